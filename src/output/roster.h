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
    bt_gid n_kept;          ///< ids for pieces of floes, from n_free on
} bt_roster;

/// Row of a body among those that were there from the start, in the order of their ids; −1: it is a piece of a floe.
static inline bt_gid bt_roster_row(const bt_roster *r, bt_gid gid)
{
    return gid < r->n_free ? gid : gid < r->n_free + r->n_kept ? -1 : gid - r->n_kept;
}

/// Release what a roster holds.
void bt_roster_free(bt_roster *r);

#endif
