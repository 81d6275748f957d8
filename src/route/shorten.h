// SPDX-License-Identifier: MIT
// A path through way-points made cheaper: fewer corners, and better places for them.
#ifndef BERGTOW_ROUTE_SHORTEN_H
#define BERGTOW_ROUTE_SHORTEN_H

#include "route/swath.h"

typedef struct bt_way {
    int n, cap;
    double (*point)[2]; ///< [n] way-points, m; the last is the end
    bt_path_cost cost;
} bt_way;

/// Legs of a way from the start of the task, with corners of its radius; false where they have no room. The path is
/// the caller's to free.
bool bt_way_path(const bt_planner *planner, const bt_way *way, bt_path *path);
/// Sets way->cost.
void bt_way_price(const bt_planner *planner, bt_way *way);
void bt_way_copy(bt_way *to, const bt_way *from);

/// The nearest place of the goal, of the task at the time t, to (x, y), in the frame of the ice.
void bt_way_goal(const bt_planner *planner, double t, double x, double y, double goal[2]);

/// Lower the cost of a way until no step does: corners left out, moved and put in. Its end stays at the goal, which is
/// where it is when the berg arrives.
void bt_way_shorten(const bt_planner *planner, bt_way *way);

#endif
