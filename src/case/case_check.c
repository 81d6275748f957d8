// SPDX-License-Identifier: MIT
// Defaults that follow from other keys, and checks across keys.
//
// A check names the keys it looks at; when one of them was refused already, it is left out: its message would be about
// the default that stands in for the refused value.
#include "case/case_check.h"
#include "case/case_tow.h"
#include "case/warning.h"

#include "bergtow/shape.h"
#include "base/fileio.h"
#include "case/constraints.h"
#include "case/cost.h"
#include "case/ice_bounds.h"
#include "base/elementary.h"
#include "base/largest.h"
#include "case/schema.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

typedef bt_check check;

typedef struct {
    double x_min, x_max, y_min, y_max;
} box;

// Bounds of an outline at a pose.
static box bounds_of(int n, const double *v, double x, double y, double yaw)
{
    box b = {INFINITY, -INFINITY, INFINITY, -INFINITY};
    double cosine = bt_cos(yaw), sine = bt_sin(yaw);
    for (int i = 0; i < n; i++) {
        double px = x + cosine * v[2 * i] - sine * v[2 * i + 1], py = y + sine * v[2 * i] + cosine * v[2 * i + 1];
        b.x_min = bt_min(b.x_min, px), b.x_max = bt_max(b.x_max, px);
        b.y_min = bt_min(b.y_min, py), b.y_max = bt_max(b.y_max, py);
    }
    return b;
}

// Where a body stands against the boundaries: the axis in which it is outside, or 0. Walls hold the whole outline, open
// and periodic boundaries the centroid. The slack is round-off of x0 + length.
static char outside(const bt_case *c, box b, double x, double y)
{
    double slack = 1e-9 * (c->domain.length + c->domain.width);
    bool ends = c->domain.ends == BT_BOUND_WALL, sides = c->domain.sides == BT_BOUND_WALL;
    if ((ends ? b.x_min : x) < c->domain.x0 - slack || (ends ? b.x_max : x) > c->domain.x0 + c->domain.length + slack)
        return 'x';
    if ((sides ? b.y_min : y) < c->domain.y0 - slack || (sides ? b.y_max : y) > c->domain.y0 + c->domain.width + slack)
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

/// Files that the case names, as absolute paths: the resolved file lies elsewhere.
static void follow_files(const check *k)
{
    for (int i = 0; i < bt_n_case_keys; i++) {
        if (!bt_case_keys[i].file) continue;
        char **file = (char **)((char *)k->c + bt_case_keys[i].offset);
        char *absolute = *file ? bt_case_named_file(bt_check_file(k, bt_case_keys[i].name), *file) : NULL;
        if (!absolute) continue;
        free(*file);
        *file = absolute;
    }
}

/// A velocity of which nothing is given stays open where the body drifts freely at the start; otherwise what is not
/// given is 0.
static void follow_start(bool drifts, double *vx, double *vy)
{
    if (drifts && isnan(*vx) && isnan(*vy)) return;
    bt_check_fill(vx, 0);
    bt_check_fill(vy, 0);
}

static void follow(const check *k)
{
    bt_case *c = k->c;
    bt_case_fill_scene(c);
    const bool drift = c->ice.start == BT_START_DRIFT;
    follow_start(drift && c->tow.mode == BT_TOW_NONE && c->body.shape != BT_BODY_ABSENT, &c->body.vx, &c->body.vy);
    for (bt_idx i = 0; i < c->n_floes; i++) {
        bt_floe_def *f = &c->floes[i];
        bt_check_fill(&f->width, f->length);
        bt_check_fill(&f->thickness, c->ice.thickness);
        follow_start(drift && !f->fixed, &f->vx, &f->vy);
    }
    bt_case_fill_size(c);
    if (c->output.frame_interval == 0 && c->run.duration > 0) c->output.frame_interval = c->run.duration / 200;
    follow_files(k);
}

// ---- defaults of the frames ----

// Defaults that the frame of a case decides on.
//
// A row of the table of keys says with at_sea that its default is a model basin's. In the geographic frame such a
// number would look like an answer: there it is none until the case gives it, or another key does (a programme the
// speed, a named line its stiffness). Where it is then still none and has an effect, the case is refused. Other
// defaults hold in both frames, or follow from the scene in the geographic one (case_fill.c, case_tow.c).

static double *number(bt_case *c, const bt_key *k) { return (double *)(void *)((char *)c + k->offset); }

static bool is_basin(const bt_case *c) { return c->domain.frame == BT_FRAME_BASIN; }

/// May the run use the value of this key?
static bool is_used(const bt_case *c, const char *key, bool by_hand)
{
    if (bt_case_is_unused(c, key)) return false;
    if (!strcmp(key, "ice.thickness")) return bt_case_makes_ice(c) || by_hand || c->ice.outlines;
    if (!strcmp(key, "tow.speed")) return c->body.shape != BT_BODY_ABSENT && c->tow.mode != BT_TOW_NONE;
    return true;
}

/// Numbers that nobody gave, that have an effect, and whose default is a model basin's, become NaN. by_hand: there are
/// floes of the list without a thickness of their own.
static void clear_at_sea(const bt_check *k, bool by_hand)
{
    if (!k->from || is_basin(k->c)) return;
    for (int i = 0; i < bt_n_case_keys; i++) {
        const bt_key *row = &bt_case_keys[i];
        if (!row->at_sea || row->type != BT_KEY_REAL || bt_check_given(k, row->name)) continue;
        if (is_used(k->c, row->name, by_hand)) *number(k->c, row) = NAN;
    }
}

static bool is_missing(const bt_check *k, const bt_key *row)
{
    if (row->type == BT_KEY_REAL) return isnan(*number(k->c, row));
    return k->from && !is_basin(k->c) && !bt_check_given(k, row->name);
}

/// geojson.c asks for a thickness where outlines lack one.
static bool may_miss(const bt_case *c, const char *key, bool by_hand)
{
    return !strcmp(key, "ice.thickness") && c->ice.outlines && !by_hand;
}

/// Refuse a case that lacks such a value once others have followed from what it gives. ice.thickness beside outlines
/// may stay NaN: the file says whether it is needed.
static void check_at_sea(const bt_check *k, bool by_hand)
{
    bt_case *c = k->c;
    if (!bt_check_sound(k, "domain.frame")) return;
    for (int i = 0; i < bt_n_case_keys; i++) {
        const bt_key *row = &bt_case_keys[i];
        if (!row->at_sea || !bt_check_sound(k, row->name) || !is_missing(k, row)) continue;
        if (!is_used(c, row->name, by_hand)) { // a number without effect that is given as none
            bt_schema_preset(row, row->type == BT_KEY_REAL, c);
            continue;
        }
        if (may_miss(c, row->name, by_hand)) continue;
        if (is_basin(c)) bt_check_fault(k, row->name, "is none where a value is needed; give it (%s)", row->at_sea);
        else
            bt_check_fault(k, row->name,
                           "missing, and in domain.frame: geographic it has no default (that would be a model "
                           "basin's); add it (%s)",
                           row->at_sea);
        if (k->from) k->from[i].faulty = true;
    }
}

// ---- checks ----

static void check_run(const check *k)
{
    const bt_case *c = k->c;
    if (!bt_check_sound(k, "run.dt run.duration")) return;
    if (!(c->run.dt > 0) || !(c->run.duration > 0)) return;
    double steps = (double)bt_case_steps(c);
    if (steps > BT_MOST_STEPS)
        bt_check_fault(k, "run.dt",
                       "makes %.3g steps of run.duration, at most %d are run; lengthen the step or shorten the run",
                       steps, BT_MOST_STEPS);
    if (bt_check_sound(k, "output.frame_interval") && c->run.duration / c->output.frame_interval > BT_MOST_FRAMES)
        bt_check_fault(k, "output.frame_interval", "makes %.3g frames, at most %d are written; lengthen it",
                       c->run.duration / c->output.frame_interval, BT_MOST_FRAMES);
}

static void check_closing(const check *k, const char *key, const char *boundary_key, double closing, bt_bound boundary,
                          double extent)
{
    if (closing == 0 || boundary != BT_BOUND_WALL || !bt_check_sound(k, key) || !bt_check_sound(k, boundary_key))
        return;
    if (bt_check_sound(k, "run.duration domain.length domain.width") && 2 * closing * k->c->run.duration >= extent)
        bt_check_fault(
            k, key,
            "%g m/s brings the walls together after %g s, before the end of the run; slow them or shorten run.duration",
            closing, extent / (2 * closing));
}

static void check_domain(const check *k)
{
    const bt_case *c = k->c;
    check_closing(k, "domain.ends_closing", "domain.ends", c->domain.ends_closing, c->domain.ends, c->domain.length);
    check_closing(k, "domain.sides_closing", "domain.sides", c->domain.sides_closing, c->domain.sides, c->domain.width);
}

/// Reported elsewhere: sizes in the wrong order, a region without room.
static void check_floes_made(const check *k)
{
    const bt_case *c = k->c;
    const bool power = c->ice.size_law == BT_SIZE_POWER;
    const bool sized = power ? c->ice.size_min > 0 && c->ice.size_min < c->ice.size_max : c->ice.size > 0;
    if (!bt_case_makes_ice(c) || !sized || c->ice.x_min >= c->ice.x_max || c->ice.y_min >= c->ice.y_max ||
        !bt_check_sound(k, "ice.concentration ice.size ice.size_law ice.size_min ice.size_max ice.size_exponent "
                           "ice.size_spread ice.x_min ice.x_max ice.y_min ice.y_max domain.x0 domain.y0 domain.length "
                           "domain.width"))
        return;
    const double n = bt_case_floes_made(c);
    if (n > BT_MOST_FLOES)
        bt_check_fault(k, power ? "ice.size_min" : "ice.size",
                       "makes about %.3g floes, at most %d are simulated; take larger floes or a smaller region", n,
                       BT_MOST_FLOES);
}

static bool check_body(const check *k, int *n, double *v)
{
    const bt_case *c = k->c;
    *n = 0;
    if (c->body.shape == BT_BODY_ABSENT ||
        !bt_check_sound(k, "body.shape body.length body.width body.vertices body.x body.y body.yaw"))
        return false;
    if (c->body.shape == BT_BODY_POLYGON && !c->body.n_vertices) return false;
    const char *why = NULL;
    *n = bt_case_outline(c->body.shape, c->body.length, c->body.width, c->body.n_vertices, c->body.vertices, v, &why);
    if (why) {
        bt_check_fault(k, c->body.shape == BT_BODY_POLYGON ? "body.vertices" : "body.length",
                       "the waterline is refused: %s", why);
        return false;
    }
    if (!bt_check_sound(k, "domain.frame domain.x0 domain.y0 domain.length domain.width domain.ends domain.sides"))
        return false;
    box b = bounds_of(*n, v, c->body.x, c->body.y, c->body.yaw);
    const char *extent = c->body.shape == BT_BODY_POLYGON ? "body.vertices" : "body.length";
    const bool too_long = b.x_max - b.x_min >= c->domain.length, too_wide = b.y_max - b.y_min >= c->domain.width;
    if (too_long)
        bt_check_fault(k, extent,
                       "the body spans %g m along x in a domain of %g m; take a smaller body or a larger domain.length",
                       b.x_max - b.x_min, c->domain.length);
    if (too_wide)
        bt_check_fault(k, extent,
                       "the body spans %g m along y in a domain of %g m; take a smaller body or a larger domain.width",
                       b.y_max - b.y_min, c->domain.width);
    if (too_long || too_wide) return false;
    char axis = outside(c, b, c->body.x, c->body.y);
    if (axis == 'x')
        bt_check_fault(k, "body.x", "the body, %g to %g m, is outside the domain, %g to %g m; move it inside", b.x_min,
                       b.x_max, c->domain.x0, c->domain.x0 + c->domain.length);
    if (axis == 'y')
        bt_check_fault(k, "body.y", "the body, %g to %g m, is outside the domain, %g to %g m; move it inside", b.y_min,
                       b.y_max, c->domain.y0, c->domain.y0 + c->domain.width);
    return !axis;
}

static void check_tow(const check *k)
{
    bt_case *c = k->c;
    if (!bt_check_sound(k, "tow.mode tow.speed body.shape")) return;
    if (c->body.shape == BT_BODY_ABSENT && c->tow.mode != BT_TOW_NONE) {
        if (bt_check_given(k, "tow.mode"))
            bt_check_fault(k, "tow.mode",
                           "there is no body to tow (body.shape: none); set tow.mode: none or give a body");
        else c->tow.mode = BT_TOW_NONE;
    }
    if (c->tow.mode == BT_TOW_NONE && c->tow.speed != 0) {
        if (bt_check_given(k, "tow.speed") && bt_check_given(k, "tow.mode"))
            bt_check_fault(k, "tow.speed",
                           "%g m/s has no effect with tow.mode: none; set it to 0, or set tow.mode: speed",
                           c->tow.speed);
        else c->tow.speed = 0;
    }
}

/// Way of the tow after which the body meets a wall, `room` ahead of it at the start, that comes with this speed;
/// INFINITY: not within the run. towards: cosine of the angle between the course and the way to the wall.
static double way_to_wall(const bt_case *c, double room, double towards, double closing)
{
    const double end = c->run.duration, slack = 1e-9 * (c->domain.length + c->domain.width);
    if (!(towards > 0) || towards * bt_case_tow_led(c, end) + closing * end <= room + slack) return INFINITY;
    if (closing == 0) return bt_max(0, room / towards);
    int64_t early = 0, late = bt_case_steps(c);
    while (late - early > 1) {
        const int64_t middle = early + (late - early) / 2;
        const double time = (double)middle * c->run.dt;
        if (towards * bt_case_tow_led(c, time) + closing * time <= room) early = middle;
        else late = middle;
    }
    return bt_case_tow_led(c, (double)early * c->run.dt);
}

// A body of prescribed velocity goes through a wall: two infinite masses have no contact law.
static void check_path(const check *k, int n, const double *v)
{
    const bt_case *c = k->c;
    // On a line the body follows the end, on the average at its speed, and would end up drawn against the wall. A
    // vessel may be slower. way-points: case_tow.c
    const bool straight = c->tow.mode != BT_TOW_NONE && c->tow.mode != BT_TOW_THRUST && c->tow.n_waypoints == 0;
    if (!straight || !(c->run.duration > 0) ||
        !bt_check_sound(k, "run.dt run.duration tow.mode tow.speed tow.direction tow.ramp tow.programme "
                           "domain.ends_closing domain.sides_closing"))
        return;
    double way = bt_case_tow_led(c, c->run.duration), ux = bt_cos(c->tow.direction), uy = bt_sin(c->tow.direction);
    const box b = bounds_of(n, v, c->body.x, c->body.y, c->body.yaw);
    double reach = INFINITY;
    if (c->domain.ends == BT_BOUND_WALL) {
        reach = bt_min(reach, way_to_wall(c, c->domain.x0 + c->domain.length - b.x_max, ux, c->domain.ends_closing));
        reach = bt_min(reach, way_to_wall(c, b.x_min - c->domain.x0, -ux, c->domain.ends_closing));
    }
    if (c->domain.sides == BT_BOUND_WALL) {
        reach = bt_min(reach, way_to_wall(c, c->domain.y0 + c->domain.width - b.y_max, uy, c->domain.sides_closing));
        reach = bt_min(reach, way_to_wall(c, b.y_min - c->domain.y0, -uy, c->domain.sides_closing));
    }
    if (isinf(reach)) return;
    const double time = bt_case_tow_last(c, reach);
    bt_check_fault(k, "run.duration",
                   "the tow is %g m long and a wall stands after %g m; shorten the run to %g s, or slow the tow, or "
                   "enlarge the domain",
                   way, reach, time);
}

/// Least distance between two parallel lines that enclose the outline: one of them lies along an edge of its hull.
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
    double area = 0, xx = 0, yy = 0, xy = 0; // twice, and 12, 12 and 24 times, the integrals of 1, x², y² and x y
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

/// Walls that close on the body: however it turns, it needs its least width. Between open ends it may be towed away,
/// and guard.overlap: 0 lets bodies into each other.
static void check_squeeze(const check *k, const char *key, double closing, double extent, int n, const double *v)
{
    const bt_case *c = k->c;
    const bool open = c->domain.ends == BT_BOUND_OPEN || c->domain.sides == BT_BOUND_OPEN;
    if (closing == 0 || open || c->guard.overlap == 0 || !bt_check_sound(k, key) ||
        !bt_check_sound(k, "run.dt run.duration domain.length domain.width domain.ends domain.sides"))
        return;
    const double left = extent - 2 * closing * c->run.duration, needed = least_width(n, v);
    if (left > 0 && left < needed * (1 - 1e-9)) // 0: check_closing
        bt_check_fault(k, key,
                       "%g m/s leaves %g m between the walls at the end of the run, and the body is %g m wide where it "
                       "is narrowest; slow them, or end the run after %.10g s",
                       closing, left, needed, floor((extent - needed) / (2 * closing * c->run.dt)) * c->run.dt);
}

static void check_floe(const check *k, int index)
{
    const bt_case *c = k->c;
    const bt_floe_def *f = &c->floes[index];
    char where[256];
    const char *file = c->floes_path ? c->floes_path : c->path;
    if (f->line > 0) snprintf(where, sizeof where, "%.180s:%d: floes[%d]", file ? file : "case", f->line, index);
    else snprintf(where, sizeof where, "%.180s: floes[%d]", c->path ? c->path : "case", index);
    bool polygon = f->shape == BT_BODY_POLYGON;
    const size_t before = k->err->n;
    if (polygon && !f->n_vertices)
        bt_errors_add(k->err, "%s: has shape polygon and no vertices; give them as [[x, y], [x, y], ...]", where);
    if (!polygon && f->n_vertices)
        bt_errors_add(
            k->err, "%s: has vertices but the shape is not polygon; set shape: polygon, or remove the vertices", where);
    else if (!polygon && !(f->length > 0)) bt_errors_add(k->err, "%s: has no length; give it, as in 1 m", where);
    if (k->err->n > before) return;
    double v[2 * BT_MAX_VERTICES];
    const char *why = NULL;
    int n = bt_case_floe_admit(f, v, &why);
    if (why) {
        bt_errors_add(k->err, "%s: the outline is refused: %s", where, why);
        return;
    }
    if (isnan(f->thickness)) return; // that of the ice, which is asked for
    char text[BT_ICE_WHY];
    const bt_moments m = bt_shape_moments(n, v);
    const bt_ice_floe given = {n, v, f->x, f->y, f->yaw, f->thickness, NAN, 0};
    why = sqrt(4 * m.area / BT_PI) < BT_LEAST_SIZE ? "it is less than a millimetre in size; check the unit"
                                                   : bt_ice_floe_fault(&given, text, NULL);
    if (why) {
        bt_errors_add(k->err, "%s: %s", where, why);
        return;
    }
    if (!bt_check_sound(k, "domain.frame domain.x0 domain.y0 domain.length domain.width domain.ends domain.sides"))
        return;
    box b = bounds_of(n, v, f->x, f->y, f->yaw);
    const bool long_x = bt_bound_wraps(c->domain.ends) && b.x_max - b.x_min >= c->domain.length,
               long_y = c->domain.sides == BT_BOUND_PERIODIC && b.y_max - b.y_min >= c->domain.width;
    if (long_x || long_y)
        bt_errors_add(k->err,
                      "%s: spans more than the period of the domain in %c; take a shorter floe or a larger domain",
                      where, long_x ? 'x' : 'y');
    // A fixed body may stand in a wall, as a pier does.
    if (f->fixed) b = (box){f->x, f->x, f->y, f->y};
    const char axis = outside(c, b, f->x, f->y);
    if (axis)
        bt_errors_add(k->err, "%s: is outside the domain in %c, %g to %g m; move it inside", where, axis,
                      axis == 'x' ? b.x_min : b.y_min, axis == 'x' ? b.x_max : b.y_max);
}

bt_status bt_case_check(bt_case *c, bt_origin *from, bt_errors *err)
{
    check k = {.c = c, .from = from, .err = err};
    size_t before = err->n;
    bool by_hand = false;
    for (bt_idx i = 0; i < c->n_floes; i++) by_hand = by_hand || isnan(c->floes[i].thickness);
    clear_at_sea(&k, by_hand);
    bt_case_tow_course(&k);
    follow(&k);
    bt_case_tow_follow(&k);
    bt_status loaded = bt_case_read_flow_tables(c, err);
    size_t at_files = err->n;
    check_at_sea(&k, by_hand);
    check_run(&k);
    check_domain(&k);
    check_floes_made(&k);
    double v[2 * BT_MAX_VERTICES];
    int n;
    bool placed = check_body(&k, &n, v);
    bt_case_tow_hull(c, n, v);
    check_tow(&k);
    bt_case_tow_ramp(c);
    bt_case_tow_check(&k);
    bt_case_fill_impact(c); // the reference speed goes by that of the tow
    if (placed) check_path(&k, n, v);
    if (placed && c->domain.ends == BT_BOUND_WALL)
        check_squeeze(&k, "domain.ends_closing", c->domain.ends_closing, c->domain.length, n, v);
    if (placed && c->domain.sides == BT_BOUND_WALL)
        check_squeeze(&k, "domain.sides_closing", c->domain.sides_closing, c->domain.width, n, v);
    bt_case_check_window(&k, n, v);
    bt_case_check_tables(&k);
    bt_case_lead_follow(c, n, v);
    bt_case_check_constraints(&k);
    for (bt_idx i = 0; i < c->n_floes && err->n - before < BT_MOST_COMPLAINTS; i++) check_floe(&k, i);
    if (err->n == before) bt_case_check_cost(&k);
    return err->n == before ? BT_OK : err->n == at_files ? loaded : BT_ERR_CASE;
}

void bt_case_warn_body(const bt_case *c, bt_errors *warnings)
{
    double v[2 * BT_MAX_VERTICES];
    const int n = bt_case_waterline(c, v);
    if (!n) return;
    const double ratio =
        bt_case_body_mass(c) / (c->water.density * bt_shape_extent(n, v).area * c->body.draft);
    if (!(ratio >= 1 / BT_ODD_MASS && ratio <= BT_ODD_MASS))
        bt_warn(warnings, BT_WARN_ODD_MASS,
                      "%s: the body has %.3g times the mass of the water that its waterline and draft displace: is a "
                      "unit wrong?",
                      c->body.mass > 0 ? "body.mass" : "body.density", ratio);
    const double least = least_width(n, v);
    const double height = least_gyration2(n, v) / c->body.draft - 0.5 * c->body.sail;
    if (c->body.draft <= BT_ODD_DRAFT * least && height < 0 && c->domain.frame == BT_FRAME_GEOGRAPHIC)
        bt_warn(warnings, BT_WARN_BERG_STABILITY,
                "body.draft: %g m and a sail of %.4g m: a column of ice with this waterline would roll over, its "
                "metacentric height is %.3g m, at a least width of %.4g m; check them, or expect a berg with a foot",
                c->body.draft, c->body.sail, height, least);
    if (c->body.draft > BT_ODD_DRAFT * least)
        bt_warn(warnings, BT_WARN_ODD_DRAFT,
                "body.draft: %g m is %.3g times the least width of the body, %.4g m, which would capsize; check both, "
                "and their units",
                c->body.draft, c->body.draft / least, least);
    if (c->impact.conversion == BT_IMPACT_DURATION && c->impact.duration > BT_LONG_IMPACT * c->run.dt)
        bt_warn(warnings, BT_WARN_LONG_IMPACT,
                      "impact.duration: %g s is %.3g time steps, of which each is about as long as a collision; the "
                      "peaks of collisions are as much too low as that is too long: is a unit wrong?",
                      c->impact.duration, c->impact.duration / c->run.dt);
}

bt_status bt_case_finish(bt_case *c, bt_errors *err) { return bt_case_check(c, NULL, err); }
