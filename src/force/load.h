// SPDX-License-Identifier: MIT
// Integration of a load over a step; equations in bergtow/forces.h. Inline, as it is the cost of forces in a step.
#ifndef BERGTOW_LOAD_H
#define BERGTOW_LOAD_H

#include <math.h>
#include <string.h>

#include "bergtow/forces.h"
#include "base/elementary.h"

/// Middle of the present step, s.
static inline double bt_load_time(const bt_world *world) { return ((double)world->step + 0.5) * world->par.dt; }

/// Clear a load; its streams need not be cleared, they are counted.
static inline void bt_load_clear(bt_load *load)
{
    load->turn = load->about_x =
        load->about_y = load->gain_x = load->gain_y = load->fx = load->fy = load->moment = load->yaw = 0;
    load->g = load->gx = load->gy = load->gw = load->jx = load->jy = load->jw = 0;
    load->n_streams = 0;
}

/// Add the load of law k on a body, if it acts there.
static inline void bt_load_add(const bt_forces *forces, int k, bt_force_body *body, bt_load *load)
{
    const bt_force_law *law = bt_force_laws[k];
    if (law->towed_only && !body->towed) return;
    body->own = forces->own[k];
    body->context = law->context;
    law->add(body, load);
}

/// Add the loads of all laws from `first` on.
static inline void bt_load_fill(const bt_forces *forces, int first, bt_force_body *body, bt_load *load)
{
    for (int k = first; k < forces->n; k++) bt_load_add(forces, k, body, load);
}

/// Body i at velocity u, as passed to the laws.
static inline bt_force_body bt_load_body(const bt_world *world, bt_idx i, const bt_vel *u)
{
    const bt_bodies *bodies = &world->bodies;
    return (bt_force_body){
        .par = &world->par,
        .drag = &bodies->drag[i],
        .exposure = &bodies->exposure[i],
        .vel = *u,
        .time = bt_load_time(world),
        .mass = bodies->mass[i],
        .inertia = bodies->inertia[i],
        .share = bodies->share[i],
        .towed = bodies->gid[i] == world->towed,
        .all = bodies,
        .i = i,
        .towed_at = world->forces->towed_at,
    };
}

/// The angle by which a load rotates a velocity in a step, rad; it is the same for many bodies.
typedef struct bt_turning {
    double angle, c, s;
} bt_turning;

#define BT_TURNING_NONE {.c = 1}

static inline void bt_turning_set(bt_turning *turning, double angle)
{
    if (turning->angle == angle) return;
    turning->angle = angle;
    bt_sincos(angle, &turning->s, &turning->c);
}

/// U' = U_b + R (U − U_b) + gain + Δt F/M.
static inline void bt_load_turn(const bt_load *load, const bt_turning *turning, double dt, double m, double inertia,
                                bt_vel *u)
{
    if (turning->s != 0) {
        const double x = u->x - load->about_x, y = u->y - load->about_y;
        u->x = load->about_x + turning->c * x - turning->s * y;
        u->y = load->about_y + turning->s * x + turning->c * y;
    }
    u->x += load->gain_x;
    u->y += load->gain_y;
    if (load->fx != 0 || load->fy != 0) {
        u->x += dt * load->fx / m;
        u->y += dt * load->fy / m;
    }
    if (load->moment != 0) u->w += dt * load->moment / inertia;
}

/// The implicit part of a load as one linear force j − K (U, ω).
typedef struct bt_linear {
    double g, gx, gy, gw, jx, jy, jw; ///< as in bt_load
    /// jw without that of streams, which is 0 to rounding if they do not couple
    double twist;
} bt_linear;

static inline bt_linear bt_load_linear(const bt_load *load, double w)
{
    return (bt_linear){load->g, load->gx, load->gy, load->gw + load->yaw * fabs(w), load->jx, load->jy, load->jw,
                       load->jw};
}

/// Skin drag of one fluid, k |v| v, v = U_ref − U of the size `slip`.
static inline void bt_linear_add_skin(bt_linear *linear, const bt_stream *stream, double slip)
{
    const double g = stream->skin * slip;
    linear->g += g;
    linear->jx += g * stream->u;
    linear->jy += g * stream->v;
}

/// Form drag of a stream along the convex hull of the outline of body i; rx, ry: U_ref − U, w: ω.
void bt_linear_add_outline(const bt_bodies *bodies, bt_idx i, bt_stream stream, double rx, double ry, double w,
                           bt_linear *linear);

/// The implicit part of the load on body i at velocity u.
static inline bt_linear bt_load_implicit(const bt_bodies *bodies, bt_idx i, const bt_load *load, const bt_vel *u)
{
    bt_linear linear = bt_load_linear(load, u->w);
    for (int k = 0; k < load->n_streams; k++) {
        const bt_stream *stream = &load->stream[k];
        const double rx = stream->u - u->x, ry = stream->v - u->y;
        bt_linear_add_skin(&linear, stream, sqrt(rx * rx + ry * ry));
    }
    for (int k = 0; k < load->n_streams; k++) {
        const bt_stream stream = load->stream[k]; // a copy: the load itself stays in registers
        const double rx = stream.u - u->x, ry = stream.v - u->y;
        if (stream.form != 0 && (rx != 0 || ry != 0 || u->w != 0))
            bt_linear_add_outline(bodies, i, stream, rx, ry, u->w, &linear);
    }
    return linear;
}

/// Solve (M + Δt K) U* = M U' + Δt j; inv: inverse of the diagonal of M + Δt K.
static inline void bt_linear_take(const bt_linear *linear, double dt, double m, double inertia, bt_inv inv, bt_vel *u)
{
    if (linear->gx == 0 && linear->gy == 0) { // no coupling
        // without drag exactly unchanged: a floe that drifts with the water is at rest to the last bit
        if (linear->g > 0 || linear->jx != 0 || linear->jy != 0) {
            u->x = (m * u->x + dt * linear->jx) * inv.m;
            u->y = (m * u->y + dt * linear->jy) * inv.m;
        }
        if (linear->gw > 0 || linear->twist != 0) u->w = (inertia * u->w + dt * linear->twist) * inv.i;
        return;
    }
    const double x = dt * linear->gx, y = dt * linear->gy, bx = m * u->x + dt * linear->jx,
                 by = m * u->y + dt * linear->jy;
    // The last denominator is positive: (Σ g r)² <= Σ g Σ g r².
    u->w = (inertia * u->w + dt * linear->jw + (y * bx - x * by) * inv.m) / (1 / inv.i - (x * x + y * y) * inv.m);
    u->x = (bx + y * u->w) * inv.m;
    u->y = (by - x * u->w) * inv.m;
}

#endif
