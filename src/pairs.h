// SPDX-License-Identifier: MIT
// The pair list of the broad phase (private to contact detection).
#ifndef BERGTOW_PAIRS_H
#define BERGTOW_PAIRS_H

#include "bergtow/contacts.h"

/// Build the pair list anew if bodies have travelled farther than its clearance allows, or the margin has grown.
void bt_pairs_update(bt_world *w, double margin);

#endif
