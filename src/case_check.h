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

/// bt_case_finish with the origins [bt_n_case_keys] of the values, or NULL. Appends every fault to err.
bt_status bt_case_check(bt_case *c, const bt_origin *from, bt_errors *err);

/// "FILE:LINE: KEY", "FILE: KEY" or "--set KEY=VALUE": how a message about a key begins. Truncated to the buffer.
void bt_case_locate(const bt_case *c, const bt_origin *o, const char *key, char out[256]);

/// Floes that the ice region should hold: concentration × area / mean floe area. 0 without a generator.
double bt_case_expected_floes(const bt_case *c);

/// Distance of the tow end from its start along the tow direction after time t, with the ramp, m.
double bt_case_tow_distance(const bt_case *c, double t);

/// Distance from the body to the end of the domain ahead of the tow, m.
double bt_case_window_ahead(const bt_case *c);

/// Where the body stands in a moving window, and in the geographic frame where the window lies, as far as the case leaves it open.
void bt_case_window_follow(bt_case *c);

/// First fault of a moving window, or of domain.ahead (ahead_given) without one: its key, and why with remedy; NULL = none. The body
/// reaches from x_min to x_max about its centroid.
const char *bt_case_window_fault(const bt_case *c, bool ahead_given, double x_min, double x_max, char why[256]);

#endif
