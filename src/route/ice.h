// SPDX-License-Identifier: MIT
// Ice on a raster: exact areas of floes in cells, and the force per metre of width that follows from them.
#ifndef BERGTOW_ROUTE_ICE_H
#define BERGTOW_ROUTE_ICE_H

#include "bergtow/route.h"

/// What is kept of a cell.
enum { BT_ICE_COVER, BT_ICE_MASS, BT_ICE_FLOES, BT_ICE_RAFT, BT_ICE_FIELDS };

typedef struct bt_route_ice {
    int nx, ny, n_speeds;
    double cell, x0, y0; ///< m; its lowest corner, in the frame of the raster
    double ax, ay;       ///< the frame's x axis in that of the task, unit vector
    double ox, oy;       ///< the frame's origin in that of the task, m
    /// [ny][nx] c; m, kg/m²; mass of whole floes taken along per metre of way of the centre, kg/m; c h², m²
    float *field[BT_ICE_FIELDS];
    float *mean[BT_ICE_FIELDS]; ///< the same averaged over squares of 2 (W + D̄)
    float *load;                ///< [ny][nx][n_speeds] weighted force of the ice in a metre of width, N/m
    float *line;                ///< [ny][nx][n_speeds] weighted force of whole floes with the centre here, N
} bt_route_ice;

/// A place of the task in cells of the raster.
static inline void bt_route_ice_place(const bt_route_ice *ice, double x, double y, double at[2])
{
    const double dx = x - ice->ox, dy = y - ice->oy;
    at[0] = (dx * ice->ax + dy * ice->ay - ice->x0) / ice->cell;
    at[1] = (dy * ice->ax - dx * ice->ay - ice->y0) / ice->cell;
}

/// Rasters of a task in the frame at (ox, oy) with the x axis (ax, ay), of nx × ny cells from (x0, y0) on.
void bt_route_ice_make(bt_route_ice *ice, const bt_route_task *task);
void bt_route_ice_free(bt_route_ice *ice);

/// Terms of the force at cell k and speed v, unweighted, each per metre of width but that of large floes, which is of
/// the berg with its centre there; water stays 0.
void bt_route_ice_terms(const bt_route_ice *ice, const bt_route_task *task, int64_t k, double v,
                        double term[BT_ROUTE_TERMS]);

/// Adds weight × area of a polygon of n points [n][2], in cells, to sums [ny][nx + 2], which bt_route_ice_sum ends.
void bt_route_ice_add(double *sums, int nx, int ny, int64_t n, const double *v, double weight);
/// Running sums along x: sums [ny][nx + 2] become areas in cells.
void bt_route_ice_sum(double *sums, int nx, int ny);

#endif
