// SPDX-License-Identifier: MIT
// What has been registered beside the program's own quantities.
#include "output/quantity_registry.h"

#include <ctype.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/name.h"
#include "contact/law.h"
#include "output/record.h"

const char *const bt_keep_names[BT_KEEP_KINDS] = {"last", "mean", "max", "sum"};
const char *const bt_role_names[BT_ROLE_KINDS] = {"", "balance", "force", "load", "diagnostic"};
const char *const bt_applies_codes[BT_APPLIES_KINDS] = {
    [BT_APPLIES_ALWAYS] = "always", [BT_APPLIES_BODY] = "body",       [BT_APPLIES_LINE] = "line",
    [BT_APPLIES_BRIDLE] = "bridle", [BT_APPLIES_VESSEL] = "vessel",   [BT_APPLIES_IMPACTS] = "impacts",
    [BT_APPLIES_WINDOW] = "moving",
};
const char *const bt_applies_names[BT_APPLIES_KINDS] = {
    [BT_APPLIES_ALWAYS] = "always",
    [BT_APPLIES_BODY] = "with a towed body",
    [BT_APPLIES_LINE] = "with a tow line",
    [BT_APPLIES_BRIDLE] = "with a tow line of two branches",
    [BT_APPLIES_VESSEL] = "with a vessel",
    [BT_APPLIES_IMPACTS] = "where collisions are told apart",
    [BT_APPLIES_WINDOW] = "with a moving window",
};

enum { MOST_NAME = 48, MOST_KEY = 80 }; // of the 40 letters that a force law may have, _force makes 46
static bt_quantity added[BT_MAX_ADDED];
static char added_keys[BT_MAX_ADDED][MOST_KEY];
static int n_added;

int bt_n_registered(void) { return n_added; }
const bt_quantity *bt_registered(int k) { return &added[k]; }

static bool is_taken(const char *name)
{
    for (int k = 0; k < bt_n_own_series; k++)
        if (!strcmp(bt_own_series[k].name, name)) return true;
    for (int law = 0; law < BT_LAWS; law++)
        for (int k = 0; k < bt_laws[law]->n_numbers; k++)
            if (!strcmp(bt_laws[law]->numbers[k].name, name)) return true;
    for (int k = 0; k < n_added; k++)
        if (!strcmp(added[k].name, name)) return true;
    return false;
}

/// mean_NAME_n for a mean in N: the units as the other keys of summary.json end with them.
static void make_key(const bt_quantity *q, char key[MOST_KEY])
{
    int n = snprintf(key, MOST_KEY, "%s_%s", bt_keep_names[q->keep], q->name);
    if (!strcmp(q->units, "1")) return;
    if (n + 1 < MOST_KEY) key[n++] = '_';
    for (const char *u = q->units; *u && n + 1 < MOST_KEY; u++)
        key[n++] = isalnum((unsigned char)*u) ? (char)tolower((unsigned char)*u) : '_';
    key[n] = '\0';
}

/// A name without underscores; kept to the end of the program, as the texts of a quantity are.
static char *in_words(const char *name)
{
    char *words = bt_text_copy(name);
    for (char *p = words; *p; p++)
        if (*p == '_') *p = ' ';
    return words;
}

void bt_registry_check(const char *name, int more, bt_errors *err)
{
    if (!bt_is_name(name, MOST_NAME))
        bt_errors_add(err, "quantity \"%s\": the name must be of lower-case letters, digits and _, at most %d", name,
                      MOST_NAME);
    else if (is_taken(name))
        bt_errors_add(err, "quantity %s: there is a series of this name; choose another", name);
    if (n_added + more > BT_MAX_ADDED)
        bt_errors_add(err, "quantity %s: a program can add %d of them, and they are all there; take the name of a "
                      "force whose simulation has ended, or raise BT_MAX_ADDED", name, BT_MAX_ADDED);
}

bt_status bt_quantity_register(const bt_quantity *q, bt_errors *err)
{
    const size_t before = err->n;
    const char *name = q->name ? q->name : "";
    bt_registry_check(name, 1, err);
    if (!q->units || !*q->units)
        bt_errors_add(err, "quantity %s: it has no units; take \"1\" for a plain number", name);
    if (!q->description || strlen(q->description) < 8)
        bt_errors_add(err, "quantity %s: say in a sentence what it is (`description`)", name);
    if (!q->of_world == !q->of_floe) bt_errors_add(err, "quantity %s: give it one of `of_world` and `of_floe`", name);
    if ((unsigned)q->keep >= BT_KEEP_KINDS || (unsigned)q->applies >= BT_APPLIES_KINDS ||
        (unsigned)q->role >= BT_ROLE_KINDS)
        bt_errors_add(err, "quantity %s: keep, applies or role is none of its kinds", name);
    if (err->n > before) return BT_ERR_USAGE;
    bt_quantity *own = &added[n_added];
    *own = *q;
    make_key(q, added_keys[n_added]);
    own->summary = added_keys[n_added];
    if (!own->label) own->label = in_words(own->name);
    own->offset = offsetof(bt_sample, added) + (size_t)n_added * sizeof(double);
    n_added++;
    return BT_OK;
}
