// SPDX-License-Identifier: MIT
// Two polygons: their distance, and whether they meet as they move; what they share; outlines that lie flush.
#ifndef BT_POLYGONS_H
#define BT_POLYGONS_H

#include <stdbool.h>

#include "bergtow/outline.h"
#include "geometry/box.h"

// --- distance and motion ---------------------------------------------------------------------------------------------

// Distance of two convex polygons. Independent of the contact code, so that tests can use it to check that code.

/// Two convex polygons by separating axes over all edge normals n, D from centroid to centroid, h support functions.
typedef struct bt_apart {
    /// max n·D − h_a(n) − h_b(−n): distance if > 0 along the best edge normal, depth of overlap if < 0, m
    double gap;
    /// factor by which both can be scaled about their centroids until they touch: max n·D/(h_a + h_b)
    double both;
    double first;     ///< the same when only the first is scaled: max (n·D − h_b)/h_a
} bt_apart;

/// a [na][2], b [nb][2] relative to their centroids, (dx, dy) from the centroid of a to that of b.
bt_apart bt_apart_of(int na, const double *a, int nb, const double *b, double dx, double dy);

// --- motion ----------------------------------------------------------------------------------------------------------

// Do two convex polygons come near each other as they move and turn?

/// A convex polygon that moves: n vertices v [n][2] relative to the point it turns about, m; velocity x, y, m/s; rate
/// of turn, rad/s.
typedef struct bt_moving {
    int n;
    const double *v;
    double x, y, rate;
} bt_moving;

/// Does the distance between a and b fall to `near`, m, or below within the time dt, s? (dx, dy): from the point that a
/// turns about to that of b at the beginning, m. Never false if it does; also true for some that pass at little more
/// than `near` (1 % in straight motion).
bool bt_sweep_meets(const bt_moving *a, const bt_moving *b, double dx, double dy, double near, double dt);

// --- clipping --------------------------------------------------------------------------------------------------------

/// The part of a polygon of n points to the left of the line through `at` along `along` [Sutherland & Hodgman 1974,
/// Comm. ACM 17], to out: at most 2 n points, n + 1 of a convex one; returns their number. of, mark: of the edge that
/// starts at each point, before and after; an edge along the line gets 1. NULL = none.
int64_t bt_polygon_cut(int64_t n, const double *v, const uint8_t *of, const double at[2], const double along[2],
                       double *out, uint8_t *mark);

/// Signed area, m², of the polygon of n points in w[0] within a convex, anticlockwise one of m points: cut at each of
/// its edges. Cutting a polygon that is not convex leaves seams, whose areas cancel. w: two arrays with room for all
/// cuts, which are overwritten.
double bt_polygon_shared(int64_t n, int m, const double *by, double *const w[2]);

// --- flush outlines --------------------------------------------------------------------------------------------------

// Outlines that lie flush get common vertices.

typedef struct bt_welded {
    int n;
    double v[2 * BT_MAX_VERTICES]; ///< m, anticlockwise, in a common frame
} bt_welded;

/// Move vertices of `outline[n]` that lie within `reach`, m, of the boundary of an earlier outline onto it: onto its
/// nearest vertex if one is that near, otherwise onto its edge. Also across periods, m (0 = none). An outline that
/// would become unsound by this, or change whether it is convex, stays as it is.
void bt_weld(int n, bt_welded *outline, double reach, double period_x, double period_y);

#endif
