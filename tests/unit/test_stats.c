// SPDX-License-Identifier: MIT
// Standard error against series of known autocorrelation, and the steady window against a known transient.
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdlib.h>
#include <cmocka.h>

#include "bergtow/stats.h"

/// splitmix64 and Box–Muller: a source of normal numbers of the test's own.
static double uniform(uint64_t *state)
{
    uint64_t z = (*state += 0x9e3779b97f4a7c15u);
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
    return ((double)((z ^ (z >> 31)) >> 11) + 0.5) * 0x1p-53;
}

static double normal(uint64_t *state)
{
    const double r = sqrt(-2 * log(uniform(state)));
    return r * cos(2 * BT_PI * uniform(state));
}

/// AR(1) x_i = φ x_{i−1} + noise of unit variance of x, started in its steady state: τ = ½ (1 + φ)/(1 − φ).
static void ar1(double *x, int n, double phi, uint64_t *state)
{
    double v = normal(state);
    for (int i = 0; i < n; i++) {
        x[i] = v;
        v = phi * v + sqrt(1 - phi * phi) * normal(state);
    }
}

static void check_coverage(double phi, int n, double tau_tolerance)
{
    enum { SERIES = 400 };
    const double tau = 0.5 * (1 + phi) / (1 - phi), mean = 7;
    uint64_t state = 12345;
    double *x = malloc((size_t)n * sizeof *x);
    int inside = 0;
    double tau_sum = 0, ratio_sum = 0;
    for (int s = 0; s < SERIES; s++) {
        ar1(x, n, phi, &state);
        for (int i = 0; i < n; i++) x[i] = mean + 2 * x[i];
        const bt_mean m = bt_stats_mean(x, n);
        inside += fabs(m.mean - mean) <= 1.96 * m.se;
        tau_sum += m.tau / SERIES;
        ratio_sum += m.sd / SERIES;
        assert_true(fabs(m.se - m.sd * sqrt(2 * m.tau / n)) <= 1e-12 * m.se);
        assert_true(fabs(m.n_eff - n / (2 * m.tau)) <= 1e-9 * n);
    }
    free(x);
    const double covered = 100.0 * inside / SERIES;
    print_message("phi %.2f n %d: coverage %.1f %%, tau %.3f of %.3f\n", phi, n, covered, tau_sum, tau);
    assert_true(covered >= 92 && covered <= 98);
    assert_true(fabs(tau_sum / tau - 1) < tau_tolerance);
    assert_true(fabs(ratio_sum / 2 - 1) < 0.05);
}

static void the_error_of_correlated_series_covers(void **s)
{
    (void)s;
    check_coverage(0.0, 1000, 0.02);
    check_coverage(0.5, 1000, 0.04);
    check_coverage(0.9, 4000, 0.05);
}

static void long_correlation_goes_through_pair_means(void **s)
{
    (void)s;
    check_coverage(0.99, 20000, 0.08); // 5 τ ≈ 500 lags: above the limit after which pairs are merged
}

static void constant_series_have_no_error(void **s)
{
    (void)s;
    double x[1000];
    for (int i = 0; i < 1000; i++) x[i] = 0.1;
    const bt_mean m = bt_stats_mean(x, 1000);
    assert_true(m.mean == 0.1 && m.sd == 0 && m.se == 0 && m.tau == 0.5 && m.n_eff == 1000);
    assert_int_equal(bt_stats_steady_start(x, 1000, 0), 0);
    assert_int_equal(bt_stats_steady_start(x, 1000, 300), 300);
}

static void short_series(void **s)
{
    (void)s;
    const double x[2] = {1, 4};
    bt_mean m = bt_stats_mean(x, 0);
    assert_true(isnan(m.mean) && isnan(m.sd) && isnan(m.se) && m.n == 0 && m.n_eff == 0);
    m = bt_stats_mean(x, 1);
    assert_true(m.mean == 1 && isnan(m.sd) && isnan(m.se) && m.n == 1);
    m = bt_stats_mean(x, 2);
    assert_true(m.mean == 2.5 && fabs(m.sd - sqrt(4.5)) < 1e-15 && fabs(m.se - 1.5) < 1e-15);
    for (int n = 0; n < 3; n++) assert_int_equal(bt_stats_steady_start(x, n, 0), 0);
    assert_int_equal(bt_stats_steady_start(x, 2, 5), 5);
}

static void alternating_series_keep_an_error_above_zero(void **s)
{
    (void)s;
    double x[500];
    for (int i = 0; i < 500; i++) x[i] = i % 2 ? 1 : -1;
    const bt_mean m = bt_stats_mean(x, 500);
    assert_true(m.mean == 0 && m.se > 0 && m.se < 1.0 / sqrt(500));
}

static void not_a_number_stays_visible(void **s)
{
    (void)s;
    double x[50];
    for (int i = 0; i < 50; i++) x[i] = i;
    x[20] = NAN;
    const bt_mean m = bt_stats_mean(x, 50);
    assert_true(isnan(m.mean) && isnan(m.se) && isnan(m.n_eff));
}

static void a_large_offset_does_not_drown_the_spread(void **s)
{
    (void)s;
    enum { N = 100000 };
    static double x[N], y[N];
    uint64_t state = 5;
    ar1(x, N, 0.5, &state);
    for (int i = 0; i < N; i++) {
        y[i] = x[i] + 1e9;
        x[i] = y[i] - 1e9; // exact
    }
    const bt_mean a = bt_stats_mean(x, N), b = bt_stats_mean(y, N);
    assert_true(fabs(b.mean - 1e9 - a.mean) < 1.5e-7); // one unit in the last place of 1e9 is 1.2e-7
    assert_true(fabs(a.se / b.se - 1) < 1e-5 && fabs(a.sd / b.sd - 1) < 1e-5);
}

static void the_transient_is_cut(void **s)
{
    (void)s;
    enum { N = 2000, TRANSIENT = 400 };
    double x[N];
    uint64_t state = 99;
    for (int trial = 0; trial < 20; trial++) {
        ar1(x, N, 0.5, &state);
        // A rise from −20 to 0 over the first 400 samples, in a noise of unit size.
        for (int i = 0; i < TRANSIENT; i++) x[i] += -20.0 * (TRANSIENT - i) / TRANSIENT;
        const int64_t start = bt_stats_steady_start(x, N, 0);
        assert_in_range(start, TRANSIENT - 60, TRANSIENT + 300);
        assert_true(fabs(bt_stats_mean(x + start, N - start).mean) < 0.25);
    }
    // Told to begin later, it never goes back; and it never looks beyond the middle.
    assert_true(bt_stats_steady_start(x, N, 700) >= 700);
    for (int i = 0; i < N; i++) x[i] = i;
    assert_in_range(bt_stats_steady_start(x, N, 0), N / 2 - 5, N / 2);
    assert_int_equal(bt_stats_steady_start(x, N, 1800), 1800);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_error_of_correlated_series_covers),
        cmocka_unit_test(long_correlation_goes_through_pair_means),
        cmocka_unit_test(constant_series_have_no_error),
        cmocka_unit_test(short_series),
        cmocka_unit_test(alternating_series_keep_an_error_above_zero),
        cmocka_unit_test(not_a_number_stays_visible),
        cmocka_unit_test(a_large_offset_does_not_drown_the_spread),
        cmocka_unit_test(the_transient_is_cut),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
