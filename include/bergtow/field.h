// SPDX-License-Identifier: MIT
// The ice field at time zero: floes as convex polygons with pose and thickness; made from a seed, or read back.
#ifndef BERGTOW_FIELD_H
#define BERGTOW_FIELD_H

#include "bergtow/base.h"
#include "bergtow/case.h"
#include "bergtow/comm.h"

typedef struct bt_field {
    bt_idx n;              ///< floes
    int64_t *offsets;      ///< [n+1] first vertex of each floe
    double *vertices;      ///< [offsets[n]][2] m, body frame: anticlockwise about the centroid
    double *pose;          ///< [n][3] x m, y m, yaw rad
    double *thickness;     ///< [n] m
    double *area;          ///< [n] m²
    double ice_area;       ///< m², the area that concentration refers to: ice region less the body's footprint
    double concentration;  ///< Σ area / ice_area as made
    bt_idx cap;            ///< floes the arrays have room for
    int64_t cap_vertices;  ///< vertices they have room for
} bt_field;

void bt_field_init(bt_field *f);
void bt_field_free(bt_field *f);

/// Append one floe; vertices [nv][2] are moved so that their centroid is the origin and (x, y) is shifted with them.
void bt_field_add(bt_field *f, int nv, const double *v, double x, double y, double yaw, double thickness);

/// Make the field of a case from its seed: tessellate, shrink to the asked concentration, shake to a random state,
/// check. Reproducible from the case alone. f has been initialised; what it held is released. Errors: BT_ERR_CASE (impossible packing, named), BT_ERR_NUMERIC.
bt_status bt_field_generate(const bt_case *c, bt_field *f, bt_errors *err);

/// Collective. The field of rank 0 to all ranks; f has been initialised.
void bt_field_share(const bt_comm *c, bt_field *f);

/// Write to / read from an HDF5 file: /floes/{vertices,offsets,pose,thickness,area}, attributes on /floes.
/// The writer leaves a complete file or none. The reader checks every value (finite, convex, sizes, offsets) and names file
/// and floe in its errors; f has been initialised, what it held is released, and it is empty after an error.
/// Errors: BT_ERR_IO from the system, BT_ERR_CASE for what the file holds.
bt_status bt_field_write(const bt_field *f, const bt_case *c, const char *path, bt_errors *err);
bt_status bt_field_read(bt_field *f, const char *path, bt_errors *err);

/// Largest overlap depth of any two floes, and of any floe with the closed walls, the towed body and the floes given by
/// hand, m (0 = none). By separating axes, independent of the contact detection.
double bt_field_overlap(const bt_case *c, const bt_field *f);

#endif
