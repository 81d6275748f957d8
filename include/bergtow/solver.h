// SPDX-License-Identifier: MIT
// Signorini–Coulomb contact problem of one step, by projected Gauss–Seidel.
//
//     w = J U2 + b,   M (U2 − U*) = Jᵀ λ,   0 ≤ λ_n ⟂ w_n ≥ 0,   |λ_t| ≤ μ λ_n, λ_t opposes slip       (1)–(3)
//
// Layout. One row a contact point: directions, arms and the Delassus diagonal packed together; the sweep touches
// rows, vel and inv and nothing else. Rows are grouped by colour: two manifolds of a colour share no movable
// body, so the rows of a colour can be done in any order, on any thread, with the same bits. Colours are
// first-fit in the order of the manifolds, which is the order of the ids. Manifolds on a large movable body (the
// berg on a line has hundreds) would each need a colour: they stand in one last group that is done in
// sequence, as is the tow line after it.
//
// Acceleration: Anderson's, around the sweep taken as a fixed-point map of the impulses (src/anderson.c). Why: a plain
// sweep needs ~n² sweeps on a chain of n floes (more where friction makes it bend) and ~m_berg/m_floe where a heavy
// berg squeezes light floes against a wall. `plain_sweeps` keeps the plain iteration as the reference; both end
// on a projected sweep, with velocities formed anew from the impulses, and the same criterion.
//
// A manifold is one unit of the sweep: the normals of its two points are solved together, and their friction as one.
//
// Convergence is judged on the natural map of (1): the largest of
//     |λ_n − max(0, λ_n − w_n/W_nn)| W_nn   and   |λ_t − proj_[−μλ_n, μλ_n](λ_t − w_t/W_tt)| W_tt,   m/s
// which is zero exactly at a solution. The sweep's own largest update is the same quantity seen while velocities
// still change; it only says when the true map is worth its price.
#ifndef BERGTOW_SOLVER_H
#define BERGTOW_SOLVER_H

#include "bergtow/contacts.h"
#include "bergtow/sum.h"
#include "bergtow/world.h"

typedef struct bt_row {
    bt_idx a, b;
    double nx, ny;               ///< normal from a to b; the tangent is (−ny, nx)
    double ran, rbn, rat, rbt;   ///< ra×n, rb×n, ra×t, rb×t, m
    double mn, mt;               ///< 1/W_nn, 1/W_tt, kg
    double bias;                 ///< b of the normal, m/s
    double mu;
    double ln, lt;               ///< impulse on b, N s
    double gap;                  ///< m
} bt_row;

#define BT_MAX_COLOURS 64

typedef struct bt_solver {
    bt_row *rows;                ///< [n_rows] by colour, then in the order of the manifolds
    bt_idx *unit;                ///< [n_man + 1] first row of each unit: the manifolds in the order of the rows
    bt_idx *row_of;              ///< [n_man] first row of each manifold, in the order of the manifolds
    bt_idx n_rows, cap_rows, cap_man;
    int n_colours;               ///< without the sequential group
    bt_idx start[BT_MAX_COLOURS + 2]; ///< first unit of colour c; start[n_colours] begins the sequential group
    uint64_t *used;              ///< [n bodies] colours already at each body
    uint8_t *colour;             ///< [n_man]
    bt_vel *shift;               ///< [n bodies] displacement of the position projection, m, m, rad
    double *step;                ///< [n_rows][2] what the last sweep added to (ln, lt), N s
    double *scale;               ///< [n_rows][2] √W_nn, √W_tt
    struct bt_anderson *anderson;
    double *push;                ///< [n_rows] its multipliers, kg m
    bt_idx cap_bodies;
    bool rebounds;               ///< some contact of this step has a restitution
    bt_idx *island;              ///< [n bodies] union-find of the movable bodies that touch; only while `rebounds`
    double *share;               ///< [n bodies] factor on the restitution of each island, at its least body
    bt_sum *surplus;             ///< [n bodies] work of each island's contacts, J
    bt_idx cap_islands;
    double prepare_s;            ///< wall time of the colouring and packing in this step, s
    bool shifted;                ///< the projection did something this step
} bt_solver;

bt_solver *bt_solver_create(void);
void bt_solver_free(bt_solver *s);

/// Colour, pack and sweep until the natural-map residual is at most par.tolerance or the limit is reached: vel becomes
/// U2, the manifolds get their impulses, stats the counts. Newton's law of restitution can add energy when several
/// contacts of a body rebound at once, or slip (Kane & Levinson 1985). Where the contacts of an island (bodies that
/// touch each other) come out with positive work, the step is solved again with the restitution of that island
/// halved, and again, at last with none, where the work is never positive.
void bt_solver_solve(bt_world *w);

/// Split-impulse position projection: displacements that bring overlap beyond the slop back to it, by the same
/// rows without friction; they move poses and never touch velocities.
void bt_solver_project(bt_world *w);

/// Largest natural-map residual at the present velocities and impulses, m/s.
double bt_solver_residual(const bt_world *w);

/// Work of the contact impulses in this step, Σ λ·½(w* + w2), J: the change of kinetic energy they cause, less
/// the work of prescribed motion. w* is the velocity without contacts, with the tow line's impulse: of two impulses that
/// act at once the line's comes first, or the pull of the line into the ice would count as work of the ice.
double bt_solver_work(const bt_world *w);

/// Sum of the contact impulses on body i (N s, N s, N m s about its centroid), order-free.
void bt_solver_impulse_on(const bt_world *w, bt_idx i, double j[3]);

/// Write this step's contact problem (after the solve) in FCLIB's local form. Errors: BT_ERR_IO.
bt_status bt_solver_dump(const bt_world *w, const char *path, bt_errors *err);

#endif
