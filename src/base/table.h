// SPDX-License-Identifier: MIT
// A velocity in time from a CSV file.
#ifndef BT_TABLE_H
#define BT_TABLE_H

#include "bergtow/case.h"

/// Read a table: the header "t,u,v", then rows of time and two components, times ascending; lines that are empty or
/// begin with # are left out. Numbers are SI or carry their unit, as in a case file. `table` is empty after an error;
/// what it held is released. Errors, with file and line: BT_ERR_IO from the system, BT_ERR_CASE for what the file
/// holds.
bt_status bt_table_read(bt_table *table, const char *path, bt_errors *err);
void bt_table_free(bt_table *table);

/// Can row i stand in a table: finite, its time after that of the row before, its speed in range?
bool bt_table_row_sound(const bt_table *table, int64_t i);

/// The velocity at a time, linear between rows, that of the first or last row outside; m/s. The table has a row.
void bt_table_at(const bt_table *table, double time, double v[2]);

/// Largest speed of any row, m/s: between rows it is never larger.
double bt_table_fastest(const bt_table *table);

#endif
