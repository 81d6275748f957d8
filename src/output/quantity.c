// SPDX-License-Identifier: MIT
// All quantities: the program's own table (record_series.c), then what has been registered (quantity_registry.c), those
// of force laws and contact laws included: their tables may grow, and are looked at before anybody counts.
#include "bergtow/quantity.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/name.h"
#include "output/contact_quantities.h"
#include "output/force_quantities.h"
#include "output/quantity_registry.h"
#include "output/record.h"

int bt_n_program_series(void) { return bt_n_own_series + bt_n_law_series(); }
int bt_n_series(void) { return bt_n_program_series() + bt_n_added(); }

const bt_quantity *bt_series(int k)
{
    const int before = bt_n_own_series - BT_SERIES_AFTER_LAWS, laws = bt_n_law_series();
    if (k < before) return &bt_own_series[k];
    if (k < before + laws) return bt_law_series(k - before);
    return k < bt_n_program_series() ? &bt_own_series[k - laws] : bt_registered(k - bt_n_program_series());
}

int bt_n_added(void)
{
    bt_force_quantities();
    bt_contact_quantities();
    return bt_n_registered();
}

const bt_quantity *bt_added(int k) { return bt_registered(k); }

/// For a law that is about to be registered, whose series are taken up when they are asked for first.
static bool may_be(const char *name, int more, bt_errors *err)
{
    const size_t before = err->n;
    bt_n_added(); // those of the laws before it
    bt_registry_check(name, more, err);
    return err->n == before;
}

__attribute__((constructor(101))) static void begin(void) { bt_series_may_be = may_be; }

const bt_quantity *bt_series_find(const char *name)
{
    for (int k = 0; k < bt_n_series(); k++)
        if (!strcmp(bt_series(k)->name, name)) return bt_series(k);
    return NULL;
}

/// Does the balance name this series by itself: at its begin (tow), as what it gives (ice), at its end (inertia)?
static bool is_end_of_balance(const bt_quantity *q)
{
    return q->offset == offsetof(bt_sample, tow_force) || q->offset == offsetof(bt_sample, ice_resistance) ||
           q->offset == offsetof(bt_sample, inertia_force);
}

const char *bt_balance_words(void)
{
    static char *words;
    free(words);
    bt_text text;
    bt_text_begin(&text);
    fputs("tow", text.out);
    for (int k = 0; k < bt_n_series(); k++)
        if (bt_series(k)->role == BT_ROLE_BALANCE && !is_end_of_balance(bt_series(k)))
            fprintf(text.out, " - %s", bt_series(k)->label);
    fputs(" - inertia", text.out);
    return words = bt_text_end(&text);
}

/// What contacts do to the towed body: no numbers in a step without a load.
static const size_t loads[] = {
    offsetof(bt_sample, ice_resistance), offsetof(bt_sample, ice_force_x), offsetof(bt_sample, ice_force_y),
    offsetof(bt_sample, ice_moment), offsetof(bt_sample, ice_resistance_budget),
    offsetof(bt_sample, largest_quasi_static_load), offsetof(bt_sample, tow_force), // the last: not on a line
};
enum { N_LOADS = sizeof loads / sizeof *loads };

void bt_sample_lose_load(bt_sample *s, bool prescribed)
{
    for (int k = 0; k < N_LOADS - !prescribed; k++)
        memcpy((char *)s + loads[k], &(double){NAN}, sizeof(double));
}

static bool is_load(const bt_quantity *q)
{
    bool found = false;
    for (int k = 0; k < N_LOADS; k++) found = found || q->offset == loads[k];
    return found;
}

const bt_quantity *bt_sample_fault(const bt_sample *s, unsigned has)
{
    for (int k = 0, n = bt_n_series(); k < n; k++) {
        const bt_quantity *q = bt_series(k);
        const double x = bt_sample_value(s, q);
        if (s->no_load != 0 && isnan(x) && is_load(q)) continue;
        if (s->locked != 0 && isnan(x) && q->offset == offsetof(bt_sample, contact_work)) continue;
        if (has & 1u << q->applies ? !(fabs(x) < BT_SAMPLE_MOST) : !isnan(x)) return q;
    }
    return NULL;
}
