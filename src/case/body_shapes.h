// SPDX-License-Identifier: MIT
// Names of the towed body's waterlines, in the order of bt_body_shape; those that a program adds follow.
#ifndef BERGTOW_BODY_SHAPES_H
#define BERGTOW_BODY_SHAPES_H

#include "bergtow/case.h"
#include "bergtow/shape.h"

enum { BT_OWN_SHAPES = BT_BODY_ABSENT + 1 };

extern const char *bt_body_shapes[BT_OWN_SHAPES + BT_MAX_ADDED_SHAPES + 1]; ///< ends with NULL

/// Vertices of a shape that has a name, m: neither polygon nor none. As bt_shape_named.
int bt_body_shape_named(bt_body_shape shape, double length, double width, double *v);

#endif
