// SPDX-License-Identifier: MIT
// Does a floe split under its loads, and along which section?
#ifndef BT_SPLIT_FIND_H
#define BT_SPLIT_FIND_H

#include "split/section.h"

/// Where the crack starts.
typedef enum {
    BT_SPLIT_OPENED = 1, ///< at a wedge that pushes it open
    BT_SPLIT_BENT,      ///< at an edge under bending tension, mostly far from the load
    BT_SPLIT_BURST,    ///< inside, across a force along the section
} bt_split_mode;

/// Why a section beyond its strength was not cut.
typedef enum {
    BT_SPLIT_ALLOWED,
    BT_SPLIT_SIZE,    ///< a piece would be narrower than the least width
    BT_SPLIT_ASPECT,  ///< a piece would be too slender
    BT_SPLIT_OUTLINE, ///< a piece would have too many vertices, or no convex parts within rounding
} bt_split_refusal;

typedef struct bt_split {
    bt_chord chord;           ///< where to cut (bt_split_cut)
    bt_split_mode mode;
    double ratio;             ///< stress / strength there, above 1; 0 = no split
    double length;            ///< of the section, m
    int peak;                 ///< index in the sorted loads of the collision involved; −1 = persisting loads alone
    bt_split_refusal refused; ///< why the refused section with the largest ratio was refused
    double refused_ratio;     ///< its ratio, above 1; 0 = none
} bt_split;

/// Find the section of a floe with the largest ratio of stress to strength above 1, among those that the law allows;
/// false if there is none. The loads are sorted by (other, part, point), so their order has no effect. Of sections
/// whose ratios agree to 1e-9 the first counts. Thread-safe.
bool bt_split_find(const bt_split_floe *floe, bt_floe_load *load, int n_loads, const bt_split_law *law, bt_split *best);

/// Loads whose sizes, with their opening forces, add up to at most this, N, cannot split the floe (find.c).
double bt_split_borne(const bt_split_floe *floe, const bt_split_law *law);

/// Upper bound of stress / strength under these loads for every section of this length, m, or longer (find.c).
double bt_split_bound(const bt_split_floe *floe, const bt_load_case *loads, const bt_split_law *law, double l);

#endif
