// SPDX-License-Identifier: MIT
// The frames for ParaView: an XML description of what is in result.h5.
#ifndef BT_XDMF_H
#define BT_XDMF_H

#include "output/map_axes.h"
#include "output/record.h"

/// Pieces of floes in a frame.
typedef struct bt_piece_count {
    int64_t cells, points;
} bt_piece_count;

/// Sizes of what result.h5 holds.
typedef struct bt_xdmf {
    int64_t n_floes, n_bodies;                 ///< cells: floes, other bodies
    int64_t floe_vertices, body_vertices;      ///< points
    int64_t towed;                             ///< which of the other bodies, −1 = none
    int branches;                              ///< of the tow line
    bt_map_axes axes;
    const double *time;                        ///< [n_frames] s
    const bt_frame_line *line;                 ///< [n_frames], where there are branches
    int64_t n_frames;
    const struct bt_piece_count *pieces;       ///< [n_frames] NULL: floes do not split
} bt_xdmf;

/// What stands before each polygon in XDMF's mixed topology: this, the number of its vertices, then the vertices.
#define BT_XDMF_POLYGON 3

#define BT_XDMF_HEAD                                                                                                   \
    "<?xml version=\"1.0\" encoding=\"utf-8\"?>\n<Xdmf Version=\"2.0\">\n  <Domain>\n"                                \
    "    <Grid Name=\"frames\" GridType=\"Collection\" CollectionType=\"Temporal\">\n"

/// frames.xdmf as text; the caller frees it.
char *bt_xdmf_text(const bt_xdmf *x);

#endif
