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
// Turns. Several passes may go through the strips one behind the other: a pass is on strip s while the next is on strip s − 2, done at the same
// time, for two passes two strips apart have no body in common. So what a sweep has brought into the cache serves the next ones
// as well, and threads meet a sixth as often. What a body sees is still all of the first pass, then all of the second. Columns lie
// askew, so a strip of them is two pairs wide at least; of rows one pair will do. The tile of the large bodies comes after a strip, so all tiles that meet
// its floes are made one strip.
//
// Ring. Around a periodic y row 0 comes before the last row, which is odd, so a pass that begins with strip 0 must end with its
// lowest odd row, and no pass could follow another before that is done. But a pass may begin anywhere: pass q begins with strip
// 2q, without the lowest odd row of this strip (its seam), goes around, and ends with strip 2q − 1 and that row.
//
// Ranks. Others wait for the tiles at the border; the phases of these are in step on all ranks. So that the inner tiles may follow in
// strips, the border is done together with a hem: in phase p, of the tiles up to 3 − p from the border. An inner tile of phase p beside the hem
// has all neighbours of lower phase behind it, and none of higher phase. The strips run while the last phase's velocities travel.
#ifndef BERGTOW_ORDER_H
#define BERGTOW_ORDER_H

#include "bergtow/tiles.h"

/// List the tiles with work in t->order, cut into t->run (ranks) or t->strip (one rank). After the units have been made.
void bt_order_tiles(bt_world *w);

/// Distance of each tile from the border, after tile->border has been set.
void bt_order_measure(bt_tiles *t);

#endif
