// SPDX-License-Identifier: MIT
// One pass over the active tiles in the order of their phases (private to the solver).
#ifndef BERGTOW_PHASES_H
#define BERGTOW_PHASES_H

#include "bergtow/sum.h"
#include "bergtow/world.h"

enum {
    BT_MAX_TOTALS = 12,
    BT_FEW_UNITS = 700, ///< fewer units are swept faster by one thread: threads have to meet, which takes some microseconds
};

/// What a pass adds up over tiles, threads and ranks: exact sums, and one maximum.
typedef struct bt_totals {
    bt_sum sum[BT_MAX_TOTALS];
    int n_sums;
    double most;
} bt_totals;

void bt_totals_merge(bt_totals *into, const bt_totals *from);

/// Work on one tile. Only the bodies of its block, its units and *t may be changed.
typedef void bt_visit(bt_world *w, bt_idx tile, const void *context, bt_totals *t);

/// A pass: work on every tile, and what it adds up.
typedef struct bt_pass {
    bt_visit *visit;
    const void *context;
    bt_totals *totals;
    bool looks;           ///< it changes no velocity: nothing for other ranks
} bt_pass;

enum { BT_MAX_TURN = 6 }; ///< passes of a turn

/// Visit the tiles of phase 0, then those of phase 1, ...: those of one phase share no movable body and are done at once by threads and
/// ranks. After each phase, `exchanged` (an array over the bodies, or NULL) is brought up to date on all ranks, while tiles that nobody
/// waits for are still worked on. Collective.
void bt_phases_run(bt_world *w, bt_visit *visit, const void *context, bt_vel *exchanged, bt_totals *t);

/// n passes in turn, with the results of n calls of bt_phases_run; they follow each other through the field (order.h). Collective.
void bt_phases_turn(bt_world *w, const bt_pass *pass, int n, bt_vel *exchanged);

/// Visit the tiles with work in any order, all at once.
void bt_phases_any_order(bt_world *w, bt_visit *visit, const void *context, bt_totals *t);

/// Visit all tiles, also those without contacts and of other ranks, for the sake of their bodies, in any order; no totals (NULL).
void bt_phases_everywhere(bt_world *w, bt_visit *visit, const void *context);

#endif
