// SPDX-License-Identifier: MIT
// Free drift: the velocity at which the forces of water, wind, Coriolis and slope on a body balance, with which ice
// begins (ice.start: drift).
//
//     k_w |U_w − U| (U_w − U) + k_a |U_a − U| (U_a − U) + M (U' − U)/Δt + … = 0
//
// with U' the velocity after Coriolis force and slope in a step, and whatever else the table of force laws has: the
// load of the body (forces.h) at U, of which drag is differentiated exactly.
//
// The left side is the force in a step of the scheme itself, so that a body that begins with this velocity keeps it,
// without contacts, to rounding. It is that of M dU/dt = 0 but for f Δt/2 of the Coriolis force (4e-4 at 5 s). Each
// body has its own: thickness, size and outline differ. The body does not turn: the moment that form drag has on an
// outline without symmetry is left out.
//
// Form drag is ½ρC d |v × D| v, D from one of the outermost vertices across the flow to the other, i.e. piecewise
// quadratic in v = U_ref − U, and skin drag is smooth: Newton's method, with steps that lower the residual. It exists
// and is the only one: both drags are monotone in U but for the change of width with direction, Coriolis is skew. Begun
// at the velocity at which the water's drag alone would bear the force on a body that moves with the water; where that
// force is 0, the body has exactly the velocity of the water, and rests in it (cells.h).
#ifndef BERGTOW_DRIFT_H
#define BERGTOW_DRIFT_H

#include "bergtow/world.h"

/// Free drift of body i in the water and wind of world->par, m/s. hold: along x, y it stays at rest (walls); the other
/// component balances. A body without any drag or damper does not drift: u = 0. False when the balance was not found.
bool bt_drift_velocity(const bt_world *world, bt_idx i, const bool hold[2], double u[2]);

#endif
