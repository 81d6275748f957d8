// SPDX-License-Identifier: MIT
// A* over places and headings; the moves: lattice.c.
#ifndef BERGTOW_ROUTE_LATTICE_H
#define BERGTOW_ROUTE_LATTICE_H

#include "route/swath.h"

typedef struct bt_lattice bt_lattice;

/// Result of a search.
typedef struct bt_lattice_way {
    int n_points;
    double (*point)[2]; ///< [n_points] corners and the last node, m, without the start; 0: nothing was found
    int n_legs;
    bt_leg *leg;        ///< [n_legs] the same as legs and arcs
    int n_nodes;
    double (*node)[3];  ///< [n_nodes] x, y, m, and heading, rad: the start, and each node after it
    int *node_leg;      ///< [n_nodes] legs up to it
} bt_lattice_way;

/// Make a lattice of places `spacing` m apart over the extent of planner->task, the start among them, with the x axis
/// along (ax, ay); and planner->ice in its frame, with cells of `cell` m, a whole fraction of the spacing.
bt_lattice *bt_lattice_make(bt_planner *planner, double ax, double ay, double spacing, double cell);
void bt_lattice_free(bt_lattice *lattice);
/// Spacing of the places, m.
double bt_lattice_spacing(const bt_lattice *lattice);

/// Find the cheapest way from the start to a node within 0.75 of the spacing from the goal (both ends of a line of
/// points, or twice the same point), with the mean force limited; for BT_ROUTE_PEAK the way with the least maximum
/// force, which is returned in *peak, N. False if there is none.
bool bt_lattice_search(bt_lattice *lattice, const double goal[4], int objective, double limit, double *peak,
                       bt_lattice_way *way);
void bt_lattice_way_free(bt_lattice_way *way);

#endif
