// SPDX-License-Identifier: MIT
// Where x = y = 0 of a case lies on the earth, as far as its map or its keys say it.
#ifndef BT_MAP_PLACE_H
#define BT_MAP_PLACE_H

#include "bergtow/case.h"
#include "bergtow/field.h"
#include "field/map_crs.h"

/// Names of properties that come near to `thickness`, which is none of them; NULL ends them.
extern const char *const bt_map_near_thickness[];

#define BT_MAP_FARTHEST 100e3 ///< m from the origin: the projection is one of small areas

typedef struct bt_map_place {
    bt_map_kind kind;     ///< BT_MAP_DEGREES, BT_MAP_PLANE (of a projection), BT_MAP_LOCAL (of no place on the earth)
    double first, second; ///< longitude and latitude, rad; or east and north in the plane of the map, m
    const char *crs;      ///< of the projection, as long as the outlines are there; NULL of others
} bt_map_place;

/// The map from which the outlines came (NULL or all 0: there is none) goes before ice.origin_lon and ice.origin_lat.
bt_map_place bt_map_place_of(const bt_outline_counts *o, const bt_case *c);

#endif
