// SPDX-License-Identifier: MIT
// What started this process, as its environment tells: a launcher of parallel programs, or not.
#ifndef BT_LAUNCHER_H
#define BT_LAUNCHER_H

#include "bergtow/base.h"

typedef struct bt_launcher {
    bool found; ///< a launcher has started this process
    bool first; ///< of its processes, as far as it says
    int size;   ///< processes that it started; 0 = it does not say
} bt_launcher;

bt_launcher bt_launcher_find(void);

/// bt_clock when the system started this process, before any library was loaded, to a hundredth of a second; where it
/// does not say: now.
double bt_launcher_began(void);

/// What this process starts from here on has not been started by a launcher: it would take itself for this rank.
void bt_launcher_forget(void);

#endif
