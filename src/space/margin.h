// SPDX-License-Identifier: MIT
// How far apart bodies may be and still meet within the step.
#ifndef BERGTOW_MARGIN_H
#define BERGTOW_MARGIN_H

#include "bergtow/world.h"

/// A floe that crosses more than this in a step is no longer looked ahead for (it is reported as outrun), m: a solution
/// that flies apart must not ask for cells, and pair lists, of the whole field.
double bt_margin_most(const bt_world *w);

/// Margin for speed s: 2 Δt s, rounded up to a power of √2 so that pair lists stay valid while speeds wander; at least
/// the slop. m
double bt_margin_for(const bt_world *w, double s);

#endif
