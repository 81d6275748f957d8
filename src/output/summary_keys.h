// SPDX-License-Identifier: MIT
// The table of summary.json, and what its keys mean.
#ifndef BT_SUMMARY_KEYS_H
#define BT_SUMMARY_KEYS_H

#include "base/json.h"
#include "output/summary.h"

/// What a summary is made of.
typedef struct bt_json_view {
    const bt_summary *s;
    const bt_history *h;
    const bt_case *c;
    const bt_run_totals *t;
    bt_idx n_floes;
} bt_summary_view;

/// Is the key of a registered quantity one that the summary has already? Errors: BT_ERR_USAGE, with the name to change.
bt_status bt_summary_check_added(bt_errors *err);

/// Its n rows, in the order of the file.
const bt_json_key *bt_summary_keys(int *n);
extern const bt_json_key bt_reported_keys[]; ///< of an entry of window.series
extern const int bt_n_reported_keys;

/// What a key of summary.json means, also one of a reported series, an estimate, or a registered quantity.
typedef struct bt_meaning {
    bool known, machine;             ///< machine: as bt_json_key.machine
    const char *units, *description; ///< "" where there are none
    const char *estimate, *label;    ///< of an estimate: its name and label, else ""
    const char *kind;                ///< of an estimate, as in "estimate_labels", else ""
} bt_meaning;
bt_meaning bt_summary_meaning(const char *key);

#endif
