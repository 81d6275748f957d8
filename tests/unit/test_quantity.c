// SPDX-License-Identifier: MIT
// The registry of quantities: what it refuses, the keys it makes, and the reductions of a made-up run against sums of
// the test's own. That every registered number is in every file: cli/test_quantities.py.
//
// Red with (tried): the reduction taken over all steps, or without the largest; a force of the balance not subtracted;
// a key of the summary's own not refused.
#include "made_up_run.h"

#include "output/summary_keys.h"

static double one(const bt_world *w, const void *context) { return (void)w, (void)context, 1; }
static double one_each(const bt_world *w, bt_idx floe, const void *context) { return (void)floe, one(w, context); }

#define SOUND .units = "N", .description = "a number of the test", .of_world = one

TEST(what_will_not_do_is_refused)
{
    const struct { bt_quantity q; const char *says; } bad[] = {
        {{.name = "Big Name", SOUND}, "lower-case letters"},
        {{.name = "9th", SOUND}, "lower-case letters"},
        {{SOUND}, "lower-case letters"},
        {{.name = "a_name_of_more_than_forty_eight_letters_is_too_long", SOUND}, "at most 48"},
        {{.name = "tow_force", SOUND}, "this name is taken"},
        {{.name = "bare", .description = "a number of the test", .of_world = one}, "no units"},
        {{.name = "mute", .units = "N", .of_world = one}, "describe it in one sentence"},
        {{.name = "idle", .units = "N", .description = "a number of the test"}, "give it one of"},
        {{.name = "both", SOUND, .of_floe = one_each}, "give it one of"},
        {{.name = "odd", SOUND, .keep = (bt_keep)9}, "an unknown value"},
        {{.name = "odd", SOUND, .role = (bt_role)-1}, "an unknown value"},
    };
    const int before = bt_n_series();
    for (size_t k = 0; k < sizeof bad / sizeof *bad; k++) {
        bt_errors err = {0};
        assert_int_equal(bt_quantity_register(&bad[k].q, &err), BT_ERR_USAGE);
        if (err.n != 1 || !strstr(err.text[0], bad[k].says)) fail_msg("%s", err.n ? err.text[0] : "no message");
        bt_errors_free(&err);
    }
    assert_int_equal(bt_n_series(), before);
}

/// One of each rule, and a force of the balance.
static const bt_quantity five[] = {
    {.name = "a_last", SOUND, .keep = BT_KEEP_LAST},
    {.name = "a_mean", SOUND, .keep = BT_KEEP_MEAN, .role = BT_ROLE_FORCE},
    {.name = "a_most", SOUND, .keep = BT_KEEP_MAX, .role = BT_ROLE_DIAGNOSTIC},
    {.name = "a_sum",
     .units = "N m/s",
     .description = "a number of the test",
     .keep = BT_KEEP_SUM,
     .of_floe = one_each},
    {.name = "a_pull", SOUND, .keep = BT_KEEP_MEAN, .role = BT_ROLE_BALANCE},
};
static const char *const keys[] = {"last_a_last_n", "mean_a_mean_n", "max_a_most_n", "sum_a_sum_n_m_s",
                                   "mean_a_pull_n"};
enum { STEPS = 600 };

static double number(const char *json, const char *key)
{
    char wanted[80];
    snprintf(wanted, sizeof wanted, "\"%s\": ", key);
    const char *at = strstr(json, wanted);
    if (!at) fail_msg("no %s in the summary", key);
    return at ? atof(at + strlen(wanted)) : NAN;
}

/// The k-th by its own rule over the steps from `start` on, from the samples.
static double by_hand(int k, double start)
{
    double out = NAN, n = 0;
    for (int i = 0; i < STEPS; i++) {
        const bt_sample s = sample(i);
        if (s.time < start) continue;
        const double x = bt_sample_value(&s, bt_added(k));
        const bool first = n++ == 0;
        switch (five[k].keep) {
        case BT_KEEP_LAST: out = x; break;
        case BT_KEEP_MAX: out = first ? x : fmax(out, x); break;
        case BT_KEEP_MEAN:
        case BT_KEEP_SUM: out = first ? x : out + x; break;
        }
    }
    return five[k].keep == BT_KEEP_MEAN ? out / n : out;
}

TEST(reductions_are_those_of_the_window)
{
    bt_errors err = {0};
    const bt_case c = made_up_case();
    assert_int_equal(write_run(in_folder("a"), &c, STEPS, 3, &err), BT_OK);
    char *json = slurp(in_folder("a/summary.json"));
    const double start = number(json, "start_s");
    assert_true(start > 0.05);
    for (int k = 0; k < 5; k++) {
        assert_string_equal(bt_added(k)->summary, keys[k]);
        const double want = by_hand(k, start), found = number(json, keys[k]);
        if (!(fabs(found - want) <= 1e-12 * fabs(want))) fail_msg("%s: %.17g, not %.17g", keys[k], found, want);
        assert_string_equal(bt_summary_meaning(keys[k]).units, five[k].units);
    }
    // tow = ice + 21 of the forces in it: what is added to the balance is what fails to close.
    assert_true(fabs(number(json, "closure_n") - number(json, "mean_a_pull_n")) < 1e-9);
    free(json);
    bt_errors_free(&err);
}

TEST(a_key_that_the_summary_has_is_refused)
{
    bt_errors err = {0};
    const bt_quantity q = {.name = "size", .units = "m", .description = "its key is mean_size_m", .of_world = one,
                           .keep = BT_KEEP_MEAN};
    assert_int_equal(bt_quantity_register(&q, &err), BT_OK);
    const bt_case c = made_up_case();
    assert_int_equal(write_run(in_folder("clash"), &c, 10, 1, &err), BT_ERR_USAGE);
    assert_true(err.n == 1 && strstr(err.text[0], "quantity size: its key mean_size_m"));
    bt_errors_free(&err);
}

int main(void)
{
    bt_errors err = {0};
    for (int k = 0; k < 5; k++) bt_quantity_register(&five[k], &err);
    if (err.n > 0) return 1;
    return run_in_folder();
}
