// SPDX-License-Identifier: MIT
// The table of force laws, the series they make, and their numbers in a world.
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/name.h"
#include "base/inside.h"
#include "force/forces.h"
#include "case/schema.h"
#include "force/laws.h"

#define POINTER(name) &bt_law_##name,
const bt_force_law *bt_force_laws[BT_MAX_FORCE_LAWS] = {BT_FORCE_LAWS(POINTER)};
int bt_n_force_laws = BT_LISTED_LAWS;

bt_force_series bt_force_series_of[BT_MAX_FORCE_SERIES];
int bt_n_force_series;

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

/// Append series: a world knows its series by their indices, so none may move.
static void add_series_of(const bt_force_law *law)
{
    if (law->part_of) add_series(law->part_of, NULL, false);
    if (!law->turns_only) add_series(law->name, law, law->part_of != NULL);
}

// --- a law of a program ----------------------------------------------------------------------------------------------

/// Keys and series of the laws of the program, before main, so that every reader of the tables finds them complete. The
/// first of all constructors (the lowest priority number that programs may use), so that constructors of other files
/// can register laws.
__attribute__((constructor(101))) static void begin(void)
{
    bt_errors err = {0};
    for (int k = 0; k < bt_n_force_laws; k++) {
        const bt_force_law *law = bt_force_laws[k];
        bt_keys_add(law->name, law->keys, law->n_keys, &err);
        add_series_of(law);
    }
    bt_keys_fault(&err);
}

/// Check the series of a law.
static void check_series(const bt_force_law *law, const char *name, bt_errors *err)
{
    const char *of = law->part_of ? law->part_of : law->turns_only ? NULL : name;
    if (law->part_of && !bt_is_name(law->part_of, BT_MAX_LAW_NAME))
        bt_errors_add(err, "force law %s: part_of \"%s\" is not a name of lower-case letters, digits and _, at most %d",
                      name, law->part_of, BT_MAX_LAW_NAME);
    if (!of) return;
    const int there = bt_force_series_find(of);
    if (there >= 0 && bt_force_series_of[there].law)
        bt_errors_add(err, "force law %s: part_of \"%s\" is the force of one law; name a sum of laws, such as drag, or "
                      "a new one", name, of);
    if (there >= 0 || !bt_series_may_be) return;
    char series[BT_MAX_LAW_NAME + sizeof "_force"];
    snprintf(series, sizeof series, "%.*s_force", BT_MAX_LAW_NAME, of);
    bt_series_may_be(series, 1, err);
}

bt_status bt_force_register(const bt_force_law *law, bt_errors *err)
{
    BT_PLAIN_NUMBERS;
    const size_t before = err->n;
    const char *name = law->name ? law->name : "";
    bt_name_check("force law", name, BT_MAX_LAW_NAME, bt_force_series_find(name) >= 0, err);
    if (!law->add) bt_errors_add(err, "force law %s: it has no function `add`", name);
    if (!law->doc || strlen(law->doc) < 8) bt_errors_add(err, "force law %s: describe it in one line (`doc`)", name);
    if (law->n_keys < 0 || law->n_keys > BT_MAX_FORCE_OWN)
        bt_errors_add(err, "force law %s: it has %d keys, at most %d fit", name, law->n_keys, BT_MAX_FORCE_OWN);
    if (bt_n_force_laws == BT_MAX_FORCE_LAWS)
        bt_errors_add(err, "force law %s: a program can have at most %d, and all are in use; give an applied force the "
                      "name of a force whose simulation has ended", name, BT_MAX_FORCE_LAWS);
    if (err->n == before) check_series(law, name, err);
    if (err->n > before || !bt_keys_add(name, law->keys, law->n_keys, err)) return BT_ERR_USAGE;
    bt_force_laws[bt_n_force_laws++] = law;
    add_series_of(law);
    return BT_OK;
}

// --- the numbers of a world ------------------------------------------------------------------------------------------

bt_forces *bt_forces_create(void)
{
    bt_forces *forces = bt_alloc(1, sizeof *forces);
    forces->n = bt_n_force_laws;
    forces->n_series = bt_n_force_series;
    forces->towed_at[0] = forces->towed_at[1] = NAN;
    for (int k = 0; k < forces->n; k++) forces->acted[k] = !bt_force_laws[k]->begin;
    return forces;
}

void bt_forces_free(bt_forces *forces) { free(forces); }

void bt_forces_leave_added(bt_forces *forces) { forces->n = BT_LISTED_LAWS; }

void bt_forces_setup(bt_world *world, const bt_case *input)
{
    for (int k = 0; k < world->forces->n; k++) {
        const bt_force_law *law = bt_force_laws[k];
        bt_keys_get(input, law->name, law->keys, law->n_keys, world->forces->own[k]);
        if (law->setup) law->setup(input, world->forces->own[k]);
    }
}
