// SPDX-License-Identifier: MIT
// When the width of the domain belongs to the answer.
#include "test.h"
#include "case/arch.h"

/// A body of 4 × 2 m that is towed along x, in a domain of 40 m.
static bt_case narrow(void)
{
    static bt_case c;
    if (!c.ice.size) bt_case_defaults(&c);
    bt_case d = c;
    d.body.shape = BT_BODY_RECTANGLE;
    d.body.length = 4, d.body.width = 2;
    d.domain.width = 40;
    d.domain.sides = BT_BOUND_WALL;
    return d;
}

TEST(the_width_counts_in_bodies_and_floes)
{
    bt_case c = narrow();
    bt_arch a = bt_arch_of(&c, 0.8, 0.5);
    assert_true(fabs(a.bodies - 20) < 1e-12 && fabs(a.floes - 80) < 1e-12);
    assert_string_equal(a.sides, "walls");
    c.body.yaw = BT_PI / 2; // broadside on
    assert_true(fabs(bt_arch_of(&c, 0.8, 0.5).bodies - 10) < 1e-9);
    c.tow.direction = BT_PI / 2, c.domain.length = 40;
    assert_true(fabs(bt_arch_of(&c, 0.8, 0.5).bodies - 20) < 1e-9);
}

/// What stands beside a tow along y is at the ends of the domain; on an oblique course, and of way-points, it is the
/// narrower pair.
TEST(the_extent_across_the_tow_counts)
{
    bt_case c = narrow();
    c.domain.length = 10;
    c.domain.ends = BT_BOUND_PERIODIC;
    c.domain.sides = BT_BOUND_OPEN;
    bt_arch a = bt_arch_of(&c, 0.8, 0.5);
    assert_string_equal(a.key, "domain.width");
    assert_true(isnan(a.needed) && !a.possible);
    c.tow.direction = -BT_PI / 2, c.body.yaw = -BT_PI / 2;
    a = bt_arch_of(&c, 0.8, 0.5);
    assert_string_equal(a.key, "domain.length");
    assert_string_equal(a.sides, "periodic images");
    assert_true(fabs(a.bodies - 5) < 1e-12 && a.needed == 30 && a.possible);
    c.tow.direction = c.body.yaw = BT_PI / 4; // between the two, where the sides are open
    assert_string_equal(bt_arch_of(&c, 0.8, 0.5).key, "domain.length");
    c.domain.sides = BT_BOUND_WALL, c.domain.length = 60;
    assert_string_equal(bt_arch_of(&c, 0.8, 0.5).key, "domain.width");
    c.tow.direction = c.body.yaw = 0;
    c.domain.length = 20;
    assert_string_equal(bt_arch_of(&c, 0.8, 0.5).key, "domain.width");
    double turn[] = {5, 0, 5, 30}; // along x, then along y
    c.tow.waypoints = turn, c.tow.n_waypoints = 2;
    c.body.x = c.body.y = 0;
    c.tow.mode = BT_TOW_SPEED, c.tow.speed = 1, c.tow.ramp = 0;
    c.run.duration = 4; // not as far as the turn
    assert_string_equal(bt_arch_of(&c, 0.8, 0.5).key, "domain.width");
    c.run.duration = 6;
    a = bt_arch_of(&c, 0.8, 0.5);
    assert_string_equal(a.key, "domain.length");
    assert_true(fabs(a.bodies - 5) < 1e-12); // it keeps its yaw, and goes broadside on
    c.tow.mode = BT_TOW_LINE;
    assert_true(fabs(bt_arch_of(&c, 0.8, 0.5).bodies - 10) < 1e-12); // on a line it follows
}

/// The disc of moved ice grows with the way: π (w/2)² δ = way/width, both in body widths.
TEST(a_long_tow_needs_more_width)
{
    bt_case c = narrow();
    c.tow.mode = BT_TOW_SPEED, c.tow.speed = 1, c.tow.ramp = 20;
    c.run.duration = 40; // 30 m
    assert_true(bt_arch_of(&c, 0.9, 0.5).needed == 60);
    c.run.duration = 210; // 200 m, 100 body widths
    assert_true(bt_arch_of(&c, 0.89, 0.5).needed == 60);
    assert_true(bt_arch_of(&c, 0.9, 0.5).needed == 116);  // 115.8
    assert_true(bt_arch_of(&c, 0.95, 0.5).needed == 207); // 206.01, δ = 0.003
    c.domain.width = 231;
    assert_true(bt_arch_of(&c, 0.9, 0.5).possible);
    c.domain.width = 232;
    assert_false(bt_arch_of(&c, 0.9, 0.5).possible);
    c.tow.mode = BT_TOW_NONE;
    assert_true(bt_arch_of(&c, 0.9, 0.5).needed == 60);
}

TEST(dense_ice_between_near_sides_can_arch)
{
    bt_case c = narrow();
    assert_true(bt_arch_of(&c, 0.7, 0.5).possible);
    assert_false(bt_arch_of(&c, 0.69, 0.5).possible);
    assert_false(bt_arch_of(&c, 0.8, 0).possible); // no floes
    c.domain.width = 60;
    assert_false(bt_arch_of(&c, 0.84, 0.5).possible);
    assert_true(bt_arch_of(&c, 0.85, 0.5).possible);
    c.domain.width = 120;
    assert_false(bt_arch_of(&c, 0.9, 0.5).possible);
    c.domain.width = 19;
    assert_true(bt_arch_of(&c, 0.45, 0.5).possible);
    assert_false(bt_arch_of(&c, 0.44, 0.5).possible);
    c.domain.width = 20;
    assert_false(bt_arch_of(&c, 0.5, 0.5).possible);
    // ice as made misses what was asked for in the last digits; loose ice, open sides, no floes: nothing is asked for
    assert_true(bt_arch_of(&c, nextafter(0.85, 0), 0.5).needed == 60);
    assert_true(isnan(bt_arch_of(&c, 0.44, 0.5).needed) && isnan(bt_arch_of(&c, 0.85, 0).needed));
    c.domain.sides = BT_BOUND_OPEN;
    assert_true(isnan(bt_arch_of(&c, 0.85, 0.5).needed));
    c.domain.sides = BT_BOUND_WALL;
    c.domain.width = 119;
    c.domain.sides = BT_BOUND_PERIODIC;
    assert_true(bt_arch_of(&c, 0.9, 0.5).possible);
    assert_string_equal(bt_arch_of(&c, 0.9, 0.5).sides, "periodic images");
    c.domain.sides = BT_BOUND_OPEN;
    assert_false(bt_arch_of(&c, 0.9, 0.5).possible);
    c.domain.sides = BT_BOUND_WALL;
    c.body.shape = BT_BODY_ABSENT;
    assert_false(bt_arch_of(&c, 0.9, 0.5).possible);
}

/// Ice that ends beside the tow is told, from two floe sizes of water on.
TEST(water_beside_the_ice_is_told)
{
    bt_case c = narrow();
    c.domain.length = 200;
    c.ice.x_min = 50, c.ice.x_max = 60; // ahead and astern there may be any
    c.ice.y_min = -15, c.ice.y_max = 20;
    assert_true(bt_arch_of(&c, 0.3, 0.5).water == 5);
    assert_true(bt_arch_of(&c, 0.3, 2.5).water == 0);
    assert_true(bt_arch_of(&c, 0, 0.5).water == 0);
    bt_errors said = {0};
    const bt_arch a = bt_arch_of(&c, 0.3, 0.5);
    bt_arch_warn(&a, &said);
    assert_int_equal(said.n, 1);
    assert_non_null(strstr(said.text[0], "ice.y_min, ice.y_max: 5 m of open water"));
    assert_non_null(strstr(said.text[0], "leave both keys out"));
    bt_errors_free(&said);
    said = (bt_errors){0};
    bt_arch mapped = a; // without the keys there would be no more ice on the map
    mapped.mapped = true;
    bt_arch_warn(&mapped, &said);
    assert_null(strstr(said.text[0], "leave both keys out"));
    bt_errors_free(&said);
    said = (bt_errors){0};
    c.tow.direction = c.body.yaw = BT_PI / 2;
    assert_true(bt_arch_of(&c, 0.3, 0.5).water == 190);
    assert_true(bt_arch_of(&c, 0.3, 0.5).gap == 0);
    c.domain.ends = BT_BOUND_MOVING; // which repeats the ice, and the water between it
    assert_true(bt_arch_of(&c, 0.3, 0.5).gap == 190);
    const bt_arch moving = bt_arch_of(&c, 0.3, 0.5);
    bt_arch_warn(&moving, &said);
    assert_non_null(strstr(said.text[said.n - 1], "all but 190 m of the moving window"));
    bt_errors_free(&said);
    c.tow.mode = BT_TOW_NONE;
    assert_true(bt_arch_of(&c, 0.3, 0.5).water == 0 && bt_arch_of(&c, 0.3, 0.5).gap == 0);
}

TEST_MAIN(NULL, NULL)
