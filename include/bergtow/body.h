// SPDX-License-Identifier: MIT
// The bodies of a world.
//
// Data layout. A body has a hot part, read by sweeps (velocity, 32 bytes, in every sweep; inverse inertia, 16 bytes, if
// contacts are not in batches, and when batches are packed), a warm part used once per step (pose, rotated outline,
// travelled path), and a cold part (mass, drag, polygon in its own frame), read at most a few times per step. Each
// member is a separate array over the bodies in storage order, which is the order of the cells (cells.h): neighbours in
// space are neighbours in memory.
// Every reference between bodies is a bt_idx into that order and changes when bodies change their cell; the permanent
// name of a body is its global id (gid). Every order on which the result depends follows from gids and cells, never
// from storage or rank. A rank holds the bodies of its cells, those of neighbouring cells (ghosts), and all large
// bodies (including walls and the towed body).
//
// Generated floes have the lowest gids, from 0 on. Ids for the pieces of floes that split, floes given by hand, the
// towed body and walls follow: a pair (a, b) has gid[a] < gid[b], and takes friction and restitution from b, so that
// the coefficients of the towed body and of walls prevail over those of ice.
#ifndef BERGTOW_BODY_H
#define BERGTOW_BODY_H

#include "bergtow/base.h"
#include "bergtow/outline.h"
#include "bergtow/shape.h"

BT_BEGIN_C

typedef enum {
    BT_DYNAMIC,   ///< moved by forces and contacts
    BT_KINEMATIC, ///< velocity prescribed, infinite mass in contacts
    BT_STATIC,    ///< at rest for ever
} bt_motion;

typedef struct bt_vel { double x, y, w, unused; } bt_vel;      ///< m/s, m/s, rad/s
/// 1/(M + Δt K), 1/(I + Δt K_ω), see forces.h; 0 for infinite
typedef struct bt_inv { double m, i; } bt_inv;
typedef struct bt_pose { double x, y, yaw; } bt_pose;          ///< m, m, rad

/// Home of a floe of a moving window (window.h).
typedef struct bt_home {
    double x, y, yaw; ///< pose in the field as made, m, m, rad
    int32_t copy;     ///< number of its repetition, in periods along x
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

/// Shares of a floe's drag that its neighbours leave (src/force/exposure.h), from 0 to 1.
typedef struct bt_exposure {
    double skin;        ///< share of its area exposed to water and air
    double water_form;  ///< share of the form drag along its edges, in the water
    double air_form;    ///< the same in the air
} bt_exposure;

/// A body's vertices are its outline, followed, if that is not convex, by its convex parts, each a separate polygon:
/// contacts are found between parts, and act on the body. Rejected: parts as bodies that follow a parent. All code that
/// counts, sorts, moves, hashes or writes bodies would have to distinguish the two; now only the pair search and the
/// narrow phase do.
typedef struct bt_mark {
    uint8_t count;  ///< at the first vertex of the outline or a part: its number of vertices; 0 elsewhere
    uint8_t corner; ///< the vertex of the outline that this is
    uint8_t next;   ///< of the outline: the next vertex on its convex hull; itself if it lies in a bay
} bt_mark;

/// Definition of a body for bt_world_add.
typedef struct bt_body_def {
    bt_motion motion;
    bool large;             ///< in no cell, on every rank, tested against all floes near its outline
    int n_vertices;
    const double *vertices; ///< [n_vertices][2] m, anticlockwise, centroid at the origin; convex without parts
    const bt_parts *parts;  ///< parts of an outline that is not convex (bt_outline_split), or NULL
    double x, y, yaw;       ///< m, m, rad
    double vx, vy, yaw_rate;///< m/s, m/s, rad/s
    /// M = m(1+C_m), kg, I(1+C_I), kg m²; ignored unless dynamic, but kept for the inertia force
    double mass, inertia;
    double added;           ///< m C_m, the part of the mass not subject to Coriolis and the slope of the sea, kg
    double friction, restitution;
    double thickness;       ///< of ice, m; 0 = not ice: it is never crushed (crush.h)
    bt_drag drag;
} bt_body_def;

typedef struct bt_bodies {
    bt_idx n, cap;
    // hot
    bt_vel *vel;          ///< [n] U1 at the start of the step, U* after bt_forces_predict, U2 after the solve
    bt_inv *inv;          ///< [n]
    // warm
    bt_pose *pose;        ///< [n] X1 before advance, X2 after
    double *outline;      ///< [offset[n]][2] vertices, also of parts, rotated by yaw, relative to the centroid, m
    /// [n] length of path of the fastest point of the outline relative to the water, m (only grows)
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
    double *share;        ///< [n] m/M, mass without over mass with added mass
    double *friction, *restitution; ///< [n]
    double *thickness;    ///< [n] of ice, m; 0 = not ice
    bt_drag *drag;        ///< [n]
    bt_exposure *exposure; ///< [n] state: as last evaluated
    uint8_t *motion;      ///< [n] bt_motion
    uint8_t *large;       ///< [n] 1 = in no cell
    /// [n] 1 = new, or moved by the position projection in the last step: not at rest whatever its velocity. Must be
    /// set by code that changes a pose or velocity directly
    uint8_t *disturbed;
    int32_t (*cell)[2];   ///< [n] coordinates of its cell, see cells.h
    /// [n] periods along x to add to the wrapped pose for the unwrapped place; counted in every periodic world
    int32_t *lap;
    bt_home *home;        ///< [n] with a moving window, otherwise NULL
    int64_t cap_vertices;
    bt_idx *index_of;     ///< [n_global] position in storage of each gid, −1 = not held on this rank, or no body
    /// [n_global] 1 = no body has this id on any rank: the floe has split, or the piece does not exist yet
    uint8_t *gone;
    bt_gid n_global;      ///< ids
    bt_gid n_kept;        ///< of these, ids reserved for pieces of floes (step/splitting.h)
    bt_gid cap_global;
} bt_bodies;

/// Number of vertices of the outline of body i.
static inline int bt_body_corners(const bt_bodies *bodies, bt_idx i) { return bodies->mark[bodies->offset[i]].count; }

/// First convex polygon of body i, by its first vertex within the body: 0, the outline itself, if convex.
static inline int bt_part_first(const bt_bodies *bodies, bt_idx i)
{
    const int n = bt_body_corners(bodies, i);
    return bodies->offset[i] + n < bodies->offset[i + 1] ? n : 0;
}

/// The next convex polygon, −1 = none.
static inline int bt_part_next(const bt_bodies *bodies, bt_idx i, int part)
{
    const int next = part + bodies->mark[bodies->offset[i] + part].count;
    return bodies->offset[i] + next < bodies->offset[i + 1] ? next : -1;
}

BT_END_C

#endif
