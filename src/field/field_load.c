// SPDX-License-Identifier: MIT
// The ice field of a case, generated or read, and the warnings about outlines that were read.
#include <math.h>
#include <string.h>

#include "bergtow/field.h"
#include "base/inside.h"
#include "case/case_derived.h"
#include "case/warning.h"
#include "case/ice_bounds.h"
#include "case/case_check.h"
#include "case/case_derived.h"
#include "field/field_admit.h"
#include "field/field_make.h"
#include "field/map_crs.h"

/// Note the area that the file's concentration refers to, the ice area of the domain, and the place that the case
/// gives instead of that of the file.
static void note_case(const bt_case *input, bt_field *field)
{
    bt_region region;
    bt_region_of_domain(&region, input);
    field->outlines.own_area = field->ice_area;
    field->outlines.region_area = region.ice_area;
    bt_region_free(&region);
    if (!isnan(input->ice.origin_lon))
        bt_map_set_degrees(&field->outlines, input->ice.origin_lon, input->ice.origin_lat);
}

bt_status bt_field_load(const bt_case *input, bt_field *field, bt_errors *err)
{
    BT_PLAIN_NUMBERS;
    if (input->ice.outlines) return bt_field_read_outlines(input, field, err);
    if (!input->ice.field) return bt_field_generate(input, field, err);
    const bt_status status = bt_field_read(field, input->ice.field, input->ice.nonconvex, err);
    if (status != BT_OK) return status;
    bt_refusals refusals = {.path = input->ice.field, .err = err, .status = BT_OK};
    char why[BT_ICE_WHY];
    const bt_map_crs crs = bt_map_crs_of(field->outlines.crs);
    note_case(input, field);
    if (crs.kind == BT_MAP_PLANE && !isnan(input->ice.origin_lon)) // nor are outlines in metres read with these keys
        bt_refuse(&refusals,
                  "its coordinates are metres of %s, whose north is not that of longitude and latitude, but "
                  "ice.origin_lon and ice.origin_lat are degrees; remove them: the file has its place",
                  crs.name);
    else if (*field->frame && strcmp(field->frame, bt_field_frame(input)))
        bt_refuse(&refusals,
                  "was made for domain.frame: %s, whose x and y would be mirrored in the frame of this case, %s; set "
                  "domain.frame: %s, or make the field for this frame",
                  field->frame, bt_field_frame(input), field->frame);
    else if (bt_ice_domain_fault(input, field, why)) bt_refuse(&refusals, "%s", why);
    else bt_field_check_apart(input, field, "floe", &refusals);
    if (refusals.status == BT_OK) return BT_OK;
    bt_field_free(field);
    bt_field_init(field);
    return refusals.status;
}

// --- messages --------------------------------------------------------------------------------------------------------

/// Keys that cut the ice region of a case to where the ice that was read ends, "ice.x_max: 339 m, ..."; "" = none.
static void keys_of_end(const bt_case *input, const double region[4], char out[160])
{
    static const char *const names[4] = {"x_min", "y_min", "x_max", "y_max"};
    double own[4];
    bt_case_ice_region(input, own, own + 2);
    *out = 0;
    for (int k = 0; k < 4; k++) {
        const size_t n = strlen(out);
        if (k < 2 ? region[k] > own[k] : region[k] < own[k])
            snprintf(out + n, 160 - n, "%sice.%s: %.6g m", n ? ", " : "", names[k], region[k]);
    }
}

/// A map that ends within the ice region to which its concentration refers. Rejected: the box as the region's default,
/// which would change the concentration of recorded cases, and tell a typed default from one left out.
static void warn_of_end(const bt_outline_counts *counts, const bt_case *input, bt_errors *warnings)
{
    const double *r = bt_outline_region(counts);
    char keys[160];
    if (!r || !(counts->read || counts->own_area > (r[2] - r[0]) * (r[3] - r[1]))) return;
    keys_of_end(input, r, keys);
    if (*keys)
        bt_warn(warnings, BT_WARN_MAP_ENDS,
                "the map of the ice reaches only from x = %.6g to %.6g m and y = %.6g to %.6g m: what lies beyond is "
                "unknown, but counts as open water, in the concentration, too; %s %s, or use a smaller domain",
                r[0], r[2], r[1], r[3], counts->read ? "set" : "make the field with", keys);
}

/// Ice that does not match the ice region.
static void warn_of_region(const bt_outline_counts *counts, const bt_case *input, bt_errors *warnings)
{
    if (counts->outside)
        bt_warn(warnings, BT_WARN_ICE_OUTSIDE,
                "%lld of %lld floes lie outside the ice region (ice.x_min and so on): they take part, but the "
                "concentration refers to that region and omits %.4g m2 of ice outside it",
                (long long)counts->outside, (long long)counts->read, counts->outside_area);
    if (counts->own_area > 0 && counts->region_area > 0 && fabs(counts->own_area / counts->region_area - 1) > 0.01)
        bt_warn(warnings, BT_WARN_OTHER_REGION,
                "ice.field: the concentration of the file refers to an ice region of %.6g m2, but the domain without "
                "the body has %.6g m2: it is not that of the domain",
                counts->own_area, counts->region_area);
    else warn_of_end(counts, input, warnings);
}

/// Latitude of the place of the ice, rad; NaN if unknown.
static double latitude_of(const bt_map_place *place)
{
    if (place->kind == BT_MAP_DEGREES) return place->second;
    if (place->kind != BT_MAP_PLANE) return NAN;
    const bt_map_crs crs = bt_map_crs_of(place->crs);
    return bt_map_crs_latitude(&crs, place->first, place->second);
}

static void warn_of_latitude(const bt_map_place *map, const bt_case *input, bt_errors *warnings)
{
    const double place = latitude_of(map) * 180 / BT_PI, lon = map->first * 180 / BT_PI;
    // a basin has no geographic position
    if (isnan(place) || input->domain.frame != BT_FRAME_GEOGRAPHIC) return;
    if (map->kind == BT_MAP_DEGREES && isnan(input->ice.origin_lon) && place < 0 && lon >= 37 && lon <= 90)
        bt_warn(warnings, BT_WARN_LATITUDE_FIRST,
                "the ice lies at latitude %.4g deg, longitude %.4g deg, in the south; if it should lie in the "
                "north, latitude comes first in the file: write [longitude, latitude]",
                place, lon);
    const double given = input->water.latitude * 180 / BT_PI;
    if (given == 0 && fabs(place) > 1)
        bt_warn(warnings, BT_WARN_NO_LATITUDE,
                "the ice lies at latitude %.4g deg, but without water.latitude there is no Coriolis force; set it to "
                "%.4g deg",
                place, place);
    else if (fabs(place - given) > 1)
        bt_warn(warnings, BT_WARN_OTHER_LATITUDE,
                "the ice lies at latitude %.4g deg, but water.latitude is %.4g deg; correct one", place, given);
}

/// Distortion of lengths and directions by a projection, from its scale at x = y = 0.
static void warn_of_plane(const bt_map_place *place, const bt_case *input, bt_errors *warnings)
{
    if (place->kind != BT_MAP_PLANE) return;
    const bt_map_crs crs = bt_map_crs_of(place->crs);
    double along, across;
    bt_map_crs_scale(&crs, place->first, place->second, &along, &across);
    const bool turned = crs.any_north && input->domain.frame == BT_FRAME_GEOGRAPHIC;
    bt_warn(warnings, BT_WARN_GRID_PLANE,
            "the floes are in metres of %s, used as plane coordinates. Its scale factor (at x = y = 0 %.4g along "
            "the meridian and %.4g across, areas %+.2g %%) and the angle of its north to true north (convergence%s) "
            "are not corrected; `bergtow outlines` corrects them%s",
            crs.name, along, across, 100 * (along * across - 1),
            crs.any_north ? ", any angle in a polar projection" : "",
            turned ? "; x is the grid's north here: give wind, current and tow in that frame" : "");
}

void bt_outline_warn(const bt_outline_counts *counts, const bt_case *input, bt_errors *warnings)
{
    BT_PLAIN_NUMBERS;
    if (counts->unnamed)
        bt_warn(warnings, BT_WARN_NO_THICKNESS,
                "%lld of %lld outlines have no property `thickness`, but some have %s, which is not read: they have "
                "the thickness of the case, %g m on average; rename the property if it is the thickness in metres",
                (long long)counts->bare, (long long)counts->read, counts->nearly, input->ice.thickness);
    else if (counts->bare && counts->bare < counts->read) // if none has one, that of the case is meant
        bt_warn(warnings, BT_WARN_NO_THICKNESS,
                "%lld of %lld outlines have no property `thickness`%s: they have the thickness of the case, %g m on "
                "average",
                (long long)counts->bare, (long long)counts->read, "", input->ice.thickness);
    const int64_t by_hand = bt_case_nonconvex_by_hand(input);
    if (counts->split + by_hand > 0 && input->ice.rafting_kappa > 0)
        bt_warn(warnings, BT_WARN_STAYS_RIGID,
                "ice.rafting: %lld floes are not convex and consist of convex parts: they stay rigid%s%s",
                (long long)(counts->split + by_hand),
                counts->split ? "; ice.nonconvex: hull lets those that are read raft, with their hulls' outlines" : "",
                by_hand ? "; floes by hand raft if their vertices are a convex outline" : "");
    if (counts->read && !counts->bare && input->n_floes == 0 && bt_case_changed(input, "ice.thickness"))
        bt_warn(warnings, BT_WARN_THICKNESS_IDLE,
                "ice.thickness: no effect, because all outlines have their own thickness");
    if (*counts->chart)
        bt_warn(warnings, BT_WARN_ICE_CHART,
                "%s: as of an ice chart, whose polygons are regions, of water and land, too, not floes: each became a "
                "floe of 100 %%; use outlines of single floes",
                counts->chart);
    warn_of_region(counts, input, warnings);
    if (!*counts->crs) return; // nothing of a map was read
    const bt_map_place place = bt_map_place_of(counts, input);
    warn_of_latitude(&place, input, warnings);
    warn_of_plane(&place, input, warnings);
}
