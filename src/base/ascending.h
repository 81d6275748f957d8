// SPDX-License-Identifier: MIT
// Order of doubles for qsort.
#ifndef BT_ASCENDING_H
#define BT_ASCENDING_H

static inline int bt_ascending(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

#endif
