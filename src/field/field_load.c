// SPDX-License-Identifier: MIT
// The ice field of a case, made or read, and what is said of outlines that were read.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "bergtow/field.h"
#include "case/warning.h"
#include "case/ice_bounds.h"
#include "case/constraints.h"
#include "field/field_admit.h"
#include "field/field_make.h"
#include "field/map_crs.h"

/// The area that the file's concentration refers to, and that of the domain.
static void note_region(const bt_case *c, bt_field *f)
{
    bt_region y;
    bt_region_of_domain(&y, c);
    f->outlines.own_area = f->ice_area;
    f->outlines.region_area = y.ice_area;
    bt_region_free(&y);
}

bt_status bt_field_load(const bt_case *c, bt_field *f, bt_errors *err)
{
    if (c->ice.outlines) return bt_field_read_outlines(c, f, err);
    if (!c->ice.field) return bt_field_generate(c, f, err);
    const bt_status status = bt_field_read(f, c->ice.field, c->ice.nonconvex, err);
    if (status != BT_OK) return status;
    bt_refusals r = {.path = c->ice.field, .err = err, .status = BT_OK};
    char why[BT_ICE_WHY];
    note_region(c, f);
    if (*f->frame && strcmp(f->frame, bt_field_frame(c)))
        bt_refuse(&r,
                  "was made for domain.frame: %s, whose x and y would lie mirrored in this case's, %s; set "
                  "domain.frame: %s, or make the field for this frame",
                  f->frame, bt_field_frame(c), f->frame);
    else if (bt_ice_domain_fault(c, f, why)) bt_refuse(&r, "%s", why);
    else bt_field_check_apart(c, f, "floe", &r);
    if (r.status == BT_OK) return BT_OK;
    bt_field_free(f);
    bt_field_init(f);
    return r.status;
}

// --- messages --------------------------------------------------------------------------------------------------------

/// Ice and ice region that are not the same.
static void warn_of_region(const bt_outline_counts *o, bt_errors *warnings)
{
    if (o->outside)
        bt_warn(warnings, BT_WARN_ICE_OUTSIDE,
                "%lld of %lld floes lie outside the ice region (ice.x_min and so on): they are there, and the "
                "concentration, which refers to that region, leaves out %.4g m2 of ice outside it",
                (long long)o->outside, (long long)o->read, o->outside_area);
    if (o->own_area > 0 && o->region_area > 0 && fabs(o->own_area / o->region_area - 1) > 0.01)
        bt_warn(warnings, BT_WARN_OTHER_REGION,
                "ice.field: the concentration of the file refers to an ice region of %.6g m2, and the domain "
                "less the body has %.6g m2: it is not that of the domain",
                o->own_area, o->region_area);
}

static void warn_of_latitude(const bt_outline_counts *o, const bt_case *c, bt_errors *warnings)
{
    if (!o->read || !isfinite(o->lat) || c->domain.frame != BT_FRAME_GEOGRAPHIC) return; // a basin lies nowhere
    const double place = o->lat * 180 / BT_PI, lon = o->lon * 180 / BT_PI;
    if (isnan(c->ice.origin_lon) && place < 0 && lon >= 37 && lon <= 90)
        bt_warn(warnings, BT_WARN_LATITUDE_FIRST,
                "the outlines lie at latitude %.4g deg, longitude %.4g deg, in the south; if they are to lie in "
                "the north, latitude comes first in the file: write [longitude, latitude]",
                place, lon);
    const double given = c->water.latitude * 180 / BT_PI;
    if (given == 0 && fabs(place) > 1)
        bt_warn(warnings, BT_WARN_NO_LATITUDE,
                "the outlines lie at latitude %.4g deg, and without water.latitude there is no Coriolis force; "
                "set it to %.4g deg",
                place, place);
    else if (fabs(place - given) > 1)
        bt_warn(warnings, BT_WARN_OTHER_LATITUDE,
                "the outlines lie at latitude %.4g deg, and water.latitude is %.4g deg; correct one",
                place, given);
}

/// What a projection does to lengths and directions, by its scale at x = y = 0.
static void warn_of_plane(const bt_outline_counts *o, const bt_case *c, bt_errors *warnings)
{
    const bt_map_crs crs = bt_map_crs_of(o->crs);
    if (crs.kind != BT_MAP_PLANE) return;
    double along, across;
    bt_map_crs_scale(&crs, o->east, o->north, &along, &across);
    const bool turned = crs.any_north && c->domain.frame == BT_FRAME_GEOGRAPHIC;
    bt_warn(warnings, BT_WARN_GRID_PLANE,
            "the outlines are metres of %s, used as plane coordinates: its scale factor, at x = y = 0 %.4g along the "
            "meridian and %.4g across (areas %+.2g %%), and the angle of its north to the true one (convergence%s) are "
            "not corrected, as `bergtow outlines` does%s",
            crs.name, along, across, 100 * (along * across - 1),
            crs.any_north ? ", any angle in a polar projection" : "",
            turned ? "; x is the grid's north here: give wind, current and tow in that frame" : "");
}

void bt_outline_warn(const bt_outline_counts *o, const bt_case *c, bt_errors *warnings)
{
    if (o->unnamed)
        bt_warn(warnings, BT_WARN_NO_THICKNESS,
                "%lld of %lld outlines have no property `thickness` but %s, which is not read: they have the "
                "thickness of the case, %g m in the mean; rename the property if it is the thickness in metres",
                (long long)o->unnamed, (long long)o->read, o->nearly, c->ice.thickness);
    if (o->split && c->ice.rafting_kappa > 0)
        bt_warn(warnings, BT_WARN_STAYS_RIGID,
                "ice.rafting: %lld floes are not convex and made of convex parts: they stay rigid; "
                "ice.nonconvex: hull lets them raft, with their hulls' outlines",
                (long long)o->split);
    if (o->read && !o->bare && c->n_floes == 0 && bt_case_changed(c, "ice.thickness"))
        bt_warn(warnings, BT_WARN_THICKNESS_IDLE,
                "ice.thickness: no effect, for all outlines have a thickness of their own");
    warn_of_region(o, warnings);
    warn_of_latitude(o, c, warnings);
    warn_of_plane(o, c, warnings);
}
