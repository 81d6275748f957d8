// SPDX-License-Identifier: MIT
// The Froude-scaled twin: exponents from dimensions, every key, exceptions, and the way back.
#include "test.h"
#include "bergtow/case.h"
#include "case/schema.h"

// Exponents of kg, m and s in the SI unit of a kind: L³ for mass, L for length, L^½ for time.
TEST(exponents_follow_from_the_dimensions)
{
    static const struct {
        const char *symbol;
        double kg, m, s;
    } dimensions[] = {
        {"", 0, 0, 0},       {"m", 0, 1, 0},    {"m/s", 0, 1, -1},  {"s", 0, 0, 1},      {"rad", 0, 0, 0},
        {"rad/s", 0, 0, -1}, {"N", 1, 1, -2},   {"kg", 1, 0, 0},    {"kg/m3", 1, -3, 0}, {"N s/m", 1, 0, -1},
        {"Pa", 1, -1, -2},   {"N/m", 1, 0, -2}, {"kg/m", 1, -1, 0}, {"m2", 0, 2, 0},     {"N/m2", 1, -1, -2},
        {"Pa m^0.5", 1, -0.5, -2},
    };
    for (int kind = 0; kind < BT_UNIT_KINDS; kind++) {
        bool found = false;
        for (size_t i = 0; i < sizeof dimensions / sizeof *dimensions; i++) {
            if (strcmp(bt_units_symbol((bt_unit)kind), dimensions[i].symbol)) continue;
            found = true;
            const double want = 3 * dimensions[i].kg + dimensions[i].m + 0.5 * dimensions[i].s;
            if (bt_units_froude((bt_unit)kind) != want)
                fail_msg("%s: %g, by dimension %g", dimensions[i].symbol, bt_units_froude((bt_unit)kind), want);
        }
        if (!found)
            fail_msg("add the dimensions of %s to this test", bt_units_symbol((bt_unit)kind));
    }
}

static void read_case(bt_case *c, const char *text, bt_status want)
{
    bt_errors err = {0};
    const bt_status status = bt_case_read_text(c, "case.yml", text, NULL, NULL, 0, &err);
    if (status != want) bt_errors_print(&err);
    bt_errors_free(&err);
    assert_int_equal(status, want);
}

static const char ship[] =
    "run: {dt: 0.1, duration: 120, title: a ship}\ndomain: {length: 60, width: 11, ends_closing: 0.001, sides: open}\n"
    "ice: {size: 0.8, thickness: 0.05, concentration: 0.7, seed: 3}\n"
    "body: {shape: polygon, vertices: [[0,0],[4,0],[5,1],[4,2],[0,2]], draft: 0.3, mass: 2.5 t, x: 6, yaw_rate: 0.5}\n"
    "tow: {mode: line, speed: 0.2, line_stiffness: 30 kN, line_damping: 500}\nwater: {current_x: 0.02, latitude: "
    "60}\nair: {wind_y: 3}\n"
    "output: {progress: 7, window_start: 30}\nreference: {mean_force: 12, source: nobody}\n"
    "floes: [{x: 20, y: 1, length: 0.7, vx: 0.1, yaw: 30}, {x: 30, y: -2, shape: polygon, vertices: "
    "[[0,0],[1,0],[0,1]], thickness: 0.02}]\n";

TEST(each_value_by_its_dimension)
{
    bt_case a, b;
    bt_errors err = {0};
    read_case(&a, ship, BT_OK);
    read_case(&b, ship, BT_OK);
    assert_int_equal(bt_case_scale(&b, 16, &err), BT_OK); // √16 = 4: exact
    assert_true(b.run.dt == 0.4 && b.run.duration == 480);
    assert_true(b.domain.length == 960 && b.domain.ends_closing == 0.004 && b.domain.y0 == 16 * a.domain.y0);
    assert_true(b.ice.size == 16 * 0.8 && b.ice.concentration == 0.7 && b.ice.density == 910 && b.ice.seed == 3 &&
                b.ice.shake == 15);
    assert_true(b.body.vertices[4] == 80 && b.body.mass == 4096 * 2500 && b.body.yaw_rate == a.body.yaw_rate / 4 &&
                b.body.density == 900);
    assert_true(b.body.sail == 16 * a.body.sail && b.tow.hull_x == 16 * a.tow.hull_x);
    assert_true(b.tow.speed == 0.8 && b.tow.line_stiffness == 4096 * 30e3 && b.tow.line_damping == 1024 * 500.0 &&
                b.tow.line_length == 80);
    assert_true(b.water.current_x == 0.08 && b.water.latitude == a.water.latitude && b.air.wind_y == 12);
    assert_true(b.solver.tolerance == a.solver.tolerance && b.solver.rest_speed == 4 * a.solver.rest_speed);
    assert_true(b.output.progress == 7 && b.output.window_start == 120 &&
                b.output.frame_interval == 4 * a.output.frame_interval);
    assert_true(b.reference.mean_force == 4096 * 12 && b.estimate.length_scale == 1.0 / 16 &&
                b.estimate.p_star == 20e3 && b.estimate.p_s == 13e3);
    assert_true(b.floes[0].x == 320 && b.floes[0].vx == 0.4 && b.floes[0].yaw == a.floes[0].yaw &&
                b.floes[1].vertices[2] == 16 && b.floes[1].thickness == 0.32);
    assert_string_equal(b.run.title, "a ship");
    bt_case_free(&a);
    bt_case_free(&b);
}

TEST(the_way_back_returns_every_value)
{
    static const double ratios[] = {4, 30, 1.0 / 17, 0.37};
    for (int r = 0; r < 4; r++) {
        bt_case a, b;
        bt_errors err = {0};
        read_case(&a, ship, BT_OK);
        read_case(&b, ship, BT_OK);
        if (bt_case_scale(&b, ratios[r], &err) || bt_case_scale(&b, 1 / ratios[r], &err)) {
            bt_errors_print(&err);
            fail();
        }
        for (int k = 0; k < bt_n_case_keys; k++) {
            if (bt_case_keys[k].type != BT_KEY_REAL) continue;
            double x, y;
            memcpy(&x, (char *)&a + bt_case_keys[k].offset, sizeof x);
            memcpy(&y, (char *)&b + bt_case_keys[k].offset, sizeof y);
            if (!(fabs(x - y) <= 1e-14 * fabs(x)) && !(isnan(x) && isnan(y)))
                fail_msg("%s: %.17g came back as %.17g", bt_case_keys[k].name, x, y);
        }
        bt_case_free(&a);
        bt_case_free(&b);
    }
}

TEST(a_window_to_be_found_stays_so)
{
    bt_case c;
    bt_errors err = {0};
    read_case(&c, "run: {dt: 0.1, duration: 100}\n", BT_OK);
    assert_int_equal(bt_case_scale(&c, 30, &err), BT_OK);
    assert_true(c.output.window_start == -1 && isnan(c.reference.mean_force));
    bt_case_free(&c);
}

TEST(refuses_what_cannot_be_scaled)
{
    static const struct {
        const char *text;
        double ratio;
        const char *fragment;
    } bad[] = {
        {"run: {dt: 5, duration: 1000}\ndomain: {length: 5 km, width: 2 km}\nice: {size: 30}\nbody: {length: 80}\n",
         1e4, "domain.length: becomes"},
        {"run: {dt: 0.1, duration: 100}\nice: {field: some.h5}\n", 30, "some.h5 cannot be scaled"},
    };
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        bt_case c;
        bt_errors err = {0};
        read_case(&c, bad[i].text, BT_OK);
        assert_int_equal(bt_case_scale(&c, bad[i].ratio, &err), BT_ERR_CASE);
        bool found = false;
        for (size_t k = 0; k < err.n; k++) found = found || strstr(err.text[k], bad[i].fragment);
        if (!found) fail_msg("no message says: %s", bad[i].fragment);
        bt_errors_free(&err);
        bt_case_free(&c);
    }
}

TEST_MAIN(NULL, NULL)
