// SPDX-License-Identifier: MIT
// Worlds for the programs of this folder that run on several ranks: squares of 0.8 m.
#ifndef BERGTOW_TESTS_SQUARES_H
#define BERGTOW_TESTS_SQUARES_H

#include "bergtow/world.h"

/// A world for floes of about 1 m, Δt 0.1 s.
static inline bt_world *squares_world(void)
{
    const bt_params p = {.dt = 0.1, .tolerance = 1e-6, .max_sweeps = 100, .warm_start = true, .slop = 1e-3,
                         .position_sweeps = 50, .rest_speed = 1e-3, .size = 1};
    return bt_world_create(&p);
}

/// 50 kg without drag.
static inline bt_body_def square_at(double x, double y)
{
    static double v[8] = {-0.4, -0.4, 0.4, -0.4, 0.4, 0.4, -0.4, 0.4};
    return (bt_body_def){
        .motion = BT_DYNAMIC, .n_vertices = 4, .vertices = v, .x = x, .y = y, .mass = 50, .inertia = 6};
}

#endif
