// SPDX-License-Identifier: MIT
// Sorting things named by two numbers and two parts, as pairs of bodies are: runs by insertion, then merged. qsort_r,
// which calls a function for each comparison, took three times as long for the lists of a cell.
#ifndef BT_NAMED_H
#define BT_NAMED_H

#include <string.h>

#include "bergtow/base.h"

typedef struct bt_named {
    int64_t a, b;      ///< names of the bodies; or cell and body
    uint32_t part, at; ///< parts of the bodies; place of the thing
} bt_named;

static inline bool bt_named_before(const bt_named *x, const bt_named *y)
{
    if (x->a != y->a) return x->a < y->a;
    return x->b != y->b ? x->b < y->b : x->part < y->part;
}

/// Sort v [n], with room [n] for the merges.
static inline void bt_named_sort(bt_named *v, bt_named *room, size_t n)
{
    enum { RUN = 8 };
    for (size_t i = 1; i < n; i++) {
        const bt_named x = v[i];
        size_t k = i;
        for (; k % RUN > 0 && bt_named_before(&x, &v[k - 1]); k--) v[k] = v[k - 1];
        v[k] = x;
    }
    bt_named *from = v, *to = room;
    for (size_t run = RUN; run < n; run *= 2) {
        for (size_t begin = 0; begin < n; begin += 2 * run) {
            const size_t middle = begin + run < n ? begin + run : n, end = middle + run < n ? middle + run : n;
            size_t p = begin, q = middle;
            for (size_t k = begin; k < end; k++)
                to[k] = p < middle && (q == end || !bt_named_before(&from[q], &from[p])) ? from[p++] : from[q++];
        }
        bt_named *const last = from;
        from = to, to = last;
    }
    if (from != v && n > 0) memcpy(v, from, n * sizeof *v);
}

#endif
