// SPDX-License-Identifier: MIT
// What members of an ensemble tell beside their numbers: warnings, and reasons of their verdicts, a row each.
//
//     /warnings, /reasons: member, code, text, values [n]     in the order of the members, and of their summaries;
//                                                             member: a number of /members/id; values: a JSON object
//     /codes: code, meaning                                   of all warnings and reasons that there are
//
// A group without rows is left out. Codes and values are for programs; texts are for readers, and may change.
#ifndef BT_ENSEMBLE_NOTES_H
#define BT_ENSEMBLE_NOTES_H

#include <jansson.h>

#include "base/h5util.h"

typedef struct bt_member_notes {
    int64_t n, cap;
    int64_t *member;              ///< [n]
    char **code, **text, **values; ///< [n]
} bt_member_notes;

/// Take an array of {"code", "text", "values"} of a summary; what is no such array, or entry, is left out.
void bt_member_notes_take(bt_member_notes *notes, int64_t member, const json_t *array);
/// group: "/warnings"; axis: name of a row. what: of a member, in words.
void bt_member_notes_write(bt_h5 *h, const bt_member_notes *notes, const char *group, const char *axis,
                           const char *what);
void bt_member_notes_free(bt_member_notes *notes);

/// The meanings of all codes.
void bt_warning_codes_write(bt_h5 *h);

#endif
