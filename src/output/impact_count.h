// SPDX-License-Identifier: MIT
// Collisions and quasi-static loads counted over the window of a run, which is known only when the run ends (private to
// the recorder). On rank 0.
//
// A collision belongs to the window if the step in which it begins does: time >= start. Earlier collisions are counted
// separately. They are read back piece by piece from the file to which they were written, 104 B each: a million of them
// take 104 MB on disk, but in memory only the largest peaks (80 kB) and one piece (0.9 MB). Values per step (resistance
// by collisions and quasi-static, largest quasi-static load) are columns of the history. Rejected: counters that
// restart when the start found moves, as it may also move backwards; all peaks in memory.
#ifndef BT_IMPACT_COUNT_H
#define BT_IMPACT_COUNT_H

#include "base/json.h"
#include "loads/impact.h"
#include "output/history.h"
#include "output/steady.h"

enum { BT_IMPACT_PEAKS = 10000 }; ///< the largest peaks kept for the exceedance table

/// Collisions on one panel.
typedef struct bt_panel_hits {
    int64_t n;            ///< in the window
    double peak;          ///< largest of them, N
    double start_peak;    ///< largest before, N
} bt_panel_hits;

typedef struct bt_impact_count {
    char conversion[160]; ///< its description
    double start;         ///< of the window, s; NaN without one
    double hours;         ///< its length
    int64_t n_all, n;     ///< collisions of the whole run, in the window
    bt_impact largest;    ///< by peak, in the window
    double start_peak;    ///< largest before it, N; NaN without a collision there
    double *peaks;        ///< [n_peaks] of the window, a heap with the smallest first, N
    int64_t n_peaks;
    bt_panel_hits *panel; ///< [panels]
    double collision_resistance, quasi_static_resistance; ///< means over the window, N
    /// of one floe in a step, in the window and before it, N; NaN without a step there
    double largest_quasi_static_load, start_quasi_static_load;
} bt_impact_count;

/// Begin to count over the window; values per step are taken at once.
void bt_impact_count_init(bt_impact_count *count, const bt_impacts *impacts, const bt_history *history,
                          const bt_steady *steady);
void bt_impact_count_free(bt_impact_count *count);

/// Count a collision of the run; in any order.
void bt_impact_count_add(bt_impact_count *count, const bt_impact *impact);

/// Copy the largest peaks to peaks[n_peaks], largest first.
void bt_impact_count_peaks(const bt_impact_count *count, double *peaks);

// --- in the summary --------------------------------------------------------------------------------------------------

/// Write an array of ranks, each with its peak and how often that is reached or exceeded.
void bt_impacts_exceedance(bt_json *json, const char *key, const bt_impact_count *count);
/// Print two lines of the table; nothing if `count` is NULL. at_least: the loads are lower bounds.
void bt_impacts_print(const bt_impact_count *count, bool at_least);

#endif
