// SPDX-License-Identifier: MIT
// Rows of pairs that pass each other are released, and come back where the pair meets; contacts.h.
#include "contact/contacts.h"

#include <stdlib.h>
#include <string.h>

#include "base/inside.h"
#include "contact/pack.h"
#include "contact/row.h"
#include "geometry/polygons.h"
#include "partition/domain.h"
#include "space/phases.h"
#include "space/shore.h"

/// Part `part` of body i, as bt_contacts_parts sees it.
static bt_moving moving_part(const bt_bodies *bodies, bt_idx i, int part, const bt_vel *v)
{
    const int64_t first = bodies->offset[i] + part;
    return (bt_moving){bodies->mark[first].count, bodies->outline + 2 * first, v->x, v->y, v->w};
}

/// Is body i, or its shore, a of the contact (0) or b (1)? −1: neither.
static int side_of(const bt_world *world, const bt_contact *contact, bt_idx i)
{
    const bt_gid *gid = world->bodies.gid, outline = bt_shore_outline(world->shore, gid[i]);
    return outline == bt_shore_outline(world->shore, gid[contact->a])   ? 0
           : outline == bt_shore_outline(world->shore, gid[contact->b]) ? 1 : -1;
}

/// Is the pair of the same bodies as the contact, or of another piece of the same shore? That piece may be the other
/// one of its pair.
static bool of_same_outlines(const bt_world *world, const bt_pair *pair, const bt_contact *contact)
{
    return side_of(world, contact, pair->a) + side_of(world, contact, pair->b) == 1;
}

/// Would the bodies of the contact meet at these velocities? All their parts and pieces nearby count: where several
/// touch at one place, one row stands for all (detect.c).
static bool meets(const bt_world *world, const bt_cell *cell, const bt_contact *contact, const bt_vel *va,
                  const bt_vel *vb)
{
    const bt_bodies *bodies = &world->bodies;
    const bt_vel *const v[] = {va, vb};
    const bt_pair *pairs = cell->search.pairs;
    bt_idx first = contact->pair, end = contact->pair + 1; // the list is in the order of gids
    if (bt_shore_holds(world, contact->a) || bt_shore_holds(world, contact->b)) first = 0, end = cell->search.n_pairs;
    while (first > 0 && of_same_outlines(world, &pairs[first - 1], contact)) first--;
    while (end < cell->search.n_pairs && of_same_outlines(world, &pairs[end], contact)) end++;
    for (bt_idx i = first; i < end; i++) {
        const bt_pair *pair = &pairs[i];
        if (!of_same_outlines(world, pair, contact)) continue;
        double d[2];
        bt_bodies_offset(world, pair->a, pair->b, d);
        const bt_moving p = moving_part(bodies, pair->a, pair->part[0], v[side_of(world, contact, pair->a)]),
                        q = moving_part(bodies, pair->b, pair->part[1], v[side_of(world, contact, pair->b)]);
        if (bt_sweep_meets(&p, &q, d[0], d[1], world->par.slop, world->par.dt)) return true;
    }
    return false;
}

/// Add the load of a contact, times `share`, to velocities of its bodies.
static void add_load(const bt_world *world, const bt_contact *contact, double share, bt_vel *va, bt_vel *vb)
{
    const bt_inv *inv = world->bodies.inv;
    bt_apply(contact, share * (contact->ln[0] + contact->ln[1]),
             share * (contact->ln[0] * contact->ran[0] + contact->ln[1] * contact->ran[1]),
             share * (contact->ln[0] * contact->rbn[0] + contact->ln[1] * contact->rbn[1]), share * contact->lt,
             inv[contact->a], inv[contact->b], va, vb);
}

/// The same in an array over the bodies.
static void add_load_to(const bt_world *world, const bt_contact *contact, double share, bt_vel *v)
{
    const bt_inv *inv = world->bodies.inv;
    bt_vel va = v[contact->a], vb = v[contact->b];
    add_load(world, contact, share, &va, &vb);
    bt_store(&v[contact->a], inv[contact->a], &va);
    bt_store(&v[contact->b], inv[contact->b], &vb);
}

/// Is row j one that may be released: loaded, and not known to belong to a pair that meets?
static bool in_question(const bt_cell *cell, bt_idx j)
{
    const bt_contact *contact = &cell->contacts[j];
    return cell->gaps[j].row != BT_ROW_STAYS && cell->gaps[j].row != BT_ROW_RELEASED &&
           (contact->ln[0] != 0 || contact->ln[1] != 0);
}

/// A review under way.
typedef struct {
    bool release;
    bt_vel *v; ///< [n bodies] velocities without the loads in question, but with those of the rows confirmed so far
} review;
enum { PASSING, OPEN, CONFIRMED, AGAINST, RELEASED, N_REVIEW }; ///< totals: rows

static int64_t count(const bt_totals *totals, int which) { return (int64_t)bt_sum_value(&totals->sum[which]); }

/// Mark rows whose pair passes without their load.
static void look_cell(bt_world *world, bt_idx k, const void *context, bt_totals *totals)
{
    (void)context;
    bt_cell *cell = &world->cells->cell[k];
    int n[N_REVIEW] = {0};
    for (bt_idx j = 0; j < cell->n_contacts; j++) {
        const bt_contact *contact = &cell->contacts[j];
        n[RELEASED] += cell->gaps[j].row == BT_ROW_RELEASED;
        if (!in_question(cell, j)) continue;
        bt_vel va = world->bodies.vel[contact->a], vb = world->bodies.vel[contact->b];
        add_load(world, contact, -1, &va, &vb);
        const bool open = meets(world, cell, contact, &va, &vb);
        if (!open) cell->gaps[j].row = BT_ROW_PASSING;
        n[open ? OPEN : PASSING]++;
    }
    for (int i = 0; i < N_REVIEW; i++)
        if (n[i] > 0) bt_sum_add(&totals->sum[i], n[i]);
}

static void copy_velocities(bt_world *world, bt_idx k, const void *context, bt_totals *none)
{
    (void)none;
    const bt_cell *cell = &world->cells->cell[k];
    memcpy(((const review *)context)->v + cell->first, world->bodies.vel + cell->first,
           (size_t)(cell->end - cell->first) * sizeof *world->bodies.vel);
}

/// Remove the loads in question.
static void unload_cell(bt_world *world, bt_idx k, const void *context, bt_totals *none)
{
    (void)none;
    const bt_cell *cell = &world->cells->cell[k];
    for (bt_idx j = 0; j < cell->n_contacts; j++)
        if (in_question(cell, j)) add_load_to(world, &cell->contacts[j], -1, ((const review *)context)->v);
}

/// Confirm rows whose pair meets under the loads so far, and add their loads.
static void confirm_cell(bt_world *world, bt_idx k, const void *context, bt_totals *totals)
{
    bt_vel *v = ((const review *)context)->v;
    bt_cell *cell = &world->cells->cell[k];
    int confirmed = 0;
    for (bt_idx j = 0; j < cell->n_contacts; j++) {
        const bt_contact *contact = &cell->contacts[j];
        if (cell->gaps[j].row != BT_ROW_OPEN || !in_question(cell, j) ||
            !meets(world, cell, contact, &v[contact->a], &v[contact->b])) continue;
        add_load_to(world, contact, 1, v);
        cell->gaps[j].row = BT_ROW_CONFIRMED;
        confirmed++;
    }
    if (confirmed > 0) bt_sum_add(&totals->sum[CONFIRMED], confirmed);
}

/// Collective. Confirm the open rows, of this number, that follow from loads which do not depend on them.
static void confirm(bt_world *world, review *r, int64_t open)
{
    r->v = bt_alloc_unset((size_t)world->bodies.n + 1, sizeof *r->v); // a rank may hold nothing
    bt_phases_run(world, BT_WITH_WORK, &(bt_before){copy_velocities, r}, unload_cell, r, r->v, &(bt_totals){0});
    for (int64_t more = 1; open > 0 && more > 0; open -= more) {
        bt_totals totals = {.n_sums = N_REVIEW};
        bt_phases_run(world, BT_WITH_WORK, NULL, confirm_cell, r, r->v, &totals);
        bt_domain_reduce(world, &totals);
        more = count(&totals, CONFIRMED);
    }
    free(r->v);
}

/// Release the rows in question that were not confirmed.
static void release_cell(bt_world *world, bt_idx k, const void *context, bt_totals *totals)
{
    const review *r = context;
    bt_cell *cell = &world->cells->cell[k];
    for (bt_idx j = 0; j < cell->n_contacts; j++) {
        if (!in_question(cell, j)) continue;
        const bool stays = cell->gaps[j].row == BT_ROW_CONFIRMED || !r->release;
        if (cell->gaps[j].row != BT_ROW_CONFIRMED) bt_sum_add(&totals->sum[AGAINST], 1);
        if (stays) cell->gaps[j].row = BT_ROW_OPEN;
        else bt_pack_set_row(world, cell, j, BT_ROW_RELEASED);
    }
}

/// Restore released rows whose pair meets.
static void restore_cell(bt_world *world, bt_idx k, const void *context, bt_totals *totals)
{
    (void)context;
    bt_cell *cell = &world->cells->cell[k];
    for (bt_idx j = 0; j < cell->n_contacts; j++) {
        const bt_contact *contact = &cell->contacts[j];
        if (cell->gaps[j].row != BT_ROW_RELEASED ||
            !meets(world, cell, contact, &world->bodies.vel[contact->a], &world->bodies.vel[contact->b])) continue;
        bt_pack_set_row(world, cell, j, BT_ROW_STAYS);
        bt_sum_add(&totals->sum[AGAINST], 1);
    }
}

/// Collective. A pass in any order; returns the rows of this kind.
static int64_t pass(bt_world *world, bt_visit *visit, const review *r)
{
    bt_totals totals = {.n_sums = N_REVIEW};
    bt_phases_any_order(world, visit, r, &totals);
    bt_domain_reduce(world, &totals);
    return count(&totals, AGAINST);
}

int64_t bt_passing_review(bt_world *world, bool release)
{
    review r = {.release = release};
    bt_totals totals = {.n_sums = N_REVIEW};
    bt_phases_any_order(world, look_cell, &r, &totals);
    bt_domain_reduce(world, &totals);
    const int64_t open = count(&totals, OPEN);
    if (open > 0) confirm(world, &r, open);
    const int64_t against = open + count(&totals, PASSING) > 0 ? pass(world, release_cell, &r) : 0;
    // What is released now may be the only reason why pairs that were released before meet.
    if ((release && against > 0) || count(&totals, RELEASED) == 0) return against;
    return against + pass(world, restore_cell, &r);
}
