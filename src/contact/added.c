// SPDX-License-Identifier: MIT
// Contact laws that a program has added; see added.h.
#include "contact/added.h"

#include <math.h>
#include <string.h>

#include "case/law_keys.h"
#include "contact/row.h"
#include "contact/work.h"

static const bt_contact_law *added[BT_MAX_ADDED_LAWS];
static int n_added;

int bt_n_contact_laws(void) { return n_added; }
const bt_contact_law *bt_contact_law_of(int k) { return added[k]; }

// --- registration ----------------------------------------------------------------------------------------------------

static bool is_known(const char *name)
{
    for (int law = 0; law < BT_LAWS; law++)
        if (!strcmp(bt_laws[law].name, name)) return true;
    for (int k = 0; k < n_added; k++)
        if (!strcmp(added[k]->name, name)) return true;
    return false;
}

static void check_numbers(const bt_contact_law *law, const char *name, bt_errors *err)
{
    if (law->n_numbers < 0 || law->n_numbers > BT_MAX_CONTACT_NUMBERS)
        bt_errors_add(err, "contact law %s: it has %d numbers, at most %d fit", name, law->n_numbers,
                      BT_MAX_CONTACT_NUMBERS);
    else
        for (int k = 0; k < law->n_numbers; k++)
            if (law->numbers[k].state ? !law->count : !law->remember)
                bt_errors_add(err, "contact law %s: nothing adds to its number %s; give it `%s`", name,
                              law->numbers[k].name, law->numbers[k].state ? "count" : "remember");
}

bt_status bt_contact_register(const bt_contact_law *law, bt_errors *err)
{
    const size_t before = err->n;
    const char *name = law->name ? law->name : "";
    if (!bt_law_is_name(name))
        bt_errors_add(err, "contact law \"%s\": the name must be of lower-case letters, digits and _, at most 40",
                      name);
    else if (is_known(name))
        bt_errors_add(err, "contact law %s: there is a law of this name; choose another", name);
    if (!law->on || !law->bound) bt_errors_add(err, "contact law %s: it needs the functions `on` and `bound`", name);
    if (!law->doc || strlen(law->doc) < 8) bt_errors_add(err, "contact law %s: say in a line what it is (`doc`)", name);
    if (law->n_keys < 0 || law->n_keys > BT_MAX_CONTACT_OWN)
        bt_errors_add(err, "contact law %s: it has %d keys, at most %d fit", name, law->n_keys, BT_MAX_CONTACT_OWN);
    check_numbers(law, name, err);
    if (n_added == BT_MAX_ADDED_LAWS)
        bt_errors_add(err, "contact law %s: there are %d added laws; raise BT_MAX_ADDED_LAWS", name, n_added);
    if (err->n > before || !bt_keys_add(name, law->keys, law->n_keys, err)) return BT_ERR_USAGE;
    added[n_added++] = law;
    return BT_OK;
}

void bt_added_setup(const bt_case *c, double own[BT_MAX_ADDED_LAWS][BT_MAX_CONTACT_OWN])
{
    for (int k = 0; k < n_added; k++) {
        bt_keys_values(c, added[k]->name, added[k]->keys, added[k]->n_keys, own[k]);
        if (added[k]->setup) added[k]->setup(c, own[k]);
    }
}

// --- a contact as the law sees it ------------------------------------------------------------------------------------

static const double *own_of(const bt_params *p, int law) { return p->added_own[law - BT_LAWS]; }

bool bt_added_on(const bt_params *p, int law)
{
    return law - BT_LAWS < n_added && added[law - BT_LAWS]->on(own_of(p, law));
}

bool bt_added_applies(const bt_world *w, int law, bt_idx a, bt_idx b)
{
    const bt_contact_law *l = added[law - BT_LAWS];
    return !l->applies || l->applies(w, a, b, own_of(&w->par, law));
}

static bt_touch touch_of(const bt_world *w, int law, const bt_cell *t, bt_idx j, bt_idx record)
{
    const bt_contact *u = &t->contacts[j];
    bt_touch x = {.w = w, .a = u->a, .b = u->b, .own = own_of(&w->par, law), .n = u->n};
    for (int i = 0; i < u->n; i++) x.gap[i] = t->gaps[j].gap[i];
    // ran = ra × n, which changes along the tangent by the distance
    if (u->n == 2) x.length = fabs(u->ran[1] - u->ran[0]);
    if (record >= 0) memcpy(x.value, t->laws.memory[record].value, sizeof x.value);
    return x;
}

void bt_added_bound(const bt_world *w, int law, bt_cell *t, bt_idx j, const bt_pair *p)
{
    bt_limit *l = &t->laws.limits[j];
    const bt_memory names = bt_law_names(w, p, law);
    l->trace[law] = (int32_t)bt_law_find(t, &names);
    const bt_touch x = touch_of(w, law, t, j, l->trace[law]);
    double load[2] = {INFINITY, INFINITY}, given[2] = {0};
    added[law - BT_LAWS]->bound(&x, load, given);
    for (int i = 0; i < x.n; i++) {
        bt_law_narrow(l, i, bt_max(0, load[i]) * w->par.dt, law);
        t->gaps[j].gap[i] += given[i];
    }
}

// --- after the solve -------------------------------------------------------------------------------------------------

static int first_sum(int law) { return BT_LAW_SUMS + (law - BT_LAWS) * (1 + BT_MAX_CONTACT_NUMBERS); }

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
    bt_touch x = touch_of(w, law, t, j, l->trace[law]);
    for (int i = 0; i < x.n; i++) {
        x.load[i] = u->ln[i] / w->par.dt;
        x.grown[i] = bt_added_gives_way(u, l, i, law) ? l->grown[i] : 0;
    }
    double number[BT_MAX_CONTACT_NUMBERS] = {0};
    const bool remembers = of->remember(&x, number);
    add_numbers(law, false, number, totals);
    if (!remembers) return;
    bt_memory r = bt_law_names(w, &t->search.pairs[t->gaps[j].pair], law);
    r.n_points = u->n;
    memcpy(r.value, x.value, sizeof r.value);
    bt_law_put(t, l->trace[law], &r);
}

void bt_added_count(const bt_world *w, const bt_memory *r, bt_totals *totals)
{
    const bt_contact_law *of = added[r->law - BT_LAWS];
    double number[BT_MAX_CONTACT_NUMBERS] = {0};
    if (of->count) of->count(r->value, own_of(&w->par, r->law), number);
    add_numbers(r->law, true, number, totals);
}

int bt_added_sums(void) { return n_added * (1 + BT_MAX_CONTACT_NUMBERS); }

void bt_added_tell(bt_step_stats *st, const bt_totals *t)
{
    for (int k = 0; k < n_added; k++)
        for (int i = 0; i <= BT_MAX_CONTACT_NUMBERS; i++)
            st->added[k][i] = bt_sum_value(&t->sum[first_sum(BT_LAWS + k) + i]);
}
