// SPDX-License-Identifier: MIT
// Chunks as HDF5's filters read them back: every number returns, and no kind of plane takes more room than by zlib's
// level 1 alone.
#include <zlib.h>

#include "test.h"
#include "base/h5util.h"
#include "base/rng.h"

enum { N = 20000, ROOM = 20480 };

static unsigned char shuffled[8 * ROOM], back[8 * ROOM + 1], plain[16 * ROOM];

/// Bytes by bt_deflate, which must give the numbers back; *alone: by level 1.
static size_t length_of(bt_deflater **d, const void *numbers, size_t n, size_t size, size_t *alone)
{
    memset(shuffled, 0, sizeof shuffled);
    for (size_t i = 0; i < n; i++)
        for (size_t k = 0; k < size; k++) shuffled[k * ROOM + i] = ((const unsigned char *)numbers)[i * size + k];
    size_t length = 0;
    const void *chunk = bt_deflate(d, numbers, n, ROOM, size, &length);
    assert_non_null(chunk);
    uLongf whole = sizeof back;
    assert_int_equal(uncompress(back, &whole, chunk, length), Z_OK);
    assert_int_equal(whole, ROOM * size);
    assert_memory_equal(back, shuffled, ROOM * size);
    uLongf packed = sizeof plain;
    assert_int_equal(compress2(plain, &packed, shuffled, ROOM * size, 1), Z_OK);
    *alone = packed;
    return length;
}

TEST(test_numbers_return)
{
    static double noise[N], rest[N], few[N];
    static int32_t ids[N];
    static float flat[N];
    bt_rng r = bt_rng_start(1, BT_RNG_SHAKE, 0);
    for (int i = 0; i < N; i++) {
        noise[i] = 3000 * bt_rng_uniform(&r);
        few[i] = i % 3 == 2 ? 0 : bt_rng_uniform(&r);
        ids[i] = i;
        flat[i] = i < N - 50 ? 0 : (float)bt_rng_uniform(&r);
    }
    bt_deflater *d = NULL;
    const struct { const void *numbers; size_t n, size; } all[] = {
        {noise, N, 8}, {rest, N, 8}, {few, N, 8}, {ids, N, 4}, {flat, N, 4}, {noise, 100, 8}, {noise, 1, 8},
        {ids, N / 2, 4}};
    for (size_t k = 0; k < sizeof all / sizeof *all; k++) {
        size_t alone;
        const size_t length = length_of(&d, all[k].numbers, all[k].n, all[k].size, &alone);
        assert_true((double)length < 1.02 * (double)alone + 64);
    }
    bt_deflater_free(d);
}

TEST_MAIN(NULL, NULL)
