// SPDX-License-Identifier: MIT
// Bodies that a program changes by hand between two steps.
#ifndef BERGTOW_EDIT_H
#define BERGTOW_EDIT_H

#include "bergtow/world.h"

/// Collective. Another velocity. Errors, the reason in err: BT_ERR_USAGE.
bt_status bt_edit_velocity(bt_world *world, bt_gid gid, const double v[3], bt_errors *err);

/// Collective. Another place, free of other bodies; that it is in the domain is the caller's to see to. Errors:
/// BT_ERR_USAGE.
bt_status bt_edit_place(bt_world *world, bt_gid gid, const double to[3], bt_errors *err);

#endif
