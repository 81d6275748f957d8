// SPDX-License-Identifier: MIT
// bergtow --list-quantities: every number that a run leaves, as it is registered.
#ifndef BT_QUANTITY_LIST_H
#define BT_QUANTITY_LIST_H

/// stream: FILE *. For people: series, keys of summary.json, estimates.
void bt_quantities_list(void *stream);
/// For programs: {"series": [...], "summary": [...], "estimates": [...]}.
void bt_quantities_list_json(void *stream);

#endif
