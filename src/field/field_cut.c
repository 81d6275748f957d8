// SPDX-License-Identifier: MIT
// Cut a field generated for a larger region to the ice region (ice.extent), so that domains of different widths and
// lengths share their floes.
//
// A floe inside the ice region stays bit-identical, with its thickness. A floe across a side beyond which the extent
// continues is cut parallel to that side, at the clearance c that a generated field keeps from bodies. So the part
// inside is clear of a wall, and at a periodic seam 2c from the part at the other end: they are no longer one floe.
// Parts of convex floes are convex. Parts below LEAST_PART of their floe are left out. So nothing overlaps at any
// boundary.
//
// The concentration of a part differs from that of the whole field (theory.md gives the measured scatter). Floes that
// were cut, and those whose centroid is in the strip of width s along a cut side, are scaled about their centroids by a
// common factor, each as far as it has room, until Σ area = concentration × ice area. s is the least multiple of the
// mean diameter for which no area changes by more than MAX_CHANGE. In the widest strip the limit is LAST_CHANGE, which
// small domains with few floes need.
//
// Rejected: removing or adding whole floes at random, which leaves an error of half a floe; scaling all floes, which
// leaves no floe that two widths share; shaking the strip again, which would lose some floes.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/elementary.h"
#include "bergtow/shape.h"
#include "field/field_make.h"

static const double LEAST_PART = 0.1;   // least part kept / area of its floe
static const double SHORT_EDGE = 0.02;  // shortest edge kept / diameter of a part
static const double MAX_CHANGE = 0.25; // of a floe's area, while the strip can be widened
static const double LAST_CHANGE = 0.5;  // the same in the widest strip
static const double WIDEST = 0.25;      // strip / ice region across a cut: at least half of the region keeps its floes
static const double TOLERANCE = 0.005;  // relative, of the concentration
static const double TOUCH = 1 - 1e-9, ROUND_OFF = 1e-12;
enum { MORE_PASSES = 20 };

/// One axis of a cut: the ends of the ice region, and beyond which of them the extent continues.
typedef struct axis {
    double low, high, period; ///< m; period of the extent, 0 = none
    bool at_low, at_high;
} axis;

static axis axis_of(double low, double high, double from, double to, bool periodic)
{
    const bool differ = low != from || high != to;
    // a periodic extent joins itself at an end it shares with the region: floes across that end are cut, too
    return (axis){.low = low, .high = high, .period = differ && periodic ? to - from : 0,
                  .at_low = differ && (periodic || low != from), .at_high = differ && (periodic || high != to)};
}

static bool in_obstacle(const bt_region *region, int n, const double *v, double x, double z, double radius)
{
    for (int k = 0; k < region->n_obstacles; k++) {
        const bt_obstacle *obstacle = &region->obstacles[k];
        const double dx = obstacle->x - x, dy = obstacle->y - z, reach = obstacle->radius + radius;
        if (dx * dx + dy * dy >= reach * reach) continue;
        if (bt_region_apart(obstacle, n, v, dx, dy).gap < 0) return true;
    }
    return false;
}

/// Clip the polygon v in place at the cut sides that it crosses, less the clearance; returns the number of vertices
/// left, 0 = none. Sets `crossed` if it was clipped.
static int part_within(const axis axes[2], double clearance, int n, double *v, bool *crossed)
{
    double out[2 * BT_MAX_VERTICES + 16];
    for (int k = 0; k < 2; k++)
        for (int end = 0; end < 2; end++) {
            const bt_box box = bt_box_of(n, v);
            const double sign = end ? 1 : -1, side = end ? axes[k].high : axes[k].low;
            if (!(end ? axes[k].at_high && box.high[k] > side : axes[k].at_low && box.low[k] < side)) continue;
            *crossed = true;
            n = bt_shape_clip(n, v, k ? 0 : sign, k ? sign : 0, sign * side - clearance, out);
            if (n < 3) return 0;
            memcpy(v, out, 2 * (size_t)n * sizeof *v);
        }
    return n;
}

/// Add the part of floe i of `from`, or of its image (dx, dy) away, that lies in the region.
static void add_part(const bt_region *region, const axis axes[2], const bt_field *from, const double *outline, bt_idx i,
                     double dx, double dy, bt_field *to, bool **parted)
{
    enum { MAX_CLEARED = 8 * BT_MAX_VERTICES };
    const int all = (int)(from->offsets[i + 1] - from->offsets[i]);
    const double x = from->pose[3 * i] + dx, z = from->pose[3 * i + 1] + dy, *own = outline + 2 * from->offsets[i];
    double v[2 * MAX_CLEARED], radius = 0;
    for (int k = 0; k < all; k++) {
        v[2 * k] = x + own[2 * k], v[2 * k + 1] = z + own[2 * k + 1];
        radius = bt_max(radius, bt_hypot(own[2 * k], own[2 * k + 1]));
    }
    bool changed = false;
    int n = part_within(axes, region->clearance, all, v, &changed);
    // a body that reaches across the seam of the domain has an image here that it does not have in the extent
    if (n >= 3 && in_obstacle(region, all, own, x, z, radius)) {
        n = bt_tessellation_clear(region, n, v, false);
        changed = true;
    }
    const bt_idx k = to->n;
    if (!changed) {
        bt_field_append(to, from, i);
        to->pose[3 * k] = x, to->pose[3 * k + 1] = z;
    } else {
        bt_moments moments = {0};
        if (n >= 3) moments = bt_shape_area_moments(n, v);
        if (moments.area < LEAST_PART * from->area[i]) return;
        n = bt_tessellation_clean(n, v, SHORT_EDGE * 2 * sqrt(moments.area / BT_PI), BT_MAX_VERTICES);
        moments = bt_shape_centre(n, v);
        bt_field_add(to, n, v, moments.cx, moments.cy, 0, from->thickness[i]);
        bt_region_wrap(region, &to->pose[3 * k], &to->pose[3 * k + 1]);
    }
    *parted = bt_realloc(*parted, (size_t)to->n, sizeof **parted);
    (*parted)[k] = changed;
}

/// Distance of a point from the nearest cut side, m.
static double to_cut(const axis axes[2], const double *at)
{
    double least = INFINITY;
    for (int k = 0; k < 2; k++) {
        if (axes[k].at_low) least = bt_min(least, fabs(at[k] - axes[k].low));
        if (axes[k].at_high) least = bt_min(least, fabs(axes[k].high - at[k]));
    }
    return least;
}

/// Factors by which all floes may be scaled at the same time so that no two touch and no area exceeds 1 +
/// LAST_CHANGE times the original one, `first`.
static void room_of(const bt_region *region, const bt_field *field, const double *first, double *clearance)
{
    bt_field_growth(region, field, sqrt(1 + LAST_CHANGE), clearance);
    for (bt_idx i = 0; i < field->n; i++)
        clearance[i] = bt_min(TOUCH * clearance[i], sqrt((1 + LAST_CHANGE) * first[i] / field->area[i]));
}

/// Scale the floes of the strip; returns the area reached, m².
static double scale_strip(const bt_region *region, const axis axes[2], const bool *parted, double size, double wanted,
                          bt_field *field)
{
    double *clearance = bt_alloc((size_t)field->n, sizeof *clearance),
           *first = bt_alloc((size_t)field->n, sizeof *first), widest = INFINITY, area = bt_field_floe_area(field);
    bool *held = bt_alloc((size_t)field->n, sizeof *held);
    memcpy(first, field->area, (size_t)field->n * sizeof *first);
    for (int k = 0; k < 2; k++)
        if (axes[k].at_low || axes[k].at_high) widest = bt_min(widest, WIDEST * (axes[k].high - axes[k].low));
    room_of(region, field, first, clearance);
    for (field->strip = bt_min(size, widest);; field->strip = bt_min(field->strip + size, widest)) {
        for (bt_idx i = 0; i < field->n; i++)
            held[i] = !parted[i] && !(to_cut(axes, field->pose + 3 * i) < field->strip);
        const double change = field->strip < widest ? MAX_CHANGE : LAST_CHANGE,
                     low = bt_field_area_at(field, clearance, held, 1 - change),
                     high = bt_field_area_at(field, clearance, held, 1 + change);
        if ((low <= wanted && wanted <= high) || field->strip == widest) {
            area = bt_field_fit(field, clearance, held, bt_max(low, wanted));
            break;
        }
    }
    // Room in a gap that one neighbour does not use is available to the other.
    for (int pass = 0; pass < MORE_PASSES && area < (1 - ROUND_OFF) * wanted; pass++) {
        room_of(region, field, first, clearance);
        area = bt_field_fit(field, clearance, held, wanted);
    }
    free(first);
    free(clearance);
    free(held);
    return area;
}

bt_status bt_field_cut(const bt_case *input, const bt_region *whole, const bt_region *region, double size,
                       bt_field *field, bt_errors *err)
{
    const axis axes[2] = {axis_of(region->x0, region->x1, whole->x0, whole->x1, whole->periodic_x),
                          axis_of(region->y0, region->y1, whole->y0, whole->y1, whole->periodic_y)};
    if (!(axes[0].at_low || axes[0].at_high || axes[1].at_low || axes[1].at_high)) return BT_OK;
    const int over_x = axes[0].period > 0, over_y = axes[1].period > 0;
    double *outline = bt_field_outlines(field);
    bool *parted = NULL;
    bt_field part = bt_field_like(field);
    for (bt_idx i = 0; i < field->n; i++)
        for (int ix = -over_x; ix <= over_x; ix++)
            for (int iy = -over_y; iy <= over_y; iy++)
                add_part(region, axes, field, outline, i, ix * axes[0].period, iy * axes[1].period, &part, &parted);
    free(outline);
    const double wanted = input->ice.concentration * region->ice_area,
                 area = part.n > 0 ? scale_strip(region, axes, parted, size, wanted, &part) : 0;
    free(parted);
    bt_field_free(field);
    *field = part;
    bt_field_sort(field, region);
    if (fabs(area - wanted) <= TOLERANCE * wanted) return BT_OK;
    return bt_fail(err, BT_ERR_CASE,
        "%s: ice.extent: the field cut to the ice region has a concentration of %.4g instead of %g, with floes scaled "
        "within %.3g m of the cut; use another ice.seed, smaller floes, or a larger ice region",
        bt_case_name(input), area / region->ice_area, input->ice.concentration, field->strip);
}
