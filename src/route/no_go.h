// SPDX-License-Identifier: MIT
// Where the berg may not be: polygons fixed to the ground, and the edge of the extent.
#ifndef BERGTOW_ROUTE_NO_GO_H
#define BERGTOW_ROUTE_NO_GO_H

#include "bergtow/route.h"
#include "geometry/path.h"

typedef struct bt_no_go {
    const bt_route_task *task;
    int64_t n;             ///< edges
    const double **edge;   ///< [n][2] their ends
    double far;            ///< beyond this, m, a distance counts as this
    double need;           ///< reach + clearance, m
    double x0, y0, size;   ///< buckets: lowest corner, side, m
    int nx, ny;
    int64_t *first;        ///< [nx ny + 1]
    int32_t *list;         ///< edges within `far` of a bucket
} bt_no_go;

void bt_no_go_make(bt_no_go *no_go, const bt_route_task *task);
void bt_no_go_free(bt_no_go *no_go);

/// Distance from a place on the ground to edge k, m.
double bt_no_go_to_edge(const bt_no_go *no_go, int64_t k, double x, double y);
/// Distance from a place on the ground to the nearest edge of a no-go polygon, m, or `far`.
double bt_no_go_distance(const bt_no_go *no_go, double x, double y);
/// Is a place on the ground within a no-go polygon (its holes are none)? Even-odd rule.
bool bt_no_go_inside(const bt_no_go *no_go, double x, double y);
/// How far the hull at (x, y), in the frame of the ice, is within the extent, m; negative: it reaches out.
double bt_no_go_margin(const bt_no_go *no_go, double x, double y);

/// Are all ways of `half` m to and from (x, y), passed at the time t and the speed v, free of faults? A quick look:
/// false does not say that one is not.
bool bt_no_go_clear(const bt_no_go *no_go, double x, double y, double half, double t, double v);

/// Bits of bt_route.faults for the first `length` m of a leg, begun at the time t and travelled at the speed v. A curve
/// moves by no more than its length, so that the distance in its middle clears a piece of it or the piece is halved:
/// exact to 1e-3 of `need`, on the safe side.
int bt_no_go_faults(const bt_no_go *no_go, const bt_leg *leg, double length, double t, double v);

#endif
