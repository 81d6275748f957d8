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

const bt_column_def bt_history_columns[BT_N_COLUMNS] = {
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
    COLUMN(BT_COL_PUSH, "push", largest_push),
};

double bt_history_largest(const double *x, int64_t from, int64_t to)
{
    double most = NAN;
    for (int64_t i = from; i < to; i++)
        if (!(x[i] <= most)) most = x[i];
    return most;
}

void bt_history_name(int k, char name[80])
{
    if (k < BT_N_COLUMNS) snprintf(name, 80, "%s", bt_history_columns[k].name);
    else snprintf(name, 80, "history/%s_force", bt_force_series_of[bt_law_series(k - BT_N_COLUMNS)].name);
}

void bt_history_init(bt_history *h) { *h = (bt_history){.n_laws = bt_n_law_series()}; }

void bt_history_free(bt_history *h)
{
    for (int k = 0; k < BT_N_COLUMNS + h->n_laws; k++) free(*bt_history_column(h, k));
    bt_history_init(h);
}

void bt_history_add(bt_history *h, const bt_sample *s)
{
    if (h->n == h->cap) {
        h->cap = h->cap ? 2 * h->cap : 1024;
        for (int k = 0; k < BT_N_COLUMNS + h->n_laws; k++) {
            double **x = bt_history_column(h, k);
            *x = bt_realloc(*x, (size_t)h->cap, sizeof(double));
        }
    }
    for (int k = 0; k < BT_N_COLUMNS; k++)
        h->column[k][h->n] = *(const double *)(const void *)((const char *)s + bt_history_columns[k].offset);
    for (int k = 0; k < h->n_laws; k++) h->law[k][h->n] = s->law_force[k];
    h->n++;
    h->sum_contacts += s->contacts;
    h->sum_sweeps += s->sweeps;
    h->sum_updates += s->unit_updates;
    h->sum_moves += s->momentum_moves;
    h->unprojected += s->unprojected != 0;
    h->contact_work += s->contact_work;
    h->max_overlap = bt_max_seen(h->max_overlap, s->overlap);
    h->max_residual = bt_max_seen(h->max_residual, s->residual);
    h->max_momentum_residual = bt_max_seen(h->max_momentum_residual, s->momentum_residual);
    h->crushed_work += s->crushed_work;
    h->max_crushed_depth = bt_max_seen(h->max_crushed_depth, s->crushed_depth);
    h->max_crushing = bt_max_seen(h->max_crushing, s->crushing);
    h->crushing_steps += s->crushing > 0;
    h->rafting = s->rafting;
    h->rafted_area = s->rafted_area;
    h->rafted_energy = s->rafted_energy;
    h->max_rafted_area = bt_max_seen(h->max_rafted_area, s->rafted_area);
    h->rafted_largest = bt_max_seen(h->rafted_largest, s->rafted_largest);
    h->raft_edge_work += s->raft_edge_work;
    h->raft_friction_work += s->raft_friction_work;
    h->unconverged += s->unconverged != 0;
    h->repeats += (int64_t)s->repeats;
    h->outrun += s->outrun != 0;
    h->restitution_cut += s->restitution_cut != 0;
    h->positive_work += s->contact_work > WORK_ROUNDING * s->kinetic_energy;
}
