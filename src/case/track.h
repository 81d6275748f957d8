// SPDX-License-Identifier: MIT
// The track of the towed body through undisturbed ice, planned or as run, and where the body leaves the ice that its
// mean force is to describe.
//
// Places are in the frame that drifts with that ice. There the ice region stays where it was made, and what a body has
// opened stays where it was opened. So two things follow from the track and the domain alone:
//     wake   the body comes, a period on, to a place where it has been: to less than its size, the diameter of the
//            circle of its area. Returning without a period does not count: to tow to and fro is the user's will, or
//            the tide's. Nor does the period of a moving window, where ice that comes back has been renewed.
//     left   the body has left the region for good, where the domain is open or the region ends before the domain does.
//            A region that does not fill a period is repeated with it, with open water between: there the first exit
//            counts.
#ifndef BERGTOW_TRACK_H
#define BERGTOW_TRACK_H

#include "bergtow/case.h"

typedef struct bt_track {
    int64_t n;
    const double *time, *x, *y; ///< [n] s, m; NaN where not known
    double drift[2];            ///< drift of the ice over the whole run, of a planned track, m
    const double *region;       ///< [4] x_min, y_min, x_max, y_max of the ice, m; NULL = that of the case
} bt_track;

/// Largest speed from one point to the next, m/s.
double bt_track_speed(const bt_track *track);

/// Way along x in the direction of the tow, in lengths of the domain; largest distance that it falls back, m.
double bt_track_laps(const bt_case *input, const bt_track *track);
double bt_track_fall(const bt_case *input, const bt_track *track);

/// Warn of a body that comes to its own wake, or out of the ice. Nothing in open water.
void bt_track_warn(const bt_case *input, const bt_track *track, bt_errors *warnings);

#endif
