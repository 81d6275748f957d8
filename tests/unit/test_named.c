// SPDX-License-Identifier: MIT
// The order of pairs by their names is that of qsort, for lists of every length.
#include "test.h"
#include "base/named.h"
#include "base/rng.h"

enum { MOST = 300 };

static int by_names(const void *p, const void *q)
{
    const bt_named *a = p, *b = q;
    if (a->a != b->a) return a->a < b->a ? -1 : 1;
    if (a->b != b->b) return a->b < b->b ? -1 : 1;
    return (a->part > b->part) - (a->part < b->part);
}

TEST(test_order)
{
    bt_named mine[MOST], theirs[MOST], room[MOST];
    for (int n = 0; n < MOST; n++) {
        bt_rng r = bt_rng_start(1, BT_RNG_SHAKE, n);
        for (int i = 0; i < n; i++) {
            const double spread = n % 3 ? 8 : 1e12; // names beyond 32 bits, and names that repeat
            mine[i] = (bt_named){(int64_t)(spread * bt_rng_uniform(&r)), (int64_t)(spread * bt_rng_uniform(&r)),
                                 (uint32_t)(i % 7) << 16 | (uint32_t)(i % 5), (uint32_t)i};
            theirs[i] = mine[i];
        }
        if (n > 0) qsort(theirs, (size_t)n, sizeof *theirs, by_names);
        bt_named_sort(mine, room, (size_t)n);
        uint64_t seen = 0;
        for (int i = 0; i < n; i++) {
            assert_int_equal(by_names(&mine[i], &theirs[i]), 0);
            seen += mine[i].at;
        }
        assert_int_equal(seen, n * (n - 1) / 2); // each of them once
    }
}

TEST_MAIN(NULL, NULL)
