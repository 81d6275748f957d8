// SPDX-License-Identifier: MIT
// The contacts of the towed body in the step just solved (private).
#ifndef BERGTOW_TOUCH_H
#define BERGTOW_TOUCH_H

#include "loads/impact.h"

/// Collective. All manifolds on the towed body with an impulse, in the order of gids, on rank 0: [*n], the caller
/// frees; nothing on other ranks. After the solve and before poses move.
bt_body_contact *bt_body_contacts_collect(const bt_world *w, const bt_impacts *m, int64_t *n);

#endif
