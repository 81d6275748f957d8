// SPDX-License-Identifier: MIT
// The track of the towed body through undisturbed ice, as planned or as a run has gone it, and where it leaves the ice
// that its mean is to be of.
//
// A place is one in the frame that drifts with that ice. There the ice region stays where it was made, and what a body
// has opened stays where it was opened. So two things follow from the track and the domain alone:
//     wake   the body touches a place where it has been, a period on: less than its size from there. Its size is the
//            diameter of its area. Which places it can have touched again but for the period does not matter: to tow to
//            and fro is the user's will, or the tide's. The period of a moving window does not count: what comes back
//            there has been renewed.
//     left   the body has gone out of the region for good. It can go out where the domain is open, or where the region
//            ends before the domain does. A region that does not fill a period comes again with it, and open water
//            between: there the first way out counts.
#ifndef BERGTOW_TRACK_H
#define BERGTOW_TRACK_H

#include "bergtow/case.h"

typedef struct bt_track {
    int64_t n;
    const double *time, *x, *y; ///< [n] s, m; NaN where not known
    double drift[2];            ///< of a planned one: how far the ice drifts in the whole run, m
    const double *region;       ///< [4] x_min, y_min, x_max, y_max of the ice, m; NULL = that of the case
} bt_track;

/// Largest speed from one point to the next, m/s.
double bt_track_speed(const bt_track *track);

/// Way along the tow's direction of x, in lengths of the domain; how far it falls back from that at most, m.
double bt_track_laps(const bt_case *input, const bt_track *track);
double bt_track_fall(const bt_case *input, const bt_track *track);

/// Report a body that comes to its own wake, or out of the ice. Nothing in open water.
void bt_track_warn(const bt_case *input, const bt_track *track, bt_errors *warnings);

#endif
