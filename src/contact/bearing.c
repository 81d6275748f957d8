// SPDX-License-Identifier: MIT
// The load of a face on which outlines in several polygons touch, and the points that bear it; contact/bearing.h.
#include "contact/bearing.h"

#include <math.h>
#include <stdlib.h>

#include "base/elementary.h"
#include "base/inside.h"
#include "contact/overlap.h"
#include "space/pairs.h"
#include "space/shore.h"

/// The overlap of one pair of polygons.
typedef struct bt_shared_overlap {
    bt_idx pair, first;   ///< first: index of the first overlap of the same two outlines
    int64_t outlines;     ///< the same for pairs of the same two outlines: a body, and another one or a shore
    bool shore, flip;     ///< flip: the body is b
    double nx, ny;        ///< from the body; where nothing was found, the normal of the nearest face
    bt_manifold manifold; ///< as found, or without points
    struct {
        enum { INNER, CORNER, DEPUTY } kind; ///< within the face; corner of an outline; in place of one not found
        int i;                               ///< of the contact of the pair; −1: merged into that of another
        double gap, approach;                ///< between the remaining surfaces, m; m/s
        bool part;                           ///< it bears, and takes part in this step
    } p[2];
    bt_closing face;      ///< of all points that bear on the face
} shared;

void bt_bearing_note(bt_cell *cell, bt_idx pair, const bt_manifold *found)
{
    bt_law_state *laws = cell->laws;
    BT_MAKE_ROOM(laws->overlaps, laws->n_overlaps, laws->cap_overlaps, 8);
    laws->overlaps[laws->n_overlaps++] = (shared){.pair = pair, .manifold = *found};
}

// --- faces -----------------------------------------------------------------------------------------------------------

BT_ASCENDING_BY(by_outlines, shared, outlines, pair)

static void name_outlines(const bt_world *world, const bt_cell *cell, shared *overlap)
{
    const bt_pair *pair = &cell->search.pairs[overlap->pair];
    overlap->flip = bt_shore_holds(world, pair->a);
    overlap->shore = overlap->flip || bt_shore_holds(world, pair->b);
    const bt_idx body = overlap->flip ? pair->b : pair->a, other = overlap->flip ? pair->a : pair->b;
    overlap->outlines = (int64_t)body << 32 | (int64_t)bt_shore_outline(world->shore, world->bodies.gid[other]);
}

/// The overlap of the polygons of contact j; NULL if both outlines are single polygons.
static const shared *overlap_of(const bt_world *world, const bt_cell *cell, bt_idx j)
{
    const bt_law_state *laws = cell->laws;
    shared key = {.pair = cell->contacts[j].pair};
    if (laws->n_overlaps == 0) return NULL;
    name_outlines(world, cell, &key);
    return bsearch(&key, laws->overlaps, (size_t)laws->n_overlaps, sizeof key, by_outlines);
}

/// Overlaps o on the face of `own`.
#define EACH_OF_FACE(o, laws, own)                                                                                     \
    for (shared *o = (laws)->overlaps + (own)->first, *end_ = (laws)->overlaps + (laws)->n_overlaps;                   \
         o < end_ && o->outlines == (own)->outlines; o++)                                                              \
        if (o->nx * (own)->nx + o->ny * (own)->ny > BT_SQUARE)

/// Arm of point k from the centroid of the body, m, and its place along the face of `own`.
static const double *arm_of(const shared *overlap, int k)
{
    return overlap->flip ? overlap->manifold.p[k].rb : overlap->manifold.p[k].ra;
}
static double place_of(const shared *own, const shared *overlap, int k)
{
    const double *arm = arm_of(overlap, k);
    return own->nx * arm[1] - own->ny * arm[0];
}

static void take_points(const bt_world *world, const bt_cell *cell, shared *overlap)
{
    const bt_pair *pair = &cell->search.pairs[overlap->pair];
    const bt_manifold *m = &overlap->manifold;
    const bt_idx j = pair->contact;
    overlap->nx = overlap->flip ? -m->nx : m->nx, overlap->ny = overlap->flip ? -m->ny : m->ny;
    for (int k = 0; k < m->n_points; k++) {
        overlap->p[k].i = -1;
        overlap->p[k].kind = bt_contacts_at_corner(world, pair, m->p[k].feature) ? CORNER : INNER;
        for (int i = 0; j >= 0 && i < cell->contacts[j].n; i++)
            if (cell->gaps[j].feature[i] == m->p[k].feature)
                overlap->p[k].i = i, overlap->p[k].gap = m->p[k].gap + cell->laws->limits[j].rise->depth[i];
    }
}

/// How far x lies outside a part of body i, beyond the edge that it is farthest from; x from the centroid of i, m.
static double outside(const bt_world *world, bt_idx i, int part, const double x[2])
{
    int n;
    const double *v = bt_overlap_polygon(world, i, part, &n);
    double most = 0;
    for (int k = 0; k < n; k++) {
        const double *from = v + 2 * k, *to = v + 2 * ((k + 1) % n), ex = to[0] - from[0], ey = to[1] - from[1];
        most = bt_max(most, (ey * (x[0] - from[0]) - ex * (x[1] - from[1])) / bt_hypot(ex, ey));
    }
    return most;
}

/// A polygon that only overlaps deeper in belongs to the face with the nearest of the n points found. False if the
/// outlines do not touch.
static bool take_nearest_face(const bt_world *world, const bt_cell *cell, bt_idx n, shared *overlap)
{
    const bt_pair *pair = &cell->search.pairs[overlap->pair];
    const bt_idx body = overlap->flip ? pair->b : pair->a, other = overlap->flip ? pair->a : pair->b;
    double least = INFINITY, off[2];
    bt_bodies_offset(world, body, other, off);
    for (const shared *o = cell->laws->overlaps; o < cell->laws->overlaps + n; o++)
        for (int k = 0; o->outlines == overlap->outlines && k < o->manifold.n_points; k++) {
            const double *x = arm_of(o, k);
            const double away = o->p[k].i < 0 ? INFINITY
                : bt_max(outside(world, body, pair->part[overlap->flip], x),
                         outside(world, other, pair->part[!overlap->flip], (double[2]){x[0] - off[0], x[1] - off[1]}));
            if (away < least) least = away, overlap->nx = o->nx, overlap->ny = o->ny;
        }
    return least < INFINITY;
}

/// A corner that has been merged: the nearest point that is left on its face stands for it.
static void let_stand_for(const bt_law_state *laws, const shared *own, int k)
{
    shared *nearest = NULL;
    int at = 0;
    double least = INFINITY;
    EACH_OF_FACE(o, laws, own) for (int i = 0; i < o->manifold.n_points; i++) {
        const double away = fabs(place_of(own, o, i) - place_of(own, own, k));
        if (o->p[i].i >= 0 && away < least) least = away, nearest = o, at = i;
    }
    if (nearest) nearest->p[at].kind = CORNER;
}

/// Does point k stand for a corner that was not found, as at the bottom of a bay? It is the nearest of its face, and no
/// corner is as near.
static bool is_deputy(const bt_law_state *laws, const shared *own, int k, double slop)
{
    EACH_OF_FACE(o, laws, own) for (int i = 0; i < o->manifold.n_points; i++) {
        const double more = o->manifold.p[i].gap - own->manifold.p[k].gap;
        if (o->p[i].i >= 0 && (more < -slop || (o->p[i].kind == CORNER && more <= slop))) return false;
    }
    return true;
}

/// Does point k bear once it is reached?
static bool bears(const shared *o, int k) { return k < o->manifold.n_points && o->p[k].i >= 0 && o->p[k].kind; }
static bool bears_some(const shared *o) { return bears(o, 0) || bears(o, 1); }

/// Which points of an overlap take part in the step.
static void find_part(const bt_world *world, const bt_cell *cell, shared *own)
{
    double nearest = INFINITY;
    EACH_OF_FACE(o, cell->laws, own) for (int k = 0; k < 2; k++) {
        if (!bears(o, k)) continue;
        own->face.gap = bt_min(own->face.gap, bt_max(0, o->p[k].gap));
        nearest = bt_min(nearest, o->manifold.p[k].gap);
    }
    for (int k = 0; k < 2; k++) {
        if (!bears(own, k)) continue;
        const bt_contact *contact = &cell->contacts[cell->search.pairs[own->pair].contact];
        own->p[k].approach = bt_law_approach(world, contact, own->p[k].i);
        own->p[k].part = bt_law_takes_part(world, own->p[k].gap, own->manifold.p[k].gap, own->p[k].approach,
                                           own->face.gap, nearest);
        own->face.point[own->p[k].i] = own->p[k].part;
    }
}

void bt_bearing_assign(const bt_world *world, bt_cell *cell)
{
    bt_law_state *laws = cell->laws;
    const bt_bodies *bodies = &world->bodies;
    const bt_idx n_found = laws->n_overlaps;
    for (bt_idx i = 0; i < n_found; i++)
        name_outlines(world, cell, &laws->overlaps[i]), take_points(world, cell, &laws->overlaps[i]);
    for (bt_idx i = 0, noted = 0; i < cell->search.n_pairs; i++) {
        const bt_pair *pair = &cell->search.pairs[i];
        const bool found = noted < n_found && laws->overlaps[noted].pair == i;
        noted += found;
        if (found) continue;
        shared overlap = {.pair = i};
        name_outlines(world, cell, &overlap);
        if (!overlap.shore && !pair->part[0] && !pair->part[1]) continue;
        // polygons that are farther apart than the margin do not overlap in this step
        if (bodies->path[pair->a] + bodies->path[pair->b] + cell->margin < pair->axes.reach) continue;
        if (!take_nearest_face(world, cell, n_found, &overlap)) continue;
        bt_bearing_note(cell, i, &overlap.manifold);
        laws->overlaps[laws->n_overlaps - 1] = overlap;
    }
    shared *all = laws->overlaps;
    const bt_idx n = laws->n_overlaps;
    qsort(all, (size_t)n, sizeof *all, by_outlines);
    for (bt_idx i = 0; i < n; i++) {
        all[i].first = i > 0 && all[i - 1].outlines == all[i].outlines ? all[i - 1].first : i;
        all[i].face.gap = INFINITY;
    }
    for (bt_idx i = 0; i < n; i++)
        for (int k = 0; k < all[i].manifold.n_points; k++)
            if (all[i].p[k].i < 0 && all[i].p[k].kind) let_stand_for(laws, &all[i], k);
    for (bt_idx i = 0; i < n; i++)
        for (int k = 0; k < all[i].manifold.n_points; k++)
            if (all[i].p[k].i >= 0 && !all[i].p[k].kind && is_deputy(laws, &all[i], k, world->par.slop))
                all[i].p[k].kind = DEPUTY;
    for (bt_idx i = 0; i < n; i++)
        if (bears_some(&all[i])) find_part(world, cell, &all[i]);
    for (bt_idx i = 0; i < n; i++) {
        bt_closing *face = &all[i].face;
        if (bears_some(&all[i])) EACH_OF_FACE(o, laws, &all[i]) for (int k = 0; k < 2; k++)
            if (o->p[k].part) face->n++, face->approach = bt_max(face->approach, o->p[k].approach);
    }
}

const bt_closing *bt_bearing_closing(const bt_world *world, const bt_cell *cell, bt_idx j)
{
    const shared *own = overlap_of(world, cell, j);
    return own ? &own->face : NULL;
}

// --- the load of a face ----------------------------------------------------------------------------------------------

/// A stretch of a face.
typedef struct { double from, to; const shared *of; } stretch;
BT_ASCENDING_BY(by_place, stretch, from, of)

/// Area, m², that two overlaps of the same polygon of a body have in common: where two pieces of a shore overlap.
static double common_area(const bt_world *world, const bt_cell *cell, const shared *p, const shared *q,
                          const double move[2])
{
    const bt_pair *own = &cell->search.pairs[p->pair], *pair = &cell->search.pairs[q->pair];
    if (own->part[p->flip] != pair->part[q->flip]) return 0;
    const bt_idx piece = q->flip ? pair->a : pair->b;
    double place[2], back[2] = {0, 0}, centroid[2];
    bt_overlap both;
    const int sign = p->flip ? -1 : 1;
    bt_overlap_clip(world, own->a, own->b, own->part, sign * move[0], sign * move[1], &both);
    // by way of the body, since in a period two pieces can meet at either end
    if (p->flip) bt_bodies_offset(world, own->a, own->b, back);
    bt_bodies_offset(world, p->flip ? own->b : own->a, piece, place);
    for (int i = 0; i < 2; i++) place[i] += back[i] + (p->flip ? 0 : move[i]);
    bt_overlap_cut(world, piece, pair->part[!q->flip], place, &both);
    return bt_overlap_area(&both, centroid);
}

/// The stretches on which the face of `own` bears once the body has moved `depth` along its normal, in ascending order,
/// in a list that the caller frees; returns how many. Their *length, and *area of the overlap.
static int stretches_of(const bt_world *world, const bt_cell *cell, const shared *own, double depth,
                        stretch **stretches, double *length, double *area)
{
    const double move[2] = {-depth * own->nx, -depth * own->ny};
    stretch *list = *stretches = bt_alloc_unset((size_t)cell->laws->n_overlaps, sizeof *list);
    int n = 0, kept = 0;
    *length = *area = 0;
    EACH_OF_FACE(o, cell->laws, own) {
        const bt_pair *pair = &cell->search.pairs[o->pair];
        const int sign = o->flip ? -1 : 1;
        const bt_manifold m = {.a = pair->a, .b = pair->b, .nx = sign * own->nx, .ny = sign * own->ny};
        double of, off[2] = {0, 0};
        const bt_patch patch = bt_law_patch(world, pair->part, &m, depth, &of);
        if (!(patch.length > 0)) continue;
        if (o->flip) bt_bodies_offset(world, pair->b, pair->a, off);
        const double middle = own->nx * off[1] - own->ny * off[0] + sign * patch.middle;
        list[n++] = (stretch){middle - 0.5 * patch.length, middle + 0.5 * patch.length, o};
        *area += of;
    }
    qsort(list, (size_t)n, sizeof *list, by_place);
    for (int i = 0; i < n; i++) {
        if (kept == 0 || !(list[i].from < list[kept - 1].to)) {
            list[kept++] = list[i];
            continue;
        }
        stretch *last = &list[kept - 1]; // what this has in common with those before, the last to end has, too
        if (own->shore) *area -= common_area(world, cell, list[i].of, last->of, move);
        if (list[i].to > last->to) last->to = list[i].to, last->of = list[i].of;
    }
    for (int i = 0; i < kept; i++) *length += list[i].to - list[i].from;
    *area = bt_max(0, *area);
    return kept;
}

/// ∫ from..to of what a point bears of a unit load, on the side towards its neighbour at `next` (−∞: none).
static double side(double place, double next, double from, double to)
{
    from = bt_max(from, next), to = bt_min(to, place);
    if (!(to > from)) return 0;
    return isinf(next) ? to - from : (to - from) * (0.5 * (from + to) - next) / (place - next);
}

/// Length that point k bears of the stretches [n] at this depth: between two points of the outlines that it reaches, by
/// the lever rule.
static double borne(const bt_cell *cell, const shared *own, int k, double depth, const stretch *list, int n)
{
    const double place = place_of(own, own, k);
    double low = -INFINITY, high = INFINITY, length = 0;
    int here = 0;
    if (!own->p[k].part || own->p[k].gap > depth) return 0;
    EACH_OF_FACE(o, cell->laws, own) for (int i = 0; i < 2; i++) {
        if (!o->p[i].part || o->manifold.p[i].gap > depth) continue; // where ice is crushed, its share is borne by none
        const double other = place_of(own, o, i);
        if (other < place) low = bt_max(low, other);
        else if (other > place) high = bt_min(high, other);
        else here++;
    }
    for (int i = 0; i < n; i++)
        length += side(place, low, list[i].from, list[i].to) + side(-place, -high, -list[i].to, -list[i].from);
    return length / here;
}

void bt_bearing_of(const bt_world *world, const bt_cell *cell, bt_idx j, const double depth[2], bt_bearing of[2])
{
    const shared *own = overlap_of(world, cell, j);
    of[0] = of[1] = (bt_bearing){0};
    if (!bears_some(own)) return;
    double length[2], area[2];
    for (int d = 0; d < 2; d++) {
        stretch *list;
        const int n = stretches_of(world, cell, own, depth[d], &list, &length[d], &area[d]);
        for (int k = 0; k < 2; k++)
            if (bears(own, k)) of[own->p[k].i].length[d] = borne(cell, own, k, depth[d], list, n);
        free(list);
    }
    const double all = length[0] + length[1];
    for (int k = 0; k < 2; k++) {
        if (!bears(own, k)) continue;
        bt_bearing *to = &of[own->p[k].i];
        to->area[0] = length[0] > 0 ? area[0] * to->length[0] / length[0] : 0;
        to->area[1] = to->area[0] + (all > 0 ? (area[1] - area[0]) * (to->length[0] + to->length[1]) / all : 0);
        to->least = 1.0 / bt_max(1, own->face.n);
        if (own->p[k].gap < depth[1]) to->late = bt_max(0, own->p[k].gap - own->face.gap);
    }
}

double bt_bearing_whole(const bt_world *world, const bt_cell *cell, bt_idx j, double depth, double *area)
{
    const bt_contact *contact = &cell->contacts[j];
    const bt_manifold manifold = {.a = contact->a, .b = contact->b, .nx = contact->nx, .ny = contact->ny};
    const shared *own = overlap_of(world, cell, j);
    if (!own) return bt_law_patch(world, cell->search.pairs[contact->pair].part, &manifold, depth, area).length;
    double length;
    stretch *list;
    stretches_of(world, cell, own, depth, &list, &length, area);
    free(list);
    return length;
}

double bt_bearing_share(const bt_world *world, const bt_cell *cell, bt_idx j)
{
    const shared *own = overlap_of(world, cell, j);
    double mine = 0, all = 0;
    if (!own) return 1;
    EACH_OF_FACE(o, cell->laws, own) {
        const bt_idx contact = cell->search.pairs[o->pair].contact;
        for (int k = 0; k < 2; k++) {
            const double impulse = bears(o, k) ? cell->contacts[contact].ln[o->p[k].i] : 0;
            all += impulse, mine += contact == j ? impulse : 0;
        }
    }
    return all > 0 ? mine / all : 0;
}
