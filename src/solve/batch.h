// SPDX-License-Identifier: MIT
// Listed contacts of a cell in batches of four that share no body, swept with vector instructions.
//
//     contacts   [0] [1] [2] [3] [4] [5] ...      one record per contact; half bear no load and are not listed
//     list     0       2   3       5  ...
//     batch   {0 2 5 9} {3 7 8 11} ...         an array of vectors each: nx of four contacts, ny of four, ...
//
// A sweep goes through the batches of a cell in sequence, and updates the four contacts of each at once: as they share
// no movable body, this equals updating them one after the other. So the order of a cell's updates is that of its
// batches, the same everywhere.
//
// Vectors are the compiler's (four doubles each): IEEE arithmetic, element by element, without contraction, whatever
// the instructions. So the bits do not depend on the processor; on x86-64 the sweep exists twice, with and without
// AVX2, and the loader chooses. The scalar update of src/solve/kernel.h remains for contacts with a large body, which
// they all share, and for bounds with a rising part (src/solve/limit.h). A batch holds contacts of one kind: without
// bounds, with flat ones, or sheets (contact/raft.h).
//
// Packing happens before the first sweep over a new list. Batches replace the records in the memory of the contacts,
// since both together would be a third of all memory in dense ice; the records of unlisted contacts follow them.
// Residual passes read the contacts in either form, and unpack the batches of a cell whose list has changed. The
// records are restored before any other code reads the contacts. The unknowns before the last sweep then stand after
// the records until the next list is packed: a contact in no batch has not changed, or it would have been listed.
#ifndef BERGTOW_BATCH_H
#define BERGTOW_BATCH_H

#include "solve/rounds.h"

/// Are the contacts of this cell swept in batches?
bool bt_batch_is_for(const bt_cell *cell);

/// Bytes that a sweep reads per contact of the cell: its part of a full batch, or its record with its masses and the
/// inverse masses of both bodies; and both velocities.
size_t bt_batch_bytes(const bt_cell *cell);

/// Start a new problem in the cell, without batches.
void bt_batch_begin(bt_cell *cell);

/// Apply all impulses of a packed cell to its bodies; contacts that are in no batch have none.
void bt_batch_apply(const bt_cell *cell, bt_vel *v);

/// Residual pass over the cell: list the contacts to be swept, and return the totals.
bt_found bt_batch_residual(bt_cell *cell, const bt_vel *v, const bt_inv *inv, const bt_problem *problem);

/// One visit of a sweep to the cell: extrapolate, then make at most `times` passes, each over the batches that the
/// previous pass has not left calm.
void bt_batch_sweep(bt_cell *cell, bt_vel *v, const bt_inv *inv, const bt_sweep *sweep, int times, bt_totals *totals);

/// The records of the contacts of a cell [n_contacts]: its own, or, if it is packed, those written to `copy`. Batches
/// stay, and so do the rests, which an unpacking in the middle of the sweeps would end.
const bt_contact *bt_batch_read(const bt_cell *cell, bt_contact *copy);

/// Restore the records of the contacts, with their impulses; does nothing if the cell is not packed.
void bt_batch_unpack(bt_cell *cell);

#endif
