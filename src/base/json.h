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
    bool flat;    ///< the members stand on one line
} bt_json;

/// key: NULL inside an array and at the top. bracket: '{' or '['.
void bt_json_open(bt_json *json, const char *key, char bracket);
void bt_json_close(bt_json *json, char bracket); ///< '}' or ']'
/// the shortest text that reads back to the same bits; null unless finite
void bt_json_number(bt_json *json, const char *key, double value);
void bt_json_int(bt_json *json, const char *key, int64_t value);
void bt_json_bool(bt_json *json, const char *key, bool value);
/// An array of numbers on one line, with 7 digits each: for curves.
void bt_json_numbers(bt_json *json, const char *key, int64_t n, const double *values);
/// value: NULL gives null; bytes that are not UTF-8 become U+FFFD.
void bt_json_string(bt_json *json, const char *key, const char *value);
void bt_json_raw(bt_json *j, const char *key, const char *json); ///< a value that is already JSON
void bt_json_free(bt_json *json);

// --- tables of keys --------------------------------------------------------------------------------------------------

// Tables of JSON keys: a row for each key, in the order of the file, with its units, meaning and place of its value.
//
// The same rows write the file, fill `bergtow --list-quantities`, and give the datasets of ensemble.h5 their
// attributes. A key "a.b" is the member b of the object a, whose own row (BT_JSON_GROUP) comes first.

struct bt_json_view; // data for the rows; the program that has the table defines the type

typedef enum {
    /// value at `offset` in its source, or from `number` or `text`
    BT_JSON_REAL, BT_JSON_INT, BT_JSON_INT32, BT_JSON_BOOL, BT_JSON_TEXT,
    BT_JSON_GROUP,   ///< an object whose members follow; null if it does not apply
    BT_JSON_WRITTEN, ///< written by `write`, key included
    BT_JSON_ADDED,   ///< placeholder of the registered quantities (summary_keys.c)
    BT_JSON_LAWS,    ///< placeholder of the totals of contact laws, in a table that is not yet assembled
    BT_JSON_SPLITS,  ///< likewise, of the totals of floes that split
    BT_JSON_SAVED    ///< likewise, of one running total
} bt_json_kind;

typedef struct bt_json_key {
    const char *key, *units, *description;
    bt_json_kind kind;
    int from;                ///< index of its source
    size_t offset;
    double (*number)(const struct bt_json_view *view);
    const char *(*text)(const struct bt_json_view *view);
    bool (*when)(const struct bt_json_view *view); ///< NULL = always; if false, a group is null, a plain key left out
    /// at: the member
    void (*write)(bt_json *json, const char *key, const struct bt_json_view *view, const void *at);
    bool machine;            ///< about the machine and the moment, not the result: left out of an ensemble's numbers
} bt_json_key;

/// The kind of a member of a struct.
#define BT_JSON_KIND(x)                                                                                                \
    _Generic((x), double: BT_JSON_REAL, int64_t: BT_JSON_INT, int: BT_JSON_INT32, bool: BT_JSON_BOOL,                  \
             char *: BT_JSON_TEXT, const char *: BT_JSON_TEXT)
/// Initializers of a row for a member of a source.
#define BT_JSON_AT(from_, type, key_, member, units_, text_) \
    .key = key_, .units = units_, .description = text_, .kind = BT_JSON_KIND(((type *)0)->member), .from = from_, \
    .offset = offsetof(type, member)

/// Write the rows as members of the open object. source: by bt_json_key.from.
void bt_json_keys_write(bt_json *json, const bt_json_key *keys, int n, const struct bt_json_view *view,
                        const void *const *source);

/// The row of a key; NULL if there is none.
const bt_json_key *bt_json_keys_find(const bt_json_key *keys, int n, const char *key);

#endif
