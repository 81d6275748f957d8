// SPDX-License-Identifier: MIT
// Rounds of sweeps with momentum over the contacts that matter (private to the solver): the same iteration for contacts
// and for the position projection.
//
// Half and more of the contacts of a jam bear no load and open: their update changes nothing. So a residual pass over
// all contacts finds the largest residual and lists, cell by cell, the contacts that bear load or close; a round of
// sweeps then covers the lists only; at the next residual pass, contacts that have opened leave the lists and contacts
// that have closed enter them.
//
// Between two sweeps of a round all unknowns are extrapolated along their last change (Nesterov 1983, Soviet Math.
// Dokl. 27; Beck & Teboulle 2009, SIAM J. Imaging Sci. 2; for contacts Mazhar et al. 2015, ACM Trans. Graph. 34):
//     x_{k+1} = sweep(y_k),   y_{k+1} = x_{k+1} + β (x_{k+1} − x_k),
//     β = min(cap, (θ_k − 1)/θ_{k+1}),   θ_{k+1} = (1 + √(1 + 4 θ_k²))/2
// and where the sweep turned against the move, Σ W (y_k − x_{k+1}) (x_{k+1} − x_k) > 0, it starts anew with θ = 1, β =
// 0 (O'Donoghue & Candès 2015, Found. Comput. Math. 15). Velocities are linear in the impulses: those of y are the same
// combination, so each body needs only its previous velocity, no impulse is applied again, and ghosts, which have the
// same velocities, are moved alike without communication.
//
// A round ends early once an update is small: no more than 0.7 of the tolerance. The residual of a contact is the
// change by its own exact solution, with its neighbours held; along a slowly moving chain it is a few times the update,
// by a nearly constant factor. So while the residual is too large, the update that ends a round is lowered by that
// factor, at most to a half at a time. Otherwise each of the next rounds would be one sweep without momentum between
// two residual passes (the most expensive step at 95 % took 80 such rounds).
//
// A batch of contacts (batch.h) whose update is no more than 0.3 of the tolerance is calm. It rests in the next sweep,
// and after each further calm update for twice as many sweeps plus one, at most three: most of a jam is calm long
// before its last contacts. Momentum moves its bodies meanwhile, so its unknowns have to follow, at its next update:
// moves by β₁, β₂, … without updates between them amount to x + (β₁ + β₁β₂ + …) (x − x₋). The last sweep of a round
// updates all batches, because extrapolation alone may leave tension, or friction outside its cone. At 80 to 95 % this
// saves a third of the updates, for a tenth more sweeps. Resting whole cells saves half of that; rests of up to seven
// sweeps, and other thresholds, are no better.
//
// Momentum continues from round to round: a contact that leaves or enters the lists, and a floe newly reached by them,
// starts without it. It restarts after velocities have been formed from the impulses, and before and after a round over
// a part of the field.
//
// The problem is only piecewise smooth, and a Gauss–Seidel sweep is not a gradient step: with a fixed cap some jams run
// in circles (contacts that open and close, or stick and slip, in turn). So the cap is adapted to its gain. If some
// rounds reduce the sum of squares enough (GAIN in rounds.c, where the other numbers are, too), the cap moves nearer to
// 1 and rounds become longer; otherwise its distance from 1 grows, down to no momentum. If that does not help either,
// rounds of many sweeps (FREE_LENGTH) follow without a cap: chains of many floes, and heavy bodies that press on light
// ones, are slow rather than circling, and converge only with β near 1 (a row of 5 floes under 10⁴ times their mass:
// 13,000 sweeps, where plain ones need more than 500,000). A problem that has not converged within the limit of work
// gets some more without momentum, since momentum that does not converge circles far from the solution. If the residual
// is still FAR above the tolerance, the iteration restarts with half of the work, at most twice.
//
// A jam that does not converge within its work wanders: its residual rises and falls by a factor of ten. So the
// unknowns of the best residual pass are kept, from half of the work on, and are the result.
//
// When only few contacts are far from the tolerance, every second round covers only the cells around them.
//
// The limit is on work: updates and residuals of contacts, plus a cost per sweep, so that sweeps over a few contacts
// end, too.
//
// Order-free decisions. Cells form their parts of the sums in plain arithmetic, in the order of their contacts, which
// is the same everywhere; the parts are added in 128-bit fixed point (bergtow/sum.h). So every decision is the same for
// any number of threads and ranks.
//
// Rejected: Anderson acceleration around the sweep, over all contacts or the listed ones (0.6 to 1.8 times the time of
// the plain sweep in dense ice; histories of 240 B per contact and 96 B per floe, against 24 B per listed contact and
// 32 B per floe here); over-relaxation (1.3 helps without momentum and hurts with it); momentum with a separate step
// for each cell or contact; sweeps in alternating direction; proximal Newton steps over the listed contacts (M + Jᵀ D J
// of the velocities, unsymmetric where contacts slide, factorised by nested dissection): two of them finish a jam with
// a handful of contacts left, but where a wedge drives its impulses up over thousands of sweeps, a Newton step takes as
// long as a hundred sweeps, and the wedge needs one step for each contact that changes its state. At equal work more
// steps missed the tolerance with them than without. Extrapolation of two rounds of plain sweeps along their difference
// (Aitken; it shrinks by 2 % a round): contacts change their state all along that way, and the rounds after it are back
// where they started. Going back to the best unknowns whenever the residual has risen: more steps missed. Every round
// over a part of the field while few contacts are bad, not every second: where walls close on 100,000 floes it saves a
// third of the updates, around a berg in 90 and 95 % ice it takes 4 to 6 % more, and 1.6 to 1.8 times the sweeps. A
// coarse level over clusters of cells: what grows with the size of a field is the number of hard spots (from 30,000 to
// 100,000 floes between the same walls, 5.3 to 8.4 updates of a contact in a step, half of them in rounds with fewer
// than 40 bad contacts), and these are smaller than a cluster.
#ifndef BERGTOW_ROUNDS_H
#define BERGTOW_ROUNDS_H

#include <stdlib.h>

#include "contact/row.h"
#include "space/cells.h"
#include "space/phases.h"

/// Totals of a residual pass; the largest residual is `most`. CHECKS: contacts whose residual was computed.
enum {
    BT_RESIDUAL_SQUARES, BT_RESIDUAL_ROWS, BT_RESIDUAL_CONTACTS, BT_RESIDUAL_CHECKS, BT_RESIDUAL_LISTED,
    BT_RESIDUAL_BAD, BT_RESIDUAL_N
};
/// What has happened since the last residual pass: the problem is new; only sweeps over the lists, after which the
/// residual of a cell with no body moved is unchanged; or velocities are to be formed anew.
typedef enum { BT_BEGINS, BT_SWEPT, BT_SETTLES } bt_since;
/// Totals of a sweep; the largest update is `most`.
enum { BT_SWEEP_AGAINST, BT_SWEEP_UPDATES, BT_SWEEP_MOVED, BT_SWEEP_N };

#define BT_NEAR 0.7 // share of the tolerance: an update that ends a round, and a residual that is not bad

/// Action on the unknowns of the best residual pass.
typedef enum { BT_KEEP, BT_PUT_BACK, BT_FORGET } bt_keeping;

/// The problem to iterate.
typedef struct bt_problem {
    bt_visit *residual;   ///< list the contacts of a cell (bt_rounds_list), report its residual (_found); context: this
    bt_visit *sweep;      ///< sweep the list of a cell, after its move; context: bt_sweep
    bt_visit *keep;       ///< keep the unknowns of a cell, put them back, or forget them; context: bt_keeping. Or NULL
    void (*settle)(bt_world *world); ///< velocities anew from the impulses, or NULL
    bt_vel *vel;          ///< [n bodies] moved by the sweeps
    struct bt_tow *line;  ///< swept after the last cell, or NULL
    double tolerance;     ///< of the residual
    double per_square;    ///< factor on sums of squares, see bt_sum
    double most_squares;  ///< of one cell, times that
    double per_energy;    ///< factor on products of moves
    double cap;           ///< of the momentum at the start
    int length;           ///< sweeps of a round at the start
    double limit;         ///< of the work, in updates of every contact; plain: in sweeps
    /// Is it proved that there is no solution? It ends the rounds. Collective, leaves all as it is; or NULL
    bool (*refuted)(bt_world *world);
    bool plain;           ///< sweeps over all contacts, without momentum
} bt_problem;

#define BT_ENOUGH 0.3 // share of the tolerance: a batch with smaller updates is calm
enum { BT_REST = 3 }; // the most sweeps for which a calm batch rests

/// A sweep, as the cells see it.
typedef struct bt_sweep {
    const bt_problem *problem;
    bool moves;           ///< store the unknowns before the sweep, and add up BT_SWEEP_AGAINST
    double beta;          ///< extrapolation factor before it
    bool all;             ///< none rests
    /// by the number of sweeps that a batch has rested: extrapolation factors of x, and of its value before the last
    /// sweep
    double lead[BT_REST + 1], lag[BT_REST + 1];
} bt_sweep;

/// Work done.
typedef struct bt_work {
    int64_t sweeps;
    int64_t updates;      ///< of contacts
    int64_t moves;        ///< of contacts by momentum
    int64_t checks;       ///< residuals of contacts computed
    // by the last residual pass
    double residual;      ///< largest
    double squares;       ///< sum over the rows
    int64_t rows, contacts, listed, bad;
} bt_work;

/// Set the scales of the exact sums from the tolerance of the residual, the largest mass and the number of cells.
void bt_rounds_scale(bt_problem *problem, const bt_cells *t);

/// Extra data of a contact that is swept in place and not in a batch.
typedef struct bt_in_place {
    bt_mass mass;
    double before[3];     ///< unknowns before the last sweep
} bt_in_place;

/// Result of a residual pass over a cell.
typedef struct bt_found {
    double most, squares;
    int64_t rows, bad;    ///< bad: contacts far from the tolerance
} bt_found;

/// The contacts of a cell that are swept: cell->n_listed of them.
typedef struct bt_work_list {
    bt_idx *list;                   ///< [n_listed] ascending
    double (*best)[3];              ///< [n_contacts] unknowns of the best residual pass while kept, else NULL
    bt_idx cap_list;
    bt_in_place *in_place;          ///< [n_contacts] stored after the contacts if swept in place, else unset
    /// The listed contacts are in batches (solve/batch.h), and the cell has no contacts but those. In the memory of the
    /// contacts: [n_batches], and after them the records of the contacts that are not listed
    bool packed;
    struct bt_batch *batch;
    bt_idx n_batches;
    /// [n_last] if not packed: unknowns of the last listed contacts for the next list, stored after the contacts
    struct bt_unknowns *last;
    bt_idx n_last;
    bt_found found;                 ///< by the last residual pass that looked at the cell
    bt_idx found_listed;            ///< the number of contacts that it listed
    bool kept;                      ///< swept in a round over a part of the field
    bool still;                     ///< sweeps could not move its bodies in the last round: no momentum
} bt_work_list;

/// Make the work lists of the cells after new labels, all empty.
void bt_rounds_begin(bt_world *world);

/// Free the work lists of all cells.
void bt_rounds_free_lists(struct bt_solver *solver);

/// Give a cell an empty list with room for all its contacts; a residual pass calls this first.
void bt_rounds_list(bt_cell *cell);

/// Form the effective masses of the contacts of a cell that will be swept in place.
void bt_rounds_in_place(bt_cell *cell, const bt_inv *inv);

/// Collective. Residual pass over all contacts; writes the residual and the lists' totals to *work.
void bt_rounds_residual(bt_world *world, const bt_problem *problem, bt_since since, bt_work *work);

/// Collective. One sweep over the lists, without momentum; returns the largest update.
double bt_rounds_sweep(bt_world *world, const bt_problem *problem, bt_work *work);

/// Collective. Rounds until the residual is within the tolerance or the limit of work is reached; call it after a
/// residual pass that found the residual too large.
void bt_rounds_run(bt_world *world, const bt_problem *problem, bt_work *work);

/// Allocate a displacement for every body of this rank (bt_solver.shift), with unset values.
void bt_rounds_make_shift(bt_world *world);

/// Store the result of a residual pass over a cell in its work list.
void bt_rounds_found(bt_cell *cell, const bt_found *found);

enum { BT_MOVED_FEW = 192 };
/// Extrapolated unknowns of the listed contacts of a cell.
typedef struct bt_moved {
    double few[BT_MOVED_FEW][3];
    double (*y)[3];       ///< [n_list]
} bt_moved;

static inline void bt_moved_begin(bt_moved *moved, const bt_cell *cell)
{
    moved->y = cell->n_listed > BT_MOVED_FEW ? bt_alloc((size_t)cell->n_listed, sizeof *moved->y) : moved->few;
}

/// Add to the totals of the sweep the number of contacts of the cell that were moved, and how far they turned against
/// the move, J.
static inline void bt_rounds_moved(const bt_sweep *sweep, int64_t n, double against, bt_totals *totals)
{
    bt_sum_add(&totals->sum[BT_SWEEP_AGAINST], bt_max(-0x1p60, bt_min(0x1p60, against * sweep->problem->per_energy)));
    bt_sum_add(&totals->sum[BT_SWEEP_MOVED], (double)n);
}

static inline void bt_moved_end(bt_moved *moved, const bt_cell *cell, const bt_sweep *sweep, double against,
                                bt_totals *totals)
{
    bt_rounds_moved(sweep, sweep->beta > 0 ? cell->n_listed : 0, against, totals);
    if (moved->y != moved->few) free(moved->y);
}

/// Extrapolate n unknowns along their last change before a sweep: x becomes y, copied to `y`; the old x is stored in
/// `before`.
static inline void bt_rounds_move(const bt_sweep *sweep, double *x, double *before, double *y, int n)
{
    for (int i = 0; i < n; i++) {
        const double now = x[i];
        if (sweep->beta > 0) x[i] = now + sweep->beta * (now - before[i]);
        before[i] = now;
        y[i] = x[i];
    }
}

/// How far the sweep turned one unknown against its move: Σ W (y − x') (x' − x), J.
static inline double bt_rounds_against(double weight, double x, double before, double y)
{
    return weight * (y - x) * (x - before);
}

#endif
