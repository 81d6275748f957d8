// SPDX-License-Identifier: MIT
// Checks shared by all readers of ice fields: which outlines are accepted, and where floes may lie.
#ifndef BT_FIELD_ADMIT_H
#define BT_FIELD_ADMIT_H

#include "bergtow/field.h"

enum { BT_MAX_MESSAGES = 10 }; ///< faults of a file reported one by one

/// Faults of one file; only the first few are reported in words.
typedef struct bt_refusals {
    const char *path;
    bt_errors *err;
    int said;
    bt_status status;
} bt_refusals;

void bt_refuse(bt_refusals *refusals, const char *fmt, ...) __attribute__((format(printf, 2, 3)));

/// May this outline be a floe? Returns why not, or NULL. v [*n][2] must be clean and anticlockwise. It becomes its hull
/// if `nonconvex` says so, or if rounding explains its reflex corners; `counts` records the changes.
const char *bt_outline_admit(bt_nonconvex nonconvex, int *n, double *v, bt_outline_counts *counts);

/// Refuse floes outside the domain (walls bound the whole outline, other boundaries the centroid) and floes that
/// overlap each other by more than the solver's slop. The first few are reported one by one, then the number of
/// overlapping pairs and the deepest overlap. `noun`: the file's word for a floe.
void bt_field_check_apart(const bt_case *input, const bt_field *field, const char *noun, bt_refusals *refusals);

/// The same, and refuse floes that overlap the towed body or a floe given by hand. Not for a field file (ice.field),
/// where a lead may remove such floes.
void bt_field_check_places(const bt_case *input, const bt_field *field, const char *noun, bt_refusals *refusals);

#endif
