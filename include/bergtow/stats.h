// SPDX-License-Identifier: MIT
// Mean, interval and trend of a correlated time series, and the start of its steady window.
#ifndef BERGTOW_STATS_H
#define BERGTOW_STATS_H

#include "bergtow/base.h"

BT_BEGIN_C

typedef struct bt_mean {
    double mean, sd;    ///< of the samples
    double se;          ///< standard error of the mean, from the lowest frequencies of the series; NaN if n < 2
    double low, high;   ///< 95 % interval of the mean, 3.182 standard errors to either side; NaN if n < 2
    double tau;         ///< correlation time in samples, at least ½, the value of white noise
    double n_eff;       ///< n / (2τ)
    int64_t n;
} bt_mean;

/// A straight line through a series.
typedef struct bt_trend {
    /// of the line from the first sample to the last, in the unit of the series; NaN if n < BT_TREND_LEAST
    double change;
    double se;          ///< its standard error with correlation
    double low, high;   ///< the interval, which misses 0 in 5 % of all series without drift
    bool significant;   ///< the interval does not contain 0
} bt_trend;

enum { BT_TREND_LEAST = 12 }; ///< with fewer samples there is no trend

/// Mean, standard error and interval of x[n], spaced evenly. The method and its measured coverage: src/base/stats.c.
/// Linear in n.
bt_mean bt_stats_mean(const double *x, int64_t n);

/// Does the mean of x[n] drift? Least squares on batch means, with the correlation of the residuals. Linear in n.
bt_trend bt_stats_trend(const double *x, int64_t n);

/// Means of the four quarters of x[n]; NaN for a quarter without samples.
void bt_stats_quarters(const double *x, int64_t n, double quarter[4]);

enum { BT_STATS_STARTS = 4096 }; ///< most starts of a window that are tried

/// Step between the starts of a window that are tried in n samples: 5, doubled until at most BT_STATS_STARTS starts are
/// left. So sums between any two starts take bounded memory, and the start found is late by at most n /
/// BT_STATS_STARTS.
int64_t bt_stats_start_step(int64_t n);

/// Start of the steady window of x[n]: that of MSER-5 (White 1997, Simulation 69), the truncation point that minimises
/// the variance of the mean of batches of 5, searched over the first half of the samples after `first` in steps of
/// bt_stats_start_step(n - first). It is accepted only if a rank test, insensitive to single large values,
/// distinguishes the truncated part from the rest, and its mean differs, or its standard deviation is larger, by more
/// than `material` of the mean of the rest; otherwise `first`, as for n - first < BT_TREND_LEAST. A transient shorter
/// than 2 % of the series is not distinguished from a single large value. Returns an index in [first,
/// bt_stats_last_start(n, first)].
int64_t bt_stats_steady_start(const double *x, int64_t n, int64_t first, double material);

/// The last start tried: a minimum there is the end of the search, not a minimum of the series.
int64_t bt_stats_last_start(int64_t n, int64_t first);

BT_END_C

#endif
