// SPDX-License-Identifier: MIT
// Quantities of force laws; see force_quantities.h.
#include "output/force_quantities.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "output/record.h"

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
    for (; known < bt_n_force_series; known++) {
        const bt_force_series *of = &bt_force_series_of[known];
        if (!of->part && !has_series(of)) add_quantity(of);
    }
}
