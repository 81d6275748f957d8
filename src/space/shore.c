// SPDX-License-Identifier: MIT
// Covered edges, normal cones and the tree of boxes of the fixed bodies that lie against each other; see shore.h.
#include "space/shore.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/elementary.h"
#include "base/inside.h"
#include "body/bodies.h"

static const double CONE = 1e-6; // rad; two pieces of a straight shore may both count, never neither
static const double ENDS = 4;    // slops: an exposed edge shorter than this does not count, nor a gap to its end
static const double SEAM = 1e-3; // rad a boundary may turn and go straight on: below a floe it sags less than the slop
enum { LEAF = 4 };               // polygons per leaf

typedef struct { double low[2], high[2]; } box;

struct bt_shore {
    bt_gid n_gids;
    int64_t *first;             ///< [n_gids] of the faces of a body, −1 = part of no shore
    bt_gid *outline;            ///< [n_gids] lowest id in the shore of a body; until all are found, one on the way
    bt_face *face;              ///< [n_faces] one for each vertex
    bt_shore_polygon *polygon;  ///< [n] in the order of the tree
    int n;
    /// [] box about the polygons of a node; nodes 2k + 1 and 2k + 2 hold the halves of node k
    box *node;
};

void bt_shore_free(bt_shore *shore)
{
    if (!shore) return;
    free(shore->first);
    free(shore->outline);
    free(shore->face);
    free(shore->polygon);
    free(shore->node);
    free(shore);
}

bool bt_shore_has(const bt_shore *shore, bt_gid gid) { return shore && gid < shore->n_gids && shore->first[gid] >= 0; }

bt_gid bt_shore_outline(const bt_shore *shore, bt_gid gid)
{
    return bt_shore_has(shore, gid) ? shore->outline[gid] : gid;
}

const bt_face *bt_shore_faces(const bt_shore *shore, bt_gid gid, int part)
{
    return bt_shore_has(shore, gid) ? shore->face + shore->first[gid] + part : NULL;
}

static bool in_cone(const bt_face *face, double nx, double ny, double beside)
{
    const double *u = face->u, *w = face->w;
    return u[0] * ny - u[1] * nx >= -beside && nx * w[1] - ny * w[0] >= -beside &&
           nx * (u[0] + w[0]) + ny * (u[1] + w[1]) > 0;
}

bool bt_shore_in_cone(const bt_face *face, double nx, double ny) { return in_cone(face, nx, ny, CONE); }

// --- tree ------------------------------------------------------------------------------------------------------------

static int along(int axis, const bt_shore_polygon *a, const bt_shore_polygon *b)
{
    const double x = a->low[axis] + a->high[axis], y = b->low[axis] + b->high[axis];
    return x != y ? (x < y ? -1 : 1) : a->gid != b->gid ? (a->gid < b->gid ? -1 : 1) : a->part - b->part;
}

static int along_x(const void *p, const void *q) { return along(0, p, q); }
static int along_y(const void *p, const void *q) { return along(1, p, q); }

static void build_node(bt_shore *shore, int node, int begin, int end)
{
    box bounds = {{INFINITY, INFINITY}, {-INFINITY, -INFINITY}};
    for (int i = begin; i < end; i++)
        for (int a = 0; a < 2; a++) {
            bounds.low[a] = bt_min(bounds.low[a], shore->polygon[i].low[a]);
            bounds.high[a] = bt_max(bounds.high[a], shore->polygon[i].high[a]);
        }
    shore->node[node] = bounds;
    if (end - begin <= LEAF) return;
    const bool long_x = bounds.high[0] - bounds.low[0] >= bounds.high[1] - bounds.low[1];
    qsort(shore->polygon + begin, (size_t)(end - begin), sizeof *shore->polygon, long_x ? along_x : along_y);
    const int middle = begin + (end - begin) / 2;
    build_node(shore, 2 * node + 1, begin, middle);
    build_node(shore, 2 * node + 2, middle, end);
}

static void build_tree(bt_shore *shore)
{
    free(shore->node);
    shore->node = bt_alloc(4 * (size_t)shore->n + 4, sizeof *shore->node);
    if (shore->n > 0) build_node(shore, 0, 0, shore->n);
}

static bool boxes_meet(const double low[2], const double high[2], const double other_low[2],
                       const double other_high[2])
{
    return low[0] <= other_high[0] && other_low[0] <= high[0] && low[1] <= other_high[1] && other_low[1] <= high[1];
}

/// Call take(context, polygon) for each polygon whose box meets `bounds`.
static void visit(const bt_shore *shore, int node, int begin, int end, const box *bounds,
                  void (*take)(void *, const bt_shore_polygon *), void *context)
{
    if (!boxes_meet(bounds->low, bounds->high, shore->node[node].low, shore->node[node].high)) return;
    if (end - begin > LEAF) {
        const int middle = begin + (end - begin) / 2;
        visit(shore, 2 * node + 1, begin, middle, bounds, take, context);
        visit(shore, 2 * node + 2, middle, end, bounds, take, context);
        return;
    }
    for (int i = begin; i < end; i++)
        if (boxes_meet(bounds->low, bounds->high, shore->polygon[i].low, shore->polygon[i].high))
            take(context, &shore->polygon[i]);
}

typedef struct { bt_shore_list *list; double x, y, shift[2], period[2]; } nearest;

/// Take a polygon at this image if it is the nearest: each polygon once, as pairs of its body have one offset.
static void take_nearest(void *context, const bt_shore_polygon *p)
{
    const nearest *c = context;
    const double dx = p->x - c->x, dy = p->y - c->y;
    if (bt_nearest_image(dx, c->period[0]) != dx + c->shift[0]) return;
    if (bt_nearest_image(dy, c->period[1]) != dy + c->shift[1]) return;
    bt_shore_list *list = c->list;
    BT_MAKE_ROOM(list->found, list->n, list->cap, 64);
    list->found[list->n++] = *p;
}

void bt_shore_near(const bt_world *world, double x, double y, const double low[2], const double high[2],
                   bt_shore_list *list)
{
    const bt_shore *shore = world->shore;
    const double period[2] = {world->par.period_x, world->par.period_y};
    const int images_x = period[0] > 0, images_y = period[1] > 0;
    list->n = 0;
    for (int kx = -images_x; kx <= images_x; kx++)
        for (int ky = -images_y; ky <= images_y; ky++) {
            nearest c = {list, x, y, {kx * period[0], ky * period[1]}, {period[0], period[1]}};
            const box bounds =
                {{low[0] - c.shift[0], low[1] - c.shift[1]}, {high[0] - c.shift[0], high[1] - c.shift[1]}};
            visit(shore, 0, 0, shore->n, &bounds, take_nearest, &c);
        }
}

// --- the boundary of the union ---------------------------------------------------------------------------------------

/// A polygon in a common frame.
typedef struct { int n; const double *v; double x, y; } polygon;

static polygon polygon_of(const bt_bodies *bodies, const bt_shore_polygon *p, const double shift[2])
{
    const double *v = bodies->outline + 2 * (bodies->offset[bodies->index_of[p->gid]] + p->part);
    return (polygon){p->count, v, p->x + shift[0], p->y + shift[1]};
}

static void vertex(const polygon *shape, int i, double out[2])
{
    const double *v = shape->v + 2 * (i < shape->n ? i : i - shape->n);
    out[0] = shape->x + v[0];
    out[1] = shape->y + v[1];
}

/// Outward unit normal of edge i; returns the length of the edge, m.
static double normal_of(const polygon *shape, int i, double n[2])
{
    const double *v = shape->v + 2 * (i < shape->n ? i : i - shape->n), *q = shape->v + 2 * ((i + 1) % shape->n);
    const double length = bt_hypot(q[0] - v[0], q[1] - v[1]);
    n[0] = (q[1] - v[1]) / length;
    n[1] = (v[0] - q[0]) / length;
    return length;
}

/// Height of x above edge i.
static double height(const polygon *shape, int i, const double x[2])
{
    double n[2], v[2];
    normal_of(shape, i, n);
    vertex(shape, i, v);
    return n[0] * (x[0] - v[0]) + n[1] * (x[1] - v[1]);
}

/// Does an edge normal of the first polygon separate the two by more than `reach`, m?
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

/// The interval along edge i of p, at a distance `beyond` outside it, that lies in q; false if there is none.
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

/// Normals u to w of polygon `shape` at point x, of the first and the last edge on which x lies; false if x is inside,
/// or if it is farther off than `reach` (*near false).
static bool cone_at(const polygon *shape, const double x[2], double reach, bool *near, double u[2], double w[2])
{
    bool on[BT_MAX_VERTICES];
    int first = -1;
    *near = true;
    for (int i = 0; i < shape->n; i++) {
        const double h = height(shape, i, x);
        *near = *near && h <= reach;
        on[i] = h >= -reach;
    }
    for (int i = 0; i < shape->n; i++)
        if (on[i] && !on[i > 0 ? i - 1 : shape->n - 1]) first = i;
    if (!*near || first < 0) return false;
    int last = first;
    while (on[(last + 1) % shape->n]) last++;
    normal_of(shape, first, u);
    normal_of(shape, last, w);
    return true;
}

/// Replace cone a by the intersection of a with the cone u to w.
static void intersect(bt_face *a, const double u[2], const double w[2])
{
    bt_face both = *a, b = {.u = {u[0], u[1]}, .w = {w[0], w[1]}};
    if (a->u[0] * u[1] - a->u[1] * u[0] > 0) memcpy(both.u, u, sizeof both.u);
    if (w[0] * a->w[1] - w[1] * a->w[0] > 0) memcpy(both.w, w, sizeof both.w);
    const bool some = in_cone(a, both.u[0], both.u[1], SEAM) && in_cone(&b, both.u[0], both.u[1], SEAM) &&
                      in_cone(a, both.w[0], both.w[1], SEAM) && in_cone(&b, both.w[0], both.w[1], SEAM);
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
    double (*span)[2];       ///< intervals of one edge that others cover
    int n_spans, cap_spans, edge;
} about;

static bt_gid lowest(const bt_shore *shore, bt_gid gid)
{
    while (shore->outline[gid] != gid) gid = shore->outline[gid];
    return gid;
}

/// Two bodies lie against each other: one shore.
static void join(bt_shore *shore, bt_gid a, bt_gid b)
{
    const bt_gid p = lowest(shore, a), q = lowest(shore, b), low = p < q ? p : q;
    shore->outline[p] = shore->outline[q] = shore->outline[a] = shore->outline[b] = low;
}

static void take_beside(void *context, const bt_shore_polygon *q)
{
    about *around = context;
    if (q->gid == around->of->gid && q->part == around->of->part && around->shift[0] == 0 && around->shift[1] == 0)
        return;
    const double none[2] = {0, 0};
    const polygon shape = polygon_of(around->b, around->of, none), other = polygon_of(around->b, q, around->shift);
    if (apart_by_edge_of(&shape, &other, around->reach) || apart_by_edge_of(&other, &shape, around->reach)) return;
    around->alone = false;
    join(around->s, around->of->gid, q->gid);
    if (!around->face) return;
    double x[2], u[2], w[2], span[2];
    bool near;
    vertex(&shape, around->edge, x);
    bt_face *face = &around->face[around->edge];
    if (cone_at(&other, x, around->reach, &near, u, w)) intersect(face, u, w);
    else if (near) memset(face->u, 0, sizeof face->u), memset(face->w, 0, sizeof face->w);
    if (!cover(&shape, around->edge, &other, around->reach, span)) return;
    if (around->n_spans == around->cap_spans)
        around->span = bt_realloc(around->span, (size_t)(around->cap_spans = 2 * around->cap_spans + 8),
                                  sizeof *around->span);
    memcpy(around->span[around->n_spans++], span, sizeof span);
}

/// Visit all polygons that may lie against around->of, at all images.
static void look_beside(const bt_world *world, about *around)
{
    const double period[2] = {world->par.period_x, world->par.period_y};
    const int images_x = period[0] > 0, images_y = period[1] > 0;
    for (int kx = -images_x; kx <= images_x; kx++)
        for (int ky = -images_y; ky <= images_y; ky++) {
            box bounds;
            around->shift[0] = kx * period[0], around->shift[1] = ky * period[1];
            for (int a = 0; a < 2; a++) {
                bounds.low[a] = around->of->low[a] - around->shift[a] - 2 * around->reach;
                bounds.high[a] = around->of->high[a] - around->shift[a] + 2 * around->reach;
            }
            visit(around->s, 0, 0, around->s->n, &bounds, take_beside, around);
        }
}

/// Cut off the ends of an edge that others cover.
static void trim(about *around, bt_face *face, double length)
{
    face->from = 0;
    face->to = length;
    const double slack = ENDS * around->reach;
    for (bool changed = true; changed;) {
        changed = false;
        for (int k = 0; k < around->n_spans; k++) {
            const double *s = around->span[k];
            if (s[0] <= face->from + slack && s[1] > face->from) face->from = s[1], changed = true;
            if (s[1] >= face->to - slack && s[0] < face->to) face->to = s[0], changed = true;
        }
    }
    if (face->to - face->from <= bt_min(slack, 0.5 * length)) face->to = face->from;
}

static bool parallel(const double n[2], const double m[2])
{
    return n[0] * m[0] + n[1] * m[1] > 0 && fabs(n[0] * m[1] - n[1] * m[0]) <= SEAM;
}

/// Does the boundary go straight on past vertex i, an end of an exposed edge with the normal n, but on other polygons?
static bool goes_on(const polygon *shape, const bt_face *faces, int i, const double n[2])
{
    const int at = i % shape->n;
    double before[2], after[2];
    normal_of(shape, at > 0 ? at - 1 : shape->n - 1, before);
    normal_of(shape, at, after);
    return parallel(faces[at].u, n) && parallel(faces[at].w, n) && !parallel(before, after);
}

static void find_faces(const bt_world *world, about *around)
{
    const double none[2] = {0, 0};
    const polygon shape = polygon_of(around->b, around->of, none);
    for (around->edge = 0; around->edge < shape.n; around->edge++) {
        bt_face *face = &around->face[around->edge];
        normal_of(&shape, around->edge > 0 ? around->edge - 1 : shape.n - 1, face->u);
        const double length = normal_of(&shape, around->edge, face->w);
        around->n_spans = 0;
        look_beside(world, around);
        trim(around, face, length);
    }
    for (int i = 0; i < shape.n; i++) {
        bt_face *face = &around->face[i];
        double n[2];
        const double length = normal_of(&shape, i, n);
        face->on[0] = face->from == 0 && goes_on(&shape, around->face, i, n);
        face->on[1] = face->to == length && goes_on(&shape, around->face, i + 1, n);
    }
}

/// Collect all polygons of the fixed bodies.
static void collect(const bt_world *world, bt_shore *shore)
{
    const bt_bodies *bodies = &world->bodies;
    int cap = 0;
    for (bt_idx i = 0; i < bodies->n; i++) {
        if (bodies->motion[i] != BT_STATIC) continue;
        for (int part = bt_part_first(bodies, i); part >= 0; part = bt_part_next(bodies, i, part)) {
            if (shore->n == cap)
                shore->polygon = bt_realloc(shore->polygon, (size_t)(cap = 2 * cap + 8), sizeof *shore->polygon);
            bt_shore_polygon *p = &shore->polygon[shore->n++];
            *p = (bt_shore_polygon){.gid = bodies->gid[i], .part = part,
                                    .count = bodies->mark[bodies->offset[i] + part].count, .x = bodies->pose[i].x,
                                    .y = bodies->pose[i].y, .low = {INFINITY, INFINITY},
                                    .high = {-INFINITY, -INFINITY}};
            const double none[2] = {0, 0};
            const polygon shape = polygon_of(bodies, p, none);
            for (int k = 0; k < shape.n; k++) {
                double x[2];
                vertex(&shape, k, x);
                for (int a = 0; a < 2; a++) p->low[a] = bt_min(p->low[a], x[a]), p->high[a] = bt_max(p->high[a], x[a]);
            }
        }
    }
    build_tree(shore);
}

void bt_shore_create(bt_world *world)
{
    bt_bodies *bodies = &world->bodies;
    bt_shore *shore = bt_alloc(1, sizeof *shore);
    shore->n_gids = bodies->n_global;
    shore->first = bt_alloc((size_t)shore->n_gids + 1, sizeof *shore->first);
    shore->outline = bt_alloc((size_t)shore->n_gids + 1, sizeof *shore->outline);
    for (bt_gid g = 0; g < shore->n_gids; g++) shore->first[g] = -1, shore->outline[g] = g;
    collect(world, shore);
    about around = {.b = bodies, .s = shore, .reach = bt_max(world->par.slop, 1e-9 * world->par.size)};
    int64_t n_faces = 0;
    for (int k = 0; k < shore->n; k++) {
        around.of = &shore->polygon[k];
        around.alone = around.of->part == 0;
        if (around.alone) look_beside(world, &around);
        if (around.alone || shore->first[around.of->gid] >= 0) continue;
        const bt_idx i = bodies->index_of[around.of->gid];
        shore->first[around.of->gid] = n_faces;
        n_faces += bodies->offset[i + 1] - bodies->offset[i];
        bodies->large[i] = 1;
    }
    int kept = 0;
    for (int k = 0; k < shore->n; k++)
        if (shore->first[shore->polygon[k].gid] >= 0) shore->polygon[kept++] = shore->polygon[k];
    shore->n = kept;
    if (kept == 0) {
        bt_shore_free(shore);
        return;
    }
    build_tree(shore);
    shore->face = bt_alloc((size_t)n_faces, sizeof *shore->face);
    for (int k = 0; k < shore->n; k++) {
        around.of = &shore->polygon[k];
        around.face = shore->face + shore->first[around.of->gid] + around.of->part;
        find_faces(world, &around);
    }
    free(around.span);
    for (bt_gid g = 0; g < shore->n_gids; g++) shore->outline[g] = lowest(shore, g);
    world->shore = shore;
}
