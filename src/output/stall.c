// SPDX-License-Identifier: MIT
// Windows in which the towed body stood still; see output/stall.h.
#include "output/stall.h"

#include "tow/tow.h"
#include "bergtow/world.h"
#include "base/elementary.h"

void bt_stall_add(bt_stall *stall, double asked, double dt, const double at[2], double ice, double pull, double path)
{
    if (!stall->begun) { // the place before the first step is not known: the window begins after it
        stall->from_x = at[0], stall->from_y = at[1];
        stall->begun = true;
        return;
    }
    if (!(asked > 0)) return; // a resting tow asks for no motion
    stall->asked += asked;
    stall->spent += dt;
    stall->ice += (isnan(ice) ? pull : ice) * dt; // not a number: more than any pull
    stall->pull += pull * dt;
    if (stall->asked < path) return;
    const double way = bt_hypot(at[0] - stall->from_x, at[1] - stall->from_y);
    if (way < BT_STALL_SHARE * stall->asked && stall->pull > 0 && stall->ice >= BT_STALL_HELD * stall->pull) {
        stall->windows++;
        stall->time += stall->spent;
    }
    stall->asked = stall->spent = stall->ice = stall->pull = 0;
    stall->from_x = at[0], stall->from_y = at[1];
}

/// Is (x, y), relative to the centroid of body i, within its outline, convex or not?
static bool within(const bt_bodies *bodies, bt_idx i, double x, double y)
{
    const double *v = bodies->outline + 2 * bodies->offset[i];
    const int64_t n = bodies->offset[i + 1] - bodies->offset[i];
    bool in = false;
    for (int64_t k = 0; k < n; k++) {
        const double *p = v + 2 * k, *q = v + 2 * ((k + 1) % n);
        if ((p[1] > y) != (q[1] > y) && x < p[0] + (y - p[1]) / (q[1] - p[1]) * (q[0] - p[0])) in = !in;
    }
    return in;
}

static void add_overtaken(bt_stall *stall, const bt_world *world)
{
    const bt_tow *tow = world->tow;
    bool fast = false;
    for (int k = 0; k < tow->n_branches; k++) fast = fast || !tow->branch[k].broken;
    if (!fast) return; // adrift
    const bool in = within(&world->bodies, bt_world_towed(world), tow->carriage_x - tow->travel_x,
                           tow->carriage_y - tow->travel_y);
    stall->outside = stall->outside || !in;
    if (!in || !stall->outside) return; // a line fastened amidships may begin inside the hull
    if (stall->inside == 0) stall->inside_from = tow->time;
    stall->inside += world->par.dt;
}

void bt_stall_step(bt_stall *stall, const bt_world *world, double ice, double pull, double path)
{
    const bt_tow *tow = world->tow;
    if (!tow || tow->mode == BT_TOW_NONE || tow->mode == BT_TOW_SPEED) return;
    add_overtaken(stall, world);
    bt_stall_add(stall, world->par.dt * bt_tow_speed(tow, tow->time), world->par.dt,
                 (const double[]){tow->travel_x, tow->travel_y}, ice, pull, path);
}
