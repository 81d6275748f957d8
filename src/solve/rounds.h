// SPDX-License-Identifier: MIT
// Rounds of sweeps with momentum over the contacts that matter (private to the solver): one iteration for contacts and
// for the position projection.
//
// Half and more of the contacts of a jam bear no load and open: their update changes nothing. So a residual pass over
// all contacts finds the largest residual and lists, cell by cell, the contacts that bear load or close; a round of
// sweeps goes over the lists only; then follows the next residual pass. What has opened leaves the lists then, what has
// closed meanwhile enters them.
//
// Between two sweeps of a round everything is moved on along its last change (Nesterov 1983, Soviet Math. Dokl. 27;
// Beck & Teboulle 2009, SIAM J. Imaging Sci. 2; for contacts Mazhar et al. 2015, ACM Trans. Graph. 34):
//     x_{k+1} = sweep(y_k),   y_{k+1} = x_{k+1} + β (x_{k+1} − x_k),
//     β = min(cap, (θ_k − 1)/θ_{k+1}),   θ_{k+1} = (1 + √(1 + 4 θ_k²))/2
// and where the sweep turned against the move, Σ W (y_k − x_{k+1}) (x_{k+1} − x_k) > 0, it starts anew with θ = 1, β =
// 0 (O'Donoghue & Candès 2015, Found. Comput. Math. 15). Velocities are linear in the impulses: those of y are the same
// combination, so each body needs but its velocity before, no impulse is applied again, and ghosts, which have the same
// velocities, are moved alike without a message.
//
// A round ends early once an update is small: no more than 0.7 of the tolerance. The residual of a contact is what its
// own exact solution would change, whatever its neighbours do; along a chain that moves slowly it is a few times the
// update, and the factor hardly changes. So where the residual is still too large the update that ends a round is
// lowered by that factor, by no more than a half at a time. Otherwise each of the next rounds is one sweep without
// momentum between two residual passes (the dearest step at 95 % took 80 such rounds).
//
// A batch of contacts (batch.h) whose update is no more than 0.3 of the tolerance is calm. It rests in the next sweep,
// and after each further calm update in twice as many and one more, at most three: most of a jam is calm long before
// its last contacts are. Momentum moves its bodies meanwhile, so that its unknowns have to follow, and do so at its
// next update: moves by β₁, β₂, … with no update between them come to x + (β₁ + β₁β₂ + …) (x − x₋). The last sweep of a
// round leaves none out, for a move alone may leave a pull, or friction beyond its cone. At 80 to 95 % this takes a
// third of the updates away, for a tenth more sweeps. Whole cells that rest: half of that; rests of up to seven sweeps,
// and other thresholds: no better.
//
// The momentum goes on from round to round: a contact that leaves or enters the lists, and a floe that they newly
// reach, is at rest then. It starts anew where velocities have been formed from the impulses, and around a round over a
// part of the field.
//
// The problem is only piecewise smooth, and a Gauss–Seidel sweep is not a gradient step: with a fixed cap some jams run
// in circles (contacts that open and close, stick and slip by turns). So the cap follows what it brings. Three rounds
// that take a fifth off the sum of squares bring it nearer to 1, and make rounds longer; others take it half as far
// away again, down to none below 0.3. If that does not help either, three rounds of 400 sweeps follow without a cap:
// chains of many floes, and heavy bodies that press on light ones, are not circling but slow, and converge with β near
// 1 alone (a row of 5 floes under 10⁴ times their mass: 13,000 sweeps, where plain ones need more than 500,000). What
// has not converged within the limit of work gets three tenths of it more without momentum, which circles far from the
// solution where it does not converge. Where the result is still more than four tolerances off, the whole starts anew
// with half of the work, at most twice.
//
// A jam that does not converge within its work wanders: its residual rises and falls by a factor of ten. So the
// unknowns of the best residual pass are kept, from half of the work on, and are the result.
//
// When few contacts are left that are far from the tolerance, every second round is over the cells about them alone.
//
// The limit is one of work: updates and residuals of contacts, and something for the sweep itself, so that sweeps
// over a few contacts end, too.
//
// Order-free decisions. Cells form their parts of the sums in plain arithmetic, in the order of their contacts, which
// is the same everywhere; the parts are added in 128-bit fixed point (bergtow/sum.h). So every decision is the same for
// any number of threads and ranks.
//
// Rejected: Anderson acceleration around the sweep, over all contacts or the listed ones (0.6 to 1.8 times the time of
// the plain sweep in dense ice; histories of 240 B a contact and 96 B a floe, against 24 a listed contact and 32 a floe
// here); over-relaxation (1.3 helps without momentum and hurts with it); momentum with a step of its own
// for each cell or contact; sweeps in alternating direction; proximal Newton steps over the listed contacts (M + Jᵀ D J
// of the velocities, unsymmetric where contacts slide, factorised by nested dissection): two of them end a jam of which
// a handful of contacts is left, but where a wedge drives its impulses up over thousands of sweeps a Newton step takes
// as long as a hundred sweeps and the wedge needs as many steps as contacts change their state. At equal work more
// steps missed the tolerance with them than without. Extrapolation of two rounds of plain sweeps along their
// difference (Aitken; it shrinks by 2 % a round): contacts change their state all along that way, and the rounds after
// it are where they were before. Going back to the best unknowns whenever the residual has risen: more steps missed.
#ifndef BERGTOW_ROUNDS_H
#define BERGTOW_ROUNDS_H

#include <stdlib.h>

#include "contact/row.h"
#include "space/cells.h"
#include "space/phases.h"

/// Totals of a residual pass; the largest residual is `most`. CHECKS: contacts whose residual was taken.
enum {
    BT_RESIDUAL_SQUARES, BT_RESIDUAL_ROWS, BT_RESIDUAL_CONTACTS, BT_RESIDUAL_CHECKS, BT_RESIDUAL_LISTED,
    BT_RESIDUAL_BAD, BT_RESIDUAL_N
};
/// What has happened since the last residual pass: the problem is new, or only sweeps over the lists, which leave the
/// residual of a cell as it was where they move none of its bodies; or velocities are to be formed anew.
typedef enum { BT_BEGINS, BT_SWEPT, BT_SETTLES } bt_since;
/// Totals of a sweep; the largest update is `most`.
enum { BT_SWEEP_AGAINST, BT_SWEEP_UPDATES, BT_SWEEP_MOVED, BT_SWEEP_N };

#define BT_NEAR 0.7 // of the tolerance: an update that ends a round, and a residual that does not count as bad

/// What is to be done with the unknowns of the best residual pass.
typedef enum { BT_KEEP, BT_PUT_BACK, BT_FORGET } bt_keeping;

/// What is iterated.
typedef struct bt_problem {
    bt_visit *residual;   ///< list the contacts of a cell (bt_rounds_list), tell what is left (_found); context: this
    bt_visit *sweep;      ///< sweep the list of a cell, after its move; context: bt_sweep
    bt_visit *keep;       ///< keep the unknowns of a cell, put them back, or forget them; context: bt_keeping. Or NULL
    void (*settle)(bt_world *world); ///< velocities anew from the impulses, or NULL
    bt_vel *vel;          ///< [n bodies] moved by the sweeps
    struct bt_tow *line;  ///< swept after the last cell, or NULL
    double tolerance;     ///< of the residual
    double per_square;    ///< factor on sums of squares, see bt_sum
    double most_squares;  ///< of one cell, times that
    double per_energy;    ///< and on products of moves
    double cap;           ///< of the momentum at the start
    int length;           ///< sweeps of a round at the start
    double limit;         ///< of the work, in updates of every contact; of plain ones, in sweeps
    bool plain;           ///< sweeps over all contacts, without momentum
} bt_problem;

#define BT_ENOUGH 0.3 // of the tolerance: what changes less is calm
enum { BT_REST = 3 }; // sweeps that a calm batch rests at most

/// A sweep, as the cells see it.
typedef struct bt_sweep {
    const bt_problem *problem;
    bool moves;           ///< keep what was before the sweep, and add up BT_SWEEP_AGAINST
    double beta;          ///< move along the last change before it
    bool all;             ///< none rests
    /// by the number of sweeps that a batch has rested: how far x is moved on along its last change, and how far what
    /// was before the last sweep
    double lead[BT_REST + 1], lag[BT_REST + 1];
} bt_sweep;

/// Work done.
typedef struct bt_work {
    int64_t sweeps;
    int64_t updates;      ///< of contacts
    int64_t moves;        ///< of contacts by momentum
    int64_t checks;       ///< residuals of contacts that were taken
    // what the last residual pass has found
    double residual;      ///< largest
    double squares;       ///< sum over the rows
    int64_t rows, contacts, listed, bad;
} bt_work;

/// Scales of the exact sums for a tolerance of the residual, the largest mass and the number of cells.
void bt_rounds_scale(bt_problem *problem, const bt_cells *t);

/// What a contact needs that is swept where it is, and not in a batch.
typedef struct bt_in_place {
    bt_mass mass;
    double before[3];     ///< unknowns before the last sweep
} bt_in_place;

/// What a residual pass finds in a cell.
typedef struct bt_found {
    double most, squares;
    int64_t rows, bad;    ///< bad: contacts far from the tolerance
} bt_found;

/// The contacts of a cell that are swept: cell->n_listed of them.
typedef struct bt_work_list {
    bt_idx *list;                   ///< [n_listed] ascending
    double (*best)[3];              ///< [n_contacts] of the best residual pass, while they are kept; otherwise NULL
    bt_idx cap_list;
    bt_in_place *in_place;          ///< [n_contacts] where they are swept in place, after them; otherwise unset
    /// The listed contacts are in batches (solve/batch.h), and the cell has no contacts but those. In the memory of the
    /// contacts: [n_batches], and after them the records of the contacts that are not listed
    bool packed;
    struct bt_batch *batch;
    bt_idx n_batches;
    /// [n_last] otherwise: what the contacts that were listed last hand on to the next list, after the contacts
    struct bt_unknowns *last;
    bt_idx n_last;
    bt_found found;                 ///< by the last residual pass that looked at the cell
    bt_idx found_listed;            ///< and how many it listed
    bool kept;                      ///< swept in a round over a part of the field
    bool still;                     ///< they could not in the round before: nothing of theirs moves on
} bt_work_list;

/// The work lists of the cells, after new labels: all empty.
void bt_rounds_begin(bt_world *world);

/// Forget what the next step takes anew.
void bt_rounds_rest(struct bt_solver *solver);

/// An empty list for a cell with room for all its contacts: what a residual pass calls before it lists.
void bt_rounds_list(bt_cell *cell);

/// Masses of the contacts of a cell that are going to be swept where they are.
void bt_rounds_in_place(bt_cell *cell, const bt_inv *inv);

/// Collective. What the residual of all contacts is now, into *work.
void bt_rounds_residual(bt_world *world, const bt_problem *problem, bt_since since, bt_work *work);

/// Collective. One sweep over the lists, without momentum; returns the largest update.
double bt_rounds_sweep(bt_world *world, const bt_problem *problem, bt_work *work);

/// Collective. Rounds until the residual is within the tolerance, or the limit of work is reached; after a residual
/// pass that found it not to be.
void bt_rounds_run(bt_world *world, const bt_problem *problem, bt_work *work);

/// Memory for a displacement of every body of this rank (bt_solver.shift), whose values are not set.
void bt_rounds_make_shift(bt_world *world);

/// What a residual pass has found in a cell, into its work list.
void bt_rounds_found(bt_cell *cell, const bt_found *found);

enum { BT_MOVED_FEW = 192 };
/// Unknowns of the listed contacts of a cell after their move.
typedef struct bt_moved {
    double few[BT_MOVED_FEW][3];
    double (*y)[3];       ///< [n_list]
} bt_moved;

static inline void bt_moved_begin(bt_moved *moved, const bt_cell *cell)
{
    moved->y = cell->n_listed > BT_MOVED_FEW ? bt_alloc((size_t)cell->n_listed, sizeof *moved->y) : moved->few;
}

/// Into the totals of the sweep: how many contacts of the cell were moved, and what they turned against it, J.
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

/// Move n unknowns along their last change before a sweep: x to y, kept in `y`, and x kept in `before`.
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
