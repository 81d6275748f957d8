// SPDX-License-Identifier: MIT
// How a check of a case complains.
#ifndef BERGTOW_CASE_FAULTS_H
#define BERGTOW_CASE_FAULTS_H

#include "bergtow/case.h"

/// Where the value of a key comes from, for messages and to leave out checks on values that were refused already.
typedef struct bt_origin {
    int line;        ///< in the file; 0 = default or override
    const char *file; ///< of the files of the case, NULL = its own
    const char *set; ///< the override "key=value", or NULL
    /// where that stands, "FILE:LINE: ", or NULL: in the command line; "" of a default in a case of a study
    const char *place;
    bool faulty;     ///< refused; the member holds the default
} bt_origin;

/// "FILE:LINE: KEY", "FILE: KEY", "--set KEY=VALUE" or "PLACE: KEY=VALUE": how a message about a key begins. Truncated
/// to the buffer.
void bt_case_locate(const bt_case *input, const bt_origin *origin, const char *key, char out[256]);

/// A check under way.
typedef struct bt_check {
    bt_case *c;
    bt_origin *from; ///< [bt_n_case_keys], or NULL
    bt_errors *err;
} bt_check;

/// The file in which a key stands; the case's own where it is not given.
const char *bt_check_file(const bt_check *check, const char *key);

bool bt_check_given(const bt_check *check, const char *key);  ///< in the file or by an override
/// Is a key given where another is, in the same file or both on the command line? A default stands in both, but not in
/// a study, where another member may have it otherwise.
bool bt_check_together(const bt_check *check, const char *key, const char *other);
bool bt_check_sound(const bt_check *check, const char *keys); ///< none of the keys, separated by blanks, was refused
void bt_check_fault(const bt_check *check, const char *key, const char *fmt, ...) __attribute__((format(printf, 3, 4)));

#endif
