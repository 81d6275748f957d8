// SPDX-License-Identifier: MIT
// Floe size laws: diameter d of the circle of equal area.
//
// single     d ~ Gamma with mean `size` and standard deviation spread × size (d = size when spread = 0). A gamma rather
//            than a normal law, so that no floe has a negative size; below a tenth of the mean it is drawn again.
// lognormal  ln d ~ N(μ, σ), σ² = ln(1 + spread²), cut at [size_min, size_max] when given; μ is found so that the cut
//            law has the mean `size`.
// power      N(>d) ~ d^−a between size_min and size_max (Rothrock & Thorndike 1984, J. Geophys. Res. 89):
//            P(>d) = (d^−a − M^−a)/(m^−a − M^−a); its mean follows from m, M and a, and `size` is not used.
#include "field/field_make.h"

#include <math.h>

#include "base/elementary.h"
#include "base/rng.h"
#include "case/case_derived.h"

#define LEAST_SHARE 1e-3 // of a law that its limits leave

static double normal_cdf(double x) { return 0.5 * bt_erfc(-x / sqrt(2)); }

// E[d^k; low < d < high] / P(low < d < high) of the lognormal law: completing the square shifts the limits by kσ.
static double lognormal_moment(const bt_sizes *s, double mu, int k)
{
    double a = s->min > 0 ? (bt_log(s->min) - mu) / s->sigma : -INFINITY;
    double b = s->max > 0 ? (bt_log(s->max) - mu) / s->sigma : INFINITY;
    double whole = normal_cdf(b) - normal_cdf(a);
    double part = normal_cdf(b - k * s->sigma) - normal_cdf(a - k * s->sigma);
    return bt_exp(k * mu + 0.5 * k * k * s->sigma * s->sigma) * part / whole;
}

// E[d^k] of the truncated power law: ∫ d^k a d^(−a−1) dd / (m^−a − M^−a).
static double power_moment(const bt_sizes *s, int k)
{
    double m = s->min, q = s->max / s->min, a = s->exponent, e = k - a;
    double top = fabs(e) < 1e-9 ? bt_log(q) : (bt_pow(q, e) - 1) / e;
    return bt_pow(m, k) * a * top / (1 - bt_pow(q, -a));
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
    if (s->law != BT_SIZE_LOGNORMAL || s->spread == 0) return BT_OK;
    s->sigma = sqrt(bt_log1p(s->spread * s->spread));
    s->mu = bt_log(s->mean) - s->sigma * s->sigma / 2;
    if (s->min <= 0 && s->max <= 0) return BT_OK;
    if ((s->min > 0 && s->mean <= s->min) || (s->max > 0 && s->mean >= s->max)) {
        bt_errors_add(
            err, "%s: ice.size: %g m is not between ice.size_min %g m and ice.size_max %g m; move the limits apart",
            path, s->mean, s->min, s->max);
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
            err,
            "%s: ice.size: no lognormal law cut at %g..%g m has the mean %g m and spread %g; move the limits apart",
            path, s->min, s->max, s->mean, s->spread);
        return BT_ERR_CASE;
    }
    return BT_OK;
}

#define LEAST_SPREAD 1e-6 // a distribution narrower than this has numbers that no double holds: 1/spread²

double bt_sizes_draw(const bt_sizes *s, int64_t seed, int64_t id)
{
    bt_rng r = bt_rng_start(seed, BT_RNG_SIZE, id);
    if (s->law == BT_SIZE_POWER) {
        // inverse of P(>d) = u
        double q = bt_pow(s->max / s->min, -s->exponent), u = 1 - bt_rng_uniform(&r);
        return s->min * bt_pow(q + u * (1 - q), -1 / s->exponent);
    }
    if (s->spread < LEAST_SPREAD) return s->mean;
    for (;;) {
        double d;
        if (s->law == BT_SIZE_LOGNORMAL) {
            d = bt_exp(s->mu + s->sigma * bt_rng_normal(&r));
            if (d >= s->min && (s->max <= 0 || d <= s->max)) return d;
        } else {
            double k = 1 / (s->spread * s->spread);
            d = s->mean / k * bt_rng_gamma(&r, k);
            if (d >= 0.1 * s->mean) return d;
        }
    }
}

double bt_sizes_mean(const bt_sizes *s) { return s->law == BT_SIZE_POWER ? power_moment(s, 1) : s->mean; }

double bt_sizes_mean_area(const bt_sizes *s)
{
    if (s->law == BT_SIZE_POWER) return BT_PI / 4 * power_moment(s, 2);
    if (s->law == BT_SIZE_LOGNORMAL && s->spread > 0) return BT_PI / 4 * lognormal_moment(s, s->mu, 2);
    return BT_PI / 4 * s->mean * s->mean * (1 + s->spread * s->spread);
}

#define SIZE_OFF 0.05   // of the mean, from which on it is said
#define SPREAD_OFF 0.1  // of the spread, likewise
#define BELOW_OFF 0.01  // of the floes, likewise
#define BELOW_SLACK 1e-2 // of size_min: a common factor near 1 brings the areas to the concentration

/// Every floe is one that the size law drew, put into a cell.
static bool as_drawn(const bt_case *c) { return !bt_case_reads_field(c) && c->lead.mode == BT_LEAD_NONE; }

bt_field_sizes bt_field_sizes_of(const bt_case *c, const bt_field *f)
{
    const double limit = as_drawn(c) && c->ice.size_law != BT_SIZE_SINGLE ? (1 - BELOW_SLACK) * c->ice.size_min : 0;
    bt_field_sizes s = {.n = f->n, .mean = bt_field_mean_size(f), .least = INFINITY};
    for (bt_idx i = 0; i < f->n; i++) {
        const double d = sqrt(4 * f->area[i] / BT_PI);
        s.below += d < limit;
        s.least = bt_min(s.least, d);
    }
    return s;
}

void bt_field_size_warn(const bt_case *c, const bt_field_sizes *found, bt_errors *warnings)
{
    bt_sizes s;
    bt_errors refused = {0}; // such a case makes no ice
    const bt_idx n = found->n;
    if (as_drawn(c) && n > 0 && bt_sizes_init(&s, c, &refused) == BT_OK) {
        const double mean = bt_sizes_mean(&s), second = bt_sizes_mean_area(&s) * 4 / BT_PI;
        const double scatter = sqrt(bt_max(second - mean * mean, 0) / n), off = found->mean - mean;
        if (fabs(off) > SIZE_OFF * mean && fabs(off) > 3 * scatter)
            bt_errors_add(warnings,
                          "the %d floes have a mean diameter of %.3g m, %.0f %% %s than that of ice.size_law: at a "
                          "wide spread small floes are drawn again, or find no place; lower ice.size_spread, or "
                          "count on the diameter that was made",
                          (int)n, found->mean, 100 * fabs(off) / mean, off > 0 ? "more" : "less");
        const double spread = sqrt(bt_max(second - mean * mean, 0)) / mean;
        if (s.law == BT_SIZE_LOGNORMAL && spread < (1 - SPREAD_OFF) * s.spread)
            bt_errors_add(warnings,
                          "ice.size_min and ice.size_max leave the sizes a spread of %.2g, where ice.size_spread asks "
                          "for %.2g: all that is drawn beyond them is drawn again; move them apart, or lower "
                          "ice.size_spread",
                          spread, s.spread);
        if (found->below > BELOW_OFF * n)
            bt_errors_add(warnings,
                          "%d of the %d floes, %.2g %%, are smaller than ice.size_min, down to %.3g m: small floes "
                          "get the room that larger ones leave them; narrow the range of sizes, or lower the "
                          "concentration",
                          (int)found->below, (int)n, 100.0 * found->below / n, found->least);
    }
    bt_errors_free(&refused);
}
