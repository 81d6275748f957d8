// SPDX-License-Identifier: MIT
// The tow of a case (private to the set-up).
#ifndef BERGTOW_SETUP_TOW_H
#define BERGTOW_SETUP_TOW_H

#include "tow/tow.h"

/// The tow at time zero of a case that was checked; release with bt_tow_free.
bt_tow *bt_setup_tow(const bt_case *c);

/// Displacement from the start after this way of the tow, m.
void bt_setup_tow_displacement(const bt_case *c, const bt_tow *t, double way, double d[2]);

#endif
