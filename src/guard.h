// SPDX-License-Identifier: MIT
// Guards of a run: what no sound run does ends it with exit code 5 and the state before the step, instead of a result nobody should use.
//
//     guard.overlap       deepest overlap of two bodies / mean floe size
//     guard.energy        kinetic energy of all bodies / that at the reference speed of the solver
//     guard.unconverged   steps in a row that met the sweep limit
//     guard.escape        a floe whose centroid is beyond a wall, looked for every BT_ESCAPE_STEPS steps
// and, always, a pose or velocity that is not a number. 0 or false switches a guard off. The limits are assumed: far beyond what a run with warnings
// shows (overlap of 30 % of a floe, 1,000 unconverged steps in a jam), and short of what happens before numbers overflow.
//
// The state before the step. No step keeps one, which would cost more than a step where ice rests. A run repeats itself to the bit, so the state is
// made again, from the last checkpoint or from the start, up to the step before (run.c).
#ifndef BT_GUARD_H
#define BT_GUARD_H

#include "bergtow/case.h"
#include "bergtow/world.h"

enum { BT_ESCAPE_STEPS = 50 };

typedef struct bt_guard {
    double overlap;         ///< m
    double energy;          ///< J
    int64_t unconverged;
    bool escape_x, escape_y;
    double low[2], high[2]; ///< of the domain, m
    bt_gid n_floes;
    double size;            ///< mean floe size, m
    int64_t in_a_row;       ///< state: steps in a row that did not converge
} bt_guard;

/// Collective. Limits for the world of a case.
void bt_guard_begin(bt_guard *g, const bt_case *c, const bt_world *w, bt_gid n_floes, double mean_size, double reference_speed);

/// Collective. After a step; the same status on all ranks, the message too but for a body that only some hold. Errors: BT_ERR_NUMERIC.
bt_status bt_guard_check(bt_guard *g, const bt_world *w, bt_errors *err);

/// Is every pose and velocity on this rank a number? Errors: BT_ERR_NUMERIC.
bt_status bt_guard_finite(const bt_world *w, bt_errors *err);

#endif
