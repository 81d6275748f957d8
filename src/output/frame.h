// SPDX-License-Identifier: MIT
// Bodies and frames in the form that the recorder takes.
#ifndef BT_FRAME_H
#define BT_FRAME_H

#include "bergtow/comm.h"
#include "bergtow/field.h"
#include "bergtow/world.h"

/// Which bodies each rank records: first[k] up to first[k + 1] on rank k. Floes are distributed in equal blocks in the
/// order of their ids; the last rank records the other bodies. first: [size + 1].
void bt_record_blocks(const bt_comm *comm, bt_idx n_floes, bt_idx n_bodies, int64_t *first);

/// Bodies as the recorder needs them; the arrays belong to the caller, and hold the bodies of this rank's block: floes
/// first, then (on the last rank) other bodies. Without MPI the block is everything.
typedef struct bt_record_bodies {
    bt_idx n_floes, n_bodies;    ///< of all ranks; bodies = floes + hand-made fixed bodies + towed body + walls
    const int64_t *offsets;      ///< [bodies of the block + 1]
    const double *vertices;      ///< [offsets[end] − offsets[0]][2] m, body frame, from the block's first
    const double *thickness;     ///< [bodies of the block] m (draft + sail of the towed body, 0 for walls)
    const double *area;          ///< [bodies of the block] m²
    const int32_t *fixed;        ///< [bodies of the block] 1: a body that nothing moves; NULL: none is
    const char *const *names;    ///< [n_bodies − n_floes] "towed body", "wall x low", ...; on rank 0
    bt_idx towed;                ///< index of the towed body among all, −1 = none
    int branches;                ///< of the tow line, 0 = none
    /// if this rank holds them all while the record is open: frames draw their outlines; NULL = those of a copy
    const bt_bodies *all;
    const bt_outline_counts *outlines; ///< of the map from which the floes came; NULL: none
} bt_record_bodies;

/// A body in a frame.
typedef struct bt_frame_row {
    double x, y, yaw;        ///< m, m, rad
    double contact_force;    ///< largest normal force on the floe in this step, N; not recorded for other bodies
    double speed;            ///< of the centroid, m/s
    double vx, vy;           ///< its velocity, m/s; stored in single precision
    double fx, fy;           ///< sum of all contact forces on the body in this step, N; also in single precision
} bt_frame_row;
enum { BT_FRAME_ROW = sizeof(bt_frame_row) / sizeof(double) };

/// A piece of a floe in a frame.
typedef struct bt_piece_row {
    double piece;            ///< number of the piece, from 0
    bt_frame_row row;
    double thickness;        ///< m
} bt_piece_row;
enum { BT_PIECE_ROW = sizeof(bt_piece_row) / sizeof(double) };

/// Numbers that lie side by side in one of these rows and are recorded together: n, from this byte on.
typedef struct bt_frame_part {
    size_t at;
    int n;
} bt_frame_part;
#define BT_FRAME_PART(type, member, n) {offsetof(type, member), n}
static inline const double *bt_frame_numbers(const void *row, bt_frame_part part)
{
    return (const void *)((const char *)row + part.at);
}

/// The tow line in a frame: each branch from the hull to its towing end, or at the hull alone once it is broken.
enum { BT_FRAME_BRANCHES = 2 };
typedef struct bt_frame_line {
    double point[BT_FRAME_BRANCHES][2][2]; ///< m, relative to the body as drawn
    double tension[BT_FRAME_BRANCHES];     ///< N
} bt_frame_line;

#endif
