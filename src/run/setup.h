// SPDX-License-Identifier: MIT
// From a case and its ice field to a world.
#ifndef BT_SETUP_H
#define BT_SETUP_H

#include "bergtow/case.h"
#include "bergtow/field.h"
#include "bergtow/world.h"
#include "case/track.h"
#include "output/gather.h"
#include "tow/tow.h"

/// Build the world of a case: floes of the field, floes given by hand, towed body, walls, in this order. Errors:
/// BT_ERR_CASE (a floe outside the domain or overlapping the body, from a field that was read).
bt_status bt_setup_world(const bt_case *input, const bt_field *field, bt_world **world, bt_roster *roster,
                         bt_errors *err);

/// Free drift at time zero (force/drift.h) of a round floe of this size and thickness (m) in ice of this concentration,
/// whose lee is estimated (force/exposure.h), into floe, and of the towed body into body, m/s; NaN where ice.start, the
/// tow or a velocity that is given has it otherwise.
void bt_setup_drift(const bt_case *input, double size, double thickness, double concentration, double floe[2],
                    double body[2]);

/// Track of the towed body through the ice as the tow is planned (the end of a line in place of the body that it
/// pulls), with the mean floe, round, of this size and thickness (m), in free drift, in ice of this concentration.
/// Empty without a tow. Release with bt_setup_track_free.
bt_track bt_setup_track(const bt_case *input, double size, double thickness, double concentration);
void bt_setup_track_free(bt_track *track);

/// Constants of the step from the case. size: mean floe size, m.
bt_params bt_setup_params(const bt_case *input, double size);

// --- parts of it (private to setup*.c) -------------------------------------------------------------------------------

/// Is the field one of this domain, and is there room for it until walls have closed? Otherwise a message.
bool bt_setup_check_field(const bt_case *input, const bt_field *field, bt_errors *err);

/// Are the bodies apart, also on prescribed paths, and does each have room within a period? Otherwise messages.
/// first_wall: the walls are the bodies from there on.
bool bt_setup_check_bodies(const bt_case *input, bt_world *world, const bt_roster *roster, bt_idx first_wall,
                           bt_errors *err);

/// The tow at time zero of a case that was checked; release with bt_tow_free.
bt_tow *bt_setup_tow(const bt_case *input);

#endif
