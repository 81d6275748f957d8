// SPDX-License-Identifier: MIT
// Series of contact laws that a program has added (bergtow/contact.h): their work and their numbers, as quantities.
#ifndef BERGTOW_CONTACT_QUANTITIES_H
#define BERGTOW_CONTACT_QUANTITIES_H

/// Register a quantity for each number of the added laws, once.
void bt_contact_quantities(void);

#endif
