// SPDX-License-Identifier: MIT
// How many threads work at a run: fewer than it was given while others use the cores.
#ifndef BT_PACE_H
#define BT_PACE_H

#include <stdbool.h>

typedef struct bt_pace {
    int most, now;          ///< threads that the run may have, and that work
    int from;               ///< threads before the trial that is under way, 0 = none is
    bool fewer;             ///< the next trial is with fewer, otherwise with more
    double rate;            ///< work a second before the trial
    double wall, cpu, work; ///< s, s, of the window so far
    double due, pause;      ///< s until the next trial, and between this one and that after it
} bt_pace;

/// varies: false keeps to `threads`.
void bt_pace_begin(bt_pace *pace, int threads, bool varies);

/// After a step: its wall time and the processor time of all threads in it, s, and its work in any unit. Returns the
/// threads of the next step.
int bt_pace_step(bt_pace *pace, double wall, double cpu, double work);

#endif
