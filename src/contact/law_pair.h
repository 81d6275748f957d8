// SPDX-License-Identifier: MIT
// Work of the impulses of a contact.
#ifndef BT_LAW_PAIR_H
#define BT_LAW_PAIR_H

#include "space/cells.h"

/// Work of the impulses of contact u in this step, Σ λ·½(w* + w2), J: the change of kinetic energy they cause, less
/// the work of prescribed motion. w* is the velocity without contacts, with the tow line's impulse: of two impulses
/// that act at once the line's comes first, or the pull of the line into the ice would count as work of the ice.
double bt_contacts_work(const bt_world *w, const bt_contact *u);

/// The part of it of the normal impulse of point i, J.
double bt_contacts_normal_work(const bt_world *w, const bt_contact *u, int i);

/// The most that contact u can have given in a step whose residual this is, m/s, J: of an exact solution λ·w <= 0, and
/// λᵀ½(w* + w2) = λᵀw2 − ½ λᵀWλ <= Σ |λ| residual.
double bt_contacts_unsolved_work(const bt_contact *u, double residual);

#endif
