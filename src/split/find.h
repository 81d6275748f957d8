// SPDX-License-Identifier: MIT
// Does a floe split under its loads, and along which section?
#ifndef BT_SPLIT_FIND_H
#define BT_SPLIT_FIND_H

#include "split/section.h"

/// Where the crack starts.
typedef enum {
    BT_SPLIT_NEAR = 1, ///< at a wedge that pushes it open
    BT_SPLIT_FAR,      ///< at an edge that bending stretches, most often far from the load
    BT_SPLIT_BURST,    ///< inside, across a force along the section
} bt_split_mode;

/// Why a section beyond its strength was not cut.
typedef enum {
    BT_SPLIT_ALLOWED,
    BT_SPLIT_SIZE,    ///< a piece would be narrower than the least width
    BT_SPLIT_ASPECT,  ///< a piece would be too slender
    BT_SPLIT_OUTLINE, ///< a piece would have too many vertices, or has no convex parts to rounding
} bt_split_refusal;

typedef struct bt_split {
    bt_chord chord;           ///< where to cut (bt_split_cut)
    bt_split_mode mode;
    double ratio;             ///< stress / strength there, above 1; 0 = no split
    double length;            ///< of the section, m
    int peak;                 ///< the collision it takes, a place in the sorted loads; −1 = persisting loads alone
    bt_split_refusal refused; ///< why the section with the largest ratio of those that were refused was
    double refused_ratio;     ///< its ratio, above 1; 0 = none
} bt_split;

/// The section of a floe with the largest ratio of stress to strength above 1, of those the law allows; false when
/// there is none. The loads are put into the order of (other, part, point): their order has no effect. Among sections
/// whose ratios agree to 1e-9 the first one counts. Safe in threads.
bool bt_split_find(const bt_split_floe *floe, bt_floe_load *load, int n_loads, const bt_split_law *law, bt_split *best);

/// Loads whose sizes, with their opening forces, add up to no more than this, N, split no such floe (find.c).
double bt_split_borne(const bt_split_floe *floe, const bt_split_law *law);

/// Upper bound of the ratio of every section of this length or longer, m, whichever the loads (find.c).
double bt_split_bound(const bt_split_floe *floe, const bt_load_case *loads, const bt_split_law *law, double l);

#endif
