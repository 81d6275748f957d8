// SPDX-License-Identifier: MIT
// A force law from outside the program: the one of docs/how-to-add-a-force-law.md, and a spring that depends on the
// place. Registered once, each takes part in tow force, momentum balance, rest, free drift, the undisturbed ice of a
// moving window, series, summary and resume, without a line there.
//
// Red with (tried): the law left out of one of those loops (prediction, record, drift, window); the sum of forces of
// observe.c taken over drag, Coriolis and tilt alone; the implicit part of the record with U1 in place of U2; the rest
// of floes without asking laws that are added; the column of the law not in the checkpoint; the wrapped place of the
// towed body.
#include "scene.h"
#include "force/forces.h"

#include <unistd.h>

#include "base/h5read.h"
#include "base/checksum.h"
#include "bergtow/run.h"
#include "run/setup.h"
#include "force/drift.h"
#include "force/load.h"
#include "output/observe.h"
#include "step/window.h"

#include "examples/force_law.c"

// --- a spring that holds the towed body at x = 0, y = 0 --------------------------------------------------------------

static void spring(const bt_force_body *b, bt_load *l)
{
    const bt_pose p = bt_force_pose(b);
    l->fx -= b->own[0] * p.x;
    l->fy -= b->own[0] * p.y;
    l->moment -= b->own[1] * p.yaw;
}

static const bt_law_key spring_keys[] = {
    {"stiffness", "N/m", "0 N/m", "[0, 1e9]", "pull for each metre from the origin"},
    {"turning", "", "0", "[0, 1e12]", "moment for each radian of yaw, N m"},
};
static const bt_force_law spring_law = {.name = "spring",
                                        .doc = "pull of a spring to the origin",
                                        .towed_only = true,
                                        .keys = spring_keys,
                                        .n_keys = 2,
                                        .add = spring};

// --- a motor: a thrust that rises with time, a damper that turns -----------------------------------------------------

static void motor(const bt_force_body *b, bt_load *l)
{
    l->fx += b->own[0] * b->time;
    l->gw += b->own[1];
    l->jw += b->own[1] * b->own[2];
}

/// Takes back what Coriolis and skin drag do, but for a thousandth of the former at 1 m/s: no velocity balances it.
static void follow(const bt_force_body *b, bt_load *l)
{
    const double u = b->vel.x - b->par->water_u, v = b->vel.y - b->par->water_v, slip = b->own[1] * hypot(u, v);
    l->fx += b->own[0] * (b->vel.y + 1e-3) + slip * u;
    l->fy += -b->own[0] * b->vel.x + slip * v;
}

static const bt_law_key motor_keys[] = {
    {"thrust_rate", "", "0", "[0, 1e9]", "thrust for each second, N/s"},
    {"damping", "", "0", "[0, 1e9]", "moment for each rate of turn, N m s"},
    {"rate", "", "0", "[0, 10]", "rate of turn that it drives to, rad/s"},
};
static const bt_force_law motor_law = {.name = "motor",
                                       .doc = "thrust that rises with time, and a damper that turns",
                                       .towed_only = true,
                                       .keys = motor_keys,
                                       .n_keys = 3,
                                       .add = motor};

static const bt_law_key follow_keys[] = {
    {"deflection", "", "0", "[0, 1e9]", "mass times Coriolis parameter, kg/s"},
    {"skin", "", "0", "[0, 1e9]", "coefficient of skin drag, kg/m"},
};
static const bt_force_law follow_law = {.name = "follow",
                                        .doc = "what keeps a body from ever drifting freely",
                                        .towed_only = true,
                                        .keys = follow_keys,
                                        .n_keys = 2,
                                        .add = follow};

static double *own_of(bt_world *w, const bt_force_law *law)
{
    for (int k = 0; k < w->forces->n; k++)
        if (bt_force_laws[k] == law) return w->forces->own[k];
    fail_msg("%s is not in the table", law->name);
    return NULL;
}

static const bt_impulse *impulse_of(const bt_world *w, const bt_force_law *law)
{
    int k = 0;
    while (bt_force_laws[k] != law) k++;
    return &w->forces->law[k];
}

/// Waves into x at 30° with F = load × diameter, damped by per_speed × F.
static void make_waves(bt_world *w, double load, double per_speed)
{
    const double own[] = {1, 8, BT_PI / 6, load, per_speed};
    memcpy(own_of(w, &wave_drift_law), own, sizeof own);
}

static double width_of(const bt_world *w, bt_idx i) { return 2 * w->bodies.radius[i]; }

// --- the table -------------------------------------------------------------------------------------------------------

TEST(what_will_not_do_is_refused)
{
    static const bt_law_key bad_contact[] = {{"strength", "furlong", "0", "[0, 1]", "a strength of something"}},
                              no_range[] = {{"strength", "N", "0 N", NULL, "a strength of something"}},
                              beyond[] = {{"strength", "N", "2 N", "[0, 1]", "a strength of something"}};
    const struct { bt_force_law law; const char *says;
    } bad[] = {
        {{.name = "tilt", .doc = "a law of that name", .add = spring}, "this name is taken"},
        {{.name = "drag", .doc = "a sum of that name", .add = spring}, "this name is taken"},
        {{.name = "tow", .doc = "a law whose series is there", .add = spring}, "tow_force: this name"},
        {{.name = "share", .doc = "a part of no name", .add = spring, .part_of = "My Sum!"}, "part_of \"My Sum!\""},
        {{.name = "swell", .doc = "a part of one law", .add = spring, .part_of = "coriolis"}, "the force of one law"},
        {{.name = "Big Law", .doc = "a law of that name", .add = spring}, "lower-case letters"},
        {{.name = "idle", .doc = "a law without function"}, "no function"},
        {{.name = "mute", .add = spring}, "describe it in one line"},
        {{.name = "odd", .doc = "a law with a bad unit", .add = spring, .keys = bad_contact, .n_keys = 1},
         "unit furlong"},
        {{.name = "wide", .doc = "a law without a range", .add = spring, .keys = no_range, .n_keys = 1},
         "the range must be"},
        {{.name = "far", .doc = "a law with a bad default", .add = spring, .keys = beyond, .n_keys = 1},
         "the default must be"},
        {{.name = "ice", .doc = "a law whose section is there", .add = spring, .keys = spring_keys, .n_keys = 1},
         "choose a section of its own"},
    };
    const int laws = bt_n_force_laws, series = bt_n_series();
    for (size_t k = 0; k < sizeof bad / sizeof *bad; k++) {
        bt_errors err = {0};
        assert_int_not_equal(bt_force_register(&bad[k].law, &err), BT_OK);
        if (err.n == 0 || !strstr(err.text[0], bad[k].says))
            fail_msg("%s: %s", bad[k].says, err.n ? err.text[0] : "nothing said");
        bt_errors_free(&err);
    }
    assert_int_equal(bt_n_force_laws, laws);
    assert_int_equal(bt_n_series(), series);
}

static const char *const basin =
    "run: {dt: 0.1, duration: 4}\n"
    "domain: {length: 14, width: 6}\n"
    "ice: {concentration: 0.4, size: 0.8, friction: 0.35}\n"
    "body: {length: 2, x: 2}\n"
    "tow: {mode: speed, speed: 0.3, ramp: 0.5}\n"
    "output: {window_start: 1, sample_every: 3}\n"
    "wave_drift: {amplitude: 3 cm, period: 1.5 s, direction: 160 deg}\n";

static char folder[] = "/tmp/bergtow-law-XXXXXX";

static char *in_folder(const char *name)
{
    static char path[4][160];
    static int which;
    which = (which + 1) % 4;
    snprintf(path[which], sizeof path[which], "%s/%s", folder, name);
    return path[which];
}

static void read_basin(bt_case *c)
{
    bt_errors err = {0};
    FILE *f = fopen(in_folder("case.yml"), "w");
    assert_non_null(f);
    fputs(basin, f);
    assert_int_equal(fclose(f), 0);
    if (bt_case_read(c, in_folder("case.yml"), NULL, 0, &err) != BT_OK) fail_msg("%s", err.text[0]);
}

TEST(its_keys_are_keys_of_the_case)
{
    bt_case c;
    read_basin(&c);
    char *text = bt_case_resolved(&c);
    assert_non_null(strstr(text, "\nwave_drift:\n  amplitude: 0.03 m"));
    free(text);
    bt_field none;
    bt_field_init(&none);
    bt_world *w;
    bt_roster roster;
    bt_errors err = {0};
    if (bt_setup_world(&c, &none, &w, &roster, &err) != BT_OK) fail_msg("%s", err.text[0]);
    const double *own = own_of(w, &wave_drift_law);
    CHECK_CLOSE(own[DIRECTION], 160 * BT_PI / 180, 1e-15);
    CHECK_CLOSE(own[PER_WIDTH], 0.5 * 1027 * 9.81 * 0.03 * 0.03, 1e-12);
    bt_roster_free(&roster);
    bt_world_free(w);
    bt_case_free(&c);
}

// --- the towed body --------------------------------------------------------------------------------------------------

/// A body at the origin between floes; mode speed or line.
static bt_world *tow_world(bt_tow_mode mode, double speed)
{
    bt_params p = scene_params(0.2, 1);
    p.period_x = 40, p.x0 = -20, p.water_u = 0.05, p.coriolis = 0.02, p.tilt_ax = 1e-3;
    bt_world *w = bt_world_create(&p);
    for (int k = 0; k < 20; k++) {
        double v[8];
        scene_square(0.9, v);
        bt_body_def d = scene_prism(4, v, 40);
        d.x = 2 + 1.05 * (k / 4), d.y = 1.05 * (k % 4) - 1.5, d.friction = 0.3,
        d.drag = (bt_drag){.water_skin = 1, .water_form = 0.3};
        bt_world_add(w, &d);
    }
    double v[8] = {-1, -0.5, 1, -1, 1, 0.7, -1, 0.9};
    bt_body_def d = scene_prism(4, v, 60);
    d.motion = mode == BT_TOW_SPEED ? BT_KINEMATIC : BT_DYNAMIC;
    d.large = true, d.vx = mode == BT_TOW_SPEED ? speed : 0, d.friction = 0.3, d.added = 0.3 * d.mass;
    d.drag = (bt_drag){.water_skin = 20, .water_form = 8, .air_skin = 0.1, .yaw = 5};
    w->towed = bt_world_add(w, &d);
    w->tow = bt_alloc(1, sizeof *w->tow);
    *w->tow = (bt_tow){.mode = mode,
                       .ux = 1,
                       .speed = speed,
                       .dt = p.dt,
                       .carriage_x = 8,
                       .n_branches = mode == BT_TOW_LINE,
                       .branch[0] = {.length0 = 7, .k = 400, .c = 60, .hull_x = 1, .hull_y = 0.2}};
    make_waves(w, 12, 0.7);
    own_of(w, &spring_law)[0] = 3, own_of(w, &spring_law)[1] = 2;
    return w;
}

/// Led: the tow bears what the laws say at the prescribed velocity, wherever the body is, beyond the period, too.
TEST(the_tow_bears_it_at_a_set_speed)
{
    const double v = 1.2;
    bt_world *w = tow_world(BT_TOW_SPEED, v);
    for (int s = 0; s < 300; s++) {
        const double x = w->tow->travel_x;
        bt_world_step(w);
        bt_sample o;
        bt_observe(w, 1, &o);
        const double force = 12 * width_of(w, bt_world_towed(w)),
                     waves = force * cos(BT_PI / 6) + 0.7 * force * (0.05 - v), pull = -3 * x;
        const int n = bt_n_added();
        assert_int_equal(n, 4);
        CHECK_CLOSE(o.added[0], -waves, 1e-12 * force);
        CHECK_CLOSE(o.added[1], -pull, 1e-12 * (force + fabs(pull)));
        const double others = o.ice_resistance + o.drag_force + o.coriolis_force + o.tilt_force + o.inertia_force;
        CHECK_CLOSE(o.tow_force, others - waves - pull, 1e-12 * (fabs(others) + force + fabs(pull)));
        // the floes' own waves are not booked as ice
        CHECK_CLOSE(o.ice_resistance_budget, o.ice_resistance, 1e-9 * (fabs(o.ice_resistance) + force));
    }
    assert_true(w->tow->travel_x > 1.5 * w->par.period_x);
    bt_world_free(w);
}

/// On a line: in every step, M (U2 − U1) and I (ω2 − ω1) are the impulses of the laws, the line and the ice, to
/// rounding.
TEST(the_momentum_balance_closes_on_a_line)
{
    bt_world *w = tow_world(BT_TOW_LINE, 1.2);
    double turned = 0, touched = 0, worked = 0;
    for (int s = 0; s < 300; s++) {
        bt_world_step(w);
        bt_sample o;
        bt_observe(w, 1, &o);
        const bt_idx i = bt_world_towed(w);
        const bt_bodies *b = &w->bodies;
        const bt_branch *line = &w->tow->branch[0];
        const double dt = w->par.dt, m = b->mass[i];
        double x = line->lambda * line->lx + dt * o.ice_force_x, y = line->lambda * line->ly + dt * o.ice_force_y,
               turn = line->lambda * line->rxl + dt * o.ice_moment;
        double scale = fabs(x) + fabs(y) + m;
        for (int k = 0; k < w->forces->n; k++) {
            const bt_impulse *j = &w->forces->law[k];
            x += j->x, y += j->y, turn += j->turn;
            scale += fabs(j->x) + fabs(j->y) + fabs(j->turn);
        }
        const bt_vel *u1 = &b->vel_start[i], *u2 = &b->vel[i];
        CHECK_CLOSE(m * (u2->x - u1->x), x, 1e-12 * scale);
        CHECK_CLOSE(m * (u2->y - u1->y), y, 1e-12 * scale);
        CHECK_CLOSE(b->inertia[i] * (u2->w - u1->w), turn, 1e-12 * scale);
        // What each law is by itself: with U2 where it is implicit.
        const double force = 12 * width_of(w, i);
        CHECK_CLOSE(impulse_of(w, &wave_drift_law)->x, dt * force * (cos(BT_PI / 6) + 0.7 * (0.05 - u2->x)),
                    1e-12 * scale);
        CHECK_CLOSE(impulse_of(w, &wave_drift_law)->y, dt * force * (sin(BT_PI / 6) - 0.7 * u2->y), 1e-12 * scale);
        const double sum = o.ice_resistance + o.drag_force + o.coriolis_force + o.tilt_force + o.added[0] + o.added[1] +
                           o.inertia_force;
        CHECK_CLOSE(o.tow_force, sum, 1e-11 * scale / dt);
        turned = bt_max(turned, fabs(b->pose[i].yaw)), touched += o.ice_resistance != 0,
        worked = bt_max(worked, o.tow_force);
        assert_true(w->stats.momentum_residual < 1e-12);
    }
    assert_true(turned > 0.05 && touched > 20 && worked > 100);
    bt_world_free(w);
}

/// Forces are those of the middle of a step, so k t gives k t²/2m exactly; a damper gives a moment by itself:
/// I (ω2 − ω1) = Δt g (Ω − ω2).
TEST(thrust_of_the_middle_and_moment)
{
    enum { STEPS = 30 };
    const double rate = 0.7, damping = 5, turn = 0.3;
    bt_params p = scene_params(0.2, 1);
    bt_world *w = bt_world_create(&p);
    double v[8];
    scene_square(1, v);
    bt_body_def d = scene_prism(4, v, 20);
    d.large = true;
    w->towed = bt_world_add(w, &d);
    own_of(w, &motor_law)[0] = rate, own_of(w, &motor_law)[1] = damping, own_of(w, &motor_law)[2] = turn;
    for (int s = 0; s < STEPS; s++) bt_world_step(w);
    const bt_vel *u = &w->bodies.vel[bt_world_towed(w)];
    const double time = STEPS * p.dt, left = pow(1 + p.dt * damping / d.inertia, -STEPS);
    CHECK_CLOSE(u->x, 0.5 * rate * time * time / d.mass, 1e-13);
    CHECK_CLOSE(u->w, turn * (1 - left), 1e-13);
    bt_world_free(w);
}

// --- ice -------------------------------------------------------------------------------------------------------------

/// Undisturbed ice of a window moves as a floe among it that nothing touches, and begins as free drift has it.
TEST(undisturbed_ice_feels_it)
{
    enum { FLOES = 3 };
    bt_params p = scene_params(0.5, 1);
    p.period_x = 100, p.water_u = 0.1, p.air_v = 4, p.coriolis = 1e-3;
    bt_world *w = bt_world_create(&p);
    make_waves(w, 0.4, 0.5);
    for (int k = 0; k < FLOES; k++) {
        double v[8];
        scene_square(1, v);
        bt_body_def d = scene_prism(4, v, 20);
        d.x = 10 * k, d.drag = (bt_drag){.water_skin = 3, .air_skin = 0.01};
        bt_world_add(w, &d);
    }
    const bool hold[2] = {false, false};
    double drift[2];
    assert_true(bt_drift_velocity(w, 0, hold, drift));
    w->tow = bt_alloc(1, sizeof *w->tow);
    bt_undisturbed_create(w, FLOES, (const bool[2]){false, false});
    bt_window_create(w, 1, 50, FLOES);
    w->tow->travel_x = -1e9; // the window stands
    for (int s = 0; s < 1500; s++) {
        bt_world_step(w);
        const bt_vel *floe = &w->bodies.vel[bt_world_index(w, 1)];
        CHECK_CLOSE(w->undisturbed->vel.x, floe->x, 1e-14);
        CHECK_CLOSE(w->undisturbed->vel.y, floe->y, 1e-14);
    }
    CHECK_CLOSE(w->undisturbed->vel.x, drift[0], 1e-9);
    CHECK_CLOSE(w->undisturbed->vel.y, drift[1], 1e-9);
    // F (cos, sin) + g (U_w − U) + skin drag = 0 but for Coriolis and wind, which are small here
    assert_true(drift[0] > 0.1 + 0.1 && drift[1] > 0.1);
    bt_world_free(w);
}

/// Forces that nothing balances, although they are small beside each of them: no drift is found.
TEST(no_drift_where_nothing_balances)
{
    for (int never = 0; never < 2; never++) {
        bt_params p = scene_params(1e-3, 1);
        p.coriolis = 1e-2, p.water_u = 1;
        bt_world *w = bt_world_create(&p);
        double v[8], drift[2];
        scene_square(1, v);
        bt_body_def d = scene_prism(4, v, 20);
        d.large = true, d.drag.water_skin = 1e-3 * d.mass * p.coriolis;
        w->towed = bt_world_add(w, &d);
        if (never) own_of(w, &follow_law)[0] = d.mass * p.coriolis, own_of(w, &follow_law)[1] = d.drag.water_skin;
        const bool hold[2] = {false, false};
        assert_int_equal(bt_drift_velocity(w, bt_world_towed(w), hold, drift), !never);
        bt_world_free(w);
    }
}

/// A floe in water at rest: it rests without waves, and is moved by them, also in the step after they have risen.
TEST(floes_rest_only_without_it)
{
    for (int waves = 0; waves < 2; waves++) {
        bt_params p = scene_params(0.5, 1);
        bt_world *w = bt_world_create(&p);
        double v[8];
        scene_square(1, v);
        bt_body_def d = scene_prism(4, v, 20);
        d.drag.water_skin = 3;
        bt_world_add(w, &d);
        if (waves) make_waves(w, 0.4, 0.5);
        assert_int_equal(bt_forces_rest(w), !waves);
        for (int s = 0; s < 10; s++) bt_world_step(w);
        assert_int_equal(w->stats.n_active, waves);
        assert_true(waves ? w->bodies.vel[0].x > 0.01 : w->bodies.vel[0].x == 0);
        bt_world_free(w);
    }
}

// --- a run -----------------------------------------------------------------------------------------------------------

static double number(const char *text, const char *key)
{
    char quoted[80];
    snprintf(quoted, sizeof quoted, "\"%s\":", key);
    const char *at = strstr(text, quoted);
    if (!at) fail_msg("no %s in summary.json", key);
    return strtod(at + strlen(quoted), NULL);
}

static char *text_of(const char *path)
{
    FILE *f = fopen(path, "r");
    assert_non_null(f);
    char *text = calloc(1, 1 << 20);
    assert_true(fread(text, 1, (1 << 20) - 1, f) > 100);
    fclose(f);
    return text;
}

/// Runs the basin, in pieces of `steps`.
static void run_basin(const char *name, int64_t steps)
{
    bt_case c;
    bt_errors err = {0};
    read_basin(&c);
    const bt_run_options o = {.dir = in_folder(name),
                              .quiet = true,
                              .threads = 1,
                              .max_steps = steps,
                              .dump_step = -1,
                              .command_line = "test"};
    bt_status status = bt_run(&bt_comm_alone, &c, &o, &err);
    for (int64_t done = steps; steps > 0 && done < bt_case_steps(&c) && status == BT_OK; done += steps)
        status = bt_run_resume(&bt_comm_alone, &o, &err);
    if (status != BT_OK) fail_msg("%s", err.n ? err.text[0] : "a run failed");
    bt_case_free(&c);
}

static int64_t series_of(const char *name, const char *series, double *x)
{
    bt_errors err = {0};
    bt_h5_reader r;
    char path[80], *file = in_folder(name);
    snprintf(path, sizeof path, "/series/%s", series);
    strcat(file, "/result.h5");
    bt_h5_open(&r, file, BT_CHECKSUM_RESULT, &err);
    const int64_t n = bt_h5_size(&r, path, 0);
    bt_h5_read(&r, path, H5T_NATIVE_DOUBLE, 0, n, 1, x);
    if (r.status != BT_OK) fail_msg("%s", err.n ? err.text[0] : "no series");
    bt_h5_end(&r);
    return n;
}

/// Series and summary have the law by its name; stopped and taken up again in the middle of an entry, the same to the
/// bit.
TEST(a_run_records_it_and_a_resumed_run_the_same)
{
    run_basin("whole", 0);
    run_basin("pieces", 7);
    double whole[64], pieces[64], tow[64];
    const int64_t n = series_of("whole", "wave_drift_force", whole);
    assert_int_equal(n, 14); // 40 steps, three an entry
    assert_int_equal(series_of("pieces", "wave_drift_force", pieces), n);
    assert_memory_equal(whole, pieces, (size_t)n * sizeof *whole);
    assert_int_equal(series_of("whole", "tow_force", tow), n);
    char *a = text_of(in_folder("whole/summary.json")), *b = text_of(in_folder("pieces/summary.json"));
    const char *const means[] = {"mean_wave_drift_force_n", "mean_spring_force_n", "mean_tow_force_n",
                                 "mean_drag_force_n", "closure_n"};
    for (size_t k = 0; k < sizeof means / sizeof *means; k++) assert_true(number(a, means[k]) == number(b, means[k]));
    // Disc of 2 m at 0.3 m/s against waves at 160°: F = ½ ρ g a² D, 4 ω/g F (U_w − U)
    const double force = 0.5 * 1027 * 9.81 * 0.03 * 0.03 * 2,
                 want = -(force * cos(160 * BT_PI / 180) - 4 * (2 * BT_PI / 1.5) / 9.81 * force * 0.3);
    CHECK_CLOSE(number(a, "mean_wave_drift_force_n"), want, 1e-2 * want); // the disc is a polygon
    CHECK_CLOSE(whole[n - 1], number(a, "mean_wave_drift_force_n"), 1e-9);
    assert_true(fabs(number(a, "closure_relative")) < 1e-9 && number(a, "mean_spring_force_n") == 0);
    free(a);
    free(b);
}

static int set_up(void **state)
{
    (void)state;
    bt_errors err = {0};
    return !mkdtemp(folder) || bt_force_register(&wave_drift_law, &err) != BT_OK ||
           bt_force_register(&spring_law, &err) != BT_OK || bt_force_register(&motor_law, &err) != BT_OK ||
           bt_force_register(&follow_law, &err) != BT_OK;
}

static int clean_up(void **state)
{
    (void)state;
    char command[80];
    snprintf(command, sizeof command, "rm -r %s", folder);
    return system(command);
}

/// j − K (U, ω) with K = 0 is a force like any other. Red when it counts only where something is damped.
TEST(what_is_linear_acts_without_damping)
{
    const double dt = 0.5, m = 4, inertia = 8;
    bt_linear l = {.jx = 3, .jy = -2, .jw = 5, .twist = 5};
    bt_vel u = {.x = 1, .y = 2, .w = 0.25};
    bt_linear_take(&l, dt, m, inertia, (bt_inv){1 / m, 1 / inertia}, &u);
    assert_true(u.x == 1 + dt * 3 / m && u.y == 2 - dt * 2 / m && u.w == 0.25 + dt * 5 / inertia);
}

TEST_MAIN(set_up, clean_up)
