// SPDX-License-Identifier: MIT
// Fixed bodies that lie against each other act as one outline: a shore.
//
// A shore is the union of convex polygons: fixed bodies, or the parts of those that are not convex. Something outside
// can touch only the boundary of the union:
//   an edge     where no other polygon covers it. Covered is what has another polygon beyond it, at the distance of the
//               slop. An edge covered at an end counts up to there; what is covered between its ends stays, for the
//               half-plane of the edge is right on either side of the cover;
//   a corner V  in the directions n of the normal cones of all polygons that V lies on, within the slop: n·(x − V) <= 0
//               for the points x near V of each of them. At the seam of a straight quay this is one direction, in a
//               bay none.
// So a corner that slides along flush pieces meets neither their covered ends nor the corners at their seams. Polygons
// may also overlap: where their boundaries cross there is no corner that could be touched.
//
// All of this is known when the world is made, since nothing of it moves. Each rank holds it, and the bodies of a shore
// are large: they are on each rank, and what touches a body from the shore is in the cell of that body, where contacts
// of several pieces at one place become one (contact/detect.c). A tree of boxes finds the polygons near a body.
//
// Rejected: one body for each shore. It would take from the pieces their names, thickness and loads, and needs outlines
// with holes and without a limit to their vertices. And the "ghost vertices" of a chain of segments (Box2D), which know
// one neighbour at each end and no overlap.
#ifndef BERGTOW_SHORE_H
#define BERGTOW_SHORE_H

#include "bergtow/world.h"

/// What of one vertex of a polygon, and of the edge that starts there, is on the boundary of the shore.
typedef struct bt_face {
    double from, to;   ///< the edge counts from here to here, m from its vertex; from >= to: it does not
    double u[2], w[2]; ///< unit normals that bound the cone, anticlockwise from u to w; both 0: it counts nowhere
} bt_face;

typedef struct bt_shore bt_shore;

/// Find the shores among the fixed bodies of a world that is not yet distributed, before its walls are added;
/// world->shore stays NULL where there is none. Their bodies become large.
void bt_shore_create(bt_world *world);
void bt_shore_free(bt_shore *shore);

/// Is body gid part of a shore?
bool bt_shore_has(const bt_shore *shore, bt_gid gid);
/// The same of the body with index i.
static inline bool bt_shore_holds(const bt_world *world, bt_idx i)
{
    return world->shore && bt_shore_has(world->shore, world->bodies.gid[i]);
}
/// Faces of the polygon of body gid that starts at its vertex `part`; NULL: the body is part of no shore.
const bt_face *bt_shore_faces(const bt_shore *shore, bt_gid gid, int part);
/// Does the corner of a face count in the direction of the unit vector n?
bool bt_shore_in_cone(const bt_face *face, double nx, double ny);

/// A polygon of a shore: the one of body gid that starts at its vertex `part`.
typedef struct bt_shore_polygon {
    bt_gid gid;
    int part, count;
    double x, y;             ///< centroid of the body, m
    double low[2], high[2];  ///< box, m
} bt_shore_polygon;

typedef struct bt_shore_list {
    bt_shore_polygon *found; ///< [n]
    size_t n, cap;
} bt_shore_list;

/// Polygons whose boxes come within the box low..high, m, at the image nearest to the body with its centroid at (x, y).
void bt_shore_near(const bt_world *world, double x, double y, const double low[2], const double high[2],
                   bt_shore_list *list);

#endif
