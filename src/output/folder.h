// SPDX-License-Identifier: MIT
// The folder of a run: which of its files are the program's, and how a new one takes the place of an old result.
//
// The old result is moved into DIR/replaced, name by name, before the new run writes anything but its case, and is
// removed when the new one stands: when it has a checkpoint or a summary. Every moment between leaves one of two
// states:
//
//     replaced/ and no case.resolved.yml     the exchange was cut short: bt_folder_recover makes the folder what it was
//     replaced/ and case.resolved.yml        the new run has begun: `resume` runs it, from the start if it must
//
// so the name case.resolved.yml, given by one rename, decides. Rejected: to delete first (a full disk then leaves
// neither result); to write the new run into a folder of its own and exchange the two at the end (what watches a run
// looks for it under its name, and two results need the disk of two for the whole run instead of until the first
// checkpoint).
#ifndef BT_FOLDER_H
#define BT_FOLDER_H

#include "bergtow/base.h"

#define BT_FOLDER_REPLACED "replaced"

/// Refuse, by name, every file that a run would replace and this program has not written. A `stop` with something in
/// it is one: a request to stop is an empty file. The other calls leave such files where they are.
bt_status bt_folder_check(const char *dir, bt_errors *err);

/// May a run write its result here? A long run must not take the place of another by a slip of the hand: only with
/// force. remedy: what the caller's user can do, as "give another folder with -o". Errors: BT_ERR_IO.
bt_status bt_folder_may_take(const char *dir, bool force, const char *remedy, bt_errors *err);

/// Move what is there aside and give the resolved case its name. After an error the folder is as it was.
bt_status bt_folder_replace(const char *dir, const char *resolved, bt_errors *err);

/// Undo a replacement that did not come to its end, or whose run could not begin; nothing if there is none.
void bt_folder_put_back(const char *dir);

/// The same, only where the replacement itself was cut short. Holding the lock of the folder.
void bt_folder_recover(const char *dir);

/// The new result stands: what it has replaced goes.
void bt_folder_settle(const char *dir);

/// Is a result kept aside, because the new one does not stand?
bool bt_folder_keeps(const char *dir);

#endif
