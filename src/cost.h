// SPDX-License-Identifier: MIT
// What a run costs, before it is made.
#ifndef BERGTOW_COST_H
#define BERGTOW_COST_H

#include "bergtow/case.h"

/// Seconds a floe and step on one core, measured on cases/basin (AMD EPYC, 2026): 0.5, 2 and 15 µs at 20, 50 and 80 %, where
/// force chains reach the walls and the contact solver sweeps a hundred times. Between them the logarithm is linear.
/// A large pack at 80 % in which most floes rest costs a tenth of that: the order of magnitude, no more.
double bt_cost_floe_step(double concentration);

/// Of a whole case with a generated field, s of one core.
double bt_cost_seconds(const bt_case *c);

#endif
