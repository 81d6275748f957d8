// SPDX-License-Identifier: MIT
// The numbers of a whole run: reduced over one window (steady.h), with a warning for each doubt.
//
// Forces are means over a step, F = impulse / Δt. Over the steady window:
//     mean ice resistance with its 95 % interval (bergtow/stats.h); sd, 95th and 99th percentile, peak of step means
//     closure = <ice> − (<tow> − <drag> − <Coriolis> − <tilt> − … − <inertia>)      the body's own momentum balance
// and the same mean by momentum, without the contacts of the body (observe.c). The peak of step means depends on Δt:
// the mean does not.
#include "output/summary.h"

#include <string.h>

#include "base/elementary.h"
#include "base/inside.h"
#include "case/case_check.h"
#include "case/case_tow.h"
#include "case/ice_bounds.h"
#include "case/time_step.h"
#include "case/warning.h"
#include "estimate/packing.h"
#include "geometry/path.h"
#include "solve/islands.h"
#include "step/splitting.h"

// --- the moving window -----------------------------------------------------------------------------------------------

#define SHARE_LIMIT 0.01 // share of kept or missed floes above which there is a warning

void bt_summary_window_warn_laps(bt_errors *warnings, double laps)
{
    if (!(laps > 1)) return;
    bt_warn(warnings, BT_WARN_WINDOW_LAPS,
            "the moving window travels %.2f times its length through the ice: after each length the body meets the "
            "same field again, with the hole where it stood at time zero; samples a length apart are not independent, "
            "and the standard error may be too small; use a longer domain, or several values of ice.seed",
            laps);
}

static void summary_window_warn(bt_errors *warnings, const bt_window *window)
{
    if (!window) return;
    const double places = (double)(window->renewed + window->missed),
                 floes = (double)(window->renewed + window->kept);
    if (window->overtaken > window->stride)
        bt_warn(warnings, BT_WARN_ICE_OVERTOOK,
                "ice overtook the body, which fell %.3g m back through it: wind, current or tide carried the ice "
                "faster than the tow, and old ice of the window came from behind, since it is renewed only ahead; set "
                "domain.ends: periodic or open, or tow faster",
                window->overtaken);
    bt_summary_window_warn_laps(warnings, bt_window_laps(window));
    if (places > 0 && (double)window->missed > SHARE_LIMIT * places)
        bt_warn(warnings, BT_WARN_PLACES_MISSED,
                "%.1f %% of the places at the front of the moving window stayed empty: the body carries their floes "
                "along, or pushes them far ahead, and so meets that much less ice; use a longer domain",
                100 * (double)window->missed / places);
    if (floes > 0 && (double)window->kept > SHARE_LIMIT * floes)
        bt_warn(warnings, BT_WARN_FLOES_KEPT,
                "%.1f %% of the floes behind the moving window came back ahead unchanged, since their places were not "
                "free: disturbed ice enters; use a longer domain, and more of it behind the body",
                100 * (double)window->kept / floes);
}

// --- the numbers of a run --------------------------------------------------------------------------------------------

#define CLOSURE_LIMIT 1e-6
#define MOMENTUM_LIMIT 1e-9
/// Overlap above this fraction of the mean floe size is reported.
#define OVERLAP_LIMIT 0.01

static bt_mean mean_over(const bt_summary *summary, const bt_history *history, bt_column k)
{
    return bt_stats_mean(history->column[k] + summary->window.first, summary->window.n);
}

/// Reduce the values of steps first to end by the rule of their quantity.
static double reduce(const double *x, int64_t first, int64_t end, bt_keep keep)
{
    if (first >= end) return NAN;
    if (keep == BT_KEEP_LAST) return x[end - 1];
    if (keep == BT_KEEP_MEAN) return bt_stats_mean(x + first, end - first).mean;
    double out = x[first];
    for (int64_t i = first + 1; i < end; i++) out = keep == BT_KEEP_SUM ? out + x[i] : bt_max_seen(out, x[i]);
    return out;
}

static void reduce_window(bt_summary *summary, const bt_history *history)
{
    const int64_t n = summary->window.n;
    summary->ice = summary->window.series[BT_REPORTED_ICE].mean;
    summary->tow = summary->window.series[BT_REPORTED_TOW].mean;
    summary->drag = mean_over(summary, history, BT_COL_DRAG);
    summary->coriolis = mean_over(summary, history, BT_COL_CORIOLIS);
    summary->tilt = mean_over(summary, history, BT_COL_TILT);
    summary->inertia = mean_over(summary, history, BT_COL_INERTIA);
    summary->budget = mean_over(summary, history, BT_COL_BUDGET);

    double *sorted = bt_alloc((size_t)n, sizeof *sorted);
    if (n > 0) memcpy(sorted, history->column[BT_COL_ICE] + summary->window.first, (size_t)n * sizeof *sorted);
    qsort(sorted, (size_t)n, sizeof *sorted, bt_ascending);
    summary->p95 = bt_percentile(sorted, n, 95);
    summary->p99 = bt_percentile(sorted, n, 99);
    summary->peak = bt_percentile(sorted, n, 100);
    free(sorted);

    double largest = bt_max(fabs(summary->ice.mean), bt_max(fabs(summary->tow.mean), fabs(summary->drag.mean)));
    largest = bt_max(largest, bt_max(fabs(summary->coriolis.mean), fabs(summary->tilt.mean)));
    summary->balance = summary->tow.mean - summary->drag.mean - summary->coriolis.mean - summary->tilt.mean;
    for (int k = 0; k < summary->n_added; k++) {
        if (bt_added(k)->role != BT_ROLE_BALANCE) continue;
        largest = bt_max(largest, fabs(summary->added[k]));
        summary->balance -= summary->added[k];
    }
    summary->balance -= summary->inertia.mean;
    summary->closure = summary->ice.mean - summary->balance;
    summary->closure_relative = largest > 0 ? summary->closure / largest : summary->closure == 0 ? 0 : NAN;
    const double other = summary->ice.mean - summary->budget.mean;
    summary->budget_closure_relative = largest > 0 ? other / largest : other == 0 ? 0 : NAN;
    if (n == 0) return;

    if (summary->window.at_least) return; // neither balance has valid numbers
    if (fabs(summary->closure_relative) > CLOSURE_LIMIT)
        bt_warn(&summary->warnings, BT_WARN_BODY_BALANCE,
                "the mean ice resistance differs from %s by %.2g of the largest of them; the momentum balance of "
                "the towed body does not close",
                bt_balance_words(), fabs(summary->closure_relative));
    if (fabs(summary->budget_closure_relative) > CLOSURE_LIMIT)
        bt_warn(&summary->warnings, BT_WARN_ICE_BALANCE,
                "the mean ice resistance differs by %.2g from that by momentum, without the contacts of the body; that "
                "balance does not close",
                fabs(summary->budget_closure_relative));
}

/// Warn of events: a broken line changes the meaning of the means.
static void warn_of_events(bt_summary *summary, const bt_events *events)
{
    for (int64_t i = 0; events && i < events->n; i++) {
        if (events->event[i].kind != BT_EVENT_LINE_BROKEN && events->event[i].kind != BT_EVENT_ADRIFT) continue;
        const bool adrift = events->event[i].kind == BT_EVENT_ADRIFT;
        char text[160];
        bt_event_describe(&events->event[i], text);
        bt_warn(&summary->warnings, adrift ? BT_WARN_ADRIFT : BT_WARN_LINE_BROKEN, "at %g s %s", events->event[i].time,
                text);
        if (!adrift) bt_warn_number(&summary->warnings, "branch", (double)events->event[i].subject);
        bt_warn_number(&summary->warnings, adrift ? "speed_m_s" : "tension_n", events->event[i].value);
    }
}

/// Warn of a verdict other than "steady", and of doubts about a mean from the case itself: its start, its width and its
/// length.
static void warn_of_window(bt_summary *summary, const bt_case *input, const bt_run_totals *totals)
{
    if (summary->window.verdict != BT_STEADY) {
        char *reasons = bt_warnings_text(&summary->window.reasons);
        bt_warn(&summary->warnings, summary->window.verdict == BT_TOO_SHORT ? BT_WARN_TOO_SHORT : BT_WARN_NOT_STEADY,
                "%s: %s", bt_verdict_names[summary->window.verdict], reasons);
        free(reasons);
    }
    bt_case_warn_start(input, &summary->warnings);
    summary->arch = bt_arch_of(input, totals->concentration, totals->mean_size);
    bt_arch_warn(&summary->arch, &summary->warnings);
    const bt_packing packing = bt_packing_of(input, totals->concentration);
    bt_packing_warn(&packing, summary->sim_time, &summary->warnings); // also at the end of its window
}

/// Warn of steps that were not solved well.
static void warn_of_solver(bt_summary *summary, const bt_history *history, const bt_run_totals *totals)
{
    if (history->unconverged)
        bt_warn(&summary->warnings, BT_WARN_UNCONVERGED,
                "%lld of %lld steps reached the work limit before the tolerance (largest residual %.2g m/s, tolerance "
                "%.2g m/s); %s",
                (long long)history->unconverged, (long long)history->n, history->max_residual, totals->tolerance,
                history->locked_steps >= (double)history->unconverged ? "more work would not help"
                                                                      : "raise solver.max_sweeps or lower run.dt");
    if (history->locked_steps > 0)
        bt_warn(&summary->warnings, BT_WARN_LOCKED,
                "in %.0f of %lld steps bodies were locked between others that cannot give way (walls, a body at a "
                "given speed), so no bounded load keeps them apart and their forces are undefined: "
                BT_LOCKED_REMEDY,
                history->locked_steps, (long long)history->n);
    if (history->unprojected > 0)
        bt_warn(&summary->warnings, BT_WARN_UNPROJECTED,
                "in %lld of %lld steps the position projection reached its work limit and left overlap: raise "
                "solver.position_sweeps, or, where bodies are pressed together more slowly than the tolerance "
                "resolves, lower solver.tolerance",
                (long long)history->unprojected, (long long)history->n);
    if (history->outrun)
        bt_warn(&summary->warnings, BT_WARN_OUTRUN,
                "in %lld of %lld steps a body moved farther than the contact detection looks ahead: a contact may have "
                "been met a step late, as overlap, or missed; lower run.dt",
                (long long)history->outrun, (long long)history->n);
    if (history->restitution_cut)
        bt_warn(&summary->warnings, BT_WARN_REBOUNDS_LOWERED,
                "in %lld of %lld steps rebounds would have added energy, or had no room; their restitution was lowered",
                (long long)history->restitution_cut, (long long)history->n);
    if (history->positive_work)
        bt_warn(&summary->warnings, BT_WARN_ENERGY_ADDED,
                "in %lld of %lld steps the contacts added energy; tighten solver.tolerance or lower run.dt",
                (long long)history->positive_work, (long long)history->n);
}

/// Warn of splits.
static void warn_of_splits(bt_summary *summary, const bt_run_totals *totals)
{
    const bt_split_totals *p = &totals->splitting->total;
    if (p->deferred > 0)
        bt_warn(&summary->warnings, BT_WARN_SPLIT_DEFERRED,
                "%lld times a floe was left to split in the next step, after %d rounds: loads of these steps may be "
                "too high",
                (long long)p->deferred, BT_SPLIT_ROUNDS);
    if (p->refused_reserve > 0)
        bt_warn(&summary->warnings, BT_WARN_SPLIT_RESERVE,
                "%lld times a floe could not split, after %lld splits had used up all ids; raise ice.splitting.reserve",
                (long long)p->refused_reserve, (long long)totals->splitting->reserve / 2);
    if (p->unconverged > 0)
        bt_warn(&summary->warnings, BT_WARN_SPLIT_UNCONVERGED,
                "in %lld of %lld steps the loads had not converged, so no floe split; raise solver.max_sweeps or lower "
                "run.dt",
                (long long)p->unconverged, (long long)totals->n_steps);
}

static void warn_of_bodies(bt_summary *summary, const bt_history *history, const bt_case *input,
                           const bt_run_totals *totals)
{
    if (!(history->max_overlap <= OVERLAP_LIMIT * totals->mean_size))
        bt_warn(&summary->warnings, BT_WARN_OVERLAP,
                "bodies overlap by up to %.2g m, %.1f %% of the mean floe size; lower run.dt or raise %s",
                history->max_overlap, 100 * history->max_overlap / totals->mean_size,
                totals->splitting ? "ice.splitting.least_size" : "solver.position_sweeps");
    for (int law = 0; law < BT_LAWS; law++) {
        if (bt_laws[law]->warn)
            bt_laws[law]->warn(history->laws + bt_law_first_total(law), totals->mean_size, &summary->warnings);
    }
    if (totals->splitting) warn_of_splits(summary, totals);
    if (totals->stall.inside > 0)
        bt_warn(&summary->warnings, BT_WARN_END_INSIDE,
                "the towing end was inside the hull for %.3g s, from %.4g s on: a following current, a tow that slows "
                "down or a sharp turn let the body overtake it; nothing in the model keeps them apart, and the line "
                "pulls from behind afterwards",
                totals->stall.inside, totals->stall.inside_from);
    if (totals->stall.windows)
        bt_warn(&summary->warnings, BT_WARN_STALLED,
                "the towed body stood still for %.3g s of %.3g s, below %g %% of the speed that the tow asked for over "
                "a path of a mean floe size, and the ice held it: a jam%s",
                totals->stall.time, summary->sim_time, 100 * BT_STALL_SHARE,
                input->ice.crushing_pressure > 0 || input->ice.rafting_kappa > 0
                          ? ""
                          : "; rigid contact has no largest force: consider ice.rafting.kappa or "
                            "ice.crushing.pressure");
    if (!(history->max_momentum_residual <= MOMENTUM_LIMIT))
        bt_warn(&summary->warnings, BT_WARN_MOMENTUM,
                "momentum is conserved only to %.2g of what the steps exchange; please report this case",
                history->max_momentum_residual);
    bt_outline_warn(&totals->outlines, input, &summary->warnings);
    bt_field_size_warn(input, &totals->sizes, &summary->warnings);
    if (totals->mean_thickness > 0) bt_ice_warn(input, totals->mean_size, totals->mean_thickness, &summary->warnings);
    warn_of_events(summary, totals->events);
    summary_window_warn(&summary->warnings, totals->window);
    if (totals->floes_outside)
        bt_warn(&summary->warnings, BT_WARN_FLOES_LEFT,
                "%lld floes left the open domain and no longer resist; use a larger domain or walls if that matters",
                (long long)totals->floes_outside);
}

/// Without a tow: tow.direction is 0 by default and has no meaning, so a free body has no resistance along it.
static void clear_resistance_if_untowed(bt_summary *summary, const bt_case *input)
{
    if (input->tow.mode != BT_TOW_NONE) return;
    summary->ice.mean = summary->ice.se = summary->ice.low = summary->ice.high = NAN;
    bt_warn(&summary->warnings, BT_WARN_NO_TOW,
            "nothing tows the body, so there is no mean ice resistance: all other forces of the summary, and the "
            "series of ice_resistance, are those against tow.direction (%g deg), whichever way the body drifts; for "
            "the force of the ice read the series ice_force_x and ice_force_y",
            input->tow.direction * 180 / BT_PI);
}

/// A line cannot push, and the largest of negative forces is the smallest load: neither mean nor peak is a pull.
static void warn_if_held_back(bt_summary *summary, const bt_history *history)
{
    if (!(summary->tow.mean < 0)) return;
    const double *tow = history->column[BT_COL_TOW] + summary->window.first;
    double least = summary->tow.mean;
    for (int64_t i = 0; i < summary->window.n; i++) least = tow[i] < least ? tow[i] : least; // of no NaN
    bt_warn(&summary->warnings, BT_WARN_HELD_BACK,
            "the mean tow force is %.3g N, and down to %.3g N in a step: current, wind or inertia carries the body "
            "faster than the tow, which holds it back; the peak of the tow force is the moment of least load, and no "
            "pull of a vessel follows from it",
            summary->tow.mean, least);
}

/// Conditions of the estimates over the window as ordered by the case: mean speed and course of the programme there.
/// The estimate reports a turn within the window, also of the body. tow: velocity ordered over ground, m/s.
static void order_window(bt_summary *summary, const bt_history *history, const bt_case *input, double tow[2])
{
    const bt_steady *steady = &summary->window;
    bt_estimate_input *in = &summary->estimate;
    bt_case straight = *input; // texts and tables remain those of `input`
    bt_path path = {0};
    char why[200];
    if (input->tow.mode != BT_TOW_NONE && steady->end > steady->start) {
        const double from = bt_case_tow_distance(input, steady->start), to = bt_case_tow_distance(input, steady->end);
        if (input->tow.n_programme > 0 || steady->start < input->tow.ramp)
            straight.tow.speed = (to - from) / (steady->end - steady->start);
        if (input->tow.n_waypoints > 0 && bt_case_tow_path(input, &path, why)) {
            double a[2], b[2], first[2], last[2];
            bt_path_at(&path, steady->path_at[0], a, first);
            bt_path_at(&path, steady->path_at[1], b, last);
            straight.tow.direction = bt_atan2(first[1] + last[1], first[0] + last[0]);
            // at a prescribed speed a body keeps its yaw; on a line it follows its course, as in src/case/arch.c
            if (input->tow.mode != BT_TOW_SPEED) straight.body.yaw += straight.tow.direction - input->tow.direction;
            bt_path_free(&path);
        }
    }
    // The mean yaw, which on a line or of a free body may differ from the start; in a turn it mixes two courses.
    const double yaw = mean_over(summary, history, BT_COL_YAW).mean;
    if (isfinite(yaw) && !steady->turns) straight.body.yaw = yaw;
    bt_estimate_conditions(&straight, in);
    in->turns = steady->turns;
    in->changes_speed = steady->changes_speed;
    tow[0] = straight.tow.speed * bt_cos(straight.tow.direction);
    tow[1] = straight.tow.speed * bt_sin(straight.tow.direction);
}

/// Measured speeds of the window, if known, for the estimates. A drifting body is not towed. tow: as ordered over
/// ground, m/s.
static void measure_speeds(bt_summary *summary, const bt_history *history, const bt_case *input,
                           const bt_run_totals *totals, const double tow[2])
{
    bt_estimate_input *in = &summary->estimate;
    const bool changes = input->water.tide.major > 0 || input->water.table.n > 0; // the current
    const double ice[2] =
        {mean_over(summary, history, BT_COL_SPEED_ICE).mean, mean_over(summary, history, BT_COL_LEEWAY_ICE).mean},
                 water[2] = {mean_over(summary, history, BT_COL_SPEED_WATER).mean,
                             mean_over(summary, history, BT_COL_LEEWAY_WATER).mean};
    bool adrift = false;
    for (int64_t i = 0; totals->events && i < totals->events->n; i++)
        adrift |= totals->events->event[i].kind == BT_EVENT_ADRIFT;
    if (adrift) {
        in->speed = in->along = in->water_speed = in->water_along = NAN;
    } else if (isfinite(ice[0]) && !isnan(in->along)) {
        // Less the drift of the ice over ground within the window: not its mean over the run.
        const double speed = bt_hypot(tow[0], tow[1]), made[2] = {mean_over(summary, history, BT_COL_VX).mean,
                                                                  mean_over(summary, history, BT_COL_VY).mean};
        const double along = (made[0] * tow[0] + made[1] * tow[1]) / speed;
        if (isfinite(along) && changes && !summary->window.turns) in->ordered = speed - (along - ice[0]);
        else in->ordered += ice[0] - water[0];
        in->along = ice[0], in->speed = bt_hypot(ice[0], ice[1]);
        in->water_along = water[0], in->water_speed = bt_hypot(water[0], water[1]);
    }
}

void bt_summary_make(bt_summary *summary, const bt_history *history, const bt_case *input, const bt_run_totals *totals,
                     bt_idx n_floes, bool body)
{
    const double nan = NAN;
    *summary = (bt_summary){.body = body, .sim_time = history->n ? history->column[BT_COL_TIME][history->n - 1] : 0,
                            .reference_ratio = nan};
    if (totals->stopped) bt_warn(&summary->warnings, BT_WARN_STOPPED, "the run stopped early: %s", totals->stopped);
    else if (totals->n_steps < totals->whole_steps)
        bt_warn(&summary->warnings, BT_WARN_ENDED_EARLY,
                "the run ended after %lld of %lld steps, as requested: `bergtow resume` runs the rest",
                (long long)totals->n_steps, (long long)totals->whole_steps);

    const bt_mean none = bt_stats_mean(NULL, 0);
    summary->ice =
        summary->tow = summary->drag = summary->coriolis = summary->tilt = summary->inertia = summary->budget = none;
    summary->p95 = summary->p99 = summary->peak =
        summary->balance = summary->closure = summary->closure_relative = summary->budget_closure_relative = nan;
    bt_steady_none(&summary->window);
    if (body) bt_steady_find(&summary->window, history, input, totals);
    summary->n_added = history->n_columns - BT_N_COLUMNS;
    for (int k = 0; k < summary->n_added; k++)
        summary->added[k] = reduce(history->column[BT_N_COLUMNS + k], body ? summary->window.first : 0, history->n,
                                   bt_added(k)->keep);
    if (body) {
        reduce_window(summary, history);
        clear_resistance_if_untowed(summary, input);
        warn_if_held_back(summary, history);
        warn_of_window(summary, input, totals);
        summary->reference_ratio = summary->ice.mean / input->reference.mean_force;
        double tow[2];
        order_window(summary, history, input, tow);
        measure_speeds(summary, history, input, totals, tow);
        summary->estimate.concentration = totals->concentration;
        if (totals->mean_thickness > 0) summary->estimate.thickness = totals->mean_thickness;
        if (totals->mean_radius > 0) summary->estimate.floe_radius = totals->mean_radius;
    }

    summary->contacts = history->n ? history->sum_contacts / (double)history->n : nan;
    summary->sweeps = history->n ? history->sum_sweeps / (double)history->n : nan;
    summary->updates = history->n ? history->sum_updates / (double)history->n : nan;
    summary->moves = history->n ? history->sum_moves / (double)history->n : nan;
    summary->checks = history->n ? history->sum_checks / (double)history->n : nan;
    summary->projected = history->n ? history->sum_projected / (double)history->n : nan;
    summary->ns_per_floe_step =
        n_floes > 0 && totals->n_steps > 0 ? 1e9 * totals->wall_time / ((double)n_floes * (double)totals->n_steps)
                                           : nan;

    const bt_track track = {.n = body ? history->n : 0, .time = history->column[BT_COL_TIME],
                            .x = history->column[BT_COL_IN_ICE_X], .y = history->column[BT_COL_IN_ICE_Y]};
    const bt_time_step step = bt_time_step_of(input, (double)n_floes, totals->mean_size, &track);
    bt_time_step_warn(input, &step, &summary->warnings);
    bt_case_warn_idle(input, &summary->warnings);
    bt_case_warn_tables(input, &summary->warnings);
    bt_case_warn_body(input, &summary->warnings);
    bt_ice_warn_closed(input, totals->ice_area, &summary->warnings);
    if (n_floes > 0) bt_ice_warn_slow(input, totals->mean_size, &summary->warnings);
    if (totals->undisturbed)
        bt_case_warn_lead(input, totals->undisturbed->drift_x, totals->undisturbed->drift_y, &summary->warnings);
    warn_of_solver(summary, history, totals);
    warn_of_bodies(summary, history, input, totals);
}

double bt_summary_held_against(const bt_summary *summary)
{
    return summary->window.met_no_ice ? NAN : summary->ice.mean;
}

void bt_summary_free(bt_summary *summary)
{
    bt_errors_free(&summary->warnings);
    bt_errors_free(&summary->window.reasons);
    *summary = (bt_summary){0};
}
