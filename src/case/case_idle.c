// SPDX-License-Identifier: MIT
// Keys of the ice that have no effect beside what another key says.
//
// Who gives both in one file contradicts himself, and is refused. Where they come from different places, the key may be
// inherited, from a base or from the case that a study or --set changes: then the run says that it was not used. A
// default says nothing, nor does a file that has every key, as a resolved case and a scaled twin have: it says what is.
#include "case/case_idle.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "case/case_derived.h"
#include "case/schema.h"

enum { LONGEST_NAME = 64 };

/// Keys that are not used.
typedef struct idle {
    bool so;
    const char *keys;  ///< separated by blanks
    const char *cause; ///< the key that makes them so
    const char *why;   ///< completes "has no effect "
} idle;

enum { RULES = 10 };

static void list(const bt_case *c, idle out[RULES])
{
    const bool read = bt_case_reads_field(c), power = c->ice.size_law == BT_SIZE_POWER;
    // a moving window has its room in floes of ice.size, whatever the ice (case_window.c)
    const bool sized = c->domain.ends == BT_BOUND_MOVING;
    const char *source = c->ice.field ? "ice.field" : "ice.outlines";
    const idle all[RULES] = {
        {read, "ice.concentration ice.shape ice.sides ice.aspect ice.size_law ice.size_spread ice.size_min "
               "ice.size_max ice.size_exponent ice.shake",
         source, "on ice that is read from a file"},
        {read && !sized, "ice.size", source, "on ice that is read from a file"},
        {c->ice.field, "ice.thickness_law ice.thickness_spread", "ice.field",
         "on the floes of a field file, which have thicknesses of their own"},
        {c->ice.field && c->n_floes == 0, "ice.thickness", "ice.field",
         "on the floes of a field file, which have thicknesses of their own"},
        {c->ice.field, "ice.x_min ice.x_max ice.y_min ice.y_max", "ice.field",
         "on a field file, which has its own ice region"},
        {!c->ice.field && c->ice.thickness_law == BT_THICK_CONSTANT, "ice.thickness_spread", "ice.thickness_law",
         "with ice.thickness_law: constant"},
        {!read && c->ice.size_law == BT_SIZE_SINGLE, "ice.size_min ice.size_max", "ice.size_law",
         "with ice.size_law: single"},
        {!read && !power, "ice.size_exponent", "ice.size_law", "without ice.size_law: power"},
        {!read && power, sized ? "ice.size_spread" : "ice.size ice.size_spread", "ice.size_law",
         "with ice.size_law: power, whose sizes follow from ice.size_min, size_max and size_exponent"},
        {!read, c->ice.shape == BT_ICE_RECTANGLES ? "ice.sides"
                : c->ice.shape == BT_ICE_POLYGONS ? "ice.aspect"
                                                  : "ice.sides ice.aspect",
         "ice.shape", "on floes of this ice.shape"},
    };
    memcpy(out, all, sizeof all);
}

static bool is_changed(const bt_case *c, const bt_case *defaults, const char *name)
{
    const bt_key *k = &bt_case_keys[bt_schema_find(bt_case_keys, bt_n_case_keys, name)];
    const size_t size = k->type == BT_KEY_REAL  ? sizeof(double)
                        : k->type == BT_KEY_INT ? sizeof(int64_t)
                                                : sizeof(int);
    return memcmp((const char *)c + k->offset, (const char *)defaults + k->offset, size) != 0;
}

bool bt_case_changed(const bt_case *c, const char *key)
{
    bt_case defaults = {0};
    bt_schema_preset(bt_case_keys, bt_n_case_keys, &defaults);
    const bool changed = is_changed(c, &defaults, key);
    bt_schema_release(bt_case_keys, bt_n_case_keys, &defaults);
    return changed;
}

/// Calls found for each key that is not used although its value is not the default.
static void look(const bt_case *c, void (*found)(void *to, const char *key, const idle *r), void *to)
{
    idle rules[RULES];
    bt_case defaults = {0};
    list(c, rules);
    bt_schema_preset(bt_case_keys, bt_n_case_keys, &defaults);
    defaults.ice.x_min = c->domain.x0, defaults.ice.x_max = c->domain.x0 + c->domain.length;
    defaults.ice.y_min = c->domain.y0, defaults.ice.y_max = c->domain.y0 + c->domain.width;
    for (int i = 0; i < RULES; i++)
        for (const char *keys = rules[i].keys; rules[i].so && *keys; keys += strspn(keys, " ")) {
            char name[LONGEST_NAME];
            const size_t n = strcspn(keys, " ");
            snprintf(name, sizeof name, "%.*s", (int)n, keys);
            keys += n;
            if (is_changed(c, &defaults, name)) found(to, name, &rules[i]);
        }
    bt_schema_release(bt_case_keys, bt_n_case_keys, &defaults);
}

/// Does the file in which the key stands have more than half of all keys? Nobody writes so many by hand.
static bool says_all(const bt_check *k, const char *key)
{
    int n = 0;
    for (int i = 0; i < bt_n_case_keys; i++)
        n += k->from[i].line > 0 && !strcmp(bt_check_file(k, bt_case_keys[i].name), bt_check_file(k, key));
    return 2 * n > bt_n_case_keys;
}

static void refuse(void *to, const char *key, const idle *r)
{
    const bt_check *k = to;
    if (says_all(k, key)) return;
    if (!bt_check_sound(k, key) || !bt_check_sound(k, r->cause) || !bt_check_together(k, key, r->cause)) return;
    bt_check_fault(k, key, "has no effect %s; remove the key, or change %s", r->why, r->cause);
}

void bt_case_check_idle(const bt_check *k)
{
    if (k->from) look(k->c, refuse, (void *)k);
}

/// Keys of one reason in a row, so that one warning says them.
typedef struct warning {
    bt_errors *warnings;
    const char *why;
    char names[512];
} warning;

static void put(warning *w)
{
    if (*w->names) bt_errors_add(w->warnings, "%s: no effect %s", w->names, w->why);
    *w->names = 0;
}

static void gather(void *to, const char *key, const idle *r)
{
    warning *w = to;
    if (w->why != r->why) put(w);
    w->why = r->why;
    const size_t n = strlen(w->names);
    snprintf(w->names + n, sizeof w->names - n, "%s%s", n ? ", " : "", key);
}

void bt_case_warn_idle(const bt_case *c, bt_errors *warnings)
{
    warning w = {.warnings = warnings};
    look(c, gather, &w);
    put(&w);
}
