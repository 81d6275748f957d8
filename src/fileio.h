// SPDX-License-Identifier: MIT
// Text files that are complete or absent, folders, and the wording of input/output errors.
#ifndef BT_FILEIO_H
#define BT_FILEIO_H

#include "bergtow/base.h"

/// Append "path: cannot ACTION: reason; remedy" for an errno value; returns BT_ERR_IO.
bt_status bt_file_fail(const char *path, const char *action, int errnum, bt_errors *err);

/// What a user can do about an errno value of a failed file operation.
const char *bt_file_remedy(int errnum);

/// Whole text of a file of at most 16 MiB, terminated; the caller frees it (also after an error). what: "a case file", for the
/// messages. Errors: BT_ERR_IO, BT_ERR_CASE (too large).
bt_status bt_file_read(const char *path, const char *what, char **text, size_t *size, bt_errors *err);

/// The same, of at most so many bytes.
bt_status bt_file_read_to(const char *path, const char *what, size_t most, char **text, size_t *size, bt_errors *err);

/// Write text to path by way of a temporary name and a rename: path holds the old or the new text, never a part.
bt_status bt_file_write(const char *path, const char *text, bt_errors *err);

/// Make a folder with its parents; no error when it is there.
bt_status bt_file_make_dir(const char *path, bt_errors *err);

/// Remove a file; no error when it is not there.
bt_status bt_file_remove(const char *path, bt_errors *err);

/// dir/name in new memory; the caller frees it.
char *bt_file_join(const char *dir, const char *name);

#endif
