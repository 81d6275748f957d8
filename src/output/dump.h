// SPDX-License-Identifier: MIT
// The contact problem of the step just solved, in a file.
#ifndef BT_DUMP_H
#define BT_DUMP_H

#include "bergtow/world.h"

/// Write this step's contact problem (after the solve) in FCLIB's local form. Errors: BT_ERR_IO.
bt_status bt_solver_dump(const bt_world *world, const char *path, bt_errors *err);

#endif
