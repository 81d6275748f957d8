// SPDX-License-Identifier: MIT
// Defaults that follow from other keys, and checks across keys.
//
// A check names the keys it looks at. If one of them was refused already, the check is skipped: its message would be
// about the default that stands in for the refused value.
#include "case/case_check.h"
#include "base/inside.h"
#include "case/case_tow.h"
#include "case/warning.h"

#include "bergtow/shape.h"
#include "base/fileio.h"
#include "case/cost.h"
#include "case/ice_bounds.h"
#include "base/elementary.h"
#include "base/largest.h"
#include "case/schema.h"

#include <string.h>

typedef struct {
    double x_min, x_max, y_min, y_max;
} box;

// Bounds of an outline at a pose.
static box bounds_of(int n, const double *v, double x, double y, double yaw)
{
    box bounds = {INFINITY, -INFINITY, INFINITY, -INFINITY};
    double cosine = bt_cos(yaw), sine = bt_sin(yaw);
    for (int i = 0; i < n; i++) {
        double px = x + cosine * v[2 * i] - sine * v[2 * i + 1], py = y + sine * v[2 * i] + cosine * v[2 * i + 1];
        bounds.x_min = bt_min(bounds.x_min, px), bounds.x_max = bt_max(bounds.x_max, px);
        bounds.y_min = bt_min(bounds.y_min, py), bounds.y_max = bt_max(bounds.y_max, py);
    }
    return bounds;
}

// The axis along which a body is outside the domain, or 0. Walls must hold the whole outline, open and periodic
// boundaries the centroid. The slack allows for the round-off of x0 + length.
static char outside(const bt_case *input, box bounds, double x, double y)
{
    double slack = 1e-9 * (input->domain.length + input->domain.width);
    bool ends = input->domain.ends == BT_BOUND_WALL, sides = input->domain.sides == BT_BOUND_WALL;
    if ((ends ? bounds.x_min : x) < input->domain.x0 - slack ||
        (ends ? bounds.x_max : x) > input->domain.x0 + input->domain.length + slack)
        return 'x';
    if ((sides ? bounds.y_min : y) < input->domain.y0 - slack ||
        (sides ? bounds.y_max : y) > input->domain.y0 + input->domain.width + slack)
        return 'y';
    return 0;
}

// ---- defaults that follow from other keys ----

char *bt_case_named_file(const char *from, const char *file)
{
    if (*file == '/') return NULL;
    char *folder = bt_file_folder(from), *absolute = realpath(folder, NULL),
         *joined = absolute ? bt_file_join(absolute, file) : NULL;
    free(absolute);
    free(folder);
    return joined;
}

/// Make the paths of files that the case names absolute, since the resolved file lies elsewhere.
static void follow_files(const bt_check *check)
{
    for (int i = 0; i < bt_n_case_keys; i++) {
        if (!bt_case_keys[i].file) continue;
        char **file = (char **)((char *)check->c + bt_case_keys[i].offset);
        char *absolute = *file ? bt_case_named_file(bt_check_file(check, bt_case_keys[i].name), *file) : NULL;
        if (!absolute) continue;
        free(*file);
        *file = absolute;
    }
}

/// A velocity without any given component stays open if the body drifts freely at the start; otherwise missing
/// components become 0.
static void follow_start(bool drifts, double *vx, double *vy)
{
    if (drifts && isnan(*vx) && isnan(*vy)) return;
    bt_check_fill(vx, 0);
    bt_check_fill(vy, 0);
}

static void follow(const bt_check *check)
{
    bt_case *input = check->c;
    bt_case_fill_scene(input);
    const bool drift = input->ice.start == BT_START_DRIFT;
    follow_start(drift && input->tow.mode == BT_TOW_NONE && input->body.shape != BT_BODY_ABSENT, &input->body.vx,
                 &input->body.vy);
    for (bt_idx i = 0; i < input->n_floes; i++) {
        bt_floe_def *floe = &input->floes[i];
        bt_check_fill(&floe->width, floe->length);
        bt_check_fill(&floe->thickness, input->ice.thickness);
        follow_start(drift && !floe->fixed, &floe->vx, &floe->vy);
    }
    bt_case_fill_size(input);
    if (input->output.frame_interval == 0 && input->run.duration > 0)
        input->output.frame_interval = input->run.duration / 200;
    follow_files(check);
}

// ---- defaults of the frames ----

// In the table of keys, at_sea marks a default that is a model basin's. In the geographic frame such a number would
// look like an answer: the key has no value there until the case gives it, or another key implies it (a programme the
// speed, a named line its stiffness). If it still has none, and has an effect, the case is refused. Other defaults hold
// in both frames, or follow from the scene in the geographic one (case_fill.c, case_tow.c).

static double *number(bt_case *input, const bt_key *key) { return (double *)(void *)((char *)input + key->offset); }

static bool is_basin(const bt_case *input) { return input->domain.frame == BT_FRAME_BASIN; }

/// May the run use the value of this key?
static bool is_used(const bt_case *input, const char *key, bool by_hand)
{
    if (bt_case_why_unused(input, key)) return false;
    return strcmp(key, "ice.thickness") || bt_case_makes_ice(input) || by_hand || input->ice.outlines;
}

/// Set numbers to NaN that nobody gave, that have an effect, and whose default is a model basin's. by_hand: the list
/// has floes without a thickness of their own.
static void clear_at_sea(const bt_check *check, bool by_hand)
{
    if (!check->from || is_basin(check->c)) return;
    for (int i = 0; i < bt_n_case_keys; i++) {
        const bt_key *row = &bt_case_keys[i];
        if (!row->at_sea || row->type != BT_KEY_REAL || bt_check_given(check, row->name)) continue;
        if (is_used(check->c, row->name, by_hand)) *number(check->c, row) = NAN;
    }
}

static bool is_missing(const bt_check *check, const bt_key *row)
{
    if (row->type == BT_KEY_REAL) return isnan(*number(check->c, row));
    return check->from && !is_basin(check->c) && !bt_check_given(check, row->name);
}

/// May this value stay open? geojson.c asks for a thickness if outlines lack one.
static bool may_miss(const bt_case *input, const char *key, bool by_hand)
{
    return !strcmp(key, "ice.thickness") && input->ice.outlines && !by_hand;
}

/// Refuse a case that still lacks such a value after others have followed from the given ones. With outlines
/// ice.thickness may stay NaN: the file decides whether it is needed.
static void check_at_sea(const bt_check *check, bool by_hand)
{
    bt_case *input = check->c;
    if (!bt_check_sound(check, "domain.frame")) return;
    for (int i = 0; i < bt_n_case_keys; i++) {
        const bt_key *row = &bt_case_keys[i];
        if (!row->at_sea || !bt_check_sound(check, row->name) || !is_missing(check, row)) continue;
        if (!is_used(input, row->name, by_hand)) { // given as none, and without effect
            bt_schema_preset(row, row->type == BT_KEY_REAL, input);
            continue;
        }
        if (may_miss(input, row->name, by_hand)) continue;
        if (is_basin(input))
            bt_check_fault(check, row->name, "is none, but a value is needed; give it (%s)", row->at_sea);
        else
            bt_check_fault(check, row->name,
                           "missing, and in domain.frame: geographic it has no default (that would be a model "
                           "basin's); add it (%s)",
                           row->at_sea);
        if (check->from) check->from[i].faulty = true;
    }
}

// ---- checks ----

static void check_run(const bt_check *check)
{
    const bt_case *input = check->c;
    if (!bt_check_sound(check, "run.dt run.duration")) return;
    if (!(input->run.dt > 0) || !(input->run.duration > 0)) return;
    double steps = (double)bt_case_steps(input);
    if (steps > BT_MAX_STEPS)
        bt_check_fault(check, "run.dt",
                       "makes %.3g steps of run.duration, more than the limit of %d; lengthen the step or shorten the "
                       "run",
                       steps, BT_MAX_STEPS);
    if (bt_check_sound(check, "output.frame_interval") && input->run.duration / input->output.frame_interval >
        BT_MAX_FRAMES)
        bt_check_fault(check, "output.frame_interval", "makes %.3g frames, more than the limit of %d; lengthen it",
                       input->run.duration / input->output.frame_interval, BT_MAX_FRAMES);
}

static void check_closing(const bt_check *check, const char *key, const char *boundary_key, double closing,
                          bt_bound boundary, double extent)
{
    if (closing == 0 || boundary != BT_BOUND_WALL || !bt_check_sound(check, key) ||
        !bt_check_sound(check, boundary_key))
        return;
    if (bt_check_sound(check, "run.duration domain.length domain.width") &&
        2 * closing * check->c->run.duration >= extent)
        bt_check_fault(
            check, key,
            "%g m/s brings the walls together after %g s, before the end of the run; slow them or shorten run.duration",
            closing, extent / (2 * closing));
}

static void check_domain(const bt_check *check)
{
    const bt_case *input = check->c;
    check_closing(check, "domain.ends_closing", "domain.ends", input->domain.ends_closing, input->domain.ends,
                  input->domain.length);
    check_closing(check, "domain.sides_closing", "domain.sides", input->domain.sides_closing, input->domain.sides,
                  input->domain.width);
}

/// Sizes in the wrong order and a region without room are reported elsewhere.
static void check_floes_made(const bt_check *check)
{
    const bt_case *input = check->c;
    const bool power = input->ice.size_law == BT_SIZE_POWER;
    const bool sized = power ? input->ice.size_min > 0 && input->ice.size_min < input->ice.size_max
                             : input->ice.size > 0;
    if (!bt_case_makes_ice(input) || !sized || input->ice.x_min >= input->ice.x_max ||
        input->ice.y_min >= input->ice.y_max ||
        !bt_check_sound(check, "ice.concentration ice.size ice.size_law ice.size_min ice.size_max ice.size_exponent "
                               "ice.size_spread ice.x_min ice.x_max ice.y_min ice.y_max domain.x0 domain.y0 "
                               "domain.length domain.width"))
        return;
    const double n = bt_case_floes_made(input);
    if (n > BT_MAX_FLOES)
        bt_check_fault(check, power ? "ice.size_min" : "ice.size",
                       "makes about %.3g floes, more than the limit of %d; use larger floes or a smaller region", n,
                       BT_MAX_FLOES);
}

static bool check_body(const bt_check *check, int *n, double *v)
{
    const bt_case *input = check->c;
    *n = 0;
    if (input->body.shape == BT_BODY_ABSENT ||
        !bt_check_sound(check, "body.shape body.length body.width body.vertices body.x body.y body.yaw"))
        return false;
    if (input->body.shape == BT_BODY_POLYGON && !input->body.n_vertices) return false;
    const char *why = NULL;
    *n = bt_case_outline(input->body.shape, input->body.length, input->body.width, input->body.n_vertices,
                         input->body.vertices, v, &why);
    if (why) {
        bt_check_fault(check, input->body.shape == BT_BODY_POLYGON ? "body.vertices" : "body.length",
                       "the waterline is refused: %s", why);
        return false;
    }
    if (!bt_check_sound(check, "domain.frame domain.x0 domain.y0 domain.length domain.width domain.ends domain.sides"))
        return false;
    box bounds = bounds_of(*n, v, input->body.x, input->body.y, input->body.yaw);
    const char *extent = input->body.shape == BT_BODY_POLYGON ? "body.vertices" : "body.length";
    const bool too_long = bounds.x_max - bounds.x_min >= input->domain.length,
               too_wide = bounds.y_max - bounds.y_min >= input->domain.width;
    if (too_long)
        bt_check_fault(check, extent,
                       "the body spans %g m along x in a domain of %g m; use a smaller body or a larger domain.length",
                       bounds.x_max - bounds.x_min, input->domain.length);
    if (too_wide)
        bt_check_fault(check, extent,
                       "the body spans %g m along y in a domain of %g m; use a smaller body or a larger domain.width",
                       bounds.y_max - bounds.y_min, input->domain.width);
    if (too_long || too_wide) return false;
    char axis = outside(input, bounds, input->body.x, input->body.y);
    if (axis == 'x')
        bt_check_fault(check, "body.x", "the body, %g to %g m, is outside the domain, %g to %g m; move it inside",
                       bounds.x_min, bounds.x_max, input->domain.x0, input->domain.x0 + input->domain.length);
    if (axis == 'y')
        bt_check_fault(check, "body.y", "the body, %g to %g m, is outside the domain, %g to %g m; move it inside",
                       bounds.y_min, bounds.y_max, input->domain.y0, input->domain.y0 + input->domain.width);
    return !axis;
}

static void check_tow(const bt_check *check)
{
    bt_case *input = check->c;
    if (!bt_check_sound(check, "tow.mode tow.speed body.shape")) return;
    if (input->body.shape == BT_BODY_ABSENT && input->tow.mode != BT_TOW_NONE) {
        if (bt_check_given(check, "tow.mode"))
            bt_check_fault(check, "tow.mode",
                           "there is no body to tow (body.shape: none); set tow.mode: none or give a body");
        else input->tow.mode = BT_TOW_NONE;
    }
    if (input->tow.mode == BT_TOW_NONE && input->tow.speed != 0) {
        if (bt_check_given(check, "tow.speed") && bt_check_given(check, "tow.mode"))
            bt_check_fault(check, "tow.speed",
                           "%g m/s has no effect with tow.mode: none; set it to 0, or set tow.mode: speed",
                           input->tow.speed);
        else input->tow.speed = 0;
    }
}

/// Way of the tow until the body meets a wall that is `room` ahead of it at the start and approaches at the speed
/// `closing`; INFINITY if not within the run. towards: cosine between the course and the direction to the wall.
static double way_to_wall(const bt_case *input, double room, double towards, double closing)
{
    const double end = input->run.duration, slack = 1e-9 * (input->domain.length + input->domain.width);
    if (!(towards > 0) || towards * bt_case_tow_led(input, end) + closing * end <= room + slack) return INFINITY;
    if (closing == 0) return bt_max(0, room / towards);
    int64_t early = 0, late = bt_case_steps(input);
    while (late - early > 1) {
        const int64_t middle = early + (late - early) / 2;
        const double time = (double)middle * input->run.dt;
        if (towards * bt_case_tow_led(input, time) + closing * time <= room) early = middle;
        else late = middle;
    }
    return bt_case_tow_led(input, (double)early * input->run.dt);
}

// A body of prescribed velocity passes through a wall: no contact law holds between two infinite masses.
static void check_path(const bt_check *check, int n, const double *v)
{
    const bt_case *input = check->c;
    // On a line the body follows the end, at the same speed on average, and would end up pulled against the wall. A
    // vessel may be slower. Way-points: case_tow.c
    const bool straight = input->tow.mode != BT_TOW_NONE && input->tow.mode != BT_TOW_THRUST &&
                          input->tow.n_waypoints == 0;
    if (!straight || !(input->run.duration > 0) ||
        !bt_check_sound(check, "run.dt run.duration tow.mode tow.speed tow.direction tow.ramp tow.programme "
                               "domain.ends_closing domain.sides_closing"))
        return;
    double way = bt_case_tow_led(input, input->run.duration), ux = bt_cos(input->tow.direction),
           uy = bt_sin(input->tow.direction);
    const box bounds = bounds_of(n, v, input->body.x, input->body.y, input->body.yaw);
    double reach = INFINITY;
    if (input->domain.ends == BT_BOUND_WALL) {
        reach = bt_min(reach, way_to_wall(input, input->domain.x0 + input->domain.length - bounds.x_max, ux,
                                          input->domain.ends_closing));
        reach = bt_min(reach, way_to_wall(input, bounds.x_min - input->domain.x0, -ux, input->domain.ends_closing));
    }
    if (input->domain.sides == BT_BOUND_WALL) {
        reach = bt_min(reach, way_to_wall(input, input->domain.y0 + input->domain.width - bounds.y_max, uy,
                                          input->domain.sides_closing));
        reach = bt_min(reach, way_to_wall(input, bounds.y_min - input->domain.y0, -uy, input->domain.sides_closing));
    }
    if (isinf(reach)) return;
    const double time = bt_case_tow_last(input, reach);
    bt_check_fault(check, "run.duration",
                   "the tow is %g m long and a wall is in its way after %g m; shorten the run to %g s, or slow the "
                   "tow, or enlarge the domain",
                   way, reach, time);
}

/// Least distance between two parallel lines that enclose the outline; one lies along an edge of its convex hull.
static double least_width(int n, const double *v)
{
    double hull[2 * BT_MAX_VERTICES], least = INFINITY;
    memcpy(hull, v, 2 * sizeof *v * (size_t)n);
    n = bt_shape_hull(n, hull);
    for (int i = 0; i < n; i++) {
        const double *p = hull + 2 * i, *q = hull + 2 * ((i + 1) % n), length = bt_hypot(q[0] - p[0], q[1] - p[1]);
        least = bt_min(least, bt_shape_width(n, hull, (q[0] - p[0]) / length, (q[1] - p[1]) / length));
    }
    return least;
}

/// Square of the least radius of gyration of an area about an axis through its centroid, the origin, m².
static double least_gyration2(int n, const double *v)
{
    double area = 0, xx = 0, yy = 0, xy = 0; // 2, 12, 12 and 24 times the integrals of 1, x², y² and x y
    for (int i = 0; i < n; i++) {
        const double *p = v + 2 * i, *q = v + 2 * ((i + 1) % n), cross = p[0] * q[1] - p[1] * q[0];
        area += cross;
        xx += cross * (p[0] * p[0] + p[0] * q[0] + q[0] * q[0]);
        yy += cross * (p[1] * p[1] + p[1] * q[1] + q[1] * q[1]);
        xy += cross * (2 * p[0] * p[1] + p[0] * q[1] + q[0] * p[1] + 2 * q[0] * q[1]);
    }
    xx /= 6 * area, yy /= 6 * area, xy /= 12 * area;
    return 0.5 * (xx + yy) - bt_hypot(0.5 * (xx - yy), xy);
}

/// Walls that close on the body: whichever way it turns, it needs its least width. With an open boundary it may be
/// pushed or towed away, and guard.overlap: 0 lets bodies overlap.
static void check_squeeze(const bt_check *check, const char *key, double closing, double extent, int n, const double *v)
{
    const bt_case *input = check->c;
    const bool open = input->domain.ends == BT_BOUND_OPEN || input->domain.sides == BT_BOUND_OPEN;
    if (closing == 0 || open || input->guard.overlap == 0 || !bt_check_sound(check, key) ||
        !bt_check_sound(check, "run.dt run.duration domain.length domain.width domain.ends domain.sides"))
        return;
    const double left = extent - 2 * closing * input->run.duration, needed = least_width(n, v);
    if (left > 0 && left < needed * (1 - 1e-9)) // 0 or less: check_closing
        bt_check_fault(check, key,
                       "%g m/s leaves %g m between the walls at the end of the run, and the body is %g m wide where it "
                       "is narrowest; slow them, or end the run after %.10g s",
                       closing, left, needed, floor((extent - needed) / (2 * closing * input->run.dt)) * input->run.dt);
}

static void check_floe(const bt_check *check, int index)
{
    const bt_case *input = check->c;
    const bt_floe_def *floe = &input->floes[index];
    char where[256];
    const char *file = input->floes_path ? input->floes_path : input->path;
    if (floe->line > 0) snprintf(where, sizeof where, "%.180s:%d: floes[%d]", file ? file : "case", floe->line, index);
    else snprintf(where, sizeof where, "%.180s: floes[%d]", bt_case_name(input), index);
    bool polygon = floe->shape == BT_BODY_POLYGON;
    const size_t before = check->err->n;
    if (polygon && !floe->n_vertices)
        bt_errors_add(check->err, "%s: has shape polygon but no vertices; give them as [[x, y], [x, y], ...]", where);
    if (!polygon && floe->n_vertices)
        bt_errors_add(
            check->err, "%s: has vertices but the shape is not polygon; set shape: polygon, or remove the vertices",
            where);
    else if (!polygon && !(floe->length > 0)) bt_errors_add(check->err, "%s: has no length; give it, as in 1 m", where);
    if (check->err->n > before) return;
    double v[2 * BT_MAX_VERTICES];
    const char *why = NULL;
    int n = bt_case_floe_admit(floe, v, &why);
    if (why) {
        bt_errors_add(check->err, "%s: the outline is refused: %s", where, why);
        return;
    }
    if (floe->fixed && (floe->vx != 0 || floe->vy != 0 || floe->yaw_rate != 0))
        bt_errors_add(check->err, "%s: is fixed and has a velocity; remove vx, vy and yaw_rate, or fixed", where);
    if (isnan(floe->thickness)) return; // the thickness of the ice, which is asked for elsewhere
    char text[BT_ICE_WHY];
    const bt_moments moments = bt_shape_moments(n, v);
    const bt_ice_floe given = {n, v, floe->x, floe->y, floe->yaw, floe->thickness, NAN, 0};
    why = sqrt(4 * moments.area / BT_PI) < BT_LEAST_SIZE ? "it is less than a millimetre in size; check the unit"
                                                         : bt_ice_floe_fault(&given, text, NULL);
    if (why) {
        bt_errors_add(check->err, "%s: %s", where, why);
        return;
    }
    if (!bt_check_sound(check, "domain.frame domain.x0 domain.y0 domain.length domain.width domain.ends domain.sides"))
        return;
    box bounds = bounds_of(n, v, floe->x, floe->y, floe->yaw);
    const bool long_x = bt_bound_wraps(input->domain.ends) && bounds.x_max - bounds.x_min >= input->domain.length,
               long_y = input->domain.sides == BT_BOUND_PERIODIC && bounds.y_max - bounds.y_min >= input->domain.width;
    if (long_x || long_y)
        bt_errors_add(check->err,
                      "%s: spans more than the period of the domain in %c; use a shorter floe or a larger domain",
                      where, long_x ? 'x' : 'y');
    // A fixed body may stand in a wall, as a pier does.
    if (floe->fixed) bounds = (box){floe->x, floe->x, floe->y, floe->y};
    const char axis = outside(input, bounds, floe->x, floe->y);
    if (axis)
        bt_errors_add(check->err, "%s: is outside the domain in %c, %g to %g m; move it inside", where, axis,
                      axis == 'x' ? bounds.x_min : bounds.y_min, axis == 'x' ? bounds.x_max : bounds.y_max);
}

bt_status bt_case_check(bt_case *input, bt_origin *from, bt_errors *err)
{
    bt_check check = {.c = input, .from = from, .err = err};
    size_t before = err->n;
    bool by_hand = false;
    for (bt_idx i = 0; i < input->n_floes; i++) by_hand = by_hand || isnan(input->floes[i].thickness);
    clear_at_sea(&check, by_hand);
    bt_case_tow_course(&check);
    follow(&check);
    bt_case_tow_follow(&check);
    bt_status loaded = bt_case_read_flow_tables(input, err);
    size_t at_files = err->n;
    check_at_sea(&check, by_hand);
    check_run(&check);
    check_domain(&check);
    check_floes_made(&check);
    double v[2 * BT_MAX_VERTICES];
    int n;
    bool placed = check_body(&check, &n, v);
    bt_case_tow_hull(input, n, v);
    check_tow(&check);
    bt_case_tow_ramp(input);
    bt_case_tow_check(&check);
    bt_case_fill_impact(input); // the reference speed depends on that of the tow
    if (placed) check_path(&check, n, v);
    if (placed && input->domain.ends == BT_BOUND_WALL)
        check_squeeze(&check, "domain.ends_closing", input->domain.ends_closing, input->domain.length, n, v);
    if (placed && input->domain.sides == BT_BOUND_WALL)
        check_squeeze(&check, "domain.sides_closing", input->domain.sides_closing, input->domain.width, n, v);
    bt_case_check_window(&check, n, v);
    bt_case_check_tables(&check);
    bt_case_lead_follow(input, n, v);
    bt_case_check_constraints(&check);
    for (bt_idx i = 0; i < input->n_floes && err->n - before < BT_MAX_COMPLAINTS; i++) check_floe(&check, i);
    if (err->n == before) bt_case_check_cost(&check);
    return err->n == before ? BT_OK : err->n == at_files ? loaded : BT_ERR_CASE;
}

// Corners of squares reach 1.25 times as far as circles of their area, broken ice about as far. The two largest of the
// few floes that a period then holds are on average 1.5 standard deviations above the mean. Of 16 fields each, at a
// spread of 0.2, a period of 100 m refused 1 at 30 m, 13 at 35 m, and all at 40 m; this warns from 31 m on.
#define REACH 1.25
#define LARGEST 1.5

void bt_case_warn_large(const bt_case *input, bt_errors *warnings)
{
    const double period = bt_case_period(input), size = input->ice.size;
    // the limits of a power law are known, and refused
    if (!bt_case_makes_ice(input) || input->ice.size_law == BT_SIZE_POWER ||
        REACH * (1 + LARGEST * input->ice.size_spread) * size < period / 2)
        return;
    bt_warn(warnings, BT_WARN_LARGE_FLOES,
            "ice.size: of floes of %g m the largest may have no room to turn side by side in the period of %g m, and "
            "the run is then refused; use smaller floes or a larger domain",
            size, period);
}

void bt_case_warn_body(const bt_case *input, bt_errors *warnings)
{
    double v[2 * BT_MAX_VERTICES];
    const int n = bt_case_waterline(input, v);
    if (!n) return;
    const double ratio =
        bt_case_body_mass(input) / (input->water.density * bt_shape_area_moments(n, v).area * input->body.draft);
    if (!(ratio >= 1 / BT_ODD_MASS && ratio <= BT_ODD_MASS))
        bt_warn(warnings, BT_WARN_ODD_MASS,
                      "%s: the body has %.3g times the mass of the water that its waterline and draft displace: is a "
                      "unit wrong?",
                      input->body.mass > 0 ? "body.mass" : "body.density", ratio);
    const double least = least_width(n, v);
    const double height = least_gyration2(n, v) / input->body.draft - 0.5 * input->body.sail;
    if (input->body.draft <= BT_ODD_DRAFT * least && height < 0 && input->domain.frame == BT_FRAME_GEOGRAPHIC)
        bt_warn(warnings, BT_WARN_BERG_STABILITY,
                "body.draft: %g m with a sail of %.4g m: a column of ice with this waterline would roll over "
                "(metacentric height %.3g m, least width %.4g m); check them, or expect a berg with a foot",
                input->body.draft, input->body.sail, height, least);
    if (input->body.draft > BT_ODD_DRAFT * least)
        bt_warn(warnings, BT_WARN_ODD_DRAFT,
                "body.draft: %g m is %.3g times the least width of the body, %.4g m, so the body would capsize; check "
                "both, and their units",
                input->body.draft, input->body.draft / least, least);
    if (input->impact.conversion == BT_IMPACT_DURATION && input->impact.duration > BT_LONG_IMPACT * input->run.dt)
        bt_warn(warnings, BT_WARN_LONG_IMPACT,
                      "impact.duration: %g s is %.3g time steps, each about as long as a collision: the peaks of "
                      "collisions come out too low by that factor; is a unit wrong?",
                      input->impact.duration, input->impact.duration / input->run.dt);
}

bt_status bt_case_finish(bt_case *input, bt_errors *err)
{
    BT_PLAIN_NUMBERS;
    return bt_case_check(input, NULL, err);
}
