// SPDX-License-Identifier: MIT
// Width of the domain against body, floes and arches, and what bounds their load; the rules are in arch.h.
#include "case/arch.h"
#include "case/warning.h"

#include <math.h>

#include "bergtow/shape.h"
#include "base/elementary.h"
#include "case/case_tow.h"

/// Body widths that ice from this concentration on needs.
static const struct { double concentration, widths; } asked[] = {{0.45, 10}, {0.7, 30}, {0.85, BT_ARCH_LOCKING}};

/// δ of arch.h, from this concentration on.
static const struct { double concentration, slack; } locked[] = {{0.9, 0.0095}, {0.95, 0.003}};

/// A disc is a polygon of its area, and 0.08 % wider than its length: thirty of its lengths are thirty widths.
static const double OUTLINE = 1e-3;

/// Ice as made misses the concentration asked for in the last digits, and what is printed as 90 % has the rule of 90 %.
static bool reaches(double concentration, double limit) { return concentration >= limit - 0.005; }

/// A pair of boundaries of the domain that may stand beside a tow, what lies between them, and its key.
typedef struct pair {
    bt_bound kind;
    double extent, ice; ///< of the domain, and of the region of the ice, m
    const char *key, *region, *open;
} pair;

/// Body widths, and those that are needed, between one pair for a tow in the direction `course`.
static bt_arch beside_tow(const bt_case *c, const pair *p, double course, double concentration, double floe_size)
{
    double v[2 * BT_MAX_VERTICES];
    const int n = bt_case_waterline(c, v);
    // at a set speed a body keeps its yaw; on a line it follows its course
    const double ahead = (c->tow.mode == BT_TOW_SPEED ? course : c->tow.direction) - c->body.yaw,
                 across = n ? bt_shape_width(n, v, bt_cos(ahead), bt_sin(ahead)) : NAN;
    const bool open = p->kind == BT_BOUND_OPEN;
    bt_arch a = {.key = p->key,
                 .concentration = concentration,
                 .bodies = p->extent / across,
                 .floes = floe_size > 0 ? p->extent / floe_size : NAN,
                 .needed = NAN};
    a.sides = open ? p->open : p->kind == BT_BOUND_WALL ? "walls" : "periodic images";
    a.beside = n > 0 && floe_size > 0;
    a.region = p->region;
    const double water = p->extent - p->ice;
    const bool counts = a.beside && concentration > 0 && c->tow.mode != BT_TOW_NONE;
    a.water = counts && water > BT_ARCH_WATER * floe_size ? water : 0;
    const double gap = c->domain.length - (c->ice.x_max - c->ice.x_min);
    a.gap = counts && c->domain.ends == BT_BOUND_MOVING && gap > BT_ARCH_WATER * floe_size ? gap : 0;
    for (size_t k = 0; a.beside && !open && k < sizeof asked / sizeof *asked; k++)
        if (reaches(concentration, asked[k].concentration)) a.needed = asked[k].widths;
    const double way = c->tow.mode == BT_TOW_NONE ? 0 : bt_case_tow_distance(c, c->run.duration);
    for (size_t k = 0; k < sizeof locked / sizeof *locked; k++)
        if (a.needed > 0 && way > 0 && reaches(concentration, locked[k].concentration))
            a.needed = bt_max(a.needed, ceil(2 * sqrt(way / (BT_PI * locked[k].slack * across))));
    if (a.bodies < a.needed && a.bodies > a.needed * (1 - OUTLINE)) a.bodies = a.needed;
    a.possible = a.bodies < a.needed;
    return a;
}

/// Is a the narrower domain for its ice? Of two that nothing is asked of, the one with fewer body widths.
static bool narrower(const bt_arch *a, const bt_arch *b)
{
    if (a->needed > 0 && b->needed > 0) return a->bodies / a->needed < b->bodies / b->needed;
    if (a->needed > 0 || b->needed > 0) return a->needed > 0;
    return a->bodies < b->bodies;
}

bt_arch bt_arch_of(const bt_case *c, double concentration, double floe_size)
{
    // along x: beside a tow along y
    const pair pairs[2] = {{c->domain.sides, c->domain.width, c->ice.y_max - c->ice.y_min, "domain.width",
                            "ice.y_min, ice.y_max", "open sides"},
                           {c->domain.ends, c->domain.length, c->ice.x_max - c->ice.x_min, "domain.length",
                            "ice.x_min, ice.x_max", "open ends"}};
    const int legs = c->tow.n_waypoints > 0 ? c->tow.n_waypoints : 1;
    const double way = c->tow.mode == BT_TOW_NONE ? 0 : bt_case_tow_distance(c, c->run.duration);
    double begins = 0; // way at which the leg begins, m: straight from the body on, corners not rounded
    bt_arch worst = {.key = NULL};
    for (int leg = 0; leg < legs && (leg == 0 || begins < way); leg++) {
        const double *q = c->tow.waypoints + 2 * leg;
        const double course = leg == 0 ? c->tow.direction : bt_atan2(q[1] - q[-1], q[0] - q[-2]);
        if (c->tow.n_waypoints > 0)
            begins += leg == 0 ? bt_hypot(q[0] - c->body.x, q[1] - c->body.y) : bt_hypot(q[0] - q[-2], q[1] - q[-1]);
        for (int k = 0; k < 2; k++) {
            if (fabs(k ? bt_cos(course) : bt_sin(course)) >= BT_ARCH_ALONG) continue; // that pair is ahead and astern
            const bt_arch a = beside_tow(c, &pairs[k], course, concentration, floe_size);
            if (!worst.key || narrower(&a, &worst)) worst = a;
        }
    }
    worst.rigid = !(c->ice.rafting_kappa > 0) && !(c->ice.crushing_pressure > 0);
    worst.unbounded = worst.rigid && worst.beside && reaches(concentration, BT_BOUND_CONCENTRATION);
    return worst;
}

const char *bt_arch_floes(const bt_arch *a) { return a->rigid ? "rigid floes" : "floes"; }

void bt_arch_warn(const bt_arch *a, bt_errors *warnings)
{
    if (a->possible)
        bt_warn(warnings, BT_WARN_NARROW_DOMAIN,
                      "%s: %.3g body widths of %.0f %% ice, and %s can carry arches of %s: the "
                      "resistance is also a property of "
                      "that width; take at least %g body widths (assumed), or compare widths",
                      a->key, a->bodies, 100 * a->concentration, a->sides, bt_arch_floes(a), a->needed);
    if (a->water > 0)
        bt_warn(warnings, BT_WARN_ICE_STRIP,
                      "%s: %.4g m of open water beside the tow, where the ice ends before the domain does: floes are "
                      "pushed out into it, and the resistance is that of a strip of ice; leave both keys out to fill "
                      "the domain, unless that is meant",
                      a->region, a->water);
    if (a->gap > 0)
        bt_warn(warnings, BT_WARN_ICE_GAP,
                      "ice.x_min, ice.x_max: the ice fills all but %.4g m of the moving window, and is repeated so: "
                      "the body comes into open water again and again; leave both keys out",
                      a->gap);
    if (a->unbounded)
        bt_warn(warnings, BT_WARN_LOAD_UNBOUNDED,
                      "ice.concentration: %.0f %% of rigid floes: from some %.0f %% on (assumed) they lock, and their "
                      "load has no upper bound; read it as a property of this model, or let floes raft "
                      "(ice.rafting.kappa, 10 to 34) or crush (ice.crushing.pressure)",
                      100 * a->concentration, 100 * BT_BOUND_CONCENTRATION);
}
