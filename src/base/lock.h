// SPDX-License-Identifier: MIT
// One process at a time in a result folder.
#ifndef BT_LOCK_H
#define BT_LOCK_H

#include "bergtow/base.h"

/// Take dir/run.lock, which names host and process; the system lifts it when the process ends, however. Returns a
/// descriptor for bt_lock_drop, −1 with a message when another process has it or it cannot be made. *busy: another
/// process has it, which passes; or NULL.
int bt_lock_take(const char *dir, bool *busy, bt_errors *err);
/// The same of another file than run.lock, which tells of a run. It stays.
int bt_lock_take_file(const char *dir, const char *name, bool *busy, bt_errors *err);
void bt_lock_drop(const char *dir, int lock);

#endif
