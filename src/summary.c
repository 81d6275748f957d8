// SPDX-License-Identifier: MIT
// The numbers of a whole run: kept step by step, reduced over the steady window, with a warning for each doubt.
//
// Forces are means over a step, F = impulse / Δt. Over the steady window:
//     mean ice resistance ± standard error (bergtow/stats.h), sd, 95th and 99th percentile and peak of the step means
//     closure = <ice> − (<tow> − <drag> − <Coriolis> − <tilt> − <inertia>)      the body's own momentum balance
// and the same mean from the momentum of everything else. The peak of step means depends on Δt: the mean does not.
#include "summary.h"
#include "summary_window.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/// Work of the contacts above this fraction of the kinetic energy is no rounding.
#define WORK_ROUNDING 1e-10
/// Independent samples (n / 2τ) below which a standard error is itself too uncertain: its own relative error is then > 25 %.
#define MIN_INDEPENDENT 20
#define CLOSURE_LIMIT 1e-6
#define MOMENTUM_LIMIT 1e-9
/// Overlap above this fraction of the mean floe size is told.
#define OVERLAP_LIMIT 0.01
/// Crush above this fraction of it is told: outlines stay as they were, and floes that have gone so far into each other part sideways.
#define CRUSH_LIMIT 0.3

void bt_history_init(bt_history *h) { *h = (bt_history){.peak_tension = NAN}; }

void bt_history_free(bt_history *h)
{
    double *columns[] = {h->time, h->ice, h->tow, h->drag, h->coriolis, h->tilt, h->inertia, h->budget};
    for (size_t i = 0; i < sizeof columns / sizeof *columns; i++) free(columns[i]);
    bt_history_init(h);
}

void bt_history_add(bt_history *h, const bt_sample *s)
{
    enum { N_COLUMNS = 8 };
    double **columns[N_COLUMNS] = {&h->time, &h->ice, &h->tow, &h->drag, &h->coriolis, &h->tilt, &h->inertia, &h->budget};
    const double values[N_COLUMNS] = {s->time, s->ice_resistance, s->tow_force, s->drag_force, s->coriolis_force, s->tilt_force, s->inertia_force,
                                      s->ice_resistance_budget};
    if (h->n == h->cap) {
        h->cap = h->cap ? 2 * h->cap : 1024;
        for (size_t i = 0; i < N_COLUMNS; i++) *columns[i] = bt_realloc(*columns[i], (size_t)h->cap, sizeof(double));
    }
    for (size_t i = 0; i < N_COLUMNS; i++) (*columns[i])[h->n] = values[i];
    h->n++;
    h->sum_contacts += s->contacts;
    h->sum_sweeps += s->sweeps;
    h->contact_work += s->contact_work;
    h->max_overlap = bt_max_seen(h->max_overlap, s->overlap);
    h->max_residual = bt_max_seen(h->max_residual, s->residual);
    h->max_momentum_residual = bt_max_seen(h->max_momentum_residual, s->momentum_residual);
    if (!isnan(s->line_tension)) h->peak_tension = isnan(h->peak_tension) ? s->line_tension
                                                                          : bt_max(h->peak_tension, s->line_tension);
    h->crushed_work += s->crushed_work;
    h->max_crushed_depth = bt_max_seen(h->max_crushed_depth, s->crushed_depth);
    h->max_crushing = bt_max_seen(h->max_crushing, s->crushing);
    h->crushing_steps += s->crushing > 0;
    h->unconverged += s->unconverged != 0;
    h->repeats += (int64_t)s->repeats;
    h->outrun += s->outrun != 0;
    h->restitution_cut += s->restitution_cut != 0;
    h->positive_work += s->contact_work > WORK_ROUNDING * s->kinetic_energy;
}

static int ascending(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/// Percentile by linear interpolation between order statistics (numpy's default) of sorted x[n].
static double percentile(const double *x, int64_t n, double percent)
{
    if (n < 1) return NAN;
    const double at = percent / 100 * (double)(n - 1);
    const int64_t i = (int64_t)at, next = i + 1 < n ? i + 1 : i;
    return x[i] + (at - (double)i) * (x[next] - x[i]);
}

static int64_t first_at_or_after(const bt_history *h, double time)
{
    int64_t i = 0;
    while (i < h->n && h->time[i] < time) i++;
    return i;
}

static const char *warn_window(bt_summary *s)
{
    return s->window.warning ? s->window.warning : s->warnings.text[s->warnings.n - 1];
}

static void choose_window(bt_summary *s, const bt_history *h, const bt_case *c)
{
    s->window.given = c->output.window_start >= 0;
    const double ramp = c->tow.mode == BT_TOW_NONE ? 0 : c->tow.ramp;
    const double earliest = s->window.given ? c->output.window_start : ramp;
    int64_t first = first_at_or_after(h, earliest);
    if (first >= h->n) {
        s->window.first = h->n;
        s->window.start = s->window.end = NAN;
        bt_errors_add(&s->warnings, "no steady window: it would begin at %g s and the run ends at %g s; run longer, or %s",
                      earliest, s->sim_time, s->window.given ? "lower output.window_start" : "shorten tow.ramp");
        s->window.warning = warn_window(s);
        return;
    }
    if (!s->window.given) {
        const int64_t earliest_step = first;
        first = bt_stats_steady_start(h->ice, h->n, first);
        // A minimum at the far end of the search means that the variance still falls where the search stops.
        if (first > earliest_step && first + 5 > h->n / 2) {
            bt_errors_add(&s->warnings, "no steady state was found: the ice resistance still drifts in the first half of the "
                          "run, and the window begins at its middle (%g s); run longer", h->time[first]);
            s->window.warning = warn_window(s);
        }
    }
    s->window.first = first;
    s->window.n = h->n - first;
    s->window.start = h->time[first];
    s->window.end = h->time[h->n - 1];
}

static void reduce_window(bt_summary *s, const bt_history *h, double dt)
{
    const int64_t first = s->window.first, n = s->window.n;
    s->ice = bt_stats_mean(h->ice + first, n);
    s->tow = bt_stats_mean(h->tow + first, n);
    s->drag = bt_stats_mean(h->drag + first, n);
    s->coriolis = bt_stats_mean(h->coriolis + first, n);
    s->tilt = bt_stats_mean(h->tilt + first, n);
    s->inertia = bt_stats_mean(h->inertia + first, n);
    s->budget = bt_stats_mean(h->budget + first, n);
    s->window.correlation_time = n > 1 ? s->ice.tau * dt : NAN;

    double *sorted = bt_alloc((size_t)n, sizeof *sorted);
    if (n > 0) memcpy(sorted, h->ice + first, (size_t)n * sizeof *sorted);
    qsort(sorted, (size_t)n, sizeof *sorted, ascending);
    s->p95 = percentile(sorted, n, 95);
    s->p99 = percentile(sorted, n, 99);
    s->peak = percentile(sorted, n, 100);
    free(sorted);

    double largest = bt_max(fabs(s->ice.mean), bt_max(fabs(s->tow.mean), fabs(s->drag.mean)));
    largest = bt_max(largest, bt_max(fabs(s->coriolis.mean), fabs(s->tilt.mean)));
    s->balance = s->tow.mean - s->drag.mean - s->coriolis.mean - s->tilt.mean - s->inertia.mean;
    s->closure = s->ice.mean - s->balance;
    s->closure_relative = largest > 0 ? s->closure / largest : s->closure == 0 ? 0 : NAN;
    const double other = s->ice.mean - s->budget.mean;
    s->budget_closure_relative = largest > 0 ? other / largest : other == 0 ? 0 : NAN;
    if (n == 0) return;

    if (!(s->ice.n_eff >= MIN_INDEPENDENT)) {
        if (isfinite(s->ice.n_eff))
            bt_errors_add(&s->warnings, "the steady window is short: %g s hold %.1f independent samples of the ice resistance "
                          "(correlation time %g s) and the standard error needs %d; run longer",
                          s->window.end - s->window.start, s->ice.n_eff, s->window.correlation_time, MIN_INDEPENDENT);
        else
            bt_errors_add(&s->warnings, "the ice resistance is not finite within the steady window: the run is not usable; "
                          "lower run.dt");
        s->window.warning = warn_window(s);
    }
    if (fabs(s->closure_relative) > CLOSURE_LIMIT)
        bt_errors_add(&s->warnings, "the mean ice resistance differs from tow - drag - Coriolis - tilt - inertia by %.2g of the largest of them; "
                      "the momentum balance of the towed body does not close", fabs(s->closure_relative));
    if (fabs(s->budget_closure_relative) > CLOSURE_LIMIT)
        bt_errors_add(&s->warnings, "the mean ice resistance differs by %.2g from the one by the momentum of the ice and the "
                      "walls; the momentum balance of the ice does not close", fabs(s->budget_closure_relative));
}

/// A mean over a ramp or a stop is none of a steady tow.
static void warn_of_programme(bt_summary *s, const bt_case *c)
{
    const double *p = c->tow.programme;
    for (int i = 0; i + 1 < c->tow.n_programme && s->window.n > 0; i++) {
        if (p[2 * i + 1] == p[2 * i + 3] || p[2 * i + 2] <= s->window.start || p[2 * i] >= s->window.end) continue;
        bt_errors_add(&s->warnings, "the speed programme goes from %g to %g m/s within the steady window, %g to %g s; end the run before, or read the series",
                      p[2 * i + 1], p[2 * i + 3], s->window.start, s->window.end);
        return;
    }
}

/// A line that broke changes what the means stand for.
static void warn_of_events(bt_summary *s, const bt_events *e)
{
    for (int64_t i = 0; e && i < e->n; i++) {
        if (e->event[i].kind != BT_EVENT_LINE_BROKEN && e->event[i].kind != BT_EVENT_ADRIFT) continue;
        char text[160];
        bt_event_describe(&e->event[i], text);
        bt_errors_add(&s->warnings, "at %g s %s%s", e->event[i].time, text,
                      s->window.n > 0 && e->event[i].time > s->window.start ? ": within the steady window, whose means mix before and after" : "");
    }
}

void bt_summary_make(bt_summary *s, const bt_history *h, const bt_case *c, const bt_run_totals *t, bt_idx n_floes,
                     bool body)
{
    const double nan = NAN;
    *s = (bt_summary){.body = body, .sim_time = h->n ? h->time[h->n - 1] : 0, .reference_ratio = nan};
    if (t->stopped) bt_errors_add(&s->warnings, "the run stopped early: %s", t->stopped);

    const bt_mean none = bt_stats_mean(NULL, 0);
    s->ice = s->tow = s->drag = s->coriolis = s->tilt = s->inertia = s->budget = none;
    s->p95 = s->p99 = s->peak = s->balance = s->closure = s->closure_relative = s->budget_closure_relative = nan;
    s->window.start = s->window.end = s->window.correlation_time = nan;
    if (body) {
        choose_window(s, h, c);
        reduce_window(s, h, t->dt);
        s->reference_ratio = s->ice.mean / c->reference.mean_force;
        bt_estimate_conditions(c, &s->estimate);
        s->estimate.concentration = t->concentration;
        if (t->mean_thickness > 0) s->estimate.thickness = t->mean_thickness;
        if (t->mean_radius > 0) s->estimate.floe_radius = t->mean_radius;
    }

    s->contacts = h->n ? h->sum_contacts / (double)h->n : nan;
    s->sweeps = h->n ? h->sum_sweeps / (double)h->n : nan;
    s->ns_per_floe_step = n_floes > 0 && t->n_steps > 0 ? 1e9 * t->wall_time / ((double)n_floes * (double)t->n_steps) : nan;

    if (h->unconverged)
        bt_errors_add(&s->warnings, "%lld of %lld steps met the sweep limit before the tolerance (largest residual %.2g m/s, "
                      "tolerance %.2g m/s); raise solver.max_sweeps or lower run.dt",
                      (long long)h->unconverged, (long long)h->n, h->max_residual, t->tolerance);
    if (h->outrun)
        bt_errors_add(&s->warnings, "in %lld of %lld steps, mostly unconverged ones, a floe moved farther than the contact detection looks "
                      "ahead: a contact may have been met a step late, as overlap; lower run.dt", (long long)h->outrun, (long long)h->n);
    if (h->restitution_cut)
        bt_errors_add(&s->warnings, "in %lld of %lld steps simultaneous rebounds would have added energy; their restitution was lowered",
                      (long long)h->restitution_cut, (long long)h->n);
    if (h->positive_work)
        bt_errors_add(&s->warnings, "in %lld of %lld steps the contacts added energy; tighten solver.tolerance or lower run.dt",
                      (long long)h->positive_work, (long long)h->n);
    if (!(h->max_overlap <= OVERLAP_LIMIT * t->mean_size))
        bt_errors_add(&s->warnings, "bodies overlap by up to %.2g m, %.1f %% of the mean floe size; lower run.dt or raise "
                      "solver.position_sweeps", h->max_overlap, 100 * h->max_overlap / t->mean_size);
    if (!(h->max_crushed_depth <= CRUSH_LIMIT * t->mean_size))
        bt_errors_add(&s->warnings, "floes were crushed to a depth of %.2g m, %.0f %% of the mean floe size: outlines and masses stay as they were, "
                      "which is no model of that", h->max_crushed_depth, 100 * h->max_crushed_depth / t->mean_size);
    if (t->stall.windows)
        bt_errors_add(&s->warnings, "the towed body stood still for %.3g s of %.3g s, below %g %% of the speed that the tow asked for over a path of a "
                      "mean floe size: a jam%s", t->stall.time, s->sim_time, 100 * BT_STALL_SHARE,
                      c->ice.crushing_pressure > 0 ? "" : "; rigid contact has no largest force: consider ice.crushing.pressure");
    if (!(h->max_momentum_residual <= MOMENTUM_LIMIT))
        bt_errors_add(&s->warnings, "momentum is conserved only to %.2g of what the steps exchange; please report this case",
                      h->max_momentum_residual);
    bt_outline_warn(&t->outlines, c, &s->warnings);
    warn_of_events(s, t->events);
    warn_of_programme(s, c);
    bt_summary_window_warn(&s->warnings, t->window);
    if (t->floes_outside)
        bt_errors_add(&s->warnings, "%lld floes left the open domain and resist no more; use a larger domain or walls if that "
                      "matters", (long long)t->floes_outside);
}

void bt_summary_free(bt_summary *s)
{
    bt_errors_free(&s->warnings);
    *s = (bt_summary){0};
}
