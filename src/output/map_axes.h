// SPDX-License-Identifier: MIT
// How the world lies on what is drawn of it elsewhere: east to the right and north up, about an origin near the ice.
#ifndef BT_MAP_AXES_H
#define BT_MAP_AXES_H

#include "bergtow/case.h"
#include "bergtow/field.h"

/// Drawn coordinates are (y, x) of the geographic frame, that is east and north, and (x, y) of the basin's, each less
/// that of the origin.
typedef struct bt_map_axes {
    bool swapped;        ///< geographic: seen from above its x and y run clockwise
    double origin[2];    ///< x, y of the case where the drawing has 0, 0, m
    char crs[112];       ///< in which the place of the origin is known, for PROJ; "": in none
    double crs_place[2]; ///< first and second coordinate of the origin there, m
} bt_map_axes;

/// Of a case and the map of its field; o: NULL without one.
bt_map_axes bt_map_axes_of(const bt_case *c, const bt_outline_counts *o);

/// Of the two axes, for a reader of the file.
static inline const char *bt_map_axes_names(const bt_map_axes *a)
{
    return a->swapped ? "east (y), north (x)" : "x, y";
}

/// x, y of the case as drawn, m.
static inline void bt_map_axes_point(const bt_map_axes *a, double x, double y, double drawn[2])
{
    drawn[a->swapped] = x - a->origin[0];
    drawn[!a->swapped] = y - a->origin[1];
}

/// Components of a vector as drawn.
static inline void bt_map_axes_vector(const bt_map_axes *a, double vx, double vy, double drawn[2])
{
    drawn[a->swapped] = vx;
    drawn[!a->swapped] = vy;
}

#endif
