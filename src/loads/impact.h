// SPDX-License-Identifier: MIT
// Loads on the towed body: contact impulses of a step separated into quasi-static loads and collisions, and collisions
// as forces.
//
// A step gives impulses. What they mean as forces depends on how long they act, which a rigid contact does not say [Y:
// Yulmetov & Løset 2017, section 2.2 begins so; formulas derived here]:
//
//   quasi-static  a contact that has been closed before: F = λ / Δt
//   collision     a contact whose approach the step cuts: λ_c acts for the time of a collision, T_c, not for a step
//
// Separation. A manifold's impulse λ acts at its pressure centre, θ_i = λ_i / λ. There, with W = n·(M_a⁻¹ +
// M_b⁻¹)·n including rotation, W_nt the coupling with the tangent, and ρ = λ_t / λ, an impulse alone changes the normal
// velocity by λ (W + ρ W_nt). From an approach v1 < 0 at the start of the step to v2 at its end the collision takes
//     λ_c = min(λ, (v2 − v1) / (W + ρ W_nt)),      λ − λ_c is quasi-static,      m_e = 1/W.
// M is the mass with added mass, without the drag of the step. For one floe that hits by itself this is all of λ; a
// floe held against the hull by wind, or by others, has v1 = 0 and λ_c = 0. Rejected: the manifold's two points each by
// itself, λ_i against (v2 − v1)_i / W_ii; a square hit flush then shows 4/5 of its momentum, since the points share it.
// A blow that comes through a floe already against the hull has no approach there: it is quasi-static, and as sharp as
// Δt makes it. Approaches below a least speed count as quasi-static: a contact that has converged to the tolerance
// still creeps, and one that slides over a corner of the hull meets a new normal every step.
//
// Events. The step in which a gap closes leaves the approach gap/Δt (the bias b of solver.h); the next step takes the
// rest. So a collision goes on into the next step if the last one left a rest of approach above the solver's tolerance
// and it is this that is cut; impulses add up.
//
// Force of a collision with impulse λ, approach v_n and effective mass m_e; every peak names which:
//   duration    T_c given:                       mean λ / T_c,  peak (π/2) λ / T_c of a half-sine
//   crushing    a corner of angle φ is crushed at pressure p over thickness h: F = k x, k = 2 p h tan(φ/2), so
//               peak v_n √(k m_e) after t_p = (π/2) √(m_e / k),  mean (2/π) peak up to then, without the rebound
// In the second v_n is what the contact itself takes away, min(approach, λ / m_e): neighbours may take a part.
//
// What is counted of them, and from when: src/output/impact_count.h, src/loads/panel.h.
//
// On several ranks every rank finds the contacts that it owns; rank 0 gathers them, in the order of ids, and has all
// that follows.
#ifndef BT_IMPACT_H
#define BT_IMPACT_H

#include "bergtow/case.h"
#include "bergtow/world.h"
#include "loads/panel.h"

/// One manifold on the towed body in one step. Numbers only, so that ranks can hand it on as a row.
typedef struct bt_body_contact {
    double gid;           ///< of the other body
    double x, y;          ///< pressure centre, m, body frame
    double nx, ny;        ///< direction of the normal force on the towed body, body frame; the tangent is (−ny, nx)
    double normal, friction; ///< λ, λ_t on the towed body, N s
    double collision;     ///< λ_c, N s
    double approach;      ///< −v1 where the contact closes, otherwise 0, m/s
    double rest;          ///< −v2 where it still closes, otherwise 0, m/s
    double mass;          ///< m_e, kg
    double thickness;     ///< of the ice that is crushed, m
    double corner;        ///< interior angle of the corner in contact, rad; NaN if it has none
    double px[2], py[2], point[2]; ///< contact points, m, body frame, and the normal impulse of each, N s
} bt_body_contact;

/// A collision.
typedef struct bt_impact {
    double time;          ///< end of the step in which it began, s
    double gid;           ///< of the floe (or wall)
    double x, y;          ///< on the hull, m, body frame
    double panel;
    double impulse;       ///< λ_c, N s
    double approach;      ///< v_n, m/s
    double mass;          ///< m_e, kg
    double thickness;     ///< m
    double corner;        ///< φ used by the conversion `crushing`, rad
    double mean, peak;    ///< N, by the conversion
    double duration;      ///< T_c or t_p, s
} bt_impact;

/// A collision that may go on in the next step.
typedef struct bt_impact_open {
    bt_impact so_far;
    double rest;          ///< approach that the last step left, m/s
    double largest;       ///< largest λ_c of one manifold in it so far: place, mass and corner are of that one, N s
} bt_impact_open;

/// What the conversion goes by.
typedef struct bt_impact_rule {
    bt_impact_conversion conversion;
    double duration;      ///< T_c, s
    double pressure;      ///< p, Pa
    bool real_corner;     ///< φ of the floe's or hull's own corner where there is one
    double corner_angle;  ///< φ otherwise, rad
    double least_speed;   ///< slower approaches are quasi-static, m/s
} bt_impact_rule;

/// State of this part: on rank 0 everything; on other ranks only rule, panels' geometry and scratch.
typedef struct bt_impacts {
    bt_impact_rule rule;
    double dt, tolerance; ///< s, m/s
    double sheet;         ///< mass of a floe, added mass included, over its area and thickness, kg/m³
    double body_height;   ///< thickness of the towed body, for contacts with walls, m
    bt_panels panels;
    // the last step
    bt_body_contact *contact;    ///< [n_contacts] by gid
    int64_t n_contacts;
    bt_impact *closed;    ///< [n_closed] collisions that ended in it, by gid
    int64_t n_closed, cap_closed;
    double collision_x, collision_y; ///< share of collisions in the contact impulse on the body, world frame, N s
    double largest_quasi_static_load;  ///< Σ (λ − λ_c) / Δt over the manifolds of one floe or wall, N
    // carried on
    bt_impact_open *open; ///< [n_open] by gid
    int64_t n_open;
} bt_impacts;

bt_impact_rule bt_impact_rule_of(const bt_case *input);
/// Mean, peak and duration of a collision from its impulse, approach, mass, thickness and corner.
void bt_impact_convert(const bt_impact_rule *rule, bt_impact *impact);

/// For the towed body of the world; NULL when the case asks for none, or there is no body.
bt_impacts *bt_impacts_create(const bt_case *input, const bt_world *world);
void bt_impacts_free(bt_impacts *impacts);

/// Collective. Take the step just solved: after the solve and before poses move.
void bt_impacts_take(bt_world *world);

/// The run is over: what is still open is closed as it is, into `closed`.
void bt_impacts_end(bt_impacts *impacts);

/// What the conversion is, in words: "half-sine of 0.1 s".
void bt_impact_describe(const bt_impact_rule *rule, char out[160]);

#endif
