// SPDX-License-Identifier: MIT
// Is the domain wide enough for body, floes and arches, and what bounds their load? The rules are in arch.h.
#include "case/arch.h"
#include "case/case_derived.h"
#include "case/warning.h"

#include "bergtow/shape.h"
#include "base/elementary.h"
#include "case/case_tow.h"

/// Body widths needed by ice of at least this concentration.
static const struct { double concentration, widths; } asked[] = {{0.45, 10}, {0.7, 30}, {0.85, BT_ARCH_LOCKING}};

/// δ of arch.h for ice of at least this concentration.
static const struct { double concentration, slack; } locked[] = {{0.9, 0.0095}, {0.95, 0.003}};

/// A disc is a polygon of equal area, 0.08 % wider than its length: thirty of its lengths count as thirty widths.
static const double OUTLINE = 1e-3;

/// Ice as made misses the key's concentration in the last digits; what prints as 90 % follows the rule for 90 %.
static bool reaches(double concentration, double limit) { return concentration >= limit - 0.005; }

/// A pair of boundaries of the domain that may lie beside a tow, the extent between them, and its key.
typedef struct pair {
    bt_bound kind;
    double extent, ice; ///< of the domain, and of the region of the ice, m
    const char *key, *region, *open;
} pair;

/// Body widths between one pair of boundaries for a tow in the direction `course`, and body widths needed.
static bt_arch beside_tow(const bt_case *input, const pair *p, double course, double concentration, double floe_size)
{
    double v[2 * BT_MAX_VERTICES];
    const int n = bt_case_waterline(input, v);
    // at a set speed a body keeps its yaw; on a line it turns with its course
    const double ahead = (input->tow.mode == BT_TOW_SPEED ? course : input->tow.direction) - input->body.yaw,
                 across = n ? bt_shape_width(n, v, bt_cos(ahead), bt_sin(ahead)) : NAN;
    const bool open = p->kind == BT_BOUND_OPEN;
    bt_arch arch = {.key = p->key,
                    .concentration = concentration,
                    .bodies = p->extent / across,
                    .floes = floe_size > 0 ? p->extent / floe_size : NAN,
                    .needed = NAN};
    arch.sides = open ? p->open : p->kind == BT_BOUND_WALL ? "walls" : "periodic images";
    arch.beside = n > 0 && floe_size > 0;
    arch.region = p->region;
    const double water = p->extent - p->ice;
    const bool counts = arch.beside && concentration > 0 && input->tow.mode != BT_TOW_NONE;
    arch.water = counts && water > BT_ARCH_WATER * floe_size ? water : 0;
    const double gap = input->domain.length - (input->ice.x_max - input->ice.x_min);
    arch.gap = counts && input->domain.ends == BT_BOUND_MOVING && gap > BT_ARCH_WATER * floe_size ? gap : 0;
    for (size_t k = 0; arch.beside && !open && k < sizeof asked / sizeof *asked; k++)
        if (reaches(concentration, asked[k].concentration)) arch.needed = asked[k].widths;
    const double way = input->tow.mode == BT_TOW_NONE ? 0 : bt_case_tow_distance(input, input->run.duration);
    for (size_t k = 0; k < sizeof locked / sizeof *locked; k++)
        if (arch.needed > 0 && way > 0 && reaches(concentration, locked[k].concentration))
            arch.needed = bt_max(arch.needed, ceil(2 * sqrt(way / (BT_PI * locked[k].slack * across))));
    if (arch.bodies < arch.needed && arch.bodies > arch.needed * (1 - OUTLINE)) arch.bodies = arch.needed;
    arch.possible = arch.bodies < arch.needed;
    return arch;
}

/// Is a the narrower domain for its ice? If neither needs a width, the domain with fewer body widths is.
static bool narrower(const bt_arch *a, const bt_arch *b)
{
    if (a->needed > 0 && b->needed > 0) return a->bodies / a->needed < b->bodies / b->needed;
    if (a->needed > 0 || b->needed > 0) return a->needed > 0;
    return a->bodies < b->bodies;
}

bt_arch bt_arch_of(const bt_case *input, double concentration, double floe_size)
{
    // the sides lie beside a tow along x, the ends beside a tow along y
    const pair pairs[2] =
        {{input->domain.sides, input->domain.width, input->ice.y_max - input->ice.y_min, "domain.width",
                            "ice.y_min, ice.y_max", "open sides"},
                           {input->domain.ends, input->domain.length, input->ice.x_max - input->ice.x_min,
                            "domain.length",
                            "ice.x_min, ice.x_max", "open ends"}};
    const int legs = input->tow.n_waypoints > 0 ? input->tow.n_waypoints : 1;
    const double way = input->tow.mode == BT_TOW_NONE ? 0 : bt_case_tow_distance(input, input->run.duration);
    double begins = 0; // way to the start of the leg, m: on straight legs from the body, corners not rounded
    bt_arch worst = {.key = NULL};
    for (int leg = 0; leg < legs && (leg == 0 || begins < way); leg++) {
        const double *q = input->tow.waypoints + 2 * leg;
        const double course = leg == 0 ? input->tow.direction : bt_atan2(q[1] - q[-1], q[0] - q[-2]);
        if (input->tow.n_waypoints > 0)
            begins += leg == 0 ? bt_hypot(q[0] - input->body.x, q[1] - input->body.y)
                               : bt_hypot(q[0] - q[-2], q[1] - q[-1]);
        for (int k = 0; k < 2; k++) {
            if (fabs(k ? bt_cos(course) : bt_sin(course)) >= BT_ARCH_ALONG) continue; // that pair is ahead and astern
            const bt_arch arch = beside_tow(input, &pairs[k], course, concentration, floe_size);
            if (!worst.key || narrower(&arch, &worst)) worst = arch;
        }
    }
    worst.rigid = !(input->ice.rafting_kappa > 0) && !(input->ice.crushing_pressure > 0);
    worst.splits = input->ice.splitting.toughness > 0;
    worst.mapped = bt_case_reads_field(input);
    worst.unbounded = worst.rigid && worst.beside && reaches(concentration, BT_BOUND_CONCENTRATION);
    return worst;
}

const char *bt_arch_floes(const bt_arch *arch) { return arch->rigid ? "rigid floes" : "floes"; }

void bt_arch_warn(const bt_arch *arch, bt_errors *warnings)
{
    if (arch->possible)
        bt_warn(warnings, BT_WARN_NARROW_DOMAIN,
                      "%s: %.3g body widths of %.0f %% ice, and %s can carry arches of %s: the resistance also depends "
                      "on that width; use at least %g body widths (assumed), or compare widths",
                      arch->key, arch->bodies, 100 * arch->concentration, arch->sides, bt_arch_floes(arch),
                      arch->needed);
    if (arch->water > 0)
        bt_warn(warnings, BT_WARN_ICE_STRIP,
                      "%s: %.4g m of open water beside the tow, where the ice ends before the domain does: floes are "
                      "pushed out into it, and the resistance is that of a strip of ice; %s, unless that is intended",
                      arch->region, arch->water,
                      arch->mapped ? "use a map that reaches farther, or a smaller domain"
                                   : "leave both keys out to fill the domain");
    if (arch->gap > 0)
        bt_warn(warnings, BT_WARN_ICE_GAP,
                      "ice.x_min, ice.x_max: the ice fills all but %.4g m of the moving window, and the window repeats "
                      "that gap: the body meets open water again and again; %s",
                      arch->gap, arch->mapped ? "use a map that fills the window, or a smaller domain"
                                              : "leave both keys out");
    if (arch->unbounded)
        bt_warn(warnings, BT_WARN_LOAD_UNBOUNDED,
                      "ice.concentration: %.0f %% of %s: above about %.0f %% (assumed) they lock, and their load has "
                      "no upper bound; read it as a property of this model, or let floes raft (ice.rafting.kappa, 10 "
                      "to 34) or crush (ice.crushing.pressure)",
                      100 * arch->concentration,
                      arch->splits ? "floes that split into rigid pieces" : "rigid floes",
                      100 * BT_BOUND_CONCENTRATION);
}
