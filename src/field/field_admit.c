// SPDX-License-Identifier: MIT
// Checks shared by all readers of ice fields: which outlines are accepted, and where floes may lie.
#include "field/field_admit.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "bergtow/outline.h"
#include "field/field_make.h"
#include "base/elementary.h"
#include "geometry/box.h"

void bt_refuse(bt_refusals *refusals, const char *fmt, ...)
{
    refusals->status = BT_ERR_CASE;
    if (refusals->said > BT_MAX_MESSAGES) return;
    char text[640];
    va_list ap;
    va_start(ap, fmt);
    vsnprintf(text, sizeof text, fmt, ap);
    va_end(ap);
    if (refusals->said++ == BT_MAX_MESSAGES)
        bt_errors_add(refusals->err, "%s: more of the same; only the first %d are shown", refusals->path,
                      BT_MAX_MESSAGES);
    else bt_errors_add(refusals->err, "%s: %s", refusals->path, text);
}

// Depth of reflex corners, as a share of the extent, that the rounding of coordinates explains (1e-7 degrees is a
// centimetre). A thousandth is the overlap that the solver tolerates (solver.slop), so shapes need no more accuracy.
// Rejected: a limit from the last digit of the numbers, which an earlier change of coordinates erases.
static const double ROUNDING = 1e-3;

/// Replace the outline by its hull, and count it, if rounding explains the depth of every corner in the hull.
static bool smooth(int *n, double *v, bt_outline_counts *counts)
{
    double hull[2 * BT_MAX_VERTICES], extent = 0, deepest = 0;
    memcpy(hull, v, 2 * (size_t)*n * sizeof *v);
    const int m = bt_shape_hull(*n, hull);
    for (int i = 0; i < *n; i++) {
        double depth = INFINITY; // distance to the nearest edge of the hull
        for (int k = 0; k < m; k++) {
            const double *p = hull + 2 * k, *q = hull + 2 * ((k + 1) % m), ex = q[0] - p[0], ey = q[1] - p[1];
            depth = bt_min(depth, (ex * (v[2 * i + 1] - p[1]) - ey * (v[2 * i] - p[0])) / bt_hypot(ex, ey));
            extent = bt_max(extent, bt_hypot(hull[2 * k] - v[2 * i], hull[2 * k + 1] - v[2 * i + 1]));
        }
        deepest = bt_max(deepest, depth);
    }
    if (!(deepest <= ROUNDING * extent)) return false;
    counts->rounded++;
    counts->rounded_corners += *n - m;
    counts->rounded_area += 0.5 * (bt_outline_area2(m, hull) - bt_outline_area2(*n, v));
    memcpy(v, hull, 2 * (size_t)m * sizeof *v);
    *n = m;
    return true;
}

const char *bt_outline_admit(bt_nonconvex nonconvex, int *n, double *v, bt_outline_counts *counts)
{
    // Making a hull only needs an outline that does not cross itself. The hull may have few enough vertices even if the
    // outline has too many.
    const bool many = *n > BT_MAX_VERTICES && nonconvex == BT_NONCONVEX_HULL;
    const char *fault = !many                       ? bt_outline_fault(*n, v)
                        : bt_outline_crosses(*n, v) ? "its edges cross or touch each other"
                                                    : NULL;
    if (fault) return fault;
    if (!many && bt_outline_convex(*n, v)) return NULL;
    if (!many && smooth(n, v, counts)) return bt_shape_fault(*n, v);
    switch (nonconvex) {
    case BT_NONCONVEX_REFUSE: return "it is not convex; set ice.nonconvex to hull or split, or correct it";
    case BT_NONCONVEX_HULL: {
        const double before = 0.5 * bt_outline_area2(*n, v);
        *n = bt_shape_hull(*n, v);
        if ((fault = bt_shape_fault(*n, v))) return fault;
        counts->hulled++;
        counts->hull_area += 0.5 * bt_outline_area2(*n, v) - before;
        return NULL;
    }
    case BT_NONCONVEX_SPLIT: {
        bt_parts parts;
        if (!bt_outline_split(*n, v, &parts)) return BT_NO_PARTS;
        counts->split++;
        counts->parts += parts.n;
        return NULL;
    }
    }
    return NULL;
}

// --- places ----------------------------------------------------------------------------------------------------------

typedef struct place {
    const bt_field *f;
    const double *outline; ///< turned by the yaw, relative to the centroid
    bt_parts **parts;      ///< [n] of floes that are not convex; NULL otherwise
    double allowed;        ///< overlap left to the position projection, m
    const char *noun;
    bool map;              ///< of ice.outlines
    bt_refusals *r;
    int64_t overlapping;   ///< pairs that overlap by more than that
    double deepest;        ///< their deepest overlap, m
} place;

/// One convex piece of a floe.
typedef struct piece { int n; double v[2 * BT_MAX_VERTICES]; } piece;

static int n_pieces(const place *where, bt_idx i) { return where->parts[i] ? where->parts[i]->n : 1; }

static void take_piece(const place *where, bt_idx i, int k, piece *out)
{
    const int64_t first = where->f->offsets[i];
    const bt_parts *parts = where->parts[i];
    int from = 0;
    for (int j = 0; parts && j < k; j++) from += parts->count[j];
    out->n = parts ? parts->count[k] : (int)(where->f->offsets[i + 1] - first);
    for (int j = 0; j < out->n; j++) {
        const int64_t at = first + (parts ? parts->corner[from + j] : j);
        out->v[2 * j] = where->outline[2 * at];
        out->v[2 * j + 1] = where->outline[2 * at + 1];
    }
}

/// Depth of floe i in a convex body b, (dx, dy) from the centroid of i to the origin of b.
static double depth_in(const place *where, bt_idx i, int nb, const double *b, double dx, double dy)
{
    double deepest = 0;
    for (int k = 0; k < n_pieces(where, i); k++) {
        piece a;
        take_piece(where, i, k, &a);
        deepest = bt_max(deepest, -bt_apart_of(a.n, a.v, nb, b, dx, dy).gap);
    }
    return deepest;
}

static void visit(void *context, bt_idx i, bt_idx j, double dx, double dy)
{
    place *where = context;
    double deepest = 0;
    for (int k = 0; k < n_pieces(where, j); k++) {
        piece b;
        take_piece(where, j, k, &b);
        deepest = bt_max(deepest, depth_in(where, i, b.n, b.v, dx, dy));
    }
    if (!(deepest > where->allowed)) return;
    where->overlapping++;
    where->deepest = bt_max(where->deepest, deepest);
    bt_refuse(where->r, "%s %d and %s %d overlap by %.3g m (allowed: %.3g m); move or shrink one of them%s%s",
              where->noun, (int)(i < j ? i : j), where->noun, (int)(i < j ? j : i), deepest, where->allowed,
              where->map ? ", or let bergtow outlines cut the file, as floes that raft" : "",
              where->f->outlines.hulled ? ", or set ice.nonconvex: split if only their hulls overlap" : "");
}

static void check_bounds(const bt_case *input, const place *where, bt_idx i)
{
    const bt_field *field = where->f;
    const double x = field->pose[3 * i], y = field->pose[3 * i + 1],
                 slack = 1e-9 * (input->domain.length + input->domain.width);
    const double x1 = input->domain.x0 + input->domain.length, y1 = input->domain.y0 + input->domain.width;
    double low[2] = {x, y}, high[2] = {x, y}; // walls bound the whole outline, other boundaries the centroid
    for (int64_t k = field->offsets[i]; k < field->offsets[i + 1]; k++)
        for (int a = 0; a < 2; a++) {
            if ((a ? input->domain.sides : input->domain.ends) != BT_BOUND_WALL) continue;
            const double q = (a ? y : x) + where->outline[2 * k + a];
            low[a] = bt_min(low[a], q), high[a] = bt_max(high[a], q);
        }
    if (low[0] < input->domain.x0 - slack || high[0] > x1 + slack)
        bt_refuse(where->r,
                  "%s %d, x %g to %g m, is outside the domain, %g to %g m; remove it, move the outlines, or enlarge "
                  "the domain",
                  where->noun, (int)i, low[0], high[0], input->domain.x0, x1);
    else if (low[1] < input->domain.y0 - slack || high[1] > y1 + slack)
        bt_refuse(where->r,
                  "%s %d, y %g to %g m, is outside the domain, %g to %g m; remove it, move the outlines, or enlarge "
                  "the domain",
                  where->noun, (int)i, low[1], high[1], input->domain.y0, y1);
}

/// Prepare `where` and `region`, the whole domain, for checks of pairs of floes.
static void begin_places(place *where, bt_region *region, const bt_case *input, const bt_field *field)
{
    bt_region_of_domain(region, input);
    where->allowed = bt_max(input->solver.slop, 1e-9) * bt_field_mean_size(field);
    where->parts = bt_alloc((size_t)field->n, sizeof *where->parts);
    for (bt_idx i = 0; i < field->n; i++) {
        const int n = (int)(field->offsets[i + 1] - field->offsets[i]);
        const double *v = field->vertices + 2 * field->offsets[i];
        if (bt_outline_convex(n, v)) continue;
        where->parts[i] = bt_alloc(1, sizeof *where->parts[i]);
        bt_outline_split(n, v, where->parts[i]);
    }
}

static void check_pairs(place *where, const bt_region *region)
{
    bt_field_visit_pairs(region, where->f, where->outline, 1, visit, where);
    if (where->overlapping <= 1) return;
    // A summary, however many pairs have been reported one by one.
    bt_errors_add(where->r->err, "%s: %lld pairs of %ss overlap, by %.3g m at most", where->r->path,
                  (long long)where->overlapping, where->noun, where->deepest);
}

/// Refuse floes that overlap the towed body or a floe given by hand.
static void check_obstacles(const place *where, const bt_region *region)
{
    const bt_field *field = where->f;
    for (bt_idx i = 0; i < field->n; i++) {
        double x = field->pose[3 * i], z = field->pose[3 * i + 1], radius = 0;
        for (int64_t k = field->offsets[i]; k < field->offsets[i + 1]; k++)
            radius = bt_max(radius, bt_hypot(where->outline[2 * k], where->outline[2 * k + 1]));
        bt_region_wrap(region, &x, &z);
        for (int o = 0; o < region->n_obstacles; o++) {
            const bt_obstacle *obstacle = &region->obstacles[o];
            if (bt_hypot(obstacle->x - x, obstacle->y - z) >= radius + obstacle->radius) continue;
            piece rel = {.n = obstacle->n};
            for (int k = 0; k < obstacle->n; k++) rel.v[2 * k] = obstacle->v[2 * k] - obstacle->x,
                     rel.v[2 * k + 1] = obstacle->v[2 * k + 1] - obstacle->y;
            const double depth = depth_in(where, i, rel.n, rel.v, obstacle->x - x, obstacle->y - z);
            if (depth > where->allowed)
                bt_refuse(where->r,
                          "%s %d lies %.3g m deep in the towed body or a floe given by hand (allowed: %.3g m); remove "
                          "it, or move the body",
                          where->noun, (int)i, depth, where->allowed);
        }
    }
}

static void check_places(const bt_case *input, const bt_field *field, const char *noun, bool obstacles,
                         bt_refusals *refusals)
{
    double *outline = bt_field_outlines(field);
    place where = {.f = field, .outline = outline, .noun = noun, .map = input->ice.outlines, .r = refusals};
    bt_region region;
    for (bt_idx i = 0; i < field->n; i++) check_bounds(input, &where, i);
    begin_places(&where, &region, input, field);
    check_pairs(&where, &region);
    if (obstacles) check_obstacles(&where, &region);
    for (bt_idx i = 0; i < field->n; i++) free(where.parts[i]);
    free(where.parts);
    free(outline);
    bt_region_free(&region);
}

void bt_field_check_apart(const bt_case *input, const bt_field *field, const char *noun, bt_refusals *refusals)
{
    check_places(input, field, noun, false, refusals);
}

void bt_field_check_places(const bt_case *input, const bt_field *field, const char *noun, bt_refusals *refusals)
{
    check_places(input, field, noun, true, refusals);
}
