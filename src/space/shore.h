// SPDX-License-Identifier: MIT
// Fixed bodies that lie against each other act as one outline: a shore.
//
// A shore is the union of convex polygons: fixed bodies, or the parts of those that are not convex. From outside only
// the boundary of the union can be touched:
//   an edge     where no other polygon covers it, that is, lies outside it at the distance of the
//               slop. An edge covered at an end counts up to there; a cover between its ends is ignored, for the
//               half-plane of the edge is right on either side of the cover;
//   a corner V  in the directions n of the normal cones of all polygons that V lies on, within the slop: n·(x − V) <= 0
//               for the points x near V of each of them. At the seam of a straight quay this is one direction, in a
//               bay none.
// So a corner that slides along flush pieces meets neither their covered ends nor the corners at their seams. Polygons
// may also overlap: where their boundaries cross there is no corner that could be touched.
//
// All of this is known when the world is made, since shores do not move. Each rank holds it, and the bodies of a shore
// are large: they are on each rank, and contacts of a body with the shore are in the cell of that body, where contacts
// of several pieces at one place become one (contact/detect.c). A tree of boxes finds the polygons near a body.
//
// Rejected: one body for each shore. The pieces would lose their names, thickness and loads, and outlines could have
// holes and any number of vertices. Also rejected: the "ghost vertices" of a chain of segments (Box2D), which allow one
// neighbour at each end and no overlap.
#ifndef BERGTOW_SHORE_H
#define BERGTOW_SHORE_H

#include "bergtow/world.h"

/// The part of a vertex of a polygon, and of the edge that starts there, on the boundary of the shore.
typedef struct bt_face {
    double from, to;   ///< the edge counts from here to here, m from its vertex; from >= to: it does not
    bool on[2];        ///< before `from`, after `to` the boundary goes straight on, on other polygons only
    double u[2], w[2]; ///< unit normals that bound the cone, anticlockwise from u to w; both 0: empty. In a bay that is
                       ///< nearly straight, w is before u: empty, too
} bt_face;

typedef struct bt_shore bt_shore;

/// Find the shores among the fixed bodies of a world that is not yet distributed, before its walls are added; their
/// bodies become large. world->shore stays NULL if there is none.
void bt_shore_create(bt_world *world);
void bt_shore_free(bt_shore *shore);

/// Is body gid part of a shore?
bool bt_shore_has(const bt_shore *shore, bt_gid gid);
/// The same for the body with index i.
static inline bool bt_shore_holds(const bt_world *world, bt_idx i)
{
    return world->shore && bt_shore_has(world->shore, world->bodies.gid[i]);
}
/// The body that stands for the outline of body gid: of a shore, the one with the lowest id; otherwise gid itself.
bt_gid bt_shore_outline(const bt_shore *shore, bt_gid gid);
/// Faces of the polygon of body gid that starts at its vertex `part`; NULL if the body is part of no shore.
const bt_face *bt_shore_faces(const bt_shore *shore, bt_gid gid, int part);
/// Does the corner of a face count in the direction of the unit vector n?
bool bt_shore_in_cone(const bt_face *face, double nx, double ny);

/// A polygon of a shore, which starts at vertex `part` of body gid.
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
