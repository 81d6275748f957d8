// SPDX-License-Identifier: MIT
// Strength of ice against splitting, its scatter, and the work of fracture.
#include "split/law.h"
#include "base/rng.h"

#include <math.h>

static const double PAIR_FACTOR = 0.75, FACTOR = 1.4; // c of law.h
static const double YOUNG = 5e9, POISSON = 0.3;           // of full-scale sea ice, assumed; 2 to 6 GPa are in use

double bt_split_strength(const bt_split_law *law, double l, bool pair)
{
    // sqrt(l/l0) and not l/l0: a toughness without limit, to switch fracture off, must not overflow.
    const double x = law->strength * sqrt(l) / ((pair ? PAIR_FACTOR : FACTOR) * law->toughness);
    return law->strength / sqrt(1 + x * x);
}

double bt_split_scatter(int64_t seed, bt_gid ancestor, int64_t path, double modulus)
{
    if (!(modulus > 0)) return 1;
    bt_rng rng = bt_rng_start(seed, BT_RNG_SPLIT, ancestor);
    rng.ctr.v[2] = (uint64_t)path;
    const double u = 1 - bt_rng_uniform(&rng); // in (0, 1]
    return bt_pow(-bt_log(u) / bt_log(2), 1 / modulus);
}

double bt_split_work(double toughness, double thickness, double l)
{
    return toughness * toughness * (1 - POISSON * POISSON) / YOUNG * thickness * l;
}

double bt_split_opening_load(const bt_split_law *law, double thickness, double l)
{
    return bt_split_strength(law, l, true) * thickness * l / 4;
}

double bt_split_three_point_load(const bt_split_law *law, double thickness, double l)
{
    return bt_split_strength(law, l, false) * thickness * l / 1.5;
}

double bt_split_wedge(double phi, double mu)
{
    const double slope = bt_tan(phi), rest = 1 - mu * slope;
    return rest > 0 ? 2 * (slope + mu) / rest : 0;
}
