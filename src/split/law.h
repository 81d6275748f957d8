// SPDX-License-Identifier: MIT
// The law of splitting: the loads on a floe, the strength of its ice, and the limits of the law.
//
// Strength with a size effect. The strength of a long section follows from linear elastic fracture mechanics, K:
// toughness; that of a short one is the strength σ_t of ice without a crack:
//     σ_c(l) = σ_t / sqrt(1 + l/l0),   l0 = (c K / σ_t)²,   so that σ_c → c K/√l for l ≫ l0.
// c = 0.75 where a pair of forces opens the mouth of the crack: in a free square the force has its maximum, 0.187 h K
// √l, at a crack length of 0.145 l, a nominal stress of 4 × 0.187 K/√l.
// c = 1.4 elsewhere: an edge crack, or a buried crack, of that length under bending stress.
#ifndef BT_SPLIT_LAW_H
#define BT_SPLIT_LAW_H

#include "bergtow/base.h"

/// One contact of a floe, as the floe feels it.
typedef struct bt_floe_load {
    double x, y;           ///< point relative to the centroid, m
    double fx, fy;         ///< force on the floe, N
    double length;         ///< w on which it acts, along the floe's edge, m
    double edge_x, edge_y; ///< unit vector along the floe's edge there; of any sign
    double opening;        ///< each force of the pair by which a wedge opens the floe along the edge, N; 0 = none
    bt_gid other;          ///< the other body
    int part, point;       ///< which contact of the two bodies it is
    bool collision;        ///< the peak of a collision: acts beside the persisting loads, but not beside another peak
} bt_floe_load;

typedef struct bt_split_law {
    double toughness;   ///< K, Pa √m
    double strength;    ///< σ_t of ice without a crack, Pa
    double least_width; ///< least width of a piece anywhere, m
    double aspect;      ///< largest length / width of a piece, unless its parent had more
    double slop;        ///< shorter lengths count as 0: an end of a section this near a vertex moves to it, m
} bt_split_law;

enum { BT_SPLIT_CONTACTS = 8 }; ///< number of contacts of a floe, the largest, that give sections

/// σ_c, Pa, of a section of length l, m, against an opening pair (`pair`) or any other stress.
double bt_split_strength(const bt_split_law *law, double l, bool pair);

/// Factor of a floe on the strength: Weibull with this modulus and median 1,
///     (−ln u / ln 2)^(1/modulus),   u uniform of (seed, ancestor, path) alone.
/// ancestor: the generated floe from which it comes; path: 1 for that floe, for a piece twice the path of its parent,
/// plus one for the smaller piece. Returns 1 for modulus 0.
double bt_split_scatter(int64_t seed, bt_gid ancestor, int64_t path, double modulus);

/// Work of fracture of a section, K² (1 − ν²)/E h l, J, with E = 5 GPa and ν = 0.3 of full-scale ice.
double bt_split_work(double toughness, double thickness, double l);

/// Opening force F_y of a pair, N, that splits a free square floe of side l, m, through its middle.
double bt_split_opening_load(const bt_split_law *law, double thickness, double l);
/// Three-point load, N, that splits the same floe: a force at the middle of a side, supports at the ends of the
/// opposite side.
double bt_split_three_point_load(const bt_split_law *law, double thickness, double l);

/// F_x / F_y of a wedge of half angle φ, rad, pressed into an edge with the force F_x, friction μ:
/// 2 (tan φ + μ)/(1 − μ tan φ); 0 where it does not open: μ tan φ ≥ 1.
double bt_split_wedge(double phi, double mu);

#endif
