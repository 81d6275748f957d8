// SPDX-License-Identifier: MIT
// What floes leave of each other's drag: skin that other sheets cover, edges in the lee of other floes.
//
// Form drag. An edge at a distance D behind another floe does not feel the free stream. The lee of an obstacle of
// height H fades over a length of its height [Hanssen-Bauer & Gjessing 1988, Tellus A 40, 82-91; Steele et al. 1989, J.
// Geophys. Res. 94, 8955-8965]; the drag of the edge is what is left of it [Lüpkes et al. 2012, J. Geophys. Res. 117,
// D13112; Tsamados et al. 2014, J. Phys. Oceanogr. 44, 1329-1353: S_c², S_c = (1 − exp(−s D/H))^½]:
//     f = 1 − exp(−s D/H) = 1 − exp(−D/(λH)),   λ = 1/s
// s = 0.18 [Tsamados et al.; Icepack, neutral_drag_coeffs, from Hanssen-Bauer & Gjessing and Steele et al.]; 0.5
// [Lüpkes et al.]: λ = 5.6 and 2. The case gives λ and not s: none is λ = 0, and a range that begins there goes on
// without a jump, which s = 0 for none would not (s → 0 shelters all).
//     H of the one ahead, of draft ρ_i/ρ_w h in the water, freeboard (1 − ρ_i/ρ_w) h in the air: the obstacle casts the
//     lee [A]. One that is lower than the edge, h_j < h_i, covers it over the part h_j/h_i [A]:
//     f = 1 − max_j min(1, h_j/h_i) g(D_j/(λH_j)),   g(x) = exp(−x) T(x)
// T tapers from 1 at x = 3.5 to 0 at x = 4.5 (3u² − 2u³): by default, the search ends 25 heights ahead, where 1 % would
// be left [A].
//
// Where. On LINES lines along the flow past the floe's centroid, v = U_ref − U, which share the width across it evenly:
// from where each enters the convex hull (along which form drag acts, forces.h) upstream to where it left the last
// outline. A line that enters inside another floe has D = 0: edges on and under other sheets have no form drag. The
// keel of a pile would add what stands deeper than a sheet, ½ρ C_w (n − 1) H per width for n sheets on each other, at
// one edge a pile. The factor of a floe is the mean over its lines: the moment of a lee on one side only is left out.
// Obstacles are floes, the fixed ones too. The towed body has a wake as well, which is left out, and so are walls; the
// towed body itself feels the free stream.
//
// Skin drag. Of n sheets on a spot one is seen by the water and one by the air, and nobody knows which: each has 1/n of
// it [A], of two one half. Between floes of one velocity that is the force on what they cover together. A floe has
//     e = 1/A ∫_A dA/n
// of its skin drag and of the moment of that, so that sheets that move together have the skin drag of what they cover
// together, piles too. n is constant between edges, so that on a line y = const the integral of 1/n is linear in y from
// one vertex or crossing of outlines to the next: the middle of each such strip is exact. Counted are pairs that may
// raft (contact/raft.h) and overlap by more than the slop.
//
// When. In steps n with n mod N = 0, N = max(1, τ/Δt), the factors are formed from the poses and velocities at the
// start of the step and kept until the next such step; they are state. τ is the time in which the reference speed of
// the case passes BT_EXPOSURE_WAY drafts of the mean floe [A], and a floe past which all flows slower than
// BT_EXPOSURE_SLOW of that speed has its turn every eighth time [A]: its drag is 1 % and less. docs/theory.md says what
// the age of the factors makes. The law knows neither Δt, nor the margin of the detection, nor the age of pair lists:
// it looks for itself, in cells within its reach. A fluid that does not flow past a floe changes nothing: the factors
// stay (1 where there never was a flow), and a cell that rests costs nothing.
//
// Periods. Of a floe the nearest image counts, as for contacts; a lee that goes on to a second one, or to the floe
// itself around the period, is left out.
//
// Ranks. The owner of a floe forms its factors; floes near its cells that this rank does not hold come as copies for
// the moment (partition/domain.h), and the factors go to all that hold the floe. Maxima, and sums in the order of ids:
// the same bits anywhere.
#ifndef BERGTOW_EXPOSURE_H
#define BERGTOW_EXPOSURE_H

#include "bergtow/world.h"

#define BT_EXPOSURE_WAY 15.0  ///< way of the reference speed from one look to the next / draft, assumed
#define BT_EXPOSURE_SLOW 0.1  ///< flow with 1 % of the drag / reference speed, assumed
#define BT_EXPOSURE_REACH 4.5 ///< farthest that a floe shelters / λH, assumed

/// How often, and how far floes look: for a world with all its floes, whose par has lee, draft and covers. speed: m/s.
void bt_exposure_setup(bt_world *world, double speed);

/// Collective. The factors of all floes past which a fluid flows, at the poses and velocities of now; labels must be
/// those of now (cells.h).
void bt_exposure_look(bt_world *world);

/// Collective. At the start of a step, with labels: looks when it is due.
void bt_exposure_begin(bt_world *world);

/// Factors of floes below id n_floes together, of a world that is not distributed: Σ f (form drag × width) / Σ (form
/// drag × width); 1 where nothing flows. All have the whole of their skin.
bt_exposure bt_exposure_mean(const bt_world *world, bt_gid n_floes);

/// The same for floes of a mean diameter and thickness (m) at random at a concentration, before a field is there. With
/// free ways at random, of mean ℓ = (1 − A)/A times the mean chord of a disc π/4 d, the mean of 1 − exp(−D/(λH)) is
///     f = ℓ/(ℓ + λH)
bt_exposure bt_exposure_estimate(const bt_params *par, double size, double thickness, double concentration);

#endif
