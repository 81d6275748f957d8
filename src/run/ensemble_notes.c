// SPDX-License-Identifier: MIT
// Warnings and reasons of members in ensemble.h5; the layout is in ensemble_notes.h.
#include "run/ensemble_notes.h"

#include <stdlib.h>
#include <string.h>

#include "base/fileio.h"
#include "base/h5dataset.h"
#include "case/warning.h"

static char *copied(const json_t *value)
{
    const char *text = json_string_value(value);
    return bt_text_copy(text ? text : "");
}

void bt_member_notes_take(bt_member_notes *notes, int64_t member, const json_t *array)
{
    size_t i;
    json_t *entry;
    json_array_foreach((json_t *)array, i, entry)
    {
        if (!json_is_object(entry)) continue;
        if (notes->n == notes->cap) {
            notes->cap = notes->cap ? 2 * notes->cap : 64;
            notes->member = bt_realloc(notes->member, (size_t)notes->cap, sizeof *notes->member);
            notes->code = bt_realloc(notes->code, (size_t)notes->cap, sizeof *notes->code);
            notes->text = bt_realloc(notes->text, (size_t)notes->cap, sizeof *notes->text);
            notes->values = bt_realloc(notes->values, (size_t)notes->cap, sizeof *notes->values);
        }
        char *values = json_dumps(json_object_get(entry, "values"), 0);
        notes->member[notes->n] = member;
        notes->code[notes->n] = copied(json_object_get(entry, "code"));
        notes->text[notes->n] = copied(json_object_get(entry, "text"));
        notes->values[notes->n++] = bt_text_copy(values ? values : "{}");
        free(values);
    }
}

static void write_texts(bt_h5 *h, const char *group, const char *name, const char *axis, int64_t n,
                        const char *const *texts, const char *meaning)
{
    char *path = bt_file_join(group, name);
    bt_h5_write_names(h, path, (hsize_t)n, texts);
    bt_h5_describe(h, path, axis, NULL, meaning);
    free(path);
}

void bt_member_notes_write(bt_h5 *h, const bt_member_notes *notes, const char *group, const char *axis,
                           const char *what)
{
    if (notes->n == 0) return;
    bt_h5_group(h, group);
    char *path = bt_file_join(group, "member");
    bt_h5_write(h, path, H5T_NATIVE_INT64, (hsize_t)notes->n, 0, notes->member);
    bt_h5_describe(h, path, axis, "1", "number of the member in the study, from 1");
    free(path);
    write_texts(h, group, "code", axis, notes->n, (const char *const *)notes->code, what);
    write_texts(h, group, "text", axis, notes->n, (const char *const *)notes->text, "the same for readers");
    write_texts(h, group, "values", axis, notes->n, (const char *const *)notes->values, "values in it, as JSON");
}

void bt_member_notes_free(bt_member_notes *notes)
{
    for (int64_t i = 0; i < notes->n; i++) {
        free(notes->code[i]);
        free(notes->text[i]);
        free(notes->values[i]);
    }
    free(notes->member);
    free(notes->code);
    free(notes->text);
    free(notes->values);
    *notes = (bt_member_notes){0};
}

void bt_warning_codes_write(bt_h5 *h)
{
    const char *column[2][BT_N_WARNINGS];
    for (int k = 0; k < BT_N_WARNINGS; k++) {
        column[0][k] = bt_warning_rows[k].code;
        column[1][k] = bt_warning_rows[k].meaning;
    }
    bt_h5_group(h, "/codes");
    write_texts(h, "/codes", "code", "warning_code", BT_N_WARNINGS, column[0], "codes of warnings and reasons");
    write_texts(h, "/codes", "meaning", "warning_code", BT_N_WARNINGS, column[1], "what each stands for");
}
