// SPDX-License-Identifier: MIT
// The files that a case names: field, outlines, tables. A case says their paths alone. A run that was killed before its
// first checkpoint begins again by its case.resolved.yml and reads them anew, so what they held is kept there, in a
// comment for each:
//
//     # water.current_table: 312 bytes, xxh128 0123...
//
// So is what the file itself said, in its second line (# case: ...), where a file that is cut has it, too: edited
// meanwhile, it would be the case of another run under the name of this one.
//
// Rejected: a checkpoint at time zero, which holds them. A checkpoint means that a new result stands and the old one
// may go (output/folder.h), and that a member of an ensemble whose process dies gets on (run/ensemble_list.h).
#ifndef BT_CASE_FILES_H
#define BT_CASE_FILES_H

#include "bergtow/case.h"
#include "case/schema.h"

/// The file of a key that names one, NULL = none.
const char *bt_case_file(const bt_case *input, const bt_key *key);

/// These comments, for all files that can be read; the caller frees them.
char *bt_case_digests(const bt_case *input);

/// Those of them that a text has; the caller frees it.
char *bt_case_digests_in(const bt_case *input, const char *text);

/// case.resolved.yml: the resolved case with the comment of itself, and those of its files (bt_case_digests), or NULL.
/// The caller frees it.
char *bt_case_with_digests(const char *resolved, const char *digests);

/// Is the case.resolved.yml of this text what its comment says? dir: of the run, for the messages. Errors: BT_ERR_CASE.
bt_status bt_case_itself_same(const char *path, const char *text, const char *dir, bt_errors *err);

/// Are the files what the comments in input->text say? The rest as above.
bt_status bt_case_files_same(const bt_case *input, const char *dir, bt_errors *err);

/// What a text says behind "NAME: " at the beginning of a line, NULL = nothing.
const char *bt_case_said_of(const char *text, const char *name);

#endif
