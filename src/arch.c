// SPDX-License-Identifier: MIT
// Width of the domain against body, floes and arches; the rule is in arch.h.
#include "arch.h"

#include <math.h>

#include "bergtow/shape.h"

bt_arch bt_arch_of(const bt_case *c, double concentration, double floe_size)
{
    double v[2 * BT_MAX_VERTICES];
    const int n = bt_case_waterline(c, v);
    // The tow goes along the domain, more or less: what stands at the sides is across it.
    const double ahead = c->tow.direction - c->body.yaw, across = n ? bt_shape_width(n, v, cos(ahead), sin(ahead)) : NAN;
    const bool open = c->domain.sides == BT_BOUND_OPEN;
    bt_arch a = {.bodies = c->domain.width / across, .floes = floe_size > 0 ? c->domain.width / floe_size : NAN};
    a.sides = open ? "open sides" : c->domain.sides == BT_BOUND_PERIODIC ? "periodic images" : "walls";
    a.possible = !open && n > 0 && floe_size > 0 && concentration >= BT_ARCH_CONCENTRATION && a.bodies < BT_ARCH_WIDTHS;
    return a;
}
