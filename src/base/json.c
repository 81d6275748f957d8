// SPDX-License-Identifier: MIT
// JSON text (RFC 8259) built in memory: always valid, whatever the numbers and strings.
//
// Why not jansson, which reads JSON here (ensembles, maps): it writes 60 as 60.0 and 0.1 as 0.10000000000000001, puts
// each number of a curve on a line of its own, refuses a string that is not UTF-8 (a title is whatever the case holds),
// and cannot write NaN. Working around all this would take as much code as this file.
#include "base/json.h"

#include <inttypes.h>
#include <string.h>

#include "base/inside.h"
#include "base/name.h"

static void put(bt_json *json, const char *s, size_t n)
{
    if (json->n + n + 1 > json->cap) {
        json->cap = 2 * (json->n + n + 1) + 256;
        json->text = bt_realloc(json->text, json->cap, 1);
    }
    memcpy(json->text + json->n, s, n);
    json->n += n;
    json->text[json->n] = '\0';
}

static void puts_(bt_json *json, const char *s) { put(json, s, strlen(s)); }

static void put_string(bt_json *json, const char *value)
{
    puts_(json, "\"");
    for (const unsigned char *s = (const unsigned char *)value; *s; ) {
        const size_t n = bt_utf8_length(s);
        if (n == 0) {
            puts_(json, "\\ufffd");
            s++;
            continue;
        }
        if (*s == '"' || *s == '\\') {
            put(json, (const char[]){'\\', (char)*s}, 2);
        } else if (*s < 0x20 || *s == 0x7f) {
            char escape[8];
            snprintf(escape, sizeof escape, "\\u%04x", *s);
            puts_(json, escape);
        } else {
            put(json, (const char *)s, n);
        }
        s += n;
    }
    puts_(json, "\"");
}

static void indent(bt_json *json)
{
    puts_(json, "\n");
    for (int i = 0; i < json->depth; i++) puts_(json, "  ");
}

static void member(bt_json *json, const char *key)
{
    if (json->started) puts_(json, json->flat ? ", " : ",");
    if (json->depth && !json->flat) indent(json);
    json->started = true;
    if (!key) return;
    put_string(json, key);
    puts_(json, ": ");
}

void bt_json_open(bt_json *json, const char *key, char bracket)
{
    member(json, key);
    put(json, &bracket, 1);
    json->depth++;
    json->started = false;
}

void bt_json_close(bt_json *json, char bracket)
{
    json->depth--;
    if (json->started && !json->flat) indent(json);
    put(json, &bracket, 1);
    json->started = true;
    if (json->depth == 0 && !json->flat) puts_(json, "\n");
}

void bt_json_number(bt_json *json, const char *key, double value)
{
    member(json, key);
    char text[40] = "null";
    for (int digits = 15; isfinite(value) && digits <= 17; digits++) {
        snprintf(text, sizeof text, "%.*g", digits, value);
        if (strtod(text, NULL) == value) break;
    }
    puts_(json, text);
}

void bt_json_int(bt_json *json, const char *key, int64_t value)
{
    member(json, key);
    char text[24];
    snprintf(text, sizeof text, "%" PRId64, value);
    puts_(json, text);
}

void bt_json_bool(bt_json *json, const char *key, bool value)
{
    member(json, key);
    puts_(json, value ? "true" : "false");
}

void bt_json_numbers(bt_json *json, const char *key, int64_t n, const double *values)
{
    member(json, key);
    puts_(json, "[");
    for (int64_t i = 0; i < n; i++) {
        char text[40] = "null";
        if (isfinite(values[i])) snprintf(text, sizeof text, "%.7g", values[i]);
        if (i) puts_(json, ", ");
        puts_(json, text);
    }
    puts_(json, "]");
}

void bt_json_string(bt_json *json, const char *key, const char *value)
{
    member(json, key);
    if (value) put_string(json, value);
    else puts_(json, "null");
}

void bt_json_raw(bt_json *j, const char *key, const char *json)
{
    member(j, key);
    puts_(j, json);
}

void bt_json_free(bt_json *json)
{
    free(json->text);
    *json = (bt_json){0};
}

// --- tables of keys --------------------------------------------------------------------------------------------------

/// Does `key` belong to the object of this name?
static bool inside(const char *key, const char *object, size_t n) { return !strncmp(key, object, n) && key[n] == '.'; }

static void write_value(bt_json *json, const bt_json_key *k, const struct bt_json_view *view, const void *source)
{
    const char *key = bt_last_part(k->key), *at = source ? (const char *)source + k->offset : NULL;
    switch (k->kind) {
    case BT_JSON_REAL: bt_json_number(json, key, k->number ? k->number(view)
                                                           : *(const double *)(const void *)at); break;
    case BT_JSON_INT:
        bt_json_int(json, key, k->number ? (int64_t)k->number(view) : *(const int64_t *)(const void *)at);
        break;
    case BT_JSON_INT32: bt_json_int(json, key, *(const int *)(const void *)at); break;
    case BT_JSON_BOOL: bt_json_bool(json, key, *(const bool *)at); break;
    case BT_JSON_TEXT: bt_json_string(json, key, k->text ? k->text(view)
                                                         : *(const char *const *)(const void *)at); break;
    case BT_JSON_WRITTEN:
    case BT_JSON_ADDED: k->write(json, key, view, at); break;
    case BT_JSON_LAWS:
    case BT_JSON_SPLITS:
    case BT_JSON_SAVED:
    case BT_JSON_GROUP: break;
    }
}

void bt_json_keys_write(bt_json *json, const bt_json_key *keys, int n, const struct bt_json_view *view,
                        const void *const *source)
{
    enum { DEEPEST = 4 };
    size_t open[DEEPEST]; // lengths of the names of the open objects
    int depth = 0;
    for (int i = 0; i < n; i++) {
        const bt_json_key *key = &keys[i];
        while (depth > 0 && !inside(key->key, keys[i - 1].key, open[depth - 1])) {
            bt_json_close(json, '}');
            depth--;
        }
        const bool there = !key->when || key->when(view);
        if (key->kind != BT_JSON_GROUP) {
            if (there) write_value(json, key, view, source[key->from]);
        } else if (there) {
            bt_json_open(json, bt_last_part(key->key), '{');
            open[depth++] = strlen(key->key);
        } else {
            bt_json_string(json, bt_last_part(key->key), NULL);
            while (i + 1 < n && inside(keys[i + 1].key, key->key, strlen(key->key))) i++;
        }
    }
    for (; depth > 0; depth--) bt_json_close(json, '}');
}

const bt_json_key *bt_json_keys_find(const bt_json_key *keys, int n, const char *key)
{
    for (int i = 0; i < n; i++)
        if (!strcmp(keys[i].key, key)) return &keys[i];
    return NULL;
}

// --- messages --------------------------------------------------------------------------------------------------------

static void print_json(const char *text, const char *code)
{
    static const char mark[] = "warning: ";
    const bool warning = !strncmp(text, mark, strlen(mark));
    bt_json json = {.flat = true};
    bt_json_open(&json, NULL, '{');
    bt_json_bool(&json, "warning", warning);
    bt_json_string(&json, "code", code);
    bt_json_string(&json, "text", text + (warning ? strlen(mark) : 0));
    bt_json_close(&json, '}');
    fprintf(stderr, "%s\n", json.text);
    bt_json_free(&json);
}

void bt_errors_print(const bt_errors *err)
{
    BT_PLAIN_NUMBERS;
    const char *as = getenv("BERGTOW_MESSAGES");
    for (size_t i = 0; i < err->n; i++) {
        const char *code = err->note[i].code;
        if (as && !strcmp(as, "json")) print_json(err->text[i], code);
        else fprintf(stderr, "bergtow: %s%s%s%s\n", err->text[i], code ? " [" : "", code ? code : "", code ? "]" : "");
    }
}

void bt_errors_warn(const char *fmt, ...)
{
    BT_PLAIN_NUMBERS;
    bt_errors one = {0};
    va_list ap;
    va_start(ap, fmt);
    bt_errors_add_list(&one, fmt, ap);
    va_end(ap);
    bt_errors_print(&one);
    bt_errors_free(&one);
}
