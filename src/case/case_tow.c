// SPDX-License-Identifier: MIT
// The tow of a case: defaults that follow from other keys, checks, and where its path leads.
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "geometry/path.h"
#include "bergtow/catenary.h"
#include "case/warning.h"
#include "case/rope.h"
#include "bergtow/shape.h"
#include "case/case_tow.h"
#include "case/case_check.h"
#include "case/speed_law.h"
#include "base/elementary.h"

enum { TIMES = 2000 };                 // of a run at which its planned track is looked at
static const double DAMPING = 0.03;     // of critical, of a line at sea, assumed
static const double BESIDE_HULL = 0.05; // of the hull's extent that a fastening point may lie outside it, assumed

static bool has_line(const bt_case *c) { return c->tow.mode == BT_TOW_LINE || c->tow.mode == BT_TOW_THRUST; }

// ---- speed and way ----

static bt_speed_law speed_law(const bt_case *c)
{
    return (bt_speed_law){
        .speed = c->tow.speed, .ramp = c->tow.ramp, .programme = c->tow.programme, .n = c->tow.n_programme};
}

/// Largest speed of the programme up to a time, and the time at which it is first reached.
static void largest_speed(const bt_case *c, double end, double *speed, double *time)
{
    const double *p = c->tow.programme;
    *speed = -1, *time = 0;
    for (int i = 0; i < c->tow.n_programme && (i == 0 || p[2 * i] <= end); i++)
        if (p[2 * i + 1] > *speed) *speed = p[2 * i + 1], *time = i > 0 ? p[2 * i] : 0;
    const bt_speed_law l = speed_law(c);
    if (isfinite(end) && bt_speed_law_at(&l, end) > *speed) *speed = bt_speed_law_at(&l, end), *time = end;
}

/// Until when a programme is followed: points after the end of the run are none of the tow.
static double programme_end(const bt_case *c) { return c->run.duration > 0 ? c->run.duration : INFINITY; }

double bt_case_tow_distance(const bt_case *c, double t)
{
    const bt_speed_law l = speed_law(c);
    return bt_speed_law_way(&l, t);
}

double bt_case_tow_led(const bt_case *c, double t)
{
    const bt_speed_law l = speed_law(c);
    const double steps = ceil(t / c->run.dt * (1 - 1e-12)); // not a number in a case that is refused
    return bt_speed_law_led(&l, steps > 0 && steps < 1e15 ? (int64_t)steps : 0, c->run.dt);
}

double bt_case_tow_time(const bt_case *c, double way)
{
    const bt_speed_law l = speed_law(c);
    return bt_speed_law_time(&l, way, c->run.duration);
}

double bt_case_tow_last(const bt_case *c, double way)
{
    const bt_speed_law l = speed_law(c);
    int64_t low = 0, high = bt_case_steps(c);
    while (low < high) {
        const int64_t mid = low + (high - low) / 2 + 1;
        if (bt_speed_law_led(&l, mid, c->run.dt) <= way) low = mid;
        else high = mid - 1;
    }
    return (double)low * c->run.dt;
}

double bt_case_tow_turn(const bt_case *c, int k)
{
    const double *p = c->tow.waypoints + 2 * k;
    if (k + 1 >= c->tow.n_waypoints) return 0;
    const double before = k > 0 ? bt_atan2(p[1] - p[-1], p[0] - p[-2]) : c->tow.direction;
    return fabs(remainder(bt_atan2(p[3] - p[1], p[2] - p[0]) - before, 2 * BT_PI));
}

// ---- where it starts, and its path ----

/// A point of the hull in the world at time zero.
static void hull_at(const bt_case *c, double hx, double hy, double at[2])
{
    const double cy = bt_cos(c->body.yaw), sy = bt_sin(c->body.yaw);
    at[0] = c->body.x + cy * hx - sy * hy;
    at[1] = c->body.y + sy * hx + cy * hy;
}

/// Distance of the ends of a branch at the start, m: just taut, without tension. A line with a weight is never without:
/// it starts with BT_START_PULL times its weight.
static double start_span(const bt_case *c, double length, double stiffness)
{
    const double w = c->tow.line.weight;
    if (!(w > 0 && length > 0 && stiffness > 0)) return length;
    return bt_catenary_span(length, stiffness, w, BT_START_PULL * w * length);
}

bool bt_case_tow_start(const bt_case *c, double at[2])
{
    const double ux = bt_cos(c->tow.direction), uy = bt_sin(c->tow.direction);
    // A line's length ahead of the fastening point: taut, without tension.
    double p[2], q[2];
    hull_at(c, c->tow.hull_x, c->tow.hull_y, p);
    const double length[2] = {start_span(c, c->tow.line_length, c->tow.line_stiffness),
                              start_span(c, c->tow.branch2.length, c->tow.branch2.stiffness)};
    at[0] = p[0] + length[0] * ux;
    at[1] = p[1] + length[0] * uy;
    if (c->tow.line.branches < 2 || !has_line(c)) return true;
    // Two branches: ahead of the middle between their fastening points, as far as neither is stretched. (Where both are
    // just taut may lie far off the tow's axis, when one point lies ahead of the other.)
    hull_at(c, c->tow.branch2.hull_x, c->tow.branch2.hull_y, q);
    const double *const hull[2] = {p, q};
    const double mx = 0.5 * (p[0] + q[0]), my = 0.5 * (p[1] + q[1]);
    double ahead = INFINITY;
    for (int k = 0; k < 2; k++) {
        const double dx = mx - hull[k][0], dy = my - hull[k][1], along = dx * ux + dy * uy, far2 = dx * dx + dy * dy;
        if (!(length[k] * length[k] > far2)) return false;
        ahead = bt_min(ahead, sqrt(length[k] * length[k] - far2 + along * along) - along);
    }
    at[0] = mx + ahead * ux;
    at[1] = my + ahead * uy;
    return true;
}

bool bt_case_tow_path(const bt_case *c, bt_path *path, char why[200])
{
    double start[2];
    *path = (bt_path){0};
    if (!bt_case_tow_start(c, start)) {
        snprintf(why, 200,
                 "the branches do not reach the middle between their fastening points; lengthen the shorter one or "
                 "move its fastening point");
        return false;
    }
    if (!has_line(c)) start[0] = c->body.x, start[1] = c->body.y;
    if (c->tow.n_waypoints > 0)
        return bt_path_make(path, start[0], start[1], c->tow.n_waypoints, c->tow.waypoints, c->tow.turn_radius, why);
    const double ahead[2] = {start[0] + bt_cos(c->tow.direction), start[1] + bt_sin(c->tow.direction)};
    const bool made = bt_path_make(path, start[0], start[1], 1, ahead, 0, why);
    if (made) path->n_marks = 0; // the point ahead is no way-point
    return made;
}

bool bt_case_trail_begin(const bt_case *c, bt_trail *t)
{
    char why[200];
    double start[2], tangent[2];
    *t = (bt_trail){.path = bt_alloc(1, sizeof *t->path)};
    if (!bt_case_tow_path(c, t->path, why)) {
        bt_case_trail_end(t);
        return false;
    }
    bt_path_at(t->path, 0, start, tangent);
    t->far = (start[0] - c->body.x) * tangent[0] + (start[1] - c->body.y) * tangent[1];
    t->x = start[0] - t->far * tangent[0], t->y = start[1] - t->far * tangent[1];
    t->beside[0] = c->body.x - t->x, t->beside[1] = c->body.y - t->y;
    return true;
}

void bt_case_trail_to(bt_trail *t, double way, double at[2])
{
    double end[2], tangent[2];
    bt_path_at(t->path, way, end, tangent);
    const double dx = end[0] - t->x, dy = end[1] - t->y, apart = bt_hypot(dx, dy);
    const double on = apart > t->far ? 1 - t->far / apart : 0;
    t->x += on * dx, t->y += on * dy;
    at[0] = t->x + t->beside[0], at[1] = t->y + t->beside[1];
}

void bt_case_trail_end(bt_trail *t)
{
    bt_path_free(t->path);
    free(t->path);
    *t = (bt_trail){0};
}

double bt_case_tow_cut(const bt_case *c)
{
    bt_trail t;
    if (c->tow.n_waypoints == 0 || !has_line(c) || !bt_case_trail_begin(c, &t)) return 0;
    enum { BEHIND = 100 }; // points of the path, to two lines' lengths behind the end: the body is beside one of these
    double at[2], beside[2], tangent[2], most = 0;
    const double whole = bt_case_tow_distance(c, c->run.duration);
    for (int i = 1; i <= TIMES; i++) {
        const double way = whole * i / TIMES;
        bt_case_trail_to(&t, way, at);
        double least = INFINITY;
        for (int k = 0; k < BEHIND && i % 4 == 0; k++) {
            bt_path_at(t.path, way - 2 * t.far * k / BEHIND, beside, tangent);
            least = bt_min(least, bt_hypot(beside[0] - t.x, beside[1] - t.y));
        }
        if (isfinite(least)) most = bt_max(most, least);
    }
    bt_case_trail_end(&t);
    return most;
}

// ---- defaults ----

void bt_case_tow_course(const bt_check *k)
{
    bt_case *c = k->c;
    if (c->domain.frame == BT_FRAME_GEOGRAPHIC) bt_check_fill(&c->body.x, 0);
    if (c->domain.ends == BT_BOUND_MOVING && c->tow.n_waypoints > 0 && !bt_check_given(k, "tow.direction"))
        bt_case_window_face(c, c->tow.waypoints[0]);
    if (c->tow.n_waypoints > 0 && !bt_check_given(k, "tow.direction") && !isnan(c->body.x))
        c->tow.direction = bt_atan2(c->tow.waypoints[1] - c->body.y, c->tow.waypoints[0] - c->body.x);
}

/// Stiffness of a branch, N/m: of one with a weight as it starts, if that is wanted, or stretched.
static double branch_stiffness(const bt_case *c, double length, double stiffness, bool at_start)
{
    double tangent = stiffness / length;
    const double span = start_span(c, length, stiffness);
    if (at_start && span != length) bt_catenary_pull(length, stiffness, c->tow.line.weight, span, &tangent);
    return tangent;
}

/// Period of the body on its line or lines, s; 0 without a line.
static double period_on(const bt_case *c, bool at_start)
{
    if (!has_line(c)) return 0;
    const double body = bt_case_body_mass(c) * (1 + c->body.added_mass),
                 vessel = c->tow.vessel.mass * (1 + c->tow.vessel.added_mass);
    const double mass = c->tow.mode == BT_TOW_THRUST ? body * vessel / (body + vessel) : body;
    double k = branch_stiffness(c, c->tow.line_length, c->tow.line_stiffness, at_start);
    if (c->tow.line.branches > 1) k += branch_stiffness(c, c->tow.branch2.length, c->tow.branch2.stiffness, at_start);
    const double period = 2 * BT_PI * sqrt(mass / k);
    return isfinite(period) ? period : 0;
}

/// At sea: a share of the critical damping of the body on its line or lines, N s/m; 0 without a line.
static double damping_of(const bt_case *c)
{
    const double stiffness = c->tow.line_stiffness / c->tow.line_length, period = period_on(c, false);
    // 2 ζ k/ω of each of parallel lines makes 2 ζ M ω of them all
    return period > 0 ? DAMPING * stiffness * period / BT_PI : 0;
}

void bt_case_tow_follow(const bt_check *k)
{
    bt_case *c = k->c;
    if (c->tow.n_programme > 0) {
        double speed, time;
        largest_speed(c, programme_end(c), &speed, &time);
        if (!bt_check_given(k, "tow.speed")) c->tow.speed = speed;
        if (!bt_check_given(k, "tow.ramp")) c->tow.ramp = time;
    }
    bt_case_tow_course(k);
    const bt_rope rope = bt_rope_named(c->tow.line.type, c->tow.line.diameter);
    const bool named = c->tow.line.type != BT_ROPE_NUMBERS, at_sea = c->domain.frame == BT_FRAME_GEOGRAPHIC;
    bt_check_fill(&c->tow.line_stiffness, named ? rope.stiffness : at_sea && has_line(c) ? NAN : 10e3);
    bt_check_fill(&c->tow.line.breaking_load, rope.breaking);
    bt_check_fill(&c->tow.branch2.length, c->tow.line_length);
    bt_check_fill(&c->tow.branch2.stiffness, c->tow.line_stiffness);
    bt_check_fill(&c->tow.branch2.breaking_load, c->tow.line.breaking_load);
    bt_check_fill(&c->tow.line_damping, at_sea ? damping_of(c) : 100); // by the stiffness of both branches
    bt_check_fill(&c->tow.branch2.damping, c->tow.line_damping);
    bt_check_fill(&c->tow.vessel.free_resistance, 0.4 * c->tow.vessel.bollard_pull);
    bt_check_fill(&c->tow.vessel.lookahead, c->tow.line_length > 0 ? c->tow.line_length : 1);
}

// A linear ramp of T_r accelerates the body at v/T_r, under which the tension of an undamped line swings about M v/T_r
// with that amplitude. A sudden start has the amplitude M v ω = 2π M v/T: two periods bring it down to a twelfth, and
// whole periods leave no swing behind. A line with a weight is softest as it starts, where its slack is still to be
// taken up, and that period is the longest.
double bt_case_line_period(const bt_case *c) { return period_on(c, true); }

double bt_case_steepest_ramp(const bt_case *c)
{
    const double *p = c->tow.programme;
    if (c->tow.n_programme == 0) return c->tow.ramp;
    const double own = c->body.vx * bt_cos(c->tow.direction) + c->body.vy * bt_sin(c->tow.direction);
    double least = p[1] > bt_max(0, own) * (1 + 1e-9) ? 0 : INFINITY;
    for (int i = 0; i + 1 < c->tow.n_programme; i++)
        if (p[2 * i + 3] > p[2 * i + 1])
            least = bt_min(least, (p[2 * i + 2] - p[2 * i]) * c->tow.speed / (p[2 * i + 3] - p[2 * i + 1]));
    return least;
}

bool bt_case_start_is_slow(const bt_case *c)
{
    return bt_case_steepest_ramp(c) >= BT_RAMP_PERIODS * bt_case_line_period(c) * (1 - 1e-12);
}

double bt_case_earliest_window(const bt_case *c)
{
    if (c->output.window_start >= 0) return c->output.window_start;
    if (c->tow.mode == BT_TOW_NONE) return 0;
    if (bt_case_start_is_slow(c)) return c->tow.ramp;
    // A start that jerks the line: the body swings on, and a few swings are too few to be told from chance. Of a short
    // run half is left.
    const double swings = BT_RAMP_PERIODS * bt_case_line_period(c), rest = c->run.duration - c->tow.ramp;
    return c->tow.ramp + bt_max(0, bt_min(swings, 0.5 * rest));
}

/// Speed and course that change within a step.
static void warn_of_jerks(const bt_case *c, bt_errors *warnings)
{
    const double *p = c->tow.programme;
    for (int i = 0; i + 1 < c->tow.n_programme; i++)
        if (p[2 * i + 3] != p[2 * i + 1] && p[2 * i + 2] - p[2 * i] < c->run.dt)
            bt_warn(warnings, BT_WARN_SPEED_JUMP,
                          "tow.programme: from %g to %g m/s in less than a step: the tow force is then mass times the "
                          "change over run.dt, as large as that is short, and its peak says nothing; let the change "
                          "take several steps",
                          p[2 * i + 1], p[2 * i + 3]);
    bt_path path = {0};
    char why[200];
    if (c->tow.n_waypoints == 0 || c->tow.turn_radius > 0 || !bt_case_tow_path(c, &path, why)) return;
    for (int k = 0; k < path.n_marks; k++)
        if (bt_case_tow_turn(c, k) > BT_TURN && path.mark[k] < bt_case_tow_distance(c, c->run.duration)) {
            bt_warn(warnings, BT_WARN_TURN_JUMP,
                          "tow.turn_radius: 0 m, and the body turns at way-point %d within one step: the tow force is "
                          "then mass times the change of velocity over run.dt, as large as that is short, and its peak "
                          "says nothing; give a radius",
                          k + 1);
            break;
        }
    bt_path_free(&path);
}

/// Largest speed of the current along the tow, m/s; over all legs of it.
static double following(const bt_case *c)
{
    double most = 0;
    for (int k = 0; k == 0 || k < c->tow.n_waypoints; k++) {
        const double *p = c->tow.waypoints + 2 * k,
                     course = k > 0 ? bt_atan2(p[1] - p[-1], p[0] - p[-2]) : c->tow.direction,
                     ux = bt_cos(course), uy = bt_sin(course);
        if (c->water.table.n == 0)
            most = bt_max(most, c->water.current_x * ux + c->water.current_y * uy + c->water.tide.major);
        for (int64_t i = 0; i < c->water.table.n; i++)
            most = bt_max(most, c->water.table.row[3 * i + 1] * ux + c->water.table.row[3 * i + 2] * uy +
                                    c->water.tide.major);
    }
    return most;
}

/// A body that comes on faster than its towing end, which a line does not hinder.
static void warn_of_overtaking(const bt_case *c, bt_errors *warnings)
{
    const double along = has_line(c) ? following(c) : 0;
    if (along > c->tow.speed && c->tow.speed > 0)
        bt_warn(warnings, BT_WARN_CURRENT_OVERTAKES,
                      "water.%s: up to %.3g m/s along the tow, which is to make %.3g m/s: the current carries the body "
                      "past its towing end, and nothing in the model fends it off; tow faster than the current, or "
                      "against it",
                      c->water.table.n ? "current_table" : c->water.tide.major > 0 ? "tide" : "current_x", along,
                      c->tow.speed);
}

/// A run that is over before the tow has its speed. Of a programme the ramp is the time of its largest speed within
/// the run.
static void warn_of_short_run(const bt_case *c, bt_errors *warnings)
{
    if (c->tow.mode == BT_TOW_NONE || c->tow.n_programme > 0 || !(c->tow.speed > 0)) return;
    if (!(c->tow.ramp >= c->run.duration)) return;
    bt_warn(warnings, BT_WARN_SHORT_RUN,
            "tow.ramp: the speed rises for %.4g s and the run ends after %.4g s: no time of it is at tow.speed; "
            "lengthen run.duration, or give a shorter ramp",
            c->tow.ramp, c->run.duration);
}

void bt_case_warn_start(const bt_case *c, bt_errors *warnings)
{
    warn_of_short_run(c, warnings);
    if (c->tow.mode == BT_TOW_SPEED) warn_of_jerks(c, warnings);
    warn_of_overtaking(c, warnings);
    if (bt_case_start_is_slow(c)) return;
    const double period = bt_case_line_period(c), ramp = bt_case_steepest_ramp(c);
    if (c->tow.n_programme > 0)
        bt_warn(warnings, BT_WARN_STEEP_PROGRAMME,
                      "tow.programme: a rise as steep as from 0 to %.4g m/s in %.4g s is short for a body that swings "
                      "on its line in %.3g s: it jerks the line, which swings on; take at least %.3g s for that",
                      c->tow.speed, ramp, period, BT_RAMP_PERIODS * period);
    else
        bt_warn(warnings, BT_WARN_SHORT_RAMP,
                      "tow.ramp: %.4g s is short for a body that swings on its line in %.3g s: the start jerks the "
                      "line, and it swings on; leave tow.ramp out, or take at least %.3g s",
                      ramp, period, BT_RAMP_PERIODS * period);
}

void bt_case_tow_ramp(bt_case *c)
{
    if (!isnan(c->tow.ramp)) return;
    double v[2 * BT_MAX_VERTICES];
    const int n = c->tow.mode == BT_TOW_NONE ? 0 : bt_case_waterline(c, v);
    const double size = n ? sqrt(4 / BT_PI * bt_shape_moments(n, v).area) : 0,
                 way = c->tow.speed > 0 ? size / c->tow.speed : 0;
    c->tow.ramp = bt_max(way, BT_RAMP_PERIODS * bt_case_line_period(c));
}

/// The point of the waterline farthest in a direction; the middle when several corners are equally far.
static void farthest_point(int n, const double *v, double ux, double uy, double at[2])
{
    double most = -INFINITY, size = 0, x = 0, y = 0;
    int count = 0;
    for (int i = 0; i < n; i++) {
        most = bt_max(most, v[2 * i] * ux + v[2 * i + 1] * uy);
        size = bt_max(size, bt_hypot(v[2 * i], v[2 * i + 1]));
    }
    for (int i = 0; i < n; i++)
        if (v[2 * i] * ux + v[2 * i + 1] * uy >= most - 1e-9 * size) x += v[2 * i], y += v[2 * i + 1], count++;
    at[0] = count ? x / count : 0;
    at[1] = count ? y / count : 0;
}

void bt_case_tow_hull(bt_case *c, int n, const double *v)
{
    const double ahead = c->tow.direction - c->body.yaw, ux = bt_cos(ahead), uy = bt_sin(ahead);
    const bool two = c->tow.line.branches > 1;
    double p[2], q[2];
    farthest_point(n, v, two ? -uy : ux, two ? ux : uy, p);
    farthest_point(n, v, uy, -ux, q);
    bt_check_fill(&c->tow.hull_x, p[0]);
    bt_check_fill(&c->tow.hull_y, p[1]);
    bt_check_fill(&c->tow.branch2.hull_x, q[0]);
    bt_check_fill(&c->tow.branch2.hull_y, q[1]);
}

// ---- checks ----

static void check_programme(const bt_check *k)
{
    const bt_case *c = k->c;
    if (c->tow.n_programme == 0 || !bt_check_sound(k, "tow.programme")) return;
    const double *p = c->tow.programme;
    for (int i = 0; i + 1 < c->tow.n_programme; i++)
        if (!(p[2 * i + 2] > p[2 * i])) {
            bt_check_fault(k, "tow.programme",
                           "point %d is at %g s, not after the one before, %g s; put the times in order", i + 2,
                           p[2 * i + 2], p[2 * i]);
            return;
        }
    double speed, time;
    largest_speed(c, programme_end(c), &speed, &time);
    if (bt_check_sound(k, "tow.speed") && c->tow.speed != speed)
        bt_check_fault(k, "tow.speed",
                       "%g m/s has no effect with tow.programme, whose largest speed is %g m/s; remove one of them",
                       c->tow.speed, speed);
    if (bt_check_sound(k, "tow.ramp") && c->tow.ramp != time)
        bt_check_fault(
            k, "tow.ramp",
            "%g s has no effect with tow.programme, which reaches its largest speed at %g s; remove one of them",
            c->tow.ramp, time);
}

/// How far a point lies outside a convex outline, m; within it less than 0.
static double outside_of(int n, const double *v, double x, double y)
{
    double most = -INFINITY;
    for (int i = 0; i < n; i++) {
        const double *p = v + 2 * i, *q = v + 2 * ((i + 1) % n), ex = q[0] - p[0], ey = q[1] - p[1];
        most = bt_max(most, (ey * (x - p[0]) - ex * (y - p[1])) / bt_hypot(ex, ey));
    }
    return most;
}

/// A line is fastened on the hull, or a little beside its waterline.
static void check_fastening(const bt_check *k)
{
    const bt_case *c = k->c;
    static const char *const key[] = {"tow.hull_x", "tow.branch2.hull_x"},
                      *const keys[] = {"tow.hull_x tow.hull_y", "tow.branch2.hull_x tow.branch2.hull_y"};
    const double at[2][2] = {{c->tow.hull_x, c->tow.hull_y}, {c->tow.branch2.hull_x, c->tow.branch2.hull_y}};
    double v[2 * BT_MAX_VERTICES];
    const int n = bt_case_waterline(c, v);
    if (!n || !has_line(c) ||
        !bt_check_sound(k, "tow.mode body.shape body.length body.width body.vertices tow.line.branches"))
        return;
    for (int b = 0; b < c->tow.line.branches; b++) {
        const double off = outside_of(n, v, at[b][0], at[b][1]);
        if (off > BESIDE_HULL * 2 * bt_shape_extent(n, v).radius && bt_check_sound(k, keys[b]))
            bt_check_fault(k, key[b],
                           "the line is fastened at (%g, %g) m from the centroid of the waterline, %.3g m outside the "
                           "hull; give a point of the hull in the body's own axes, or leave it out for its outermost",
                           at[b][0], at[b][1], off);
    }
}

/// First time at which the body, led along the path or trailing behind what is, leaves the walls; negative = never. At
/// TIMES times of the run.
static double time_of_wall(const bt_case *c)
{
    double v[2 * BT_MAX_VERTICES], at[2], found = -1;
    bt_trail t;
    if (!bt_case_trail_begin(c, &t)) return -1;
    const int n = bt_case_waterline(c, v);
    const double cy = bt_cos(c->body.yaw), sy = bt_sin(c->body.yaw);
    const double slack = 1e-9 * (c->domain.length + c->domain.width);
    for (int i = 1; i <= TIMES && found < 0; i++) {
        const double time = c->run.duration * i / TIMES;
        const double close_x = c->domain.ends_closing * time - slack, close_y = c->domain.sides_closing * time - slack;
        bt_case_trail_to(&t, bt_case_tow_led(c, time), at);
        for (int j = 0; j < n; j++) {
            const double x = at[0] + cy * v[2 * j] - sy * v[2 * j + 1] - c->domain.x0;
            const double y = at[1] + sy * v[2 * j] + cy * v[2 * j + 1] - c->domain.y0;
            if (c->domain.ends == BT_BOUND_WALL && (x < close_x || x > c->domain.length - close_x)) found = time;
            if (c->domain.sides == BT_BOUND_WALL && (y < close_y || y > c->domain.width - close_y)) found = time;
        }
    }
    bt_case_trail_end(&t);
    return found;
}

static void check_waypoints(const bt_check *k)
{
    const bt_case *c = k->c;
    if (!bt_check_sound(k, "tow.waypoints tow.turn_radius tow.direction tow.mode tow.line_length tow.line.branches "
                           "body.x body.y body.yaw"))
        return;
    if (c->tow.n_waypoints == 0 || c->tow.mode == BT_TOW_NONE) return; // that has no effect: constraints.c
    const double dx = c->tow.waypoints[0] - c->body.x, dy = c->tow.waypoints[1] - c->body.y, course = bt_atan2(dy, dx);
    if (fabs(remainder(c->tow.direction - course, 2 * BT_PI)) > 1e-9) {
        bt_check_fault(k, "tow.direction",
                       "%g deg is not the direction from the body to the first way-point, %g deg; remove one of them",
                       c->tow.direction * 180 / BT_PI, course * 180 / BT_PI);
        return;
    }
    double start[2];
    if (!bt_case_tow_start(c, start)) return; // reported by bt_case_tow_check
    if (!has_line(c)) start[0] = c->body.x, start[1] = c->body.y;
    if (!((c->tow.waypoints[0] - start[0]) * bt_cos(course) + (c->tow.waypoints[1] - start[1]) * bt_sin(course) > 0)) {
        bt_check_fault(k, "tow.waypoints",
                       "the first, (%g, %g) m, is not ahead of where the towing end starts, (%g, %g) m; move it ahead "
                       "or shorten the line",
                       c->tow.waypoints[0], c->tow.waypoints[1], start[0], start[1]);
        return;
    }
    bt_path path;
    char why[200];
    if (!bt_case_tow_path(c, &path, why)) {
        bt_check_fault(k, "tow.waypoints", "%s", why);
        return;
    }
    // As for the direction of a straight tow.
    for (int i = 0; c->domain.ends == BT_BOUND_MOVING && i + 1 < c->tow.n_waypoints && bt_check_sound(k, "domain.ends");
         i++) {
        const double lx = c->tow.waypoints[2 * i + 2] - c->tow.waypoints[2 * i],
                     ly = c->tow.waypoints[2 * i + 3] - c->tow.waypoints[2 * i + 1];
        if (lx * bt_case_tow_sign(c) >= 0.5 * bt_hypot(lx, ly)) continue;
        bt_check_fault(k, "tow.waypoints",
                       "the leg from way-point %d leads %g deg from x, and a moving window goes along x; keep within "
                       "60 deg of that, or set domain.ends: periodic or open",
                       i + 1, bt_atan2(ly, lx) * 180 / BT_PI);
        break;
    }
    // A vessel may be slower than its programme, and is not held to it.
    if (c->tow.mode != BT_TOW_THRUST && c->run.duration > 0 && c->body.shape != BT_BODY_ABSENT &&
        bt_check_sound(k, "run.duration tow.speed tow.ramp tow.programme domain.length domain.width domain.x0 "
                          "domain.y0 domain.ends domain.sides domain.ends_closing domain.sides_closing body.shape")) {
        const double time = time_of_wall(c);
        if (time >= 0)
            bt_check_fault(k, "run.duration",
                           "the way-points lead the body into a wall after %.4g m; shorten the run to %g s, or move "
                           "the way-points, or enlarge the domain",
                           bt_case_tow_distance(c, time), floor(time));
    }
    bt_path_free(&path);
}

void bt_case_tow_check(const bt_check *k)
{
    const bt_case *c = k->c;
    check_programme(k);
    check_fastening(k);
    double start[2];
    if (has_line(c) &&
        bt_check_sound(k, "tow.mode tow.line_length tow.line.branches tow.branch2.length tow.hull_x tow.hull_y "
                          "tow.branch2.hull_x tow.branch2.hull_y") &&
        !bt_case_tow_start(c, start))
        bt_check_fault(k, "tow.branch2.length",
                       "the two branches, %g and %g m, do not both reach the middle between their fastening points; "
                       "lengthen the shorter one or move its fastening point",
                       c->tow.line_length, c->tow.branch2.length);
    check_waypoints(k);
}
