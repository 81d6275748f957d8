// SPDX-License-Identifier: MIT
// The folder of a run: which of its files belong to the program, and how a new run replaces an old result.
//
// The old result is moved into DIR/replaced, name by name, before the new run writes anything but its case, and removed
// when the new one is complete: when it has a checkpoint or a summary. A stop in between leaves one of two states:
//
//     replaced/ and no case.resolved.yml     the exchange was interrupted: bt_folder_recover restores the folder
//     replaced/ and case.resolved.yml        the new run has begun: `resume` runs it, from the start if necessary
//
// so the name case.resolved.yml, given by one rename, decides. Rejected: deleting first (a full disk then leaves
// neither result); writing the new run into a separate folder and exchanging the two at the end (programs that watch a
// run look for it under its name, and both results need disk space for the whole run instead of until the first
// checkpoint).
#ifndef BT_FOLDER_H
#define BT_FOLDER_H

#include "bergtow/base.h"

#define BT_FOLDER_REPLACED "replaced"
/// The first file of a run, and of an ensemble. Neither begins in the folder of the other: a reader of the folder would
/// have to guess which of the two is meant.
#define BT_FOLDER_CASE "case.resolved.yml"
#define BT_FOLDER_STUDY "study.resolved.yml"

/// Report, by name, every file that a run would replace although this program has not written it, such as a `stop` that
/// is not empty: a request to stop is an empty file. The other calls leave such files alone. Errors: BT_ERR_IO.
bt_status bt_folder_check(const char *dir, bt_errors *err);

/// May a run write its result here? remedy: as in bt_run_options (bergtow/run.h). Errors: BT_ERR_IO.
bt_status bt_folder_may_take(const char *dir, const char *remedy, bt_errors *err);

/// Move the present result aside and write the resolved case. After an error the folder is as before.
bt_status bt_folder_replace(const char *dir, const char *resolved, bt_errors *err);

/// Undo a replacement that was not finished, or whose run could not begin; does nothing if there is none.
void bt_folder_put_back(const char *dir);

/// The same, only if the replacement itself was interrupted. The caller holds the lock of the folder.
void bt_folder_recover(const char *dir);

/// The new result is complete: remove the old one.
void bt_folder_settle(const char *dir);

/// Warn of the pages and pictures in the folder, which are of an earlier result: the new one has just been completed.
/// Nothing else tells a reader of the folder that they show other numbers.
void bt_folder_warn_pages(const char *dir);

/// Is a result kept aside because the new one is not complete?
bool bt_folder_keeps(const char *dir);

#endif
