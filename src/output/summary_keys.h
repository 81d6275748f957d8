// SPDX-License-Identifier: MIT
// The table of summary.json, and the meaning of its keys.
#ifndef BT_SUMMARY_KEYS_H
#define BT_SUMMARY_KEYS_H

#include "base/json.h"
#include "output/summary.h"

/// The data from which a summary is made.
typedef struct bt_json_view {
    const bt_summary *s;
    const bt_history *h;
    const bt_case *c;
    const bt_run_totals *t;
    bt_idx n_floes;
} bt_summary_view;

/// Check that no registered quantity has a key of the summary's own. Errors: BT_ERR_USAGE, with the name to change.
bt_status bt_summary_check_added(bt_errors *err);

/// Rows [*n] of the table, in the order of the file.
const bt_json_key *bt_summary_keys(int *n);
extern const bt_json_key bt_reported_keys[]; ///< of an entry of window.series
extern const int bt_n_reported_keys;

/// Meaning of a key of summary.json, also of a reported series, an estimate, or a registered quantity.
typedef struct bt_meaning {
    bool known, machine;             ///< machine: as bt_json_key.machine
    const char *units, *description; ///< "" if there are none
    const char *estimate, *label;    ///< of an estimate: its name and label, else ""
    const char *kind;                ///< of an estimate, as in "estimate_labels", else ""
} bt_meaning;
bt_meaning bt_summary_meaning(const char *key);

// --- bergtow --list-quantities ---------------------------------------------------------------------------------------

/// Print series, keys of summary.json and estimates for people. stream: FILE *.
void bt_quantities_list(void *stream);
/// Print them for programs: {"series": [...], "summary": [...], "estimates": [...]}.
void bt_quantities_list_json(void *stream);

#endif
