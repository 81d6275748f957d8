// SPDX-License-Identifier: MIT
// The table of contact laws, and the code common to all of them; contact/law.h.
#include "contact/law.h"
#include "contact/law_pair.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "contact/added.h"
#include "partition/domain.h"
#include "contact/row.h"

const bt_law bt_rigid_law = {.name = "rigid", .what = "a contact bears any load"};

#define POINTER(name, law) &law,
const bt_law *const bt_laws[BT_LAWS] = {BT_CONTACT_LAWS(POINTER)};

int bt_law_first_number(int law)
{
    int n = 0;
    while (law > 0) n += bt_laws[--law]->n_numbers;
    return n;
}

int bt_law_first_total(int law)
{
    int n = 0;
    while (law > 0) n += bt_laws[--law]->n_totals;
    return n;
}

void bt_laws_setup(const bt_case *input, bt_params *par)
{
    for (int law = 0; law < BT_LAWS; law++)
        if (bt_laws[law]->setup) bt_laws[law]->setup(input, par->law_own[law]);
    bt_added_setup(input, par);
}

bool bt_law_on(const bt_params *par, int law)
{
    return law < BT_LAWS ? bt_laws[law]->on && bt_laws[law]->on(par->law_own[law]) : bt_added_on(par, law);
}

bool bt_law_applies(const bt_world *world, int law, bt_idx a, bt_idx b)
{
    return law < BT_LAWS ? bt_laws[law]->applies(world, a, b) : bt_added_applies(world, law, a, b);
}

bool bt_laws_on(const bt_params *par)
{
    for (int law = 0; law < BT_ALL_LAWS; law++)
        if (bt_law_on(par, law)) return true;
    return false;
}

bool bt_laws_rise(const bt_params *par)
{
    for (int law = 0; law < BT_LAWS; law++)
        if (bt_laws[law]->rises && bt_law_on(par, law)) return true;
    return false;
}

// --- memory ----------------------------------------------------------------------------------------------------------

void bt_laws_prune(const bt_world *world, bt_cell *cell)
{
    bt_idx kept = 0;
    for (bt_idx k = 0; k < cell->laws->n_memory; k++) {
        bt_memory *memory = &cell->laws->memory[k];
        if (memory->law < BT_LAWS ? bt_laws[memory->law]->keeps(world, memory) : bt_law_near(world, memory))
            cell->laws->memory[kept++] = *memory;
    }
    cell->laws->n_memory = kept;
}

// --- bounds ----------------------------------------------------------------------------------------------------------

void bt_laws_reserve(bt_cell *cell)
{
    if (cell->n_contacts <= cell->laws->cap_limits) return;
    cell->laws->cap_limits = bt_cells_room(cell->n_contacts);
    free(cell->laws->limits);
    free(cell->laws->rises);
    cell->laws->limits = bt_alloc_unset((size_t)cell->laws->cap_limits, sizeof *cell->laws->limits);
    cell->laws->rises = cell->laws->rising ? bt_alloc_unset((size_t)cell->laws->cap_limits, sizeof *cell->laws->rises)
                                         : NULL;
}

void bt_laws_recall(const bt_world *world, bt_cell *cell, bt_idx j, const bt_pair *pair, const bt_manifold *manifold)
{
    bt_limit *limit = &cell->laws->limits[j];
    *limit = (bt_limit){
        .flat = {INFINITY, INFINITY}, .most = {INFINITY, INFINITY}, .cap = {INFINITY, INFINITY},
        .rise = cell->laws->rises ? &cell->laws->rises[j] : NULL};
    if (limit->rise) *limit->rise = (bt_rise){0};
    for (int law = 0; law < BT_ALL_LAWS; law++) limit->record[law] = -1;
    for (int law = 0; manifold->n_points > 0 && law < BT_LAWS; law++)
        if (bt_laws[law]->recall && bt_law_on(&world->par, law) &&
            bt_laws[law]->applies(world, manifold->a, manifold->b))
            bt_laws[law]->recall(world, cell, j, pair, manifold);
}

void bt_laws_bound(const bt_world *world, bt_cell *cell, bt_idx j, const bt_pair *pair, const bt_manifold *manifold)
{
    bt_limit *limit = &cell->laws->limits[j];
    if (manifold->n_points > 0 && world->par.added_laws > 0)
        memcpy(limit->closes, bt_law_closing(world, cell, j, manifold).point, sizeof limit->closes);
    // In reverse order: where a pair has rafted, gaps are not measured from crushed surfaces.
    for (int law = BT_ALL_LAWS - 1; manifold->n_points > 0 && law >= BT_LAWS; law--)
        if (bt_law_on(&world->par, law) && bt_added_applies(world, law, manifold->a, manifold->b))
            bt_added_bound(world, law, cell, j, pair);
    for (int law = BT_LAWS - 1; law > BT_LAW_RIGID; law--) {
        if (manifold->n_points == 0 && !bt_laws[law]->contact) continue; // sheets obey only the law that makes them
        if (bt_law_on(&world->par, law) && bt_laws[law]->applies(world, manifold->a, manifold->b))
            bt_laws[law]->bound(world, cell, j, pair, manifold);
    }
}

double bt_laws_bear(const bt_world *world, const bt_cell *cell, bt_idx j, double energy)
{
    if (!bt_laws_on(&world->par)) return INFINITY;
    const bt_contact *contact = &cell->contacts[j];
    double most = 0;
    for (int i = 0; i < contact->n; i++) most += cell->laws->limits[j].cap[i] / world->par.dt;
    for (int law = 0; law < BT_LAWS; law++)
        if (bt_laws[law]->bears && bt_law_on(&world->par, law) &&
            bt_laws[law]->applies(world, contact->a, contact->b))
            most = bt_min(most, bt_laws[law]->bears(world, cell, j, energy));
    return most;
}

// --- growth ----------------------------------------------------------------------------------------------------------

/// The sums of a law's numbers; those of added laws precede them.
static bt_sum *sums_of(bt_totals *totals, int law) { return totals->sum + bt_added_sums() + bt_law_first_number(law); }

static void into_stats(bt_step_stats *st, bt_totals *totals, const double most[BT_LAWS])
{
    for (int law = 0; law < BT_LAWS; law++) {
        double *number = st->laws + bt_law_first_number(law);
        for (int k = 0; k < bt_laws[law]->n_numbers; k++)
            number[k] = bt_laws[law]->numbers[k].largest ? most[law] : bt_sum_value(&sums_of(totals, law)[k]);
    }
    bt_added_stats(st, totals);
}

/// The law whose bound point i has reached; the rigid law if it has reached none.
static int yields(const bt_contact *contact, const bt_limit *limit, int i)
{
    if (limit->by[i] >= BT_LAWS && bt_added_gives_way(contact, limit, i, limit->by[i])) return limit->by[i];
    int law = BT_LAWS - 1;
    while (law > BT_LAW_RIGID && !bt_laws[law]->gives_way(contact, limit, i)) law--;
    return law;
}

static void grow_contact(bt_world *world, bt_cell *cell, bt_idx j, bt_totals *totals)
{
    const bt_contact *contact = &cell->contacts[j];
    const bt_vel *v = world->bodies.vel;
    bt_limit *limit = &cell->laws->limits[j];
    for (int i = 0; i < contact->n; i++) {
        const double approach = -(bt_normal_velocity(contact, i, &v[contact->a], &v[contact->b]) + limit->place[i]);
        if (!(approach > 0)) continue;
        const int law = yields(contact, limit, i);
        if (law == BT_LAW_RIGID) continue;
        limit->grown[i] = world->par.dt * approach;
        if (law < BT_LAWS) bt_laws[law]->give_way(world, cell, j, i, sums_of(totals, law));
        else bt_added_give_way(world, law, cell, j, i, totals);
    }
}

static void grow_cell(bt_world *world, bt_idx k, const void *context, bt_totals *totals)
{
    (void)context;
    bt_cell *cell = &world->cells->cell[k];
    const bt_idx before = cell->laws->n_memory;
    for (bt_idx j = 0; j < cell->n_contacts; j++) {
        grow_contact(world, cell, j, totals);
        for (int law = 0; law < BT_LAWS; law++)
            if (bt_law_on(&world->par, law)) bt_laws[law]->remember(world, cell, j, sums_of(totals, law));
        for (int law = BT_LAWS; law < BT_ALL_LAWS; law++)
            if (bt_law_on(&world->par, law)) bt_added_remember(world, law, cell, j, totals);
    }
    if (cell->laws->n_memory > before)
        qsort(cell->laws->memory, (size_t)cell->laws->n_memory, sizeof *cell->laws->memory, bt_memory_by_names);
}

/// All records of this rank, also of pairs that have come to rest against each other and have no contacts.
static void count_records(const bt_world *world, double most[BT_LAWS], bt_totals *totals)
{
    const bt_cells *ts = world->cells;
    for (bt_idx k = 0; k < ts->n; k++)
        for (bt_idx i = 0; ts->cell[k].own && i < ts->cell[k].laws->n_memory; i++) {
            const bt_memory *memory = &ts->cell[k].laws->memory[i];
            if (memory->law >= BT_LAWS) {
                bt_added_count(world, memory, totals);
                continue;
            }
            most[memory->law] =
                bt_max(most[memory->law], bt_laws[memory->law]->count(world, memory, sums_of(totals, memory->law)));
        }
}

void bt_laws_grow(bt_world *world)
{
    bt_totals totals = {.n_sums = bt_law_first_number(BT_LAWS) + bt_added_sums()};
    double most[BT_LAWS] = {0};
    if (bt_laws_on(&world->par)) {
        bt_phases_any_order(world, grow_cell, NULL, &totals);
        count_records(world, most, &totals);
        bt_domain_reduce(world, &totals);
        bt_domain_maxima(world, most, BT_LAWS);
    }
    into_stats(&world->stats, &totals, most);
}
