// SPDX-License-Identifier: MIT
// Collisions and quasi-static loads in the summary (private to it).
#ifndef BT_IMPACT_REPORT_H
#define BT_IMPACT_REPORT_H

#include "output/impact_count.h"
#include "base/json.h"

/// An array of ranks, each with its peak and how often that is reached or exceeded.
void bt_impacts_exceedance(bt_json *j, const char *key, const bt_impact_count *c);
/// Two lines of the printed table; nothing when c is NULL. at_least: the loads are lower bounds.
void bt_impacts_print(const bt_impact_count *c, bool at_least);

#endif
