// SPDX-License-Identifier: MIT
// Narrow phase: gap, normal and contact points of two convex polygons.
//
// Separating axes: over the edges i of one polygon, s_i = min_j n_i·(p_j − q_i) is the signed distance of the other
// polygon from the edge's line. The largest s over both polygons is the distance when the nearest features are
// an edge and a vertex, minus the least penetration when they overlap, and a lower bound of the distance when two
// vertices are nearest. The edge with the largest s is the reference edge; the edge of the other polygon that
// faces it most squarely is clipped to the reference edge's extent and gives up to two points, so that two
// floes lying edge to edge resist turning. Two vertices facing each other get one point with the normal along the
// line that joins them: there an edge normal would feign a wall in front of a passing corner.
//
// The best edges seldom change, while a full search is half of the work. So a pair stores them, with their leads. For
// centroids d apart, s_i is n_i·d plus a part that depends only on the difference of the yaws; so a motion by Δd and
// turns φ changes no s_i by more than |Δd| + |φ| |d| + |φ_a − φ_b| r, and the first edge stays first while twice this
// is less than its lead over the second. Until then only these edges are tested, and the result equals that of the full
// search to the last bit. Rejected: path lengths as the bound, which need less memory (floes that are pushed ahead move
// far, but with each other).
//
// Rejected: GJK with a contact patch (more code, and iterative on a problem that has at most a dozen vertices).
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "contact/contacts.h"
#include "base/inside.h"
#include "space/cells.h"
#include "space/shore.h"
#include "base/elementary.h"

#define UNIT (2 * BT_PI / 65536) // rad, of bt_axes.turn
#define ROUNDED 5                // in UNITs: less than two per body from rounding the turn, and all other rounding
#define AROUND 50                // ties around the best within which separations are exact: they bound leads

// Bodies that are apart by less than this share of a tie touch. Where corners coincide to rounding, as on the two sides
// of a crack, their nearest features are an accident of rounding: it may be an edge whose line passes through the other
// body. The edge that separates them most gives the normal then.
#define TOUCHING 1e-6

typedef struct {
    const double *v;     ///< outline, relative to the centroid
    const double *per_length; ///< of the edges
    int count;
    double x, y;         ///< centroid in the frame of body a
} polygon;

static polygon polygon_of(const bt_bodies *bodies, bt_idx i, int part, double x, double y)
{
    int64_t first = bodies->offset[i] + part;
    // A convex body is taken whole without reading its marks, which would cost one more cache line per pair.
    const int count = part == 0 ? (int)(bodies->offset[i + 1] - first) : bodies->mark[first].count;
    return (polygon){bodies->outline + 2 * first, bodies->per_length + first, count, x, y};
}

/// Outward unit normal of edge i: its direction turned clockwise. Formed when needed: storing them would take a quarter
/// of a floe's memory.
BT_INLINE void edge_normal(const polygon *shape, int i, double *nx, double *ny)
{
    const double *v = shape->v + 2 * i, *next = shape->v + 2 * (i + 1 < shape->count ? i + 1 : 0);
    *nx = (next[1] - v[1]) * shape->per_length[i];
    *ny = (v[0] - next[0]) * shape->per_length[i];
}

/// An edge: how far it separates the other polygon from its own, and its outward unit normal.
typedef struct { double s, nx, ny; int i; } edge;

/// Edge i of p and the signed distance of q from it; if that is certainly less than `floor`, an upper bound: q contains
/// its centroid, so it comes nearer to the edge's line than the centroid. One product instead of one per vertex, and it
/// rules out two edges in three.
BT_INLINE edge edge_of(const polygon *p, int i, const polygon *q, double floor)
{
    edge side = {.i = i};
    edge_normal(p, i, &side.nx, &side.ny);
    side.s = side.nx * (q->x - p->x - p->v[2 * i]) + side.ny * (q->y - p->y - p->v[2 * i + 1]);
    if (side.s < floor) return side;
    const double *v = q->v, *end = v + 2 * q->count;
    double least = side.nx * v[0] + side.ny * v[1];
    for (v += 2; v < end; v += 2) least = bt_min(side.nx * v[0] + side.ny * v[1], least);
    side.s += least;
    return side;
}

/// The edge of p that separates q most, exact if it does so by at least `floor`, and its lead over all other edges;
/// stops at the first edge that separates by more than `enough`.
BT_INLINE edge best_edge(const polygon *p, const polygon *q, double enough, double floor, double *lead)
{
    edge best = {.s = -INFINITY};
    double second = -INFINITY;
    for (int i = 0; i < p->count && !(best.s > enough); i++) {
        const edge side = edge_of(p, i, q, floor);
        second = bt_max(second, bt_min(side.s, best.s));
        if (side.s > best.s) best = side;
    }
    *lead = best.s < floor ? 0 : best.s - second;
    return best;
}

/// Squared distance from a point to the segment e..f, and the position along it (0..1).
static double point_segment(const double *x, const double *e, const double *f, double *t)
{
    double dx = f[0] - e[0], dy = f[1] - e[1], px = x[0] - e[0], py = x[1] - e[1];
    *t = bt_min(1, bt_max(0, (px * dx + py * dy) / (dx * dx + dy * dy)));
    double rx = px - *t * dx, ry = py - *t * dy;
    return rx * rx + ry * ry;
}

static void world_vertex(const polygon *shape, int i, double out[2])
{
    out[0] = shape->v[2 * i] + shape->x;
    out[1] = shape->v[2 * i + 1] + shape->y;
}

/// Nearest features of two separated polygons, by trying every vertex against every edge. Returns true when two
/// vertices are nearest (*ip of p, *iq of q); otherwise *near is the edge and *of_q says whose.
static bool nearest_features(const polygon *p, const polygon *q, int *ip, int *iq, int *near, bool *of_q)
{
    double best = INFINITY, x[2], e[2], f[2], t;
    bool corners = false;
    for (int side = 0; side < 2; side++) {
        const polygon *with_edge = side ? q : p, *with_vertex = side ? p : q;
        for (int i = 0; i < with_edge->count; i++) {
            int next = i + 1 < with_edge->count ? i + 1 : 0;
            world_vertex(with_edge, i, e);
            world_vertex(with_edge, next, f);
            for (int j = 0; j < with_vertex->count; j++) {
                world_vertex(with_vertex, j, x);
                double d = point_segment(x, e, f, &t);
                if (d >= best) continue;
                best = d;
                corners = t <= 0 || t >= 1;
                int k = t <= 0 ? i : next;
                *ip = side ? j : k;
                *iq = side ? k : j;
                *near = i;
                *of_q = side;
            }
        }
    }
    return corners;
}

static void set_point(bt_manifold *manifold, double x, double y, double gap, double dx, double dy, uint32_t feature)
{
    // (x, y): the point midway between the surfaces, in the frame of a; (dx, dy): centroid of b.
    bt_point *p = &manifold->p[manifold->n_points++];
    *p = (bt_point){.gap = gap, .ra = {x, y}, .rb = {x - dx, y - dy}, .feature = feature};
}

BT_INLINE double cosine(const polygon *shape, int j, const edge *side)
{
    double nx, ny;
    edge_normal(shape, j, &nx, &ny);
    return side->nx * nx + side->ny * ny;
}

/// Edge of `shape` that faces edge `side` most squarely. A guess other than -1 is right if both its neighbours face
/// `side` less squarely: normals turn one way around an outline.
BT_INLINE int facing_edge(const polygon *shape, const edge *side, int guess)
{
    if (guess >= 0) {
        const double d = cosine(shape, guess, side) + 1e-9;
        if (d < cosine(shape, guess > 0 ? guess - 1 : shape->count - 1, side) &&
            d < cosine(shape, guess + 1 < shape->count ? guess + 1 : 0, side))
            return guess;
    }
    int facing = 0;
    double least = INFINITY;
    for (int j = 0; j < shape->count; j++) {
        const double d = cosine(shape, j, side);
        if (d < least) least = d, facing = j;
    }
    return facing;
}

/// Largest gap of a point; where a contact law needs both ends of an edge, by how much the gap of the farther end may
/// exceed that of the nearer, whatever the margin (contact/law_pair.h, bt_closing); the slop, m.
typedef struct { double margin, beside, slop; } bounds;

static bounds bounds_of(const bt_world *world, double margin)
{
    return (bounds){margin, world->cells->beside, world->par.slop};
}

/// Points on edge `facing` of the incident polygon that face the reference edge, or only its exposed part on a shore
/// (shown, or NULL); `flip` if the reference is b.
BT_INLINE void clip_points(const polygon *ref, const edge *side, const bt_face *shown, const polygon *inc, int facing,
                        bool flip, const double d[2], bounds most, bt_manifold *manifold)
{
    const double nx = side->nx, ny = side->ny;
    const int i = side->i;
    const double tx = -ny, ty = nx; // along the edge: outlines run anticlockwise
    double r[2], rn[2];
    world_vertex(ref, i, r);
    world_vertex(ref, i + 1 < ref->count ? i + 1 : 0, rn);
    const double from = shown ? shown->from : 0, to = shown ? shown->to : tx * (rn[0] - r[0]) + ty * (rn[1] - r[1]);

    int other = facing + 1 < inc->count ? facing + 1 : 0;
    double p[2], q[2];
    world_vertex(inc, facing, p); // the incident edge runs against the reference edge: p is far along t
    world_vertex(inc, other, q);
    const double tp = tx * (p[0] - r[0]) + ty * (p[1] - r[1]), tq = tx * (q[0] - r[0]) + ty * (q[1] - r[1]);
    const double gp = nx * (p[0] - r[0]) + ny * (p[1] - r[1]), gq = nx * (q[0] - r[0]) + ny * (q[1] - r[1]);

    manifold->nx = flip ? -nx : nx;
    manifold->ny = flip ? -ny : ny;
    manifold->flush = 0;
    const uint32_t base = ((uint32_t)flip << 31) | ((uint32_t)i << 20);
    struct { double t, gap; uint32_t id; } ends[2] = {
        {tp, gp, (uint32_t)facing << 1}, {tq, gq, (uint32_t)other << 1}};
    const double span = tp - tq;
    int n = 0, kept = 0;
    double depth = INFINITY;
    for (int k = 0; k < 2; k++) {
        double t = ends[k].t, bound = k == 0 ? to : from;
        bool beyond = k == 0 ? t > to : t < from;
        if (beyond && span > 0) {
            double f = (bound - tq) / span; // position of the bound along the incident edge, from q
            if (f < 0 || f > 1) continue;   // the whole incident edge is beyond
            ends[k].t = bound;
            ends[k].gap = gq + f * (gp - gq);
            ends[k].id = (uint32_t)(k == 0 ? i + 1 : i) << 1 | 1u;
        } else if (t < from || t > to) {
            continue;
        }
        depth = bt_min(depth, ends[k].gap);
        ends[n++] = ends[k];
    }
    if (depth > most.margin) return;
    if (n == 2 && most.beside > 0) {
        const double tilt = fabs(ends[0].gap - ends[1].gap);
        manifold->flush = fabs(ends[0].t - ends[1].t) * (tilt > most.beside ? most.beside / tilt : 1);
    }
    for (int k = 0; k < n; k++)
        if (ends[k].gap <= bt_max(most.margin, depth + most.beside)) ends[kept++] = ends[k];
    // Both points lie on one line along the edge, half-way into the smaller gap: their tangential rows are then the
    // same, and the solver can treat their friction as one unknown. The normal rows do not depend on that height.
    for (int k = 0; k < kept; k++)
        set_point(manifold, r[0] + ends[k].t * tx + 0.5 * depth * nx, r[1] + ends[k].t * ty + 0.5 * depth * ny,
                  ends[k].gap, d[0], d[1], base | ends[k].id);
}

/// The deepest vertex of inc below the reference edge as the only point.
static void deepest_point(const polygon *ref, const edge *side, const polygon *inc, bool flip, const double d[2],
                          bt_manifold *manifold)
{
    const double nx = side->nx, ny = side->ny;
    double r[2], x[2], least = INFINITY;
    int deepest = 0;
    world_vertex(ref, side->i, r);
    for (int j = 0; j < inc->count; j++) {
        world_vertex(inc, j, x);
        double g = nx * (x[0] - r[0]) + ny * (x[1] - r[1]);
        if (g < least) {
            least = g;
            deepest = j;
        }
    }
    world_vertex(inc, deepest, x);
    manifold->nx = flip ? -nx : nx;
    manifold->ny = flip ? -ny : ny;
    set_point(manifold, x[0] - 0.5 * least * nx, x[1] - 0.5 * least * ny, least, d[0], d[1],
              ((uint32_t)flip << 31) | ((uint32_t)side->i << 20) | (uint32_t)deepest << 1);
}

/// The only point from two corners, ca of a and cb of b: the normal is along the line that joins them. False beyond the
/// margin.
static bool join_corners(const polygon *a, int ca, const polygon *b, int cb, const double d[2], double margin,
                         bt_manifold *manifold)
{
    double x[2], y[2];
    world_vertex(a, ca, x);
    world_vertex(b, cb, y);
    const double gap = bt_hypot(y[0] - x[0], y[1] - x[1]);
    if (gap > margin || gap == 0) return false;
    manifold->flush = 0;
    manifold->nx = (y[0] - x[0]) / gap;
    manifold->ny = (y[1] - x[1]) / gap;
    set_point(manifold, 0.5 * (x[0] + y[0]), 0.5 * (x[1] + y[1]), gap, d[0], d[1],
              0x7ff00000u | (uint32_t)ca << 10 | (uint32_t)cb);
    return true;
}

/// Is the edge of b the reference? Two edges that face each other squarely have nearly the same separation: keep the
/// previous reference, so that features, and with them impulses, persist.
BT_INLINE bool reference_is_b(const edge *a, const edge *b, double tie, int before)
{
    bool ref_b = b->s > a->s;
    if (!isfinite(a->s) || !isfinite(b->s)) return ref_b;
    const bool square = a->nx * b->nx + a->ny * b->ny < -BT_SQUARE;
    if (square && before >= 0 && fabs(a->s - b->s) < tie) ref_b = before;
    else if (square && before < 0 && b->s < a->s + tie) ref_b = false;
    // one axis shows them apart: the tie must not feign overlap
    if (bt_max(a->s, b->s) > 0 && (ref_b ? b->s : a->s) <= 0) ref_b = !ref_b;
    return ref_b;
}

/// 1 % of the smaller floe's radius.
static double tie_of(const bt_bodies *bodies, bt_idx i, bt_idx j)
{
    return 0.01 * bt_min(bodies->radius[i], bodies->radius[j]);
}

/// Yaw in units. A NaN or absurd yaw may give any value: guards end such a run.
BT_INLINE uint16_t turn_of(double yaw) { return fabs(yaw) < 1e9 ? (uint16_t)(int64_t)(yaw * (1 / UNIT)) : 0; }

/// Relative pose of bodies i and j, with axes not yet known.
BT_INLINE bt_axes place_of(const bt_bodies *bodies, bt_idx i, bt_idx j, const double d[2])
{
    return (bt_axes){.x = (float)d[0], .y = (float)d[1], .room = -1, .edge = {-1, -1},
                     .turn = {turn_of(bodies->pose[i].yaw), turn_of(bodies->pose[j].yaw)}};
}

/// Upper bound, m, of the change of any edge's separation from `axes` to `now`; radius: the larger of the two bodies.
BT_INLINE float motion(const bt_axes *axes, const bt_axes *now, float radius)
{
    const int turn = abs((int16_t)(now->turn[0] - axes->turn[0])) + abs((int16_t)(now->turn[1] - axes->turn[1])) +
                     ROUNDED;
    const float arm = fabsf(axes->x) + fabsf(axes->y) + radius;
    return fabsf(now->x - axes->x) + fabsf(now->y - axes->y) + (float)turn * (float)UNIT * arm;
}

/// The edges `side` of a and b that separate the two most. False as soon as one separates by more than the margin. The
/// edges of the last search usually do so again, or are certainly still the best (motion). Otherwise an edge that
/// separates by less than these, by more than the tie, can be neither the best nor a tie. An edge that is ruled out has
/// s = -∞.
BT_INLINE bool find_axes(const polygon *a, const polygon *b, double margin, double tie, float radius,
                         const bt_axes *now, bt_axes *axes, edge side[2])
{
    side[0] = axes->edge[0] >= 0 ? edge_of(a, axes->edge[0], b, -INFINITY) : (edge){-INFINITY, .i = -1};
    side[1] = axes->edge[1] >= 0 ? edge_of(b, axes->edge[1], a, -INFINITY) : (edge){-INFINITY, .i = -1};
    const double known = bt_max(side[0].s, side[1].s);
    if (known > margin) return false;
    if (motion(axes, now, radius) < axes->room) return true;
    double lead[2];
    *axes = *now;
    side[0] = best_edge(a, b, margin, known - AROUND * tie, &lead[0]);
    axes->edge[0] = (int8_t)side[0].i;
    if (side[0].s > margin) return false;
    side[1] = best_edge(b, a, margin, bt_max(known, side[0].s) - AROUND * tie, &lead[1]);
    axes->edge[1] = (int8_t)side[1].i;
    const bool first = side[1].s > side[0].s;
    const double both = bt_min(lead[0], lead[1]), alone = bt_min(lead[first], fabs(side[0].s - side[1].s) - tie);
    if (alone > both) axes->edge[!first] = -1;
    if (side[1].s > margin) return false;
    axes->room = (float)(0.5 * bt_max(both, alone));
    return true;
}

/// Manifold of convex bodies. *gap: the largest separation, a lower bound of the distance.
BT_FOR_EACH_CPU
static bool bodies_touch(const bt_world *world, bt_idx a, bt_idx b, double margin, int reference_before,
                         bt_manifold *manifold, bt_axes *axes, double *gap)
{
    double d[2];
    bt_bodies_offset(world, a, b, d);
    const bt_axes now = place_of(&world->bodies, a, b, d);
    const polygon shape[2] = {polygon_of(&world->bodies, a, 0, 0, 0), polygon_of(&world->bodies, b, 0, d[0], d[1])};
    const double tie = tie_of(&world->bodies, a, b);
    const float radius = (float)bt_max(world->bodies.radius[a], world->bodies.radius[b]);
    edge side[2];
    const bool apart = !find_axes(&shape[0], &shape[1], margin, tie, radius, &now, axes, side);
    *gap = bt_max(side[0].s, side[1].s);
    if (apart) return false;
    const bool ref = reference_is_b(&side[0], &side[1], tie, reference_before);
    const double sep = side[ref].s;

    manifold->a = a, manifold->b = b, manifold->n_points = 0; // the rest is set with the points
    const bounds most = bounds_of(world, margin);
    clip_points(&shape[ref], &side[ref], NULL, &shape[!ref], facing_edge(&shape[!ref], &side[ref], side[!ref].i), ref,
                d, most, manifold);
    if (!(sep > TOUCHING * tie)) {
        if (manifold->n_points == 0) deepest_point(&shape[ref], &side[ref], &shape[!ref], ref, d, manifold);
        return true;
    }
    if (manifold->n_points > 0 && bt_min(manifold->p[0].gap, manifold->p[manifold->n_points - 1].gap) <= sep + tie)
        return true;
    // The nearest vertex lies beside the reference edge, and not by the tilt of two nearly parallel edges: a corner is
    // near.
    manifold->n_points = 0;
    int ca = 0, cb = 0, near = 0;
    bool of_b = false;
    if (nearest_features(&shape[0], &shape[1], &ca, &cb, &near, &of_b))
        return join_corners(&shape[0], ca, &shape[1], cb, d, margin, manifold);
    const edge with = edge_of(&shape[of_b], near, &shape[!of_b], INFINITY);
    clip_points(&shape[of_b], &with, NULL, &shape[!of_b], facing_edge(&shape[!of_b], &with, -1), of_b, d, most,
                manifold);
    return manifold->n_points > 0;
}

// --- bodies that are not convex, and shores --------------------------------------------------------------------------
//
// The parts of such a body are convex, but some of their edges are cuts through the ice, and some of their corners are
// no corners of the body. A contact there would be spurious: a floe that slides along a shore of two parts would be
// stopped by the corner of the part ahead ("ghost" or "internal edge" collisions). So a contact counts only where the
// outline itself can be touched:
//   an edge       is one of the outline, not a cut;
//   a corner V    of the outline, with edges e1 → V → e2, is convex, and the direction n from the body to the other one
//                 lies in its normal cone: n·e1 >= 0 and n·e2 <= 0.
// A contact left out here is found with the part that has the edge, or with the part on the other side of the cut.
// Parts that are apart touch at their nearest features, if these count. If not, and the vertex nearest to the best edge
// that counts lies past an end where the outline has no corner, that vertex belongs to the next part, and the other
// vertices still meet this edge: a tilted edge over a seam or a bay has one corner over each part. (Without this the
// farther one ran into the ice.) Overlapping parts separate along the best axis that counts, unless that is much
// farther than along the best of all: the middle one of three parts that share a corner has edges of the outline only
// on its far side. An edge past whose end, a corner, the other's vertex lies is not the one it came through
// (past_an_end).
//
// The pieces of a shore (space/shore.h) are such parts of one outline: their edges and corners count where they lie on
// its boundary.

// rad by which a direction may stand outside a cone: two parts of a straight shore may both count, never neither
#define CONE 1e-6
#define STRAIGHT 0.01 // rad by which an outline may turn where it is no corner that bears
#define DETOUR 4  // depth along an axis that counts / depth along the best of all; more only within the tie

typedef struct {
    polygon p;
    const bt_mark *mark;
    const double *outline; ///< of the body
    int corners;
    const bt_face *face;   ///< of a shore: which stretches count
    bool whole;            ///< the body is convex and alone: everything counts
} part_of_body;

static part_of_body part_of(const bt_world *world, bt_idx i, int part, double x, double y)
{
    const bt_bodies *bodies = &world->bodies;
    const int64_t first = bodies->offset[i];
    const bt_face *face = bt_shore_faces(world->shore, bodies->gid[i], part);
    return (part_of_body){polygon_of(bodies, i, part, x, y), bodies->mark + first + part, bodies->outline + 2 * first,
                          bt_body_corners(bodies, i), face, part == 0 && !face};
}

static bool edge_counts(const part_of_body *part, int i)
{
    const int next = i + 1 < part->p.count ? i + 1 : 0, after = part->mark[i].corner + 1;
    if (part->face) return part->face[i].from < part->face[i].to;
    return part->whole || part->mark[next].corner == (after < part->corners ? after : 0);
}

/// The edges of the outline before and after corner i of a part of a floe.
static void edges_at(const part_of_body *part, int i, double before[2], double after[2])
{
    const int here = part->mark[i].corner, last = here > 0 ? here - 1 : part->corners - 1,
              next = here + 1 < part->corners ? here + 1 : 0;
    for (int k = 0; k < 2; k++) {
        before[k] = part->outline[2 * here + k] - part->outline[2 * last + k];
        after[k] = part->outline[2 * next + k] - part->outline[2 * here + k];
    }
}

static bool corner_counts(const part_of_body *part, int i, double nx, double ny)
{
    if (part->whole) return true;
    if (part->face) return bt_shore_in_cone(&part->face[i], nx, ny);
    double a[2], b[2];
    edges_at(part, i, a, b);
    if (a[0] * b[1] - a[1] * b[0] <= 0) return false;
    return nx * a[0] + ny * a[1] >= -CONE * bt_hypot(a[0], a[1]) &&
           nx * b[0] + ny * b[1] <= CONE * bt_hypot(b[0], b[1]);
}

/// Vertex of `shape` that reaches farthest against (nx, ny).
static int support(const polygon *shape, double nx, double ny)
{
    int at = 0;
    double least = INFINITY;
    for (int j = 0; j < shape->count; j++) {
        const double s = nx * shape->v[2 * j] + ny * shape->v[2 * j + 1];
        if (s < least) least = s, at = j;
    }
    return at;
}

/// Is edge i of a shore, and covered by others at an end?
static bool covered_at_an_end(const part_of_body *part, int i)
{
    const bt_face *face = part->face ? &part->face[i] : NULL;
    return face && (face->from > 0 || face->to * part->p.per_length[i] < 1 - 1e-9);
}

/// Is x beside an exposed stretch of edge i?
static bool shows_at(const part_of_body *part, int i, const double x[2])
{
    const bt_face *face = &part->face[i];
    double nx, ny, v[2];
    edge_normal(&part->p, i, &nx, &ny);
    world_vertex(&part->p, i, v);
    const double t = nx * (x[1] - v[1]) - ny * (x[0] - v[0]), slack = 1e-3 / part->p.per_length[i];
    return face->from < face->to && t >= face->from - slack && t <= face->to + slack;
}

/// How far edge j of q reaches past the end of edge i of p at `vertex`, m, and the *gap of its end, if p is cut there
/// from the rest of a straight shore; else −∞.
static double past_seam(const part_of_body *p, int i, const part_of_body *q, int j, int vertex, double *gap)
{
    const int end = vertex != i;
    double nx, ny, v[2], x[2], past = -INFINITY;
    if (!p->face || !p->face[i].on[end]) return past;
    edge_normal(&p->p, i, &nx, &ny);
    world_vertex(&p->p, end && i + 1 == p->p.count ? 0 : i + end, v);
    for (int k = 0; k < 2; k++) {
        world_vertex(&q->p, k && j + 1 == q->p.count ? 0 : j + k, x);
        const double along = (end ? 1 : -1) * (nx * (x[1] - v[1]) - ny * (x[0] - v[0]));
        if (along > past) past = along, *gap = nx * (x[0] - v[0]) + ny * (x[1] - v[1]);
    }
    return past;
}

/// clip_points, without points on a cut: if the edge that faces the reference is a cut, only its ends can count; if
/// others cover an end of it, only its exposed stretch. A point at the seam of a straight shore, on an edge that
/// reaches past it, goes if the end of the edge is too far off for a point. False if therefore none is left.
static bool clip_what_counts(const part_of_body *ref, const edge *side, const part_of_body *inc, bool flip,
                             const double d[2], bounds most, bt_manifold *manifold)
{
    const int facing = facing_edge(&inc->p, side, -1);
    clip_points(&ref->p, side, ref->face ? &ref->face[side->i] : NULL, &inc->p, facing, flip, d, most, manifold);
    const bool partly = covered_at_an_end(inc, facing), all = edge_counts(inc, facing) && !partly;
    int kept = 0, beyond = 0;
    for (int k = 0; k < manifold->n_points; k++) {
        const uint32_t id = manifold->p[k].feature & 0xfffff; // vertex, and whether it belongs to the reference
        const int vertex = (int)(id >> 1), of_ref = id & 1;
        double gap = 0;
        const double past = of_ref ? past_seam(ref, side->i, inc, facing, vertex, &gap)
                                   : past_seam(inc, facing, ref, side->i, vertex, &gap);
        if (past > most.slop && gap > bt_max(most.margin, manifold->p[k].gap + most.beside)) {
            beyond++;
            continue;
        }
        const bool corner = !of_ref && corner_counts(inc, vertex, -side->nx, -side->ny);
        if (!all && !corner && !(partly && shows_at(inc, facing, manifold->p[k].ra))) continue;
        manifold->p[kept++] = manifold->p[k];
    }
    manifold->n_points = kept;
    return kept > 0 || beyond == 0;
}

/// Do others cover an end of edge `side` of p, or of the edge of q that faces it, leaving no contact point?
static bool beside_what_shows(const part_of_body *p, const edge *side, const part_of_body *q)
{
    if (!covered_at_an_end(p, side->i) && !(q->face && covered_at_an_end(q, facing_edge(&q->p, side, -1))))
        return false;
    bt_manifold manifold = {0};
    clip_what_counts(p, side, q, false, (double[2]){0, 0}, (bounds){.margin = INFINITY}, &manifold);
    return manifold.n_points == 0;
}

/// Among edges of p that count, against corners of q that count, the edge that separates q most.
static edge best_that_counts(const part_of_body *p, const part_of_body *q)
{
    edge best = {.s = -INFINITY};
    for (int i = 0; i < p->p.count; i++) {
        if (!edge_counts(p, i)) continue;
        const edge side = edge_of(&p->p, i, &q->p, -INFINITY);
        if (side.s > best.s && corner_counts(q, support(&q->p, side.nx, side.ny), -side.nx, -side.ny) &&
            !beside_what_shows(p, &side, q))
            best = side;
    }
    return best;
}

/// Is vertex i a convex corner of the outline (bt_contacts_at_corner)?
static bool is_corner(const part_of_body *part, int i)
{
    if (part->whole) return true;
    if (part->face) {
        const double *u = part->face[i].u, *w = part->face[i].w;
        return u[0] * w[1] - u[1] * w[0] > STRAIGHT;
    }
    double a[2], b[2];
    edges_at(part, i, a, b);
    return a[0] * b[1] - a[1] * b[0] > STRAIGHT * bt_hypot(a[0], a[1]) * bt_hypot(b[0], b[1]);
}

/// Does the vertex of q deepest behind edge `side` of p lie past an end of it that is a corner, or past one that is
/// none? Past a corner it has not come through this edge, but through the next one.
static bool past_an_end(const part_of_body *p, const edge *side, const part_of_body *q, bool corner)
{
    const int i = side->i, next = i + 1 < p->p.count ? i + 1 : 0;
    double x[2], v[2], end[2];
    world_vertex(&q->p, support(&q->p, side->nx, side->ny), x);
    world_vertex(&p->p, i, v);
    world_vertex(&p->p, next, end);
    return (side->nx * (x[1] - v[1]) < side->ny * (x[0] - v[0]) && is_corner(p, i) == corner) ||
           (side->nx * (x[1] - end[1]) > side->ny * (x[0] - end[0]) && is_corner(p, next) == corner);
}

static double least_gap(const bt_manifold *m)
{
    return m->n_points == 0 ? INFINITY : bt_min(m->p[0].gap, m->p[m->n_points - 1].gap);
}

/// Contact at the nearest features of two separate parts, if both count.
static bool nearest_contact(const part_of_body *a, const part_of_body *b, const double d[2], bounds most,
                            bt_manifold *manifold)
{
    int ca = 0, cb = 0, near = 0;
    bool of_b = false;
    *manifold = (bt_manifold){.a = manifold->a, .b = manifold->b};
    if (nearest_features(&a->p, &b->p, &ca, &cb, &near, &of_b)) {
        return join_corners(&a->p, ca, &b->p, cb, d, most.margin, manifold) &&
               corner_counts(a, ca, manifold->nx, manifold->ny) && corner_counts(b, cb, -manifold->nx, -manifold->ny);
    }
    const part_of_body *ref = of_b ? b : a, *inc = of_b ? a : b;
    const edge side = edge_of(&ref->p, near, &inc->p, INFINITY);
    if (!edge_counts(ref, near) || !corner_counts(inc, of_b ? ca : cb, -side.nx, -side.ny) ||
        beside_what_shows(ref, &side, inc))
        return false;
    if (!clip_what_counts(ref, &side, inc, of_b, d, most, manifold)) return false;
    if (manifold->n_points == 0) deepest_point(&ref->p, &side, &inc->p, of_b, d, manifold);
    return least_gap(manifold) <= most.margin;
}

static bool parts_touch(const bt_world *world, bt_idx ia, bt_idx ib, const uint16_t part[2], double margin,
                        int reference_before, bt_manifold *manifold, bt_axes *known, double *gap)
{
    double d[2];
    bt_bodies_offset(world, ia, ib, d);
    const part_of_body p[2] = {part_of(world, ia, part[0], 0, 0), part_of(world, ib, part[1], d[0], d[1])};
    const double tie = tie_of(&world->bodies, ia, ib);
    // A part need not contain its body's centroid, which best_edge relies on: all edges in full, the last axis first.
    const int n_a = p[0].p.count, n = n_a + p[1].p.count,
              hint = known->edge[0] >= 0 ? known->edge[0] : known->edge[1] >= 0 ? n_a + known->edge[1] : 0;
    *known = (bt_axes)BT_NO_AXES;
    double best = -INFINITY;
    for (int k = 0; k < n && !(best > margin); k++) {
        const int axis = k == 0 ? hint : k <= hint ? k - 1 : k, in_b = axis >= n_a;
        const edge side = edge_of(&p[in_b].p, in_b ? axis - n_a : axis, &p[!in_b].p, -INFINITY);
        if (side.s <= best) continue;
        best = side.s;
        known->edge[in_b] = (int8_t)side.i;
        known->edge[!in_b] = -1;
    }
    *gap = best;
    if (best > margin) return false;

    *manifold = (bt_manifold){.a = ia, .b = ib};
    const bounds most = bounds_of(world, margin);
    const edge side[2] = {best_that_counts(&p[0], &p[1]), best_that_counts(&p[1], &p[0])};
    const bool ref = reference_is_b(&side[0], &side[1], tie, reference_before);
    const double sep = side[ref].s;
    if (best > TOUCHING * tie) {
        const part_of_body *from = &p[ref], *to = &p[!ref];
        if (sep > 0 && sep >= best - tie) {
            if (!clip_what_counts(from, &side[ref], to, ref, d, most, manifold)) return false;
            if (least_gap(manifold) <= sep + tie) return true;
        }
        if (nearest_contact(&p[0], &p[1], d, most, manifold)) return true;
        if (!isfinite(sep) || !past_an_end(from, &side[ref], to, false)) return false;
        *manifold = (bt_manifold){.a = ia, .b = ib};
        clip_what_counts(from, &side[ref], to, ref, d, most, manifold);
        return manifold->n_points > 0 && least_gap(manifold) > 0;
    }
    for (int k = 0; k < 2; k++) {
        const bool from_b = k == 0 ? ref : !ref;
        const part_of_body *from = &p[from_b], *to = &p[!from_b];
        if (!(-side[from_b].s <= bt_max(tie, -DETOUR * best))) continue;
        if (!clip_what_counts(from, &side[from_b], to, from_b, d, most, manifold)) return false;
        if (manifold->n_points > 0) return true;
        if (-side[from_b].s > tie && past_an_end(from, &side[from_b], to, true)) continue;
        deepest_point(&from->p, &side[from_b], &to->p, from_b, d, manifold);
        return true;
    }
    return false;
}

bool bt_contacts_at_corner(const bt_world *world, const bt_pair *pair, uint32_t feature)
{
    if ((feature & 0x7ff00000u) == 0x7ff00000u) return true; // join_corners
    const bool in_b = (feature >> 31) == (feature & 1);
    const part_of_body part = part_of(world, in_b ? pair->b : pair->a, pair->part[in_b], 0, 0);
    return is_corner(&part, (int)((feature & 0xfffff) >> 1) % part.p.count);
}

/// Is each of the pair the only polygon of its outline?
static bool are_whole(const bt_world *world, bt_idx a, bt_idx b, const uint16_t part[2])
{
    return part[0] == 0 && part[1] == 0 && !bt_shore_holds(world, a) && !bt_shore_holds(world, b);
}

bool bt_contacts_near(const bt_world *world, bt_idx a, bt_idx b, const uint16_t part[2], double margin)
{
    bt_manifold manifold;
    bt_axes axes = BT_NO_AXES;
    double gap;
    if (are_whole(world, a, b, part)) return bodies_touch(world, a, b, margin, -1, &manifold, &axes, &gap);
    parts_touch(world, a, b, part, margin, -1, &manifold, &axes, &gap); // perhaps nothing that counts is near
    return gap <= margin;
}

bool bt_contacts_parts(const bt_world *world, bt_idx a, bt_idx b, const uint16_t part[2], double margin,
                       int reference_before, bt_manifold *manifold, bt_axes *axes)
{
    bt_axes none = BT_NO_AXES, *known = axes ? axes : &none;
    double gap;
    const bool whole = are_whole(world, a, b, part);
    const bool touch = whole ? bodies_touch(world, a, b, margin, reference_before, manifold, known, &gap)
                             : parts_touch(world, a, b, part, margin, reference_before, manifold, known, &gap);
    const double reach = gap + world->bodies.path[a] + world->bodies.path[b];
    known->reach = (float)(reach - 1e-6 * fabs(reach));
    return touch;
}
