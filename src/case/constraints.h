// SPDX-License-Identifier: MIT
// Constraints between keys, and keys that have no effect because of the value of another key.
#ifndef BT_CONSTRAINTS_H
#define BT_CONSTRAINTS_H

#include "bergtow/case.h"
#include "case/case_faults.h"

/// Refuse values that break a limit, and keys without effect that stand in the same file as the key that makes them
/// useless, or are set beside it. All defaults must be set.
void bt_case_check_constraints(const bt_check *check);

/// Warn of the other keys without effect, which may come from a base or a study.
void bt_case_warn_idle(const bt_case *input, bt_errors *warnings);

/// Mark keys without effect in idle_key [bt_n_case_keys].
void bt_case_mark_idle(const bt_case *input, bool *idle_key);

/// Set a key, a number or a choice, to its default.
void bt_case_put_default(bt_case *c, int key);

/// For a key that has no effect, whatever its value: the text that completes "has no effect "; NULL for other keys.
const char *bt_case_why_unused(const bt_case *input, const char *key);

/// Does a key (a number, a choice or points) have another value than its default, which may follow from other keys?
bool bt_case_changed(const bt_case *c, const char *key);

#endif
