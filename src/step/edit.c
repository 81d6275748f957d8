// SPDX-License-Identifier: MIT
// Bodies that a program changes by hand between two steps; see edit.h.
//
// Cells rest, keep pairs and speeds on the ground that bodies move by steps alone. So labels and cells are made anew
// before the next step, as when a moving window puts floes elsewhere (window.c), and the body counts as disturbed.
#include "step/edit.h"

#include <math.h>
#include <stdlib.h>

#include "body/bodies.h"
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

/// Put body i, if this rank holds it, to a place. The periods that this lies from the domain are taken off, and counted
/// as those are by which it has gone; a floe of a moving window has been put into the window.
static void put(bt_world *w, bt_idx i, const double to[3])
{
    bt_bodies *b = &w->bodies;
    if (i < 0) return;
    bt_pose *p = &b->pose[i];
    if (w->tow && i == bt_world_towed(w)) {
        w->tow->travel_x += to[0] - p->x;
        w->tow->travel_y += to[1] - p->y;
    }
    int32_t across = 0;
    p->x = bt_into_period(to[0], w->par.x0, w->par.period_x, &b->lap[i]);
    p->y = bt_into_period(to[1], w->par.y0, w->par.period_y, &across);
    p->yaw = to[2];
    bt_bodies_turn(b, i);
    if (w->window && b->gid[i] < w->window->n_floes) b->lap[i] = bt_window_lap(w, p->x);
}

/// Collective. Id of a body over which body gid would lie at a place, by more than is left alone; −1 = none. The rank
/// that owns it shows its outline there to all, as none of them need hold both it and what stands there.
static double obstacle_at(const bt_world *w, bt_gid gid, const double to[3])
{
    const bt_bodies *b = &w->bodies;
    const bt_idx i = bt_world_index(w, gid);
    const size_t own = i >= 0 && bt_domain_owns(w, i) ? (size_t)(b->offset[i + 1] - b->offset[i]) : 0;
    double *turned = bt_alloc(2 * own, sizeof *turned), s, c, radius = 0;
    bt_sincos(to[2], &s, &c);
    for (size_t k = 0; k < own; k++) {
        const double *v = b->vertices + 2 * ((size_t)b->offset[i] + k);
        turned[2 * k] = c * v[0] - s * v[1];
        turned[2 * k + 1] = s * v[0] + c * v[1];
    }
    size_t n;
    double *vertex = bt_domain_gather_all(w, turned, own, 2 * sizeof *turned, &n);
    bt_mark *mark = bt_domain_gather_all(w, own ? b->mark + b->offset[i] : NULL, own, sizeof *mark, &n);
    for (size_t k = 0; k < n; k++) radius = bt_max(radius, bt_hypot(vertex[2 * k], vertex[2 * k + 1]));
    double found = -1;
    for (bt_idx j = 0; j < b->n; j++) {
        double d[2] = {b->pose[j].x - to[0], b->pose[j].y - to[1]};
        if (w->par.period_x > 0) d[0] -= w->par.period_x * nearbyint(d[0] / w->par.period_x);
        if (w->par.period_y > 0) d[1] -= w->par.period_y * nearbyint(d[1] / w->par.period_y);
        if (b->gid[j] == gid || bt_hypot(d[0], d[1]) > radius + b->radius[j]) continue;
        if (bt_bodies_depth(b, j, mark, vertex, (int64_t)n, d[0], d[1]) > w->par.slop)
            found = bt_max(found, (double)b->gid[j]);
    }
    free(turned);
    free(vertex);
    free(mark);
    bt_domain_maxima(w, &found, 1);
    return found;
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
    const double obstacle = obstacle_at(w, gid, to);
    if (obstacle >= 0) {
        bt_errors_add(err, "body %lld: would lie over body %lld there; choose a free place", id, (long long)obstacle);
        return BT_ERR_USAGE;
    }
    const bt_idx i = bt_world_index(w, gid);
    put(w, i, to);
    stir(w, i);
    return BT_OK;
}
