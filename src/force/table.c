// SPDX-License-Identifier: MIT
// The table of force laws, the series they make, and their numbers in a world.
#include <ctype.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "case/schema.h"
#include "force/laws.h"

#define POINTER(name) &bt_law_##name,
const bt_force_law *bt_force_laws[BT_MAX_FORCE_LAWS] = {BT_FORCE_LAWS(POINTER)};
int bt_n_force_laws = BT_LISTED_LAWS;

bt_force_series bt_force_series_of[BT_MAX_FORCE_SERIES];
int bt_n_force_series, bt_n_force_wholes;

int bt_force_series_find(const char *name)
{
    for (int k = 0; k < bt_n_force_series; k++)
        if (!strcmp(bt_force_series_of[k].name, name)) return k;
    return -1;
}

static void add_series(const char *name, const bt_force_law *law, bool part)
{
    if (bt_force_series_find(name) < 0) bt_force_series_of[bt_n_force_series++] = (bt_force_series){name, law, part};
}

/// Those that are no part first: what sums up the forces adds them in this order.
static void find_series(void)
{
    bt_n_force_series = 0;
    for (int k = 0; k < bt_n_force_laws; k++) {
        const bt_force_law *law = bt_force_laws[k];
        if (law->part_of) add_series(law->part_of, NULL, false);
        else if (!law->turns_only) add_series(law->name, law, false);
    }
    bt_n_force_wholes = bt_n_force_series;
    for (int k = 0; k < bt_n_force_laws; k++)
        if (bt_force_laws[k]->part_of && !bt_force_laws[k]->turns_only)
            add_series(bt_force_laws[k]->name, bt_force_laws[k], true);
}

// --- a law of a program ----------------------------------------------------------------------------------------------

static bool is_name(const char *s)
{
    for (const char *p = s; *p; p++)
        if (!islower((unsigned char)*p) && *p != '_' && !(p > s && isdigit((unsigned char)*p))) return false;
    return *s && strlen(s) <= 40;
}

static int unit_of(const char *symbol)
{
    if (!symbol || !*symbol) return BT_UNIT_NONE;
    for (int u = 0; u < BT_UNIT_KINDS; u++)
        if (!strcmp(bt_units_symbol((bt_unit)u), symbol)) return u;
    return -1;
}

/// Is every key of the law in the table of the case's keys?
static bool add_keys(const bt_force_law *law, bt_errors *err)
{
    bool all = true;
    for (int k = 0; k < law->n_keys; k++) {
        const bt_force_key *own = &law->keys[k];
        const int unit = unit_of(own->unit);
        const size_t length = strlen(law->name) + strlen(own->name) + 2;
        char *name = bt_alloc(length, 1); // kept by the table of keys
        snprintf(name, length, "%s.%s", law->name, own->name);
        if (unit < 0)
            bt_errors_add(err, "%s: unit %s is none of those of a case; take an SI symbol of bt_force_key, or \"\"",
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
    return all;
}

/// Keys and series of the laws of the program, before main: whoever looks at the tables finds them complete.
__attribute__((constructor)) static void begin(void)
{
    bt_errors err = {0};
    for (int k = 0; k < bt_n_force_laws; k++) add_keys(bt_force_laws[k], &err);
    bt_errors_print(&err);
    if (err.n > 0) abort();
    find_series();
}

bt_status bt_force_register(const bt_force_law *law, bt_errors *err)
{
    const size_t before = err->n;
    const char *name = law->name ? law->name : "";
    if (!is_name(name))
        bt_errors_add(err, "force law \"%s\": the name must be of lower-case letters, digits and _, at most 40", name);
    else if (bt_force_series_find(name) >= 0)
        bt_errors_add(err, "force law %s: there is a force of this name; choose another", name);
    if (!law->add) bt_errors_add(err, "force law %s: it has no function `add`", name);
    if (!law->doc || strlen(law->doc) < 8) bt_errors_add(err, "force law %s: say in a line what it is (`doc`)", name);
    if (law->n_keys < 0 || law->n_keys > BT_MAX_FORCE_OWN)
        bt_errors_add(err, "force law %s: it has %d keys, at most %d fit", name, law->n_keys, BT_MAX_FORCE_OWN);
    if (bt_n_force_laws == BT_MAX_FORCE_LAWS)
        bt_errors_add(err, "force law %s: there are %d laws; raise BT_MAX_FORCE_LAWS", name, BT_MAX_FORCE_LAWS);
    if (err->n > before || !add_keys(law, err)) return BT_ERR_USAGE;
    bt_force_laws[bt_n_force_laws++] = law;
    find_series();
    return BT_OK;
}

// --- the numbers of a world ------------------------------------------------------------------------------------------

bt_forces *bt_forces_create(void)
{
    bt_forces *f = bt_alloc(1, sizeof *f);
    f->n = bt_n_force_laws;
    f->n_series = bt_n_force_series;
    f->towed_at[0] = f->towed_at[1] = NAN;
    return f;
}

void bt_forces_free(bt_forces *f) { free(f); }

/// Value of the key law.own of a case.
static double value_of(const bt_case *c, const bt_force_law *law, const bt_force_key *own)
{
    char name[128];
    snprintf(name, sizeof name, "%s.%s", law->name, own->name);
    double x;
    memcpy(&x, (const char *)c + bt_case_keys[bt_schema_find(bt_case_keys, bt_n_case_keys, name)].offset, sizeof x);
    return x;
}

void bt_forces_setup(bt_world *w, const bt_case *c)
{
    for (int k = 0; k < w->forces->n; k++) {
        const bt_force_law *law = bt_force_laws[k];
        for (int j = 0; j < law->n_keys; j++) w->forces->own[k][j] = value_of(c, law, &law->keys[j]);
        if (law->setup) law->setup(c, w->forces->own[k]);
    }
}
