// SPDX-License-Identifier: MIT
// Floes that split, in result.h5: the splits, the pieces they made, and these pieces in the frames. Written by rank 0;
// only in runs whose floes may split.
//
//     /splits     [S] time, parent, generation, mode, ratio, thickness; crack [S][4]
//     /pieces     [2 S] area, offsets [2 S + 1], vertices: split k made the pieces 2 k (the larger) and 2 k + 1
//     /frames     piece_end [T]: end of each frame's rows of its existing pieces: piece, piece_pose, ...
//     /xdmf/NNNNNN/piece_...     for ParaView
//
// A floe is a row of /floes, or, from n_floes on, a piece. A floe that has split has no numbers (NaN) in later frames.
#ifndef BT_PIECE_STORE_H
#define BT_PIECE_STORE_H

#include "base/h5read.h"
#include "base/h5util.h"
#include "output/xdmf.h"
#include "output/frame.h"
#include "output/gather.h"

struct bt_splitting;

enum { BT_PIECE_COLUMNS = 7, BT_SPLIT_COLUMNS = 7 };

typedef struct bt_piece_store {
    bt_h5 *h;                       ///< NULL: floes do not split
    const struct bt_splitting *s;
    const bt_roster *roster;
    int64_t n_bodies;               ///< floes and bodies at the start
    double dt;
    bt_map_axes axes;
    hid_t split[BT_SPLIT_COLUMNS], area, offsets, vertices, end, piece[BT_PIECE_COLUMNS];
    int64_t n_splits, n_vertices;   ///< written
    int64_t n_rows, n_frames;       ///< in the frames so far
    bt_piece_count *frame;          ///< [n_frames] for ParaView
    int64_t cap;
} bt_piece_store;

/// Set up the store, on rank 0 before the first frame. All arguments must stay valid.
void bt_piece_store_create(bt_piece_store *store, bt_h5 *h5, const struct bt_splitting *splitting,
                           const bt_roster *roster, int64_t n_bodies, double dt, const bt_map_axes *axes);
/// Write the splits since the last call.
void bt_piece_store_write(bt_piece_store *store);
/// Write the pieces [n] of a frame, in the order of their ids; the frame is already in /xdmf.
void bt_piece_store_frame(bt_piece_store *store, const bt_piece_row *rows, int64_t n);
/// Read the pieces [*n] of frame k of an older file, for bt_piece_store_frame; the caller frees them.
bt_piece_row *bt_piece_store_read(bt_h5_reader *old, int64_t k, int64_t *n);
void bt_piece_store_close(bt_piece_store *store);

#endif
