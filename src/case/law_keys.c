// SPDX-License-Identifier: MIT
// Keys that a program adds; see bergtow/law_key.h.
#include "bergtow/law_key.h"

#include <string.h>

#include "base/inside.h"
#include "case/schema.h"

static int unit_of(const char *symbol)
{
    if (!symbol || !*symbol) return BT_UNIT_NONE;
    for (int u = 0; u < BT_UNIT_KINDS; u++)
        if (!strcmp(bt_units_symbol((bt_unit)u), symbol)) return u;
    return -1;
}

static bt_errors faults;

void bt_keys_fault(bt_errors *err)
{
    for (size_t k = 0; k < err->n; k++) bt_errors_add(&faults, "%s", err->text[k]);
    bt_errors_free(err);
}

bool bt_keys_sound(bt_errors *err)
{
    for (size_t k = 0; k < faults.n; k++) bt_errors_add(err, "%s", faults.text[k]);
    return faults.n == 0;
}

bool bt_keys_add(const char *section, const bt_law_key *keys, int n, bt_errors *err)
{
    BT_PLAIN_NUMBERS;
    const int before = bt_schema_added();
    bool all = true;
    for (int k = 0; k < n; k++) {
        const bt_law_key *own = &keys[k];
        const int unit = unit_of(own->unit);
        const size_t length = strlen(section) + strlen(own->name) + 2;
        char *name = bt_alloc(length, 1); // kept by the table of keys
        snprintf(name, length, "%s.%s", section, own->name);
        if (unit < 0)
            bt_errors_add(err, "%s: unit %s is not a unit of a case; use an SI symbol of bt_law_key, or \"\"",
                          name, own->unit);
        const bt_key key = {.name = name,
                            .unit = (bt_unit)bt_max(unit, 0),
                            .preset = own->preset,
                            .range = own->range,
                            .doc = own->doc};
        const bool added = unit >= 0 && bt_schema_add(&key, err) >= 0;
        if (!added) free(name);
        all = all && added;
    }
    if (!all) bt_schema_take_back(before); // all of them or none
    return all;
}

void bt_keys_get(const bt_case *input, const char *section, const bt_law_key *keys, int n, double *own)
{
    BT_PLAIN_NUMBERS;
    for (int k = 0; k < n; k++) {
        char name[128];
        snprintf(name, sizeof name, "%s.%s", section, keys[k].name);
        const bt_key *key = &bt_case_keys[bt_schema_find(bt_case_keys, bt_n_case_keys, name)];
        memcpy(&own[k], (const char *)input + key->offset, sizeof own[k]);
    }
}
