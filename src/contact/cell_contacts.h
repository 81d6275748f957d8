// SPDX-License-Identifier: MIT
// Contacts of a cell: records, bounds, and the memory of contact laws; and how all of them pass to new cells.
//
// bt_cell.contacts [n_contacts] and .gaps hold the contacts of the step. New labels leave none until the next
// detection: then both arrays have search.n_pairs entries, and detection takes over their n, impulses and features.
// While contacts are packed (bt_work_list.packed), batches use the memory of .contacts.
#ifndef BERGTOW_CELL_CONTACTS_H
#define BERGTOW_CELL_CONTACTS_H

#include "space/cells.h"
#include "space/exchange.h"

/// One manifold, in two cache lines: what batches are packed from (solve/batch.h), four contacts at a time, each a line
/// of four numbers after the other; in the last cell and under rising bounds a sweep reads it itself, and writes the
/// second line. Its two points are on a line along the tangent, so both have the same tangential row. Its effective
/// masses follow from the arms and the bodies (contact/row.h): they are formed where they are used, which takes less
/// time than reading them would, and are not kept but where sweeps need them again and again.
typedef struct bt_contact {
    double nx, ny;         ///< normal from a to b; the tangent is (−ny, nx)
    double rat, rbt;       ///< ra×t, rb×t, m
    double ran[2], rbn[2]; ///< ra×n, rb×n of each point, m
    double bias[2];        ///< b of the normals, m/s
    double mu;
    bt_idx a, b;
    double ln[2], lt;      ///< impulse on b, N s
    int32_t n;             ///< points, 1 or 2; 0: sheets, whose impulse along x is ln[0], along y lt (contact/raft.h)
    bt_idx pair;           ///< its pair in the cell
} bt_contact;
_Static_assert(sizeof(bt_contact) == 128, "two cache lines; four lines of four numbers (solve/rows.h)");

/// What the sweep does not see of it.
typedef struct bt_gaps {
    double gap[2];         ///< m; from the position projection on those that U2 leaves at the end of the step
    uint32_t feature[2];   ///< of the points
    int32_t row;           ///< bt_row_state (contact/pack.h)
} bt_gaps;

/// What contact laws bound and remember in a cell (contact/law.h).
typedef struct bt_law_state {
    struct bt_limit *limits;        ///< [n_contacts] bounds of the contacts; NULL where contacts are rigid
    struct bt_rise *rises;          ///< [n_contacts] their rising parts; NULL where no law has one
    /// [n_memory] what laws remember of pairs of this cell, sorted by bt_memory_by_names
    bt_memory *memory;
    bt_idx cap_limits, n_memory, cap_memory;
    bool rising;                    ///< some bounds have a rising part
} bt_law_state;

/// Room for so many bytes in place of the contacts, which are lost if there was less.
void bt_cells_make_room(bt_cell *cell, size_t bytes);

/// Room for so many bytes after the contacts, which stay but may be moved; returns where it begins.
void *bt_cells_after_contacts(bt_cell *cell, size_t bytes);

/// Give back the memory beyond that of the contacts, which are not packed.
void bt_cells_rest(bt_cells *cells);

/// Take from a cell whose bodies rest what a step needs for its contacts; what contact laws remember stays.
void bt_cells_idle(bt_cell *cell);

/// Free what the cells hold; none is left.
void bt_cells_empty(bt_cells *cells);

/// In the order of (a, b, part, law).
int bt_memory_by_names(const void *p, const void *q);
/// Append a record to the memory of a cell.
void bt_cells_remember(bt_cell *cell, const bt_memory *memory);

/// Impulses of the pairs in contact, and what contact laws remember of pairs, that this rank owns, [*n]; the caller
/// frees.
bt_memory *bt_cells_take_memory(const bt_world *world, int64_t *n);
/// Collective. Cells as another run left them: their geometry and the labels of all bodies, which every rank holds,
/// have been set, and the memory [n], which is released, is that of all ranks. A domain has been created, but
/// nothing is distributed yet.
void bt_cells_restore(bt_world *world, bt_memory *memory, int64_t n);

/// Collective. At the start of a step: renew labels, storage and cells if some floe has left its cell too far.
void bt_cells_begin(bt_world *world);

/// Collective. The same if the cells are too small for this margin, m. True when renewed: every index of a body has
/// changed.
bool bt_cells_update(bt_world *world, double margin);

/// What is done to the bodies that this rank holds, and to its memory of contacts [*n], which it takes and returns.
typedef bt_memory *bt_bodies_change(bt_world *world, bt_memory *memory, int64_t *n, const void *context);
/// Collective. New labels, storage and cells after bodies have been put in the place of others. Indices change.
void bt_cells_change(bt_world *world, bt_bodies_change *change, const void *context);

#endif
