// SPDX-License-Identifier: MIT
// The length on which each contact point bears, for laws that bound a load by the overlap of the outlines.
//
// The overlap of two convex polygons is borne by the one or two points of their contact. Where several polygons of an
// outline touch a body (parts of a body that is not convex, pieces of a shore), one contact may have to bear the
// overlap of others too: points found twice are merged (contact/detect.c), and a polygon that only overlaps deeper in
// has no point at all, for its corners do not count along the normal (contact/manifold.c). So
//   the points found on the overlap of two polygons share it; if one has been merged, the nearest point that is left
//   takes its share; if none was found, that point takes the whole overlap.
// Then a face that is cut bears what it would bear in one piece, and at the same places; so does a corner at which
// cuts end. Nothing is borne twice: the overlaps of two parts can cover the same stretch of the face at different
// depths, and pieces of a shore may overlap.
#ifndef BERGTOW_BEARING_H
#define BERGTOW_BEARING_H

#include "contact/law_pair.h"

/// Note a manifold as found, before points are merged: in the order of pairs.
void bt_bearing_note(bt_cell *cell, bt_idx pair, const bt_manifold *found);

/// Find the point that bears for each point that has been merged, and for each polygon near that has none; after the
/// contacts have been made and the records read.
void bt_bearing_assign(const bt_world *world, bt_cell *cell);

/// Lengths, m, and areas, m², of the overlaps that one point bears, at two depths.
typedef struct bt_bearing {
    double length[2], area[2];
} bt_bearing;

/// Those of both points of contact j, made from the manifold, when b has moved by depth[0] and depth[1], m, towards a.
void bt_bearing_of(const bt_world *world, const bt_cell *cell, bt_idx j, const bt_manifold *manifold,
                   const bt_closing *closing, const double depth[2], bt_bearing of[2]);

/// How many points of the face on which the outlines of contact j touch are within a slop of the nearest, at least 1:
/// they share its least length. *own: how many of them are of this contact. 0 if the outlines are single polygons.
int bt_bearing_points(const bt_world *world, const bt_cell *cell, bt_idx j, int *own);

/// Length, m, of all that contact j bears at one depth; *area, m².
double bt_bearing_whole(const bt_world *world, const bt_cell *cell, bt_idx j, double depth, double *area);

#endif
