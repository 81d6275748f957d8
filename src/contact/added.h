// SPDX-License-Identifier: MIT
// Laws that a program has added (bergtow/contact.h), as the table of contact laws calls them (contact/law.h). Their
// numbers are BT_LAWS, BT_LAWS + 1, ... in the order of their registration.
//
// They have no rows in bt_laws: the functions of a row serve one law, those here serve all added laws. Their bounds are
// flat and known before the sweeps, so that batches of four can hold their contacts.
#ifndef BERGTOW_CONTACT_ADDED_H
#define BERGTOW_CONTACT_ADDED_H

#include "bergtow/contact.h"
#include "contact/law.h"

/// Append a law that register.c has checked. False if there is no room.
bool bt_added_add(const bt_contact_law *law);

/// Is this law on? False also if it was registered after the world was made.
bool bt_added_on(const bt_params *par, int law);
bool bt_added_applies(const bt_world *world, int law, bt_idx a, bt_idx b);

/// Set the bounds of contact j of the cell, and widen its gaps by the overlap that the law permits.
void bt_added_bound(const bt_world *world, int law, bt_cell *cell, bt_idx j, const bt_pair *pair);

/// Is point i at the bound of this law?
static inline bool bt_added_gives_way(const bt_contact *contact, const bt_limit *limit, int i, int law)
{
    return limit->by[i] == law && contact->ln[i] >= limit->cap[i];
}

/// Book the work at point i, which is at the law's bound and still approaching.
void bt_added_give_way(const bt_world *world, int law, const bt_cell *cell, bt_idx j, int i, bt_totals *totals);

/// After the solve: update the law's record of the pair of contact j.
void bt_added_remember(const bt_world *world, int law, bt_cell *cell, bt_idx j, bt_totals *totals);

/// Add a record to the numbers that describe a state.
void bt_added_count(const bt_world *world, const bt_memory *memory, bt_totals *totals);

/// Number of their sums, which precede those of the program's own laws.
int bt_added_sums(void);

/// Write their sums to the statistics of the step.
void bt_added_stats(bt_step_stats *st, const bt_totals *totals);

/// For the world of a case: enter the laws registered so far, with their numbers, in par.
void bt_added_setup(const bt_case *input, bt_params *par);

#endif
