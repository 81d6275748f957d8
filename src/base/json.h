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
void bt_json_open(bt_json *j, const char *key, char bracket);
void bt_json_close(bt_json *j, char bracket); ///< '}' or ']'
void bt_json_number(bt_json *j, const char *key, double value); ///< shortest text of the same bits; null unless finite
void bt_json_int(bt_json *j, const char *key, int64_t value);
void bt_json_bool(bt_json *j, const char *key, bool value);
/// An array of numbers in one line, with 7 digits each: for curves.
void bt_json_numbers(bt_json *j, const char *key, int64_t n, const double *values);
/// value: NULL gives null; bytes that are not UTF-8 become U+FFFD.
void bt_json_string(bt_json *j, const char *key, const char *value);
void bt_json_raw(bt_json *j, const char *key, const char *json); ///< a value that is JSON already
void bt_json_free(bt_json *j);

#endif
