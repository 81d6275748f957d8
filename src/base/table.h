// SPDX-License-Identifier: MIT
// A velocity over time from a CSV file.
#ifndef BT_TABLE_H
#define BT_TABLE_H

#include "bergtow/case.h"

/// Read a table: the header "t,u,v", then rows of time and two components, with ascending times; empty lines and lines
/// that begin with # are skipped. Numbers are SI or carry their unit, as in a case file. The previous content of
/// `table` is released; after an error it is empty. Errors, with file and line: BT_ERR_IO from the system, BT_ERR_CASE
/// for the content of the file.
bt_status bt_table_read(bt_table *table, const char *path, bt_errors *err);
void bt_table_free(bt_table *table);

/// Is row i valid: finite, later than the row before, its components in range?
bool bt_table_row_sound(const bt_table *table, int64_t i);

/// The velocity at a time, m/s: linear between rows, outside them that of the first or last. The table has a row.
void bt_table_at(const bt_table *table, double time, double v[2]);

/// Largest speed of any row, m/s; it is never exceeded between rows.
double bt_table_fastest(const bt_table *table);

#endif
