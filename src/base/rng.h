// SPDX-License-Identifier: MIT
// Random numbers that depend on (seed, purpose, id) alone: Philox 4×64-10 (Salmon et al. 2011, SC11, "Parallel random
// numbers: as easy as 1, 2, 3") with key (seed, purpose) and counter (id, block). No state is shared between ids, so
// the numbers of a floe do not depend on threads, on ranks, or on how many numbers another floe has drawn.
#ifndef BT_RNG_H
#define BT_RNG_H

#include <Random123/philox.h>

#include "bergtow/base.h"
#include "base/elementary.h"

/// Purpose of a stream. These numbers are part of the result: append, never reorder.
typedef enum {
    BT_RNG_SIZE = 1,   ///< floe diameters
    BT_RNG_PLACE,      ///< seeds of the tessellation
    BT_RNG_CUT,        ///< saw-cut rows
    BT_RNG_ORIENT,     ///< orientation of regular polygons
    BT_RNG_SHAKE,      ///< velocities of the shake
    BT_RNG_THICKNESS,
    BT_RNG_MEMBER,     ///< seeds of the members of a study
    BT_RNG_HYPERCUBE,  ///< strata of a Latin hypercube, and positions in them
    BT_RNG_SPLIT,      ///< strength of floes
} bt_rng_purpose;

typedef struct bt_rng {
    philox4x64_key_t key;
    philox4x64_ctr_t ctr, block;
    int left; ///< numbers of the block not yet used
} bt_rng;

static inline bt_rng bt_rng_start(int64_t seed, bt_rng_purpose purpose, int64_t id)
{
    bt_rng rng = {.left = 0};
    rng.key.v[0] = (uint64_t)seed;
    rng.key.v[1] = (uint64_t)purpose;
    rng.ctr.v[0] = (uint64_t)id;
    return rng;
}

static inline uint64_t bt_rng_bits(bt_rng *rng)
{
    if (rng->left == 0) {
        rng->block = philox4x64(rng->ctr, rng->key);
        rng->ctr.v[1]++;
        rng->left = 4;
    }
    return rng->block.v[--rng->left];
}

/// Uniform in [0, 1), 53 bits.
static inline double bt_rng_uniform(bt_rng *rng) { return (double)(bt_rng_bits(rng) >> 11) * 0x1p-53; }

/// Standard normal by Box and Muller (1958); the sine twin is discarded, so that a draw always costs two numbers.
static inline double bt_rng_normal(bt_rng *rng)
{
    double u = 1 - bt_rng_uniform(rng), v = bt_rng_uniform(rng); // u in (0, 1]
    return sqrt(-2 * bt_log(u)) * bt_cos(2 * BT_PI * v);
}

/// Gamma of shape k > 0 and scale 1: Marsaglia and Tsang 2000, ACM TOMS 26.
static inline double bt_rng_gamma(bt_rng *rng, double k)
{
    if (k < 1) {
        double g = bt_rng_gamma(rng, k + 1);
        return g * bt_pow(1 - bt_rng_uniform(rng), 1 / k);
    }
    double d = k - 1.0 / 3, c = 1 / sqrt(9 * d);
    for (;;) {
        double x = bt_rng_normal(rng), v = 1 + c * x;
        if (v <= 0) continue;
        v = v * v * v;
        if (bt_log(1 - bt_rng_uniform(rng)) < 0.5 * x * x + d - d * v + d * bt_log(v)) return d * v;
    }
}

#endif
