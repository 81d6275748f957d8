// SPDX-License-Identifier: MIT
// Shake: floes fly about and collide elastically until the place they were made in is forgotten.
//
// The project's own contact dynamics without water, friction or loss (e = 1), in closed walls (or periodic), around the
// fixed obstacles: the hard-particle gas, whose states at given concentration are all equally likely, so the field is
// random without being any particular construction. Every floe starts with the same energy in each of its freedoms, in
// a random direction: speed v with v² ∝ 1/area, spin v/(√2 radius of gyration); collisions make the velocities
// Maxwellian. Equal speeds instead would soon hand the energy of large floes to small ones, which then outrun the step.
// Units: v = 1 m/s for the floe of median area, mass = area.
// A step moves a floe by `stride`, the whole shake by `length` on average. Collisions need not be solved to the last
// digit: a few sweeps do, and what overlap that leaves is pushed out as it comes, and at rest at the end.
#include <math.h>
#include <omp.h>
#include <stdlib.h>
#include <string.h>

#include "bergtow/world.h"
#include "field/field_make.h"
#include "force/forces.h"
#include "base/inside.h"
#include "base/elementary.h"
#include "base/rng.h"

enum { FLIGHT_SWEEPS = 6, REST_SWEEPS = 60, REST_STEPS = 40, FEW = 4000 };
static const double LARGE = 4; // floes of more than this many mean diameters are in no cell: cells fit the rest

static void add_static(bt_world *w, int n, double *v)
{
    bt_moments m = bt_shape_centre(n, v);
    bt_world_add(w, &(bt_body_def){.motion = BT_STATIC,
                                   .large = true,
                                   .n_vertices = n,
                                   .vertices = v,
                                   .x = m.cx,
                                   .y = m.cy,
                                   .mass = 1,
                                   .inertia = 1,
                                   .restitution = 1});
}

static void add_box(bt_world *w, double x0, double x1, double y0, double y1)
{
    double v[8] = {x0, y0, x1, y0, x1, y1, x0, y1};
    add_static(w, 4, v);
}

static void add_surroundings(bt_world *w, const bt_region *y, double thick)
{
    // Walls reach past the corners, and past a periodic edge: a floe that lies across it meets the nearest image of the
    // wall.
    if (!y->periodic_x) {
        add_box(w, y->x0 - thick, y->x0, y->y0 - thick, y->y1 + thick);
        add_box(w, y->x1, y->x1 + thick, y->y0 - thick, y->y1 + thick);
    }
    if (!y->periodic_y) {
        add_box(w, y->x0 - thick, y->x1 + thick, y->y0 - thick, y->y0);
        add_box(w, y->x0 - thick, y->x1 + thick, y->y1, y->y1 + thick);
    }
    for (int k = 0; k < y->n_obstacles; k++) {
        // The world makes its own periodic images: only the one at home is a body.
        const bt_obstacle *o = &y->obstacles[k];
        if ((y->periodic_x && (o->x < y->x0 || o->x >= y->x1)) || (y->periodic_y && (o->y < y->y0 || o->y >= y->y1)))
            continue;
        double v[2 * BT_MAX_VERTICES];
        memcpy(v, o->v, 2 * (size_t)o->n * sizeof *v);
        add_static(w, o->n, v);
    }
}

static double median_area(const bt_field *f)
{
    double *sorted = bt_alloc((size_t)f->n, sizeof *sorted);
    memcpy(sorted, f->area, (size_t)f->n * sizeof *sorted);
    qsort(sorted, (size_t)f->n, sizeof *sorted, bt_ascending);
    const double median = sorted[f->n / 2];
    free(sorted);
    return median;
}

/// The floes as bodies of mass = area, each with a random heading and as much energy as any other. size: their mean.
static void add_floes(bt_world *w, const bt_case *c, const bt_field *f, double size, int64_t stage)
{
    const double median = median_area(f);
    for (bt_idx i = 0; i < f->n; i++) {
        int nv = (int)(f->offsets[i + 1] - f->offsets[i]);
        const double *v = f->vertices + 2 * f->offsets[i];
        bt_moments m = bt_shape_extent(nv, v);
        bt_rng r = bt_rng_start(c->ice.seed, BT_RNG_SHAKE, stage << 32 | i);
        double speed = sqrt(median / m.area), heading = 2 * BT_PI * bt_rng_uniform(&r),
               spin = bt_rng_uniform(&r) < 0.5 ? -1 : 1;
        bt_world_add(w, &(bt_body_def){
                            .motion = BT_DYNAMIC,
                            .large = f->area[i] > LARGE * LARGE * BT_PI / 4 * size * size,
                            .n_vertices = nv,
                            .vertices = v,
                            .x = f->pose[3 * i],
                            .y = f->pose[3 * i + 1],
                            .yaw = f->pose[3 * i + 2],
                            .vx = speed * bt_cos(heading),
                            .vy = speed * bt_sin(heading),
                            .yaw_rate = spin * speed * sqrt(m.area / m.polar / 2),
                            .mass = m.area,
                            .inertia = m.polar,
                            .restitution = 1,
                        });
    }
}

static void fly(bt_world *w, bt_idx n_floes, int64_t steps)
{
    double energy = 0;
    for (int64_t k = 0; k < steps; k++) {
        bt_world_step(w);
        // Collisions solved to a tolerance gain a little energy: taken out, so that strides stay as asked.
        if (k == 0) energy = w->stats.kinetic_energy;
        if (w->stats.kinetic_energy > 1.1 * energy) {
            double s = sqrt(energy / w->stats.kinetic_energy);
            for (bt_idx i = 0; i < n_floes; i++) {
                bt_vel *v = &w->bodies.vel[bt_world_index(w, i)];
                v->x *= s, v->y *= s, v->w *= s;
            }
        }
    }
}

/// Contacts are linear in the turn of a step: a floe that turns by θ may end θ²/2 radii inside another. At rest the
/// position projection alone acts, and takes that out.
static void settle(bt_world *w, bt_idx n_floes)
{
    w->par.position_sweeps = REST_SWEEPS;
    for (int k = 0; k < REST_STEPS; k++) {
        for (bt_idx i = 0; i < n_floes; i++) {
            const bt_idx at = bt_world_index(w, i);
            w->bodies.vel[at] = (bt_vel){0};
            // stopped by hand: its last move may have left an overlap that nothing at rest would be looked at for
            w->bodies.disturbed[at] = 1;
        }
        bt_world_step(w);
        if (w->stats.overlap <= 3 * w->par.slop) break;
    }
}

static bt_status take_poses(const bt_world *w, const bt_case *c, const bt_region *y, bt_field *f, bt_errors *err)
{
    for (bt_idx i = 0; i < f->n; i++) {
        const bt_pose *p = &w->bodies.pose[bt_world_index(w, i)];
        if (!isfinite(p->x) || !isfinite(p->y) || !isfinite(p->yaw)) {
            bt_errors_add(
                err,
                "%s: ice field: floe %lld left the numbers while the field was shaken; report this case with its seed, "
                "and use ice.shake: 0 meanwhile",
                c->path ? c->path : "case", (long long)i);
            return BT_ERR_NUMERIC;
        }
        f->pose[3 * i] = p->x;
        f->pose[3 * i + 1] = p->y;
        f->pose[3 * i + 2] = remainder(p->yaw, 2 * BT_PI);
        bt_region_wrap(y, &f->pose[3 * i], &f->pose[3 * i + 1]);
    }
    return BT_OK;
}

bt_status bt_field_shake(const bt_case *c, const bt_region *y, bt_field *f, double length, double stride, int64_t stage,
                         bt_errors *err)
{
    if (f->n < 1 || !(length > 0) || !(stride > 0)) return BT_OK;
    double size = 0, largest = 0;
    for (bt_idx i = 0; i < f->n; i++) {
        double d = 2 * sqrt(f->area[i] / BT_PI);
        size += d / f->n;
        largest = bt_max(largest, d);
    }
    const double steps = ceil(length / stride);
    bt_params par = {
        .dt = length / steps, .x0 = y->x0, .y0 = y->y0,
        .period_x = y->periodic_x ? y->x1 - y->x0 : 0, .period_y = y->periodic_y ? y->y1 - y->y0 : 0,
        .tolerance = 5e-2, .max_sweeps = 6, .plain_sweeps = true, .slop = 2e-5 * size, .position_sweeps = FLIGHT_SWEEPS,
        .rest_speed = 0, .size = size,
    };
    bt_world *w = bt_world_create(&par);
    bt_forces_leave_added(w->forces); // the ice follows from the case alone
    add_floes(w, c, f, size, stage);
    add_surroundings(w, y, bt_max(4 * largest, size));

    // Threads that meet at every colour of every sweep cost more than they bring for few floes, and very much more on a
    // busy machine. The result does not depend on their number.
    const int threads = omp_get_max_threads();
    if (f->n < FEW) omp_set_num_threads(1);
    fly(w, f->n, (int64_t)steps);
    settle(w, f->n);
    omp_set_num_threads(threads);
    const bt_status status = take_poses(w, c, y, f, err);
    bt_world_free(w);
    return status;
}
