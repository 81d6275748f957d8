// SPDX-License-Identifier: MIT
// Keys that have no effect beside what another key says.
#ifndef BT_CASE_IDLE_H
#define BT_CASE_IDLE_H

#include "bergtow/case.h"
#include "case/case_faults.h"

/// Refuse those that stand in the file that makes them useless, or are both set beside it.
void bt_case_check_idle(const bt_check *k);

/// Warn of the others, which a base or a study may have brought along.
void bt_case_warn_idle(const bt_case *c, bt_errors *warnings);

/// Mark them in idle_key [bt_n_case_keys].
void bt_case_mark_idle(const bt_case *c, bool *idle_key);

/// Give a key of a number or a choice its default.
void bt_case_put_default(bt_case *c, int key);

/// Has this key no effect, whatever its value?
bool bt_case_is_unused(const bt_case *c, const char *key);

/// Has a key of a number or a choice another value than its default, which others may set?
bool bt_case_changed(const bt_case *c, const char *key);

// --- of the frames ---------------------------------------------------------------------------------------------------

// Defaults that the frame of a case decides on.

/// In the geographic frame: numbers that nobody gave, that have an effect, and whose default is a model basin's, become
/// NaN. by_hand: there are floes of the list without a thickness of their own.
void bt_case_frame_clear(const bt_check *k, bool by_hand);

/// Refuse a case that lacks such a value once others have followed from what it gives. ice.thickness beside outlines
/// may stay NaN: the file says whether it is needed.
void bt_case_frame_check(const bt_check *k, bool by_hand);

#endif
