// SPDX-License-Identifier: MIT
// Has the towed body stood still, held by ice, while the tow asked for motion? The usual end of a jam in rigid contact.
//
// Time is cut into windows in which the tow asks for a path of one mean floe size. A window counts when the body, drawn
// by a line or thrust, has come less than BT_STALL_SHARE of that way from where it began, and ice bore BT_STALL_HELD of
// the pull or more: a body that a weak vessel only sets going, or that a current holds, is in no jam. Nor is one whose
// last line has parted. Why a path and not a time: one floe size is what a jam must yield to release, at any scale and
// speed; a body that waits for its line to be hauled taut moves again sooner.
//
// And has it overtaken its towing end? Nothing in the model keeps a vessel off the hull: the end then goes through it,
// and the line pulls from behind.
#ifndef BERGTOW_STALL_H
#define BERGTOW_STALL_H

#include "bergtow/base.h"

#define BT_STALL_SHARE 0.05
#define BT_STALL_HELD 0.5 ///< assumed: in a jam ice bears all of it, less what the water bears

typedef struct bt_stall {
    int64_t windows;        ///< that the body stood still
    double time;            ///< s, of these
    // the window under way
    double asked, spent;    ///< path asked for so far, m; s
    double from_x, from_y;  ///< where the body was, m
    double ice, pull;       ///< impulse of the ice against the tow, and of the tow, N s
    bool begun;
    // the towing end within the hull, after it has been outside
    double inside, inside_from; ///< s; s, when first; of no meaning where the first is 0
    bool outside;               ///< it has been outside
} bt_stall;

struct bt_world;

/// After each step. ice, pull: resistance of the ice and force of the tow in it, N; path: asked path of a window, m.
void bt_stall_step(bt_stall *stall, const struct bt_world *world, double ice, double pull, double path);

/// The same by numbers: asked path of the step m, its length s, where the body is then, and the forces.
void bt_stall_add(bt_stall *stall, double asked, double dt, const double at[2], double ice, double pull, double path);

#endif
