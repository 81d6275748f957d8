// SPDX-License-Identifier: MIT
// Elementary functions whose bits are the same on every machine.
//
// A C library chooses its functions by the processor, with or without fused multiply-add, and libraries differ: with
// them the same program made other floes on another machine, and a run resumed there matched the run of neither
// machine. The functions here use nothing but + - * / and sqrt of doubles, which IEEE 754 rounds in one way only, and
// operations that are exact (frexp, ldexp, remainder); the compiler may not contract or reorder them
// (-ffp-contract=off, no -ffast-math). A test checks that the program imports no other function of libm.
//
// Errors in units in the last place, against long double: sin, cos, exp, log and log1p below 1, hypot below 1.3, atan2,
// asinh and tan below 2.2, pow below 2 + 2 |y ln x|, erfc below 60. Rejected: correctly rounded functions (CORE-MATH),
// which promise the same and more, in several thousand lines of foreign code.
#ifndef BT_ELEMENTARY_H
#define BT_ELEMENTARY_H

#include <math.h>

void bt_sincos(double x, double *sine, double *cosine);
double bt_tan(double x);
double bt_atan2(double y, double x);
double bt_exp(double x);
double bt_log(double x);
/// log(1 + x)
double bt_log1p(double x);
double bt_asinh(double x);
double bt_pow(double x, double y);
double bt_erfc(double x);

/// The least k with x <= 2^k; x > 0.
static inline int bt_ceil_log2(double x)
{
    int k;
    return frexp(x, &k) == 0.5 ? k - 1 : k;
}

/// The least k with x <= 2^(k/2); x > 0.
static inline int bt_ceil_2log2(double x)
{
    int k;
    const double m = frexp(x, &k);
    return 2 * k - (m == 0.5 ? 2 : m <= 0.70710678118654752440 ? 1 : 0);
}

static inline double bt_sin(double x)
{
    double s, c;
    bt_sincos(x, &s, &c);
    return s;
}

static inline double bt_cos(double x)
{
    double s, c;
    bt_sincos(x, &s, &c);
    return c;
}

static inline double bt_hypot(double x, double y)
{
    const double square = x * x + y * y;
    if (square > 0x1p-900 && square < 0x1p1000) return sqrt(square);
    if (isinf(x) || isinf(y)) return INFINITY;
    const double largest = fmax(fabs(x), fabs(y));
    if (!(largest > 0)) return x + y; // 0, or NaN
    int k;
    frexp(largest, &k); // squares neither overflow nor vanish
    const double a = ldexp(x, -k), b = ldexp(y, -k);
    return ldexp(sqrt(a * a + b * b), k);
}

#endif
