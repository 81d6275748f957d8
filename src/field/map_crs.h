// SPDX-License-Identifier: MIT
// Meaning of the numbers of a GeoJSON file by the name of its coordinate reference system.
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
    char name[32];   ///< "OGC:CRS84", "EPSG:32633", "local"; an unknown one as given, truncated
    double true_lat; ///< latitude of true scale if polar, deg; 0: equal-area, or not polar
    double offset;   ///< east and north of the pole, m
    bool south;      ///< of the southern hemisphere
    bool any_north;  ///< grid north can differ from true north by any angle: polar projections
} bt_map_crs;

/// Name in this program for coordinates not tied to any place on the earth. OGC has no name for them.
#define BT_MAP_LOCAL_NAME "urn:x-bergtow:crs:local-metres-east-north"

/// From "EPSG:32633", "urn:ogc:def:crs:EPSG::32633", "http://www.opengis.net/def/crs/OGC/1.3/CRS84" and the like,
/// whatever the case of the letters.
bt_map_crs bt_map_crs_of(const char *name);

/// Scale factor at a place of a projection, metres on the map per metre on the ground, along and across the meridian,
/// on a sphere: within a thousandth of that on the ellipsoid.
void bt_map_crs_scale(const bt_map_crs *crs, double east, double north, double *along, double *across);

/// Latitude of a place of a projection, rad, within 0.001°.
double bt_map_crs_latitude(const bt_map_crs *crs, double east, double north);

// --- places ----------------------------------------------------------------------------------------------------------

// Where x = y = 0 of a case lies on the earth, if its map or its keys tell.

#define BT_MAP_FARTHEST 100e3 ///< m from the origin: the projection is for small areas

/// Between these latitudes, deg, there is no sea ice: the nearest to the equator is in the Bohai Sea, at 37° N, and off
/// South Georgia, at 54° S.
#define BT_MAP_FREE_SOUTH (-53.)
#define BT_MAP_FREE_NORTH 30.

typedef struct bt_map_place {
    bt_map_kind kind;     ///< BT_MAP_DEGREES, BT_MAP_PLANE (of a projection), BT_MAP_LOCAL (of no place on the earth)
    double first, second; ///< longitude and latitude, rad; or east and north in the plane of the map, m
    const char *crs;      ///< of metres: of the projection, valid as long as the outlines, or BT_MAP_LOCAL_NAME
} bt_map_place;

/// By ice.origin_lon and ice.origin_lat; without them, that of the outlines or of the field file (NULL or all 0: none).
bt_map_place bt_map_place_of(const bt_outline_counts *counts, const bt_case *input);

/// The place of x = y = 0 is (lon, lat), rad.
void bt_map_set_degrees(bt_outline_counts *counts, double lon, double lat);

#endif
