// SPDX-License-Identifier: MIT
// Writing JSON from a table of keys.
#include "output/json_keys.h"

#include <string.h>

/// Is `key` inside the object of this name?
static bool inside(const char *key, const char *object, size_t n) { return !strncmp(key, object, n) && key[n] == '.'; }

static const char *last_part(const char *key)
{
    const char *dot = strrchr(key, '.');
    return dot ? dot + 1 : key;
}

static void write_value(bt_json *j, const bt_json_key *k, const struct bt_summary_view *v, const void *source)
{
    const char *key = last_part(k->key), *at = source ? (const char *)source + k->offset : NULL;
    switch (k->kind) {
    case BT_JSON_REAL: bt_json_number(j, key, k->number ? k->number(v) : *(const double *)(const void *)at); break;
    case BT_JSON_INT:
        bt_json_int(j, key, k->number ? (int64_t)k->number(v) : *(const int64_t *)(const void *)at);
        break;
    case BT_JSON_INT32: bt_json_int(j, key, *(const int *)(const void *)at); break;
    case BT_JSON_BOOL: bt_json_bool(j, key, *(const bool *)at); break;
    case BT_JSON_TEXT: bt_json_string(j, key, k->text ? k->text(v) : *(const char *const *)(const void *)at); break;
    case BT_JSON_WRITTEN:
    case BT_JSON_ADDED: k->write(j, key, v, source); break;
    case BT_JSON_LAWS:
    case BT_JSON_GROUP: break;
    }
}

void bt_json_keys_write(bt_json *j, const bt_json_key *keys, int n, const struct bt_summary_view *v,
                        const void *const *source)
{
    enum { DEEPEST = 4 };
    size_t open[DEEPEST]; // lengths of the names of the objects that are open
    int depth = 0;
    for (int i = 0; i < n; i++) {
        const bt_json_key *k = &keys[i];
        while (depth > 0 && !inside(k->key, keys[i - 1].key, open[depth - 1])) {
            bt_json_close(j, '}');
            depth--;
        }
        const bool there = !k->when || k->when(v);
        if (k->kind != BT_JSON_GROUP) {
            if (there) write_value(j, k, v, source[k->from]);
        } else if (there) {
            bt_json_open(j, last_part(k->key), '{');
            open[depth++] = strlen(k->key);
        } else {
            bt_json_string(j, last_part(k->key), NULL);
            while (i + 1 < n && inside(keys[i + 1].key, k->key, strlen(k->key))) i++;
        }
    }
    for (; depth > 0; depth--) bt_json_close(j, '}');
}

const bt_json_key *bt_json_keys_find(const bt_json_key *keys, int n, const char *key)
{
    for (int i = 0; i < n; i++)
        if (!strcmp(keys[i].key, key)) return &keys[i];
    return NULL;
}
