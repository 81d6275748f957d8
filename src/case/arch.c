// SPDX-License-Identifier: MIT
// Width of the domain against body, floes and arches; the rule is in arch.h.
#include "case/arch.h"

#include <math.h>

#include "bergtow/shape.h"

bt_arch bt_arch_of(const bt_case *c, double concentration, double floe_size)
{
    double v[2 * BT_MAX_VERTICES];
    const int n = bt_case_waterline(c, v);
    // The tow goes along the domain, more or less: what stands at the sides is across it.
    const double ahead = c->tow.direction - c->body.yaw,
                 across = n ? bt_shape_width(n, v, cos(ahead), sin(ahead)) : NAN;
    const bool open = c->domain.sides == BT_BOUND_OPEN;
    bt_arch a = {.concentration = concentration,
                 .bodies = c->domain.width / across,
                 .floes = floe_size > 0 ? c->domain.width / floe_size : NAN};
    a.sides = open ? "open sides" : c->domain.sides == BT_BOUND_PERIODIC ? "periodic images" : "walls";
    a.possible = !open && n > 0 && floe_size > 0 && concentration >= BT_ARCH_CONCENTRATION && a.bodies < BT_ARCH_WIDTHS;
    return a;
}

void bt_arch_warn(const bt_arch *a, bt_errors *warnings)
{
    if (a->possible)
        bt_errors_add(warnings,
                      "domain.width: %.3g body widths of %.0f %% ice, and %s can carry arches of rigid floes: the "
                      "resistance is also a property of "
                      "that width; take at least %g body widths (assumed), or compare widths",
                      a->bodies, 100 * a->concentration, a->sides, BT_ARCH_WIDTHS);
}
