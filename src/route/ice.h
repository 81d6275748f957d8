// SPDX-License-Identifier: MIT
// Ice on a raster: exact areas of floes in cells, and the force per metre of width that follows from them.
#ifndef BERGTOW_ROUTE_ICE_H
#define BERGTOW_ROUTE_ICE_H

#include "bergtow/route.h"

/// Quantities stored for a cell.
enum { BT_ICE_COVER, BT_ICE_MASS, BT_ICE_FLOES, BT_ICE_RAFT, BT_ICE_FIELDS };

typedef struct bt_route_ice {
    int nx, ny, n_speeds;
    double cell, x0, y0; ///< size, m; lowest corner of the raster, in its own frame
    double ax, ay;       ///< its x axis in the frame of the task, unit vector
    double ox, oy;       ///< its origin in the frame of the task, m
    /// [ny][nx] c; m, kg/m²; mass of whole floes taken along per metre that the centre moves, kg/m; c h², m²
    float *field[BT_ICE_FIELDS];
    float *mean[BT_ICE_FIELDS]; ///< the same averaged over squares of 2 (W + D̄)
    float *load;                ///< [ny][nx][n_speeds] weighted force of the ice per metre of width, N/m
    float *line;                ///< [ny][nx][n_speeds] weighted force of whole floes on a berg centred here, N
} bt_route_ice;

/// Convert a place of the task to cells of the raster.
static inline void bt_route_ice_place(const bt_route_ice *ice, double x, double y, double at[2])
{
    const double dx = x - ice->ox, dy = y - ice->oy;
    at[0] = (dx * ice->ax + dy * ice->ay - ice->x0) / ice->cell;
    at[1] = (dy * ice->ax - dx * ice->ay - ice->y0) / ice->cell;
}

/// Make the rasters of a task. `ice` gives the frame, the cell and nx × ny cells from (x0, y0) on.
void bt_route_ice_make(bt_route_ice *ice, const bt_route_task *task);
void bt_route_ice_free(bt_route_ice *ice);

/// Unweighted terms of the force at cell k and speed v, per metre of width; but that of large floes is for the whole
/// berg, centred there. Water stays 0.
void bt_route_ice_terms(const bt_route_ice *ice, const bt_route_task *task, int64_t k, double v,
                        double term[BT_ROUTE_TERMS]);

/// Adds weight × area of a polygon of n points [n][2], in cells, to sums [ny][nx + 2]; bt_route_ice_sum completes them.
void bt_route_ice_add(double *sums, int nx, int ny, int64_t n, const double *v, double weight);
/// Running sums along x: sums [ny][nx + 2] become areas in cells.
void bt_route_ice_sum(double *sums, int nx, int ny);

#endif
