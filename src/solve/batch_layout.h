// SPDX-License-Identifier: MIT
// What batches are made of (private to src/solve/batch*.c): the vectors of one, what stands after them, and what
// outlives them.
#ifndef BERGTOW_BATCH_LAYOUT_H
#define BERGTOW_BATCH_LAYOUT_H

#include "solve/batch.h"
#include "solve/rows.h"

/// Up to so many contacts, what a thread needs for a visit to a cell is on its stack: nearly all cells, which have some
/// sixty.
enum { BT_FEW = 128 };

typedef enum { BT_BATCH_RIGID, BT_BATCH_BOUNDED, BT_BATCH_SHEETS } bt_batch_kind;

/// Names as in bt_contact and bt_mass; lanes without a contact are zero. It is all there is of its contacts while they
/// are packed.
typedef struct bt_batch {
    bt_vec nx, ny, ran[2], rbn[2], rat, rbt, w[2], w12, mn[2], per_det, wt, mt, bias[2], mu;
    bt_vec ma, ia, mb, ib;  // inverse masses and moments of inertia of a and b
    bt_vec x[3], before[3]; // impulses: now, before the last sweep
    bt_idx a[BT_LANES], b[BT_LANES], contact[BT_LANES], pair[BT_LANES];
    bool moves_a[BT_LANES], moves_b[BT_LANES];
    uint8_t points[BT_LANES], n, kind;
} bt_batch;
_Static_assert(sizeof(bt_batch) == 32 * sizeof(bt_vec), "the listed contacts of dense ice, 256 bytes each");

/// bt_limit.ends of sheets, which have one point and so neither of the two.
#define BT_ENDS_X w12
#define BT_ENDS_Y per_det

/// Of the normals; [0] of sheets: of their friction. After the batches of a cell whose contacts have bounds.
typedef struct bt_batch_bounds {
    bt_vec of[2];
} bt_batch_bounds;

/// How many sweeps a batch rests after its last update; of these to come, and done. Apart from the batches, for a sweep
/// reads more of these than batches.
typedef struct bt_rest {
    uint8_t in_all, to_come, done;
} bt_rest;

/// Of one contact: unknowns before the last sweep.
typedef struct bt_unknowns {
    double before[3];
    bt_idx contact;
} bt_unknowns;

/// The listed contacts of a cell into batches of sweeps.
void bt_batch_pack(bt_cell *cell, const bt_inv *inv);

/// After the batches of a packed cell: [n_batches] what they rest, and the records of the contacts in none, ascending.
bt_rest *bt_batch_rests(const bt_cell *cell);
bt_contact *bt_batch_others(const bt_cell *cell);

#endif
