// SPDX-License-Identifier: MIT
// The intersection of two convex outlines, and the owner of each of its edges.
#ifndef BERGTOW_OVERLAP_H
#define BERGTOW_OVERLAP_H

#include "contact/contacts.h"

/// Anticlockwise, in the frame of the centroid of a.
typedef struct bt_overlap {
    int n;                             ///< 0 = they do not overlap
    double v[2][4 * BT_MAX_VERTICES];  ///< v[now]: the vertices, m
    uint8_t of_b[2][2 * BT_MAX_VERTICES]; ///< 1 = the edge that starts at the vertex is one of b
    int now;
    double push[2 * BT_MAX_VERTICES][2]; ///< contribution of each edge to −grad, m: by bt_overlap_gradient
} bt_overlap;

/// The outline [2n] of a part of body i from its centroid, m.
const double *bt_overlap_polygon(const bt_world *world, bt_idx i, int part, int *n);

/// Intersection of these parts of a and b when b has been moved by (dx, dy): cut by the edges of b one after the other
/// (Sutherland & Hodgman 1974, Comm. ACM 17). The bits depend on the poses alone.
void bt_overlap_clip(const bt_world *world, bt_idx a, bt_idx b, const uint16_t part[2], double dx, double dy,
                     bt_overlap *overlap);

/// Cut an overlap by the edges of a part of body i, whose centroid is at `place` in the frame of the overlap, m.
void bt_overlap_cut(const bt_world *world, bt_idx i, int part, const double place[2], bt_overlap *overlap);

/// Area (m²) and centroid (m, in the frame of a).
double bt_overlap_area(const bt_overlap *overlap, double centroid[2]);

/// How the area A changes when b is moved: grad = ∂A/∂(displacement of b), m. The boundary of the overlap is a closed
/// line, so with n the outward normal
///     grad = ∫_{edges of b} n dl = −∫_{edges of a} n dl = ½ (∫_b − ∫_a) n dl
/// Where edges of both lie on each other and face the same way (rectangles in a row) the gradient jumps as one passes
/// the other. Such edges count for neither, and edges within `blend` of each other only in part.
void bt_overlap_gradient(const bt_world *world, bt_idx a, bt_idx b, const uint16_t part[2], bt_overlap *overlap,
                         double blend, double grad[2]);

#endif
