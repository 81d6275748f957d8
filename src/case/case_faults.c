// SPDX-License-Identifier: MIT
// How checks of a case report faults: where a key stands, whether it was given, whether it was refused already.
#include "case/case_faults.h"

#include <string.h>

#include "base/name.h"
#include "case/schema.h"

void bt_case_locate(const bt_case *input, const bt_origin *origin, const char *key, char out[256])
{
    const char *path = origin && origin->file ? origin->file : bt_case_name(input);
    if (origin && origin->set && origin->place) snprintf(out, 256, "%.120s%.130s", origin->place, origin->set);
    else if (origin && origin->set) snprintf(out, 256, "--set %.240s", origin->set);
    else if (origin && origin->line > 0) snprintf(out, 256, "%.160s:%d: %s", path, origin->line, key);
    else snprintf(out, 256, "%.160s: %s", path, key);
}

static const bt_origin *origin(const bt_check *check, const char *key)
{
    return check->from ? &check->from[bt_schema_find(bt_case_keys, bt_n_case_keys, key)] : NULL;
}

const char *bt_check_file(const bt_check *check, const char *key)
{
    const bt_origin *o = origin(check, key);
    return o && o->file && !o->set ? o->file : check->c->path ? check->c->path : "";
}

bool bt_check_given(const bt_check *check, const char *key)
{
    const bt_origin *o = origin(check, key);
    return o && (o->line > 0 || o->set);
}

bool bt_check_together(const bt_check *check, const char *key, const char *other)
{
    if (!bt_check_given(check, key)) return false;
    const bt_origin *a = origin(check, key), *b = origin(check, other);
    if (a->place || b->place) return false;
    if (!bt_check_given(check, other)) return true;
    return a->set || b->set ? a->set && b->set : !strcmp(bt_check_file(check, key), bt_check_file(check, other));
}

bool bt_check_sound(const bt_check *check, const char *keys)
{
    char name[BT_LONGEST_KEY];
    while (check->from && bt_next_name(&keys, name))
        if (origin(check, name)->faulty) return false;
    return true;
}

void bt_check_fault(const bt_check *check, const char *key, const char *fmt, ...)
{
    char where[256], why[512];
    bt_case_locate(check->c, origin(check, key), key, where);
    va_list ap;
    va_start(ap, fmt);
    vsnprintf(why, sizeof why, fmt, ap);
    va_end(ap);
    bt_errors_add(check->err, "%s: %s", where, why);
}
