// SPDX-License-Identifier: MIT
// How the body is towed: prescribed velocity, or an elastic line to a carriage.
//
// Line: unstretched length L0, stiffness k = EA/L0, damping c, from a point on the hull to a carriage on a
// prescribed path. Tension T = max(0, k (l − L0) + c dl/dt). Within a step the line is one more unilateral row of
// the solver, λ = Δt T ≥ 0, solved together with the contacts:
//     λ = max(0, Δt [k (l1 + θ Δt l̇2 − L0) + c l̇2]),   l̇2 = u·(ċ − v_hull,2)
// With X2 = X1 + Δt U2, θ = 0 is the symplectic Euler scheme: no numerical damping, stable for h = Δt √(k W) < 2
// (W: inverse mass of the hull point along the line). The amplification matrix of the free spring has determinant
// 1/(1+θh²) and is stable for every h when h² ≤ 4 + 2θh². So θ = max(0, 1 − 2/h²): none while the oscillation is
// resolved (h ≤ √2), tending to backward Euler for a line too stiff for the step. Stable for any stiffness [D].
#ifndef BERGTOW_TOW_H
#define BERGTOW_TOW_H

#include "bergtow/case.h"
#include "bergtow/world.h"

typedef struct bt_tow {
    bt_tow_mode mode;
    double ux, uy;            ///< unit vector of the tow direction
    double speed, ramp;       ///< m/s, s
    double length0, k, c;     ///< m, N/m, N s/m
    double hull_x, hull_y;    ///< fastening point, body frame, m
    double dt;                ///< s
    // state
    double time;              ///< s
    double carriage_x, carriage_y; ///< m
    double lambda;            ///< line impulse of the last step, N s (starts the next solve)
    double travel_x, travel_y;///< position of the body, not wrapped, m
    // the row of this step
    bool taut;
    double rx, ry;            ///< arm from the centroid to the fastening point, m
    double lx, ly;            ///< unit vector from the hull to the carriage
    double rxl;               ///< arm × unit vector, m
    double length;            ///< l1, m
    double carriage_speed;    ///< ċ·u, m/s
    double w;                 ///< W, 1/kg
    double a, b;              ///< λ = max(0, a + b l̇2)
} bt_tow;

/// Speed of the prescribed programme at time t: linear from 0 over the ramp, then constant. m/s
double bt_tow_speed(const bt_tow *t, double time);

/// At the start of a step: prescribed velocity into a kinematic body, carriage moved, line row set up.
void bt_tow_begin(bt_world *w);

/// One Gauss–Seidel update of the line row; returns its natural-map residual before the update, m/s.
double bt_tow_update(bt_tow *t, bt_vel *v, bt_inv inv);

/// Velocity of the body changed by line impulse d, N s.
void bt_tow_apply(const bt_tow *t, double d, bt_vel *v, bt_inv inv);

/// Natural-map residual of the line row at velocity v, m/s.
double bt_tow_residual(const bt_tow *t, const bt_vel *v);

/// Start from the impulse of the last step, or from none.
void bt_tow_warm_start(bt_tow *t, bool keep);

/// Tension of the last step, N.
static inline double bt_tow_tension(const bt_tow *t) { return t->lambda / t->dt; }

uint64_t bt_tow_hash(const bt_tow *t);

#endif
