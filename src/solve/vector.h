// SPDX-License-Identifier: MIT
// Four doubles at a time (private to the solver): the compiler's vectors, element by element in IEEE arithmetic without
// contraction, whatever instructions they are translated to. So the bits do not depend on the processor.
#ifndef BERGTOW_VECTOR_H
#define BERGTOW_VECTOR_H

#include <stdint.h>

#include "bergtow/base.h"

enum { BT_LANES = 4 };

typedef double bt_vec __attribute__((vector_size(BT_LANES * sizeof(double))));
typedef int64_t bt_mask __attribute__((vector_size(BT_LANES * sizeof(int64_t))));

// One copy of a function for each instruction set that the program is built for, chosen when it starts: by the dynamic
// linker of glibc (ifunc), which other C libraries have nothing of.
#if defined(__x86_64__) && !defined(__AVX2__) && !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__) &&    \
    !defined(__clang__) && defined(__GLIBC__)
#define BT_FOR_EACH_CPU __attribute__((target_clones("avx2", "default")))
#else
#define BT_FOR_EACH_CPU
#endif
#define BT_INLINE static inline __attribute__((always_inline))

BT_INLINE bt_vec bt_choose(bt_mask m, bt_vec yes, bt_vec no)
{
    return (bt_vec)(((bt_mask)yes & m) | ((bt_mask)no & ~m));
}
BT_INLINE bt_vec bt_larger(bt_vec a, bt_vec b) { return bt_choose(a > b, a, b); }
BT_INLINE bt_vec bt_smaller(bt_vec a, bt_vec b) { return bt_choose(a < b, a, b); }
BT_INLINE bt_vec bt_size_of(bt_vec a) { return (bt_vec)((bt_mask)a & ~(bt_mask)(bt_vec){-0.0, -0.0, -0.0, -0.0}); }
BT_INLINE double bt_largest_lane(bt_vec a) { return bt_max(bt_max(a[0], a[1]), bt_max(a[2], a[3])); }

#endif
