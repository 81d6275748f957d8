// SPDX-License-Identifier: MIT
// Simple polygons: cleaning, faults, moments of what is not convex, convex parts against point-in-polygon tests.
#include "scene.h"

#include "bergtow/outline.h"

static const double c_shape[] = {0, 0, 2, 0, 2, 0.5, 0.5, 0.5, 0.5, 1.5, 2, 1.5, 2, 2, 0, 2};

/// A star-shaped polygon of 8 to 20 corners, nearly always with bays.
static int random_star(uint64_t *rng, double *v)
{
    const int n = 8 + (int)(13 * scene_uniform(rng));
    for (int k = 0; k < n; k++) {
        const double a = 2 * BT_PI * (k + 0.8 * scene_uniform(rng)) / n, r = 0.3 + 0.7 * scene_uniform(rng);
        v[2 * k] = r * cos(a);
        v[2 * k + 1] = r * sin(a);
    }
    return n;
}

/// By the crossing number, which is not what the split uses.
static bool inside(int n, const double *v, double x, double y)
{
    bool in = false;
    for (int i = 0, j = n - 1; i < n; j = i++)
        if ((v[2 * i + 1] > y) != (v[2 * j + 1] > y) &&
            x < (v[2 * j] - v[2 * i]) * (y - v[2 * i + 1]) / (v[2 * j + 1] - v[2 * i + 1]) + v[2 * i])
            in = !in;
    return in;
}

TEST(cleaning_keeps_the_corners)
{
    // A square with double corners, points in the middle of sides, two in a row, and one that begins in the middle of a
    // side.
    double v[] = {0.5, 0, 1, 0, 1, 0, 1, 0.2, 1, 0.2, 1, 0.9, 1, 1, 0, 1, 0, 1, 0, 0.3, 0, 0};
    assert_int_equal(bt_outline_clean(11, v), 4);
    CHECK_CLOSE(bt_outline_area2(4, v), 2, 1e-15);
    double c[16];
    memcpy(c, c_shape, sizeof c);
    assert_int_equal(bt_outline_clean(8, c), 8);
    double line[] = {0, 0, 1, 0, 2, 0, 3, 0};
    assert_true(bt_outline_clean(4, line) < 4); // and no endless loop
}

TEST(faults)
{
    assert_null(bt_outline_fault(8, c_shape));
    assert_false(bt_outline_convex(8, c_shape));
    double reversed[16];
    for (int k = 0; k < 8; k++) reversed[2 * k] = c_shape[2 * (7 - k)], reversed[2 * k + 1] = c_shape[2 * (7 - k) + 1];
    assert_non_null(strstr(bt_outline_fault(8, reversed), "clockwise"));
    const double bow[] = {0, 0, 2, 2, 2, 0, 0, 1.5};
    assert_non_null(strstr(bt_outline_fault(4, bow), "cross"));
    const double touching[] = {0, 0, 2, 0, 2, 2, 1, 0, 0, 2}; // a corner on an edge
    assert_non_null(strstr(bt_outline_fault(5, touching), "touch"));
    const double pinched[] = {0, 0, 1, 1, 2, 0, 2, 2, 1, 1, 0, 2}; // two triangles that share a point
    assert_non_null(strstr(bt_outline_fault(6, pinched), "touch"));
    const double spike[] = {0, 0, 1, 0, 3, 0, 1, 0, 1, 1};
    assert_non_null(bt_outline_fault(5, spike));
    const double spike_at_seam[] = {3, 0, 1, 0, 1, 1, 0, 0, 1, 0};
    assert_non_null(bt_outline_fault(5, spike_at_seam));
    const double flat[] = {0, 0, 1, 0, 2, 1e-14};
    assert_non_null(bt_outline_fault(3, flat));
    const double bad[] = {0, 0, 1, 0, NAN, 1};
    assert_non_null(strstr(bt_outline_fault(3, bad), "finite"));
    double many[2 * 129];
    bt_shape_regular(129, 1, many);
    assert_non_null(strstr(bt_outline_fault(129, many), "128"));
    assert_non_null(strstr(bt_outline_fault(2, bad), "3 vertices"));
}

/// L of three unit squares: area 3, centroid (5/6, 5/6), polar moment by Steiner's theorem.
TEST(moments_of_what_is_not_convex)
{
    const double l[] = {0, 0, 2, 0, 2, 1, 1, 1, 1, 2, 0, 2};
    const bt_moments m = bt_shape_moments(6, l);
    CHECK_CLOSE(m.area, 3, 1e-14);
    CHECK_CLOSE(m.cx, 5.0 / 6, 1e-14);
    CHECK_CLOSE(m.cy, 5.0 / 6, 1e-14);
    double polar = 0, cubic = 0;
    const double at[3][2] = {{0.5, 0.5}, {1.5, 0.5}, {0.5, 1.5}};
    for (int k = 0; k < 3; k++)
        polar += 1.0 / 6 + (at[k][0] - 5.0 / 6) * (at[k][0] - 5.0 / 6) + (at[k][1] - 5.0 / 6) * (at[k][1] - 5.0 / 6);
    CHECK_CLOSE(m.polar, polar, 1e-14);
    enum { N = 400 }; // ∫ r³ by the midpoint rule
    for (int k = 0; k < 3; k++)
        for (int i = 0; i < N; i++)
            for (int j = 0; j < N; j++) {
                const double r =
                    hypot(at[k][0] - 0.5 + (i + 0.5) / N - 5.0 / 6, at[k][1] - 0.5 + (j + 0.5) / N - 5.0 / 6);
                cubic += r * r * r / N / N;
            }
    CHECK_CLOSE(m.cubic, cubic, 1e-5);
}

static void check_parts(int n, const double *v, const bt_parts *p, uint64_t *rng)
{
    double area2 = 0, part[BT_MAX_VERTICES][2 * 24];
    int reflex = 0, from = 0;
    for (int i = 0; i < n; i++) {
        const double *a = v + 2 * i, *b = v + 2 * ((i + 1) % n), *c = v + 2 * ((i + 2) % n);
        reflex += (b[0] - a[0]) * (c[1] - b[1]) - (b[1] - a[1]) * (c[0] - b[0]) < 0;
    }
    for (int k = 0; k < p->n; from += p->count[k++]) {
        assert_true(p->count[k] <= 24);
        for (int j = 0; j < p->count[k]; j++) memcpy(part[k] + 2 * j, v + 2 * p->corner[from + j], 2 * sizeof(double));
        assert_null(bt_shape_fault(p->count[k], part[k]));
        area2 += bt_outline_area2(p->count[k], part[k]);
    }
    assert_int_equal(from, p->n_vertices);
    CHECK_CLOSE(area2, bt_outline_area2(n, v), 1e-9);
    assert_true(p->n <= 2 * reflex + 1); // Hertel & Mehlhorn: at most two diagonals stay at a reflex corner
    assert_true(p->n > 1 || reflex == 0);
    for (int i = 0; i < 200; i++) {
        const double x = 2.2 * scene_uniform(rng) - 1.1, y = 2.2 * scene_uniform(rng) - 1.1;
        int in = 0;
        for (int k = 0; k < p->n; k++) in += inside(p->count[k], part[k], x, y);
        assert_int_equal(in, inside(n, v, x, y));
    }
}

TEST(parts_fill_the_outline_once)
{
    uint64_t rng = 3;
    bt_parts p;
    assert_true(bt_outline_split(8, c_shape, &p));
    assert_int_equal(p.n, 3);
    const double l[] = {0, 0, 2, 0, 2, 1, 1, 1, 1, 2, 0, 2};
    assert_true(bt_outline_split(6, l, &p));
    assert_int_equal(p.n, 2);
    double v[2 * BT_MAX_VERTICES];
    bt_shape_regular(12, 1, v);
    assert_true(bt_outline_split(12, v, &p));
    assert_int_equal(p.n, 1);
    int with_bays = 0;
    for (int k = 0; k < 400; k++) {
        const int n = random_star(&rng, v);
        if (bt_outline_fault(n, v)) continue;
        assert_true(bt_outline_split(n, v, &p));
        check_parts(n, v, &p, &rng);
        with_bays += p.n > 2;
    }
    assert_true(with_bays > 350);
    // The longest that is allowed: a comb of 128 corners, with 31 teeth.
    for (int k = 0; k < 63; k++) v[2 * k] = k, v[2 * k + 1] = k % 2 ? 5 : 1;
    for (int k = 63; k < 128; k++) v[2 * k] = 62 - (k - 63) * 62.0 / 64, v[2 * k + 1] = 6 + 1e-3 * (k - 63) * (127 - k);
    assert_null(bt_outline_fault(128, v));
    assert_true(bt_outline_split(128, v, &p));
    assert_true(p.n > 31 && p.n_vertices <= BT_MAX_PART_VERTICES);
}

/// 1 degree of latitude and of longitude at 60° N are 111.4 km and 55.8 km; across 180° it is the short way.
/// Four corners on a line on either side, and rounding has its say when the outline is turned. It left no ear.
TEST(parts_of_two_notches_that_face_each_other)
{
    const double notched[] = {0, -5, 10, -5, 10, -4.95, 11, -4.95, 11, -5, 13, -5, 13, 5, 11, 5, 11, 4.95, 10, 4.95,
                              10, 5, 0, 5};
    for (int k = 0; k < 400; k++) {
        double v[24];
        for (int i = 0; i < 12; i++) {
            const double *p = notched + 2 * ((i + k) % 12);
            v[2 * i] = cos(k) * p[0] - sin(k) * p[1], v[2 * i + 1] = sin(k) * p[0] + cos(k) * p[1];
        }
        bt_parts p;
        assert_true(bt_outline_split(12, v, &p));
        double area2 = 0;
        for (int i = 0, from = 0; i < p.n; from += p.count[i++]) {
            double own[2 * BT_MAX_VERTICES];
            for (int j = 0; j < p.count[i]; j++) memcpy(own + 2 * j, v + 2 * p.corner[from + j], 2 * sizeof *own);
            assert_null(bt_shape_fault(p.count[i], own));
            area2 += bt_outline_area2(p.count[i], own);
        }
        CHECK_CLOSE(area2, 2 * (130 - 2 * 0.05), 1e-6);
    }
}

TEST(projection_of_known_lengths)
{
    const double d = BT_PI / 180;
    double north, east;
    bt_outline_project(20 * d, 60.5 * d, 20 * d, 59.5 * d, &north, &east);
    CHECK_CLOSE(north, 111412, 2); // meridian at 60°: 111,132.95 − 559.85 cos 2φ + 1.17 cos 4φ m a degree
    CHECK_CLOSE(east, 0, 1e-9);
    bt_outline_project(21 * d, 60 * d, 20 * d, 60 * d, &north, &east);
    CHECK_CLOSE(east, 55800, 5); // 111,412.88 cos φ − 93.5 cos 3φ + 0.12 cos 5φ m a degree
    // A parallel bends to the north of the great circle that leaves eastward: ½ Δλ² sin φ cos φ N.
    CHECK_CLOSE(north, 0.5 * d * d * sin(60 * d) * cos(60 * d) * 6394e3, 1);
    bt_outline_project(-179.5 * d, 70 * d, 179.5 * d, 70 * d, &north, &east);
    CHECK_CLOSE(east, 38187, 5);
}

/// There and back, at every latitude, across 180° and at the poles themselves; the way out is checked against geodesics
/// elsewhere.
TEST(the_inverse_of_the_projection)
{
    const double d = BT_PI / 180, latitude[] = {-90, -89.99, -60, 0, 45, 76.5, 89.9, 90},
                 longitude[] = {-180, -90, 0, 20, 179.99}, far[] = {0, 1e-3, 30, 5e3, 100e3};
    for (int i = 0; i < 8; i++)
        for (int j = 0; j < 5; j++)
            for (int k = 0; k < 5; k++)
                for (int a = 0; a < 12; a++) {
                    const double n = far[k] * cos(a * BT_PI / 6), e = far[k] * sin(a * BT_PI / 6);
                    double lon, lat, north, east;
                    bt_outline_unproject(n, e, longitude[j] * d, latitude[i] * d, &lon, &lat);
                    bt_outline_project(lon, lat, longitude[j] * d, latitude[i] * d, &north, &east);
                    assert_true(fabs(lon) <= BT_PI && fabs(lat) <= BT_PI / 2);
                    if (!(hypot(north - n, east - e) <= 3e-9 + 2e-14 * far[k]))
                        fail_msg("%g, %g from %g, %g: back to %g, %g", n, e, longitude[j], latitude[i], north - n,
                                 east - e);
                }
}

TEST_MAIN(NULL, NULL)
