// SPDX-License-Identifier: MIT
// Current and wind in time: what bt_params holds of them is set anew at the start of every step.
//
// Velocity at time t, uniform in space (u along x, v along y):
//     U(t) = U_0 + e_1 a cos(ωt − φ) + e_2 b sin(ωt − φ),   ω = 2π/T          constant part and tidal ellipse
//     U(t) = linear between the rows of a table                                in place of them
// a, b: semi-axes, e_1 the direction of inclination, e_2 that of e_1 turned a quarter from x towards y, so that the
// current turns from x towards y where b > 0.
//
// A step takes the velocity of its middle, U(t + Δt/2), for all forces. Why: floes that follow the water move by
// Δt U_w in the step, which is the water's own displacement to second order (exact for a constant and on a straight
// piece of a table); forces in the series are means over the step anyway. Rejected: the end of the step, in the manner
// of the implicit drag; a floe's path is then off by Δt/2 (U_w(T) − U_w(0)).
//
// Sea-surface tilt, for a body that takes the place of water (model: −m g ∇η, m without added mass: forces.h):
//     geostrophic   −g∇η = f k×U_w at that time: balances Coriolis on the current, and nothing accelerates the body
//                   with the water but drag
//     dynamic       −g∇η = dU_w/dt + f k×U_w: the tilt that a current without friction, uniform in space, has; dU_w/dt
//                   moves the added mass, too. A body that moves with the water goes on doing so without drag. dU_w/dt
//                   is taken from the middle of the last step (from t = 0 in the first) to the middle of this one, and
//                   Coriolis acts about the current of the last step: so it is exact in the scheme of forces.h, U' =
//                   U_b + R (U1 − U_b) + Δt (−g∇η)
//
// Rest. A floe is at rest when it has the water's velocity of that step (cells.h). When water, wind or balance differ
// from those of the step before, no cell rests: every body is looked at and feels the forces again. Cells move along
// with the water: by its displacement since t = 0, the sum of Δt U_w over the steps, which every rank forms alike.
#ifndef BERGTOW_ENVIRONMENT_H
#define BERGTOW_ENVIRONMENT_H

#include "bergtow/case.h"
#include "bergtow/world.h"

typedef struct bt_environment bt_environment;

/// Current and wind of a case, or NULL when neither changes with time: bt_params then says it all. Tables are copied.
bt_environment *bt_environment_create(const bt_case *input);
void bt_environment_free(bt_environment *environment);

/// At the start of a step: water, wind, balance and tilt of its middle into world->par; wakes what rested when they
/// changed. Does nothing without an environment.
void bt_environment_begin(bt_world *world);

/// At the end of a step: displacement of the water, world->drift_x, world->drift_y.
void bt_environment_advance(bt_world *world);

/// Current (water true) or wind of a case at time t, m/s.
void bt_environment_at(const bt_case *input, bool water, double t, double v[2]);

/// Mean of current or wind over the run, m/s.
void bt_environment_mean(const bt_case *input, bool water, double v[2]);

/// Does the current or the wind of a case change in time?
bool bt_environment_changes(const bt_case *input);


#endif
