// SPDX-License-Identifier: MIT
// What the summary keeps of every step of a run.
#ifndef BT_HISTORY_H
#define BT_HISTORY_H

#include "output/record.h"

/// Columns of what the summary keeps of every step; names and members of the sample: bt_history_columns.
typedef enum bt_column {
    BT_COL_TIME,
    BT_COL_ICE,
    BT_COL_TOW,
    BT_COL_DRAG,
    BT_COL_CORIOLIS,
    BT_COL_TILT,
    BT_COL_INERTIA,
    BT_COL_BUDGET,
    BT_COL_TENSION_1,
    BT_COL_TENSION_2,
    BT_COL_THRUST,
    BT_COL_UNCONVERGED,
    BT_COL_RESIDUAL,
    BT_COL_COLLISION,
    BT_COL_PUSH,
    BT_N_COLUMNS
} bt_column;

typedef struct bt_column_def {
    const char *name;   ///< in the checkpoint, under history/
    size_t offset;      ///< of the number in bt_sample
} bt_column_def;

extern const bt_column_def bt_history_columns[BT_N_COLUMNS];

/// What the summary keeps of every step, whatever output.sample_every says: 120 bytes a step.
typedef struct bt_history {
    int64_t n, cap;
    double *column[BT_N_COLUMNS];    ///< [n] each, contacts as in bt_sample; NaN where a step has no such number
    double *law[BT_MAX_FORCE_LAWS];  ///< [n] each of the first n_laws: bt_sample.law_force
    int n_laws;
    double sum_contacts, sum_sweeps, sum_updates, sum_moves, contact_work;
    double max_overlap, max_momentum_residual, max_residual;
    double crushed_work, max_crushed_depth, max_crushing; ///< J, m, contact points
    int64_t crushing_steps;
    double rafting, rafted_area, rafted_energy;  ///< in the last step, as in bt_sample
    double max_rafted_area, rafted_largest, raft_edge_work, raft_friction_work; ///< m², m², J, J
    int64_t unconverged, unprojected, positive_work, restitution_cut, repeats, outrun;
} bt_history;

/// Column k of the history, those of force laws after the others: its place, and its name in the checkpoint (NAME of
/// the force law's series).
static inline double **bt_history_column(bt_history *h, int k)
{
    return k < BT_N_COLUMNS ? &h->column[k] : &h->law[k - BT_N_COLUMNS];
}
void bt_history_name(int k, char name[80]);

/// The larger of the two, and NaN when one of them is: a maximum must not hide it.
static inline double bt_max_seen(double a, double b) { return a >= b || a != a ? a : b; }

/// Largest of x[from..to), NaN for none of them.
double bt_history_largest(const double *x, int64_t from, int64_t to);

/// Empty, with a column for every series of a force law.
void bt_history_init(bt_history *h);
void bt_history_add(bt_history *h, const bt_sample *s);
void bt_history_free(bt_history *h);

#endif
