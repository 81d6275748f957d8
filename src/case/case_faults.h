// SPDX-License-Identifier: MIT
// How checks of a case report faults.
#ifndef BERGTOW_CASE_FAULTS_H
#define BERGTOW_CASE_FAULTS_H

#include "bergtow/case.h"

/// Where the value of a key comes from: for messages, and to skip checks of values that were refused already.
typedef struct bt_origin {
    int line;        ///< in the file; 0 = default or override
    const char *file; ///< file of the case that gives it, NULL = the case's own
    const char *set; ///< the override "key=value", or NULL
    /// where the override stands, "FILE:LINE: "; NULL: on the command line; "": a default, in a case of a study
    const char *place;
    bool faulty;     ///< refused; the member holds the default
} bt_origin;

/// "FILE:LINE: KEY", "FILE: KEY", "--set KEY=VALUE" or "PLACE: KEY=VALUE": the beginning of a message about a key,
/// truncated to the buffer.
void bt_case_locate(const bt_case *input, const bt_origin *origin, const char *key, char out[256]);

/// A check in progress.
typedef struct bt_check {
    bt_case *c;
    bt_origin *from; ///< [bt_n_case_keys], or NULL
    bt_errors *err;
} bt_check;

/// The file that gives a key; the case's own file if none does.
const char *bt_check_file(const bt_check *check, const char *key);

bool bt_check_given(const bt_check *check, const char *key);  ///< in the file or by an override
/// Is a key given where another is: in the same file, or both on the command line? A default counts as given in both
/// places, but not in a study, where another member may have another value.
bool bt_check_together(const bt_check *check, const char *key, const char *other);
bool bt_check_sound(const bt_check *check, const char *keys); ///< none of the keys, separated by blanks, was refused
void bt_check_fault(const bt_check *check, const char *key, const char *fmt, ...) __attribute__((format(printf, 3, 4)));

#endif
