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

/// Is the pair of the same bodies as the contact, or of another piece of the same shore?
static bool of_same_outlines(const bt_world *world, const bt_pair *pair, const bt_contact *contact)
{
    return (pair->a == contact->a || (bt_shore_holds(world, pair->a) && bt_shore_holds(world, contact->a))) &&
           (pair->b == contact->b || (bt_shore_holds(world, pair->b) && bt_shore_holds(world, contact->b)));
}

/// Would the bodies of the contact meet at these velocities? All their parts and pieces nearby count: where several
/// touch at one place, one row stands for all (detect.c).
static bool meets(const bt_world *world, const bt_cell *cell, const bt_contact *contact, const bt_vel *va,
                  const bt_vel *vb)
{
    const bt_bodies *bodies = &world->bodies;
    const bt_pair *pairs = cell->search.pairs;
    bt_idx first = contact->pair, end = contact->pair + 1; // the list is in the order of gids
    if (bt_shore_holds(world, contact->a) || bt_shore_holds(world, contact->b)) first = 0, end = cell->search.n_pairs;
    while (first > 0 && of_same_outlines(world, &pairs[first - 1], contact)) first--;
    while (end < cell->search.n_pairs && of_same_outlines(world, &pairs[end], contact)) end++;
    for (bt_idx i = first; i < end; i++) {
        if (!of_same_outlines(world, &pairs[i], contact)) continue;
        double d[2];
        bt_bodies_offset(world, pairs[i].a, pairs[i].b, d);
        const bt_moving p = moving_part(bodies, pairs[i].a, pairs[i].part[0], va),
                        q = moving_part(bodies, pairs[i].b, pairs[i].part[1], vb);
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

static bool is_loaded(const bt_contact *contact) { return contact->ln[0] != 0 || contact->ln[1] != 0; }

/// A review under way. Totals: the rows that it has changed; loaded rows that may be released.
typedef struct {
    bool release;
    bt_vel *v; ///< [n bodies] velocities under the loads that stay and those of rows confirmed so far
} review;
enum { CHANGED, IN_QUESTION, N_REVIEW };

/// Release rows whose pair passes without their load, and restore those of released pairs that meet.
static void review_cell(bt_world *world, bt_idx k, const void *context, bt_totals *totals)
{
    const review *r = context;
    bt_cell *cell = &world->cells->cell[k];
    int changed = 0, in_question = 0;
    for (bt_idx j = 0; j < cell->n_contacts; j++) {
        const bt_contact *contact = &cell->contacts[j];
        const bool released = cell->gaps[j].row == BT_ROW_RELEASED;
        if (cell->gaps[j].row == BT_ROW_STAYS || (!released && !is_loaded(contact))) continue;
        bt_vel va = world->bodies.vel[contact->a], vb = world->bodies.vel[contact->b];
        add_load(world, contact, -1, &va, &vb);
        if (meets(world, cell, contact, &va, &vb) != released) {
            in_question += !released;
            continue;
        }
        if (released) bt_pack_set_row(world, cell, j, BT_ROW_STAYS);
        else if (r->release) bt_pack_set_row(world, cell, j, BT_ROW_RELEASED);
        changed++;
    }
    if (changed > 0) bt_sum_add(&totals->sum[CHANGED], changed);
    if (in_question > 0) bt_sum_add(&totals->sum[IN_QUESTION], in_question);
}

static void copy_velocities(bt_world *world, bt_idx k, const void *context, bt_totals *none)
{
    (void)none;
    const bt_cell *cell = &world->cells->cell[k];
    memcpy(((const review *)context)->v + cell->first, world->bodies.vel + cell->first,
           (size_t)(cell->end - cell->first) * sizeof *world->bodies.vel);
}

/// Remove the loads of the rows in question.
static void unload_cell(bt_world *world, bt_idx k, const void *context, bt_totals *none)
{
    (void)none;
    const bt_cell *cell = &world->cells->cell[k];
    for (bt_idx j = 0; j < cell->n_contacts; j++)
        if (cell->gaps[j].row == BT_ROW_OPEN && is_loaded(&cell->contacts[j]))
            add_load_to(world, &cell->contacts[j], -1, ((const review *)context)->v);
}

/// Confirm rows in question whose pair meets under the loads so far, and add their loads.
static void confirm_cell(bt_world *world, bt_idx k, const void *context, bt_totals *totals)
{
    bt_vel *v = ((const review *)context)->v;
    bt_cell *cell = &world->cells->cell[k];
    int confirmed = 0;
    for (bt_idx j = 0; j < cell->n_contacts; j++) {
        const bt_contact *contact = &cell->contacts[j];
        if (cell->gaps[j].row != BT_ROW_OPEN || !is_loaded(contact) ||
            !meets(world, cell, contact, &v[contact->a], &v[contact->b])) continue;
        add_load_to(world, contact, 1, v);
        cell->gaps[j].row = BT_ROW_CONFIRMED;
        confirmed++;
    }
    if (confirmed > 0) bt_sum_add(&totals->sum[CHANGED], confirmed);
}

/// Release the rows that were not confirmed.
static void end_cell(bt_world *world, bt_idx k, const void *context, bt_totals *totals)
{
    const review *r = context;
    bt_cell *cell = &world->cells->cell[k];
    for (bt_idx j = 0; j < cell->n_contacts; j++) {
        bt_gaps *gaps = &cell->gaps[j];
        if (gaps->row == BT_ROW_CONFIRMED) {
            gaps->row = BT_ROW_OPEN;
        } else if (gaps->row == BT_ROW_OPEN && is_loaded(&cell->contacts[j])) {
            if (r->release) bt_pack_set_row(world, cell, j, BT_ROW_RELEASED);
            bt_sum_add(&totals->sum[CHANGED], 1);
        }
    }
}

/// Collective. Release rows in question, of this number, that only confirm each other. Returns how many.
static int64_t release_circles(bt_world *world, review *r, int64_t in_question)
{
    r->v = bt_alloc_unset((size_t)world->bodies.n + 1, sizeof *r->v);
    bt_phases_run(world, BT_WITH_WORK, &(bt_before){copy_velocities, r}, unload_cell, r, r->v, &(bt_totals){0});
    for (int64_t more = in_question; in_question > 0 && more > 0; in_question -= more) {
        bt_totals totals = {.n_sums = N_REVIEW};
        bt_phases_run(world, BT_WITH_WORK, NULL, confirm_cell, r, r->v, &totals);
        bt_domain_reduce(world, &totals);
        more = (int64_t)bt_sum_value(&totals.sum[CHANGED]);
    }
    free(r->v);
    bt_totals totals = {.n_sums = N_REVIEW};
    bt_phases_any_order(world, end_cell, r, &totals);
    bt_domain_reduce(world, &totals);
    return (int64_t)bt_sum_value(&totals.sum[CHANGED]);
}

int64_t bt_passing_review(bt_world *world, bool release)
{
    bt_totals totals = {.n_sums = N_REVIEW};
    review r = {.release = release};
    bt_phases_any_order(world, review_cell, &r, &totals);
    bt_domain_reduce(world, &totals);
    const int64_t in_question = (int64_t)bt_sum_value(&totals.sum[IN_QUESTION]),
                  circular = in_question > 0 ? release_circles(world, &r, in_question) : 0;
    return (int64_t)bt_sum_value(&totals.sum[CHANGED]) + circular;
}
