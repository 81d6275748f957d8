// SPDX-License-Identifier: MIT
// One pass over the active cells in the order of their phases (for the folders above src/space).
//
// The result depends only on this rule: of two cells that share a body, the one of lower phase comes first (cells.h),
// and a pass ends before the next begins. So each thread goes through phase 0, then phase 1, ..., and before it visits
// a cell it waits for those of its eight neighbours that come first (bt_turn). Threads synchronise only at the end of
// the pass: around a berg a phase has some ten cells, and a barrier after each would leave one thread idle for half a
// cell five times per sweep. There is no deadlock: a thread waits only for cells of lower phases, which other threads
// have taken. Border cells and inner cells of a phase form one stretch each. Each thread has a share of every stretch:
// neighbouring cells with its part of the work, the same until the next residual pass, so that their data are still in
// its caches; a thread that has finished takes cells from other shares. With several ranks threads do synchronise after
// each stretch: the border cells of a phase come first, and their velocities travel while the inner cells are
// processed.
//
//     phase 0 (colour 0)       phase 1            ...   phase 4 (large bodies)
//     border cells | inner     border | inner           one rank
//     ------------>|           ------>|
//        send      |...receive   send |...receive       send, receive
//     thread 0  ====  ======    ===    =====            ==
//     thread 1  ====  =====x    ===    ====xx           (waits)      x: a cell of another thread's share
//
// Invariant: cells of one phase have no movable body in common, so that their visits commute, and every body is visited
// in the same order as in the plain schedule, the reference: phase after phase, cell after cell, by one thread
// (solver.plain_schedule).
//
// Rejected: passes that follow each other through the field without barriers, so that one reuses the data that the
// other has read. After every sweep there is a decision for the whole field (rounds.h), so the next pass cannot begin
// earlier.
#ifndef BERGTOW_PHASES_H
#define BERGTOW_PHASES_H

#include "bergtow/sum.h"
#include "bergtow/world.h"

enum {
    BT_MAX_TOTALS = 28,
    /// one thread sweeps fewer contacts faster: a team costs 2 µs, a contact some 14 ns
    BT_FEW_CONTACTS = 350,
};

/// Totals of a pass over cells and threads, and by bt_domain_reduce over ranks (not most2): exact sums, and maxima.
typedef struct bt_totals {
    bt_sum sum[BT_MAX_TOTALS];
    int n_sums;
    double most, most2;
} bt_totals;

/// Work on one cell. Only the bodies of its block, its contacts and *totals may be changed.
typedef void bt_visit(bt_world *world, bt_idx cell, const void *context, bt_totals *totals);

/// List the cells of this rank with work in t->order, by phase, and distribute them to threads. After the contacts have
/// been made.
void bt_phases_order(bt_world *world);

/// After new lists: assign the cells to threads by their listed contacts, and put those with a list first. No result
/// depends on it.
void bt_phases_distribute(bt_world *world);

/// The cells of a pass: all with work, or those that sweeps change, with listed contacts or a line.
typedef enum { BT_WITH_WORK, BT_LISTED } bt_which;

/// A visit before the pass, for the bodies: in any order, of all busy cells or those whose bodies sweeps may move, also
/// cells without contacts and cells of other ranks; without totals (NULL).
typedef struct bt_before {
    bt_visit *visit;
    const void *context;
} bt_before;

/// Collective. After the visits `before` (or NULL), visit the cells of phase 0, then phase 1, ...: those of one phase
/// share no movable body and are processed in parallel by threads and ranks. After each phase, `exchanged` (an array
/// over the bodies, or NULL) is updated on all ranks, while other cells are still being processed.
void bt_phases_run(bt_world *world, bt_which which, const bt_before *before, bt_visit *visit, const void *context,
                   bt_vel *exchanged, bt_totals *totals);

/// Visit the cells with work in any order, in parallel.
void bt_phases_any_order(bt_world *world, bt_visit *visit, const void *context, bt_totals *totals);

/// Visit cells [n] of a list in any order; up to `few` cells are left to one thread. Totals are of this rank only.
void bt_phases_listed(bt_world *world, const bt_idx *list, bt_idx n, bt_idx few, bt_visit *visit, const void *context,
                      bt_totals *totals);

/// The same with all busy cells.
void bt_phases_busy(bt_world *world, bt_visit *visit, const void *context, bt_totals *totals);

#endif
