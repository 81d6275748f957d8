// SPDX-License-Identifier: MIT
// The table of contact laws, and what is the same for all of them; contact/law.h.
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

void bt_laws_setup(const bt_case *c, bt_params *p)
{
    for (int law = 0; law < BT_LAWS; law++)
        if (bt_laws[law]->setup) bt_laws[law]->setup(c, p->law_own[law]);
    bt_added_setup(c, p);
}

bool bt_law_on(const bt_params *p, int law)
{
    return law < BT_LAWS ? bt_laws[law]->on && bt_laws[law]->on(p->law_own[law]) : bt_added_on(p, law);
}

bool bt_law_applies(const bt_world *w, int law, bt_idx a, bt_idx b)
{
    return law < BT_LAWS ? bt_laws[law]->applies(w, a, b) : bt_added_applies(w, law, a, b);
}

bool bt_laws_on(const bt_params *p)
{
    for (int law = 0; law < BT_ALL_LAWS; law++)
        if (bt_law_on(p, law)) return true;
    return false;
}

bool bt_laws_rise(const bt_params *p)
{
    for (int law = 0; law < BT_LAWS; law++)
        if (bt_laws[law]->rises && bt_law_on(p, law)) return true;
    return false;
}

// --- memory ----------------------------------------------------------------------------------------------------------

void bt_laws_prune(const bt_world *w, bt_cell *t)
{
    bt_idx kept = 0;
    for (bt_idx k = 0; k < t->laws.n_memory; k++) {
        bt_memory *r = &t->laws.memory[k];
        if (r->law < BT_LAWS ? bt_laws[r->law]->keeps(w, r) : bt_law_near(w, r)) t->laws.memory[kept++] = *r;
    }
    t->laws.n_memory = kept;
}

// --- bounds ----------------------------------------------------------------------------------------------------------

void bt_laws_reserve(bt_cell *t)
{
    if (t->n_contacts <= t->laws.cap_limits) return;
    t->laws.cap_limits = bt_cells_room(t->n_contacts);
    free(t->laws.limits);
    free(t->laws.rises);
    t->laws.limits = bt_alloc_aligned((size_t)t->laws.cap_limits, sizeof *t->laws.limits);
    t->laws.rises = t->laws.rising ? bt_alloc_aligned((size_t)t->laws.cap_limits, sizeof *t->laws.rises) : NULL;
}

void bt_laws_bound(const bt_world *w, bt_cell *t, bt_idx j, const bt_pair *p, const bt_manifold *m)
{
    bt_limit *l = &t->laws.limits[j];
    *l = (bt_limit){
        .flat = {INFINITY, INFINITY}, .most = {INFINITY, INFINITY}, .cap = {INFINITY, INFINITY},
        .rise = t->laws.rises ? &t->laws.rises[j] : NULL};
    if (l->rise) *l->rise = (bt_rise){0};
    for (int law = 0; law < BT_ALL_LAWS; law++) l->record[law] = -1;
    if (m->n_points > 0 && w->par.added_laws > 0)
        memcpy(l->closes, bt_law_closing(w, t, j, m).point, sizeof l->closes);
    // The last first: what has rafted is not measured from what was crushed before.
    for (int law = BT_ALL_LAWS - 1; m->n_points > 0 && law >= BT_LAWS; law--)
        if (bt_law_on(&w->par, law) && bt_added_applies(w, law, m->a, m->b)) bt_added_bound(w, law, t, j, p);
    for (int law = BT_LAWS - 1; law > BT_LAW_RIGID; law--) {
        if (m->n_points == 0 && !bt_laws[law]->contact) continue; // sheets are of one law alone
        if (bt_law_on(&w->par, law) && bt_laws[law]->applies(w, m->a, m->b)) bt_laws[law]->bound(w, t, j, p, m);
    }
}

// --- growth ----------------------------------------------------------------------------------------------------------

/// Sums of the numbers of a law; those of added laws come first.
static bt_sum *sums_of(bt_totals *t, int law) { return t->sum + bt_added_sums() + bt_law_first_number(law); }

static void into_stats(bt_step_stats *st, bt_totals *t, const double most[BT_LAWS])
{
    for (int law = 0; law < BT_LAWS; law++) {
        double *number = st->laws + bt_law_first_number(law);
        for (int k = 0; k < bt_laws[law]->n_numbers; k++)
            number[k] = bt_laws[law]->numbers[k].largest ? most[law] : bt_sum_value(&sums_of(t, law)[k]);
    }
    bt_added_stats(st, t);
}

/// The law at whose bound point i is; the rigid one where it is at none.
static int yields(const bt_contact *u, const bt_limit *l, int i)
{
    if (l->by[i] >= BT_LAWS && bt_added_gives_way(u, l, i, l->by[i])) return l->by[i];
    int law = BT_LAWS - 1;
    while (law > BT_LAW_RIGID && !bt_laws[law]->gives_way(u, l, i)) law--;
    return law;
}

static void grow_contact(bt_world *w, bt_cell *t, bt_idx j, bt_totals *totals)
{
    const bt_contact *u = &t->contacts[j];
    const bt_vel *v = w->bodies.vel;
    bt_limit *l = &t->laws.limits[j];
    for (int i = 0; i < u->n; i++) {
        const double approach = -(bt_normal_velocity(u, i, &v[u->a], &v[u->b]) + l->place[i]);
        if (!(approach > 0)) continue;
        const int law = yields(u, l, i);
        if (law == BT_LAW_RIGID) continue;
        l->grown[i] = w->par.dt * approach;
        if (law < BT_LAWS) bt_laws[law]->give_way(w, t, j, i, sums_of(totals, law));
        else bt_added_give_way(w, law, t, j, i, totals);
    }
}

static void grow_cell(bt_world *w, bt_idx k, const void *context, bt_totals *totals)
{
    (void)context;
    bt_cell *t = &w->cells->cell[k];
    const bt_idx before = t->laws.n_memory;
    for (bt_idx j = 0; j < t->n_contacts; j++) {
        grow_contact(w, t, j, totals);
        for (int law = 0; law < BT_LAWS; law++)
            if (bt_law_on(&w->par, law)) bt_laws[law]->remember(w, t, j, sums_of(totals, law));
        for (int law = BT_LAWS; law < BT_ALL_LAWS; law++)
            if (bt_law_on(&w->par, law)) bt_added_remember(w, law, t, j, totals);
    }
    if (t->laws.n_memory > before)
        qsort(t->laws.memory, (size_t)t->laws.n_memory, sizeof *t->laws.memory, bt_memory_by_names);
}

/// All records of this rank, also of pairs that have come to rest against each other and have no contacts.
static void count_records(const bt_world *w, double most[BT_LAWS], bt_totals *totals)
{
    const bt_cells *ts = w->cells;
    for (bt_idx k = 0; k < ts->n; k++)
        for (bt_idx i = 0; ts->cell[k].own && i < ts->cell[k].laws.n_memory; i++) {
            const bt_memory *r = &ts->cell[k].laws.memory[i];
            if (r->law >= BT_LAWS) {
                bt_added_count(w, r, totals);
                continue;
            }
            most[r->law] = bt_max(most[r->law], bt_laws[r->law]->count(w, r, sums_of(totals, r->law)));
        }
}

void bt_laws_grow(bt_world *w)
{
    bt_totals t = {.n_sums = bt_law_first_number(BT_LAWS) + bt_added_sums()};
    double most[BT_LAWS] = {0};
    if (bt_laws_on(&w->par)) {
        bt_phases_any_order(w, grow_cell, NULL, &t);
        count_records(w, most, &t);
        bt_domain_reduce(w, &t);
        bt_domain_maxima(w, most, BT_LAWS);
    }
    into_stats(&w->stats, &t, most);
}
