// SPDX-License-Identifier: MIT
// Number of working threads of a run: fewer than assigned while other programs use the cores.
#ifndef BT_PACE_H
#define BT_PACE_H

#include <stdbool.h>

typedef struct bt_pace {
    int most, now;          ///< threads assigned to the run, and at work
    int from;               ///< threads before the present trial, 0 = no trial
    bool fewer;             ///< the next trial is with fewer, otherwise with more
    double rate;            ///< work per second before the trial
    double wall, cpu, work; ///< s, s, work; in the window so far
    double due, pause;      ///< s until the next trial, and from that to the one after it
} bt_pace;

/// Start with `threads`; varies: false keeps this number.
void bt_pace_begin(bt_pace *pace, int threads, bool varies);

/// After a step: wall time and processor time of all threads in it, s, and its work in any unit. Returns the number of
/// threads for the next step.
int bt_pace_step(bt_pace *pace, double wall, double cpu, double work);

#endif
