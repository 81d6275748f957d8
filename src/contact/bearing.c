// SPDX-License-Identifier: MIT
// Which contact points bear the overlap of outlines in several polygons; contact/bearing.h.
#include "contact/bearing.h"

#include <math.h>
#include <stdlib.h>

#include "base/inside.h"
#include "base/elementary.h"
#include "contact/overlap.h"
#include "contact/row.h"
#include "space/pairs.h"
#include "space/shore.h"

/// The overlap of one pair of polygons, and the contact point that bears the share of each of its points.
typedef struct bt_shared_overlap {
    bt_idx pair;
    bt_manifold manifold; ///< as found; if nothing was found, a point at its bearer, with the normal there
    struct { bt_idx contact; int point; } by[2]; ///< contact −1: no contact of the two outlines is left
} shared;

void bt_bearing_note(bt_cell *cell, bt_idx pair, const bt_manifold *found)
{
    bt_law_state *laws = cell->laws;
    BT_MAKE_ROOM(laws->overlaps, laws->n_overlaps, laws->cap_overlaps, 8);
    laws->overlaps[laws->n_overlaps++] = (shared){.pair = pair, .manifold = *found};
}

// --- who bears -------------------------------------------------------------------------------------------------------

/// The body that touches a shore, −1 if neither of the pair is in one.
static bt_idx beside_shore(const bt_world *world, const bt_pair *p)
{
    return bt_shore_holds(world, p->a) ? p->b : bt_shore_holds(world, p->b) ? p->a : -1;
}

/// From the centroid of one body to that of another, m, of the outlines of a pair: pieces of a shore at the images that
/// are nearest to the body beside it, since in a period two pieces can meet at either end.
static void offset_of(const bt_world *world, const bt_pair *pair, bt_idx from, bt_idx to, double off[2])
{
    const bt_idx body = beside_shore(world, pair);
    if (from == to || body < 0 || from == body || to == body) {
        bt_bodies_offset(world, from, to, off);
        return;
    }
    double back[2];
    bt_bodies_offset(world, from, body, off);
    bt_bodies_offset(world, body, to, back);
    off[0] += back[0], off[1] += back[1];
}

/// Do both pairs belong to the same two outlines?
static bool same_outlines(const bt_world *world, const bt_pair *p, const bt_pair *q)
{
    if (p->a == q->a && p->b == q->b) return true;
    const bt_idx body = beside_shore(world, p);
    return body >= 0 && body == beside_shore(world, q);
}

/// Are both overlaps on the same face of the same two outlines? 1; −1 if so and a and b are exchanged; 0 = no.
static int same_face(const bt_world *world, const bt_cell *cell, const shared *overlap, const shared *other)
{
    const bt_pair *own = &cell->search.pairs[overlap->pair], *pair = &cell->search.pairs[other->pair];
    const bt_manifold *m = &overlap->manifold, *o = &other->manifold;
    const bool shore = beside_shore(world, own) >= 0;
    const int sign = shore && bt_shore_holds(world, own->a) != bt_shore_holds(world, pair->a) ? -1 : 1;
    return sign * (o->nx * m->nx + o->ny * m->ny) > BT_SQUARE && same_outlines(world, own, pair) ? sign : 0;
}

/// Arm of point i of a contact from the centroid of its a, m.
static void arm_of(const bt_contact *contact, int i, double arm[2])
{
    arm[0] = contact->rat * contact->nx + contact->ran[i] * contact->ny;
    arm[1] = contact->rat * contact->ny - contact->ran[i] * contact->nx;
}

/// How far x lies outside a part of body i, beyond the edge that it is farthest from; x from the centroid of i, m.
static double outside(const bt_world *world, bt_idx i, int part, const double x[2])
{
    int n;
    const double *v = bt_overlap_polygon(world, i, part, &n);
    double most = 0;
    for (int k = 0; k < n; k++) {
        const double *from = v + 2 * k, *to = v + 2 * (k + 1 < n ? k + 1 : 0);
        const double ex = to[0] - from[0], ey = to[1] - from[1];
        most = bt_max(most, (ey * (x[0] - from[0]) - ex * (x[1] - from[1])) / bt_hypot(ex, ey));
    }
    return most;
}

/// Let the nearest point of the contacts of the same outlines bear for point k. If it was not found, only the polygons
/// themselves tell what is near.
static void find_bearer(const bt_world *world, const bt_cell *cell, shared *overlap, int k, bool found)
{
    const bt_pair *pairs = cell->search.pairs, *own = &pairs[overlap->pair];
    double least = INFINITY, to_b[2];
    bt_bodies_offset(world, own->a, own->b, to_b);
    overlap->by[k].contact = -1;
    for (bt_idx j = 0; j < cell->n_contacts; j++) {
        const bt_contact *contact = &cell->contacts[j];
        if (contact->n == 0 || !same_outlines(world, own, &pairs[contact->pair])) continue;
        double to_a[2];
        offset_of(world, own, own->a, contact->a, to_a);
        for (int i = 0; i < contact->n; i++) {
            double x[2];
            arm_of(contact, i, x);
            x[0] += to_a[0], x[1] += to_a[1];
            const double *p = overlap->manifold.p[k].ra, from_b[2] = {x[0] - to_b[0], x[1] - to_b[1]};
            const double away = found ? bt_hypot(x[0] - p[0], x[1] - p[1])
                                      : bt_max(outside(world, own->a, own->part[0], x),
                                               outside(world, own->b, own->part[1], from_b));
            if (!(away < least)) continue;
            least = away;
            overlap->by[k].contact = j, overlap->by[k].point = i;
        }
    }
}

static void find_bearers(const bt_world *world, const bt_cell *cell, shared *overlap)
{
    const bt_idx j = cell->search.pairs[overlap->pair].contact;
    for (int k = 0; k < overlap->manifold.n_points; k++) {
        int i = 0;
        while (j >= 0 && i < cell->contacts[j].n && cell->gaps[j].feature[i] != overlap->manifold.p[k].feature) i++;
        if (j >= 0 && i < cell->contacts[j].n) overlap->by[k].contact = j, overlap->by[k].point = i;
        else find_bearer(world, cell, overlap, k, true);
    }
}

/// The overlap of a pair without a point found, once its bearer is known.
static void take_normal(const bt_world *world, const bt_cell *cell, shared *overlap)
{
    const bt_contact *contact = &cell->contacts[overlap->by[0].contact];
    const bt_pair *own = &cell->search.pairs[overlap->pair];
    const bool same_a = contact->a == own->a || (contact->b != own->b && bt_shore_holds(world, contact->a) ==
                                                                         bt_shore_holds(world, own->a));
    overlap->manifold = (bt_manifold){.a = own->a, .b = own->b, .n_points = 1,
                                      .nx = same_a ? contact->nx : -contact->nx,
                                      .ny = same_a ? contact->ny : -contact->ny};
}

BT_ASCENDING_BY(by_pair, shared, pair, pair)

/// Is the pair among the first n overlaps of the cell?
static bool is_noted(const bt_law_state *laws, bt_idx n, bt_idx pair)
{
    return n > 0 && bsearch(&(shared){.pair = pair}, laws->overlaps, (size_t)n, sizeof *laws->overlaps, by_pair);
}

void bt_bearing_assign(const bt_world *world, bt_cell *cell)
{
    bt_law_state *laws = cell->laws;
    const bt_bodies *bodies = &world->bodies;
    const bt_idx n_found = laws->n_overlaps;
    for (bt_idx i = 0; i < n_found; i++) find_bearers(world, cell, &laws->overlaps[i]);
    for (bt_idx i = 0; i < cell->search.n_pairs; i++) {
        const bt_pair *pair = &cell->search.pairs[i];
        if (pair->part[0] == 0 && pair->part[1] == 0 && beside_shore(world, pair) < 0) continue;
        // polygons that are farther apart than the margin do not overlap in this step
        if (bodies->path[pair->a] + bodies->path[pair->b] + cell->margin < pair->axes.reach) continue;
        if (is_noted(laws, n_found, i)) continue;
        shared overlap = {.pair = i};
        find_bearer(world, cell, &overlap, 0, false);
        if (overlap.by[0].contact < 0) continue;
        take_normal(world, cell, &overlap);
        bt_bearing_note(cell, i, &overlap.manifold);
        laws->overlaps[laws->n_overlaps - 1].by[0] = overlap.by[0];
    }
    qsort(laws->overlaps, (size_t)laws->n_overlaps, sizeof *laws->overlaps, by_pair);
}

// --- what is borne ---------------------------------------------------------------------------------------------------

/// Area, m², that an overlap has in common with another one of the same body and shore: where the two pieces overlap.
static double common_area(const bt_world *world, const bt_cell *cell, const shared *overlap, const shared *other,
                          double depth)
{
    const bt_pair *own = &cell->search.pairs[overlap->pair], *pair = &cell->search.pairs[other->pair];
    const bool of_b = bt_shore_holds(world, own->b), other_b = bt_shore_holds(world, pair->b);
    const double move[2] = {-depth * overlap->manifold.nx, -depth * overlap->manifold.ny};
    const bt_idx piece = other_b ? pair->b : pair->a;
    double place[2], centroid[2];
    bt_overlap both;
    bt_overlap_clip(world, own->a, own->b, own->part, move[0], move[1], &both);
    offset_of(world, own, own->a, piece, place);
    if (of_b) place[0] += move[0], place[1] += move[1];
    bt_overlap_cut(world, piece, pair->part[other_b], place, &both);
    return bt_overlap_area(&both, centroid);
}

/// Does the piece of the shore in a pair reach the patch of another pair, along the tangent of m?
static bool piece_meets(const bt_world *world, const bt_pair *own, const bt_pair *pair, const bt_manifold *m,
                        const bt_patch *patch)
{
    const bool of_b = bt_shore_holds(world, pair->b);
    const bt_idx piece = of_b ? pair->b : pair->a;
    double off[2], low = INFINITY, high = -INFINITY;
    int n;
    const double *v = bt_overlap_polygon(world, piece, pair->part[of_b], &n);
    offset_of(world, own, own->a, piece, off);
    for (int i = 0; i < n; i++) {
        const double t = m->nx * (v[2 * i + 1] + off[1]) - m->ny * (v[2 * i] + off[0]);
        low = bt_min(low, t), high = bt_max(high, t);
    }
    return low < patch->middle + 0.5 * patch->length && high > patch->middle - 0.5 * patch->length;
}

/// The patch of an overlap, less the stretches that those before it bear on the same face.
static bt_patch patch_of(const bt_world *world, const bt_cell *cell, const shared *overlap, double depth, double *area)
{
    const bt_pair *pairs = cell->search.pairs, *own = &pairs[overlap->pair];
    const bt_manifold *m = &overlap->manifold;
    const bt_patch patch = bt_law_patch(world, own->part, m, depth, area);
    const bool shore = beside_shore(world, own) >= 0;
    if (!(patch.length > 0)) return patch;
    // each of those before it can divide one stretch
    const size_t most = (size_t)(overlap - cell->laws->overlaps) + 1;
    double *from = bt_alloc_unset(2 * most, sizeof *from), *to = from + most;
    from[0] = patch.middle - 0.5 * patch.length, to[0] = patch.middle + 0.5 * patch.length;
    int n = 1;
    for (const shared *o = cell->laws->overlaps; o < overlap; o++) {
        const bt_pair *pair = &pairs[o->pair];
        const int sign = same_face(world, cell, overlap, o);
        if (sign == 0 || (shore && !piece_meets(world, own, pair, m, &patch))) continue;
        double other_area, off[2];
        const bt_patch other = bt_law_patch(world, pair->part, &o->manifold, depth, &other_area);
        if (!(other.length > 0)) continue;
        offset_of(world, own, own->a, pair->a, off);
        const double middle = sign * other.middle + m->nx * off[1] - m->ny * off[0],
                     low = middle - 0.5 * other.length, high = middle + 0.5 * other.length;
        bool meet = false;
        for (int i = n - 1; i >= 0; i--) { // leave the parts on either side
            if (!(low < to[i] && high > from[i])) continue;
            const double end = to[i];
            meet = true;
            to[i] = bt_max(from[i], low);
            if (high < end) from[n] = high, to[n++] = end;
        }
        if (meet && shore) *area -= common_area(world, cell, overlap, o, depth);
    }
    double length = 0, moment = 0;
    for (int i = 0; i < n; i++) length += to[i] - from[i], moment += 0.5 * (to[i] - from[i]) * (to[i] + from[i]);
    free(from);
    *area = bt_max(0, *area);
    return (bt_patch){length, length > 0 ? moment / length : patch.middle};
}

/// The points of an overlap that take part, by the gaps and approaches of their bearers.
static bt_closing closing_of(const bt_world *world, const bt_cell *cell, const shared *overlap)
{
    double gap[2] = {0}, outline[2] = {0}, approach[2] = {0};
    const int n = overlap->manifold.n_points;
    for (int k = 0; k < n; k++) {
        const bt_idx j = overlap->by[k].contact;
        if (j < 0) continue;
        const int i = overlap->by[k].point;
        outline[k] = overlap->manifold.p[k].gap;
        gap[k] = outline[k] + cell->laws->limits[j].rise->depth[i];
        approach[k] = bt_law_approach(world, &cell->contacts[j], i);
    }
    return bt_law_closing_at(world, n, gap, outline, approach);
}

/// Add what contact j bears of one overlap.
static void bear(const shared *overlap, bt_idx j, const bt_closing *closing, const bt_patch patch[2],
                 const double area[2], bt_bearing of[2])
{
    const double all = patch[0].length + patch[1].length;
    for (int k = 0; k < overlap->manifold.n_points; k++) {
        if (overlap->by[k].contact != j) continue;
        bt_bearing *to = &of[overlap->by[k].point];
        const double share = bt_law_share(&overlap->manifold, k, patch[0], closing);
        const double first = patch[0].length * share,
                     second = patch[1].length * bt_law_share(&overlap->manifold, k, patch[1], closing);
        const double part = all > 0 ? (first + second) / all : 0, before = area[0] * share;
        to->length[0] += first, to->length[1] += second;
        to->area[0] += before, to->area[1] += before + (area[1] - area[0]) * part;
    }
}

static bool bears_some(const shared *overlap, bt_idx j)
{
    for (int k = 0; k < overlap->manifold.n_points; k++)
        if (overlap->by[k].contact == j) return true;
    return false;
}

/// Is contact j one of outlines in several polygons?
static bool is_shared(const bt_cell *cell, bt_idx j)
{
    return is_noted(cell->laws, cell->laws->n_overlaps, cell->contacts[j].pair);
}

void bt_bearing_of(const bt_world *world, const bt_cell *cell, bt_idx j, const bt_manifold *manifold,
                   const bt_closing *closing, const double depth[2], bt_bearing of[2])
{
    const shared alone = {.pair = cell->contacts[j].pair, .manifold = *manifold, .by = {{j, 0}, {j, 1}}};
    const bool several = is_shared(cell, j);
    const bt_idx n = several ? cell->laws->n_overlaps : 1;
    of[0] = of[1] = (bt_bearing){0};
    for (bt_idx i = 0; i < n; i++) {
        const shared *overlap = several ? &cell->laws->overlaps[i] : &alone;
        if (!bears_some(overlap, j)) continue;
        const bt_closing here = several ? closing_of(world, cell, overlap) : *closing;
        double area[2];
        bt_patch patch[2];
        for (int k = 0; k < 2; k++)
            patch[k] = several ? patch_of(world, cell, overlap, depth[k], &area[k])
                               : bt_law_patch(world, cell->search.pairs[alone.pair].part, manifold, depth[k], &area[k]);
        bear(overlap, j, &here, patch, area, of);
    }
}

int bt_bearing_points(const bt_world *world, const bt_cell *cell, bt_idx j, int *own)
{
    const bt_law_state *laws = cell->laws;
    *own = 0;
    if (!is_shared(cell, j)) return 0;
    const shared *first = bsearch(&(shared){.pair = cell->contacts[j].pair}, laws->overlaps, (size_t)laws->n_overlaps,
                                  sizeof *first, by_pair);
    double nearest = INFINITY;
    int all = 0;
    for (int pass = 0; pass < 2; pass++)
        for (bt_idx i = 0; i < laws->n_overlaps; i++) {
            const shared *overlap = &laws->overlaps[i];
            const bt_idx contact = cell->search.pairs[overlap->pair].contact;
            if (contact < 0 || same_face(world, cell, first, overlap) == 0) continue;
            for (int k = 0; k < overlap->manifold.n_points; k++) {
                if (overlap->by[k].contact != contact) continue; // merged into a point of another
                const double gap = overlap->manifold.p[k].gap + laws->limits[contact].rise->depth[overlap->by[k].point];
                if (pass == 0) nearest = bt_min(nearest, gap);
                else if (gap <= bt_max(nearest, 0) + world->par.slop) all++, *own += contact == j;
            }
        }
    return all > 0 ? all : 1;
}

double bt_bearing_whole(const bt_world *world, const bt_cell *cell, bt_idx j, double depth, double *area)
{
    const bt_contact *contact = &cell->contacts[j];
    const bt_manifold manifold = {.a = contact->a, .b = contact->b, .nx = contact->nx, .ny = contact->ny};
    if (!is_shared(cell, j))
        return bt_law_patch(world, cell->search.pairs[contact->pair].part, &manifold, depth, area).length;
    bt_bearing of[2];
    bt_bearing_of(world, cell, j, &manifold, NULL, (double[2]){depth, depth}, of);
    *area = of[0].area[1] + of[1].area[1];
    return of[0].length[1] + of[1].length[1];
}
