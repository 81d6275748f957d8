// SPDX-License-Identifier: MIT
// The swath of a berg along a path: its stretches, their speeds and costs; and where the berg may not be.
#ifndef BERGTOW_ROUTE_SWATH_H
#define BERGTOW_ROUTE_SWATH_H

#include "route/ice.h"
#include "bergtow/route.h"
#include "geometry/path.h"

// --- where the berg may not be ---------------------------------------------------------------------------------------

// Polygons fixed to the ground, and the edge of the extent.

typedef struct bt_no_go {
    const bt_route_task *task;
    int64_t n;             ///< edges
    const double **edge;   ///< [n][2] their ends
    double far;            ///< cap on distances, m
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
/// Is a place on the ground within a no-go polygon (one ring, no holes)? Even-odd rule.
bool bt_no_go_inside(const bt_no_go *no_go, double x, double y);
/// Least distance of the hull at (x, y), in the frame of the ice, from the edge of the extent, m; negative if outside.
double bt_no_go_margin(const bt_no_go *no_go, double x, double y);

/// Are all paths of `half` m to and from (x, y), passed at the time t and the speed v, free of faults? A quick test:
/// false proves nothing.
bool bt_no_go_clear(const bt_no_go *no_go, double x, double y, double half, double t, double v);

/// Bits of bt_route.faults for the first `length` m of a leg, begun at the time t and travelled at the speed v. No
/// point of a piece is farther from its middle than half its length, so the distance there clears the piece, or the
/// piece is halved: exact to 1e-3 of `need`, on the safe side.
int bt_no_go_faults(const bt_no_go *no_go, const bt_leg *leg, double length, double t, double v);

// --- paths -----------------------------------------------------------------------------------------------------------

/// Data shared by the planner: task, ice and no-go polygons in one frame, and the penalty near routes already found.
typedef struct bt_planner {
    bt_route_task task;     ///< speeds descending
    bt_route_ice ice;
    bt_no_go no_go;
    double water[2];        ///< velocity of the water in the frame of the ice, m/s
    uint8_t *near;          ///< [ny][nx] of the raster: 1 = within W of a route found before
    double penalty;         ///< factor of the cost there; 1 = none
    struct bt_kept_leg *kept; ///< by bt_swath_keep
    int64_t states;
} bt_planner;

/// Cost of a stretch at its speed.
typedef struct bt_stretch_cost {
    int speed;              ///< index
    double force, work, time, measure; ///< N, J, s, in the unit of the objective
    bool over;              ///< no speed keeps the force limit; this one has the least force
} bt_stretch_cost;

/// Cost of a path.
typedef struct bt_path_cost {
    int faults;
    double over;            ///< length above the force limit, m
    double cost, second;    ///< with penalties; if costs are equal, the second decides
    double plain;           ///< without penalties
    double length, time, work, peak;
} bt_path_cost;

/// Water drag against the tow along (tx, ty) at speed v, N. At least a thousandth of that in still water, so that a
/// following current does not make a path free.
double bt_swath_water(const bt_planner *planner, double tx, double ty, double v);

/// Add the integral of the load over the first `length` m of a leg to sums [n_speeds], N m. Slices lie between normals
/// of the path, so that consecutive pieces do not overlap.
void bt_swath_load(const bt_planner *planner, const bt_leg *leg, double length, double *sums);

/// Best speed of a stretch by the objective: load [n_speeds], N m, and mean water drag, N; limit: of the mean force.
bt_stretch_cost bt_swath_choose(const bt_planner *planner, double length, const double *load, const double *water,
                                double limit);

/// Cost of n legs, in stretches of at most 2 W; out [bt_swath_stretches], or NULL, takes them.
bt_path_cost bt_swath_cost(const bt_planner *planner, int n, const bt_leg *leg, bt_route_stretch *out);
/// Start caching costs of legs in bt_swath_cost; call it again when the cells with a penalty have changed.
void bt_swath_keep(bt_planner *planner);
/// Number of stretches that bt_swath_cost makes of these legs.
int64_t bt_swath_stretches(const bt_planner *planner, int n, const bt_leg *leg);

/// The leg that a stretch is.
static inline bt_leg bt_swath_leg(const bt_route_stretch *stretch)
{
    return (bt_leg){.x = stretch->x, .y = stretch->y, .tx = stretch->tx, .ty = stretch->ty, .length = stretch->length,
                    .turn = stretch->turn};
}

/// Is a cheaper than b?
bool bt_swath_better(const bt_path_cost *a, const bt_path_cost *b);

/// Fill in the terms, areas (by exact clipping) and clearance of a route that has its stretches.
void bt_swath_report(const bt_planner *planner, bt_route *route);

#endif
