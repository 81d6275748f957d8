// SPDX-License-Identifier: MIT
// What the summary keeps of every step of a run.
#ifndef BT_HISTORY_H
#define BT_HISTORY_H

#include "base/snapshot.h"
#include "contact/law.h"
#include "output/sample.h"

/// Columns of what the summary keeps of every step; names and members of the sample: history.c.
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
    BT_COL_QUASI_STATIC,
    BT_COL_SPEED_ICE,
    BT_COL_LEEWAY_ICE,
    BT_COL_SPEED_WATER,
    BT_COL_LEEWAY_WATER,
    BT_COL_IN_ICE_X,
    BT_COL_IN_ICE_Y,
    BT_COL_VX, ///< over ground
    BT_COL_VY,
    BT_COL_YAW,
    BT_COL_NO_LOAD,
    BT_N_COLUMNS
} bt_column;

/// What the summary keeps of every step, whatever output.sample_every says: 200 bytes a step.
/// A load that is no number (bt_sample.no_load) is kept as the last one before it, 0 at the start: it has no bound, so
/// any number is below it, and means, percentiles and peaks of what is kept are the least that they can be.
typedef struct bt_history {
    int64_t n, cap;
    int n_columns;                   ///< the program's own, then one for each registered quantity
    /// [n] each, units as in bt_sample; NaN where a step has no such number
    double *column[BT_N_COLUMNS + BT_MAX_ADDED];
    // running totals: bt_history_total
    double sum_contacts, sum_sweeps, sum_updates, sum_moves, sum_checks, sum_projected, contact_work;
    double max_overlap, max_momentum_residual, max_residual;
    double locked_steps, no_load_steps;
    int64_t unconverged, unprojected, positive_work, restitution_cut, repeats, outrun, misjudged;
    bt_total_value laws[BT_MAX_LAW_TOTALS]; ///< of the contact laws, in their order (contact/law.h)
} bt_history;

enum { BT_HISTORY_NAME = 80 };

/// A running total: its member of bt_history, what it takes of a step, and how.
typedef struct bt_total {
    bt_state_row at;                      ///< name in the checkpoint, under history
    bt_total_rule rule;
    size_t offset;                        ///< of the number in bt_sample
} bt_total;
int bt_n_history_totals(void);
const bt_total *bt_history_total(int k);

/// Name of a column in the checkpoint; returns name.
#define BT_HISTORY_ADDED "history/added_"
const char *bt_history_name(int k, char name[BT_HISTORY_NAME]);
/// The column of the program's own, k < BT_N_COLUMNS, as it is in a checkpoint.
const bt_state_row *bt_history_column(int k);

/// The larger of the two, and NaN when one of them is: a maximum must not hide it.
static inline double bt_max_seen(double a, double b) { return a >= b || a != a ? a : b; }

/// Largest of x[from..to), NaN for none of them.
double bt_history_largest(const double *x, int64_t from, int64_t to);

/// Empty, with a column for each quantity that has been registered by now.
void bt_history_init(bt_history *h);
void bt_history_add(bt_history *h, const bt_sample *s);
void bt_history_free(bt_history *h);

#endif
