// SPDX-License-Identifier: MIT
// The bodies of a world as the recorder names them.
#ifndef BERGTOW_ROSTER_H
#define BERGTOW_ROSTER_H

#include "bergtow/base.h"

/// What the recorder wants to know of the bodies beside their outlines.
typedef struct bt_roster {
    bt_idx n_floes;         ///< generated or read, then given by hand
    double *thickness;      ///< [n bodies] m; draft + sail of the towed body, 0 for walls
    const char **names;     ///< [n bodies − n_floes]
    double mean_size;       ///< mean equivalent diameter of the floes, m
    bt_idx n_free;          ///< floes generated or read, which move freely; those given by hand may be fixed
} bt_roster;

/// Release what a roster holds.
void bt_roster_free(bt_roster *r);

#endif
