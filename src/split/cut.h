// SPDX-License-Identifier: MIT
// The cut of an outline along a section into two pieces, without loss.
#ifndef BT_SPLIT_CUT_H
#define BT_SPLIT_CUT_H

#include "split/section.h"

#include "bergtow/outline.h"

/// One of the two pieces.
typedef struct bt_piece {
    int n;                             ///< vertices
    double outline[2 * BT_MAX_VERTICES]; ///< [n][2] m, anticlockwise, about its own centroid
    bool convex;
    bt_parts parts;                    ///< convex parts of an outline that is not convex
    double x, y;                       ///< centroid in the parent's frame, m
    double area;                       ///< m²
    double polar;                      ///< ∫ r² dA about its own centroid, m⁴
    bool left;                         ///< of the chord
} bt_piece;

/// Cut an outline of n vertices, centroid at the origin, along a section. area (m²) and polar (m⁴) are those of the
/// parent body. The larger piece comes first; if the two are equal to 1e-9, the left one. Area, and first and second
/// moments, of the second piece are the parent's minus the first's, so that the sums
///     A_1 + A_2 = A,   A_1 c_1 + A_2 c_2 = 0,   J_1 + A_1 c_1² + J_2 + A_2 c_2² = J
/// hold to rounding, and with velocities V + ω k × c_i and spins ω also mass, momentum, angular momentum and kinetic
/// energy, if mass and inertia have the same share of added water. The ends of the section have the same bits in the
/// parent's frame before the centroids are subtracted. False if a piece has fewer than 3 or more than BT_MAX_VERTICES
/// vertices, no area, or no convex parts.
bool bt_split_cut(int n, const double *outline, double area, double polar, const bt_chord *chord, bt_piece piece[2]);

#endif
