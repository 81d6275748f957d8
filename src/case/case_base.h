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

/// The case's own file, then its base, then the base of that, and so on.
typedef struct bt_case_files {
    bt_case_file *file;
    int n;
} bt_case_files;

/// Parse the text of the case's own file, of size bytes, and read and parse the files that it is based on; path and
/// text are copied. alone: a base is refused, and no file is read. Call bt_case_files_free also after an error. Errors:
/// BT_ERR_CASE; BT_ERR_IO if a base cannot be read.
bt_status bt_case_files_read(bt_case_files *files, const char *path, const char *text, size_t size, bool alone,
                             bt_errors *err);
void bt_case_files_free(bt_case_files *files);

/// All texts as one, for the record: without a base the case's own text, otherwise one YAML document for each file,
/// which begins with "--- # FILE". Caller frees.
char *bt_case_files_text(const bt_case_files *files);

/// Kind of a file, by its keys; other if it cannot be read. Pipes are not read, since that is possible only once.
typedef enum { BT_FILE_OTHER, BT_FILE_CASE, BT_FILE_STUDY } bt_file_kind;
bt_file_kind bt_case_kind_of(const char *path);
/// The same for a tree.
bt_file_kind bt_case_kind(const bt_node *root);

extern const bt_key bt_base_key; ///< the key `base` of a case: it describes the file, not the case

#endif
