// SPDX-License-Identifier: MIT
// Admissible ice: bounds of one floe, and of a field, from the ranges in the table of keys.
//
// A number that passes here can be multiplied as in the mechanics, mass × radius², force × time, without leaving the
// range of a double, so that no input makes an infinity or a NaN out of finite numbers. Rejected: separate bounds in
// each reader, which let an HDF5 file have a thickness of 800 m where a case file may have 100 m.
#include "case/ice_bounds.h"
#include "case/warning.h"

#include "bergtow/shape.h"
#include "base/elementary.h"
#include "base/largest.h"
#include "case/schema.h"

static const double LEAST = 0.99; // a field made for the least concentration may fall just short of it

/// The ranges for each floe, parsed once.
typedef struct limits { bt_range thickness, size, corner, length; } limits;

static bt_range range_of(const char *name)
{
    bt_range range;
    bt_value_range(&bt_case_keys[bt_schema_find(bt_case_keys, bt_n_case_keys, name)], &range);
    return range;
}

static const limits *known(void)
{
    static limits bounds;
    static bool read = false;
    if (!read) {
        bounds = (limits){range_of("ice.thickness"), range_of("ice.size"), range_of("domain.x0"),
                          range_of("domain.length")};
        read = true;
    }
    return &bounds;
}

void bt_ice_thickness_range(double *least, double *most)
{
    *least = BT_LEAST_THICKNESS;
    *most = known()->thickness.hi;
}

const char *bt_ice_floe_fault(const bt_ice_floe *floe, char why[BT_ICE_WHY], bt_ice_part *part)
{
    bt_ice_part unasked;
    if (!part) part = &unasked;
    const limits *bounds = known();
    *part = BT_ICE_THICKNESS;
    if (!(floe->thickness >= BT_LEAST_THICKNESS) || !(floe->thickness <= bounds->thickness.hi)) {
        snprintf(why, BT_ICE_WHY, "thickness %g m is refused: give %g to %g, in metres and without a unit",
                 floe->thickness, BT_LEAST_THICKNESS, bounds->thickness.hi);
        return why;
    }
    *part = BT_ICE_POSE;
    const double low = bounds->corner.lo, high = bounds->corner.hi + bounds->length.hi; // wherever a domain can be
    if (!isfinite(floe->x) || !isfinite(floe->y) || !isfinite(floe->yaw)) return "its pose is not finite";
    if (!(floe->x >= low && floe->x <= high) || !(floe->y >= low && floe->y <= high)) {
        snprintf(why, BT_ICE_WHY, "its place, (%g, %g) m, is not within %g to %g m, where a domain can be; move it",
                 floe->x, floe->y, low, high);
        return why;
    }
    *part = BT_ICE_OUTLINE;
    const bt_moments moments = bt_shape_area_moments(floe->n, floe->v);
    // The range of ice.size holds for the mean alone: a single floe of a law, or a piece, may be larger or smaller.
    if (!(moments.area > 0) || !(2 * moments.radius <= bounds->length.hi)) {
        snprintf(why, BT_ICE_WHY,
                 "its size, %g m across and %g m2, is not between 0 and %g m; check the unit of its vertices",
                 2 * moments.radius, moments.area, bounds->length.hi);
        return why;
    }
    if (!(bt_hypot(moments.cx, moments.cy) <= 1e-6 * moments.radius)) {
        snprintf(why, BT_ICE_WHY,
                 "the centroid of its vertices is at (%g, %g) m, not at the origin; subtract it from the vertices and "
                 "add it to the pose",
                 moments.cx, moments.cy);
        return why;
    }
    *part = BT_ICE_AREA;
    if (!isnan(floe->area) && !(fabs(floe->area - moments.area) <= floe->exact * moments.area)) {
        snprintf(why, BT_ICE_WHY, "area %g m2 is not that of its outline, %g m2; correct it or leave it out",
                 floe->area, moments.area);
        return why;
    }
    return NULL;
}

const char *bt_ice_field_fault(bool kept, int64_t n, double sum_size, double sum_area, double ice_area,
                               char why[BT_ICE_WHY])
{
    const limits *bounds = known();
    const double most = bounds->length.hi * bounds->length.hi, mean = n > 0 ? sum_size / (double)n : 0;
    const double concentration = sum_area / ice_area;
    if (!(ice_area > 0) || !(ice_area <= most))
        snprintf(why, BT_ICE_WHY, "the area that the concentration refers to, %g m2, is not between 0 and %g "
                                  "m2", ice_area,
                 most);
    else if (n == 0) return NULL;
    else if (!kept && !(mean >= BT_LEAST_SIZE && mean <= bounds->size.hi))
        snprintf(why, BT_ICE_WHY,
                 "the mean size of the floes, %.3g m, is not within %g to %g m; check the unit of the coordinates",
                 mean, BT_LEAST_SIZE, bounds->size.hi);
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

const char *bt_ice_domain_fault(const bt_case *input, const bt_field *field, char why[BT_ICE_WHY])
{
    double size = 0;
    for (bt_idx i = 0; i < field->n; i++) size += sqrt(4 * field->area[i] / BT_PI);
    const double mean = field->n > 0 ? size / field->n : 0, whole = input->domain.length * input->domain.width;
    if (mean > bt_min(input->domain.length, input->domain.width)) {
        snprintf(why, BT_ICE_WHY,
                 "the mean size of the floes, %.3g m, is above that of the domain, %g x %g m; check the unit of the "
                 "coordinates, or enlarge the domain",
                 mean, input->domain.length, input->domain.width);
        return why;
    }
    if (field->ice_area > whole * (1 + 1e-6)) {
        snprintf(why, BT_ICE_WHY,
                 "the area that the concentration refers to, %.6g m2, is above that of the domain, %.6g m2; give the "
                 "domain that the field was made for",
                 field->ice_area, whole);
        return why;
    }
    return bt_ice_field_fault(false, field->n, size, field->concentration * field->ice_area, field->ice_area, why);
}

double bt_ice_closed(const bt_case *input, double area)
{
    const double x = 2 * input->domain.ends_closing * input->run.duration,
                 y = 2 * input->domain.sides_closing * input->run.duration;
    const bool leaves = input->domain.ends == BT_BOUND_OPEN || input->domain.sides == BT_BOUND_OPEN;
    if ((x == 0 && y == 0) || leaves || input->ice.rafting_kappa > 0 || input->ice.crushing_pressure > 0) return 0;
    double v[2 * BT_MAX_VERTICES];
    const int n = bt_case_waterline(input, v);
    const double body = n ? bt_shape_moments(n, v).area : 0;
    const double room = (input->domain.length - x) * (input->domain.width - y) - body;
    return room > 0 ? area / room : area > 0 ? INFINITY : 0;
}

void bt_ice_warn_closed(const bt_case *input, double area, bt_errors *warnings)
{
    const double closed = bt_ice_closed(input, area);
    if (!(closed >= input->estimate.phi_j)) return;
    bt_warn(warnings, BT_WARN_CLOSED_ICE,
                  "domain.%s_closing: the walls bring the ice to a concentration of %.3g by the end of the run, but "
                  "the ice is packed from %g on (estimate.phi_j): rigid floes then bear any load; end the run earlier, "
                  "or set ice.crushing.pressure or ice.rafting.kappa",
                  input->domain.ends_closing > 0 ? "ends" : "sides", closed, input->estimate.phi_j);
}

void bt_ice_warn_slow(const bt_case *input, double size, bt_errors *warnings)
{
    const double accepted = input->solver.tolerance * bt_case_reference_speed(input);
    for (int k = 0; k < 2; k++) {
        const double closing = k ? input->domain.sides_closing : input->domain.ends_closing,
                     across = (k ? input->domain.width : input->domain.length) / size;
        // where floes are locked, each contact of a row of floes from wall to wall takes an equal share
        const double share = 2 * closing / (across + 1);
        if (!(closing > 0 && size > 0 && share < 2 * accepted)) continue;
        bt_warn(warnings, BT_WARN_SLOW_CLOSING,
                      "domain.%s_closing: %g m/s, divided among the contacts of about %.0f floes from wall to wall, is "
                      "%.2g m/s each, but the solver treats speeds below %.2g m/s as rest: ice locked between the "
                      "walls may bear no load, without a warning; set solver.tolerance: %.1g",
                      k ? "sides" : "ends", closing, across, share, accepted,
                      input->solver.tolerance * 0.1 * share / accepted);
    }
}

static const double THICK = 10, STOUT = 0.2; // m; / floe size: ice is seldom thicker, assumed

static const double THIN = 0.1; // m, at full scale, assumed

static const double FAR = 10; // times the range of the literature: ice is not expected so far outside, assumed

/// Warn of toughness and strength far from the literature: a number without its k, or in another unit.
static void warn_strength(const bt_case *input, bt_errors *warnings)
{
    const struct {
        const char *key, *unit;
        double value, least, most, usual;
    } known[] = {{"ice.splitting.toughness", "kPa m^0.5", input->ice.splitting.toughness, 50e3, 250e3, 150e3},
                 {"ice.splitting.strength", "kPa", input->ice.splitting.strength, 200e3, 500e3, 300e3}};
    for (int k = 0; k < 2; k++)
        if (known[k].value < known[k].least / FAR || known[k].value > known[k].most * FAR)
            bt_warn(warnings, BT_WARN_ODD_STRENGTH,
                    "%s: %.3g %s, where sea ice has %g to %g in the literature; check the unit, as in %g %s",
                    known[k].key, known[k].value / 1e3, known[k].unit, known[k].least / 1e3, known[k].most / 1e3,
                    known[k].usual / 1e3, known[k].unit);
}

void bt_ice_warn(const bt_case *input, double size, double thickness, bt_errors *warnings)
{
    const bool splits = input->ice.splitting.toughness > 0 && input->domain.frame == BT_FRAME_GEOGRAPHIC;
    if (splits) warn_strength(input, warnings);
    if (splits && thickness < THIN)
        bt_warn(warnings, BT_WARN_THIN_SPLITS,
                "ice.splitting.toughness: the ice is %.3g m thick on average, but floes of less than 0.1 m raft or "
                "bend before they split; set ice.rafting.kappa, or 0 here",
                thickness);
    const bool deep = input->body.shape != BT_BODY_ABSENT && thickness > input->body.draft;
    if (!(thickness > THICK) && !(thickness > STOUT * size) && !deep) return;
    bt_warn(warnings, BT_WARN_THICK_ICE,
                  "the ice is %.3g m thick on average, %s; check that it is in metres (ice.thickness, or thickness in "
                  "the file)",
                  thickness,
                  thickness > THICK          ? "more than 10 m"
                  : thickness > STOUT * size ? "more than a fifth of the floe size"
                                             : "more than the draft of the body");
}
