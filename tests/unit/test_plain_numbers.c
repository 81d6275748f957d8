// SPDX-License-Identifier: MIT
// The library in a program that rounds upward, traps and flushes subnormal numbers: it computes as ever, on any number
// of threads, and the program has its environment back. Numbers have a decimal point: cli/test_host.py.
//
// Red with (tried): no change of the environment, also on the threads alone; a test of the rounding mode alone; an
// environment that is not given back.
#include "scene.h"

#include <fenv.h>
#include <omp.h>
#ifdef __x86_64__
#include <immintrin.h>
#endif

#include "bergtow/catenary.h"
#include "bergtow/outline.h"
#include "bergtow/simulation.h"
#include "bergtow/stats.h"

// Enough floes that every loop of their making is divided among threads.
static const char towed[] = "run: {dt: 0.1, duration: 1}\n"
                            "domain: {length: 60, width: 40, ends: wall}\n"
                            "ice: {concentration: 0.8, size: 0.8, thickness: 0.1}\n"
                            "body: {shape: disc, length: 3, draft: 0.3, x: 4}\n"
                            "tow: {mode: speed, speed: 0.3, ramp: 0.2}\n"
                            "output: {window_start: 0.5}\n";

/// State hashes of the start and the end.
typedef struct hashes { uint64_t start, end; } hashes;

static hashes hashes_on(int threads)
{
    bt_simulation *s;
    hashes found;
    const bt_simulation_options o = {.text = towed, .threads = threads};
    if (bt_simulation_create(&s, &o) != BT_OK) fail_msg("%s", bt_last_error());
    assert_true(bt_simulation_bodies(s) > 2000);
    found.start = bt_simulation_hash(s);
    if (bt_simulation_step(s, 10) != BT_OK) fail_msg("%s", bt_last_error());
    found.end = bt_simulation_hash(s);
    assert_int_equal(bt_simulation_end(s), BT_OK);
    return found;
}

/// A team of the program's own, whose threads the library then takes over.
static void round_on_two_threads(int mode)
{
#pragma omp parallel num_threads(2)
    fesetround(mode);
}

TEST(a_rounding_mode_of_the_program)
{
    const hashes wanted = hashes_on(1);
    for (int threads = 1; threads <= 2; threads++) {
        round_on_two_threads(FE_UPWARD);
        const hashes found = hashes_on(threads);
        const int mode = fegetround();
        round_on_two_threads(FE_TONEAREST);
        assert_int_equal(mode, FE_UPWARD);
        assert_int_equal(found.start, wanted.start);
        assert_int_equal(found.end, wanted.end);
    }
    round_on_two_threads(FE_UPWARD);
    fesetround(FE_TONEAREST); // on this thread alone
    const hashes found = hashes_on(2);
    round_on_two_threads(FE_TONEAREST);
    assert_int_equal(found.start, wanted.start);
    assert_int_equal(found.end, wanted.end);
}

#ifdef __GLIBC__
TEST(traps_of_the_program)
{
    const hashes wanted = hashes_on(1);
    enum { TRAPS = FE_DIVBYZERO | FE_INVALID | FE_OVERFLOW };
    if (feenableexcept(TRAPS) < 0) skip(); // a processor without
    const hashes found = hashes_on(2);
    const int traps = fegetexcept();
    fedisableexcept(FE_ALL_EXCEPT);
    assert_int_equal(traps, TRAPS);
    assert_int_equal(found.end, wanted.end);
}
#endif

/// Some numbers of functions that only compute.
static void compute(double number[6])
{
    double tangent;
    number[0] = bt_catenary_span(100, 1e6, 50, 3e4);
    number[1] = bt_catenary_pull(100, 1e6, 50, 99, &tangent);
    number[2] = tangent;
    number[3] = bt_stats_mean((const double[]){0.1, 0.7, 0.2}, 3).mean;
    bt_outline_project(10.1, 70.3, 10.25, 70.5, &number[4], &number[5]);
}

TEST(functions_that_only_compute)
{
    static const int modes[] = {FE_UPWARD, FE_DOWNWARD, FE_TOWARDZERO};
    double wanted[6], found[6];
    compute(wanted);
    for (size_t k = 0; k < sizeof modes / sizeof *modes; k++) {
        fesetround(modes[k]);
        compute(found);
        const int mode = fegetround();
        fesetround(FE_TONEAREST);
        assert_int_equal(mode, modes[k]);
        assert_memory_equal(found, wanted, sizeof wanted);
    }
}

#ifdef __x86_64__
TEST(subnormal_numbers_that_the_program_flushes)
{
    const unsigned before = _mm_getcsr();
    _mm_setcsr(before | 0x8040); // as a program linked with -ffast-math
    const double area2 = bt_outline_area2(4, (const double[]){0, 0, 1e-155, 0, 1e-155, 1e-155, 0, 1e-155});
    const unsigned after = _mm_getcsr();
    _mm_setcsr(before);
    assert_int_equal(after & 0x8040, 0x8040);
    assert_true(area2 > 0);
}
#endif

TEST(the_code_of_no_message)
{
    bt_errors none = {0};
    bt_errors_code(&none, "code");
    assert_int_equal(none.n, 0);
    bt_errors_code(NULL, "code");
}

TEST_MAIN(NULL, NULL)
