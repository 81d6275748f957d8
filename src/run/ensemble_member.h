// SPDX-License-Identifier: MIT
// The files by which members of an ensemble are told apart: lock, attempts, reasons of a failure. What they mean:
// bergtow/ensemble.h.
#ifndef BT_ENSEMBLE_MEMBER_H
#define BT_ENSEMBLE_MEMBER_H

#include "bergtow/base.h"

/// Open folder/name; −1 and errno.
int bt_member_open(const char *folder, const char *name, int flags);

/// Lock of an open file: the system lifts it when the file is closed and when the process ends, however it ends.
bool bt_member_take_lock(int fd, bool wait);

/// Is somebody, this process too, at work on the member?
bool bt_member_held(const char *folder);

/// Starts of a member that had no end, since it last came on: one that has written a checkpoint since is no hopeless
/// one.
int bt_member_attempts(const char *folder);
void bt_member_note_attempt(const char *folder);
void bt_member_forget_attempts(const char *folder);

/// In the folder, or beside it where the folder takes no file. Errors: BT_ERR_IO, when neither does.
bt_status bt_member_record_failure(const char *folder, bt_status code, const bt_errors *why, bt_errors *err);
void bt_member_forget_failure(const char *folder);

#endif
