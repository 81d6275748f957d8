// SPDX-License-Identifier: MIT
// How a load is integrated over a step; equations in bergtow/forces.h. Inline: this is what a step spends on forces.
#ifndef BERGTOW_LOAD_H
#define BERGTOW_LOAD_H

#include <math.h>
#include <string.h>

#include "bergtow/forces.h"
#include "base/elementary.h"

/// Middle of the step at hand, s.
static inline double bt_load_time(const bt_world *w) { return ((double)w->step + 0.5) * w->par.dt; }

/// Streams are counted.
static inline void bt_load_clear(bt_load *l)
{
    l->turn = l->about_x = l->about_y = l->gain_x = l->gain_y = l->fx = l->fy = l->moment = l->yaw = 0;
    l->g = l->gx = l->gy = l->gw = l->jx = l->jy = l->jw = 0;
    l->n_streams = 0;
}

/// What law k adds to a body on which it acts.
static inline void bt_load_add(const bt_forces *f, int k, bt_force_body *b, bt_load *l)
{
    const bt_force_law *law = bt_force_laws[k];
    if (law->towed_only && !b->towed) return;
    b->own = f->own[k];
    b->context = law->context;
    law->add(b, l);
}

/// What all laws from `first` on add to a body.
static inline void bt_load_fill(const bt_forces *f, int first, bt_force_body *b, bt_load *l)
{
    for (int k = first; k < f->n; k++) bt_load_add(f, k, b, l);
}

/// Body i at velocity u as laws see it.
static inline bt_force_body bt_load_body(const bt_world *w, bt_idx i, const bt_vel *u)
{
    const bt_bodies *b = &w->bodies;
    return (bt_force_body){
        .par = &w->par,
        .drag = &b->drag[i],
        .exposure = &b->exposure[i],
        .vel = *u,
        .time = bt_load_time(w),
        .mass = b->mass[i],
        .inertia = b->inertia[i],
        .share = b->share[i],
        .towed = b->gid[i] == w->towed,
        .all = b,
        .i = i,
        .towed_at = w->forces->towed_at,
    };
}

/// The angle by which a load turns a velocity in a step, rad; many bodies have the same.
typedef struct bt_turning {
    double angle, c, s;
} bt_turning;

#define BT_TURNING_NONE {.c = 1}

static inline void bt_turning_set(bt_turning *r, double angle)
{
    if (r->angle == angle) return;
    r->angle = angle;
    bt_sincos(angle, &r->s, &r->c);
}

/// U' = U_b + R (U − U_b) + gain + Δt F/M.
static inline void bt_load_turn(const bt_load *l, const bt_turning *r, double dt, double m, double inertia, bt_vel *u)
{
    if (r->s != 0) {
        const double x = u->x - l->about_x, y = u->y - l->about_y;
        u->x = l->about_x + r->c * x - r->s * y;
        u->y = l->about_y + r->s * x + r->c * y;
    }
    u->x += l->gain_x;
    u->y += l->gain_y;
    if (l->fx != 0 || l->fy != 0) {
        u->x += dt * l->fx / m;
        u->y += dt * l->fy / m;
    }
    if (l->moment != 0) u->w += dt * l->moment / inertia;
}

/// All that is implicit as one linear force j − K (U, ω).
typedef struct bt_linear {
    double g, gx, gy, gw, jx, jy, jw; ///< as in bt_load
    /// jw without that of streams, which vanishes where they do not couple, but for rounding
    double twist;
} bt_linear;

static inline bt_linear bt_load_linear(const bt_load *l, double w)
{
    return (bt_linear){l->g, l->gx, l->gy, l->gw + l->yaw * fabs(w), l->jx, l->jy, l->jw, l->jw};
}

/// Skin drag of one fluid, k |v| v, v = U_ref − U of the size `slip`.
static inline void bt_linear_add_skin(bt_linear *a, const bt_stream *s, double slip)
{
    const double g = s->skin * slip;
    a->g += g;
    a->jx += g * s->u;
    a->jy += g * s->v;
}

/// Form drag of a stream along the convex hull of the outline of body i; rx, ry: U_ref − U, w: ω.
void bt_linear_add_outline(const bt_bodies *b, bt_idx i, bt_stream s, double rx, double ry, double w, bt_linear *a);

/// Everything implicit that acts on body i at velocity u.
static inline bt_linear bt_load_implicit(const bt_bodies *b, bt_idx i, const bt_load *l, const bt_vel *u)
{
    bt_linear a = bt_load_linear(l, u->w);
    for (int k = 0; k < l->n_streams; k++) {
        const bt_stream *s = &l->stream[k];
        const double rx = s->u - u->x, ry = s->v - u->y;
        bt_linear_add_skin(&a, s, sqrt(rx * rx + ry * ry));
    }
    for (int k = 0; k < l->n_streams; k++) {
        const bt_stream s = l->stream[k]; // a copy: the load itself stays in registers
        const double rx = s.u - u->x, ry = s.v - u->y;
        if (s.form != 0 && (rx != 0 || ry != 0 || u->w != 0)) bt_linear_add_outline(b, i, s, rx, ry, u->w, &a);
    }
    return a;
}

/// (M + Δt K) U* = M U' + Δt j; inv: of the diagonal of M + Δt K.
static inline void bt_linear_take(const bt_linear *l, double dt, double m, double inertia, bt_inv inv, bt_vel *u)
{
    if (l->gx == 0 && l->gy == 0) { // no coupling
        // without drag exactly as it was: a floe that drifts with the water is at rest to the last bit
        if (l->g > 0 || l->jx != 0 || l->jy != 0) {
            u->x = (m * u->x + dt * l->jx) * inv.m;
            u->y = (m * u->y + dt * l->jy) * inv.m;
        }
        if (l->gw > 0 || l->twist != 0) u->w = (inertia * u->w + dt * l->twist) * inv.i;
        return;
    }
    const double x = dt * l->gx, y = dt * l->gy, bx = m * u->x + dt * l->jx, by = m * u->y + dt * l->jy;
    // The last denominator is positive: (Σ g r)² <= Σ g Σ g r².
    u->w = (inertia * u->w + dt * l->jw + (y * bx - x * by) * inv.m) / (1 / inv.i - (x * x + y * y) * inv.m);
    u->x = (bx + y * u->w) * inv.m;
    u->y = (by - x * u->w) * inv.m;
}

#endif
