// SPDX-License-Identifier: MIT
// Recognise coordinate reference systems by name, as degrees or as metres east and north, without a projection library.
//
// GeoJSON has longitude before latitude and east before north, whatever order the registry gives to the axes of a
// system [RFC 7946, 3.1.1; GeoJSON 2008, 2.1.1], so an EPSG code says what the two numbers are, but not their order.
// Degrees on WGS84, ETRS89 and NAD83 are treated as the same: they differ by less than 3 m, equally at all places.
// Metres of a projection are used as plane coordinates, not corrected for its scale (UTM: 0.9996 to 1.001 within its
// zone; polar: 0.97 to 1.04 north of 65°) nor for the angle between grid north and true north (convergence; UTM: up to
// 3°, polar: any). Mercator is refused: at 76° its metre is a quarter of a metre on the ground. Codes: EPSG registry.
#include "field/map_crs.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "bergtow/base.h"
#include "base/elementary.h"

static const double EARTH = 6371e3; // m, mean radius
#define UPS_LATITUDE 81.1145 // deg, latitude of true scale if the scale at the pole is 0.994

static const struct {
    int first, last;
    bt_map_kind kind;
    bool any_north, south;
    double true_lat, offset; // of a polar projection
} known[] = {
    {4326, 4326, BT_MAP_DEGREES, false, false, 0, 0}, // WGS 84
    {4979, 4979, BT_MAP_DEGREES, false, false, 0, 0}, // the same with a height
    {4258, 4258, BT_MAP_DEGREES, false, false, 0, 0}, // ETRS89
    {4937, 4937, BT_MAP_DEGREES, false, false, 0, 0}, // the same with a height
    {4269, 4269, BT_MAP_DEGREES, false, false, 0, 0}, // NAD83
    {4617, 4617, BT_MAP_DEGREES, false, false, 0, 0}, // NAD83 (CSRS)
    {32601, 32660, BT_MAP_PLANE, false, false, 0, 0}, // UTM north, WGS 84
    {32701, 32760, BT_MAP_PLANE, false, true, 0, 0}, // UTM south
    {25828, 25838, BT_MAP_PLANE, false, false, 0, 0}, // UTM, ETRS89
    {26901, 26923, BT_MAP_PLANE, false, false, 0, 0}, // UTM, NAD83
    {3411, 3411, BT_MAP_PLANE, true, false, 70, 0}, // NSIDC sea ice polar stereographic north, Hughes
    {3412, 3412, BT_MAP_PLANE, true, true, 70, 0}, // the same, south
    {3413, 3413, BT_MAP_PLANE, true, false, 70, 0}, // the same, north, WGS 84
    {3976, 3976, BT_MAP_PLANE, true, true, 70, 0}, // the same, south, WGS 84
    {3031, 3031, BT_MAP_PLANE, true, true, 71, 0}, // Antarctic polar stereographic
    {3995, 3995, BT_MAP_PLANE, true, false, 71, 0}, // Arctic polar stereographic
    {3996, 3996, BT_MAP_PLANE, true, false, 75, 0}, // IBCAO
    {5041, 5041, BT_MAP_PLANE, true, false, UPS_LATITUDE, 2e6}, // UPS north
    {5042, 5042, BT_MAP_PLANE, true, true, UPS_LATITUDE, 2e6}, // UPS south
    {32661, 32661, BT_MAP_PLANE, true, false, UPS_LATITUDE, 2e6}, // UPS north, other order of axes in the registry
    {32761, 32761, BT_MAP_PLANE, true, true, UPS_LATITUDE, 2e6}, // UPS south
    {5936, 5940, BT_MAP_PLANE, true, false, UPS_LATITUDE, 2e6}, // Arctic: Alaska, Canada, Greenland, Norway, Russia
    {3571, 3576, BT_MAP_PLANE, true, false, 0, 0}, // north pole Lambert azimuthal equal-area, six meridians
    {6931, 6931, BT_MAP_PLANE, true, false, 0, 0}, // EASE-Grid 2.0 north
    {6932, 6932, BT_MAP_PLANE, true, true, 0, 0}, // EASE-Grid 2.0 south
    {3857, 3857, BT_MAP_WARPED, false, false, 0, 0}, // Pseudo-Mercator of web maps
    {3395, 3395, BT_MAP_WARPED, false, false, 0, 0}, // World Mercator
    {3785, 3785, BT_MAP_WARPED, false, false, 0, 0}, // Pseudo-Mercator, withdrawn
    {900913, 900913, BT_MAP_WARPED, false, false, 0, 0}, // the same, before it had a code
};

/// The part after the last ':' or '/'.
static const char *last_word(const char *name)
{
    const char *last = name;
    for (const char *s = name; *s; s++)
        if (*s == ':' || *s == '/') last = s + 1;
    return last;
}

static bool holds(const char *name, const char *word)
{
    for (; *name; name++)
        if (!strncasecmp(name, word, strlen(word))) return true;
    return false;
}

bt_map_crs bt_map_crs_of(const char *name)
{
    bt_map_crs crs = {.kind = BT_MAP_UNKNOWN};
    const char *word = last_word(name);
    snprintf(crs.name, sizeof crs.name, "%.31s", name);
    if (!strcmp(name, BT_MAP_LOCAL_NAME)) {
        crs.kind = BT_MAP_LOCAL;
        snprintf(crs.name, sizeof crs.name, "local");
    } else if (!strcasecmp(word, "CRS84") || !strcasecmp(word, "CRS84h") || !strcasecmp(word, "CRS83")) {
        crs.kind = BT_MAP_DEGREES;
        snprintf(crs.name, sizeof crs.name, "OGC:CRS%s", word + 3);
    } else if (holds(name, "EPSG") && *word && strlen(word) <= 6 && strspn(word, "0123456789") == strlen(word)) {
        const int code = atoi(word);
        snprintf(crs.name, sizeof crs.name, "EPSG:%d", code);
        for (size_t i = 0; i < sizeof known / sizeof *known; i++)
            if (code >= known[i].first && code <= known[i].last)
                crs.kind = known[i].kind, crs.any_north = known[i].any_north, crs.south = known[i].south,
                crs.true_lat = known[i].true_lat, crs.offset = known[i].offset;
    }
    return crs;
}

void bt_map_crs_scale(const bt_map_crs *crs, double east, double north, double *along, double *across)
{
    if (!crs->any_north) { // UTM: scale 0.9996 on the central meridian
        const double from = (east - 500e3) / (0.9996 * EARTH);
        *along = *across = 0.9996 * (1 + from * from / 2);
        return;
    }
    const double rho = bt_hypot(east - crs->offset, north - crs->offset);
    if (crs->true_lat > 0) { // stereographic: rho = R (1 + sin true_lat) tan(c/2), c from the pole
        const double pole = (1 + bt_sin(crs->true_lat * BT_PI / 180)) / 2, t = rho / (2 * EARTH * pole);
        *along = *across = pole * (1 + t * t);
    } else { // equal areas: rho = 2 R sin(c/2)
        const double half = bt_min(rho / (2 * EARTH), 0.999);
        *along = sqrt(1 - half * half);
        *across = 1 / *along;
    }
}

double bt_map_crs_latitude(const bt_map_crs *crs, double east, double north)
{
    // On the sphere from which each kind of projection starts; then its latitude there, less that on the ellipsoid, is
    // -part e² sin(2 lat) [Snyder 1987, 3-5, 3-18, 3-26, to first order in e²].
    const double ecc2 = 6.694e-3, axis = 6378.1e3;
    double lat, part;
    if (!crs->any_north) { // transverse Mercator, northings from the equator, in the south less 10,000 km
        const double along = (north - 1e7 * crs->south) / (0.9996 * 6367.4e3), off = (east - 500e3) / (0.9996 * axis);
        const double cosh_off = (bt_exp(off) + bt_exp(-off)) / 2, sine = bt_sin(along) / cosh_off;
        lat = bt_atan2(sine, sqrt(1 - sine * sine)), part = 3. / 8;
        return lat + part * ecc2 * bt_sin(2 * lat);
    }
    const double rho = bt_hypot(east - crs->offset, north - crs->offset);
    if (crs->true_lat > 0) { // stereographic
        const double exact = crs->true_lat * BT_PI / 180, given = exact - ecc2 / 2 * bt_sin(2 * exact);
        const double sine = bt_sin(exact), circle = axis * bt_cos(exact) / sqrt(1 - ecc2 * sine * sine);
        lat = BT_PI / 2 - 2 * bt_atan2(rho * bt_tan(BT_PI / 4 - given / 2), circle), part = 1. / 2;
    } else { // equal areas: rho = 2 R sin(c/2)
        const double half = bt_min(rho / (2 * EARTH), 1);
        lat = BT_PI / 2 - 2 * bt_atan2(half, sqrt(1 - half * half)), part = 1. / 3;
    }
    lat += part * ecc2 * bt_sin(2 * lat);
    return crs->south ? -lat : lat;
}

// --- places ----------------------------------------------------------------------------------------------------------

// Where x = y = 0 of a case lies on the earth: map_crs.h.

bt_map_place bt_map_place_of(const bt_outline_counts *counts, const bt_case *input)
{
    const bool map = counts && *counts->crs;
    const bool plane = map && isfinite(counts->east);
    if (!isnan(input->ice.origin_lon))
        return (bt_map_place){BT_MAP_DEGREES, input->ice.origin_lon, input->ice.origin_lat, NULL};
    if (map && isfinite(counts->lon)) return (bt_map_place){BT_MAP_DEGREES, counts->lon, counts->lat, NULL};
    if (map && bt_map_crs_of(counts->crs).kind == BT_MAP_PLANE)
        return (bt_map_place){BT_MAP_PLANE, plane ? counts->east : 0, plane ? counts->north : 0, counts->crs};
    return (bt_map_place){BT_MAP_LOCAL, plane ? counts->east : 0, plane ? counts->north : 0, BT_MAP_LOCAL_NAME};
}

void bt_map_set_degrees(bt_outline_counts *counts, double lon, double lat)
{
    snprintf(counts->crs, sizeof counts->crs, "OGC:CRS84");
    counts->lon = lon, counts->lat = lat;
    counts->east = counts->north = NAN;
}
