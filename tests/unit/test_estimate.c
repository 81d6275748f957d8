// SPDX-License-Identifier: MIT
// The estimates at points computed by hand, at the edges of their regimes, and at two scales.
#include "test.h"
#include "bergtow/estimate.h"

// 80 m across, 0.5 m/s, ice of 1 m: rho_i h W V² = 910 · 1 · 80 · 0.25 = 18 200 N.
static bt_estimate_input berg(double a)
{
    return (bt_estimate_input){.concentration = a,
                               .thickness = 1,
                               .floe_radius = 15,
                               .width = 80,
                               .speed = 0.5,
                               .along = 0.5,
                               .water_speed = 0.5,
                               .water_along = 0.5,
                               .ice_density = 910,
                               .water_density = 1027,
                               .drag = 4000,
                               .p_star = 20e3,
                               .p_s = 13e3,
                               .c_si = 1,
                               .kappa = 11,
                               .kappa_low = 5,
                               .kappa_high = 17,
                               .phi_j = 0.9,
                               .length_scale = 1};
}

static void check(bt_estimate e, double want, bool valid, int line)
{
    if (!(fabs(e.force - want) <= 1e-9 * fabs(want)))
        fail_msg("line %d: %.10g N, by hand %.10g N", line, e.force, want);
    if (e.valid != valid) fail_msg("line %d: valid is %d: %s", line, e.valid, e.note);
    if (!e.note || !*e.note) fail_msg("line %d: no note", line);
}
#define CHECK(kind, in, want, valid) check(bt_estimate_at(BT_EST_##kind, &(in)), want, valid, __LINE__)

TEST(lichey_hellmer_in_its_regimes)
{
    bt_estimate_input in = berg(0.15);
    CHECK(LICHEY_HELLMER, in, 0, true); // the threshold itself has no force
    in = berg(nextafter(0.15, 1)); // nor is what rounding may have made of it
    CHECK(LICHEY_HELLMER, in, 0, true);
    in = berg(0.1501);
    CHECK(LICHEY_HELLMER, in, 9100, true);
    in = berg(0.8);
    CHECK(LICHEY_HELLMER, in, 9100, true);
    in.c_si = 2;
    CHECK(LICHEY_HELLMER, in, 18200, true);
    in = berg(0.95); // P = 20 000 / e = 7358 N/m: below P_s, drag
    CHECK(LICHEY_HELLMER, in, 9100, true);
    in.thickness = 2; // P = 14 715 N/m: captured, P W
    CHECK(LICHEY_HELLMER, in, 40e3 * 80 * 0.36787944117144233, true);
    in.p_s = 15e3;
    CHECK(LICHEY_HELLMER, in, 18200, true);
    in = berg(0.9);
    in.thickness = 5; // P = 100 000 / e² = 13 534 N/m
    CHECK(LICHEY_HELLMER, in, 100e3 * 80 * 0.1353352832366127, true);
    in.concentration = 0.9 - 1e-6; // strong enough, and not dense enough
    CHECK(LICHEY_HELLMER, in, 45500, true);
    in.concentration = 0.9;
    in.p_s = bt_estimate_strength(&in); // P = P_s counts as captured
    CHECK(LICHEY_HELLMER, in, 100e3 * 80 * 0.1353352832366127, true);
    in.p_s = nextafter(in.p_s, 1e9);
    CHECK(LICHEY_HELLMER, in, 45500, true);
}

TEST(a_current_across_or_from_behind)
{
    bt_estimate_input in = berg(0.5);
    in.speed = in.water_speed = 0.5, in.along = in.water_along = 0.3; // ½ · 910 · 80 · 0.5 · 0.3
    CHECK(LICHEY_HELLMER, in, 5460, true);
    CHECK(OPEN_WATER, in, 600, true);
    in.along = -0.3;
    CHECK(LICHEY_HELLMER, in, -5460, true);
    const bt_estimate_kind ahead[] = {BT_EST_COMPACTION, BT_EST_RAFTING, BT_EST_MOMENTUM, BT_EST_DILUTE};
    for (int i = 0; i < 4; i++) {
        const bt_estimate e = bt_estimate_at(ahead[i], &in);
        assert_true(isnan(e.force) && !e.valid);
    }
    in = berg(0.95);
    in.thickness = 2, in.speed = 0.5, in.along = 0.3; // the limit acts along the motion
    CHECK(LICHEY_HELLMER, in, 0.6 * 40e3 * 80 * 0.36787944117144233, true);
}

TEST(three_closures)
{
    bt_estimate_input in = berg(0.95);
    CHECK(COMPACTION, in, 1.6e6 * 0.36787944117144233, true);
    in = berg(1);
    CHECK(COMPACTION, in, 1.6e6, true);
    in = berg(0.5); // 20 000 · 80 · e^−10, loose
    CHECK(COMPACTION, in, 1.6e6 * 4.5399929762484854e-05, false);

    in = berg(0.8); // ½ · 910 · (117/1027) · 9.81 · 0.8 · 80 = 32 544.36
    const double lift = 0.5 * 910 * (117.0 / 1027) * 9.81 * 64;
    assert_true(fabs(lift - 32544.365) < 1e-2);
    CHECK(RAFTING, in, 11 * lift, true);
    bt_estimate e = bt_estimate_at(BT_EST_RAFTING, &in);
    assert_true(fabs(e.low - 5 * lift) < 1e-6 && fabs(e.high - 17 * lift) < 1e-6);
    in.thickness = 0.5; // h²
    CHECK(RAFTING, in, 11 * lift / 4, true);
    in.speed = in.along = 5; // no speed in it
    CHECK(RAFTING, in, 11 * lift / 4, true);

    in = berg(0.8);
    CHECK(MOMENTUM, in, 18200 * 7.2, true); // 0.8 · 0.9 / 0.1
    in = berg(0.45);
    CHECK(MOMENTUM, in, 18200 * 0.9, true);
    in = berg(0.9); // A = φ
    e = bt_estimate_at(BT_EST_MOMENTUM, &in);
    assert_true(isnan(e.force) && !e.valid);
    in = berg(0.95);
    e = bt_estimate_at(BT_EST_MOMENTUM, &in);
    assert_true(isnan(e.force) && !e.valid);
    in = berg(nextafter(0.9, 0)); // as 0.9 comes out of a made field: no force of 4e18 N
    e = bt_estimate_at(BT_EST_MOMENTUM, &in);
    assert_true(isnan(e.force) && !e.valid);
}

TEST(dilute_limit_and_open_water)
{
    bt_estimate_input in = berg(0.1); // 4/3 · 0.1 · 910 · 55 · 0.25
    CHECK(DILUTE, in, 1668.3333333333333, true);
    in.restitution = 0.5;
    CHECK(DILUTE, in, 2502.5, true);
    in = berg(0.8);
    CHECK(DILUTE, in, 13346.666666666666, false);
    CHECK(OPEN_WATER, in, 1000, true);
    in = berg(0);
    for (int k = 0; k < bt_n_estimates(); k++)
        check(bt_estimate_at(k, &in), k == BT_EST_OPEN_WATER ? 1000 : 0, true, __LINE__);
}

TEST(without_tow_nothing_has_a_value)
{
    bt_estimate_input in = berg(0.8);
    in.speed = in.along = NAN;
    for (int k = 0; k < bt_n_estimates(); k++) {
        const bt_estimate e = bt_estimate_at(k, &in);
        assert_true(isnan(e.force) && !e.valid);
    }
    in = berg(0.8);
    in.speed = in.along = in.water_speed = in.water_along = 0;
    CHECK(LICHEY_HELLMER, in, 0, true);
    CHECK(OPEN_WATER, in, 0, true);
}

static void read_case(bt_case *c, const char *text)
{
    bt_errors err = {0};
    const bt_status status = bt_case_read_text(c, "case.yml", text, NULL, NULL, 0, &err);
    bt_errors_print(&err);
    bt_errors_free(&err);
    assert_int_equal(status, BT_OK);
}

TEST(conditions_follow_from_the_case)
{
    bt_case c;
    bt_estimate_input in;
    // Towed along y with the long side along x, a current of (0.3, 0.1): ΔV = (−0.3, 0.4), 0.5 m/s, 0.4 m/s along.
    read_case(&c, "run: {dt: 1, duration: 100}\ndomain: {length: 2 km, width: 2 km}\nice: {size: 30 m, size_spread: 0, "
                  "thickness: 0.7 m, concentration: 0.6}\n"
                  "body: {shape: rectangle, length: 80 m, width: 20 m, draft: 10 m, x: 1 km, restitution: 0.25}\n"
                  "tow: {speed: 0.5, direction: 90 deg}\nwater: {current_x: 0.3, current_y: 0.1, density: 1000}\n"
                  "estimate: {length_scale: 10}\n");
    bt_estimate_conditions(&c, &in);
    assert_true(fabs(in.width - 80) < 1e-9 && fabs(in.speed - 0.5) < 1e-12 && fabs(in.along - 0.4) < 1e-12);
    assert_true(in.water_speed == in.speed && in.water_along == in.along && in.ordered == in.along);
    // Ice that the wind drives past the water, at (0.3, 0.8): the body falls behind it.
    bt_estimate_input driven;
    bt_estimate_ordered(&c, (const double[]){0.3, 0.8}, &driven);
    assert_true(fabs(driven.along + 0.3) < 1e-12 && fabs(driven.speed - hypot(0.3, 0.3)) < 1e-12);
    assert_true(driven.water_along == in.along && driven.water_speed == in.water_speed && driven.drag == in.drag);
    const double drag = bt_estimate_at(BT_EST_OPEN_WATER, &driven).force;
    assert_true(fabs(drag / (in.drag * 0.5 * 0.4) - 1) < 1e-12); // of the water, whatever the ice does
    assert_true(in.concentration == 0.6 && in.thickness == 0.7 && in.floe_radius == 15 && in.restitution == 0.25);
    assert_true(in.p_star == 2000 && in.p_s == 130);
    // across the flow: (0.8, 0.6) · (80, 20) = 76 m; ½ · 1000 · 0.85 · 10 · 76 + 1000 · 5e-4 · 1600
    assert_true(fabs(in.drag - (323000 + 800)) < 1e-6);
    bt_case_free(&c);

    read_case(&c, "run: {dt: 1, duration: 100}\ntow: {mode: none}\n");
    bt_estimate_conditions(&c, &in);
    assert_true(isnan(in.along) && isnan(in.speed));
    bt_case_free(&c);
}

// Power law a = 2 on [10, 40]: <d³>/<d²> = 30 / ln 4. Lognormal with s = 0.5: 20 · 1.25². A field's own mean is
// compared to that.
TEST(floe_size_is_weighted_with_area)
{
    bt_case c;
    bt_estimate_input in;
    read_case(&c,
              "run: {dt: 1, duration: 100}\ndomain: {length: 2 km, width: 1 km}\nbody: {length: 80}\n"
              "ice: {size_law: power, size_min: 10, size_max: 40, size_exponent: 2, concentration: 0.4, shake: 0}\n");
    bt_estimate_conditions(&c, &in);
    assert_true(fabs(in.floe_radius - 15 / log(4)) < 1e-9);
    bt_field f;
    bt_errors err = {0};
    bt_field_init(&f);
    assert_int_equal(bt_field_generate(&c, &f, &err), BT_OK);
    double h, r;
    bt_estimate_field(&f, &h, &r);
    assert_true(f.n > 500 && fabs(h - c.ice.thickness) < 1e-12);
    if (fabs(r / in.floe_radius - 1) > 0.03) fail_msg("field %g, law %g", r, in.floe_radius);
    bt_field_free(&f);
    bt_case_free(&c);
    read_case(&c, "run: {dt: 1, duration: 100}\ndomain: {length: 2 km, width: 1 km}\nice: {size_law: lognormal, size: "
                  "20, size_spread: 0.5}\n");
    bt_estimate_conditions(&c, &in);
    assert_true(fabs(in.floe_radius - 10 * 1.5625) < 1e-9);
    bt_case_free(&c);
}

// Two floes of 1 and 3 m² and 0.1 and 0.5 m: h = (0.1 + 1.5)/4, not the mean of the two numbers.
TEST(thickness_is_weighted_with_area)
{
    bt_field f;
    bt_field_init(&f);
    const double small[8] = {0, 0, 1, 0, 1, 1, 0, 1}, big[8] = {0, 0, 3, 0, 3, 1, 0, 1};
    bt_field_add(&f, 4, small, 0, 0, 0, 0.1);
    bt_field_add(&f, 4, big, 5, 0, 0, 0.5);
    double h, r;
    bt_estimate_field(&f, &h, &r);
    assert_true(fabs(h - 0.4) < 1e-12 && fabs(r - (1 + 3 * sqrt(3)) / 4 / sqrt(BT_PI)) < 1e-12);
    bt_field_free(&f);
    bt_estimate_field(&f, &h, &r);
    assert_true(h == 0 && r == 0);
}

// Every estimate of a model, times the cube of the scale, is that of full scale: also where capture begins.
TEST(model_and_full_scale_agree)
{
    for (int k = 0; k < 2; k++) {
        bt_case c;
        char text[400];
        snprintf(text, sizeof text,
                 "run: {dt: 5, duration: 1000}\ndomain: {length: 5 km, width: 2 km, frame: geographic, ends: "
                 "wall, sides: wall}\n"
                 "ice: {size: 30 m, thickness: %s m, concentration: 0.95}\nbody: {length: 80 m, draft: 60 m}\n"
                 "tow: {speed: 0.5}\nwater: {current_x: -0.1}\n",
                 k ? "2" : "1"); // captured, or not
        read_case(&c, text);
        bt_estimate_input full, model;
        bt_estimate_conditions(&c, &full);
        bt_errors err = {0};
        assert_int_equal(bt_case_scale(&c, 1.0 / 30, &err), BT_OK);
        assert_true(fabs(c.estimate.length_scale - 30) < 1e-12 && c.estimate.p_star == 20e3 && c.estimate.p_s == 13e3);
        bt_estimate_conditions(&c, &model);
        assert_non_null(strstr(bt_estimate_at(BT_EST_LICHEY_HELLMER, &full).note, k ? "captured" : "drag"));
        for (int i = 0; i < bt_n_estimates(); i++) {
            const bt_estimate a = bt_estimate_at(i, &full), b = bt_estimate_at(i, &model);
            assert_ptr_equal(a.note, b.note);
            if (i == BT_EST_MOMENTUM) assert_true(isnan(a.force) && isnan(b.force));
            else if (fabs(27000 * b.force / a.force - 1) > 1e-12)
                fail_msg("%s: %g N, scaled %g N", bt_estimate_of(i)->name, a.force, 27000 * b.force);
        }
        bt_case_free(&c);
    }
}

TEST_MAIN(NULL, NULL)
