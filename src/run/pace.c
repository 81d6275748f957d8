// SPDX-License-Identifier: MIT
// How many threads work at a run: fewer than it was given while others use the cores.
//
// Threads wait for each other in every pass, some hundred times a step. When other programs want the cores, the system
// takes the thread that all wait for off its core for milliseconds, each time; a run with two threads then took ten
// times as long as with one. No way of waiting helps, as the one waited for does not run.
//
// So threads are tried out: where they get too little of the processors, half of them work for a moment, and go on so
// if more gets done in a second of wall time; later twice as many are tried. Trials that fail become rare. The result
// does not depend on the number of threads (docs/architecture.md), and so this may go by the clock.
//
// Rejected: to go by the load average, which is a minute late and counts whom the scheduler ranks lower.
#include "run/pace.h"

static const double window = 0.1;  // s of wall time for a rate
static const double busy = 0.6;    // of the threads' time on a core: more, and nothing is wrong
static const double gain = 1.1;    // more threads are to do this much more, and fewer not clearly less
static const double less = 0.97;
static const double shortest = 1, longest = 16; // s between trials

void bt_pace_begin(bt_pace *p, int threads, bool varies)
{
    *p = (bt_pace){.most = threads, .now = threads, .fewer = true, .due = window, .pause = shortest};
    if (!varies) p->most = 1;
}

/// Threads of a trial in the direction that is next; as many as now where there is none.
static int trial(const bt_pace *p, double use)
{
    if (p->fewer) return use < busy ? (p->now + 1) / 2 : p->now;
    return 2 * p->now < p->most ? 2 * p->now : p->most;
}

static void end_trial(bt_pace *p, double rate)
{
    if (rate > (p->fewer ? less : gain) * p->rate) {
        p->pause = shortest;
    } else {
        p->now = p->from;
        p->fewer = !p->fewer;
        if (p->pause < longest) p->pause *= 2;
    }
    p->from = 0;
    p->due = p->pause;
}

static void begin_trial(bt_pace *p, double rate, double use)
{
    int n = trial(p, use);
    if (n == p->now) {
        p->fewer = !p->fewer;
        n = trial(p, use);
    }
    p->due = p->pause;
    if (n == p->now) return;
    p->from = p->now;
    p->rate = rate;
    p->now = n;
}

int bt_pace_step(bt_pace *p, double wall, double cpu, double work)
{
    if (p->most < 2) return p->now;
    p->wall += wall;
    p->cpu += cpu;
    p->work += work;
    if (p->wall < window || p->work == 0) return p->now;
    const double rate = p->work / p->wall, use = p->cpu / (p->wall * p->now);
    p->due -= p->wall;
    p->wall = p->cpu = p->work = 0;
    if (p->from) end_trial(p, rate);
    else if (p->due <= 0) begin_trial(p, rate, use);
    return p->now;
}
