// SPDX-License-Identifier: MIT
// Laws that a program has added (bergtow/contact.h), as the table of contact laws calls them (contact/law.h). Their
// numbers are BT_LAWS, BT_LAWS + 1, ... in the order of their registration.
//
// They have no rows in bt_laws: a row's functions know the law by themselves, and one set of functions here serves all
// that are added. Their bounds are flat and known before the sweeps, so that batches of four take them.
#ifndef BERGTOW_CONTACT_ADDED_H
#define BERGTOW_CONTACT_ADDED_H

#include "bergtow/contact.h"
#include "contact/law.h"

/// A law that has been checked (register.c), after those that are there. False: there is no room.
bool bt_added_add(const bt_contact_law *law);

/// False of a law that the world is without.
bool bt_added_on(const bt_params *par, int law);
bool bt_added_applies(const bt_world *world, int law, bt_idx a, bt_idx b);

/// Bounds of contact j of the cell; overlap that the law gives is no gap.
void bt_added_bound(const bt_world *world, int law, bt_cell *cell, bt_idx j, const bt_pair *pair);

/// Is point i at the bound of this law?
static inline bool bt_added_gives_way(const bt_contact *contact, const bt_limit *limit, int i, int law)
{
    return limit->by[i] == law && contact->ln[i] >= limit->cap[i];
}

/// Point i is at the law's bound and approaches: its work.
void bt_added_give_way(const bt_world *world, int law, const bt_cell *cell, bt_idx j, int i, bt_totals *totals);

/// After the solve: what the pair of contact j remembers.
void bt_added_remember(const bt_world *world, int law, bt_cell *cell, bt_idx j, bt_totals *totals);

/// A record into the numbers that are a state.
void bt_added_count(const bt_world *world, const bt_memory *memory, bt_totals *totals);

/// How many sums they have, before those of the program's own laws.
int bt_added_sums(void);

/// Their sums into the numbers of the step.
void bt_added_stats(bt_step_stats *st, const bt_totals *totals);

/// For a world of a case: those that there are now, and their numbers.
void bt_added_setup(const bt_case *input, bt_params *par);

#endif
