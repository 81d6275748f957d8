// SPDX-License-Identifier: MIT
// The tow of a case: defaults that follow from other keys, checks, and where its path leads.

#include "geometry/path.h"
#include "bergtow/catenary.h"
#include "base/inside.h"
#include "case/warning.h"
#include "case/rope.h"
#include "bergtow/shape.h"
#include "case/case_tow.h"
#include "case/case_check.h"
#include "case/speed_law.h"
#include "base/elementary.h"

enum { TIMES = 2000 };                 // times of a run at which its planned track is checked
static const double DAMPING = 0.03;     // share of the critical damping, of a line at sea, assumed
static const double BESIDE_HULL = 0.05; // how far outside the hull a fastening point may lie / its extent, assumed

static bool has_line(const bt_case *input)
{
    return input->tow.mode == BT_TOW_LINE || input->tow.mode == BT_TOW_THRUST;
}

// ---- speed and way ----

static bt_speed_law speed_law(const bt_case *input)
{
    return (bt_speed_law){
        .speed = input->tow.speed, .ramp = input->tow.ramp, .programme = input->tow.programme,
        .n = input->tow.n_programme};
}

/// Largest speed of the programme up to a time, and the time at which it is first reached.
static void largest_speed(const bt_case *input, double end, double *speed, double *time)
{
    const double *p = input->tow.programme;
    *speed = -1, *time = 0;
    for (int i = 0; i < input->tow.n_programme && (i == 0 || p[2 * i] <= end); i++)
        if (p[2 * i + 1] > *speed) *speed = p[2 * i + 1], *time = i > 0 ? p[2 * i] : 0;
    const bt_speed_law law = speed_law(input);
    if (isfinite(end) && bt_speed_law_at(&law, end) > *speed) *speed = bt_speed_law_at(&law, end), *time = end;
}

/// End of the time in which a programme counts: points after the end of the run are not part of the tow.
static double programme_end(const bt_case *input) { return input->run.duration > 0 ? input->run.duration : INFINITY; }

double bt_case_tow_distance(const bt_case *input, double t)
{
    const bt_speed_law law = speed_law(input);
    return bt_speed_law_way(&law, t);
}

double bt_case_tow_led(const bt_case *input, double t)
{
    const bt_speed_law law = speed_law(input);
    const double steps = ceil(t / input->run.dt * (1 - 1e-12)); // NaN in a refused case
    return bt_speed_law_led(&law, steps > 0 && steps < 1e15 ? (int64_t)steps : 0, input->run.dt);
}

double bt_case_tow_time(const bt_case *input, double way)
{
    const bt_speed_law law = speed_law(input);
    return bt_speed_law_time(&law, way, input->run.duration);
}

double bt_case_tow_last(const bt_case *input, double way)
{
    const bt_speed_law law = speed_law(input);
    int64_t low = 0, high = bt_case_steps(input);
    while (low < high) {
        const int64_t mid = low + (high - low) / 2 + 1;
        if (bt_speed_law_led(&law, mid, input->run.dt) <= way) low = mid;
        else high = mid - 1;
    }
    return (double)low * input->run.dt;
}

double bt_case_tow_turn(const bt_case *input, int k)
{
    const double *p = input->tow.waypoints + 2 * k;
    if (k + 1 >= input->tow.n_waypoints) return 0;
    const double before = k > 0 ? bt_atan2(p[1] - p[-1], p[0] - p[-2]) : input->tow.direction;
    return fabs(remainder(bt_atan2(p[3] - p[1], p[2] - p[0]) - before, 2 * BT_PI));
}

// ---- where it starts, and its path ----

/// A point of the hull in coordinates of the world at time zero.
static void hull_at(const bt_case *input, double hx, double hy, double at[2])
{
    const double cy = bt_cos(input->body.yaw), sy = bt_sin(input->body.yaw);
    at[0] = input->body.x + cy * hx - sy * hy;
    at[1] = input->body.y + sy * hx + cy * hy;
}

/// Distance between the ends of a branch at the start, m: just taut, without tension. A line with a weight always has
/// tension: it starts with a pull of BT_START_PULL times its weight.
static double start_span(const bt_case *input, double length, double stiffness)
{
    const double w = input->tow.line.weight;
    if (!(w > 0 && length > 0 && stiffness > 0)) return length;
    return bt_catenary_span(length, stiffness, w, BT_START_PULL * w * length);
}

bool bt_case_tow_start(const bt_case *input, double at[2])
{
    const double ux = bt_cos(input->tow.direction), uy = bt_sin(input->tow.direction);
    // A line's length ahead of the fastening point: taut, without tension.
    double p[2], q[2];
    hull_at(input, input->tow.hull_x, input->tow.hull_y, p);
    const double length[2] = {start_span(input, input->tow.line_length, input->tow.line_stiffness),
                              start_span(input, input->tow.branch2.length, input->tow.branch2.stiffness)};
    at[0] = p[0] + length[0] * ux;
    at[1] = p[1] + length[0] * uy;
    if (input->tow.line.branches < 2 || !has_line(input)) return true;
    // Two branches: the end is as far ahead of the middle between their fastening points as it can be without
    // stretching one. (Where both are just taut may be far off the tow's axis, if one point lies ahead of the other.)
    hull_at(input, input->tow.branch2.hull_x, input->tow.branch2.hull_y, q);
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

bool bt_case_tow_path(const bt_case *input, bt_path *path, char why[200])
{
    double start[2];
    *path = (bt_path){0};
    if (!bt_case_tow_start(input, start)) {
        snprintf(why, 200,
                 "the branches do not reach the middle between their fastening points; lengthen the shorter one or "
                 "move its fastening point");
        return false;
    }
    if (!has_line(input)) start[0] = input->body.x, start[1] = input->body.y;
    if (input->tow.n_waypoints > 0)
        return bt_path_make(path, start[0], start[1], input->tow.n_waypoints, input->tow.waypoints,
                            input->tow.turn_radius, why);
    const double ahead[2] = {start[0] + bt_cos(input->tow.direction), start[1] + bt_sin(input->tow.direction)};
    const bool made = bt_path_make(path, start[0], start[1], 1, ahead, 0, why);
    if (made) path->n_marks = 0; // the point ahead is no way-point
    return made;
}

bool bt_case_trail_begin(const bt_case *input, bt_trail *trail)
{
    char why[200];
    double start[2], tangent[2];
    *trail = (bt_trail){.path = bt_alloc(1, sizeof *trail->path)};
    if (!bt_case_tow_path(input, trail->path, why)) {
        bt_case_trail_end(trail);
        return false;
    }
    bt_path_at(trail->path, 0, start, tangent);
    trail->far = (start[0] - input->body.x) * tangent[0] + (start[1] - input->body.y) * tangent[1];
    trail->x = start[0] - trail->far * tangent[0], trail->y = start[1] - trail->far * tangent[1];
    trail->beside[0] = input->body.x - trail->x, trail->beside[1] = input->body.y - trail->y;
    return true;
}

void bt_case_trail_to(bt_trail *trail, double way, double at[2])
{
    double end[2], tangent[2];
    bt_path_at(trail->path, way, end, tangent);
    const double dx = end[0] - trail->x, dy = end[1] - trail->y, apart = bt_hypot(dx, dy);
    const double on = apart > trail->far ? 1 - trail->far / apart : 0;
    trail->x += on * dx, trail->y += on * dy;
    at[0] = trail->x + trail->beside[0], at[1] = trail->y + trail->beside[1];
}

void bt_case_trail_end(bt_trail *trail)
{
    bt_path_free(trail->path);
    free(trail->path);
    *trail = (bt_trail){0};
}

double bt_case_tow_cut(const bt_case *input)
{
    bt_trail trail;
    if (input->tow.n_waypoints == 0 || !has_line(input) || !bt_case_trail_begin(input, &trail)) return 0;
    enum { BEHIND = 100 }; // points of the path, up to two line lengths behind the end; the body is beside one of them
    double at[2], beside[2], tangent[2], most = 0;
    const double whole = bt_case_tow_distance(input, input->run.duration);
    for (int i = 1; i <= TIMES; i++) {
        const double way = whole * i / TIMES;
        bt_case_trail_to(&trail, way, at);
        double least = INFINITY;
        for (int k = 0; k < BEHIND && i % 4 == 0; k++) {
            bt_path_at(trail.path, way - 2 * trail.far * k / BEHIND, beside, tangent);
            least = bt_min(least, bt_hypot(beside[0] - trail.x, beside[1] - trail.y));
        }
        if (isfinite(least)) most = bt_max(most, least);
    }
    bt_case_trail_end(&trail);
    return most;
}

// ---- defaults ----

void bt_case_tow_course(const bt_check *check)
{
    bt_case *input = check->c;
    if (input->domain.frame == BT_FRAME_GEOGRAPHIC) bt_check_fill(&input->body.x, 0);
    if (input->domain.ends == BT_BOUND_MOVING && input->tow.n_waypoints > 0 && !bt_check_given(check, "tow.direction"))
        bt_case_window_face(input, input->tow.waypoints[0]);
    if (input->tow.n_waypoints > 0 && !bt_check_given(check, "tow.direction") && !isnan(input->body.x))
        input->tow.direction =
            bt_atan2(input->tow.waypoints[1] - input->body.y, input->tow.waypoints[0] - input->body.x);
}

/// Stiffness of a branch, N/m: of a stretched line, or (at_start) of a line with a weight as it starts.
static double branch_stiffness(const bt_case *input, double length, double stiffness, bool at_start)
{
    double tangent = stiffness / length;
    const double span = start_span(input, length, stiffness);
    if (at_start && span != length) bt_catenary_pull(length, stiffness, input->tow.line.weight, span, &tangent);
    return tangent;
}

/// Period of the body on its line or lines, s; 0 without a line.
static double period_on(const bt_case *input, bool at_start)
{
    if (!has_line(input)) return 0;
    const double body = bt_case_body_mass(input) * (1 + input->body.added_mass),
                 vessel = input->tow.vessel.mass * (1 + input->tow.vessel.added_mass);
    const double mass = input->tow.mode == BT_TOW_THRUST ? body * vessel / (body + vessel) : body;
    double k = branch_stiffness(input, input->tow.line_length, input->tow.line_stiffness, at_start);
    if (input->tow.line.branches > 1)
        k += branch_stiffness(input, input->tow.branch2.length, input->tow.branch2.stiffness, at_start);
    const double period = 2 * BT_PI * sqrt(mass / k);
    return isfinite(period) ? period : 0;
}

/// Damping at sea: a share of the critical damping of the body on its line or lines, N s/m; 0 without a line.
static double damping_of(const bt_case *input)
{
    const double stiffness = input->tow.line_stiffness / input->tow.line_length, period = period_on(input, false);
    // parallel lines with 2 ζ k/ω each have 2 ζ M ω together
    return period > 0 ? DAMPING * stiffness * period / BT_PI : 0;
}

void bt_case_tow_follow(const bt_check *check)
{
    bt_case *input = check->c;
    if (input->tow.n_programme > 0) {
        double speed, time;
        largest_speed(input, programme_end(input), &speed, &time);
        if (!bt_check_given(check, "tow.speed")) input->tow.speed = speed;
        if (!bt_check_given(check, "tow.ramp")) input->tow.ramp = time;
    }
    bt_case_tow_course(check);
    const bt_rope rope = bt_rope_named(input->tow.line.type, input->tow.line.diameter);
    const bool named = input->tow.line.type != BT_ROPE_NUMBERS, at_sea = input->domain.frame == BT_FRAME_GEOGRAPHIC;
    bt_check_fill(&input->tow.line_stiffness, named ? rope.stiffness : at_sea && has_line(input) ? NAN : 10e3);
    bt_check_fill(&input->tow.line.breaking_load, rope.breaking);
    bt_check_fill(&input->tow.branch2.length, input->tow.line_length);
    bt_check_fill(&input->tow.branch2.stiffness, input->tow.line_stiffness);
    bt_check_fill(&input->tow.branch2.breaking_load, input->tow.line.breaking_load);
    bt_check_fill(&input->tow.line_damping, at_sea ? damping_of(input) : 100); // needs the stiffness of both branches
    bt_check_fill(&input->tow.branch2.damping, input->tow.line_damping);
    bt_check_fill(&input->tow.vessel.free_resistance, 0.4 * input->tow.vessel.bollard_pull);
    bt_check_fill(&input->tow.vessel.lookahead, input->tow.line_length > 0 ? input->tow.line_length : 1);
}

// A linear ramp of duration T_r accelerates the body at v/T_r; the tension of an undamped line then swings about M
// v/T_r with that amplitude. A sudden start has the amplitude M v ω = 2π M v/T: a ramp of two periods reduces it to a
// twelfth, and one of whole periods leaves no swing behind. A line with a weight is softest as it starts, when its
// slack is still to be taken up: its period is then the longest.
double bt_case_line_period(const bt_case *input) { return period_on(input, true); }

double bt_case_steepest_ramp(const bt_case *input)
{
    const double *p = input->tow.programme;
    if (input->tow.n_programme == 0) return input->tow.ramp;
    const double own = input->body.vx * bt_cos(input->tow.direction) + input->body.vy * bt_sin(input->tow.direction);
    double least = p[1] > bt_max(0, own) * (1 + 1e-9) ? 0 : INFINITY;
    for (int i = 0; i + 1 < input->tow.n_programme; i++)
        if (p[2 * i + 3] > p[2 * i + 1])
            least = bt_min(least, (p[2 * i + 2] - p[2 * i]) * input->tow.speed / (p[2 * i + 3] - p[2 * i + 1]));
    return least;
}

bool bt_case_start_is_slow(const bt_case *input)
{
    return bt_case_steepest_ramp(input) >= BT_RAMP_PERIODS * bt_case_line_period(input) * (1 - 1e-12);
}

double bt_case_earliest_window(const bt_case *input)
{
    BT_PLAIN_NUMBERS;
    if (input->output.window_start >= 0) return input->output.window_start;
    if (input->tow.mode == BT_TOW_NONE) return 0;
    // At a prescribed speed the tow force of the ramp is the inertia of the body, also in the step that ends with it.
    if (input->tow.mode == BT_TOW_SPEED && input->tow.ramp > 0) return input->tow.ramp + input->run.dt;
    if (bt_case_start_is_slow(input)) return input->tow.ramp;
    // After a start that jerks the line the body keeps swinging, and a few swings are too few to be told from chance:
    // leave out two, but at most half of what follows the ramp.
    const double swings = BT_RAMP_PERIODS * bt_case_line_period(input), rest = input->run.duration - input->tow.ramp;
    return input->tow.ramp + bt_max(0, bt_min(swings, 0.5 * rest));
}

/// Warn of a speed and a course that change within a step.
static void warn_of_jerks(const bt_case *input, bt_errors *warnings)
{
    const double *p = input->tow.programme;
    for (int i = 0; i + 1 < input->tow.n_programme; i++)
        if (p[2 * i + 3] != p[2 * i + 1] && p[2 * i + 2] - p[2 * i] < input->run.dt)
            bt_warn(warnings, BT_WARN_SPEED_JUMP,
                          "tow.programme: from %g to %g m/s in less than a step: the tow force is then mass times that "
                          "change over run.dt, and its peak depends on run.dt alone; spread the change over several "
                          "steps",
                          p[2 * i + 1], p[2 * i + 3]);
    bt_path path = {0};
    char why[200];
    if (input->tow.n_waypoints == 0 || input->tow.turn_radius > 0 || !bt_case_tow_path(input, &path, why)) return;
    for (int k = 0; k < path.n_marks; k++)
        if (bt_case_tow_turn(input, k) > BT_TURN && path.mark[k] < bt_case_tow_distance(input, input->run.duration)) {
            bt_warn(warnings, BT_WARN_TURN_JUMP,
                          "tow.turn_radius: 0 m makes the body turn at way-point %d within one step: the tow force is "
                          "then mass times the change of velocity over run.dt, and its peak depends on run.dt alone; "
                          "give a radius",
                          k + 1);
            break;
        }
    bt_path_free(&path);
}

/// Largest speed of the current along the tow over all its legs, m/s.
static double following(const bt_case *input)
{
    double most = 0;
    for (int k = 0; k == 0 || k < input->tow.n_waypoints; k++) {
        const double *p = input->tow.waypoints + 2 * k,
                     course = k > 0 ? bt_atan2(p[1] - p[-1], p[0] - p[-2]) : input->tow.direction,
                     ux = bt_cos(course), uy = bt_sin(course);
        if (input->water.table.n == 0)
            most = bt_max(most, input->water.current_x * ux + input->water.current_y * uy + input->water.tide.major);
        for (int64_t i = 0; i < input->water.table.n; i++)
            most = bt_max(most, input->water.table.row[3 * i + 1] * ux + input->water.table.row[3 * i + 2] * uy +
                                    input->water.tide.major);
    }
    return most;
}

/// Warn of a current that carries the body past its towing end, which a line does not prevent.
static void warn_of_overtaking(const bt_case *input, bt_errors *warnings)
{
    const double along = has_line(input) ? following(input) : 0;
    if (along > input->tow.speed && input->tow.speed > 0)
        bt_warn(warnings, BT_WARN_CURRENT_OVERTAKES,
                      "water.%s: up to %.3g m/s along the tow, whose speed is to be %.3g m/s: the current carries the "
                      "body past its towing end, and nothing in the model keeps them apart; tow faster than the "
                      "current, or against it",
                      input->water.table.n ? "current_table" : input->water.tide.major > 0 ? "tide" : "current_x",
                      along, input->tow.speed);
}

/// Warn of a run that ends before the tow has its speed. Not for a programme, whose ramp is the time of its largest
/// speed within the run.
static void warn_of_short_run(const bt_case *input, bt_errors *warnings)
{
    if (input->tow.mode == BT_TOW_NONE || input->tow.n_programme > 0 || !(input->tow.speed > 0)) return;
    if (!(input->tow.ramp >= input->run.duration)) return;
    bt_warn(warnings, BT_WARN_SHORT_RUN,
            "tow.ramp: the speed rises for %.4g s, but the run ends after %.4g s: it never reaches tow.speed; lengthen "
            "run.duration, or give a shorter ramp",
            input->tow.ramp, input->run.duration);
}

void bt_case_warn_start(const bt_case *input, bt_errors *warnings)
{
    warn_of_short_run(input, warnings);
    if (input->tow.mode == BT_TOW_SPEED) warn_of_jerks(input, warnings);
    warn_of_overtaking(input, warnings);
    if (bt_case_start_is_slow(input)) return;
    const double period = bt_case_line_period(input), ramp = bt_case_steepest_ramp(input);
    if (input->tow.n_programme > 0)
        bt_warn(warnings, BT_WARN_STEEP_PROGRAMME,
                      "tow.programme: a rise as steep as from 0 to %.4g m/s in %.4g s is short for a body that swings "
                      "on its line in %.3g s: it jerks the line, and the body keeps swinging; use at least %.3g s for "
                      "that",
                      input->tow.speed, ramp, period, BT_RAMP_PERIODS * period);
    else
        bt_warn(warnings, BT_WARN_SHORT_RAMP,
                      "tow.ramp: %.4g s is short for a body that swings on its line in %.3g s: the start jerks the "
                      "line, and the body keeps swinging; leave tow.ramp out, or use at least %.3g s",
                      ramp, period, BT_RAMP_PERIODS * period);
}

void bt_case_tow_ramp(bt_case *input)
{
    if (!isnan(input->tow.ramp)) return;
    double v[2 * BT_MAX_VERTICES];
    const int n = input->tow.mode == BT_TOW_NONE ? 0 : bt_case_waterline(input, v);
    const double size = n ? sqrt(4 / BT_PI * bt_shape_moments(n, v).area) : 0,
                 way = input->tow.speed > 0 ? size / input->tow.speed : 0;
    input->tow.ramp = bt_max(way, BT_RAMP_PERIODS * bt_case_line_period(input));
}

/// The point of the waterline farthest in a direction; the middle of the corners if several are equally far.
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

void bt_case_tow_hull(bt_case *input, int n, const double *v)
{
    const double ahead = input->tow.direction - input->body.yaw, ux = bt_cos(ahead), uy = bt_sin(ahead);
    const bool two = input->tow.line.branches > 1;
    double p[2], q[2];
    farthest_point(n, v, two ? -uy : ux, two ? ux : uy, p);
    farthest_point(n, v, uy, -ux, q);
    bt_check_fill(&input->tow.hull_x, p[0]);
    bt_check_fill(&input->tow.hull_y, p[1]);
    bt_check_fill(&input->tow.branch2.hull_x, q[0]);
    bt_check_fill(&input->tow.branch2.hull_y, q[1]);
}

// ---- checks ----

static void check_programme(const bt_check *check)
{
    const bt_case *input = check->c;
    if (input->tow.n_programme == 0 || !bt_check_sound(check, "tow.programme")) return;
    const double *p = input->tow.programme;
    for (int i = 0; i + 1 < input->tow.n_programme; i++)
        if (!(p[2 * i + 2] > p[2 * i])) {
            bt_check_fault(check, "tow.programme",
                           "point %d is at %g s, not later than the point before, %g s; put the times in order", i + 2,
                           p[2 * i + 2], p[2 * i]);
            return;
        }
    double speed, time;
    largest_speed(input, programme_end(input), &speed, &time);
    if (bt_check_sound(check, "tow.speed") && input->tow.speed != speed)
        bt_check_fault(check, "tow.speed",
                       "%g m/s has no effect with tow.programme, whose largest speed is %g m/s; remove one of them",
                       input->tow.speed, speed);
    if (bt_check_sound(check, "tow.ramp") && input->tow.ramp != time)
        bt_check_fault(
            check, "tow.ramp",
            "%g s has no effect with tow.programme, which reaches its largest speed at %g s; remove one of them",
            input->tow.ramp, time);
}

/// How far a point lies outside a convex outline, m; negative inside.
static double outside_of(int n, const double *v, double x, double y)
{
    double most = -INFINITY;
    for (int i = 0; i < n; i++) {
        const double *p = v + 2 * i, *q = v + 2 * ((i + 1) % n), ex = q[0] - p[0], ey = q[1] - p[1];
        most = bt_max(most, (ey * (x - p[0]) - ex * (y - p[1])) / bt_hypot(ex, ey));
    }
    return most;
}

/// A line must be fastened on the hull, or at most a little beside its waterline.
static void check_fastening(const bt_check *check)
{
    const bt_case *input = check->c;
    static const char *const key[] = {"tow.hull_x", "tow.branch2.hull_x"},
                      *const keys[] = {"tow.hull_x tow.hull_y", "tow.branch2.hull_x tow.branch2.hull_y"};
    const double at[2][2] =
        {{input->tow.hull_x, input->tow.hull_y}, {input->tow.branch2.hull_x, input->tow.branch2.hull_y}};
    double v[2 * BT_MAX_VERTICES];
    const int n = bt_case_waterline(input, v);
    if (!n || !has_line(input) ||
        !bt_check_sound(check, "tow.mode body.shape body.length body.width body.vertices tow.line.branches"))
        return;
    for (int b = 0; b < input->tow.line.branches; b++) {
        const double off = outside_of(n, v, at[b][0], at[b][1]);
        if (off > BESIDE_HULL * 2 * bt_shape_area_moments(n, v).radius && bt_check_sound(check, keys[b]))
            bt_check_fault(check, key[b],
                           "the line is fastened at (%g, %g) m from the centroid of the waterline, %.3g m outside the "
                           "hull; give a point of the hull in the body's own axes, or leave it out to use the "
                           "outermost point",
                           at[b][0], at[b][1], off);
    }
}

/// First of TIMES times of the run at which the body, led along the path or trailing behind an end that is, passes a
/// wall; negative = never.
static double time_of_wall(const bt_case *input)
{
    double v[2 * BT_MAX_VERTICES], at[2], found = -1;
    bt_trail trail;
    if (!bt_case_trail_begin(input, &trail)) return -1;
    const int n = bt_case_waterline(input, v);
    const double cy = bt_cos(input->body.yaw), sy = bt_sin(input->body.yaw);
    const double slack = 1e-9 * (input->domain.length + input->domain.width);
    for (int i = 1; i <= TIMES && found < 0; i++) {
        const double time = input->run.duration * i / TIMES;
        const double close_x = input->domain.ends_closing * time - slack,
                     close_y = input->domain.sides_closing * time - slack;
        bt_case_trail_to(&trail, bt_case_tow_led(input, time), at);
        for (int j = 0; j < n; j++) {
            const double x = at[0] + cy * v[2 * j] - sy * v[2 * j + 1] - input->domain.x0;
            const double y = at[1] + sy * v[2 * j] + cy * v[2 * j + 1] - input->domain.y0;
            if (input->domain.ends == BT_BOUND_WALL && (x < close_x || x > input->domain.length - close_x))
                found = time;
            if (input->domain.sides == BT_BOUND_WALL && (y < close_y || y > input->domain.width - close_y))
                found = time;
        }
    }
    bt_case_trail_end(&trail);
    return found;
}

static void check_waypoints(const bt_check *check)
{
    const bt_case *input = check->c;
    if (!bt_check_sound(check, "tow.waypoints tow.turn_radius tow.direction tow.mode tow.line_length tow.line.branches "
                               "body.x body.y body.yaw"))
        return;
    if (input->tow.n_waypoints == 0 || input->tow.mode == BT_TOW_NONE) return; // no effect: constraints.c
    const double dx = input->tow.waypoints[0] - input->body.x, dy = input->tow.waypoints[1] - input->body.y,
                 course = bt_atan2(dy, dx);
    if (fabs(remainder(input->tow.direction - course, 2 * BT_PI)) > 1e-9) {
        bt_check_fault(check, "tow.direction",
                       "%g deg is not the direction from the body to the first way-point, %g deg; remove one of them",
                       input->tow.direction * 180 / BT_PI, course * 180 / BT_PI);
        return;
    }
    double start[2];
    if (!bt_case_tow_start(input, start)) return; // reported by bt_case_tow_check
    if (!has_line(input)) start[0] = input->body.x, start[1] = input->body.y;
    if (!((input->tow.waypoints[0] - start[0]) * bt_cos(course) +
          (input->tow.waypoints[1] - start[1]) * bt_sin(course) > 0)) {
        bt_check_fault(check, "tow.waypoints",
                       "the first, (%g, %g) m, is not ahead of the start of the towing end, (%g, %g) m; move it ahead "
                       "or shorten the line",
                       input->tow.waypoints[0], input->tow.waypoints[1], start[0], start[1]);
        return;
    }
    bt_path path;
    char why[200];
    if (!bt_case_tow_path(input, &path, why)) {
        bt_check_fault(check, "tow.waypoints", "%s", why);
        return;
    }
    // The same limit as for the direction of a straight tow.
    for (int i = 0; input->domain.ends == BT_BOUND_MOVING && i + 1 < input->tow.n_waypoints &&
         bt_check_sound(check, "domain.ends");
         i++) {
        const double lx = input->tow.waypoints[2 * i + 2] - input->tow.waypoints[2 * i],
                     ly = input->tow.waypoints[2 * i + 3] - input->tow.waypoints[2 * i + 1];
        if (lx * bt_case_tow_sign(input) >= 0.5 * bt_hypot(lx, ly)) continue;
        bt_check_fault(check, "tow.waypoints",
                       "the leg from way-point %d leads %g deg from x, but a moving window moves along x; keep within "
                       "60 deg of that, or set domain.ends: periodic or open",
                       i + 1, bt_atan2(ly, lx) * 180 / BT_PI);
        break;
    }
    // A vessel need not keep up with its programme, so its way is not known.
    if (input->tow.mode != BT_TOW_THRUST && input->run.duration > 0 && input->body.shape != BT_BODY_ABSENT &&
        bt_check_sound(check, "run.duration tow.speed tow.ramp tow.programme domain.length domain.width domain.x0 "
                              "domain.y0 domain.ends domain.sides domain.ends_closing domain.sides_closing "
                              "body.shape")) {
        const double time = time_of_wall(input);
        if (time >= 0)
            bt_check_fault(check, "run.duration",
                           "the way-points lead the body into a wall after %.4g m; shorten the run to %g s, or move "
                           "the way-points, or enlarge the domain",
                           bt_case_tow_distance(input, time), floor(time));
    }
    bt_path_free(&path);
}

void bt_case_tow_check(const bt_check *check)
{
    const bt_case *input = check->c;
    check_programme(check);
    check_fastening(check);
    double start[2];
    if (has_line(input) &&
        bt_check_sound(check, "tow.mode tow.line_length tow.line.branches tow.branch2.length tow.hull_x tow.hull_y "
                              "tow.branch2.hull_x tow.branch2.hull_y") &&
        !bt_case_tow_start(input, start))
        bt_check_fault(check, "tow.branch2.length",
                       "the two branches, %g and %g m, do not both reach the middle between their fastening points; "
                       "lengthen the shorter one or move its fastening point",
                       input->tow.line_length, input->tow.branch2.length);
    check_waypoints(check);
}
