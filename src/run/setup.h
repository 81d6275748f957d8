// SPDX-License-Identifier: MIT
// From a case and its ice field to a world.
#ifndef BT_SETUP_H
#define BT_SETUP_H

#include "bergtow/case.h"
#include "bergtow/field.h"
#include "bergtow/world.h"
#include "case/case_derived.h"
#include "case/track.h"
#include "output/gather.h"
#include "tow/tow.h"

/// Build the world of a case: floes of the field, floes given by hand, towed body, walls, in this order. Errors:
/// BT_ERR_CASE (from a field file: a floe outside the domain or overlapping the body).
bt_status bt_setup_world(const bt_case *input, const bt_field *field, bt_world **world, bt_roster *roster,
                         bt_errors *err);

/// The mean floe: of a field that has floes; without them of the ice that is to be generated; without that of the floes
/// given by hand that can move; and if there are none, of ice.size and ice.thickness.
bt_floe_means bt_setup_mean_floe(const bt_case *input, const bt_field *field);

/// Free drift at time zero (force/drift.h), m/s: `floe`, of a round floe of this size and thickness (m) in ice of this
/// concentration, with an estimated lee (force/exposure.h); `body`, of the towed body. NaN if ice.start, the tow or a
/// given velocity sets it otherwise.
void bt_setup_drift(const bt_case *input, double size, double thickness, double concentration, double floe[2],
                    double body[2]);

/// Planned track of the towed body through the ice (with a line, the track of its end), where the ice is in free drift:
/// a round mean floe of this size and thickness (m) at this concentration. Empty without a tow. Release with
/// bt_setup_track_free.
bt_track bt_setup_track(const bt_case *input, double size, double thickness, double concentration);
void bt_setup_track_free(bt_track *track);

/// Constants of the step from the case. size: mean floe size, m.
bt_params bt_setup_params(const bt_case *input, double size);

// --- parts of it (private to setup*.c) -------------------------------------------------------------------------------

/// Does the field belong to this domain, and does it have room until walls have closed? Otherwise a message.
bool bt_setup_check_field(const bt_case *input, const bt_field *field, bt_errors *err);

/// Are the bodies apart, also on prescribed paths, and does each have room within a period? Otherwise messages.
/// first_wall: index of the first wall; walls are the last bodies.
bool bt_setup_check_bodies(const bt_case *input, bt_world *world, const bt_roster *roster, bt_idx first_wall,
                           bt_errors *err);

/// The tow at time zero of a checked case; release with bt_tow_free.
bt_tow *bt_setup_tow(const bt_case *input);

#endif
