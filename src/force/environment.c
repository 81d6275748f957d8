// SPDX-License-Identifier: MIT
// Current and wind in time; equations in force/environment.h.
#include "force/environment.h"

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
    bt_table table;      ///< replaces all of these if it has rows
} flow;

struct bt_environment {
    flow water, air;
    bt_tilt tilt;
};

static flow flow_of(const bt_case *input, bool water)
{
    if (!water) return (flow){.u = input->air.wind_x, .v = input->air.wind_y, .table = input->air.table};
    const double x = bt_cos(input->water.tide.inclination), y = bt_sin(input->water.tide.inclination);
    return (flow){
        .u = input->water.current_x,
        .v = input->water.current_y,
        .e1 = {input->water.tide.major * x, input->water.tide.major * y},
        .e2 = {-input->water.tide.minor * y, input->water.tide.minor * x},
        .turn = input->water.tide.period > 0 ? 2 * BT_PI / input->water.tide.period : 0,
        .lag = input->water.tide.phase,
        .table = input->water.table,
    };
}

static bool changes(const flow *fluid)
{
    return fluid->table.n > 0 || fluid->e1[0] != 0 || fluid->e1[1] != 0 || fluid->e2[0] != 0 || fluid->e2[1] != 0;
}

static void velocity(const flow *fluid, double t, double v[2])
{
    if (fluid->table.n > 0) {
        bt_table_at(&fluid->table, t, v);
        return;
    }
    const double angle = fluid->turn * t - fluid->lag, c = bt_cos(angle), s = bt_sin(angle);
    v[0] = fluid->u + fluid->e1[0] * c + fluid->e2[0] * s;
    v[1] = fluid->v + fluid->e1[1] * c + fluid->e2[1] * s;
}

void bt_environment_at(const bt_case *input, bool water, double t, double v[2])
{
    const flow fluid = flow_of(input, water);
    velocity(&fluid, t, v);
}

void bt_environment_mean(const bt_case *input, double v[2])
{
    enum { SAMPLES = 1000 };
    const flow fluid = flow_of(input, true);
    v[0] = fluid.u, v[1] = fluid.v;
    if (!changes(&fluid)) return;
    double sum[2] = {0, 0};
    for (int i = 0; i < SAMPLES; i++) {
        velocity(&fluid, (i + 0.5) / SAMPLES * input->run.duration, v);
        sum[0] += v[0], sum[1] += v[1];
    }
    v[0] = sum[0] / SAMPLES, v[1] = sum[1] / SAMPLES;
}

bool bt_environment_changes(const bt_case *input)
{
    const flow water = flow_of(input, true), air = flow_of(input, false);
    return changes(&water) || changes(&air);
}

static void own(bt_table *table)
{
    if (table->n == 0) return;
    double *row = bt_alloc((size_t)table->n, 3 * sizeof *row);
    memcpy(row, table->row, (size_t)table->n * 3 * sizeof *row);
    table->row = row;
}

bt_environment *bt_environment_create(const bt_case *input)
{
    const bt_environment environment = {.water = flow_of(input, true), .air = flow_of(input, false),
                                        .tilt = input->water.tilt};
    if (!changes(&environment.water) && !changes(&environment.air)) return NULL;
    bt_environment *out = bt_alloc(1, sizeof *out);
    *out = environment;
    own(&out->water.table);
    own(&out->air.table);
    return out;
}

void bt_environment_free(bt_environment *environment)
{
    if (!environment) return;
    bt_table_free(&environment->water.table);
    bt_table_free(&environment->air.table);
    free(environment);
}

void bt_environment_begin(bt_world *world)
{
    const bt_environment *environment = world->environment;
    if (!environment) return;
    bt_params *par = &world->par;
    const double t = ((double)world->step + 0.5) * par->dt;
    double water[2], air[2];
    velocity(&environment->water, t, water);
    velocity(&environment->air, t, air);
    double balance[2] = {0, 0}, tilt[2] = {par->tilt_ax, par->tilt_ay};
    if (environment->tilt == BT_TILT_GEOSTROPHIC) memcpy(balance, water, sizeof balance);
    if (environment->tilt == BT_TILT_DYNAMIC) {
        velocity(&environment->water, world->step > 0 ? ((double)world->step - 0.5) * par->dt : 0, balance);
        for (int k = 0; k < 2; k++) tilt[k] = (water[k] - balance[k]) / par->dt;
    }
    const bool same = water[0] == par->water_u && water[1] == par->water_v && air[0] == par->air_u &&
                      air[1] == par->air_v && tilt[0] == par->tilt_ax && tilt[1] == par->tilt_ay;
    par->water_u = water[0], par->water_v = water[1];
    par->air_u = air[0], par->air_v = air[1];
    par->balance_u = balance[0], par->balance_v = balance[1];
    par->tilt_ax = tilt[0], par->tilt_ay = tilt[1];
    if (same) return;
    bt_cells_wake_all(world->cells);
    for (bt_idx k = 0; k < world->cells->n; k++) world->cells->asleep[k] = BT_AWAKE;
}

void bt_environment_advance(bt_world *world)
{
    const bt_params *par = &world->par;
    if (world->environment) {
        world->drift_x += par->dt * par->water_u;
        world->drift_y += par->dt * par->water_v;
    } else { // avoids the rounding of a sum
        const double time = (double)(world->step + 1) * par->dt;
        world->drift_x = time * par->water_u;
        world->drift_y = time * par->water_v;
    }
}
