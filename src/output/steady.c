// SPDX-License-Identifier: MIT
// Window and verdict of a run; the rules are in steady.h.
#include "output/steady.h"
#include "base/units.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "geometry/path.h"
#include "step/window.h"
#include "case/case_tow.h"
#include "case/track.h"
#include "case/warning.h"
#include "base/inside.h"
#include "base/elementary.h"
#include "output/summary.h"

const char *const bt_verdict_names[] = {"steady", "not steady", "too short"};

/// load: its independent samples count for the length of the window. always: there in every run with a towed body.
static const struct { const char *name, *key; bt_column column; bool load, always; } reported[BT_N_REPORTED] = {
    [BT_REPORTED_ICE] = {"ice resistance", "ice_resistance", BT_COL_ICE, true, true},
    [BT_REPORTED_TOW] = {"tow force", "tow_force", BT_COL_TOW, true, true},
    [BT_REPORTED_DRAG] = {"drag", "drag_force", BT_COL_DRAG, false, false},
    [BT_REPORTED_TENSION_1] = {"tension of the line", "line_tension_1", BT_COL_TENSION_1, true, false},
    [BT_REPORTED_TENSION_2] = {"tension of the second branch", "line_tension_2", BT_COL_TENSION_2, true, false},
    [BT_REPORTED_THRUST] = {"thrust of the vessel", "vessel_thrust", BT_COL_THRUST, true, false},
};

/// Where a reason of this verdict goes. Those of one verdict stand one after the other; one of a run that is not steady
/// takes the place of one of a window too short.
static bt_errors *because(bt_steady *s, bt_verdict verdict)
{
    if (s->verdict == BT_NOT_STEADY && verdict == BT_TOO_SHORT) return NULL;
    if (s->verdict != verdict) bt_errors_free(&s->reasons);
    s->verdict = verdict;
    return &s->reasons;
}

static int64_t first_at_or_after(const bt_history *h, double time)
{
    int64_t i = 0;
    while (i < h->n && h->column[BT_COL_TIME][i] < time) i++;
    return i;
}

/// A series that the run has from step `first` to its end.
static bool is_there(const double *x, int64_t first, int64_t n)
{
    for (int64_t i = first; i < n; i++)
        if (isnan(x[i])) return false;
    return n > first;
}

/// Of a branch that has parted only the peaks are left: its mean is one of tension and zeros, or of zeros alone.
static bool has_parted(const bt_run_totals *t, bt_reported_series k)
{
    bool parted = false;
    if (k != BT_REPORTED_TENSION_1 && k != BT_REPORTED_TENSION_2) return false;
    for (int64_t i = 0; t->events && i < t->events->n; i++)
        parted |= t->events->event[i].kind == BT_EVENT_LINE_BROKEN &&
                  t->events->event[i].subject == 1 + (int)k - BT_REPORTED_TENSION_1;
    return parted;
}

/// How many equal stretches the sum of |x[n]| above `base` is worth: with R_i the sum over a stretch between two steps
/// of next to nothing, (Σ R_i)² / Σ R_i². A stretch of more steps than `length` is cut into pieces of that.
static double stretches(const double *x, int64_t n, double base, double length)
{
    double mean = 0, sum = 0, squares = 0, piece = 0;
    int64_t steps = 0;
    for (int64_t i = 0; i < n; i++) mean += bt_max(0, fabs(x[i]) - base) / (double)n;
    for (int64_t i = 0; i <= n; i++) {
        const double above = i < n ? bt_max(0, fabs(x[i]) - base) : 0;
        const bool rest = above <= BT_STEADY_MATERIAL * mean;
        if (rest || (double)steps >= length) {
            sum += piece, squares += piece * piece;
            piece = 0, steps = 0;
        }
        if (!rest) piece += above, steps++;
    }
    return squares > 0 ? sum * sum / squares : 0;
}

/// What |x[n]| is above in nine steps of ten: a floe that is carried on the bow, say.
static double always_there(const double *x, int64_t n)
{
    if (n < 1) return 0;
    double *sorted = bt_alloc((size_t)n, sizeof *sorted);
    for (int64_t i = 0; i < n; i++) sorted[i] = fabs(x[i]);
    qsort(sorted, (size_t)n, sizeof *sorted, bt_ascending);
    const double base = sorted[n / 10];
    free(sorted);
    return base;
}

/// Stretches of contact that the mean of a window of the ice resistance is worth. A long push is one, up to a sixtieth
/// of the window, so that contact without end is worth six times as many as are asked for, and what is always there is
/// none. Not cut to the correlation: short collisions make that short, and a push of some minutes would be hundreds;
/// where a body meets floes one by one nearly all steps are independent, and say nothing of a mean that is made of
/// three hits. What is slow in dense ice is in n_eff.
static double contacts(const double *x, const bt_mean *m)
{
    return stretches(x, m->n, always_there(x, m->n), (double)m->n / (6 * BT_STEADY_STRETCHES));
}

/// Does a series vary by more than matters, or is it too short to tell?
static bool varies(const bt_mean *m)
{
    return m->n < BT_STEADY_INDEPENDENT || !(m->sd <= BT_STEADY_MATERIAL * fabs(m->mean));
}

static bool pauses(const double *x, const bt_mean *m)
{
    for (int64_t i = 0; i < m->n; i++)
        if (fabs(x[i]) <= BT_STEADY_MATERIAL * fabs(m->mean)) return true;
    return false;
}

/// Index of the window's first step; h->n without a window.
static int64_t find_start(bt_steady *s, const bt_history *h, const bt_case *c)
{
    s->given = c->output.window_start >= 0;
    s->earliest = bt_case_earliest_window(c);
    const int64_t earliest = first_at_or_after(h, s->earliest);
    int64_t first = earliest;
    int settles = -1; // which series
    if (s->given || earliest >= h->n) return first;
    const double *ice = h->column[BT_COL_ICE];
    for (int k = 0; k < BT_N_REPORTED; k++) {
        const double *x = h->column[reported[k].column];
        // Where a few collisions are left nothing tells them from those before, nor in a tow force that is their sum
        // with a constant.
        const bool collisions = k == BT_REPORTED_ICE || (k == BT_REPORTED_TOW && c->tow.mode == BT_TOW_SPEED);
        if (!is_there(x, earliest, h->n)) continue;
        const int64_t start = bt_stats_steady_start(x, h->n, earliest, BT_STEADY_MATERIAL);
        if (start > earliest && collisions) {
            const bt_mean left = bt_stats_mean(ice + start, h->n - start);
            if (contacts(ice + start, &left) < BT_STEADY_STRETCHES) continue;
        }
        first = start > first ? start : first;
        // A minimum at the far end of the search means that the variance still falls where the search stops.
        if (start > earliest && start == bt_stats_last_start(h->n, earliest)) settles = k;
    }
    if (settles >= 0) {
        bt_warn(because(s, BT_NOT_STEADY), BT_WARN_SETTLING,
                "the %s still settles where the search for a start ends, halfway from %g s to the end of the run, and "
                "the window begins there (%g s): run longer",
                reported[settles].name, s->earliest, h->column[BT_COL_TIME][first]);
        bt_warn_name(&s->reasons, "series", reported[settles].key);
    }
    return first;
}

static void reduce(bt_steady *s, const bt_history *h, const bt_run_totals *t)
{
    for (int k = 0; k < BT_N_REPORTED; k++) {
        const double *x = h->column[reported[k].column];
        bt_reported *r = &s->series[k];
        *r = (bt_reported){.name = reported[k].name,
                           .key = reported[k].key,
                           .mean = bt_stats_mean(NULL, 0),
                           .peak = bt_history_largest(x, s->first, h->n),
                           .start_peak = bt_history_largest(x, 0, s->first),
                           .present =
                               reported[k].always || (is_there(x, s->first, h->n) && !has_parted(t, k))};
        if (!r->present) continue;
        r->mean = bt_stats_mean(x + s->first, s->n);
        r->trend = bt_stats_trend(x + s->first, s->n);
        bt_stats_quarters(x + s->first, s->n, r->quarter);
    }
    bt_mean *ice = &s->series[BT_REPORTED_ICE].mean;
    const double *x = h->column[BT_COL_ICE] + s->first;
    s->stretches = varies(ice) ? contacts(x, ice) : INFINITY;
    const double most = s->stretches < BT_STEADY_STRETCHES ? s->stretches
                        : pauses(x, ice)                   ? stretches(x, s->n, 0, 2 * ice->tau)
                                                           : INFINITY;
    if (most < ice->n_eff && (most > 0 || t->concentration > 0)) ice->n_eff = most;
    // A body that met no ice has a mean of 0, and nothing says how far from it that of a longer tow is.
    if (ice->sd == 0 && ice->mean == 0 && t->concentration > 0) ice->se = ice->low = ice->high = NAN;
    for (int64_t i = s->first; i < h->n; i++) {
        s->unconverged += (h->column[BT_COL_UNCONVERGED][i] != 0) / (double)s->n;
        s->no_load += (h->column[BT_COL_NO_LOAD][i] > 0) / (double)s->n;
        s->residual = bt_max_seen(s->residual, h->column[BT_COL_RESIDUAL][i]);
    }
    s->at_least = s->no_load > 0;
    if (!s->at_least) return; // a lower bound has no interval; the tow force is none on a line
    ice->se = ice->low = ice->high = NAN;
    bt_mean *tow = &s->series[BT_REPORTED_TOW].mean;
    if (isnan(s->series[BT_REPORTED_TENSION_1].peak)) tow->se = tow->low = tow->high = NAN;
}

double bt_steady_peak_tension(const bt_steady *s, bool before)
{
    static const bt_reported_series branch[] = {BT_REPORTED_TENSION_1, BT_REPORTED_TENSION_2};
    double most = NAN;
    for (int k = 0; k < 2; k++) {
        const bt_reported *r = &s->series[branch[k]];
        const double x = before ? r->start_peak : r->peak;
        if (!isnan(x) && !(x <= most)) most = x;
    }
    return most;
}

void bt_steady_none(bt_steady *s)
{
    *s = (bt_steady){.earliest = NAN, .start = NAN, .end = NAN, .correlation_time = NAN};
    for (int k = 0; k < BT_N_REPORTED; k++)
        s->series[k] = (bt_reported){.mean = bt_stats_mean(NULL, 0), .peak = NAN, .start_peak = NAN};
}

static void judge_solver(bt_steady *s, const bt_case *c, const bt_run_totals *t)
{
    const double speed = t->tolerance / c->solver.tolerance;
    if (s->at_least)
        bt_warn(because(s, BT_NOT_STEADY), BT_WARN_NO_LOAD,
                "%.3g %% of the steps in the window have no solution, so the loads of the body are at least those "
                "given: let ice give way (ice.rafting.kappa, ice.crushing.pressure), or do not use them",
                100 * s->no_load);
    if (s->unconverged > BT_STEADY_UNCONVERGED)
        bt_warn(because(s, BT_NOT_STEADY), BT_WARN_UNCONVERGED_SHARE,
                "%.1f %% of the steps in the window did not converge, more than the %g %% that a mean bears: raise "
                "solver.max_sweeps or lower run.dt",
                100 * s->unconverged, 100 * BT_STEADY_UNCONVERGED);
    if (s->residual > BT_STEADY_RESIDUAL * speed)
        bt_warn(because(s, BT_NOT_STEADY), BT_WARN_RESIDUAL,
                "a step in the window was left with a residual of %.2g m/s, more than %g of the reference speed of "
                "%.3g m/s: raise solver.max_sweeps or lower run.dt",
                s->residual, BT_STEADY_RESIDUAL, speed);
}

/// Way of the towing end after this time, m. A vessel need not keep to its programme: it goes as far as its body.
static double led_after(const bt_history *h, const bt_case *c, double time)
{
    const double *t = h->column[BT_COL_TIME], *vx = h->column[BT_COL_VX], *vy = h->column[BT_COL_VY];
    double way = 0;
    if (c->tow.mode != BT_TOW_THRUST || h->n == 0 || isnan(vx[0])) return bt_case_tow_distance(c, time);
    for (int64_t i = 0; i < h->n && t[i] <= time; i++) way += bt_hypot(vx[i], vy[i]) * (t[i] - (i > 0 ? t[i - 1] : 0));
    return way;
}

#define COURSE_LEFT 0.1 // rad of a turn that is left where the body counts as being on its new course, assumed

static double half_tan(double angle) { return bt_sin(0.5 * angle) / bt_cos(0.5 * angle); }

/// Way of the end from a turn until the body on its line has followed, m. The angle θ between body and end goes down as
/// tan θ/2 ~ exp(−s/L) (a tractrix); a line's length at least.
static double followed_in(const bt_case *c, double turn)
{
    if (c->tow.mode == BT_TOW_SPEED) return 0;
    return c->tow.line_length * bt_max(1, bt_log(half_tan(bt_min(turn, 3)) / half_tan(COURSE_LEFT)));
}

/// When way-point k was passed, s; NaN = not yet.
static double passed_at(const bt_run_totals *t, int k)
{
    for (int64_t i = 0; t->events && i < t->events->n; i++)
        if (t->events->event[i].kind == BT_EVENT_WAYPOINT && t->events->event[i].subject - 1 == k)
            return t->events->event[i].time;
    return NAN;
}

/// Angle between the mean courses of the body in the first and the last tenth of the window, rad: a heavy body swings
/// out and comes on to its new course later than its line leads it there.
static double swing(const bt_steady *s, const bt_history *h)
{
    const int64_t n = (s->n + 9) / 10;
    double v[2][2] = {{0}};
    for (int64_t i = 0; i < n; i++)
        for (int k = 0; k < 2; k++) {
            const int64_t at = k ? h->n - 1 - i : s->first + i;
            v[k][0] += h->column[BT_COL_VX][at], v[k][1] += h->column[BT_COL_VY][at];
        }
    return fabs(bt_atan2(v[0][0] * v[1][1] - v[0][1] * v[1][0], v[0][0] * v[1][0] + v[0][1] * v[1][1]));
}

/// Turns at way-points, by the way of the end: from the beginning of the arc until the body has followed.
static void judge_course(bt_steady *s, const bt_history *h, const bt_case *c, const bt_run_totals *t)
{
    bt_path path;
    char why[200];
    for (int k = 0; k < 2; k++) s->led[k] = led_after(h, c, k ? s->end : s->start);
    if (c->tow.n_waypoints == 0 || c->tow.mode == BT_TOW_NONE || !bt_case_tow_path(c, &path, why)) return;
    bool turned = false;
    for (int k = 0; k < path.n_marks; k++) {
        const double turn = bt_case_tow_turn(c, k), passed = passed_at(t, k), arc = 0.5 * c->tow.turn_radius * turn;
        const bool vessel = c->tow.mode == BT_TOW_THRUST && isfinite(passed);
        const double mark = vessel ? led_after(h, c, passed) : path.mark[k], slack = 1e-9 * mark;
        turned = turned || (turn > BT_TURN && mark < s->led[1]);
        if (!(turn > BT_TURN) || mark - arc >= s->led[1] - slack ||
            mark + arc + followed_in(c, turn) <= s->led[0] + slack)
            continue;
        char when[60] = "that it begins to turn to";
        if (isfinite(passed)) snprintf(when, sizeof when, "passed at %g s", passed);
        bt_warn(because(s, BT_NOT_STEADY), BT_WARN_COURSE_CHANGES,
                "the course changes by %.3g deg at way-point %d, %s, within the window%s: end the run before, begin "
                "the window later, or read the series",
                turn * 180 / BT_PI, k + 1, when,
                mark + arc > s->led[0] + slack ? "" : " for the body, which follows its line");
        s->turns = true;
    }
    bt_path_free(&path);
    if (!turned || s->turns || c->tow.mode == BT_TOW_SPEED || !(swing(s, h) > COURSE_LEFT)) return;
    bt_warn(because(s, BT_NOT_STEADY), BT_WARN_COURSE_FOLLOWS,
            "the course of the body, behind its line, still changes by %.3g deg within the window: begin it later, or "
            "read the series",
            swing(s, h) * 180 / BT_PI);
    s->turns = true;
}

/// What happened within the window that no mean goes across.
static void judge_events(bt_steady *s, const bt_case *c, const bt_run_totals *t)
{
    const double *p = c->tow.programme;
    for (int i = 0; i + 1 < c->tow.n_programme; i++) {
        if (p[2 * i + 1] == p[2 * i + 3] || p[2 * i + 2] <= s->start || p[2 * i] >= s->end) continue;
        bt_warn(because(s, BT_NOT_STEADY), BT_WARN_PROGRAMME,
                "the speed programme goes from %g to %g m/s within the window, %g to %g s: end the run before, or read "
                "the series",
                p[2 * i + 1], p[2 * i + 3], s->start, s->end);
    }
    for (int64_t i = 0; t->events && i < t->events->n; i++) {
        const bt_event *e = &t->events->event[i];
        if (e->kind == BT_EVENT_ADRIFT)
            bt_warn(because(s, BT_NOT_STEADY), BT_WARN_ADRIFT,
                    "the last line parted at %g s, and nothing tows the body since", e->time);
        else if (e->kind == BT_EVENT_LINE_BROKEN && e->time > s->start)
            bt_warn(because(s, BT_NOT_STEADY), BT_WARN_PARTED_IN_WINDOW,
                    "a line parted at %g s, within the window, whose means mix before and after",
                    e->time);
    }
    if (!t->window) return;
    const double places = (double)(t->window->renewed + t->window->missed);
    if (places > 0 && (double)t->window->missed > BT_STEADY_MISSED * places)
        bt_warn(because(s, BT_NOT_STEADY), BT_WARN_PLACES_MISSED,
                "%.0f %% of the places ahead of the moving window stayed empty: the body pushes ever more ice, or "
                "carries it along: take a longer domain",
                100 * (double)t->window->missed / places);
}

/// Way that the body has come on over ground within the window, along the leg of the tow that it is on, m; NaN = not
/// known.
static double come_on(const bt_steady *s, const bt_history *h, const bt_case *c, const bt_run_totals *totals)
{
    const double *t = h->column[BT_COL_TIME], *vx = h->column[BT_COL_VX], *vy = h->column[BT_COL_VY];
    double way = 0, ux = bt_cos(c->tow.direction), uy = bt_sin(c->tow.direction), passed = passed_at(totals, 0);
    int leg = 0;
    for (int64_t i = s->first + 1; i < h->n; i++) {
        while (leg + 1 < c->tow.n_waypoints && passed <= t[i]) {
            const double *p = c->tow.waypoints + 2 * leg, course = bt_atan2(p[3] - p[1], p[2] - p[0]);
            ux = bt_cos(course), uy = bt_sin(course);
            passed = passed_at(totals, ++leg);
        }
        way += (vx[i] * ux + vy[i] * uy) * (t[i] - t[i - 1]);
    }
    return way;
}

/// Ice that the body has opened itself, water beyond the ice, or a body that does not come on.
static void judge_track(bt_steady *s, const bt_history *h, const bt_case *c, const bt_run_totals *totals)
{
    const double *x = h->column[BT_COL_IN_ICE_X], *y = h->column[BT_COL_IN_ICE_Y];
    const bt_track t = {.n = h->n, .time = h->column[BT_COL_TIME], .x = x, .y = y,
                        .region = bt_outline_region(&totals->outlines)};
    bt_errors found = {0};
    bt_track_warn(c, &t, &found);
    if (found.n) bt_errors_move(because(s, BT_NOT_STEADY), &found);
    const double asked =
        c->tow.mode == BT_TOW_NONE ? 0 : bt_case_tow_distance(c, s->end) - bt_case_tow_distance(c, s->start);
    const double way = come_on(s, h, c, totals);
    if (totals->stall.inside > 0)
        bt_warn(because(s, BT_NOT_STEADY), BT_WARN_END_INSIDE,
                "the towing end was within the hull for %.3g s, from %.4g s on: the body has overtaken it, and its "
                "line pulls from behind",
                totals->stall.inside, totals->stall.inside_from);
    if (totals->stall.time > BT_STEADY_STALLED * s->end)
        bt_warn(because(s, BT_NOT_STEADY), BT_WARN_STOOD_STILL,
                "the towed body stood still for %.3g s of %.3g s, held by the ice: the mean depends on how often it "
                "jams",
                totals->stall.time, s->end);
    else if (way < BT_STALL_SHARE * asked && !s->turns) { // else the body may be on the leg before
        bt_warn(because(s, BT_NOT_STEADY), BT_WARN_NO_HEADWAY,
                "the tow asked for %.4g m within the window, %g to %g s, and the body has %s %.3g m over ground: it "
                "does not come on",
                asked, s->start, s->end, way < 0 ? "gone astern by" : "come on by", fabs(way));
        bt_warn_number(&s->reasons, "way_m", way);
    }
}

/// The first of the reported series with a trend that matters: the others mostly follow from it.
static void judge_trends(bt_steady *s)
{
    char change[32], low[32], high[32];
    for (int k = 0; k < BT_N_REPORTED; k++) {
        const bt_reported *r = &s->series[k];
        const bt_trend *t = &r->trend;
        // that a few collisions came early or late is no trend
        if (s->stretches < BT_STEADY_STRETCHES && (k == BT_REPORTED_ICE || k == BT_REPORTED_TOW)) continue;
        if (!r->present || !t->significant || !(fabs(t->change) > BT_STEADY_MATERIAL * fabs(r->mean.mean))) continue;
        bt_warn(because(s, BT_NOT_STEADY), BT_WARN_TREND,
                "the %s %s over the window by %s (95 %%: %s to %s), %.0f %% of its mean: run longer, or begin the "
                "window later",
                r->name, t->change > 0 ? "rises" : "falls", bt_force_text(change, fabs(t->change)),
                bt_force_text(low, bt_min(fabs(t->low), fabs(t->high))),
                bt_force_text(high, bt_max(fabs(t->low), fabs(t->high))), 100 * fabs(t->change / r->mean.mean));
        bt_warn_name(&s->reasons, "series", r->key);
        bt_warn_number(&s->reasons, "change_n", t->change);
        bt_warn_number(&s->reasons, "low_n", t->low);
        bt_warn_number(&s->reasons, "high_n", t->high);
        return;
    }
}

/// A body that no floe has touched tells nothing of the ice, however long the window, and one that a few have touched
/// little.
static void judge_contact(bt_steady *s, const bt_run_totals *t)
{
    const bt_mean *ice = &s->series[BT_REPORTED_ICE].mean;
    s->met_no_ice = t->concentration > 0 && ice->mean == 0 && ice->sd == 0;
    if (s->met_no_ice) s->stretches = 0;
    if (s->met_no_ice && t->lead.mode == BT_LEAD_CHANNEL)
        bt_warn(because(s, BT_TOO_SHORT), BT_WARN_NO_ICE_CHANNEL,
                "the body met no ice within the window, %g to %g s, in a channel of %.4g m: run longer, or take it "
                "that the ice does not come into the channel",
                s->start, s->end, t->lead.width);
    else if (s->met_no_ice)
        bt_warn(because(s, BT_TOO_SHORT), BT_WARN_NO_ICE,
                "the body met no ice within the window, %g to %g s, in %.3g %% ice: run longer",
                s->start, s->end, 100 * t->concentration);
    else if (ice->mean != 0 && s->stretches < BT_STEADY_STRETCHES)
        bt_warn(because(s, BT_TOO_SHORT), BT_WARN_FEW_CONTACTS,
                "the mean of the ice resistance within the window, %g to %g s, is made of a few stretches of contact, "
                "worth %.2g equal ones, fewer than %d: run longer",
                s->start, s->end, s->stretches, BT_STEADY_STRETCHES);
}

/// The load that is known worst, of those that vary; and a body on a line that has had no time to swing.
static void judge_length(bt_steady *s, const bt_case *c, double dt)
{
    const double swings = BT_RAMP_PERIODS * bt_case_line_period(c), length = (double)s->n * dt;
    if (length < swings * (1 - 1e-9))
        bt_warn(because(s, BT_TOO_SHORT), BT_WARN_FEW_SWINGS,
                "the window of %g s is shorter than %g swings of the body on its line (%.3g s each): run longer",
                length, BT_RAMP_PERIODS, bt_case_line_period(c));
    const bt_reported *worst = NULL;
    for (int k = 0; k < BT_N_REPORTED; k++) {
        const bt_reported *r = &s->series[k];
        const double n = (double)s->n / (2 * r->mean.tau); // stretches of contact are judged before
        if (!reported[k].load || !r->present || !varies(&r->mean) || n >= BT_STEADY_INDEPENDENT) continue;
        if (!worst || r->mean.tau > worst->mean.tau) worst = r;
    }
    if (!worst) return;
    bt_errors *reasons = because(s, BT_TOO_SHORT);
    bt_warn(reasons, BT_WARN_FEW_SAMPLES,
            "the window of %g s holds %.1f independent samples of the %s (correlation time %.3g s), fewer than %d: run "
            "longer",
            (double)s->n * dt, floor(10 * (double)s->n / (2 * worst->mean.tau)) / 10, worst->name, worst->mean.tau * dt,
            BT_STEADY_INDEPENDENT);
    bt_warn_name(reasons, "series", worst->key);
}

void bt_steady_find(bt_steady *s, const bt_history *h, const bt_case *c, const bt_run_totals *t)
{
    const double *time = h->column[BT_COL_TIME], ramp = c->tow.mode == BT_TOW_NONE ? 0 : c->tow.ramp;
    *s = (bt_steady){.start = NAN, .end = NAN, .correlation_time = NAN};
    s->first = find_start(s, h, c);
    s->put_off = s->first - first_at_or_after(h, s->earliest);
    s->n = h->n - s->first;
    if (s->n == 0) {
        bt_warn(because(s, BT_TOO_SHORT), BT_WARN_NO_WINDOW,
                "no window: it would begin at %g s and the run ends at %g s: run longer, or %s",
                s->earliest, h->n ? time[h->n - 1] : 0, s->given                  ? "lower output.window_start"
                : c->tow.n_programme > 0 ? "let tow.programme come to its largest speed earlier"
                                         : "shorten tow.ramp");
    } else {
        s->start = time[s->first];
        s->end = time[h->n - 1];
    }
    reduce(s, h, t);
    if (s->n == 0) return;
    s->correlation_time = s->n > 1 ? s->series[BT_REPORTED_ICE].mean.tau * t->dt : NAN;
    if (!isfinite(s->series[BT_REPORTED_ICE].mean.mean) || !isfinite(s->series[BT_REPORTED_TOW].mean.mean))
        bt_warn(because(s, BT_NOT_STEADY), BT_WARN_NOT_FINITE,
                "the forces on the body are not finite within the window: the run is not usable: lower run.dt");
    if (s->start < ramp * (1 - 1e-12))
        bt_warn(because(s, BT_NOT_STEADY), BT_WARN_WITHIN_RAMP,
                "the window begins at %g s, before the %s at %g s: raise output.window_start",
                s->start, c->tow.n_programme > 0 ? "tow comes to the largest speed of its programme"
                                                 : "ramp of the tow ends",
                ramp);
    judge_solver(s, c, t);
    judge_events(s, c, t);
    judge_course(s, h, c, t);
    judge_track(s, h, c, t);
    judge_trends(s);
    judge_contact(s, t);
    judge_length(s, c, t->dt);
}
