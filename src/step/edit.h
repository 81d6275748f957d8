// SPDX-License-Identifier: MIT
// Bodies that a program changes by hand between two steps.
#ifndef BERGTOW_EDIT_H
#define BERGTOW_EDIT_H

#include "bergtow/world.h"

/// Collective. Set the velocity v (m/s, m/s, rad/s) of body gid. Errors, with the reason in err: BT_ERR_USAGE.
bt_status bt_edit_velocity(bt_world *world, bt_gid gid, const double v[3], bt_errors *err);

/// Collective. Move body gid to the pose `to` (m, m, rad), which must be free of other bodies; the caller ensures that
/// it is in the domain. Errors: BT_ERR_USAGE.
bt_status bt_edit_place(bt_world *world, bt_gid gid, const double to[3], bt_errors *err);

#endif
