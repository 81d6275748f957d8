// SPDX-License-Identifier: MIT
// Collisions in the window of a run and before it: numbers, the largest, the largest peaks; see impact_count.h.
#include "output/impact_count.h"

#include <string.h>

#include "base/inside.h"
#include "base/units.h"

void bt_impact_count_init(bt_impact_count *count, const bt_impacts *impacts, const bt_history *history,
                          const bt_steady *steady)
{
    const double *push = history->column[BT_COL_QUASI_STATIC];
    *count = (bt_impact_count){.start = steady->start, .hours = (double)steady->n * impacts->dt / 3600,
                               .start_peak = NAN};
    bt_impact_describe(&impacts->rule, count->conversion);
    count->peaks = bt_alloc(BT_IMPACT_PEAKS, sizeof *count->peaks);
    count->panel = bt_alloc((size_t)impacts->panels.n, sizeof *count->panel);
    count->collision_resistance = bt_stats_mean(steady->n ? history->column[BT_COL_COLLISION] + steady->first : NULL,
                                                steady->n).mean;
    count->quasi_static_resistance = steady->series[BT_REPORTED_ICE].mean.mean - count->collision_resistance;
    count->largest_quasi_static_load = bt_history_largest(push, steady->first, history->n);
    count->start_quasi_static_load = bt_history_largest(push, 0, steady->first);
}

void bt_impact_count_free(bt_impact_count *count)
{
    free(count->peaks);
    free(count->panel);
    *count = (bt_impact_count){0};
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

static void keep_peak(bt_impact_count *count, double peak)
{
    if (count->n_peaks == BT_IMPACT_PEAKS) {
        if (peak <= count->peaks[0]) return;
        count->peaks[0] = peak;
        sift_down(count->peaks, count->n_peaks, 0);
        return;
    }
    int64_t i = count->n_peaks++;
    for (; i > 0 && count->peaks[(i - 1) / 2] > peak; i = (i - 1) / 2) count->peaks[i] = count->peaks[(i - 1) / 2];
    count->peaks[i] = peak;
}

void bt_impact_count_peaks(const bt_impact_count *count, double *peaks)
{
    if (count->n_peaks == 0) return;
    memcpy(peaks, count->peaks, (size_t)count->n_peaks * sizeof *peaks);
    qsort(peaks, (size_t)count->n_peaks, sizeof *peaks, bt_descending);
}

// --- counting --------------------------------------------------------------------------------------------------------

void bt_impact_count_add(bt_impact_count *count, const bt_impact *impact)
{
    bt_panel_hits *hits = &count->panel[(int)impact->panel];
    count->n_all++;
    if (!(impact->time >= count->start)) {
        if (!(impact->peak <= count->start_peak)) count->start_peak = impact->peak;
        hits->start_peak = bt_max(hits->start_peak, impact->peak);
        return;
    }
    if (count->n++ == 0 || impact->peak > count->largest.peak) count->largest = *impact;
    keep_peak(count, impact->peak);
    hits->n++;
    hits->peak = bt_max(hits->peak, impact->peak);
}

// --- in the summary --------------------------------------------------------------------------------------------------

// Exceedance. Of n peaks in the time T, largest first, F_k is reached or exceeded k times, at the rate k/T. The table
// has the ranks 1, 2, 5, 10, ..., without fits or interpolation. A rate near 1/T rests on a single peak.

/// The k-th of 1, 2, 5, 10, 20, ...
static int64_t rank_of(int k)
{
    static const int64_t of[] = {1, 2, 5};
    int64_t r = of[k % 3];
    for (int i = 0; i < k / 3; i++) r *= 10;
    return r;
}

static double *sorted(const bt_impact_count *count)
{
    double *p = bt_alloc((size_t)count->n_peaks + 1, sizeof *p);
    bt_impact_count_peaks(count, p);
    return p;
}

void bt_impacts_exceedance(bt_json *json, const char *key, const bt_impact_count *count)
{
    double *peaks = sorted(count);
    bt_json_open(json, key, '[');
    for (int k = 0; rank_of(k) <= count->n_peaks; k++) {
        bt_json_open(json, NULL, '{');
        bt_json_int(json, "rank", rank_of(k));
        bt_json_number(json, "per_hour", (double)rank_of(k) / count->hours);
        bt_json_number(json, "peak_n", peaks[rank_of(k) - 1]);
        bt_json_close(json, '}');
    }
    bt_json_close(json, ']');
    free(peaks);
}

void bt_impacts_print(const bt_impact_count *count, bool at_least)
{
    if (!count || !(count->hours > 0)) return;
    char a[32], b[32];
    const char *least = at_least ? "at least " : "";
    printf("  collisions          %lld in the window from %g s on, %.3g an hour; %s%s of the mean resistance, ",
           (long long)count->n, count->start, (double)count->n / count->hours, least,
           bt_force_text(a, count->collision_resistance));
    if (at_least) printf("the quasi-static rest has no bound\n");
    else printf("quasi-static %s\n", bt_force_text(b, count->quasi_static_resistance));
    if (count->n > 0) {
        printf("    peaks%s (%s)", at_least ? ", at least" : "", count->conversion);
        double *peaks = sorted(count);
        // A few of the ranks: the largest, then tenfold.
        for (int k = 0; rank_of(k) <= count->n_peaks; k += 3)
            printf("%s %s at %.3g/h", k ? "," : ":", bt_force_text(a, peaks[rank_of(k) - 1]),
                   (double)rank_of(k) / count->hours);
        printf("; largest quasi-static load %s%s\n", least, bt_force_text(a, count->largest_quasi_static_load));
        free(peaks);
    }
    if (count->n_all > count->n)
        printf("    start             %lld before the window, the largest peak %s, the largest quasi-static load %s\n",
               (long long)(count->n_all - count->n), bt_force_text(a, count->start_peak),
               bt_force_text(b, count->start_quasi_static_load));
}
