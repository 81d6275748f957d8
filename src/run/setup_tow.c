// SPDX-License-Identifier: MIT
// Builds the tow of a case: programme, path, branches, vessel.
#include "run/setup.h"

#include <math.h>
#include <string.h>

#include "case/case_tow.h"
#include "base/elementary.h"

bt_tow *bt_setup_tow(const bt_case *c)
{
    bt_tow *t = bt_alloc(1, sizeof *t);
    const bool thrust = c->tow.mode == BT_TOW_THRUST, line = thrust || c->tow.mode == BT_TOW_LINE;
    double start[2];
    bt_case_tow_start(c, start);
    *t = (bt_tow){
        .mode = c->tow.mode,
        .ux = bt_cos(c->tow.direction),
        .uy = bt_sin(c->tow.direction),
        .speed = c->tow.speed,
        .ramp = c->tow.ramp,
        .n_branches = line ? (int)c->tow.line.branches : 0,
        .branch[0] = {.length0 = c->tow.line_length,
                      .k = line ? c->tow.line_stiffness / c->tow.line_length : 0,
                      .c = c->tow.line_damping,
                      .hull_x = c->tow.hull_x,
                      .hull_y = c->tow.hull_y,
                      .breaking = c->tow.line.breaking_load,
                      .weight = c->tow.line.weight},
        .dt = c->run.dt,
        .carriage_x = start[0],
        .carriage_y = start[1],
        .travel_x = c->body.x,
        .travel_y = c->body.y,
    };
    if (t->n_branches > 1)
        t->branch[1] = (bt_branch){.length0 = c->tow.branch2.length,
                                   .k = c->tow.branch2.stiffness / c->tow.branch2.length,
                                   .c = c->tow.branch2.damping,
                                   .hull_x = c->tow.branch2.hull_x,
                                   .hull_y = c->tow.branch2.hull_y,
                                   .breaking = c->tow.branch2.breaking_load,
                                   .weight = c->tow.line.weight};
    if (c->tow.n_programme > 0) {
        t->n_programme = c->tow.n_programme;
        t->programme = bt_alloc((size_t)t->n_programme, 2 * sizeof *t->programme);
        memcpy(t->programme, c->tow.programme, (size_t)t->n_programme * 2 * sizeof *t->programme);
    }
    char why[200];
    // Straight on needs no path, but for the vessel, which has to find its place on it.
    if (c->tow.n_waypoints > 0 || thrust) bt_case_tow_path(c, &t->path, why);
    if (thrust) {
        const double speed = bt_tow_speed(t, 0);
        t->vessel = (bt_vessel){.mass = c->tow.vessel.mass * (1 + c->tow.vessel.added_mass),
                                .bollard_pull = c->tow.vessel.bollard_pull,
                                .free_speed = c->tow.vessel.free_speed,
                                .free_resistance = c->tow.vessel.free_resistance,
                                .lateral = c->tow.vessel.lateral_drag,
                                .lookahead = c->tow.vessel.lookahead,
                                .vx = speed * t->ux,
                                .vy = speed * t->uy};
    }
    return t;
}

void bt_setup_tow_displacement(const bt_case *c, const bt_tow *t, double way, double d[2])
{
    d[0] = way * bt_cos(c->tow.direction);
    d[1] = way * bt_sin(c->tow.direction);
    if (t->path.n == 0) return;
    double start[2], tangent[2];
    bt_path_at(&t->path, 0, start, tangent);
    bt_path_at(&t->path, way, d, tangent);
    d[0] -= start[0];
    d[1] -= start[1];
}
