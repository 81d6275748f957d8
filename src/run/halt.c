// SPDX-License-Identifier: MIT
// Signals, stop file and limits of wall time; see halt.h.
#include "run/halt.h"

#include <inttypes.h>
#include <unistd.h>

#include "base/fileio.h"

#define STOP_FILE "stop"
#define LOOK_SECONDS                                                                                                   \
    0.25 // s of wall time between tests for the stop file: each is a system call, on a cluster over the network
// below them a bit for each signal
static const uint64_t by_file = UINT64_C(1) << 48, by_clock = UINT64_C(1) << 49, save = UINT64_C(1) << 50;

static volatile sig_atomic_t stop_signal, saves_asked;

static void on_stop(int number) { stop_signal = number; }
static void on_save(int number)
{
    (void)number;
    saves_asked = (saves_asked + 1) & 0xffff;
}

// Runs in this process with handlers, which stay from the first such run to the end of the last.
static int users;
static struct sigaction before_all[BT_N_CAUGHT];

static const int caught[BT_N_CAUGHT] = {SIGINT, SIGTERM, SIGUSR2, SIGHUP, SIGUSR1};

void bt_halt_catch(void (*stops)(int), void (*saves)(int), struct sigaction before[BT_N_CAUGHT])
{
    for (int k = 0; k < BT_N_CAUGHT; k++) {
        // SA_RESTART: otherwise a call on a network disk would fail because of the signal that asks for a checkpoint
        struct sigaction act = {.sa_handler = caught[k] == SIGUSR1 ? saves : stops, .sa_flags = SA_RESTART};
        sigemptyset(&act.sa_mask);
        sigaction(caught[k], NULL, &before[k]);
        const bool outlives_session = caught[k] == SIGHUP && before[k].sa_handler == SIG_IGN; // nohup
        if (act.sa_handler && !outlives_session) sigaction(caught[k], &act, NULL);
    }
}

void bt_halt_let_go(const struct sigaction before[BT_N_CAUGHT])
{
    for (int k = 0; k < BT_N_CAUGHT; k++) sigaction(caught[k], &before[k], NULL);
}

void bt_halt_begin(bt_halt *halt)
{
    halt->last = bt_clock();
    halt->looked = 0;
    if (!halt->o->leave_signals && users++ == 0) {
        stop_signal = 0;
        bt_halt_catch(on_stop, on_save, before_all);
    }
    halt->saves_seen = saves_asked;
}

void bt_halt_end(bt_halt *halt)
{
    if (halt->o->leave_signals) return;
    if (halt->o->stop_signal && stop_signal) *halt->o->stop_signal = stop_signal;
    if (--users == 0) bt_halt_let_go(before_all);
}

uint64_t bt_halt_look(bt_halt *halt, int64_t step)
{
    uint64_t bits = 0;
    if (!halt->o->leave_signals && stop_signal) bits |= UINT64_C(1) << stop_signal;
    else if (halt->o->stop_signal && *halt->o->stop_signal) bits |= UINT64_C(1) << *halt->o->stop_signal;
    if (!halt->o->leave_signals && halt->saves_seen != saves_asked) {
        halt->saves_seen = saves_asked;
        bits |= save;
    }
    if (!halt->first) return bits;
    const double now = bt_clock();
    if (halt->c->output.checkpoint_steps > 0 && step % halt->c->output.checkpoint_steps == 0) bits |= save;
    if (halt->c->output.checkpoint_wall > 0 && now - halt->last >= halt->c->output.checkpoint_wall) bits |= save;
    if (halt->o->max_wall > 0 && now - halt->started >= halt->o->max_wall) bits |= by_clock;
    if (halt->o->dir && now - halt->looked >= LOOK_SECONDS) {
        halt->looked = now;
        if (bt_file_there(halt->o->dir, STOP_FILE)) bits |= by_file;
    }
    return bits;
}

void bt_halt_saved(bt_halt *halt) { halt->last = bt_clock(); }

void bt_halt_describe(const bt_halt *halt, uint64_t bits, int64_t step, char out[96])
{
    const uint64_t signals = bits & (by_file - 2);
    if (signals) snprintf(out, 96, "signal %d after step %" PRId64, __builtin_ctzll(signals), step);
    else if (bits & by_file) snprintf(out, 96, "the file %s after step %" PRId64, STOP_FILE, step);
    else snprintf(out, 96, "the limit of %g s of wall time after step %" PRId64, halt->o->max_wall, step);
    if (bits & by_file && halt->first) unlink(BT_PATH(halt->o->dir, STOP_FILE));
}

void bt_halt_block(sigset_t *before)
{
    sigset_t block;
    sigemptyset(&block);
    for (int k = 0; k < BT_N_CAUGHT; k++) sigaddset(&block, caught[k]);
    pthread_sigmask(SIG_BLOCK, &block, before);
}
