// SPDX-License-Identifier: MIT
// Constants and moments of the size laws; see size_law.h.
#include "case/size_law.h"

#include "base/elementary.h"

#define LEAST_SHARE 1e-3 // of draws within the limits of a law

static double normal_cdf(double x) { return 0.5 * bt_erfc(-x / sqrt(2)); }

/// Limits of a law, of which at least one is given, for a message.
static const char *cut_at(const bt_sizes *sizes, char out[64])
{
    if (sizes->min > 0 && sizes->max > 0) snprintf(out, 64, "%g..%g m", sizes->min, sizes->max);
    else snprintf(out, 64, "%g m", sizes->min > 0 ? sizes->min : sizes->max);
    return out;
}

// E[d^k; low < d < high] / P(low < d < high) of the lognormal law: completing the square shifts the limits by kσ.
static double lognormal_moment(const bt_sizes *sizes, double mu, int k)
{
    double a = sizes->min > 0 ? (bt_log(sizes->min) - mu) / sizes->sigma : -INFINITY;
    double b = sizes->max > 0 ? (bt_log(sizes->max) - mu) / sizes->sigma : INFINITY;
    double whole = normal_cdf(b) - normal_cdf(a);
    double part = normal_cdf(b - k * sizes->sigma) - normal_cdf(a - k * sizes->sigma);
    return bt_exp(k * mu + 0.5 * k * k * sizes->sigma * sizes->sigma) * part / whole;
}

/// ln Γ(x), x > 0: Stirling's series above 8, and Γ(x + 1) = x Γ(x) below.
static double log_gamma(double x)
{
    double product = 1;
    for (; x < 8; x++) product *= x;
    const double r = 1 / (x * x);
    return (x - 0.5) * bt_log(x) - x + 0.5 * bt_log(2 * BT_PI) +
           (1.0 / 12 - r * (1.0 / 360 - r * (1.0 / 1260 - r * (1.0 / 1680 - r / 1188)))) / x - bt_log(product);
}

/// Share of a gamma law of shape a and scale 1 above x: Q(a, x), by the series of its complement.
static double gamma_above(double a, double x)
{
    double term = bt_exp(a * bt_log(x) - x - log_gamma(a + 1)), sum = term;
    for (int n = 1; term > 1e-17 * sum && n < 1000; n++) sum += term *= x / (a + n);
    return bt_max(0, 1 - sum);
}

/// E[d^k; d > least] / P(d > least) of a gamma law: d^k times its density is a gamma density of shape + k.
static double gamma_moment(const bt_sizes *sizes, double scale, int k)
{
    const double shape = 1 / (sizes->spread * sizes->spread), x = sizes->least / scale;
    double whole = 1;
    for (int i = 0; i < k; i++) whole *= scale * (shape + i);
    return whole * gamma_above(shape + k, x) / gamma_above(shape, x);
}

// E[d^k] of the truncated power law: ∫ d^k a d^(−a−1) dd / (m^−a − M^−a).
static double power_moment(const bt_sizes *sizes, int k)
{
    double m = sizes->min, q = sizes->max / sizes->min, a = sizes->exponent, e = k - a;
    double top = fabs(e) < 1e-9 ? bt_log(q) : (bt_pow(q, e) - 1) / e;
    return bt_pow(m, k) * a * top / (1 - bt_pow(q, -a));
}

#define CUT_MATTERS 0.5 // least spread at which the cut does: below, it moves the mean by less than 0.1 %

/// Scale of the gamma law whose part above `least` has the mean `mean`.
static void init_gamma(bt_sizes *sizes)
{
    sizes->scale = sizes->mean / (1 / (sizes->spread * sizes->spread));
    if (sizes->spread < CUT_MATTERS) return;
    sizes->least = BT_SINGLE_LEAST * sizes->mean;
    double low = 0, high = sizes->scale;
    for (int k = 0; k < 100; k++) {
        sizes->scale = (low + high) / 2;
        *(gamma_moment(sizes, sizes->scale, 1) < sizes->mean ? &low : &high) = sizes->scale;
    }
}

bt_status bt_sizes_init(bt_sizes *sizes, const bt_case *input, bt_errors *err)
{
    const char *path = bt_case_name(input);
    *sizes = (bt_sizes){.law = input->ice.size_law, .mean = input->ice.size, .spread = input->ice.size_spread,
                        .min = input->ice.size_min, .max = input->ice.size_max, .exponent = input->ice.size_exponent};
    if (sizes->law == BT_SIZE_POWER) {
        if (!(sizes->min > 0 && sizes->max > sizes->min && sizes->exponent > 0))
            return bt_fail(err, BT_ERR_CASE,
                           "%s: ice.size_law: power needs 0 < ice.size_min < ice.size_max and ice.size_exponent > 0, "
                           "got %g m, %g m and %g",
                           path, sizes->min, sizes->max, sizes->exponent);
        return BT_OK;
    }
    if (!(sizes->mean > 0) || !(sizes->spread >= 0))
        return bt_fail(err, BT_ERR_CASE,
                       "%s: ice.size: needs a positive size and a spread of zero or more, got %g m and %g", path,
                       sizes->mean, sizes->spread);
    if (sizes->law == BT_SIZE_SINGLE && sizes->spread > 0) init_gamma(sizes);
    if (sizes->law != BT_SIZE_LOGNORMAL || sizes->spread == 0) return BT_OK;
    sizes->sigma = sqrt(bt_log1p(sizes->spread * sizes->spread));
    sizes->mu = bt_log(sizes->mean) - sizes->sigma * sizes->sigma / 2;
    if (sizes->min <= 0 && sizes->max <= 0) return BT_OK;
    if ((sizes->min > 0 && sizes->mean <= sizes->min) || (sizes->max > 0 && sizes->mean >= sizes->max))
        return bt_fail(err, BT_ERR_CASE, "%s: ice.size: %g m is %s; move the limits apart", path, sizes->mean,
            sizes->min > 0 && sizes->mean <= sizes->min ? "not above ice.size_min" : "not below ice.size_max");
    double low = sizes->mu - 3 * sizes->sigma, high = sizes->mu + 3 * sizes->sigma;
    for (int k = 0; k < 100; k++) {
        sizes->mu = (low + high) / 2;
        *(lognormal_moment(sizes, sizes->mu, 1) < sizes->mean ? &low : &high) = sizes->mu;
    }
    double mean = lognormal_moment(sizes, sizes->mu, 1);
    // share of the draws that lie between the limits; the others are drawn again
    const double share = normal_cdf(sizes->max > 0 ? (bt_log(sizes->max) - sizes->mu) / sizes->sigma : INFINITY) -
                         normal_cdf(sizes->min > 0 ? (bt_log(sizes->min) - sizes->mu) / sizes->sigma : -INFINITY);
    if (!(fabs(mean - sizes->mean) < 1e-6 * sizes->mean) || !(share > LEAST_SHARE))
        return bt_fail(err, BT_ERR_CASE,
            "%s: ice.size: no lognormal law cut at %s has the mean %g m and spread %g; move the limits apart",
            path, cut_at(sizes, (char[64]){0}), sizes->mean, sizes->spread);
    return BT_OK;
}

double bt_sizes_moment(const bt_sizes *sizes, int k)
{
    if (sizes->law == BT_SIZE_POWER) return power_moment(sizes, k);
    if (sizes->law == BT_SIZE_LOGNORMAL && sizes->spread > 0) return lognormal_moment(sizes, sizes->mu, k);
    if (sizes->least > 0) return gamma_moment(sizes, sizes->scale, k);
    double moment = 1;
    for (int i = 0; i < k; i++) moment *= sizes->mean * (1 + i * sizes->spread * sizes->spread);
    return moment;
}

double bt_sizes_mean(const bt_sizes *sizes)
{
    return sizes->law == BT_SIZE_POWER ? power_moment(sizes, 1) : sizes->mean;
}

double bt_sizes_mean_area(const bt_sizes *sizes) { return BT_PI / 4 * bt_sizes_moment(sizes, 2); }
