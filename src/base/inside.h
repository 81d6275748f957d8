// SPDX-License-Identifier: MIT
// Parts of src/base/base.c for the program itself, which users of the library do not need.
#ifndef BT_INSIDE_H
#define BT_INSIDE_H

#include <fenv.h>
#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdlib.h>

/// Is work on n things worth a team of threads? In the validation build always, so that small tests reach every
/// parallel loop.
#ifdef BT_VALIDATE
#define BT_MANY(n, few) ((n) >= 0 && (few) >= 0)
#else
#define BT_MANY(n, few) ((n) > (few))
#endif

/// From here to the end of the block this thread writes and reads numbers with a decimal point, and computes as C does
/// by default: rounding to nearest, no traps, subnormal numbers kept. The locale and the floating-point environment of
/// the program that uses the library are back at the end. Blocks may be nested.
///
/// It comes first in every public function, except those without such numbers (named in tests/plain_numbers.py), and in
/// every OpenMP team: a thread keeps the environment in which it was created, perhaps for a team of the program.
/// So functions of the program that the library calls (forces, quantities) run with it, too. 10 ns where there is
/// nothing to change, 0.3 µs where there is.
#define BT_PLAIN_NUMBERS                                                                                               \
    __attribute__((cleanup(bt_numbers_restore), unused)) const bt_numbers numbers_until_return = bt_numbers_plain()

typedef struct bt_numbers {
    void *locale;        ///< of the thread
    bool changed;        ///< the environment
    fenv_t environment;  ///< as it was, if changed
} bt_numbers;
bt_numbers bt_numbers_plain(void);
void bt_numbers_restore(const bt_numbers *before);

/// Set the function that ends the program at once, with a code: _Exit, or one that ends the other ranks, too.
void bt_leave_by(void (*by)(int code));

/// Make room for one more entry in a list of n entries with room for cap; the room begins with `first` and doubles.
#define BT_MAKE_ROOM(list, n, cap, first)                                                                              \
    do {                                                                                                               \
        if ((n) == (cap)) (list) = bt_realloc(list, (size_t)((cap) = (cap) ? 2 * (cap) : (first)), sizeof *(list));    \
    } while (0)

/// Free several pieces of memory, each of which may be NULL; all are named before the first is freed.
#define BT_FREE(...) bt_free_all(sizeof((void *[]){__VA_ARGS__}) / sizeof(void *), (void *[]){__VA_ARGS__})
static inline void bt_free_all(size_t n, void *const *list)
{
    for (size_t i = 0; i < n; i++) free(list[i]);
}

// Order of doubles, for qsort.

static inline int bt_ascending(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}
static inline int bt_descending(const void *a, const void *b) { return bt_ascending(b, a); }

/// Percentile by linear interpolation between order statistics (numpy's default) of sorted x[n].
static inline double bt_percentile(const double *x, int64_t n, double percent)
{
    if (n < 1) return NAN;
    const double at = percent / 100 * (double)(n - 1);
    const int64_t i = (int64_t)at, next = i + 1 < n ? i + 1 : i;
    return x[i] + (at - (double)i) * (x[next] - x[i]);
}

/// Define an order of structs, for qsort: by one number of theirs; the second: where that is the same, by another.
#define BT_ASCENDING(name, type, first) BT_ASCENDING_BY(name, type, first, first)
#define BT_ASCENDING_BY(name, type, first, second)                                                                     \
    static int name(const void *p, const void *q)                                                                      \
    {                                                                                                                  \
        const type *a = p, *b = q;                                                                                     \
        if (a->first != b->first) return a->first < b->first ? -1 : 1;                                                 \
        return (a->second > b->second) - (a->second < b->second);                                                      \
    }

// Functions that take most of the time, compiled for the processor in use, on which no bit of their results depends.

// BT_FOR_EACH_CPU makes a copy of a function for each instruction set; at start the dynamic linker of glibc chooses
// among them (ifunc), which other C libraries lack.
#if defined(__x86_64__) && !defined(__AVX2__) && !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__) &&    \
    !defined(__clang__) && defined(__GLIBC__)
#define BT_FOR_EACH_CPU __attribute__((target_clones("avx2", "default")))
#else
#define BT_FOR_EACH_CPU
#endif
#define BT_INLINE static inline __attribute__((always_inline))

#endif
