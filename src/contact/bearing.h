// SPDX-License-Identifier: MIT
// The length on which each contact point bears, where outlines in several polygons touch: parts of a body that is not
// convex, or pieces of a shore; for laws that bound a load by the overlap of the outlines.
//
// A face is what two outlines touch each other with along one normal (up to BT_SQUARE). Its load is that of one
// displacement of the body: at the depth y the overlaps of all pairs of polygons cover stretches of the tangent line,
// and the face bears on their union. So a piece behind another, or two pieces that overlap, add nothing, and corners,
// seams and the order of pieces need no rule of their own.
//
// The load, uniform on these stretches, is replaced by forces at the corners that y reaches: between two of them by the
// lever rule, beyond the last all at the last. Points at seams and bays (bt_contacts_at_corner) bear nothing, since a
// face in one piece has none there. A corner stands where detect.c has merged it to; where no corner is as near as the
// nearest point (a corner in a bay whose edges end there), that point is one. A corner that is reached after the first,
// by `late`, does its work from there on.
//
// Rejected: each overlap borne by the points found on it, less what others bear (this module's predecessor). Each has
// its own gap and depth, and they add up to one face only where all are alike.
#ifndef BERGTOW_BEARING_H
#define BERGTOW_BEARING_H

#include "contact/law_pair.h"

/// Note a manifold as found, before points are merged: in the order of pairs.
void bt_bearing_note(bt_cell *cell, bt_idx pair, const bt_manifold *found);

/// Find the overlaps of each face, and the corners that bear it; after the contacts have been made and the records
/// read.
void bt_bearing_assign(const bt_world *world, bt_cell *cell);

/// The points of the face of contact j that take part, point[]: of its own; NULL if both outlines are single polygons.
const bt_closing *bt_bearing_closing(const bt_world *world, const bt_cell *cell, bt_idx j);

/// What one point bears at two depths of its face, lengths, m, and areas, m²; its share in the least length of the
/// face; how much later than the nearest it is reached, m, 0 if it is not.
typedef struct bt_bearing {
    double length[2], area[2], least, late;
} bt_bearing;

/// Those of both points of contact j, of a face, when b has moved by depth[0] and depth[1], m, towards a.
void bt_bearing_of(const bt_world *world, const bt_cell *cell, bt_idx j, const double depth[2], bt_bearing of[2]);

/// Length, m, on which the face of contact j bears at one depth; *area, m².
double bt_bearing_whole(const bt_world *world, const bt_cell *cell, bt_idx j, double depth, double *area);

/// Share of contact j in the load of its face, by the impulses of the step.
double bt_bearing_share(const bt_world *world, const bt_cell *cell, bt_idx j);

#endif
