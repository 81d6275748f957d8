// SPDX-License-Identifier: MIT
// Panel loads over a window whose start is known only when the run ends (private to the recorder).
//
//     | early steps: block 0 | block 1 | block 2 | ...        the window begins with one of the blocks 1, 2, ...
//     0                   earliest
//
// From the earliest start on the steps are summed up in blocks as long as the possible starts lie apart
// (bergtow/stats.h): 5 steps in a run of up to 20,480. When there would be more than BT_STATS_STARTS, two and two
// become one. Memory, and share of a checkpoint: at most 4097 × 32 B a panel, 4.7 MB for 36. Rejected: all steps (1.2
// kB each, without a bound); a sum that begins anew when the start that is found moves, which it also does backwards.
#ifndef BT_PANEL_BLOCKS_H
#define BT_PANEL_BLOCKS_H

#include "loads/panel.h"

/// Loads of several steps on one panel. Numbers only: a row of the checkpoint.
typedef struct bt_panel_loads {
    double fx, fy, normal; ///< sums over the steps, N
    double most;           ///< largest normal of a step, N
} bt_panel_loads;

typedef struct bt_panel_blocks {
    int n;                 ///< panels
    int64_t steps;         ///< counted from the earliest start on
    bt_panel_loads *load;  ///< [blocks][n]
    int64_t cap;           ///< blocks there is room for
} bt_panel_blocks;

void bt_panel_blocks_init(bt_panel_blocks *b, int n);
void bt_panel_blocks_free(bt_panel_blocks *b);

/// Rows of `load` after so many steps: a row a panel for each block, the early one included.
int64_t bt_panel_blocks_rows(const bt_panel_blocks *b, int64_t steps);

/// Take the loads of a step. early: it ends before the earliest start.
void bt_panel_blocks_add(bt_panel_blocks *b, const bt_panel *panel, bool early);

/// What was saved: `steps`, and load[bt_panel_blocks_rows], which is taken over.
void bt_panel_blocks_restore(bt_panel_blocks *b, int64_t steps, bt_panel_loads *load);

/// Into before[n] and within[n]: the steps before and in the window that begins `first` steps after the earliest start.
/// first: a multiple of bt_stats_start_step(steps), or `steps`, where there is no window.
void bt_panel_blocks_reduce(const bt_panel_blocks *b, int64_t first, bt_panel_loads *before, bt_panel_loads *within);

#endif
