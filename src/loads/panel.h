// SPDX-License-Identifier: MIT
// Panels of the hull: the waterline of the towed body cut into pieces of equal length, and the contact load on each.
//
// The waterline is walked in the order of its vertices (from the body's own +x towards +y). Panel 0 is centred where
// the body's x axis leaves it, so that a tow along that axis presses on panel 0 and its neighbours. A contact point
// belongs to the panel of the nearest point of the waterline; at a corner, to that of the edge it presses on. The load
// of a step is impulse / Δt, for quasi-static loads and collisions alike. Vectors are in the body's frame.
#ifndef BT_PANEL_H
#define BT_PANEL_H

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
    double bow;           ///< the same to the point on the x axis, m
    bt_panel *panel;      ///< [n] of the last step
} bt_panels;

/// Set up n panels on a waterline with the centroid at the origin; the outline is copied. Release with bt_panels_free.
void bt_panels_init(bt_panels *panels, int n, int n_vertices, const double *outline);
void bt_panels_free(bt_panels *panels);

/// Panel of the point (x, y), m, body frame. At a corner, where two edges are equally near, it lies on the edge that a
/// load in the direction (nx, ny) presses on more squarely.
int bt_panels_at(const bt_panels *panels, double x, double y, double nx, double ny);

/// The point of the waterline at panel coordinate s (panel k: s = k to k + 1), m; normal: outward unit normal there (or
/// NULL).
void bt_panels_point(const bt_panels *panels, double s, double xy[2], double normal[2]);

/// Begin a step: no load.
void bt_panels_clear(bt_panels *panels);

/// Load of one contact point: place, m, direction (nx, ny) of its normal force, that force, N, and with friction, N; in
/// the body frame.
typedef struct bt_point_load {
    double x, y, nx, ny, normal, fx, fy;
} bt_point_load;

void bt_panels_load(bt_panels *panels, const bt_point_load *load);

// --- blocks of steps -------------------------------------------------------------------------------------------------

// Panel loads over a window whose start is known only when the run ends (private to the recorder).
//
//     | early steps: block 0 | block 1 | block 2 | ...        the window begins with one of the blocks 1, 2, ...
//     0                   earliest
//
// From the earliest start on, steps are summed in blocks whose length is the spacing of the possible starts
// (bergtow/stats.h): 5 steps in a run of up to 20,480. When there would be more than BT_STATS_STARTS, blocks are merged
// in pairs. Memory, and share of a checkpoint: at most 4097 × 32 B per panel, 4.7 MB for 36. Rejected: all steps (1.2
// kB each, unbounded); a sum that restarts when the start found moves, as it may also move backwards.

/// Loads of several steps on one panel. Numbers only: a row of the checkpoint.
typedef struct bt_panel_loads {
    double fx, fy, normal; ///< sums over the steps, N
    double most;           ///< largest normal of a step, N
} bt_panel_loads;

typedef struct bt_panel_blocks {
    int n;                 ///< panels
    int64_t steps;         ///< counted from the earliest start on
    bt_panel_loads *load;  ///< [blocks][n]
    int64_t cap;           ///< capacity in blocks
} bt_panel_blocks;

void bt_panel_blocks_init(bt_panel_blocks *blocks, int n);
void bt_panel_blocks_free(bt_panel_blocks *blocks);

/// Number of rows of `load` after this many steps: one per panel and block, the early block included.
int64_t bt_panel_blocks_rows(const bt_panel_blocks *blocks, int64_t steps);

/// Add the loads of a step. early: it ends before the earliest start.
void bt_panel_blocks_add(bt_panel_blocks *blocks, const bt_panel *panel, bool early);

/// Restore saved values: `steps`, and load[bt_panel_blocks_rows], whose ownership is taken.
void bt_panel_blocks_restore(bt_panel_blocks *blocks, int64_t steps, bt_panel_loads *load);

/// Sum the steps before and in the window that begins `first` steps after the earliest start, into before[n] and
/// within[n]. first: a multiple of bt_stats_start_step(steps), or `steps` without a window.
void bt_panel_blocks_reduce(const bt_panel_blocks *b, int64_t first, bt_panel_loads *before, bt_panel_loads *within);

#endif
