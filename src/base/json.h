// SPDX-License-Identifier: MIT
// JSON text built in memory: always valid, whatever the numbers and strings.
#ifndef BT_JSON_H
#define BT_JSON_H

#include "bergtow/base.h"

typedef struct bt_json {
    char *text; ///< zero-terminated; release with bt_json_free
    size_t n, cap;
    int depth;
    bool started; ///< the open object or array has a member
    bool flat;    ///< members follow in one line
} bt_json;

/// key: NULL inside an array and at the top. bracket: '{' or '['.
void bt_json_open(bt_json *json, const char *key, char bracket);
void bt_json_close(bt_json *json, char bracket); ///< '}' or ']'
/// shortest text of the same bits; null unless finite
void bt_json_number(bt_json *json, const char *key, double value);
void bt_json_int(bt_json *json, const char *key, int64_t value);
void bt_json_bool(bt_json *json, const char *key, bool value);
/// An array of numbers in one line, with 7 digits each: for curves.
void bt_json_numbers(bt_json *json, const char *key, int64_t n, const double *values);
/// value: NULL gives null; bytes that are not UTF-8 become U+FFFD.
void bt_json_string(bt_json *json, const char *key, const char *value);
void bt_json_raw(bt_json *j, const char *key, const char *json); ///< a value that is JSON already
void bt_json_free(bt_json *json);

// --- tables of keys --------------------------------------------------------------------------------------------------

// Tables of JSON keys: one row gives a key its units, its meaning and the place of its value, in the order of the file.
//
// The same rows write the file, fill `bergtow --list-quantities` and give the datasets of ensemble.h5 their attributes.
// A key "a.b" is the member b of the object a, whose own row (BT_JSON_GROUP) comes before.

struct bt_json_view; // what rows are formed from: its type is that of the program that has the table

typedef enum {
    /// at `offset` in its source, or by `number` or `text`
    BT_JSON_REAL, BT_JSON_INT, BT_JSON_INT32, BT_JSON_BOOL, BT_JSON_TEXT,
    BT_JSON_GROUP,   ///< an object whose members follow; null where it does not apply
    BT_JSON_WRITTEN, ///< what `write` writes, key included
    BT_JSON_ADDED,   ///< the place of the registered quantities (summary_keys.c)
    BT_JSON_LAWS,    ///< and of the totals of contact laws, in a table that is yet to be put together
    BT_JSON_SPLITS,  ///< of those of floes that split
    BT_JSON_SAVED    ///< and of a running total
} bt_json_kind;

typedef struct bt_json_key {
    const char *key, *units, *description;
    bt_json_kind kind;
    int from;                ///< index of its source
    size_t offset;
    double (*number)(const struct bt_json_view *view);
    const char *(*text)(const struct bt_json_view *view);
    bool (*when)(const struct bt_json_view *view); ///< NULL = always; else a group is null, a plain key left out
    void (*write)(bt_json *json, const char *key, const struct bt_json_view *view, const void *source);
    bool machine;            ///< of the machine and the moment, not of the result: no number of an ensemble's member
} bt_json_key;

/// The kind of a member of a struct.
#define BT_JSON_KIND(x)                                                                                                \
    _Generic((x), double: BT_JSON_REAL, int64_t: BT_JSON_INT, int: BT_JSON_INT32, bool: BT_JSON_BOOL,                  \
             char *: BT_JSON_TEXT, const char *: BT_JSON_TEXT)
/// The parts of a row for a member of a source.
#define BT_JSON_AT(from_, type, key_, member, units_, text_) \
    .key = key_, .units = units_, .description = text_, .kind = BT_JSON_KIND(((type *)0)->member), .from = from_, \
    .offset = offsetof(type, member)

/// The rows as members of the object that is open. source: by bt_json_key.from.
void bt_json_keys_write(bt_json *json, const bt_json_key *keys, int n, const struct bt_json_view *view,
                        const void *const *source);

/// The row of a key, NULL where there is none.
const bt_json_key *bt_json_keys_find(const bt_json_key *keys, int n, const char *key);

#endif
