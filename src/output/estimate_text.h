// SPDX-License-Identifier: MIT
// The estimates of a case as JSON for scripts and as a table for readers.
#ifndef BT_ESTIMATE_TEXT_H
#define BT_ESTIMATE_TEXT_H

#include "bergtow/estimate.h"
#include "base/json.h"

/// An object "estimates": the conditions, one object an estimate, and curves over the concentration with all else kept.
/// simulated: mean ice resistance of a run, N, for the ratios (of the drag: none); NaN = no run.
void bt_estimates_json(bt_json *j, const char *key, const bt_estimate_input *in, double simulated);

/// A table on stdout, each line begun with indent: estimate, force, simulated / estimate when there is a run, regime.
/// full: with formula and source.
void bt_estimates_print(const bt_estimate_input *in, double simulated, const char *indent, bool full);

#endif
