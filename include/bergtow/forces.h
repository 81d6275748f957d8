// SPDX-License-Identifier: MIT
// External forces: free velocity U* = U1 + M⁻¹ F_ext Δt of every body.
//
// Per body, in this order [model: Yulmetov & Løset 2017, section 1; coefficients: see the case schema]:
//   Coriolis   exact rotation of U − U_b by f Δt (inertial circles keep their speed), U_b: the velocity
//              in geostrophic balance with the sea-surface tilt, or 0
//   tilt       U += −g ∇η Δt
//   drag       M dU/dt = k_w |U_w−U| (U_w−U) + k_a |U_a−U| (U_a−U), with
//              k_w = ρ_w C_ws A + ½ρ_w C_w d b(φ), k_a likewise with sail height; b(φ) width across the flow
//   yaw        I dω/dt = −(ρ_w C_ws + ρ_a C_as) ∫r³dA |ω| ω
// Drag is linearised about the speeds at the start of the step and integrated implicitly:
//   U* = (M U + Δt (K_w U_w + K_a U_a)) / (M + Δt (K_w + K_a)),  K = k |U_ref − U|
// a weighted mean of U, U_w and U_a, so that drag can never reverse a relative velocity, whatever Δt. For one fluid it
// is the exact solution of the quadratic law, 1/u2 = 1/u1 + kΔt/M.
#ifndef BERGTOW_FORCES_H
#define BERGTOW_FORCES_H

#include "bergtow/world.h"

/// Fill vel_start (U1), and vel and vel_free (U*) of every dynamic body. Kinematic and static bodies keep vel.
void bt_forces_predict(bt_world *w);

/// External impulse on body i in this step, N s, N s, N m s: M(U*−U1) of a dynamic body; for a kinematic body what
/// the same forces give at its prescribed velocity.
void bt_forces_impulse(const bt_world *w, bt_idx i, double j[3]);

/// Drag of one body from its outline, draft and coefficients: multiplied out.
bt_drag bt_forces_drag(const bt_moments *m, double draft, double sail, double water_density, double air_density,
                       double water_form, double water_skin, double air_form, double air_skin);

#endif
