// SPDX-License-Identifier: MIT
// Columns and running totals of the steps of a run; what is made of them: steady.h, summary.h.
#include "output/history.h"
#include "case/cost.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

/// Work of the contacts above this fraction of the kinetic energy is no rounding.
#define WORK_ROUNDING 1e-10

#define COLUMN(column, name, member) [column] = {"history/" name, offsetof(bt_sample, member)}
_Static_assert((int)BT_N_COLUMNS == (int)BT_COST_COLUMNS, "what check says of memory and disk counts them");

typedef struct {
    const char *name;   ///< in the checkpoint, under history/
    size_t offset;      ///< of the number in bt_sample
} column_def;

static const column_def columns[BT_N_COLUMNS] = {
    COLUMN(BT_COL_TIME, "time", time),
    COLUMN(BT_COL_ICE, "ice", ice_resistance),
    COLUMN(BT_COL_TOW, "tow", tow_force),
    COLUMN(BT_COL_DRAG, "drag", drag_force),
    COLUMN(BT_COL_CORIOLIS, "coriolis", coriolis_force),
    COLUMN(BT_COL_TILT, "tilt", tilt_force),
    COLUMN(BT_COL_INERTIA, "inertia", inertia_force),
    COLUMN(BT_COL_BUDGET, "budget", ice_resistance_budget),
    COLUMN(BT_COL_TENSION_1, "tension_1", line_tension_1),
    COLUMN(BT_COL_TENSION_2, "tension_2", line_tension_2),
    COLUMN(BT_COL_THRUST, "thrust", vessel_thrust),
    COLUMN(BT_COL_UNCONVERGED, "unconverged_step", unconverged),
    COLUMN(BT_COL_RESIDUAL, "residual", residual),
    COLUMN(BT_COL_COLLISION, "collision", collision_resistance),
    COLUMN(BT_COL_QUASI_STATIC, "push", largest_push),
};

double bt_history_largest(const double *x, int64_t from, int64_t to)
{
    double most = NAN;
    for (int64_t i = from; i < to; i++)
        if (!(x[i] <= most)) most = x[i];
    return most;
}

static double added_energy(const bt_sample *s) { return s->contact_work > WORK_ROUNDING * s->kinetic_energy; }

#define TOTAL(type, member, rule_, from)                                                                               \
    {                                                                                                                  \
        .at = {#member, BT_ITEM_##type, 1, offsetof(bt_history, member)}, .rule = BT_TOTAL_##rule_,                    \
        .offset = offsetof(bt_sample, from)                                                                            \
    }
#define LATER(type, member, rule_, from, missing_)                                                                     \
    {                                                                                                                  \
        .at = {#member, BT_ITEM_##type, 1, offsetof(bt_history, member)}, .rule = BT_TOTAL_##rule_,                    \
        .offset = offsetof(bt_sample, from), .missing = BT_TOTAL_##missing_                                            \
    }
const bt_total bt_history_totals[BT_N_TOTALS] = {
    TOTAL(F64, sum_contacts, SUM, contacts),
    TOTAL(F64, sum_sweeps, SUM, sweeps),
    TOTAL(F64, sum_updates, SUM, unit_updates),
    TOTAL(F64, sum_moves, SUM, momentum_moves),
    LATER(F64, sum_checks, SUM, residual_checks, UNKNOWN),
    LATER(F64, sum_projected, SUM, position_updates, UNKNOWN),
    TOTAL(F64, contact_work, SUM, contact_work),
    TOTAL(F64, max_overlap, MAX, overlap),
    TOTAL(F64, max_momentum_residual, MAX, momentum_residual),
    TOTAL(F64, max_residual, MAX, residual),
    TOTAL(F64, crushed_work, SUM, crushed_work),
    TOTAL(F64, max_crushed_depth, MAX, crushed_depth),
    TOTAL(F64, max_crushing, MAX, crushing),
    TOTAL(I64, crushing_steps, STEPS, crushing),
    LATER(F64, rafting, LAST, rafting, ZERO),
    LATER(F64, rafted_area, LAST, rafted_area, ZERO),
    LATER(F64, rafted_energy, LAST, rafted_energy, ZERO),
    LATER(F64, max_rafted_area, MAX, rafted_area, ZERO),
    LATER(F64, rafted_largest, MAX, rafted_largest, ZERO),
    LATER(F64, raft_edge_work, SUM, raft_edge_work, ZERO),
    LATER(F64, raft_friction_work, SUM, raft_friction_work, ZERO),
    TOTAL(I64, unconverged, STEPS, unconverged),
    LATER(F64, locked_steps, STEPS, locked, UNKNOWN),
    TOTAL(I64, unprojected, STEPS, unprojected),
    {.at = {"positive_work", BT_ITEM_I64, 1, offsetof(bt_history, positive_work)},
     .rule = BT_TOTAL_STEPS,
     .of = added_energy},
    TOTAL(I64, restitution_cut, STEPS, restitution_cut),
    TOTAL(I64, repeats, SUM, repeats),
    TOTAL(I64, outrun, STEPS, outrun),
};

/// A step into a total. Counts of whole numbers are exact in a double up to 2⁵³, far beyond any run.
static void add_total(bt_history *h, const bt_total *t, const bt_sample *s)
{
    double x = 0, sum = 0;
    int64_t whole = 0;
    char *at = (char *)h + t->at.offset;
    if (t->of) x = t->of(s);
    else memcpy(&x, (const char *)s + t->offset, sizeof x);
    if (t->rule == BT_TOTAL_STEPS) x = x != 0;
    if (t->at.type == BT_ITEM_I64) {
        memcpy(&whole, at, sizeof whole);
        whole += (int64_t)x;
        memcpy(at, &whole, sizeof whole);
    } else {
        memcpy(&sum, at, sizeof sum);
        sum = t->rule == BT_TOTAL_MAX ? bt_max_seen(sum, x) : t->rule == BT_TOTAL_LAST ? x : sum + x;
        memcpy(at, &sum, sizeof sum);
    }
}

const char *bt_history_name(int k, char name[BT_HISTORY_NAME])
{
    if (k < BT_N_COLUMNS) snprintf(name, BT_HISTORY_NAME, "%s", columns[k].name);
    else snprintf(name, BT_HISTORY_NAME, BT_HISTORY_ADDED "%s", bt_added(k - BT_N_COLUMNS)->name);
    return name;
}

void bt_history_init(bt_history *h) { *h = (bt_history){.n_columns = BT_N_COLUMNS + bt_n_added()}; }

void bt_history_free(bt_history *h)
{
    for (int k = 0; k < h->n_columns; k++) free(h->column[k]);
    bt_history_init(h);
}

void bt_history_add(bt_history *h, const bt_sample *s)
{
    if (h->n == h->cap) {
        h->cap = h->cap ? 2 * h->cap : 1024;
        for (int k = 0; k < h->n_columns; k++)
            h->column[k] = bt_realloc(h->column[k], (size_t)h->cap, sizeof(double));
    }
    for (int k = 0; k < BT_N_COLUMNS; k++)
        h->column[k][h->n] = *(const double *)(const void *)((const char *)s + columns[k].offset);
    for (int k = BT_N_COLUMNS; k < h->n_columns; k++)
        h->column[k][h->n] = bt_sample_value(s, bt_added(k - BT_N_COLUMNS));
    h->n++;
    for (int k = 0; k < BT_N_TOTALS; k++) add_total(h, &bt_history_totals[k], s);
}
