// SPDX-License-Identifier: MIT
// Values of keys: text to member, and member to text.
#ifndef BERGTOW_VALUE_H
#define BERGTOW_VALUE_H

#include "case/schema.h"

#include <stdio.h>

/// Bounds of a key in SI; those without a range get ±infinity.
typedef struct bt_range {
    double lo, hi;
    bool lo_open, hi_open;
} bt_range;

/// The range of a key from its text. False when the text is malformed.
bool bt_value_range(const bt_key *k, bt_range *r);

/// Read a scalar into the member of the key under base. plain: not quoted, so that none means "no value". On refusal
/// the member keeps its value and why says reason and remedy. Not for points.
bool bt_value_read(const bt_key *k, void *base, const char *text, bool plain, char why[BT_WHY]);

/// Read the coordinate of a point, with the key's unit and range.
bool bt_value_read_coordinate(const bt_key *k, const char *text, double *value, char why[BT_WHY]);

/// Write the member as a YAML scalar (or flow list of points) that reads back to the same bits.
void bt_value_write(const bt_key *k, const void *base, FILE *out);


#endif
