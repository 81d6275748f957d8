// SPDX-License-Identifier: MIT
// Memory layout of batches (private to src/solve/batch*.c): the vectors of a batch, the data after all batches, and the
// data that outlives them.
#ifndef BERGTOW_BATCH_LAYOUT_H
#define BERGTOW_BATCH_LAYOUT_H

#include "solve/batch.h"
#include "solve/rows.h"

/// Up to this many contacts, the scratch for a visit to a cell is on the stack: nearly always, as cells have about
/// sixty.
enum { BT_FEW = 128 };

typedef enum { BT_BATCH_RIGID, BT_BATCH_BOUNDED, BT_BATCH_SHEETS } bt_batch_kind;

/// Names as in bt_contact and bt_mass; lanes without a contact are zero. It is the only copy of packed contacts.
typedef struct bt_batch {
    bt_vec nx, ny, ran[2], rbn[2], rat, rbt, w[2], w12, mn[2], per_det, wt, mt, bias[2], mu;
    bt_vec ma, ia, mb, ib;  // inverse masses and moments of inertia of a and b
    bt_vec x[3], before[3]; // impulses: now, before the last sweep
    bt_idx a[BT_LANES], b[BT_LANES], contact[BT_LANES], pair[BT_LANES];
    bool moves_a[BT_LANES], moves_b[BT_LANES];
    uint8_t points[BT_LANES], n, kind;
} bt_batch;
_Static_assert(sizeof(bt_batch) == 32 * sizeof(bt_vec), "the listed contacts of dense ice, 256 bytes each");

/// bt_limit.ends of sheets, in two members that only contacts with two points use.
#define BT_ENDS_X w12
#define BT_ENDS_Y per_det

/// Bounds of the normal impulses; for sheets [0] bounds their friction. They follow the batches of a cell whose
/// contacts have bounds.
typedef struct bt_batch_bounds {
    bt_vec of[2];
} bt_batch_bounds;

/// The sweeps for which a batch rests after its last update: in all, to come, and done. Stored apart from the batches,
/// because a sweep reads more of these than batches.
typedef struct bt_rest {
    uint8_t in_all, to_come, done;
} bt_rest;

/// The unknowns of one contact before the last sweep.
typedef struct bt_unknowns {
    double before[3];
    bt_idx contact;
} bt_unknowns;

/// Pack the listed contacts of a cell into batches.
void bt_batch_pack(bt_cell *cell, const bt_inv *inv);

/// The data after the batches of a packed cell: [n_batches] their rests; and the records of contacts in no batch,
/// ascending.
bt_rest *bt_batch_rests(const bt_cell *cell);
bt_contact *bt_batch_others(const bt_cell *cell);

#endif
