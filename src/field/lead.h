// SPDX-License-Identifier: MIT
// Ice management: the lead that a vessel has opened ahead of the towed body, cut into the ice field before the run.
//
// The lead is a strip of a width about a polyline, with round joints and square ends. It takes the floes that overlap
//   it, whole ones:
//   channel   they are gone
//   managed   they are cut by straight cuts through the centroid, across their longer extent (the axis of their largest
//             second moment), until no piece that overlaps the strip has more than the area of a disc of the given
//             diameter. Pieces that come to lie outside the strip stay as large as they are
// Why whole floes, and not along the strip's edges: a ship breaks a floe or pushes it away, and does not saw it along
// its own side. A cut takes a slit of 1e-4 of the piece diameter, so that pieces do not overlap by rounding (assumed);
// edges shorter than 1 % of a piece are cut off. Pieces are thicker than their floe by what that has cost: mass is
// kept. Floes given by hand are left as they are. That ice which was there lies elsewhere (under the ice, at the sides
// of the lead) is not modelled.
#ifndef BERGTOW_LEAD_H
#define BERGTOW_LEAD_H

#include "bergtow/case.h"
#include "bergtow/field.h"

typedef struct bt_lead {
    const char *name;         ///< of the case, for messages
    bt_lead_mode mode;
    double width, floe_size;  ///< m
    int n;                    ///< points of the path, at least 2
    const double *path;       ///< [n][2] m
    double x0, y0;            ///< low corner of the domain, m
    double period_x, period_y;///< m; 0 = neither floes nor the lead go round the domain
} bt_lead;

/// What opening a lead did.
typedef struct bt_lead_stats {
    bt_lead_mode mode;
    double width, length;     ///< of the lead, m
    int64_t taken;            ///< floes that overlapped it
    double area_taken;        ///< of those, m²
    int64_t pieces;           ///< that those were cut into
    double mean_piece;        ///< mean diameter of the circle of a piece's area, m; 0 without pieces
    double concentration_before, concentration_after; ///< of the ice region
} bt_lead_stats;

/// Cut the lead into a field: floes keep their order, pieces stand in the place of their floe. ice_area of the field
/// stays, its concentration is renewed. Errors: BT_ERR_CASE (more pieces than can be simulated; the field is left as it
/// was).
bt_status bt_lead_cut(const bt_lead *lead, bt_field *field, bt_lead_stats *stats, bt_errors *err);

/// The lead of a case, along the planned path of the body; without one (lead.mode none) nothing is done. Errors as
/// above.
bt_status bt_lead_open(const bt_case *input, bt_field *field, bt_lead_stats *stats, bt_errors *err);

/// One line on stdout, as in the summary; nothing without a lead.
void bt_lead_stats_print(const bt_lead_stats *stats);

#endif
