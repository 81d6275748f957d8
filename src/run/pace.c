// SPDX-License-Identifier: MIT
// Number of working threads of a run: fewer than assigned while other programs use the cores.
//
// Threads wait for each other in every pass, some hundred times per step. When other programs want the cores, the
// system may suspend the thread that all wait for, for milliseconds each time; a run with two threads then took ten
// times as long as with one. No way of waiting helps, since the awaited thread is not running.
//
// So the number of threads is tried out: if they get too little processor time, half of them work for a moment, and
// continue so if more work is done per second of wall time; later twice as many are tried. Failed trials make the next
// ones rarer. The result does not depend on the number of threads (docs/architecture.md), so the clock may decide.
//
// Rejected: the load average, which is a minute late and counts processes of lower priority.
#include "run/pace.h"

static const double window = 0.1;  // s of wall time for a rate
static const double busy = 0.6;    // share of the threads' time on a core: above this, nothing is wrong
static const double gain = 1.1;    // more threads must do this much more, and fewer not clearly less
static const double less = 0.97;
static const double shortest = 1, longest = 16; // s between trials

void bt_pace_begin(bt_pace *pace, int threads, bool varies)
{
    *pace = (bt_pace){.most = threads, .now = threads, .fewer = true, .due = window, .pause = shortest};
    if (!varies) pace->most = 1;
}

/// Number of threads of the next trial; the present number if there is none.
static int trial(const bt_pace *pace, double use)
{
    if (pace->fewer) return use < busy ? (pace->now + 1) / 2 : pace->now;
    return 2 * pace->now < pace->most ? 2 * pace->now : pace->most;
}

static void end_trial(bt_pace *pace, double rate)
{
    if (rate > (pace->fewer ? less : gain) * pace->rate) {
        pace->pause = shortest;
    } else {
        pace->now = pace->from;
        pace->fewer = !pace->fewer;
        if (pace->pause < longest) pace->pause *= 2;
    }
    pace->from = 0;
    pace->due = pace->pause;
}

static void begin_trial(bt_pace *pace, double rate, double use)
{
    int n = trial(pace, use);
    if (n == pace->now) {
        pace->fewer = !pace->fewer;
        n = trial(pace, use);
    }
    pace->due = pace->pause;
    if (n == pace->now) return;
    pace->from = pace->now;
    pace->rate = rate;
    pace->now = n;
}

int bt_pace_step(bt_pace *pace, double wall, double cpu, double work)
{
    if (pace->most < 2) return pace->now;
    pace->wall += wall;
    pace->cpu += cpu;
    pace->work += work;
    if (pace->wall < window || pace->work == 0) return pace->now;
    const double rate = pace->work / pace->wall, use = pace->cpu / (pace->wall * pace->now);
    pace->due -= pace->wall;
    pace->wall = pace->cpu = pace->work = 0;
    if (pace->from) end_trial(pace, rate);
    else if (pace->due <= 0) begin_trial(pace, rate, use);
    return pace->now;
}
