// SPDX-License-Identifier: MIT
// The tow from step to step: speed and path of the end, velocity of the body, way-points; equations in tow/tow.h.
#include "tow/tow.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "case/speed_law.h"
#include "tow/tow_rows.h"

void bt_tow_free(bt_tow *t)
{
    if (!t) return;
    free(t->programme);
    bt_path_free(&t->path);
    free(t);
}

double bt_tow_speed(const bt_tow *t, double time)
{
    return bt_speed_law_at(
        &(bt_speed_law){.speed = t->speed, .ramp = t->ramp, .programme = t->programme, .n = t->n_programme}, time);
}

/// Course and speed that lead from (x, y) to where the path is one step further; on the course of the path while it
/// stands still.
static void follow_path(bt_tow *t, double x, double y)
{
    double to[2], tangent[2];
    bt_path_at(&t->path, t->way + t->dt * t->end_speed, to, tangent);
    const double dx = to[0] - x, dy = to[1] - y, far = sqrt(dx * dx + dy * dy);
    const bool moves = t->end_speed > 0 && far > 0;
    t->ux = moves ? dx / far : tangent[0];
    t->uy = moves ? dy / far : tangent[1];
    t->end_speed = moves ? far / t->dt : 0;
}

void bt_tow_lead(bt_world *w)
{
    bt_tow *t = w->tow;
    if (!t || w->towed < 0) return;
    t->end_speed = bt_tow_speed(t, t->time + t->dt);
    if (t->mode != BT_TOW_SPEED) return;
    bt_bodies *b = &w->bodies;
    const bt_idx i = bt_world_towed(w);
    if (t->path.n > 0) follow_path(t, t->travel_x, t->travel_y);
    b->vel_start[i] = b->vel[i];
    b->vel[i] = b->vel_free[i] = (bt_vel){.x = t->end_speed * t->ux, .y = t->end_speed * t->uy};
}

void bt_tow_begin(bt_world *w)
{
    bt_tow *t = w->tow;
    if (!t || w->towed < 0) return;
    if (t->mode == BT_TOW_LINE) {
        if (t->path.n > 0) follow_path(t, t->carriage_x, t->carriage_y);
        bt_tow_begin_rows(w);
    } else if (t->mode == BT_TOW_THRUST) {
        bt_tow_begin_vessel(w);
        bt_tow_begin_rows(w);
    }
}

static void break_branches(bt_world *w, double time)
{
    bt_tow *t = w->tow;
    int left = 0, broke = 0;
    for (int k = 0; k < t->n_branches; k++) {
        bt_branch *b = &t->branch[k];
        if (b->broken) continue;
        const double tension = bt_tow_tension(t, k);
        if (b->breaking > 0 && tension > b->breaking) {
            b->broken = true;
            broke++;
            bt_events_add(&w->events, time, BT_EVENT_LINE_BROKEN, k + 1, tension);
        } else {
            left++;
        }
    }
    if (broke == 0 || left > 0) return;
    const bt_vel *v = &w->bodies.vel[bt_world_towed(w)];
    bt_events_add(&w->events, time, BT_EVENT_ADRIFT, 0, sqrt(v->x * v->x + v->y * v->y));
}

void bt_tow_advance(bt_world *w)
{
    bt_tow *t = w->tow;
    if (!t) return;
    const double dt = t->dt, end = (double)(w->step + 1) * dt, speed = bt_tow_speed(t, t->time + dt);
    t->way += dt * speed;
    double led = t->way;
    if (t->mode == BT_TOW_THRUST) {
        bt_tow_finish_vessel(t);
        t->carriage_x += dt * t->vessel.vx;
        t->carriage_y += dt * t->vessel.vy;
        const double near = bt_path_near(&t->path, t->vessel.way, t->carriage_x, t->carriage_y);
        led = t->vessel.way = bt_max(near, t->vessel.way + BT_VESSEL_WAY * dt * bt_max(0, t->vessel.vd2));
    } else if (t->path.n > 0) {
        double at[2], tangent[2];
        bt_path_at(&t->path, t->way, at, tangent);
        t->carriage_x = at[0];
        t->carriage_y = at[1];
    } else {
        t->carriage_x += dt * speed * t->ux;
        t->carriage_y += dt * speed * t->uy;
    }
    while (t->mark < t->path.n_marks && led >= t->path.mark[t->mark] * (1 - 1e-12)) {
        t->mark++;
        bt_events_add(&w->events, end, BT_EVENT_WAYPOINT, t->mark, t->path.mark[t->mark - 1]);
    }
    if (bt_tow_has_line(t)) break_branches(w, end);
    t->time = end;
}

static uint64_t mix(uint64_t h, double x)
{
    uint64_t u;
    memcpy(&u, &x, sizeof u);
    h = (h ^ u) * 0x9e3779b97f4a7c15u;
    return h ^ h >> 29;
}

uint64_t bt_tow_hash(const bt_tow *t)
{
    const double state[] = {t->time, t->carriage_x, t->carriage_y, t->branch[0].lambda, t->travel_x, t->travel_y};
    uint64_t h = 0;
    for (size_t k = 0; k < sizeof state / sizeof *state; k++) h = mix(h, state[k]);
    // What a tow by one line on a straight path has not.
    if (t->n_branches > 1) h = mix(h, t->branch[1].lambda);
    for (int k = 0; k < t->n_branches; k++)
        if (t->branch[k].broken) h = mix(h, k + 1);
    if (t->path.n > 0) h = mix(mix(h, t->way), t->mark);
    if (t->mode == BT_TOW_THRUST) h = mix(mix(mix(h, t->vessel.vx), t->vessel.vy), t->vessel.way);
    return h;
}
