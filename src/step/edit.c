// SPDX-License-Identifier: MIT
// Bodies that a program changes by hand between two steps; see edit.h.
//
// Resting cells and stored pairs and speeds rely on bodies moving only in steps. So labels and cells are made anew
// before the next step, as when a moving window renews floes (window.c), and the body counts as disturbed.
#include "step/edit.h"

#include <math.h>
#include <stdlib.h>

#include "body/bodies.h"
#include "partition/domain.h"
#include "space/cells.h"
#include "step/window.h"
#include "tow/tow.h"
#include "base/elementary.h"

/// May a program change this body? The answer is the same on all ranks, though they hold different bodies.
static bool may_change(const bt_world *world, bt_gid gid, const double x[3], bt_errors *err)
{
    const bt_bodies *bodies = &world->bodies;
    const long long id = (long long)gid;
    if (gid < 0 || gid >= bodies->n_global) {
        bt_errors_add(err, "body %lld: does not exist; ids are 0 to %lld", id, (long long)bodies->n_global - 1);
        return false;
    }
    if (bodies->gone[gid]) {
        bt_errors_add(err, "body %lld: is a floe that has split, or a piece that is not there yet; change another body",
                      id);
        return false;
    }
    const bt_idx i = bodies->index_of[gid];
    double led = i >= 0 && bodies->motion[i] != BT_DYNAMIC;
    bt_domain_maxima(world, &led, 1);
    if (led > 0) bt_errors_add(err, "body %lld: its motion is prescribed by the case; change another body", id);
    const bool finite = isfinite(x[0]) && isfinite(x[1]) && isfinite(x[2]);
    if (!finite) bt_errors_add(err, "body %lld: %g, %g, %g are not all finite numbers", id, x[0], x[1], x[2]);
    return finite && !(led > 0);
}

static void stir(bt_world *world, bt_idx i)
{
    if (i >= 0) world->bodies.disturbed[i] = 1;
    world->cells->relabel = true;
}

bt_status bt_edit_velocity(bt_world *world, bt_gid gid, const double v[3], bt_errors *err)
{
    if (!may_change(world, gid, v, err)) return BT_ERR_USAGE;
    const bt_idx i = bt_world_index(world, gid);
    if (i >= 0) {
        // the difference, the change by contacts, stays
        bt_vel *u = &world->bodies.vel[i], *free = &world->bodies.vel_free[i];
        free->x = v[0] - (u->x - free->x);
        free->y = v[1] - (u->y - free->y);
        *u = (bt_vel){.x = v[0], .y = v[1], .w = v[2]};
    }
    stir(world, i);
    return BT_OK;
}

/// Put body i, if this rank holds it, at a pose. A place outside the domain is wrapped, and the periods are counted as
/// if travelled; a floe of a moving window counts as placed inside the window.
static void put(bt_world *world, bt_idx i, const double to[3])
{
    bt_bodies *bodies = &world->bodies;
    if (i < 0) return;
    bt_pose *pose = &bodies->pose[i];
    if (world->tow && i == bt_world_towed(world)) {
        world->tow->travel_x += to[0] - pose->x;
        world->tow->travel_y += to[1] - pose->y;
    }
    int32_t across = 0;
    pose->x = bt_into_period(to[0], world->par.x0, world->par.period_x, &bodies->lap[i]);
    pose->y = bt_into_period(to[1], world->par.y0, world->par.period_y, &across);
    pose->yaw = to[2];
    bt_bodies_turn(bodies, i);
    if (world->window && bodies->gid[i] < world->window->n_floes) bodies->lap[i] = bt_window_lap(world, pose->x);
}

/// Collective. Id of a body that body gid would overlap by more than the slop at pose `to`; −1 = none. The rank that
/// owns gid sends its outline to all, as no rank need hold both bodies.
static double obstacle_at(const bt_world *world, bt_gid gid, const double to[3])
{
    const bt_bodies *bodies = &world->bodies;
    const bt_idx i = bt_world_index(world, gid);
    const size_t own = i >= 0 && bt_domain_owns(world, i) ? (size_t)(bodies->offset[i + 1] - bodies->offset[i]) : 0;
    double *turned = bt_alloc(2 * own, sizeof *turned), s, c, radius = 0;
    bt_sincos(to[2], &s, &c);
    for (size_t k = 0; k < own; k++) {
        const double *v = bodies->vertices + 2 * ((size_t)bodies->offset[i] + k);
        turned[2 * k] = c * v[0] - s * v[1];
        turned[2 * k + 1] = s * v[0] + c * v[1];
    }
    size_t n;
    double *vertex = bt_domain_gather_all(world, turned, own, 2 * sizeof *turned, &n);
    bt_mark *mark = bt_domain_gather_all(world, own ? bodies->mark + bodies->offset[i] : NULL, own, sizeof *mark, &n);
    for (size_t k = 0; k < n; k++) radius = bt_max(radius, bt_hypot(vertex[2 * k], vertex[2 * k + 1]));
    double found = -1;
    for (bt_idx j = 0; j < bodies->n; j++) {
        double d[2] = {bodies->pose[j].x - to[0], bodies->pose[j].y - to[1]};
        if (world->par.period_x > 0) d[0] -= world->par.period_x * nearbyint(d[0] / world->par.period_x);
        if (world->par.period_y > 0) d[1] -= world->par.period_y * nearbyint(d[1] / world->par.period_y);
        if (bodies->gid[j] == gid || bt_hypot(d[0], d[1]) > radius + bodies->radius[j]) continue;
        if (bt_bodies_depth(bodies, j, mark, vertex, (int64_t)n, d[0], d[1]) > world->par.slop)
            found = bt_max(found, (double)bodies->gid[j]);
    }
    free(turned);
    free(vertex);
    free(mark);
    bt_domain_maxima(world, &found, 1);
    return found;
}

bt_status bt_edit_place(bt_world *world, bt_gid gid, const double to[3], bt_errors *err)
{
    const long long id = (long long)gid;
    if (!may_change(world, gid, to, err)) return BT_ERR_USAGE;
    if (gid == world->towed && world->tow && world->tow->mode != BT_TOW_NONE)
        return bt_fail(err, BT_ERR_USAGE,
                       "body %lld: is towed, and its line or course begins where it is; move it by body.x, body.y", id);
    const double obstacle = obstacle_at(world, gid, to);
    if (obstacle >= 0)
        return bt_fail(err, BT_ERR_USAGE,
                       "body %lld: would lie over body %lld there; choose a free place", id, (long long)obstacle);
    const bt_idx i = bt_world_index(world, gid);
    put(world, i, to);
    stir(world, i);
    return BT_OK;
}
