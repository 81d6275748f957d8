// SPDX-License-Identifier: MIT
// The order in which passes go through the tiles of this rank (private to the solver).
//
// What the result depends on is only this: of two tiles that share a block, the one of lower phase comes first (tiles.h), and both have had one pass
// before either has the next. All of phase 0, then all of phase 1, ... is one such order; but then every phase reads, and writes, all
// velocities of the field, every pass all units, and threads wait for each other after each phase. Better:
//
// Steps. Rows of tiles have levels, which differ by one at most between a row and the next, and pass q visits a tile of level l and phase c in step
//     s = l + c + 4 q,
// in a step earlier passes first, and lower phases first. This keeps the order: let two tiles that share a block have levels l, l' with |l − l'| <= 1 and
// phases c < c'. In one pass l + c <= l' + c', and where these are equal the phase decides. The next pass comes to the first in step l + c + 4 (q + 1) >=
// l' − 1 + c' − 3 + 4 (q + 1) = l' + c' + 4 q, and where these are equal the pass decides. So a wave runs from where the levels are least to where they are
// greatest, and the next pass follows it four levels behind: what a sweep has brought into the cache serves the next ones as well. A level is a group of
// rows, of one row or more. The tile of the large bodies has all rows that meet its floes in one level.
//
// Bands. On one rank each thread has a band of rows, and goes through its tiles by steps. Bands are in pairs that come towards each other: levels are least where
// pairs meet pairs, and at the ends of the field, and rise from there (an odd band, the last, rises to the end). A tile whose neighbours may be another thread's first waits until these
// have had the passes that come before. There are no barriers, and what a thread has in its caches it finds there again. The share of the
// units that a band is expected to do follows the time it took in the last step (a converged tile is swept in less, cores differ).
// Where the bands of a pair meet is decided in each turn: groups about the expected place are taken by the one that comes to them first, with all their
// passes. (With a fixed place, 300,000 floes lost 8 to 12 % of a sweep there, when something had held up one thread or the other for a
// millisecond, and next to nothing where bands begin together.) Only who does what depends on it, no result.
// Only within a pair, that is: between pairs there are the shares, from step to step. A ring has an even number of bands, so with an odd number of
// threads one thread has two, of different pairs.
//
// Threads do not wait in a circle. Where the levels on both sides of a meeting are equal this is plain: each band takes its tiles in the order of
// (step, pass, phase), so of all tiles that are waited for, or not yet reached, the first in this order can be done. Where they are not:
// a tile of pass q and phase c waits only for tiles of smaller c + 4 q, or of an equal one and an earlier pass. A thread that is waited for where levels are 0 has
// yet to do a step before 4 n, n being the passes; groups that are free to be taken have level 4 n and more, and the fixed one beside them 4 n − 1, whose tiles
// of pass 0 and phase 0 wait for none. So what it waits for itself is at another place where levels agree, and earlier: a chain of waits that
// leaves a meeting does not come back to one, and within a meeting it goes to ever smaller c + 4 q. A group that nobody has taken yet is waited
// for from the step of its level on, in which a band takes it before all else. Pairs too short for free groups meet at a fixed place, with as many groups on either side.
// (With free groups from level 1 on, unit/test_order.c hangs.)
// Tried before: tiles of a step dealt to threads as they came free. Each tile was then in the other core's cache half of the time, and at 300,000 floes
// a sweep took 1.7 times the processor time on two threads that it took on one, while two programs side by side did not slow each other at all.
//
// Ranks. Others wait for the tiles at the border, whose phases and passes are in step on all ranks. A tile's level follows from its depth, in tiles from the nearest
// border tile (or from the tiles beside a large body): 0 for depths 0 and 1, and rising from there. So the border tiles of phase c
// have pass q in step c + 4 q, one exchange a step, and can be done first in it: tiles of depth 1, being of the same level, have the same phase, or another step.
// The others of the step are done while the velocities travel. The tile of the large bodies has pass q before the border in step 4 + 4 q; its exchange is not hidden.
#ifndef BERGTOW_ORDER_H
#define BERGTOW_ORDER_H

#include "bergtow/tiles.h"

/// List the tiles with work in t->order, and who does what of it in t->bands. After the units have been made.
void bt_order_tiles(bt_world *w);

/// First band of thread t, when there are n_threads; that of thread n_threads is the end.
bt_idx bt_bands_of(const bt_bands *b, bt_idx t, bt_idx n_threads);

/// Depths of all tiles from those that have depth 0; of the others it is −1 before.
void bt_order_depths(bt_tiles *t);

#endif
