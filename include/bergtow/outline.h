// SPDX-License-Identifier: MIT
// Outlines as they come from images: any simple polygon; cleaned, checked, projected, and cut into convex parts.
#ifndef BERGTOW_OUTLINE_H
#define BERGTOW_OUTLINE_H

#include "bergtow/shape.h"

BT_BEGIN_C

enum { BT_MAX_PART_VERTICES = 3 * BT_MAX_VERTICES }; ///< of all parts of one outline: at most n + 2 (n − 3)

/// Convex parts of a simple polygon.
typedef struct bt_parts {
    int n;                                ///< parts
    int count[BT_MAX_VERTICES];           ///< [n] vertices of each part
    int n_vertices;                       ///< of all parts
    /// [n_vertices] vertices as indices into the outline, part after part, anticlockwise
    uint8_t corner[BT_MAX_PART_VERTICES];
} bt_parts;

/// Drop neighbouring vertices that coincide, and vertices in the middle of a straight line, in place; returns how many
/// remain. A vertex is on the line if it lies within 1e-9 of the extent.
int bt_outline_clean(int n, double *v);

/// Twice the signed area, m²; negative if the vertices run clockwise.
double bt_outline_area2(int n, const double *v);

/// Why an outline cannot be a floe, convex or not, or NULL: too few or many vertices, not finite, zero area, clockwise,
/// edges that cross or touch. The text is a static string that completes "... is refused: ".
const char *bt_outline_fault(int n, const double *v);

/// Do the edges of a ring of any length cross or touch each other (other than neighbours at their common vertex)?
bool bt_outline_crosses(int n, const double *v);

/// Is a valid outline convex (to the tolerance of bt_shape_fault)?
bool bt_outline_convex(int n, const double *v);

/// Cut a valid outline into convex parts: cut ears (best shape first), then remove every diagonal whose removal leaves
/// a convex polygon [Hertel & Mehlhorn 1983, LNCS 158: at most four times the least number of parts]. False if rounding
/// leaves no ear.
bool bt_outline_split(int n, const double *v, bt_parts *parts);

/// Project a place (lon, lat) to metres north and east of (lon0, lat0), angles in radians, on the WGS84 ellipsoid.
/// Azimuthal equidistant for a small area: the direction is that of the place seen from the origin (e, n: its chord's
/// components
///     east and north), the distance the arc over the chord c,
///     (east, north) = (e, n)/√(e² + n²) · c (1 + c²/(24 R²)),   R² = M N, the radii of curvature at the origin.
/// Poles and the 180th meridian are not singular. Error against geodesics, from 60° to 89° N: 1 mm at 10 km, 2 cm at
/// 100 km.
void bt_outline_project(double lon, double lat, double lon0, double lat0, double *north, double *east);

/// The place (lon, lat), rad, longitude from −π to π, of metres north and east of (lon0, lat0): the inverse of
/// bt_outline_project, to rounding, within a tenth of the earth's radius.
void bt_outline_unproject(double north, double east, double lon0, double lat0, double *lon, double *lat);

/// Can two numbers be longitude and latitude in degrees? narrow: with a longitude up to 180° (RFC 7946), for degrees
/// without a crs, and for metres, which all so small are taken for degrees; otherwise up to 360°.
bool bt_outline_in_degrees(double lon, double lat, bool narrow);

/// The place in the middle of n others, all longitude and latitude in degrees: of the box around them in its own
/// projection, which no pole and no meridian disturbs; where they lie far apart, their mean direction. (0, 0) of none.
void bt_outline_middle(int64_t n, const double *place, double middle[2]);

BT_END_C

#endif
