// SPDX-License-Identifier: MIT
// Rows of pairs that pass each other are released, and come back where the pair meets; contacts.h.
#include "contact/contacts.h"

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

/// Is the pair of the same bodies as the contact, or of another piece of the same shore?
static bool of_same_outlines(const bt_world *world, const bt_pair *pair, const bt_contact *contact)
{
    return (pair->a == contact->a || (bt_shore_holds(world, pair->a) && bt_shore_holds(world, contact->a))) &&
           (pair->b == contact->b || (bt_shore_holds(world, pair->b) && bt_shore_holds(world, contact->b)));
}

/// Would the bodies of the contact meet without this load, all other loads unchanged? All their parts and pieces nearby
/// count: where several touch at one place, one row stands for all (detect.c).
static bool meet_without(const bt_world *world, const bt_cell *cell, const bt_contact *contact)
{
    const bt_bodies *bodies = &world->bodies;
    const bt_pair *pairs = cell->search.pairs;
    bt_vel va = bodies->vel[contact->a], vb = bodies->vel[contact->b];
    bt_apply(contact, -(contact->ln[0] + contact->ln[1]),
             -(contact->ln[0] * contact->ran[0] + contact->ln[1] * contact->ran[1]),
             -(contact->ln[0] * contact->rbn[0] + contact->ln[1] * contact->rbn[1]), -contact->lt,
             bodies->inv[contact->a], bodies->inv[contact->b], &va, &vb);
    bt_idx first = contact->pair, end = contact->pair + 1; // the list is in the order of gids
    if (bt_shore_holds(world, contact->a) || bt_shore_holds(world, contact->b)) first = 0, end = cell->search.n_pairs;
    while (first > 0 && of_same_outlines(world, &pairs[first - 1], contact)) first--;
    while (end < cell->search.n_pairs && of_same_outlines(world, &pairs[end], contact)) end++;
    for (bt_idx i = first; i < end; i++) {
        if (!of_same_outlines(world, &pairs[i], contact)) continue;
        double d[2];
        bt_bodies_offset(world, pairs[i].a, pairs[i].b, d);
        const bt_moving p = moving_part(bodies, pairs[i].a, pairs[i].part[0], &va),
                        q = moving_part(bodies, pairs[i].b, pairs[i].part[1], &vb);
        if (bt_sweep_meets(&p, &q, d[0], d[1], world->par.slop, world->par.dt)) return true;
    }
    return false;
}

static void review_cell(bt_world *world, bt_idx k, const void *context, bt_totals *totals)
{
    const bool release = *(const bool *)context;
    bt_cell *cell = &world->cells->cell[k];
    int changed = 0;
    for (bt_idx j = 0; j < cell->n_contacts; j++) {
        const bt_contact *contact = &cell->contacts[j];
        const bool released = cell->gaps[j].row == BT_ROW_RELEASED;
        if (cell->gaps[j].row == BT_ROW_STAYS || (!released && contact->ln[0] == 0 && contact->ln[1] == 0)) continue;
        if (meet_without(world, cell, contact) != released) continue;
        if (released) bt_pack_set_row(world, cell, j, BT_ROW_STAYS);
        else if (release) bt_pack_set_row(world, cell, j, BT_ROW_RELEASED);
        changed++;
    }
    if (changed > 0) bt_sum_add(&totals->sum[0], changed);
}

int64_t bt_passing_review(bt_world *world, bool release)
{
    bt_totals totals = {.n_sums = 1};
    bt_phases_any_order(world, review_cell, &release, &totals);
    bt_domain_reduce(world, &totals);
    return (int64_t)bt_sum_value(&totals.sum[0]);
}
