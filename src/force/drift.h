// SPDX-License-Identifier: MIT
// Free drift: the velocity at which the forces of water, wind, Coriolis and slope on a body balance, and with which ice
// starts (ice.start: drift).
//
//     k_w |U_w − U| (U_w − U) + k_a |U_a − U| (U_a − U) + M (U' − U)/Δt + … = 0
//
// with U' the velocity after Coriolis force and slope in a step, plus all else in the table of force laws: the load of
// the body (forces.h) at U, with the exact derivative of drag.
//
// The left side is the force in a step of the scheme itself, so that without contacts a body that starts with this
// velocity keeps it to rounding. It agrees with M dU/dt = 0 except for a fraction f Δt/2 of the Coriolis force (4e-4 at
// 5 s). Each body has its own velocity, as thickness, size and outline differ. The body does not rotate: the moment of
// form drag on an asymmetric outline is neglected.
//
// Form drag is ½ρC d |v × D| v, D from one of the outermost vertices across the flow to the other, i.e. piecewise
// quadratic in v = U_ref − U, and skin drag is smooth: Newton's method, with steps that lower the residual. The
// solution exists and is unique: both drags are monotone in U apart from the change of width with direction, and
// Coriolis is skew. It starts at the velocity at which the water's drag alone would balance the force on a body that
// moves with the water; if that force is 0, the body has exactly the velocity of the water, and rests in it (cells.h).
#ifndef BERGTOW_DRIFT_H
#define BERGTOW_DRIFT_H

#include "bergtow/world.h"

/// Free drift of body i in the water and wind of world->par, m/s. hold: whether walls keep it at rest along x, y; the
/// other component balances. A body without any drag or damper does not drift: u = 0. False if no balance was found.
bool bt_drift_velocity(const bt_world *world, bt_idx i, const bool hold[2], double u[2]);

#endif
