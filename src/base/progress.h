// SPDX-License-Identifier: MIT
// Progress of a run: one line rewritten on a terminal, plain lines elsewhere.
#ifndef BT_PROGRESS_H
#define BT_PROGRESS_H

#include "bergtow/base.h"

/// Set by the caller before bt_progress_start. Zeroed memory means: stderr, the monotonic clock, not quiet.
typedef struct bt_progress {
    FILE *out;              ///< NULL = stderr
    double (*clock)(void);  ///< s, NULL = bt_clock; a test sets its own
    double interval;        ///< wall time between plain lines, s; a terminal is rewritten every 0.2 s
    int64_t n_steps;        ///< of the whole run
    bool quiet, terminal;   ///< terminal: detected by bt_progress_start unless set
    // state
    double started, last;   ///< s
    int64_t first_step, step;
    double time;            ///< simulated, s
    double force_sum;       ///< N
    int64_t n_force;
    bool drawn;
} bt_progress;

/// Begin at a step (not 0 when a run is resumed).
void bt_progress_start(bt_progress *progress, int64_t step);
/// After a step: its number, the simulated time (s), and the ice resistance of the step (N; NaN without a towed body).
/// Costs one clock reading unless a line is due.
void bt_progress_step(bt_progress *progress, int64_t step, double time, double ice_resistance);
/// The current line without a line end, even if `quiet`.
enum { BT_PROGRESS_LINE = 200 };
void bt_progress_line(const bt_progress *progress, char line[BT_PROGRESS_LINE]);
/// Erase the line on the terminal, so that the next output begins on an empty one.
void bt_progress_end(bt_progress *progress);

#endif
