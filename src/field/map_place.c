// SPDX-License-Identifier: MIT
// Where x = y = 0 of a case lies on the earth: map_place.h.
#include "field/map_place.h"

#include <math.h>

bt_map_place bt_map_place_of(const bt_outline_counts *o, const bt_case *c)
{
    const bool read = o && o->read;
    const bool plane = read && isfinite(o->east);
    if (read && isfinite(o->lon)) return (bt_map_place){BT_MAP_DEGREES, o->lon, o->lat, NULL};
    if (read && bt_map_crs_of(o->crs).kind == BT_MAP_PLANE)
        return (bt_map_place){BT_MAP_PLANE, plane ? o->east : 0, plane ? o->north : 0, o->crs};
    if (!isnan(c->ice.origin_lon)) return (bt_map_place){BT_MAP_DEGREES, c->ice.origin_lon, c->ice.origin_lat, NULL};
    return (bt_map_place){BT_MAP_LOCAL, plane ? o->east : 0, plane ? o->north : 0, NULL};
}
