// SPDX-License-Identifier: MIT
// The numbers of a whole run: reduced over one window (steady.h), with a warning for each doubt.
//
// Forces are means over a step, F = impulse / Δt. Over the steady window:
//     mean ice resistance with its 95 % interval (bergtow/stats.h); sd, 95th and 99th percentile, peak of step means
//     closure = <ice> − (<tow> − <drag> − <Coriolis> − <tilt> − … − <inertia>)      the body's own momentum balance
// and the same mean by momentum, without the contacts of the body (observe.c). The peak of step means depends on Δt:
// the mean does not.
#include "output/summary.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/elementary.h"
#include "base/inside.h"
#include "case/arch.h"
#include "case/case_check.h"
#include "case/case_tow.h"
#include "case/constraints.h"
#include "case/ice_bounds.h"
#include "case/warning.h"
#include "estimate/packing.h"
#include "geometry/path.h"
#include "solve/islands.h"
#include "step/splitting.h"

// --- the moving window -----------------------------------------------------------------------------------------------

// What the moving window did, and when its ice is not that of a long domain.

#define SHARE_LIMIT 0.01 // of the floes that went round as they were, or are missing, above which it is reported

void bt_summary_window_print(const bt_window *v)
{
    if (!v) return;
    printf("  moving window       %.3g times its length; %lld floes renewed, %lld kept, %lld places missed, %lld floes "
           "wait\n",
           bt_window_laps(v), (long long)v->renewed, (long long)v->kept, (long long)v->missed, (long long)v->waiting);
}

void bt_summary_window_warn_laps(bt_errors *warnings, double laps)
{
    if (!(laps > 1)) return;
    bt_warn(warnings, BT_WARN_WINDOW_LAPS,
            "the moving window goes %.2f times its length through the ice: the body meets the same field "
            "again after each, with the hole in which it stood at time zero; samples a length apart are not "
            "independent, and the standard error may be too small; take a longer domain, or several values of "
            "ice.seed",
            laps);
}

static void summary_window_warn(bt_errors *warnings, const bt_window *v)
{
    if (!v) return;
    const double places = (double)(v->renewed + v->missed),
                 floes = (double)(v->renewed + v->kept);
    if (v->overtaken > v->stride)
        bt_warn(warnings, BT_WARN_ICE_OVERTOOK,
                "ice overtook the body, which fell %.3g m back through it: wind, current or tide carried the ice "
                "faster than the tow, and what came from behind was the ice of the window once more, which is "
                "renewed ahead only; set domain.ends: periodic or open, or tow faster",
                v->overtaken);
    bt_summary_window_warn_laps(warnings, bt_window_laps(v));
    if (places > 0 && (double)v->missed > SHARE_LIMIT * places)
        bt_warn(warnings, BT_WARN_PLACES_MISSED,
                "%.1f %% of the places at the front of the moving window stayed empty: the body carries their floes "
                "along, or pushes them far ahead; the ice that it meets is thinner by that; take a longer domain",
                100 * (double)v->missed / places);
    if (floes > 0 && (double)v->kept > SHARE_LIMIT * floes)
        bt_warn(warnings, BT_WARN_FLOES_KEPT,
                "%.1f %% of the floes behind the moving window came back ahead as they were, their places not being "
                "free: disturbed ice enters; take a longer domain, and more of it behind the body",
                100 * (double)v->kept / floes);
}

// --- the numbers of a run --------------------------------------------------------------------------------------------

#define CLOSURE_LIMIT 1e-6
#define MOMENTUM_LIMIT 1e-9
/// Overlap above this fraction of the mean floe size is reported.
#define OVERLAP_LIMIT 0.01
/// Crush above this fraction of it is reported: outlines stay as they were, and floes that have gone so far into each
/// other part sideways.

/// Percentile by linear interpolation between order statistics (numpy's default) of sorted x[n].
static double percentile(const double *x, int64_t n, double percent)
{
    if (n < 1) return NAN;
    const double at = percent / 100 * (double)(n - 1);
    const int64_t i = (int64_t)at, next = i + 1 < n ? i + 1 : i;
    return x[i] + (at - (double)i) * (x[next] - x[i]);
}

static bt_mean mean_over(const bt_summary *s, const bt_history *h, bt_column k)
{
    return bt_stats_mean(h->column[k] + s->window.first, s->window.n);
}

/// A number of steps first to end by the rule of its quantity.
static double reduce(const double *x, int64_t first, int64_t end, bt_keep keep)
{
    if (first >= end) return NAN;
    if (keep == BT_KEEP_LAST) return x[end - 1];
    if (keep == BT_KEEP_MEAN) return bt_stats_mean(x + first, end - first).mean;
    double out = x[first];
    for (int64_t i = first + 1; i < end; i++) out = keep == BT_KEEP_SUM ? out + x[i] : bt_max_seen(out, x[i]);
    return out;
}

static void reduce_added(bt_summary *s, const bt_history *h)
{
    const int64_t first = s->body ? s->window.first : 0;
    s->n_added = h->n_columns - BT_N_COLUMNS;
    for (int k = 0; k < s->n_added; k++)
        s->added[k] = reduce(h->column[BT_N_COLUMNS + k], first, h->n, bt_added(k)->keep);
}

static void reduce_window(bt_summary *s, const bt_history *h)
{
    const int64_t n = s->window.n;
    s->ice = s->window.series[BT_REPORTED_ICE].mean;
    s->tow = s->window.series[BT_REPORTED_TOW].mean;
    s->drag = mean_over(s, h, BT_COL_DRAG);
    s->coriolis = mean_over(s, h, BT_COL_CORIOLIS);
    s->tilt = mean_over(s, h, BT_COL_TILT);
    s->inertia = mean_over(s, h, BT_COL_INERTIA);
    s->budget = mean_over(s, h, BT_COL_BUDGET);

    double *sorted = bt_alloc((size_t)n, sizeof *sorted);
    if (n > 0) memcpy(sorted, h->column[BT_COL_ICE] + s->window.first, (size_t)n * sizeof *sorted);
    qsort(sorted, (size_t)n, sizeof *sorted, bt_ascending);
    s->p95 = percentile(sorted, n, 95);
    s->p99 = percentile(sorted, n, 99);
    s->peak = percentile(sorted, n, 100);
    free(sorted);

    double largest = bt_max(fabs(s->ice.mean), bt_max(fabs(s->tow.mean), fabs(s->drag.mean)));
    largest = bt_max(largest, bt_max(fabs(s->coriolis.mean), fabs(s->tilt.mean)));
    s->balance = s->tow.mean - s->drag.mean - s->coriolis.mean - s->tilt.mean;
    for (int k = 0; k < s->n_added; k++) {
        if (bt_added(k)->role != BT_ROLE_BALANCE) continue;
        largest = bt_max(largest, fabs(s->added[k]));
        s->balance -= s->added[k];
    }
    s->balance -= s->inertia.mean;
    s->closure = s->ice.mean - s->balance;
    s->closure_relative = largest > 0 ? s->closure / largest : s->closure == 0 ? 0 : NAN;
    const double other = s->ice.mean - s->budget.mean;
    s->budget_closure_relative = largest > 0 ? other / largest : other == 0 ? 0 : NAN;
    if (n == 0) return;

    if (s->window.at_least) return; // neither balance is one of numbers
    if (fabs(s->closure_relative) > CLOSURE_LIMIT)
        bt_warn(&s->warnings, BT_WARN_BODY_BALANCE,
                "the mean ice resistance differs from %s by %.2g of the largest of them; the momentum balance of "
                "the towed body does not close",
                bt_balance_words(), fabs(s->closure_relative));
    if (fabs(s->budget_closure_relative) > CLOSURE_LIMIT)
        bt_warn(&s->warnings, BT_WARN_ICE_BALANCE,
                "the mean ice resistance differs by %.2g from the one by momentum, without the contacts of the "
                "body; that balance does not close",
                fabs(s->budget_closure_relative));
}

/// A line that broke changes what the means stand for.
static void warn_of_events(bt_summary *s, const bt_events *e)
{
    for (int64_t i = 0; e && i < e->n; i++) {
        if (e->event[i].kind != BT_EVENT_LINE_BROKEN && e->event[i].kind != BT_EVENT_ADRIFT) continue;
        const bool adrift = e->event[i].kind == BT_EVENT_ADRIFT;
        char text[160];
        bt_event_describe(&e->event[i], text);
        bt_warn(&s->warnings, adrift ? BT_WARN_ADRIFT : BT_WARN_LINE_BROKEN, "at %g s %s", e->event[i].time, text);
        if (!adrift) bt_warn_number(&s->warnings, "branch", (double)e->event[i].subject);
        bt_warn_number(&s->warnings, adrift ? "speed_m_s" : "tension_n", e->event[i].value);
    }
}

/// The verdict, where it is not "steady", and what in the case itself casts doubt on a mean: its start, its width and
/// its length.
static void warn_of_window(bt_summary *s, const bt_case *c, const bt_run_totals *t)
{
    if (s->window.verdict != BT_STEADY) {
        char *reasons = bt_warnings_text(&s->window.reasons);
        bt_warn(&s->warnings, s->window.verdict == BT_TOO_SHORT ? BT_WARN_TOO_SHORT : BT_WARN_NOT_STEADY,
                "%s: %s",
                bt_verdict_names[s->window.verdict], reasons);
        free(reasons);
    }
    bt_case_warn_start(c, &s->warnings);
    s->arch = bt_arch_of(c, t->concentration, t->mean_size);
    bt_arch_warn(&s->arch, &s->warnings);
    const bt_packing packing = bt_packing_of(c, t->concentration);
    bt_packing_warn(&packing, s->sim_time, &s->warnings); // where its window ends, too
}

/// How the steps were solved.
static void warn_of_solver(bt_summary *s, const bt_history *h, const bt_run_totals *t)
{
    if (h->unconverged)
        bt_warn(&s->warnings, BT_WARN_UNCONVERGED,
                "%lld of %lld steps met the limit of work before the tolerance (largest residual %.2g m/s, "
                "tolerance %.2g m/s); %s",
                (long long)h->unconverged, (long long)h->n, h->max_residual, t->tolerance,
                h->locked_steps >= (double)h->unconverged ? "more work would not help"
                                                          : "raise solver.max_sweeps or lower run.dt");
    if (h->locked_steps > 0)
        bt_warn(&s->warnings, BT_WARN_LOCKED,
                "in %.0f of %lld steps bodies were locked between others that give way to nothing (walls, a body "
                "at a given speed), so that no bounded load keeps them apart and their forces are no numbers: "
                BT_LOCKED_REMEDY,
                h->locked_steps, (long long)h->n);
    if (h->unprojected > 0)
        bt_warn(&s->warnings, BT_WARN_UNPROJECTED,
                "in %lld of %lld steps the position projection met its limit of work and left overlap: raise "
                "solver.position_sweeps, or, where bodies are pressed together slower than the tolerance tells, "
                "lower solver.tolerance",
                (long long)h->unprojected, (long long)h->n);
    if (h->outrun)
        bt_warn(&s->warnings, BT_WARN_OUTRUN,
                "in %lld of %lld steps a body moved farther than the contact detection looks ahead: a contact may have "
                "been met a step late, as overlap, or missed; lower run.dt",
                (long long)h->outrun, (long long)h->n);
    if (h->restitution_cut)
        bt_warn(&s->warnings, BT_WARN_REBOUNDS_LOWERED,
                "in %lld of %lld steps simultaneous rebounds would have added energy; their restitution was lowered",
                (long long)h->restitution_cut, (long long)h->n);
    if (h->positive_work)
        bt_warn(&s->warnings, BT_WARN_ENERGY_ADDED,
                "in %lld of %lld steps the contacts added energy; tighten solver.tolerance or lower run.dt",
                (long long)h->positive_work, (long long)h->n);
}

/// What the bodies came to.
static void warn_of_splits(bt_summary *s, const bt_run_totals *t)
{
    const bt_split_totals *p = &t->splitting->total;
    if (p->deferred > 0)
        bt_warn(&s->warnings, BT_WARN_SPLIT_DEFERRED,
                "%lld floes were left to split in the next step after %d rounds: loads of their steps may be too high",
                (long long)p->deferred, BT_SPLIT_ROUNDS);
    if (p->no_id > 0)
        bt_warn(&s->warnings, BT_WARN_SPLIT_RESERVE,
                "%lld floes could not split, as all ids for %lld pieces were used; raise ice.splitting.reserve",
                (long long)p->no_id, (long long)t->splitting->reserve);
    if (p->unconverged > 0)
        bt_warn(&s->warnings, BT_WARN_SPLIT_UNCONVERGED,
                "%lld of %lld steps did not converge, and no floe split in them; raise solver.max_sweeps or lower "
                "run.dt",
                (long long)p->unconverged, (long long)t->n_steps);
}

static void warn_of_bodies(bt_summary *s, const bt_history *h, const bt_case *c, const bt_run_totals *t)
{
    if (!(h->max_overlap <= OVERLAP_LIMIT * t->mean_size))
        bt_warn(&s->warnings, BT_WARN_OVERLAP,
                "bodies overlap by up to %.2g m, %.1f %% of the mean floe size; lower run.dt or raise "
                "solver.position_sweeps",
                h->max_overlap, 100 * h->max_overlap / t->mean_size);
    for (int law = 0; law < BT_LAWS; law++) {
        if (bt_laws[law]->warn)
            bt_laws[law]->warn(h->laws + bt_law_first_total(law), t->mean_size, &s->warnings);
    }
    if (t->splitting) warn_of_splits(s, t);
    if (t->stall.inside > 0)
        bt_warn(&s->warnings, BT_WARN_END_INSIDE,
                "the towing end was within the hull for %.3g s, from %.4g s on: a following current, a tow that "
                "slows down or a sharp turn let the body overtake it; nothing in the model keeps them apart, and "
                "the line pulls from behind afterwards",
                t->stall.inside, t->stall.inside_from);
    if (t->stall.windows)
        bt_warn(&s->warnings, BT_WARN_STALLED,
                "the towed body stood still for %.3g s of %.3g s, below %g %% of the speed that the tow asked for over "
                "a path of a mean floe size, and the ice held it: a jam%s",
                t->stall.time, s->sim_time, 100 * BT_STALL_SHARE,
                c->ice.crushing_pressure > 0 || c->ice.rafting_kappa > 0
                    ? ""
                    : "; rigid contact has no largest force: consider ice.rafting.kappa or ice.crushing.pressure");
    if (!(h->max_momentum_residual <= MOMENTUM_LIMIT))
        bt_warn(&s->warnings, BT_WARN_MOMENTUM,
                "momentum is conserved only to %.2g of what the steps exchange; please report this case",
                h->max_momentum_residual);
    bt_outline_warn(&t->outlines, c, &s->warnings);
    bt_field_size_warn(c, &t->sizes, &s->warnings);
    if (t->mean_thickness > 0) bt_ice_warn(c, t->mean_size, t->mean_thickness, &s->warnings);
    warn_of_events(s, t->events);
    summary_window_warn(&s->warnings, t->window);
    if (t->floes_outside)
        bt_warn(&s->warnings, BT_WARN_FLOES_LEFT,
                "%lld floes left the open domain and resist no more; use a larger domain or walls if that "
                "matters",
                (long long)t->floes_outside);
}

/// tow.direction is 0 by default and nothing drifts along it: what resists along it is no number of a free body.
static void without_tow(bt_summary *s, const bt_case *c)
{
    if (c->tow.mode != BT_TOW_NONE) return;
    s->ice.mean = s->ice.se = s->ice.low = s->ice.high = NAN;
    bt_warn(&s->warnings, BT_WARN_NO_TOW,
            "nothing tows the body, so there is no mean ice resistance: all other forces of the summary, and the "
            "series of ice_resistance, are those against tow.direction (%g deg), whatever way the body drifts; "
            "for the force of the ice read the series ice_force_x and ice_force_y",
            c->tow.direction * 180 / BT_PI);
}

/// The conditions of the estimates as the case orders them over the window: at the mean speed of the programme there,
/// on the course there. The estimate says when that turns within the window, for the body too. tow: velocity ordered
/// over ground, m/s.
static void order_window(bt_summary *summary, const bt_history *h, const bt_case *c, double tow[2])
{
    const bt_steady *s = &summary->window;
    bt_estimate_input *in = &summary->estimate;
    bt_case straight = *c; // texts and tables remain those of c
    bt_path path = {0};
    char why[200];
    if (c->tow.mode != BT_TOW_NONE && s->end > s->start) {
        const double from = bt_case_tow_distance(c, s->start), to = bt_case_tow_distance(c, s->end);
        if (c->tow.n_programme > 0 || s->start < c->tow.ramp)
            straight.tow.speed = (to - from) / (s->end - s->start);
        if (c->tow.n_waypoints > 0 && bt_case_tow_path(c, &path, why)) {
            double a[2], b[2], first[2], last[2];
            bt_path_at(&path, s->led[0], a, first);
            bt_path_at(&path, s->led[1], b, last);
            straight.tow.direction = bt_atan2(first[1] + last[1], first[0] + last[0]);
            // at a set speed a body keeps its yaw; on a line it follows its course, as in src/case/arch.c
            if (c->tow.mode != BT_TOW_SPEED) straight.body.yaw += straight.tow.direction - c->tow.direction;
            bt_path_free(&path);
        }
    }
    // As the body lay, which on a line or free need not be as it began; a mean across a turn would be of two courses.
    const double yaw = mean_over(summary, h, BT_COL_YAW).mean;
    if (isfinite(yaw) && !s->turns) straight.body.yaw = yaw;
    bt_estimate_conditions(&straight, in);
    in->turns = s->turns;
    tow[0] = straight.tow.speed * bt_cos(straight.tow.direction);
    tow[1] = straight.tow.speed * bt_sin(straight.tow.direction);
}

/// Speeds of the window, where they are known: what the estimates take. Nothing tows a body that is adrift. tow: as
/// ordered over ground, m/s.
static void measure_speeds(bt_summary *s, const bt_history *h, const bt_case *c, const bt_run_totals *t,
                           const double tow[2])
{
    bt_estimate_input *in = &s->estimate;
    const bool changes = c->water.tide.major > 0 || c->water.table.n > 0; // the current
    const double ice[2] = {mean_over(s, h, BT_COL_SPEED_ICE).mean, mean_over(s, h, BT_COL_LEEWAY_ICE).mean},
                 water[2] = {mean_over(s, h, BT_COL_SPEED_WATER).mean, mean_over(s, h, BT_COL_LEEWAY_WATER).mean};
    bool adrift = false;
    for (int64_t i = 0; t->events && i < t->events->n; i++) adrift |= t->events->event[i].kind == BT_EVENT_ADRIFT;
    if (adrift) {
        in->speed = in->along = in->water_speed = in->water_along = NAN;
    } else if (isfinite(ice[0]) && !isnan(in->along)) {
        // Less the drift of the ice over ground within the window: that of a current that changes is not the mean of
        // the run.
        const double speed = bt_hypot(tow[0], tow[1]), made[2] = {mean_over(s, h, BT_COL_VX).mean,
                                                                  mean_over(s, h, BT_COL_VY).mean};
        const double along = (made[0] * tow[0] + made[1] * tow[1]) / speed;
        if (isfinite(along) && changes && !s->window.turns) in->ordered = speed - (along - ice[0]);
        else in->ordered += ice[0] - water[0];
        in->along = ice[0], in->speed = bt_hypot(ice[0], ice[1]);
        in->water_along = water[0], in->water_speed = bt_hypot(water[0], water[1]);
    }
}

void bt_summary_make(bt_summary *s, const bt_history *h, const bt_case *c, const bt_run_totals *t, bt_idx n_floes,
                     bool body)
{
    const double nan = NAN;
    *s = (bt_summary){.body = body, .sim_time = h->n ? h->column[BT_COL_TIME][h->n - 1] : 0, .reference_ratio = nan};
    if (t->stopped) bt_warn(&s->warnings, BT_WARN_STOPPED, "the run stopped early: %s", t->stopped);
    else if (t->n_steps < t->whole_steps)
        bt_warn(&s->warnings, BT_WARN_ENDED_EARLY,
                "the run ended after %lld of %lld steps, as it was asked to: `bergtow resume` takes the others",
                (long long)t->n_steps, (long long)t->whole_steps);

    const bt_mean none = bt_stats_mean(NULL, 0);
    s->ice = s->tow = s->drag = s->coriolis = s->tilt = s->inertia = s->budget = none;
    s->p95 = s->p99 = s->peak = s->balance = s->closure = s->closure_relative = s->budget_closure_relative = nan;
    bt_steady_none(&s->window);
    if (body) bt_steady_find(&s->window, h, c, t);
    reduce_added(s, h);
    if (body) {
        reduce_window(s, h);
        without_tow(s, c);
        warn_of_window(s, c, t);
        s->reference_ratio = s->ice.mean / c->reference.mean_force;
        double tow[2];
        order_window(s, h, c, tow);
        measure_speeds(s, h, c, t, tow);
        s->estimate.concentration = t->concentration;
        if (t->mean_thickness > 0) s->estimate.thickness = t->mean_thickness;
        if (t->mean_radius > 0) s->estimate.floe_radius = t->mean_radius;
    }

    s->contacts = h->n ? h->sum_contacts / (double)h->n : nan;
    s->sweeps = h->n ? h->sum_sweeps / (double)h->n : nan;
    s->updates = h->n ? h->sum_updates / (double)h->n : nan;
    s->moves = h->n ? h->sum_moves / (double)h->n : nan;
    s->checks = h->n ? h->sum_checks / (double)h->n : nan;
    s->projected = h->n ? h->sum_projected / (double)h->n : nan;
    s->ns_per_floe_step =
        n_floes > 0 && t->n_steps > 0 ? 1e9 * t->wall_time / ((double)n_floes * (double)t->n_steps) : nan;

    bt_case_warn_idle(c, &s->warnings);
    bt_case_warn_tables(c, &s->warnings);
    bt_case_warn_body(c, &s->warnings);
    bt_ice_warn_closed(c, t->ice_area, &s->warnings);
    if (n_floes > 0) bt_ice_warn_slow(c, t->mean_size, &s->warnings);
    if (t->undisturbed) bt_case_warn_lead(c, t->undisturbed->drift_x, t->undisturbed->drift_y, &s->warnings);
    warn_of_solver(s, h, t);
    warn_of_bodies(s, h, c, t);
}

double bt_summary_held_against(const bt_summary *s) { return s->window.met_no_ice ? NAN : s->ice.mean; }

void bt_summary_free(bt_summary *s)
{
    bt_errors_free(&s->warnings);
    bt_errors_free(&s->window.reasons);
    *s = (bt_summary){0};
}
