// SPDX-License-Identifier: MIT
// Four doubles at a time (private to the solver): the compiler's vectors, element by element in IEEE arithmetic without
// contraction, whatever the instructions. So the bits do not depend on the processor.
#ifndef BERGTOW_VECTOR_H
#define BERGTOW_VECTOR_H

#include <stdint.h>

#include "base/inside.h"
#include "bergtow/base.h"

enum { BT_LANES = 4 };

typedef double bt_vec __attribute__((vector_size(BT_LANES * sizeof(double))));
typedef int64_t bt_mask __attribute__((vector_size(BT_LANES * sizeof(int64_t))));

BT_INLINE bt_vec bt_choose(bt_mask m, bt_vec yes, bt_vec no)
{
    return (bt_vec)(((bt_mask)yes & m) | ((bt_mask)no & ~m));
}
BT_INLINE bt_vec bt_larger(bt_vec a, bt_vec b) { return bt_choose(a > b, a, b); }
BT_INLINE bt_vec bt_smaller(bt_vec a, bt_vec b) { return bt_choose(a < b, a, b); }
BT_INLINE bt_vec bt_size_of(bt_vec a) { return (bt_vec)((bt_mask)a & ~(bt_mask)(bt_vec){-0.0, -0.0, -0.0, -0.0}); }
/// The bits set in any lane.
BT_INLINE int64_t bt_joined(bt_mask m)
{
    m |= __builtin_shufflevector(m, m, 2, 3, 0, 1);
    m |= __builtin_shufflevector(m, m, 1, 0, 3, 2);
    return m[0];
}
BT_INLINE double bt_largest_lane(bt_vec a) { return bt_max(bt_max(a[0], a[1]), bt_max(a[2], a[3])); }

#endif
