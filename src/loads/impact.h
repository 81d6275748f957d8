// SPDX-License-Identifier: MIT
// Loads on the towed body: contact impulses of a step separated into quasi-static loads and collisions, and collisions
// as forces.
//
// A step gives impulses. Their forces depend on how long they act, which a rigid contact does not determine [Yulmetov &
// Løset 2017, beginning of section 2.2; formulas derived here]:
//
//   quasi-static  a contact that was closed before: F = λ / Δt
//   collision     a contact whose approach the step stops: λ_c acts for the time of a collision, T_c, not for a step
//
// Separation. A manifold's impulse λ acts at its pressure centre, θ_i = λ_i / λ. There, with W = n·(M_a⁻¹ + M_b⁻¹)·n
// including rotation, W_nt the coupling with the tangent, and ρ = λ_t / λ, an impulse λ alone changes the normal
// velocity by λ (W + ρ W_nt). From an approach v1 < 0 at the start of the step to v2 at its end the collision takes
//     λ_c = min(λ, (v2 − v1) / (W + ρ W_nt)),      λ − λ_c is quasi-static,      m_e = 1/W.
// M is the mass with added mass, without the drag of the step. For a single floe that hits the hull this is all of λ; a
// floe held against the hull by wind, or by others, has v1 = 0 and λ_c = 0. Rejected: the manifold's two points
// separately, λ_i against (v2 − v1)_i / W_ii; a square that hits flush then shows 4/5 of its momentum, since the points
// share it. A blow transmitted by a floe already against the hull has no approach there: it is quasi-static, and its
// peak depends on Δt. Approaches below a least speed count as quasi-static: a contact that has converged to the
// tolerance still creeps, and a contact that slides over a corner of the hull meets a new normal every step.
//
// Collision. What lies within one outline is hit once: a floe with all its parts, and a shore (space/shore.h) with all
// its pieces, however it is cut. Its manifolds act together in a step as the points of one do: λ_c adds up, and with
// the shares s_k = λ_c,k / Σ λ_c, m_e = 1/W of J = Σ s_k J_k. So two faces of a shore that meet in a bay, or two of its
// quays that the body hits in the same step, are one collision. Its x, y, panel, thickness, corner and name (of the
// floe, or the piece of the shore) are those of the manifold with the largest λ_c. Two shores are two collisions. A
// quasi-static load, too, is that of an outline. Rejected: one collision for each piece, which divided a blow, and its
// peak, by the cuts; faces told apart by their normals, for which a limit would have to be chosen.
//
// Events. The step in which a gap closes leaves the approach gap/Δt (the bias b of solver.h); the next step stops the
// rest. So a collision continues in the next step if the last one left an approach above the solver's tolerance and
// this rest is now stopped; impulses add up. Where the force must be known at once (step/splitting.h), the sum follows
// from the first step: the velocity that a contact changes is in proportion to its impulse, so that of both is
//     Λ = λ_c v1 / (v1 − v2)   for v2 < 0, otherwise λ_c
// however the gap divides it.
//
// A collision counts in the step in which it ends, and the last step of a case ends those under way: series and rows
// hold the same ones. Rejected: to end them in the rows of a run that is stopped. Its last sample is written by then,
// and the run that resumes it continues them.
//
// Force of a collision with impulse λ, approach v_n and effective mass m_e, by the conversion:
//   duration    T_c given:                       mean λ / T_c,  peak (π/2) λ / T_c of a half-sine
//   crushing    a corner of angle φ is crushed at pressure p over thickness h: F = k x, k = 2 p h tan(φ/2), so
//               peak v_n √(k m_e) after t_p = (π/2) √(m_e / k),  mean (2/π) peak up to then, without the rebound
// In the second v_n is the approach that the contact itself removes, min(approach, λ / m_e): neighbours may share it.
// Where contact laws limit what the ice bears (contact/law.h), the peak is at most that: for ice that is crushed, the
// force at the depth where the work of crushing is ½ m_e v_n². Then peak and mean are less, and the duration is longer,
// by the same factor. Rejected: this force in place of the conversion. Flush edges bear all of it at the first touch,
// p h times their length, however slow the approach: real ice gives way elastically first.
//
// Counts, and their start: src/output/impact_count.h, src/loads/panel.h.
//
// On several ranks every rank finds the contacts that it owns; rank 0 gathers them, by id, and does the rest.
#ifndef BT_IMPACT_H
#define BT_IMPACT_H

#include "bergtow/case.h"
#include "bergtow/world.h"
#include "contact/cell_contacts.h"
#include "loads/panel.h"

/// One manifold on the towed body in one step. Numbers only, so that ranks can exchange it as a row.
typedef struct bt_body_contact {
    double gid;           ///< of the other body
    double outline;       ///< of that body: bt_shore_outline
    double x, y;          ///< pressure centre, m, body frame
    double nx, ny;        ///< direction of the normal force on the towed body, body frame; the tangent is (−ny, nx)
    double normal, friction; ///< λ, λ_t on the towed body, N s
    double collision;     ///< λ_c, N s
    double approach;      ///< −v1 if the contact closes, otherwise 0, m/s
    double rest;          ///< −v2 if it still closes, otherwise 0, m/s
    double mass;          ///< m_e, kg
    double arm, other_arm; ///< r×n of the pressure centre on the towed body and on the other, m
    double inverse_mass, inverse_inertia; ///< of the other body, 1/kg, 1/(kg m²)
    double most;          ///< force that the contact laws let it bear as a collision, N; may be INFINITY
    double thickness;     ///< of the ice that is crushed, m
    double corner;        ///< interior angle of the corner in contact, rad; NaN if it has none
    double px[2], py[2], point[2]; ///< contact points, m, body frame, and the normal impulse of each, N s
} bt_body_contact;

/// A collision.
typedef struct bt_impact {
    double time;          ///< end of the step in which it began, s
    double gid;           ///< of the floe (or wall, or piece of a shore)
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

/// A collision that may continue in the next step.
typedef struct bt_impact_open {
    bt_impact so_far;
    double rest;          ///< approach that the last step left, m/s
    double largest;       ///< largest λ_c of one manifold so far, which gives name, place and corner, N s
    double most;          ///< force that the contact laws let the contacts of one step bear, the largest so far, N;
                          ///< 0 = not known, from a checkpoint of version 0.1.0
} bt_impact_open;

/// Parameters of the conversion.
typedef struct bt_impact_rule {
    bt_impact_conversion conversion;
    double duration;      ///< T_c, s
    double pressure;      ///< p, Pa
    bool real_corner;     ///< use the angle of the floe's or hull's corner if there is one
    double corner_angle;  ///< φ otherwise, rad
    double least_speed;   ///< slower approaches are quasi-static, m/s
    bool limited;         ///< by contact laws
} bt_impact_rule;

/// State of this part: on rank 0 everything; on other ranks only rule, panels' geometry and scratch.
typedef struct bt_impacts {
    bt_impact_rule rule;
    double dt, tolerance; ///< s, m/s
    double sheet;         ///< mass of a floe, added mass included, over its area and thickness, kg/m³
    double body_height;   ///< thickness of the towed body, for contacts with walls, m
    bt_panels panels;
    // the last step
    bt_body_contact *contact;    ///< [n_contacts] by outline
    int64_t n_contacts;
    bt_impact *closed;    ///< [n_closed] collisions that ended in the step, by outline
    int64_t n_closed, cap_closed;
    double collision_x, collision_y; ///< share of collisions in the contact impulse on the body, world frame, N s
    double largest_quasi_static_load;  ///< Σ (λ − λ_c) / Δt over the manifolds of one outline, N
    // carried over to the next step
    bt_impact_open *open; ///< [n_open] one for each outline, in that order
    int64_t n_open;
} bt_impacts;

bt_impact_rule bt_impact_rule_of(const bt_case *input);
/// Mean, peak and duration of a collision from its impulse, approach, mass, thickness and corner, and the most that
/// the contact laws let the ice bear, N; 0 = not known.
void bt_impact_convert(const bt_impact_rule *rule, double most, bt_impact *impact);

/// Create it for the towed body of the world; NULL if the case does not ask for collisions, or there is no body.
bt_impacts *bt_impacts_create(const bt_case *input, const bt_world *world);
void bt_impacts_free(bt_impacts *impacts);

/// Collective. Take the step just solved: after the solve and before poses move.
void bt_impacts_take(bt_world *world);

/// After a state was read: bring the open collisions into order. An earlier program had one for each piece of a shore;
/// they become one.
void bt_impacts_resume(bt_world *world);

/// After the last step of a case: the open collisions end with it, as they are, and follow those in `closed`.
void bt_impacts_end(bt_impacts *impacts);

/// Description of the conversion, such as "half-sine of 0.1 s".
void bt_impact_describe(const bt_impact_rule *rule, char out[160]);

// --- one contact as a collision --------------------------------------------------------------------------------------

// Of the step just solved: the part of its impulse that stops the approach, and the corner in contact.

typedef struct bt_collision {
    double impulse;   ///< λ_c, N s
    double whole;     ///< Λ: of this step and the next, if the collision continues there, N s
    double approach;  ///< −v1 if the contact closes, otherwise 0, m/s
    double rest;      ///< −v2 if it still closes, otherwise 0, m/s
    double mass;      ///< m_e, kg
    double ran, rbn;  ///< ra×n, rb×n of the pressure centre, m
} bt_collision;

/// The collision part of a contact with a normal impulse above 0, after the solve and before poses move.
bt_collision bt_contact_collision(const bt_world *world, const bt_contact *contact);

/// The most that the contact laws let contact j of the cell bear in this collision of it, N; INFINITY where none limits
/// it.
double bt_collision_bears(const bt_world *world, const bt_cell *cell, bt_idx j, const bt_collision *collision);

typedef struct bt_contact_corner {
    double angle;     ///< interior, rad; NaN if there is none
    int of;           ///< 0 = corner of a, 1 = of b; −1 = the sharper of two corners that meet
} bt_contact_corner;

/// The corner that makes a contact point of a pair of parts, from its feature as numbered by manifold.c.
bt_contact_corner bt_contact_corner_of(const bt_world *world, const bt_contact *contact, const uint16_t part[2],
                                       uint32_t feature);

#endif
