// SPDX-License-Identifier: MIT
// Current and wind in time; equations in force/environment.h.
#include "force/environment.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "space/cells.h"
#include "base/elementary.h"
#include "base/table.h"

/// One of the two fluids.
typedef struct {
    double u, v;         ///< constant part, m/s
    double e1[2], e2[2]; ///< semi-axes of the ellipse as vectors, m/s
    double turn, lag;    ///< ω, rad/s; φ, rad
    bt_table table;      ///< in place of all that when it has rows
} flow;

struct bt_environment {
    flow water, air;
    bt_tilt tilt;
};

static flow flow_of(const bt_case *c, bool water)
{
    if (!water) return (flow){.u = c->air.wind_x, .v = c->air.wind_y, .table = c->air.table};
    const double x = bt_cos(c->water.tide.inclination), y = bt_sin(c->water.tide.inclination);
    return (flow){
        .u = c->water.current_x,
        .v = c->water.current_y,
        .e1 = {c->water.tide.major * x, c->water.tide.major * y},
        .e2 = {-c->water.tide.minor * y, c->water.tide.minor * x},
        .turn = c->water.tide.period > 0 ? 2 * BT_PI / c->water.tide.period : 0,
        .lag = c->water.tide.phase,
        .table = c->water.table,
    };
}

static bool changes(const flow *f)
{
    return f->table.n > 0 || f->e1[0] != 0 || f->e1[1] != 0 || f->e2[0] != 0 || f->e2[1] != 0;
}

static void velocity(const flow *f, double t, double v[2])
{
    if (f->table.n > 0) {
        bt_table_at(&f->table, t, v);
        return;
    }
    const double angle = f->turn * t - f->lag, c = bt_cos(angle), s = bt_sin(angle);
    v[0] = f->u + f->e1[0] * c + f->e2[0] * s;
    v[1] = f->v + f->e1[1] * c + f->e2[1] * s;
}

void bt_environment_at(const bt_case *c, bool water, double t, double v[2])
{
    const flow f = flow_of(c, water);
    velocity(&f, t, v);
}

void bt_environment_mean(const bt_case *c, bool water, double v[2])
{
    enum { SAMPLES = 1000 };
    const flow f = flow_of(c, water);
    v[0] = f.u, v[1] = f.v;
    if (!changes(&f)) return;
    double sum[2] = {0, 0};
    for (int i = 0; i < SAMPLES; i++) {
        velocity(&f, (i + 0.5) / SAMPLES * c->run.duration, v);
        sum[0] += v[0], sum[1] += v[1];
    }
    v[0] = sum[0] / SAMPLES, v[1] = sum[1] / SAMPLES;
}

bool bt_environment_changes(const bt_case *c)
{
    const flow water = flow_of(c, true), air = flow_of(c, false);
    return changes(&water) || changes(&air);
}

static void own(bt_table *t)
{
    if (t->n == 0) return;
    double *row = bt_alloc((size_t)t->n, 3 * sizeof *row);
    memcpy(row, t->row, (size_t)t->n * 3 * sizeof *row);
    t->row = row;
}

bt_environment *bt_environment_create(const bt_case *c)
{
    const bt_environment e = {.water = flow_of(c, true), .air = flow_of(c, false), .tilt = c->water.tilt};
    if (!changes(&e.water) && !changes(&e.air)) return NULL;
    bt_environment *out = bt_alloc(1, sizeof *out);
    *out = e;
    own(&out->water.table);
    own(&out->air.table);
    return out;
}

void bt_environment_free(bt_environment *e)
{
    if (!e) return;
    bt_table_free(&e->water.table);
    bt_table_free(&e->air.table);
    free(e);
}

void bt_environment_begin(bt_world *w)
{
    const bt_environment *e = w->environment;
    if (!e) return;
    bt_params *p = &w->par;
    const double t = ((double)w->step + 0.5) * p->dt;
    double water[2], air[2];
    velocity(&e->water, t, water);
    velocity(&e->air, t, air);
    double balance[2] = {0, 0}, tilt[2] = {p->tilt_ax, p->tilt_ay};
    if (e->tilt == BT_TILT_GEOSTROPHIC) memcpy(balance, water, sizeof balance);
    if (e->tilt == BT_TILT_DYNAMIC) {
        velocity(&e->water, w->step > 0 ? ((double)w->step - 0.5) * p->dt : 0, balance);
        for (int k = 0; k < 2; k++) tilt[k] = (water[k] - balance[k]) / p->dt;
    }
    const bool same = water[0] == p->water_u && water[1] == p->water_v && air[0] == p->air_u && air[1] == p->air_v &&
                      tilt[0] == p->tilt_ax && tilt[1] == p->tilt_ay;
    p->water_u = water[0], p->water_v = water[1];
    p->air_u = air[0], p->air_v = air[1];
    p->balance_u = balance[0], p->balance_v = balance[1];
    p->tilt_ax = tilt[0], p->tilt_ay = tilt[1];
    if (same) return;
    bt_cells_wake_all(w->cells);
    for (bt_idx k = 0; k < w->cells->n; k++) w->cells->asleep[k] = BT_AWAKE;
}

void bt_environment_advance(bt_world *w)
{
    const bt_params *p = &w->par;
    if (w->environment) {
        w->drift_x += p->dt * p->water_u;
        w->drift_y += p->dt * p->water_v;
    } else { // without the rounding of a sum
        const double time = (double)(w->step + 1) * p->dt;
        w->drift_x = time * p->water_u;
        w->drift_y = time * p->water_v;
    }
}
