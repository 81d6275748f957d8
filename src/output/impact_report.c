// SPDX-License-Identifier: MIT
// Collisions as numbers for scripts and readers: how many, the largest, how often a peak is exceeded.
//
// Exceedance. Of n peaks in the time T, largest first, F_k is reached or exceeded k times: at the rate k/T. The table
// takes the ranks 1, 2, 5, 10, ...; nothing is fitted and nothing between ranks is made up. A rate near 1/T rests on
// one peak.
#include "output/impact_report.h"
#include "base/units.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "output/summary.h"

/// The k-th of 1, 2, 5, 10, 20, ...
static int64_t rank_of(int k)
{
    static const int64_t of[] = {1, 2, 5};
    int64_t r = of[k % 3];
    for (int i = 0; i < k / 3; i++) r *= 10;
    return r;
}

static double *sorted(const bt_impact_count *c)
{
    double *p = bt_alloc((size_t)c->n_peaks + 1, sizeof *p);
    bt_impact_count_peaks(c, p);
    return p;
}

void bt_impacts_exceedance(bt_json *j, const char *key, const bt_impact_count *c)
{
    double *peaks = sorted(c);
    bt_json_open(j, key, '[');
    for (int k = 0; rank_of(k) <= c->n_peaks; k++) {
        bt_json_open(j, NULL, '{');
        bt_json_int(j, "rank", rank_of(k));
        bt_json_number(j, "per_hour", (double)rank_of(k) / c->hours);
        bt_json_number(j, "peak_n", peaks[rank_of(k) - 1]);
        bt_json_close(j, '}');
    }
    bt_json_close(j, ']');
    free(peaks);
}

void bt_impacts_print(const bt_impact_count *c, bool at_least)
{
    if (!c || !(c->hours > 0)) return;
    char a[32], b[32];
    const char *least = at_least ? "at least " : "";
    printf("  collisions          %lld in the window from %g s on, %.3g an hour; %s%s of the mean resistance, ",
           (long long)c->n, c->start, (double)c->n / c->hours, least, bt_force_text(a, c->collision_resistance));
    if (at_least) printf("the quasi-static rest has no bound\n");
    else printf("quasi-static %s\n", bt_force_text(b, c->quasi_static_resistance));
    if (c->n > 0) {
        printf("    peaks%s (%s)", at_least ? ", at least" : "", c->conversion);
        double *peaks = sorted(c);
        // A few of the ranks: the largest, then tenfold.
        for (int k = 0; rank_of(k) <= c->n_peaks; k += 3)
            printf("%s %s at %.3g/h", k ? "," : ":", bt_force_text(a, peaks[rank_of(k) - 1]),
                   (double)rank_of(k) / c->hours);
        printf("; largest quasi-static load %s%s\n", least, bt_force_text(a, c->largest_quasi_static_load));
        free(peaks);
    }
    if (c->n_all > c->n)
        printf("    start             %lld before the window, the largest peak %s, the largest quasi-static load %s\n",
               (long long)(c->n_all - c->n), bt_force_text(a, c->start_peak),
               bt_force_text(b, c->start_quasi_static_load));
}
