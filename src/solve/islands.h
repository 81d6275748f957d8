// SPDX-License-Identifier: MIT
// Islands of movable bodies that touch each other, over ranks too (private to the solver).
//
// An island is named by the gid of a body in it, that of its root. Where islands of several ranks meet in a body that
// both hold, the names belong together: every rank gathers these few (name here, name there) links and joins them by
// the same union-find; sums of islands that reach over ranks are added as exact sums, so it does not matter which of
// its bodies names an island.
#ifndef BERGTOW_ISLANDS_H
#define BERGTOW_ISLANDS_H

#include "bergtow/sum.h"
#include "bergtow/world.h"
#include "space/cells.h"

typedef struct bt_islands {
    bt_idx *root;  ///< [n bodies] union-find of the movable bodies that touch
    bt_gid *name;  ///< [n bodies] at the roots: gid of a body of the island, the same on all ranks
    double *share; ///< [n bodies] at the roots: a number of the island, 1 at first
    /// [n bodies] at the roots: sums over this rank's part of the island, and by bt_islands_add over all of it
    bt_sum *sum;
    bt_idx cap;
} bt_islands;

bt_islands *bt_islands_create(void);
void bt_islands_free(bt_islands *s);

/// Collective. Join the bodies of all contacts of this step that `joins` takes (NULL: of all).
void bt_islands_make(bt_world *w, bt_islands *s, bool (*joins)(const bt_cell *cell, bt_idx contact));

/// Root of the island of a movable body.
bt_idx bt_islands_root(bt_islands *s, bt_idx body);
/// The same of a contact with at least one movable body.
bt_idx bt_islands_of(const bt_world *w, bt_islands *s, const bt_contact *u);

/// Sums of all islands to 0.
void bt_islands_clear(const bt_world *w, bt_islands *s);
/// Collective. Sums over this rank's part of each island to sums over the island.
void bt_islands_add(const bt_world *w, bt_islands *s);

#endif
