// SPDX-License-Identifier: MIT
// The files of a case: its own, and those that it is based on.
#ifndef BT_CASE_BASE_H
#define BT_CASE_BASE_H

#include "base/tree.h"
#include "case/schema.h"

/// A file of a case.
typedef struct bt_case_file {
    char *path, *text;
    size_t size;
    bt_node *root; ///< a map
} bt_case_file;

/// The case's own file, then its base, then the base of that.
typedef struct bt_case_files {
    bt_case_file *file;
    int n;
} bt_case_files;

/// Take over path and text of the case's own file, of size bytes, and read those that it is based on; every text is
/// parsed. alone: a base is refused, and no file read. After an error, too, bt_case_files_free. Errors: BT_ERR_CASE,
/// BT_ERR_IO (a base cannot be read).
bt_status bt_case_files_read(bt_case_files *files, const char *path, const char *text, size_t size, bool alone,
                             bt_errors *err);
void bt_case_files_free(bt_case_files *files);

/// All texts as one, for the record: of a case without a base its own, otherwise one YAML document a file, which begins
/// with "--- # FILE". Caller frees.
char *bt_case_files_text(const bt_case_files *files);

/// What a file holds, by its keys; other where it cannot be read. Pipes, which can be read only once, are not read.
typedef enum { BT_FILE_OTHER, BT_FILE_CASE, BT_FILE_STUDY } bt_file_kind;
bt_file_kind bt_case_kind_of(const char *path);
/// The same of a tree.
bt_file_kind bt_case_kind(const bt_node *root);

extern const bt_key bt_base_key; ///< the key `base` of a case; of the file, and not of what it says

#endif
