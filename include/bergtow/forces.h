// SPDX-License-Identifier: MIT
// External forces: a table of laws, the free velocity U* and effective inertia of every body by them, and their record.
//
// One law, one entry (bt_force_law), one function that says what the law does to a body: it adds to the load of the
// body (bt_load). How a load is integrated stands in one place (src/force/load.h), and whatever needs the forces goes
// through the same table: the prediction U*, the record of the towed body, the rest of floes, free drift, the
// undisturbed ice, the guards. A force can so not be in one of them and missing in another.
// Rejected: a law as a function from velocity to force. An explicit drag reverses the relative velocity where Δt K > M,
// and Newton's method of free drift and the exact circles of Coriolis need to know what is linear, quadratic or a
// rotation.
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
// Added mass. Water that goes along with a body moves relative to water that has Coriolis and slope in balance: neither
// acts on it, so that a body drifts with a geostrophic current whatever its added mass, m f k×(U − U_b) = 0. In a
// current that changes, the body is pushed by (m_w + m_a) dU_w/dt, m_w the displaced mass, taken as m (it floats): U +=
// dU_w/dt Δt. Without f and slope that is the Froude–Krylov force and the added mass of the relative acceleration.
//
// Form drag. In translation ∮ max(0, −v̂·n) dl is the width across the flow, and the force ½ρ C d b |v| v. A body that
// turns meets water on the other side of each end, and is damped. Form drag is pressure, which acts along the normal,
// so that the part of the arm along it has no moment: τ = 0 by default, strip theory for each side (cross-flow
// principle, Faltinsen 1990). τ = 1 is drag along the local flow. A rectangle of 80 × 56 m and 58 m draft at 0.3°/s
// keeps 46 % of it after 30 min, 25 % with τ = 1 (an ellipse 91 and 45 %), and 99.8 % with skin drag alone. An outline
// whose centroid does not lie in the middle of its width has a moment in translation, too. On a straight side v and a
// are linear along l and n constant: where water comes in, dF and a×dF are polynomials of second and third degree, and
// two points of Gauss on that stretch exact; no square root is left. A bay of an outline that is not convex is passed
// by: water meets the hull across it. Floes have the same law as the towed body: it costs 1 % of a step in 80 % ice and
// 4 % in 20 %, and what a floe resists to being turned aside counts (docs/theory.md says how much).
//
// In time, drag is linearised about the velocities at the start of the step, g = ½ρ C d max(0, −v1·n) dl and ρ C_s A
// |v1|, and taken at U2:
//     F = Σ g Jᵀ (U_ref − J U2),   J U = U + ω×a,   K = Σ g JᵀJ symmetric, not negative
// Free velocity: (M + Δt K) U* = M U' + Δt Σ g Jᵀ U_ref, a mean of U', U_w and U_a with matrix weights: drag can never
// reverse a relative velocity, whatever Δt. For one fluid and no contact it is the exact solution of the quadratic law,
// 1/u2 = 1/u1 + kΔt/M. Contacts and line see the diagonal of M + Δt K alone (a body has one inverse mass and one
// inertia in the sweeps), so that what K couples of turning and drift is that of U* instead of U2: a part Δt K/M of
// that coupling, 1 % of it for a berg at full scale; nothing where drift and turning are not coupled. Rejected: drag
// applied before the contacts with the bare mass in the contacts; the drag on a body held at a speed is then too low by
// a factor 1 + Δt K/M. Coupling taken at U1: stable, too, but a long step can reverse it.
#ifndef BERGTOW_FORCES_H
#define BERGTOW_FORCES_H

#include <math.h>

#include "bergtow/case.h"
#include "bergtow/law_key.h"
#include "bergtow/world.h"

#ifdef __cplusplus
extern "C" {
#endif

enum {
    BT_MAX_FORCE_LAWS = 64,
    BT_MAX_FORCE_SERIES = 2 * BT_MAX_FORCE_LAWS,
    BT_MAX_FORCE_OWN = 8,      ///< numbers of a law's own in a world
    BT_MAX_STREAMS = 8,        ///< in one load
};

/// A fluid that flows past the body, with drag ρ C A |v| v over its area and ½ ρ C d v max(0, −v·n) dl along its
/// outline.
typedef struct bt_stream {
    double u, v;               ///< velocity of the fluid, m/s
    double skin;               ///< ρ C A, kg/m
    double form;               ///< ½ ρ C d, kg/m²
} bt_stream;

/// What the laws do to one body in a step. In this order: the rotation about (about_x, about_y), gain, explicit force,
/// and all that is implicit together.
typedef struct bt_load {
    double turn;               ///< rate at which the velocity of the body without added mass turns, rad/s: exact
    double about_x, about_y;   ///< velocity about which it turns, m/s
    double gain_x, gain_y;     ///< velocity that the body gains in the step, m/s: forces in proportion to the mass
    double fx, fy, moment;     ///< explicit force, N, N, N m
    // Linear force j − K (U, ω), taken at the end of the step: K over (x, y, ω) is {{g, 0, −gy}, {0, g, gx}, {−gy, gx,
    // gw}}, symmetric and not negative, as of dampers g at the points r: g = Σ g, gx, gy = Σ g r, gw = Σ g r².
    double g, gx, gy, gw;      ///< kg/s, kg m/s, kg m/s, kg m²/s
    double jx, jy, jw;         ///< N, N, N m; of dampers: Σ g U_ref, Σ g r×U_ref
    double yaw;                ///< moment −yaw |ω| ω, kg m²; implicit as the streams
    int n_streams;
    bt_stream stream[BT_MAX_STREAMS];
} bt_load;

/// Drag in a stream. Without room for it the load is no number, and the run ends in this step.
static inline void bt_load_stream(bt_load *load, double u, double v, double skin, double form)
{
    const bt_stream stream = {u, v, skin, form};
    if (load->n_streams < BT_MAX_STREAMS) load->stream[load->n_streams++] = stream;
    else load->fx = NAN;
}

/// A damper g at the centroid that draws the body towards the velocity (u, v).
static inline void bt_load_damper(bt_load *load, double g, double u, double v)
{
    load->g += g;
    load->jx += g * u;
    load->jy += g * v;
}

/// A body as a law sees it: one of the world, or undisturbed ice (step/window.h), a mean floe that stands nowhere:
/// its place is NaN, so that a law which depends on the place and forgets it is found at once where a moving window
/// takes such ice in; elsewhere it counts as going with the water, in the speed through the ice.
typedef struct bt_force_body {
    const bt_params *par;      ///< Δt, current, wind of the step
    const double *own;         ///< [BT_MAX_FORCE_OWN] numbers of the law
    const void *context;       ///< of the law
    const bt_drag *drag;
    const bt_exposure *exposure; ///< what of it the neighbours leave
    bt_vel vel;                ///< U1, m/s, rad/s
    double time;               ///< of the middle of the step, s
    double mass, inertia;      ///< M kg, I kg m²
    double share;              ///< m/M
    bool towed;
    // what few laws need is read from here by the functions below
    const bt_bodies *all;
    bt_idx i;
    const double *towed_at; ///< [2] m
} bt_force_body;

/// of the circle about the outline, m
static inline double bt_force_radius(const bt_force_body *body) { return body->all->radius[body->i]; }
/// of its outline, m²
static inline double bt_force_area(const bt_force_body *body) { return body->all->area[body->i]; }
/// of ice, m; 0 = no ice
static inline double bt_force_thickness(const bt_force_body *body) { return body->all->thickness[body->i]; }

/// Place at the start of the step, m, m, rad; of the towed body x and y are not wrapped.
static inline bt_pose bt_force_pose(const bt_force_body *body)
{
    bt_pose pose = body->all->pose[body->i];
    if (body->towed && !isnan(body->towed_at[0])) pose.x = body->towed_at[0], pose.y = body->towed_at[1];
    return pose;
}

/// A force law. What it does follows from its numbers, the time and the body; what is to survive a checkpoint cannot be
/// kept anywhere else.
typedef struct bt_force_law {
    const char *name;          ///< lower_snake; its series is NAME_force
    /// one line, "drag of water": the description of the series goes on "on the towed body against the tow direction"
    const char *doc;
    const char *part_of;       ///< the law is recorded in the series PART_OF_force, in place of its own; NULL = its own
    bool turns_only;           ///< it has a moment and no force: no series of its own
    bool towed_only;           ///< it acts on the towed body alone: add is not called for others
    /// [n_keys] own[k] is the value of the k-th; they are read, checked, listed and written as all others
    const bt_law_key *keys;
    int n_keys;
    /// own[] from other keys of the case; own[0..n_keys) are there. NULL = that is all
    void (*setup)(const bt_case *input, double own[BT_MAX_FORCE_OWN]);
    /// May a floe rest that drifts with the water: does the law neither move it nor change from step to step? Asked
    /// once a step. NULL = never, which is right for every law, and costs the time that floes at rest save. Not asked
    /// of towed_only.
    bool (*rests)(const bt_params *par, const double *own);
    /// Add to *load what the law does to the body in this step. Called for every body in every step, by several threads
    /// at once: it must change nothing but *load. Required.
    void (*add)(const bt_force_body *body, bt_load *load);
    /// Once a step, by one thread, when all bodies have their places: for what a law needs of all of them together. It
    /// may set own[]; when its `rests` then turns to no, floes at rest are woken. NULL = done, otherwise why it failed:
    /// the run ends after this step. NULL in place of the function = nothing to do. Of registered laws only, not of
    /// those in src/force/laws.h; so is `context`.
    const char *(*begin)(const bt_world *world, double own[BT_MAX_FORCE_OWN], void *context);
    void *context;             ///< handed to `begin`, and to `add` in the body
} bt_force_law;

/// in the order in which they add; written by bt_force_register alone
extern const bt_force_law *bt_force_laws[BT_MAX_FORCE_LAWS];
extern int bt_n_force_laws;

/// Add a law to the table, for a program that uses the library: before it reads a case or makes a world (a world has
/// the laws that were there when it was made), and from one thread. On all ranks alike. The law and its texts remain
/// the caller's and must stay where they are to the end of the program. Errors: BT_ERR_USAGE, with reason and remedy in
/// err: a name that is taken or none, no `add`, no `doc`, more than BT_MAX_FORCE_OWN keys, a table that is full.
bt_status bt_force_register(const bt_force_law *law, bt_errors *err);

/// A series of forces: of one law, or the sum of those that are part_of it.
typedef struct bt_force_series {
    const char *name;          ///< without _force
    const bt_force_law *law;   ///< NULL = a sum
    bool part;                 ///< it is counted in a sum, too: what sums up the forces on the body leaves it out
} bt_force_series;

/// in the order of the laws, a sum before its first part; what is there keeps its place when laws are added
extern bt_force_series bt_force_series_of[BT_MAX_FORCE_SERIES];
extern int bt_n_force_series;

/// Index into bt_force_series_of, −1 = none.
int bt_force_series_find(const char *name);

/// Linear and angular impulse of a step.
typedef struct bt_impulse { double x, y, turn; } bt_impulse; ///< N s, N s, N m s

/// The laws of a world: their numbers, and what they did to the towed body in the step just solved.
typedef struct bt_forces {
    int n;                     ///< laws
    int n_series;
    const bt_force_law *failed; ///< a law whose `begin` has failed, and why; NULL = none
    const char *why;
    double towed_at[2];        ///< where the towed body stands, not wrapped, m; NaN until the first step
    /// in this step or before: a checkpoint names the added laws that have. Applied forces (bergtow/applied.h) act from
    /// the first step with a row that is not 0, all other laws always.
    bool acted[BT_MAX_FORCE_LAWS];
    double own[BT_MAX_FORCE_LAWS][BT_MAX_FORCE_OWN]; ///< [law][number]
    /// as really used by the step: what is implicit with U2; their sum with those of contacts and line is M (U2 − U1),
    /// I (ω2 − ω1)
    bt_impulse law[BT_MAX_FORCE_LAWS];
    bt_impulse series[BT_MAX_FORCE_SERIES];
} bt_forces;

/// The impulses on body i in the step just solved, before it has moved, as in bt_forces; of a kinematic body the forces
/// at its prescribed velocity. law: [BT_MAX_FORCE_LAWS]; series: [BT_MAX_FORCE_SERIES].
void bt_forces_impulses(const bt_world *world, bt_idx i, bt_impulse *law, bt_impulse *series);

/// All that acts on body i at velocity u.
void bt_forces_load(const bt_world *world, bt_idx i, const bt_vel *u, bt_load *load);

/// Drag of one body from the moments of its outline, multiplied out: the products of bt_drag (body.h). draft, sail: m;
/// densities: kg/m³; coefficients of form and skin drag: 1 (bt_drag_coefs).
bt_drag bt_forces_drag(const bt_moments *moments, double draft, double sail, double water_density, double air_density,
                       double water_form, double water_skin, double air_form, double air_skin);

#ifdef __cplusplus
}
#endif

#endif
