// SPDX-License-Identifier: MIT
// The laws of the program: one line each, in the order in which they add to a load. Rounding follows that order.
#ifndef BERGTOW_LAWS_H
#define BERGTOW_LAWS_H

#include "bergtow/forces.h"

#define BT_FORCE_LAWS(LAW) \
    LAW(water_drag) \
    LAW(air_drag) \
    LAW(yaw_drag) \
    LAW(coriolis) \
    LAW(tilt)

#define BT_FORCE_LAW_EXTERN(name) extern const bt_force_law bt_law_##name;
BT_FORCE_LAWS(BT_FORCE_LAW_EXTERN)

#endif
