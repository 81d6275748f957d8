// SPDX-License-Identifier: MIT
// All data of a time step: constants (params.h), bodies (body.h), and the data of the layers.
#ifndef BERGTOW_WORLD_H
#define BERGTOW_WORLD_H

#include "bergtow/base.h"
#include "bergtow/body.h"
#include "bergtow/event.h"
#include "bergtow/params.h"

BT_BEGIN_C

struct bt_cells;
struct bt_solver;
struct bt_tow;
struct bt_domain;
struct bt_exchange;
struct bt_window;
struct bt_undisturbed;
struct bt_impacts;
struct bt_environment;
struct bt_forces;
struct bt_splitting;

/// Phases of the wall time of a run: X(name, contents).
#define BT_WALL_PHASES(X)                                                                                              \
    X(detect, "labels and storage of bodies, margins, the detection of contacts")                                      \
    X(colour, "the order of the cells by their colours, and their distribution to threads")                            \
    X(forces, "current and wind, forces, velocities without contacts")                                                 \
    X(solve, "the contact solver, restitution included")                                                               \
    X(advance, "balances, the record of forces and collisions, motion")                                                \
    X(exchange, "waiting for other ranks")                                                                             \
    X(output, "series, checks, frames and checkpoints")                                                                \
    X(project, "what gives way, and the position projection")                                                          \
    X(split, "loads of the floes, and floes that split")

/// Wall time by phase, s.
typedef struct bt_phases {
#define BT_MEMBER_OF_PHASES(name, text) double name;
    BT_WALL_PHASES(BT_MEMBER_OF_PHASES)
#undef BT_MEMBER_OF_PHASES
} bt_phases;

/// Numbers of the last step.
typedef struct bt_step_stats {
    int64_t n_points;        ///< contact points passed to the solver
    int64_t n_active;        ///< floes in active cells (the others rest)
    int64_t sweeps, position_sweeps;
    int64_t position_updates; ///< of contacts by the sweeps of the position projection
    bool projected;          ///< the position projection converged, or had nothing to do
    int64_t contact_updates;    ///< of contacts by the sweeps
    int64_t contact_moves;      ///< of contacts by momentum between sweeps
    int64_t residual_checks; ///< residuals of contacts, and velocities formed anew for them
    int64_t repeats;         ///< repeated detections and solves because the solution outran the margin
    bool outrun;             ///< it still did at the end: a contact may have been missed
    int64_t misjudged;       ///< remaining rows of pairs that pass, and meeting pairs without rows (contact/contacts.h)
    double residual, residual_rms; ///< natural-map residual: max-norm and root mean square over the rows, m/s
    bool converged;
    bool locked;             ///< it did not, and some bodies are locked (src/solve/islands.h)
    bool no_load;            ///< some of these touch the towed body: its load is unbounded
    double overlap;          ///< deepest overlap at the start of the step, m
    bool restitution_cut;    ///< rebounds would have added energy or had no room somewhere, and were lowered
    double contact_work;     ///< Σ λ·½(w1 + w2) from the velocities at the start of the step, J
    bool added_energy;       ///< contacts gained more over the step without them than residual and rounding explain
    /// numbers of the program's contact laws, in their order (src/contact/law.h): series, with units and meaning there
    double laws[BT_MAX_LAW_NUMBERS];
    double added[BT_MAX_ADDED_LAWS][1 + BT_MAX_CONTACT_NUMBERS]; ///< work (J) and numbers of added laws
    double momentum_residual;///< relative to the momentum exchanged in the step
    double kinetic_energy;   ///< at the end, J
    bt_phases phases;        ///< wall time by phase; `output` is not part of the step
    bt_phases shared;        ///< the part in passes shared by several threads
    double in_team;          ///< the same for the present phase
} bt_step_stats;

typedef struct bt_world {
    bt_params par;
    bt_bodies bodies;
    struct bt_cells *cells;
    struct bt_solver *solver;
    struct bt_tow *tow;      ///< NULL without towed body
    struct bt_window *window;///< NULL = the domain is fixed
    struct bt_undisturbed *undisturbed; ///< NULL = no towed body (step/window.h)
    struct bt_environment *environment; ///< current and wind in time (environment.h), NULL = constant, as in par
    struct bt_forces *forces; ///< parameters of the force laws, and their impulses on the towed body (forces.h)
    struct bt_domain *domain;///< division among ranks, NULL = all here (domain.h)
    const struct bt_exchange *exchange; ///< operations of the division for space (exchange.h), NULL with it
    struct bt_shore *shore;  ///< fixed bodies that lie against each other (space/shore.h), NULL = none
    struct bt_splitting *splitting; ///< splitting of floes (step/splitting.h), NULL = floes do not split
    struct bt_impacts *impacts; ///< loads of the towed body: collisions and the rest (impact.h), NULL = not separated
    bt_gid towed;            ///< gid of the towed body, −1 = none
    int64_t step;            ///< steps done
    bt_events events;        ///< the same on all ranks
    double drift_x, drift_y; ///< displacement of the water since time zero, m
    bt_step_stats stats;
} bt_world;

/// Create an empty world; release with bt_world_free. The constants of the step are copied.
bt_world *bt_world_create(const bt_params *par);
/// Release a world and its contents. NULL is ignored.
void bt_world_free(bt_world *world);

/// Add a body; returns its gid: bodies are numbered in the order in which they are added, floes first. The definition
/// is copied. Asserted, not checked: 3 to BT_MAX_VERTICES vertices, of an outline that bt_shape_fault (with parts:
/// bt_outline_fault) accepts; mass and inertia > 0 of a dynamic body; a world that is not yet distributed to ranks.
bt_gid bt_world_add(bt_world *world, const bt_body_def *def);

/// Index of body gid in the present storage of this rank, −1 = not here.
static inline bt_idx bt_world_index(const bt_world *world, bt_gid gid) { return world->bodies.index_of[gid]; }

/// Index of the towed body, −1 = none. Every rank holds it.
static inline bt_idx bt_world_towed(const bt_world *world)
{
    return world->towed < 0 ? -1 : world->bodies.index_of[world->towed];
}

/// Collective. Do one step Δt: forces, detection, solve, projection, advance; see src/step/step.c for the order.
void bt_world_step(bt_world *world);

/// Overlaps of bodies at the present poses.
typedef struct bt_overlaps {
    int64_t pairs;        ///< pairs that overlap by more than allowed
    double deepest;       ///< of all pairs, m, 0 = none
    bt_gid a, b;          ///< the pair with the deepest overlap
} bt_overlaps;

/// Collective. Find this rank's overlaps at the present poses; pairs deeper than `allowed`, m, are counted. Labels and
/// storage may be renewed: body indices then change.
bt_overlaps bt_world_overlaps(bt_world *world, double allowed);

/// Collective. 64-bit hash of the state: poses and velocities by gid, memory of contact laws, step, window, drift of
/// the water, tow. Equal for equal states, however stored or distributed.
uint64_t bt_world_hash(const bt_world *world);

BT_END_C

#endif
