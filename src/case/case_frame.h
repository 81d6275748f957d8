// SPDX-License-Identifier: MIT
// Defaults that the frame of a case decides on.
#ifndef BERGTOW_CASE_FRAME_H
#define BERGTOW_CASE_FRAME_H

#include "bergtow/case.h"
#include "case/case_faults.h"

/// In the geographic frame: numbers that nobody gave, that have an effect, and whose default is a model basin's, become
/// NaN. by_hand: there are floes of the list without a thickness of their own.
void bt_case_frame_clear(const bt_check *k, bool by_hand);

/// Refuse a case that lacks such a value once others have followed from what it gives. ice.thickness beside outlines
/// may stay NaN: the file says whether it is needed.
void bt_case_frame_check(const bt_check *k, bool by_hand);

#endif
