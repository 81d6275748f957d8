// SPDX-License-Identifier: MIT
// Contact detection of one step: which cells are active, their margins, narrow phase, contacts with last step's
// impulses.
#include <math.h>
#include <omp.h>
#include <stdlib.h>
#include <string.h>

#include "base/inside.h"
#include "contact/bearing.h"
#include "contact/contacts.h"
#include "contact/law.h"
#include "contact/law_pair.h"
#include "contact/pack.h"
#include "partition/domain.h"
#include "space/cells.h"
#include "space/pairs.h"
#include "space/phases.h"
#include "space/shore.h"
#include "tow/tow.h"

// --- parts that meet at one place ------------------------------------------------------------------------------------

// Contacts of several parts of one floe, or of several pieces of a shore, at one place become one.
//
// Parts that share a corner can both touch another floe there: one by the corner, the other by the end of its edge. The
// normals of the two then differ by the tilt of two nearly parallel edges. The two rows form a spurious wedge: it stops
// a sliding floe, and with friction the sweeps find no solution at all (seen: a hexagon in two parts, 20,000 sweeps, 18
// J gained). Normals farther apart than those of edges that face each other squarely (manifold.c) belong to different
// sides, as in a notch, and stay. Of two points at one place the deeper stays: the other may be the end of an edge cut
// off at the seam, above the corner just beyond it.

#define PLACE 0.01  // of the smaller radius, as for reference edges

/// A contact of a body that touches several polygons of one outline.
typedef struct {
    bt_manifold *m;
    bt_gid body;   ///< the body that touches
    size_t place;  ///< in the list
    int n_points;  ///< as found
    bool flip;     ///< it is b of the pair
} touch;

static const double *arm(const touch *t, int i) { return t->flip ? t->m->p[i].rb : t->m->p[i].ra; }

/// Do point i of p and point j of q press at the same place in the same way?
static bool same_place(const touch *p, int i, const touch *q, int j, double reach)
{
    const double sign = p->flip == q->flip ? 1 : -1;
    if (sign * (p->m->nx * q->m->nx + p->m->ny * q->m->ny) < BT_SQUARE) return false;
    const double *x = arm(p, i), *y = arm(q, j), dx = x[0] - y[0], dy = x[1] - y[1];
    return fabs(p->m->nx * dy - p->m->ny * dx) <= reach; // along the surface: their heights differ by half of the gaps
}

static void drop(bt_manifold *manifold, int i)
{
    if (i + 1 < manifold->n_points) manifold->p[i] = manifold->p[i + 1];
    manifold->n_points--;
}

/// Of points that p and q share, keep those of q, unless that of p is deeper by more than the slop.
static void settle(const bt_world *world, const touch *p, const touch *q)
{
    const bt_bodies *bodies = &world->bodies;
    bt_manifold *m = p->m, *o = q->m;
    const double reach = PLACE * bt_min(bt_min(bodies->radius[m->a], bodies->radius[m->b]),
                                        bt_min(bodies->radius[o->a], bodies->radius[o->b])),
                 deeper = world->par.slop;
    for (int i = m->n_points - 1; i >= 0; i--)
        for (int j = o->n_points - 1; j >= 0; j--) {
            if (!same_place(p, i, q, j, reach)) continue;
            if (m->p[i].gap < o->p[j].gap - deeper) {
                drop(o, j);
            } else {
                drop(m, i);
                break;
            }
        }
}

/// Remove duplicate points among the contacts t[n] of one body with the polygons of one outline.
static void unite(const bt_world *world, const touch *t, size_t n)
{
    // Flush edges say more than single points, so single points are dropped first, whatever their order.
    for (size_t i = 0; i < n; i++)
        for (size_t j = 0; j < n; j++)
            if (i != j && t[i].m->n_points == 1 && (t[j].m->n_points == 2 || (t[j].m->n_points == 1 && j < i)))
                settle(world, &t[i], &t[j]);
    for (size_t i = 0; i < n; i++)
        for (size_t j = 0; j < i; j++)
            if (t[i].n_points == 2 && t[j].n_points == 2) settle(world, &t[i], &t[j]);
}

BT_ASCENDING_BY(by_body, touch, body, place)

void bt_merge_parts(const bt_world *world, bt_manifold *man, size_t n)
{
    const bt_bodies *bodies = &world->bodies;
    touch *t = bt_alloc(n, sizeof *t);
    size_t on_shore = 0;
    for (size_t k = 0, end; k < n; k = end) {
        const bool shore_a = bt_shore_holds(world, man[k].a), shore_b = bt_shore_holds(world, man[k].b);
        end = k + 1;
        if (shore_a || shore_b) {
            t[on_shore++] = (touch){&man[k], bodies->gid[shore_a ? man[k].b : man[k].a], k, man[k].n_points, shore_a};
            continue;
        }
        touch *of_pair = t + on_shore; // until the next one comes
        for (; end < n && man[end].a == man[k].a && man[end].b == man[k].b; end++) {}
        for (size_t i = k; i < end; i++) of_pair[i - k] = (touch){.m = &man[i], .n_points = man[i].n_points};
        if (end > k + 1) unite(world, of_pair, end - k);
    }
    if (on_shore > 0) qsort(t, on_shore, sizeof *t, by_body);
    for (size_t k = 0, end; k < on_shore; k = end) {
        for (end = k + 1; end < on_shore && t[end].body == t[k].body; end++) {}
        if (end > k + 1) unite(world, t + k, end - k);
    }
    free(t);
}

// --- detection -------------------------------------------------------------------------------------------------------

/// A speed whose margin is the slop, for bodies at rest that may overlap by more than the slop.
static double stir(const bt_world *world) { return 0.4 * world->par.slop / world->par.dt; }

/// Raise the bounds for a speed s in the cells x0..x1 × y0..y1. Cell T has t in its block or in the ring around it if t
/// − 2 <= T <= t + 1.
static void raise(bt_cells *cells, int32_t x0, int32_t x1, int32_t y0, int32_t y1, double s)
{
    const bool open = !cells->wrap_x && !cells->wrap_y; // then the box of the cells is all there is
    x0 -= 2, x1 += 1, y0 -= 2, y1 += 1;
    if (open) {
        x0 = x0 > cells->low_x ? x0 : cells->low_x, x1 = x1 < cells->low_x + cells->n_x
                                                         ? x1 : cells->low_x + cells->n_x - 1;
        y0 = y0 > cells->low_y ? y0 : cells->low_y, y1 = y1 < cells->low_y + cells->n_y
                                                         ? y1 : cells->low_y + cells->n_y - 1;
    }
    for (int32_t y = y0; y <= y1; y++)
        for (int32_t x = x0; x <= x1; x++) {
            const bt_idx k = open ? cells->at[(int64_t)(y - cells->low_y) * cells->n_x + (x - cells->low_x)]
                                  : bt_cells_at(cells, cells->wrap_x == 1 ? 0 : x, cells->wrap_y == 1 ? 0 : y);
            if (k < 0 || !(s > cells->bound[k])) continue; // if its bound is above 0 it is awake
            bt_cells_wake(cells, k);
            cells->bound[k] = s;
        }
}

/// Raise the bounds of the cells that the speed s of cell (x, y) affects.
static void spread(bt_cells *cells, int32_t x, int32_t y, double s) { raise(cells, x, x, y, y, s); }

/// Raise the bounds of the cells under and beside large bodies that move or can be moved.
static double spread_large(bt_world *world, const bt_vel *v, const bt_vel *v2)
{
    bt_cells *cells = world->cells;
    const bt_bodies *bodies = &world->bodies;
    double fastest = 0;
    bool movable = false;
    for (bt_idx l = cells->n_in_cells; l < bodies->n; l++) {
        double s = bt_max(bt_bodies_speed(world, l, &v[l]), bt_bodies_speed(world, l, &v2[l]));
        if (bodies->disturbed[l] && bodies->motion[l] == BT_DYNAMIC) s = bt_max(s, stir(world));
        movable = movable || bodies->motion[l] == BT_DYNAMIC;
        if (s == 0) continue;
        fastest = bt_max(fastest, s);
        const bt_cell_range range =
            bt_pairs_range(world, l, bt_margin_for(world, s) + cells->max_radius + cells->allowance);
        raise(cells, range.x0, range.x1, range.y0, range.y1, s);
    }
    return movable ? fastest : 0;
}

/// Largest speed in cell k at both velocities.
static void find_speed(bt_world *world, bt_idx k, const void *velocities, bt_totals *none)
{
    (void)none;
    bt_cells *cells = world->cells;
    const bt_vel *const *v = velocities;
    const double least = stir(world);
    double s = 0;
    if (k == cells->n - 1) return;
    const bt_idx end = bt_cells_moves(cells, k) ? cells->cell[k].end : cells->cell[k].first;
    for (bt_idx i = cells->cell[k].first; i < end; i++) {
        // most floes of a moving cell are at rest
        if (!bt_bodies_drift(world, &v[0][i])) s = bt_max(s, bt_bodies_speed(world, i, &v[0][i]));
        if (v[1] != v[0] && !bt_bodies_drift(world, &v[1][i])) s = bt_max(s, bt_bodies_speed(world, i, &v[1][i]));
        if (world->bodies.disturbed[i]) s = bt_max(s, least);
    }
    cells->speed[k] = s;
}

double bt_contacts_bound(bt_world *world, const bt_vel *v, const bt_vel *v2, bool keep)
{
    bt_cells *cells = world->cells;
    const bt_bodies *bodies = &world->bodies;
    const bt_idx n = cells->n - 1;
    if (!keep) {
        for (bt_idx j = 0; j < cells->n_busy; j++) {
            cells->bound[cells->busy[j]] = 0;
            cells->awake[cells->busy[j]] = 0;
        }
    }
    const bt_idx n_busy = cells->n_busy; // others rest
    bt_totals none = {0};
    bt_phases_busy(world, find_speed, (const bt_vel *const[2]){v, v2}, &none);
    double fastest = 0;
    for (bt_idx j = 0; j < n_busy; j++) {
        const bt_idx k = cells->busy[j];
        if (!(cells->speed[k] > 0) || !cells->cell[k].own) continue;
        fastest = bt_max(fastest, cells->speed[k]);
        spread(cells, cells->cell[k].x, cells->cell[k].y, cells->speed[k]);
    }
    bt_domain_tell_cells(world, cells->speed, spread);
    const double large = spread_large(world, v, v2);
    bt_cells_sort_busy(cells);
    // The last cell meets floes anywhere: its bound is the speed of the fastest.
    bool movable = false;
    for (bt_idx l = cells->n_in_cells; l < bodies->n; l++) movable = movable || bodies->motion[l] == BT_DYNAMIC;
    fastest = bt_max(fastest, large);
    bt_domain_maxima(world, &fastest, 1);
    if (movable) cells->bound[n] = bt_max(cells->bound[n], fastest);
    return fastest;
}

bool bt_contacts_outrun(const bt_world *world)
{
    const bt_cells *cells = world->cells;
    double any = 0;
    for (bt_idx j = 0; j < cells->n_busy && any == 0; j++) {
        const bt_idx k = cells->busy[j];
        const bt_cell *cell = &cells->cell[k];
        any = cell->own && cells->bound[k] > 0 &&
              (!cell->active || !bt_margin_holds(world, cell->margin, cells->bound[k]) ||
                                                   2 * world->par.dt * cells->bound[k] > bt_margin_most(world));
    }
    bt_domain_maxima(world, &any, 1);
    return any > 0;
}

typedef struct {
    bt_pair_scratch pairs;
    bt_pack_scratch pack;
} thread_scratch;

/// Is one of the pair a polygon of several: a part of a floe, or a piece of a shore?
static bool in_several(const bt_world *world, const bt_pair *pair)
{
    return pair->part[0] || pair->part[1] || bt_shore_holds(world, pair->a) || bt_shore_holds(world, pair->b);
}

/// Merge contacts found by several parts of a floe, or pieces of a shore.
static void merge(const bt_world *world, bt_cell *cell, bt_pack_scratch *scratch)
{
    for (size_t k = 0; bt_laws_rise(&world->par) && k < scratch->n; k++) {
        const bt_pair *pair = &cell->search.pairs[scratch->pair[k]];
        if (in_several(world, pair)) bt_bearing_note(cell, scratch->pair[k], &scratch->man[k]);
    }
    bt_merge_parts(world, scratch->man, scratch->n);
    size_t kept = 0;
    for (size_t k = 0; k < scratch->n; k++) {
        if (scratch->man[k].n_points == 0) {
            cell->search.pairs[scratch->pair[k]].contact = -1;
            continue;
        }
        scratch->man[kept] = scratch->man[k];
        scratch->pair[kept++] = scratch->pair[k];
    }
    scratch->n = kept;
}

/// Replace contacts of pairs with a record by those that a law makes, or append these.
static void replace(const bt_world *world, bt_cell *cell, bt_pack_scratch *scratch)
{
    const size_t n = scratch->n;
    for (int law = 0; law < BT_LAWS; law++) {
        if (!bt_laws[law]->contact || !bt_law_on(&world->par, law)) continue;
        for (size_t k = 0; k < n; k++) {
            bt_pair *pair = &cell->search.pairs[scratch->pair[k]];
            const bt_memory names = bt_law_names(world, pair, law);
            const bt_idx at = bt_law_find(cell, &names);
            if (at < 0) continue;
            bt_manifold edge, *sheets = bt_pack_next(scratch, scratch->pair[k]);
            if (bt_laws[law]->contact(world, pair, &cell->laws->memory[at], &edge, sheets)) {
                scratch->man[k] = edge;
                scratch->n++;
            } else {
                scratch->man[k] = *sheets;
                pair->contact = -1;
            }
        }
    }
}

static void narrow_phase(bt_world *world, bt_idx k, const void *scratch, bt_totals *none)
{
    (void)none;
    const bt_bodies *bodies = &world->bodies;
    thread_scratch *s = &(*(thread_scratch *const *)scratch)[omp_get_thread_num()];
    bt_cell *cell = &world->cells->cell[k];
    if (cell->laws->n_memory > 0) bt_laws_prune(world, cell);
    bt_pairs_update(world, k, cell, cell->margin, &s->pairs);
    bt_pack_begin(&s->pack, 2 * (size_t)cell->search.n_pairs); // a pair may have a second contact (replace)
    bool several = false; // polygons of one outline
    cell->laws->n_overlaps = 0;
    const bool near = bt_pairs_near(world, k, cell, cell->margin);
    const double far = cell->margin + bt_pairs_near_gap(world);
    for (bt_idx j = 0, n = near ? cell->search.n_near : cell->search.n_pairs; j < n; j++) {
        const bt_idx i = near ? cell->search.near[j] : j;
        bt_pair *pair = &cell->search.pairs[i];
        const double paths = bodies->path[pair->a] + bodies->path[pair->b];
        if (paths + cell->margin < pair->axes.reach) {
            pair->contact = -1;
            if (!near && !(paths + far < pair->axes.reach)) bt_pairs_add_near(cell, i);
            continue;
        }
        if (!near) bt_pairs_add_near(cell, i);
        bt_manifold *manifold = bt_pack_next(&s->pack, i);
        const int reference_before = pair->contact >= 0 ? (int)(cell->gaps[pair->contact].feature[0] >> 31) : -1;
        if (!bt_contacts_parts(world, pair->a, pair->b, pair->part, cell->margin, reference_before, manifold,
                               &pair->axes)) {
            pair->contact = -1;
            continue;
        }
        s->pack.n++;
        several = several || in_several(world, pair);
    }
    if (several) merge(world, cell, &s->pack);
    if (cell->laws->n_memory > 0) replace(world, cell, &s->pack);
    bt_pack_contacts(world, k, &s->pack);
}

static void wake_body(bt_world *world, bt_idx i)
{
    bt_cells *cells = world->cells;
    if (world->bodies.large[i]) return;
    const bt_idx k = bt_cells_at(cells, world->bodies.cell[i][0], world->bodies.cell[i][1]);
    cells->awake[k] = 1;
    bt_cells_wake(cells, k);
}

/// Find the cells with bodies that contacts, here or on other ranks, may move; a second detection in the same step puts
/// no cell to sleep.
static void find_awake(bt_world *world)
{
    bt_cells *cells = world->cells;
    for (bt_idx i = 0; i < cells->n_order; i++) {
        const bt_cell *cell = &cells->cell[cells->order[i]];
        if (cell->phase == BT_COLOURS) {
            for (bt_idx j = 0; j < cell->n_contacts; j++)
                wake_body(world, cell->contacts[j].a), wake_body(world, cell->contacts[j].b);
            continue;
        }
        const bt_idx block[4] = {cells->order[i], cell->right, cell->above, cell->diagonal};
        for (int j = 0; j < 4; j++) {
            if (block[j] < 0) continue;
            cells->awake[block[j]] = 1;
            bt_cells_wake(cells, block[j]);
        }
    }
    bt_domain_moved_elsewhere(world, wake_body);
    bt_cells_sort_busy(cells);
}

static void mark_touched(const bt_cell *cell, uint8_t bit, uint8_t *touched)
{
    for (bt_idx j = 0; j < cell->n_contacts; j++) {
        touched[cell->contacts[j].a] |= bit;
        touched[cell->contacts[j].b] |= bit;
    }
}

void bt_contacts_detect(bt_world *world, bool again)
{
    enum { FEW = 8 }; // a cell takes about ten microseconds
    bt_cells *cells = world->cells;
    cells->beside = bt_laws_on(&world->par) ? world->par.slop : 0; // contact/law_pair.h, bt_closing
    bt_idx *due = bt_alloc((size_t)cells->n_busy, sizeof *due), n_due = 0;
    for (bt_idx j = 0; j < cells->n_busy; j++) {
        const bt_idx k = cells->busy[j];
        bt_cell *cell = &cells->cell[k];
        cell->just_detected = false;
        if (!cell->own) continue;
        const bool active = cells->bound[k] > 0;
        if (!active) {
            if (cell->search.pairs || cell->n_contacts) bt_cells_idle(cell);
            cell->active = false;
            continue;
        }
        if (again && cell->active && bt_margin_holds(world, cell->margin, cells->bound[k])) continue;
        cell->active = true;
        cell->margin = bt_margin_for(world, cells->bound[k]);
        cell->just_detected = true;
        due[n_due++] = k;
    }
    // inside a parallel region of the caller, one thread does the pass and keeps its number
    const int team = omp_get_num_threads(), most = omp_get_max_threads(), threads = team > most ? team : most;
    thread_scratch *scratch = bt_alloc((size_t)threads, sizeof *scratch);
    bt_phases_listed(world, due, n_due, FEW, narrow_phase, &scratch, &(bt_totals){0});
    for (int i = 0; i < threads; i++) {
        bt_pair_scratch_free(&scratch[i].pairs);
        bt_pack_scratch_free(&scratch[i].pack);
    }
    free(scratch);
    free(due);
    const double t0 = bt_clock();
    bt_phases_order(world);
    world->stats.phases.colour += bt_clock() - t0;
    bt_domain_select(world, mark_touched);
    find_awake(world);
    bt_cells_leave(cells);
}

double bt_contacts_overlap(bt_world *world)
{
    bt_cells_begin(world); // from here on and again below, bodies may lie elsewhere
    if (bt_cells_update(world,
                        bt_margin_for(world, bt_contacts_bound(world, world->bodies.vel, world->bodies.vel, false))))
        bt_contacts_bound(world, world->bodies.vel, world->bodies.vel, false);
    bt_contacts_detect(world, false);
    const bt_cells *cells = world->cells;
    double deepest = 0;
    for (bt_idx k = 0; k < cells->n; k++)
        if (cells->cell[k].own) deepest = bt_max(deepest, cells->cell[k].overlap);
    bt_domain_maxima(world, &deepest, 1);
    return deepest;
}

/// Keep the deeper of two; of equals the one with the lower ids, so that the order of threads does not matter.
static void deeper(bt_overlaps *to, const bt_overlaps *overlaps)
{
    to->pairs += overlaps->pairs;
    const bool same = overlaps->deepest == to->deepest, first = overlaps->a < to->a ||
                                                                (overlaps->a == to->a && overlaps->b < to->b);
    if (!(overlaps->deepest > to->deepest || (same && overlaps->pairs > 0 && first))) return;
    to->deepest = overlaps->deepest;
    to->a = overlaps->a, to->b = overlaps->b;
}

/// Overlaps in the pairs of one cell. A body of several parts is one body.
static bt_overlaps overlaps_of(const bt_world *world, const bt_cell *cell, double allowed)
{
    bt_overlaps all = {0}, pair = {0};
    for (bt_idx i = 0; i < cell->search.n_pairs; i++) {
        const bt_pair *q = &cell->search.pairs[i];
        const bt_gid a = world->bodies.gid[q->a], b = world->bodies.gid[q->b];
        if (pair.a != a || pair.b != b) {
            deeper(&all, &pair);
            pair = (bt_overlaps){.a = a, .b = b};
        }
        bt_manifold manifold;
        if (!bt_contacts_parts(world, q->a, q->b, q->part, 0, -1, &manifold, NULL)) continue;
        for (int j = 0; j < manifold.n_points; j++) pair.deepest = bt_max(pair.deepest, 0 - manifold.p[j].gap);
        pair.pairs = pair.deepest > allowed;
    }
    deeper(&all, &pair);
    return all;
}

/// Overlaps in all cells of this rank.
static bt_overlaps all_overlaps(bt_world *world, double allowed)
{
    const bt_cells *cells = world->cells;
    bt_overlaps all = {0};
    // One cell at a time, on temporary lists: needs neither the step's contacts nor memory for all lists.
#pragma omp parallel if (BT_MANY(cells->n, BT_FEW_CELLS))
    {
        BT_PLAIN_NUMBERS;
        bt_pair_scratch scratch = {0};
#pragma omp for schedule(dynamic, 4)
        for (bt_idx k = 0; k < cells->n; k++) {
            if (!cells->cell[k].own) continue;
            bt_cell own = cells->cell[k];
            own.search.pairs = NULL;
            own.search.n_pairs = own.search.cap_pairs = 0;
            own.search.listed = false;
            bt_pairs_update(world, k, &own, 0, &scratch);
            const bt_overlaps here = overlaps_of(world, &own, allowed);
#pragma omp critical
            deeper(&all, &here);
            free(own.search.pairs);
        }
        bt_pair_scratch_free(&scratch);
    }
    return all;
}

bt_overlaps bt_world_overlaps(bt_world *world, double allowed)
{
    BT_PLAIN_NUMBERS;
    bt_cells_begin(world);
    bt_cells_update(world, world->par.slop);
    return all_overlaps(world, allowed);
}
