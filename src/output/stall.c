// SPDX-License-Identifier: MIT
// Windows in which the towed body stood still; what they are: output/stall.h.
#include "output/stall.h"

#include <math.h>

#include "tow/tow.h"
#include "bergtow/world.h"
#include "base/elementary.h"

void bt_stall_add(bt_stall *s, double asked, double dt, const double at[2], double ice, double pull, double path)
{
    if (!s->begun) { // where the body was before its first step is not known: the window begins after it
        s->from_x = at[0], s->from_y = at[1];
        s->begun = true;
        return;
    }
    if (!(asked > 0)) return; // a tow that holds asks for nothing
    s->asked += asked;
    s->spent += dt;
    s->ice += (isnan(ice) ? pull : ice) * dt; // no number: beyond any pull
    s->pull += pull * dt;
    if (s->asked < path) return;
    const double way = bt_hypot(at[0] - s->from_x, at[1] - s->from_y);
    if (way < BT_STALL_SHARE * s->asked && s->pull > 0 && s->ice >= BT_STALL_HELD * s->pull) {
        s->windows++;
        s->time += s->spent;
    }
    s->asked = s->spent = s->ice = s->pull = 0;
    s->from_x = at[0], s->from_y = at[1];
}

/// Is (x, y), relative to the centroid of body i, within its outline, convex or not?
static bool within(const bt_bodies *b, bt_idx i, double x, double y)
{
    const double *v = b->outline + 2 * b->offset[i];
    const int64_t n = b->offset[i + 1] - b->offset[i];
    bool in = false;
    for (int64_t k = 0; k < n; k++) {
        const double *p = v + 2 * k, *q = v + 2 * ((k + 1) % n);
        if ((p[1] > y) != (q[1] > y) && x < p[0] + (y - p[1]) / (q[1] - p[1]) * (q[0] - p[0])) in = !in;
    }
    return in;
}

static void add_overtaken(bt_stall *s, const bt_world *w)
{
    const bt_tow *t = w->tow;
    bool fast = false;
    for (int k = 0; k < t->n_branches; k++) fast = fast || !t->branch[k].broken;
    if (!fast) return; // adrift
    const bool in = within(&w->bodies, bt_world_towed(w), t->carriage_x - t->travel_x, t->carriage_y - t->travel_y);
    s->outside = s->outside || !in;
    if (!in || !s->outside) return; // a line fastened amidships may begin within
    if (s->inside == 0) s->inside_from = t->time;
    s->inside += w->par.dt;
}

void bt_stall_step(bt_stall *s, const bt_world *w, double ice, double pull, double path)
{
    const bt_tow *t = w->tow;
    if (!t || t->mode == BT_TOW_NONE || t->mode == BT_TOW_SPEED) return;
    add_overtaken(s, w);
    bt_stall_add(s, w->par.dt * bt_tow_speed(t, t->time), w->par.dt, (const double[]){t->travel_x, t->travel_y}, ice,
                 pull, path);
}
