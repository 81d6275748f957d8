// SPDX-License-Identifier: MIT
// The order in which a pass goes through the tiles of this rank (private to the solver).
//
// What the result depends on is only that of two adjacent tiles the one of lower phase comes first (tiles.h). All of phase 0, then all of
// phase 1, ... is one such order; but then every phase reads, and writes, all velocities of the field, and where these do not fit
// into a cache that is half of the traffic of a sweep. So the tiles stand in strips of some hundred, and a strip goes
// through its phases before the next is begun: the velocities that phase 0 has read are still there in phase 3. Along y, tiles of phases
// 0 and 1 have even rows and those of 2 and 3 odd ones, whose neighbours in the row above must have been done: a strip's odd
// rows lie one lower than its even ones. Along x each phase lies one column lower than the one before.
//
// Ranks. Others wait for the tiles at the border; the phases of these are in step on all ranks. So that the inner tiles may follow in
// strips, the border is done together with a hem: in phase p, of the tiles up to 3 − p from the border. An inner tile of phase p beside the hem
// has all neighbours of lower phase behind it, and none of higher phase. The strips run while the last phase's velocities travel.
#ifndef BERGTOW_ORDER_H
#define BERGTOW_ORDER_H

#include "bergtow/tiles.h"

/// List the tiles with work in t->order, cut into t->run. After the units have been made.
void bt_order_tiles(bt_world *w);

/// Distance of each tile from the border, after tile->border has been set.
void bt_order_measure(bt_tiles *t);

#endif
