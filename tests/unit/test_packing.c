// SPDX-License-Identifier: MIT
// When the packed ice reaches the wall ahead: the balance of area by hand, every way the tow can go, and where nothing
// is said.
#include "test.h"
#include "estimate/packing.h"

/// A body of 4 x 2 m that is towed at 0.5 m/s along x from (10, 0), in a closed domain of 100 x 20 m.
static bt_case closed(void)
{
    static bt_case defaults;
    if (!defaults.ice.size) bt_case_defaults(&defaults);
    bt_case c = defaults;
    c.run.duration = 100;
    c.domain.x0 = 0, c.domain.y0 = -10;
    c.domain.length = 100, c.domain.width = 20;
    c.domain.ends = c.domain.sides = BT_BOUND_WALL;
    c.ice.x_min = 0, c.ice.x_max = 100, c.ice.y_min = -10, c.ice.y_max = 10;
    c.body.shape = BT_BODY_RECTANGLE;
    c.body.length = 4, c.body.width = 2, c.body.x = 10, c.body.y = 0;
    c.tow.mode = BT_TOW_SPEED;
    c.tow.speed = 0.5, c.tow.ramp = 4;
    c.estimate.phi_j = 0.9;
    return c;
}

TEST(area_balances)
{
    bt_case c = closed();
    // 88 m ahead of the bow: front at 1 + (2/20) 0.8/0.1 = 1.8 of the body's way.
    bt_packing p = bt_packing_of(&c, 0.8);
    assert_float_equal(p.way, 88 / 1.8, 1e-9);
    assert_float_equal(p.time, 88 / 1.8 / 0.5 + 2, 1e-6);
    // Broadside: 4 m across, 89 m ahead.
    c.body.yaw = BT_PI / 2;
    assert_float_equal(bt_packing_of(&c, 0.8).way, 89 / (1 + 0.2 * 8), 1e-9);
    c.body.yaw = 0;
    // As broad as the domain: V phi/(phi - A).
    c.body.width = c.domain.width;
    assert_float_equal(bt_packing_of(&c, 0.8).way, 88 * (0.9 - 0.8) / 0.9, 1e-9);
    c.body.width = 2;
    // The ice ends at 50 m: 0.9 of 20 m x (88 - d) hold the 38 m x 20 m x 0.8 there were, less 0.8 of 18 m x d.
    c.ice.x_max = 50;
    const double d = bt_packing_of(&c, 0.8).way;
    assert_float_equal(0.9 * 20 * (88 - d), 0.8 * 20 * 38 - 0.8 * 18 * d, 1e-9);
    c.ice.x_max = 12; // none ahead
    assert_true(isnan(bt_packing_of(&c, 0.8).time));
    // No sparser than it packs: at once.
    c.ice.x_max = 100;
    assert_true(bt_packing_of(&c, 0.9).time == 0 && bt_packing_of(&c, 0.95).time == 0);
    // A tow that ends before.
    const double programme[] = {0, 0, 10, 1, 20, 1, 30, 0};
    double copy[8];
    memcpy(copy, programme, sizeof copy);
    c.tow.programme = copy, c.tow.n_programme = 4;
    assert_true(isinf(bt_packing_of(&c, 0.8).time));
    assert_float_equal(bt_packing_of(&c, 0.895).way, 88 / (1 + 0.1 * 0.895 / 0.005), 1e-9); // 4.7 m, while it speeds up
    assert_float_equal(bt_packing_of(&c, 0.895).time, sqrt(20 * 88 / (1 + 0.1 * 0.895 / 0.005)), 1e-6);
}

TEST(towards_any_wall)
{
    bt_case c = closed();
    c.tow.direction = BT_PI;
    assert_float_equal(bt_packing_of(&c, 0.8).way, 8 / 1.8, 1e-9);
    c.tow.direction = BT_PI / 2; // 9 m ahead, 4 m across of 100 m
    assert_float_equal(bt_packing_of(&c, 0.8).way, 9 / (1 + 0.04 * 8), 1e-9);
    c.body.y = 3;
    c.tow.direction = -BT_PI / 2;
    assert_float_equal(bt_packing_of(&c, 0.8).way, 12 / (1 + 0.04 * 8), 1e-9);
    c.domain.sides = BT_BOUND_PERIODIC;
    assert_true(isnan(bt_packing_of(&c, 0.8).time));
    c = closed();
    c.tow.direction = 0.3; // 17 degrees: the way along the axis counts
    const bt_packing p = bt_packing_of(&c, 0.8);
    assert_float_equal(p.time, p.way / cos(0.3) / 0.5 + 2, 1e-6);
    c.tow.direction = 0.6;
    assert_true(isnan(bt_packing_of(&c, 0.8).time));
}

TEST(where_nothing_is_said)
{
    for (int k = 0; k < 8; k++) {
        bt_case c = closed();
        double point[] = {60, 0};
        if (k == 0) c.domain.ends = BT_BOUND_OPEN;
        if (k == 1) c.domain.ends = BT_BOUND_PERIODIC;
        if (k == 2) c.domain.ends = BT_BOUND_MOVING;
        if (k == 3) c.body.shape = BT_BODY_ABSENT;
        if (k == 4) c.tow.mode = BT_TOW_NONE;
        if (k == 5) c.tow.waypoints = point, c.tow.n_waypoints = 1;
        if (k == 6) c.lead.mode = BT_LEAD_CHANNEL;
        const bt_packing p = bt_packing_of(&c, k == 7 ? 0 : 0.8);
        bt_errors warnings = {0};
        bt_packing_warn(&p, 1e6, &warnings);
        assert_true(isnan(p.time) && warnings.n == 0);
    }
}

TEST(reported_from_the_earliest_time_on)
{
    const bt_packing p = {.time = 100, .way = 10, .packed = 0.9}, at_once = {.time = 0, .packed = 0.9};
    bt_errors w = {0};
    bt_packing_warn(&p, 100 * BT_PACKING_EARLY, &w);
    assert_int_equal(w.n, 0);
    bt_packing_warn(&p, 100 * BT_PACKING_EARLY + 0.1, &w);
    assert_int_equal(w.n, 1);
    assert_non_null(strstr(w.text[0], "at about 100 s, 87 s at the earliest"));
    bt_packing_warn(&at_once, 1, &w);
    assert_int_equal(w.n, 2);
    assert_non_null(strstr(w.text[1], "from the start"));
    bt_errors_free(&w);
}

TEST_MAIN(NULL, NULL)
