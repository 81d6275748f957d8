// SPDX-License-Identifier: MIT
// Constants and moments of the size laws; see size_law.h.
#include "case/size_law.h"

#include <math.h>
#include <stdio.h>

#include "base/elementary.h"

#define LEAST_SHARE 1e-3 // of a law that its limits leave

static double normal_cdf(double x) { return 0.5 * bt_erfc(-x / sqrt(2)); }

/// Limits of a law that has one at least, for a message.
static const char *cut_at(const bt_sizes *s, char out[64])
{
    if (s->min > 0 && s->max > 0) snprintf(out, 64, "%g..%g m", s->min, s->max);
    else snprintf(out, 64, "%g m", s->min > 0 ? s->min : s->max);
    return out;
}

// E[d^k; low < d < high] / P(low < d < high) of the lognormal law: completing the square shifts the limits by kσ.
static double lognormal_moment(const bt_sizes *s, double mu, int k)
{
    double a = s->min > 0 ? (bt_log(s->min) - mu) / s->sigma : -INFINITY;
    double b = s->max > 0 ? (bt_log(s->max) - mu) / s->sigma : INFINITY;
    double whole = normal_cdf(b) - normal_cdf(a);
    double part = normal_cdf(b - k * s->sigma) - normal_cdf(a - k * s->sigma);
    return bt_exp(k * mu + 0.5 * k * k * s->sigma * s->sigma) * part / whole;
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

/// Share of a gamma law of shape a and scale 1 that lies above x: Q(a, x), by the series of its complement.
static double gamma_above(double a, double x)
{
    double term = bt_exp(a * bt_log(x) - x - log_gamma(a + 1)), sum = term;
    for (int n = 1; term > 1e-17 * sum && n < 1000; n++) sum += term *= x / (a + n);
    return bt_max(0, 1 - sum);
}

/// E[d^k; d > least] / P(d > least) of a gamma law: d^k times its density is one of shape + k.
static double gamma_moment(const bt_sizes *s, double scale, int k)
{
    const double shape = 1 / (s->spread * s->spread), x = s->least / scale;
    double whole = 1;
    for (int i = 0; i < k; i++) whole *= scale * (shape + i);
    return whole * gamma_above(shape + k, x) / gamma_above(shape, x);
}

// E[d^k] of the truncated power law: ∫ d^k a d^(−a−1) dd / (m^−a − M^−a).
static double power_moment(const bt_sizes *s, int k)
{
    double m = s->min, q = s->max / s->min, a = s->exponent, e = k - a;
    double top = fabs(e) < 1e-9 ? bt_log(q) : (bt_pow(q, e) - 1) / e;
    return bt_pow(m, k) * a * top / (1 - bt_pow(q, -a));
}

#define CUT_MATTERS 0.5 // least spread at which it does: below, it moves the mean by less than 0.1 %

/// Scale of the gamma law whose part above `least` has the mean `mean`.
static void init_gamma(bt_sizes *s)
{
    s->scale = s->mean / (1 / (s->spread * s->spread));
    if (s->spread < CUT_MATTERS) return;
    s->least = BT_SINGLE_LEAST * s->mean;
    double low = 0, high = s->scale;
    for (int k = 0; k < 100; k++) {
        s->scale = (low + high) / 2;
        *(gamma_moment(s, s->scale, 1) < s->mean ? &low : &high) = s->scale;
    }
}

bt_status bt_sizes_init(bt_sizes *s, const bt_case *c, bt_errors *err)
{
    const char *path = c->path ? c->path : "case";
    *s = (bt_sizes){.law = c->ice.size_law, .mean = c->ice.size, .spread = c->ice.size_spread,
                    .min = c->ice.size_min, .max = c->ice.size_max, .exponent = c->ice.size_exponent};
    if (s->law == BT_SIZE_POWER) {
        if (!(s->min > 0 && s->max > s->min && s->exponent > 0)) {
            bt_errors_add(err,
                          "%s: ice.size_law: power needs 0 < ice.size_min < ice.size_max and ice.size_exponent > 0, "
                          "got %g m, %g m and %g",
                          path, s->min, s->max, s->exponent);
            return BT_ERR_CASE;
        }
        return BT_OK;
    }
    if (!(s->mean > 0) || !(s->spread >= 0)) {
        bt_errors_add(err, "%s: ice.size: needs a positive size and a spread of zero or more, got %g m and %g", path,
                      s->mean, s->spread);
        return BT_ERR_CASE;
    }
    if (s->law == BT_SIZE_SINGLE && s->spread > 0) init_gamma(s);
    if (s->law != BT_SIZE_LOGNORMAL || s->spread == 0) return BT_OK;
    s->sigma = sqrt(bt_log1p(s->spread * s->spread));
    s->mu = bt_log(s->mean) - s->sigma * s->sigma / 2;
    if (s->min <= 0 && s->max <= 0) return BT_OK;
    if ((s->min > 0 && s->mean <= s->min) || (s->max > 0 && s->mean >= s->max)) {
        bt_errors_add(
            err, "%s: ice.size: %g m is %s; move the limits apart", path, s->mean,
            s->min > 0 && s->mean <= s->min ? "not above ice.size_min" : "not below ice.size_max");
        return BT_ERR_CASE;
    }
    double low = s->mu - 3 * s->sigma, high = s->mu + 3 * s->sigma;
    for (int k = 0; k < 100; k++) {
        s->mu = (low + high) / 2;
        *(lognormal_moment(s, s->mu, 1) < s->mean ? &low : &high) = s->mu;
    }
    double mean = lognormal_moment(s, s->mu, 1);
    // of all that is drawn, what lies between the limits: the rest is drawn again
    const double share = normal_cdf(s->max > 0 ? (bt_log(s->max) - s->mu) / s->sigma : INFINITY) -
                         normal_cdf(s->min > 0 ? (bt_log(s->min) - s->mu) / s->sigma : -INFINITY);
    if (!(fabs(mean - s->mean) < 1e-6 * s->mean) || !(share > LEAST_SHARE)) {
        bt_errors_add(
            err, "%s: ice.size: no lognormal law cut at %s has the mean %g m and spread %g; move the limits apart",
            path, cut_at(s, (char[64]){0}), s->mean, s->spread);
        return BT_ERR_CASE;
    }
    return BT_OK;
}

double bt_sizes_moment(const bt_sizes *s, int k)
{
    if (s->law == BT_SIZE_POWER) return power_moment(s, k);
    if (s->law == BT_SIZE_LOGNORMAL && s->spread > 0) return lognormal_moment(s, s->mu, k);
    if (s->least > 0) return gamma_moment(s, s->scale, k);
    double moment = 1;
    for (int i = 0; i < k; i++) moment *= s->mean * (1 + i * s->spread * s->spread);
    return moment;
}

double bt_sizes_mean(const bt_sizes *s) { return s->law == BT_SIZE_POWER ? power_moment(s, 1) : s->mean; }

double bt_sizes_mean_area(const bt_sizes *s) { return BT_PI / 4 * bt_sizes_moment(s, 2); }
