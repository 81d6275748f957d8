// SPDX-License-Identifier: MIT
// The numbers of a whole run: reduced over one window, written as JSON and as a table.
#ifndef BT_SUMMARY_H
#define BT_SUMMARY_H

#include "bergtow/estimate.h"
#include "bergtow/stats.h"
#include "case/arch.h"
#include "output/totals.h"
#include "output/steady.h"
#include "step/window.h"

enum { BT_EVENTS_REPORTED = 40 }; ///< most events listed; all are in result.h5

typedef struct bt_summary {
    bool body;                        ///< there is a towed body, so that forces are defined
    double sim_time;                  ///< s
    bt_steady window;
    bt_arch arch;                     ///< width of the domain against ice and body, as made; empty without a body
    bt_mean ice, tow, drag, coriolis, tilt, inertia, budget; ///< N, over the window
    double p95, p99, peak;            ///< N, of the step means of the ice resistance
    /// reductions of the registered quantities over the window, without a towed body over all steps
    double added[BT_MAX_ADDED];
    int n_added;                      ///< those of the run
    double balance;                   ///< mean tow − drag − Coriolis − tilt − registered forces − inertia, N
    double closure, closure_relative; ///< mean ice − balance, N; over the largest of the means
    double budget_closure_relative;   ///< (mean ice − budget) over the largest of the means
    double contacts, sweeps, updates, moves, checks, projected; ///< means over all steps
    double ns_per_floe_step;
    bt_estimate_input estimate;       ///< conditions of the estimates: the case's, with the ice as made
    double reference_ratio;           ///< mean ice / measured mean, NaN without a reference
    const struct bt_impact_count *impacts; ///< collisions over the window, NULL = not evaluated
    bt_errors warnings;
} bt_summary;

void bt_summary_make(bt_summary *summary, const bt_history *history, const bt_case *input, const bt_run_totals *totals,
                     bt_idx n_floes, bool body);
/// summary.json as text; the caller frees it.
char *bt_summary_json(const bt_summary *summary, const bt_history *history, const bt_case *input,
                      const bt_run_totals *totals, bt_idx n_floes);
void bt_summary_print(const bt_summary *summary, const bt_history *history, const bt_case *input,
                      const bt_run_totals *totals, bt_idx n_floes);
/// Mean ice resistance with which estimates are compared, N; NaN if the body met no ice in the window.
double bt_summary_held_against(const bt_summary *summary);
void bt_summary_free(bt_summary *summary);

/// Warn of a moving window that travels, or will travel, this many times its length through the ice.
void bt_summary_window_warn_laps(bt_errors *warnings, double laps);

#endif
