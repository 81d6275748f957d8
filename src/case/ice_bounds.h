// SPDX-License-Identifier: MIT
// Admissible ice, whatever its source: one gate for floes given by hand, GeoJSON outlines, HDF5 fields and checkpoints.
#ifndef BT_ICE_BOUNDS_H
#define BT_ICE_BOUNDS_H

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
    double exact;     ///< largest relative difference between this area and that of the outline
} bt_ice_floe;

/// Bounds of the thickness of any floe, m. A thickness law is cut there.
void bt_ice_thickness_range(double *least, double *most);

/// The part of a floe that is at fault.
typedef enum { BT_ICE_THICKNESS, BT_ICE_POSE, BT_ICE_OUTLINE, BT_ICE_AREA } bt_ice_part;

/// Why this cannot be a floe, in words that complete "floe 7: ", or NULL; part: what is at fault (may be NULL).
/// Thickness, place and extent must be within the ranges of ice.thickness, domain.x0 and domain.length in the table of
/// keys. That the outline is valid, convex or in convex parts, has been checked before.
const char *bt_ice_floe_fault(const bt_ice_floe *floe, char why[BT_ICE_WHY], bt_ice_part *part);

/// Why these floes together cannot be an ice field, or NULL: a mean size (diameter of the circle of equal area) below
/// BT_LEAST_SIZE or beyond ice.size, a meaningless area of the ice, a concentration below BT_LEAST_CONCENTRATION or
/// above 1. ice_area: area that the concentration refers to, m². Of a field without floes only ice_area is checked.
/// kept: for a checkpoint, whose field a lead may have cut into pieces, or nearly removed.
const char *bt_ice_field_fault(bool kept, int64_t n, double sum_size, double sum_area, double ice_area,
                               char why[BT_ICE_WHY]);

/// The same for a field in the domain of a case, whose size the mean size and the ice area must not exceed.
const char *bt_ice_domain_fault(const bt_case *input, const bt_field *field, char why[BT_ICE_WHY]);

/// Concentration to which closing walls bring ice of this area, m², all floes, by the end of the run. INFINITY if the
/// body takes all of the room; 0 if no wall closes, or if ice can leave, raft or be crushed.
double bt_ice_closed(const bt_case *input, double area);

/// Warn of walls that pack the ice (estimate.phi_j).
void bt_ice_warn_closed(const bt_case *input, double area, bt_errors *warnings);

/// Warn of walls that close so slowly that each contact, if floes of this mean size, m, share the closing among
/// themselves, may close by the tolerance of the solver: the ice counts as at rest.
void bt_ice_warn_slow(const bt_case *input, double size, bt_errors *warnings);

/// Warn of a mean thickness that looks like one in centimetres, of ice too thin to split, and of an odd toughness or
/// strength. size, thickness: of the mean floe, m.
void bt_ice_warn(const bt_case *input, double size, double thickness, bt_errors *warnings);

#endif
