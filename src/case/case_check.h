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
bt_status bt_case_check(bt_case *c, bt_origin *from, bt_errors *err);

/// The default of a number that is not given.
static inline void bt_check_fill(double *member, double value)
{
    if (isnan(*member)) *member = value;
}

/// The defaults of numbers that follow from other keys, of a case whose shapes are sound.
void bt_case_fill(bt_case *c);
/// Mean floe size of a case in the geographic frame that makes and reads no ice: that of its floes, which have
/// outlines, or the size of the body.
void bt_case_fill_size(bt_case *c);
/// Those of domain, ice and body alone.
void bt_case_fill_scene(bt_case *c);
/// Those of collisions, once the tow has its own.
void bt_case_fill_impact(bt_case *c);

/// Absolute path of a file that is named in the file `from`, to whose folder it is relative; NULL where it is absolute,
/// or that folder is not there.
char *bt_case_named_file(const char *from, const char *file);

/// Read the tables of current and wind that the case names. Errors: BT_ERR_IO, BT_ERR_CASE; the table is then empty.
bt_status bt_case_load_tables(bt_case *c, bt_errors *err);

/// Checks of current and wind in time.
void bt_case_check_environment(const bt_check *k);

/// Width and length of the lead that follow from the body and the tow. The waterline is v [n][2], n = 0 without a body.
void bt_case_lead_follow(bt_case *c, int n, const double *v);

/// Checks of the lead.
void bt_case_check_lead(const bt_check *k);

#define BT_ODD_MASS 4.0     ///< mass / displaced water, or its inverse, beyond which a unit may be wrong, assumed
/// draft / least width of the waterline beyond which a body would hardly stay upright, assumed: a column of ice of
/// uniform density does up to 0.94 (disc), bergs with a foot beyond that
#define BT_ODD_DRAFT 2.0
// A column stays upright while GM = BM − BG > 0, BM = (I/A)/draft, BG = sail/2 [metacentre as in Bass 1980, Annals of
// Glaciology]; asked at sea only, where nothing holds the body upright.
#define BT_LONG_IMPACT 20.0 ///< time steps of a collision beyond which one may be, assumed
/// Mass and draft of the body, and duration of its collisions, that no body may have.
void bt_case_warn_body(const bt_case *c, bt_errors *warnings);

/// Rows of the tables of current and wind that are closer than a step, which does not see what is between.
void bt_case_warn_tables(const bt_case *c, bt_errors *warnings);

/// Warn of a lead that drifts away from the tow with its ice, by (x, y) m in the whole run.
void bt_case_warn_lead(const bt_case *c, double x, double y, bt_errors *warnings);

/// Length of path that the tow has led along after time t, with ramp or programme, m.
double bt_case_tow_distance(const bt_case *c, double t);

/// The same as a run goes it, in whole steps at the speed of their end, after those that time t takes, m.
double bt_case_tow_led(const bt_case *c, double t);

/// Time of the last step after which that is no more than this way, s.
double bt_case_tow_last(const bt_case *c, double way);

/// Time at which the tow has led along this way at the latest within the run, s.
double bt_case_tow_time(const bt_case *c, double way);

/// The planned way of the towed body: led along the path, or drawn on a line behind an end that is.
struct bt_path;
typedef struct bt_trail {
    struct bt_path *path; ///< of the end; in mode speed of the body
    double far;           ///< from the end to the point that trails behind it, m; 0 in mode speed
    double x, y;          ///< that point, m
    double beside[2];     ///< of the body's centroid from there, m
} bt_trail;
/// False where the way-points make no path. Release with bt_case_trail_end.
bool bt_case_trail_begin(const bt_case *c, bt_trail *t);
/// The centroid when the end has gone this way, m: on, in steps much shorter than the line, by which it is a tractrix.
void bt_case_trail_to(bt_trail *t, double way, double at[2]);
void bt_case_trail_end(bt_trail *t);

/// How far a body that trails behind a line cuts the corners of the planned path, m.
double bt_case_tow_cut(const bt_case *c);

#define BT_TURN 1e-6 ///< rad; less is rounding
/// Change of course at way-point k, from 0, either way, rad; 0 at the last.
double bt_case_tow_turn(const bt_case *c, int k);

/// Natural period of the body, with added mass, on its line or lines (taken as parallel), against the vessel in mode
/// thrust, s; 0 without a line. Of a line with a weight as it starts: the longest, since it stiffens with the pull.
double bt_case_line_period(const bt_case *c);

#define BT_START_PULL 2.0 ///< of a line with a weight, in its weights: it sags by L/16 then, assumed
#define BT_RAMP_PERIODS 2.0 ///< of the body on its line that a start takes which does not jerk it, assumed

/// Is the ramp at least BT_RAMP_PERIODS periods of the body on its line (or the start that of a programme, or without a
/// line)?
bool bt_case_start_is_slow(const bt_case *c);
/// Time that the tow takes to its speed at its steepest rise, s: the ramp; of a programme that of a ramp as steep. A
/// programme that begins with a speed begins with a jerk: 0.
double bt_case_steepest_ramp(const bt_case *c);
/// Report a start that is not; and what a body at a prescribed speed does within one step, under a tow force that is as
/// large as the step is short: turn at a sharp corner, or reach another speed.
void bt_case_warn_start(const bt_case *c, bt_errors *warnings);

/// The direction that way-points give, where the place of the body is known: a moving window lies by it.
void bt_case_tow_course(const bt_check *k);
/// Defaults of the tow that follow from other keys; body.x and body.y are there.
void bt_case_tow_follow(const bt_check *k);
/// tow.ramp, where it is not given; the tow mode and the body are there.
void bt_case_tow_ramp(bt_case *c);
/// Fastening points that are not given, from the waterline v [n][2].
void bt_case_tow_hull(bt_case *c, int n, const double *v);
/// Work and output of the run against the limits of size, of a case that is sound so far.
void bt_case_check_cost(const bt_check *k);
/// Programme, way-points, lines and vessel.
void bt_case_tow_check(const bt_check *k);
/// Where the towing end starts. False when two branches are too short to meet.
bool bt_case_tow_start(const bt_case *c, double at[2]);
/// The planned path; caller frees. Without way-points straight on. False with the reason in why.
bool bt_case_tow_path(const bt_case *c, struct bt_path *p, char why[200]);

/// Distance from the body to the end of the domain ahead of the tow, m; where no body is in the domain, its length.
double bt_case_window_ahead(const bt_case *c);

/// Where the body stands in the moving window of a basin, whose place is given, on its way to x, which may lie either
/// way.
void bt_case_window_face(bt_case *c, double x);

/// Where the body stands in a moving window, and in the geographic frame where the window lies, as far as the case
/// leaves it open.
void bt_case_window_follow(bt_case *c);

/// Checks of the moving window. The waterline is v [n][2], n = 0 without a body.
void bt_case_check_window(const bt_check *k, int n, const double *v);

#endif
