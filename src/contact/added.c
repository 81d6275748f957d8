// SPDX-License-Identifier: MIT
// Contact laws that a program has added; see added.h.
#include "contact/added.h"

#include <math.h>
#include <string.h>

#include "contact/row.h"
#include "contact/law_pair.h"

static const bt_contact_law *added[BT_MAX_ADDED_LAWS];
static int n_added;

int bt_n_contact_laws(void) { return n_added; }
const bt_contact_law *bt_contact_law_of(int k) { return added[k]; }

bool bt_added_add(const bt_contact_law *law)
{
    if (n_added == BT_MAX_ADDED_LAWS) return false;
    added[n_added++] = law;
    return true;
}

void bt_added_setup(const bt_case *input, bt_params *par)
{
    par->added_laws = n_added;
    for (int k = 0; k < n_added; k++) {
        double *own = par->law_own[BT_LAWS + k];
        bt_keys_get(input, added[k]->name, added[k]->keys, added[k]->n_keys, own);
        if (added[k]->setup) added[k]->setup(input, own);
    }
}

// --- a contact as the law sees it ------------------------------------------------------------------------------------

static const double *own_of(const bt_params *par, int law) { return par->law_own[law]; }

bool bt_added_on(const bt_params *par, int law)
{
    return law - BT_LAWS < par->added_laws && added[law - BT_LAWS]->on(own_of(par, law));
}

bool bt_added_applies(const bt_world *world, int law, bt_idx a, bt_idx b)
{
    const bt_contact_law *l = added[law - BT_LAWS];
    return !l->applies || l->applies(world, a, b, own_of(&world->par, law));
}

static bt_law_contact contact_of(const bt_world *world, int law, const bt_cell *cell, bt_idx j, bt_idx record)
{
    const bt_contact *contact = &cell->contacts[j];
    bt_law_contact x = {.w = world, .a = contact->a, .b = contact->b, .own = own_of(&world->par, law), .n = contact->n};
    const bool *closes = cell->laws->limits[j].closes;
    for (int i = 0; i < contact->n; i++) x.gap[i] = cell->gaps[j].gap[i], x.closes[i] = closes[i];
    // ran = ra × n: its difference between the points is their distance along the tangent
    if (closes[0] && closes[1]) x.length = fabs(contact->ran[1] - contact->ran[0]);
    if (record >= 0) memcpy(x.value, cell->laws->memory[record].value, sizeof x.value);
    return x;
}

void bt_added_bound(const bt_world *world, int law, bt_cell *cell, bt_idx j, const bt_pair *pair)
{
    bt_limit *limit = &cell->laws->limits[j];
    const bt_memory names = bt_law_names(world, pair, law);
    limit->record[law] = (int32_t)bt_law_find(cell, &names);
    const bt_law_contact contact = contact_of(world, law, cell, j, limit->record[law]);
    double load[2] = {INFINITY, INFINITY}, given[2] = {0};
    added[law - BT_LAWS]->bound(&contact, load, given);
    for (int i = 0; i < contact.n; i++) {
        bt_law_narrow(limit, i, bt_max(0, load[i]) * world->par.dt, law);
        cell->gaps[j].gap[i] += given[i];
    }
}

// --- after the solve -------------------------------------------------------------------------------------------------

static int first_sum(int law) { return (law - BT_LAWS) * (1 + BT_MAX_CONTACT_NUMBERS); }

void bt_added_give_way(const bt_world *world, int law, const bt_cell *cell, bt_idx j, int i, bt_totals *totals)
{
    bt_sum_add(&totals->sum[first_sum(law)], -bt_contacts_normal_work(world, &cell->contacts[j], i));
}

static void add_numbers(int law, bool state, const double *number, bt_totals *totals)
{
    const bt_contact_law *of = added[law - BT_LAWS];
    for (int k = 0; k < of->n_numbers; k++)
        if (of->numbers[k].state == state) bt_sum_add(&totals->sum[first_sum(law) + 1 + k], number[k]);
}

void bt_added_remember(const bt_world *world, int law, bt_cell *cell, bt_idx j, bt_totals *totals)
{
    const bt_contact_law *of = added[law - BT_LAWS];
    const bt_contact *contact = &cell->contacts[j];
    if (!of->remember || contact->n == 0 || !bt_added_applies(world, law, contact->a, contact->b)) return;
    const bt_limit *limit = &cell->laws->limits[j];
    bt_law_contact x = contact_of(world, law, cell, j, limit->record[law]);
    for (int i = 0; i < x.n; i++) {
        x.load[i] = contact->ln[i] / world->par.dt;
        x.grown[i] = bt_added_gives_way(contact, limit, i, law) ? limit->grown[i] : 0;
    }
    double number[BT_MAX_CONTACT_NUMBERS] = {0};
    const bool remembers = of->remember(&x, number);
    add_numbers(law, false, number, totals);
    if (!remembers) return;
    bt_memory memory = bt_law_names(world, &cell->search.pairs[cell->contacts[j].pair], law);
    memory.n_points = contact->n;
    memcpy(memory.value, x.value, sizeof memory.value);
    bt_law_put(cell, limit->record[law], &memory);
}

void bt_added_count(const bt_world *world, const bt_memory *memory, bt_totals *totals)
{
    const bt_contact_law *of = added[memory->law - BT_LAWS];
    double number[BT_MAX_CONTACT_NUMBERS] = {0};
    if (of->count) of->count(memory->value, own_of(&world->par, memory->law), number);
    add_numbers(memory->law, true, number, totals);
}

int bt_added_sums(void) { return n_added * (1 + BT_MAX_CONTACT_NUMBERS); }

void bt_added_stats(bt_step_stats *st, const bt_totals *totals)
{
    for (int k = 0; k < n_added; k++)
        for (int i = 0; i <= BT_MAX_CONTACT_NUMBERS; i++)
            st->added[k][i] = bt_sum_value(&totals->sum[first_sum(BT_LAWS + k) + i]);
}
