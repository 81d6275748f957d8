// SPDX-License-Identifier: MIT
// The registered quantities, those of force laws not yet asked for; see bergtow/quantity.h.
#ifndef BERGTOW_QUANTITY_REGISTRY_H
#define BERGTOW_QUANTITY_REGISTRY_H

#include "bergtow/quantity.h"

int bt_n_registered(void);
const bt_quantity *bt_registered(int k);

/// Why there can be no series of this name, or not `more` of them, into err.
void bt_registry_check(const char *name, int more, bt_errors *err);

#endif
