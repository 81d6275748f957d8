// SPDX-License-Identifier: MIT
// Crushing-limited contact: ice bears at most a given pressure, and is crushed where the load would be higher.
//
// The normal impulse of contact point i in a step is bounded, and with it the friction cone |λ_t| <= μ Σ λ_i:
//     0 <= λ_i <= p h Δt ℓ_i,   w_i > 0 only if λ_i = 0,   w_i < 0 only if λ_i is at its bound
// p: ice.crushing.pressure, h: thickness of the thinner floe of the pair (of the floe, on the towed body or a wall), ℓ:
// contact length. At the bound the bodies keep approaching and crush the ice between them: d_i += −Δt w_i, d: crushed
// depth. Gaps are measured from the crushed surfaces, g + d, so that neither the position projection nor the statistics
// of overlap take crushed ice for an error, and bodies that part and come back meet where they crushed each other last.
// Crushing does not change the mass of a floe.
//
// Contact length. ℓ is the width, across the normal, of the overlap of the two outlines as they are when the crushed
// surfaces touch: the overlapping part for two edges; for a corner of angle φ crushed squarely to the depth d,
// 2 d tan(φ/2); for a disc, the chord. Two points share it in the ratio of point forces equivalent to a uniform
// pressure on it: half each for two flush edges, nearly all for the end of an edge that has come in tilted, nothing for
// a point that takes no part (bt_closing). The overlap is evaluated one slop deeper and at the penetration y that the
// pair would reach; ℓ at the surface follows from both: nothing for a corner, all of it for flush edges, which thus
// bear from the first touch. No contact is shorter than ℓ_min = least_length × h (half of it for each of two points),
// assumed: ice fails at higher pressures on smaller areas, and a corner that has been in a pack is blunt by about its
// thickness. 0: corners are sharp.
//
// Energy. F = p h ℓ does the work E(y) = p h ∫ ℓ dy over the depth y, and ∫ ℓ dy is the growth of the overlapped area:
// E is exact for every outline at the depths where the overlap is evaluated. Between them F is piecewise linear
// (resistance_of). The impulse F Δt of a long step would stop a floe before anything is crushed. So a point that comes
// in under its own momentum, v1 Δt > gap, bears (contact/hit.h)
//     λ <= L(u) = P + 2 (E(y) − P u)/(v1 + u),   y = Δt u − gap
// u, v1: approach at the end and at the start of the step; P: impulse of the external forces along the row. Then the
// energy ½ λ (v1 + u) that the contact takes from the bodies is the energy of crushing, with other contacts too: a step
// that would stop the floe leaves it the share of its speed that takes it to its depth, and the next step takes the
// energy left, the square of that share. v1 is the velocity itself and not the free one: loads are not kinetic energy.
// At u = 0 the point bears P, so that a floe that lies against others does not creep. L never exceeds the mean force
// over the free way times Δt, which it has at a constant speed of crushing, u = v1. A gap to cross first costs nothing.
// A point that does not come in under its own momentum, or comes in slower than solver.rest_speed or under loads beyond
// the limit, bears the mean force over its penetration times Δt, from u = 0 on. The same holds with restitution, where
// the point rebounds as soon as the limit allows, and for a pair that has rafted.
// Depth and work, of a floe by itself or in a row, by face, corner or disc, are within 0.1 % for Δt from 2 ms to 5 s.
// Remaining error: in the step of a hit, a point cannot tell load passed on from others from the load that stops it. If
// others press with a share s of the limit, it crushes up to s/(2 − s) v1 Δt more than in small steps.
// And where a rounded outline comes in so fast that a step takes it past its next corners, these take shares before
// they touch: at Δt √(k/m) = 3 a regular 16-gon goes 7 % less deep, one in parts up to 10 %, and askew up to 16 %,
// deeper.
// Rejected: the line through (0, 0) and the solution of the lone collision, which sweeps like any line: depths of a
// heavy body that hits floes held by others are off by −28 % (face) and +66 % (corner at 5 s). An implicit length at a
// share of the way (this law's predecessor): right where the first step stops a corner, −30 % in between, nothing where
// a gap comes first. Lengths from the corner's angle, or from the clipped points of the manifold: a disc of 32 short
// edges then bears on one of them at any depth.
//
// Memory. A pair keeps its depths, by contact feature, while its gap is at most BT_LAW_MEMORY mean floe sizes; then
// they are forgotten, and the ice is sharp again (assumed). A point whose feature is new (the corner has slid on to the
// next edge) takes the present overlap, at most the pair's deepest crush, as its depth: sliding neither crushes nor
// restores overlap. A depth belongs to this pair alone: a third floe meets the original outline.
//
// Outlines in several polygons bear where they would in one piece (contact/bearing.h), and what one part of a floe, or
// piece of a shore, has crushed is open to the others. Corners beside seams, flush and tilted faces, pieces behind each
// other: where a step is short against the blow, depths are within 1 % of the closed form or of one piece, 3 % for a
// piece behind a narrow one.
//
// Not modelled: in a step the contacts of one face do not know of each other's hits, as the two points of a contact do.
// A tilted face that turns within a step until it is flush ends turned otherwise on a quay in pieces (4 m at 5°,
// 0.5 m/s, Δt = 0.2 s: by 0.7°, and its corner up to 60 % deeper). A piece closely behind a narrow one, both reached in
// one step, makes the dent up to 8 % deeper.
// A record holds two points, so a crushed corner that was not found is forgotten once two other features of the pair
// have been crushed; its depth is then the present overlap, as for a new point.
// Crushed ice does not pile up, extrude or lose mass, and the pressure does not fall with the area of contact.
// Surfaces that were crushed askew stay tilted against each other, and sliding along them changes gaps without the
// normal rows noticing: such steps leave overlap (up to 2.5 % of a floe in the basin's jams, more between floes in
// parts), which the position projection removes in later steps.
#ifndef BERGTOW_CRUSH_H
#define BERGTOW_CRUSH_H

#include "contact/law.h"

// The record of bt_crush_law: for each of two contact features a depth, m, and 1 if it is older than the last step.

/// Its parameters from the case: p, Pa, 0 = contacts are rigid; least length of a contact / ice thickness.
enum { BT_CRUSH_PRESSURE, BT_CRUSH_LEAST };

/// Thickness that is crushed when bodies a and b are pressed together, m: that of the thinner ice; 0 = neither is ice.
double bt_crush_thickness(const bt_bodies *bodies, bt_idx a, bt_idx b);

#endif
