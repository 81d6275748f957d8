// SPDX-License-Identifier: MIT
// Anderson acceleration of the sweeps (private to the solver).
//
// Anderson 1965, J. ACM 12; Walker & Ni 2011, SIAM J. Numer. Anal. 49, type II. A sweep is a fixed-point map x → g(x) of the impulses:
//     f_k = g(x_k) − x_k,   γ = argmin |f_k − ΔF γ|,   x_{k+1} = g(x_k) − ΔG γ
// with the last m differences of f and g as columns of ΔF and ΔG, and |f|² = Σ W f² (J). On a linear problem this is GMRES on
// the fixed-point map, whether or not that map is symmetric (a Gauss–Seidel sweep is not; conjugate gradients around
// it need 10 to 100 times the sweeps on long chains and on heavy bodies, see heavy_body_squeezes_a_row in tests/physics).
//
// Velocities are linear in the impulses, so the velocities of x_{k+1} are the same combination, v(g_k) − ΔV γ: each body has its own
// columns ΔV, and no impulse need be applied again.
//
// Order-free sums. The scalar products steer the solver, so they must have the same bits for any number of threads and ranks. Each
// tile forms its part in plain arithmetic, in the order of its units, which is the same everywhere; the tiles' parts are added in
// 128-bit fixed point (bergtow/sum.h).
//
// Only every third sweep is recorded and followed by a move; the two between are plain (as in alternating Anderson–Jacobi, Pratapa &
// Suryanarayana 2016, J. Comput. Phys. 306). Differences over three sweeps point as well as those over one, and the
// bookkeeping, which costs more than a sweep, is a third. In fields larger than the caches it is every sixth: the history and the velocities
// are read from memory half as often, which outweighs the slower convergence. 300,000 floes, compression-95: 174 sweeps a step with every
// third, 196 with every fourth, 214 with every sixth, 257 with every ninth; time a step 1, 0.90, 0.80, 0.82.
//
// The contact problem is only piecewise smooth, so: when |f|² has grown tenfold over its best, the columns describe another
// piece and are dropped; when it has grown a million-fold in one step, the step is also taken back. A γ beyond
// 10⁶ (columns nearly dependent) drops the columns as well. Where |f| has not halved in 30 recorded sweeps, contacts open and close, stick
// and slip by turns as the moves throw them about (a heavy body that presses light floes against a wall): then tiles are swept twice as
// often in their turn, and again, up to 32 times. Over 144 such rows (mass ratios to 10⁴, friction 0 to 0.5, tolerances to
// 10⁻⁷ m/s) that took the steps beyond 1,000 sweeps from 116 to 3 of 4,320. Tried without profit: long rests with plain sweeps,
// other depths (1 to 12), depths that change, over-relaxation, sweeps in both directions.
#ifndef BERGTOW_ANDERSON_H
#define BERGTOW_ANDERSON_H

#include "bergtow/tiles.h"
#include "bergtow/tow.h"
#include "phases.h"

enum { BT_ANDERSON_EVERY = 3, BT_ANDERSON_EVERY_FAR = 6 }; ///< sweeps from one that is recorded to the next; in large fields
#define BT_ANDERSON_DEPTH 4 // 6 to 16 need fewer sweeps on smooth problems, but stall on sticking and slipping heavy chains

/// One scalar unknown with its history: a branch of the tow line.
typedef struct bt_anderson_scalar {
    double f_before, g_before, df[BT_ANDERSON_DEPTH], dg[BT_ANDERSON_DEPTH];
} bt_anderson_scalar;

typedef struct bt_anderson {
    // this iteration
    bool has_column;           ///< f and g are there of the iteration before too: their differences are a new column
    int column;                ///< its place
    // over the iterations
    int depth, head;           ///< columns in use, next to be replaced
    int every;                 ///< one sweep of so many is recorded
    int wait;                  ///< plain sweeps before the next that is recorded
    int rest;                  ///< more of them after the next drop
    int stalled;               ///< recorded sweeps since |f| was halved
    int effort;                ///< tiles are swept 2^effort times as often in their turn
    double mark;               ///< |f|² when it was last halved
    bool started;              ///< f and g of the iteration before are kept
    double best, before;       ///< least |f|² since the last drop, and that of the iteration before
    double scale;              ///< power of two that the sums are multiplied by
    double gram[BT_ANDERSON_DEPTH][BT_ANDERSON_DEPTH];
    double gamma[BT_ANDERSON_DEPTH];
    bt_anderson_scalar line[BT_MAX_BRANCHES];
} bt_anderson;

typedef enum {
    BT_ANDERSON_STAY, ///< x_{k+1} = g(x_k)
    BT_ANDERSON_MOVE, ///< x_{k+1} = g(x_k) − ΔG γ
    BT_ANDERSON_BACK, ///< the last move was bad: x_{k+1} = g(x_{k−1})
} bt_anderson_verdict;

/// Start a new iteration. energy: J, the order of |f|² of one unit at convergence; sets the quantum of the sums. Of `every` sweeps one is recorded.
void bt_anderson_start(bt_anderson *a, double energy, int every);

/// Sweeps up to and with the next that is recorded.
static inline int64_t bt_anderson_period(const bt_anderson *a) { return 1 + a->wait; }

/// Before each sweep: is it to be recorded? Then t is ready for its sums.
bool bt_anderson_begin(bt_anderson *a, bt_totals *t);

/// Room in a tile for the histories of its units and bodies.
void bt_anderson_reserve(bt_tile *tile, bool units);

/// Before the sweep of a tile: ask memory for its history, which is there when the sweep is done.
void bt_anderson_fetch(const bt_tile *tile);

/// After the sweep of a tile: x [n_units][3] are its impulses before it, and scratch after; weight [n_units][3] is scratch. Adds the
/// tile's part of the scalar products to *t.
void bt_anderson_collect(const bt_anderson *a, bt_tile *tile, double *x, double *weight, bt_totals *t);

/// The same for one scalar unknown: value x before the sweep, g after it; weight: its W.
void bt_anderson_collect_scalar(const bt_anderson *a, bt_anderson_scalar *s, double x, double g, double weight, bt_totals *t);

/// From the totals over all tiles: what to do.
bt_anderson_verdict bt_anderson_decide(bt_anderson *a, const bt_totals *t);

/// Carry the verdict out: on the impulses of a tile's units, on one scalar (returns its new value), and on the velocities of a tile's
/// bodies, whose history is kept at the same time (so it is called after every recorded sweep, whatever the verdict).
void bt_anderson_move_units(const bt_anderson *a, bt_anderson_verdict v, bt_tile *tile);
double bt_anderson_moved(const bt_anderson *a, bt_anderson_verdict v, const bt_anderson_scalar *s, double g);
void bt_anderson_move_bodies(const bt_anderson *a, bt_anderson_verdict v, bt_tile *tile, bt_vel *vel);

#endif
