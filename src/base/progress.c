// SPDX-License-Identifier: MIT
// How far a run is: one line rewritten on a terminal, plain lines elsewhere. On stderr, since stdout is for results.
#include "base/progress.h"

#include <math.h>
#include <unistd.h>

#define TERMINAL_INTERVAL 0.2
#define CLEAR_TO_END "\x1b[K"

void bt_progress_start(bt_progress *p, int64_t step)
{
    if (!p->out) p->out = stderr;
    if (!p->clock) p->clock = bt_clock;
    p->terminal = p->terminal || isatty(fileno(p->out));
    p->started = p->last = p->clock();
    p->first_step = p->step = step;
    p->time = 0;
    p->force_sum = 0;
    p->n_force = 0;
    p->drawn = false;
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

void bt_progress_line(const bt_progress *p, char line[BT_PROGRESS_LINE])
{
    char left[48];
    const double rate = (double)(p->step - p->first_step) / bt_max(p->clock() - p->started, 1e-9);
    const double percent = p->n_steps > 0 ? 100 * (double)p->step / (double)p->n_steps : 0;
    const int n = snprintf(line, BT_PROGRESS_LINE, "%5.1f %%  t = %.6g s  %.4g steps/s  %s left", percent, p->time,
                           rate, duration(left, (double)(p->n_steps - p->step) / rate));
    if (p->n_force > 0)
        snprintf(line + n, BT_PROGRESS_LINE - (size_t)n, "  mean ice resistance so far %.4g N",
                 p->force_sum / (double)p->n_force);
}

static void draw(bt_progress *p, double now)
{
    char line[BT_PROGRESS_LINE];
    bt_progress_line(p, line);
    fprintf(p->out, p->terminal ? "\r%s" CLEAR_TO_END : "%s\n", line);
    fflush(p->out);
    p->last = now;
    p->drawn = true;
}

void bt_progress_step(bt_progress *p, int64_t step, double time, double ice_resistance)
{
    p->step = step;
    p->time = time;
    if (!isnan(ice_resistance)) {
        p->force_sum += ice_resistance;
        p->n_force++;
    }
    if (p->quiet) return;
    const double now = p->clock(), interval = p->terminal ? TERMINAL_INTERVAL : p->interval;
    if (now - p->last >= interval) draw(p, now);
}

void bt_progress_end(bt_progress *p)
{
    if (p->drawn && p->terminal) {
        fputs("\r" CLEAR_TO_END, p->out);
        fflush(p->out);
    }
    p->drawn = false;
}
