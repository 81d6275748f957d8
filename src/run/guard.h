// SPDX-License-Identifier: MIT
// Guards of a run: a state that no sound run reaches ends the run with exit code 5, and keeps the state before the step
// in place of a result that must not be used.
//
//     guard.overlap       deepest overlap of two bodies / mean floe size
//     guard.energy        kinetic energy of all bodies / the energy that the scene can drive them to
//     guard.unconverged   consecutive steps that reached the limit of work
//     guard.no_solution   steps with locked bodies (solve/islands.h) / steps of the case
//     guard.escape        a body whose centroid is beyond a wall
// and, always, NaN or infinity, or a number where there must be NaN: in poses and velocities, in tow, window and
// collisions, in the samples of the series (bt_sample_fault). 0 or false switches the others off. The limits are
// assumed: far beyond the values of runs with warnings (overlap of 30 % of a floe, 1,000 unconverged steps in a jam),
// and below those reached before numbers overflow.
//
// Every guard checks every step, and the state after the last one. Bodies are checked only in cells that may have
// moved: a field at rest costs only a test of its cells. A body can leave the domain only by moving; at the end all
// bodies are checked nevertheless.
//
// Energy. The limit is guard.energy × (E_0 + Σ ½ M v²), E_0 the initial kinetic energy of the case and v the speed to
// which the body can be driven:
//     v = max(v_p, U_w + v_a + v_s + v_l)  v_p: tow, closing walls, reference speed of the solver; U_w: fastest
//     current, twice that if Coriolis acts about it
// Contacts dissipate energy, so no distribution of it among the bodies exceeds the sum, apart from the work of
// prescribed bodies and of the line, both of the order of v_p; guard.energy leaves room for that, and for the speed of
// a floe squeezed out of a wedge.
// Wind. Drag of water k_w r² and of air k_a (D − r)², D = U_a + U_w at most, balance at r = D α/(1 + α), α² = k_a/k_w
// (Nansen's 2 %, for the default coefficients). r approaches that from below; D bounds it for any α. α² is at most the
// larger of the ratios of skin and form drag, whatever the width. A light floe in a long step overshoots the balance at
// first: from rest the linearised drag (forces.h) takes r to D x/(1 + x), x = Δt k_a D/M, and beyond the balance only
// if x > α. So v_a = D m/(1 + m) with m = max(α, x), and D for m > 1, where the air also turns the body about.
// Rejected: U_a itself, which is a bound, too, but fifty times what ice does in wind: energy of 10⁴ times that is a
// pack at a hundred times the speed of the wind.
// Slope. An acceleration a = g |∇η| against drag reaches at most √(M a / k_w), or a T at the end of the run: v_s is the
// smaller one, at least a Δt; k_w for the least possible width of the outline, area over diameter. Explicit forces of
// other laws (forces.h), with their initial values, add to a; a linear force draws the body to the velocity v_l =
// |j|/g.
//
// The state before the step. Steps do not keep it, as that would cost more than a step in which ice rests. A run is
// reproducible to the bit, so the state is computed again, from the last checkpoint or from the start, up to the
// previous step (run.c).
#ifndef BT_GUARD_H
#define BT_GUARD_H

#include "bergtow/case.h"
#include "output/sample.h"
#include "output/gather.h"
#include "bergtow/world.h"

typedef struct bt_guard {
    double overlap;         ///< m
    double energy;          ///< J; state: a program's forces may have changed by the time of a checkpoint
    const bt_case *c;
    int64_t most_locked;    ///< steps, −1 = no limit
    bt_gid n_floes;
    double size;            ///< mean floe size, m
    int64_t in_a_row;       ///< state: steps in a row that did not converge
    int64_t locked;         ///< state: steps without a solution
    /// of the last check: highest id on this rank of a body that is not finite, of a body beyond a wall; −1 = none
    double broken, gone;
} bt_guard;

/// Collective. Set the limits for the world of a case after all bodies have been distributed.
void bt_guard_begin(bt_guard *guard, const bt_case *input, const bt_world *world, const bt_roster *roster);

/// Check after a step with this sample. Not collective: ranks agree on the status, and then call bt_guard_name. Errors:
/// BT_ERR_NUMERIC.
bt_status bt_guard_check(bt_guard *guard, bt_world *world, const bt_sample *sample, bt_errors *err);

/// The same for the state after the last step: checks every body, and its deepest overlap, m.
bt_status bt_guard_check_end(bt_guard *guard, bt_world *world, double overlap, bt_errors *err);

/// Collective, if some rank has found a fault: name the body, if there is one, on all ranks.
void bt_guard_name(const bt_guard *guard, const bt_world *world, bt_errors *err);

#endif
