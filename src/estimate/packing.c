// SPDX-License-Identifier: MIT
// Time at which the packed ice reaches the wall ahead; the balance is in packing.h.
#include "estimate/packing.h"
#include "case/warning.h"

#include <math.h>

#include "bergtow/shape.h"
#include "case/case_derived.h"
#include "case/case_tow.h"
#include "base/elementary.h"

static const double ALONG = 0.9; // least cosine between the tow and the axis of the domain it is taken to follow

/// Time at which the tow has gone so far, also beyond the end of the run; INFINITY if it never does.
static double time_of(const bt_case *c, double way)
{
    bt_case longer = *c;
    for (int k = 0; k < 20; k++, longer.run.duration *= 2)
        if (bt_case_tow_distance(c, longer.run.duration) >= way) return bt_case_tow_time(&longer, way);
    return INFINITY;
}

bt_packing bt_packing_of(const bt_case *c, double concentration)
{
    bt_packing p = {.time = NAN, .way = NAN, .packed = c->estimate.phi_j};
    double v[2 * BT_MAX_VERTICES];
    const int n = bt_case_waterline(c, v);
    const double ux = bt_cos(c->tow.direction), uy = bt_sin(c->tow.direction), yaw = c->body.yaw;
    const bool x = fabs(ux) >= fabs(uy);
    const bool wall = (x ? c->domain.ends : c->domain.sides) == BT_BOUND_WALL;
    if (!n || !wall || !(concentration > 0) || c->tow.mode == BT_TOW_NONE || c->tow.n_waypoints > 0 ||
        c->lead.mode != BT_LEAD_NONE)
        return p;
    if (fabs(x ? ux : uy) < ALONG) return p;
    // Along the axis s = x or y, in the sense of the tow: bow, wall, end of the ice.
    const double sign = (x ? ux : uy) > 0 ? 1 : -1, at = x ? c->body.x : c->body.y;
    double bow = -INFINITY;
    for (int i = 0; i < n; i++) {
        const double wx = bt_cos(yaw) * v[2 * i] - bt_sin(yaw) * v[2 * i + 1],
                     wy = bt_sin(yaw) * v[2 * i] + bt_cos(yaw) * v[2 * i + 1];
        bow = bt_max(bow, sign * (at + (x ? wx : wy)));
    }
    const double low = x ? c->domain.x0 : c->domain.y0, length = x ? c->domain.length : c->domain.width,
                 W = x ? c->domain.width : c->domain.length;
    double ice_low[2], ice_high[2];
    bt_case_ice_region(c, ice_low, ice_high);
    const double L = (sign > 0 ? low + length : -low) - bow,
                 ice = bt_min(L, bt_max(0, (sign > 0 ? ice_high[!x] : -ice_low[!x]) - bow));
    const double ahead = c->tow.direction - yaw, b = bt_min(W, bt_shape_width(n, v, bt_cos(ahead), bt_sin(ahead)));
    const double room = W * (p.packed * L - concentration * ice), taken = p.packed * W - concentration * (W - b);
    p.way = room <= 0 ? 0 : room / taken;
    if (!(p.way <= L)) return (bt_packing){NAN, NAN, p.packed}; // the body is there first
    p.time = p.way > 0 ? time_of(c, p.way / fabs(x ? ux : uy)) : 0;
    return p;
}

void bt_packing_warn(const bt_packing *p, double end, bt_errors *warnings)
{
    if (!(end > BT_PACKING_EARLY * p->time)) return;
    if (p->time == 0)
        bt_warn(warnings, BT_WARN_PACKED_AT_START,
                "domain.length: ice as dense as this (estimate.phi_j %g) is packed up to the wall ahead from the "
                "start: the resistance is also a property of "
                "the domain's length; take domain.ends: open, periodic or moving where no wall is meant",
                p->packed);
    else
        bt_warn(warnings, BT_WARN_PACKED,
                "domain.length: the packed ice ahead reaches the wall at about %.3g s, %.3g s at the earliest "
                "(estimate: the ice of the body's track, packed to "
                "%g over the width of the domain), and the end is at %g s: from then on the resistance is also a "
                "property of the domain's length; end the run before, "
                "or take a longer domain",
                p->time, BT_PACKING_EARLY * p->time, p->packed, end);
}
