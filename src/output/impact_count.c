// SPDX-License-Identifier: MIT
// Collisions in the window of a run and before it: numbers, the largest, the largest peaks; see impact_count.h.
#include "output/impact_count.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/units.h"
#include "output/summary.h"

void bt_impact_count_init(bt_impact_count *c, const bt_impacts *m, const bt_history *h, const bt_steady *w)
{
    const double *push = h->column[BT_COL_QUASI_STATIC];
    *c = (bt_impact_count){.start = w->start, .hours = (double)w->n * m->dt / 3600, .start_peak = NAN};
    bt_impact_describe(&m->rule, c->conversion);
    c->peaks = bt_alloc(BT_IMPACT_PEAKS, sizeof *c->peaks);
    c->panel = bt_alloc((size_t)m->panels.n, sizeof *c->panel);
    c->collision_resistance = bt_stats_mean(w->n ? h->column[BT_COL_COLLISION] + w->first : NULL, w->n).mean;
    c->quasi_static_resistance = w->series[BT_REPORTED_ICE].mean.mean - c->collision_resistance;
    c->largest_quasi_static_load = bt_history_largest(push, w->first, h->n);
    c->start_quasi_static_load = bt_history_largest(push, 0, w->first);
}

void bt_impact_count_free(bt_impact_count *c)
{
    free(c->peaks);
    free(c->panel);
    *c = (bt_impact_count){0};
}

// --- the largest peaks -----------------------------------------------------------------------------------------------

static void sift_down(double *heap, int64_t n, int64_t i)
{
    for (;;) {
        int64_t least = i;
        for (int64_t k = 2 * i + 1; k <= 2 * i + 2 && k < n; k++)
            if (heap[k] < heap[least]) least = k;
        if (least == i) return;
        const double x = heap[i];
        heap[i] = heap[least], heap[least] = x;
        i = least;
    }
}

static void keep_peak(bt_impact_count *c, double peak)
{
    if (c->n_peaks == BT_IMPACT_PEAKS) {
        if (peak <= c->peaks[0]) return;
        c->peaks[0] = peak;
        sift_down(c->peaks, c->n_peaks, 0);
        return;
    }
    int64_t i = c->n_peaks++;
    for (; i > 0 && c->peaks[(i - 1) / 2] > peak; i = (i - 1) / 2) c->peaks[i] = c->peaks[(i - 1) / 2];
    c->peaks[i] = peak;
}

static int descending(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;
    return (x < y) - (x > y);
}

void bt_impact_count_peaks(const bt_impact_count *c, double *peaks)
{
    if (c->n_peaks == 0) return;
    memcpy(peaks, c->peaks, (size_t)c->n_peaks * sizeof *peaks);
    qsort(peaks, (size_t)c->n_peaks, sizeof *peaks, descending);
}

// --- counting --------------------------------------------------------------------------------------------------------

void bt_impact_count_add(bt_impact_count *c, const bt_impact *e)
{
    bt_panel_hits *p = &c->panel[(int)e->panel];
    c->n_all++;
    if (!(e->time >= c->start)) {
        if (!(e->peak <= c->start_peak)) c->start_peak = e->peak;
        p->start_peak = bt_max(p->start_peak, e->peak);
        return;
    }
    if (c->n++ == 0 || e->peak > c->largest.peak) c->largest = *e;
    keep_peak(c, e->peak);
    p->n++;
    p->peak = bt_max(p->peak, e->peak);
}

// --- in the summary --------------------------------------------------------------------------------------------------

// Collisions as numbers for scripts and readers: how many, the largest, how often a peak is exceeded.
//
// Exceedance. Of n peaks in the time T, largest first, F_k is reached or exceeded k times: at the rate k/T. The table
// takes the ranks 1, 2, 5, 10, ...; nothing is fitted and nothing between ranks is made up. A rate near 1/T rests on
// one peak.

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
