// SPDX-License-Identifier: MIT
// Floes that split in a step, and their pieces as bodies.
//
// In a step (step.c): solve; find the loads on every floe from that solution (law and cut: src/split); cut every floe
// whose strength is exceeded, at its pose and velocity at the start of the step; then solve the step again with the
// pieces, at most BT_SPLIT_ROUNDS times. So no reported load exceeds the strength of its floe. All floes are judged
// under the same loads (Jacobi), so their order does not matter. Floes that would still split after the last round wait
// for the next step, and are counted. A step that has not converged splits nothing.
//
// A piece has the velocity field of its parent,
//     v_i = V + ω k×(c_i − c),   ω_i = ω,
// so that the pieces have the momentum, angular momentum and kinetic energy of the parent to rounding (with added mass,
// too, if C_I = C_m), and areas and moments of area add up to the parent's.
//
// Ids. An id names one outline for ever: both pieces get new ids, and the parent's is retired. Ids of pieces are
// reserved when the world is set up, after the generated floes and before all other bodies, whose coefficients prevail
// over those of ice. They are assigned in the order of the parents' ids: the same on any number of ranks. Rejected: the
// larger piece keeps the id. Files, pictures and records would have to know which outline an id has at which time.
//
// Pairs. The records of contact laws for a pair go to both pieces; that of a piece not near the other body is dropped
// as usual. The two sides of a crack touch from the first instant, with gap 0 and without an approach.
//
// The history of all splits is the same on all ranks. Outlines, parents and generations of pieces follow from it, in
// files and checkpoints too.
#ifndef BERGTOW_SPLITTING_H
#define BERGTOW_SPLITTING_H

#include "bergtow/world.h"
#include "loads/impact.h"
#include "split/find.h"

enum { BT_SPLIT_ROUNDS = 4, BT_SPLIT_MODES = BT_SPLIT_BURST + 1 };

/// One split. Members of 8 bytes only: ranks exchange it, and checkpoints save it, as a row.
typedef struct bt_split_record {
    int64_t step;       ///< steps done before the one in which it happened
    bt_gid parent;
    int64_t generation; ///< of the pieces; 1 if the parent is an original floe
    int64_t mode;       ///< bt_split_mode
    double near[2];     ///< end of the crack at the load, m
    double far[2];      ///< its other end, m
    double thickness;   ///< m
    double ratio;       ///< stress over strength
    double area[2];     ///< of the pieces, the larger one first, m²
    double polar[2];    ///< ∫r²dA of each about its centroid, m⁴
    double at[2][2];    ///< centroids of the pieces in the frame of the parent, m
    int64_t corners[3]; ///< vertices of their outlines, and of the parent's if it is original, else 0
} bt_split_record;

/// Totals over the run, the same on all ranks.
typedef struct bt_split_totals {
    int64_t by_mode[BT_SPLIT_MODES];
    // how often a floe was not split; the same floe counts in every step
    int64_t deferred;           ///< waited for the next step
    int64_t refused_size;       ///< a piece would have been too small or too slender
    int64_t refused_generation; ///< of the last generation
    int64_t refused_reserve;    ///< no ids were left
    int64_t refused_rafted;     ///< lay over or under others
    int64_t unconverged;        ///< steps that did not converge and so split nothing
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
    bt_split_record *split;     ///< [n] in the order of the pieces' ids
    int64_t n, cap;
    int64_t *begin;             ///< [n] first vertex of each split
    double *vertex;             ///< [n_vertices][2] outlines as in `corners`, each in its own frame, m
    int64_t n_vertices, cap_vertices;
    bt_split_totals total;
    int64_t now;                ///< splits in the last step
    double *sum;                ///< [cap_sum ≥ bodies] sum of the loads on each body in a solution, N
    double *borne;              ///< [cap_borne ≥ ids] N, 0 = not yet known (bt_split_borne)
    bt_idx cap_sum;
    bt_gid cap_borne;
} bt_splitting;

void bt_splitting_free(bt_splitting *splitting);

/// Row of a body where the original bodies come first and then all pieces of floes, whose ids lie between those of the
/// others.
static inline int64_t bt_splitting_row(const bt_world *world, bt_gid gid)
{
    const bt_splitting *splitting = world->splitting;
    if (!splitting || gid < splitting->first) return gid;
    if (gid >= splitting->first + splitting->reserve) return gid - splitting->reserve;
    return world->bodies.n_global - splitting->reserve + (gid - splitting->first);
}

/// The split that made piece k (from 0); the piece is its number k % 2.
static inline const bt_split_record *bt_splitting_birth(const bt_splitting *splitting, bt_gid k)
{
    return &splitting->split[k / 2];
}

/// Outlines of split k: of piece 0, of piece 1, or (2) of an original parent.
static inline const double *bt_splitting_outline(const bt_splitting *splitting, int64_t k, int which)
{
    const int64_t *c = splitting->split[k].corners;
    return splitting->vertex + 2 * (splitting->begin[k] + (which > 0 ? c[0] : 0) + (which > 1 ? c[1] : 0));
}

/// Append a split to the history: its outlines one after the other, [corners[0] + corners[1] + corners[2]][2].
void bt_splitting_append(bt_splitting *splitting, const bt_split_record *record, const double *vertex);

/// Generation of a floe, 0 = original.
int64_t bt_splitting_generation(const bt_splitting *splitting, bt_gid gid);
/// The original floe from which gid comes; *path: the path from it to gid (bt_split_scatter).
bt_gid bt_splitting_ancestor(const bt_splitting *splitting, bt_gid gid, int64_t *path);

/// Percentile of the size √A, m, of the present pieces, or (before) of the original floes that they come from; NaN if
/// none has split.
double bt_splitting_size(const bt_splitting *splitting, bool before, double percent);

/// ∫r²dA of floe i about its centroid, m⁴; for a piece, as computed by its cut.
double bt_splitting_polar(const bt_world *world, bt_idx i);

/// Collective. Splits from..n of the history: put pieces in place of their parents, and reset all velocities to the
/// start of the step.
void bt_splitting_put(bt_world *world, int64_t from);

/// Collective. After the solve. True if floes were cut: their pieces are new bodies, all velocities are those at the
/// start of the step, and the step must be solved again. False if nothing splits, or `round` is BT_SPLIT_ROUNDS.
bool bt_splitting_step(bt_world *world, int round);

/// After the original bodies have been set up, before they are distributed: put pieces in place of parents by the
/// stored history. Poses and velocities are set later.
void bt_splitting_restore(bt_world *world);

/// Hash of the history, for the hash of the state.
uint64_t bt_splitting_hash(const bt_splitting *splitting);

#endif
