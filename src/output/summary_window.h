// SPDX-License-Identifier: MIT
// The moving window in the summary: table, warnings. Nothing where there is none (NULL).
#ifndef BT_SUMMARY_WINDOW_H
#define BT_SUMMARY_WINDOW_H

#include "step/window.h"

void bt_summary_window_print(const bt_window *v);
/// Of a moving window that goes, or is to go, so many times its length through the ice.
void bt_summary_window_warn_laps(bt_errors *warnings, double laps);
void bt_summary_window_warn(bt_errors *warnings, const bt_window *v);

#endif
