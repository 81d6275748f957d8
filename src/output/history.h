// SPDX-License-Identifier: MIT
// Data that the summary keeps of every step of a run.
#ifndef BT_HISTORY_H
#define BT_HISTORY_H

#include "base/snapshot.h"
#include "contact/law.h"
#include "output/sample.h"

/// Columns that the summary keeps of every step: X(id, name in a checkpoint, member of bt_sample). Units and meaning
/// are those of the series of that member.
#define BT_HISTORY_COLUMNS(X) \
    X(TIME, "time", time) \
    X(ICE, "ice", ice_resistance) \
    X(TOW, "tow", tow_force) \
    X(DRAG, "drag", drag_force) \
    X(CORIOLIS, "coriolis", coriolis_force) \
    X(TILT, "tilt", tilt_force) \
    X(INERTIA, "inertia", inertia_force) \
    X(BUDGET, "budget", ice_resistance_budget) \
    X(TENSION_1, "tension_1", line_tension_1) \
    X(TENSION_2, "tension_2", line_tension_2) \
    X(THRUST, "thrust", vessel_thrust) \
    X(UNCONVERGED, "unconverged_step", unconverged) \
    X(RESIDUAL, "residual", residual) \
    X(COLLISION, "collision", collision_resistance) \
    X(QUASI_STATIC, "quasi_static", largest_quasi_static_load) \
    X(SPEED_ICE, "speed_through_ice", speed_through_ice) \
    X(LEEWAY_ICE, "leeway_through_ice", leeway_through_ice) \
    X(SPEED_WATER, "speed_through_water", speed_through_water) \
    X(LEEWAY_WATER, "leeway_through_water", leeway_through_water) \
    X(IN_ICE_X, "body_in_ice_x", body_in_ice_x) \
    X(IN_ICE_Y, "body_in_ice_y", body_in_ice_y) \
    X(VX, "body_vx", body_vx) \
    X(VY, "body_vy", body_vy) \
    X(YAW, "body_yaw", body_yaw) \
    X(NO_LOAD, "no_load", no_load)

typedef enum bt_column {
#define BT_COLUMN_ID(id, name, member) BT_COL_##id,
    BT_HISTORY_COLUMNS(BT_COLUMN_ID)
#undef BT_COLUMN_ID
    BT_N_COLUMNS
} bt_column;

/// Data of every step for the summary, whatever output.sample_every: 200 bytes per step.
/// A load that is not a number (bt_sample.no_load) is replaced by the last valid one, 0 at the start: it is unbounded,
/// so any number is below it, and means, percentiles and peaks of the column are lower bounds.
typedef struct bt_history {
    int64_t n, cap;
    int n_columns;                   ///< the program's own, then one for each registered quantity
    /// [n] each, units as in bt_sample; NaN if a step has no such number
    double *column[BT_N_COLUMNS + BT_MAX_ADDED];
    // running totals: bt_history_total
    double sum_contacts, sum_sweeps, sum_updates, sum_moves, sum_checks, sum_projected, contact_work;
    double max_overlap, max_momentum_residual, max_residual;
    double locked_steps, no_load_steps;
    int64_t unconverged, unprojected, positive_work, restitution_cut, repeats, outrun, misjudged;
    bt_total_value laws[BT_MAX_LAW_TOTALS]; ///< of the contact laws, in their order (contact/law.h)
} bt_history;

enum { BT_HISTORY_NAME = 80 };

/// A running total: its member of bt_history, the number of a step that it takes, and its rule.
typedef struct bt_total {
    bt_state_row at;                      ///< name in the checkpoint, under history
    bt_total_rule rule;
    size_t offset;                        ///< of the number in bt_sample
} bt_total;
int bt_n_history_totals(void);
const bt_total *bt_history_total(int k);

#define BT_HISTORY_ADDED "history/added_"
/// Column k of a history as stored in a checkpoint; its name there, with the group, is written to name.
bt_state_row bt_history_column(int k, char name[BT_HISTORY_NAME]);

/// The larger of the two, NaN if either is: a maximum must not hide it.
static inline double bt_max_seen(double a, double b) { return a >= b || a != a ? a : b; }

/// Largest of x[from..to), NaN if the range is empty.
double bt_history_largest(const double *x, int64_t from, int64_t to);

/// Make an empty history, with a column for each quantity registered so far.
void bt_history_init(bt_history *history);
void bt_history_add(bt_history *history, const bt_sample *sample);
void bt_history_free(bt_history *history);

#endif
