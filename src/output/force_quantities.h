// SPDX-License-Identifier: MIT
// Series of force laws: what each does to the towed body, as quantities.
#ifndef BERGTOW_FORCE_QUANTITIES_H
#define BERGTOW_FORCE_QUANTITIES_H

#include "bergtow/forces.h"

/// Register a quantity for each series of the table of force laws that is none of the program's own series, once.
void bt_force_quantities(void);

#endif
