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
// The contact problem is only piecewise smooth, so: when |f|² has grown tenfold over its best, the columns
// describe another piece and are dropped; when it has grown a million-fold in one step, the step is also taken back. A γ beyond
// 10⁶ (columns nearly dependent) drops the columns as well. And where |f| has not halved in 150 iterations, extrapolation may undo
// what sweeps achieve, for ever (seen: two points of an edge, one of them about to let go, which plain sweeps settle in 300): a
// long rest follows, 150, 300, 600... sweeps. After each drop a few sweeps stay plain, 0, 1, 3, 7, 15.
#ifndef BERGTOW_ANDERSON_H
#define BERGTOW_ANDERSON_H

#include "bergtow/tiles.h"
#include "phases.h"

#define BT_ANDERSON_DEPTH 4 // 6 to 16 need fewer sweeps on smooth problems, but stall on sticking and slipping heavy chains

/// One scalar unknown with its history: the tow line.
typedef struct bt_anderson_scalar {
    double f_before, g_before, df[BT_ANDERSON_DEPTH], dg[BT_ANDERSON_DEPTH];
} bt_anderson_scalar;

typedef struct bt_anderson {
    // this iteration
    bool recording;            ///< f and g are kept (no plain iteration of a rest)
    bool has_column;           ///< and their differences to the iteration before are a new column
    int column;                ///< its place
    // over the iterations
    int depth, head;           ///< columns in use, next to be replaced
    int rest, next_rest;       ///< plain iterations left now, and after the next drop
    int stalled, long_rest;    ///< iterations since |f| was halved, plain iterations when that takes too long
    double mark;               ///< |f|² at the last halving
    bool started;              ///< f and g of the iteration before are kept
    double best, before;       ///< least |f|² since the last drop, and that of the iteration before
    double scale;              ///< power of two that the sums are multiplied by
    double gram[BT_ANDERSON_DEPTH][BT_ANDERSON_DEPTH];
    double gamma[BT_ANDERSON_DEPTH];
    bt_anderson_scalar line;
} bt_anderson;

typedef enum {
    BT_ANDERSON_STAY, ///< x_{k+1} = g(x_k)
    BT_ANDERSON_MOVE, ///< x_{k+1} = g(x_k) − ΔG γ
    BT_ANDERSON_BACK, ///< the last move was bad: x_{k+1} = g(x_{k−1})
} bt_anderson_verdict;

/// Start a new iteration. energy: J, the order of |f|² of one unit at convergence; sets the quantum of the sums.
void bt_anderson_start(bt_anderson *a, double energy);

/// Before each sweep; returns how many sums it will fill.
int bt_anderson_begin(bt_anderson *a);

/// Room in a tile for the histories of its units and bodies.
void bt_anderson_reserve(bt_tile *tile, bool units);

/// After the sweep of a tile: x [n_units][3] are its impulses before it. Adds the tile's part of the scalar products to *t.
void bt_anderson_collect(const bt_anderson *a, bt_tile *tile, const double *x, bt_totals *t);

/// The same for one scalar unknown: value x before the sweep, g after it; weight: its W.
void bt_anderson_collect_scalar(const bt_anderson *a, bt_anderson_scalar *s, double x, double g, double weight, bt_totals *t);

/// From the totals over all tiles: what to do.
bt_anderson_verdict bt_anderson_decide(bt_anderson *a, const bt_totals *t);

/// Carry the verdict out: on the impulses of a tile's units, on one scalar (returns its new value), and on the velocities of a tile's
/// bodies, whose history is kept at the same time (so it is called in every recording iteration, whatever the verdict).
void bt_anderson_move_units(const bt_anderson *a, bt_anderson_verdict v, bt_tile *tile);
double bt_anderson_moved(const bt_anderson *a, bt_anderson_verdict v, const bt_anderson_scalar *s, double g);
void bt_anderson_move_bodies(const bt_anderson *a, bt_anderson_verdict v, bt_tile *tile, bt_vel *vel, const bt_inv *inv);

#endif
