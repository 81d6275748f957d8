// SPDX-License-Identifier: MIT
// Constraints between keys, and the keys that have no effect beside what another key says.
#ifndef BT_CONSTRAINTS_H
#define BT_CONSTRAINTS_H

#include "bergtow/case.h"
#include "case/case_faults.h"

/// Refuse values that break a limit, and keys without effect that stand in the file that makes them useless, or are set
/// beside it. All defaults have their values.
void bt_case_check_constraints(const bt_check *check);

/// Warn of the other keys without effect, which a base or a study may have brought along.
void bt_case_warn_idle(const bt_case *input, bt_errors *warnings);

/// Mark them in idle_key [bt_n_case_keys].
void bt_case_mark_idle(const bt_case *input, bool *idle_key);

/// Give a key of a number or a choice its default.
void bt_case_put_default(bt_case *c, int key);

/// Of a key that has no effect, whatever its value: what completes "has no effect "; NULL of others.
const char *bt_case_why_unused(const bt_case *input, const char *key);

/// Has a key of a number, a choice or points another value than its default, which others may set?
bool bt_case_changed(const bt_case *c, const char *key);

#endif
