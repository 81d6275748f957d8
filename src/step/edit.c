// SPDX-License-Identifier: MIT
// Bodies that a program changes by hand between two steps; see edit.h.
//
// Cells rest, keep pairs and speeds on the ground that bodies move by steps alone. So labels and cells are made anew
// before the next step, as when a moving window puts floes elsewhere (window.c), and the body counts as disturbed.
#include "step/edit.h"

#include <math.h>

#include "body/bodies.h"
#include "contact/contacts.h"
#include "partition/domain.h"
#include "space/cells.h"
#include "step/window.h"
#include "tow/tow.h"
#include "base/elementary.h"

/// Is it a body that a program may change? The answer is the same on all ranks, which hold bodies of their own.
static bool may_change(const bt_world *w, bt_gid gid, const double x[3], bt_errors *err)
{
    const bt_bodies *b = &w->bodies;
    const long long id = (long long)gid;
    if (gid < 0 || gid >= b->n_global) {
        bt_errors_add(err, "body %lld: there is none; ids are 0 to %lld", id, (long long)b->n_global - 1);
        return false;
    }
    const bt_idx i = b->index_of[gid];
    double led = i >= 0 && b->motion[i] != BT_DYNAMIC;
    bt_domain_maxima(w, &led, 1);
    if (led > 0) bt_errors_add(err, "body %lld: its motion is prescribed by the case; change another body", id);
    const bool finite = isfinite(x[0]) && isfinite(x[1]) && isfinite(x[2]);
    if (!finite) bt_errors_add(err, "body %lld: %g, %g, %g are not all finite numbers", id, x[0], x[1], x[2]);
    return finite && !(led > 0);
}

static void stir(bt_world *w, bt_idx i)
{
    if (i >= 0) w->bodies.disturbed[i] = 1;
    w->cells->relabel = true;
}

bt_status bt_edit_velocity(bt_world *w, bt_gid gid, const double v[3], bt_errors *err)
{
    if (!may_change(w, gid, v, err)) return BT_ERR_USAGE;
    const bt_idx i = bt_world_index(w, gid);
    if (i >= 0) {
        // what contacts did to it stays in the difference
        bt_vel *u = &w->bodies.vel[i], *free = &w->bodies.vel_free[i];
        free->x = v[0] - (u->x - free->x);
        free->y = v[1] - (u->y - free->y);
        *u = (bt_vel){.x = v[0], .y = v[1], .w = v[2]};
    }
    stir(w, i);
    return BT_OK;
}

static void put(bt_bodies *b, bt_idx i, double x, double y, double yaw)
{
    b->pose[i].x = x, b->pose[i].y = y, b->pose[i].yaw = yaw;
    bt_bodies_turn(b, i);
}

/// What counts the periods that a body has gone by: it has been put into the window, and elsewhere by as much as it was
/// moved.
static void unwrap(bt_world *w, bt_idx i, const bt_pose *was)
{
    const bt_pose *p = &w->bodies.pose[i];
    if (w->window && w->bodies.gid[i] < w->window->n_floes)
        w->bodies.home[i].lap = bt_window_lap(w, p->x);
    if (!w->tow || i != bt_world_towed(w)) return;
    w->tow->travel_x += p->x - was->x;
    w->tow->travel_y += p->y - was->y;
}

/// Id of a body that body i overlaps by more than is left alone, −1 = none: of those that this rank holds.
static double obstacle_of(const bt_world *w, bt_idx i)
{
    const bt_bodies *b = &w->bodies;
    for (bt_idx j = 0; j < b->n; j++) {
        double d[2];
        bt_bodies_offset(w, i, j, d);
        if (j == i || bt_hypot(d[0], d[1]) > b->radius[i] + b->radius[j]) continue;
        const bool first = b->gid[i] < b->gid[j];
        const bt_idx one = first ? i : j, other = first ? j : i;
        for (int p = bt_part_first(b, one); p >= 0; p = bt_part_next(b, one, p))
            for (int q = bt_part_first(b, other); q >= 0; q = bt_part_next(b, other, q)) {
                bt_manifold m;
                double gap = INFINITY;
                int32_t axis = -1;
                const uint16_t part[2] = {(uint16_t)p, (uint16_t)q};
                bt_contacts_parts(w, one, other, part, 0, -1, &m, &gap, &axis);
                if (gap < -w->par.slop) return (double)b->gid[j];
            }
    }
    return -1;
}

bt_status bt_edit_place(bt_world *w, bt_gid gid, const double to[3], bt_errors *err)
{
    const long long id = (long long)gid;
    if (!may_change(w, gid, to, err)) return BT_ERR_USAGE;
    if (gid == w->towed && w->tow && w->tow->mode != BT_TOW_NONE) {
        bt_errors_add(err, "body %lld: is towed, and its line or course begins where it is; move it by body.x, body.y",
                      id);
        return BT_ERR_USAGE;
    }
    const bt_idx i = bt_world_index(w, gid);
    bt_pose was = {0};
    double obstacle = -1;
    if (i >= 0) {
        was = w->bodies.pose[i];
        put(&w->bodies, i, to[0], to[1], to[2]);
        obstacle = obstacle_of(w, i);
    }
    bt_domain_maxima(w, &obstacle, 1); // not every rank that has the body has what it would lie over
    if (i >= 0 && obstacle >= 0) put(&w->bodies, i, was.x, was.y, was.yaw);
    else if (i >= 0) unwrap(w, i, &was);
    if (obstacle >= 0) {
        bt_errors_add(err, "body %lld: would lie over body %lld there; choose a free place", id, (long long)obstacle);
        return BT_ERR_USAGE;
    }
    stir(w, i);
    return BT_OK;
}
