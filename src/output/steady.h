// SPDX-License-Identifier: MIT
// One window of a run for all its reported series, and a verdict on whether they are those of a steady tow.
//
//     | ramp |  start-up  |  window: means, intervals, percentiles, peaks  |
//     0    earliest     start                                             end
//
// Start. Given by output.window_start; otherwise the latest of the points that bt_stats_steady_start finds (MSER-5) in
// each reported series between the end of the ramp and halfway to the end of the run: the ice resistance may be steady
// long before the tension of the line.
// Verdict:
//     not steady   the window begins within the ramp, a reported series has a trend, the tow, its course or the body
//                  changes within the window, the body enters its own wake, leaves the ice (case/track.h) or stands
//                  still, or the contacts were not solved: the mean is valid for this time only, and says nothing
//                  of a longer tow
//     too short    there is no window, or it has fewer than BT_STEADY_INDEPENDENT independent samples of some load by
//                  its correlation time, n / (2 tau), contact with ice worth fewer than BT_STEADY_STRETCHES equal
//                  stretches, or less than two swings of a body on its line. n_eff of the ice resistance, which
//                  pauses lower, is shown and not judged: the limits were measured for the other two
//     steady       none of these was found
#ifndef BT_STEADY_H
#define BT_STEADY_H

#include "bergtow/stats.h"
#include "output/history.h"
#include "output/totals.h"

/// with fewer the interval covers the mean in less than 93 % of all cases (measured, src/base/stats.c)
#define BT_STEADY_INDEPENDENT 20
/// likewise for contact, in equal stretches: in 200 fields each of 2, 5, 10 and 20 % ice the interval contains the mean
/// of the others in 53, 87 and 91 % of windows worth up to 3, 3 to 7 and 7 to 10 stretches, and in 94 % of those worth
/// more
#define BT_STEADY_STRETCHES 10
#define BT_STEADY_MATERIAL 0.02     ///< change over the window / mean below which a trend does not matter, assumed
#define BT_STEADY_UNCONVERGED 0.01  ///< largest share of unconverged steps in the window, assumed
#define BT_STEADY_RESIDUAL 0.1      ///< largest residual of a step in the window / reference speed, assumed
#define BT_STEADY_STALLED 0.05      ///< largest share of the run in which the body stood still, assumed
#define BT_STEADY_MISSED 0.05       ///< largest share of the places ahead of a moving window that stayed empty, assumed

typedef enum bt_verdict { BT_STEADY, BT_NOT_STEADY, BT_TOO_SHORT } bt_verdict;

/// "steady", "not steady", "too short".
extern const char *const bt_verdict_names[];

/// Series whose means are reported.
typedef enum bt_reported_series {
    BT_REPORTED_ICE,
    BT_REPORTED_TOW,
    BT_REPORTED_DRAG,
    BT_REPORTED_TENSION_1,
    BT_REPORTED_TENSION_2,
    BT_REPORTED_THRUST,
    BT_N_REPORTED
} bt_reported_series;

/// A series whose mean is reported, over the window.
typedef struct bt_reported {
    const char *name, *key; ///< in a sentence; in summary.json
    bool present;           ///< the run has it over the whole window
    bt_mean mean;           ///< N
    bt_trend trend;         ///< N
    double quarter[4];      ///< means of the window's quarters, N
    double peak;            ///< largest step mean in the window, N
    double start_peak;      ///< largest before the window, N; NaN without steps there
} bt_reported;

typedef struct bt_steady {
    bt_verdict verdict;
    bt_errors reasons;            ///< of a verdict other than steady (case/warning.h); release them
    double earliest, start, end;  ///< s; start and end NaN without a window
    double correlation_time;      ///< of the ice resistance, s
    double unconverged;           ///< share of the steps in the window that did not converge
    double residual;              ///< largest of them, m/s
    double no_load;               ///< share of the steps in the window in which the load of the body is not a number
    bool at_least;                ///< there are such steps: means, percentiles and peaks of the loads are lower bounds
    double stretches;             ///< equivalent number of stretches of contact with ice, INFINITY if it hardly varies
    bool met_no_ice;              ///< there is ice, but none has touched the body within the window
    bool given;                   ///< start given by output.window_start, not found
    int64_t first, n;             ///< steps
    int64_t put_off;              ///< steps from the earliest possible start to the first
    double path_at[2];            ///< path of the towing end at start and end, m (bt_path_at); mode speed: of the body
    bool turns;                   ///< the course of the tow changes within the window, or that of the body behind it
    bool changes_speed;           ///< the ordered speed changes within the window
    bt_reported series[BT_N_REPORTED];
} bt_steady;

/// The larger of the two branches' peaks in the window, or before it, N; NaN without a line.
double bt_steady_peak_tension(const bt_steady *steady, bool before);

/// For a run without a towed body: all unknown.
void bt_steady_none(bt_steady *steady);

/// Find the window of a run with a towed body.
void bt_steady_find(bt_steady *steady, const bt_history *history, const bt_case *input, const bt_run_totals *totals);

#endif
