// SPDX-License-Identifier: MIT
// Series of contact laws: the numbers of the program's own (contact/law.h), and work and numbers of those that a
// program has added (bergtow/contact.h).
#ifndef BERGTOW_CONTACT_QUANTITIES_H
#define BERGTOW_CONTACT_QUANTITIES_H

#include "bergtow/quantity.h"

/// Those of the program's own, in the order of the laws.
int bt_n_law_series(void);
const bt_quantity *bt_law_series(int k);

/// Register a quantity for each number of the added laws, once.
void bt_contact_quantities(void);

#endif
