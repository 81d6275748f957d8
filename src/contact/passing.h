// SPDX-License-Identifier: MIT
// Pairs that pass each other within the step, and those that meet.
//
// The bias gap/Δt makes a plane of the nearest feature (pack.c): right for bodies that meet within the step, wrong for
// those that pass beside each other, which it stops as a wall would. Which of the two a pair does is known when the
// velocities are. So after a solve every row that bears load, of a pair that was more than the slop apart and bore none
// in the step before, is held against the way of the two outlines relative to each other, turning included
// (geometry/apart.h), at the velocities that they have without the impulse of this row and with those of all others. A
// pair that stays more than the slop apart is released: no impulse, no friction, no row in the position projection.
// Released pairs are held against the new velocities in the same way; one that meets has its row again, for the rest of
// the step. The step is solved anew from the impulses that are there until nothing changes: then every row that bears
// load stops two bodies that would meet, and no released pair meets.
//
// Why without its own impulse: a corner that is hit as if it stood in the way turns its floe, and the turn can bring
// the floe to where it is touched. Also a row that rebounds parts the pair by the velocities that it leaves.
//
// Rejected: to leave rows out before the solve because the pair would pass by its free velocities. A push that runs
// through a row of floes within one step makes pairs meet that would not; each of them would take a solve of its own.
#ifndef BERGTOW_PASSING_H
#define BERGTOW_PASSING_H

#include "bergtow/world.h"

/// Collective. After a solve that converged: release rows (if so), and give released pairs that meet their rows again.
/// Returns how many rows have changed, or with `release` false would have: then the step has to be solved again.
int64_t bt_passing_review(bt_world *w, bool release);

#endif
