// SPDX-License-Identifier: MIT
// The ice field: concentration, no overlap, randomness and size laws of every generator.
#include <omp.h>

#include "test.h"
#include "bergtow/contact.h"
#include "bergtow/field.h"
#include "bergtow/forces.h"
#include "bergtow/shape.h"
#include "field/field_make.h"

// A basin of 36 m × 10 m with floes of 1 m and a disc of 2.5 m at (5, 0).
static bt_case basin(void)
{
    bt_case c = {.path = (char *)"test.yml"};
    c.domain.length = 36, c.domain.width = 10, c.domain.y0 = -5;
    c.ice.x_max = 36, c.ice.y_min = -5, c.ice.y_max = 5;
    c.ice.concentration = 0.8, c.ice.size = 1, c.ice.size_spread = 0.3, c.ice.size_exponent = 2;
    c.ice.sides = 6, c.ice.aspect = 1.5, c.ice.thickness = 0.04, c.ice.seed = 7, c.ice.shake = 15;
    c.body.shape = BT_BODY_DISC, c.body.length = c.body.width = 2.5, c.body.x = 5;
    return c;
}

static bt_field made(const bt_case *c)
{
    bt_field f;
    bt_errors err = {0};
    bt_field_init(&f);
    bt_status status = bt_field_generate(c, &f, &err);
    if (status != BT_OK) fail_msg("status %d: %s", status, err.n ? err.text[0] : "");
    assert_int_equal(err.n, 0);
    bt_errors_free(&err);
    return f;
}

// ---- an overlap test of its own: vertices in place, all pairs, all images ----

typedef struct polygon {
    int n;
    double v[2 * BT_MAX_VERTICES];
} polygon;

static polygon in_place(const bt_field *f, bt_idx i)
{
    polygon p = {.n = (int)(f->offsets[i + 1] - f->offsets[i])};
    double c = cos(f->pose[3 * i + 2]), s = sin(f->pose[3 * i + 2]);
    for (int k = 0; k < p.n; k++) {
        const double *v = f->vertices + 2 * (f->offsets[i] + k);
        p.v[2 * k] = f->pose[3 * i] + c * v[0] - s * v[1];
        p.v[2 * k + 1] = f->pose[3 * i + 1] + s * v[0] + c * v[1];
    }
    return p;
}

// Largest separation along the edge normals of a; < 0 if none separates.
static double separation(const polygon *a, const polygon *b, double dx, double dy)
{
    double best = -INFINITY;
    for (int i = 0; i < a->n; i++) {
        const double *p = a->v + 2 * i, *q = a->v + 2 * ((i + 1) % a->n);
        double l = hypot(q[0] - p[0], q[1] - p[1]), nx = (q[1] - p[1]) / l, ny = (p[0] - q[0]) / l, low = INFINITY;
        for (int k = 0; k < b->n; k++)
            low = fmin(low, nx * (b->v[2 * k] + dx - p[0]) + ny * (b->v[2 * k + 1] + dy - p[1]));
        best = fmax(best, low);
    }
    return best;
}

static double gap(const polygon *a, const polygon *b, double dx, double dy)
{
    return fmax(separation(a, b, dx, dy), separation(b, a, -dx, -dy));
}

static polygon *all_in_place(const bt_field *f)
{
    polygon *p = malloc((size_t)(f->n + 1) * sizeof *p);
    for (bt_idx i = 0; i < f->n; i++) p[i] = in_place(f, i);
    return p;
}

// Least gap of all pairs, and of each floe to its nearest neighbour if `nearest` is given.
static double least_gap(const bt_case *c, const bt_field *f, double *nearest)
{
    polygon *p = all_in_place(f);
    double least = INFINITY, far = 3 * c->ice.size;
    int ix = c->domain.ends == BT_BOUND_PERIODIC, iy = c->domain.sides == BT_BOUND_PERIODIC;
    for (bt_idx i = 0; nearest && i < f->n; i++) nearest[i] = INFINITY;
    for (bt_idx i = 0; i < f->n; i++)
        for (bt_idx j = i + 1; j < f->n; j++)
            for (int kx = -ix; kx <= ix; kx++)
                for (int ky = -iy; ky <= iy; ky++) {
                    double dx = kx * c->domain.length, dy = ky * c->domain.width;
                    double d =
                        hypot(f->pose[3 * j] + dx - f->pose[3 * i], f->pose[3 * j + 1] + dy - f->pose[3 * i + 1]);
                    if (d > 4 * far) continue;
                    double g = gap(&p[i], &p[j], dx, dy);
                    least = fmin(least, g);
                    if (nearest) nearest[i] = fmin(nearest[i], g), nearest[j] = fmin(nearest[j], g);
                }
    free(p);
    return least;
}

static double least_gap_to(const polygon *b, const bt_field *f)
{
    double least = INFINITY;
    for (bt_idx i = 0; i < f->n; i++) {
        const polygon p = in_place(f, i);
        least = fmin(least, gap(&p, b, 0, 0));
    }
    return least;
}

static polygon body_in_place(const bt_case *c)
{
    polygon b;
    b.n = bt_case_waterline(c, b.v);
    double cs = cos(c->body.yaw), sn = sin(c->body.yaw);
    for (int k = 0; k < b.n; k++) {
        double x = b.v[2 * k], y = b.v[2 * k + 1];
        b.v[2 * k] = c->body.x + cs * x - sn * y;
        b.v[2 * k + 1] = c->body.y + sn * x + cs * y;
    }
    return b;
}

// Everything a field must be, whatever made it.
static void assert_sound_within(const bt_case *c, const bt_field *f, const char *what, double tolerance)
{
    double sum = 0, round_off = 1e-12 * c->domain.length;
    polygon body = body_in_place(c);
    for (bt_idx i = 0; i < f->n; i++) {
        const char *fault = bt_shape_fault((int)(f->offsets[i + 1] - f->offsets[i]), f->vertices + 2 * f->offsets[i]);
        if (fault) fail_msg("%s: floe %d: %s", what, i, fault);
        polygon p = in_place(f, i);
        bt_moments m = bt_shape_moments(p.n, p.v);
        sum += m.area;
        assert_true(fabs(m.area - f->area[i]) < 1e-9 * m.area);
        assert_true(hypot(m.cx - f->pose[3 * i], m.cy - f->pose[3 * i + 1]) < 1e-9 * c->domain.length);
        for (int k = 0; k < p.n; k++) {
            bool in_x = c->domain.ends == BT_BOUND_PERIODIC ||
                        (p.v[2 * k] >= c->ice.x_min - round_off && p.v[2 * k] <= c->ice.x_max + round_off);
            bool in_y = c->domain.sides == BT_BOUND_PERIODIC ||
                        (p.v[2 * k + 1] >= c->ice.y_min - round_off && p.v[2 * k + 1] <= c->ice.y_max + round_off);
            if (!in_x || !in_y)
                fail_msg("%s: floe %d sticks out at (%.17g, %.17g)", what, i, p.v[2 * k], p.v[2 * k + 1]);
        }
        for (int kx = -1; body.n && kx <= 1; kx++)
            for (int ky = -1; ky <= 1; ky++) {
                if ((kx && c->domain.ends != BT_BOUND_PERIODIC) || (ky && c->domain.sides != BT_BOUND_PERIODIC))
                    continue;
                double g = gap(&p, &body, kx * c->domain.length, ky * c->domain.width);
                if (g < 0) fail_msg("%s: floe %d is %g m inside the body", what, i, -g);
            }
    }
    double least = least_gap(c, f, NULL);
    if (least < -round_off) fail_msg("%s: floes overlap by %g m", what, -least);
    double wanted = c->ice.concentration * f->ice_area;
    if (!(fabs(sum - wanted) <= tolerance * wanted)) fail_msg("%s: concentration %.9f", what, sum / f->ice_area);
    assert_true(fabs(f->concentration - sum / f->ice_area) < 1e-9);
}

static void assert_sound(const bt_case *c, const bt_field *f, const char *what)
{
    assert_sound_within(c, f, what, 1e-6);
}

static void assert_makes(bt_case c, bt_ice_shape shape, double concentration, const char *what)
{
    char name[100];
    snprintf(name, sizeof name, "%s at %g", what, concentration);
    c.ice.shape = shape;
    c.ice.concentration = concentration;
    bt_field f = made(&c);
    assert_sound(&c, &f, name);
    assert_true((f.n > 0) == (concentration > 0));
    bt_field_free(&f);
}

TEST(test_voronoi)
{
    const double all[] = {0, 0.2, 0.5, 0.8, 0.95};
    for (int k = 0; k < 5; k++) assert_makes(basin(), BT_ICE_VORONOI, all[k], "voronoi");
}

TEST(test_rectangles)
{
    const double all[] = {0, 0.2, 0.5, 0.8, 0.95};
    for (int k = 0; k < 5; k++) assert_makes(basin(), BT_ICE_RECTANGLES, all[k], "rectangles");
    // away from the body every floe is a rectangle, with the aspect asked for where there is room
    bt_case c = basin();
    c.body.shape = BT_BODY_ABSENT, c.ice.shape = BT_ICE_RECTANGLES, c.ice.concentration = 0.3, c.ice.aspect = 2;
    bt_field f = made(&c);
    for (bt_idx i = 0; i < f.n; i++) {
        const double *v = f.vertices + 2 * f.offsets[i];
        assert_int_equal(f.offsets[i + 1] - f.offsets[i], 4);
        double a = hypot(v[2] - v[0], v[3] - v[1]), b = hypot(v[4] - v[2], v[5] - v[3]);
        assert_true(fabs((v[2] - v[0]) * (v[4] - v[2]) + (v[3] - v[1]) * (v[5] - v[3])) < 1e-9);
        assert_true(fabs(fmax(a, b) / fmin(a, b) - 2) < 1e-6);
    }
    bt_field_free(&f);
}

TEST(test_polygons)
{
    const double all[] = {0.2, 0.5, 0.7};
    for (int sides = 4; sides <= 6; sides += 2)
        for (int k = 0; k < 3; k++) {
            bt_case c = basin();
            c.ice.sides = sides, c.ice.size_spread = 0, c.domain.length = c.ice.x_max = 24;
            assert_makes(c, BT_ICE_POLYGONS, all[k], sides == 4 ? "squares" : "hexagons");
        }
    bt_case c = basin();
    c.ice.shape = BT_ICE_POLYGONS, c.ice.concentration = 0.6, c.ice.size_spread = 0;
    bt_field f = made(&c);
    double first = f.area[0];
    for (bt_idx i = 0; i < f.n; i++) { // all alike and regular
        assert_true(fabs(f.area[i] - first) < 0.005 * first);
        bt_moments m = bt_shape_moments(6, f.vertices + 2 * f.offsets[i]);
        assert_true(fabs(m.inradius / m.radius - sqrt(0.75)) < 1e-9);
    }
    bt_field_free(&f);
}

TEST(test_surroundings)
{
    // periodic both ways, the body over the edge
    bt_case c = basin();
    c.domain.ends = c.domain.sides = BT_BOUND_PERIODIC;
    c.body.x = 35.5, c.body.y = 4.5;
    assert_makes(c, BT_ICE_VORONOI, 0.8, "periodic voronoi");
    assert_makes(c, BT_ICE_RECTANGLES, 0.9, "periodic rectangles");
    assert_makes(c, BT_ICE_POLYGONS, 0.6, "periodic hexagons");
    c.ice.shake = 0;
    assert_makes(c, BT_ICE_VORONOI, 0.9, "periodic tessellation");
    bt_field f = made(&c);
    assert_true(fabs(f.ice_area - (360 - BT_PI * 2.5 * 2.5 / 4)) < 1e-9); // with all four parts of the body
    bt_field_free(&f);
    // open ends, a turned square berg that stands half in the ice region
    c = basin();
    c.domain.ends = c.domain.sides = BT_BOUND_OPEN;
    c.body.shape = BT_BODY_SQUARE, c.body.length = 3, c.body.x = 6, c.body.yaw = 0.6;
    c.ice.x_min = 6;
    assert_makes(c, BT_ICE_VORONOI, 0.9, "beside a berg");
    f = made(&c);
    assert_true(fabs(f.ice_area - (30 * 10 - 4.5)) < 1e-9);
    bt_field_free(&f);
    // many floes of very different size
    c = basin();
    c.ice.size_law = BT_SIZE_POWER, c.ice.size_min = 0.5, c.ice.size_max = 5;
    assert_makes(c, BT_ICE_VORONOI, 0.85, "power law");
    assert_makes(c, BT_ICE_RECTANGLES, 0.7, "power law rectangles");
    // a floe given by hand keeps its place
    c = basin();
    bt_floe_def hand = {
        .shape = BT_BODY_RECTANGLE, .length = 4, .width = 2, .x = 20, .y = 1, .yaw = 0.4, .thickness = 0.1};
    c.floes = &hand, c.n_floes = 1;
    f = made(&c);
    assert_sound(&c, &f, "hand-given floe");
    bt_case without = c;
    without.n_floes = 0;
    bt_field g = made(&without);
    assert_true(fabs(g.ice_area - f.ice_area - 8) < 1e-9);
    polygon outline = {.n = 4};
    const double corner[4][2] = {{-2, -1}, {2, -1}, {2, 1}, {-2, 1}}, cs = cos(hand.yaw), sn = sin(hand.yaw);
    for (int k = 0; k < 4; k++) {
        outline.v[2 * k] = hand.x + cs * corner[k][0] - sn * corner[k][1];
        outline.v[2 * k + 1] = hand.y + sn * corner[k][0] + cs * corner[k][1];
    }
    assert_true(least_gap_to(&outline, &f) > -1e-9);
    assert_true(least_gap_to(&outline, &g) < -0.1); // ice made without it lies under it
    bt_field_free(&f);
    bt_field_free(&g);
}

static bool same(const bt_field *f, const bt_field *g)
{
    return f->n == g->n && memcmp(f->offsets, g->offsets, ((size_t)f->n + 1) * sizeof *f->offsets) == 0 &&
           memcmp(f->vertices, g->vertices, 2 * (size_t)f->offsets[f->n] * sizeof *f->vertices) == 0 &&
           memcmp(f->pose, g->pose, 3 * (size_t)f->n * sizeof *f->pose) == 0 &&
           memcmp(f->thickness, g->thickness, (size_t)f->n * sizeof *f->thickness) == 0 &&
           memcmp(f->area, g->area, (size_t)f->n * sizeof *f->area) == 0;
}

TEST(test_seed)
{
    for (int shape = BT_ICE_VORONOI; shape <= BT_ICE_POLYGONS; shape++) {
        bt_case c = basin();
        c.ice.shape = (bt_ice_shape)shape, c.ice.concentration = 0.6, c.ice.thickness_law = BT_THICK_LOGNORMAL;
        c.ice.thickness_spread = 0.3;
        bt_field f = made(&c);
        bt_field g = made(&c);
        assert_true(same(&f, &g));
        bt_field_free(&g);
        c.ice.seed++;
        g = made(&c);
        assert_false(same(&f, &g));
        bt_field_free(&f);
        bt_field_free(&g);
    }
    // more floes than the threshold of the parallel loops: the number of threads does not matter
    bt_case c = basin();
    c.domain.length = c.ice.x_max = 420, c.ice.concentration = 0.95, c.ice.shake = 1;
    bt_field f = made(&c);
    assert_true(f.n > 4000);
    omp_set_num_threads(2);
    bt_field g = made(&c);
    omp_set_num_threads(1);
    assert_true(same(&f, &g));
    bt_field_free(&f);
    bt_field_free(&g);
}

// ---- size laws ----

static void assert_law(const bt_case *c, double mean, double sd)
{
    bt_sizes s;
    bt_errors err = {0};
    assert_int_equal(bt_sizes_init(&s, c, &err), BT_OK);
    enum { N = 40000 };
    double sum = 0, sum2 = 0;
    for (int i = 0; i < N; i++) {
        double d = bt_sizes_draw(&s, 3, i);
        assert_true(d > 0 && d >= c->ice.size_min && (c->ice.size_max == 0 || d <= c->ice.size_max));
        sum += d / N;
        sum2 += d * d / N;
    }
    if (fabs(sum - mean) > 0.01 * mean) fail_msg("mean %g, want %g", sum, mean);
    if (sd >= 0 && fabs(sqrt(fmax(0, sum2 - sum * sum)) - sd) > 0.03 * mean)
        fail_msg("sd %g, want %g", sqrt(sum2 - sum * sum), sd);
    assert_true(fabs(bt_sizes_mean(&s) - mean) < 0.001 * mean);
    assert_true(fabs(bt_sizes_mean_area(&s) - BT_PI / 4 * sum2) < 0.03 * sum2);
}

// Is floe i of f one of g, to the bit? Near an edge of a larger field or not: both have it in their own order.
static bool has(const bt_field *g, const bt_field *f, bt_idx i)
{
    const int64_t n = f->offsets[i + 1] - f->offsets[i];
    for (bt_idx k = 0; k < g->n; k++)
        if (memcmp(g->pose + 3 * k, f->pose + 3 * i, 3 * sizeof *f->pose) == 0)
            return g->offsets[k + 1] - g->offsets[k] == n && g->thickness[k] == f->thickness[i] &&
                   memcmp(g->vertices + 2 * g->offsets[k], f->vertices + 2 * f->offsets[i],
                          2 * (size_t)n * sizeof *f->vertices) == 0;
    return false;
}

// The domain of c is that of `large` but for its size, and its field is cut from that one's: the same floes but for the
// strip.
static void assert_shares(const bt_case *large, bt_case c, const char *what)
{
    c.ice.extent_x_min = large->ice.x_min, c.ice.extent_x_max = large->ice.x_max;
    c.ice.extent_y_min = large->ice.y_min, c.ice.extent_y_max = large->ice.y_max;
    bt_field f = made(large), g = made(&c);
    char name[100];
    snprintf(name, sizeof name, "%s at %g, seed %d", what, c.ice.concentration, (int)c.ice.seed);
    assert_sound_within(&c, &g, name, 0.005);
    const bool in_x = c.ice.x_max < large->ice.x_max, in_y = c.ice.y_max < large->ice.y_max;
    assert_true(g.strip >= c.ice.size && g.strip <= 0.25 * (in_x ? c.domain.length : c.domain.width));
    bt_idx common = 0, expected = 0;
    const bt_field *both[2] = {&f, &g};
    for (int k = 0; k < 2; k++)
        for (bt_idx i = 0; i < both[k]->n; i++) {
            const double x = both[k]->pose[3 * i], y = both[k]->pose[3 * i + 1];
            const polygon p = in_place(both[k], i);
            bool whole = true; // those that were cut lie at the side, whatever their centroid
            for (int e = 0; e < p.n; e++)
                whole = whole && (!in_x || p.v[2 * e] < c.ice.x_max - 0.01) &&
                        (!in_y || fabs(p.v[2 * e + 1]) < c.ice.y_max - 0.01);
            if (!whole || (in_x && !(x < c.ice.x_max - g.strip - 1e-9)) ||
                (in_y && !(fabs(y) < c.ice.y_max - g.strip - 1e-9)))
                continue;
            if (!has(both[!k], both[k], i)) fail_msg("%s: floe at (%g, %g) is of one field alone", name, x, y);
            if (k) common++;
            else expected++;
        }
    assert_int_equal(common, expected);
    assert_true(common > g.n / 3);
    bt_field_free(&f);
    bt_field_free(&g);
}

// Red where the strip is not scaled (concentration), all floes are (bits), thickness follows the cut (bits), or the
// body's image over the seam is forgotten (overlap).
TEST(test_cut)
{
    const double concentration[] = {0.2, 0.9};
    for (int k = 0; k < 2; k++)
        for (int seed = 7; seed < 9; seed++) {
            bt_case c = basin(), wide;
            c.ice.concentration = concentration[k], c.ice.seed = seed;
            c.ice.thickness_law = BT_THICK_LOGNORMAL, c.ice.thickness_spread = 0.3;
            c.domain.sides = seed == 8 ? BT_BOUND_PERIODIC : BT_BOUND_WALL;
            wide = c;
            wide.domain.width = 24, wide.domain.y0 = wide.ice.y_min = -12, wide.ice.y_max = 12;
            assert_shares(&wide, c, "width");
            bt_case shorter = c;
            shorter.domain.length = shorter.ice.x_max = 25;
            assert_shares(&c, shorter, "length");
        }
    // the body over the edge of a domain whose extent has no image of it there
    bt_case c = basin();
    c.domain.ends = c.domain.sides = BT_BOUND_PERIODIC, c.body.y = 4.5;
    bt_case wide = c;
    wide.domain.width = 24, wide.domain.y0 = wide.ice.y_min = -12, wide.ice.y_max = 12;
    assert_shares(&wide, c, "body over the edge");
    c.ice.shape = wide.ice.shape = BT_ICE_RECTANGLES;
    assert_shares(&wide, c, "rectangles");
    c.ice.shape = wide.ice.shape = BT_ICE_POLYGONS, c.ice.concentration = wide.ice.concentration = 0.6;
    assert_shares(&wide, c, "hexagons");
    // Ice up to both ends of a period, where floes of the extent lie across its own seam, and no slivers. Red without
    // the images of the extent (-40 % there), or with all parts kept.
    c = basin();
    c.domain.ends = BT_BOUND_PERIODIC, c.body.shape = BT_BODY_ABSENT;
    c.ice.size_spread = 0, c.ice.concentration = 0.9, c.ice.extent_x_max = 50;
    bt_field p = made(&c);
    double ends = 0, smallest = INFINITY, out[2 * BT_MAX_VERTICES + 2], at[2 * BT_MAX_VERTICES + 2];
    for (bt_idx i = 0; i < p.n; i++) {
        const polygon q = in_place(&p, i);
        const int low = bt_shape_clip(q.n, q.v, 1, 0, 0.4, out), high = bt_shape_clip(q.n, q.v, -1, 0, -35.6, at);
        ends += (low >= 3 ? bt_shape_moments(low, out).area : 0) + (high >= 3 ? bt_shape_moments(high, at).area : 0);
        smallest = fmin(smallest, p.area[i]);
    }
    assert_true(fabs(ends / (0.9 * 0.8 * 10) - 1) < 0.12);
    assert_true(smallest > 0.05 * BT_PI / 4);
    bt_field_free(&p);
    // an extent that is the ice region changes no bit
    c = basin();
    bt_field f = made(&c);
    c.ice.extent_x_min = 0, c.ice.extent_x_max = 36, c.ice.extent_y_min = -5, c.ice.extent_y_max = 5;
    bt_field g = made(&c);
    assert_true(same(&f, &g) && g.strip == 0);
    bt_field_free(&f);
    bt_field_free(&g);
}

TEST(test_size_laws)
{
    bt_case c = basin();
    c.ice.size = 30;
    c.ice.size_spread = 0;
    assert_law(&c, 30, 0);
    c.ice.size_spread = 0.3;
    assert_law(&c, 30, 9);
    for (double spread = 0.45; spread <= 2; spread += 0.31) { // cut at a tenth of the mean, with the mean kept
        c.ice.size_spread = spread;
        assert_law(&c, 30, -1);
    }
    c.ice.size_law = BT_SIZE_LOGNORMAL, c.ice.size_spread = 0.5;
    assert_law(&c, 30, 15);
    c.ice.size_min = 15, c.ice.size_max = 60; // cut, with the mean kept
    assert_law(&c, 30, -1);
    c.ice.size_law = BT_SIZE_POWER, c.ice.size_min = 10, c.ice.size_max = 100;
    for (double a = 1.5; a < 2.6; a += 0.5) { // E[d] = a/(a−1) m (1 − q^(1−a))/(1 − q^−a), q = M/m
        c.ice.size_exponent = a;
        assert_law(&c, a / (a - 1) * 10 * (1 - pow(10, 1 - a)) / (1 - pow(10, -a)), -1);
    }
    c.ice.size_exponent = 1;
    assert_law(&c, 10 * log(10) / 0.9, -1);
}

// Exponent of a power law cut at [m, M] by maximum likelihood:
// n/a − n ln q q^−a/(1 − q^−a) − Σ ln(d/m) = 0, falling in a.
static double likely_exponent(bt_idx n, const double *area, double m, double M)
{
    double sum = 0, low = 0.1, high = 6, q = M / m;
    for (bt_idx i = 0; i < n; i++) sum += log(2 * sqrt(area[i] / BT_PI) / m);
    for (int k = 0; k < 60; k++) {
        double a = (low + high) / 2, z = pow(q, -a);
        *(n / a - n * log(q) * z / (1 - z) - sum > 0 ? &low : &high) = a;
    }
    return low;
}

TEST(test_sizes_of_fields)
{
    for (int shape = BT_ICE_VORONOI; shape <= BT_ICE_RECTANGLES; shape++) {
        bt_case c = basin();
        c.ice.shape = (bt_ice_shape)shape, c.ice.shake = 0;
        c.domain.length = c.ice.x_max = 1000, c.domain.width = 800, c.domain.y0 = c.ice.y_min = -400, c.ice.y_max = 400;
        c.ice.size_law = BT_SIZE_POWER, c.ice.size_min = 10, c.ice.size_max = 100, c.ice.size_exponent = 1.8;
        bt_field f = made(&c);
        double a = likely_exponent(f.n, f.area, 10, 100); // standard error about a/√n = 0.05
        if (fabs(a - 1.8) > 0.15) fail_msg("exponent %g of %d floes", a, f.n);
        bt_field_free(&f);

        c.ice.size_law = BT_SIZE_SINGLE, c.ice.size = 20, c.ice.size_spread = 0.25, c.ice.concentration = 0.95,
        c.ice.size_min = c.ice.size_max = 0;
        f = made(&c);
        double sum = 0, sum2 = 0;
        for (bt_idx i = 0; i < f.n; i++) {
            double d = 2 * sqrt(f.area[i] / BT_PI);
            sum += d / f.n;
            sum2 += d * d / f.n;
        }
        if (fabs(sum - 20) > 0.4) fail_msg("mean diameter %g", sum);
        if (fabs(sqrt(sum2 - sum * sum) - 5) > 0.5) fail_msg("standard deviation %g", sqrt(sum2 - sum * sum));
        bt_field_free(&f);
    }
}

TEST(test_thickness)
{
    bt_case c = basin();
    c.domain.length = c.ice.x_max = 120, c.ice.shake = 0;
    bt_field f = made(&c);
    for (bt_idx i = 0; i < f.n; i++) assert_true(f.thickness[i] == 0.04);
    bt_field_free(&f);
    c.ice.thickness_law = BT_THICK_LOGNORMAL, c.ice.thickness_spread = 0.25;
    f = made(&c);
    double sum = 0, sum2 = 0, log3 = 0, log2 = 0, log1 = 0;
    for (bt_idx i = 0; i < f.n; i++) sum += f.thickness[i] / f.n, log1 += log(f.thickness[i]) / f.n;
    for (bt_idx i = 0; i < f.n; i++) {
        sum2 += pow(f.thickness[i] - sum, 2) / f.n;
        log2 += pow(log(f.thickness[i]) - log1, 2) / f.n;
        log3 += pow(log(f.thickness[i]) - log1, 3) / f.n;
    }
    if (fabs(sum - 0.04) > 0.04 * 0.03) fail_msg("mean thickness %g of %d", sum, f.n);
    if (fabs(sqrt(sum2) - 0.01) > 0.01 * 0.1) fail_msg("spread of thickness %g", sqrt(sum2));
    if (fabs(log3) > 0.3 * pow(log2, 1.5)) fail_msg("ln h is skewed"); // a lognormal is not, a normal law's ln h is
    bt_field_free(&f);
}

// ---- randomness ----

static double variation_of_gaps(const bt_case *c)
{
    bt_field f = made(c);
    double *g = malloc((size_t)f.n * sizeof *g), sum = 0, sum2 = 0;
    least_gap(c, &f, g);
    for (bt_idx i = 0; i < f.n; i++) sum += g[i] / f.n, sum2 += g[i] * g[i] / f.n;
    free(g);
    bt_field_free(&f);
    return sqrt(sum2 - sum * sum) / sum;
}

TEST(test_relaxed)
{
    // Gap to the nearest neighbour: nearly the same everywhere in a shrunken tessellation, close to exponential in a
    // gas.
    const double all[] = {0.3, 0.5, 0.8};
    for (int k = 0; k < 3; k++) {
        bt_case c = basin();
        c.ice.concentration = all[k], c.body.shape = BT_BODY_ABSENT, c.ice.size_spread = 0.1;
        c.ice.shake = 0;
        double lattice = variation_of_gaps(&c);
        c.ice.shake = 15;
        double shaken = variation_of_gaps(&c);
        if (!(shaken > 0.6 && shaken > 2.5 * lattice))
            fail_msg("at %g: variation of gaps %g, before the shake %g", all[k], shaken, lattice);
    }
}

TEST(test_orientation)
{
    bt_case c = basin();
    c.ice.shape = BT_ICE_RECTANGLES, c.ice.concentration = 0.4, c.body.shape = BT_BODY_ABSENT;
    c.domain.length = c.ice.x_max = 40, c.domain.width = 20, c.ice.y_max = 15;
    c.domain.ends = c.domain.sides = BT_BOUND_PERIODIC;
    for (int shaken = 0; shaken < 2; shaken++) {
        c.ice.shake = shaken ? 15 : 0;
        bt_field f = made(&c);
        double sum[4] = {0};
        for (bt_idx i = 0; i < f.n; i++) {
            const double *v = f.vertices + 2 * f.offsets[i];
            double ax = v[2] - v[0], ay = v[3] - v[1], bx = v[4] - v[2], by = v[5] - v[3];
            bool first = hypot(ax, ay) > hypot(bx, by);
            double side = atan2(first ? ay : by, first ? ax : bx) + f.pose[3 * i + 2];
            sum[0] += cos(2 * side) / f.n, sum[1] += sin(2 * side) / f.n;
            sum[2] += cos(4 * side) / f.n, sum[3] += sin(4 * side) / f.n;
        }
        // of n random directions each of these is normal with standard deviation 1/√(2n)
        double limit = 4 / sqrt(2.0 * f.n), worst = 0;
        for (int k = 0; k < 4; k++) worst = fmax(worst, fabs(sum[k]));
        if (shaken ? worst > limit : worst < 0.9)
            fail_msg("order parameters %g %g %g %g of %d floes", sum[0], sum[1], sum[2], sum[3], f.n);
        bt_field_free(&f);
    }
}

TEST(test_space_order)
{
    // along a space-filling curve the next floe is near: at random it would be 12 m away on average
    bt_case c = basin();
    bt_field f = made(&c);
    double sum = 0;
    for (bt_idx i = 1; i < f.n; i++)
        sum += hypot(f.pose[3 * i] - f.pose[3 * i - 3], f.pose[3 * i + 1] - f.pose[3 * i - 2]) / (f.n - 1);
    assert_true(sum < 2.5);
    bt_field_free(&f);
}

// ---- errors, and the overlap check itself ----

static void assert_refused(const bt_case *c, bt_status want, const char *part)
{
    bt_field f;
    bt_errors err = {0};
    bt_field_init(&f);
    assert_int_equal(bt_field_generate(c, &f, &err), want);
    assert_true(err.n >= 1);
    if (!strstr(err.text[0], part)) fail_msg("said \"%s\", expected \"...%s...\"", err.text[0], part);
    assert_int_equal(f.n, 0);
    assert_int_equal(f.offsets[0], 0);
    bt_errors_free(&err);
    bt_field_free(&f);
}

TEST(test_refusals)
{
    bt_case c = basin();
    c.domain.length = c.ice.x_max = 8, c.ice.shape = BT_ICE_POLYGONS, c.ice.sides = 5, c.ice.concentration = 0.95;
    assert_refused(&c, BT_ERR_CASE, "cannot pack regular polygons to 0.95 in this region; ask for at most about 0.");
    c = basin();
    c.ice.size = 100;
    assert_refused(&c, BT_ERR_CASE, "larger than all the requested ice");
    c.ice.size = 1e-4;
    assert_refused(&c, BT_ERR_CASE, "larger floes");
    c = basin();
    c.body.length = c.body.width = 100;
    assert_refused(&c, BT_ERR_CASE, "cover all");
    c = basin();
    c.ice.x_min = 40;
    assert_refused(&c, BT_ERR_CASE, "is empty");
    c = basin();
    c.ice.size_law = BT_SIZE_POWER;
    assert_refused(&c, BT_ERR_CASE, "ice.size_min");
}

TEST(test_add)
{
    // a square given off its centroid and turned: the floe lies where its vertices were
    bt_field f;
    bt_field_init(&f);
    const double v[] = {1, 1, 3, 1, 3, 3, 1, 3};
    bt_field_add(&f, 4, v, 10, 20, BT_PI / 2, 0.5);
    assert_true(fabs(f.pose[0] - 8) < 1e-12 && fabs(f.pose[1] - 22) < 1e-12 && f.pose[2] == BT_PI / 2);
    assert_true(fabs(f.vertices[0] + 1) < 1e-12 && fabs(f.area[0] - 4) < 1e-12);
    for (int i = 1; i < 1000; i++) bt_field_add(&f, 4, v, i, 0, 0, 0.5);
    assert_int_equal(f.n, 1000);
    assert_int_equal(f.offsets[1000], 4000);
    assert_true(fabs(f.pose[3 * 700] - 702) < 1e-12);
    bt_field_free(&f);
}

static void push(const bt_force_body *b, bt_load *l) { l->fx += b->mass; }
static bool always(const double *own) { return own[0] == 0; }
static void yield_at_once(const bt_law_contact *t, double load[2], double given[2])
{
    (void)t, (void)given;
    load[0] = load[1] = 1e-3;
}

/// What a program adds acts on what is towed through the ice, and not on how the ice is made.
TEST(test_laws_of_a_program)
{
    static const bt_force_law law = {.name = "push", .doc = "a push that never ends", .add = push};
    static const bt_contact_law contact = {
        .name = "soft", .doc = "contacts that bear next to nothing", .on = always, .bound = yield_at_once};
    const bt_case c = basin();
    bt_errors err = {0};
    bt_field before = made(&c);
    assert_int_equal(bt_force_register(&law, &err), BT_OK);
    assert_int_equal(bt_contact_register(&contact, &err), BT_OK);
    bt_field after = made(&c);
    assert_int_equal(after.n, before.n);
    assert_memory_equal(after.pose, before.pose, 3 * (size_t)before.n * sizeof *before.pose);
    bt_field_free(&before);
    bt_field_free(&after);
}

int main(void)
{
    omp_set_num_threads(1); // small fields: threads that wait for one another only cost
    return run_all_tests(NULL, NULL);
}
