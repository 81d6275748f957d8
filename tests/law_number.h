// SPDX-License-Identifier: MIT
// A number of a contact law in the step just taken, by the name of its series.
#ifndef BERGTOW_TESTS_LAW_NUMBER_H
#define BERGTOW_TESTS_LAW_NUMBER_H

#include <math.h>
#include <string.h>

#include "contact/crush.h"
#include "contact/law.h"
#include "contact/raft.h"

static inline double scene_law(const bt_world *w, const char *name)
{
    for (int law = 0; law < BT_LAWS; law++)
        for (int k = 0; k < bt_laws[law]->n_numbers; k++)
            if (!strcmp(bt_laws[law]->numbers[k].name, name)) return w->stats.laws[bt_law_first_number(law) + k];
    return NAN;
}

#endif
