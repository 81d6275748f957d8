// SPDX-License-Identifier: MIT
// What ice may be, whatever way it comes in: one gate for floes given by hand, GeoJSON outlines, HDF5 fields and
// checkpoints.
#ifndef BT_ICE_BOUNDS_H
#define BT_ICE_BOUNDS_H

#include "bergtow/base.h"
#include "bergtow/case.h"
#include "bergtow/field.h"

enum { BT_ICE_WHY = 240 };

/// One floe as an input gives it.
typedef struct bt_ice_floe {
    int n;            ///< vertices
    const double *v;  ///< [n][2] m, about the centroid
    double x, y, yaw; ///< m, m, rad
    double thickness; ///< m
    double area;      ///< m²; NaN: not given
    double exact;     ///< relative difference that the area may have from that of the outline
} bt_ice_floe;

/// Bounds of the thickness of any floe, m. The law of a made field is cut there.
void bt_ice_thickness_range(double *least, double *most);

/// What of a floe is at fault.
typedef enum { BT_ICE_THICKNESS, BT_ICE_POSE, BT_ICE_OUTLINE, BT_ICE_AREA } bt_ice_part;

/// Why it cannot be a floe, in words that complete "floe 7: ", and which part of it, or NULL. Thickness, place and
/// extent are held against the ranges of ice.thickness, domain.x0 and domain.length in the table of keys. That the
/// outline is one, convex or in convex parts, has been seen before. part: may be NULL.
const char *bt_ice_floe_fault(const bt_ice_floe *floe, char why[BT_ICE_WHY], bt_ice_part *part);

/// Why these floes together cannot be an ice field, or NULL: mean size (diameter of the circle of equal area) below
/// BT_LEAST_SIZE or beyond ice.size, area of the ice without a meaning, concentration below BT_LEAST_CONCENTRATION or
/// above 1. ice_area: what the concentration refers to, m². A field without floes needs a sound ice_area alone. kept:
/// of a checkpoint, whose field a lead may have cut into pieces, or taken nearly all of.
const char *bt_ice_field_fault(bool kept, int64_t n, double sum_size, double sum_area, double ice_area,
                               char why[BT_ICE_WHY]);

/// The same of a field, and of its floes in the domain of a case: mean size and ice area no larger than that.
const char *bt_ice_domain_fault(const bt_case *input, const bt_field *field, char why[BT_ICE_WHY]);

/// Concentration to which closing walls bring ice of this area, all floes, by the end of the run: INFINITY where the
/// body takes all of the room; 0 where none close, or ice can leave, raft or be crushed.
double bt_ice_closed(const bt_case *input, double area);

/// Warn of walls that pack it (estimate.phi_j).
void bt_ice_warn_closed(const bt_case *input, double area, bt_errors *warnings);

/// Warn of walls that close so slowly that floes of this mean size, m, which share it out among themselves, take it for
/// rest: a contact may close by the tolerance of the solver.
void bt_ice_warn_slow(const bt_case *input, double size, bt_errors *warnings);

/// Warn of a mean thickness that looks like one in centimetres, and of one at which floes do not split. size,
/// thickness: of the mean floe, m.
void bt_ice_warn(const bt_case *input, double size, double thickness, bt_errors *warnings);

#endif
