// SPDX-License-Identifier: MIT
// How the world lies on what is drawn of it elsewhere; what for: map_axes.h.
//
// Programs that draw hold coordinates in single precision, 24 bits. At a northing of 8,676 km that leaves steps of 1 m,
// and floes of 0.4 m have no area. So the origin is the middle of the domain, rounded towards 0 to the least power of
// ten that is no less than the domain: 0, 0 for most cases, and never farther from the ice than ten domains, where a
// step is below a millionth of the domain.
#include "output/map_axes.h"

#include <math.h>
#include <stdio.h>

#include "base/elementary.h"
#include "field/map_crs.h"
#include "field/map_place.h"

static double rounded(double middle, double extent)
{
    double unit = 1;
    if (!(extent > 0)) return 0;
    while (unit < extent) unit *= 10;
    while (unit >= 10 * extent) unit /= 10;
    return trunc(middle / unit) * unit;
}

bt_map_axes bt_map_axes_of(const bt_case *c, const bt_outline_counts *o)
{
    const double extent = bt_max(c->domain.length, c->domain.width);
    bt_map_axes a = {.swapped = c->domain.frame == BT_FRAME_GEOGRAPHIC,
                     .origin = {rounded(c->domain.x0 + c->domain.length / 2, extent),
                                rounded(c->domain.y0 + c->domain.width / 2, extent)}};
    const bt_map_place p = bt_map_place_of(o, c);
    const double degree = BT_PI / 180;
    if (p.kind == BT_MAP_DEGREES)
        snprintf(a.crs, sizeof a.crs, "+proj=aeqd +lat_0=%.12g +lon_0=%.12g +datum=WGS84 +units=m", p.second / degree,
                 p.first / degree);
    else if (p.kind == BT_MAP_PLANE) snprintf(a.crs, sizeof a.crs, "%s", p.crs);
    bt_map_axes_point(&(bt_map_axes){.swapped = a.swapped}, a.origin[0], a.origin[1], a.crs_place);
    if (p.kind == BT_MAP_PLANE) a.crs_place[0] += p.first, a.crs_place[1] += p.second;
    return a;
}
