// SPDX-License-Identifier: MIT
// A test program of cmocka: TEST(name) { ... } for each test, TEST_MAIN(set_up, clean_up) at the end.
#ifndef BERGTOW_TESTS_TEST_H
#define BERGTOW_TESTS_TEST_H

#include <errno.h>
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
// cmocka.h needs the headers above first
#include <cmocka.h>

static struct CMUnitTest test_table[64];
static size_t n_tests;

/// Defines a test and enters it in the table before main starts; priorities keep the order of the file.
#define TEST(name)                                                                                                    \
    static void name(void **unused_);                                                                                 \
    __attribute__((constructor(1000 + __LINE__))) static void enter_##name(void)                                      \
    {                                                                                                                 \
        test_table[n_tests++] = (struct CMUnitTest)cmocka_unit_test(name);                                            \
    }                                                                                                                 \
    static void name(__attribute__((unused)) void **unused_)

static inline int run_all_tests(CMFixtureFunction set_up, CMFixtureFunction clean_up)
{
    return _cmocka_run_group_tests(program_invocation_short_name, test_table, n_tests, set_up, clean_up);
}

#define TEST_MAIN(set_up, clean_up)                                                                                   \
    int main(void) { return run_all_tests(set_up, clean_up); }

#endif
