// SPDX-License-Identifier: MIT
// Sums whose result does not depend on the order of the terms.
//
// Each term is truncated to a multiple of 2⁻⁶⁴ and added in 128-bit integer arithmetic, which is associative; so the
// same terms give the same bits on any number of threads and ranks. A double-precision reduction does not, and a
// superaccumulator (Collange et al. 2015) keeps bits that no quantity here needs. Terms must stay below
// 2⁶² ≈ 4.6e18 in magnitude; a larger one, or a NaN, makes the sum NaN instead of wrong. The total must stay below 2⁶³,
// which is not checked: a caller with many large terms scales them (src/solve/rounds.c).
#ifndef BERGTOW_SUM_H
#define BERGTOW_SUM_H

#include <math.h>

#include "bergtow/base.h"

BT_BEGIN_C

__extension__ typedef __int128 bt_int128;
__extension__ typedef unsigned __int128 bt_uint128;

typedef struct bt_sum {
    bt_int128 v; ///< in units of 2⁻⁶⁴
    bool bad;
} bt_sum;

/// Add a term; a term of 2⁶² or more, or a NaN, makes the sum NaN. An empty sum is {0}.
static inline void bt_sum_add(bt_sum *sum, double x)
{
    if (!(fabs(x) < 0x1p62)) {
        sum->bad = true;
        return;
    }
    // The magnitude in three parts, each exact and below 2⁶³, where a conversion is one instruction: x 2⁶⁴, truncated.
    const double size = fabs(x), whole = (double)(int64_t)size, high = (size - whole) * 0x1p32;
    const int64_t upper = (int64_t)high, lower = (int64_t)((high - (double)upper) * 0x1p32);
    const bt_uint128 v = (bt_uint128)(int64_t)size << 64 | (bt_uint128)(uint64_t)upper << 32 | (uint64_t)lower;
    // Modulo 2¹²⁸: a sum that exceeds 2⁶³ on the way to a smaller total is right, in any order.
    sum->v = (bt_int128)((bt_uint128)sum->v + (x < 0 ? -v : v));
}

/// Add another sum.
static inline void bt_sum_join(bt_sum *sum, const bt_sum *more)
{
    sum->v = (bt_int128)((bt_uint128)sum->v + (bt_uint128)more->v);
    sum->bad = sum->bad || more->bad;
}

/// The sum as a double, rounded once; NaN if a term was bad.
static inline double bt_sum_value(const bt_sum *sum) { return sum->bad ? (double)NAN : (double)sum->v * 0x1p-64; }

BT_END_C

#endif
