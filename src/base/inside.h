// SPDX-License-Identifier: MIT
// What all of the program uses of src/base/base.c and others have no use for.
#ifndef BT_INSIDE_H
#define BT_INSIDE_H

/// Is work on n things worth a team of threads? In the validation build always, so that small tests reach every
/// parallel loop.
#ifdef BT_VALIDATE
#define BT_MANY(n, few) ((n) >= 0 && (few) >= 0)
#else
#define BT_MANY(n, few) ((n) > (few))
#endif

/// Numbers of this thread are written and read with a decimal point from here on, whatever the locale of the program
/// that uses the library. Returns what bt_point_end takes to restore it; such pairs may lie within each other.
void *bt_point_begin(void);
void bt_point_end(void *before);

/// How the program ends at once, with a code and no return: _Exit, or what ends the other ranks, too.
void bt_leave_by(void (*by)(int code));

/// Room in a list for one entry more than n: cap entries, twice as many each time, `first` to begin with.
#define BT_MAKE_ROOM(list, n, cap, first)                                                                              \
    do {                                                                                                               \
        if ((n) == (cap)) (list) = bt_realloc(list, (size_t)((cap) = (cap) ? 2 * (cap) : (first)), sizeof *(list));    \
    } while (0)

// Order of doubles for qsort.

static inline int bt_ascending(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

// Functions in which the time goes, for the processor that there is. Their bits do not depend on it.

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
