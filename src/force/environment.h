// SPDX-License-Identifier: MIT
// Current and wind in time: their values in bt_params are set anew at the start of every step.
//
// Velocity at time t, uniform in space (u along x, v along y):
//     U(t) = U_0 + e_1 a cos(ωt − φ) + e_2 b sin(ωt − φ),   ω = 2π/T          constant part and tidal ellipse
//     U(t) = linear between the rows of a table                                in place of them
// a, b: semi-axes, e_1 the direction of inclination, e_2 is e_1 rotated by 90° from x towards y, so that the current
// rotates from x towards y for b > 0.
//
// A step uses the velocity at its middle, U(t + Δt/2), for all forces. Reason: floes that follow the water move by Δt
// U_w in the step, which is the displacement of the water to second order (exact for a constant and on a linear piece
// of a table); forces in the series are means over the step anyway. Rejected: the end of the step, like the implicit
// drag; a floe's path is then off by Δt/2 (U_w(T) − U_w(0)).
//
// Sea-surface tilt, for a body that displaces water (model: −m g ∇η, m without added mass: forces.h):
//     geostrophic   −g∇η = f k×U_w at that time: balances Coriolis on the current; only drag accelerates the body
//                   with the water
//     dynamic       −g∇η = dU_w/dt + f k×U_w: the tilt of a frictionless current, uniform in space; dU_w/dt also
//                   moves the added mass. A body that moves with the water continues to without drag. dU_w/dt
//                   is taken from the middle of the last step (from t = 0 in the first) to the middle of this one, and
//                   Coriolis acts about the current of the last step: thus it is exact in the scheme of forces.h, U' =
//                   U_b + R (U1 − U_b) + Δt (−g∇η)
//
// Rest. A floe is at rest when it has the water's velocity of that step (cells.h). When water, wind or balance differ
// from the previous step, no cell rests: the forces on every body are formed again. Cells move with the water: by its
// displacement since t = 0, the sum of Δt U_w over the steps, which every rank computes.
#ifndef BERGTOW_ENVIRONMENT_H
#define BERGTOW_ENVIRONMENT_H

#include "bergtow/case.h"
#include "bergtow/world.h"

typedef struct bt_environment bt_environment;

/// Current and wind of a case, or NULL if neither changes with time: bt_params is then sufficient. Tables are copied.
bt_environment *bt_environment_create(const bt_case *input);
void bt_environment_free(bt_environment *environment);

/// At the start of a step: set water, wind, balance and tilt at its middle in world->par; wakes all cells if they
/// changed. Does nothing without an environment.
void bt_environment_begin(bt_world *world);

/// At the end of a step: advance the displacement of the water, world->drift_x, world->drift_y.
void bt_environment_advance(bt_world *world);

/// Current (water true) or wind of a case at time t, m/s.
void bt_environment_at(const bt_case *input, bool water, double t, double v[2]);

/// Mean of the current over the run, m/s.
void bt_environment_mean(const bt_case *input, double v[2]);

/// Does the current or the wind of a case change in time?
bool bt_environment_changes(const bt_case *input);


#endif
