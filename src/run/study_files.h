// SPDX-License-Identifier: MIT
// The files that the cases of a study name: fields, outlines, tables. A case says their paths alone, so what they hold
// is kept beside study.resolved.yml, in the file study.files, a line each:
//
//     /home/me/current.csv: 312 bytes, xxh128 0123...
//
// Members made before and after a change of such a file are of two studies.
#ifndef BT_STUDY_FILES_H
#define BT_STUDY_FILES_H

#include <sys/stat.h>

#include "base/checksum.h"
#include "bergtow/study.h"

typedef struct {
    char *path; ///< absolute
    char digest[BT_CHECKSUM_DIGEST];
    int64_t bytes;
    struct stat seen; ///< when the digest was taken
} bt_named_file;

typedef struct bt_study_files {
    bt_named_file *list;
    int n;
} bt_study_files;

/// Those that the base case and the values of its keys name, each once, as far as they can be read: a member whose file
/// is missing says so itself.
void bt_study_files_find(bt_study_files *f, const bt_study *s);
void bt_study_files_free(bt_study_files *f);

/// Compare with DIR/study.files, and add there what it does not have; the caller holds DIR/lock. old: DIR has had
/// members before, and a warning says of which file nothing tells what it was then. Errors: BT_ERR_CASE, a file has
/// changed; BT_ERR_IO.
bt_status bt_study_files_keep(const bt_study_files *f, const char *dir, bool old, bt_errors *warnings, bt_errors *err);

/// Are they what they were when they were found? Read again only where the system says that they have changed. Errors:
/// BT_ERR_CASE.
bt_status bt_study_files_same(bt_study_files *f, bt_errors *err);

#endif
