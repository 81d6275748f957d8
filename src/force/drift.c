// SPDX-License-Identifier: MIT
// Free drift of one body; equations in force/drift.h.
#include "force/drift.h"

#include <math.h>
#include <string.h>

#include "force/load.h"
#include "base/elementary.h"

/// Force on a body at a velocity, N; its derivative; the sum of the magnitudes of its parts.
typedef struct {
    double f[2], df[2][2], scale;
} balance;

/// From the lowest to the highest vertex of the outline across v, m.
static void extent_across(const bt_bodies *bodies, bt_idx i, const double v[2], double d[2])
{
    const double *low = bodies->outline + 2 * bodies->offset[i], *high = low;
    double least = INFINITY, most = -INFINITY;
    for (int64_t k = bodies->offset[i]; k < bodies->offset[i + 1]; k++) {
        const double *p = bodies->outline + 2 * k, s = v[0] * p[1] - v[1] * p[0];
        if (s < least) least = s, low = p;
        if (s > most) most = s, high = p;
    }
    d[0] = high[0] - low[0];
    d[1] = high[1] - low[1];
}

/// skin |v| v + form |v × D| v, v = ref − u.
static void add_stream(const bt_bodies *bodies, bt_idx i, const bt_stream *in, const double u[2], balance *sum)
{
    const double skin = in->skin, form = in->form, v[2] = {in->u - u[0], in->v - u[1]}, s = bt_hypot(v[0], v[1]);
    if (s == 0) return;
    double d[2];
    extent_across(bodies, i, v, d);
    const double across = v[0] * d[1] - v[1] * d[0], g = skin * s + form * across;
    const double dg[2] = {skin * v[0] / s + form * d[1], skin * v[1] / s - form * d[0]}; // derivative by v
    for (int r = 0; r < 2; r++) {
        sum->f[r] += g * v[r];
        sum->df[r][r] -= g;
        for (int c = 0; c < 2; c++) sum->df[r][c] -= v[r] * dg[c];
    }
    sum->scale += g * s;
}

/// Explicit and linear forces. An explicit force counts as constant; if it is not, Newton's method slows down.
static void add_rest(const bt_load *load, const double u[2], balance *sum)
{
    const double f[2] = {load->fx + load->jx - load->g * u[0], load->fy + load->jy - load->g * u[1]};
    for (int r = 0; r < 2; r++) {
        sum->f[r] += f[r];
        sum->df[r][r] -= load->g;
    }
    sum->scale += bt_hypot(load->fx, load->fy) + bt_hypot(load->jx, load->jy) + load->g * bt_hypot(u[0], u[1]);
}

static balance balance_at(const bt_world *world, bt_idx i, const double u[2])
{
    const bt_bodies *bodies = &world->bodies;
    const double dt = world->par.dt, rate = bodies->mass[i] / dt;
    bt_load load;
    bt_forces_load(world, i, &(bt_vel){.x = u[0], .y = u[1]}, &load);
    bt_turning turning = BT_TURNING_NONE;
    bt_turning_set(&turning, bodies->share[i] * load.turn * dt);
    // U' − U without the cancellation of the whole velocities.
    const double x = u[0] - load.about_x, y = u[1] - load.about_y;
    balance sum = {
        .f = {rate * ((turning.c - 1) * x - turning.s * y + load.gain_x),
              rate * (turning.s * x + (turning.c - 1) * y + load.gain_y)},
        .df = {{rate * (turning.c - 1), -rate * turning.s}, {rate * turning.s, rate * (turning.c - 1)}},
    };
    sum.scale = rate * (fabs(turning.s) * bt_hypot(x, y) + bt_hypot(load.gain_x, load.gain_y));
    for (int k = 0; k < load.n_streams; k++) add_stream(bodies, i, &load.stream[k], u, &sum);
    add_rest(&load, u, &sum);
    return sum;
}

/// The balance without forces across walls, which bear them.
static balance held_balance(const bt_world *world, bt_idx i, const bool hold[2], const double u[2])
{
    balance sum = balance_at(world, i, u);
    for (int k = 0; k < 2; k++)
        if (hold[k]) {
            sum.f[k] = sum.df[0][1] = sum.df[1][0] = 0;
            sum.df[k][k] = -1;
        }
    return sum;
}

bool bt_drift_velocity(const bt_world *world, bt_idx i, const bool hold[2], double u[2])
{
    enum { MAX_STEPS = 100, MAX_HALVINGS = 40 };
    bt_load load;
    bt_forces_load(world, i, &(bt_vel){0}, &load);
    double skin = 0, form = 0;
    for (int k = 0; k < load.n_streams; k++) skin += load.stream[k].skin, form += load.stream[k].form;
    const double drag = skin + form * (2 * world->bodies.radius[i]);
    const bool drifts = drag > 0 || load.g > 0;
    u[0] = hold[0] || !drifts ? 0 : world->par.water_u;
    u[1] = hold[1] || !drifts ? 0 : world->par.water_v;
    if (!drifts) return true;
    balance sum = held_balance(world, i, hold, u);
    double force = bt_hypot(sum.f[0], sum.f[1]);
    if (force == 0) return true;
    const double first = drag > 0 ? sqrt(force / drag) / force : 1 / load.g;
    for (int k = 0; k < 2; k++) u[k] += first * sum.f[k];
    sum = held_balance(world, i, hold, u);
    force = bt_hypot(sum.f[0], sum.f[1]);
    for (int step = 0; step < MAX_STEPS && force > 0; step++) {
        const double det = sum.df[0][0] * sum.df[1][1] - sum.df[0][1] * sum.df[1][0];
        const double by[2] = {-(sum.df[1][1] * sum.f[0] - sum.df[0][1] * sum.f[1]) / det,
                              -(sum.df[0][0] * sum.f[1] - sum.df[1][0] * sum.f[0]) / det};
        if (!isfinite(by[0]) || !isfinite(by[1])) break;
        double share = 1, next = INFINITY, to[2] = {0, 0};
        balance there = sum;
        for (int k = 0; k < MAX_HALVINGS && !(next < force); k++, share *= 0.5) {
            to[0] = u[0] + share * by[0], to[1] = u[1] + share * by[1];
            there = held_balance(world, i, hold, to);
            next = bt_hypot(there.f[0], there.f[1]);
        }
        if (!(next < force)) break; // rounding, or no descent
        memcpy(u, to, sizeof to);
        sum = there;
        force = next;
    }
    return force <= 1e-10 * sum.scale;
}
