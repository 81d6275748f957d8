// SPDX-License-Identifier: MIT
// Signorini–Coulomb contact problem of one step, by projected Gauss–Seidel.
//
//     w = J U2 + b,   M̃ (U2 − U*) = Jᵀ λ,   0 ≤ λ_n ⟂ w_n ≥ 0,   |λ_t| ≤ μ λ_n, λ_t opposes slip       (1)–(3)
//
// with M̃ = M + Δt diag K, the mass with the implicit part of the drag (bodies.inv is its inverse).
//
// A sweep updates contacts one after the other (a contact is a manifold: the normals of its two points are solved
// together, and their friction as one), cell by cell in the order of cells.h, with the velocities as they stand.
// Contacts with large movable bodies (the berg on a line has hundreds) follow in sequence, and the tow line after them.
//
// Data flow of a step. contacts (bt_cell.contacts, with the impulses of the last step) and vel_free -> vel ->
//   residual pass -> lists -> sweeps -> vel, contacts:
//   residual reads all contacts and vel; writes bt_work_list.list (contacts that bear load or close), the residual, and
//   the number of bad contacts;
//   sweep    covers the lists only, inner_sweeps times per cell before the next cell: its data are then in the
//            first-level cache, and ranks need not exchange anything. The listed contacts are packed for it,
//            four a batch, and put back before the next residual pass (src/solve/batch.h); those of
//            movable large bodies and with rising bounds are swept where they are;
//   move     between two sweeps: extrapolates impulses and velocities along their last change (bt_solver.before);
//   settle   at the end: vel anew from vel_free and the impulses, then a residual pass for the reported residual.
// Rounds of sweeps, momentum, stopping rules and the limit of work: src/solve/rounds.h. The position projection works
// likewise, with displacements in place of velocities.
//
// Why momentum: a plain sweep needs ~n² sweeps on a chain of n floes (more where friction makes it bend) and
// ~m_berg/m_floe where a heavy berg squeezes light floes against a wall. `plain_sweeps` keeps the plain iteration, over
// all contacts, as the reference; both end with a projected sweep, velocities formed anew from the impulses, and the
// same criterion.
//
// Where a contact law applies (contact/law.h) the normal impulses have an upper bound, too, λ_n <= L(w_n)
// (src/solve/limit.h), and in the natural map the projection is on [0, L].
//
// Convergence is judged on the natural map of (1): the largest of
//     |λ_n − max(0, λ_n − w_n/W_nn)| W_nn   and   |λ_t − proj_[−μλ_n, μλ_n](λ_t − w_t/W_tt)| W_tt,   m/s
// which is zero exactly at a solution. The largest change of a row's speed in a sweep is the same quantity while
// velocities still change; it only tells when evaluating the true map is worth its cost. The root mean square over all
// rows is also reported. Under a bound L the map itself is bounded by L W: an impulse more than 1 % short of L counts
// by the speed left (bt_short_residual in src/solve/kernel.h); for sheets, whose impulse has a direction, if it takes
// 1 % less power than the bound allows.
#ifndef BT_SOLVER_H
#define BT_SOLVER_H

#include "bergtow/world.h"
#include "contact/contacts.h"
#include "contact/law_pair.h"
#include "space/cells.h"
#include "tow/tow.h"

// --- restitution -----------------------------------------------------------------------------------------------------

// Restitution that never adds energy (private to the solver).
//
// Newton's law can add energy when several contacts of a body rebound at once, or slip (Kane & Levinson 1985). Movable
// bodies joined by contacts, loaded or not, form an island; if its contacts do positive work, the step is solved again
// with the restitution of that island halved, repeatedly, and finally with none, when the work is never positive.
//
// A rebound may also go farther within the step than there is room behind the body. The rows of the rebound,
// J U2 ≥ e × approach, and of the body behind, J U2 ≥ −gap/Δt, then contradict each other, and the sweeps raise the
// loads of both without limit, although free and fixed bodies that do not overlap always have a solution without
// restitution: at U2 = 0 no contact closes. So a rebound is only a wish. An island that holds one and is not solved
// loses restitution, too, and only a step whose unsolved islands have none left counts as unconverged or locked. The
// next solution starts without the loads of such an island: they would take as long to fall as they took to rise.
//
// The proof of islands.h, tried a few times during the sweeps, ends most of these early; restitution is then halved.
// What it does not find (many wedges with friction) takes the whole limit of work; such an island goes on with none at
// once. By halves the steps of a jam at 92 % and Δt 5 s, where a third does not converge with or without restitution,
// took 5 times as long as before, and this way 2; against steps of Δt/100 of random scenes both are equally good.

/// Collective. Full restitution for every island; false (and nothing to do) when no contact of this step has any.
bool bt_restitution_begin(bt_world *world);

/// Collective. Lower the restitution, and the biases, of every island whose contacts did positive work beyond the error
/// of the solution (λ times the residual, and rounding); if there is none and the solution has not converged, of every
/// island with a rebound and a contact that is not solved. If sweeps were ended by a proof, only of the islands that it
/// names. True if there was one.
bool bt_restitution_lower(bt_world *world);

typedef struct bt_solver {
    struct bt_work_list *work;   ///< [n_work] of the cells (solve/rounds.h)
    bt_idx n_work;
    bt_vel *before;              ///< [n bodies] the velocities before the last sweep (src/solve/rounds.h)
    bt_idx cap_before;
    double line_before[BT_MAX_BRANCHES]; ///< impulses of the line before the last sweep, N s
    double line_best[BT_MAX_BRANCHES]; ///< and at the best residual pass, while kept
    bt_vel *shift;               ///< [n bodies] displacement of the position projection, m, m, rad
    bt_idx cap_bodies;
    bool shifted;                ///< the projection, or its second pass, has moved something
    bool turned;                 ///< some pair has turned so far that there may be a second pass
    bool parted_again;           ///< the second pass has moved something
    struct bt_aside *aside;      ///< [cells] contacts put aside during the projection (solve/project.c)
    bool rebounds;               ///< some contact of this step has a restitution
    bool refuted;                ///< rebounds lock the bodies of the islands whose sums are not 0
    bool extends;                ///< the present solution of this step may still hold with the added contacts
    struct bt_islands *islands;  ///< of all contacts (solve/islands.h)
} bt_solver;

bt_solver *bt_solver_create(void);
void bt_solver_free(bt_solver *solver);

/// Collective. Sweep until the natural-map residual is at most par.tolerance or the limit is reached: vel becomes U2,
/// contacts get their impulses, stats the counts. Restitution is lowered where it would add energy
/// (bt_restitution_lower). `extends`: vel solves this step as before its last detection; that solution stays if the
/// added contacts allow it.
void bt_solver_solve(bt_world *world, bool extends);

/// Prepare a cell for the solve: empty its list, cut impulses to their present bounds, mark nothing as moved.
void bt_solver_begin_cell(bt_world *world, bt_cell *cell);

/// Passes over a cell (bt_problem.residual and .sweep): contacts, biases, bounds and masses come from the cell,
/// velocities from the problem.
bt_visit bt_solver_residual_of_cell, bt_solver_sweep_cell;

/// Collective. Split-impulse position projection: displacements that bring overlap beyond the slop back to it, by the
/// same rows without friction; they move poses and never touch velocities.
void bt_solver_project(bt_world *world);

/// Collective. After the poses have moved: a second pass where rotations have left overlap (solve/project.c). True if
/// there are displacements; the poses then move once more, by these alone.
bool bt_solver_project_again(bt_world *world);

#endif
