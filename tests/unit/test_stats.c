// SPDX-License-Identifier: MIT
// Standard error against series of known autocorrelation, and the steady window against a known transient.
#include "test.h"
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

static void check_coverage(double phi, int n)
{
    enum { SERIES = 400 };
    const double tau = 0.5 * (1 + phi) / (1 - phi), mean = 7;
    uint64_t state = 12345;
    double *x = malloc((size_t)n * sizeof *x);
    int inside = 0;
    double tau_sum = 0, var_sum = 0, sd_sum = 0;
    for (int s = 0; s < SERIES; s++) {
        ar1(x, n, phi, &state);
        for (int i = 0; i < n; i++) x[i] = mean + 2 * x[i];
        const bt_mean m = bt_stats_mean(x, n);
        inside += m.low <= mean && mean <= m.high;
        tau_sum += m.tau / SERIES;
        var_sum += m.se * m.se / SERIES;
        sd_sum += m.sd / SERIES;
        assert_true(fabs(m.high - m.mean - 3.182 * m.se) <= 1e-9 * m.se &&
                    fabs(m.mean - m.low - 3.182 * m.se) <= 1e-9 * m.se);
        assert_true(fabs(m.n_eff - n / (2 * m.tau)) <= 1e-9 * n);
    }
    free(x);
    const double covered = 100.0 * inside / SERIES, true_var = 4 * 2 * tau / n;
    print_message("phi %.2f n %d: coverage %.1f %%, variance %.3f of the true one, tau %.3f of %.3f\n", phi, n, covered,
                  var_sum / true_var, tau_sum, tau);
    assert_true(covered >= 93.5 && covered <= 97.5);
    // the larger of two estimates, each right in the mean
    assert_true(var_sum / true_var > 1 && var_sum / true_var < 1.5);
    assert_true(fabs(tau_sum / tau - 1) < 0.15); // short series of batches see a little of the correlation as noise
    assert_true(fabs(sd_sum / 2 - 1) < 0.05);
}

TEST(the_interval_of_correlated_series_covers)
{
    check_coverage(0.0, 1000);
    check_coverage(0.5, 1000);
    check_coverage(0.9, 4000);
    check_coverage(0.99, 20000);
}

/// Noise whose slow part is taken back later, as ice that one jam has used up is missing in the next: x_i = e_i − θ
/// e_{i−LAG}. Its mean has the variance (1 − θ)² / n, while the autocorrelation is zero up to LAG.
TEST(what_is_taken_back_later_is_seen)
{
    enum { N = 2000, LAG = 60, SERIES = 200 };
    static double e[N + LAG], x[N];
    const double theta = 0.5;
    uint64_t seed = 3;
    double var = 0;
    int inside = 0;
    for (int k = 0; k < SERIES; k++) {
        for (int i = 0; i < N + LAG; i++) e[i] = normal(&seed);
        for (int i = 0; i < N; i++) x[i] = e[i + LAG] - theta * e[i];
        const bt_mean m = bt_stats_mean(x, N);
        var += m.se * m.se * N / SERIES;
        inside += m.low <= 0 && 0 <= m.high;
    }
    print_message("variance %.3f, true %.3f, of white noise of the same sd %.3f; coverage %.1f %%\n", var, 0.25, 1.25,
                  100.0 * inside / SERIES);
    assert_true(var > 0.2 && var < 0.45); // the highest of the waves begins to see the noise
    assert_true(inside >= 0.93 * SERIES);
}

typedef enum { NOTHING, DRIFT, JUMP, START_UP } change;

/// Share of series with a trend, in per cent. size: in standard errors of the mean, as the run itself would report it
/// in the mean.
static double alarms(int n, double phi, change kind, double size)
{
    enum { SERIES = 1000 };
    uint64_t state = 77;
    double *x = malloc((size_t)n * sizeof *x);
    const double se = sqrt((1 + phi) / (1 - phi) / n);
    int found = 0;
    for (int k = 0; k < SERIES; k++) {
        ar1(x, n, phi, &state);
        for (int i = 0; i < n; i++) {
            const double u = (i + 0.5) / n;
            if (kind == DRIFT) x[i] += size * se * (u - 0.5);
            if (kind == JUMP) x[i] += size * se * (u > 0.5);
            if (kind == START_UP) x[i] -= size * se * exp(-10 * u);
        }
        found += bt_stats_trend(x, n).significant;
    }
    free(x);
    return 100.0 * found / SERIES;
}

/// A drift of d parts the means of the halves by d/2, whose standard error is twice that of the mean: three of them are
/// d = 12.
TEST(a_drift_is_told_from_noise)
{
    static const struct {
        int n;
        double phi;
    } series[] = {{480, 0}, {2600, 0}, {480, 0.5}, {2600, 0.9}, {480, 0.8}, {2600, 0.95}};
    double false_sum = 0, drift_sum = 0;
    enum { N = sizeof series / sizeof *series };
    for (int k = 0; k < N; k++) {
        const int n = series[k].n;
        const double phi = series[k].phi, none = alarms(n, phi, NOTHING, 0), drift = alarms(n, phi, DRIFT, 12),
                     jump = alarms(n, phi, JUMP, 10), start = alarms(n, phi, START_UP, 60);
        print_message(
            "n %d phi %.2f (%.0f independent): false %.1f %%, drift %.1f %%, jump %.1f %%, start-up %.1f %%\n", n, phi,
            n * (1 - phi) / (1 + phi), none, drift, jump, start);
        assert_true(none <= 7); // 5 % and three standard errors of 1,000 trials
        assert_true(drift >= 87.2);
        assert_true(jump >= 90);
        // it bends, and what the line leaves of it counts as noise; a window that is found begins after it
        assert_true(start >= 80);
        false_sum += none / N;
        drift_sum += drift / N;
    }
    assert_true(false_sum <= 5 && drift_sum >= 90);
}

TEST(the_trend_is_the_line_through_the_series)
{
    double x[960], quarter[4];
    for (int i = 0; i < 960; i++) x[i] = 3 + 2.0 * i / 960 + 0.1 * cos(2 * BT_PI * 20 * (i + 0.5) / 960);
    const bt_trend t = bt_stats_trend(x, 960);
    assert_true(t.significant && fabs(t.change - 2) < 1e-2 && t.low < t.change && t.change < t.high);
    bt_stats_quarters(x, 960, quarter);
    for (int q = 0; q < 4; q++) assert_true(fabs(quarter[q] - (3.25 + 0.5 * q)) < 2e-3);
    assert_true(isnan(bt_stats_trend(x, BT_TREND_LEAST - 1).change));
    bt_stats_quarters(x, 2, quarter);
    assert_true(isnan(quarter[0]) && quarter[1] == x[0] && isnan(quarter[2]) && quarter[3] == x[1]);
    for (int i = 0; i < 960; i++) x[i] = 5;
    assert_true(!bt_stats_trend(x, 960).significant && bt_stats_trend(x, 960).change == 0);
}

TEST(constant_series_have_no_error)
{
    double x[1000];
    for (int i = 0; i < 1000; i++) x[i] = 0.1;
    const bt_mean m = bt_stats_mean(x, 1000);
    assert_true(m.mean == 0.1 && m.sd == 0 && m.se == 0 && m.tau == 0.5 && m.n_eff == 1000);
    assert_int_equal(bt_stats_steady_start(x, 1000, 0, 0.02), 0);
    assert_int_equal(bt_stats_steady_start(x, 1000, 300, 0.02), 300);
}

TEST(short_series)
{
    const double x[2] = {1, 4};
    bt_mean m = bt_stats_mean(x, 0);
    assert_true(isnan(m.mean) && isnan(m.sd) && isnan(m.se) && m.n == 0 && m.n_eff == 0);
    m = bt_stats_mean(x, 1);
    assert_true(m.mean == 1 && isnan(m.sd) && isnan(m.se) && m.n == 1);
    m = bt_stats_mean(x, 2);
    assert_true(m.mean == 2.5 && fabs(m.sd - sqrt(4.5)) < 1e-15 && fabs(m.se - 1.5) < 1e-15);
    for (int n = 0; n < 3; n++) assert_int_equal(bt_stats_steady_start(x, n, 0, 0.02), 0);
    assert_int_equal(bt_stats_steady_start(x, 2, 5, 0.02), 5);
}

TEST(alternating_series_keep_an_error_above_zero)
{
    double x[500];
    for (int i = 0; i < 500; i++) x[i] = i % 2 ? 1 : -1;
    const bt_mean m = bt_stats_mean(x, 500);
    assert_true(m.mean == 0 && m.se > 0 && m.se < 1.0 / sqrt(500));
}

TEST(not_a_number_stays_visible)
{
    double x[50];
    for (int i = 0; i < 50; i++) x[i] = i;
    x[20] = NAN;
    const bt_mean m = bt_stats_mean(x, 50);
    assert_true(isnan(m.mean) && isnan(m.se) && isnan(m.n_eff));
}

TEST(a_large_offset_does_not_drown_the_spread)
{
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

TEST(the_transient_is_cut)
{
    enum { N = 2000, TRANSIENT = 400 };
    double x[N];
    uint64_t state = 99;
    for (int trial = 0; trial < 20; trial++) {
        ar1(x, N, 0.5, &state);
        // A rise from −20 to 0 over the first 400 samples, in a noise of unit size.
        for (int i = 0; i < TRANSIENT; i++) x[i] += -20.0 * (TRANSIENT - i) / TRANSIENT;
        const int64_t start = bt_stats_steady_start(x, N, 0, 0.02);
        assert_in_range(start, TRANSIENT - 60, TRANSIENT + 300);
        assert_true(fabs(bt_stats_mean(x + start, N - start).mean) < 0.25);
    }
    // One that matters to nobody is not.
    for (int i = 0; i < N; i++) x[i] = 1000 + (i < TRANSIENT ? 20 : 0) + 0.1 * normal(&state);
    assert_int_equal(bt_stats_steady_start(x, N, 0, 0.03), 0);
    assert_in_range(bt_stats_steady_start(x, N, 0, 0.01), TRANSIENT, TRANSIENT + 300);
    ar1(x, N, 0.5, &state);
    for (int i = 0; i < TRANSIENT; i++) x[i] += -20.0 * (TRANSIENT - i) / TRANSIENT;
    // Told to begin later, it never goes back; and it never looks beyond the middle.
    assert_true(bt_stats_steady_start(x, N, 700, 0.02) >= 700);
    for (int i = 0; i < N; i++) x[i] = i;
    assert_in_range(bt_stats_steady_start(x, N, 0, 0.02), N / 2 - 5, N / 2);
    // The middle of what follows: a long ramp must not leave nothing to search.
    assert_in_range(bt_stats_steady_start(x, N, 1200, 0.02), 1600 - 5, 1600);
    assert_in_range(bt_stats_steady_start(x, N, 1800, 0.02), 1900 - 5, 1900);
}

/// Rare large values of a wide distribution, as of a body that meets floes one by one, are no transient: a start just
/// after the last large one would leave too low a mean.
TEST(rare_large_values_are_not_cut)
{
    enum { N = 4000, SERIES = 400 };
    static double x[N];
    static const double events[] = {6, 25, 100};
    uint64_t state = 31;
    for (int k = 0; k < 3; k++) {
        double whole = 0, kept = 0;
        for (int i = 0; i < SERIES; i++) {
            for (int j = 0; j < N; j++) x[j] = uniform(&state) < events[k] / N ? exp(normal(&state)) : 0;
            const int64_t start = bt_stats_steady_start(x, N, 0, 0.02);
            whole += bt_stats_mean(x, N).mean / SERIES;
            kept += bt_stats_mean(x + start, N - start).mean / SERIES;
        }
        print_message("%g events: mean of the window %.3f of the whole\n", events[k], kept / whole);
        assert_true(fabs(kept / whole - 1) < 0.03);
    }
}

/// A series that settles to its end has its minimum at the last start, however far apart the starts lie.
TEST(the_end_of_the_search_is_known)
{
    for (int64_t n = 19990; n < 90000; n += 997) {
        double *x = malloc((size_t)n * sizeof *x);
        assert_non_null(x);
        for (int64_t i = 0; i < n; i++) x[i] = exp(-2.0 * (double)i / (double)n);
        for (int64_t first = 0; first < n; first += 3 * n / 7) {
            const int64_t last = bt_stats_last_start(n, first);
            assert_int_equal(bt_stats_steady_start(x, n, first, 0.02), last);
            assert_in_range(last, first + (n - first) / 2 - bt_stats_start_step(n - first), first + (n - first) / 2);
        }
        free(x);
    }
}

/// A long series: the starts that are looked at lie apart so far that they are few, and the one that is found is the
/// best of them.
TEST(starts_of_a_long_series_are_few)
{
    enum { MANY = 5 * BT_STATS_STARTS };
    const int64_t n[] = {1, MANY, MANY + 1, 2 * MANY, 2 * MANY + 1, 1000 * (int64_t)MANY},
                  step[] = {5, 5, 10, 10, 20, 5120};
    for (int k = 0; k < 6; k++) assert_int_equal(bt_stats_start_step(n[k]), step[k]);
    enum { N = 4 * MANY, FROM = 3 };
    double *x = malloc(N * sizeof *x);
    assert_non_null(x);
    uint64_t state = 7;
    ar1(x, N, 0.5, &state);
    for (int i = 0; i < N / 7; i++) x[i] += 10;
    const int64_t start = bt_stats_steady_start(x, N, FROM, 0.02);
    assert_in_range(start, N / 7, N / 7 + 40);
    assert_int_equal((start - FROM) % 20, 0);
    free(x);
}

TEST_MAIN(NULL, NULL)
