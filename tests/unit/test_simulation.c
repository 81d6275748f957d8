// SPDX-License-Identifier: MIT
// Several simulations in one process: signals, and laws that come while one is there.
//
// Red with (tried): the handlers of each simulation's own; a request to stop that a new simulation forgets, or that a
// deaf one follows; keys of later laws in the case of an earlier simulation.
#include "scene.h"

#include <signal.h>

#include "bergtow/forces.h"
#include "bergtow/simulation.h"

static const char still_water[] = "run: {dt: 0.1, duration: 5}\n"
                                  "domain: {length: 20, width: 8, ends: wall, sides: wall}\n"
                                  "ice: {concentration: 0.2, size: 1, thickness: 0.1}\n"
                                  "body: {shape: disc, length: 1.5, draft: 0.3, x: 2}\n"
                                  "tow: {mode: speed, speed: 0.1, ramp: 1}\n";

static bt_simulation *begun(bool signals)
{
    bt_simulation *s;
    const bt_simulation_options o = {.text = still_water, .threads = 1, .signals = signals};
    if (bt_simulation_create(&s, &o) != BT_OK) fail_msg("%s", bt_last_error());
    return s;
}

static bool is_caught(int number)
{
    struct sigaction now;
    assert_int_equal(sigaction(number, NULL, &now), 0);
    return now.sa_handler != SIG_DFL;
}

TEST(handlers_stay_to_the_end_of_the_last)
{
    assert_false(is_caught(SIGINT));
    bt_simulation *first = begun(true), *second = begun(true);
    bt_simulation_drop(first);
    assert_true(is_caught(SIGINT) && is_caught(SIGUSR1));
    bt_simulation_drop(second);
    assert_false(is_caught(SIGINT) || is_caught(SIGUSR1));
}

TEST(a_request_to_stop_is_of_those_that_listen)
{
    bt_simulation *listens = begun(true), *deaf = begun(false);
    assert_int_equal(bt_simulation_step(listens, 1), BT_OK);
    raise(SIGTERM);
    bt_simulation *later = begun(false); // forgets nothing
    assert_int_equal(bt_simulation_step(deaf, 1), BT_OK);
    assert_int_equal(bt_simulation_step(later, 1), BT_OK);
    assert_int_equal(bt_simulation_step(listens, 1), BT_ERR_SIGNAL);
    bt_simulation_drop(listens);
    assert_int_equal(bt_simulation_step(deaf, 1), BT_OK);
    bt_simulation *new = begun(true); // the request was another one's, which has ended
    assert_int_equal(bt_simulation_step(new, 1), BT_OK);
    bt_simulation_drop(new);
    bt_simulation_drop(deaf);
    bt_simulation_drop(later);
}

static void add_nothing(const bt_force_body *b, bt_load *l) { (void)b, (void)l; }

TEST(a_law_that_comes_later_is_not_in_the_case)
{
    static const bt_law_key keys[] = {
        {.name = "strength", .unit = "N", .preset = "3", .range = "(0, 10]", .doc = "how strong the late law is"}};
    static const bt_force_law law = {.name = "late", .doc = "a law that comes late", .keys = keys, .n_keys = 1,
                                     .add = add_nothing};
    bt_simulation *before = begun(false);
    bt_errors err = {0};
    assert_int_equal(bt_force_register(&law, &err), BT_OK);
    bt_simulation *after = begun(false);
    char *without = bt_simulation_case(before), *with = bt_simulation_case(after);
    assert_null(strstr(without, "late:"));
    assert_non_null(strstr(with, "strength: 3 N"));
    bt_release(without);
    bt_release(with);
    bt_simulation_drop(before);
    bt_simulation_drop(after);
}

TEST(options_that_are_none_are_refused)
{
    bt_simulation *s;
    const bt_simulation_options o = {.text = still_water, .threads = 1, .n_set = -1};
    assert_int_equal(bt_simulation_create(&s, &o), BT_ERR_USAGE);
    assert_non_null(strstr(bt_last_error(), "n_set: -1"));
}

TEST_MAIN(NULL, NULL)
