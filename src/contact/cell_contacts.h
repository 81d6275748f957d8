// SPDX-License-Identifier: MIT
// Contacts of a cell: records, bounds, and the memory of contact laws; and how all of them pass to new cells.
//
// bt_cell.contacts [n_contacts] and .gaps hold the contacts of the step. After new labels n_contacts is 0 until the
// next detection: both arrays then have search.n_pairs entries, from which detection takes over n, impulses and
// features. While contacts are packed (bt_work_list.packed), batches use the memory of .contacts.
#ifndef BERGTOW_CELL_CONTACTS_H
#define BERGTOW_CELL_CONTACTS_H

#include "space/cells.h"
#include "space/exchange.h"

/// One manifold, in two cache lines. Batches are packed from these records (solve/batch.h), four contacts at a time,
/// line by line of four numbers; in the last cell and under rising bounds a sweep reads the record itself and writes
/// its second line. The two points lie on a line along the tangent, so both have the same tangential row. The effective
/// masses follow from the arms and the bodies (contact/row.h): forming them takes less time than reading them would, so
/// they are stored only where sweeps use them repeatedly.
typedef struct bt_contact {
    double nx, ny;         ///< normal from a to b; the tangent is (−ny, nx)
    double rat, rbt;       ///< ra×t, rb×t, m
    double ran[2], rbn[2]; ///< ra×n, rb×n of each point, m
    double bias[2];        ///< b of the normals, m/s
    double mu;
    bt_idx a, b;
    double ln[2], lt;      ///< impulse on b, N s
    int32_t n;             ///< points, 1 or 2; 0: sheets, whose impulse along x is ln[0], along y lt (contact/raft.h)
    bt_idx pair;           ///< index of its pair in the cell
} bt_contact;
_Static_assert(sizeof(bt_contact) == 128, "two cache lines; four lines of four numbers (solve/rows.h)");

/// The part of a contact that sweeps do not read.
typedef struct bt_gaps {
    double gap[2];         ///< m; from the position projection on: at the end of the step, by U2
    uint32_t feature[2];   ///< of the points
    int32_t row;           ///< bt_row_state (contact/pack.h)
} bt_gaps;

/// Bounds and records of the contact laws in a cell (contact/law.h).
typedef struct bt_law_state {
    struct bt_limit *limits;        ///< [n_contacts] bounds of the contacts; NULL where contacts are rigid
    struct bt_rise *rises;          ///< [n_contacts] their rising parts; NULL where no law has one
    /// [n_memory] records of the laws for pairs of this cell, sorted by bt_memory_by_names
    bt_memory *memory;
    /// [n_overlaps] of outlines in several polygons, where bounds have a rising part
    struct bt_shared_overlap *overlaps; // contact/bearing.c
    bt_idx cap_limits, n_memory, cap_memory, n_overlaps, cap_overlaps;
    bool rising;                    ///< some bounds have a rising part
} bt_law_state;

/// Make room for this many bytes in place of the contacts, which are lost if there was less.
void bt_cells_make_room(bt_cell *cell, size_t bytes);

/// Make room for this many bytes after the contacts, which stay but may move; returns the start of that room.
void *bt_cells_after_contacts(bt_cell *cell, size_t bytes);

/// Free the contacts, pairs and bounds of a cell whose bodies rest; the records of contact laws stay.
void bt_cells_idle(bt_cell *cell);

/// Free all cells and what they hold.
void bt_cells_empty(bt_cells *cells);

/// Comparison for qsort, by (a, b, part, law).
int bt_memory_by_names(const void *p, const void *q);
/// Append a record to the memory of a cell.
void bt_cells_remember(bt_cell *cell, const bt_memory *memory);

/// The records of this rank's own pairs, [*n]: impulses of those in contact, and the memory of contact laws. The caller
/// frees them.
bt_memory *bt_cells_take_memory(const bt_world *world, int64_t *n);
/// Collective. Restore the cells that another run left. The geometry of the cells and the labels of all bodies, which
/// every rank holds, have been set; memory [n] is that of all ranks, and is released. A domain exists, but nothing is
/// distributed yet.
void bt_cells_restore(bt_world *world, bt_memory *memory, int64_t n);

/// Collective. At the start of a step: renew labels, storage and cells if some floe has left its cell too far.
void bt_cells_begin(bt_world *world);

/// Collective. The same if the cells are too small for this margin, m. True if so: every body index has changed.
bool bt_cells_update(bt_world *world, double margin);

/// A change of the bodies that this rank holds; takes the rank's contact memory [*n] and returns the new one.
typedef bt_memory *bt_bodies_change(bt_world *world, bt_memory *memory, int64_t *n, const void *context);
/// Collective. Replace bodies by `change`, then make new labels, storage and cells. Indices change.
void bt_cells_change(bt_world *world, bt_bodies_change *change, const void *context);

#endif
