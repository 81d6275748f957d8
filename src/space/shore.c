// SPDX-License-Identifier: MIT
// Covered edges, normal cones and the tree of boxes of the fixed bodies that lie against each other; see shore.h.
#include "space/shore.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/elementary.h"
#include "body/bodies.h"

static const double CONE = 1e-6; // rad; two pieces of a straight shore may both answer, never none
static const double ENDS = 4;    // slops: an edge that shows less than this does not count, nor a gap to its end
enum { LEAF = 4 };               // polygons at the end of a branch

typedef struct { double low[2], high[2]; } box;

struct bt_shore {
    bt_gid n_gids;
    int64_t *first;             ///< [n_gids] of the faces of a body, −1 = part of no shore
    bt_face *face;              ///< [n_faces] one for each vertex
    bt_shore_polygon *polygon;  ///< [n] in the order of the tree
    int n;
    /// [] box about the polygons of a node; node k has the nodes 2k + 1 and 2k + 2 for the halves of its polygons
    box *node;
};

void bt_shore_free(bt_shore *s)
{
    if (!s) return;
    free(s->first);
    free(s->face);
    free(s->polygon);
    free(s->node);
    free(s);
}

bool bt_shore_has(const bt_shore *s, bt_gid gid) { return s && gid < s->n_gids && s->first[gid] >= 0; }

const bt_face *bt_shore_faces(const bt_shore *s, bt_gid gid, int part)
{
    return bt_shore_has(s, gid) ? s->face + s->first[gid] + part : NULL;
}

bool bt_shore_in_cone(const bt_face *f, double nx, double ny)
{
    const double *u = f->u, *w = f->w;
    return u[0] * ny - u[1] * nx >= -CONE && nx * w[1] - ny * w[0] >= -CONE &&
           nx * (u[0] + w[0]) + ny * (u[1] + w[1]) > 0;
}

// --- tree ------------------------------------------------------------------------------------------------------------

static int along_x(const void *p, const void *q)
{
    const bt_shore_polygon *a = p, *b = q;
    const double x = a->low[0] + a->high[0], y = b->low[0] + b->high[0];
    return x != y ? (x < y ? -1 : 1) : a->gid != b->gid ? (a->gid < b->gid ? -1 : 1) : a->part - b->part;
}

static int along_y(const void *p, const void *q)
{
    const bt_shore_polygon *a = p, *b = q;
    const double x = a->low[1] + a->high[1], y = b->low[1] + b->high[1];
    return x != y ? (x < y ? -1 : 1) : a->gid != b->gid ? (a->gid < b->gid ? -1 : 1) : a->part - b->part;
}

static void build_node(bt_shore *s, int node, int begin, int end)
{
    box b = {{INFINITY, INFINITY}, {-INFINITY, -INFINITY}};
    for (int i = begin; i < end; i++)
        for (int a = 0; a < 2; a++) {
            b.low[a] = bt_min(b.low[a], s->polygon[i].low[a]);
            b.high[a] = bt_max(b.high[a], s->polygon[i].high[a]);
        }
    s->node[node] = b;
    if (end - begin <= LEAF) return;
    const bool long_x = b.high[0] - b.low[0] >= b.high[1] - b.low[1];
    qsort(s->polygon + begin, (size_t)(end - begin), sizeof *s->polygon, long_x ? along_x : along_y);
    const int middle = begin + (end - begin) / 2;
    build_node(s, 2 * node + 1, begin, middle);
    build_node(s, 2 * node + 2, middle, end);
}

static void build_tree(bt_shore *s)
{
    free(s->node);
    s->node = bt_alloc(4 * (size_t)s->n + 4, sizeof *s->node);
    if (s->n > 0) build_node(s, 0, 0, s->n);
}

static bool boxes_meet(const double low[2], const double high[2], const double other_low[2],
                       const double other_high[2])
{
    return low[0] <= other_high[0] && other_low[0] <= high[0] && low[1] <= other_high[1] && other_low[1] <= high[1];
}

/// Calls take(context, polygon) for each that meets the box.
static void visit(const bt_shore *s, int node, int begin, int end, const box *b,
                  void (*take)(void *, const bt_shore_polygon *), void *context)
{
    if (!boxes_meet(b->low, b->high, s->node[node].low, s->node[node].high)) return;
    if (end - begin > LEAF) {
        const int middle = begin + (end - begin) / 2;
        visit(s, 2 * node + 1, begin, middle, b, take, context);
        visit(s, 2 * node + 2, middle, end, b, take, context);
        return;
    }
    for (int i = begin; i < end; i++)
        if (boxes_meet(b->low, b->high, s->polygon[i].low, s->polygon[i].high)) take(context, &s->polygon[i]);
}

typedef struct { bt_shore_list *list; double x, y, shift[2], period[2]; } nearest;

/// At this image, if it is the nearest one: each polygon once, as its body's pairs have one offset.
static void take_nearest(void *context, const bt_shore_polygon *p)
{
    const nearest *c = context;
    const double dx = p->x - c->x, dy = p->y - c->y;
    if (bt_nearest_image(dx, c->period[0]) != dx + c->shift[0]) return;
    if (bt_nearest_image(dy, c->period[1]) != dy + c->shift[1]) return;
    bt_shore_list *l = c->list;
    if (l->n == l->cap) l->found = bt_realloc(l->found, l->cap = l->cap ? 2 * l->cap : 64, sizeof *l->found);
    l->found[l->n++] = *p;
}

void bt_shore_near(const bt_world *w, double x, double y, const double low[2], const double high[2],
                   bt_shore_list *list)
{
    const bt_shore *s = w->shore;
    const double period[2] = {w->par.period_x, w->par.period_y};
    const int images_x = period[0] > 0, images_y = period[1] > 0;
    list->n = 0;
    for (int kx = -images_x; kx <= images_x; kx++)
        for (int ky = -images_y; ky <= images_y; ky++) {
            nearest c = {list, x, y, {kx * period[0], ky * period[1]}, {period[0], period[1]}};
            const box b = {{low[0] - c.shift[0], low[1] - c.shift[1]}, {high[0] - c.shift[0], high[1] - c.shift[1]}};
            visit(s, 0, 0, s->n, &b, take_nearest, &c);
        }
}

// --- the boundary of the union ---------------------------------------------------------------------------------------

/// A polygon in a common frame.
typedef struct { int n; const double *v; double x, y; } polygon;

static polygon polygon_of(const bt_bodies *b, const bt_shore_polygon *p, const double shift[2])
{
    const double *v = b->outline + 2 * (b->offset[b->index_of[p->gid]] + p->part);
    return (polygon){p->count, v, p->x + shift[0], p->y + shift[1]};
}

static void vertex(const polygon *p, int i, double out[2])
{
    const double *v = p->v + 2 * (i < p->n ? i : i - p->n);
    out[0] = p->x + v[0];
    out[1] = p->y + v[1];
}

/// Outward unit normal of edge i, and how long that is, m.
static double normal_of(const polygon *p, int i, double n[2])
{
    const double *v = p->v + 2 * (i < p->n ? i : i - p->n), *q = p->v + 2 * ((i + 1) % p->n);
    const double length = bt_hypot(q[0] - v[0], q[1] - v[1]);
    n[0] = (q[1] - v[1]) / length;
    n[1] = (v[0] - q[0]) / length;
    return length;
}

/// Height of x above edge i.
static double height(const polygon *p, int i, const double x[2])
{
    double n[2], v[2];
    normal_of(p, i, n);
    vertex(p, i, v);
    return n[0] * (x[0] - v[0]) + n[1] * (x[1] - v[1]);
}

/// How far apart two polygons are along an edge normal of the first, at least.
static bool apart_by_edge_of(const polygon *p, const polygon *q, double reach)
{
    for (int i = 0; i < p->n; i++) {
        double least = INFINITY, x[2];
        for (int k = 0; k < q->n; k++) {
            vertex(q, k, x);
            least = bt_min(least, height(p, i, x));
        }
        if (least > reach) return true;
    }
    return false;
}

/// From where to where along edge i of p, at a distance `beyond` outside it, q is; false: nowhere.
static bool cover(const polygon *p, int i, const polygon *q, double beyond, double span[2])
{
    double n[2], x[2];
    span[0] = 0;
    span[1] = normal_of(p, i, n);
    vertex(p, i, x);
    x[0] += beyond * n[0], x[1] += beyond * n[1];
    for (int k = 0; k < q->n && span[0] < span[1]; k++) {
        double m[2];
        normal_of(q, k, m);
        const double at = height(q, k, x), slope = m[1] * n[0] - m[0] * n[1]; // along the edge (−n_y, n_x)
        if (slope > 0) span[1] = bt_min(span[1], -at / slope);
        else if (slope < 0) span[0] = bt_max(span[0], -at / slope);
        else if (at > 0) return false;
    }
    return span[0] < span[1];
}

/// The normals of polygon p at a point of its boundary, from the first to the last edge that it is on; false: it is
/// inside, or `near` is false.
static bool cone_at(const polygon *p, const double x[2], double reach, bool *near, double u[2], double w[2])
{
    bool on[BT_MAX_VERTICES];
    int first = -1;
    *near = true;
    for (int i = 0; i < p->n; i++) {
        const double h = height(p, i, x);
        *near = *near && h <= reach;
        on[i] = h >= -reach;
    }
    for (int i = 0; i < p->n; i++)
        if (on[i] && !on[i > 0 ? i - 1 : p->n - 1]) first = i;
    if (!*near || first < 0) return false;
    int last = first;
    while (on[(last + 1) % p->n]) last++;
    normal_of(p, first, u);
    normal_of(p, last, w);
    return true;
}

/// What cones a and b have in common, into a.
static void intersect(bt_face *a, const double u[2], const double w[2])
{
    bt_face both = *a, b = {.u = {u[0], u[1]}, .w = {w[0], w[1]}};
    if (a->u[0] * u[1] - a->u[1] * u[0] > 0) memcpy(both.u, u, sizeof both.u);
    if (w[0] * a->w[1] - w[1] * a->w[0] > 0) memcpy(both.w, w, sizeof both.w);
    const bool some = bt_shore_in_cone(a, both.u[0], both.u[1]) && bt_shore_in_cone(&b, both.u[0], both.u[1]) &&
                      bt_shore_in_cone(a, both.w[0], both.w[1]) && bt_shore_in_cone(&b, both.w[0], both.w[1]);
    if (!some) memset(both.u, 0, sizeof both.u), memset(both.w, 0, sizeof both.w);
    memcpy(a->u, both.u, sizeof both.u);
    memcpy(a->w, both.w, sizeof both.w);
}

typedef struct {
    const bt_bodies *b;
    bt_shore *s;
    const bt_shore_polygon *of;
    double shift[2], reach;
    bool alone;              ///< no other polygon lies against it
    bt_face *face;           ///< [of->count], or NULL
    double (*span)[2];       ///< what others cover of one edge
    int n_spans, cap_spans, edge;
} about;

static void take_beside(void *context, const bt_shore_polygon *q)
{
    about *c = context;
    if (q->gid == c->of->gid && q->part == c->of->part && c->shift[0] == 0 && c->shift[1] == 0) return;
    const double none[2] = {0, 0};
    const polygon p = polygon_of(c->b, c->of, none), other = polygon_of(c->b, q, c->shift);
    if (apart_by_edge_of(&p, &other, c->reach) || apart_by_edge_of(&other, &p, c->reach)) return;
    c->alone = false;
    if (!c->face) return;
    double x[2], u[2], w[2], span[2];
    bool near;
    vertex(&p, c->edge, x);
    bt_face *f = &c->face[c->edge];
    if (cone_at(&other, x, c->reach, &near, u, w)) intersect(f, u, w);
    else if (near) memset(f->u, 0, sizeof f->u), memset(f->w, 0, sizeof f->w);
    if (!cover(&p, c->edge, &other, c->reach, span)) return;
    if (c->n_spans == c->cap_spans)
        c->span = bt_realloc(c->span, (size_t)(c->cap_spans = 2 * c->cap_spans + 8), sizeof *c->span);
    memcpy(c->span[c->n_spans++], span, sizeof span);
}

/// Looks at all polygons that may lie against c->of, at all images.
static void look_beside(const bt_world *w, about *c)
{
    const double period[2] = {w->par.period_x, w->par.period_y};
    const int images_x = period[0] > 0, images_y = period[1] > 0;
    for (int kx = -images_x; kx <= images_x; kx++)
        for (int ky = -images_y; ky <= images_y; ky++) {
            box b;
            c->shift[0] = kx * period[0], c->shift[1] = ky * period[1];
            for (int a = 0; a < 2; a++) {
                b.low[a] = c->of->low[a] - c->shift[a] - 2 * c->reach;
                b.high[a] = c->of->high[a] - c->shift[a] + 2 * c->reach;
            }
            visit(c->s, 0, 0, c->s->n, &b, take_beside, c);
        }
}

/// The ends of an edge that others cover are taken off.
static void trim(about *c, bt_face *f, double length)
{
    f->from = 0;
    f->to = length;
    const double slack = ENDS * c->reach;
    for (bool changed = true; changed;) {
        changed = false;
        for (int k = 0; k < c->n_spans; k++) {
            const double *s = c->span[k];
            if (s[0] <= f->from + slack && s[1] > f->from) f->from = s[1], changed = true;
            if (s[1] >= f->to - slack && s[0] < f->to) f->to = s[0], changed = true;
        }
    }
    if (f->to - f->from <= bt_min(slack, 0.5 * length)) f->to = f->from;
}

static void find_faces(const bt_world *w, about *c)
{
    const double none[2] = {0, 0};
    const polygon p = polygon_of(c->b, c->of, none);
    for (c->edge = 0; c->edge < p.n; c->edge++) {
        bt_face *f = &c->face[c->edge];
        normal_of(&p, c->edge > 0 ? c->edge - 1 : p.n - 1, f->u);
        const double length = normal_of(&p, c->edge, f->w);
        c->n_spans = 0;
        look_beside(w, c);
        trim(c, f, length);
    }
}

/// All polygons of the fixed bodies there are.
static void collect(const bt_world *w, bt_shore *s)
{
    const bt_bodies *b = &w->bodies;
    int cap = 0;
    for (bt_idx i = 0; i < b->n; i++) {
        if (b->motion[i] != BT_STATIC) continue;
        for (int part = bt_part_first(b, i); part >= 0; part = bt_part_next(b, i, part)) {
            if (s->n == cap) s->polygon = bt_realloc(s->polygon, (size_t)(cap = 2 * cap + 8), sizeof *s->polygon);
            bt_shore_polygon *p = &s->polygon[s->n++];
            *p = (bt_shore_polygon){.gid = b->gid[i], .part = part, .count = b->mark[b->offset[i] + part].count,
                                    .x = b->pose[i].x, .y = b->pose[i].y,
                                    .low = {INFINITY, INFINITY}, .high = {-INFINITY, -INFINITY}};
            const double none[2] = {0, 0};
            const polygon q = polygon_of(b, p, none);
            for (int k = 0; k < q.n; k++) {
                double x[2];
                vertex(&q, k, x);
                for (int a = 0; a < 2; a++) p->low[a] = bt_min(p->low[a], x[a]), p->high[a] = bt_max(p->high[a], x[a]);
            }
        }
    }
    build_tree(s);
}

void bt_shore_create(bt_world *w)
{
    bt_bodies *b = &w->bodies;
    bt_shore *s = bt_alloc(1, sizeof *s);
    s->n_gids = b->n_global;
    s->first = bt_alloc((size_t)s->n_gids + 1, sizeof *s->first);
    for (bt_gid g = 0; g < s->n_gids; g++) s->first[g] = -1;
    collect(w, s);
    about c = {.b = b, .s = s, .reach = bt_max(w->par.slop, 1e-9 * w->par.size)};
    int64_t n_faces = 0;
    for (int k = 0; k < s->n; k++) {
        c.of = &s->polygon[k];
        c.alone = c.of->part == 0;
        if (c.alone) look_beside(w, &c);
        if (c.alone || s->first[c.of->gid] >= 0) continue;
        const bt_idx i = b->index_of[c.of->gid];
        s->first[c.of->gid] = n_faces;
        n_faces += b->offset[i + 1] - b->offset[i];
        b->large[i] = 1;
    }
    int kept = 0;
    for (int k = 0; k < s->n; k++)
        if (s->first[s->polygon[k].gid] >= 0) s->polygon[kept++] = s->polygon[k];
    s->n = kept;
    if (kept == 0) {
        bt_shore_free(s);
        return;
    }
    build_tree(s);
    s->face = bt_alloc((size_t)n_faces, sizeof *s->face);
    for (int k = 0; k < s->n; k++) {
        c.of = &s->polygon[k];
        c.face = s->face + s->first[c.of->gid] + c.of->part;
        find_faces(w, &c);
    }
    free(c.span);
    w->shore = s;
}
