// SPDX-License-Identifier: MIT
// The frames for ParaView: an XML description of the datasets in result.h5.
#ifndef BT_XDMF_H
#define BT_XDMF_H

#include "bergtow/case.h"
#include "bergtow/field.h"
#include "output/frame.h"

// --- axes ------------------------------------------------------------------------------------------------------------

// Axes of drawings of the world: east to the right and north up, about an origin near the ice.

/// Drawn coordinates are (y, x) of the geographic frame, that is east and north, and (x, y) of the basin's, each
/// relative to the origin.
typedef struct bt_map_axes {
    bool swapped;        ///< geographic: seen from above its x and y run clockwise
    double origin[2];    ///< x, y of the case at the origin of the drawing, m
    char crs[112];       ///< reference system in which the origin is known, for PROJ; "" if none
    double crs_place[2]; ///< first and second coordinate of the origin there, m
} bt_map_axes;

/// Axes for a case and the map of its field; counts: NULL without a map.
bt_map_axes bt_map_axes_of(const bt_case *input, const bt_outline_counts *counts);

/// Names of the two axes, for a reader of the file.
static inline const char *bt_map_axes_names(const bt_map_axes *axes)
{
    return axes->swapped ? "east (y), north (x)" : "x, y";
}

/// x, y of the case as drawn, m.
static inline void bt_map_axes_point(const bt_map_axes *axes, double x, double y, double drawn[2])
{
    drawn[axes->swapped] = x - axes->origin[0];
    drawn[!axes->swapped] = y - axes->origin[1];
}

/// A number (n = 1) or a vector (2) as drawn; ParaView's vectors have three components.
static inline void bt_map_axes_value(const bt_map_axes *axes, const double *x, int n, float *drawn)
{
    if (n == 1) drawn[0] = (float)x[0];
    else drawn[axes->swapped] = (float)x[0], drawn[!axes->swapped] = (float)x[1], drawn[2] = 0;
}

/// Pieces of floes in a frame.
typedef struct bt_piece_count {
    int64_t cells, points;
} bt_piece_count;

/// Sizes of the datasets in result.h5.
typedef struct bt_xdmf {
    int64_t n_floes, n_bodies;                 ///< cells: floes, other bodies
    int64_t floe_vertices, body_vertices;      ///< points
    int64_t towed;                             ///< index among the other bodies, −1 = none
    int branches;                              ///< of the tow line
    bt_map_axes axes;
    const double *time;                        ///< [n_frames] s
    const bt_frame_line *line;                 ///< [n_frames], if there are branches
    int64_t n_frames;
    const struct bt_piece_count *pieces;       ///< [n_frames] NULL: floes do not split
} bt_xdmf;

/// Cell type of a polygon in XDMF's mixed topology, followed by the number of its vertices and their indices.
#define BT_XDMF_POLYGON 3

#define BT_XDMF_HEAD                                                                                                   \
    "<?xml version=\"1.0\" encoding=\"utf-8\"?>\n<Xdmf Version=\"2.0\">\n  <Domain>\n"                                \
    "    <Grid Name=\"frames\" GridType=\"Collection\" CollectionType=\"Temporal\">\n"

/// frames.xdmf as text; the caller frees it.
char *bt_xdmf_text(const bt_xdmf *xdmf);

#endif
