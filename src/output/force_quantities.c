// SPDX-License-Identifier: MIT
// Quantities of force laws; see force_quantities.h.
#include "output/force_quantities.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "output/record.h"
#include "tow/tow.h"

double bt_force_against(const bt_world *w, int k)
{
    const bt_impulse *j = &w->forces->series[k];
    return 0.0 - (j->x * w->tow->ux + j->y * w->tow->uy) / w->par.dt; // 0 − x, for no −0 in open water
}

double bt_force_of(const bt_world *w, const void *series)
{
    return bt_force_against(w, bt_force_series_find(series));
}

/// Is its force one of the program's own series?
static bool has_series(const bt_force_series *of)
{
    for (int k = 0; k < bt_n_own_series; k++)
        if (bt_own_series[k].of_world == bt_force_of && !strcmp(bt_own_series[k].context, of->name)) return true;
    return false;
}

/// Its texts stay for the life of the program, as the law does.
static void add_quantity(const bt_force_series *of)
{
    bt_errors err = {0};
    char *name = bt_text_of("%s_force", of->name),
         *text = bt_text_of("%s on the towed body against the tow direction", of->law ? of->law->doc : of->name);
    const bt_quantity q = {.name = name, .units = "N", .description = text, .label = of->name, .keep = BT_KEEP_MEAN,
                           .applies = BT_APPLIES_BODY, .role = BT_ROLE_BALANCE, .of_world = bt_force_of,
                           .context = of->name};
    if (bt_quantity_register(&q, &err) != BT_OK) bt_errors_print(&err);
    bt_errors_free(&err);
}

void bt_force_quantities(void)
{
    static int known; // series of the table that have been looked at
    static bool added[BT_MAX_FORCE_SERIES];
    if (known == bt_n_force_series) return;
    known = bt_n_force_series;
    for (int k = 0; k < bt_n_force_wholes; k++) {
        const bt_force_series *of = &bt_force_series_of[k];
        if (has_series(of) || added[k]) continue;
        added[k] = true;
        add_quantity(of);
    }
}
