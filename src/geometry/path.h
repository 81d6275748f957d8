// SPDX-License-Identifier: MIT
// A path in the plane as a function of its length: straight legs through way-points, corners sharp or rounded by arcs.
//
// A corner of angle δ between two legs is rounded by an arc of radius R that touches both at R tan(δ/2) from the
// way-point. The leg after the last way-point has no end.
#ifndef BERGTOW_PATH_H
#define BERGTOW_PATH_H

#include "bergtow/base.h"

/// A straight leg or an arc.
typedef struct bt_leg {
    double way;      ///< length of path before it, m
    double length;   ///< m; the last is endless
    double x, y;     ///< where it starts, m
    double tx, ty;   ///< unit tangent there
    double turn;     ///< curvature, 1/m, positive from +x towards +y; 0 = straight
} bt_leg;

typedef struct bt_path {
    bt_leg *leg;     ///< [n]
    int n;           ///< 0 = no path was made
    double *mark;    ///< [n_marks] way at which each way-point is passed (middle of the arc), m
    int n_marks;
} bt_path;

/// From (x, y) through points [n][2] with corners of this radius (0 = sharp). False, with the reason in why, when two
/// points coincide, a rounded corner has no room on its legs, or turns back on itself.
bool bt_path_make(bt_path *path, double x, double y, int n, const double *points, double radius, char why[200]);

/// Position and unit tangent after `way` m of a leg (before its start: backwards).
void bt_leg_at(const bt_leg *leg, double way, double at[2], double tangent[2]);

/// Position and unit tangent after `way` m of it (before the start: on the straight line backwards).
void bt_path_at(const bt_path *path, double way, double at[2], double tangent[2]);

/// Way of a point of the path near (x, y), sought forwards and backwards from `way` by moving along the tangent of a
/// leg or about the centre of an arc.
double bt_path_near(const bt_path *path, double way, double x, double y);

void bt_path_free(bt_path *path);

#endif
