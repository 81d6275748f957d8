// SPDX-License-Identifier: MIT
// Restitution that never adds energy (private to the solver).
//
// Newton's law can add energy when several contacts of a body rebound at once, or slip (Kane & Levinson 1985). Movable
// bodies that touch form an island; where the contacts of an island come out with positive work, the step is solved
// again with the restitution of that island halved, and again, at last with none, where the work is never positive.
#ifndef BERGTOW_RESTITUTION_H
#define BERGTOW_RESTITUTION_H

#include "bergtow/world.h"

/// Collective. Full restitution for every island; false (and nothing to do) when no contact of this step has any.
bool bt_restitution_begin(bt_world *w);

/// Collective. Lower the restitution, and the biases, of every island whose contacts did positive work, beyond what
/// rows solved to the residual may do (λ times the residual, and rounding). True when there was one.
bool bt_restitution_lower(bt_world *w);

#endif
