// SPDX-License-Identifier: MIT
// What ice may be: bounds of one floe, and of a field, from the ranges in the table of keys.
//
// A number that passes here can be multiplied as the mechanics do it, mass × radius², force × time, without leaving the
// range of a double, so that no input makes an infinity or a NaN out of finite numbers. Rejected: bounds of their own
// in each reader, which had let an HDF5 file have floes of 800 m where a case file may have 100 m.
#include "case/ice_bounds.h"
#include "case/warning.h"

#include <math.h>
#include <stdio.h>

#include "bergtow/shape.h"
#include "base/elementary.h"
#include "base/largest.h"
#include "case/schema.h"

static const double LEAST = 0.99; // a field that was made for the least concentration meets it but nearly

/// The ranges that are asked for each floe, read from their texts once.
typedef struct limits { bt_range thickness, size, corner, length; } limits;

static bt_range range_of(const char *name)
{
    bt_range r;
    bt_value_range(&bt_case_keys[bt_schema_find(bt_case_keys, bt_n_case_keys, name)], &r);
    return r;
}

static const limits *known(void)
{
    static limits l;
    static bool read = false;
    if (!read) {
        l = (limits){range_of("ice.thickness"), range_of("ice.size"), range_of("domain.x0"), range_of("domain.length")};
        read = true;
    }
    return &l;
}

void bt_ice_thickness_range(double *least, double *most)
{
    *least = BT_LEAST_THICKNESS;
    *most = known()->thickness.hi;
}

const char *bt_ice_floe_fault(const bt_ice_floe *f, char why[BT_ICE_WHY], bt_ice_part *part)
{
    bt_ice_part unasked;
    if (!part) part = &unasked;
    const limits *l = known();
    *part = BT_ICE_THICKNESS;
    if (!(f->thickness >= BT_LEAST_THICKNESS) || !(f->thickness <= l->thickness.hi)) {
        snprintf(why, BT_ICE_WHY, "thickness %g m is refused: give %g to %g, in metres and without a unit",
                 f->thickness, BT_LEAST_THICKNESS, l->thickness.hi);
        return why;
    }
    *part = BT_ICE_POSE;
    const double low = l->corner.lo, high = l->corner.hi + l->length.hi; // wherever a domain can be
    if (!isfinite(f->x) || !isfinite(f->y) || !isfinite(f->yaw)) return "its pose is not finite";
    if (!(f->x >= low && f->x <= high) || !(f->y >= low && f->y <= high)) {
        snprintf(why, BT_ICE_WHY, "its place, (%g, %g) m, is not within %g to %g m, where a domain can be; move it",
                 f->x, f->y, low, high);
        return why;
    }
    *part = BT_ICE_OUTLINE;
    const bt_moments m = bt_shape_extent(f->n, f->v);
    // Only the mean has the range of ice.size: a single floe of a law, or a piece, is larger or smaller.
    if (!(m.area > 0) || !(2 * m.radius <= l->length.hi)) {
        snprintf(why, BT_ICE_WHY,
                 "its size, %g m across and %g m2, is beyond 0 to %g m; check the unit of its vertices", 2 * m.radius,
                 m.area, l->length.hi);
        return why;
    }
    if (!(bt_hypot(m.cx, m.cy) <= 1e-6 * m.radius)) {
        snprintf(why, BT_ICE_WHY,
                 "the centroid of its vertices is at (%g, %g) m, not at the origin; subtract it from the vertices and "
                 "add it to the pose",
                 m.cx, m.cy);
        return why;
    }
    *part = BT_ICE_AREA;
    if (!isnan(f->area) && !(fabs(f->area - m.area) <= f->exact * m.area)) {
        snprintf(why, BT_ICE_WHY, "area %g m2 is not that of its outline, %g m2; correct it or leave it out", f->area,
                 m.area);
        return why;
    }
    return NULL;
}

const char *bt_ice_field_fault(bool kept, int64_t n, double sum_size, double sum_area, double ice_area,
                               char why[BT_ICE_WHY])
{
    const limits *l = known();
    const double most = l->length.hi * l->length.hi, mean = n > 0 ? sum_size / (double)n : 0;
    const double concentration = sum_area / ice_area;
    if (!(ice_area > 0) || !(ice_area <= most))
        snprintf(why, BT_ICE_WHY, "the area that the concentration refers to, %g m2, is beyond 0 to %g m2", ice_area,
                 most);
    else if (n == 0) return NULL;
    else if (!kept && !(mean >= BT_LEAST_SIZE && mean <= l->size.hi))
        snprintf(why, BT_ICE_WHY,
                 "the mean size of the floes, %.3g m, is not within %g to %g m; check the unit of the coordinates",
                 mean, BT_LEAST_SIZE, l->size.hi);
    else if (!kept && !(concentration >= LEAST * BT_LEAST_CONCENTRATION))
        snprintf(why, BT_ICE_WHY,
                 "the concentration, %.3g m2 of floes / %.3g m2 of the ice region, is %.3g, below %g; check the unit "
                 "of the coordinates, or make the ice region smaller",
                 sum_area, ice_area, concentration, BT_LEAST_CONCENTRATION);
    else if (!(concentration <= 1 + 1e-9))
        snprintf(why, BT_ICE_WHY,
                 "the concentration, %.3g m2 of floes / %.3g m2 of the ice region, is %.3g, above 1: make the ice "
                 "region (ice.x_min and so on) as large as the ice",
                 sum_area, ice_area, concentration);
    else return NULL;
    return why;
}

const char *bt_ice_domain_fault(const bt_case *c, const bt_field *f, char why[BT_ICE_WHY])
{
    double size = 0;
    for (bt_idx i = 0; i < f->n; i++) size += sqrt(4 * f->area[i] / BT_PI);
    const double mean = f->n > 0 ? size / f->n : 0, whole = c->domain.length * c->domain.width;
    if (mean > bt_min(c->domain.length, c->domain.width)) {
        snprintf(why, BT_ICE_WHY,
                 "the mean size of the floes, %.3g m, is above that of the domain, %g x %g m; check the unit of the "
                 "coordinates, or enlarge the domain",
                 mean, c->domain.length, c->domain.width);
        return why;
    }
    if (f->ice_area > whole * (1 + 1e-6)) {
        snprintf(why, BT_ICE_WHY,
                 "the area that the concentration refers to, %.6g m2, is above that of the domain, %.6g m2; give the "
                 "domain that the field was made for",
                 f->ice_area, whole);
        return why;
    }
    return bt_ice_field_fault(false, f->n, size, f->concentration * f->ice_area, f->ice_area, why);
}

double bt_ice_closed(const bt_case *c, double area)
{
    const double x = 2 * c->domain.ends_closing * c->run.duration, y = 2 * c->domain.sides_closing * c->run.duration;
    const bool leaves = c->domain.ends == BT_BOUND_OPEN || c->domain.sides == BT_BOUND_OPEN;
    if ((x == 0 && y == 0) || leaves || c->ice.rafting_kappa > 0 || c->ice.crushing_pressure > 0) return 0;
    double v[2 * BT_MAX_VERTICES];
    const int n = bt_case_waterline(c, v);
    const double body = n ? bt_shape_moments(n, v).area : 0;
    const double room = (c->domain.length - x) * (c->domain.width - y) - body;
    return room > 0 ? area / room : area > 0 ? INFINITY : 0;
}

void bt_ice_warn_closed(const bt_case *c, double area, bt_errors *warnings)
{
    const double closed = bt_ice_closed(c, area);
    if (!(closed >= c->estimate.phi_j)) return;
    bt_warn(warnings, BT_WARN_CLOSED_ICE,
                  "domain.%s_closing: the walls bring the ice to a concentration of %.3g by the end of the run, packed "
                  "from %g on (estimate.phi_j): rigid floes then bear any load; end the run before, or set "
                  "ice.crushing.pressure or ice.rafting.kappa",
                  c->domain.ends_closing > 0 ? "ends" : "sides", closed, c->estimate.phi_j);
}

void bt_ice_warn_slow(const bt_case *c, double size, bt_errors *warnings)
{
    const double accepted = c->solver.tolerance * bt_case_reference_speed(c);
    for (int k = 0; k < 2; k++) {
        const double closing = k ? c->domain.sides_closing : c->domain.ends_closing,
                     across = (k ? c->domain.width : c->domain.length) / size;
        // of a row of floes from wall to wall each contact takes an equal share, where they are locked
        const double share = 2 * closing / (across + 1);
        if (!(closing > 0 && size > 0 && share < 2 * accepted)) continue;
        bt_warn(warnings, BT_WARN_SLOW_CLOSING,
                      "domain.%s_closing: %g m/s, shared out among the contacts of some %.0f floes from wall to wall, "
                      "is %.2g m/s each, and the solver takes %.2g m/s for rest: ice that is locked between the walls "
                      "may bear no load, without a word; set solver.tolerance: %.1g",
                      k ? "sides" : "ends", closing, across, share, accepted,
                      c->solver.tolerance * 0.1 * share / accepted);
    }
}

static const double THICK = 10, STOUT = 0.2; // m; of the floe size: beyond, ice is seldom so thick, assumed

static const double THIN = 0.1; // m, at full scale, assumed

static const double FAR = 10; // times the range of the literature: more than its ice differs, assumed

/// Toughness and strength far from the literature: a number without k, or in another unit.
static void warn_strength(const bt_case *c, bt_errors *warnings)
{
    const struct {
        const char *key, *unit;
        double value, least, most, usual;
    } known[] = {{"ice.splitting.toughness", "kPa m^0.5", c->ice.splitting.toughness, 50e3, 250e3, 150e3},
                 {"ice.splitting.strength", "kPa", c->ice.splitting.strength, 200e3, 500e3, 300e3}};
    for (int k = 0; k < 2; k++)
        if (known[k].value < known[k].least / FAR || known[k].value > known[k].most * FAR)
            bt_warn(warnings, BT_WARN_ODD_STRENGTH,
                    "%s: %.3g %s, where sea ice has %g to %g in the literature; check the unit, as in %g %s",
                    known[k].key, known[k].value / 1e3, known[k].unit, known[k].least / 1e3, known[k].most / 1e3,
                    known[k].usual / 1e3, known[k].unit);
}

void bt_ice_warn(const bt_case *c, double size, double thickness, bt_errors *warnings)
{
    const bool splits = c->ice.splitting.toughness > 0 && c->domain.frame == BT_FRAME_GEOGRAPHIC;
    if (splits) warn_strength(c, warnings);
    if (splits && thickness < THIN)
        bt_warn(warnings, BT_WARN_THIN_SPLITS,
                "ice.splitting.toughness: the ice is %.3g m thick in the mean, and floes of less than 0.1 m raft or "
                "bend before they split; set ice.rafting.kappa, or 0 here",
                thickness);
    const bool deep = c->body.shape != BT_BODY_ABSENT && thickness > c->body.draft;
    if (!(thickness > THICK) && !(thickness > STOUT * size) && !deep) return;
    bt_warn(warnings, BT_WARN_THICK_ICE,
                  "the ice is %.3g m thick in the mean, %s; check that it is in metres (ice.thickness, or thickness in "
                  "the file)",
                  thickness,
                  thickness > THICK          ? "more than 10 m"
                  : thickness > STOUT * size ? "more than a fifth of the floe size"
                                             : "more than the draft of the body");
}
