// SPDX-License-Identifier: MIT
// What all readers of ice fields share: which outlines get in, and whether they lie where they can.
#include "field/field_admit.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "bergtow/outline.h"
#include "field/field_make.h"
#include "case/ice_bounds.h"
#include "field/map_crs.h"
#include "base/elementary.h"

void bt_refuse(bt_refusals *r, const char *fmt, ...)
{
    r->status = BT_ERR_CASE;
    if (r->said > BT_MOST_MESSAGES) return;
    char text[640];
    va_list ap;
    va_start(ap, fmt);
    vsnprintf(text, sizeof text, fmt, ap);
    va_end(ap);
    if (r->said++ == BT_MOST_MESSAGES)
        bt_errors_add(r->err, "%s: more of the same; only the first %d are shown", r->path, BT_MOST_MESSAGES);
    else bt_errors_add(r->err, "%s: %s", r->path, text);
}

// Corners that coordinates of so many digits cannot tell from convex ones: 1e-7 degrees are a centimetre. A thousandth
// of the extent, the overlap that the solver leaves alone (solver.slop), is also what the shape of a floe is known to.
// Rejected: the last digit of the numbers as the measure, which a change of coordinates before takes away.
static const double ROUNDING = 1e-3;

/// The hull, if no corner lies deeper in it than rounding; counted.
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
    // A hull needs no more of the outline than that it goes once round an area; it may have fewer vertices than the
    // outline.
    const bool many = *n > BT_MAX_VERTICES && nonconvex == BT_NONCONVEX_HULL;
    const char *fault = !many                       ? bt_outline_fault(*n, v)
                        : bt_outline_crosses(*n, v) ? "its edges cross or touch each other"
                                                    : NULL;
    if (fault) return fault;
    if (!many && bt_outline_convex(*n, v)) return NULL;
    if (!many && smooth(n, v, counts)) return bt_shape_fault(*n, v);
    switch (nonconvex) {
    case BT_NONCONVEX_REFUSE: return "it is not convex; set ice.nonconvex to hull or split, or mend it";
    case BT_NONCONVEX_HULL: {
        const double before = 0.5 * bt_outline_area2(*n, v);
        *n = bt_shape_hull(*n, v);
        if ((fault = bt_shape_fault(*n, v))) return fault;
        counts->hulled++;
        counts->hull_area += 0.5 * bt_outline_area2(*n, v) - before;
        return NULL;
    }
    case BT_NONCONVEX_SPLIT: {
        bt_parts p;
        if (!bt_outline_split(*n, v, &p))
            return "it cannot be cut into convex parts: edges almost touch; move its vertices apart, or simplify it";
        counts->split++;
        counts->parts += p.n;
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
    double allowed;        ///< overlap that is left to the position projection, m
    const char *noun;
    bt_refusals *r;
    int64_t overlapping;   ///< pairs that overlap by more
    double deepest;        ///< of them, m
} place;

/// One convex piece of a floe.
typedef struct piece { int n; double v[2 * BT_MAX_VERTICES]; } piece;

static int n_pieces(const place *p, bt_idx i) { return p->parts[i] ? p->parts[i]->n : 1; }

static void take_piece(const place *p, bt_idx i, int k, piece *out)
{
    const int64_t first = p->f->offsets[i];
    const bt_parts *parts = p->parts[i];
    int from = 0;
    for (int j = 0; parts && j < k; j++) from += parts->count[j];
    out->n = parts ? parts->count[k] : (int)(p->f->offsets[i + 1] - first);
    for (int j = 0; j < out->n; j++) {
        const int64_t at = first + (parts ? parts->corner[from + j] : j);
        out->v[2 * j] = p->outline[2 * at];
        out->v[2 * j + 1] = p->outline[2 * at + 1];
    }
}

/// Depth of floe i in a convex body b, (dx, dy) from the centroid of i to the origin of b.
static double depth_in(const place *p, bt_idx i, int nb, const double *b, double dx, double dy)
{
    double deepest = 0;
    for (int k = 0; k < n_pieces(p, i); k++) {
        piece a;
        take_piece(p, i, k, &a);
        deepest = bt_max(deepest, -bt_apart_of(a.n, a.v, nb, b, dx, dy).gap);
    }
    return deepest;
}

static void visit(void *context, bt_idx i, bt_idx j, double dx, double dy)
{
    place *p = context;
    double deepest = 0;
    for (int k = 0; k < n_pieces(p, j); k++) {
        piece b;
        take_piece(p, j, k, &b);
        deepest = bt_max(deepest, depth_in(p, i, b.n, b.v, dx, dy));
    }
    if (!(deepest > p->allowed)) return;
    p->overlapping++;
    p->deepest = bt_max(p->deepest, deepest);
    bt_refuse(p->r, "%s %d and %s %d overlap by %.3g m (allowed: %.3g m); move or shrink one of them%s", p->noun,
              (int)(i < j ? i : j), p->noun, (int)(i < j ? j : i), deepest, p->allowed,
              p->f->outlines.hulled ? ", or set ice.nonconvex: split, if it is their hulls that overlap" : "");
}

static void check_bounds(const bt_case *c, const place *p, bt_idx i)
{
    const bt_field *f = p->f;
    const double x = f->pose[3 * i], y = f->pose[3 * i + 1], slack = 1e-9 * (c->domain.length + c->domain.width);
    const double x1 = c->domain.x0 + c->domain.length, y1 = c->domain.y0 + c->domain.width;
    double low[2] = {x, y}, high[2] = {x, y}; // walls hold the whole outline, other boundaries the centroid
    for (int64_t k = f->offsets[i]; k < f->offsets[i + 1]; k++)
        for (int a = 0; a < 2; a++) {
            if ((a ? c->domain.sides : c->domain.ends) != BT_BOUND_WALL) continue;
            const double q = (a ? y : x) + p->outline[2 * k + a];
            low[a] = bt_min(low[a], q), high[a] = bt_max(high[a], q);
        }
    if (low[0] < c->domain.x0 - slack || high[0] > x1 + slack)
        bt_refuse(p->r,
                  "%s %d, x %g to %g m, is outside the domain, %g to %g m; take it out, move the outlines, or enlarge "
                  "the domain",
                  p->noun, (int)i, low[0], high[0], c->domain.x0, x1);
    else if (low[1] < c->domain.y0 - slack || high[1] > y1 + slack)
        bt_refuse(p->r,
                  "%s %d, y %g to %g m, is outside the domain, %g to %g m; take it out, move the outlines, or enlarge "
                  "the domain",
                  p->noun, (int)i, low[1], high[1], c->domain.y0, y1);
}

/// Ready for pairs of floes of f, wherever in the domain they lie.
static void begin_places(place *p, bt_region *y, const bt_case *c, const bt_field *f)
{
    bt_region_of_domain(y, c);
    p->allowed = bt_max(c->solver.slop, 1e-9) * bt_field_mean_size(f);
    p->parts = bt_alloc((size_t)f->n, sizeof *p->parts);
    for (bt_idx i = 0; i < f->n; i++) {
        const int n = (int)(f->offsets[i + 1] - f->offsets[i]);
        const double *v = f->vertices + 2 * f->offsets[i];
        if (bt_outline_convex(n, v)) continue;
        p->parts[i] = bt_alloc(1, sizeof *p->parts[i]);
        bt_outline_split(n, v, p->parts[i]);
    }
}

static void check_pairs(place *p, const bt_region *y)
{
    bt_field_visit_pairs(y, p->f, p->outline, 1, visit, p);
    if (p->overlapping <= 1) return;
    // A line of its own, whatever has been reported one by one.
    bt_errors_add(p->r->err, "%s: %lld pairs of %ss overlap, by %.3g m at most", p->r->path, (long long)p->overlapping,
                  p->noun, p->deepest);
}

/// Floes in the towed body or a floe given by hand.
static void check_obstacles(const place *p, const bt_region *y)
{
    const bt_field *f = p->f;
    for (bt_idx i = 0; i < f->n; i++) {
        double x = f->pose[3 * i], z = f->pose[3 * i + 1], radius = 0;
        for (int64_t k = f->offsets[i]; k < f->offsets[i + 1]; k++)
            radius = bt_max(radius, bt_hypot(p->outline[2 * k], p->outline[2 * k + 1]));
        bt_region_wrap(y, &x, &z);
        for (int o = 0; o < y->n_obstacles; o++) {
            const bt_obstacle *b = &y->obstacles[o];
            if (bt_hypot(b->x - x, b->y - z) >= radius + b->radius) continue;
            piece rel = {.n = b->n};
            for (int k = 0; k < b->n; k++) rel.v[2 * k] = b->v[2 * k] - b->x, rel.v[2 * k + 1] = b->v[2 * k + 1] - b->y;
            const double depth = depth_in(p, i, rel.n, rel.v, b->x - x, b->y - z);
            if (depth > p->allowed)
                bt_refuse(p->r,
                          "%s %d lies %.3g m deep in the towed body or a floe given by hand (allowed: %.3g m); take it "
                          "out, or move the body",
                          p->noun, (int)i, depth, p->allowed);
        }
    }
}

static void check_places(const bt_case *c, const bt_field *f, const char *noun, bool obstacles, bt_refusals *r)
{
    double *outline = bt_field_outlines(f);
    place p = {.f = f, .outline = outline, .noun = noun, .r = r};
    bt_region y;
    for (bt_idx i = 0; i < f->n; i++) check_bounds(c, &p, i);
    begin_places(&p, &y, c, f);
    check_pairs(&p, &y);
    if (obstacles) check_obstacles(&p, &y);
    for (bt_idx i = 0; i < f->n; i++) free(p.parts[i]);
    free(p.parts);
    free(outline);
    bt_region_free(&y);
}

void bt_field_check_apart(const bt_case *c, const bt_field *f, const char *noun, bt_refusals *r)
{
    check_places(c, f, noun, false, r);
}

void bt_field_check_places(const bt_case *c, const bt_field *f, const char *noun, bt_refusals *r)
{
    check_places(c, f, noun, true, r);
}
