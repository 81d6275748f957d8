// SPDX-License-Identifier: MIT
// The estimates of a case as JSON for scripts and as a table for readers.
#ifndef BT_ESTIMATE_TEXT_H
#define BT_ESTIMATE_TEXT_H

#include "bergtow/estimate.h"
#include "base/json.h"

extern const bt_json_key bt_estimate_keys[]; ///< of one estimate
extern const int bt_n_estimate_keys;
extern const bt_json_key bt_condition_keys[]; ///< of their conditions
extern const int bt_n_condition_keys;

/// Write an object "estimates": the conditions, one object per estimate, and curves over the concentration with all
/// else fixed. simulated: mean ice resistance of a run, N, for the ratios (none for drag); NaN = no run.
void bt_estimates_json(bt_json *json, const char *key, const bt_estimate_input *in, double simulated);

/// Write an object "estimate_labels": for each estimate, in the order of the registry, its label, its kind, and whether
/// its curve differs between fields of one case. For readers of the file, which know no estimate by name.
void bt_estimate_labels_json(bt_json *json, const char *key, const bt_estimate_input *in);

static inline const char *bt_estimate_kind_name(const bt_estimate_def *def)
{
    return def->on_top ? "on top" : "ice resistance";
}

/// Print a table on stdout, each line after `indent`: estimate, force, simulated / estimate if there is a run, regime.
/// full: with formula and source.
void bt_estimates_print(const bt_estimate_input *in, double simulated, const char *indent, bool full);

#endif
