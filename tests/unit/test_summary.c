// SPDX-License-Identifier: MIT
// summary.json of made-up runs: its numbers against sums of the test's own, and a warning for each doubt.
#include "made_up_run.h"

#include "output/steady.h"
#include "step/window.h"

/// The text after "key": up to the end of the line, without a comma.
/// Of a member that has a line of its own: not of a value of a warning.
static const char *json_value(const char *json, const char *key)
{
    static char value[400];
    char wanted[80];
    snprintf(wanted, sizeof wanted, " \"%s\": ", key);
    const char *at = json ? strstr(json, wanted) : NULL;
    while (at && at[-1] != '\n' && at[-1] != ' ') at = strstr(at + 1, wanted);
    if (!at) {
        print_error("no %s in %s\n", key, json ? json : "(no file)");
        return "missing";
    }
    snprintf(value, sizeof value, "%s", at + strlen(wanted));
    value[strcspn(value, "\n")] = '\0';
    const size_t n = strlen(value);
    if (n && value[n - 1] == ',') value[n - 1] = '\0';
    return value;
}

TEST(summary_holds_the_numbers)
{
    bt_errors err = {0};
    const bt_case c = made_up_case();
    assert_int_equal(write_run(in_folder("a"), &c, 600, 3, &err), BT_OK);
    char *json = slurp(in_folder("a/summary.json"));
    double mean = 0;
    const double start = atof(json_value(json, "start_s"));
    int n = 0;
    for (int i = 0; i < 600; i++)
        if (sample(i).time >= start) mean += sample(i).ice_resistance, n++;
    mean /= n;
    assert_true(fabs(atof(json_value(json, "mean_ice_resistance_n")) - mean) < 1e-9);
    assert_true(fabs(atof(json_value(json, "mean_tow_force_n")) - mean - 21) < 1e-9);
    assert_true(fabs(atof(json_value(json, "closure_n"))) < 1e-9);
    assert_true(fabs(atof(json_value(json, "ratio")) - mean / 500) < 1e-12);
    const double se = atof(json_value(json, "mean_ice_resistance_se_n"));
    assert_true(se > 0 && se < 3);
    assert_int_equal(atoi(json_value(json, "n_samples")), n);
    assert_true(n >= 300);
    assert_string_equal(json_value(json, "rule"), "\"mser5\"");
    assert_string_equal(json_value(json, "n_floes"), "3");
    assert_string_equal(json_value(json, "n_steps"), "600");
    assert_string_equal(json_value(json, "dt_s"), "0.1");
    assert_string_equal(json_value(json, "sim_time_s"), "60");
    assert_string_equal(json_value(json, "contacts_mean"), "8.5");
    assert_string_equal(json_value(json, "mean_sweeps"), "5");
    assert_string_equal(json_value(json, "unconverged_steps"), "0");
    assert_string_equal(json_value(json, "positive_work_steps"), "0");
    assert_string_equal(json_value(json, "contact_work_j"), "-1200");
    assert_string_equal(json_value(json, "crushed_work_j"), "225");
    assert_string_equal(json_value(json, "crushing_steps"), "150");
    assert_string_equal(json_value(json, "max_crushing_contacts"), "3");
    assert_string_equal(json_value(json, "max_crushed_depth_m"), "0.01");
    assert_string_equal(json_value(json, "stalled_s"), "0");
    assert_string_equal(json_value(json, "max_overlap_m"), "0.0001");
    assert_string_equal(json_value(json, "max_overlap_relative"), "5e-05");
    assert_string_equal(json_value(json, "state_hash"), "\"0123456789abcdef\"");
    assert_string_equal(json_value(json, "exchange"), "6");
    assert_true(fabs(atof(json_value(json, "ns_per_floe_step")) - 0.6e9 / 1800) < 1e-3);
    assert_string_equal(json_value(json, "stopped"), "null");
    assert_string_equal(json_value(json, "warnings"), "[]");
    assert_non_null(strstr(json, "\"title\": \"quote \\\" backslash \\\\ newline \\u000a and byte \\ufffd end\""));
    free(json);
}

/// Write a run whose samples are changed by spoil, and return its summary.json.
static char *summary_of(bt_case *c, int steps, const bt_run_totals *t, bt_idx towed, void (*spoil)(bt_sample *, int))
{
    bt_errors err = {0};
    bt_record_bodies b = bodies();
    b.towed = towed;
    bt_record *r;
    assert_int_equal(bt_record_open(&r, &bt_comm_alone, in_folder("s"), c, &b, "", NULL, true, &err), BT_OK);
    for (int i = 0; i < steps; i++) {
        bt_sample s = sample(i);
        if (spoil) spoil(&s, i);
        bt_record_sample(r, &s, &err);
    }
    assert_int_equal(bt_record_close(r, t, NULL, false, &err), BT_OK);
    assert_int_equal(err.n, 0);
    return slurp(in_folder("s/summary.json"));
}

static void slow_wave(bt_sample *s, int i)
{
    s->ice_resistance = 1000 + 100 * sin(2 * BT_PI * i / 200.0);
    s->ice_resistance_budget = s->ice_resistance;
    s->tow_force = s->ice_resistance + 21;
}

static void everything_wrong(bt_sample *s, int i)
{
    s->unconverged = i % 3 == 0;
    s->contact_work = i % 5 == 0 ? 1 : -1;
    s->added_energy = i % 5 == 0;
    s->repeats = i % 4 == 0 ? 3 : 0;
    s->overlap = 0.1;
    bt_sample_set(s, bt_series_find("crushed_depth"), 0.9);
    s->momentum_residual = 1e-3;
    s->tow_force += 100;
    s->ice_resistance_budget -= 7;
}

static void broken_number(bt_sample *s, int i)
{
    if (i == 400) s->ice_resistance = NAN;
}

TEST(every_doubt_is_reported)
{
    bt_case c = made_up_case();
    bt_run_totals t = totals(600);

    c.output.window_start = 20;
    char *json = summary_of(&c, 600, &t, FLOES, slow_wave);
    assert_non_null(strstr(json, "independent samples of the ice resistance"));
    assert_string_equal(json_value(json, "verdict"), "\"too short\"");
    assert_string_equal(json_value(json, "rule"), "\"given\"");
    assert_string_equal(json_value(json, "start_s"), "20");
    assert_int_not_equal(strncmp(json_value(json, "warning"), "null", 4), 0);
    free(json);

    t.stopped = "SIGTERM";
    t.floes_outside = 2;
    t.stall = (bt_stall){.windows = 3, .time = 12};
    json = summary_of(&c, 600, &t, FLOES, everything_wrong);
    static const char *const reported[] = {"stopped early: SIGTERM",
                                       "200 of 600 steps reached the work limit",
                                       "120 of 600 steps the contacts added energy",
                                       "overlap by up to 0.1 m",
                                       "momentum is conserved only to 0.001",
                                       "2 floes left",
                                       "differs from tow - drag - Coriolis - tilt - inertia",
                                       "from that by momentum",
                                       "crushed to a depth of 0.9 m, 45 % of the mean floe size",
                                       "stood still for 12 s of 60 s"};
    for (size_t k = 0; k < sizeof reported / sizeof *reported; k++)
        if (!strstr(json, reported[k])) fail_msg("not reported: %s in %s", reported[k], json);
    assert_null(strstr(json, "independent samples of the"));
    assert_string_equal(json_value(json, "repeated_solves"), "450");
    assert_string_equal(json_value(json, "verdict"), "\"not steady\""); // a third of the steps did not converge
    free(json);

    t = totals(600);
    json = summary_of(&c, 600, &t, FLOES, broken_number);
    assert_string_equal(json_value(json, "mean_ice_resistance_n"), "null");
    assert_non_null(strstr(json, "not finite"));
    free(json);

    c.output.window_start = 100;
    json = summary_of(&c, 600, &t, FLOES, NULL);
    assert_string_equal(json_value(json, "mean_ice_resistance_n"), "null");
    assert_non_null(strstr(json, "no window: it would begin at 100 s, but the run ends at 60 s"));
    free(json);

    c.output.window_start = -1;
    c.tow.ramp = 50;
    json = summary_of(&c, 600, &t, FLOES, NULL);
    assert_true(atof(json_value(json, "start_s")) >= 50);
    free(json);
}

/// White noise of unit size by i, the test's own.
static double noise(int i)
{
    uint64_t z = ((uint64_t)i + 1) * 0x9e3779b97f4a7c15u;
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
    return sqrt(12) * ((double)((z ^ (z >> 31)) >> 11) * 0x1p-53 - 0.5);
}

static void set_forces(bt_sample *s, double ice, double tow)
{
    s->ice_resistance = s->ice_resistance_budget = ice;
    s->tow_force = tow;
    s->drag_force = 20;
    s->inertia_force = tow - ice - s->drag_force - s->coriolis_force - s->tilt_force;
}

static void sound_tow(bt_sample *s, int i) { set_forces(s, 100 + 10 * noise(i), 121 + 10 * noise(i)); }

/// The body is drawn with a jerk and swings on its line for half of the run, in noiseless ice.
static void jerked_tow(bt_sample *s, int i)
{
    set_forces(s, 100 + 10 * noise(i), 121 + 10 * noise(i));
    s->line_tension_2 = NAN;
    s->line_tension = s->line_tension_1 = 121 + 2000 * exp(-i / 60.0) + 10 * noise(i + 1000);
}

static void rising_ice(bt_sample *s, int i)
{
    set_forces(s, 100 + 0.05 * i + 10 * noise(i), 121 + 0.05 * i + 10 * noise(i));
}
static void one_wild_step(bt_sample *s, int i) { sound_tow(s, i), s->residual = i == 500 ? 0.2 : s->residual; }
static void few_unconverged(bt_sample *s, int i) { sound_tow(s, i), s->unconverged = i > 300 && i % 50 == 0; }

static void carried_along(bt_sample *s, int i)
{
    slow_wave(s, i);
    s->tow_force -= 2000;
    s->drag_force -= 2000;
}

TEST(a_body_that_the_tow_holds_back_is_reported)
{
    bt_case c = made_up_case();
    bt_run_totals t = totals(600);
    c.output.window_start = 20;
    char *json = summary_of(&c, 600, &t, FLOES, slow_wave);
    assert_null(strstr(json, "\"held_back\""));
    free(json);
    json = summary_of(&c, 600, &t, FLOES, carried_along);
    assert_non_null(strstr(json, "\"code\": \"held_back\""));
    assert_null(strstr(json, "\"code\": \"body_balance\""));
    const double mean = atof(json_value(json, "mean_tow_force_n"));
    assert_true(mean < -900 && fabs(atof(json_value(json, "peak_tow_force_n")) + 879) < 0.1);
    double said[2];
    const char *values = strstr(strstr(json, "\"held_back\""), "\"values\"");
    assert_int_equal(sscanf(values, "\"values\": {\"mean_n\": %lf, \"least_n\": %lf}", said, said + 1), 2);
    assert_true(fabs(said[0] - mean) < 1e-9 && fabs(said[1] + 1079) < 0.1);
    free(json);
}

TEST(the_window_serves_every_series)
{
    bt_case c = made_up_case();
    const bt_run_totals t = totals(600);
    char *json = summary_of(&c, 600, &t, FLOES, sound_tow);
    assert_string_equal(json_value(json, "verdict"), "\"steady\"");
    assert_string_equal(json_value(json, "reasons"), "[]");
    const double alone = atof(json_value(json, "start_s"));
    assert_true(alone < 20);
    free(json);

    json = summary_of(&c, 600, &t, FLOES, jerked_tow);
    const double start = atof(json_value(json, "start_s"));
    assert_true(start > 15 && start > alone); // the ice alone would begin at `alone`
    assert_true(atof(json_value(json, "peak_line_tension_n")) < 300);
    assert_true(atof(json_value(json, "start_peak_line_tension_n")) > 2000);
    assert_true(fabs(atof(json_value(json, "mean_line_tension_n")) - 121) < 5);
    free(json);

    // Quarters, and the change of the line through them.
    c.output.window_start = 0;
    json = summary_of(&c, 600, &t, FLOES, rising_ice);
    assert_string_equal(json_value(json, "verdict"), "\"not steady\"");
    assert_non_null(strstr(json, "the ice resistance rises over the window by"));
    const char *quarters = strstr(json, "\"quarters_n\": [");
    assert_non_null(quarters);
    double q[4];
    assert_int_equal(sscanf(quarters + 15, " %lf , %lf , %lf , %lf", &q[0], &q[1], &q[2], &q[3]), 4);
    for (int k = 0; k < 4; k++) assert_true(fabs(q[k] - (103.75 + 7.5 * k)) < 2.5);
    assert_true(fabs(atof(json_value(json, "change_n")) - 30) < 4);
    free(json);
}

TEST(what_no_mean_goes_across_is_a_verdict)
{
    bt_case c = made_up_case();
    c.output.window_start = 20;
    double programme[] = {0, 1, 40, 1, 50, 0.5};
    bt_event event[] = {{.time = 45, .kind = BT_EVENT_LINE_BROKEN, .subject = 1, .value = 7}};
    const bt_events events = {.event = event, .n = 1};
    static const char *const reported[] = {"the window begins at 20 s, before the ramp of the tow ends at 30 s",
                                       "a step in the window ended with a residual of 0.2 m/s",
                                       "1.2 % of the steps in the window did not converge",
                                       "the speed programme goes from 1 to 0.5 m/s within the window",
                                       "a line parted at 45 s",
                                       "stood still for 6 s of 60 s",
                                       "at the front of the moving window found no free place"};
    for (size_t k = 0; k < sizeof reported / sizeof *reported; k++) {
        bt_case d = c;
        bt_run_totals t = totals(600);
        bt_window window = {.sign = 1, .renewed = 50, .missed = k == 6 ? 10 : 0, .length = 10};
        const bt_undisturbed ice = {.drift_x = -1};
        if (k == 0) d.tow.ramp = 30;
        if (k == 3) d.tow.programme = programme, d.tow.n_programme = 3;
        if (k == 4) t.events = &events;
        if (k == 5) t.stall = (bt_stall){.windows = 1, .time = 6};
        if (k == 6) t.window = &window, t.undisturbed = &ice;
        char *json = summary_of(&d, 600, &t, FLOES, k == 1 ? one_wild_step : k == 2 ? few_unconverged : sound_tow);
        assert_string_equal(json_value(json, "verdict"), "\"not steady\"");
        const char *reasons = strstr(json, "\"reasons\": ["), *said = reasons ? strstr(reasons, reported[k]) : NULL;
        if (!said || said > strstr(reasons, "]")) fail_msg("wanted '%s', reported %s", reported[k], json);
        free(json);
    }
}

TEST(without_a_towed_body_forces_are_null)
{
    bt_case c = made_up_case();
    c.reference.mean_force = NAN;
    const bt_run_totals t = totals(20);
    char *json = summary_of(&c, 20, &t, -1, NULL);
    static const char *const null[] = {"mean_ice_resistance_n", "mean_ice_resistance_se_n", "mean_tow_force_n",
                                       "mean_drag_force_n", "mean_ice_resistance_budget_n", "peak_ice_resistance_n",
                                       "closure_n", "start_s", "rule", "reference"};
    for (size_t k = 0; k < sizeof null / sizeof *null; k++) assert_string_equal(json_value(json, null[k]), "null");
    assert_string_equal(json_value(json, "warnings"), "[]");
    assert_string_equal(json_value(json, "n_steps"), "20");
    free(json);

    const bt_run_totals none = totals(0); // not one step
    json = summary_of(&c, 0, &none, FLOES, NULL);
    assert_string_equal(json_value(json, "contacts_mean"), "null");
    assert_string_equal(json_value(json, "sim_time_s"), "0");
    assert_non_null(strstr(json, "no window: it would begin at 0 s, but the run ends at 0 s"));
    free(json);
}

static void half_the_speed(bt_sample *s, int i)
{
    s->speed_through_ice = i < 290 ? 9 : 0.25 + 0.05 * (i % 2);
    s->leeway_through_ice = i < 290 ? 9 : 0.3;
    s->speed_through_water = 0.5, s->leeway_through_water = -0.1; // in water at rest
}

static void before_it_was_measured(bt_sample *s, int i)
{
    half_the_speed(s, i);
    if (i < 400) s->speed_through_ice = NAN;
}

/// Estimates are those of the speed that the body made through the ice in the window; of the speed ordered where a part
/// of it is not known; and nothing tows a body that is adrift.
TEST(estimates_take_the_speed_of_the_window)
{
    bt_case c = made_up_case();
    c.output.window_start = 30;
    c.body.shape = BT_BODY_RECTANGLE, c.body.length = 4, c.body.width = 2;
    c.tow.speed = 0.5;
    const bt_run_totals t = totals(600);
    char *json = summary_of(&c, 600, &t, FLOES, half_the_speed);
    assert_true(fabs(atof(json_value(json, "speed_along_m_s")) - 0.275) < 1e-3);
    assert_true(fabs(atof(json_value(json, "speed_m_s")) - hypot(0.275, 0.3)) < 1e-3);
    assert_true(fabs(atof(json_value(json, "water_speed_m_s")) - hypot(0.5, 0.1)) < 1e-9);
    // 0.5 through the water, past which the ice drifts at 0.225
    assert_true(fabs(atof(json_value(json, "ordered_speed_m_s")) - 0.275) < 1e-3);
    free(json);
    json = summary_of(&c, 600, &t, FLOES, before_it_was_measured);
    assert_true(fabs(atof(json_value(json, "speed_along_m_s")) - 0.5) < 1e-12);
    free(json);
    bt_event event[] = {{.time = 45, .kind = BT_EVENT_ADRIFT, .value = 7}};
    const bt_events events = {.event = event, .n = 1};
    bt_run_totals adrift = totals(600);
    adrift.events = &events;
    json = summary_of(&c, 600, &adrift, FLOES, half_the_speed);
    assert_string_equal(json_value(json, "speed_along_m_s"), "null");
    assert_null(strstr(json, "\"compares\": true"));
    free(json);
}

/// Their mean is not the value at the mean speed, unless they depend on none.
TEST(a_changing_speed_is_held_against_no_estimate_that_depends_on_it)
{
    bt_case c = made_up_case();
    c.output.window_start = 30;
    c.body.shape = BT_BODY_RECTANGLE, c.body.length = 4, c.body.width = 2;
    c.tow.speed = 0.5;
    double programme[] = {0, 0.5, 40, 0.5, 50, 0.25};
    for (int k = 0; k < 3; k++) {
        bt_case d = c;
        bt_run_totals t = totals(600);
        t.concentration = 0.8;
        if (k == 1) d.tow.ramp = 40;
        if (k == 2) d.tow.programme = programme, d.tow.n_programme = 3;
        char *json = summary_of(&d, 600, &t, FLOES, sound_tow);
        const char *momentum = strstr(json, "\"marchenko_momentum\": {");
        assert_string_equal(json_value(momentum, "compares"), k == 0 ? "true" : "false");
        const char *rafting = strstr(json, "\"marchenko_rafting\": {");
        assert_string_equal(json_value(rafting, "compares"), "true");
        free(json);
    }
}

static void never_touched(bt_sample *s, int i)
{
    s->ice_resistance = s->ice_resistance_budget = i < 100 ? 50 : 0;
    s->tow_force = s->ice_resistance + 21;
}

/// A body that no floe touched: no number of samples says what the ice resists, and no estimate is held against it.
TEST(a_body_that_met_no_ice_tells_nothing)
{
    bt_case c = made_up_case();
    c.output.window_start = 20;
    c.body.shape = BT_BODY_RECTANGLE, c.body.length = 4, c.body.width = 2;
    c.tow.speed = 0.5;
    bt_run_totals t = totals(600);
    for (int ice = 0; ice < 2; ice++) {
        t.concentration = ice ? 0.2 : 0;
        char *json = summary_of(&c, 600, &t, FLOES, never_touched);
        assert_true(!strstr(json, "the body met no ice within the window") == !ice);
        if (ice) assert_string_equal(json_value(json, "verdict"), "\"too short\"");
        assert_string_equal(json_value(json, "n_contact_stretches"), ice ? "0" : "null");
        if (ice) assert_null(strstr(json, "\"simulated_over_estimate\": 0"));
        free(json);
    }
}

static int spikes_apart;
static void spikes(bt_sample *s, int i) { set_forces(s, i % spikes_apart == 0 ? 1000 : 0, 121 + 10 * noise(i)); }

/// Nearly every step of a body that meets floes one by one is an independent sample, of nothing.
TEST(a_few_collisions_are_few_samples)
{
    bt_case c = made_up_case();
    c.output.window_start = 20;
    const bt_run_totals t = totals(600);
    for (int k = 0; k < 2; k++) {
        spikes_apart = k ? 10 : 100;
        char *json = summary_of(&c, 600, &t, FLOES, spikes);
        assert_true((strstr(json, "a few stretches of contact, equivalent to 4 equal ones") == NULL) == (k > 0));
        assert_string_equal(json_value(json, "verdict"), k ? "\"steady\"" : "\"too short\"");
        assert_true(fabs(atof(json_value(json, "n_independent")) - (k ? 40 : 4)) <= 1);
        assert_true(fabs(atof(json_value(json, "n_contact_stretches")) - (k ? 40 : 4)) <= 1);
        free(json);
    }
}

static void early_collision(bt_sample *s, int i)
{
    spikes_apart = 100;
    spikes(s, i);
    if (i >= 40 && i < 160) set_forces(s, i == 50 ? 1e6 : 5000, 121 + 10 * noise(i)); // and a push after it
}

static void carried(bt_sample *s, int i) { set_forces(s, 500 + (i % 100 == 0 ? 1000 : 0) + noise(i), 121); }
static void giant(bt_sample *s, int i) { set_forces(s, 100 + 10 * noise(i) + (i == 400 ? 1e6 : 0), 121); }

/// Nor is a floe that is carried on the bow all the time more than its hits, or a contact with one giant step.
TEST(contact_without_a_pause_may_be_few_samples)
{
    bt_case c = made_up_case();
    c.output.window_start = 20;
    const bt_run_totals t = totals(600);
    for (int k = 0; k < 3; k++) {
        char *json = summary_of(&c, 600, &t, FLOES, k == 0 ? carried : k == 1 ? giant : sound_tow);
        assert_string_equal(json_value(json, "verdict"), k < 2 ? "\"too short\"" : "\"steady\"");
        assert_true((strstr(json, "a few stretches of contact") != NULL) == (k < 2));
        free(json);
    }
}

/// Of a few collisions the first is no transient: a window that began after it would hold the others alone.
TEST(a_few_collisions_begin_no_window)
{
    bt_case c = made_up_case();
    const bt_run_totals t = totals(600);
    char *json = summary_of(&c, 600, &t, FLOES, early_collision);
    assert_true(atof(json_value(json, "start_s")) < 1);
    assert_true(atof(json_value(json, "n_independent")) < 4);
    free(json);
}

static void slow_ripple(bt_sample *s, int i) { set_forces(s, 1000 + 10 * sin(2 * BT_PI * i / 200.0), 1000); }

/// A slow wave of one per cent of the mean leaves nothing to doubt.
TEST(a_small_wave_needs_no_longer_run)
{
    bt_case c = made_up_case();
    c.output.window_start = 20;
    const bt_run_totals t = totals(600);
    char *json = summary_of(&c, 600, &t, FLOES, slow_ripple);
    assert_string_equal(json_value(json, "verdict"), "\"steady\"");
    free(json);
}

static void second_branch_parts(bt_sample *s, int i)
{
    sound_tow(s, i);
    s->line_tension_2 = i < 100 ? 5000 : 0;
}

/// Its zeros are no tension, and its largest stays.
TEST(a_branch_that_has_parted_has_no_mean)
{
    bt_case c = made_up_case();
    c.output.window_start = 20;
    bt_event event[] = {{.time = 10, .kind = BT_EVENT_LINE_BROKEN, .subject = 2, .value = 5000}};
    const bt_events events = {.event = event, .n = 1};
    for (int parted = 0; parted < 2; parted++) {
        bt_run_totals t = totals(600);
        if (parted) t.events = &events;
        char *json = summary_of(&c, 600, &t, FLOES, second_branch_parts);
        const char *second = strstr(json, "\"line_tension_2\": {");
        assert_non_null(second);
        assert_true((strncmp(json_value(second, "mean_n"), "null", 4) == 0) == (parted > 0));
        assert_string_equal(json_value(second, "start_peak_n"), "5000");
        assert_string_equal(json_value(json, "start_peak_line_tension_n"), "5000");
        free(json);
    }
}

static bool turned;
static void line_turns_it(bt_sample *s, int i) { sound_tow(s, i), s->body_yaw = turned && i >= 100 ? 0.5 * BT_PI : 0; }

/// A body that its line has turned pushes ice over the width that it has then.
TEST(the_width_is_that_of_the_window)
{
    bt_case c = made_up_case();
    c.output.window_start = 20;
    c.body.shape = BT_BODY_RECTANGLE, c.body.length = 4, c.body.width = 2;
    c.tow.speed = 0.5;
    const bt_run_totals t = totals(600);
    for (int k = 0; k < 2; k++) {
        turned = k > 0;
        char *json = summary_of(&c, 600, &t, FLOES, line_turns_it);
        assert_true(fabs(atof(json_value(json, "width_m")) - (turned ? 4 : 2)) < 1e-9);
        free(json);
    }
}

/// The ice that overtakes the body in a moving window is what it met before.
TEST(ice_that_overtakes_a_window_is_reported)
{
    bt_case c = made_up_case();
    bt_run_totals t = totals(600);
    const bt_undisturbed ice = {.drift_x = -12};
    for (int back = 0; back < 2; back++) {
        const bt_window window = {.sign = -1, .length = 40, .stride = 2, .overtaken = back ? 2.1 : 1.9};
        t.window = &window, t.undisturbed = &ice;
        char *json = summary_of(&c, 600, &t, FLOES, NULL);
        assert_true(!strstr(json, "ice overtook the body, which fell 2.1 m back through it") == !back);
        free(json);
    }
}

/// A branch that parts and a programme that changes before the window, or beyond it, are no part of its mean.
TEST(what_lies_beyond_the_window_does_not_judge_it)
{
    bt_case c = made_up_case();
    c.output.window_start = 20;
    double before[] = {0, 0.5, 10, 0.5, 15, 1}, beyond[] = {0, 1, 61, 1, 70, 0.5};
    bt_event event[] = {{.time = 10, .kind = BT_EVENT_LINE_BROKEN, .subject = 1, .value = 7}};
    const bt_events events = {.event = event, .n = 1};
    for (int k = 0; k < 3; k++) {
        bt_case d = c;
        bt_run_totals t = totals(600);
        if (k == 0) d.tow.programme = before, d.tow.n_programme = 3;
        if (k == 1) d.tow.programme = beyond, d.tow.n_programme = 3;
        if (k == 2) t.events = &events;
        char *json = summary_of(&d, 600, &t, FLOES, sound_tow);
        if (strcmp(json_value(json, "verdict"), "\"steady\"")) fail_msg("%d: %s", k, json_value(json, "reason"));
        free(json);
    }
}

/// Floes that come back as they were count among those that fell behind, not among the places ahead.
TEST(disturbed_ice_that_comes_back_is_reported)
{
    bt_case c = made_up_case();
    c.output.window_start = 20;
    const bt_undisturbed ice = {.drift_x = -12};
    static const struct {
        int64_t renewed, kept, missed;
        const char *warning;
    } of[] = {{300, 100, 0, "25.0 % of the floes behind the moving window came back"},
              {891, 9, 0, NULL},
              {300, 0, 100, "25.0 % of the places at the front of the moving window stayed empty"}};
    for (size_t k = 0; k < sizeof of / sizeof *of; k++) {
        bt_run_totals t = totals(600);
        const bt_window window = {.sign = 1, .length = 40, .stride = 2, .renewed = of[k].renewed, .kept = of[k].kept,
                                  .missed = of[k].missed};
        t.window = &window, t.undisturbed = &ice;
        char *json = summary_of(&c, 600, &t, FLOES, sound_tow);
        if (of[k].warning && !strstr(json, of[k].warning)) fail_msg("not reported: %s in %s", of[k].warning, json);
        assert_true((strstr(json, "came back ahead unchanged") != NULL) == (of[k].kept == 100));
        free(json);
    }
}

/// Of the branches that a run has, the strongest, whichever it is.
TEST(the_peak_tension_is_of_the_strongest_branch)
{
    bt_steady s;
    bt_steady_none(&s);
    assert_true(isnan(bt_steady_peak_tension(&s, false)));
    bt_reported *one = &s.series[BT_REPORTED_TENSION_1], *two = &s.series[BT_REPORTED_TENSION_2];
    one->peak = 7, one->start_peak = 1;
    assert_true(bt_steady_peak_tension(&s, false) == 7);
    two->peak = 5, two->start_peak = 3;
    assert_true(bt_steady_peak_tension(&s, false) == 7 && bt_steady_peak_tension(&s, true) == 3);
}

int main(void)
{
    return run_in_folder();
}
