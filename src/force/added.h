// SPDX-License-Identifier: MIT
// Force laws that a program has added, as checkpoints know them.
#ifndef BERGTOW_FORCE_ADDED_H
#define BERGTOW_FORCE_ADDED_H

#include "bergtow/forces.h"

/// An applied force (bergtow/applied.h) that does nothing in the step of these numbers; false of every other law.
bool bt_force_waits(const bt_force_law *law, const double *own);

/// An applied force whose function has been taken away: it acts no more.
bool bt_force_is_released(const bt_force_law *law);

#endif
