// SPDX-License-Identifier: MIT
// Convex polygons: moments, named waterlines, validity.
//
// A polygon is n vertices v[2*i], v[2*i+1] in metres, anticlockwise in its (x, y) frame. In the full-scale
// frame (x north, y east) the same order looks clockwise from above; nothing here depends on that.
#ifndef BERGTOW_SHAPE_H
#define BERGTOW_SHAPE_H

#include "bergtow/base.h"

BT_BEGIN_C

#define BT_MAX_VERTICES 128 ///< of one polygon; the contact code keeps per-pair buffers of this length

/// Moments of a polygon about its own centroid.
typedef struct bt_moments {
    double area;     ///< A, m²
    double cx, cy;   ///< centroid in the frame of the vertices, m
    double polar;    ///< ∫ r² dA about the centroid, m⁴
    double cubic;    ///< ∫ r³ dA about the centroid, m⁵ (yaw drag)
    double radius;   ///< largest distance of a vertex from the centroid, m
    double inradius; ///< smallest distance of an edge line from the centroid, m
} bt_moments;

/// Area, centroid and moments by exact integration over the triangle fan (∫r³ by closed form per triangle).
bt_moments bt_shape_moments(int n, const double *v);

/// The same without ∫ r³ dA, which stays 0: its two asinh per edge are two thirds of the work, and only drag needs it.
bt_moments bt_shape_area_moments(int n, const double *v);

/// Only area and centroid, to the same bits; the others stay 0.
bt_moments bt_shape_centroid(int n, const double *v);

/// Why a polygon cannot be a body, or NULL: too few or many vertices, clockwise, not convex, zero area,
/// repeated vertices. The text is a static string that completes "... is refused: ".
const char *bt_shape_fault(int n, const double *v);

/// Is a polygon faulty beyond the rounding of a valid outline when centred, shrunk or cut? Looser than bt_shape_fault.
bool bt_shape_broken(int n, const double *v);

/// Move the centroid to the origin, in place; returns the result of bt_shape_area_moments before the move.
bt_moments bt_shape_centre(int n, double *v);

/// Width across the direction (ux, uy) (unit vector, body frame): extent of the projection on its normal, m.
double bt_shape_width(int n, const double *v, double ux, double uy);

/// Regular n-gon of the given area about the origin, first vertex on the +x side. v: [2*n].
void bt_shape_regular(int n, double area, double *v);

/// Convex hull (anticlockwise, no collinear points) of n points, in place; returns its number of vertices.
int bt_shape_hull(int n, double *v);

/// Clip a convex polygon to the half-plane nx·x + ny·y <= d. out holds up to n+1 vertices; returns their number (0 if
/// nothing is left).
int bt_shape_clip(int n, const double *v, double nx, double ny, double d, double *out);

/// Names of shapes, in the order of bt_body_shape (bergtow/case.h).
#define BT_SHAPE_NAMES "disc", "square", "rectangle", "ship"

/// Write a named waterline of length l (x) and width w (y), m, centred, bow on +x, to v: [2*BT_MAX_VERTICES]. "disc"
/// (64-gon of the area of the ellipse l×w), "square" (side l), "rectangle", "ship" (raked bow over a quarter of the
/// length, transom of 0.7 w). Returns the number of vertices, 0 if the name is unknown.
int bt_shape_named(const char *name, double l, double w, double *v);

/// A waterline of length l (x) and width w (y), m, bow on +x, convex and anticlockwise, about any origin: it is moved
/// to its centroid. v: [2*BT_MAX_VERTICES]; returns the number of vertices, at most BT_MAX_VERTICES.
typedef int (*bt_shape_outline)(double l, double w, double *v);

enum { BT_MAX_ADDED_SHAPES = 4 };

/// Add a shape of the towed body, `body.shape: NAME`, before a case is read and from one thread; how:
/// docs/how-to-add-a-body-shape.md. Name and function must remain valid. Errors: BT_ERR_USAGE with reason and remedy: a
/// missing or used name, no convex outline of 2 × 1 m, no room.
bt_status bt_shape_register(const char *name, bt_shape_outline outline, bt_errors *err);

BT_END_C

#endif
