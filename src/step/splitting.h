// SPDX-License-Identifier: MIT
// Floes that split in a step, and the bodies that are born of it.
//
// In a step (step.c): solve; what loads every floe bears, from that solution (law and cut: src/split); every floe whose
// strength is exceeded is cut, at its pose and velocity at the start of the step; then the step is solved again, with
// the pieces, at most BT_SPLIT_ROUNDS times. So no load is reported that a floe would not have borne. All floes are
// looked at with the same loads (Jacobi), so their order does not matter. What would still split after the last round
// waits for the next step, and is counted. A step that has not converged splits nothing.
//
// A piece has the velocity field of its parent,
//     v_i = V + ω k×(c_i − c),   ω_i = ω,
// so that momentum, angular momentum and kinetic energy are those of the parent to rounding (with added mass, too,
// where C_I = C_m), and areas and moments of area add up to the parent's.
//
// Ids. An id names one outline for ever: both pieces get new ids, and that of the parent is gone. Those of pieces are
// kept when the world is set up, after the generated floes and before all other bodies, whose coefficients prevail over
// the ice's. They are handed out in the order of the ids of the parents: the same on any number of ranks. Rejected: the
// larger piece keeps the id. Files, pictures and memory would have to know for each id which outline it has when.
//
// Pairs. What contact laws remember of a pair goes to both pieces; where one is not near the other body it is forgotten
// as ever. The two sides of a crack touch from the first instant, with gap 0 and without an approach.
//
// The history of all splits is the same on all ranks. Outlines, parents and generations of pieces follow from it, in
// files and in checkpoints.
#ifndef BERGTOW_SPLITTING_H
#define BERGTOW_SPLITTING_H

#include "bergtow/world.h"
#include "loads/impact.h"
#include "split/find.h"

enum { BT_SPLIT_ROUNDS = 4, BT_SPLIT_MODES = BT_SPLIT_BURST + 1 };

/// One split. Numbers of 8 bytes only: ranks hand it on, and checkpoints save it, as a row.
typedef struct bt_split_record {
    int64_t step;       ///< steps done before the one in which it happened
    bt_gid parent;
    int64_t generation; ///< of the pieces; 1 of those of a floe that was there from the start
    int64_t mode;       ///< bt_split_mode
    double near[2];     ///< end of the crack at the load, m
    double far[2];      ///< its other end, m
    double thickness;   ///< m
    double ratio;       ///< stress over strength
    double area[2];     ///< of the pieces, the larger one first, m²
    double polar[2];    ///< ∫r²dA of each about its centroid, m⁴
    double at[2][2];    ///< centroids of the pieces in the frame of the parent, m
    int64_t corners[3]; ///< vertices of their outlines, and of the parent's if that was there from the start, else 0
} bt_split_record;

/// Over the run, the same on all ranks.
typedef struct bt_split_totals {
    int64_t by_mode[BT_SPLIT_MODES];
    int64_t deferred;           ///< floes that waited for the next step, in all steps
    int64_t too_small;          ///< floes whose pieces would have been too small or too slender, in all steps
    int64_t too_old;            ///< of the last generation
    int64_t no_id;              ///< no ids were left
    int64_t rafted;             ///< they lay over or under others
    int64_t unconverged;        ///< steps that did not converge, and so split nothing
    int64_t steps;              ///< steps with a split
    double crack_length;        ///< m
    double work;                ///< G_f h l, J
    double largest_refused;     ///< largest ratio of stress to strength of a floe that could not split
} bt_split_totals;

typedef struct bt_splitting {
    bt_split_law law;
    double modulus;             ///< of Weibull's scatter of the strength, 0 = none
    int64_t seed;
    int64_t generations;        ///< most
    bt_gid first, reserve;      ///< ids of pieces: first up to first + reserve
    bt_impact_rule rule;        ///< force of a collision
    double large;               ///< radius from which on a floe is in no cell, m
    bt_split_record *split;     ///< [n] in the order of their ids
    int64_t n, cap;
    int64_t *begin;             ///< [n] first vertex of each split
    double *vertex;             ///< [n_vertices][2] outlines as in `corners`, each in its own frame, m
    int64_t n_vertices, cap_vertices;
    bt_split_totals total;
    int64_t now;                ///< splits in the last step
    double *sum;                ///< [cap_sum ≥ bodies] of a solution: of the loads of each body, N
    double *borne;              ///< [cap_borne ≥ ids] N, 0 = not yet known (bt_split_borne)
    bt_idx cap_sum;
    bt_gid cap_borne;
} bt_splitting;

void bt_splitting_free(bt_splitting *splitting);

/// Pieces that have been born.
static inline bt_gid bt_splitting_pieces(const bt_splitting *splitting) { return splitting ? 2 * splitting->n : 0; }

/// The split that made piece k (from 0), and which of its pieces it is.
static inline const bt_split_record *bt_splitting_birth(const bt_splitting *splitting, bt_gid k)
{
    return &splitting->split[k / 2];
}

/// Outlines of split k: of piece 0, of piece 1, or, 2, of a parent that was there from the start.
static inline const double *bt_splitting_outline(const bt_splitting *splitting, int64_t k, int which)
{
    const int64_t *c = splitting->split[k].corners;
    return splitting->vertex + 2 * (splitting->begin[k] + (which > 0 ? c[0] : 0) + (which > 1 ? c[1] : 0));
}

/// Append a split to the history: its outlines one after the other, [corners[0] + corners[1] + corners[2]][2].
void bt_splitting_append(bt_splitting *splitting, const bt_split_record *record, const double *vertex);

/// Generation of a floe, 0 = there from the start.
int64_t bt_splitting_generation(const bt_splitting *splitting, bt_gid gid);
/// The floe that was there from the start, and the way from it to gid (bt_split_scatter).
bt_gid bt_splitting_ancestor(const bt_splitting *splitting, bt_gid gid, int64_t *path);

/// Size √A, m, that this share of the pieces that are there, or (before) of the floes that they are of, does not
/// exceed; NaN if none has split.
double bt_splitting_size(const bt_splitting *splitting, bool before, double share);

/// ∫r²dA of floe i about its centroid, m⁴; of a piece, as the cut has given it.
double bt_splitting_polar(const bt_world *world, bt_idx i);

/// Collective. Splits from..n of the history: pieces in the place of their parents, all velocities those at the start
/// of the step.
void bt_splitting_put(bt_world *world, int64_t from);

/// Collective. After the solve. True: floes were cut, their pieces are new bodies, all velocities are those at the
/// start of the step, and it is to be solved again. False: nothing splits, or `round` is BT_SPLIT_ROUNDS.
bool bt_splitting_step(bt_world *world, int round);

/// After bodies have been set up as in the beginning, before they are distributed: pieces in the place of parents, as
/// the history of s has them. Poses and velocities are yet to be set.
void bt_splitting_restore(bt_world *world);

/// Of the history, for the hash of the state.
uint64_t bt_splitting_hash(const bt_splitting *splitting);

#endif
