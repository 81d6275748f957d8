// SPDX-License-Identifier: MIT
// Builds the tow of a case: programme, path, branches, vessel.
#include "run/setup.h"

#include <math.h>
#include <string.h>

#include "case/case_tow.h"
#include "base/elementary.h"

bt_tow *bt_setup_tow(const bt_case *input)
{
    bt_tow *tow = bt_alloc(1, sizeof *tow);
    const bool thrust = input->tow.mode == BT_TOW_THRUST, line = thrust || input->tow.mode == BT_TOW_LINE;
    double start[2];
    bt_case_tow_start(input, start);
    *tow = (bt_tow){
        .mode = input->tow.mode,
        .ux = bt_cos(input->tow.direction),
        .uy = bt_sin(input->tow.direction),
        .speed = input->tow.speed,
        .ramp = input->tow.ramp,
        .n_branches = line ? (int)input->tow.line.branches : 0,
        .branch[0] = {.length0 = input->tow.line_length,
                      .k = line ? input->tow.line_stiffness / input->tow.line_length : 0,
                      .c = input->tow.line_damping,
                      .hull_x = input->tow.hull_x,
                      .hull_y = input->tow.hull_y,
                      .breaking = input->tow.line.breaking_load,
                      .weight = input->tow.line.weight},
        .dt = input->run.dt,
        .carriage_x = start[0],
        .carriage_y = start[1],
        .travel_x = input->body.x,
        .travel_y = input->body.y,
    };
    if (tow->n_branches > 1)
        tow->branch[1] = (bt_branch){.length0 = input->tow.branch2.length,
                                     .k = input->tow.branch2.stiffness / input->tow.branch2.length,
                                     .c = input->tow.branch2.damping,
                                     .hull_x = input->tow.branch2.hull_x,
                                     .hull_y = input->tow.branch2.hull_y,
                                     .breaking = input->tow.branch2.breaking_load,
                                     .weight = input->tow.line.weight};
    if (input->tow.n_programme > 0) {
        tow->n_programme = input->tow.n_programme;
        tow->programme = bt_alloc((size_t)tow->n_programme, 2 * sizeof *tow->programme);
        memcpy(tow->programme, input->tow.programme, (size_t)tow->n_programme * 2 * sizeof *tow->programme);
    }
    char why[200];
    // Straight on needs no path, but for the vessel, which has to find its place on it.
    if (input->tow.n_waypoints > 0 || thrust) bt_case_tow_path(input, &tow->path, why);
    if (thrust) {
        const double speed = bt_tow_speed(tow, 0);
        tow->vessel = (bt_vessel){.mass = input->tow.vessel.mass * (1 + input->tow.vessel.added_mass),
                                  .bollard_pull = input->tow.vessel.bollard_pull,
                                  .free_speed = input->tow.vessel.free_speed,
                                  .free_resistance = input->tow.vessel.free_resistance,
                                  .lateral = input->tow.vessel.lateral_drag,
                                  .lookahead = input->tow.vessel.lookahead,
                                  .vx = speed * tow->ux,
                                  .vy = speed * tow->uy};
    }
    return tow;
}

void bt_setup_tow_displacement(const bt_case *input, const bt_tow *tow, double way, double d[2])
{
    d[0] = way * bt_cos(input->tow.direction);
    d[1] = way * bt_sin(input->tow.direction);
    if (tow->path.n == 0) return;
    double start[2], tangent[2];
    bt_path_at(&tow->path, 0, start, tangent);
    bt_path_at(&tow->path, way, d, tangent);
    d[0] -= start[0];
    d[1] -= start[1];
}
