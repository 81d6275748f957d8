// SPDX-License-Identifier: MIT
// The pair list of one cell (for the folders above src/space).
#ifndef BERGTOW_PAIRS_H
#define BERGTOW_PAIRS_H

#include "base/named.h"
#include "space/cells.h"
#include "space/shore.h"

/// Room that one thread works in.
typedef struct bt_pair_scratch {
    double *box;          ///< [6][cap_boxes] x, y and the box about them: low x, low y, high x, high y, m
    bt_idx *body;         ///< [cap_boxes]
    size_t cap_boxes;
    bt_pair *found;       ///< [cap_found]
    size_t cap_found;
    bt_named *name;       ///< [2][cap_names] of those found
    size_t cap_names;
    bt_shore_list shore;  ///< polygons near a body
} bt_pair_scratch;

/// Make the list of cell k, kept in `cell`, anew unless it holds for this margin.
void bt_pairs_update(bt_world *world, bt_idx k, bt_cell *cell, double margin, bt_pair_scratch *scratch);

/// Do the near pairs of cell k hold for this margin? If not, they are to be found anew: clears them, and keeps what has
/// moved by now.
bool bt_pairs_near(const bt_world *world, bt_idx k, bt_cell *cell, double margin);
/// Pair i is near when it has less than this between its bodies beyond the margin, m.
double bt_pairs_near_gap(const bt_world *world);
void bt_pairs_add_near(bt_cell *cell, bt_idx i);

void bt_pair_scratch_free(bt_pair_scratch *scratch);

/// Cells (unwrapped coordinates) that the box of body i covers, widened by pad, m.
typedef struct bt_cell_range { int32_t x0, x1, y0, y1; } bt_cell_range;
bt_cell_range bt_pairs_range(const bt_world *world, bt_idx i, double pad);

#endif
