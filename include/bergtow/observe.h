// SPDX-License-Identifier: MIT
// One step seen from outside: forces on the towed body, balances, counts.
#ifndef BERGTOW_OBSERVE_H
#define BERGTOW_OBSERVE_H

#include "bergtow/record.h"
#include "bergtow/world.h"

/// Fill the sample of the step just done. reference_speed: m/s, for the count of moving floes.
void bt_observe(const bt_world *w, double reference_speed, bt_sample *s);

/// Largest normal contact force on each body of this rank in the step just done, N. force: [n bodies]. Collective.
void bt_observe_contact_force(const bt_world *w, double *force);

/// First body with a pose or velocity that is not finite, −1 if none.
bt_idx bt_observe_not_finite(const bt_world *w);

#endif
