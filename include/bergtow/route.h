// SPDX-License-Identifier: MIT
// Routes for a towed iceberg through ice with known floes: corners, speeds and costs.
//
// Frame: that of the drifting ice, which is the frame of the case at t = 0. The ice is at rest in it; points fixed to
// the ground move by −u t, u the drift of the ice. The path is that of the berg's centre, and its swath is the strip of
// the berg's width W about it. The force F on the berg in the swath, at the speed V along the path, is per metre of
// width, with m the mass of ice per area of sea, c the concentration, h the thickness, C the added mass coefficient of
// floes, D̄ the mean size of floes by area, and averages (·)' over the known part of a square of 2 (W + D̄):
//     water       d |V t − u_w| (V t − u_w) · t, d = ½ ρ_w C_d A_w, u_w the water's velocity in this frame: one number
//     plough      f1 = (1 + C) m V²: floes that the berg meets are accelerated to its speed; as much again is lost
//     large       floes move as a whole. A floe of mass M, diameter D and offset b from the path takes in an oblique
//                 collision without rebound or friction the momentum along it M V (1 − b²/ρ²), ρ = (D + W)/2; the share
//                 D/(D + W) of it counts here, the rest being ice in the swath. The force on a berg whose centre is at
//                 the distance r from the floe's is (1 + C) M V² D/(D + W) · 2/(π ρ²) √(ρ² − r²), whose integral along
//                 any straight line is the work [Abel 1826]; of the ellipse of the floe's second moments
//     compaction  (f1 + large/W)' (1/(1 − c'/c_j) − 1): floes that are met push those around them. Ahead of the berg
//                 ice is packed up to the cover c_j at which it jams, and the front of that runs ahead of the berg;
//                 momentum of a piston in one dimension; 1/(..) is at most 10, assumed
//     rafting     q h² c, q = κ ½ ρ_i (1 − ρ_i/ρ_w) g, wherever ice is met; with weight 0 unless fitted
// If floes raft, the sum of plough, compaction and large/W is at most q (h²)' [the cap of rafting contacts]. Presence
// and size of the terms are assumed: their weights are for fitting to tows. The terms of a swath add up along a path
// without counting ice twice, as slices between two normals of the path.
#ifndef BERGTOW_ROUTE_H
#define BERGTOW_ROUTE_H

#include "bergtow/base.h"

BT_BEGIN_C

enum {
    BT_ROUTE_TERMS = 5,   ///< of the force: water, plough, compaction, large, rafting
    BT_ROUTE_LARGE = 3,   ///< the term of whole floes, not per width
    BT_ROUTE_SPEEDS = 16, ///< most entries in a list of speeds
    BT_ROUTE_MOST = 16,   ///< most routes
};

/// What a route costs: the work of the tow, J; its time, s; the largest force of a stretch, N; its length, m.
typedef enum { BT_ROUTE_WORK, BT_ROUTE_TIME, BT_ROUTE_PEAK, BT_ROUTE_LENGTH } bt_route_objective;

/// Why there is no route, or fewer than requested.
typedef enum {
    BT_ROUTE_OK,
    BT_ROUTE_FEWER,          ///< fewer routes a width apart than requested
    BT_ROUTE_NONE,           ///< no route from start to goal
    BT_ROUTE_START_OUTSIDE,  ///< the hull at the start extends beyond the extent
    BT_ROUTE_GOAL_OUTSIDE,
    BT_ROUTE_START_NO_GO,    ///< the hull at the start is in a no-go polygon or within its clearance
    BT_ROUTE_GOAL_NO_GO,
    BT_ROUTE_START_TOO_THICK, ///< the force at the start exceeds the limit at every speed
    BT_ROUTE_GOAL_TOO_THICK,
    BT_ROUTE_GOAL_DRIFTS,    ///< in the frame of the ice the goal moves away faster than the berg follows at any speed
    BT_ROUTE_AT_GOAL,        ///< the start is the goal
} bt_route_status;

/// Faults of a route: bits.
enum { BT_ROUTE_IN_NO_GO = 1, BT_ROUTE_OUTSIDE = 2, BT_ROUTE_OVER_LIMIT = 4, BT_ROUTE_TURNS = 8 };

/// The task. Polygon i has points first[i] to first[i + 1] − 1 of an array [..][2], m, in either direction.
typedef struct bt_route_task {
    int64_t n_floes;
    const int64_t *floe_first;   ///< [n_floes + 1]
    const double *floe;          ///< m
    const double *thickness;     ///< [n_floes] h, m
    double density;              ///< ρ_i, kg/m³
    double added_mass;           ///< C
    double jam_cover;            ///< c_j
    double rafting;              ///< q, N/m³; INFINITY: floes do not raft
    double width, reach;         ///< of the berg across its path; largest distance of its outline from its centre, m
    double drag;                 ///< d, kg/m; above 0
    double start[2];             ///< m
    double goal[4];              ///< a point, or both ends of a line of points, m, fixed to the ground
    double extent[4];            ///< x0, y0, x1, y1 within which the hull stays, m
    double start_heading, goal_heading; ///< of the path, rad; NAN: any
    double speed[BT_ROUTE_SPEEDS];      ///< m/s, above 0
    double force_limit;          ///< N; INFINITY: none
    double force_factor;         ///< the limit applies to this factor times the mean force of a stretch
    int64_t n_no_go;
    const int64_t *no_go_first;  ///< [n_no_go + 1]
    const double *no_go;         ///< m, fixed to the ground
    double clearance;            ///< from the hull to a no-go polygon, m
    double radius;               ///< least radius of the path, m
    double spacing, cell;        ///< of the lattice and of the raster, m; 0: chosen
    double turn_cost;            ///< unit of the objective/rad
    double weight[BT_ROUTE_TERMS];
    double drift[2], water[2];   ///< velocities of ice and water over the ground, m/s
    int32_t goal_is_line, n_speeds, objective, headings, routes; ///< headings: 16 or 32
} bt_route_task;

/// A stretch of a route at one speed: straight or an arc.
typedef struct bt_route_stretch {
    double x, y, tx, ty;   ///< its start, m, and the unit tangent there
    double length, turn;   ///< m; curvature, 1/m
    double speed, force;   ///< m/s; mean tow force along it, N
} bt_route_stretch;

typedef struct bt_route {
    int64_t n_corners, n_stretches;
    double (*corner)[2];        ///< [n_corners] way-points: corners, and the end; m
    bt_route_stretch *stretch;  ///< [n_stretches]
    double radius;              ///< of the arcs at the corners, m; 0 = sharp
    double length, duration, work, force, peak; ///< m, s, J; mean and largest force of a stretch, N
    double cost;                ///< of the objective
    double term[BT_ROUTE_TERMS]; ///< mean force of each term along it, unweighted, N
    double ice_area, ice_mass;  ///< of the floes within the swath, clipped exactly, m², kg
    double clearance;           ///< least distance of the circle of `reach` about the centre to a no-go polygon, m
    int64_t faults;
} bt_route;

typedef struct bt_route_plan {
    int32_t status;      ///< bt_route_status
    int32_t n;           ///< routes
    double force;        ///< for a status about force: the least force at the place, N
    int64_t states;      ///< states of the lattice visited by the searches
    double spacing, cell; ///< as used, m
    bt_route route[1 + BT_ROUTE_MOST]; ///< [n] the straight line first, then the routes found, best first
} bt_route_plan;

/// Make a plan. Deterministic: costs of the search are whole numbers, and of equal costs the lower index goes first. No
/// errors other than the status in the plan: the caller must have checked the numbers. Where the goal drifts away from
/// the straight line, or drifting ice has it outside the domain or in thick ice on arrival, the slowest speed is left
/// out, until it is reached. Release with bt_route_free.
void bt_route_make(const bt_route_task *task, bt_route_plan *plan);
/// Release the routes of a plan.
void bt_route_free(bt_route_plan *plan);

/// Evaluate the way from start to goal through n corners [n][2], m, without a search: terms, forces, areas. No route in
/// the plan: the goal drifts away (BT_ROUTE_GOAL_DRIFTS), or the turns do not fit (BT_ROUTE_NONE).
void bt_route_through(const bt_route_task *task, int n, const double (*corner)[2], bt_route_plan *plan);

/// Concentration of the floes of a task on nx × ny cells over its extent, from exact areas; cover [ny][nx].
void bt_route_cover(const bt_route_task *task, int64_t nx, int64_t ny, double *cover);

/// Shortest path of curvature at most 1/radius from (x, y, heading) `from` to `to` [Dubins 1957, Am. J. Math. 79]: the
/// shortest of the six words. leg [3][2]: length, m, and curvature, 1/m. Returns its length.
double bt_route_dubins(const double from[3], const double to[3], double radius, double leg[3][2]);
/// Length, m, of one of the words LSL, RSR, LSR, RSL, RLR, LRL, 0 to 5; INFINITY if it does not exist.
double bt_route_word(const double from[3], const double to[3], double radius, int word, double leg[3][2]);

BT_END_C

#endif
