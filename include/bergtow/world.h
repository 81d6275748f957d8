// SPDX-License-Identifier: MIT
// The bodies and everything one time step works on.
//
// Data layout. A body has a hot part, all that sweeps touch (velocity, 32 bytes, in every sweep; inverse inertia, 16
// bytes, where contacts are not in batches, and when batches are packed), a warm part used once a step (pose, rotated
// outline, travelled path), and a cold part (mass, drag, polygon in its own frame), read a few times a step at most.
// Each member is an array of its own over the bodies in storage order, which is the order of the cells (cells.h):
// neighbours in space are neighbours in memory.
// Every reference between bodies is a bt_idx into that order and changes when bodies change their cell; the name of a
// body that stays is its global id (gid), and every order that the result depends on follows from gids and cells, never
// from storage or rank. A rank holds the bodies of its cells, those of cells beside them (ghosts), and all large
// bodies (walls and the towed body among them).
//
// Generated floes have the lowest gids, from 0 on. Ids for the pieces of floes that split, floes given by hand, the
// towed body and walls follow: a pair (a, b) is kept with gid[a] < gid[b], and takes friction and restitution from b,
// the body with the higher gid (so the towed body's and a wall's own coefficients prevail over the ice's).
#ifndef BERGTOW_WORLD_H
#define BERGTOW_WORLD_H

#include "bergtow/base.h"
#include "bergtow/event.h"
#include "bergtow/outline.h"
#include "bergtow/shape.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef enum {
    BT_DYNAMIC,   ///< moved by forces and contacts
    BT_KINEMATIC, ///< velocity prescribed, infinite mass in contacts
    BT_STATIC,    ///< at rest for ever
} bt_motion;

typedef struct bt_vel { double x, y, w, unused; } bt_vel;      ///< m/s, m/s, rad/s
/// 1/(M + Δt K), 1/(I + Δt K_ω), see forces.h; 0 for infinite
typedef struct bt_inv { double m, i; } bt_inv;
typedef struct bt_pose { double x, y, yaw; } bt_pose;          ///< m, m, rad

/// Where a floe of a moving window belongs (window.h).
typedef struct bt_home {
    double x, y, yaw; ///< pose in the field as made, m, m, rad
    int32_t copy;     ///< which repetition of that place, in lengths of the period along x
} bt_home;

/// Drag of one body, coefficients multiplied out (model: quadratic in the relative velocity).
typedef struct bt_drag {
    double water_skin;  ///< ρ_w C_ws A, kg/m
    double water_form;  ///< ½ ρ_w C_w draft, kg/m²; along the hull of the outline (forces.h)
    double air_skin;    ///< ρ_a C_as A, kg/m
    double air_form;    ///< ½ ρ_a C_a sail, kg/m²
    double yaw;         ///< (ρ_w C_ws + ρ_a C_as) ∫r³dA, kg m²
    double tangential;  ///< share τ of the flow along a side in the moment of form drag (forces.h)
} bt_drag;

/// What of a floe's drag its neighbours leave (src/force/exposure.h), each from 0 to 1 = all of it.
typedef struct bt_exposure {
    double skin;        ///< share of its area that water and air see
    double water_form;  ///< of the form drag along its edges, in the water
    double air_form;    ///< the same in the air
} bt_exposure;

/// A body's vertices are its outline and, when that is not convex, its convex parts after it, each a polygon of its
/// own: contacts are found between parts, and act on the body. Rejected: parts as bodies that follow a parent.
/// Everything that counts, sorts, moves, hashes or writes bodies would have to tell the two apart; this way only the
/// pair search and the narrow phase know.
typedef struct bt_mark {
    uint8_t count;  ///< at the first vertex of the outline or a part: its number of vertices; 0 elsewhere
    uint8_t corner; ///< vertex of the outline that stands here
    uint8_t next;   ///< of the outline: the vertex after this one on its convex hull; itself where it lies in a bay
} bt_mark;

/// What bt_world_add needs of a body.
typedef struct bt_body_def {
    bt_motion motion;
    bool large;             ///< in no cell, on every rank, tested against all floes near its outline
    int n_vertices;
    const double *vertices; ///< [n_vertices][2] m, anticlockwise, centroid at the origin; convex without parts
    const bt_parts *parts;  ///< of an outline that is not convex (bt_outline_split), or NULL
    double x, y, yaw;       ///< m, m, rad
    double vx, vy, yaw_rate;///< m/s, m/s, rad/s
    /// M = m(1+C_m), kg, I(1+C_I), kg m²; ignored unless dynamic, but kept for the inertia force
    double mass, inertia;
    double added;           ///< m C_m, the part of the mass that Coriolis and the slope of the sea do not act on, kg
    double friction, restitution;
    double thickness;       ///< of ice, m; 0 = no ice: it is never crushed (crush.h)
    bt_drag drag;
} bt_body_def;

typedef struct bt_bodies {
    bt_idx n, cap;
    // hot
    bt_vel *vel;          ///< [n] U1 at the start of the step, U* after bt_forces_predict, U2 after the solve
    bt_inv *inv;          ///< [n]
    // warm
    bt_pose *pose;        ///< [n] X1 before advance, X2 after
    double *outline;      ///< [offset[n]][2] vertices, also those of parts, turned by yaw, relative to the centroid, m
    /// [n] length of path travelled through the water's frame by the fastest point of the outline, m (grows only)
    double *path;
    bt_vel *vel_start;    ///< [n] U1
    bt_vel *vel_free;     ///< [n] U*
    // cold
    bt_gid *gid;          ///< [n]
    int64_t *offset;      ///< [n+1] first vertex
    bt_mark *mark;        ///< [offset[n]]
    double *vertices;     ///< [offset[n]][2] own frame, m
    double *per_length;   ///< [offset[n]] 1/length of the edge that starts at each vertex, 1/m
    double *radius;       ///< [n] m
    double *area;         ///< [n] m²
    double *mass, *inertia; ///< [n] M kg, I kg m²
    double *share;        ///< [n] m/M, the body without its added mass over the whole
    double *friction, *restitution; ///< [n]
    double *thickness;    ///< [n] of ice, m; 0 = no ice
    bt_drag *drag;        ///< [n]
    bt_exposure *exposure; ///< [n] state: as it was last looked at
    uint8_t *motion;      ///< [n] bt_motion
    uint8_t *large;       ///< [n] 1 = in no cell
    /// [n] 1 = new, or moved by the position projection in the last step: not at rest whatever its velocity. To be set
    /// by code that changes a pose or velocity itself
    uint8_t *disturbed;
    int32_t (*cell)[2];   ///< [n] coordinates of its cell, see cells.h
    /// [n] periods along x that the body lies above its pose, which is wrapped; counted in every periodic world
    int32_t *lap;
    bt_home *home;        ///< [n] with a moving window, otherwise NULL
    int64_t cap_vertices;
    bt_idx *index_of;     ///< [n_global] position in storage of each gid, −1 = not held on this rank, or no body
    /// [n_global] 1 = no body has this id, on any rank: of a floe that has split, or of no piece yet
    uint8_t *gone;
    bt_gid n_global;      ///< ids
    bt_gid n_kept;        ///< of them, how many were kept for pieces of floes (step/splitting.h)
    bt_gid cap_global;
} bt_bodies;

/// Most contact laws, the program's own included; most that are added (contact.h); numbers `own` of one law; numbers
/// that one added law may form; numbers that all of the program's own laws form together.
enum {
    BT_MAX_LAWS = 8, BT_MAX_ADDED_LAWS = 3, BT_MAX_CONTACT_OWN = 8, BT_MAX_CONTACT_NUMBERS = 4, BT_MAX_LAW_NUMBERS = 12
};

/// Constants of the step.
typedef struct bt_params {
    double dt;             ///< Δt, s
    double x0, y0;         ///< low corner of the domain, m
    double period_x, period_y; ///< length of the periodic directions, m; 0 = not periodic
    double tolerance;      ///< natural-map residual at which the sweeps stop, m/s
    /// limit of the work of a step: 6 updates of every contact for each; with plain_sweeps, of sweeps
    int64_t max_sweeps;
    bool warm_start;
    bool plain_sweeps;     ///< sweeps over all contacts, without momentum (reference)
    bool plain_schedule;   ///< passes over the cells by one thread (reference)
    int64_t inner_sweeps;  ///< times a cell is swept before the next one has its turn
    double cell;           ///< least side of a cell in mean floe diameters, 0 = the default
    double slop;           ///< overlap left alone, m
    int64_t position_sweeps; ///< limit of the position projection: updates of every contact; with plain_sweeps, sweeps
    double rest_speed;     ///< approach below this has no restitution, m/s
    double size;           ///< mean floe diameter, sets cells and skin, m
    double law_own[BT_MAX_LAWS][BT_MAX_CONTACT_OWN]; ///< numbers of each contact law; units as it says
    int added_laws;        ///< contact laws of a program (contact.h) that act here: the first so many
    // fluid and frame (see forces.h)
    double water_u, water_v, air_u, air_v; ///< of the step at hand (environment.h), m/s
    double coriolis;       ///< dU/dt = coriolis × (−Uy, Ux), rad/s: +f in the geographic frame, −f in the basin's
    double balance_u, balance_v; ///< velocity in geostrophic balance with the tilt (Coriolis acts on U minus this), m/s
    double tilt_ax, tilt_ay;     ///< −g ∇η beyond that balance, m/s²
    bool tilt_moves_water;       ///< that is dU_w/dt (tilt: dynamic), which acts on the added mass, too
    // what floes leave of each other's drag (src/force/exposure.h)
    double lee;            ///< λ, length of the lee of an edge / its height, 0 = no edge is sheltered
    double draft;          ///< of ice / its thickness, ρ_i/ρ_w
    double lee_reach;      ///< farthest that any floe shelters, m
    bool covers;           ///< sheets that lie on each other share their skin drag
    double exposure_slow;  ///< floes past which fluids flow slower, m/s, are looked at less often
    int64_t exposure_steps; ///< steps from one look at it to the next, 0 = never: all bodies have all of their drag
} bt_params;

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

/// Where the wall time of a run goes: X(name, what is in it).
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
    int64_t n_points;        ///< contact points handed to the solver
    int64_t n_active;        ///< floes in cells that were looked at (the others rest)
    int64_t sweeps, position_sweeps;
    int64_t position_updates; ///< of contacts by the sweeps of the position projection
    bool projected;          ///< the position projection came to its end, or there was nothing to do
    int64_t contact_updates;    ///< of contacts by the sweeps
    int64_t contact_moves;      ///< of contacts by momentum between sweeps
    int64_t residual_checks; ///< of contacts by residual passes, and by velocities formed anew for them
    int64_t repeats;         ///< times the step was detected and solved again because its solution outran the margin
    bool outrun;             ///< it still did at the end: a contact may have been missed
    int64_t misjudged;       ///< rows at the end of pairs that pass, and pairs that meet without (contact/passing.h)
    double residual, residual_rms; ///< natural-map residual: max-norm and root mean square over the rows, m/s
    bool converged;
    bool locked;             ///< it did not, and some bodies cannot give way to any load (src/solve/islands.h)
    bool no_load;            ///< of these, some press on the towed body: its load has no bound
    double overlap;          ///< deepest overlap at the start of the step, m
    bool restitution_cut;    ///< rebounds would have added energy somewhere and were lowered there
    double contact_work;     ///< J
    bool added_energy;       ///< it is more than 0 by more than the residual and rounding explain
    /// numbers of the program's contact laws, in their order (src/contact/law.h): series, with units and meaning there
    double laws[BT_MAX_LAW_NUMBERS];
    double added[BT_MAX_ADDED_LAWS][1 + BT_MAX_CONTACT_NUMBERS]; ///< work (J) and numbers of laws that were added
    double momentum_residual;///< relative to the momentum exchanged in the step
    double kinetic_energy;   ///< at the end, J
    bt_phases phases;        ///< where its wall time went; `output` is not of the step
    bt_phases shared;        ///< of it, in passes that several threads share
    double in_team;          ///< of the phase under way
} bt_step_stats;

typedef struct bt_world {
    bt_params par;
    bt_bodies bodies;
    struct bt_cells *cells;
    struct bt_solver *solver;
    struct bt_tow *tow;      ///< NULL without towed body
    struct bt_window *window;///< NULL = the domain stands still
    struct bt_undisturbed *undisturbed; ///< NULL = no body is towed (step/undisturbed.h)
    struct bt_environment *environment; ///< current and wind in time (environment.h), NULL = as par says
    struct bt_forces *forces; ///< numbers of the force laws, and what they did to the towed body (forces.h)
    struct bt_domain *domain;///< division among ranks, NULL = all here (domain.h)
    const struct bt_exchange *exchange; ///< what the division does for space (exchange.h), NULL with it
    struct bt_shore *shore;  ///< fixed bodies that lie against each other (space/shore.h), NULL = none
    struct bt_splitting *splitting; ///< floes that split (step/splitting.h), NULL = none does
    struct bt_impacts *impacts; ///< loads of the towed body by collisions and without (impact.h), NULL = as a whole
    bt_gid towed;            ///< gid of the towed body, −1 = none
    int64_t step;            ///< steps done
    bt_events events;        ///< what happened when, the same on all ranks
    double drift_x, drift_y; ///< displacement of the water since time zero, m
    bt_step_stats stats;
} bt_world;

/// An empty world; release with bt_world_free. The constants of the step are copied.
bt_world *bt_world_create(const bt_params *p);
/// Release a world and all that it holds. NULL is ignored.
void bt_world_free(bt_world *w);

/// Add a body; returns its gid: bodies are numbered in the order in which they are added, floes first. The definition
/// is copied. Asserted, not checked: 3 to BT_MAX_VERTICES vertices, of an outline that bt_shape_fault (with parts:
/// bt_outline_fault) accepts; mass and inertia > 0 of a dynamic body; a world that is not yet distributed to ranks.
bt_gid bt_world_add(bt_world *w, const bt_body_def *d);

/// Number of vertices of the outline of body i.
static inline int bt_body_corners(const bt_bodies *b, bt_idx i) { return b->mark[b->offset[i]].count; }

/// First of the convex polygons that touch for body i, as its first vertex from the body's first: 0, the outline
/// itself, if that is convex.
static inline int bt_part_first(const bt_bodies *b, bt_idx i)
{
    const int n = bt_body_corners(b, i);
    return b->offset[i] + n < b->offset[i + 1] ? n : 0;
}

/// The one after it, −1 = none.
static inline int bt_part_next(const bt_bodies *b, bt_idx i, int part)
{
    const int next = part + b->mark[b->offset[i] + part].count;
    return b->offset[i] + next < b->offset[i + 1] ? next : -1;
}

/// Where body gid is stored on this rank now, −1 = not here.
static inline bt_idx bt_world_index(const bt_world *w, bt_gid gid) { return w->bodies.index_of[gid]; }

/// Index of the towed body, −1 = none. Every rank holds it.
static inline bt_idx bt_world_towed(const bt_world *w) { return w->towed < 0 ? -1 : w->bodies.index_of[w->towed]; }

/// Collective. One step Δt: forces, detection, solve, projection, advance; the order stands in src/step/step.c.
void bt_world_step(bt_world *w);

/// Bodies in each other at the present poses.
typedef struct bt_overlaps {
    int64_t pairs;        ///< that overlap by more than is allowed
    double deepest;       ///< of all pairs, m, 0 = none
    bt_gid a, b;          ///< the pair with it
} bt_overlaps;

/// Collective. Overlaps that this rank finds at the present poses; pairs deeper than allowed, m, are counted. Labels
/// and storage may be renewed: indices of bodies change then.
bt_overlaps bt_world_overlaps(bt_world *w, double allowed);

/// Collective. 64-bit hash of the state: poses and velocities by gid, memory of contact laws, step, window, drift of
/// the water, tow. Equal for equal states, however stored or distributed.
uint64_t bt_world_hash(const bt_world *w);

#ifdef __cplusplus
}
#endif

#endif
