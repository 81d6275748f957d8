// SPDX-License-Identifier: MIT
// Checks across the keys of a case, and the numbers that follow from them.
#ifndef BERGTOW_CASE_CHECK_H
#define BERGTOW_CASE_CHECK_H

#include <math.h>

#include "bergtow/case.h"
#include "case/case_derived.h"
#include "case/case_faults.h"

/// bt_case_finish with the origins [bt_n_case_keys] of the values, or NULL; origins of missing values are marked as
/// faulty. Appends every fault to err. Reads the tables that the case names. Errors: BT_ERR_CASE; BT_ERR_IO if the only
/// fault is a table that cannot be read.
bt_status bt_case_check(bt_case *input, bt_origin *from, bt_errors *err);

/// Set a number that is not given to its default.
static inline void bt_check_fill(double *member, double value)
{
    if (isnan(*member)) *member = value;
}

/// Set defaults of numbers that follow from other keys, in a case whose shapes are sound.
void bt_case_fill(bt_case *input);
/// Set the mean floe size of a case in the geographic frame that neither makes nor reads ice: that of its floes, which
/// must have outlines, or the size of the body.
void bt_case_fill_size(bt_case *input);
/// Set the defaults of domain, ice and body alone.
void bt_case_fill_scene(bt_case *input);
/// Set the defaults of collisions and solver.rest_speed, once the tow has its defaults.
void bt_case_fill_impact(bt_case *input);

/// Absolute path of a file that is named relative to the folder of the file `from`; the caller frees it. NULL if it is
/// absolute already, or if that folder does not exist.
char *bt_case_named_file(const char *from, const char *file);

/// Read the tables of current and wind that the case names. Errors: BT_ERR_IO, BT_ERR_CASE; the table is then empty.
bt_status bt_case_read_flow_tables(bt_case *input, bt_errors *err);

/// Do the tables cover the run?
void bt_case_check_tables(const bt_check *check);

/// Set width and length of the lead from the body and the tow. The waterline is v [n][2], n = 0 without a body.
void bt_case_lead_follow(bt_case *input, int n, const double *v);

#define BT_ODD_MASS 4.0     ///< mass / displaced water, or its inverse, above which a unit may be wrong, assumed
/// draft / least width of the waterline above which a body would hardly stay upright, assumed: a column of ice of
/// uniform density stays upright up to 0.94 (disc), a berg with a foot beyond that
#define BT_ODD_DRAFT 2.0
// A column stays upright while GM = BM − BG > 0, BM = (I/A)/draft, BG = sail/2 [metacentre as in Bass 1980, Annals of
// Glaciology]; checked at sea only, where nothing holds the body upright.
#define BT_LONG_IMPACT 20.0 ///< time steps of a collision above which a unit may be wrong, assumed
/// Warn of an implausible mass, draft or stability of the body, and of implausibly long collisions.
void bt_case_warn_body(const bt_case *input, bt_errors *warnings);

/// Warn of floes too large for the period of the domain, in which two must have room to turn side by side: whether a
/// run is refused depends on the floes made.
void bt_case_warn_large(const bt_case *input, bt_errors *warnings);

/// Warn of rows of the tables of current and wind less than a step apart: a step does not see what lies between.
void bt_case_warn_tables(const bt_case *input, bt_errors *warnings);

/// Warn of a lead that the body leaves, at corners of its path or as the ice drifts by (x, y) m in the whole run.
void bt_case_warn_lead(const bt_case *input, double x, double y, bt_errors *warnings);

/// Distance from the body to the end of the domain ahead of the tow, m; the length of the domain if no body is in it.
double bt_case_window_ahead(const bt_case *input);

/// Place the body in the moving window of a basin, whose place is given, for a way to x, which may lie in either
/// direction.
void bt_case_window_face(bt_case *input, double x);

/// Set, if the case leaves them open, the place of the body in a moving window and, in the geographic frame, the place
/// of the window.
void bt_case_window_follow(bt_case *input);

/// Checks of the moving window. The waterline is v [n][2], n = 0 without a body.
void bt_case_check_window(const bt_check *check, int n, const double *v);

// --- constraints -----------------------------------------------------------------------------------------------------

/// Refuse values that break a limit, and keys without effect that stand in the same file as the key that makes them
/// useless, or are set beside it. All defaults must be set.
void bt_case_check_constraints(const bt_check *check);

/// Warn of the other keys without effect, which may come from a base or a study.
void bt_case_warn_idle(const bt_case *input, bt_errors *warnings);

/// Mark keys without effect in idle_key [bt_n_case_keys].
void bt_case_mark_idle(const bt_case *input, bool *idle_key);

/// Set a key, a number or a choice, to its default.
void bt_case_put_default(bt_case *c, int key);

/// For a key that has no effect, whatever its value: the text that completes "has no effect "; NULL for other keys.
const char *bt_case_why_unused(const bt_case *input, const char *key);

/// Does a key (a number, a choice or points) have another value than its default, which may follow from other keys?
bool bt_case_changed(const bt_case *c, const char *key);

#endif
