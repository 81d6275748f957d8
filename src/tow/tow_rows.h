// SPDX-License-Identifier: MIT
// The line rows and the vessel of one step (private to the tow).
#ifndef BERGTOW_TOW_ROWS_H
#define BERGTOW_TOW_ROWS_H

#include "tow/tow.h"

/// Course of the vessel and the three linear things it can be at the end of the step.
void bt_tow_begin_vessel(bt_world *w);

/// Rows of the branches at the present poses, from course and speed of the end.
void bt_tow_begin_rows(bt_world *w);

/// Velocity and thrust of the vessel that belong to the impulses found.
void bt_tow_finish_vessel(bt_tow *t);

#endif
