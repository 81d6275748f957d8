// SPDX-License-Identifier: MIT
// Free drift of the mean floe, step by step; what it is for: step/undisturbed.h.
#include "step/undisturbed.h"

#include <math.h>

#include "base/elementary.h"
#include "body/bodies.h"
#include "force/forces.h"
#include "tow/tow.h"

/// Of the convex hull, along which form drag acts, m.
static double hull_perimeter(const bt_bodies *b, bt_idx i)
{
    const int n = bt_body_corners(b, i);
    const double *v = b->vertices + 2 * b->offset[i], *per_length = b->per_length + b->offset[i];
    const bt_mark *mark = b->mark + b->offset[i];
    double sum = 0;
    for (int k = 0; k < n; k++) {
        const int to = mark[k].next;
        if (to == (k + 1) % n) sum += 1 / per_length[k];
        else if (to != k) sum += bt_hypot(v[2 * to] - v[2 * k], v[2 * to + 1] - v[2 * k + 1]); // across a bay
    }
    return sum;
}

/// Mean floe: its drag as that of all floes together over their number, all of it in the skin's, since a floe that has
/// no direction has a width of its own. Mean width of a convex hull: its perimeter / π (Cauchy).
static void mean_floe(const bt_world *w, bt_undisturbed *v, bt_gid n_floes)
{
    const bt_bodies *b = &w->bodies;
    double n = 0;
    for (bt_gid g = 0; g < n_floes; g++) {
        const bt_idx i = bt_world_index(w, g);
        if (i < 0 || b->motion[i] != BT_DYNAMIC) continue;
        const double perimeter = hull_perimeter(b, i);
        v->mass += b->mass[i];
        v->share += b->share[i] * b->mass[i];
        v->inertia += b->inertia[i];
        v->radius += b->radius[i];
        v->area += b->area[i];
        v->thickness += b->thickness[i];
        const bt_drag *d = &b->drag[i];
        v->exposure = b->exposure[i];
        v->drag.water_skin += d->water_skin + v->exposure.water_form * d->water_form * perimeter / BT_PI;
        v->drag.air_skin += d->air_skin + v->exposure.air_form * d->air_form * perimeter / BT_PI;
        // relative to the water, so that the mean of floes that rest in it does to the last bit
        v->vel.x += b->vel[i].x - w->par.water_u;
        v->vel.y += b->vel[i].y - w->par.water_v;
        n++;
    }
    if (n == 0) { // as the water goes
        v->vel = (bt_vel){.x = w->par.water_u, .y = w->par.water_v};
        return;
    }
    v->share /= v->mass;
    v->mass /= n, v->drag.water_skin /= n, v->drag.air_skin /= n;
    v->inertia /= n, v->radius /= n, v->area /= n, v->thickness /= n;
    v->vel.x = w->par.water_u + v->vel.x / n, v->vel.y = w->par.water_v + v->vel.y / n;
}

void bt_undisturbed_create(bt_world *w, bt_gid n_floes, const bool held[2])
{
    bt_undisturbed *v = w->undisturbed = bt_alloc(1, sizeof *v);
    *v = (bt_undisturbed){.held = {held[0], held[1]}, .exposure = bt_exposed};
    mean_floe(w, v, n_floes);
    if (held[0]) v->vel.x = 0;
    if (held[1]) v->vel.y = 0;
}

/// By the table of force laws, as of every floe; so what has the velocity of the water keeps it to the last bit.
void bt_undisturbed_advance(bt_world *w)
{
    bt_undisturbed *v = w->undisturbed;
    if (!v) return;
    bt_pose nowhere = {NAN, NAN, NAN};
    const bt_bodies one = {
        .n = 1, .pose = &nowhere, .radius = &v->radius, .area = &v->area, .thickness = &v->thickness};
    bt_force_body mean = {
        .drag = &v->drag, .exposure = &bt_exposed, .vel = v->vel, .mass = v->mass, .inertia = v->inertia,
        .share = v->share, .all = &one};
    const bt_vel water = {.x = w->par.water_u, .y = w->par.water_v};
    bt_vel u = v->mass > 0 ? bt_forces_drift(w, &mean) : water;
    // A law that depends on the place. The ice that a window takes in has none, and the run ends.
    if (!w->window && !(isfinite(u.x) && isfinite(u.y))) u = water;
    u.w = 0;
    if (v->held[0]) u.x = 0;
    if (v->held[1]) u.y = 0;
    v->vel = u;
    v->drift_x += w->par.dt * u.x;
    v->drift_y += w->par.dt * u.y;
}

void bt_undisturbed_place(const bt_world *w, double at[2])
{
    const bt_undisturbed *v = w->undisturbed;
    at[0] = w->tow->travel_x - (v ? v->drift_x : 0);
    at[1] = w->tow->travel_y - (v ? v->drift_y : 0);
}
