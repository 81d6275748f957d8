// SPDX-License-Identifier: MIT
// How far two convex polygons are apart. Independent of the contact code, so that it can check it.
#ifndef BERGTOW_APART_H
#define BERGTOW_APART_H

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

#endif
