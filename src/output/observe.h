// SPDX-License-Identifier: MIT
// Observed numbers of one step: forces on the towed body, balances, counts.
#ifndef BERGTOW_OBSERVE_H
#define BERGTOW_OBSERVE_H

#include "output/sample.h"
#include "bergtow/comm.h"
#include "output/gather.h"
#include "bergtow/world.h"

/// Collective. Fill the sample of the step just done. reference_speed: m/s, for the count of moving floes.
void bt_observe(bt_world *world, double reference_speed, bt_sample *sample);

/// The kinds of numbers that apply to this world: bit 1 << k for each bt_applies k.
unsigned bt_observe_applies(const bt_world *world);

/// Collective. Area of all floes, m².
double bt_observe_ice_area(const bt_world *world);

/// Collective. Largest normal contact force on each body of this rank in the step just done, N. force: [n bodies].
void bt_observe_contact_force(const bt_world *world, double *force);

/// Collective. Sum of all contact forces on each body in the last step, N, to force [n]: for free floes from their
/// momentum, m (U2 - U*) / dt, which needs no order of their contacts; for the few others, which may be prescribed or
/// fixed, from their contacts. 0 before the first step.
void bt_observe_net_force(const bt_comm *comm, const bt_world *world, const bt_roster *roster, double (*force)[2]);

#endif
