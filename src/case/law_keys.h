// SPDX-License-Identifier: MIT
// Keys that laws of a table bring along: into the table of keys, and their values out of a case.
#ifndef BERGTOW_LAW_KEYS_H
#define BERGTOW_LAW_KEYS_H

#include "bergtow/case.h"
#include "bergtow/law_key.h"

/// Lower-case letters, digits and _, at most 40.
bool bt_law_is_name(const char *s);

/// Is every key law.NAME now in the table of the case's keys? Those that are not: reason and remedy in err.
bool bt_law_keys_add(const char *law, const bt_law_key *keys, int n, bt_errors *err);

/// own[k], the value of the k-th.
void bt_law_keys_values(const bt_case *c, const char *law, const bt_law_key *keys, int n, double *own);

#endif
