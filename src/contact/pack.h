// SPDX-License-Identifier: MIT
// From the manifolds of a cell to the contacts that the sweeps work on (private to detection and solver).
#ifndef BERGTOW_PACK_H
#define BERGTOW_PACK_H

#include "contact/contacts.h"
#include "space/cells.h"

/// State of a row by the relative motion of its pair (contact/contacts.h).
typedef enum {
    BT_ROW_STAYS,    ///< touching, or restored after release
    BT_ROW_OPEN,     ///< apart by more than the slop: it can be released
    BT_ROW_RELEASED, ///< the two pass each other
    BT_ROW_PASSING, BT_ROW_CONFIRMED, ///< OPEN and loaded, within a review (contact/passing.c)
} bt_row_state;

/// Data that a contact passes to its successor.
typedef struct bt_held {
    int32_t n;           ///< points, 0 = there was none
    uint32_t feature[2];
    double ln[2], lt;    ///< N s
    int32_t row;         ///< bt_row_state
} bt_held;

/// Manifolds of one cell, in the order of its pairs; one scratch per thread.
typedef struct bt_pack_scratch {
    bt_manifold *man; ///< [n]
    bt_idx *pair;     ///< [n] which pair
    bt_idx *place;    ///< [n] index of its contact in the cell
    bt_held *held;    ///< [n] contact of that pair in the step before
    uint8_t *colour;  ///< [n]
    size_t n, cap;
    uint64_t *used;   ///< colours taken at each body of the block
    size_t cap_used;
} bt_pack_scratch;

/// Make room for n manifolds, with none kept yet.
void bt_pack_begin(bt_pack_scratch *scratch, size_t n);
/// Place for the next manifold, of pair i; it is kept once the caller increments n.
static inline bt_manifold *bt_pack_next(bt_pack_scratch *scratch, bt_idx i)
{
    scratch->pair[scratch->n] = i;
    return &scratch->man[scratch->n];
}
/// Make the contacts of cell k from the manifolds kept, with the impulses of their predecessors (0 without warm start).
void bt_pack_contacts(bt_world *world, bt_idx k, bt_pack_scratch *scratch);
void bt_pack_scratch_free(bt_pack_scratch *scratch);

/// Set the normal and arms of a contact from its manifold.
void bt_pack_rows(const bt_world *world, const bt_manifold *manifold, bt_contact *contact);

/// Set the normal biases of a contact with these gaps; share: factor on the restitution.
void bt_pack_bias(const bt_world *world, bt_contact *contact, const bt_gaps *gaps, double share);

/// Set the row state of contact j of the cell, and its bias.
void bt_pack_set_row(const bt_world *world, bt_cell *cell, bt_idx j, bt_row_state state);

#endif
