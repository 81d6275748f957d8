// SPDX-License-Identifier: MIT
// The files that a case names: field, outlines, tables. A case stores only their paths. A run that was killed before
// its first checkpoint starts again from its case.resolved.yml and reads the files again; so case.resolved.yml records
// what they contained, in a comment for each:
//
//     # water.current_table: 312 bytes, xxh128 0123...
//
// Its second line (# case: ...) does the same for case.resolved.yml itself, and is still there if the file is cut: a
// file edited in the meantime would be the case of another run under the name of this one. The case as given follows as
// comments, each line behind "#> ": reports take its comments for the sources of its values.
//
// Rejected: a checkpoint at time zero, which contains them. A checkpoint means that a new result stands and the old one
// may go (output/folder.h), and that a member whose process dies has made progress (run/ensemble_list.h).
#ifndef BT_CASE_FILES_H
#define BT_CASE_FILES_H

#include "bergtow/case.h"
#include "case/schema.h"

/// The file that a key names; NULL if none.
const char *bt_case_file(const bt_case *input, const bt_key *key);

/// These comments, for all files that can be read; the caller frees them.
char *bt_case_digests(const bt_case *input);

/// Those of these comments that a text contains; the caller frees them.
char *bt_case_digests_in(const bt_case *input, const char *text);

/// The text of case.resolved.yml: the resolved case with the comment about itself; digests, those about its files
/// (bt_case_digests), or NULL; given, the case as given, or NULL. With that the text may exceed BT_MAX_TEXT_BYTES, the
/// most that is read: then it is left out. The caller frees it.
char *bt_case_with_comments(const char *resolved, const char *digests, const char *given);

/// The case as given, from the text of a case.resolved.yml; NULL if it is not there. The caller frees it.
char *bt_case_given_in(const char *text);

/// Does a case.resolved.yml match its comment about itself? dir: of the run, for messages. Errors: BT_ERR_CASE.
bt_status bt_case_itself_same(const char *path, const char *text, const char *dir, bt_errors *err);

/// Do the files match the comments in input->text? The rest as above.
bt_status bt_case_files_same(const bt_case *input, const char *dir, bt_errors *err);

/// Warn of files that do not match the comments in input->text: a case.resolved.yml was given, with the promise that it
/// gives the same result. digests: the comments of the files as they were read. A key that was replaced since, by a
/// case based on it or with --set, has no comment.
void bt_case_warn_files(const bt_case *input, const char *digests, bt_errors *warnings);

/// The text behind "NAME: " at the beginning of a line; NULL if there is none.
const char *bt_case_said_of(const char *text, const char *name);

#endif
