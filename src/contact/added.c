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

void bt_added_setup(const bt_case *c, bt_params *p)
{
    p->added_laws = n_added;
    for (int k = 0; k < n_added; k++) {
        double *own = p->law_own[BT_LAWS + k];
        bt_keys_get(c, added[k]->name, added[k]->keys, added[k]->n_keys, own);
        if (added[k]->setup) added[k]->setup(c, own);
    }
}

// --- a contact as the law sees it ------------------------------------------------------------------------------------

static const double *own_of(const bt_params *p, int law) { return p->law_own[law]; }

bool bt_added_on(const bt_params *p, int law)
{
    return law - BT_LAWS < p->added_laws && added[law - BT_LAWS]->on(own_of(p, law));
}

bool bt_added_applies(const bt_world *w, int law, bt_idx a, bt_idx b)
{
    const bt_contact_law *l = added[law - BT_LAWS];
    return !l->applies || l->applies(w, a, b, own_of(&w->par, law));
}

static bt_law_contact contact_of(const bt_world *w, int law, const bt_cell *t, bt_idx j, bt_idx record)
{
    const bt_contact *u = &t->contacts[j];
    bt_law_contact x = {.w = w, .a = u->a, .b = u->b, .own = own_of(&w->par, law), .n = u->n};
    const bool *closes = t->laws.limits[j].closes;
    for (int i = 0; i < u->n; i++) x.gap[i] = t->gaps[j].gap[i], x.closes[i] = closes[i];
    // ran = ra × n, which changes along the tangent by the distance
    if (closes[0] && closes[1]) x.length = fabs(u->ran[1] - u->ran[0]);
    if (record >= 0) memcpy(x.value, t->laws.memory[record].value, sizeof x.value);
    return x;
}

void bt_added_bound(const bt_world *w, int law, bt_cell *t, bt_idx j, const bt_pair *p)
{
    bt_limit *l = &t->laws.limits[j];
    const bt_memory names = bt_law_names(w, p, law);
    l->record[law] = (int32_t)bt_law_find(t, &names);
    const bt_law_contact x = contact_of(w, law, t, j, l->record[law]);
    double load[2] = {INFINITY, INFINITY}, given[2] = {0};
    added[law - BT_LAWS]->bound(&x, load, given);
    for (int i = 0; i < x.n; i++) {
        bt_law_narrow(l, i, bt_max(0, load[i]) * w->par.dt, law);
        t->gaps[j].gap[i] += given[i];
    }
}

// --- after the solve -------------------------------------------------------------------------------------------------

static int first_sum(int law) { return (law - BT_LAWS) * (1 + BT_MAX_CONTACT_NUMBERS); }

void bt_added_give_way(const bt_world *w, int law, const bt_cell *t, bt_idx j, int i, bt_totals *totals)
{
    bt_sum_add(&totals->sum[first_sum(law)], -bt_contacts_normal_work(w, &t->contacts[j], i));
}

static void add_numbers(int law, bool state, const double *number, bt_totals *totals)
{
    const bt_contact_law *of = added[law - BT_LAWS];
    for (int k = 0; k < of->n_numbers; k++)
        if (of->numbers[k].state == state) bt_sum_add(&totals->sum[first_sum(law) + 1 + k], number[k]);
}

void bt_added_remember(const bt_world *w, int law, bt_cell *t, bt_idx j, bt_totals *totals)
{
    const bt_contact_law *of = added[law - BT_LAWS];
    const bt_contact *u = &t->contacts[j];
    if (!of->remember || u->n == 0 || !bt_added_applies(w, law, u->a, u->b)) return;
    const bt_limit *l = &t->laws.limits[j];
    bt_law_contact x = contact_of(w, law, t, j, l->record[law]);
    for (int i = 0; i < x.n; i++) {
        x.load[i] = u->ln[i] / w->par.dt;
        x.grown[i] = bt_added_gives_way(u, l, i, law) ? l->grown[i] : 0;
    }
    double number[BT_MAX_CONTACT_NUMBERS] = {0};
    const bool remembers = of->remember(&x, number);
    add_numbers(law, false, number, totals);
    if (!remembers) return;
    bt_memory r = bt_law_names(w, &t->search.pairs[t->contacts[j].pair], law);
    r.n_points = u->n;
    memcpy(r.value, x.value, sizeof r.value);
    bt_law_put(t, l->record[law], &r);
}

void bt_added_count(const bt_world *w, const bt_memory *r, bt_totals *totals)
{
    const bt_contact_law *of = added[r->law - BT_LAWS];
    double number[BT_MAX_CONTACT_NUMBERS] = {0};
    if (of->count) of->count(r->value, own_of(&w->par, r->law), number);
    add_numbers(r->law, true, number, totals);
}

int bt_added_sums(void) { return n_added * (1 + BT_MAX_CONTACT_NUMBERS); }

void bt_added_stats(bt_step_stats *st, const bt_totals *t)
{
    for (int k = 0; k < n_added; k++)
        for (int i = 0; i <= BT_MAX_CONTACT_NUMBERS; i++)
            st->added[k][i] = bt_sum_value(&t->sum[first_sum(BT_LAWS + k) + i]);
}
