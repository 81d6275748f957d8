// SPDX-License-Identifier: MIT
// Checks across the keys of a case, and the numbers that follow from them.
#ifndef BERGTOW_CASE_CHECK_H
#define BERGTOW_CASE_CHECK_H

#include <math.h>

#include "bergtow/case.h"
#include "case/case_derived.h"
#include "case/case_faults.h"

/// bt_case_finish with the origins [bt_n_case_keys] of the values, or NULL; those of values that are missing are marked
/// as faulty. Appends every fault to err. Reads the
/// tables that the case names: BT_ERR_IO when nothing else is wrong than that one cannot be read.
bt_status bt_case_check(bt_case *input, bt_origin *from, bt_errors *err);

/// The default of a number that is not given.
static inline void bt_check_fill(double *member, double value)
{
    if (isnan(*member)) *member = value;
}

/// The defaults of numbers that follow from other keys, of a case whose shapes are sound.
void bt_case_fill(bt_case *input);
/// Mean floe size of a case in the geographic frame that makes and reads no ice: that of its floes, which have
/// outlines, or the size of the body.
void bt_case_fill_size(bt_case *input);
/// Those of domain, ice and body alone.
void bt_case_fill_scene(bt_case *input);
/// Those of collisions, once the tow has its own.
void bt_case_fill_impact(bt_case *input);

/// Absolute path of a file that is named in the file `from`, to whose folder it is relative; NULL where it is absolute,
/// or that folder is not there.
char *bt_case_named_file(const char *from, const char *file);

/// Read the tables of current and wind that the case names. Errors: BT_ERR_IO, BT_ERR_CASE; the table is then empty.
bt_status bt_case_read_flow_tables(bt_case *input, bt_errors *err);

/// Do the tables cover the run?
void bt_case_check_tables(const bt_check *check);

/// Width and length of the lead that follow from the body and the tow. The waterline is v [n][2], n = 0 without a body.
void bt_case_lead_follow(bt_case *input, int n, const double *v);

#define BT_ODD_MASS 4.0     ///< mass / displaced water, or its inverse, beyond which a unit may be wrong, assumed
/// draft / least width of the waterline beyond which a body would hardly stay upright, assumed: a column of ice of
/// uniform density does up to 0.94 (disc), bergs with a foot beyond that
#define BT_ODD_DRAFT 2.0
// A column stays upright while GM = BM − BG > 0, BM = (I/A)/draft, BG = sail/2 [metacentre as in Bass 1980, Annals of
// Glaciology]; asked at sea only, where nothing holds the body upright.
#define BT_LONG_IMPACT 20.0 ///< time steps of a collision beyond which one may be, assumed
/// Mass and draft of the body, and duration of its collisions, that no body may have.
void bt_case_warn_body(const bt_case *input, bt_errors *warnings);

/// Rows of the tables of current and wind that are closer than a step, which does not see what is between.
void bt_case_warn_tables(const bt_case *input, bt_errors *warnings);

/// Warn of a lead that drifts away from the tow with its ice, by (x, y) m in the whole run.
void bt_case_warn_lead(const bt_case *input, double x, double y, bt_errors *warnings);

/// Distance from the body to the end of the domain ahead of the tow, m; where no body is in the domain, its length.
double bt_case_window_ahead(const bt_case *input);

/// Where the body stands in the moving window of a basin, whose place is given, on its way to x, which may lie either
/// way.
void bt_case_window_face(bt_case *input, double x);

/// Where the body stands in a moving window, and in the geographic frame where the window lies, as far as the case
/// leaves it open.
void bt_case_window_follow(bt_case *input);

/// Checks of the moving window. The waterline is v [n][2], n = 0 without a body.
void bt_case_check_window(const bt_check *check, int n, const double *v);

#endif
