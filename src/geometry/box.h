// SPDX-License-Identifier: MIT
// Bounding boxes of polygons, and checks of their vertices.
#ifndef BT_BOX_H
#define BT_BOX_H

#include <math.h>

#include "bergtow/base.h"

/// Along the axes, m.
typedef struct bt_box { double low[2], high[2]; } bt_box;

static inline bt_box bt_box_of(int64_t n, const double *v)
{
    bt_box box = {{INFINITY, INFINITY}, {-INFINITY, -INFINITY}};
    for (int64_t i = 0; i < 2 * n; i++) {
        box.low[i % 2] = bt_min(box.low[i % 2], v[i]);
        box.high[i % 2] = bt_max(box.high[i % 2], v[i]);
    }
    return box;
}

static inline bool bt_box_apart(const bt_box *a, const bt_box *b)
{
    return a->low[0] > b->high[0] || a->low[1] > b->high[1] || a->high[0] < b->low[0] || a->high[1] < b->low[1];
}

/// What is wrong with the vertices of an outline, one by one or as neighbours, or NULL; *extent: diagonal of their box,
/// m. near: distance / extent up to which neighbouring vertices coincide.
const char *bt_ring_fault(int n, const double *v, double near, double *extent);

/// What is wrong with its area, relative to the extent, or with its sense, or NULL. Tell of edges that cross before
/// this: a figure of eight may have no area, or a negative one.
const char *bt_ring_area_fault(int n, const double *v, double extent);

/// What is wrong with an outline that bt_outline_split cannot cut.
#define BT_NO_PARTS "it cannot be cut into convex parts: edges almost touch; move its vertices apart, or simplify it"

#endif
