// SPDX-License-Identifier: MIT
// Series of force laws: what each does to the towed body, as quantities.
#ifndef BERGTOW_FORCE_QUANTITIES_H
#define BERGTOW_FORCE_QUANTITIES_H

#include "bergtow/forces.h"

/// Force of series k (bt_force_series_of) on the towed body against the tow direction in the step just solved, N.
double bt_force_against(const bt_world *w, int k);

/// The same by the name of the series: of_world of a quantity whose context is that name.
double bt_force_of(const bt_world *w, const void *series);

/// Register a quantity for each series of the table of force laws that is none of the program's own series, once.
void bt_force_quantities(void);

#endif
