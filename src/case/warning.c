// SPDX-License-Identifier: MIT
// Warnings with codes and values; the table is in warning.h.
#include "case/warning.h"

#include <string.h>

#include "base/name.h"

const struct bt_warning_row bt_warning_rows[BT_N_WARNINGS] = {
#define BT_WARNING_ROW(name, code, values, meaning) {code, values, meaning},
    BT_WARNINGS(BT_WARNING_ROW)
#undef BT_WARNING_ROW
};

/// Write the values of a text as members of the open object: each conversion takes the argument that printf takes.
static void put_values(bt_json *json, const char *names, const char *text, va_list ap)
{
    char name[BT_LONGEST_KEY];
    for (const char *at = strchr(text, '%'); at; at = strchr(at, '%')) {
        at += 1 + strspn(at + 1, "-+ #0123456789.");
        const size_t longs = strspn(at, "l");
        at += longs;
        const char conversion = *at++;
        if (conversion == '%') continue;
        const bool wanted = bt_next_name(&names, name) && strcmp(name, "-") != 0;
        if (conversion == 's') {
            const char *value = va_arg(ap, const char *);
            if (wanted) bt_json_string(json, name, value);
        } else if (conversion == 'd') {
            const int64_t value = longs > 1 ? va_arg(ap, long long) : longs ? va_arg(ap, long) : va_arg(ap, int);
            if (wanted) bt_json_int(json, name, value);
        } else {
            const double value = va_arg(ap, double);
            if (wanted) bt_json_number(json, name, value);
        }
    }
}

void bt_warn(bt_errors *list, bt_warning w, const char *text, ...)
{
    if (!list) return;
    va_list ap;
    va_start(ap, text);
    bt_errors_add_list(list, text, ap);
    va_end(ap);
    bt_json values = {.flat = true};
    bt_json_open(&values, NULL, '{');
    va_start(ap, text);
    put_values(&values, bt_warning_rows[w].values, text, ap);
    va_end(ap);
    bt_json_close(&values, '}');
    list->note[list->n - 1] = (bt_note){bt_text_copy(bt_warning_rows[w].code), values.text};
}

/// Append the members of `one` to the values of the last warning; frees it.
static void join(bt_errors *list, bt_json *one)
{
    bt_json_close(one, '}');
    bt_note *note = &list->note[list->n - 1];
    const size_t n = strlen(note->values); // "{...}": the members of `one` replace the closing brace
    char *both = bt_text_of("%.*s%s%s", (int)n - 1, note->values, n > 2 ? ", " : "", one->text + 1);
    bt_json_free(one);
    free(note->values);
    note->values = both;
}

void bt_warn_number(bt_errors *list, const char *name, double value)
{
    if (!list) return;
    bt_json one = {.flat = true};
    bt_json_open(&one, NULL, '{');
    bt_json_number(&one, name, value);
    join(list, &one);
}

void bt_warn_name(bt_errors *list, const char *name, const char *value)
{
    if (!list) return;
    bt_json one = {.flat = true};
    bt_json_open(&one, NULL, '{');
    bt_json_string(&one, name, value);
    join(list, &one);
}

void bt_warnings_json(bt_json *json, const char *key, const bt_errors *list)
{
    bt_json_open(json, key, '[');
    for (size_t i = 0; i < list->n; i++) {
        bt_json_open(json, NULL, '{');
        json->flat = true;
        bt_json_string(json, "code", list->note[i].code);
        bt_json_string(json, "text", list->text[i]);
        bt_json_raw(json, "values", list->note[i].values ? list->note[i].values : "{}");
        bt_json_close(json, '}');
        json->flat = false;
    }
    bt_json_close(json, ']');
}

char *bt_warnings_text(const bt_errors *list)
{
    bt_text text;
    bt_text_begin(&text);
    for (size_t i = 0; i < list->n; i++) fprintf(text.out, "%s%s", i ? "; " : "", list->text[i]);
    return bt_text_end(&text);
}
