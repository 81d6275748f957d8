// SPDX-License-Identifier: MIT
// External forces: free velocity U* and effective inertia of every body.
//
// Per body, in this order [model: Yulmetov & Løset 2017, section 1; coefficients: see the case schema]:
//   Coriolis   exact rotation of U − U_b by f Δt (inertial circles keep their speed), U_b: the velocity
//              in geostrophic balance with the sea-surface tilt, or 0
//   tilt       U += −g ∇η Δt
//   drag       M dU/dt = k_w |U_w−U| (U_w−U) + k_a |U_a−U| (U_a−U), with
//              k_w = ρ_w C_ws A + ½ρ_w C_w d b(φ), k_a likewise with sail height; b(φ) width across the flow
//   yaw        I dω/dt = −(ρ_w C_ws + ρ_a C_as) ∫r³dA |ω| ω
// Drag is linearised about the speeds at the start of the step, K = k |U_ref − U1|, and taken at U2:
//     (M + Δt K) U2 = M U1 + Δt (K_w U_w + K_a U_a) + Jᵀ λ
// So the contact problem has the effective mass M + Δt K, and U* = (M U1 + Δt Σ K U_ref)/(M + Δt K) is a weighted
// mean of U1, U_w and U_a: drag can never reverse a relative velocity, whatever Δt. For one fluid and no contact it
// is the exact solution of the quadratic law, 1/u2 = 1/u1 + kΔt/M. Rejected: drag applied before the contacts
// with the bare mass in the contacts; the drag on a body held at a speed is then too low by a factor 1 + Δt K/M.
#ifndef BERGTOW_FORCES_H
#define BERGTOW_FORCES_H

#include "bergtow/world.h"

/// Fill vel_start (U1), vel and vel_free (U*) and inv (effective) of every dynamic body. Kinematic and static bodies
/// keep vel.
void bt_forces_predict(bt_world *w);

/// External impulses of a step on one body by what they come from.
typedef struct bt_external {
    double drag[2], turn;   ///< water and air, N s; their moment, N m s
    double coriolis[2];     ///< N s: M (R − I) U1, R the rotation by f Δt
    double tilt[2];         ///< N s: −M g ∇η Δt, or in balance with U_b: −M (R − I) U_b
} bt_external;

/// External impulses on body i in the step just solved; of a dynamic body from U1, U* and U2 by the scheme above (contact
/// impulses do not enter), so that their sum is what the step has used, to rounding; of a kinematic body the same forces at its prescribed velocity.
bt_external bt_forces_external(const bt_world *w, bt_idx i);

/// Drag of one body from its outline, draft and coefficients: multiplied out.
bt_drag bt_forces_drag(const bt_moments *m, double draft, double sail, double water_density, double air_density,
                       double water_form, double water_skin, double air_form, double air_skin);

#endif
