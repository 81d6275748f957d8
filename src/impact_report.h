// SPDX-License-Identifier: MIT
// Collisions and pushes in the summary (private to it).
#ifndef BT_IMPACT_REPORT_H
#define BT_IMPACT_REPORT_H

#include "bergtow/impact.h"
#include "json.h"

/// "impacts": {...}; null when m is NULL.
void bt_impacts_json(bt_json *j, const bt_impacts *m);
/// Two lines of the printed table; nothing when m is NULL.
void bt_impacts_print(const bt_impacts *m);

#endif
