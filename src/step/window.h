// SPDX-License-Identifier: MIT
// Moving window (domain.ends: moving): the domain travels with the towed body, ice enters ahead and is dropped behind.
//
// Space is periodic along x with the window's length L, as in ends: periodic, and so is the field, which has no seam.
// Every floe has a home: its pose in the field as made (the mother field), which continues beyond the window, repeated
// with period L and drifting as undisturbed ice does:
//     X_i(t) = home_i + drift(t) + copy_i L
// The distance of the body through that ice matters: ice that drifts past a body at rest is renewed just as ice at rest
// through which a body is towed. So the window is defined in the frame that drifts with the ice: with s = σ (x −
// drift), σ = ±1 the sign of the tow along x, it covers [rear, rear + L), and `rear` follows the body, which thus keeps
// its distance `ahead` from the front. A floe is due when the rear has passed its home, s(X_i) < rear, and the floe
// itself, s(x_i) < rear; a floe that the body has pushed ahead may also be taken from inside the window, up to the
// distance rear − s(X_i) by which it is late, but not from the half of the ice behind the body that is next to it. It
// is renewed when its next place, X_i + σL at the front, is free of all floes that stay: it is put there with the
// velocity of undisturbed ice. Floes that obstruct each other's places move at once. So the number of bodies, their ids
// and the memory use stay constant, and the ice that enters is the mother field as it was made.
//
// Around the period the rear and the front are neighbours. A floe that waits for its place lies, by periodicity, among
// the ice at the front, acts there like any other, and keeps that ice complete. Within the front zone, half of `ahead`
// deep (assumed: far enough from the body to be undisturbed), a place can still be filled late. Beyond it:
//     kept    a floe that went round unchanged: disturbed ice comes again
//     missed  a place that stayed empty, because the body carries its floe along
// Both are counted. Rejected: a pool of spare floes for the missed places (outlines would have to change, or twice as
// many bodies be kept, for a deficit that a longer window removes); a window with open ends (ice in front of a berg at
// 80 % would give way).
//
// Undisturbed ice: see below.
#ifndef BT_WINDOW_H
#define BT_WINDOW_H

#include "bergtow/world.h"

// --- undisturbed ice -------------------------------------------------------------------------------------------------

// Ice that no body disturbs: the mean floe of the field, in free drift from the initial velocity of the field.
//
// The moving window takes in ice with this drift, and the speed of the towed body through the ice is relative to it
// (output/observe.c). Between walls dense ice has nowhere to drift, and rests; loose ice drifts until it has packed
// against one of them, which the mean floe does not model. The mean floe has no position, so a force law that depends
// on the place gives it no velocity; without a window it then moves with the water.

typedef struct bt_undisturbed {
    // constants
    bool held[2];         ///< along x, y: by walls
    double mass, inertia, radius, area, thickness; ///< mean floe; mass 0 = no ice: moves with the water
    bt_drag drag;         ///< its drag, with form drag included in the skin drag
    double share;         ///< m/M of all floes together
    bt_exposure exposure; ///< initial exposure of all floes of the field; included in `drag`
    // state
    double drift_x, drift_y; ///< drift since the start, m
    bt_vel vel;           ///< m/s
} bt_undisturbed;

/// Create the undisturbed ice from the floes with ids below n_floes, after all bodies have been added and before the
/// world is distributed to ranks. held: whether walls stop drift along x, y.
void bt_undisturbed_create(bt_world *world, bt_gid n_floes, const bool held[2]);

/// At the end of a step: advance the drift. Does nothing without undisturbed ice.
void bt_undisturbed_advance(bt_world *world);

/// Place of the towed body in the frame that drifts with this ice (over ground if there is none), not wrapped, m.
void bt_undisturbed_place(const bt_world *world, double at[2]);

/// Largest stride of the rear, in mean floe diameters: renewing requires new labels, so it is done for many floes at
/// once.
#define BT_WINDOW_STRIDE 2.0

typedef struct bt_window {
    // constants
    double sign;          ///< σ
    double length, ahead; ///< L; distance of the body from the front, m
    double stride;        ///< the rear moves by multiples of this, m
    double zone;          ///< depth of the front zone, m
    bt_gid n_floes;       ///< bodies below this id are renewed
    // state
    double start, rear;   ///< s of the rear end, initially and now, m
    double most;          ///< largest distance of the body through undisturbed ice so far, along σx, m
    double overtaken;     ///< the farthest that it has fallen behind that: ice passed it from behind, m
    int64_t renewed, kept, missed; ///< in all
    int64_t waiting;      ///< floes behind the rear that were not renewed when it last moved
    int64_t renewed_now;  ///< in the last step
    double dropped[3];    ///< total momentum x, y (kg m/s) and kinetic energy (J) of floes when taken out
    double brought[3];    ///< the same when they entered
} bt_window;

/// Let the window follow the towed body of a world whose bodies have all been added, before it is distributed to ranks:
/// par.period_x is its length, and world->undisturbed must exist.
/// sign: of the tow along x; ahead: m; n_floes: bodies below this id are renewed.
void bt_window_create(bt_world *world, double sign, double ahead, bt_gid n_floes);

/// Collective. At the start of a step: move the rear after the body, and renew floes. Does nothing without a window.
void bt_window_begin(bt_world *world);

/// Lower end of the window, x in m.
static inline double bt_window_low(const bt_window *window, const bt_undisturbed *ice)
{
    return (window->sign > 0 ? window->rear : -(window->rear + window->length)) + ice->drift_x;
}

/// The number of periods (bt_bodies.lap) that brings a body at x into the window.
int32_t bt_window_lap(const bt_world *world, double x);

/// Windows of ice passed: distance of the rear through the ice over the length.
static inline double bt_window_laps(const bt_window *window) { return (window->rear - window->start) / window->length; }

/// Hash of the window and of the undisturbed ice.
uint64_t bt_window_hash(const bt_world *world);

#endif
