// SPDX-License-Identifier: MIT
// Ice that no body disturbs: the mean floe of the field, in free drift from the velocity at which the field begins.
//
// The moving window takes in ice that drifts so (step/window.h), and the speed of the towed body through the ice is
// relative to it (output/observe.c). Between walls dense ice has nowhere to drift, and rests; loose ice drifts until it
// has packed at one of them, which the mean floe knows nothing of. The mean floe stands nowhere, so a force law that
// depends on the place gives it no velocity; without a window it then goes with the water.
#ifndef BERGTOW_UNDISTURBED_H
#define BERGTOW_UNDISTURBED_H

#include "bergtow/world.h"

typedef struct bt_undisturbed {
    // constants
    bool held[2];         ///< along x, y: by walls
    double mass, inertia, radius, area, thickness; ///< mean floe; mass 0 = no ice: then it goes with the water
    bt_drag drag;         ///< its drag, that along the outline as part of the skin's
    double share;         ///< m/M of all floes together
    bt_exposure exposure; ///< which all floes of the field begin with; in `drag`
    // state
    double drift_x, drift_y; ///< way since the start, m
    bt_vel vel;           ///< m/s
} bt_undisturbed;

/// Of the floes below id n_floes of a world whose bodies have all been added, before it is distributed to ranks. held:
/// along x, y, by walls.
void bt_undisturbed_create(bt_world *w, bt_gid n_floes, const bool held[2]);

/// At the end of a step: it drifts on. Nothing where there is none.
void bt_undisturbed_advance(bt_world *w);

/// Place of the towed body in the frame that drifts with this ice (where there is none, over ground), not wrapped, m.
void bt_undisturbed_place(const bt_world *w, double at[2]);

#endif
