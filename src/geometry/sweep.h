// SPDX-License-Identifier: MIT
// Do two convex polygons come near each other as they move and turn?
#ifndef BERGTOW_SWEEP_H
#define BERGTOW_SWEEP_H

#include <stdbool.h>

/// A convex polygon that moves: n vertices v [n][2] relative to the point it turns about, m; velocity x, y, m/s; rate
/// of turn, rad/s.
typedef struct bt_moving {
    int n;
    const double *v;
    double x, y, rate;
} bt_moving;

/// Does the distance between a and b fall to `near`, m, or below within the time dt, s? (dx, dy): from the point that a
/// turns about to that of b at the beginning, m. Never false when it does; true, too, for some that pass at little more
/// than `near` (1 % on a straight way).
bool bt_sweep_meets(const bt_moving *a, const bt_moving *b, double dx, double dy, double near, double dt);

#endif
