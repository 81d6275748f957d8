// SPDX-License-Identifier: MIT
// Window and verdict of a run; the rules are in steady.h.
#include "output/steady.h"
#include "base/units.h"

#include "geometry/path.h"
#include "case/case_tow.h"
#include "case/track.h"
#include "case/warning.h"
#include "base/inside.h"
#include "base/elementary.h"
#include "step/window.h"

const char *const bt_verdict_names[] = {"steady", "not steady", "too short"};

/// load: its independent samples decide whether the window is long enough. always: in every run with a towed body.
static const struct { const char *name, *key; bt_column column; bool load, always; } reported[BT_N_REPORTED] = {
    [BT_REPORTED_ICE] = {"ice resistance", "ice_resistance", BT_COL_ICE, true, true},
    [BT_REPORTED_TOW] = {"tow force", "tow_force", BT_COL_TOW, true, true},
    [BT_REPORTED_DRAG] = {"drag", "drag_force", BT_COL_DRAG, false, false},
    [BT_REPORTED_TENSION_1] = {"tension of the line", "line_tension_1", BT_COL_TENSION_1, true, false},
    [BT_REPORTED_TENSION_2] = {"tension of the second branch", "line_tension_2", BT_COL_TENSION_2, true, false},
    [BT_REPORTED_THRUST] = {"thrust of the vessel", "vessel_thrust", BT_COL_THRUST, true, false},
};

/// Place for a reason of this verdict. Reasons of one verdict are listed; `not steady` replaces reasons of `too short`.
static bt_errors *because(bt_steady *steady, bt_verdict verdict)
{
    if (steady->verdict == BT_NOT_STEADY && verdict == BT_TOO_SHORT) return NULL;
    if (steady->verdict != verdict) bt_errors_free(&steady->reasons);
    steady->verdict = verdict;
    return &steady->reasons;
}

static int64_t first_at_or_after(const bt_history *history, double time)
{
    int64_t i = 0;
    while (i < history->n && history->column[BT_COL_TIME][i] < time) i++;
    return i;
}

/// Does the run have the series from step `first` to its end?
static bool is_there(const double *x, int64_t first, int64_t n)
{
    for (int64_t i = first; i < n; i++)
        if (isnan(x[i])) return false;
    return n > first;
}

/// Has the branch of this series broken? Then only its peaks are valid: its mean would be of tension and zeros, or of
/// zeros alone.
static bool has_parted(const bt_run_totals *totals, bt_reported_series k)
{
    bool parted = false;
    if (k != BT_REPORTED_TENSION_1 && k != BT_REPORTED_TENSION_2) return false;
    for (int64_t i = 0; totals->events && i < totals->events->n; i++)
        parted |= totals->events->event[i].kind == BT_EVENT_LINE_BROKEN &&
                  totals->events->event[i].subject == 1 + (int)k - BT_REPORTED_TENSION_1;
    return parted;
}

/// Equivalent number of equal stretches in the sum of |x[n]| above `base`: (Σ R_i)² / Σ R_i², with R_i the sum over a
/// stretch between two steps with almost nothing. A stretch longer than `length` steps is cut into pieces of that
/// length.
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

/// The value that |x[n]| exceeds in nine steps of ten, such as the load of a floe carried on the bow.
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

/// Equivalent number of stretches of contact in a window of the ice resistance. A long push is one stretch, up to a
/// sixtieth of the window, so that continuous contact is worth six times as many as required; a constant load does not
/// count. Stretches are not cut to the correlation time: short collisions make it short, and a push of some minutes
/// would count as hundreds; where a body meets floes one by one nearly all steps are independent, but say nothing about
/// a mean made of three hits. Slow variation in dense ice is covered by the correlation time.
static double contacts(const double *x, const bt_mean *mean)
{
    return stretches(x, mean->n, always_there(x, mean->n), (double)mean->n / (6 * BT_STEADY_STRETCHES));
}

/// Does a series vary significantly, or is it too short to tell?
static bool varies(const bt_mean *mean)
{
    return mean->n < BT_STEADY_INDEPENDENT || !(mean->sd <= BT_STEADY_MATERIAL * fabs(mean->mean));
}

static bool pauses(const double *x, const bt_mean *mean)
{
    for (int64_t i = 0; i < mean->n; i++)
        if (fabs(x[i]) <= BT_STEADY_MATERIAL * fabs(mean->mean)) return true;
    return false;
}

/// Index of the window's first step; history->n without a window.
static int64_t find_start(bt_steady *steady, const bt_history *history, const bt_case *input)
{
    steady->given = input->output.window_start >= 0;
    steady->earliest = bt_case_earliest_window(input);
    const int64_t earliest = first_at_or_after(history, steady->earliest);
    int64_t first = earliest;
    int settles = -1; // index of a series
    if (steady->given || earliest >= history->n) return first;
    const double *ice = history->column[BT_COL_ICE];
    for (int k = 0; k < BT_N_REPORTED; k++) {
        const double *x = history->column[reported[k].column];
        // If only few collisions remain, they cannot be distinguished from earlier ones, nor in a tow force that is
        // their sum with a constant.
        const bool collisions = k == BT_REPORTED_ICE || (k == BT_REPORTED_TOW && input->tow.mode == BT_TOW_SPEED);
        if (!is_there(x, earliest, history->n)) continue;
        const int64_t start = bt_stats_steady_start(x, history->n, earliest, BT_STEADY_MATERIAL);
        if (start > earliest && collisions) {
            const bt_mean left = bt_stats_mean(ice + start, history->n - start);
            if (contacts(ice + start, &left) < BT_STEADY_STRETCHES) continue;
        }
        first = start > first ? start : first;
        // A minimum at the far end of the search means that the variance still falls where the search stops.
        if (start > earliest && start == bt_stats_last_start(history->n, earliest)) settles = k;
    }
    if (settles >= 0) {
        bt_warn(because(steady, BT_NOT_STEADY), BT_WARN_SETTLING,
                "the %s is still settling where the search for a start ends, halfway from %g s to the end of the run; "
                "the window begins there (%g s): run longer",
                reported[settles].name, steady->earliest, history->column[BT_COL_TIME][first]);
        bt_warn_name(&steady->reasons, "series", reported[settles].key);
    }
    return first;
}

static void reduce(bt_steady *steady, const bt_history *history, const bt_run_totals *totals)
{
    for (int k = 0; k < BT_N_REPORTED; k++) {
        const double *x = history->column[reported[k].column];
        bt_reported *r = &steady->series[k];
        *r = (bt_reported){.name = reported[k].name,
                           .key = reported[k].key,
                           .mean = bt_stats_mean(NULL, 0),
                           .peak = bt_history_largest(x, steady->first, history->n),
                           .start_peak = bt_history_largest(x, 0, steady->first),
                           .present =
                               reported[k].always ||
                               (is_there(x, steady->first, history->n) && !has_parted(totals, k))};
        if (!r->present) continue;
        r->mean = bt_stats_mean(x + steady->first, steady->n);
        r->trend = bt_stats_trend(x + steady->first, steady->n);
        bt_stats_quarters(x + steady->first, steady->n, r->quarter);
    }
    bt_mean *ice = &steady->series[BT_REPORTED_ICE].mean;
    const double *x = history->column[BT_COL_ICE] + steady->first;
    steady->stretches = varies(ice) ? contacts(x, ice) : INFINITY;
    const double most = steady->stretches < BT_STEADY_STRETCHES ? steady->stretches
                        : pauses(x, ice)                   ? stretches(x, steady->n, 0, 2 * ice->tau)
                                                           : INFINITY;
    if (most < ice->n_eff && (most > 0 || totals->concentration > 0)) ice->n_eff = most;
    // A body that met no ice has a mean of 0, and its distance from the mean of a longer tow is unknown.
    if (ice->sd == 0 && ice->mean == 0 && totals->concentration > 0) ice->se = ice->low = ice->high = NAN;
    for (int64_t i = steady->first; i < history->n; i++) {
        steady->unconverged += (history->column[BT_COL_UNCONVERGED][i] != 0) / (double)steady->n;
        steady->no_load += (history->column[BT_COL_NO_LOAD][i] > 0) / (double)steady->n;
        steady->residual = bt_max_seen(steady->residual, history->column[BT_COL_RESIDUAL][i]);
    }
    steady->at_least = steady->no_load > 0;
    if (!steady->at_least) return; // a lower bound has no interval; on a line the tow force is not a bound
    ice->se = ice->low = ice->high = NAN;
    bt_mean *tow = &steady->series[BT_REPORTED_TOW].mean;
    if (isnan(steady->series[BT_REPORTED_TENSION_1].peak)) tow->se = tow->low = tow->high = NAN;
}

double bt_steady_peak_tension(const bt_steady *steady, bool before)
{
    static const bt_reported_series branch[] = {BT_REPORTED_TENSION_1, BT_REPORTED_TENSION_2};
    double most = NAN;
    for (int k = 0; k < 2; k++) {
        const bt_reported *r = &steady->series[branch[k]];
        const double x = before ? r->start_peak : r->peak;
        if (!isnan(x) && !(x <= most)) most = x;
    }
    return most;
}

void bt_steady_none(bt_steady *steady)
{
    *steady = (bt_steady){.earliest = NAN, .start = NAN, .end = NAN, .correlation_time = NAN};
    for (int k = 0; k < BT_N_REPORTED; k++)
        steady->series[k] = (bt_reported){.mean = bt_stats_mean(NULL, 0), .peak = NAN, .start_peak = NAN};
}

static void judge_solver(bt_steady *steady, const bt_case *input, const bt_run_totals *totals)
{
    const double speed = totals->tolerance / input->solver.tolerance;
    if (steady->at_least)
        bt_warn(because(steady, BT_NOT_STEADY), BT_WARN_NO_LOAD,
                "%.3g %% of the steps in the window have no solution, so the loads on the body are at least those "
                "given: let ice give way (ice.rafting.kappa, ice.crushing.pressure), or do not use them",
                100 * steady->no_load);
    if (steady->unconverged > BT_STEADY_UNCONVERGED)
        bt_warn(because(steady, BT_NOT_STEADY), BT_WARN_UNCONVERGED_SHARE,
                "%.1f %% of the steps in the window did not converge, more than the %g %% that a mean tolerates: raise "
                "solver.max_sweeps or lower run.dt",
                100 * steady->unconverged, 100 * BT_STEADY_UNCONVERGED);
    if (steady->residual > BT_STEADY_RESIDUAL * speed)
        bt_warn(because(steady, BT_NOT_STEADY), BT_WARN_RESIDUAL,
                "a step in the window ended with a residual of %.2g m/s, more than %g of the reference speed of %.3g "
                "m/s: raise solver.max_sweeps or lower run.dt",
                steady->residual, BT_STEADY_RESIDUAL, speed);
}

/// Distance of the towing end after this time, m. A vessel may fall behind its programme: it goes as far as its body.
static double distance_towed(const bt_history *history, const bt_case *input, double time)
{
    const double *t = history->column[BT_COL_TIME], *vx = history->column[BT_COL_VX], *vy = history->column[BT_COL_VY];
    double way = 0;
    if (input->tow.mode != BT_TOW_THRUST || history->n == 0 || isnan(vx[0])) return bt_case_tow_distance(input, time);
    for (int64_t i = 0; i < history->n && t[i] <= time; i++)
        way += bt_hypot(vx[i], vy[i]) * (t[i] - (i > 0 ? t[i - 1] : 0));
    return way;
}

#define COURSE_LEFT 0.1 // rad of a turn left when the body counts as on its new course, assumed

static double half_tan(double angle) { return bt_sin(0.5 * angle) / bt_cos(0.5 * angle); }

/// Distance of the end from a turn until the body on its line has followed, m. The angle θ between body and end decays
/// as tan θ/2 ~ exp(−s/L) (a tractrix); at least the length of the line.
static double distance_to_follow(const bt_case *input, double turn)
{
    if (input->tow.mode == BT_TOW_SPEED) return 0;
    return input->tow.line_length * bt_max(1, bt_log(half_tan(bt_min(turn, 3)) / half_tan(COURSE_LEFT)));
}

/// When way-point k was passed, s; NaN = not yet.
static double passed_at(const bt_run_totals *totals, int k)
{
    for (int64_t i = 0; totals->events && i < totals->events->n; i++)
        if (totals->events->event[i].kind == BT_EVENT_WAYPOINT && totals->events->event[i].subject - 1 == k)
            return totals->events->event[i].time;
    return NAN;
}

/// Angle between the mean courses of the body in the first and the last tenth of the window, rad: a heavy body swings
/// out and reaches its new course later than its line.
static double swing(const bt_steady *steady, const bt_history *history)
{
    const int64_t n = (steady->n + 9) / 10;
    double v[2][2] = {{0}};
    for (int64_t i = 0; i < n; i++)
        for (int k = 0; k < 2; k++) {
            const int64_t at = k ? history->n - 1 - i : steady->first + i;
            v[k][0] += history->column[BT_COL_VX][at], v[k][1] += history->column[BT_COL_VY][at];
        }
    return fabs(bt_atan2(v[0][0] * v[1][1] - v[0][1] * v[1][0], v[0][0] * v[1][0] + v[0][1] * v[1][1]));
}

/// Judge turns at way-points, by the path of the end: from the beginning of the arc until the body has followed.
static void judge_course(bt_steady *steady, const bt_history *history, const bt_case *input,
                         const bt_run_totals *totals)
{
    bt_path path;
    char why[200];
    for (int k = 0; k < 2; k++) steady->path_at[k] = distance_towed(history, input, k ? steady->end : steady->start);
    if (input->tow.n_waypoints == 0 || input->tow.mode == BT_TOW_NONE || !bt_case_tow_path(input, &path, why)) return;
    bool turned = false;
    for (int k = 0; k < path.n_marks; k++) {
        const double turn = bt_case_tow_turn(input, k), passed = passed_at(totals, k),
                     arc = 0.5 * input->tow.turn_radius * turn;
        const bool vessel = input->tow.mode == BT_TOW_THRUST && isfinite(passed);
        const double mark = vessel ? distance_towed(history, input, passed) : path.mark[k], slack = 1e-9 * mark;
        turned = turned || (turn > BT_TURN && mark < steady->path_at[1]);
        if (!(turn > BT_TURN) || mark - arc >= steady->path_at[1] - slack ||
            mark + arc + distance_to_follow(input, turn) <= steady->path_at[0] + slack)
            continue;
        char when[60] = "to which it begins to turn";
        if (isfinite(passed)) snprintf(when, sizeof when, "passed at %g s", passed);
        bt_warn(because(steady, BT_NOT_STEADY), BT_WARN_COURSE_CHANGES,
                "the course changes by %.3g deg at way-point %d, %s, within the window%s: end the run earlier, begin "
                "the window later, or read the series",
                turn * 180 / BT_PI, k + 1, when,
                mark + arc > steady->path_at[0] + slack ? "" : " for the body, which follows its line");
        steady->turns = true;
    }
    bt_path_free(&path);
    if (!turned || steady->turns || input->tow.mode == BT_TOW_SPEED || !(swing(steady, history) > COURSE_LEFT)) return;
    bt_warn(because(steady, BT_NOT_STEADY), BT_WARN_COURSE_FOLLOWS,
            "the course of the body, behind its line, still changes by %.3g deg within the window: begin it later, or "
            "read the series",
            swing(steady, history) * 180 / BT_PI);
    steady->turns = true;
}

/// Judge events within the window across which no mean is valid.
static void judge_events(bt_steady *steady, const bt_case *input, const bt_run_totals *totals)
{
    const double *p = input->tow.programme;
    for (int i = 0; i + 1 < input->tow.n_programme; i++) {
        if (p[2 * i + 1] == p[2 * i + 3] || p[2 * i + 2] <= steady->start || p[2 * i] >= steady->end) continue;
        bt_warn(because(steady, BT_NOT_STEADY), BT_WARN_PROGRAMME,
                "the speed programme goes from %g to %g m/s within the window, %g to %g s: end the run earlier, or "
                "read the series",
                p[2 * i + 1], p[2 * i + 3], steady->start, steady->end);
        steady->changes_speed = true;
    }
    for (int64_t i = 0; totals->events && i < totals->events->n; i++) {
        const bt_event *event = &totals->events->event[i];
        if (event->kind == BT_EVENT_ADRIFT)
            bt_warn(because(steady, BT_NOT_STEADY), BT_WARN_ADRIFT,
                    "the last line parted at %g s, and nothing has towed the body since", event->time);
        else if (event->kind == BT_EVENT_LINE_BROKEN && event->time > steady->start)
            bt_warn(because(steady, BT_NOT_STEADY), BT_WARN_PARTED_IN_WINDOW,
                    "a line parted at %g s, within the window: the means mix the time before and after", event->time);
    }
    if (!totals->window) return;
    const double places = (double)(totals->window->renewed + totals->window->missed);
    if (places > 0 && (double)totals->window->missed > BT_STEADY_MISSED * places)
        bt_warn(because(steady, BT_NOT_STEADY), BT_WARN_PLACES_MISSED,
                "%.0f %% of the floes due to enter at the front of the moving window found no free place: the body "
                "pushes ever more ice, or carries it along: use a longer domain",
                100 * (double)totals->window->missed / places);
}

/// Distance made good over ground by the body within the window, along its present leg of the tow, m; NaN = not known.
static double distance_made_good(const bt_steady *steady, const bt_history *history, const bt_case *input,
                      const bt_run_totals *totals)
{
    const double *t = history->column[BT_COL_TIME], *vx = history->column[BT_COL_VX], *vy = history->column[BT_COL_VY];
    double way = 0, ux = bt_cos(input->tow.direction), uy = bt_sin(input->tow.direction), passed = passed_at(totals, 0);
    int leg = 0;
    for (int64_t i = steady->first + 1; i < history->n; i++) {
        while (leg + 1 < input->tow.n_waypoints && passed <= t[i]) {
            const double *p = input->tow.waypoints + 2 * leg, course = bt_atan2(p[3] - p[1], p[2] - p[0]);
            ux = bt_cos(course), uy = bt_sin(course);
            passed = passed_at(totals, ++leg);
        }
        way += (vx[i] * ux + vy[i] * uy) * (t[i] - t[i - 1]);
    }
    return way;
}

/// Judge the track: ice that the body has already opened, water beyond the ice, or a body that does not advance.
static void judge_track(bt_steady *steady, const bt_history *history, const bt_case *input, const bt_run_totals *totals)
{
    const double *x = history->column[BT_COL_IN_ICE_X], *y = history->column[BT_COL_IN_ICE_Y];
    const bt_track track = {.n = history->n, .time = history->column[BT_COL_TIME], .x = x, .y = y,
                            .region = bt_outline_region(&totals->outlines)};
    bt_errors found = {0};
    bt_track_warn(input, &track, &found);
    if (found.n) bt_errors_move(because(steady, BT_NOT_STEADY), &found);
    const double asked =
        input->tow.mode == BT_TOW_NONE
        ? 0 : bt_case_tow_distance(input, steady->end) - bt_case_tow_distance(input, steady->start);
    const double way = distance_made_good(steady, history, input, totals);
    if (totals->stall.inside > 0)
        bt_warn(because(steady, BT_NOT_STEADY), BT_WARN_END_INSIDE,
                "the towing end was inside the hull for %.3g s, from %.4g s on: the body has overtaken it, and its "
                "line pulls from behind",
                totals->stall.inside, totals->stall.inside_from);
    if (totals->stall.time > BT_STEADY_STALLED * steady->end)
        bt_warn(because(steady, BT_NOT_STEADY), BT_WARN_STOOD_STILL,
                "the towed body stood still for %.3g s of %.3g s, held by the ice: the mean depends on how often it "
                "jams",
                totals->stall.time, steady->end);
    // with turns the body may be on the previous leg
    else if (asked > 0 && way < BT_STALL_SHARE * asked && !steady->turns) {
        bt_warn(because(steady, BT_NOT_STEADY), BT_WARN_NO_HEADWAY,
                "the tow asked for %.4g m within the window, %g to %g s, but the body has %s %.3g m over ground: it "
                "makes no headway",
                asked, steady->start, steady->end, way < 0 ? "gone astern by" : "moved ahead by", fabs(way));
        bt_warn_number(&steady->reasons, "way_m", way);
    }
}

/// Report the first series with a significant trend: the others mostly follow from it.
static void judge_trends(bt_steady *steady)
{
    char change[32], low[32], high[32];
    for (int k = 0; k < BT_N_REPORTED; k++) {
        const bt_reported *r = &steady->series[k];
        const bt_trend *trend = &r->trend;
        // a few collisions, early or late, are not a trend
        if (steady->stretches < BT_STEADY_STRETCHES && (k == BT_REPORTED_ICE || k == BT_REPORTED_TOW)) continue;
        if (!r->present || !trend->significant || !(fabs(trend->change) > BT_STEADY_MATERIAL * fabs(r->mean.mean)))
            continue;
        bt_warn(because(steady, BT_NOT_STEADY), BT_WARN_TREND,
                "the %s %s over the window by %s (95 %%: %s to %s), %.0f %% of its mean: run longer, or begin the "
                "window later",
                r->name, trend->change > 0 ? "rises" : "falls", bt_force_text(change, fabs(trend->change)),
                bt_force_text(low, bt_min(fabs(trend->low), fabs(trend->high))),
                bt_force_text(high, bt_max(fabs(trend->low), fabs(trend->high))),
                100 * fabs(trend->change / r->mean.mean));
        bt_warn_name(&steady->reasons, "series", r->key);
        bt_warn_number(&steady->reasons, "change_n", trend->change);
        bt_warn_number(&steady->reasons, "low_n", trend->low);
        bt_warn_number(&steady->reasons, "high_n", trend->high);
        return;
    }
}

/// Judge contact: a body that no floe has touched tells nothing about the ice, however long the window, and with few
/// contacts little.
static void judge_contact(bt_steady *steady, const bt_run_totals *totals)
{
    const bt_mean *ice = &steady->series[BT_REPORTED_ICE].mean;
    steady->met_no_ice = totals->concentration > 0 && ice->mean == 0 && ice->sd == 0;
    if (steady->met_no_ice) steady->stretches = 0;
    if (steady->met_no_ice && totals->lead.mode == BT_LEAD_CHANNEL)
        bt_warn(because(steady, BT_TOO_SHORT), BT_WARN_NO_ICE_CHANNEL,
                "the body met no ice within the window, %g to %g s, in a channel of %.4g m: run longer, or conclude "
                "that no ice enters the channel",
                steady->start, steady->end, totals->lead.width);
    else if (steady->met_no_ice)
        bt_warn(because(steady, BT_TOO_SHORT), BT_WARN_NO_ICE,
                "the body met no ice within the window, %g to %g s, in %.3g %% ice: run longer",
                steady->start, steady->end, 100 * totals->concentration);
    else if (ice->mean != 0 && steady->stretches < BT_STEADY_STRETCHES)
        bt_warn(because(steady, BT_TOO_SHORT), BT_WARN_FEW_CONTACTS,
                "the mean of the ice resistance within the window, %g to %g s, rests on a few stretches of contact, "
                "equivalent to %.2g equal ones, fewer than %d: run longer",
                steady->start, steady->end, steady->stretches, BT_STEADY_STRETCHES);
}

/// Judge the length: by the least known of the varying loads, and by a body on a line that has had no time to swing.
static void judge_length(bt_steady *steady, const bt_case *input, double dt)
{
    const double swings = BT_RAMP_PERIODS * bt_case_line_period(input), length = (double)steady->n * dt;
    if (length < swings * (1 - 1e-9))
        bt_warn(because(steady, BT_TOO_SHORT), BT_WARN_FEW_SWINGS,
                "the window of %g s is shorter than %g swings of the body on its line (%.3g s each): run longer",
                length, BT_RAMP_PERIODS, bt_case_line_period(input));
    const bt_reported *worst = NULL;
    for (int k = 0; k < BT_N_REPORTED; k++) {
        const bt_reported *r = &steady->series[k];
        const double n = (double)steady->n / (2 * r->mean.tau); // stretches of contact have been judged already
        if (!reported[k].load || !r->present || !varies(&r->mean) || n >= BT_STEADY_INDEPENDENT) continue;
        if (!worst || r->mean.tau > worst->mean.tau) worst = r;
    }
    if (!worst) return;
    bt_errors *reasons = because(steady, BT_TOO_SHORT);
    bt_warn(reasons, BT_WARN_FEW_SAMPLES,
            "the window of %g s holds %.1f independent samples of the %s (correlation time %.3g s), fewer than %d: run "
            "longer",
            (double)steady->n * dt, floor(10 * (double)steady->n / (2 * worst->mean.tau)) / 10, worst->name,
            worst->mean.tau * dt, BT_STEADY_INDEPENDENT);
    bt_warn_name(reasons, "series", worst->key);
}

void bt_steady_find(bt_steady *steady, const bt_history *history, const bt_case *input, const bt_run_totals *totals)
{
    const double *time = history->column[BT_COL_TIME], ramp = input->tow.mode == BT_TOW_NONE ? 0 : input->tow.ramp;
    *steady = (bt_steady){.start = NAN, .end = NAN, .correlation_time = NAN};
    steady->first = find_start(steady, history, input);
    steady->put_off = steady->first - first_at_or_after(history, steady->earliest);
    steady->n = history->n - steady->first;
    if (steady->n == 0) {
        bt_warn(because(steady, BT_TOO_SHORT), BT_WARN_NO_WINDOW,
                "no window: it would begin at %g s, but the run ends at %g s: run longer, or %s",
                steady->earliest, history->n ? time[history->n - 1] : 0,
                steady->given                  ? "lower output.window_start"
                : input->tow.n_programme > 0 ? "let tow.programme reach its largest speed earlier"
                                             : "shorten tow.ramp");
    } else {
        steady->start = time[steady->first];
        steady->end = time[history->n - 1];
    }
    reduce(steady, history, totals);
    if (steady->n == 0) return;
    steady->correlation_time = steady->n > 1 ? steady->series[BT_REPORTED_ICE].mean.tau * totals->dt : NAN;
    if (!isfinite(steady->series[BT_REPORTED_ICE].mean.mean) || !isfinite(steady->series[BT_REPORTED_TOW].mean.mean))
        bt_warn(because(steady, BT_NOT_STEADY), BT_WARN_NOT_FINITE,
                "the forces on the body are not finite within the window: the run is not usable: lower run.dt");
    steady->changes_speed = steady->start < ramp * (1 - 1e-12);
    if (steady->changes_speed)
        bt_warn(because(steady, BT_NOT_STEADY), BT_WARN_WITHIN_RAMP,
                "the window begins at %g s, before the %s at %g s: raise output.window_start",
                steady->start, input->tow.n_programme > 0 ? "tow reaches the largest speed of its programme"
                                                          : "ramp of the tow ends",
                ramp);
    judge_solver(steady, input, totals);
    judge_events(steady, input, totals);
    judge_course(steady, history, input, totals);
    judge_track(steady, history, input, totals);
    judge_trends(steady);
    judge_contact(steady, totals);
    judge_length(steady, input, totals->dt);
}
