// SPDX-License-Identifier: MIT
// Elementary functions: their error against long double, their ends, and a checksum of their bits that every compiler
// and machine must give.
#include "test.h"
#include "bergtow/base.h"
#include "base/elementary.h"

#include <float.h>
#include <inttypes.h>

#include "base/rng.h"

enum { N = 400000 };

typedef struct {
    const char *name;
    double from, to;   ///< of the argument; of its logarithm where both are below
    bool spread;       ///< exp of a uniform number
    double (*of)(double);
    long double (*exact)(long double);
    double ulps;       ///< bound
} function;

static const function functions[] = {
    {"sin", -7, 7, false, bt_sin, sinl, 0.9},
    {"cos", -7, 7, false, bt_cos, cosl, 0.9},
    {"sin, far", -1e6, 1e6, false, bt_sin, sinl, 0.9},
    {"tan", -1.5, 1.5, false, bt_tan, tanl, 2.2},
    {"exp", -40, 40, false, bt_exp, expl, 0.9},
    {"exp, far", -708, 709, false, bt_exp, expl, 0.9},
    {"log", -300, 300, true, bt_log, logl, 0.9},
    {"log, near 1", -1e-2, 1e-2, true, bt_log, logl, 0.9},
    {"log1p", -0.7, 2, false, bt_log1p, log1pl, 1.1},
    {"log1p, small", -30, 3, true, bt_log1p, log1pl, 1.1},
    {"asinh", -3, 3, false, bt_asinh, asinhl, 2.2},
    {"asinh, far", -30, 30, true, bt_asinh, asinhl, 2.2},
    {"erfc", -4, 5, false, bt_erfc, erfcl, 60},
};

static double argument(const function *f, int i)
{
    bt_rng r = bt_rng_start(7, BT_RNG_SIZE, i);
    const double x = f->from + (f->to - f->from) * bt_rng_uniform(&r);
    return f->spread ? bt_exp(x) : x;
}

static double error_in_ulps(double value, long double exact)
{
    const double unit = nextafter(fabs((double)exact), INFINITY) - fabs((double)exact);
    return (double)(fabsl((long double)value - exact) / unit);
}

TEST(errors_stay_below_their_bounds)
{
    if (LDBL_MANT_DIG <= DBL_MANT_DIG) skip(); // nothing better to hold them against: the checksum does
    for (size_t k = 0; k < sizeof functions / sizeof *functions; k++) {
        const function *f = &functions[k];
        double worst = 0;
        for (int i = 0; i < N; i++) {
            const double x = argument(f, i);
            worst = fmax(worst, error_in_ulps(f->of(x), f->exact(x)));
        }
        print_message("%-14s %.3f\n", f->name, worst);
        assert_true(worst < f->ulps);
    }
}

TEST(errors_of_two_arguments_stay_below_their_bounds)
{
    if (LDBL_MANT_DIG <= DBL_MANT_DIG) skip();
    double arc = 0, root = 0, power = 0;
    for (int i = 0; i < N; i++) {
        bt_rng r = bt_rng_start(8, BT_RNG_SIZE, i);
        const double size = bt_exp(40 * bt_rng_uniform(&r) - 20), x = bt_rng_uniform(&r) - 0.5,
                     y = size * (bt_rng_uniform(&r) - 0.5), base = bt_exp(8 * bt_rng_uniform(&r) - 4),
                     n = 10 * bt_rng_uniform(&r) - 5;
        arc = fmax(arc, error_in_ulps(bt_atan2(y, x), atan2l(y, x)));
        root = fmax(root, error_in_ulps(bt_hypot(x, y), hypotl(x, y)));
        power = fmax(power, error_in_ulps(bt_pow(base, n), powl(base, n)) / (2 + 2 * fabs(n * log(base))));
    }
    print_message("atan2 %.3f, hypot %.3f, pow %.3f of its bound\n", arc, root, power);
    assert_true(arc < 2 && root < 1.3 && power < 1);
}

TEST(ends_are_those_of_the_standard)
{
    const double zero = 0, tiny = 0x1p-1074, huge = DBL_MAX;
    double s, c;
    bt_sincos(0, &s, &c);
    assert_true(s == 0 && c == 1);
    bt_sincos(INFINITY, &s, &c);
    assert_true(isnan(s) && isnan(c));
    assert_true(bt_sin(BT_PI / 2) == 1 && bt_cos(BT_PI) == -1 && fabs(bt_sin(BT_PI) - 1.2246467991473532e-16) < 1e-31);
    assert_true(fabs(bt_sin(1e12) - sin(1e12)) < 1e-3); // an argument that is known to 1e-4 only
    assert_true(bt_exp(0) == 1 && bt_exp(1000) == INFINITY && bt_exp(-1000) == 0 && isnan(bt_exp(NAN)));
    assert_true(bt_exp(-745) == exp(-745) && bt_exp(709.7) < INFINITY);
    assert_true(bt_log(1) == 0 && bt_log(0) == -INFINITY && isnan(bt_log(-1)) && bt_log(INFINITY) == INFINITY);
    assert_true(fabs(bt_log(tiny) - log(tiny)) < 1e-12 && bt_log1p(-1) == -INFINITY && bt_log1p(1e-20) == 1e-20);
    assert_true(bt_pow(3, 2) == 9 && bt_pow(2, -3) == 0.125 && bt_pow(0, 0.5) == 0 && isnan(bt_pow(-2, 0.5)) &&
                bt_pow(5, 0) == 1);
    assert_true(bt_atan2(zero, 1) == 0 && bt_atan2(zero, -1) == BT_PI && bt_atan2(-zero, -1) == -BT_PI);
    assert_true(bt_atan2(1, zero) == BT_PI / 2 && bt_atan2(-1, zero) == -BT_PI / 2 && bt_atan2(1, 1) == BT_PI / 4);
    assert_true(bt_atan2(INFINITY, INFINITY) == BT_PI / 4 && isnan(bt_atan2(NAN, 1)));
    assert_true(bt_hypot(3, 4) == 5 && bt_hypot(0, 0) == 0 && bt_hypot(huge, 1) == huge && bt_hypot(tiny, 0) == tiny);
    assert_true(fabs(bt_hypot(3e200, 4e200) / 5e200 - 1) < 1e-15);
    assert_true(fabs(bt_hypot(3e-200, 4e-200) / 5e-200 - 1) < 1e-15);
    assert_true(isnan(bt_hypot(NAN, 1)));
    assert_true(bt_hypot(INFINITY, NAN) == INFINITY);
    assert_true(bt_erfc(0) == 1 && fabs(bt_erfc(-6) - 2) < 1e-15);
    assert_true(fabs(bt_erfc(2) / 0.004677734981047266 - 1) < 1e-13);
    assert_true(bt_ceil_log2(1) == 0 && bt_ceil_log2(1.1) == 1 && bt_ceil_log2(0.5) == -1 && bt_ceil_log2(3) == 2);
    assert_true(bt_ceil_2log2(1) == 0 && bt_ceil_2log2(1.4) == 1 && bt_ceil_2log2(1.42) == 2 && bt_ceil_2log2(2) == 2);
}

static void add(uint64_t *hash, double x)
{
    uint64_t bits;
    memcpy(&bits, &x, sizeof bits);
    for (int k = 0; k < 8; k++, bits >>= 8) *hash = (*hash ^ (bits & 255)) * UINT64_C(1099511628211);
}

/// The one test that compares machines: what this number is here, it is with any compiler, libm and processor.
TEST(bits_are_those_of_every_machine)
{
    uint64_t hash = UINT64_C(14695981039346656037);
    for (size_t k = 0; k < sizeof functions / sizeof *functions; k++)
        for (int i = 0; i < 20000; i++) add(&hash, functions[k].of(argument(&functions[k], i)));
    for (int i = 0; i < 20000; i++) {
        bt_rng r = bt_rng_start(9, BT_RNG_SIZE, i);
        const double x = 100 * bt_rng_uniform(&r) - 50, y = 100 * bt_rng_uniform(&r) - 50;
        add(&hash, bt_atan2(y, x));
        add(&hash, bt_hypot(y, x));
        add(&hash, bt_pow(fabs(x), 0.1 * y));
    }
    print_message("bits %016" PRIx64 "\n", hash);
    assert_true(hash == UINT64_C(0x3a444cd7af690146));
}

TEST_MAIN(NULL, NULL)
