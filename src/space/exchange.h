// SPDX-License-Identifier: MIT
// Operations that space needs from the division among ranks: a table that partition/ fills in when a world is divided.
//
// Space is below the division: it knows that some cells and bodies may be elsewhere, but not how they get there. On one
// rank there is no table (world->exchange == NULL).
#ifndef BERGTOW_EXCHANGE_H
#define BERGTOW_EXCHANGE_H

#include "space/cells.h"

/// The record of a pair under permanent names, part of the state of the world. contact/law.h gives the numbers their
/// meaning; here they are only moved with the pair.
typedef struct bt_memory {
    bt_gid a, b;
    uint16_t part[2];    ///< as in bt_pair
    int32_t n_points;
    uint32_t feature[2]; ///< of the points
    double value[4];     ///< rigid: impulses as in bt_contact (ln, lt), N s; other laws: see there
    uint16_t law;        ///< number of the law (contact/law.h); 0, rigid: impulses of the last step
} bt_memory;

typedef struct bt_exchange {
    /// Collective. Maxima of x [n] over the ranks.
    void (*maxima)(const bt_world *world, double *x, int n);
    /// Does this rank own the contacts of cell (x, y)? And those of the large movable bodies?
    bool (*owns_cell)(const bt_world *world, int32_t x, int32_t y);
    bool (*owns_large)(const bt_world *world);
    /// End the run if the ranks do not exchange the floes of cell (x, y), which a large body of this rank may meet.
    void (*need)(const bt_world *world, int32_t x, int32_t y);
    /// Is a new division due?
    bool (*due)(const bt_world *world);
    /// Collective. After labelling: choose owners, move bodies (owned and ghosts) and contact memory to where they
    /// belong now. Takes and returns the memory.
    bt_memory *(*migrate)(bt_world *world, bt_memory *memory, int64_t *n);
    /// Collective. After the cells have been made: find out what to exchange with which rank.
    void (*connect)(bt_world *world);
    /// After a phase: send the changes of its border cells in v (an array over the bodies), and receive the others'.
    void (*send)(bt_world *world, int phase, bt_vel *v);
    void (*receive)(bt_world *world, int phase, bt_vel *v);
} bt_exchange;

#endif
