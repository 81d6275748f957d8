// SPDX-License-Identifier: MIT
// Shake: floes fly about and collide elastically until they have forgotten where they were made.
//
// It uses the project's own contact dynamics without water, friction or loss (e = 1), between closed walls (or
// periodic), around the fixed obstacles. That is a hard-particle gas: all its states at a given concentration are
// equally likely, so the field is random and not any particular construction. Every floe starts with the same energy in
// each degree of freedom, in a random direction: speed v with v² ∝ 1/area, spin v/(√2 radius of gyration); collisions
// make the velocities Maxwellian. With equal speeds, large floes would soon pass their energy to small ones, which
// would then move too far in a step. Units: v = 1 m/s for the floe of median area, mass = area.
// A step moves a floe by `stride`, the whole shake by `length` on average. Collisions need not be solved to the last
// digit: a few sweeps suffice. The overlap they leave is projected out in every step, and at rest at the end.
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
static const double LARGE = 4; // mean diameters: larger floes are kept out of the cells, which fit the rest

static void add_static(bt_world *world, int n, double *v)
{
    bt_moments moments = bt_shape_centre(n, v);
    bt_world_add(world, &(bt_body_def){.motion = BT_STATIC,
                                       .large = true,
                                       .n_vertices = n,
                                       .vertices = v,
                                       .x = moments.cx,
                                       .y = moments.cy,
                                       .restitution = 1});
}

static void add_box(bt_world *world, double x0, double x1, double y0, double y1)
{
    double v[8] = {x0, y0, x1, y0, x1, y1, x0, y1};
    add_static(world, 4, v);
}

static void add_surroundings(bt_world *world, const bt_region *region, double thick)
{
    // Walls reach past the corners, and past a periodic edge: a floe that lies across it meets the nearest image of the
    // wall.
    if (!region->periodic_x) {
        add_box(world, region->x0 - thick, region->x0, region->y0 - thick, region->y1 + thick);
        add_box(world, region->x1, region->x1 + thick, region->y0 - thick, region->y1 + thick);
    }
    if (!region->periodic_y) {
        add_box(world, region->x0 - thick, region->x1 + thick, region->y0 - thick, region->y0);
        add_box(world, region->x0 - thick, region->x1 + thick, region->y1, region->y1 + thick);
    }
    for (int k = 0; k < region->n_obstacles; k++) {
        // The world makes its own periodic images: add only the obstacle inside the region.
        const bt_obstacle *obstacle = &region->obstacles[k];
        if ((region->periodic_x && (obstacle->x < region->x0 || obstacle->x >= region->x1)) ||
            (region->periodic_y && (obstacle->y < region->y0 || obstacle->y >= region->y1)))
            continue;
        double v[2 * BT_MAX_VERTICES];
        memcpy(v, obstacle->v, 2 * (size_t)obstacle->n * sizeof *v);
        add_static(world, obstacle->n, v);
    }
}

static double median_area(const bt_field *field)
{
    double *sorted = bt_alloc((size_t)field->n, sizeof *sorted);
    memcpy(sorted, field->area, (size_t)field->n * sizeof *sorted);
    qsort(sorted, (size_t)field->n, sizeof *sorted, bt_ascending);
    const double median = sorted[field->n / 2];
    free(sorted);
    return median;
}

/// Add the floes as bodies of mass = area, each with a random heading and the same energy. size: mean diameter.
static void add_floes(bt_world *world, const bt_case *input, const bt_field *field, double size, int64_t stage)
{
    const double median = median_area(field);
    for (bt_idx i = 0; i < field->n; i++) {
        int nv = (int)(field->offsets[i + 1] - field->offsets[i]);
        const double *v = field->vertices + 2 * field->offsets[i];
        bt_moments moments = bt_shape_area_moments(nv, v);
        bt_rng rng = bt_rng_start(input->ice.seed, BT_RNG_SHAKE, stage << 32 | i);
        double speed = sqrt(median / moments.area), heading = 2 * BT_PI * bt_rng_uniform(&rng),
               spin = bt_rng_uniform(&rng) < 0.5 ? -1 : 1;
        bt_world_add(world, &(bt_body_def){
                            .motion = BT_DYNAMIC,
                            .large = field->area[i] > LARGE * LARGE * BT_PI / 4 * size * size,
                            .n_vertices = nv,
                            .vertices = v,
                            .x = field->pose[3 * i],
                            .y = field->pose[3 * i + 1],
                            .yaw = field->pose[3 * i + 2],
                            .vx = speed * bt_cos(heading),
                            .vy = speed * bt_sin(heading),
                            .yaw_rate = spin * speed * sqrt(moments.area / moments.polar / 2),
                            .mass = moments.area,
                            .inertia = moments.polar,
                            .restitution = 1,
                        });
    }
}

static void fly(bt_world *world, bt_idx n_floes, int64_t steps)
{
    double energy = 0;
    for (int64_t k = 0; k < steps; k++) {
        bt_world_step(world);
        // Collisions solved to a tolerance add a little energy; remove it, so that strides stay as asked for.
        if (k == 0) energy = world->stats.kinetic_energy;
        if (world->stats.kinetic_energy > 1.1 * energy) {
            double s = sqrt(energy / world->stats.kinetic_energy);
            for (bt_idx i = 0; i < n_floes; i++) {
                bt_vel *v = &world->bodies.vel[bt_world_index(world, i)];
                v->x *= s, v->y *= s, v->w *= s;
            }
        }
    }
}

/// Contacts are linearised in the rotation of a step: a floe that turns by θ may end θ²/2 radii inside another. At rest
/// only the position projection acts, and removes that overlap.
static void settle(bt_world *world, bt_idx n_floes)
{
    world->par.position_sweeps = REST_SWEEPS;
    for (int k = 0; k < REST_STEPS; k++) {
        for (bt_idx i = 0; i < n_floes; i++) {
            const bt_idx at = bt_world_index(world, i);
            world->bodies.vel[at] = (bt_vel){0};
            // mark it: its last move may have left an overlap, and no contacts are sought between bodies at rest
            world->bodies.disturbed[at] = 1;
        }
        bt_world_step(world);
        if (world->stats.overlap <= 3 * world->par.slop) break;
    }
}

static bt_status take_poses(const bt_world *world, const bt_case *input, const bt_region *region, bt_field *field,
                            bt_errors *err)
{
    for (bt_idx i = 0; i < field->n; i++) {
        const bt_pose *pose = &world->bodies.pose[bt_world_index(world, i)];
        if (!isfinite(pose->x) || !isfinite(pose->y) || !isfinite(pose->yaw))
            return bt_fail(err, BT_ERR_NUMERIC,
                "%s: ice field: floe %lld has no finite position after the field was shaken; report this case with its "
                "seed, and use ice.shake: 0 meanwhile",
                bt_case_name(input), (long long)i);
        field->pose[3 * i] = pose->x;
        field->pose[3 * i + 1] = pose->y;
        field->pose[3 * i + 2] = remainder(pose->yaw, 2 * BT_PI);
        bt_region_wrap(region, &field->pose[3 * i], &field->pose[3 * i + 1]);
    }
    return BT_OK;
}

bt_status bt_field_shake(const bt_case *input, const bt_region *region, bt_field *field, double length, double stride,
                         int64_t stage, bt_errors *err)
{
    if (field->n < 1 || !(length > 0) || !(stride > 0)) return BT_OK;
    double size = 0, largest = 0;
    for (bt_idx i = 0; i < field->n; i++) {
        double d = 2 * sqrt(field->area[i] / BT_PI);
        size += d / field->n;
        largest = bt_max(largest, d);
    }
    const double steps = ceil(length / stride);
    bt_params par = {
        .dt = length / steps, .x0 = region->x0, .y0 = region->y0,
        .period_x = region->periodic_x ? region->x1 - region->x0 : 0,
        .period_y = region->periodic_y ? region->y1 - region->y0 : 0, .tolerance = 5e-2, .max_sweeps = 6,
        .plain_sweeps = true, .slop = 2e-5 * size, .position_sweeps = FLIGHT_SWEEPS, .rest_speed = 0, .size = size,
    };
    bt_world *world = bt_world_create(&par);
    bt_forces_leave_added(world->forces); // the ice depends on the case alone
    add_floes(world, input, field, size, stage);
    add_surroundings(world, region, bt_max(4 * largest, size));

    // For few floes, threads that synchronise at every colour of every sweep cost more than they gain, and far more on
    // a busy machine. The result does not depend on the number of threads.
    const int threads = omp_get_max_threads();
    if (field->n < FEW) omp_set_num_threads(1);
    fly(world, field->n, (int64_t)steps);
    settle(world, field->n);
    omp_set_num_threads(threads);
    const bt_status status = take_poses(world, input, region, field, err);
    bt_world_free(world);
    return status;
}
