// SPDX-License-Identifier: MIT
// Functions in which the time goes, for the processor that there is. Their bits do not depend on it.
#ifndef BERGTOW_CPU_H
#define BERGTOW_CPU_H

// One copy of a function for each instruction set that the program is built for, chosen when it starts: by the dynamic
// linker of glibc (ifunc), which other C libraries have nothing of.
#if defined(__x86_64__) && !defined(__AVX2__) && !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__) &&    \
    !defined(__clang__) && defined(__GLIBC__)
#define BT_FOR_EACH_CPU __attribute__((target_clones("avx2", "default")))
#else
#define BT_FOR_EACH_CPU
#endif
#define BT_INLINE static inline __attribute__((always_inline))

#endif
