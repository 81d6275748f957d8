// SPDX-License-Identifier: MIT
// Outlines that lie flush get common vertices.
#ifndef BERGTOW_WELD_H
#define BERGTOW_WELD_H

#include "bergtow/outline.h"

typedef struct bt_welded {
    int n;
    double v[2 * BT_MAX_VERTICES]; ///< m, anticlockwise, in a common frame
} bt_welded;

/// Move vertices of o[n] that lie within `reach`, m, of the boundary of an outline before theirs onto it: onto its
/// nearest vertex if one is that near, otherwise onto its edge. Also across periods, m (0 = none). An outline that this
/// would make unsound, or no longer convex, stays as it is.
void bt_weld(int n, bt_welded *o, double reach, double period_x, double period_y);

#endif
