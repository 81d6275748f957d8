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
// Rejected: GJK with a contact patch (more code, and iterative on a problem that has at most a dozen vertices).
#include <math.h>
#include <string.h>

#include "contact/contacts.h"
#include "space/cells.h"
#include "space/shore.h"
#include "base/elementary.h"

typedef struct {
    const double *v;     ///< outline, relative to the centroid
    const double *per_length; ///< of the edges
    int count;
    double x, y;         ///< centroid in the frame of body a
} polygon;

static polygon polygon_of(const bt_bodies *b, bt_idx i, int part, double x, double y)
{
    int64_t first = b->offset[i] + part;
    // The whole of a convex body without a look at its marks: they would be one more line of memory in every pair.
    const int count = part == 0 ? (int)(b->offset[i + 1] - first) : b->mark[first].count;
    return (polygon){b->outline + 2 * first, b->per_length + first, count, x, y};
}

/// Outward unit normal of edge i: its direction turned clockwise. Formed when needed: kept ones would be a fourth of a
/// floe's memory.
static inline void edge_normal(const polygon *p, int i, double *nx, double *ny)
{
    const double *v = p->v + 2 * i, *next = p->v + 2 * (i + 1 < p->count ? i + 1 : 0);
    *nx = (next[1] - v[1]) * p->per_length[i];
    *ny = (v[0] - next[0]) * p->per_length[i];
}

/// Signed distance of q from edge i of p; −∞ when it is certainly less than `floor`: q holds its centroid, so it
/// reaches nearer to the edge's line than that does. One product instead of one a vertex, and it rules out two edges of
/// three.
static inline double edge_separation(const polygon *p, int i, const polygon *q, double floor)
{
    double nx, ny;
    edge_normal(p, i, &nx, &ny);
    const double centre = nx * (q->x - p->x - p->v[2 * i]) + ny * (q->y - p->y - p->v[2 * i + 1]);
    if (centre < floor) return -INFINITY;
    double least = INFINITY;
    for (int j = 0; j < q->count; j++) least = bt_min(least, nx * q->v[2 * j] + ny * q->v[2 * j + 1]);
    return least + centre;
}

/// Largest edge separation of q from p, exact if it is at least `floor`; stops at the first edge that separates by more
/// than `enough`.
static double max_separation(const polygon *p, const polygon *q, double enough, double floor, int *edge)
{
    double best = -INFINITY;
    for (int i = 0; i < p->count; i++) {
        const double s = edge_separation(p, i, q, floor);
        if (s > best) {
            best = s;
            *edge = i;
            if (best > enough) break;
        }
    }
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

static void world_vertex(const polygon *p, int i, double out[2])
{
    out[0] = p->v[2 * i] + p->x;
    out[1] = p->v[2 * i + 1] + p->y;
}

/// Nearest features of two separated polygons, by trying every vertex against every edge. Returns true when two
/// vertices are nearest (*ip of p, *iq of q); otherwise *edge is the edge and *of_q says whose.
static bool nearest_features(const polygon *p, const polygon *q, int *ip, int *iq, int *edge, bool *of_q)
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
                *edge = i;
                *of_q = side;
            }
        }
    }
    return corners;
}

static void set_point(bt_manifold *m, double x, double y, double gap, double dx, double dy, uint32_t feature)
{
    // (x, y): the point midway between the surfaces, in the frame of a; (dx, dy): centroid of b.
    bt_point *p = &m->p[m->n_points++];
    *p = (bt_point){.gap = gap, .ra = {x, y}, .rb = {x - dx, y - dy}, .feature = feature};
}

/// Edge of q that faces a normal most squarely.
static int facing_edge(const polygon *q, double nx, double ny)
{
    int facing = 0;
    double least = INFINITY;
    for (int j = 0; j < q->count; j++) {
        double jx, jy;
        edge_normal(q, j, &jx, &jy);
        double d = nx * jx + ny * jy;
        if (d < least) {
            least = d;
            facing = j;
        }
    }
    return facing;
}

/// How far points may be apart: from the other body; and, where a contact law asks for both ends of an edge, beyond the
/// nearer one, however near that is to the margin (contact/law.h, bt_closing).
typedef struct { double margin, beside; } bounds;

static bounds bounds_of(const bt_world *w, double margin) { return (bounds){margin, w->cells->beside}; }

/// Points of the incident polygon that face reference edge i, or what counts of it on a shore (shown, or NULL); `flip`
/// when the reference is b.
static void clip_points(const polygon *ref, int i, const bt_face *shown, const polygon *inc, bool flip, double dx,
                        double dy, bounds most, bt_manifold *m)
{
    double nx, ny;
    edge_normal(ref, i, &nx, &ny);
    const double tx = -ny, ty = nx; // along the edge: outlines run anticlockwise
    double r[2], rn[2];
    world_vertex(ref, i, r);
    world_vertex(ref, i + 1 < ref->count ? i + 1 : 0, rn);
    const double from = shown ? shown->from : 0, to = shown ? shown->to : tx * (rn[0] - r[0]) + ty * (rn[1] - r[1]);

    const int facing = facing_edge(inc, nx, ny);
    int other = facing + 1 < inc->count ? facing + 1 : 0;
    double p[2], q[2];
    world_vertex(inc, facing, p); // the incident edge runs against the reference edge: p is far along t
    world_vertex(inc, other, q);
    const double tp = tx * (p[0] - r[0]) + ty * (p[1] - r[1]), tq = tx * (q[0] - r[0]) + ty * (q[1] - r[1]);
    const double gp = nx * (p[0] - r[0]) + ny * (p[1] - r[1]), gq = nx * (q[0] - r[0]) + ny * (q[1] - r[1]);

    m->nx = flip ? -nx : nx;
    m->ny = flip ? -ny : ny;
    m->flush = 0;
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
        m->flush = fabs(ends[0].t - ends[1].t) * (tilt > most.beside ? most.beside / tilt : 1);
    }
    for (int k = 0; k < n; k++)
        if (ends[k].gap <= bt_max(most.margin, depth + most.beside)) ends[kept++] = ends[k];
    // Both points on one line along the edge, half-way into the smaller gap: their tangential rows are then the same,
    // and the solver can treat the friction of the pair as one. The normal rows do not depend on that height.
    for (int k = 0; k < kept; k++)
        set_point(m, r[0] + ends[k].t * tx + 0.5 * depth * nx, r[1] + ends[k].t * ty + 0.5 * depth * ny, ends[k].gap,
                  dx, dy, base | ends[k].id);
}

/// The deepest vertex of inc below reference edge i as the only point.
static void deepest_point(const polygon *ref, int i, const polygon *inc, bool flip, double dx, double dy,
                          bt_manifold *m)
{
    double nx, ny;
    edge_normal(ref, i, &nx, &ny);
    double r[2], x[2], least = INFINITY;
    int deepest = 0;
    world_vertex(ref, i, r);
    for (int j = 0; j < inc->count; j++) {
        world_vertex(inc, j, x);
        double g = nx * (x[0] - r[0]) + ny * (x[1] - r[1]);
        if (g < least) {
            least = g;
            deepest = j;
        }
    }
    world_vertex(inc, deepest, x);
    m->nx = flip ? -nx : nx;
    m->ny = flip ? -ny : ny;
    set_point(m, x[0] - 0.5 * least * nx, x[1] - 0.5 * least * ny, least, dx, dy,
              ((uint32_t)flip << 31) | ((uint32_t)i << 20) | (uint32_t)deepest << 1);
}

/// Two corners, ca of a and cb of b, as the only point: the normal is along the line that joins them. False beyond the
/// margin.
static bool join_corners(const polygon *a, int ca, const polygon *b, int cb, const double d[2], double margin,
                         bt_manifold *m)
{
    double x[2], y[2];
    world_vertex(a, ca, x);
    world_vertex(b, cb, y);
    const double gap = bt_hypot(y[0] - x[0], y[1] - x[1]);
    if (gap > margin || gap == 0) return false;
    m->flush = 0;
    m->nx = (y[0] - x[0]) / gap;
    m->ny = (y[1] - x[1]) / gap;
    set_point(m, 0.5 * (x[0] + y[0]), 0.5 * (x[1] + y[1]), gap, d[0], d[1],
              0x7ff00000u | (uint32_t)ca << 10 | (uint32_t)cb);
    return true;
}

/// An edge of each polygon, and how far it separates the two; −∞ where none counts.
typedef struct { double sa, sb; int ia, ib; } best_axes;

/// Is the edge of b the reference? Two edges that face each other squarely have nearly the same separation: keep the
/// reference of the step before, so that features, and with them impulses, persist.
static inline bool reference_is_b(const polygon *a, const polygon *b, const best_axes *s, double tie, int before)
{
    bool ref_b = s->sb > s->sa;
    if (!isfinite(s->sa) || !isfinite(s->sb)) return ref_b;
    double ax, ay, bx, by;
    edge_normal(a, s->ia, &ax, &ay);
    edge_normal(b, s->ib, &bx, &by);
    const bool square = ax * bx + ay * by < -0.98;
    if (square && before >= 0 && fabs(s->sa - s->sb) < tie) ref_b = before;
    else if (square && before < 0 && s->sb < s->sa + tie) ref_b = false;
    // apart by one of them: the tie must not feign overlap
    if (bt_max(s->sa, s->sb) > 0 && (ref_b ? s->sb : s->sa) <= 0) ref_b = !ref_b;
    return ref_b;
}

/// 1 % of the smaller floe's radius.
static double tie_of(const bt_bodies *b, bt_idx i, bt_idx j) { return 0.01 * bt_min(b->radius[i], b->radius[j]); }

/// The edges that separate a and b most. False, with a separating axis and its gap, as soon as one separates by more
/// than the margin. *axis on entry: the one of the last step. It usually separates again. Where not, an edge that
/// separates by less than that one, and by more than the tie, is neither the best nor in question; so only the others
/// are looked at in full, and the result is the same with any hint.
static bool find_axes(const polygon *a, const polygon *b, double margin, double tie, best_axes *s, double *gap,
                      int32_t *axis)
{
    const int32_t hint = *axis;
    double known = -INFINITY;
    if (hint >= 0 && hint < a->count + b->count) {
        known = hint < a->count ? edge_separation(a, hint, b, -INFINITY)
                                : edge_separation(b, hint - a->count, a, -INFINITY);
        *gap = known;
        if (known > margin) return false;
    }
    s->sa = *gap = max_separation(a, b, margin, known - 2 * tie, &s->ia);
    *axis = s->ia;
    if (s->sa > margin) return false;
    s->sb = *gap = max_separation(b, a, margin, bt_max(known, s->sa) - 2 * tie, &s->ib);
    *axis = a->count + s->ib;
    return !(s->sb > margin);
}

/// Of bodies that are convex.
static bool bodies_touch(const bt_world *w, bt_idx a, bt_idx b, double margin, int reference_before, bt_manifold *m,
                         double *gap_out, int32_t *axis_out)
{
    double d[2];
    bt_bodies_offset(w, a, b, d);
    const polygon pa = polygon_of(&w->bodies, a, 0, 0, 0), pb = polygon_of(&w->bodies, b, 0, d[0], d[1]);
    const double tie = tie_of(&w->bodies, a, b);
    best_axes s = {0};
    if (!find_axes(&pa, &pb, margin, tie, &s, gap_out, axis_out)) return false;
    const bool ref_b = reference_is_b(&pa, &pb, &s, tie, reference_before);
    const double sep = ref_b ? s.sb : s.sa;
    const int edge = ref_b ? s.ib : s.ia;
    *gap_out = bt_max(s.sa, s.sb);
    *axis_out = ref_b ? pa.count + s.ib : s.ia;

    *m = (bt_manifold){.a = a, .b = b};
    const polygon *ref = ref_b ? &pb : &pa, *inc = ref_b ? &pa : &pb;
    const bounds most = bounds_of(w, margin);
    clip_points(ref, edge, NULL, inc, ref_b, d[0], d[1], most, m);
    if (!(sep > 0)) {
        if (m->n_points == 0) deepest_point(ref, edge, inc, ref_b, d[0], d[1], m);
        return true;
    }
    if (m->n_points > 0 && bt_min(m->p[0].gap, m->p[m->n_points - 1].gap) <= sep + tie) return true;
    // The nearest vertex lies beside the reference edge, and not by the tilt of two nearly parallel edges: a corner is
    // near.
    m->n_points = 0;
    int ca = 0, cb = 0, e = 0;
    bool of_b = false;
    if (nearest_features(&pa, &pb, &ca, &cb, &e, &of_b)) return join_corners(&pa, ca, &pb, cb, d, margin, m);
    clip_points(of_b ? &pb : &pa, e, NULL, of_b ? &pa : &pb, of_b, d[0], d[1], most, m);
    return m->n_points > 0;
}

// --- bodies that are not convex, and shores --------------------------------------------------------------------------
//
// The parts of such a body are convex, but some of their edges are cuts through the ice, and some of their corners are
// no corners of the body. A contact there would be with something that is not there: a floe that slides along a shore
// of two parts would be stopped by the corner of the part ahead ("ghost" or "internal edge" collisions). So a contact
// counts only where the outline itself can be touched:
//   an edge       is one of the outline, not a cut;
//   a corner V    of the outline, with edges e1 → V → e2, is convex, and the direction n from the body to the other one
//                 lies in its normal cone: n·e1 >= 0 and n·e2 <= 0.
// What is left out here is found with the part that has the edge, or with the one on the other side of the cut. Parts
// that are apart touch at their nearest features or not at all. Parts that overlap part along the best axis that
// counts, if that is not much farther than along the best of all: the middle one of three parts that share a corner
// has edges of the outline only on its far side.
//
// Of a shore (space/shore.h) the pieces are such parts of one outline: their edges and corners count where they are on
// the boundary of it.

// rad by which a direction may stand outside a cone: two parts of a straight shore may both answer, never none
#define CONE 1e-6
#define DETOUR 4  // depth along an axis that counts / depth along the best of all; more only within the tie

typedef struct {
    polygon p;
    const bt_mark *mark;
    const double *outline; ///< of the body
    int corners;
    const bt_face *face;   ///< of a shore: it says what counts
    bool whole;            ///< the body is convex and alone: everything counts
} part_of_body;

static part_of_body part_of(const bt_world *w, bt_idx i, int part, double x, double y)
{
    const bt_bodies *b = &w->bodies;
    const int64_t first = b->offset[i];
    const bt_face *face = bt_shore_faces(w->shore, b->gid[i], part);
    return (part_of_body){polygon_of(b, i, part, x, y), b->mark + first + part, b->outline + 2 * first,
                          bt_body_corners(b, i), face, part == 0 && !face};
}

static bool edge_counts(const part_of_body *q, int i)
{
    const int next = i + 1 < q->p.count ? i + 1 : 0, after = q->mark[i].corner + 1;
    if (q->face) return q->face[i].from < q->face[i].to;
    return q->whole || q->mark[next].corner == (after < q->corners ? after : 0);
}

static bool corner_counts(const part_of_body *q, int i, double nx, double ny)
{
    if (q->whole) return true;
    if (q->face) return bt_shore_in_cone(&q->face[i], nx, ny);
    const int here = q->mark[i].corner, before = here > 0 ? here - 1 : q->corners - 1,
              after = here + 1 < q->corners ? here + 1 : 0;
    const double *o = q->outline;
    const double ax = o[2 * here] - o[2 * before], ay = o[2 * here + 1] - o[2 * before + 1];
    const double bx = o[2 * after] - o[2 * here], by = o[2 * after + 1] - o[2 * here + 1];
    if (ax * by - ay * bx <= 0) return false;
    return nx * ax + ny * ay >= -CONE * bt_hypot(ax, ay) && nx * bx + ny * by <= CONE * bt_hypot(bx, by);
}

/// Vertex of q that reaches farthest against (nx, ny).
static int support(const polygon *q, double nx, double ny)
{
    int at = 0;
    double least = INFINITY;
    for (int j = 0; j < q->count; j++) {
        const double s = nx * q->v[2 * j] + ny * q->v[2 * j + 1];
        if (s < least) least = s, at = j;
    }
    return at;
}

/// Is edge i of a shore, and covered by others at an end?
static bool covered_at_an_end(const part_of_body *q, int i)
{
    const bt_face *f = q->face ? &q->face[i] : NULL;
    return f && (f->from > 0 || f->to * q->p.per_length[i] < 1 - 1e-9);
}

/// Is x beside a stretch of edge i that shows?
static bool shows_at(const part_of_body *q, int i, const double x[2])
{
    const bt_face *f = &q->face[i];
    double nx, ny, v[2];
    edge_normal(&q->p, i, &nx, &ny);
    world_vertex(&q->p, i, v);
    const double t = nx * (x[1] - v[1]) - ny * (x[0] - v[0]), slack = 1e-3 / q->p.per_length[i];
    return f->from < f->to && t >= f->from - slack && t <= f->to + slack;
}

/// clip_points, without points on a cut: where the edge that faces the reference is one, only its ends can count, and
/// where others cover an end of it, what shows.
static void clip_what_counts(const part_of_body *ref, int i, const part_of_body *inc, bool flip, const double d[2],
                             bounds most, bt_manifold *m)
{
    clip_points(&ref->p, i, ref->face ? &ref->face[i] : NULL, &inc->p, flip, d[0], d[1], most, m);
    double nx, ny;
    edge_normal(&ref->p, i, &nx, &ny);
    const int facing = facing_edge(&inc->p, nx, ny);
    const bool partly = covered_at_an_end(inc, facing);
    if (edge_counts(inc, facing) && !partly) return;
    int kept = 0;
    for (int k = 0; k < m->n_points; k++) {
        const uint32_t id = m->p[k].feature & 0xfffff; // vertex, and whether it is one of the reference
        const bool corner = !(id & 1) && corner_counts(inc, (int)(id >> 1), -nx, -ny);
        if (corner || (partly && shows_at(inc, facing, m->p[k].ra))) m->p[kept++] = m->p[k];
    }
    m->n_points = kept;
}

/// Do others cover an end of edge i of p, or of the edge of q that faces it, and is nothing else between them?
static bool beside_what_shows(const part_of_body *p, int i, const part_of_body *q)
{
    double nx, ny;
    edge_normal(&p->p, i, &nx, &ny);
    if (!covered_at_an_end(p, i) && !(q->face && covered_at_an_end(q, facing_edge(&q->p, nx, ny)))) return false;
    bt_manifold m = {0};
    clip_what_counts(p, i, q, false, (double[2]){0, 0}, (bounds){INFINITY, 0}, &m);
    return m.n_points == 0;
}

/// Largest separation of q from p over the edges of p that count, against corners of q that do.
static double separation_that_counts(const part_of_body *p, const part_of_body *q, int *edge)
{
    double best = -INFINITY;
    for (int i = 0; i < p->p.count; i++) {
        if (!edge_counts(p, i)) continue;
        const double s = edge_separation(&p->p, i, &q->p, -INFINITY);
        if (s <= best) continue;
        double nx, ny;
        edge_normal(&p->p, i, &nx, &ny);
        if (!corner_counts(q, support(&q->p, nx, ny), -nx, -ny) || beside_what_shows(p, i, q)) continue;
        best = s;
        *edge = i;
    }
    return best;
}

/// The nearest features of two parts that are apart, where both count.
static bool nearest_contact(const part_of_body *a, const part_of_body *b, const double d[2], bounds most,
                            bt_manifold *m)
{
    int ca = 0, cb = 0, e = 0;
    bool of_b = false;
    m->n_points = 0;
    if (nearest_features(&a->p, &b->p, &ca, &cb, &e, &of_b)) {
        return join_corners(&a->p, ca, &b->p, cb, d, most.margin, m) && corner_counts(a, ca, m->nx, m->ny) &&
               corner_counts(b, cb, -m->nx, -m->ny);
    }
    const part_of_body *ref = of_b ? b : a, *inc = of_b ? a : b;
    double nx, ny;
    edge_normal(&ref->p, e, &nx, &ny);
    if (!edge_counts(ref, e) || !corner_counts(inc, of_b ? ca : cb, -nx, -ny) || beside_what_shows(ref, e, inc))
        return false;
    clip_what_counts(ref, e, inc, of_b, d, most, m);
    if (m->n_points == 0) deepest_point(&ref->p, e, &inc->p, of_b, d[0], d[1], m);
    return bt_min(m->p[0].gap, m->p[m->n_points - 1].gap) <= most.margin;
}

bool bt_contacts_parts(const bt_world *w, bt_idx ia, bt_idx ib, const uint16_t part[2], double margin,
                       int reference_before, bt_manifold *m, double *gap_out, int32_t *axis_out)
{
    const bool convex = part[0] == 0 && part[1] == 0;
    if (convex && !bt_shore_holds(w, ia) && !bt_shore_holds(w, ib))
        return bodies_touch(w, ia, ib, margin, reference_before, m, gap_out, axis_out);
    double d[2];
    bt_bodies_offset(w, ia, ib, d);
    const part_of_body a = part_of(w, ia, part[0], 0, 0), b = part_of(w, ib, part[1], d[0], d[1]);
    const double tie = tie_of(&w->bodies, ia, ib);
    // Parts do not hold the centroid of their body, which rules out edges in max_separation: all edges in full, the
    // last axis first.
    const int32_t n = a.p.count + b.p.count, hint = *axis_out >= 0 && *axis_out < n ? *axis_out : 0;
    double best = -INFINITY;
    for (int32_t k = 0; k < n; k++) {
        const int32_t axis = k == 0 ? hint : k <= hint ? k - 1 : k;
        const double s = axis < a.p.count ? edge_separation(&a.p, axis, &b.p, -INFINITY)
                                          : edge_separation(&b.p, axis - a.p.count, &a.p, -INFINITY);
        if (s > best) best = s, *axis_out = axis;
        if (best > margin) break;
    }
    *gap_out = best;
    if (best > margin) return false;

    *m = (bt_manifold){.a = ia, .b = ib};
    const bounds most = bounds_of(w, margin);
    best_axes s = {0};
    s.sa = separation_that_counts(&a, &b, &s.ia);
    s.sb = separation_that_counts(&b, &a, &s.ib);
    const bool ref_b = reference_is_b(&a.p, &b.p, &s, tie, reference_before);
    const double sep = ref_b ? s.sb : s.sa;
    const part_of_body *ref = ref_b ? &b : &a, *inc = ref_b ? &a : &b;
    const int edge = ref_b ? s.ib : s.ia;
    if (best > 0) {
        if (sep > 0 && sep >= best - tie) {
            clip_what_counts(ref, edge, inc, ref_b, d, most, m);
            if (m->n_points > 0 && bt_min(m->p[0].gap, m->p[m->n_points - 1].gap) <= sep + tie) return true;
        }
        return nearest_contact(&a, &b, d, most, m);
    }
    if (!(-sep <= bt_max(tie, -DETOUR * best))) return false;
    clip_what_counts(ref, edge, inc, ref_b, d, most, m);
    if (m->n_points == 0) deepest_point(&ref->p, edge, &inc->p, ref_b, d[0], d[1], m);
    return true;
}
