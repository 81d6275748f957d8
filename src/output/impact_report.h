// SPDX-License-Identifier: MIT
// Collisions and pushes in the summary (private to it).
#ifndef BT_IMPACT_REPORT_H
#define BT_IMPACT_REPORT_H

#include "output/impact_count.h"
#include "base/json.h"

/// "impacts": {...}; null when c is NULL.
void bt_impacts_json(bt_json *j, const bt_impact_count *c);
/// Two lines of the printed table; nothing when c is NULL.
void bt_impacts_print(const bt_impact_count *c);

#endif
