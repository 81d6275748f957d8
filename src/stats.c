// SPDX-License-Identifier: MIT
// Mean with its standard error from the autocorrelation, and the start of the steady window.
//
// Standard error (Sokal 1997, "Monte Carlo methods in statistical mechanics", §3; Wolff 2004, Comput. Phys. Commun.
// 156, eqs. 31–35, 49). With m the mean of x[n] and
//     G(t) = Σ_i (x_i − m)(x_{i+t} − m) / (n − t)                    autocovariance at lag t
//     C(M) = G(0) + 2 Σ_{t=1..M} G(t),   τ(M) = C(M) / (2 G(0))     integrated autocorrelation time, samples
// the window is the smallest M >= 5 τ(M): the sum up to infinity has finite mean and infinite noise, and beyond five
// times its own length an exponential correlation has less than 1 % left. Subtracting the sample's own mean takes
// var(m) = C/n off every G(t), hence the corrected
//     C' = C (1 + (2M + 1)/n),   se² = C'/n.
//
// A strongly correlated series would need many lags: n·M products. When the window has not closed after MAX_LAG lags
// the series is replaced by the means of neighbouring pairs, which leaves var(m) as it is and halves τ in samples
// (Goodman's acor does the same). So the cost is at most 2 MAX_LAG n. An FFT would form all the lags to drop most of them.
#include "bergtow/stats.h"

#include <math.h>
#include <stdlib.h>

#define MAX_LAG 256
#define MIN_CORRELATED 8 // below this a lag has too few products to mean anything: taken as white noise
#define BATCH 5

/// Mean in two passes: the second takes the rounding of the first out.
static double mean_of(const double *x, int64_t n)
{
    double sum = 0, rest = 0;
    for (int64_t i = 0; i < n; i++) sum += x[i];
    const double m = sum / (double)n;
    for (int64_t i = 0; i < n; i++) rest += x[i] - m;
    return m + rest / (double)n;
}

static double autocovariance(const double *d, int64_t n, int64_t lag)
{
    double sum = 0;
    for (int64_t i = 0; i + lag < n; i++) sum += d[i] * d[i + lag];
    return sum / (double)(n - lag);
}

/// var(m) of deviations d[n], which are overwritten by their pair means where the correlation is long.
static double variance_of_mean(double *d, int64_t n)
{
    for (;;) {
        const double g0 = autocovariance(d, n, 0);
        if (!(g0 > 0) || n < MIN_CORRELATED) return g0 / (double)(n > 1 ? n - 1 : 1);
        // Lags over n/2 pair the first half with the second only and carry no information on the fluctuation within.
        const int64_t last = n / 2 < MAX_LAG ? n / 2 : MAX_LAG;
        double c = g0;
        int64_t m = 0;
        bool closed = false;
        while (m < last && !closed) {
            m++;
            c += 2 * autocovariance(d, n, m);
            closed = (double)m >= 5 * c / (2 * g0);
        }
        if (closed || last < MAX_LAG) {
            const double corrected = c * (1 + (2 * (double)m + 1) / (double)n);
            // An anticorrelated series can bring C to zero or below it; but one sample more or less at the end
            // always moves the mean by about sd/n.
            return bt_max(corrected, g0 / (double)n) / (double)n;
        }
        n /= 2;
        for (int64_t i = 0; i < n; i++) d[i] = 0.5 * (d[2 * i] + d[2 * i + 1]);
    }
}

bt_mean bt_stats_mean(const double *x, int64_t n)
{
    bt_mean r = {.mean = NAN, .sd = NAN, .se = NAN, .tau = 0.5, .n_eff = (double)n, .n = n};
    if (n < 1) return r;
    r.mean = mean_of(x, n);
    if (n < 2) return r;

    double *d = bt_alloc((size_t)n, sizeof *d);
    double sum = 0, spread = 0;
    for (int64_t i = 0; i < n; i++) {
        d[i] = x[i] - r.mean;
        sum += d[i] * d[i];
        spread = bt_max(spread, fabs(x[i] - x[0]));
    }
    r.sd = sqrt(sum / (double)(n - 1));
    if (spread == 0 && isfinite(sum)) { // a constant series: the rounding of its mean is no fluctuation
        r.mean = x[0];
        r.sd = r.se = 0;
    } else if (isfinite(sum)) {
        const double var = variance_of_mean(d, n);
        r.se = sqrt(var);
        r.tau = (double)n * var / (2 * r.sd * r.sd);
        r.n_eff = (double)n / (2 * r.tau);
    } else {
        r.sd = r.se = r.tau = r.n_eff = NAN;
    }
    free(d);
    return r;
}

// MSER(d) = Σ_{j>=d} (Y_j − mean_d)² / (k − d)² over k batch means Y_j: the squared standard error that the batches
// from d on would have if they were independent. Backwards recursion (Welford) over d, so one pass. The minimum is
// searched in the first half of the series only: near the end few batches agree by chance.
int64_t bt_stats_steady_start(const double *x, int64_t n, int64_t first)
{
    if (first < 0) first = 0;
    if (first >= n) return first;
    const int64_t k = (n - first) / BATCH;
    double mean = 0, squares = 0, best = INFINITY;
    int64_t start = first;
    for (int64_t j = k - 1; j >= 0; j--) {
        const double *b = x + first + BATCH * j;
        const double y = (b[0] + b[1] + b[2] + b[3] + b[4]) / BATCH;
        const double count = (double)(k - j), delta = y - mean;
        mean += delta / count;
        squares += delta * (y - mean);
        const int64_t at = first + BATCH * j;
        if (at > n / 2 && j > 0) continue;
        const double mser = squares / (count * count);
        if (mser <= best) {
            best = mser;
            start = at;
        }
    }
    return start;
}
