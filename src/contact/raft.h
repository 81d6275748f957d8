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
// What is stored is a force of position, the gradient of E' A:
//     grad = ∂A/∂(displacement of b),   L = |grad|,   n = −grad/L (from a to b),   w = −(dA/dt)/L
//     gap = (A* − A)/L,   0 <= λ <= E' L Δt,   w < −gap/Δt only where λ is at its bound
// A*: the largest area so far; below it the edge bears nothing: what was stored counts as lost when sheets slide back.
// For two outlines that cross twice, L is the chord between the crossings, n is square to it, and the resultant acts at
// its middle. Turning is in it, too: a closed line under uniform pressure bears no resultant, so that on the edge of b
// inside a and that on the chord are the same. L is that of the start of the step: first order in Δt, as the area
// itself. Two points on the chord, L/4 from its middle, take half of the bound each. No edge is shorter than h
// (assumed).
//
// Losses. R = (q0 − E') L Δt is lost by what goes under. It acts at the centroid of the overlap, against u, the velocity
// of b against a there, and joins the friction of the sheets (below) in one contact:
//     λ = α e_1 + β e_2 + d,   0 <= α, β <= 1,   |d| <= R_s,   of these the one that takes most power, −λ · u
//     e_1 = R (p n + s t),   e_2 = R ((1 − p) n − s t),   t square to n
// Where an edge of one floe advances inside the other it covers fresh ice. Half of each such edge is a push f_k, square
// to it, from a to b: Σ f_k = L n, and the area that is newly covered, the mean of that of both floes, grows at the rate
// Σ max(0, −f_k · u). Sums of the pushes with f_k · t > 0 and < 0, divided by L, are p n + s t and (1 − p) n − s t.
// - In line a pair loses R v, with v = −n · u the rate of going under. The area of the overlap grows by L v Δt, and costs
//   the same at any angle to n as long as both e · u < 0.
// - Along the edge the ends of the overlap go over fresh ice, by s L a length, half its width.
// - Back costs nothing: p is kept in 0 to 1. s is kept below 1/2, as corners of squares have it. Otherwise a floe that is
//   all but under another one would go on losing.
// Two squares have exactly this, in line or out of it. The power is, Δt aside,
//     D(u) = max(0, −e_1 · u) + max(0, −e_2 · u) + R_s |u|
// D is convex, and λ the impulse of largest power in a convex set (associated flow); so is the edge's, 0 <= λ <= E' L Δt
// with its gap. Without other contacts, the velocities of floes that have rafted are therefore the one minimum of
//     ½ (U − U_free)ᵀ M (U − U_free) + Σ D + Σ E' L Δt max(0, −w − gap/Δt)
// whatever μ is and whatever the sweeps start from; impulses are unique where something moves. So there is no Coulomb
// friction on an edge that has rafted. Pairs that have not have it, and as with all Coulomb friction uniqueness is not
// shown for them.
// Below A*, R is not due. It is taken times
//     max(0, 1 − gap/(Δt c + slop))
// c: approach of the edge by the velocities without contacts. So a gap that is crossed in a step of any length takes
// the losses of what goes under beyond it, and none where it is not crossed but for a slop: a cut there would let go of
// an edge that bears load whenever a residual opens it, and sheets would creep. Rejected: all of R in a step in which
// the gap would be crossed (about a berg, in steps of 5 s, edges took 13 % more work for the same area).
// Rejected: losses in the load on the chord (λ <= q0 L). It pushes sheets aside with five times what is stored, and a
// row of squares that is 1 cm out of line slips out. A disc about ½ R n of radius ½ R. Sheets then lose ½ R |u| along
// their edge however little lies on each other, which welds them together: the mean of a berg model in a basin with 80 %
// ice was 19 N, for 16 N with rigid floes and 7 N with this law. A force R cos α against the motion. It is not monotone,
// and at rest it may bear any load of the disc while it bears none when it slides along the edge: two solutions. More
// Coulomb friction on the edge, (q0 − E')/(2 q0): the same area costs 1.11, 1.23 and 1.40 times as much at 15, 30 and
// 45°. A bound of its own with the gap as its bias, in place of the taper: a second contact a pair.
// The losses at the middle of the chord, where translation has them, too: a row turns out of line sooner (0.73 of its
// load where it bears 0.99 with the centroid, which moves to the side that is deeper). That turning alone about the
// centroid costs nothing is assumed.
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
// acts against sliding at the centroid of the overlap. With the losses it is a contact of its own without contact
// points (bt_contact.n = 0), which has the components along x and y in ln[0] and lt, R_s in flat[0] of its bounds, and
// e_1 and e_2 in `loss`. Its update is one step of
//     λ <- proj(λ − ρ w),   1/ρ = largest eigenvalue of the 2 × 2 block of W
// which is exact for floes without arms and never overshoots. Rejected: more unknowns in the contact of the edge, for
// which the records and batches of all rigid ice would grow.
//
// The stored part of the load pushes sheets apart; losses and friction hold them, friction alone from an overlap of
// (ρ_i/ρ_w) h/μ on, some 2.5 h. So that an edge bears nothing when it retreats is a fair simplification.
//
// Memory. While two floes overlap, a pair keeps A*, A when it was last looked at, and the friction as the start of the
// next solve. At the end of a step A is what it is: second-order terms of the step belong to A*, and the position
// projection leaves rafted overlap alone. Where ice crushes as well, or an added law bounds the edge, the smaller bound
// takes the place of q0: what it leaves of R is lost. A pair that has rafted gives way in its area whichever law sets
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

/// What contact j of a cell bears along its normal, N s; sheets: with their edge, as friction between them is spread
/// over them.
double bt_raft_pressing(const bt_cell *t, bt_idx j);

/// Which of its totals is the area of sheets at the end, m²: the summary also has it over the area of all ice.
enum { BT_RAFT_TOTAL_AREA = 1 };

#endif
