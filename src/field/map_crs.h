// SPDX-License-Identifier: MIT
// What the name of a coordinate reference system says about the numbers of a GeoJSON file.
#ifndef BT_MAP_CRS_H
#define BT_MAP_CRS_H

#include <stdbool.h>

#include "bergtow/case.h"
#include "bergtow/field.h"

typedef enum {
    BT_MAP_DEGREES, ///< longitude, latitude
    BT_MAP_PLANE,   ///< metres east and north of a projection
    BT_MAP_LOCAL,   ///< metres east and north of x = y = 0 of a case: BT_MAP_LOCAL_NAME
    BT_MAP_WARPED,  ///< metres of the projection, not of the ground
    BT_MAP_UNKNOWN,
} bt_map_kind;

typedef struct bt_map_crs {
    bt_map_kind kind;
    char name[32];   ///< "OGC:CRS84", "EPSG:32633", "local"; of an unknown one as it is given, cut
    double true_lat; ///< at which a polar one is true to scale, deg; 0: equal areas, or no polar one
    double offset;   ///< of its pole, m
    bool any_north;  ///< the grid's north can differ from the true one by any angle: polar projections
} bt_map_crs;

/// The name this program gives to coordinates that are tied to no place on the earth. OGC has no name for one.
#define BT_MAP_LOCAL_NAME "urn:x-bergtow:crs:local-metres-east-north"

/// From "EPSG:32633", "urn:ogc:def:crs:EPSG::32633", "http://www.opengis.net/def/crs/OGC/1.3/CRS84" and the like,
/// whatever the case of the letters.
bt_map_crs bt_map_crs_of(const char *name);

/// Metres of the map for a metre on the ground at a place of a projection, along and across the meridian of a polar
/// one, on a sphere: within a thousandth of those on the ellipsoid.
void bt_map_crs_scale(const bt_map_crs *crs, double east, double north, double *along, double *across);

// --- places ----------------------------------------------------------------------------------------------------------

// Where x = y = 0 of a case lies on the earth, as far as its map or its keys say it.

#define BT_MAP_FARTHEST 100e3 ///< m from the origin: the projection is one of small areas

/// Between these latitudes, deg, there is no sea ice: nearest to the equator is that of the Bohai Sea, at 37° N, and of
/// South Georgia, at 54° S.
#define BT_MAP_FREE_SOUTH (-53.)
#define BT_MAP_FREE_NORTH 30.

typedef struct bt_map_place {
    bt_map_kind kind;     ///< BT_MAP_DEGREES, BT_MAP_PLANE (of a projection), BT_MAP_LOCAL (of no place on the earth)
    double first, second; ///< longitude and latitude, rad; or east and north in the plane of the map, m
    const char *crs;      ///< of the projection, as long as the outlines are there; NULL of others
} bt_map_place;

/// The map from which the outlines came (NULL or all 0: there is none) goes before ice.origin_lon and ice.origin_lat.
bt_map_place bt_map_place_of(const bt_outline_counts *counts, const bt_case *input);

#endif
