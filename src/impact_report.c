// SPDX-License-Identifier: MIT
// Collisions as numbers for scripts and readers: how many, the largest, how often a peak is exceeded.
//
// Exceedance. Of n peaks in the time T, largest first, F_k is reached or exceeded k times: at the rate k/T. The table takes the ranks
// 1, 2, 5, 10, ...; nothing is fitted and nothing between ranks is made up. A rate near 1/T rests on one peak.
#include "impact_report.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

static double hours(const bt_impacts *m) { return (double)m->steps * m->dt / 3600; }

/// The k-th of 1, 2, 5, 10, 20, ...
static int64_t rank_of(int k)
{
    static const int64_t of[] = {1, 2, 5};
    int64_t r = of[k % 3];
    for (int i = 0; i < k / 3; i++) r *= 10;
    return r;
}

static double *sorted(const bt_impacts *m)
{
    double *p = bt_alloc((size_t)m->n_peaks + 1, sizeof *p);
    bt_impacts_sorted_peaks(m, p);
    return p;
}

void bt_impacts_json(bt_json *j, const bt_impacts *m)
{
    if (!m) {
        bt_json_string(j, "impacts", NULL);
        return;
    }
    char text[160];
    bt_impact_describe(&m->rule, text);
    const double time = hours(m);
    bt_json_open(j, "impacts", '{');
    bt_json_string(j, "conversion", text);
    bt_json_number(j, "from_s", m->from);
    bt_json_number(j, "hours", time);
    bt_json_int(j, "collisions_whole_run", m->n_all);
    bt_json_int(j, "collisions", m->n);
    bt_json_number(j, "collisions_per_hour", time > 0 ? (double)m->n / time : NAN);
    bt_json_number(j, "mean_collision_resistance_n", m->steps > 0 ? m->sum_collision / ((double)m->steps * m->dt) : NAN);
    bt_json_number(j, "mean_push_resistance_n", m->steps > 0 ? (m->sum_ice - m->sum_collision) / ((double)m->steps * m->dt) : NAN);
    bt_json_number(j, "largest_push_n", m->steps > 0 ? m->largest_push : NAN);
    if (m->n > 0) {
        const bt_impact *e = &m->largest;
        bt_json_open(j, "largest", '{');
        bt_json_number(j, "peak_n", e->peak);
        bt_json_number(j, "mean_n", e->mean);
        bt_json_number(j, "duration_s", e->duration);
        bt_json_number(j, "impulse_ns", e->impulse);
        bt_json_number(j, "approach_m_s", e->approach);
        bt_json_number(j, "effective_mass_kg", e->mass);
        bt_json_number(j, "time_s", e->time);
        bt_json_int(j, "floe", (int64_t)e->gid);
        bt_json_int(j, "panel", (int64_t)e->panel);
        bt_json_number(j, "x_m", e->x);
        bt_json_number(j, "y_m", e->y);
        bt_json_close(j, '}');
    } else {
        bt_json_string(j, "largest", NULL);
    }
    double *peaks = sorted(m);
    bt_json_open(j, "exceedance", '[');
    for (int k = 0; rank_of(k) <= m->n_peaks; k++) {
        bt_json_open(j, NULL, '{');
        bt_json_int(j, "rank", rank_of(k));
        bt_json_number(j, "per_hour", (double)rank_of(k) / time);
        bt_json_number(j, "peak_n", peaks[rank_of(k) - 1]);
        bt_json_close(j, '}');
    }
    bt_json_close(j, ']');
    bt_json_close(j, '}');
    free(peaks);
}

static const char *force(char out[32], double newton)
{
    const double size = fabs(newton);
    if (size >= 1e6) snprintf(out, 32, "%#.4g MN", newton / 1e6);
    else if (size >= 1e3) snprintf(out, 32, "%#.4g kN", newton / 1e3);
    else snprintf(out, 32, "%#.4g N", newton);
    return out;
}

void bt_impacts_print(const bt_impacts *m)
{
    if (!m || m->steps == 0) return;
    char a[32], b[32], text[160];
    bt_impact_describe(&m->rule, text);
    const double time = (double)m->steps * m->dt;
    printf("  collisions          %lld from %g s on, %.3g an hour; %s of the mean resistance, pushes %s\n", (long long)m->n, m->from,
           (double)m->n / hours(m), force(a, m->sum_collision / time), force(b, (m->sum_ice - m->sum_collision) / time));
    if (m->n == 0) return;
    printf("    peaks (%s)", text);
    double *peaks = sorted(m);
    // A few of the ranks: the largest, then tenfold.
    for (int k = 0; rank_of(k) <= m->n_peaks; k += 3)
        printf("%s %s at %.3g/h", k ? "," : ":", force(a, peaks[rank_of(k) - 1]), (double)rank_of(k) / hours(m));
    printf("; largest push %s\n", force(a, m->largest_push));
    free(peaks);
}
