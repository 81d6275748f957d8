// SPDX-License-Identifier: MIT
// The tow of a case: named lines, distances of a programme, start of the end, hull points, and the tow that is built
// from it.
#include "scene.h"


#include "case/rope.h"
#include "case/case_check.h"
#include "case/case_tow.h"
#include "run/setup.h"

static bt_case made(void)
{
    bt_case c;
    bt_case_defaults(&c);
    c.run.dt = 0.5;
    c.run.duration = 200;
    c.domain.ends = c.domain.sides = BT_BOUND_OPEN;
    return c;
}

static void finish(bt_case *c)
{
    bt_errors err = {0};
    if (bt_case_finish(c, &err) != BT_OK) fail_msg("%s", err.text[0]);
}

/// Against the sources: OrcaFlex gives for 50 mm wire 1583 kN and 10 kg/m; MoorPy's HMPE of 60 mm 2229 kN.
TEST(named_lines)
{
    const bt_rope wire = bt_rope_named(BT_ROPE_STEEL, 0.05), pp = bt_rope_named(BT_ROPE_POLYPROPYLENE, 0.1),
                  hmpe = bt_rope_named(BT_ROPE_DYNEEMA, 0.06);
    CHECK_CLOSE(wire.breaking, 1583.4e3, 0.1e3);
    CHECK_CLOSE(wire.stiffness, 101e6, 1);
    CHECK_CLOSE(wire.mass, 9.974, 0.001);
    CHECK_CLOSE(pp.breaking, 1059.9e3, 1);
    CHECK_CLOSE(pp.stiffness, 10.6e6, 1);
    CHECK_CLOSE(pp.mass, 4.526, 1e-9);
    CHECK_CLOSE(hmpe.breaking, 2088e3 + 140.6e3, 0.1e3);
    CHECK_CLOSE(hmpe.stiffness, 56 * 2228.6e3, 3e3);
    CHECK_CLOSE(hmpe.mass, 1.7856, 1e-9);

    bt_case c = made();
    c.tow.mode = BT_TOW_LINE;
    c.tow.line.type = BT_ROPE_STEEL;
    c.tow.line.diameter = 0.05;
    c.tow.line_length = 100;
    c.tow.line.branches = 2;
    finish(&c);
    bt_tow *t = bt_setup_tow(&c);
    for (int k = 0; k < 2; k++) {
        CHECK_CLOSE(t->branch[k].k, 1.01e6, 1);
        CHECK_CLOSE(t->branch[k].breaking, 1583.4e3, 0.1e3);
    }
    bt_tow_free(t);
    bt_case_free(&c);
}

static void set_programme(bt_case *c, int n, const double *p)
{
    c->tow.programme = bt_alloc((size_t)n, 2 * sizeof *p);
    memcpy(c->tow.programme, p, (size_t)n * 2 * sizeof *p);
    c->tow.n_programme = n;
}

/// Trapezes by hand, and the speed that the tow itself uses, added up finely.
TEST(way_of_a_programme)
{
    bt_case c = made();
    set_programme(&c, 4, (double[]){10, 0.5, 30, 1.5, 100, 1.5, 120, 0});
    finish(&c);
    assert_true(c.tow.speed == 1.5 && c.tow.ramp == 30 && bt_case_reference_speed(&c) == 1.5);
    CHECK_CLOSE(bt_case_tow_distance(&c, 10), 5, 1e-12);
    CHECK_CLOSE(bt_case_tow_distance(&c, 20), 5 + 7.5, 1e-12);
    CHECK_CLOSE(bt_case_tow_distance(&c, 30), 5 + 20, 1e-12);
    CHECK_CLOSE(bt_case_tow_distance(&c, 100), 5 + 20 + 105, 1e-12);
    CHECK_CLOSE(bt_case_tow_distance(&c, 120), 5 + 20 + 105 + 15, 1e-12);
    CHECK_CLOSE(bt_case_tow_distance(&c, 500), 145, 1e-12);
    CHECK_CLOSE(bt_case_tow_time(&c, 5 + 20 + 52.5), 65, 1e-9);
    bt_tow *t = bt_setup_tow(&c);
    // A step goes at the speed of its end, which is farther on a rise: what a wall ahead is held against.
    double led = 0;
    for (int k = 1; k <= 700; k++) {
        c.run.dt = 0.173;
        led += c.run.dt * bt_tow_speed(t, k * c.run.dt);
        CHECK_CLOSE(bt_case_tow_led(&c, (k - 0.5) * c.run.dt), led, 1e-9);
        CHECK_CLOSE(bt_case_tow_led(&c, k * c.run.dt), led, 1e-9);
    }
    CHECK_CLOSE(led, 145.0, 0.2);
    c.run.duration = 500;
    for (double way = 1; way < 144; way += 1.7) {
        const double time = bt_case_tow_last(&c, way);
        assert_true(bt_case_tow_led(&c, time) <= way && bt_case_tow_led(&c, time + c.run.dt) > way);
    }
    double way = 0, way_to = 57.3;
    for (int i = 0; i < 57300; i++) way += 1e-3 * bt_tow_speed(t, (i + 0.5) * 1e-3);
    CHECK_CLOSE(way, bt_case_tow_distance(&c, way_to), 1e-6);
    bt_tow_free(t);
    bt_case_free(&c);
}

/// Bridle on a rectangle that stands askew: branches from its outermost corners, the end dead ahead, one just taut,
/// none stretched.
TEST(a_bridle_starts_taut)
{
    bt_case c = made();
    c.tow.mode = BT_TOW_LINE;
    c.tow.direction = 0.4;
    c.body.shape = BT_BODY_RECTANGLE;
    c.body.length = 4;
    c.body.width = 2;
    c.body.yaw = 0.3;
    c.tow.line.branches = 2;
    c.tow.branch2.length = 5.6;
    finish(&c);
    // Of the corners (±2, ±1), turned by −0.1 against the tow: (2, 1) is outermost to +y? Largest of −x sin 0.1 + y cos
    // 0.1: (−2, 1).
    assert_true(c.tow.hull_x == -2 && c.tow.hull_y == 1 && c.tow.branch2.hull_x == 2 && c.tow.branch2.hull_y == -1);
    bt_tow *t = bt_setup_tow(&c);
    const double length[2] = {5, 5.6};
    double slack[2];
    for (int k = 0; k < 2; k++) {
        const double x = c.body.x + cos(0.3) * t->branch[k].hull_x - sin(0.3) * t->branch[k].hull_y,
                     y = c.body.y + sin(0.3) * t->branch[k].hull_x + cos(0.3) * t->branch[k].hull_y;
        slack[k] = length[k] - hypot(t->carriage_x - x, t->carriage_y - y);
    }
    CHECK_CLOSE(bt_min(slack[0], slack[1]), 0, 1e-12);
    // the points lie opposite: their middle is the centroid
    const double dx = t->carriage_x - c.body.x, dy = t->carriage_y - c.body.y;
    CHECK_CLOSE(dx * sin(0.4) - dy * cos(0.4), 0, 1e-12);
    assert_true(dx * cos(0.4) + dy * sin(0.4) > 2);
    bt_tow_free(t);
    bt_case_free(&c);
}

TEST(the_first_waypoint_gives_the_course)
{
    bt_case c = made();
    c.tow.mode = BT_TOW_THRUST;
    c.tow.vessel.mass = 1000, c.tow.vessel.bollard_pull = 100, c.tow.vessel.free_speed = 5;
    c.tow.waypoints = bt_alloc(2, 2 * sizeof(double));
    memcpy(c.tow.waypoints, (double[]){c.tow.n_waypoints + 34.0, 30, 100, 30}, 4 * sizeof(double));
    c.tow.n_waypoints = 2;
    finish(&c); // body.x is 4
    CHECK_CLOSE(c.tow.direction, BT_PI / 4, 1e-12);
    bt_tow *t = bt_setup_tow(&c);
    assert_int_equal(t->path.n_marks, 2);
    CHECK_CLOSE(t->path.mark[0], hypot(34 - t->carriage_x, 30 - t->carriage_y), 1e-12);
    CHECK_CLOSE(t->path.mark[1], t->path.mark[0] + 66, 1e-12);
    CHECK_CLOSE(t->vessel.mass, 1050, 1e-9);
    assert_true(t->vessel.free_resistance == 40 && t->vessel.lookahead == 5);
    bt_tow_free(t);
    bt_case_free(&c);
}

TEST_MAIN(NULL, NULL)
