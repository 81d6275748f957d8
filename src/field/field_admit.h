// SPDX-License-Identifier: MIT
// What the readers of ice fields share: which outlines get in, and whether they lie where they can.
#ifndef BT_FIELD_ADMIT_H
#define BT_FIELD_ADMIT_H

#include "bergtow/field.h"

enum { BT_MOST_MESSAGES = 10 }; ///< faults of one file that are reported one by one

/// Faults of one file, the first few of them in words.
typedef struct bt_refusals {
    const char *path;
    bt_errors *err;
    int said;
    bt_status status;
} bt_refusals;

void bt_refuse(bt_refusals *refusals, const char *fmt, ...) __attribute__((format(printf, 2, 3)));

/// May this outline be a floe? v [*n][2], clean and anticlockwise, becomes its hull if the case says so; what was done
/// is counted. Returns why not, or NULL. Without bays but those that rounding makes it is taken for convex, and
/// counted.
const char *bt_outline_admit(bt_nonconvex nonconvex, int *n, double *v, bt_outline_counts *counts);

/// Refuse floes outside the domain (walls hold the whole outline, other boundaries the centroid) and floes that overlap
/// each other by more than the solver's slop: the first few one by one, and how many and how deep. `noun`: what the
/// file calls a floe.
void bt_field_check_apart(const bt_case *input, const bt_field *field, const char *noun, bt_refusals *refusals);

/// The same, and floes in the towed body or a floe given by hand. Not of a field that was made before, out of which a
/// lead may take them.
void bt_field_check_places(const bt_case *input, const bt_field *field, const char *noun, bt_refusals *refusals);

#endif
