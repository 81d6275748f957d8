// SPDX-License-Identifier: MIT
// Paths through way-points: lengths, tangents, marks, and what is refused.
#include "scene.h"

#include "geometry/path.h"

static double length_of(const bt_path *p, double way, double step)
{
    double sum = 0, a[2], b[2], t[2];
    bt_path_at(p, 0, a, t);
    const int n = (int)ceil(way / step);
    for (int i = 1; i <= n; i++) {
        bt_path_at(p, way * i / n, b, t);
        sum += hypot(b[0] - a[0], b[1] - a[1]);
        a[0] = b[0], a[1] = b[1];
    }
    return sum;
}

/// Legs, arcs and marks of a right turn, a left turn and a straight end; the tangent is continuous where corners are
/// round.
TEST(paths_have_the_lengths_of_their_legs_and_arcs)
{
    const double points[] = {100, 0, 100, 50, 200, 50};
    char why[200] = "";
    bt_path p;
    assert_true(bt_path_make(&p, 0, 0, 3, points, 0, why));
    assert_true(p.mark[0] == 100 && p.mark[1] == 150 && p.mark[2] == 250);
    double at[2], t[2];
    bt_path_at(&p, 120, at, t);
    assert_true(at[0] == 100 && at[1] == 20 && t[0] == 0 && t[1] == 1);
    bt_path_at(&p, 1000, at, t);
    assert_true(at[0] == 950 && at[1] == 50 && t[0] == 1);
    bt_path_free(&p);

    const double r = 10;
    assert_true(bt_path_make(&p, 0, 0, 3, points, r, why));
    const double first = 90 + 0.25 * BT_PI * r, second = 90 + 0.5 * BT_PI * r + 30 + 0.25 * BT_PI * r;
    CHECK_CLOSE(p.mark[0], first, 1e-12);
    CHECK_CLOSE(p.mark[1], second, 1e-12);
    CHECK_CLOSE(p.mark[2], second + 0.25 * BT_PI * r + 90, 1e-12);
    bt_path_at(&p, first, at, t);
    CHECK_CLOSE(hypot(at[0] - 90, at[1] - 10), r, 1e-12); // on the arc about its centre
    CHECK_CLOSE(at[0] - at[1], 90 - 10 + sqrt(2) * r, 1e-12);
    CHECK_CLOSE(t[0] - t[1], 0, 1e-12);
    double before[2];
    for (double way = 0.01; way < 300; way += 0.01) {
        bt_path_at(&p, way - 0.01, at, before);
        bt_path_at(&p, way, at, t);
        assert_true(fabs(t[0] * before[1] - t[1] * before[0]) < 1.01 * 0.01 / r);
        CHECK_CLOSE(bt_path_near(&p, way - 0.5, at[0], at[1]), way, 1e-6);
    }
    CHECK_CLOSE(length_of(&p, 260, 0.001), 260, 1e-5);
    bt_path_free(&p);

    // From far outside of an arc, where going along its tangent leads ever farther away; either way round.
    for (int side = -1; side <= 1; side += 2) {
        assert_true(bt_path_make(&p, 0, 0, 2, (double[]){100, 0, 100, side * 100.0}, r, why));
        for (double angle = 0.1; angle < 0.5 * BT_PI; angle += 0.1) {
            const double far = 3.5 * r, x = 90 + far * sin(angle), y = side * (r - far * cos(angle));
            CHECK_CLOSE(bt_path_near(&p, 90 + r * 0.7, x, y), 90 + r * angle, 1e-9);
        }
        bt_path_free(&p);
    }

    assert_false(bt_path_make(&p, 0, 0, 3, points, 26, why)); // two tangents of 26 m on a leg of 50 m
    assert_non_null(strstr(why, "way-point 2"));
    assert_false(bt_path_make(&p, 0, 0, 2, (double[]){10, 0, 10, 0}, 0, why));
    assert_non_null(strstr(why, "way-point 2 is at the place of"));
    assert_false(bt_path_make(&p, 0, 0, 2, (double[]){10, 0, 5, 0}, 1, why)); // back on itself
}

TEST_MAIN(NULL, NULL)
