// SPDX-License-Identifier: MIT
// Has the towed body stood still while the tow asked for motion? The usual end of a jam in rigid contact.
//
// Time is cut into windows in which the tow asks for a path of one mean floe size. A window counts when the body, drawn
// by a line or thrust, has come less than BT_STALL_SHARE of that way from where it began. Why a path and not a time:
// one floe size is what a jam must yield to release, at any scale and speed; a body that waits for its line to be
// hauled taut moves again sooner.
#ifndef BERGTOW_STALL_H
#define BERGTOW_STALL_H

#include "bergtow/base.h"

#define BT_STALL_SHARE 0.05

typedef struct bt_stall {
    int64_t windows;        ///< that the body stood still
    double time;            ///< s, of these
    // the window under way
    double asked, spent;    ///< path asked for so far, m; s
    double from_x, from_y;  ///< where the body was, m
    bool begun;
} bt_stall;

struct bt_world;

/// After each step. path: asked path of a window, m.
void bt_stall_step(bt_stall *s, const struct bt_world *w, double path);

/// The same by numbers: asked path of the step m, its length s, and where the body is then.
void bt_stall_add(bt_stall *s, double asked, double dt, double x, double y, double path);

#endif
