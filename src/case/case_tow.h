// SPDX-License-Identifier: MIT
// The tow of a case: its programme and planned way in closed form, defaults and checks of its keys.
#ifndef BT_CASE_TOW_H
#define BT_CASE_TOW_H

#include "bergtow/case.h"
#include "case/case_faults.h"

/// Length of path that the tow has led along after time t, with ramp or programme, m.
double bt_case_tow_distance(const bt_case *input, double t);

/// The same as a run goes it, in whole steps at the speed of their end, after those that time t takes, m.
double bt_case_tow_led(const bt_case *input, double t);

/// Time of the last step after which that is no more than this way, s.
double bt_case_tow_last(const bt_case *input, double way);

/// Time at which the tow has led along this way at the latest within the run, s.
double bt_case_tow_time(const bt_case *input, double way);

/// The planned way of the towed body: led along the path, or drawn on a line behind an end that is.
struct bt_path;
typedef struct bt_trail {
    struct bt_path *path; ///< of the end; in mode speed of the body
    double far;           ///< from the end to the point that trails behind it, m; 0 in mode speed
    double x, y;          ///< that point, m
    double beside[2];     ///< of the body's centroid from there, m
} bt_trail;
/// False where the way-points make no path. Release with bt_case_trail_end.
bool bt_case_trail_begin(const bt_case *input, bt_trail *trail);
/// The centroid when the end has gone this way, m: on, in steps much shorter than the line, by which it is a tractrix.
void bt_case_trail_to(bt_trail *trail, double way, double at[2]);
void bt_case_trail_end(bt_trail *trail);

/// How far a body that trails behind a line cuts the corners of the planned path, m.
double bt_case_tow_cut(const bt_case *input);

#define BT_TURN 1e-6 ///< rad; less is rounding
/// Change of course at way-point k, from 0, either way, rad; 0 at the last.
double bt_case_tow_turn(const bt_case *input, int k);

/// Natural period of the body, with added mass, on its line or lines (taken as parallel), against the vessel in mode
/// thrust, s; 0 without a line. Of a line with a weight as it starts: the longest, since it stiffens with the pull.
double bt_case_line_period(const bt_case *input);

#define BT_START_PULL 2.0 ///< of a line with a weight, in its weights: it sags by L/16 then, assumed
#define BT_RAMP_PERIODS 2.0 ///< of the body on its line that a start takes which does not jerk it, assumed

/// Is the ramp at least BT_RAMP_PERIODS periods of the body on its line (or the start that of a programme, or without a
/// line)?
bool bt_case_start_is_slow(const bt_case *input);
/// Time that the tow takes to its speed at its steepest rise, s: the ramp; of a programme that of a ramp as steep. A
/// programme that begins with a speed begins with a jerk: 0.
double bt_case_steepest_ramp(const bt_case *input);
/// Report a start that is not; and what a body at a prescribed speed does within one step, under a tow force that is as
/// large as the step is short: turn at a sharp corner, or reach another speed.
void bt_case_warn_start(const bt_case *input, bt_errors *warnings);

/// The direction that way-points give, where the place of the body is known: a moving window lies by it.
void bt_case_tow_course(const bt_check *check);
/// Defaults of the tow that follow from other keys; body.x and body.y are there.
void bt_case_tow_follow(const bt_check *check);
/// tow.ramp, where it is not given; the tow mode and the body are there.
void bt_case_tow_ramp(bt_case *input);
/// Fastening points that are not given, from the waterline v [n][2].
void bt_case_tow_hull(bt_case *input, int n, const double *v);
/// Programme, way-points, lines and vessel.
void bt_case_tow_check(const bt_check *check);
/// Where the towing end starts. False when two branches are too short to meet.
bool bt_case_tow_start(const bt_case *input, double at[2]);
/// The planned path; caller frees. Without way-points straight on. False with the reason in why.
bool bt_case_tow_path(const bt_case *input, struct bt_path *path, char why[200]);

#endif
