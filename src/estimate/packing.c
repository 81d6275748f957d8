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

/// Time at which the tow has covered this distance, also beyond the end of the run; INFINITY if it never does.
static double time_of(const bt_case *input, double way)
{
    bt_case longer = *input;
    for (int k = 0; k < 20; k++, longer.run.duration *= 2)
        if (bt_case_tow_distance(input, longer.run.duration) >= way) return bt_case_tow_time(&longer, way);
    return INFINITY;
}

bt_packing bt_packing_of(const bt_case *input, double concentration)
{
    bt_packing packing = {.time = NAN, .way = NAN, .packed = input->estimate.phi_j};
    double v[2 * BT_MAX_VERTICES];
    const int n = bt_case_waterline(input, v);
    const double ux = bt_cos(input->tow.direction), uy = bt_sin(input->tow.direction), yaw = input->body.yaw;
    const bool x = fabs(ux) >= fabs(uy);
    const bool wall = (x ? input->domain.ends : input->domain.sides) == BT_BOUND_WALL;
    if (!n || !wall || !(concentration > 0) || input->tow.mode == BT_TOW_NONE || input->tow.n_waypoints > 0 ||
        input->lead.mode != BT_LEAD_NONE)
        return packing;
    if (fabs(x ? ux : uy) < ALONG) return packing;
    // Along the axis s = x or y, in the sense of the tow: bow, wall, end of the ice.
    const double sign = (x ? ux : uy) > 0 ? 1 : -1, at = x ? input->body.x : input->body.y;
    double bow = -INFINITY;
    for (int i = 0; i < n; i++) {
        const double wx = bt_cos(yaw) * v[2 * i] - bt_sin(yaw) * v[2 * i + 1],
                     wy = bt_sin(yaw) * v[2 * i] + bt_cos(yaw) * v[2 * i + 1];
        bow = bt_max(bow, sign * (at + (x ? wx : wy)));
    }
    const double low = x ? input->domain.x0 : input->domain.y0, length = x ? input->domain.length : input->domain.width,
                 W = x ? input->domain.width : input->domain.length;
    double ice_low[2], ice_high[2];
    bt_case_ice_region(input, ice_low, ice_high);
    const double L = (sign > 0 ? low + length : -low) - bow,
                 ice = bt_min(L, bt_max(0, (sign > 0 ? ice_high[!x] : -ice_low[!x]) - bow));
    const double ahead = input->tow.direction - yaw, b = bt_min(W, bt_shape_width(n, v, bt_cos(ahead), bt_sin(ahead)));
    const double room = W * (packing.packed * L - concentration * ice),
                 taken = packing.packed * W - concentration * (W - b);
    packing.way = room <= 0 ? 0 : room / taken;
    if (!(packing.way <= L)) return (bt_packing){NAN, NAN, packing.packed}; // the body reaches it first
    packing.time = packing.way > 0 ? time_of(input, packing.way / fabs(x ? ux : uy)) : 0;
    return packing;
}

void bt_packing_warn(const bt_packing *packing, double end, bt_errors *warnings)
{
    if (!(end > BT_PACKING_EARLY * packing->time)) return;
    if (packing->time == 0)
        bt_warn(warnings, BT_WARN_PACKED_AT_START,
                "domain.length: ice as dense as this (estimate.phi_j %g) is packed up to the wall ahead from the "
                "start: the resistance also depends on the length of the domain; set domain.ends: open, periodic or "
                "moving if no wall is intended",
                packing->packed);
    else
        bt_warn(warnings, BT_WARN_PACKED,
                "domain.length: the packed ice ahead reaches the wall at about %.3g s, %.3g s at the earliest "
                "(estimate: the ice of the body's track, packed to %g over the width of the domain), and the run ends "
                "at %g s: from then on the resistance also depends on the length of the domain; end the run earlier, "
                "or use a longer domain",
                packing->time, BT_PACKING_EARLY * packing->time, packing->packed, end);
}
