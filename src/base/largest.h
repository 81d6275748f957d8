// SPDX-License-Identifier: MIT
// The most that one input may ask for: every limit of size, in one place.
//
// A case of twenty lines can ask for more memory, disk or time than any machine has, and a damaged or hostile file for
// even more. Whatever grows with a number in an input is checked against a limit here before it begins, and refused
// with key, value, limit and remedy. The limits are choices, far above what is simulated today and below what would
// exhaust a large machine. `bergtow --list-keys` prints them.
#ifndef BT_LARGEST_H
#define BT_LARGEST_H

#include <stdio.h>


enum {
    BT_MAX_TEXT_BYTES = 16 << 20,     ///< a case or study file
    BT_MAX_TABLE_BYTES = 64 << 20,    ///< a CSV table
    BT_MAX_OUTLINE_BYTES = 1 << 30,   ///< a GeoJSON file
    BT_MAX_BASES = 16,                ///< files that a case is based on, each on the next
    BT_TREE_DEPTH = 16,                ///< nesting of a case or study
    BT_TREE_NODES = 2000000,           ///< values of one file
    BT_TREE_MAP = 256,                 ///< entries of one map
    BT_MAX_TEXT = 4096,                ///< bytes of a text value
    BT_MAX_FLOES_BY_HAND = 10000,      ///< entries of the list `floes:`
    BT_MAX_POINTS = 10000,            ///< points of a list such as tow.waypoints
    BT_MAX_VALUES = 10000,            ///< values of one parameter of a study
    BT_MAX_COMPLAINTS = 200,          ///< errors of one case that are reported
    BT_MAX_THREADS = 1024,            ///< of a rank
    BT_MAX_FLOES = 20000000,          ///< about 40 GB; also keeps bt_idx far from its limit
    BT_MAX_STEPS = 100000000,         ///< the summary keeps 200 bytes of each
    BT_MAX_FRAMES = 1000000,
    BT_MAX_ROWS = 2000000,            ///< of a CSV table
    BT_MAX_RING = 10000,              ///< vertices of one outline before it is simplified or refused
    /// characters `[` in a GeoJSON file, about one a vertex; each takes some 200 bytes if the file has to be parsed as
    /// a whole (map_features.h)
    BT_MAX_LISTS = 40000000,
};

// Smaller values are a slip of units, not ice; and products of smaller numbers leave the range of a double.
static const double BT_LEAST_CONCENTRATION = 1e-6; ///< unless there is no ice
static const double BT_LEAST_SIZE = 1e-3;          ///< mean diameter of the floes, m
static const double BT_LEAST_THICKNESS = 1e-6;     ///< m
static const double BT_MAX_RESULT_BYTES = 20e12;  ///< series and frames
static const double BT_MAX_CORE_SECONDS = 3e9;    ///< estimated work of a run: 100 years of a core

/// Print a line for each limit.
void bt_largest_print(FILE *out);

#endif
