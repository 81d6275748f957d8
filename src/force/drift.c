// SPDX-License-Identifier: MIT
// Free drift of one body; equations in force/drift.h.
#include "force/drift.h"

#include <math.h>
#include <string.h>

#include "force/load.h"
#include "base/elementary.h"

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
static void add_stream(const bt_bodies *b, bt_idx i, const bt_stream *in, const double u[2], balance *a)
{
    const double skin = in->skin, form = in->form, v[2] = {in->u - u[0], in->v - u[1]}, s = bt_hypot(v[0], v[1]);
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

/// Explicit and linear forces. An explicit force counts as constant: one that falls with the velocity slows Newton's
/// method down.
static void add_rest(const bt_load *l, const double u[2], balance *a)
{
    const double f[2] = {l->fx + l->jx - l->g * u[0], l->fy + l->jy - l->g * u[1]};
    for (int r = 0; r < 2; r++) {
        a->f[r] += f[r];
        a->df[r][r] -= l->g;
    }
    a->scale += bt_hypot(l->fx, l->fy) + bt_hypot(l->jx, l->jy) + l->g * bt_hypot(u[0], u[1]);
}

static balance balance_at(const bt_world *w, bt_idx i, const double u[2])
{
    const bt_bodies *b = &w->bodies;
    const double dt = w->par.dt, rate = b->mass[i] / dt;
    bt_load l;
    bt_forces_load(w, i, &(bt_vel){.x = u[0], .y = u[1]}, &l);
    bt_turning r = BT_TURNING_NONE;
    bt_turning_set(&r, b->share[i] * l.turn * dt);
    // U' − U without the cancellation of the whole velocities.
    const double x = u[0] - l.about_x, y = u[1] - l.about_y;
    balance a = {
        .f = {rate * ((r.c - 1) * x - r.s * y + l.gain_x), rate * (r.s * x + (r.c - 1) * y + l.gain_y)},
        .df = {{rate * (r.c - 1), -rate * r.s}, {rate * r.s, rate * (r.c - 1)}},
    };
    a.scale = rate * (fabs(r.s) * bt_hypot(x, y) + bt_hypot(l.gain_x, l.gain_y));
    for (int k = 0; k < l.n_streams; k++) add_stream(b, i, &l.stream[k], u, &a);
    add_rest(&l, u, &a);
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
    bt_load l;
    bt_forces_load(w, i, &(bt_vel){0}, &l);
    double skin = 0, form = 0;
    for (int k = 0; k < l.n_streams; k++) skin += l.stream[k].skin, form += l.stream[k].form;
    const double drag = skin + form * (2 * w->bodies.radius[i]);
    const bool drifts = drag > 0 || l.g > 0;
    u[0] = hold[0] || !drifts ? 0 : w->par.water_u;
    u[1] = hold[1] || !drifts ? 0 : w->par.water_v;
    if (!drifts) return true;
    balance a = held_balance(w, i, hold, u);
    double force = bt_hypot(a.f[0], a.f[1]);
    if (force == 0) return true;
    const double first = drag > 0 ? sqrt(force / drag) / force : 1 / l.g;
    for (int k = 0; k < 2; k++) u[k] += first * a.f[k];
    a = held_balance(w, i, hold, u);
    force = bt_hypot(a.f[0], a.f[1]);
    for (int step = 0; step < MAX_STEPS && force > 0; step++) {
        const double det = a.df[0][0] * a.df[1][1] - a.df[0][1] * a.df[1][0];
        const double by[2] = {-(a.df[1][1] * a.f[0] - a.df[0][1] * a.f[1]) / det,
                              -(a.df[0][0] * a.f[1] - a.df[1][0] * a.f[0]) / det};
        if (!isfinite(by[0]) || !isfinite(by[1])) break;
        double share = 1, next = INFINITY, to[2] = {0, 0};
        balance there = a;
        for (int k = 0; k < MAX_HALVINGS && !(next < force); k++, share *= 0.5) {
            to[0] = u[0] + share * by[0], to[1] = u[1] + share * by[1];
            there = held_balance(w, i, hold, to);
            next = bt_hypot(there.f[0], there.f[1]);
        }
        if (!(next < force)) break; // rounding, or no descent
        memcpy(u, to, sizeof to);
        a = there;
        force = next;
    }
    return force <= 1e-10 * a.scale;
}
