// SPDX-License-Identifier: MIT
// Rafting: floes pressed together harder than their edges can bear slide over and under each other.
//
// Energy. A slab of thickness H that floats has the potential energy ½ ρ_i (1 − ρ_i/ρ_w) g H² per area. Floes of
// thickness h_a and h_b have more of it on top of each other than side by side, per area
//     E = ρ_i (1 − ρ_i/ρ_w) g h_a h_b
// Without any loss an advancing edge would need a load of 2 · ½ ρ_i (1 − ρ_i/ρ_w) g h² per length. With losses
// (breaking edges, friction of rubble) it needs
//     q0 = κ ½ ρ_i (1 − ρ_i/ρ_w) g h²   N/m,   κ >= 2
// with h of the thinner floe. The work is κ/2 times the energy gained by equal sheets. Published ratios of the two go
// up to 17, for pressure ridges (Flato & Hibler 1995): 5 to 17 is a κ of 10 to 34. The value for rafting is assumed
// (ice.rafting.kappa). Sheets raft whole up to h ≈ 14.2 (1 − ν²) σ²/(ρ_w g E) (Parmerter 1975; 0.17 m for common
// values); thicker ones ridge, which a larger κ represents.
//
// Edge. Growth of the overlapped area A by dA takes the work q0 dA; E' dA of it is stored, the rest lost:
//     E' = min(E, q0) = min(ρ_i (1 − ρ_i/ρ_w) g h_a h_b, q0)   N/m
// The load of the edge is along the gradient of A,
//     grad = ∂A/∂(displacement of b),   L = |grad|,   n = −grad/L (from a to b),   w = −(dA/dt)/L
//     gap = (A* − A)/L,   0 <= λ <= q0 L Δt,   w < −gap/Δt only where λ is at its bound
// A*: the largest area so far; below it the edge bears nothing: stored energy counts as lost when sheets slide back.
// For two outlines that cross twice, L is the chord between the crossings and n is square to it. Two points on the line
// parallel to the chord through the centroid of the overlap, L/4 from it, take half of the bound each. The resultant of
// losses over the whole overlap acts there, and turns back a floe that goes under askew. Rejected: the middle of the
// chord, where the gradient has its moment. A row of squares out of line then turned and buckled sooner (at 0.94 of its
// load where one pair was under by 1/50; at 1 with the centroid). L is taken at the start of the step: first order in
// Δt, like the area itself. No edge is shorter than h (assumed). Along the edge there is Coulomb friction, as before it
// rafts.
// Below A* there are no losses. The bound includes only the part
//     max(0, 1 − gap/(Δt c + slop))
// of (q0 − E') L Δt, with c the approach of the edge at the velocities without contacts. So when a gap is crossed, in a
// step of any length, only the advance beyond it causes losses; a gap that is not crossed causes none, but for the
// slop: a sharp cut would release a loaded edge whenever a residual opens it, and sheets would creep.
// Rejected: the full losses in any step in which the gap would be crossed (about a berg, in steps of 5 s, edges took
// 13 % more work for the same area).
//
// Ends. An edge inside the other floe that advances covers fresh ice. Half of each such edge is a push f_k, square to
// it, from a to b: Σ f_k = L n, and the area that is newly covered, the mean of that of both floes, grows at the rate
// Σ max(0, −f_k · u), with u the velocity of b against a at the centroid of the overlap. In motion along the chord it
// grows although A does not, by s L per length, where s L is the sum of the positive components of the pushes along t,
// square to n: half the width of the overlap. The energy stored there is lost at the other end, so that this costs q0
// per area. The ends of the overlap bear
//     |λ_t| <= q0 s L Δt   against t · u
// times the same part below A*. They hold a row of squares in line against the sideways push of the edge with the tilt
// of its chord: for two that are under by d, s L is d cos² α, with tan α = d/a, and the edge pushes with q0 d. Going
// under in line costs such squares 1 + sin² α times q0 per area. s is limited to 1/2, its value for corners of squares;
// otherwise a floe almost wholly under another would still meet this load.
// Rejected:
// - No ends. A row of squares 1 cm out of line slips out, without any load if there is no friction.
// - Losses as a disc about ½ R n of radius ½ R, R = (q0 − E') L Δt, and no friction of the edge. Sheets then bear ½ R
//   along their edge however small the overlap, which welds them together: the mean of a berg model in a basin with
//   80 % ice was 19 N, for 16 N with rigid floes and 12 N with this law.
// - Losses in the parallelogram of the pushes, times (q0 − E')/L, beside an edge that bears E' alone. The cost is
//   exactly q0 per area at any angle, but there is no room for friction of the edge: the same mean was 7 N, and a row
//   buckled at 1/100 of a side.
// - A force against the motion with the same cost per area in every direction. At rest it may exceed its value when
//   sheets slide along the edge: two solutions.
// Without friction the law is associated. Its power, Δt aside, is
//     q0 L max(0, −n · u) + q0 s L |t · u| + R_s |u|
// (R_s below), which is convex, so that the velocities are the unique minimum of a convex function. With Coulomb
// friction existence and uniqueness are as for all contacts; a cold start finds the velocities of a warm one.
//
// Rejected: the depth along the axis of least overlap, as in crushing contacts. That axis flips once a floe is more
// than half under, so the side of entry would have to be stored; and floes that slide along it would increase their
// overlap for nothing. The gradient falls to 0 where a floe is wholly under, and it may come out behind.
//
// First touch. A pair that has not rafted has the contact points of its outlines, and the same bound with the bearing
// length: for two edges, the part whose gaps differ by no more than the slop, shared as in crush.h. No contact is
// shorter than h (assumed), or a corner would bear nothing.
//
// Sheets. The lower sheet presses upwards with its buoyancy, (ρ_w − ρ_i) g h per area, h of the thinner floe. Where
// they overlap, friction of at most
//     R_s = μ (ρ_w − ρ_i) g h A Δt
// acts against sliding at the centroid of the overlap. Together with the ends this is a separate contact without
// contact points (bt_contact.n = 0), with the components along x and y in ln[0] and lt, R_s in flat[0] of its bounds
// and q0 s L Δt t in `ends`. Its update is one step of
//     λ <- proj(λ − ρ w),   1/ρ = largest eigenvalue of the 2 × 2 block of W
// which is exact for floes without arms and never overshoots. Rejected: more unknowns in the contact of the edge, which
// would enlarge the records and batches of all rigid ice.
//
// The stored energy would push sheets apart; friction between them alone holds them from an overlap of (ρ_i/ρ_w) h/μ
// on, some 2.5 h. So it is a fair simplification that a retreating edge bears nothing.
//
// Memory. While two floes overlap, the pair stores A*, A at the last evaluation, and the load of the sheets as the
// start of the next solve. At the end of a step A is taken as it is: second-order terms of the step belong to A*, and
// the position projection leaves rafted overlap alone. Where ice crushes as well, or an added law bounds the edge, the
// smaller bound takes the place of q0. A pair that has rafted yields by area whichever law sets
// the bound; only pairs that have not rafted keep crushed depths.
//
// Rafting pairs: floes of the field and by hand whose outlines are both convex. Not the towed body, walls and fixed
// floes, which represent structures, shores and grounded ice: ice does not slide over a deep hull. Nor a floe whose
// freeboard, (1 − ρ_i/ρ_w) H, exceeds the thickness of the other: the deck of the thicker one then stands higher above
// the water than the thinner one is thick, and its side is a hull to it (H some 9 times h; assumed). A floe in convex
// parts stays rigid. Such pairs crush where ice.crushing says so. Several floes on one spot are treated pair by pair: N
// sheets of h make N(N − 1)/2 pairs, and (N h)² − N h² = N(N − 1) h² is that many times the value for two, so that the
// energy of a pile, and the sum of the pressures between its layers, come out right; friction in a pile sheared from
// top to bottom is too large by the factor (N + 1)/3.
#ifndef BERGTOW_RAFT_H
#define BERGTOW_RAFT_H

#include "contact/law.h"

// The record of bt_raft_law: A*, A (m²), load of the sheets along x and y (N s).

/// Its parameters from the case, Pa/m: line load at which floes raft / thickness², 0 = they do not; pressure between
/// sheets / thickness; potential energy of sheets / (area × both thicknesses). Dimensionless: freeboard / thickness.
enum { BT_RAFT_LINE, BT_RAFT_SHEET, BT_RAFT_RISE, BT_RAFT_FREEBOARD };

/// Index of the total that is the area of sheets at the end, m², which the summary also relates to the area of all ice.
enum { BT_RAFT_TOTAL_AREA = 1 };

#endif
