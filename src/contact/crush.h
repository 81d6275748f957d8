// SPDX-License-Identifier: MIT
// Crushing-limited contact: ice bears no more than a pressure, and what cannot be borne is crushed.
//
// The normal impulse of contact point i in a step is bounded, and with it the friction cone |λ_t| <= μ Σ λ_i:
//     0 <= λ_i <= p h Δt ℓ_i,   w_i > 0 only if λ_i = 0,   w_i < 0 only if λ_i is at its bound
// p: ice.crushing.pressure, h: thickness of the thinner floe of the pair (of the floe, on the towed body or a wall), ℓ:
// contact length. Where the bound holds the bodies go on approaching: that ice is crushed, to the depth d_i += −Δt w_i.
// Gaps are measured from the crushed surfaces, g + d, so that neither the position projection nor the statistics of
// overlap take crushed ice for an error, and bodies that part and come back meet where they crushed each other last.
// The mass of crushed ice stays where it was.
//
// Contact length. ℓ is the width, across the normal, of the overlap of the two outlines as they are when the crushed
// surfaces touch: the overlapping part for two edges; for a corner of angle φ that was crushed squarely to the depth d,
// 2 d tan(φ/2); the chord for a disc. Two points share it as the forces at their places that are equivalent to a
// uniform pressure on it: half each for two edges that lie on each other, nearly all for the end of an edge that has
// come in tilted; a point that takes no part (bt_closing) has none of it. It is looked at one slop deeper, so that
// edges that lie on each other bear from the first touch. No contact is shorter than ℓ_min = least_length × h (half of
// it for each of two points), or a corner at its first touch would bear nothing; assumed.
//
// Implicit length. A step can be long against the crushing itself (Δt = 5 s; a floe of 30 m stops in 1 s): with the
// length of the start of the step a corner would go in by v Δt as if it bore nothing. So the bound is a function of the
// approach in the step,
//     λ <= max(p h Δt ℓ_min, p h Δt (ℓ1 + θ κ (−w) Δt)) and <= p h Δt ℓ2,   κ = (ℓ2 − ℓ1)/D
// ℓ1: length now, ℓ2: after the approach D that the pair would make in the step by itself. With X2 = X1 + U2 Δt and g²
// = Δt² p h κ W (W: inverse mass of the row) a corner of speed v that meets the surface, ℓ1 = 0, crushes d1 = Δt v/(1 +
// θ g²) in its first step; that the energy it took, ½ p h κ d1², is what the impulse took from the body, gives
//     θ = 1 / (1 + √(1 + g²))
// i.e. the mean over the step where it resolves the crushing, and the whole depth v/√(p h κ W) in one step where it
// does not; in between the depth of a stop comes out up to 30 % too small (at g = 1) [D].
// Rejected: θ = ½ (a fourth of the depth at g = 8) and θ = 0 (eight times the depth); lengths from the corner's angle,
// or from the clipped points of the manifold: a disc of 32 short edges then bears on one of them at any depth.
//
// Memory. A pair keeps its depths, by contact feature, while its gap is at most BT_LAW_MEMORY mean floe sizes; then
// they are forgotten, and the ice is sharp again (assumed). A point whose feature is new (the corner has slid on to the
// next edge) has the overlap that is there, at most the pair's deepest crush, as its depth: sliding neither crushes nor
// brings overlap back. So a depth is blunt ice of this pair alone: a third floe meets the outline as it was.
//
// Not done: a record holds two points, so that a crushed corner which was not found is forgotten once the other end has
// been crushed under two names; its depth then is the overlap that is there, as for a new point.
// Crushed ice does not pile up, extrude or lose mass; a pressure that falls with the area of contact.
// Surfaces that were crushed askew stay tilted against each other, and sliding along them changes gaps that the normal
// rows do not see: such steps leave overlap (up to 2.5 % of a floe in the basin's jams, more between floes in parts),
// which the position projection takes back in the steps after.
#ifndef BERGTOW_CRUSH_H
#define BERGTOW_CRUSH_H

#include "contact/law.h"

// The record of bt_crush_law: for each of two contact features a depth, m, and whether it is of an earlier step (1)
// than the last.

/// Its numbers of the case: p, Pa, 0 = contacts are rigid; least length of a contact / ice thickness.
enum { BT_CRUSH_PRESSURE, BT_CRUSH_LEAST };

#endif
