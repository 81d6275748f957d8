// SPDX-License-Identifier: MIT
// JSON text (RFC 8259) built in memory: always valid, whatever the numbers and strings.
//
// Why not jansson, which reads JSON here (ensembles, maps): it writes 60 as 60.0 and 0.1 as 0.10000000000000001, each
// number of a curve in a line of its own, refuses a string that is not UTF-8 (a title is whatever the case holds), and
// has no number for NaN. What would be left of this file to work around that is no shorter than it.
#include "base/json.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/inside.h"

static void put(bt_json *j, const char *s, size_t n)
{
    if (j->n + n + 1 > j->cap) {
        j->cap = 2 * (j->n + n + 1) + 256;
        j->text = bt_realloc(j->text, j->cap, 1);
    }
    memcpy(j->text + j->n, s, n);
    j->n += n;
    j->text[j->n] = '\0';
}

static void puts_(bt_json *j, const char *s) { put(j, s, strlen(s)); }

/// Length of the valid UTF-8 sequence at s (RFC 3629), 0 when there is none.
static size_t utf8_length(const unsigned char *s)
{
    if (s[0] < 0x80) return 1;
    const size_t n = s[0] >= 0xc2 && s[0] <= 0xdf   ? 2
                     : (s[0] & 0xf0) == 0xe0        ? 3
                     : s[0] >= 0xf0 && s[0] <= 0xf4 ? 4
                                                    : 0;
    for (size_t i = 1; i < n; i++)
        if ((s[i] & 0xc0) != 0x80) return 0;
    if (s[0] == 0xe0 && s[1] < 0xa0) return 0; // longer than needed
    if (s[0] == 0xed && s[1] > 0x9f) return 0; // surrogates
    if (s[0] == 0xf0 && s[1] < 0x90) return 0;
    if (s[0] == 0xf4 && s[1] > 0x8f) return 0; // beyond U+10FFFF
    return n;
}

static void put_string(bt_json *j, const char *value)
{
    puts_(j, "\"");
    for (const unsigned char *s = (const unsigned char *)value; *s; ) {
        const size_t n = utf8_length(s);
        if (n == 0) {
            puts_(j, "\\ufffd");
            s++;
            continue;
        }
        if (*s == '"' || *s == '\\') {
            put(j, (const char[]){'\\', (char)*s}, 2);
        } else if (*s < 0x20 || *s == 0x7f) {
            char escape[8];
            snprintf(escape, sizeof escape, "\\u%04x", *s);
            puts_(j, escape);
        } else {
            put(j, (const char *)s, n);
        }
        s += n;
    }
    puts_(j, "\"");
}

static void indent(bt_json *j)
{
    puts_(j, "\n");
    for (int i = 0; i < j->depth; i++) puts_(j, "  ");
}

static void member(bt_json *j, const char *key)
{
    if (j->started) puts_(j, j->flat ? ", " : ",");
    if (j->depth && !j->flat) indent(j);
    j->started = true;
    if (!key) return;
    put_string(j, key);
    puts_(j, ": ");
}

void bt_json_open(bt_json *j, const char *key, char bracket)
{
    member(j, key);
    put(j, &bracket, 1);
    j->depth++;
    j->started = false;
}

void bt_json_close(bt_json *j, char bracket)
{
    j->depth--;
    if (j->started && !j->flat) indent(j);
    put(j, &bracket, 1);
    j->started = true;
    if (j->depth == 0 && !j->flat) puts_(j, "\n");
}

void bt_json_number(bt_json *j, const char *key, double value)
{
    member(j, key);
    char text[40] = "null";
    void *locale = bt_point_begin();
    for (int digits = 15; isfinite(value) && digits <= 17; digits++) {
        snprintf(text, sizeof text, "%.*g", digits, value);
        if (strtod(text, NULL) == value) break;
    }
    bt_point_end(locale);
    puts_(j, text);
}

void bt_json_int(bt_json *j, const char *key, int64_t value)
{
    member(j, key);
    char text[24];
    snprintf(text, sizeof text, "%" PRId64, value);
    puts_(j, text);
}

void bt_json_bool(bt_json *j, const char *key, bool value)
{
    member(j, key);
    puts_(j, value ? "true" : "false");
}

void bt_json_numbers(bt_json *j, const char *key, int64_t n, const double *values)
{
    member(j, key);
    puts_(j, "[");
    void *locale = bt_point_begin();
    for (int64_t i = 0; i < n; i++) {
        char text[40] = "null";
        if (isfinite(values[i])) snprintf(text, sizeof text, "%.7g", values[i]);
        if (i) puts_(j, ", ");
        puts_(j, text);
    }
    bt_point_end(locale);
    puts_(j, "]");
}

void bt_json_string(bt_json *j, const char *key, const char *value)
{
    member(j, key);
    if (value) put_string(j, value);
    else puts_(j, "null");
}

void bt_json_raw(bt_json *j, const char *key, const char *json)
{
    member(j, key);
    puts_(j, json);
}

void bt_json_free(bt_json *j)
{
    free(j->text);
    *j = (bt_json){0};
}

// --- tables of keys --------------------------------------------------------------------------------------------------

// Writing JSON from a table of keys.

/// Is `key` inside the object of this name?
static bool inside(const char *key, const char *object, size_t n) { return !strncmp(key, object, n) && key[n] == '.'; }

static const char *last_part(const char *key)
{
    const char *dot = strrchr(key, '.');
    return dot ? dot + 1 : key;
}

static void write_value(bt_json *j, const bt_json_key *k, const struct bt_json_view *v, const void *source)
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
    case BT_JSON_SPLITS:
    case BT_JSON_SAVED:
    case BT_JSON_GROUP: break;
    }
}

void bt_json_keys_write(bt_json *j, const bt_json_key *keys, int n, const struct bt_json_view *v,
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
