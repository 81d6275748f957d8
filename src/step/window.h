// SPDX-License-Identifier: MIT
// Moving window (domain.ends: moving): the domain goes with the towed body, ice enters ahead and is dropped behind.
//
// Space is periodic along x with the window's length L, as in ends: periodic, and the field is made for that: it has no
// seam. Every floe has a home: its pose in the field as made (the mother field), which goes on beyond the window,
// repeated with L and drifting as undisturbed ice does:
//     X_i(t) = home_i + drift(t) + copy_i L
// What counts is the way of the body through that ice: ice that drifts past a body that stands is as much renewed as
// ice at rest that a body is towed through. So the window is one of the ice: in the frame that drifts with it,
// with s = σ (x − drift), σ = ±1 the sign of the tow along x, it covers [rear, rear + L), and `rear` follows the body,
// which so keeps its distance `ahead` from the front. A floe is due when the rear has passed its home, s(X_i) < rear,
// and itself, s(x_i) < rear; one that the body has pushed ahead is taken from inside by as much as it is late,
// rear − s(X_i), but not from the half next to the body of what lies behind it. It is renewed when its next place,
// X_i + σL at the front, is free of all floes that stay: it is put there with the velocity of undisturbed ice. Floes
// whose places hold each other go at once. So the number of bodies, their ids and the memory stay, and what enters is
// the mother field as it was made.
//
// Around the period the rear and the front are neighbours. A floe that waits for its place lies, by the period, among
// the ice at the front, acts there as any other, and keeps that ice complete. Within the front zone, half of `ahead`
// deep (assumed: far enough from the body to be undisturbed), a place can still be taken late. Beyond:
//     kept    a floe that went round as it was: disturbed ice comes again
//     missed  a place that stayed empty, because its floe is carried along by the body
// Both are counted. Rejected: a pool of spare floes for the missed places (their outlines would have to change, or
// twice the bodies be kept for a deficit that a longer window removes); a window with open ends (ice in front of a berg
// at 80 % would give way).
//
// Undisturbed ice: step/window.h.
#ifndef BT_WINDOW_H
#define BT_WINDOW_H

#include "bergtow/world.h"

// --- undisturbed ice -------------------------------------------------------------------------------------------------

// Ice that no body disturbs: the mean floe of the field, in free drift from the velocity at which the field begins.
//
// The moving window takes in ice that drifts so (step/window.h), and the speed of the towed body through the ice is
// relative to it (output/observe.c). Between walls dense ice has nowhere to drift, and rests; loose ice drifts until it
// has packed at one of them, which the mean floe knows nothing of. The mean floe stands nowhere, so a force law that
// depends on the place gives it no velocity; without a window it then goes with the water.

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
void bt_undisturbed_create(bt_world *world, bt_gid n_floes, const bool held[2]);

/// At the end of a step: it drifts on. Nothing where there is none.
void bt_undisturbed_advance(bt_world *world);

/// Place of the towed body in the frame that drifts with this ice (where there is none, over ground), not wrapped, m.
void bt_undisturbed_place(const bt_world *world, double at[2]);

/// Mean floe diameters by which the rear moves on at most: renewing costs new labels, so it is done for many floes at
/// once.
#define BT_WINDOW_STRIDE 2.0

typedef struct bt_window {
    // constants
    double sign;          ///< σ
    double length, ahead; ///< L; distance of the body from the front, m
    double stride;        ///< the rear moves on by multiples of this, m
    double zone;          ///< depth of the front zone, m
    bt_gid n_floes;       ///< bodies below this id are renewed
    // state
    double start, rear;   ///< s of the rear end at first and now, m
    double most;          ///< the largest way of the body through undisturbed ice so far, along σx, m
    double overtaken;     ///< by how much it has fallen behind that, at most: ice came past it from behind, m
    int64_t renewed, kept, missed; ///< in all
    int64_t waiting;      ///< floes behind the rear that were not renewed when it last moved
    int64_t renewed_now;  ///< in the last step
    double dropped[3];    ///< momentum x, y (kg m/s) and kinetic energy (J) of floes when they were taken out, in all
    double brought[3];    ///< the same as they entered
} bt_window;

/// Let the window follow the towed body of a world whose bodies have all been added, before it is distributed to ranks:
/// par.period_x is its length, and world->undisturbed is there.
/// sign: of the tow along x; ahead: m; n_floes: bodies below this id are renewed.
void bt_window_create(bt_world *world, double sign, double ahead, bt_gid n_floes);

/// Collective. At the start of a step: the rear follows the body, floes are renewed. Nothing without a window.
void bt_window_begin(bt_world *world);

/// Low end of the window, x in m.
static inline double bt_window_low(const bt_window *window, const bt_undisturbed *ice)
{
    return (window->sign > 0 ? window->rear : -(window->rear + window->length)) + ice->drift_x;
}

/// Periods that a body in the window at x lies above it.
int32_t bt_window_lap(const bt_world *world, double x);

/// Windows of ice that have gone by: way of the rear through the ice over the length.
static inline double bt_window_laps(const bt_window *window) { return (window->rear - window->start) / window->length; }

/// Of the window and of the undisturbed ice.
uint64_t bt_window_hash(const bt_world *world);

#endif
