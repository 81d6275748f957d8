// SPDX-License-Identifier: MIT
// The tow of a case: its programme and planned way in closed form, defaults and checks of its keys.
#ifndef BT_CASE_TOW_H
#define BT_CASE_TOW_H

#include "bergtow/case.h"
#include "case/case_faults.h"

/// Length of path that the tow covers in time t, by ramp or programme, m.
double bt_case_tow_distance(const bt_case *input, double t);

/// The same as a run covers it: in whole steps, as many as time t takes, each at the speed of its end, m.
double bt_case_tow_led(const bt_case *input, double t);

/// Time of the last step after which bt_case_tow_led is at most this way, s.
double bt_case_tow_last(const bt_case *input, double way);

/// Time at which the tow has covered this way, s; it must be covered within the run.
double bt_case_tow_time(const bt_case *input, double way);

/// The planned way of the towed body: led along the path, or pulled on a line behind an end that is.
struct bt_path;
typedef struct bt_trail {
    struct bt_path *path; ///< of the end; in mode speed, of the body
    double far;           ///< distance from the end to the point that trails behind it, m; 0 in mode speed
    double x, y;          ///< that point, m
    double beside[2];     ///< of the body's centroid from that point, m
} bt_trail;
/// False if the way-points make no path. Release with bt_case_trail_end.
bool bt_case_trail_begin(const bt_case *input, bt_trail *trail);
/// The centroid when the end has moved on to this way, m; in steps much shorter than the line its track is a tractrix.
void bt_case_trail_to(bt_trail *trail, double way, double at[2]);
void bt_case_trail_end(bt_trail *trail);

/// How far a body that trails on a line cuts the corners of the planned path, m.
double bt_case_tow_cut(const bt_case *input);

#define BT_TURN 1e-6 ///< rad; less is rounding
/// Change of course at way-point k (from 0), to either side, rad; 0 at the last.
double bt_case_tow_turn(const bt_case *input, int k);

/// Natural period, s, of the body with added mass on its line or lines (taken as parallel), in mode thrust against the
/// vessel; 0 without a line. With a weight, that at the start: the longest, since the line stiffens with the pull.
double bt_case_line_period(const bt_case *input);

#define BT_START_PULL 2.0 ///< pull / weight at the start, of a line with a weight: it then sags by L/16, assumed
#define BT_RAMP_PERIODS 2.0 ///< periods of the body on its line in a start that does not jerk it, assumed

/// Does the tow reach its speed in no less than BT_RAMP_PERIODS periods of the body on its line
/// (bt_case_steepest_ramp)? True without a line.
bool bt_case_start_is_slow(const bt_case *input);
/// Time in which the tow would reach its speed at its steepest rise, s: the ramp, or for a programme a ramp as steep as
/// its steepest rise. A programme that begins at a speed above the body's begins with a jerk: 0.
double bt_case_steepest_ramp(const bt_case *input);
/// Warn of a fast start, a run that ends within the ramp, a current faster than the tow; and, at a prescribed speed, of
/// a sharp corner or a change of speed within one step, where a shorter step gives a larger tow force.
void bt_case_warn_start(const bt_case *input, bt_errors *warnings);

/// Set the direction that way-points give, if the place of the body is known: a moving window is placed by it.
void bt_case_tow_course(const bt_check *check);
/// Set defaults of the tow that follow from other keys; body.x and body.y must be set.
void bt_case_tow_follow(const bt_check *check);
/// Set tow.ramp if it is not given; the tow mode and the body must be set.
void bt_case_tow_ramp(bt_case *input);
/// Set fastening points that are not given, from the waterline v [n][2].
void bt_case_tow_hull(bt_case *input, int n, const double *v);
/// Check the programme, fastening points, the length of branches, and way-points.
void bt_case_tow_check(const bt_check *check);
/// The place where the towing end starts. False if two branches are too short to meet.
bool bt_case_tow_start(const bt_case *input, double at[2]);
/// The planned path, straight on without way-points; release with bt_path_free. False, with the reason in why.
bool bt_case_tow_path(const bt_case *input, struct bt_path *path, char why[200]);

#endif
