// SPDX-License-Identifier: MIT
// The bodies and their frames in result.h5, each rank writing its block of them.
#ifndef BT_FRAMES_H
#define BT_FRAMES_H

#include "output/xdmf.h"
#include "output/frame.h"
#include "base/h5dataset.h"
#include "base/h5read.h"

enum { BT_FRAME_COLUMNS = 6 };

typedef struct bt_frames {
    bt_h5 *h;
    const bt_comm *comm;
    bt_map_axes axes;               ///< of the drawing: /xdmf
    int64_t n_floes, n_others;      ///< of all ranks: floes, other bodies
    int64_t first;                  ///< first body of this rank's block
    int64_t own_floes, own_others;  ///< of the block
    const bt_bodies *bodies;        ///< whose outlines are drawn; NULL = those of a copy:
    float *vertices;                ///< [vertices of the block][2] m, own frame
    uint8_t *n_vertices;            ///< [bodies of the block]
    int64_t floe_vertices, other_vertices; ///< of all ranks
    int64_t vertices_before;        ///< of floes on the ranks before this one
    hid_t time;
    bt_slab column[BT_FRAME_COLUMNS]; ///< pose, ...: frames.c
    int64_t towed;                  ///< index among the other bodies, −1 = none
    int branches;                   ///< of the tow line
    hid_t line_points, line_tension;///< with a line
    double *times;                  ///< [n] s
    bt_frame_line *lines;           ///< [n]; NULL without a line
    int64_t n, cap;                 ///< frames
} bt_frames;

/// Collective. Write /floes and /bodies, make /frames and /xdmf. *frames must be zeroed. Errors show in h5->status of
/// the rank concerned.
void bt_frames_create(bt_frames *frames, bt_h5 *h5, const bt_comm *comm, const bt_record_bodies *bodies,
                      const bt_map_axes *axes);
/// Write the group of ParaView's part of the next frame to path; returns path.
char *bt_frames_group(const bt_frames *frames, char path[64]);

/// Collective. Add a frame, whose group must exist: rows of this rank's block. Returns the same status on all ranks;
/// after a failure the file stays as at the last flush.
bt_status bt_frames_add(bt_frames *frames, double time, const bt_frame_row *rows, const bt_frame_line *line);
/// Read frame k of an older file, for bt_frames_add: rows of all bodies.
void bt_frames_read(const bt_frames *frames, bt_h5_reader *old, int64_t k, double *time, bt_frame_row *rows,
                    bt_frame_line *line);
void bt_frames_close(bt_frames *frames); ///< release its memory; datasets close with the file

#endif
