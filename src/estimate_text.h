// SPDX-License-Identifier: MIT
// The estimates of a case as JSON for scripts and as a table for readers.
#ifndef BT_ESTIMATE_TEXT_H
#define BT_ESTIMATE_TEXT_H

#include "bergtow/estimate.h"
#include "json.h"

/// An object "estimates": the conditions, one object an estimate, and curves over the concentration with all else kept. simulated: mean ice
/// resistance of a run, N, for the ratios (of the drag: none); NaN = no run.
void bt_estimates_json(bt_json *j, const char *key, const bt_estimate_input *in, double simulated);

/// Lines of a table on stdout, each begun with `indent`. full: formula, source and notes of every estimate; otherwise one line each.
void bt_estimates_print(const bt_estimate_input *in, double simulated, const char *indent, bool full);

#endif
