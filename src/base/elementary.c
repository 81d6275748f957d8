// SPDX-License-Identifier: MIT
// Elementary functions whose bits are the same on every machine (elementary.h): the argument is reduced in two parts,
// then the Taylor series, which on so short an interval needs one or two terms more than the best polynomial.
#include "base/elementary.h"

#include "bergtow/base.h"

// pi/2 = half_pi[0] + [1] + [2]: 33 bits each, so that their products with whole numbers below 2^20 are exact
static const double half_pi[3] = {0x1.921fb544p+0, 0x1.0b4611a6p-34, 0x1.3198a2e037073p-69};
// ln 2 = ln2[0] + [1]: 32 bits, and the rest
static const double ln2[2] = {0x1.62e42feep-1, 0x1.a39ef35793c76p-33};

/// Rounding error of the sum a + b, |a| >= |b|: a + b = sum + this, exactly.
static double rest_of_sum(double sum, double a, double b) { return (a - sum) + b; }

void bt_sincos(double x, double *sine, double *cosine)
{
    if (!isfinite(x)) {
        *sine = *cosine = NAN;
        return;
    }
    // Beyond this, reduction by a rounded 2 pi adds less error than the rounding of x itself.
    if (fabs(x) > 0x1p20) x = remainder(x, 2 * BT_PI);
    const double n = nearbyint(x / half_pi[0]);
    const double first = x - n * half_pi[0], second = n * half_pi[1];
    const double near = first - second, rest = rest_of_sum(near, first, -second) - n * half_pi[2];
    const double y = near + rest, low = rest_of_sum(y, near, rest), z = y * y;

    // sin(y + low) = sin y + low cos y; cos(y + low) = cos y - low sin y
    const double sine_terms =
        z * (-1 / 6.0 +
             z * (1 / 120.0 +
                  z * (-1 / 5040.0 +
                       z * (1 / 362880.0 +
                            z * (-1 / 39916800.0 +
                                 z * (1 / 6227020800.0 +
                                      z * (-1 / 1307674368000.0 + z * (1 / 355687428096000.0))))))));
    const double s = y + (y * sine_terms + low * (1 - 0.5 * z));
    const double cosine_terms =
        z * (1 / 24.0 +
             z * (-1 / 720.0 +
                  z * (1 / 40320.0 +
                       z * (-1 / 3628800.0 +
                            z * (1 / 479001600.0 + z * (-1 / 87178291200.0 + z * (1 / 20922789888000.0)))))));
    const double half = 0.5 * z, most = 1 - half;
    const double c = most + (rest_of_sum(most, 1, -half) + (z * cosine_terms - low * y));

    switch ((int)((int64_t)n & 3)) {
    case 0: *sine = s, *cosine = c; break;
    case 1: *sine = c, *cosine = -s; break;
    case 2: *sine = -s, *cosine = -c; break;
    default: *sine = -c, *cosine = s; break;
    }
}

double bt_tan(double x)
{
    double s, c;
    bt_sincos(x, &s, &c);
    return s / c;
}

/// atan t for 0 <= t <= 1: about the nearest k/8, atan t = atan k/8 + atan((t - k/8) / (1 + t k/8)).
static double arc(double t)
{
    static const double at[9] = {0,
                                 0x1.fd5ba9aac2f6ep-4,
                                 0x1.f5b75f92c80ddp-3,
                                 0x1.6f61941e4def1p-2,
                                 0x1.dac670561bb4fp-2,
                                 0x1.1e00babdefeb4p-1,
                                 0x1.4978fa3269ee1p-1,
                                 0x1.700a7c5784634p-1,
                                 0x1.921fb54442d18p-1};
    const int k = (int)nearbyint(8 * t);
    const double near = 0.125 * k, z = (t - near) / (1 + t * near), w = z * z;
    const double terms = w * (-1 / 3.0 + w * (1 / 5.0 + w * (-1 / 7.0 + w * (1 / 9.0 + w * (-1 / 11.0 + w / 13.0)))));
    return at[k] + (z + z * terms);
}

double bt_atan2(double y, double x)
{
    if (isnan(x) || isnan(y)) return x + y;
    const double a = fabs(x), b = fabs(y);
    double angle = 0; // of (a, b), in the first quadrant
    if (isinf(a) && isinf(b)) angle = 0.25 * BT_PI;
    else if (b > a) angle = 0.5 * BT_PI - arc(a / b);
    else if (a > 0) angle = arc(b / a);
    if (signbit(x)) angle = BT_PI - angle;
    return copysign(angle, y);
}

double bt_exp(double x)
{
    if (isnan(x)) return x;
    if (x > 709.8) return INFINITY;
    if (x < -745.2) return 0;
    const double k = nearbyint(x * (1 / (ln2[0] + ln2[1])));
    const double high = x - k * ln2[0], low = k * ln2[1];
    const double r = high - low, rest = rest_of_sum(r, high, -low);
    const double terms =
        r * r *
        (1 / 2.0 +
         r * (1 / 6.0 +
              r * (1 / 24.0 +
                   r * (1 / 120.0 +
                        r * (1 / 720.0 +
                             r * (1 / 5040.0 +
                                  r * (1 / 40320.0 +
                                       r * (1 / 362880.0 +
                                            r * (1 / 3628800.0 +
                                                 r * (1 / 39916800.0 +
                                                      r * (1 / 479001600.0 + r / 6227020800.0)))))))))));
    return ldexp(1 + (r + (terms + rest * (1 + r))), (int)k);
}

/// log(1 + f) + k ln 2 for 1 + f within a factor √2 of 1; rest: a small addition to the argument, relative to it.
/// With s = f / (2 + f), log(1 + f) = 2 (s + s³/3 + s⁵/5 + ...) = f - f²/2 + s (f²/2 + 2 s²/3 + 2 s⁴/5 + ...).
static double log_near(double f, double rest, int k)
{
    const double s = f / (2 + f), z = s * s, half = 0.5 * f * f;
    const double terms =
        z * (2 / 3.0 +
             z * (2 / 5.0 +
                  z * (2 / 7.0 +
                       z * (2 / 9.0 +
                            z * (2 / 11.0 +
                                 z * (2 / 13.0 +
                                      z * (2 / 15.0 + z * (2 / 17.0 + z * (2 / 19.0 + z * (2 / 21.0))))))))));
    const double small = s * (half + terms) + (k * ln2[1] + rest);
    return k * ln2[0] + (f - (half - small));
}

double bt_log(double x)
{
    if (isnan(x) || x < 0) return NAN;
    if (x == 0) return -INFINITY;
    if (isinf(x)) return x;
    int k;
    double m = frexp(x, &k); // [0.5, 1)
    if (m < 0.70710678118654752440) m *= 2, k--;
    return log_near(m - 1, 0, k);
}

double bt_log1p(double x)
{
    if (x > -0.25 && x < 0.4) return log_near(x, 0, 0);
    const double sum = 1 + x;
    if (!(sum > 0) || isinf(sum)) return bt_log(sum);
    int k;
    double m = frexp(sum, &k);
    if (m < 0.70710678118654752440) m *= 2, k--;
    const double rest = (fabs(x) > 1 ? rest_of_sum(sum, x, 1) : rest_of_sum(sum, 1, x)) / sum;
    return log_near(m - 1, rest, k);
}

double bt_asinh(double x)
{
    const double a = fabs(x);
    if (a > 0x1p28) return copysign(bt_log(a) + (ln2[0] + ln2[1]), x);
    // log(a + sqrt(a² + 1)) without cancellation near 1
    return copysign(bt_log1p(a + a * a / (1 + sqrt(a * a + 1))), x);
}

double bt_pow(double x, double y)
{
    if (y == nearbyint(y) && fabs(y) <= 64) {
        double power = 1, square = x;
        for (int n = (int)fabs(y); n > 0; n >>= 1, square *= square)
            if (n & 1) power *= square;
        return y < 0 ? 1 / power : power;
    }
    if (x == 0) return y > 0 ? 0 : INFINITY;
    return bt_exp(y * bt_log(x)); // NaN of a negative number
}

double bt_erfc(double x)
{
    if (x < 0) return 2 - bt_erfc(-x);
    const double square = x * x, two_over_root_pi = 1.12837916709551257390;
    if (x < 1.25) { // erf x = 2/sqrt(pi) exp(-x²) sum 2^n x^(2n + 1) / (2n + 1)!!
        double term = x, sum = x;
        for (int n = 1; n < 40; n++) {
            term *= 2 * square / (2 * n + 1);
            sum += term;
        }
        return 1 - two_over_root_pi * bt_exp(-square) * sum;
    }
    double fraction = x; // x + (1/2)/(x + (2/2)/(x + (3/2)/(x + ...
    for (int n = 200; n > 0; n--) fraction = x + 0.5 * n / fraction;
    return 0.5 * two_over_root_pi * bt_exp(-square) / fraction;
}
