// SPDX-License-Identifier: MIT
// The generator: draw sizes, make cells, shrink floes to the concentration, shake, check, sort.
//
// Floes are drawn from the size law until their areas fill concentration × ice area; a common factor (near 1) makes it
// exact. Cells (tessellation, sawn strips) fill the region in the same proportions. A floe is its cell scaled about the
// centroid, so cells prove that floes do not overlap before the shake; after it, separating axes do. Regular polygons
// do not fill their cells: they grow from where they fit, in stages between shakes (after Lubachevsky & Stillinger
// 1990, J. Stat. Phys. 60).
#include "field/field_make.h"

#include <math.h>
#include <stdlib.h>

#include "base/elementary.h"
#include "base/inside.h"
#include "base/largest.h"
#include "base/rng.h"
#include "case/case_derived.h"
#include "case/ice_bounds.h"
#include "case/size_law.h"
#include "case/warning.h"

// --- sizes -----------------------------------------------------------------------------------------------------------

// Floe sizes as drawn from the law of the case (case/size_law.h), and as they come out.

#define LEAST_SPREAD 1e-6 // a narrower spread counts as none: 1/spread² may overflow

double bt_sizes_draw(const bt_sizes *sizes, int64_t seed, int64_t id)
{
    bt_rng rng = bt_rng_start(seed, BT_RNG_SIZE, id);
    if (sizes->law == BT_SIZE_POWER) {
        // inverse of P(>d) = u
        double q = bt_pow(sizes->max / sizes->min, -sizes->exponent), u = 1 - bt_rng_uniform(&rng);
        return sizes->min * bt_pow(q + u * (1 - q), -1 / sizes->exponent);
    }
    if (sizes->spread < LEAST_SPREAD) return sizes->mean;
    for (;;) {
        double d;
        if (sizes->law == BT_SIZE_LOGNORMAL) {
            d = bt_exp(sizes->mu + sizes->sigma * bt_rng_normal(&rng));
            if (d >= sizes->min && (sizes->max <= 0 || d <= sizes->max)) return d;
        } else {
            d = sizes->scale * bt_rng_gamma(&rng, 1 / (sizes->spread * sizes->spread));
            if (d >= BT_SINGLE_LEAST * sizes->mean) return d;
        }
    }
}

#define UNPLACED 0.01   // share of the floes drawn without a place that is reported
#define SIZE_OFF 0.05   // relative deviation of the mean size that is reported
#define SPREAD_OFF 0.1  // likewise of the spread
#define BELOW_OFF 0.01  // share of floes below size_min that is reported
#define BELOW_SLACK 1e-2 // of size_min, by which the common factor near 1 may shrink floes below it

/// Is every floe whole, one drawn from the size law, and put into a cell? Beside a body rectangles are cut.
static bool as_drawn(const bt_case *input)
{
    return !bt_case_reads_field(input) && input->lead.mode == BT_LEAD_NONE && !bt_case_cuts_ice(input);
}

bt_field_sizes bt_field_sizes_of(const bt_case *input, const bt_field *field)
{
    BT_PLAIN_NUMBERS;
    // The cells of rectangles have the areas drawn: what is smaller is a part, beside a body.
    const double limit = as_drawn(input) && input->ice.size_law != BT_SIZE_SINGLE &&
                                 input->ice.shape != BT_ICE_RECTANGLES
                         ? (1 - BELOW_SLACK) * input->ice.size_min : 0;
    bt_field_sizes sizes = {.n = field->n, .mean = bt_field_mean_size(field), .least = INFINITY,
                            .drawn = field->drawn, .unplaced = field->unplaced};
    for (bt_idx i = 0; i < field->n; i++) {
        const double d = sqrt(4 * field->area[i] / BT_PI);
        sizes.below += d < limit;
        sizes.least = bt_min(sizes.least, d);
    }
    return sizes;
}

void bt_field_size_warn(const bt_case *input, const bt_field_sizes *found, bt_errors *warnings)
{
    BT_PLAIN_NUMBERS;
    bt_sizes sizes;
    bt_errors refused = {0}; // a case with faulty sizes makes no ice
    const bt_idx n = found->n;
    if ((double)found->unplaced > UNPLACED * (double)found->drawn)
        bt_warn(warnings, BT_WARN_UNPLACED,
                "%lld of the %lld floes drawn, %.2g %%, found no place among larger ones and are missing, most of them "
                "small: the sizes do not follow ice.size_law; narrow their range, or set ice.shape: rectangles, which "
                "has a place for each",
                (long long)found->unplaced, (long long)found->drawn,
                100 * (double)found->unplaced / (double)found->drawn);
    if (as_drawn(input) && n > 0 && bt_sizes_init(&sizes, input, &refused) == BT_OK) {
        const double mean = bt_sizes_mean(&sizes), second = bt_sizes_mean_area(&sizes) * 4 / BT_PI;
        const double scatter = sqrt(bt_max(second - mean * mean, 0) / n), off = found->mean - mean;
        if (fabs(off) > SIZE_OFF * mean && fabs(off) > 2 * scatter)
            bt_warn(warnings, BT_WARN_MEAN_SIZE,
                    "the %d floes have a mean diameter of %.3g m, %.0f %% %s than that of ice.size_law; use the "
                    "diameter obtained",
                    (int)n, found->mean, 100 * fabs(off) / mean, off > 0 ? "more" : "less");
        const double spread = sqrt(bt_max(second - mean * mean, 0)) / mean;
        if (sizes.law != BT_SIZE_POWER && spread < (1 - SPREAD_OFF) * sizes.spread)
            bt_warn(warnings, BT_WARN_SPREAD,
                    "%s the sizes a spread of %.2g, where ice.size_spread asks for %.2g: sizes drawn beyond them are "
                    "drawn again; %slower ice.size_spread",
                    sizes.law == BT_SIZE_LOGNORMAL ? "ice.size_min and ice.size_max leave"
                                                   : "a least size of a tenth of the mean leaves",
                    spread, sizes.spread, sizes.law == BT_SIZE_LOGNORMAL ? "move them apart, or " : "");
        if (found->below > BELOW_OFF * n)
            bt_warn(warnings, BT_WARN_SMALL_FLOES,
                    "%d of the %d floes, %.2g %%, are smaller than ice.size_min, down to %.3g m: small floes fill the "
                    "room that larger ones leave; narrow the range of sizes, or lower the concentration",
                    (int)found->below, (int)n, 100.0 * found->below / n, found->least);
    }
    bt_errors_free(&refused);
}

// --- making ----------------------------------------------------------------------------------------------------------

static const double CLEARANCE = 2e-3; // water kept around obstacles / mean size
static const double TOUCH = 1 - 1e-9; // part of the clearance used: rounding must not turn touching into overlap
static const double STRIDE = 0.3;     // move of a floe in a step of the shake / mean gap
static const double PUSH = 1.02;      // growth of a floe that has no room
static const double GROWN = 1e-3;     // shortfall of area at which a growing floe counts as grown
static const double MORE_GAPS = 10;    // length of another shake, if one leaves floes in each other / mean gap
static const double MOST = 0.06;      // largest move in a step / mean size: then a floe turns by a tenth of a radian
// Concentration to ask for / the one at which growing polygons gave up, where large ones have grown and small ones have
// not: ten refused cases could be made there. Rejected: the share of its goal that every floe has reached, which one
// floe without room sets (0.3 where 0.82 can be made).
static const double SAFE = 0.96;
enum { GROWTH_STAGES = 120, MORE_SHAKES = 3 };

static bt_status cannot_pack(const bt_case *input, double reached, bt_errors *err)
{
    static const char *const names[] = {[BT_ICE_VORONOI] = "voronoi floes", [BT_ICE_RECTANGLES] = "rectangles",
                                        [BT_ICE_POLYGONS] = "regular polygons"};
    return bt_fail(err, BT_ERR_CASE,
        "%s: ice.concentration: cannot pack %s to %g in this region; ask for at most about %.2f, or choose another "
        "ice.shape, size or region",
        bt_case_name(input), names[input->ice.shape], input->ice.concentration, floor(reached * 99) / 100);
}

// Target areas of all floes, m²; [*n], caller frees.
static bt_status draw_targets(const bt_case *input, const bt_sizes *sizes, double wanted, double **target, bt_idx *n,
                              bt_errors *err)
{
    double expected = wanted / bt_sizes_mean_area(sizes);
    if (expected > BT_MAX_FLOES)
        return bt_fail(err, BT_ERR_CASE,
            "%s: ice.size: %g m makes about %.3g floes, more than %d; ask for larger floes or a smaller region",
            bt_case_name(input), bt_sizes_mean(sizes), expected, BT_MAX_FLOES);
    size_t cap = 64;
    *target = bt_alloc(cap, sizeof **target);
    *n = 0;
    double sum = 0;
    for (;;) {
        double d = bt_sizes_draw(sizes, input->ice.seed, *n), a = BT_PI / 4 * d * d;
        if (*n > 0 && wanted - sum < a / 2) break; // nearer without it
        if ((size_t)*n == cap) *target = bt_realloc(*target, cap *= 2, sizeof **target);
        (*target)[(*n)++] = a;
        sum += a;
        if (sum >= wanted) break;
    }
    if (sum > 2 * wanted) {
        bt_errors_add(
            err,
            "%s: ice.size: one floe of %g m is larger than all the requested ice (%g m²); ask for smaller floes, a "
            "larger region, or ice.concentration: 0",
            bt_case_name(input), bt_sizes_mean(sizes), wanted);
        free(*target);
        return BT_ERR_CASE;
    }
    for (bt_idx i = 0; i < *n; i++) (*target)[i] *= wanted / sum;
    return BT_OK;
}

static double total_area(const bt_field *field)
{
    double sum = 0;
    for (bt_idx i = 0; i < field->n; i++) sum += field->area[i];
    return sum;
}

static double mean_gap(const bt_region *region, const bt_field *field, double *size)
{
    double d = 0, area = total_area(field);
    for (bt_idx i = 0; i < field->n; i++) d += 2 * sqrt(field->area[i] / BT_PI) / field->n;
    *size = d;
    double root = sqrt(area / region->ice_area);
    // Gap between floes of diameter d in cells of diameter d/√c. In sparse ice, a third of the spacing replaces it, so
    // that a shake of fifteen gaps is five spacings, enough to forget a lattice.
    return d / root * bt_min(1 - root, 1.0 / 3);
}

// Cells of the case's kind. wanted: area of all floes, m².
static bt_tessellation make_cells(const bt_case *input, const bt_region *region, bt_idx n, const double *target,
                                  double wanted)
{
    if (input->ice.shape != BT_ICE_RECTANGLES) return bt_tessellation_tessellate(region, n, target, input->ice.seed);
    double aspect = input->ice.aspect > 0 ? bt_max(input->ice.aspect, 1 / input->ice.aspect) : 1;
    // Around an obstacle rectangles stay rectangles, unless that wastes too much water.
    for (int effort = 0;; effort++) {
        bt_tessellation cells = bt_tessellation_saw(region, n, target, aspect, input->ice.seed, effort);
        double fill = 0;
        for (bt_idx i = 0; i < cells.n; i++) fill += bt_shape_centroid(cells.nv[i], cells.v[i]).area;
        if (region->n_obstacles == 0 || effort == 2 || fill > 1.003 * wanted) return cells;
        bt_tessellation_free(&cells);
    }
}

// One floe per cell, the cell shrunk to the target area; all floes together make up for what does not fit.
static bt_status floes_from_cells(const bt_case *input, const bt_region *region, const bt_tessellation *cells,
                                  double wanted, bt_field *field, bt_errors *err)
{
    double *clearance = bt_alloc((size_t)cells->n, sizeof *clearance);
    for (bt_idx i = 0; i < cells->n; i++) {
        if (cells->nv[i] < 3) continue;
        bt_idx k = field->n;
        bt_field_add(field, cells->nv[i], cells->v[i], 0, 0, 0, 0);
        bt_region_wrap(region, &field->pose[3 * k], &field->pose[3 * k + 1]);
        double s = sqrt(cells->target[i] / field->area[k]);
        bt_field_scale(field, k, s);
        clearance[k] = (1 - 1e-6) / s;
    }
    double reached = bt_field_fit(field, clearance, NULL, wanted);
    free(clearance);
    return reached > (1 - 1e-6) * wanted ? BT_OK : cannot_pack(input, reached / region->ice_area, err);
}

// Largest factor by which polygon v, centred at (x, y), fits into the cell.
static double fit_into(int nc, const double *cell, double x, double y, int n, const double *v, double c, double s)
{
    double t = INFINITY;
    for (int i = 0; i < nc; i++) {
        const double *p = cell + 2 * i, *q = cell + 2 * ((i + 1) % nc);
        double nx = q[1] - p[1], ny = p[0] - q[0], h = 0;
        for (int k = 0; k < n; k++)
            h = bt_max(h, nx * (c * v[2 * k] - s * v[2 * k + 1]) + ny * (s * v[2 * k] + c * v[2 * k + 1]));
        t = bt_min(t, (nx * (p[0] - x) + ny * (p[1] - y)) / h);
    }
    return t;
}

// Regular polygons as large as fit in their cells, then grown between shakes until each has its target area.
static bt_status polygons_in_cells(const bt_case *input, const bt_region *region, const bt_tessellation *cells,
                                   double wanted, bt_field *field, bt_errors *err)
{
    int sides = (int)input->ice.sides;
    if (input->ice.sides < 3 || input->ice.sides > 32)
        return bt_fail(err, BT_ERR_CASE,
            "%s: ice.sides: %lld is refused: a regular polygon has 3 to 32 sides here", bt_case_name(input),
            (long long)input->ice.sides);
    double sum = 0, v[2 * 32];
    for (bt_idx i = 0; i < cells->n; i++)
        if (cells->nv[i] >= 3) sum += cells->target[i];
    double *goal = bt_alloc((size_t)cells->n, sizeof *goal), *clearance = bt_alloc((size_t)cells->n, sizeof *clearance);
    for (bt_idx i = 0; i < cells->n; i++) {
        if (cells->nv[i] < 3) continue;
        bt_moments moments = bt_shape_centroid(cells->nv[i], cells->v[i]);
        bt_rng rng = bt_rng_start(input->ice.seed, BT_RNG_ORIENT, i);
        double yaw = 2 * BT_PI * bt_rng_uniform(&rng);
        bt_idx k = field->n;
        goal[k] = cells->target[i] * wanted / sum;
        bt_shape_regular(sides, goal[k], v);
        double t = fit_into(cells->nv[i], cells->v[i], moments.cx, moments.cy, sides, v, bt_cos(yaw), bt_sin(yaw));
        bt_field_add(field, sides, v, moments.cx, moments.cy, yaw, 0);
        bt_region_wrap(region, &field->pose[3 * k], &field->pose[3 * k + 1]);
        bt_field_scale(field, k, bt_min(1, 0.999 * t));
    }
    bt_status status = BT_OK;
    double best_area = 0, best_least = 0;
    int idle = 0;
    for (int stage = 1; status == BT_OK; stage++) {
        bt_field_growth(region, field, 2, clearance);
        double least = 1; // least area / goal of all floes
        for (bt_idx i = 0; i < field->n; i++) {
            if (clearance[i] < 1) bt_field_scale(field, i, TOUCH * clearance[i]);
            least = bt_min(least, field->area[i] / goal[i]);
        }
        double area = total_area(field);
        // A shake leaves overlaps of about its slop. Removing them has just cost that much area; settled() restores it.
        if (least > 1 - GROWN) break;
        idle = area > best_area * (1 + 2e-4) || least > best_least + 2e-3 ? 0 : idle + 1;
        best_area = bt_max(best_area, area);
        best_least = bt_max(best_least, least);
        if (stage > GROWTH_STAGES || idle > 8) {
            status = cannot_pack(input, SAFE * best_area / region->ice_area, err);
            break;
        }
        double size, gap = mean_gap(region, field, &size);
        for (bt_idx i = 0; i < field->n; i++) {
            // A floe without room still grows a little: the shake's position projection pushes its neighbours away, so
            // that grown floes do not trap it.
            bt_field_scale(field, i,
                           bt_min(sqrt(goal[i] / field->area[i]), bt_max(PUSH, 1 + 0.8 * (clearance[i] - 1))));
        }
        status = bt_field_shake(input, region, field, 2.5 * gap, bt_min(STRIDE * gap, MOST * size), stage, err);
    }
    free(goal);
    free(clearance);
    return status;
}

// Remove the overlap that the shake has left, and restore the area asked for; false, with the reason, if impossible.
static bool settled(const bt_region *region, bt_field *field, double wanted, char why[160])
{
    double *clearance = bt_alloc((size_t)field->n, sizeof *clearance);
    bt_field_growth(region, field, 1.2, clearance);
    bool good = true;
    for (bt_idx i = 0; i < field->n && good; i++) {
        clearance[i] *= TOUCH;
        good = clearance[i] > 0.9;
        if (!good) snprintf(why, 160, "floe %lld is stuck in another after the shake", (long long)i);
    }
    const double reached = good ? bt_field_fit(field, clearance, NULL, wanted) : wanted;
    if (reached < 0.995 * wanted) {
        snprintf(why, 160, "concentration %g after the shake instead of %g", reached / region->ice_area,
                 wanted / region->ice_area);
        good = false;
    }
    free(clearance);
    return good;
}

double bt_field_thickness(const bt_case *input, bt_idx i)
{
    BT_PLAIN_NUMBERS;
    // ln h ~ N(μ, σ) with the mean and standard deviation asked for
    double h = input->ice.thickness, s2 = bt_log1p(input->ice.thickness_spread * input->ice.thickness_spread);
    if (input->ice.thickness_law != BT_THICK_LOGNORMAL || s2 == 0) return h;
    bt_rng rng = bt_rng_start(input->ice.seed, BT_RNG_THICKNESS, i);
    double least, most;
    bt_ice_thickness_range(&least, &most);
    return bt_min(most, bt_max(least, h * bt_exp(sqrt(s2) * bt_rng_normal(&rng) - s2 / 2)));
}

static bt_status make(const bt_case *input, const bt_region *region, const bt_sizes *sizes, bt_field *field,
                      bt_errors *err)
{
    double wanted = input->ice.concentration * region->ice_area, *target = NULL;
    bt_idx n = 0;
    bt_status status = draw_targets(input, sizes, wanted, &target, &n, err);
    if (status != BT_OK) return status;
    bt_tessellation cells = make_cells(input, region, n, target, wanted);
    free(target);
    field->drawn = n;
    for (bt_idx i = 0; i < cells.n; i++) field->unplaced += cells.nv[i] < 3;
    status = input->ice.shape == BT_ICE_POLYGONS ? polygons_in_cells(input, region, &cells, wanted, field, err)
                                                 : floes_from_cells(input, region, &cells, wanted, field, err);
    bt_tessellation_free(&cells);
    if (status != BT_OK) return status;
    bt_field_sort(field, region);
    double size, gap = mean_gap(region, field, &size);
    // A floe that turns fast may briefly lie deep in another. More flight separates the two, rest does not. Rarely (in
    // one of 1,500 random cases) the shake ends at such a moment.
    for (int again = 0; status == BT_OK && again <= MORE_SHAKES; again++) {
        const double length = again ? MORE_GAPS : input->ice.shake;
        status = bt_field_shake(input, region, field, length * gap, bt_min(STRIDE * gap, MOST * size),
                                again ? GROWTH_STAGES + 1 + again : 0, err);
        char why[160];
        if (status != BT_OK || settled(region, field, wanted, why)) break;
        if (again < MORE_SHAKES && input->ice.shake > 0) continue;
        status = bt_fail(err, BT_ERR_NUMERIC,
                         "%s: ice field: %s; change ice.seed, or lower ice.shake", bt_case_name(input), why);
    }
    if (status != BT_OK) return status;
    bt_field_sort(field, region);
    for (bt_idx i = 0; i < field->n; i++) field->thickness[i] = bt_field_thickness(input, i);
    return BT_OK;
}

bt_status bt_field_generate(const bt_case *input, bt_field *field, bt_errors *err)
{
    BT_PLAIN_NUMBERS;
    bt_field_free(field);
    bt_field_init(field);
    bt_sizes sizes;
    bt_status status = bt_sizes_init(&sizes, input, err);
    if (status != BT_OK) return status;
    // Make the field of the extent; if that is larger than the ice region, cut it afterwards.
    const bt_case whole = bt_case_of_extent(input);
    bt_region region, of;
    status = bt_region_init(&region, input, CLEARANCE * bt_sizes_mean(&sizes), err);
    if (status == BT_OK) {
        status = bt_region_init(&of, &whole, region.clearance, err);
        if (status == BT_OK && input->ice.concentration > 0) {
            status = make(&whole, &of, &sizes, field, err);
            if (status == BT_OK) status = bt_field_cut(input, &of, &region, bt_sizes_mean(&sizes), field, err);
        }
        bt_region_free(&of);
    }
    field->ice_area = region.ice_area;
    field->concentration = region.ice_area > 0 ? total_area(field) / region.ice_area : 0;
    bt_region_free(&region);
    if (status != BT_OK) {
        bt_field_free(field);
        bt_field_init(field);
    }
    return status;
}
