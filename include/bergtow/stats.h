// SPDX-License-Identifier: MIT
// Mean, standard error from the autocorrelation, and the steady window of a time series.
#ifndef BERGTOW_STATS_H
#define BERGTOW_STATS_H

#include "bergtow/base.h"

typedef struct bt_mean {
    double mean, sd;   ///< of the samples
    double se;         ///< standard error of the mean with correlation, sd·√(2τ/n); NaN when n < 2
    double tau;        ///< integrated autocorrelation time in samples, ½ for white noise
    double n_eff;      ///< n / (2τ)
    int64_t n;
} bt_mean;

/// Mean and standard error of x[n], spaced evenly: integrated autocorrelation time with Sokal's self-consistent
/// window M ≥ 5τ (Sokal 1997, "Monte Carlo methods in statistical mechanics", §3), corrected for the bias of the
/// sample mean. Linear in n: the lags beyond the window are never formed.
bt_mean bt_stats_mean(const double *x, int64_t n);

/// Start of the steady window of x[n]: MSER-5 (White 1997, Simulation 69): the truncation point that minimises the
/// variance of the mean of batches of 5, searched over the first half. Returns an index in [first, n/2 or first].
int64_t bt_stats_steady_start(const double *x, int64_t n, int64_t first);

#endif
