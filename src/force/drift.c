// SPDX-License-Identifier: MIT
// Free drift of one body; equations in force/drift.h.
#include "force/drift.h"

#include <math.h>
#include <string.h>

#include "bergtow/forces.h"

/// Force on a body at velocity u, N; its derivative; the sum of the magnitudes of its parts.
typedef struct {
    double f[2], df[2][2], scale;
} balance;

/// From the lowest to the highest vertex of the outline across v, m.
static void extent_across(const bt_bodies *b, bt_idx i, const double v[2], double d[2])
{
    const double *low = b->outline + 2 * b->offset[i], *high = low;
    double least = INFINITY, most = -INFINITY;
    for (int64_t k = b->offset[i]; k < b->offset[i + 1]; k++) {
        const double *p = b->outline + 2 * k, s = v[0] * p[1] - v[1] * p[0];
        if (s < least) least = s, low = p;
        if (s > most) most = s, high = p;
    }
    d[0] = high[0] - low[0];
    d[1] = high[1] - low[1];
}

/// skin |v| v + form |v × D| v, v = ref − u.
static void add_drag(const bt_bodies *b, bt_idx i, double skin, double form, const double ref[2], const double u[2], balance *a)
{
    const double v[2] = {ref[0] - u[0], ref[1] - u[1]}, s = hypot(v[0], v[1]);
    if (s == 0) return;
    double d[2];
    extent_across(b, i, v, d);
    const double across = v[0] * d[1] - v[1] * d[0], g = skin * s + form * across;
    const double dg[2] = {skin * v[0] / s + form * d[1], skin * v[1] / s - form * d[0]}; // by v
    for (int r = 0; r < 2; r++) {
        a->f[r] += g * v[r];
        a->df[r][r] -= g;
        for (int c = 0; c < 2; c++) a->df[r][c] -= v[r] * dg[c];
    }
    a->scale += g * s;
}

static balance balance_at(const bt_world *w, bt_idx i, const double u[2])
{
    const bt_params *p = &w->par;
    const bt_bodies *b = &w->bodies;
    const bt_drag *d = &b->drag[i];
    const bt_turning r = bt_forces_turning(p, b->share[i]);
    const double rate = b->mass[i] / p->dt, water[2] = {p->water_u, p->water_v}, air[2] = {p->air_u, p->air_v};
    // U' − U without the cancellation of the whole velocities.
    const double x = u[0] - p->balance_u, y = u[1] - p->balance_v;
    balance a = {
        .f = {rate * ((r.c - 1) * x - r.s * y + r.vx), rate * (r.s * x + (r.c - 1) * y + r.vy)},
        .df = {{rate * (r.c - 1), -rate * r.s}, {rate * r.s, rate * (r.c - 1)}},
    };
    a.scale = rate * (fabs(r.s) * hypot(x, y) + hypot(r.vx, r.vy));
    add_drag(b, i, d->water_skin, d->water_form, water, u, &a);
    add_drag(b, i, d->air_skin, d->air_form, air, u, &a);
    return a;
}

/// Forces across walls are borne by them.
static balance held_balance(const bt_world *w, bt_idx i, const bool hold[2], const double u[2])
{
    balance a = balance_at(w, i, u);
    for (int k = 0; k < 2; k++)
        if (hold[k]) {
            a.f[k] = a.df[0][1] = a.df[1][0] = 0;
            a.df[k][k] = -1;
        }
    return a;
}

bool bt_drift_velocity(const bt_world *w, bt_idx i, const bool hold[2], double u[2])
{
    enum { MAX_STEPS = 100, MAX_HALVINGS = 40 };
    const bt_drag *d = &w->bodies.drag[i];
    const double width = 2 * w->bodies.radius[i], drag = d->water_skin + d->air_skin + (d->water_form + d->air_form) * width;
    u[0] = hold[0] || drag == 0 ? 0 : w->par.water_u;
    u[1] = hold[1] || drag == 0 ? 0 : w->par.water_v;
    if (drag == 0) return true;
    balance a = held_balance(w, i, hold, u);
    double force = hypot(a.f[0], a.f[1]);
    if (force == 0) return true;
    const double first = sqrt(force / drag) / force;
    for (int k = 0; k < 2; k++) u[k] += first * a.f[k];
    a = held_balance(w, i, hold, u);
    force = hypot(a.f[0], a.f[1]);
    for (int step = 0; step < MAX_STEPS && force > 0; step++) {
        const double det = a.df[0][0] * a.df[1][1] - a.df[0][1] * a.df[1][0];
        const double by[2] = {-(a.df[1][1] * a.f[0] - a.df[0][1] * a.f[1]) / det, -(a.df[0][0] * a.f[1] - a.df[1][0] * a.f[0]) / det};
        if (!isfinite(by[0]) || !isfinite(by[1])) break;
        double share = 1, next = INFINITY, to[2] = {0, 0};
        balance there = a;
        for (int k = 0; k < MAX_HALVINGS && !(next < force); k++, share *= 0.5) {
            to[0] = u[0] + share * by[0], to[1] = u[1] + share * by[1];
            there = held_balance(w, i, hold, to);
            next = hypot(there.f[0], there.f[1]);
        }
        if (!(next < force)) break; // rounding, or no descent
        memcpy(u, to, sizeof to);
        a = there;
        force = next;
    }
    return force <= 1e-10 * a.scale;
}
