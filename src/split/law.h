// SPDX-License-Identifier: MIT
// What makes a floe split: the loads on it, the strength of its ice, and what the law allows.
//
// Strength with a size effect. A long section is as strong as linear elastic fracture mechanics says, K its toughness;
// a short one as strong as the ice without a crack, σ_t:
//     σ_c(l) = σ_t / sqrt(1 + l/l0),   l0 = (c K / σ_t)²,   so that σ_c → c K/√l for l ≫ l0.
// c = 0.75 where a pair of forces opens the mouth of the crack: in a free square its force is largest at a crack of
// 0.145 l, 0.187 h K √l, a nominal stress of 4 × 0.187 K/√l.
// c = 1.4 elsewhere: an edge crack, or a buried one, of that length under the stress of bending.
#ifndef BT_SPLIT_LAW_H
#define BT_SPLIT_LAW_H

#include "bergtow/base.h"

/// One contact of a floe, as the floe feels it.
typedef struct bt_floe_load {
    double x, y;           ///< point relative to the centroid, m
    double fx, fy;         ///< force on the floe, N
    double length;         ///< w that it acts on, along the floe's edge, m
    double edge_x, edge_y; ///< unit vector along the floe's edge there; of any sign
    double opening;        ///< each force of the pair by which a wedge opens the floe along the edge, N; 0 = none
    bt_gid other;          ///< the other body
    int part, point;       ///< which contact of the two bodies it is
    bool collision;        ///< the peak of a collision: acts beside the persisting loads, but not beside another peak
} bt_floe_load;

typedef struct bt_split_law {
    double toughness;   ///< K, Pa √m
    double strength;    ///< σ_t of ice without a crack, Pa
    double least_width; ///< a piece must be as wide everywhere, and a section as long, m
    double aspect;      ///< largest length / width of a piece, unless its parent had more
    double slop;        ///< lengths below it are none: ends of a section move to a vertex so near, m
} bt_split_law;

enum { BT_SPLIT_CONTACTS = 8 }; ///< sections are looked for from so many contacts of a floe, the largest

/// σ_c of a section of length l, m, against a pair that opens it (or any other stress), Pa.
double bt_split_strength(const bt_split_law *law, double l, bool pair);

/// Share of the strength that a floe has: Weibull of this modulus and median 1,
///     (−ln u / ln 2)^(1/modulus),   u uniform of (seed, ancestor, path) alone.
/// ancestor: the generated floe that it was part of; path: 1 for that floe, twice its parent's for the larger piece of
/// a floe, and one more for the other. modulus 0: 1.
double bt_split_scatter(int64_t seed, bt_gid ancestor, int64_t path, double modulus);

/// Work of fracture of a section, K² (1 − ν²)/E h l, J, with E = 5 GPa and ν = 0.3 of full-scale ice.
double bt_split_work(double toughness, double thickness, double l);

/// Opening pair F_y and three-point load (a force at the middle of a side, held at the ends of the other) that split a
/// free square floe of side l through its middle, N.
double bt_split_opening_load(const bt_split_law *law, double thickness, double l);
/// See bt_split_opening_load.
double bt_split_three_point_load(const bt_split_law *law, double thickness, double l);

/// F_x / F_y of a wedge of half angle φ that is pressed into an edge with F_x, friction μ:
/// 2 (tan φ + μ)/(1 − μ tan φ); 0 where it does not open: μ tan φ ≥ 1.
double bt_split_wedge(double phi, double mu);

#endif
