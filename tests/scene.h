// SPDX-License-Identifier: MIT
// Small worlds for tests: bodies by hand, walls, a tow; nothing here computes what a test checks.
#ifndef BERGTOW_TESTS_SCENE_H
#define BERGTOW_TESTS_SCENE_H

#include "test.h"
#include "contact/contacts.h"
#include "law_number.h"
#include "space/cells.h"
#include "bergtow/forces.h"
#include "bergtow/shape.h"
#include "solve/solver.h"
#include "tow/tow.h"
#include "bergtow/world.h"

static inline bt_params scene_params(double dt, double size)
{
    return (bt_params){.dt = dt, .tolerance = 1e-10, .max_sweeps = 20000, .warm_start = true, .slop = 1e-6 * size,
                       .position_sweeps = 100, .rest_speed = 1e-6, .size = size};
}

/// A dynamic prism of `sheet` kg/m² with the outline v (centred here).
static inline bt_body_def scene_prism(int n, double *v, double sheet)
{
    bt_shape_centre(n, v);
    const bt_moments m = bt_shape_moments(n, v);
    return (bt_body_def){
        .motion = BT_DYNAMIC, .n_vertices = n, .vertices = v, .mass = sheet * m.area, .inertia = sheet * m.polar};
}

/// Square of side l.
static inline void scene_square(double l, double v[8])
{
    const double h = 0.5 * l, w[8] = {-h, -h, h, -h, h, h, -h, h};
    memcpy(v, w, sizeof w);
}

/// A static slab.
static inline bt_idx scene_wall(bt_world *w, double x0, double y0, double x1, double y1, double friction)
{
    double v[8] = {x0, y0, x1, y0, x1, y1, x0, y1};
    bt_shape_centre(4, v);
    bt_body_def d = {.motion = BT_STATIC, .large = true, .n_vertices = 4, .vertices = v, .x = 0.5 * (x0 + x1),
                     .y = 0.5 * (y0 + y1), .friction = friction};
    return bt_world_add(w, &d);
}

static inline double scene_uniform(uint64_t *state)
{
    *state = *state * 6364136223846793005u + 1442695040888963407u;
    return (double)(*state >> 11) * 0x1p-53;
}

/// A random convex polygon: hull of points on an ellipse of mean radius r.
static inline int scene_random_polygon(uint64_t *state, double r, double *v)
{
    int n = 3 + (int)(6 * scene_uniform(state));
    double stretch = 0.6 + 0.8 * scene_uniform(state);
    for (int k = 0; k < n; k++) {
        double a = 2 * BT_PI * (k + 0.7 * scene_uniform(state)) / n;
        v[2 * k] = r * stretch * cos(a);
        v[2 * k + 1] = r / stretch * sin(a);
    }
    n = bt_shape_hull(n, v);
    bt_shape_centre(n, v);
    return n;
}

#define CHECK_CLOSE(got, want, tolerance)                                                                             \
    do {                                                                                                              \
        double got_ = (got), want_ = (want), tol_ = (tolerance);                                                      \
        if (!(fabs(got_ - want_) <= tol_))                                                                            \
            fail_msg("%s = %.12g, expected %s = %.12g within %.3g", #got, got_, #want, want_, tol_);                  \
    } while (0)

#endif
