// SPDX-License-Identifier: MIT
// Listed contacts of a cell in batches of four that share no body, swept with vector instructions.
//
//     contacts   [0] [1] [2] [3] [4] [5] ...      a contact a row; half of them bear no load and are not listed
//     list     0       2   3       5  ...
//     batch   {0 2 5 9} {3 7 8 11} ...         an array of vectors each: nx of four contacts, ny of four, ...
//
// A sweep goes through the batches of a cell in sequence, and updates the four contacts of each at once: as they share
// no body that can be moved, that is the same as one after the other. So the order of a cell's updates is that of its
// batches, the same everywhere.
//
// Vectors are the compiler's (four doubles each): IEEE arithmetic, element by element, without contraction, whatever
// instructions it is translated to. So the bits do not depend on the processor; on x86-64 the sweep exists twice, for
// AVX2 and for any, and the loader takes the one that fits. The scalar update of src/solve/kernel.h remains for
// contacts with a large body, which share it, and for bounds with a rising part (src/solve/limit.h). A batch holds
// contacts of one kind: without bounds, with flat ones, or sheets (contact/raft.h).
//
// Packing happens before the first sweep over a new list. Batches take the place of the records, in the memory of the
// contacts, for both together would be a third of all memory of dense ice; the records of what is not listed stand
// after them. Residual passes look at the contacts in either form, and take apart the batches of a cell whose list has
// changed. The records are put back before anybody else looks at the contacts. What an unknown was before the last
// sweep then stands after the records until the next list is packed: a contact that was in no batch was not moved, for
// otherwise it would have been listed.
#ifndef BERGTOW_BATCH_H
#define BERGTOW_BATCH_H

#include "solve/rounds.h"

/// Are the contacts of this cell swept in batches?
bool bt_batch_is_for(const bt_cell *cell);

/// Bytes that a sweep goes through for a contact of the cell: its part of a full batch and the velocities of both
/// bodies, or its record and all that is hot of them.
size_t bt_batch_bytes(const bt_cell *cell);

/// The cell has a new problem, and no batches yet.
void bt_batch_begin(bt_cell *cell);

/// Apply all impulses of a packed cell to its bodies; contacts that are in no batch have none.
void bt_batch_apply(const bt_cell *cell, bt_vel *v);

/// What a residual pass finds in the cell; it lists the contacts to be swept.
bt_found bt_batch_residual(bt_cell *cell, const bt_vel *v, const bt_inv *inv, const bt_problem *problem);

/// One visit of a sweep to the cell: its move, and at most `times` passes, each over what the one before has not left
/// calm.
void bt_batch_sweep(bt_cell *cell, bt_vel *v, const bt_inv *inv, const bt_sweep *sweep, int times, bt_totals *totals);

/// The contacts again, with their impulses; nothing when they are there.
void bt_batch_unpack(bt_cell *cell);

#endif
