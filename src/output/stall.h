// SPDX-License-Identifier: MIT
// Has the towed body stood still, held by ice, while the tow asked for motion? The usual end of a jam in rigid contact.
//
// Time is cut into windows in which the tow asks for a path of one mean floe size. A window counts if the body, drawn
// by a line or thrust, has moved less than BT_STALL_SHARE of that path from its start, and ice bore at least
// BT_STALL_HELD of the pull: a body that a weak vessel is still accelerating, or that a current holds, is not in a jam.
// Nor is a body whose last line has broken. Why a path and not a time: to release, a jam must yield by one floe size,
// at any scale and speed; a body that waits for its line to become taut moves again sooner.
//
// Also: has it overtaken its towing end? Nothing in the model keeps a vessel off the hull: the end then passes through
// it, and the line pulls backwards.
#ifndef BERGTOW_STALL_H
#define BERGTOW_STALL_H

#include "bergtow/base.h"

#define BT_STALL_SHARE 0.05
#define BT_STALL_HELD 0.5 ///< assumed: in a jam ice bears all of the pull not borne by the water

typedef struct bt_stall {
    int64_t windows;        ///< in which the body stood still
    double time;            ///< of these, s
    // the present window
    double asked, spent;    ///< path asked for so far, m; s
    double from_x, from_y;  ///< place of the body at its start, m
    double ice, pull;       ///< impulse of the ice against the tow, and of the tow, N s
    bool begun;
    // the towing end inside the hull after it has been outside
    double inside, inside_from; ///< duration, s; first time, s (meaningless if the duration is 0)
    bool outside;               ///< it has been outside
} bt_stall;

struct bt_world;

/// Update after each step. ice, pull: resistance of the ice and force of the tow in the step, N; path: of a window, m.
void bt_stall_step(bt_stall *stall, const struct bt_world *world, double ice, double pull, double path);

/// The same from numbers: path asked in the step, m; its length dt, s; place after it, m; and the forces, N.
void bt_stall_add(bt_stall *stall, double asked, double dt, const double at[2], double ice, double pull, double path);

#endif
