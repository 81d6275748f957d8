// SPDX-License-Identifier: MIT
// Current and wind in time: tables that a case names, and checks of their keys.
#include "case_check.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "schema.h"
#include "table.h"

bt_status bt_case_load_tables(bt_case *c, bt_errors *err)
{
    const bt_status water = c->water.current_table ? bt_table_read(&c->water.table, c->water.current_table, err) : BT_OK;
    const bt_status air = c->air.wind_table ? bt_table_read(&c->air.table, c->air.wind_table, err) : BT_OK;
    // What a table holds is told before what cannot be read: 3 before 4.
    return water == BT_OK ? air : air == BT_OK || water == BT_ERR_CASE ? water : air;
}

typedef struct {
    const bt_case *c;
    const bt_origin *from;
    bt_errors *err;
} check;

static int place(const char *key) { return bt_schema_find(bt_case_keys, bt_n_case_keys, key); }

static bool sound(const check *k, const char *key) { return !k->from || !k->from[place(key)].faulty; }

/// "FILE:LINE: KEY" of a message.
static const char *where(const check *k, const char *key, char out[256])
{
    bt_case_locate(k->c, k->from ? &k->from[place(key)] : NULL, key, out);
    return out;
}

/// A table stands in place of the other keys of its fluid, and must cover the times that the run asks it for: from 0 to the
/// middle of the last step (bergtow/environment.h).
static void check_table(const check *k, const char *key, const bt_table *t, const char *const *others)
{
    char at[256];
    if (t->n == 0) return;
    for (; *others; others++) {
        double value;
        memcpy(&value, (const char *)k->c + bt_case_keys[place(*others)].offset, sizeof value);
        if (value != 0 && sound(k, *others))
            bt_errors_add(k->err, "%s: has no effect beside %s, which says it all; remove one of them", where(k, *others, at), key);
    }
    const double dt = k->c->run.dt, duration = k->c->run.duration;
    if (!sound(k, "run.dt") || !sound(k, "run.duration") || !(dt > 0) || !(duration > 0)) return;
    const double first = t->row[0], end = t->row[3 * (t->n - 1)], need = bt_max(duration, ((double)bt_case_steps(k->c) - 0.5) * dt);
    if (first > 0) bt_errors_add(k->err, "%s: the table begins at %g s and the run at 0 s; add a row for 0 s", where(k, key, at), first);
    if (end < need * (1 - 1e-12))
        bt_errors_add(k->err, "%s: the table ends at %g s and the run asks it for %g s; add rows, or shorten run.duration", where(k, key, at), end, need);
}

void bt_case_check_environment(const bt_case *c, const bt_origin *from, bt_errors *err)
{
    static const char *const current[] = {"water.current_x", "water.current_y", "water.tide.major", "water.tide.minor", NULL};
    static const char *const wind[] = {"air.wind_x", "air.wind_y", NULL};
    const check k = {.c = c, .from = from, .err = err};
    char at[256];
    if (fabs(c->water.tide.minor) > c->water.tide.major && sound(&k, "water.tide.major") && sound(&k, "water.tide.minor"))
        bt_errors_add(err, "%s: %g m/s is more than water.tide.major, %g m/s; swap them and turn the inclination by 90 deg",
                      where(&k, "water.tide.minor", at), c->water.tide.minor, c->water.tide.major);
    check_table(&k, "water.current_table", &c->water.table, current);
    check_table(&k, "air.wind_table", &c->air.table, wind);
}
