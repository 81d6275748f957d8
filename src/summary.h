// SPDX-License-Identifier: MIT
// The numbers of a whole run: kept step by step, reduced over the steady window, written as JSON and as a table.
#ifndef BT_SUMMARY_H
#define BT_SUMMARY_H

#include "bergtow/estimate.h"
#include "bergtow/record.h"
#include "bergtow/stats.h"

/// What the summary keeps of every step, whatever output.sample_every says: 64 bytes a step.
typedef struct bt_history {
    int64_t n, cap;
    double *time;    ///< [n] s
    double *ice, *tow, *drag, *coriolis, *tilt, *inertia, *budget; ///< [n] N, as in bt_sample
    double sum_contacts, sum_sweeps, contact_work;
    double max_overlap, max_momentum_residual, max_residual;
    double peak_tension;             ///< NaN until there is a line
    double crushed_work, max_crushed_depth, max_crushing; ///< J, m, contact points
    int64_t crushing_steps;
    int64_t unconverged, positive_work, restitution_cut, repeats, outrun;
} bt_history;

/// The larger of the two, and NaN when one of them is: a maximum must not hide it.
static inline double bt_max_seen(double a, double b) { return a >= b || a != a ? a : b; }

void bt_history_init(bt_history *h);
void bt_history_add(bt_history *h, const bt_sample *s);
void bt_history_free(bt_history *h);

typedef struct bt_summary {
    bool body;                        ///< there is a towed body: the forces have a meaning
    double sim_time;                  ///< s
    struct {
        double start, end;            ///< s
        double correlation_time;      ///< τ Δt of the ice resistance, s
        bool given;                   ///< by output.window_start, not found by MSER-5
        int64_t first, n;             ///< steps
        const char *warning;          ///< into warnings, or NULL
    } window;
    bt_mean ice, tow, drag, coriolis, tilt, inertia, budget; ///< N, over the window
    double p95, p99, peak;            ///< N, of the step means of the ice resistance
    double balance;                   ///< mean tow − drag − Coriolis − tilt − inertia, N
    double closure, closure_relative; ///< mean ice − balance, N; over the largest of the means
    double budget_closure_relative;   ///< (mean ice − budget) over the largest of the means
    double contacts, sweeps;          ///< means over all steps
    double ns_per_floe_step;
    bt_estimate_input estimate;       ///< conditions of the estimates: the case's, with the ice as made
    double reference_ratio;           ///< mean ice / measured mean, NaN without a reference
    bt_errors warnings;
} bt_summary;

void bt_summary_make(bt_summary *s, const bt_history *h, const bt_case *c, const bt_run_totals *t, bt_idx n_floes,
                     bool body);
/// summary.json as text; the caller frees it.
char *bt_summary_json(const bt_summary *s, const bt_history *h, const bt_case *c, const bt_run_totals *t, bt_idx n_floes);
void bt_summary_print(const bt_summary *s, const bt_history *h, const bt_case *c, const bt_run_totals *t, bt_idx n_floes);
/// A force with a prefix that keeps three digits before the point; returns out.
const char *bt_force_text(char out[32], double newton);
void bt_summary_free(bt_summary *s);

#endif
