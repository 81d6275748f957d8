// SPDX-License-Identifier: MIT
// Width of the domain against body, floes and arches, and what bounds their load; the rules are in arch.h.
#include "case/arch.h"

#include <math.h>

#include "bergtow/shape.h"
#include "base/elementary.h"
#include "case/case_check.h"

/// Body widths that ice from this concentration on needs.
static const struct { double concentration, widths; } asked[] = {{0.45, 10}, {0.7, 30}, {0.85, 60}};

/// δ of arch.h, from this concentration on.
static const struct { double concentration, slack; } locked[] = {{0.9, 0.0095}, {0.95, 0.003}};

/// Ice as made misses the concentration asked for in the last digits, and what is printed as 90 % has the rule of 90 %.
static bool reaches(double concentration, double limit) { return concentration >= limit - 0.005; }

bt_arch bt_arch_of(const bt_case *c, double concentration, double floe_size)
{
    double v[2 * BT_MAX_VERTICES];
    const int n = bt_case_waterline(c, v);
    // The tow goes along the domain, more or less: what stands at the sides is across it.
    const double ahead = c->tow.direction - c->body.yaw,
                 across = n ? bt_shape_width(n, v, bt_cos(ahead), bt_sin(ahead)) : NAN;
    const bool open = c->domain.sides == BT_BOUND_OPEN;
    bt_arch a = {.concentration = concentration,
                 .bodies = c->domain.width / across,
                 .floes = floe_size > 0 ? c->domain.width / floe_size : NAN};
    a.sides = open ? "open sides" : c->domain.sides == BT_BOUND_PERIODIC ? "periodic images" : "walls";
    const bool beside = n > 0 && floe_size > 0; // ice beside a body
    a.needed = NAN;
    for (size_t k = 0; beside && !open && k < sizeof asked / sizeof *asked; k++)
        if (reaches(concentration, asked[k].concentration)) a.needed = asked[k].widths;
    const double way = c->tow.mode == BT_TOW_NONE ? 0 : bt_case_tow_distance(c, c->run.duration);
    for (size_t k = 0; k < sizeof locked / sizeof *locked; k++)
        if (a.needed > 0 && way > 0 && reaches(concentration, locked[k].concentration))
            a.needed = bt_max(a.needed, ceil(2 * sqrt(way / (BT_PI * locked[k].slack * across))));
    a.possible = a.bodies < a.needed;
    a.rigid = !(c->ice.rafting_kappa > 0) && !(c->ice.crushing_pressure > 0);
    a.unbounded = a.rigid && beside && reaches(concentration, BT_BOUND_CONCENTRATION);
    return a;
}

const char *bt_arch_floes(const bt_arch *a) { return a->rigid ? "rigid floes" : "floes"; }

void bt_arch_warn(const bt_arch *a, bt_errors *warnings)
{
    if (a->possible)
        bt_errors_add(warnings,
                      "domain.width: %.3g body widths of %.0f %% ice, and %s can carry arches of %s: the "
                      "resistance is also a property of "
                      "that width; take at least %g body widths (assumed), or compare widths",
                      a->bodies, 100 * a->concentration, a->sides, bt_arch_floes(a), a->needed);
    if (a->unbounded)
        bt_errors_add(warnings,
                      "ice.concentration: %.0f %% of rigid floes: from some %.0f %% on (assumed) they lock, and their "
                      "load has no upper bound; read it as a property of this model, or let floes raft "
                      "(ice.rafting.kappa, 10 to 34) or crush (ice.crushing.pressure)",
                      100 * a->concentration, 100 * BT_BOUND_CONCENTRATION);
}
