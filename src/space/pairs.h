// SPDX-License-Identifier: MIT
// The pair list of one cell (for the folders above src/space).
#ifndef BERGTOW_PAIRS_H
#define BERGTOW_PAIRS_H

#include "base/named.h"
#include "space/cells.h"
#include "space/shore.h"

/// Scratch memory of one thread.
typedef struct bt_pair_scratch {
    double *box;          ///< [6][cap_boxes] x, y and the box about them: low x, low y, high x, high y, m
    bt_idx *body;         ///< [cap_boxes]
    size_t cap_boxes;
    bt_pair *found;       ///< [cap_found]
    size_t cap_found;
    bt_named *name;       ///< [2][cap_names] of the pairs found
    size_t cap_names;
    bt_shore_list shore;  ///< polygons near a body
} bt_pair_scratch;

/// Renew the list of cell k, kept in `cell`, unless it is valid for this margin, m.
void bt_pairs_update(bt_world *world, bt_idx k, bt_cell *cell, double margin, bt_pair_scratch *scratch);

/// Are the near pairs of cell k valid for this margin, m? If not, clear them and store the present paths; they have to
/// be found anew.
bool bt_pairs_near(const bt_world *world, bt_idx k, bt_cell *cell, double margin);
/// A pair is near if its gap exceeds the margin by less than this, m.
double bt_pairs_near_gap(const bt_world *world);
void bt_pairs_add_near(bt_cell *cell, bt_idx i);

void bt_pair_scratch_free(bt_pair_scratch *scratch);

/// Cells (unwrapped coordinates) that the box of body i covers, widened by pad, m.
typedef struct bt_cell_range { int32_t x0, x1, y0, y1; } bt_cell_range;
bt_cell_range bt_pairs_range(const bt_world *world, bt_idx i, double pad);

#endif
