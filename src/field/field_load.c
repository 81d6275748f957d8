// SPDX-License-Identifier: MIT
// The ice field of a case, made or read, and what is said of outlines that were read.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "bergtow/field.h"
#include "case/ice_bounds.h"
#include "field/field_admit.h"
#include "field/map_crs.h"

bt_status bt_field_load(const bt_case *c, bt_field *f, bt_errors *err)
{
    if (c->ice.outlines) return bt_field_read_outlines(c, f, err);
    if (!c->ice.field) return bt_field_generate(c, f, err);
    const bt_status status = bt_field_read(f, c->ice.field, c->ice.nonconvex, err);
    if (status != BT_OK) return status;
    bt_refusals r = {.path = c->ice.field, .err = err, .status = BT_OK};
    char why[BT_ICE_WHY];
    if (bt_ice_domain_fault(c, f, why)) bt_refuse(&r, "%s", why);
    else bt_field_check_apart(c, f, "floe", &r);
    if (r.status == BT_OK) return BT_OK;
    bt_field_free(f);
    bt_field_init(f);
    return r.status;
}

// --- messages --------------------------------------------------------------------------------------------------------

void bt_outline_warn(const bt_outline_counts *o, const bt_case *c, bt_errors *warnings)
{
    if (o->unnamed)
        bt_errors_add(warnings,
                      "%lld of %lld outlines have no property `thickness` but %s, which is not read: they have the "
                      "thickness of the case, %g m in the mean; rename the property if it is "
                      "the thickness in metres",
                      (long long)o->unnamed, (long long)o->read, o->nearly, c->ice.thickness);
    if (o->split && c->ice.rafting_kappa > 0)
        bt_errors_add(warnings,
                      "ice.rafting: %lld floes are not convex and made of convex parts: they stay rigid; "
                      "ice.nonconvex: hull lets them raft, with their hulls' outlines",
                      (long long)o->split);
    const bt_map_crs crs = bt_map_crs_of(o->crs);
    if (crs.kind != BT_MAP_PLANE) return;
    const bool turned = crs.any_north && c->domain.frame == BT_FRAME_GEOGRAPHIC;
    bt_errors_add(
        warnings,
        "the outlines are metres of %s, used as plane coordinates: its scale factor and the angle of its north to the "
        "true one (convergence%s) are not corrected%s",
        crs.name, crs.any_north ? ", any angle in a polar projection" : "",
        turned ? "; x is the grid's north here: give wind, current and tow in that frame, or the file in degrees" : "");
}
