// SPDX-License-Identifier: MIT
// What a run needs of a machine, and the refusal of what it has not.
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "bergtow/record.h"
#include "cost.h"

static bt_case a_case(void)
{
    bt_case c = {.run = {.dt = 0.5, .duration = 500000}, .output = {.frame_interval = 1000, .sample_every = 10}, .impact = {.panels = 36}};
    return c;
}

// By hand: 20 MB + n (2048/ranks + 200) on each rank of the node, and 64 B of each of a million steps on one.
static void memory_by_hand(void **state)
{
    (void)state;
    const bt_case c = a_case();
    assert_float_equal(bt_cost_memory(&c, 1e6, 1, 1), 20e6 + 2248e6 + 64e6, 1);
    assert_float_equal(bt_cost_memory(&c, 1e6, 4, 2), 2 * (20e6 + 712e6) + 64e6, 1);
}

// 501 frames of 1000 floes at 100 B; 100,000 entries of 8 B a series.
static void result_by_hand(void **state)
{
    (void)state;
    bt_case c = a_case();
    assert_float_equal(bt_cost_result(&c, 1000), 501 * 1000 * 100.0 + 8e5 * bt_n_series_fields, 1);
    c.output.panels = true;
    assert_float_equal(bt_cost_result(&c, 0), 8e5 * (bt_n_series_fields + 108), 1);
}

static void what_does_not_fit_is_refused_with_both_numbers(void **state)
{
    (void)state;
    const bt_case c = a_case();
    bt_errors err = {0};
    assert_int_equal(bt_cost_fits(&c, 1e6, &bt_comm_alone, 2.333e9, &err), BT_OK);
    assert_int_equal(err.n, 0);
    assert_int_equal(bt_cost_fits(&c, 1e6, &bt_comm_alone, 2.331e9, &err), BT_ERR_CASE);
    assert_int_equal(err.n, 1);
    assert_non_null(strstr(err.text[0], "need some 2.33 GB of memory"));
    assert_non_null(strstr(err.text[0], "ice.size"));
    bt_errors_free(&err);
    assert_true(bt_cost_machine() > 1e6 && isfinite(bt_cost_machine()));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(memory_by_hand),
        cmocka_unit_test(result_by_hand),
        cmocka_unit_test(what_does_not_fit_is_refused_with_both_numbers),
    };
    return cmocka_run_group_tests_name("cost", tests, NULL, NULL);
}
