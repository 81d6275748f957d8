// SPDX-License-Identifier: MIT
// The tow of the body: prescribed velocity, or one or two elastic lines to an end that follows a path or to a vessel.
//
// Line. A branch of unstretched length L0, stiffness k = EA/L0 and damping c runs straight (without a weight, no sag)
// from a point on the hull to the towing end. T = max(0, k (l − L0) + c dl/dt). Within a step a branch is a unilateral
// row of the solver, λ = Δt T ≥ 0:
//     λ_i = max(0, a_i + b_i l̇2_i),   a = Δt k (l1 − L0),  b = Δt (k θ Δt + c),   l̇2 = l̂·(U_end,2 − v_hull,2)
// (l̂: from hull to end at the start of the step). While l1 + Δt l̇* (at the free velocities) is still below L0, b is
// without c: a line damps only when stretched. With X2 = X1 + Δt U2, θ = 0 is the symplectic Euler scheme: no numerical
// damping, stable for h = Δt ω < 2, where ω² are the eigenvalues of K^½ W K^½, W_ij = ∂l̇_i/∂λ_j. The amplification
// matrix of a mode has determinant 1/(1+θh²) and is stable for every h when h² ≤ 4 + 2θh². So θ = max(0, 1 − 2/h²) with
// the largest h, the same for both branches so that their modes stay uncoupled: 0 while the oscillation is resolved (h
// ≤ √2), tending to backward Euler for a line too stiff for the step; a slower mode then also has h²(1 − 2θ) ≤ 4.
// Stable for any stiffness [D]. The rotation of the line within a step is explicit: its swing, ω² = T/(l M), is slow.
//
// Weight. A branch with a weight w in water is an elastic catenary between its ends (bergtow/catenary.h), quasi-static,
// without water drag on the line [assumed]. Its row has the pull H(l1) in place of k (l1 − L0); in k θ Δt, and in h,
// the tangent dH/dl, which grows with l, replaces k, at the longer of l1 and l1 + Δt l̇*. The dashpot is parallel to
// the elastic stretch alone: it takes the share q = (dH/dl)/k of l̇, and to first order acts as a dashpot c q² between
// the ends. A branch breaks by the tension at its ends, √(H² + (w L0/2)²).
//
// Vessel (mode thrust). A point of mass M (with added mass) that touches no ice [assumed], on the end of the line.
// Course d: towards the point of the planned path that lies `lookahead` ahead of the vessel's place on it
// (line-of-sight guidance, Fossen 2011). Its place is its projection, but advances by at least BT_VESSEL_WAY of the
// distance made good along d: before a corner of more than 90° the point ahead may lie abeam, and steering there does
// not change the projection, so that both would stay put for ever. Less than the whole distance made good, so that on a
// leg the projection advances more, and decides. Relative to the water the vessel has speed s along d:
//     drag     R = (R_f/s_f²) |u| u along d, `lateral` times as much across
//     thrust   0 ≤ T ≤ T_b − (T_b − R_f)(s/s_f)² along d
//     governor the largest T at which the speed over ground along d does not exceed the programme's; never astern
// with R_f the resistance at the free-running speed s_f and T_b the bollard pull. At full power the net pull is
// T − R = T_b (1 − (s/s_f)²) [assumed parabola].
// Drag and the decrease of thrust are linearised about the speed at the start of the step and taken at U2, as in
// forces.h: with K = R_f/s_f² |u1| and C = (T_b − R_f)/s_f² max(0, s1), full power acts as one more drag: (M + Δt (K +
// C)) U2 = M U1 + Δt (K + C) U_w + Δt T_b − Σ λ l̂. So at U2 the vessel obeys one of three linear models along d, {full
// power, held at the programme's speed, without power}, and U_end,2 = f − V Σ λ l̂ with V = 0 along d when held. Steady
// states are those of the quadratic laws. Wind on the vessel and Coriolis are neglected [assumed].
//
// Solution. Given the body's velocity, the two rows are solved together with the vessel, exactly: for each of its three
// states the 2×2 complementarity problem (I + diag(b) W) λ = a + b l̇0 by its four cases; full power if the speed stays
// below the programme's, else held if that requires thrust, else no power (the thrust required grows with the speed:
// exactly one state fits). Rejected without trial: the vessel as a separate body, and rows one after the other; a stiff
// line between a heavy berg and a light vessel would take hundreds of sweeps. The vessel's velocity follows from λ, so
// only λ is carried between sweeps, extrapolated and exchanged between ranks.
//
// A branch whose tension (mean over a step) exceeds its breaking load is missing from the next step on.
#ifndef BT_TOW_H
#define BT_TOW_H

#include <math.h>

#include "bergtow/case.h"
#include "bergtow/world.h"
#include "geometry/path.h"

enum { BT_MAX_BRANCHES = 2 };
#define BT_VESSEL_WAY 0.5 ///< share of the distance made good, assumed

/// One elastic line.
typedef struct bt_branch {
    double length0, k, c;     ///< m, N/m, N s/m
    double hull_x, hull_y;    ///< fastening point, body frame, m
    double breaking;          ///< breaking load, N; 0 = never breaks
    double weight;            ///< in water, N/m; 0 = straight
    // state
    bool broken;
    double lambda;            ///< impulse of the last step, N s (starts the next solve)
    // the row of this step
    bool taut;                ///< stretched, or will be in this step
    double rx, ry;            ///< arm from the centroid to the fastening point, m
    double lx, ly;            ///< unit vector from the hull to the end
    double rxl;               ///< arm × unit vector, m
    double length;            ///< l1, m; the span of a branch with weight
    double stiff;             ///< k, or the tangent of the catenary, N/m
    double a, b;              ///< λ = max(0, a + b l̇2)
    double w;                 ///< W, 1/kg; with a vessel, that without power
} bt_branch;

/// The vessel, mode thrust.
typedef struct bt_vessel {
    double mass;              ///< with added mass, kg
    double bollard_pull;      ///< T_b, N
    double free_speed;        ///< s_f, m/s
    double free_resistance;   ///< R_f, N
    double lateral;           ///< drag across / along
    double lookahead;         ///< m
    // state
    double vx, vy;            ///< m/s
    double way;               ///< its place on the path, m
    // of this step, along the course d = (ux, uy) and across n = (−uy, ux)
    double vd1, vn1;          ///< velocity at its start, m/s
    double ud, un;            ///< of the water, m/s
    double kd, kn, kt;        ///< K along and across, C, kg/s
    double full, full_w;      ///< f·d and V along d at full power, m/s, 1/kg
    double idle, idle_w;      ///< the same without power
    double across, across_w;  ///< f·n and V across
    double vd2, vn2, thrust;  ///< velocity at its end, m/s; impulse of the thrust, N s
} bt_vessel;

typedef struct bt_tow {
    bt_tow_mode mode;
    double ux, uy;            ///< course: unit vector of the tow direction in this step
    double speed, ramp;       ///< m/s, s
    double *programme;        ///< [n_programme][2] s, m/s; linear between, constant outside; replaces speed and ramp
    int n_programme;
    bt_path path;             ///< of the end (or of the body, mode speed); n = 0: straight along (ux, uy)
    bt_branch branch[BT_MAX_BRANCHES];
    int n_branches;
    bt_vessel vessel;
    double dt;                ///< s
    // state
    double time;              ///< s
    double carriage_x, carriage_y; ///< the towing end, m
    double travel_x, travel_y;///< position of the body, not wrapped, m
    double way;               ///< length of path that the end (mode speed: the body) has covered, m
    int mark;                 ///< way-points passed
    // of this step
    double end_speed;         ///< of the end along (ux, uy), m/s; with a vessel, the programme's
    double coupling;          ///< ∂(l̂_1·v_hull,1)/∂λ_2 through the body, 1/kg
    double body_w[BT_MAX_BRANCHES]; ///< ∂(l̂·v_hull)/∂λ, 1/kg
} bt_tow;

void bt_tow_free(bt_tow *tow);

/// Does a line pull (modes line and thrust)?
static inline bool bt_tow_has_line(const bt_tow *tow)
{
    return tow && (tow->mode == BT_TOW_LINE || tow->mode == BT_TOW_THRUST);
}

/// Speed of the programme at this time, m/s.
double bt_tow_speed(const bt_tow *tow, double time);

/// At the start of a step, before the forces: set the speed of the programme, and the velocity of a prescribed body.
void bt_tow_prescribe(bt_world *world);

/// At the start of a step, after the free velocities: move the end and set up the line rows.
void bt_tow_begin(bt_world *world);

/// Solve the line rows exactly at the velocity *v of the body, which is updated; returns the natural-map residual
/// before, m/s.
double bt_tow_update(bt_tow *tow, bt_vel *v, bt_inv inv);

/// Apply the impulses of all branches to the velocity of the body.
void bt_tow_apply(const bt_tow *tow, bt_vel *v, bt_inv inv);

/// Natural-map residual of the line rows at velocity v, m/s.
double bt_tow_residual(const bt_tow *tow, const bt_vel *v);

/// Start from the impulses of the last step (keep), or from none.
void bt_tow_warm_start(bt_tow *tow, bool keep);

/// At the end of a step, after the body has moved: move the end, break overloaded branches, record events.
void bt_tow_advance(bt_world *world);

/// Pull of branch k in the last step, along the line between its ends, N.
static inline double bt_tow_pull(const bt_tow *tow, int k) { return tow->branch[k].lambda / tow->dt; }

/// Tension of branch k, N; with weight, the tension at its ends, which bear half of the weight each.
static inline double bt_tow_tension(const bt_tow *tow, int k)
{
    const bt_branch *branch = &tow->branch[k];
    const double pull = bt_tow_pull(tow, k), half = 0.5 * branch->weight * branch->length0;
    return half > 0 && pull > 0 ? sqrt(pull * pull + half * half) : pull; // 0 for a broken branch
}

uint64_t bt_tow_hash(const bt_tow *tow);

#endif
