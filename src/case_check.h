// SPDX-License-Identifier: MIT
// Checks across the keys of a case, and the numbers that follow from them.
#ifndef BERGTOW_CASE_CHECK_H
#define BERGTOW_CASE_CHECK_H

#include "bergtow/case.h"

/// Where the value of a key comes from, for messages and to leave out checks on values that were refused already.
typedef struct bt_origin {
    int line;        ///< in the case file; 0 = default or override
    const char *set; ///< the override "key=value", or NULL
    bool faulty;     ///< refused; the member holds the default
} bt_origin;

/// bt_case_finish with the origins [bt_n_case_keys] of the values, or NULL. Appends every fault to err. Reads the tables that the case
/// names: BT_ERR_IO when nothing else is wrong than that one cannot be read.
bt_status bt_case_check(bt_case *c, const bt_origin *from, bt_errors *err);

/// "FILE:LINE: KEY", "FILE: KEY" or "--set KEY=VALUE": how a message about a key begins. Truncated to the buffer.
void bt_case_locate(const bt_case *c, const bt_origin *o, const char *key, char out[256]);

/// Read the tables of current and wind that the case names. Errors: BT_ERR_IO, BT_ERR_CASE; the table is then empty.
bt_status bt_case_load_tables(bt_case *c, bt_errors *err);

/// Checks of current and wind in time, as bt_case_check.
void bt_case_check_environment(const bt_case *c, const bt_origin *from, bt_errors *err);

/// Width and length of the lead that follow from the body and the tow; checks of the lead. The waterline is v [n][2], n = 0 without a body.
void bt_case_check_lead(bt_case *c, int n, const double *v, const bt_origin *from, bt_errors *err);

/// Floes that the ice region should hold: concentration × area / mean floe area. 0 without a generator.
double bt_case_expected_floes(const bt_case *c);

/// Distance of the tow end from its start along the tow direction after time t, with the ramp, m.
double bt_case_tow_distance(const bt_case *c, double t);

/// Distance from the body to the end of the domain ahead of the tow, m.
double bt_case_window_ahead(const bt_case *c);

/// Where the body stands in a moving window, and in the geographic frame where the window lies, as far as the case leaves it open.
void bt_case_window_follow(bt_case *c);

/// Checks of the moving window, as bt_case_check. The waterline is v [n][2], n = 0 without a body.
void bt_case_check_window(const bt_case *c, int n, const double *v, const bt_origin *from, bt_errors *err);

#endif
