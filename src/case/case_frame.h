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

/// Mean floe size of a case in the geographic frame that makes and reads no ice, m: that of its floes, or the size of
/// the body; NaN for other cases.
double bt_case_frame_size(const bt_case *c);
/// Damping of the tow line, N s/m: at sea a share of the critical damping of the body on its line or lines; 0 without
/// a line.
double bt_case_frame_damping(const bt_case *c);
/// Speed of approach below which contacts have no restitution, m/s: at sea a share of the reference speed.
double bt_case_frame_rest_speed(const bt_case *c);

#endif
