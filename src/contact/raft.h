// SPDX-License-Identifier: MIT
// Rafting: floes that are pressed together harder than their edges bear slide over and under each other.
//
// Energy. A slab of thickness H that floats has the potential energy ½ ρ_i (1 − ρ_i/ρ_w) g H² per area. Where floes of
// thickness h_a and h_b lie on each other there is more of it than side by side, per area
//     E = ρ_i (1 − ρ_i/ρ_w) g h_a h_b
// Without any loss an edge that advances would need 2 · ½ ρ_i (1 − ρ_i/ρ_w) g h² per length. With losses (edges that
// break, rubble that rubs) it needs
//     q0 = κ ½ ρ_i (1 − ρ_i/ρ_w) g h²   N/m,   κ >= 2
// with h of the thinner floe. The work is κ/2 times the energy gained by equal sheets. Published ratios of the two go
// up to 17, for pressure ridges (Flato & Hibler 1995): 5 to 17 is a κ of 10 to 34. Which of them holds for rafting is
// assumed (ice.rafting.kappa). Sheets raft whole up to h ≈ 14.2 (1 − ν²) σ²/(ρ_w g E) (Parmerter 1975; 0.17 m for
// common values); thicker ones ridge, which a larger κ stands for.
//
// Edge. To let the overlapped area A grow takes q0 dA, of which E' dA is stored and the rest lost:
//     E' = min(E, q0) = min(ρ_i (1 − ρ_i/ρ_w) g h_a h_b, q0)   N/m
// The load of the edge is along the gradient of A,
//     grad = ∂A/∂(displacement of b),   L = |grad|,   n = −grad/L (from a to b),   w = −(dA/dt)/L
//     gap = (A* − A)/L,   0 <= λ <= q0 L Δt,   w < −gap/Δt only where λ is at its bound
// A*: the largest area so far; below it the edge bears nothing: what was stored counts as lost when sheets slide back.
// For two outlines that cross twice, L is the chord between the crossings and n is square to it. Two points on the
// line along the chord through the centroid of the overlap, L/4 from it, take half of the bound each. There lies the
// resultant of losses over the whole overlap, which turns a floe back that goes under askew. Rejected: the middle of
// the chord, where the gradient has its moment. A row of squares out of line turned and buckled sooner (0.94 of its
// load where one pair was under by 1/50, and 1 with the centroid). L is that of the start of the step: first order in
// Δt, as the area itself. No edge is shorter than h (assumed). Along the edge there is Coulomb friction, as before it
// rafts.
// Below A*, losses are not due. Of (q0 − E') L Δt the part
//     max(0, 1 − gap/(Δt c + slop))
// is in the bound, with c the approach of the edge by the velocities without contacts. So a gap that is crossed in a
// step of any length takes the losses of what goes under beyond it, and none where it is not crossed but for a slop: a
// cut there would let go of an edge that bears load whenever a residual opens it, and sheets would creep.
// Rejected: all of them in a step in which the gap would be crossed (about a berg, in steps of 5 s, edges took 13 %
// more work for the same area).
//
// Ends. An edge inside the other floe that advances covers fresh ice. Half of each such edge is a push f_k, square to
// it, from a to b: Σ f_k = L n, and the area that is newly covered, the mean of that of both floes, grows at the rate
// Σ max(0, −f_k · u), with u the velocity of b against a at the centroid of the overlap. Along the chord it grows
// although A does not, by s L a length, where s L is the sum of the pushes' parts along t, square to n, that are above
// 0: half the width of the overlap. What is stored there is lost at the other end, so that this costs q0 an area. The
// ends of the overlap bear
//     |λ_t| <= q0 s L Δt   against t · u
// times the same part below A*. They hold a row of squares in line, which the edge pushes aside with the tilt of its
// chord: of two that are under by d, s L is d cos² α, with tan α = d/a, and the edge pushes with q0 d. Going under in
// line, such squares pay 1 + sin² α times q0 for an area. s is kept below 1/2, as corners of squares have it;
// otherwise a floe that is all but under another one would go on paying.
// Rejected:
// - No ends. A row of squares that is 1 cm out of line slips out, without a load where there is no friction.
// - Losses as a disc about ½ R n of radius ½ R, R = (q0 − E') L Δt, and no friction of the edge. Sheets then pay ½ R
//   along their edge however little lies on each other, which welds them together: the mean of a berg model in a basin
//   with 80 % ice was 19 N, for 16 N with rigid floes and 12 N with this law.
// - Losses in the parallelogram of the pushes, times (q0 − E')/L, beside an edge that bears E' alone. An area costs
//   exactly q0 at any angle, but friction of the edge has no place in it: the same mean was 7 N, and a row buckled at
//   1/100 of a side.
// - A force against the motion with the same cost for an area in every direction. At rest it may bear what it does not
//   bear when sheets slide along the edge: two solutions.
// Without friction the law is associated. Its power, Δt aside, is
//     q0 L max(0, −n · u) + q0 s L |t · u| + R_s |u|
// (R_s below), which is convex, so that velocities are the one minimum of a convex function. With Coulomb friction
// existence and uniqueness are as for all contacts; a cold start finds the velocities of a warm one.
//
// Rejected: the depth along the axis of least overlap, as in contacts that crush. That axis flips once a floe is more
// than half under, so the side of entry would have to be remembered; and floes that slide along it would go on
// overlapping for nothing. The gradient falls to 0 where a floe is wholly under, and it may come out behind.
//
// First touch. A pair that has not rafted has the contact points of its outlines, and the same bound with the length
// that bears: of two edges, the part whose gaps differ by no more than the slop, shared as in crush.h. No contact is
// shorter than h (assumed), or a corner would bear nothing.
//
// Sheets. The lower sheet presses with its buoyancy, (ρ_w − ρ_i) g h per area, h of the thinner floe. Where they
// overlap, friction of at most
//     R_s = μ (ρ_w − ρ_i) g h A Δt
// acts against sliding at the centroid of the overlap. With the ends it is a contact of its own without contact points
// (bt_contact.n = 0), which has the components along x and y in ln[0] and lt, R_s in flat[0] of its bounds and q0 s L
// Δt t in `ends`. Its update is one step of
//     λ <- proj(λ − ρ w),   1/ρ = largest eigenvalue of the 2 × 2 block of W
// which is exact for floes without arms and never overshoots. Rejected: more unknowns in the contact of the edge, for
// which the records and batches of all rigid ice would grow.
//
// What is stored would push sheets apart; friction between them alone holds them from an overlap of (ρ_i/ρ_w) h/μ on,
// some 2.5 h. So that an edge bears nothing when it retreats is a fair simplification.
//
// Memory. While two floes overlap, a pair keeps A*, A when it was last looked at, and the friction as the start of the
// next solve. At the end of a step A is what it is: second-order terms of the step belong to A*, and the position
// projection leaves rafted overlap alone. Where ice crushes as well, or an added law bounds the edge, the smaller bound
// takes the place of q0. A pair that has rafted gives way in its area whichever law sets
// the bound; crushed depths are kept by pairs that have not.
//
// Between which bodies: floes of the field and by hand whose outlines are both convex. Not the towed body, walls and
// fixed floes, which stand for structures, shores and grounded ice: ice does not slide over a deep hull. Nor a floe
// whose freeboard, (1 − ρ_i/ρ_w) H, is more than the thickness of the other: the deck of the thicker one then
// stands higher above the water than the thinner one is thick, and its side is a hull to it (H some 9 times h;
// assumed). A floe in convex parts stays rigid. Such pairs crush where ice.crushing says so. Several floes on one spot
// are treated pair by pair: N sheets of h make N(N − 1)/2 pairs, and (N h)² − N h² = N(N − 1) h² is as many times what
// it is for two, so that the energy of a pile, and the sum of the pressures between its layers, come out right;
// friction in a pile that is sheared from top to bottom is (N + 1)/3 times too much.
#ifndef BERGTOW_RAFT_H
#define BERGTOW_RAFT_H

#include "contact/law.h"

// The record of bt_raft_law: A*, A (m²), load of the sheets along x and y (N s).

/// Its numbers of the case, Pa/m: line load under which floes raft / thickness², 0 = they do not; pressure between
/// sheets on each other / thickness; potential energy of sheets on each other / (area × both thicknesses). Without a
/// unit: freeboard / thickness.
enum { BT_RAFT_LINE, BT_RAFT_SHEET, BT_RAFT_RISE, BT_RAFT_FREEBOARD };

/// Which of its totals is the area of sheets at the end, m²: the summary also has it over the area of all ice.
enum { BT_RAFT_TOTAL_AREA = 1 };

#endif
