// SPDX-License-Identifier: MIT
// Progress of a run: one line rewritten on a terminal, plain lines elsewhere. On stderr, since stdout is for results.
#include "base/progress.h"

#include <math.h>
#include <unistd.h>

#define TERMINAL_INTERVAL 0.2
#define CLEAR_TO_END "\x1b[K"

void bt_progress_start(bt_progress *progress, int64_t step)
{
    if (!progress->out) progress->out = stderr;
    if (!progress->clock) progress->clock = bt_clock;
    progress->terminal = progress->terminal || isatty(fileno(progress->out));
    progress->started = progress->last = progress->clock();
    progress->first_step = progress->step = step;
    progress->time = 0;
    progress->force_sum = 0;
    progress->n_force = 0;
    progress->drawn = false;
}

static const char *duration(char out[48], double seconds)
{
    if (!(seconds >= 0 && seconds < 1e9)) seconds = 0;
    const long long s = llround(seconds);
    if (s >= 3600) snprintf(out, 48, "%lld h %02lld min", s / 3600, s / 60 % 60);
    else if (s >= 60) snprintf(out, 48, "%lld min %02lld s", s / 60, s % 60);
    else snprintf(out, 48, "%lld s", s);
    return out;
}

void bt_progress_line(const bt_progress *progress, char line[BT_PROGRESS_LINE])
{
    char left[48];
    const double rate =
        (double)(progress->step - progress->first_step) / bt_max(progress->clock() - progress->started, 1e-9);
    const double percent = progress->n_steps > 0 ? 100 * (double)progress->step / (double)progress->n_steps : 0;
    const int n = snprintf(line, BT_PROGRESS_LINE, "%5.1f %%  t = %.6g s  %.4g steps/s  %s left", percent,
                           progress->time, rate, duration(left, (double)(progress->n_steps - progress->step) / rate));
    if (progress->n_force > 0)
        snprintf(line + n, BT_PROGRESS_LINE - (size_t)n, "  mean ice resistance so far %.4g N",
                 progress->force_sum / (double)progress->n_force);
}

static void draw(bt_progress *progress, double now)
{
    char line[BT_PROGRESS_LINE];
    bt_progress_line(progress, line);
    fprintf(progress->out, progress->terminal ? "\r%s" CLEAR_TO_END : "%s\n", line);
    fflush(progress->out);
    progress->last = now;
    progress->drawn = true;
}

void bt_progress_step(bt_progress *progress, int64_t step, double time, double ice_resistance)
{
    progress->step = step;
    progress->time = time;
    if (!isnan(ice_resistance)) {
        progress->force_sum += ice_resistance;
        progress->n_force++;
    }
    if (progress->quiet) return;
    const double now = progress->clock(), interval = progress->terminal ? TERMINAL_INTERVAL : progress->interval;
    if (now - progress->last >= interval) draw(progress, now);
}

void bt_progress_end(bt_progress *progress)
{
    if (progress->drawn && progress->terminal) {
        fputs("\r" CLEAR_TO_END, progress->out);
        fflush(progress->out);
    }
    progress->drawn = false;
}
