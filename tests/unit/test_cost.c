// SPDX-License-Identifier: MIT
// What a run needs of a machine, and the refusal of what it has not.
#include "test.h"
#include "output/record.h"
#include "case/case_derived.h"
#include "case/cost.h"

static bt_case a_case(void)
{
    bt_case c = {.run = {.dt = 0.5, .duration = 500000},
                 .output = {.frame_interval = 1000, .sample_every = 10},
                 .impact = {.panels = 36}};
    return c;
}

// By hand: 30 MB + n (2048/ranks + 200) and 450 B a part on each rank of the node, and on one n 300 for a checkpoint, a
// quarter more than 200 B of each of a million steps, 810 B an entry, here of 100,000, up to 110 MB, and 0.14 MB a
// frame, here of 501, up to 60 MB; with collisions 32 B for each of 36 panels and 3125 blocks of 320 steps.
TEST(memory_by_hand)
{
    bt_case c = a_case();
    const double kept = 250e6 + 81e6 + 60e6;
    assert_float_equal(bt_cost_memory(&c, 1e6, 0, 1, 1), 30e6 + 2548e6 + kept, 1);
    assert_float_equal(bt_cost_memory(&c, 1e6, 8e6, 4, 2), 2 * (30e6 + 712e6 + 900e6) + 300e6 + kept, 1);
    c.output.sample_every = 1;
    assert_float_equal(bt_cost_memory(&c, 1e6, 0, 1, 1), 30e6 + 2548e6 + kept + 29e6, 1);
    c.output.sample_every = 10;
    c.body.shape = BT_BODY_DISC;
    c.impact.conversion = BT_IMPACT_DURATION;
    assert_float_equal(bt_cost_memory(&c, 1e6, 0, 1, 1), 30e6 + 2548e6 + kept + 1.25 * 32 * 36 * 3125, 1);
}

/// Making the ice takes more than a short run with it, and on one rank only.
TEST(memory_of_making_the_ice)
{
    bt_case c = {.run = {.dt = 1, .duration = 10},
                 .domain = {.length = 6700, .width = 6700},
                 .ice = {.concentration = 0.7, .size = 20, .size_law = BT_SIZE_SINGLE, .x_max = 6700, .y_max = 6700},
                 .output = {.frame_interval = 10, .sample_every = 1}};
    const double n = bt_case_floes_made(&c);
    assert_true(n > 9e4 && n < 1.1e5);
    assert_float_equal(bt_cost_memory(&c, n, 0, 1, 1), 30e6 + 3500 * n, 1);
    assert_float_equal(bt_cost_memory(&c, n, 0, 4, 2), 60e6 + 3500 * n, 1);
    c.ice.field = "field.h5";
    assert_true(bt_cost_memory(&c, n, 0, 1, 1) < 30e6 + 2600 * n);
}

// By hand: 0.1 s, a million steps of 8 µs, 100,000 entries of 17 µs, 501 frames of 1 ms and 1.6 µs a floe; 1000 floes
// of 0.8 µs at 50 %, and of 100 floes in 10 parts each 0.05 µs a part and 6 ns for half the pairs of them.
TEST(time_by_hand)
{
    bt_case c = a_case();
    bt_cost_ice ice = {.floes = 1000, .concentration = 0.5};
    const double rest = 0.1 + 8 + 1.7 + 501 * 2.6e-3;
    assert_float_equal(bt_cost_stepping(&c, &ice), rest + 800, 1e-6);
    ice.split = 100, ice.parts = 1000;
    assert_float_equal(bt_cost_stepping(&c, &ice), rest + 800 + 50 + 30, 1e-6);
    c.ice.concentration = 0.5, c.ice.shake = 15;
    assert_float_equal(bt_cost_making(&c, 1000), 0.39, 1e-9);
    c.ice.concentration = 0.95, c.ice.shape = BT_ICE_RECTANGLES;
    assert_float_equal(bt_cost_making(&c, 1000), 0.75 * 0.21, 1e-9);
    c.ice.shape = BT_ICE_POLYGONS, c.ice.concentration = 0.85; // 0.2 + 0.1/(0.9 - 0.85) ms more a floe
    assert_float_equal(bt_cost_making(&c, 1000), 0.24 + 2.2, 1e-9);
    c.ice.concentration = 0.99;
    assert_float_equal(bt_cost_making(&c, 1000), 0.21 + 10.2, 1e-9);
    c.ice.field = (char *)"read.h5";
    assert_float_equal(bt_cost_making(&c, 1000), 0, 0);
}

// By hand, from several ranks (nothing is compressed): 501 frames of 1000 floes of 6 corners at 56 B, 48 B of corners
// and 32 B of ParaView's speed, velocity and forces, with 5840 B for the group, its datasets and the other bodies; ids
// and outlines 4 + 24 + 96 + 32 B; 100,096 entries (whole chunks of 256) of 8 B a series; one chunk of collisions; 350
// kB of HDF5.
TEST(disk_by_hand)
{
    bt_case c = a_case();
    const double series = 8.0 * 100096, rest = 350e3 + 8.0 * 256 * 13;
    assert_float_equal(bt_cost_frames(&c), 501, 0);
    bt_cost_disk d = bt_cost_disk_of(&c, 1000, 6000, 2);
    assert_float_equal(d.result, 501 * (1000 * 136.0 + 5840) + 156e3 + series * bt_n_series() + rest, 1);
    assert_float_equal(d.checkpoints, 135e3 + 180e3 + 13 * 6000 + 200e6, 1);
    assert_float_equal(d.texts, 38e3 + 501 * 4440, 1);
    const double kept = bt_cost_left(&d);
    assert_true(bt_cost_disk_of(&c, 1000, 6000, 1).result < d.result - 501 * 1000 * 28.0); // one rank compresses
    c.output.checkpoint_steps = 1000; // two of them from now on, and the old beside the new while they are replaced
    d = bt_cost_disk_of(&c, 1000, 6000, 2);
    assert_float_equal(d.checkpoints, 2 * (kept - d.result - d.texts), 1);
    assert_float_equal(d.most, 3 * d.result + d.texts + 1.5 * d.checkpoints, 1);
    c.output.panels = true;
    assert_float_equal(bt_cost_disk_of(&c, 0, 0, 2).result, 501 * 5840 + series * (bt_n_series() + 108) + rest, 1);
}

TEST(a_step_has_one_frame_at_most)
{
    bt_case c = {.run = {.dt = 1, .duration = 10}, .output = {.frame_interval = 0.1}};
    assert_float_equal(bt_cost_frames(&c), 11, 0);
    c.output.frame_interval = 4; // at 0, 4, 8, and the end
    assert_float_equal(bt_cost_frames(&c), 4, 0);
    c.output.frame_interval = 5;
    assert_float_equal(bt_cost_frames(&c), 3, 0);
}

TEST(what_does_not_fit_is_refused_with_both_numbers)
{
    const bt_case c = a_case();
    bt_errors err = {0};
    assert_int_equal(bt_cost_fits(&c, 1e6, &bt_comm_alone, 2.970e9, &err), BT_OK);
    assert_int_equal(err.n, 0);
    assert_int_equal(bt_cost_fits(&c, 1e6, &bt_comm_alone, 2.968e9, &err), BT_ERR_CASE);
    assert_int_equal(err.n, 1);
    assert_non_null(strstr(err.text[0], "need about 2.97 GB of memory"));
    assert_non_null(strstr(err.text[0], "ice.size"));
    bt_errors_free(&err);
    assert_int_equal(bt_cost_fits(&c, 4.5e8, &bt_comm_alone, 1e15, &err), BT_ERR_CASE);
    assert_non_null(strstr(err.text[0], "output.frame_interval"));
    bt_errors_free(&err);
    assert_true(bt_cost_machine() > 1e6 && isfinite(bt_cost_machine()));
}

TEST_MAIN(NULL, NULL)
