// SPDX-License-Identifier: MIT
// Reduction of drag by neighbouring floes: skin covered by other sheets, edges in the lee of other floes.
//
// Form drag. An edge at a distance D behind another floe does not feel the free stream. The lee of an obstacle of
// height H fades over a length of its height [Hanssen-Bauer & Gjessing 1988, Tellus A 40, 82-91; Steele et al. 1989, J.
// Geophys. Res. 94, 8955-8965]; the drag of the edge is reduced by the factor [Lüpkes et al. 2012, J. Geophys. Res.
// 117, D13112; Tsamados et al. 2014, J. Phys. Oceanogr. 44, 1329-1353: S_c², S_c = (1 − exp(−s D/H))^½]:
//     f = 1 − exp(−s D/H) = 1 − exp(−D/(λH)),   λ = 1/s
// s = 0.18 [Tsamados et al.; Icepack, neutral_drag_coeffs, from Hanssen-Bauer & Gjessing and Steele et al.]; 0.5
// [Lüpkes et al.]: λ = 5.6 and 2. The case gives λ and not s: λ = 0 means no lee, and a range of λ that begins there is
// continuous; with s that would not be so (s → 0 shelters all).
//     H is that of the floe ahead, which casts the lee [A]: draft ρ_i/ρ_w h in the water, freeboard (1 − ρ_i/ρ_w) h in
//     the air. An obstacle lower than the edge, h_j < h_i, shelters the part h_j/h_i of it [A]:
//     f = 1 − max_j min(1, h_j/h_i) g(D_j/(λH_j)),   g(x) = exp(−x) T(x)
// T tapers from 1 at x = 3.5 to 0 at x = 4.5 (3u² − 2u³): by default, the search ends 25 heights ahead, where 1 % of
// the lee would be left [A].
//
// Where. D is measured on LINES lines along the flow past the floe's centroid, v = U_ref − U, evenly spaced across its
// width: from where a line enters the convex hull (on which form drag acts, forces.h) upstream to where it left the
// last outline. A line that enters inside another floe has D = 0: edges on and under other sheets have no form drag.
// Not included: the keel of a pile, deeper than one sheet, which would add ½ρ C_w (n − 1) H per width for n sheets on
// each other, at one edge of the pile. The factor of a floe is the mean over its lines: the moment of a lee on one side
// only is neglected. Obstacles are floes, fixed ones included. The wake of the towed body, and walls, are left out; the
// towed body itself feels the free stream.
//
// Skin drag. Of n sheets on a spot one is exposed to the water and one to the air, but it is unknown which: each gets
// 1/n [A]. For floes with equal velocities that gives the force on the area that they cover together. A floe has the
// fraction
//     e = 1/A ∫_A dA/n
// of its skin drag and of the moment of skin drag, so that sheets that move together, piles too, have the skin drag of
// their common area. n is constant between edges, so that on a line y = const the integral of 1/n is linear in y from
// one vertex or crossing of outlines to the next: the midpoint rule is exact on each such strip. Only pairs count that
// may raft (contact/raft.h) and overlap by more than the slop.
//
// When. In steps n with n mod N = 0, N = max(1, τ/Δt), the factors are formed from the poses and velocities at the
// start of the step and kept until the next such step; they are state. τ is the time in which the reference speed of
// the case covers BT_EXPOSURE_WAY drafts of the mean floe [A]; a floe past which all fluids flow slower than
// BT_EXPOSURE_SLOW of that speed is evaluated every eighth time [A]: its drag is 1 % or less. For the effect of the age
// of the factors see docs/theory.md. The law depends neither on Δt, nor on the margin of the detection, nor on the age
// of pair lists: it searches the cells within its reach. Without flow past a floe its factors stay (1 if there never
// was a flow), and a cell at rest costs nothing.
//
// Periods. The nearest image of a floe counts, as for contacts; a lee that reaches a second image, or the floe itself
// around the period, is neglected.
//
// Ranks. The owner of a floe forms its factors; floes near its cells that this rank does not hold come as temporary
// copies (partition/domain.h), and the factors go to all ranks that hold the floe. Only maxima, and sums in the order
// of ids: the same bits on any ranks.
#ifndef BERGTOW_EXPOSURE_H
#define BERGTOW_EXPOSURE_H

#include "bergtow/world.h"

#define BT_EXPOSURE_WAY 15.0  ///< distance at the reference speed between evaluations / draft, assumed
#define BT_EXPOSURE_SLOW 0.1  ///< slow flow / reference speed: 1 % of the drag, assumed
#define BT_EXPOSURE_REACH 4.5 ///< largest reach of a lee / λH, assumed

/// Set how often the factors are formed, and the reach of the search, for a world with all its floes whose par has lee,
/// draft and covers. speed: reference speed, m/s.
void bt_exposure_setup(bt_world *world, double speed);

/// Collective. Form the factors of all floes past which a fluid flows, at the present poses and velocities; labels must
/// be up to date (cells.h).
void bt_exposure_look(bt_world *world);

/// Collective. At the start of a step, with labels: form the factors if they are due.
void bt_exposure_begin(bt_world *world);

/// Mean factors of the floes with ids below n_floes, in a world that is not distributed: Σ f (form drag × width) /
/// Σ (form drag × width); 1 without flow. Skin factors count as 1.
bt_exposure bt_exposure_mean(const bt_world *world, bt_gid n_floes);

/// The same for randomly placed floes of a mean diameter and thickness (m) at a concentration, before there is a field.
/// With random free paths of mean ℓ = (1 − A)/A times π/4 d, the mean chord of a disc, the mean of 1 − exp(−D/(λH)) is
///     f = ℓ/(ℓ + λH)
bt_exposure bt_exposure_estimate(const bt_params *par, double size, double thickness, double concentration);

#endif
