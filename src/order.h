// SPDX-License-Identifier: MIT
// The order in which passes go through the tiles of this rank (private to the solver).
//
// What the result depends on is only this: of two tiles that share a block, the one of lower phase comes first (tiles.h), and both have had one pass
// before either has the next. All of phase 0, then all of phase 1, ... is one such order; but then every phase reads, and writes, all
// velocities of the field, every pass all units, and threads wait for each other after each phase. Two things do better.
//
// Steps. Rows of tiles have levels, which differ by one at most between a row and the next, and pass q visits a tile of level l and phase c in step
//     s = l + c + 4 q,
// in a step earlier passes first, and lower phases first. This keeps the order: let two tiles that share a block have levels l, l' with |l − l'| <= 1 and
// phases c < c'. In one pass l + c <= l' + c', and where these are equal the phase decides. The next pass comes to the first in step l + c + 4 (q + 1) >=
// l' − 1 + c' − 3 + 4 (q + 1) = l' + c' + 4 q, and where these are equal the pass decides. So a wave runs from where the levels are least to where they are
// greatest, and the next pass follows it four levels behind: what a sweep has brought into the cache serves the next ones as well. Levels may
// rise and fall at will, around a periodic direction too; a level is one row or more. The tile of the large bodies has all
// rows that meet its floes in one level.
//
// Bands. Each thread has a band of rows, of a share of the units that follows the time it took in the last step (a converged tile is swept in less, cores
// differ; only who does what depends on it, no result), and goes through its tiles by steps. A tile at the border of its band first waits until
// its neighbours beyond have had the passes that come before. There are no barriers, and what a thread has in its caches it finds there again. No
// two threads can wait for each other: each takes its tiles in the order of (step, pass, phase), so of all tiles that are
// waited for, or not yet reached, the first in this order can be done. Levels are least at every other border and rise from there to
// both sides: there two bands begin together, at the others they end together, and between they do not meet.
// Tried before: tiles of a step dealt to threads as they came free. Each tile was then in the other core's cache half of the time, and at 300,000 floes
// a sweep took 1.7 times the processor time on two threads that it took on one, while two programs side by side did not slow each other at all.
//
// Ranks. Others wait for the tiles at the border; the phases of these are in step on all ranks. So that the inner tiles may follow in
// steps, the border is done together with a hem: in phase p, of the tiles up to 3 − p from the border. An inner tile of phase p beside the hem
// has all neighbours of lower phase behind it, and none of higher phase. The inner tiles are done while the last phase's velocities travel.
#ifndef BERGTOW_ORDER_H
#define BERGTOW_ORDER_H

#include "bergtow/tiles.h"

/// List the tiles with work in t->order, cut into t->run (ranks) or t->bands (one rank). After the units have been made.
void bt_order_tiles(bt_world *w);

/// Distance of each tile from the border, after tile->border has been set.
void bt_order_measure(bt_tiles *t);

#endif
