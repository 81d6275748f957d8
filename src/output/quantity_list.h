// SPDX-License-Identifier: MIT
// bergtow --list-quantities: every number that a run writes, as registered.
#ifndef BT_QUANTITY_LIST_H
#define BT_QUANTITY_LIST_H

/// Print series, keys of summary.json and estimates for people. stream: FILE *.
void bt_quantities_list(void *stream);
/// Print them for programs: {"series": [...], "summary": [...], "estimates": [...]}.
void bt_quantities_list_json(void *stream);

#endif
