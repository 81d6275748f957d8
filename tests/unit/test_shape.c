// SPDX-License-Identifier: MIT
// Moments, faults, hull and clipping of convex polygons against closed forms and quadrature.
#include "test.h"
#include "bergtow/shape.h"

static void assert_near(double got, double want, double rel)
{
    double scale = fabs(want) > 1e-300 ? fabs(want) : 1;
    if (!(fabs(got - want) <= rel * scale))
        fail_msg("got %.17g, want %.17g (relative %g)", got, want, (got - want) / scale);
}

TEST(test_rectangle)
{
    const double a = 3, b = 2; // half sides
    double v[] = {-a, -b, a, -b, a, b, -a, b};
    bt_moments m = bt_shape_moments(4, v);
    assert_near(m.area, 4 * a * b, 1e-15);
    assert_near(m.polar, 4 * a * b * (a * a + b * b) / 3, 1e-14);
    assert_near(m.radius, sqrt(a * a + b * b), 1e-15);
    assert_near(m.inradius, b, 1e-15);
    assert_true(fabs(m.cx) < 1e-15 && fabs(m.cy) < 1e-15);
}

TEST(test_regular)
{
    for (int n = 3; n <= 128; n += n < 12 ? 1 : 29) {
        double v[2 * BT_MAX_VERTICES];
        bt_shape_regular(n, 2.5, v);
        assert_near(v[1], 0, 1e-15);
        assert_true(v[0] > 0);
        bt_moments m = bt_shape_moments(n, v);
        double r = v[0], side = 2 * r * sin(BT_PI / n), apothem = r * cos(BT_PI / n);
        assert_near(m.area, 2.5, 1e-13);
        // polar second moment of a regular n-gon: (A/2) (R² − s²/6)
        assert_near(m.polar, m.area / 2 * (r * r - side * side / 6), 1e-12);
        assert_near(m.inradius, apothem, 1e-12);
        assert_near(m.radius, r, 1e-12);
        assert_null(bt_shape_fault(n, v));
    }
    // ∫r³ of a disc is 2π R⁵/5; the 128-gon of the same area is within 1e-6 of it
    double v[2 * 128];
    bt_shape_regular(128, BT_PI, v);
    assert_near(bt_shape_moments(128, v).cubic, 2 * BT_PI / 5, 1e-6);
}

// ∫r³ by Gauss–Legendre (5 points each way) on a fine split of every fan triangle: independent of the polar route.
static double cubic_numeric(int n, const double *v, double cx, double cy)
{
    static const double x[5] = {-0.9061798459386640, -0.5384693101056831, 0, 0.5384693101056831, 0.9061798459386640};
    static const double w[5] = {0.2369268850561891, 0.4786286704993665, 0.5688888888888889, 0.4786286704993665,
                                0.2369268850561891};
    double sum = 0;
    for (int i = 0; i < n; i++) {
        const double *p = v + 2 * i, *q = v + 2 * ((i + 1) % n);
        double c = (p[0] - v[0]) * (q[1] - v[1]) - (p[1] - v[1]) * (q[0] - v[0]);
        if (c == 0) continue;
        enum { PARTS = 60 };
        for (int ka = 0; ka < PARTS; ka++)
            for (int kb = 0; kb < PARTS; kb++)
                for (int ia = 0; ia < 5; ia++)
                    for (int ib = 0; ib < 5; ib++) {
                        double a = (ka + (1 + x[ia]) / 2) / PARTS, b = (kb + (1 + x[ib]) / 2) / PARTS;
                        // (a, b) of the unit square to v0 + a ((1 − b) p + b q − v0): Jacobian a c
                        double px = v[0] + a * ((1 - b) * p[0] + b * q[0] - v[0]) - cx;
                        double py = v[1] + a * ((1 - b) * p[1] + b * q[1] - v[1]) - cy;
                        sum += w[ia] * w[ib] / 4 / PARTS / PARTS * a * c * pow(hypot(px, py), 3);
                    }
    }
    return sum;
}

TEST(test_offset_and_cubic)
{
    // centroid, moments and ∫r³ of an irregular polygon far from the origin
    const double at[3][2] = {{0, 0}, {12, -7}, {-4000, 3000}};
    for (int k = 0; k < 3; k++) {
        double v[] = {0, 0, 4, -1, 6, 2, 3, 5, -0.5, 3};
        for (int i = 0; i < 5; i++) v[2 * i] += at[k][0], v[2 * i + 1] += at[k][1];
        bt_moments m = bt_shape_moments(5, v);
        double numeric = cubic_numeric(5, v, m.cx, m.cy);
        assert_near(m.cubic, numeric, 1e-7);
        double w[10];
        memcpy(w, v, sizeof w);
        bt_moments before = bt_shape_centre(5, w);
        assert_near(before.cx, m.cx, 0);
        bt_moments after = bt_shape_moments(5, w);
        assert_true(fabs(after.cx) < 1e-12 && fabs(after.cy) < 1e-12);
        assert_near(after.area, m.area, 1e-10);
        assert_near(after.polar, m.polar, 1e-10);
        assert_near(after.cubic, m.cubic, 1e-10);
    }
    double t[] = {1, 1, 4, 1, 1, 5}; // right triangle: centroid and I_c = (a² + b²) A / 18 about it
    bt_moments m = bt_shape_moments(3, t);
    assert_near(m.cx, 2, 1e-15);
    assert_near(m.cy, 1 + 4.0 / 3, 1e-15);
    assert_near(m.polar, 6 * (9 + 16) / 18.0, 1e-14);
}

TEST(test_width)
{
    double v[] = {-3, -1, 3, -1, 3, 1, -3, 1};
    assert_near(bt_shape_width(4, v, 1, 0), 2, 1e-15); // moving along x meets the width in y
    assert_near(bt_shape_width(4, v, 0, 1), 6, 1e-15);
    assert_near(bt_shape_width(4, v, sqrt(0.5), sqrt(0.5)), 8 * sqrt(0.5), 1e-14);
}

TEST(test_clip)
{
    double v[] = {0, 0, 2, 0, 2, 2, 0, 2}, out[2 * 5];
    assert_int_equal(bt_shape_clip(4, v, 1, 0, 1, out), 4);
    assert_near(bt_shape_moments(4, out).area, 2, 1e-15);
    int n = bt_shape_clip(4, v, sqrt(0.5), sqrt(0.5), 3 * sqrt(0.5), out); // one corner off: area 4 − ½
    assert_int_equal(n, 5);
    assert_near(bt_shape_moments(5, out).area, 3.5, 1e-14);
    assert_null(bt_shape_fault(5, out));
    n = bt_shape_clip(4, v, sqrt(0.5), sqrt(0.5), 2 * sqrt(0.5), out); // through two vertices
    assert_int_equal(n, 3);
    assert_near(bt_shape_moments(3, out).area, 2, 1e-14);
    assert_int_equal(bt_shape_clip(4, v, 1, 0, 5, out), 4);   // all inside
    assert_int_equal(bt_shape_clip(4, v, 1, 0, 2, out), 4);   // an edge on the line
    assert_int_equal(bt_shape_clip(4, v, 1, 0, 0, out), 0);   // only an edge left
    assert_int_equal(bt_shape_clip(4, v, 1, 0, -1, out), 0);
    // cutting a polygon in two loses no area, whatever the line
    double p[2 * 17], a[2 * 18], b[2 * 18];
    bt_shape_regular(17, 1, p);
    for (int k = 0; k < 500; k++) {
        double th = 0.37 * k, d = 0.6 * sin(1.3 * k);
        int na = bt_shape_clip(17, p, cos(th), sin(th), d, a), nb = bt_shape_clip(17, p, -cos(th), -sin(th), -d, b);
        assert_true(na <= 18 && nb <= 18);
        double sum = (na ? bt_shape_moments(na, a).area : 0) + (nb ? bt_shape_moments(nb, b).area : 0);
        assert_near(sum, 1, 1e-13);
    }
    // collinear points with round-off on the cutting line never overrun the buffer
    double c[2 * 12];
    for (int i = 0; i < 10; i++) c[2 * i] = i * 0.1, c[2 * i + 1] = (i % 2 ? 1e-17 : -1e-17);
    c[20] = 0.9, c[21] = 1, c[22] = 0, c[23] = 1;
    double o[2 * 13];
    assert_true(bt_shape_clip(12, c, 0, -1, 0, o) <= 13);
    assert_true(bt_shape_clip(12, c, 0, 1, 0, o) <= 13);
}

TEST(test_hull)
{
    double v[] = {1, 1, 0, 0, 2, 0, 1, 0, 2, 2, 0, 2, 0, 1, 0, 0, 1.5, 0.5};
    int n = bt_shape_hull(9, v);
    assert_int_equal(n, 4);
    assert_null(bt_shape_fault(n, v));
    assert_near(bt_shape_moments(n, v).area, 4, 1e-15);
    double line[] = {0, 0, 1, 1, 2, 2, 3, 3};
    assert_int_equal(bt_shape_hull(4, line), 2);
    double one[] = {5, 5, 5, 5, 5, 5};
    assert_int_equal(bt_shape_hull(3, one), 1);
    // every point of a cloud is inside its hull
    enum { N = 300 };
    double cloud[2 * N], hull[2 * N];
    for (int i = 0; i < 2 * N; i++) cloud[i] = sin(12.9898 * i * i) * cos(0.7 * i);
    memcpy(hull, cloud, sizeof hull);
    n = bt_shape_hull(N, hull);
    assert_true(n >= 3 && n < N);
    for (int k = 0; k < n; k++) {
        const double *p = hull + 2 * k, *q = hull + 2 * ((k + 1) % n);
        for (int i = 0; i < N; i++)
            assert_true((q[0] - p[0]) * (cloud[2 * i + 1] - p[1]) - (q[1] - p[1]) * (cloud[2 * i] - p[0]) > -1e-12);
    }
}

static void assert_fault(int n, const double *v, const char *part)
{
    const char *why = bt_shape_fault(n, v);
    if (!why) fail_msg("accepted, expected \"...%s...\"", part);
    if (!strstr(why, part)) fail_msg("said \"%s\", expected \"...%s...\"", why, part);
}

TEST(test_faults)
{
    double square[] = {0, 0, 1, 0, 1, 1, 0, 1};
    assert_null(bt_shape_fault(4, square));
    double collinear[] = {0, 0, 0.5, 0, 1, 0, 1, 1, 0, 1};
    assert_null(bt_shape_fault(5, collinear));
    assert_fault(2, square, "fewer than 3");
    double many[2 * 129];
    bt_shape_regular(129, 1, many);
    assert_fault(129, many, "more than 128");
    double clockwise[] = {0, 0, 0, 1, 1, 1, 1, 0};
    assert_fault(4, clockwise, "clockwise");
    double dented[] = {0, 0, 2, 0, 2, 2, 1, 0.5, 0, 2};
    assert_fault(5, dented, "not convex");
    double spike[] = {0, 0, 1, 0, 3, 0, 1, 0, 1, 1};
    assert_fault(5, spike, "not convex");
    double repeated[] = {0, 0, 1, 0, 1, 0, 1, 1};
    assert_fault(4, repeated, "coincide");
    double closed[] = {0, 0, 1, 0, 1, 1, 0, 0};
    assert_fault(4, closed, "coincide");
    double flat[] = {0, 0, 1, 0, 2, 0};
    assert_fault(3, flat, "zero");
    double bad[] = {0, 0, 1, 0, NAN, 1};
    assert_fault(3, bad, "finite");
    bad[4] = INFINITY;
    assert_fault(3, bad, "finite");
    double star[10]; // a pentagram turns left everywhere
    for (int i = 0; i < 5; i++) star[2 * i] = cos(4 * BT_PI * i / 5), star[2 * i + 1] = sin(4 * BT_PI * i / 5);
    assert_fault(5, star, "cross");
}

TEST(test_named)
{
    double v[2 * BT_MAX_VERTICES];
    int n = bt_shape_named("disc", 30, 20, v);
    assert_null(bt_shape_fault(n, v));
    assert_near(bt_shape_moments(n, v).area, BT_PI * 30 * 20 / 4, 1e-13);
    n = bt_shape_named("square", 7, 99, v);
    assert_near(bt_shape_moments(n, v).area, 49, 1e-15);
    n = bt_shape_named("rectangle", 7, 3, v);
    assert_near(bt_shape_width(n, v, 1, 0), 3, 1e-15);
    n = bt_shape_named("ship", 80, 18, v);
    assert_null(bt_shape_fault(n, v));
    bt_moments m = bt_shape_moments(n, v);
    assert_true(fabs(m.cx) < 1e-12 && fabs(m.cy) < 1e-12);
    assert_near(bt_shape_width(n, v, 1, 0), 18, 1e-14);
    assert_near(bt_shape_width(n, v, 0, 1), 80, 1e-14);
    int stem = 0; // the foremost point is a single vertex on the axis
    for (int i = 0; i < n; i++) if (v[2 * i] > v[2 * stem]) stem = i;
    assert_near(v[2 * stem + 1], 0, 1e-12);
    assert_int_equal(bt_shape_named("banana", 1, 1, v), 0);
}

TEST_MAIN(NULL, NULL)
