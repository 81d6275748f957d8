// SPDX-License-Identifier: MIT
// All quantities: the program's own table (record_series.c), then what has been registered (quantity_registry.c), those
// of force laws and contact laws included: their tables may grow, and are looked at before anybody counts.
#include "bergtow/quantity.h"

#include <math.h>
#include <string.h>

#include "output/contact_quantities.h"
#include "output/force_quantities.h"
#include "output/quantity_registry.h"
#include "output/record.h"

int bt_n_series(void) { return bt_n_own_series + bt_n_added(); }

const bt_quantity *bt_series(int k)
{
    return k < bt_n_own_series ? &bt_own_series[k] : bt_registered(k - bt_n_own_series);
}

int bt_n_added(void)
{
    bt_force_quantities();
    bt_contact_quantities();
    return bt_n_registered();
}

const bt_quantity *bt_added(int k) { return bt_registered(k); }

const bt_quantity *bt_series_find(const char *name)
{
    for (int k = 0; k < bt_n_series(); k++)
        if (!strcmp(bt_series(k)->name, name)) return bt_series(k);
    return NULL;
}

const bt_quantity *bt_sample_fault(const bt_sample *s, unsigned has)
{
    for (int k = 0; k < bt_n_series(); k++) {
        const bt_quantity *q = bt_series(k);
        const double x = bt_sample_value(s, q);
        if (has & 1u << q->applies ? !(fabs(x) < BT_SAMPLE_MOST) : !isnan(x)) return q;
    }
    return NULL;
}
