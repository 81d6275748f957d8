// SPDX-License-Identifier: MIT
// Numbers that follow from a case; see case_derived.h and bergtow/case.h.
#include "case/case_derived.h"

#include <string.h>

#include "bergtow/outline.h"
#include "base/elementary.h"
#include "base/inside.h"
#include "base/name.h"
#include "base/table.h"
#include "case/size_law.h"
#include "geometry/box.h"

// --- shapes of the body ----------------------------------------------------------------------------------------------

const char *bt_body_shapes[BT_OWN_SHAPES + BT_MAX_ADDED_SHAPES + 1] = {BT_SHAPE_NAMES, "polygon", "none", NULL};
static bt_shape_outline added[BT_MAX_ADDED_SHAPES];
static int n_added;

/// Vertices, m, of a shape that has a name: neither polygon nor none. As bt_shape_named.
static int body_shape_named(bt_body_shape shape, double length, double width, double *v)
{
    const int k = (int)shape - BT_OWN_SHAPES;
    if (k >= 0) return added[k](length, width, v);
    return bt_shape_named(bt_body_shapes[shape], length, shape == BT_BODY_SQUARE ? length : width, v);
}

bt_status bt_shape_register(const char *name, bt_shape_outline outline, bt_errors *err)
{
    BT_PLAIN_NUMBERS;
    const size_t before = err->n;
    bool taken = false;
    for (int k = 0; name && bt_body_shapes[k]; k++) taken = taken || !strcmp(bt_body_shapes[k], name);
    bt_name_check("shape", name ? name : "", BT_MAX_LAW_NAME, taken, err);
    if (!outline) bt_errors_add(err, "shape %s: it has no function", name);
    if (n_added == BT_MAX_ADDED_SHAPES)
        bt_errors_add(err, "shape %s: there are %d of them; raise BT_MAX_ADDED_SHAPES", name, n_added);
    if (err->n > before) return BT_ERR_USAGE;
    double v[2 * BT_MAX_VERTICES];
    const int n = outline(2, 1, v);
    const char *fault = bt_shape_fault(n, v);
    if (fault)
        return bt_fail(err, BT_ERR_USAGE, "shape %s: at 2 m by 1 m it is not an outline: %s", name, fault);
    added[n_added] = outline;
    bt_body_shapes[BT_OWN_SHAPES + n_added++] = name;
    return BT_OK;
}

// --- numbers that follow ---------------------------------------------------------------------------------------------

double bt_case_rise(double ice_density, double water_density)
{
    BT_PLAIN_NUMBERS;
    return ice_density * (1 - ice_density / water_density) * BT_GRAVITY;
}

double bt_case_tow_sign(const bt_case *input)
{
    BT_PLAIN_NUMBERS;
    return bt_cos(input->tow.direction) < 0 ? -1 : 1;
}

/// fault: returns why an outline is refused, or NULL.
static int outline_of(bt_body_shape shape, double length, double width, int n, const double *vertices, double *v,
                      const char *(*fault)(int n, const double *v), const char **why)
{
    if (shape == BT_BODY_ABSENT) return 0;
    if (shape != BT_BODY_POLYGON)
        n = body_shape_named(shape, length, width, v);
    else if (n < 3 || n > BT_MAX_VERTICES) n = 0;
    else memcpy(v, vertices, (size_t)n * 2 * sizeof *v);
    const char *reason = fault(n, v);
    if (why) *why = reason;
    if (reason) return 0;
    n = bt_outline_clean(n, v); // of corners in a straight edge: contact takes it for one edge
    bt_shape_centre(n, v);
    return n;
}

int bt_case_outline(bt_body_shape shape, double length, double width, int n, const double *vertices, double *v,
                    const char **why)
{
    return outline_of(shape, length, width, n, vertices, v, bt_shape_fault, why);
}

/// Why the outline of a floe, which need not be convex, is refused, or NULL.
static const char *floe_fault(int n, const double *v)
{
    bt_parts parts;
    const char *why = bt_outline_fault(n, v);
    return why || bt_outline_convex(n, v) || bt_outline_split(n, v, &parts) ? why : BT_NO_PARTS;
}

int bt_case_floe_admit(const bt_floe_def *floe, double *v, const char **why)
{
    return outline_of(floe->shape, floe->length, floe->width, floe->n_vertices, floe->vertices, v, floe_fault, why);
}

int bt_case_floe_outline(const bt_floe_def *floe, double *v)
{
    BT_PLAIN_NUMBERS;
    return bt_case_floe_admit(floe, v, NULL);
}

int bt_case_waterline(const bt_case *input, double *v)
{
    BT_PLAIN_NUMBERS;
    return bt_case_outline(input->body.shape, input->body.length, input->body.width, input->body.n_vertices,
                           input->body.vertices, v, NULL);
}

double bt_case_body_length(const bt_case *input, double angle)
{
    if (input->body.shape != BT_BODY_POLYGON) return input->body.length;
    double v[2 * BT_MAX_VERTICES] = {0};
    const int n = bt_case_waterline(input, v);
    const double along = angle - input->body.yaw;
    return n ? bt_shape_width(n, v, -bt_sin(along), bt_cos(along)) : 0;
}

double bt_case_size_moment(const bt_case *input, int k)
{
    bt_sizes sizes;
    bt_errors refused = {0};
    const double moment = bt_sizes_init(&sizes, input, &refused) == BT_OK ? bt_sizes_moment(&sizes, k) : NAN;
    bt_errors_free(&refused);
    return moment;
}

double bt_case_mean_size(const bt_case *input)
{
    if (input->ice.size_law != BT_SIZE_POWER || bt_case_reads_field(input)) return input->ice.size;
    return bt_case_size_moment(input, 1);
}

bool bt_case_ice_is_random(const bt_case *input)
{
    if (input->ice.outlines) return input->ice.thickness_law == BT_THICK_LOGNORMAL && input->ice.thickness_spread > 0;
    return !input->ice.field && input->ice.concentration > 0;
}

bool bt_case_key_is_idle(const bt_case *input, const char *key)
{
    static const char *const made[] = {"ice.concentration", "ice.shape",       "ice.sides",    "ice.aspect",
                                       "ice.size",          "ice.size_law",    "ice.size_min", "ice.size_max",
                                       "ice.size_spread",   "ice.size_exponent", "ice.shake",
                                       "ice.extent.x_min",  "ice.extent.x_max",  "ice.extent.y_min", "ice.extent.y_max",
                                       // used by outlines without thickness; the last, by floes by hand
                                       "ice.thickness_law", "ice.thickness_spread", "ice.thickness"};
    enum { N = sizeof made / sizeof *made };
    const int n = !bt_case_reads_field(input) ? 0 : input->ice.outlines ? N - 3 : input->n_floes ? N - 1 : N;
    for (int k = 0; k < n; k++)
        if (!strcmp(made[k], key)) return true;
    return false;
}

void bt_case_ice_region(const bt_case *input, double low[2], double high[2])
{
    const double whole[4] = {input->domain.x0, input->domain.y0, input->domain.x0 + input->domain.length,
                             input->domain.y0 + input->domain.width},
                 given[4] = {input->ice.x_min, input->ice.y_min, input->ice.x_max, input->ice.y_max};
    const double *of = input->ice.field ? whole : given;
    for (int k = 0; k < 2; k++) low[k] = of[k], high[k] = of[2 + k];
}

double bt_case_made_area(const bt_case *input)
{
    if (bt_case_reads_field(input)) return 0;
    double area = (input->ice.x_max - input->ice.x_min) * (input->ice.y_max - input->ice.y_min);
    double v[2 * BT_MAX_VERTICES];
    int n = bt_case_waterline(input, v);
    bool inside =
        input->body.x > input->ice.x_min && input->body.x < input->ice.x_max && input->body.y > input->ice.y_min &&
        input->body.y < input->ice.y_max;
    if (n && inside) area -= bt_shape_moments(n, v).area;
    for (bt_idx i = 0; i < input->n_floes; i++) {
        const bt_floe_def *floe = &input->floes[i];
        if (floe->x > input->ice.x_min && floe->x < input->ice.x_max && floe->y > input->ice.y_min &&
            floe->y < input->ice.y_max && (n = bt_case_floe_outline(floe, v)))
            area -= bt_shape_moments(n, v).area;
    }
    return bt_max(0, input->ice.concentration * area);
}

bt_floe_means bt_case_hand_means(const bt_case *input)
{
    bt_floe_means mean = {0};
    double v[2 * BT_MAX_VERTICES];
    int64_t count = 0;
    for (bt_idx i = 0; i < input->n_floes; i++) {
        const int n = bt_case_floe_outline(&input->floes[i], v);
        if (!n || input->floes[i].fixed) continue;
        const double area = bt_shape_moments(n, v).area, thickness = input->floes[i].thickness;
        mean.size += sqrt(4 * area / BT_PI), mean.thickness += thickness, mean.volume += area * thickness;
        count++;
    }
    if (count == 0) return mean;
    return (bt_floe_means){mean.size / (double)count, mean.thickness / (double)count, mean.volume / (double)count};
}

int64_t bt_case_nonconvex_by_hand(const bt_case *input)
{
    double v[2 * BT_MAX_VERTICES];
    int64_t count = 0;
    for (bt_idx i = 0; i < input->n_floes; i++) {
        const int n = bt_case_floe_outline(&input->floes[i], v);
        count += n && !input->floes[i].fixed && !bt_outline_convex(n, v);
    }
    return count;
}

double bt_case_area_by_hand(const bt_case *input)
{
    double area = 0, v[2 * BT_MAX_VERTICES];
    for (bt_idx i = 0; i < input->n_floes; i++) {
        const int n = bt_case_floe_outline(&input->floes[i], v);
        if (n) area += bt_shape_moments(n, v).area;
    }
    return area;
}

double bt_case_expected_floes(const bt_case *input)
{
    if (bt_case_reads_field(input) || input->ice.concentration == 0) return 0; // a power law may then have no limits
    const double mean_area = BT_PI / 4 * bt_case_size_moment(input, 2);
    return mean_area > 0 ? bt_max(0, bt_case_made_area(input) / mean_area) : 0; // a refused law makes none
}

// Extend a region (low, high) and its domain along one axis.
static void extend(double from, double to, double *low, double *high, double *x0, double *length, bt_bound *bound)
{
    // An end given as none (NaN) is that of the region; an end within the region has been refused.
    const double first = fmin(from, *low), last = fmax(to, *high), slack = 1e-9 * *length;
    if (first == *low && last == *high) return;
    if (!(fabs(*low - *x0) <= slack && fabs(*high - *x0 - *length) <= slack)) *bound = BT_BOUND_WALL;
    *low = *x0 = first, *high = last, *length = last - first;
}

bt_case bt_case_of_extent(const bt_case *input)
{
    bt_case of = *input;
    extend(input->ice.extent_x_min, input->ice.extent_x_max, &of.ice.x_min, &of.ice.x_max, &of.domain.x0,
           &of.domain.length, &of.domain.ends);
    extend(input->ice.extent_y_min, input->ice.extent_y_max, &of.ice.y_min, &of.ice.y_max, &of.domain.y0,
           &of.domain.width, &of.domain.sides);
    return of;
}

bool bt_case_cuts_ice(const bt_case *input)
{
    const bt_case of = bt_case_of_extent(input);
    return of.ice.x_min < input->ice.x_min || of.ice.x_max > input->ice.x_max || of.ice.y_min < input->ice.y_min ||
           of.ice.y_max > input->ice.y_max;
}

double bt_case_period(const bt_case *input)
{
    return bt_min(bt_bound_wraps(input->domain.ends) ? input->domain.length : INFINITY,
                  bt_bound_wraps(input->domain.sides) ? input->domain.width : INFINITY);
}

double bt_case_floes_made(const bt_case *input)
{
    const bt_case of = bt_case_of_extent(input);
    return bt_case_expected_floes(&of);
}

int64_t bt_case_steps(const bt_case *input)
{
    BT_PLAIN_NUMBERS;
    double steps = ceil(input->run.duration / input->run.dt * (1 - 1e-12));
    return steps < 0x1p62 ? (int64_t)steps : INT64_MAX; // a refused case may ask for more than fits
}

double bt_case_body_mass(const bt_case *input)
{
    BT_PLAIN_NUMBERS;
    double v[2 * BT_MAX_VERTICES];
    int n = bt_case_waterline(input, v);
    if (!n) return 0;
    if (input->body.mass > 0) return input->body.mass;
    return input->body.density * bt_shape_moments(n, v).area * (input->body.draft + input->body.sail);
}

double bt_case_reference_speed(const bt_case *input)
{
    BT_PLAIN_NUMBERS;
    if (input->solver.reference_speed > 0) return input->solver.reference_speed;
    if (input->tow.mode != BT_TOW_NONE && input->tow.speed > 0) return input->tow.speed;
    double u = bt_max(input->domain.ends_closing, input->domain.sides_closing);
    u = bt_max(u, bt_case_fastest_flow(input, true));
    // A velocity that is not given is that of free drift.
    if (input->body.shape != BT_BODY_ABSENT && !isnan(input->body.vx))
        u = bt_max(u, bt_hypot(input->body.vx, input->body.vy));
    for (bt_idx i = 0; i < input->n_floes; i++)
        if (!isnan(input->floes[i].vx)) u = bt_max(u, bt_hypot(input->floes[i].vx, input->floes[i].vy));
    // Free drift of ice is about 2 % of the wind (Nansen's rule).
    u = bt_max(u, 0.02 * bt_case_fastest_flow(input, false));
    return u > 0 ? u : 0.1;
}

double bt_case_fastest_flow(const bt_case *input, bool water)
{
    const bt_table *table = water ? &input->water.table : &input->air.table;
    if (table->n > 0) return bt_table_fastest(table);
    if (!water) return bt_hypot(input->air.wind_x, input->air.wind_y);
    return bt_hypot(input->water.current_x, input->water.current_y) +
           bt_max(input->water.tide.major, fabs(input->water.tide.minor));
}
