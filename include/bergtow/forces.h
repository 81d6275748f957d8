// SPDX-License-Identifier: MIT
// External forces: a table of laws, the free velocity U* and effective inertia of every body by them, and their record.
//
// Each law is one entry (bt_force_law) with one function, which adds its effect to the load of a body (bt_load). The
// integration of a load is in one place (src/force/load.h), and all users of the forces go through the same table: the
// prediction U*, the record of the towed body, the rest of floes, free drift, the undisturbed ice, the guards. So no
// force can be in one of them and missing in another.
// Rejected: a law as a function from velocity to force. An explicit drag reverses the relative velocity where Δt K > M,
// and Newton's method for free drift and the exact inertial circles of Coriolis need to distinguish linear, quadratic
// and rotation terms.
//
// The laws of the program (src/force/laws.h), per body, in the order of integration [model: Yulmetov & Løset 2017,
// section 1; coefficients: see the case schema]; m: its mass, M = m (1 + C_m):
//   Coriolis   exact rotation of U − U_b by (m/M) f Δt (inertial circles keep their speed), U_b: the velocity
//              in geostrophic balance with the sea-surface tilt, or 0
//   tilt       U += −(m/M) g ∇η Δt; with tilt: dynamic U += dU_w/dt Δt beyond that balance
//   skin drag  M dU/dt = ρ C_s A |v| v, v = U_ref − U;   I dω/dt = −(ρ_w C_ws + ρ_a C_as) ∫r³dA |ω| ω
//   form drag  dF = g (U_ref − U − ω×a), g = ½ρ C d max(0, −v·n) dl along the convex hull of the outline, and its
//              moment a×dF, with the local velocity v = U_ref − U − ω×r: water over the draft, air over the sail;
//              the arm a = t (t·r) + τ n (n·r)
//
// Added mass. Water that moves with a body is surrounded by water in which Coriolis and slope balance: neither acts on
// the added mass, so that a body drifts with a geostrophic current whatever its added mass, m f k×(U − U_b) = 0. In a
// changing current the body is pushed by (m_w + m_a) dU_w/dt, m_w the displaced mass, taken as m (it floats): U +=
// dU_w/dt Δt. Without f and slope that is the Froude–Krylov force and the added mass of the relative acceleration.
//
// Form drag. In translation ∮ max(0, −v̂·n) dl is the width across the flow, and the force ½ρ C d b |v| v. A rotating
// body meets water on opposite sides of its two ends, and is damped. Form drag is pressure, which acts along the
// normal, so that the part of the arm along it has no moment: τ = 0 by default, strip theory for each side (cross-flow
// principle, Faltinsen 1990). τ = 1 is drag along the local flow. A rectangle of 80 × 56 m and 58 m draft at 0.3°/s
// keeps 46 % of it after 30 min, 25 % with τ = 1 (an ellipse 91 and 45 %), and 99.8 % with skin drag alone. An outline
// whose centroid is not in the middle of its width also has a moment in translation. On a straight side v and a are
// linear along l and n is constant: on the inflow part, dF and a×dF are polynomials of second and third degree, for
// which two Gauss points are exact; no square root is left. Bays of an outline that is not convex are skipped: water
// meets the hull across them. Floes have the same law as the towed body: it costs 1 % of a step in 80 % ice and 4 % in
// 20 %, and a floe's resistance to being turned aside matters (docs/theory.md says how much).
//
// In time, drag is linearised about the velocities at the start of the step, g = ½ρ C d max(0, −v1·n) dl and ρ C_s A
// |v1|, and taken at U2:
//     F = Σ g Jᵀ (U_ref − J U2),   J U = U + ω×a,   K = Σ g JᵀJ symmetric, not negative
// Free velocity: (M + Δt K) U* = M U' + Δt Σ g Jᵀ U_ref, a mean of U', U_w and U_a with matrix weights: drag can never
// reverse a relative velocity, whatever Δt. For one fluid and no contact it is the exact solution of the quadratic law,
// 1/u2 = 1/u1 + kΔt/M. Contacts and line see only the diagonal of M + Δt K (a body has one inverse mass and one inertia
// in the sweeps), so that the coupling of rotation and drift by K is taken at U* instead of U2: an error of Δt K/M of
// that coupling, 1 % for a berg at full scale, and none if drift and rotation are not coupled. Rejected: drag applied
// before the contacts with the bare mass in the contacts; the drag on a body held at a speed is then too low by a
// factor 1 + Δt K/M. Coupling taken at U1: also stable, but a long step can reverse it.
#ifndef BERGTOW_FORCES_H
#define BERGTOW_FORCES_H

#include <math.h>

#include "bergtow/case.h"
#include "bergtow/law_key.h"
#include "bergtow/world.h"

BT_BEGIN_C

enum {
    BT_MAX_FORCE_LAWS = 64,
    BT_MAX_FORCE_SERIES = 2 * BT_MAX_FORCE_LAWS,
    BT_MAX_FORCE_OWN = 8,      ///< parameters of a law in a world
    BT_MAX_STREAMS = 8,        ///< in one load
};

/// A fluid that flows past the body, with drag ρ C A |v| v over its area and ½ ρ C d v max(0, −v·n) dl along its
/// outline.
typedef struct bt_stream {
    double u, v;               ///< velocity of the fluid, m/s
    double skin;               ///< ρ C A, kg/m
    double form;               ///< ½ ρ C d, kg/m²
} bt_stream;

/// The load of the laws on one body in a step, applied in this order: rotation about (about_x, about_y), gain, explicit
/// force, and all implicit parts together.
typedef struct bt_load {
    double turn;               ///< rate of rotation of the velocity of the body without added mass, rad/s: exact
    double about_x, about_y;   ///< velocity about which it rotates, m/s
    double gain_x, gain_y;     ///< velocity gain in the step, m/s: forces proportional to the mass
    double fx, fy, moment;     ///< explicit force, N, N, N m
    // Linear force j − K (U, ω), taken at the end of the step: K over (x, y, ω) is {{g, 0, −gy}, {0, g, gx}, {−gy, gx,
    // gw}}, symmetric positive semidefinite, as of dampers g at the points r: g = Σ g, gx, gy = Σ g r, gw = Σ g r².
    double g, gx, gy, gw;      ///< kg/s, kg m/s, kg m/s, kg m²/s
    double jx, jy, jw;         ///< N, N, N m; of dampers: Σ g U_ref, Σ g r×U_ref
    double yaw;                ///< moment −yaw |ω| ω, kg m²; implicit like the streams
    int n_streams;
    bt_stream stream[BT_MAX_STREAMS];
} bt_load;

/// Add drag in a stream. Without room for it the load becomes NaN, and the run ends in this step.
static inline void bt_load_stream(bt_load *load, double u, double v, double skin, double form)
{
    const bt_stream stream = {u, v, skin, form};
    if (load->n_streams < BT_MAX_STREAMS) load->stream[load->n_streams++] = stream;
    else load->fx = NAN;
}

/// Add a damper g, kg/s, at the centroid that draws the body towards the velocity (u, v), m/s.
static inline void bt_load_damper(bt_load *load, double g, double u, double v)
{
    load->g += g;
    load->jx += g * u;
    load->jy += g * v;
}

/// A body as passed to a law: a body of the world, or undisturbed ice (step/window.h), a mean floe without a position:
/// its place is NaN, so that a law that depends on the place without allowing for this is detected at once if a moving
/// window takes such ice in; elsewhere, in the speed through the ice, such ice counts as moving with the water.
typedef struct bt_force_body {
    const bt_params *par;      ///< Δt, current, wind of the step
    const double *own;         ///< [BT_MAX_FORCE_OWN] parameters of the law
    const void *context;       ///< of the law
    const bt_drag *drag;
    const bt_exposure *exposure; ///< shares of its drag that neighbours leave
    bt_vel vel;                ///< U1, m/s, rad/s
    double time;               ///< of the middle of the step, s
    double mass, inertia;      ///< M kg, I kg m²
    double share;              ///< m/M
    bool towed;
    // data for few laws, read by the functions below
    const bt_bodies *all;
    bt_idx i;
    const double *towed_at; ///< [2] m
} bt_force_body;

/// Radius of the circle about the outline, m.
static inline double bt_force_radius(const bt_force_body *body) { return body->all->radius[body->i]; }
/// Area of its outline, m².
static inline double bt_force_area(const bt_force_body *body) { return body->all->area[body->i]; }
/// Thickness of ice, m; 0 = not ice.
static inline double bt_force_thickness(const bt_force_body *body) { return body->all->thickness[body->i]; }

/// Pose at the start of the step, m, m, rad; x and y of the towed body are not wrapped.
static inline bt_pose bt_force_pose(const bt_force_body *body)
{
    bt_pose pose = body->all->pose[body->i];
    if (body->towed && !isnan(body->towed_at[0])) pose.x = body->towed_at[0], pose.y = body->towed_at[1];
    return pose;
}

/// A force law. Its effect follows from its parameters, the time and the body; checkpoints keep no other state.
typedef struct bt_force_law {
    const char *name;          ///< lower_snake; its series is NAME_force
    /// one line, "drag of water"; in the description of the series "on the towed body against the tow direction"
    /// follows
    const char *doc;
    /// the law is recorded in the series PART_OF_force, a sum of laws, too; NULL = only in its own
    const char *part_of;
    bool turns_only;           ///< it has a moment but no force: no series
    bool towed_only;           ///< it acts only on the towed body: add is not called for others
    /// [n_keys] own[k] is the value of the k-th; they are read, checked, listed and written like all others
    const bt_law_key *keys;
    int n_keys;
    /// set own[] from other keys of the case; own[0..n_keys) are already set. NULL = no others
    void (*setup)(const bt_case *input, double own[BT_MAX_FORCE_OWN]);
    /// May a floe that drifts with the water rest: does the law neither move it nor change from step to step? Called
    /// once per step. NULL = never, which is correct for every law, but costs the time that floes at rest save. Not
    /// called if towed_only.
    bool (*rests)(const bt_params *par, const double *own);
    /// Add the load of the law on the body in this step to *load. Called for every body in every step, by several
    /// threads at once: it must change only *load. Required.
    void (*add)(const bt_force_body *body, bt_load *load);
    /// Called by one thread before the step is solved, when all bodies have their places, for work on all bodies
    /// together; again if floes split and the step is solved anew with the pieces. It may set own[]; if its `rests`
    /// then becomes false, floes at rest are woken. Returns NULL, or the reason of a failure: the run ends after this
    /// step. NULL instead of the function = nothing to do. Only for registered laws, not those in src/force/laws.h;
    /// likewise `context`.
    const char *(*begin)(const bt_world *world, double own[BT_MAX_FORCE_OWN], void *context);
    void *context;             ///< passed to `begin`, and to `add` in the body
} bt_force_law;

/// The laws, in the order in which they add; written only by bt_force_register.
extern const bt_force_law *bt_force_laws[BT_MAX_FORCE_LAWS];
extern int bt_n_force_laws;

/// Add a law to the table, for a program that uses the library: before it reads a case or makes a world (a world has
/// the laws that existed when it was made), and from one thread. On all ranks alike. The law and its texts must remain
/// valid to the end of the program. Errors: BT_ERR_USAGE, with reason and remedy in err: a missing or used name, no
/// `add`, no `doc`, more than BT_MAX_FORCE_OWN keys, a full table.
bt_status bt_force_register(const bt_force_law *law, bt_errors *err);

/// A series of forces: of one law, or the sum of laws that are part_of it.
typedef struct bt_force_series {
    const char *name;          ///< without _force
    const bt_force_law *law;   ///< NULL = a sum
    bool part;                 ///< it is also in a sum: sums of the forces on the body must leave it out
} bt_force_series;

/// The series in the order of the laws, a sum before its first part; present ones keep their index when laws are added.
extern bt_force_series bt_force_series_of[BT_MAX_FORCE_SERIES];
extern int bt_n_force_series;

/// Index into bt_force_series_of, −1 = none.
int bt_force_series_find(const char *name);

/// Linear and angular impulse of a step.
typedef struct bt_impulse { double x, y, turn; } bt_impulse; ///< N s, N s, N m s

/// The laws of a world: their parameters, and their impulses on the towed body in the step just solved.
typedef struct bt_forces {
    int n;                     ///< laws
    int n_series;
    bool under_way;            ///< `begin` of a law runs: contacts are neither of the last step nor of this one
    const bt_force_law *failed; ///< a law whose `begin` has failed, and the reason; NULL = none
    const char *why;
    double towed_at[2];        ///< place of the towed body, not wrapped, m; NaN until the first step
    /// has acted in this step or before: a checkpoint names the added laws that have. Applied forces
    /// (bergtow/applied.h) act from the first step with a row that is not 0, all other laws always.
    bool acted[BT_MAX_FORCE_LAWS];
    double own[BT_MAX_FORCE_LAWS][BT_MAX_FORCE_OWN]; ///< [law][number]
    /// as used by the step, implicit parts with U2; their sum with those of contacts and line is M (U2 − U1), I (ω2 −
    /// ω1)
    bt_impulse law[BT_MAX_FORCE_LAWS];
    bt_impulse series[BT_MAX_FORCE_SERIES];
} bt_forces;

/// The impulses on body i in the step just solved, before it has moved, as in bt_forces; for a kinematic body those of
/// the forces at its prescribed velocity. law: [BT_MAX_FORCE_LAWS]; series: [BT_MAX_FORCE_SERIES].
void bt_forces_impulses(const bt_world *world, bt_idx i, bt_impulse *law, bt_impulse *series);

/// The load of all laws on body i at velocity u.
void bt_forces_load(const bt_world *world, bt_idx i, const bt_vel *u, bt_load *load);

/// Drag of one body from the moments of its outline: the products of bt_drag (body.h). draft, sail: m; densities:
/// kg/m³; coefficients of form and skin drag: 1 (bt_drag_coefs).
bt_drag bt_forces_drag(const bt_moments *moments, double draft, double sail, double water_density, double air_density,
                       double water_form, double water_skin, double air_form, double air_skin);

BT_END_C

#endif
