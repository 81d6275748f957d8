// SPDX-License-Identifier: MIT
// Ice management: the lead that a vessel has opened ahead of the towed body, cut into the ice field before the run.
//
// The lead is a strip of given width along a polyline, with round joints and square ends. It affects whole floes, all
// those that overlap it:
//   channel   they are removed
//   managed   they are cut straight through the centroid, across their longer extent (the axis of their largest
//             second moment), until no piece that overlaps the strip is larger in area than a disc of the given
//             diameter. Pieces outside the strip are not cut further
// Why whole floes, and not cuts along the strip's edges: a ship breaks a floe or pushes it away, and does not saw it
// along its own side. A cut removes a slit of 1e-4 of the piece diameter (assumed), so that rounding does not make
// pieces overlap; edges shorter than 1 % of a piece are removed. Pieces are thicker than their floe to make up for
// this, so mass is conserved. Floes given by hand are left as they are. Where the displaced ice goes (under the ice, to
// the sides of the lead) is not modelled.
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
    double period_x, period_y;///< m; 0 = the domain does not wrap
} bt_lead;

/// What opening a lead did.
typedef struct bt_lead_stats {
    bt_lead_mode mode;
    double width, length;     ///< of the lead, m
    int64_t taken;            ///< floes that overlapped it
    double area_taken;        ///< of those, m²
    int64_t pieces;           ///< into which those were cut
    double mean_piece;        ///< mean diameter of circles of their areas, m; 0 without pieces
    double concentration_before, concentration_after; ///< of the ice region; NaN = unknown
} bt_lead_stats;

/// Cut the lead into a field. Floes keep their order, and pieces take the place of their floe. ice_area of the field
/// stays, its concentration is updated. Errors: BT_ERR_CASE (more pieces than can be simulated; the field stays as it
/// was).
bt_status bt_lead_cut(const bt_lead *lead, bt_field *field, bt_lead_stats *stats, bt_errors *err);

/// Open the lead of a case along the planned path of the body; with lead.mode none, do nothing. Errors as above.
bt_status bt_lead_open(const bt_case *input, bt_field *field, bt_lead_stats *stats, bt_errors *err);

/// One line on stdout, as in the summary; nothing without a lead.
void bt_lead_stats_print(const bt_lead_stats *stats);

#endif
