// SPDX-License-Identifier: MIT
// External forces: free velocity U* and effective inertia of every body.
//
// Per body, in this order [model: Yulmetov & Løset 2017, section 1; coefficients: see the case schema]; m: its mass, M
// = m (1 + C_m):
//   Coriolis   exact rotation of U − U_b by (m/M) f Δt (inertial circles keep their speed), U_b: the velocity
//              in geostrophic balance with the sea-surface tilt, or 0
//   tilt       U += −(m/M) g ∇η Δt; with tilt: dynamic U += dU_w/dt Δt beyond that balance
//   skin drag  M dU/dt = ρ C_s A |v| v, v = U_ref − U;   I dω/dt = −(ρ_w C_ws + ρ_a C_as) ∫r³dA |ω| ω
//   form drag  dF = ½ρ C d |v| v max(0, −v̂·n) dl = ½ρ C d v max(0, −v·n) dl along the convex hull of the outline, and its moment r×dF, with the
//              local velocity v = U_ref − U − ω×r: water over the draft, air over the sail
//
// Added mass. Water that goes along with a body moves relative to water that has Coriolis and slope in balance: neither
// acts on it, so that a body drifts with a geostrophic current whatever its added mass, m f k×(U − U_b) = 0. In a
// current that changes, the body is pushed by (m_w + m_a) dU_w/dt, m_w the displaced mass, taken as m (it floats): U +=
// dU_w/dt Δt. Without f and slope that is the Froude–Krylov force and the added mass of the relative acceleration.
//
// Form drag. In translation ∮ max(0, −v̂·n) dl is the width across the flow, and the force ½ρ C d b |v| v. A body that
// turns meets water on the other side of each end, and is damped: an ellipse of 80 × 56 m and 58 m draft at 0.3°/s
// keeps 45 % of it after 30 min (a rectangle 25 %), and 99.8 % with skin drag alone. An outline whose centroid does not
// lie in the middle of its width has a moment in translation, too. On a straight side v is linear along l and n
// constant: where water comes in, dF and r×dF are polynomials of second and third degree, and two points of Gauss on
// that stretch exact; no square root is left. A bay of an outline that is not convex is passed by: water meets the hull
// across it. Floes have the same law as the towed body: it costs 1 % of a step in 80 % ice and 4 % in 20 %, and what a floe resists to
// being turned aside counts (docs/theory.md says how much).
//
// In time, drag is linearised about the velocities at the start of the step, g = ½ρ C d max(0, −v1·n) dl and ρ C_s A
// |v1|, and taken at U2:
//     F = Σ g Jᵀ (U_ref − J U2),   J U = U + ω×r,   K = Σ g JᵀJ symmetric, not negative
// Free velocity: (M + Δt K) U* = M U' + Δt Σ g Jᵀ U_ref, a mean of U', U_w and U_a with matrix weights: drag can never
// reverse a relative velocity, whatever Δt. For one fluid and no contact it is the exact solution of the quadratic law,
// 1/u2 = 1/u1 + kΔt/M. Contacts and line see the diagonal of M + Δt K alone (a body has one inverse mass and one
// inertia in the sweeps), so that what K couples of turning and drift is that of U* instead of U2: a part Δt K/M of
// that coupling, 1 % of it for a berg at full scale; nothing where drift and turning are not coupled. Rejected: drag
// applied before the contacts with the bare mass in the contacts; the drag on a body held at a speed is then too low by
// a factor 1 + Δt K/M. Coupling taken at U1: stable, too, but a long step can reverse it.
#ifndef BERGTOW_FORCES_H
#define BERGTOW_FORCES_H

#include "bergtow/world.h"

/// Fill vel_start (U1), vel and vel_free (U*) and inv (effective) of every dynamic body. Kinematic and static bodies
/// keep vel.
void bt_forces_predict(bt_world *w);

/// External impulses of a step on one body by what they come from.
typedef struct bt_external {
    double drag[2], turn;   ///< water and air, N s; their moment, N m s
    double coriolis[2];     ///< N s: M (R − I) U1, R the rotation by (m/M) f Δt
    double tilt[2];         ///< N s: −m g ∇η Δt, or in balance with U_b: −M (R − I) U_b; with M dU_w/dt Δt
} bt_external;

/// External impulses on body i in the step just solved; of a dynamic body from U1, U* and U2 by the scheme above
/// (contact impulses do not enter), so that their sum is what the step has used, to rounding; of a kinematic body the
/// same forces at its prescribed velocity.
bt_external bt_forces_external(const bt_world *w, bt_idx i);

/// What Coriolis and the slope of the sea do in a step to bodies of one share m/M of their own mass.
typedef struct bt_turning {
    double share;  ///< m/M
    double c, s;   ///< of the angle m/M f Δt
    double vx, vy; ///< velocity that the slope adds, m/s
} bt_turning;
bt_turning bt_forces_turning(const bt_params *p, double share);

/// U' = U_b + R (U − U_b) + Δt (−g ∇η): the one place where the law stands, for bodies, the undisturbed ice of a window
/// and free drift.
static inline void bt_forces_turn(const bt_params *p, const bt_turning *r, bt_vel *u)
{
    if (r->s != 0) {
        const double x = u->x - p->balance_u, y = u->y - p->balance_v;
        u->x = p->balance_u + r->c * x - r->s * y;
        u->y = p->balance_v + r->s * x + r->c * y;
    }
    u->x += r->vx;
    u->y += r->vy;
}

/// Drag of one body from its outline, draft and coefficients: multiplied out.
bt_drag bt_forces_drag(const bt_moments *m, double draft, double sail, double water_density, double air_density,
                       double water_form, double water_skin, double air_form, double air_skin);

#endif
