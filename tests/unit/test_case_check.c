// SPDX-License-Identifier: MIT
// Checks across the keys of a case, and the numbers that follow from it.
#include "case/case_derived.h"
#include "case/case_tow.h"
#include "case_text.h"


TEST(cross_checks_refuse)
{
    static const struct { const char *set, *fragment;
    } bad[] = {
        {"run.dt=11", "--set run.dt=11: 11 s is more than run.duration"},
        {"run.dt=1e-9", "steps of run.duration"},
        {"output.frame_interval=1e-6", "frames, more than the limit of"},
        {"output.window_start=10", "10 s is not below run.duration, 10 s"},
        {"body.shape=square;body.length=11", "spans 11 m along y in a domain of 10 m"},
        {"body.x=0.5", "is outside the domain"},
        {"body.y=4.5", "is outside the domain"},
        {"body.x=100", "is outside the domain"},
        {"ice.x_min=80", "the ice region is empty"},
        {"ice.x_max=73", "73 m is more than the high end of the domain, 72 m"},
        {"ice.y_min=-6", "-6 m is less than the low end of the domain, -5 m"},
        {"ice.x_min=-1", "less than the low end of the domain"},
        {"ice.y_max=6", "more than the high end of the domain"},
        {"ice.extent.y_max=4", "4 m is less than ice.y_max, 5 m, and the field is cut"},
        {"ice.extent.x_min=1", "1 m is more than ice.x_min, 0 m, and the field is cut"},
        {"ice.extent.x_max=7e6;ice.extent.y_max=3e5", "floes, more than the limit of 20000000"},
        {"ice.field=f.h5;ice.extent.y_min=-20", "ice.extent.y_min=-20: has no effect on ice that is read"},
        {"ice.size=11", "11 m is more than the short side of the ice region, 10 m"},
        {"ice.size=1 mm", "floes, more than the limit of 20000000"},
        {"ice.size_law=power", "needs a smallest size"},
        {"ice.size_min=3;ice.size_max=2", "is not below ice.size_max"},
        {"ice.size_law=power;ice.size_min=2;ice.size_max=20", "ice.size_max=20: 20 m is more than the short side"},
        {"ice.size_law=lognormal;ice.size_min=2;ice.size_max=3", "1 m is less than ice.size_min, 2 m; change one"},
        {"ice.size_min=0.5", "ice.size_min=0.5: has no effect with ice.size_law: single"},
        {"ice.size_exponent=1.5", "has no effect without ice.size_law: power"},
        {"ice.size_law=power;ice.size_min=0.5;ice.size_max=5;ice.size=2", "has no effect with ice.size_law: power"},
        {"ice.size_law=power;ice.size_min=0.5;ice.size_max=5;ice.size_spread=0.4", "size_spread=0.4: has no effect"},
        {"ice.thickness_spread=0.3", "has no effect with ice.thickness_law: constant"},
        {"ice.aspect=2", "ice.aspect=2: has no effect on floes of this ice.shape"},
        {"ice.shape=polygons;ice.aspect=2", "ice.aspect=2: has no effect"},
        {"ice.shape=rectangles;ice.sides=4", "ice.sides=4: has no effect"},
        {"ice.field=f.h5;ice.concentration=0.5", "ice.concentration=0.5: has no effect on ice that is read"},
        {"ice.field=f.h5;ice.size=2", "ice.size=2: has no effect on ice that is read"},
        {"ice.field=f.h5;ice.thickness=1", "ice.thickness=1: has no effect on the floes of a field file"},
        {"ice.outlines=f.json;ice.shake=0", "ice.shake=0: has no effect on ice that is read"},
        {"domain.ends=periodic;domain.ends_closing=0.1", "has no effect without a wall to move"},
        {"domain.sides=open;domain.sides_closing=0.1", "has no effect without a wall to move"},
        {"domain.sides_closing=1", "brings the walls together after 5 s"},
        {"run.duration=10;domain.sides_closing=0.41", "leaves 1.8 m between the walls at the end of the run"},
        {"run.duration=10;domain.sides_closing=0.48;body.shape=polygon;body.vertices=[[2, 0], [-1, 0.3], [-1, -0.3]]",
         "leaves 0.4 m between the walls at the end of the run, and the body is 0.597"},
        {"tow.mode=line;tow.line_length=0", "is 0 m and a tow by a line needs it; give it, as in 5 m"},
        {"tow.mode=line;tow.line_stiffness=0", "needs a stiffness"},
        {"body.shape=none;tow.mode=speed", "no body to tow"},
        {"tow.mode=none;tow.speed=1", "has no effect with tow.mode: none"},
        {"body.vx=1", "has no effect with tow.mode: speed"},
        {"body.shape=square;tow.speed=10", "a wall is in its way after 67 m"},
        {"body.shape=square;tow.direction=90;tow.speed=1", "a wall is in its way after 4 m"},
        {"body.shape=square;tow.direction=180;tow.speed=1", "a wall is in its way after 3 m"},
        {"body.shape=polygon", "body.vertices: is missing"},
        {"body.vertices=[[0,0],[1,0],[0,1]]", "the shape is not polygon"},
        {"body.shape=polygon;body.vertices=[[0,0],[0,1],[1,0]]", "the waterline is refused"},
        {"body.shape=square;body.width=1", "the shape is square"},
        {"water.tilt=geostrophic", "needs the Coriolis force"},
        {"water.slope_x=0.001", "has no effect without water.tilt"},
        {"tow.programme=[[0,1],[5,2],[5,0]]", "point 3 is at 5 s, not later than the point before"},
        {"tow.programme=[[0,1],[5,60]]", "point 2: 60 is out of range; give a value in [0, 50] m/s"},
        {"tow.programme=[[0 m,1]]", "point 1: m is the unit of a length, but this is a time"},
        {"tow.programme=[[0,0],[5,1]];tow.speed=2", "has no effect with tow.programme, whose largest speed is 1 m/s"},
        {"tow.programme=[[0,0],[5,1]];tow.ramp=4", "reaches its largest speed at 5 s"},
        {"tow.mode=none;tow.programme=[[0,1]]", "has no effect with tow.mode: none"},
        {"body.shape=square;tow.programme=[[0,8],[10,8]]", "a wall is in its way after 67 m; shorten the run to 8"},
        // on a rise a step goes farther than the time that it takes
        {"body.shape=square;tow.speed=12.5;tow.ramp=9.5;run.dt=0.5",
         "the tow is 68.75 m long and a wall is in its way after 67 m"},
        {"tow.waypoints=[]", "has 0 points"},
        {"tow.waypoints=[[9,0],[9,0]]", "way-point 2 is at the place of the previous one"},
        {"tow.turn_radius=3", "no effect without tow.waypoints"},
        {"tow.waypoints=[[20,0],[20,2]];tow.turn_radius=3", "leaves no room for a turn"},
        {"tow.waypoints=[[20,0]];tow.direction=10", "is not the direction from the body to the first way-point"},
        {"tow.mode=line;tow.waypoints=[[9,0]]", "is not ahead of the start of the towing end, (10"},
        {"tow.waypoints=[[6,0],[6,10]];tow.speed=1", "into a wall after"},
        {"body.shape=square;tow.speed=0.5;domain.ends_closing=0.4;run.duration=80",
         "the tow is 38.8966 m long and a wall is in its way after 36.6966 m; shorten the run to 75.6 s"},
        {"tow.waypoints=[[30,0],[31,0]];tow.speed=0.5;domain.ends_closing=0.4;run.duration=80", "into a wall after"},
        {"tow.line_length=7", "tow.line_length=7: has no effect without a line"},
        {"body.shape=polygon;body.vertices=[[1, 0], [0, 1], [-1, -1]];body.length=3",
         "body.length=3: has no effect on the waterline of body.vertices"},
        {"body.shape=none;tow.mode=none;tow.speed=0;body.draft=2", "body.draft=2: has no effect without a towed body"},
        {"tow.mode=none;tow.speed=0;tow.ramp=3", "tow.ramp=3: has no effect on a body that is not towed"},
        {"tow.mode=line;tow.branch2.length=7", "tow.branch2.length=7: has no effect on a single line"},
        {"tow.mode=line;tow.vessel.mass=7", "tow.vessel.mass=7: has no effect without a vessel"},
        {"lead.width=7", "lead.width=7: has no effect without a lead"},
        {"lead.mode=channel;lead.floe_size=7", "lead.floe_size=7: has no effect on a channel"},
        {"ice.crushing.least_length=7", "ice.crushing.least_length=7: has no effect on ice that does not crush"},
        {"ice.splitting.strength=200 kPa", "ice.splitting.strength=200 kPa: has no effect on floes that do not split"},
        {"ice.splitting.toughness=1e3;domain.ends=moving;domain.ahead=20",
         "are not supported with domain.ends: moving"},
        {"ice.splitting.toughness=1e3;ice.splitting.least_size=1", "least_size=1: 1 m is not below ice.size, 1 m"},
        {"ice.splitting.toughness=1e3;ice.size_law=power;ice.size_min=0.5;ice.size_max=2;ice.splitting.least_size=2.5",
         "2.5 m is not below ice.size_max, 2 m"},
        {"ice.splitting.toughness=1e3;ice.splitting.scatter=1.5",
         "1.5 is less than 2: such a Weibull modulus leaves floes without"},
        {"ice.splitting.toughness=1e3;ice.thickness=none;ice.field=f.h5", "has no default where ice.thickness is none"},
        {"water.tide.phase=7", "water.tide.phase=7: has no effect without a tide"},
        {"domain.ends=open;domain.sides=open;domain.wall_friction=0.7",
         "wall_friction=0.7: has no effect without walls"},
        {"tow.mode=line;tow.hull_x=1;tow.hull_y=-3", "the line is fastened at (1, -3) m"},
        {"tow.mode=line;tow.line.branches=2;tow.branch2.hull_y=-3", "the line is fastened at ("},
        {"domain.ends=moving;domain.sides=open;tow.direction=5;lead.mode=channel;lead.length=50",
         "lead.length=50: 50 m is more than domain.ahead"},
        {"domain.ends=moving;tow.waypoints=[[40,0],[41,3]]", "the leg from way-point 1 leads 71.5651 deg from x"},
        {"tow.mode=none;tow.waypoints=[[9,0]]", "has no effect with tow.mode: none"},
        {"tow.mode=line;tow.line.type=dyneema", "a named line needs a diameter"},
        {"tow.mode=line;tow.line.diameter=0.1", "has no effect without a named line"},
        {"tow.mode=line;tow.line.branches=2;tow.branch2.length=0.9", "do not both reach the middle"},
        {"tow.mode=thrust", "tow.vessel.mass: is 0 kg and tow.mode thrust needs it"},
        {"tow.mode=thrust;tow.vessel.mass=1;tow.vessel.bollard_pull=1;tow.vessel.free_resistance=2",
         "thrust does not grow with speed"},
    };
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        char copy[128];
        const char *set[8];
        int n = 0;
        snprintf(copy, sizeof copy, "%s", bad[i].set);
        for (char *part = strtok(copy, ";"); part; part = strtok(NULL, ";")) set[n++] = part;
        bt_case c;
        bt_errors err = {0};
        if (read_text_with(&c, base, set, n, &err) != BT_ERR_CASE) fail_msg("accepted: %s", bad[i].set);
        if (!has(&err, bad[i].fragment)) fail_with(&err, bad[i].fragment);
        bt_errors_free(&err);
        bt_case_free(&c);
    }
}

TEST(cross_checks_let_pass)
{
    static const char *const good[] = {
        "tow.speed=6.7", // 6.7 × (10 − 2.5) = 50 m of 67 m: the ramp counts
        "domain.ends=open;tow.speed=50",
        "domain.ends=periodic;tow.speed=50",
        "tow.mode=none",
        "body.shape=none",
        "tow.mode=line;body.vx=1",
        "tow.speed=0",
        "ice.concentration=0;ice.size=1 mm",
        "domain.sides=open;body.length=9.9;body.x=12",
        "domain.sides_closing=0.4",
        "body.vertices=none",
        "body.x=none",
        "domain.length=0.3;domain.x0=-0.1;ice.x_max=0.2;body.shape=none;ice.size=0.1",
        "ice.size_law=power;ice.size_min=0.5;ice.size_max=5",
        "ice.shape=rectangles;ice.aspect=2",
        "ice.outlines=f.json;ice.thickness=1",
        "ice.field=f.h5;ice.concentration=0.8", // the default
        "water.tilt=geostrophic;water.latitude=75",
        "tow.programme=[[0,8],[10,0]]",
        "tow.programme=[[0,0],[1,7],[8,7]];tow.speed=7;tow.ramp=1",
        "tow.waypoints=[[20,0],[40,3]];tow.direction=0;tow.turn_radius=10",
        "tow.mode=line;tow.waypoints=[[11,0],[9,0]]",
        "tow.mode=line;tow.line.branches=2;tow.branch2.length=5.5",
        "tow.mode=line;tow.line.type=steel-wire;tow.line.diameter=20 mm",
        "tow.mode=thrust;tow.vessel.mass=1 t;tow.vessel.bollard_pull=1 kN;tow.vessel.free_speed=2;tow.speed=50",
    };
    for (size_t i = 0; i < sizeof good / sizeof *good; i++) {
        char copy[128];
        const char *set[8];
        int n = 0;
        snprintf(copy, sizeof copy, "%s", good[i]);
        for (char *part = strtok(copy, ";"); part; part = strtok(NULL, ";")) set[n++] = part;
        bt_case c;
        bt_errors err = {0};
        if (read_text_with(&c, base, set, n, &err)) fail_with(&err, good[i]);
        if (c.tow.mode == BT_TOW_NONE) assert_true(c.tow.speed == 0);
        if (c.body.shape == BT_BODY_ABSENT) assert_true(c.tow.mode == BT_TOW_NONE && bt_case_body_mass(&c) == 0);
        assert_true(bt_case_reference_speed(&c) > 0);
        bt_case_free(&c);
    }
}

TEST(floes_by_hand_are_checked)
{
    static const struct { const char *floe, *fragment;
    } bad[] = {
        {"{x: 1, length: 1}", "a.yml:2: floes[0].y: missing"},
        {"{x: 5, y: 0}", "a.yml:2: floes[0]: has no length"},
        {"{x: 71.8, y: 0, length: 1}", "outside the domain in x"},
        {"{x: 9, y: 6, length: 1}", "outside the domain in y"},
        {"{x: 9, y: 0, shape: polygon}", "has shape polygon but no vertices"},
        {"{x: 9, y: 0, shape: none}", "did you mean"},
        {"{x: 9, y: 0, length: 1, vertices: [[0,0],[1,0],[0,1]]}", "the shape is not polygon"},
        {"{x: 9, y: 0, shape: polygon, vertices: [[0,0],[2,0],[0,2],[2,2]]}", "outline is refused"},
        {"{x: 9, y: 0, length: 1, x: 2}", "duplicate key"},
        {"{x: 9, y: 0, length: 0}", "out of range"},
        {"{x: 9, y: 0, shape: polygon, vertices: [[0,0],[1,0]]}", "has 2 points"},
    };
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        char text[256];
        bt_case c;
        bt_errors err = {0};
        snprintf(text, sizeof text, "%sfloes: [%s]\n", base, bad[i].floe);
        if (read_text(&c, text, &err) != BT_ERR_CASE) fail_msg("accepted: %s", bad[i].floe);
        if (i != 5 && !has(&err, bad[i].fragment)) fail_with(&err, bad[i].fragment);
        if (err.n != 1) fail_with(&err, bad[i].floe);
        bt_errors_free(&err);
        bt_case_free(&c);
    }
    char text[256];
    bt_case c;
    bt_errors err = {0};
    snprintf(text, sizeof text, "%sfloes: [{x: 71.8, y: 0, length: 1, fixed: true}]\n", base);
    if (read_text(&c, text, &err)) fail_with(&err, "a fixed body may stand in a wall");
    bt_case_free(&c);
}

// The tow end after time t against the integral of its speed.
TEST(tow_distance_is_the_integral_of_the_ramped_speed)
{
    bt_case c;
    bt_case_defaults(&c);
    c.tow.speed = 0.7;
    c.tow.ramp = 3;
    double way = 0, dt = 1e-4;
    for (int i = 0; i < 80000; i++) {
        way += dt * c.tow.speed * bt_min(1, (i + 0.5) * dt / c.tow.ramp);
        if (i % 9999 == 0) assert_true(fabs(bt_case_tow_distance(&c, (i + 1) * dt) - way) < 1e-9);
    }
    bt_case_free(&c);
}

// Expected number of floes of a power law against a sum over a fine histogram of N(>d) ~ d^-a.
TEST(expected_floes_of_a_power_law)
{
    bt_case c;
    bt_errors err = {0};
    const char *set[] = {"ice.size_law=power",    "ice.size_min=0.5", "ice.size_max=5",
                         "ice.concentration=0.5", "body.shape=none",  ""};
    static const char *const exponents[] = {"ice.size_exponent=1.5", "ice.size_exponent=2", "ice.size_exponent=2.5"};
    for (int e = 0; e < 3; e++) {
        set[5] = exponents[e];
        if (read_text_with(&c, base, set, 6, &err)) fail_with(&err, "refused");
        double a = c.ice.size_exponent, count = 0, area = 0;
        for (int i = 0; i < 100000; i++) {
            double d0 = 0.5 + 4.5 * i / 100000, d1 = 0.5 + 4.5 * (i + 1) / 100000, d = (d0 + d1) / 2,
                   n = pow(d0, -a) - pow(d1, -a);
            count += n;
            area += n * BT_PI / 4 * d * d;
        }
        double want = 0.5 * 720 * count / area;
        assert_true(fabs(bt_case_expected_floes(&c) / want - 1) < 1e-6);
        bt_case_free(&c);
    }
}

TEST(steps_do_not_gain_one_by_round_off)
{
    bt_case c;
    bt_case_defaults(&c);
    c.run.duration = 450, c.run.dt = 0.1;
    assert_true(bt_case_steps(&c) == 4500);
    c.run.duration = 0.3, c.run.dt = 0.1; // the quotient is 2.9999999999999996
    assert_true(bt_case_steps(&c) == 3);
    c.run.duration = 2.1, c.run.dt = 0.3; // the quotient is 7.000000000000001
    assert_true(bt_case_steps(&c) == 7);
    c.run.duration = 1e7, c.run.dt = 0.01;
    assert_true(bt_case_steps(&c) == 1000000000);
    c.run.duration = 1, c.run.dt = 0.3;
    assert_true(bt_case_steps(&c) == 4);
    bt_case_free(&c);
}

TEST_MAIN(make_folder, remove_folder)
