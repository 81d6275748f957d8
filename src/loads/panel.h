// SPDX-License-Identifier: MIT
// Panels of the hull: the waterline of the towed body cut into pieces of equal length, and the contact load on each.
//
// The waterline is walked in the order of its vertices (from the body's own +x towards +y). Panel 0 is centred where
// the body's x axis leaves it, so that a tow along that axis presses on panel 0 and its neighbours. A contact point
// belongs to the panel of the nearest point of the waterline. The load of a step is impulse / Δt, whatever the contact
// was: a quasi-static load, a collision, or both. Vectors are in the body's frame.
#ifndef BERGTOW_PANEL_H
#define BERGTOW_PANEL_H

#include "bergtow/base.h"

/// Load of a step on one panel.
typedef struct bt_panel {
    double fx, fy;        ///< N, body frame, friction included
    double normal;        ///< sum of the normal forces, N
} bt_panel;

typedef struct bt_panels {
    int n, n_vertices;
    double *outline;      ///< [n_vertices][2] m, body frame
    double *arc;          ///< [n_vertices + 1] length of the waterline from vertex 0 to each vertex, m
    double bow;           ///< the same for the point on the x axis, m
    bt_panel *panel;      ///< [n] of the last step
} bt_panels;

/// n panels on a waterline with the centroid at the origin; the outline is copied. Release with bt_panels_free.
void bt_panels_init(bt_panels *p, int n, int n_vertices, const double *outline);
void bt_panels_free(bt_panels *p);

/// Panel of the point (x, y), m, body frame.
int bt_panels_at(const bt_panels *p, double x, double y);

/// The point of the waterline at panel coordinate s (panel k reaches from s = k to k + 1), m; normal: outward there (or
/// NULL).
void bt_panels_point(const bt_panels *p, double s, double xy[2], double normal[2]);

/// Begin a step: no load.
void bt_panels_clear(bt_panels *p);

/// A normal force (N) and the force vector (N, body frame) at a point.
void bt_panels_load(bt_panels *p, double x, double y, double normal, double fx, double fy);

#endif
