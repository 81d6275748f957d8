// SPDX-License-Identifier: MIT
// One pass over the active cells in the order of their phases (for the folders above src/space).
//
// What the result depends on is only this: of two cells that share a body, the one of lower phase comes first
// (cells.h), and a pass ends before the next begins. So each thread goes through phase 0, then phase 1, ..., and before
// it visits a cell it waits for those of the eight around it that come first (bt_turn). Threads meet at the end of the
// pass only: around a berg a phase is some ten cells, and a barrier after each would leave one thread idle for half a
// cell five times a sweep. No thread waits for ever: a cell that is waited for has been taken by a thread that waits
// for lower phases alone. Border cells and inner cells of a phase are a stretch each. Each thread has a share of every
// stretch: neighbouring cells with its part of the work, the same from one residual pass to the next, so that it finds
// in its caches what it left there; a thread that is done takes cells from the others' shares. Among ranks threads do
// meet after each stretch: the cells of a phase for which others wait come first, and their velocities travel while the
// rest is worked on.
//
//     phase 0 (colour 0)       phase 1            ...   phase 4 (large bodies)
//     border cells | inner     border | inner           one rank
//     ------------>|           ------>|
//        send      |...receive   send |...receive       send, receive
//     thread 0  ====  ======    ===    =====            ==
//     thread 1  ====  =====x    ===    ====xx           (waits)      x: a cell of another thread's share
//
// Invariant: cells of one phase have no movable body in common, so that their visits commute, and every body sees the
// same visits in the same order as in the plain schedule: phase after phase, cell after cell, by one thread
// (solver.plain_schedule), which is the reference.
//
// Rejected: passes that follow each other through the field without barriers, so that what one has read from memory
// serves the next. After every sweep there is a decision for the whole field (rounds.h), so that there is no next pass
// to go on with.
#ifndef BERGTOW_PHASES_H
#define BERGTOW_PHASES_H

#include "bergtow/sum.h"
#include "bergtow/world.h"

enum {
    BT_MAX_TOTALS = 28,
    /// fewer contacts are swept faster by one thread: a team costs 2 µs, and a contact some 14 ns
    BT_FEW_CONTACTS = 350,
};

/// What a pass adds up over cells and threads, and bt_domain_reduce over ranks (not most2): exact sums, and maxima.
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

/// After new lists: assign the cells to threads by the contacts that are listed in them, and put those with a list
/// first. No result depends on it.
void bt_phases_distribute(bt_world *world);

/// The cells of a pass: all with work, or those that sweeps change: with listed contacts, or a line.
typedef enum { BT_WITH_WORK, BT_LISTED } bt_which;

/// What a pass does first, in any order, with all busy cells, or those whose bodies sweeps may move, for the sake of
/// their bodies: also with cells without contacts and of other ranks; no totals (NULL).
typedef struct bt_before {
    bt_visit *visit;
    const void *context;
} bt_before;

/// Collective. After what comes before it (or NULL), visit the cells of phase 0, then those of phase 1, ...: those of
/// one phase share no movable body and are done at once by threads and ranks. After each phase, `exchanged` (an array
/// over the bodies, or NULL) is brought up to date on all ranks, while the other cells are still worked on.
void bt_phases_run(bt_world *world, bt_which which, const bt_before *before, bt_visit *visit, const void *context,
                   bt_vel *exchanged, bt_totals *totals);

/// Visit the cells with work in any order, all at once.
void bt_phases_any_order(bt_world *world, bt_visit *visit, const void *context, bt_totals *totals);

/// Visit cells [n] of a list in any order; not more than `few` are left to one thread. Totals are of this rank only.
void bt_phases_listed(bt_world *world, const bt_idx *list, bt_idx n, bt_idx few, bt_visit *visit, const void *context,
                      bt_totals *totals);

/// The same with all busy cells.
void bt_phases_busy(bt_world *world, bt_visit *visit, const void *context, bt_totals *totals);

#endif
