// SPDX-License-Identifier: MIT
// The frames for ParaView: an XML description of what is in result.h5.
#ifndef BT_XDMF_H
#define BT_XDMF_H

#include "bergtow/base.h"

/// Sizes of what result.h5 holds.
typedef struct bt_xdmf {
    int64_t n_floes, n_bodies;                 ///< cells: floes, other bodies
    int64_t floe_vertices, body_vertices;      ///< points
    const double *time;                        ///< [n_frames] s
    int64_t n_frames;
} bt_xdmf;

/// The polygons of n bodies in XDMF's mixed form (type, number of vertices, vertices): fills out, if not NULL, and
/// returns its length. offsets: [n+1], counted from the first of these bodies' vertices.
int64_t bt_xdmf_topology(int64_t n, const int64_t *offsets, int32_t *out);

/// frames.xdmf as text; the caller frees it.
char *bt_xdmf_text(const bt_xdmf *x);

#endif
