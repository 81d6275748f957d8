// SPDX-License-Identifier: MIT
// Requests to a run while it steps: checkpoints by signal, steps and wall time, and stops.
//
//     SIGINT, SIGTERM, SIGUSR2   checkpoint and stop      (mpirun passes on SIGUSR1 and SIGUSR2; at the others it kills
//     the ranks a second later)
//     SIGHUP                     the same: the session has ended; under nohup, which ignores it, the run continues
//     SIGUSR1                    checkpoint and continue
//     DIR/stop                   checkpoint and stop; the file is removed
//     --max-wall                 the same after that time
//     output.checkpoint_steps, output.checkpoint_wall       checkpoint and continue
//
// Any rank may receive a signal; rank 0 tests files and clocks. The requests of all ranks are joined once per step, as
// bits, so that all do the same after the same step.
#ifndef BT_HALT_H
#define BT_HALT_H

#include "bergtow/run.h"

enum { BT_N_CAUGHT = 5 };

typedef struct bt_halt {
    const bt_case *c;       ///< when it asks for checkpoints
    const bt_run_options *o;///< folder, longest wall time, what becomes of signals
    double started;         ///< bt_clock when the call began
    bool first;             ///< this is rank 0
    // state
    double last, looked;    ///< bt_clock of the last checkpoint, of the last test for the stop file
    int saves_seen;         ///< requests for a checkpoint by signal that have been served
} bt_halt;

/// Keep signals from now on for the next bt_halt_look; of several runs, the last bt_halt_end restores the handlers
/// before the first.
void bt_halt_begin(bt_halt *halt);
void bt_halt_end(bt_halt *halt);

/// Requests known to this rank after a step, as bits. Bit 0 is never set.
uint64_t bt_halt_look(bt_halt *halt, int64_t step);

static inline bool bt_halt_stops(uint64_t bits) { return (bits & ((UINT64_C(1) << 50) - 2)) != 0; }
static inline bool bt_halt_saves(uint64_t bits) { return bits >> 50 != 0; }

/// Note that a checkpoint has been written.
void bt_halt_saved(bt_halt *halt);

/// Describe why the run stops after this step; removes the stop file (rank 0).
void bt_halt_describe(const bt_halt *halt, uint64_t bits, int64_t step, char out[96]);

/// Catch the signals that ask for a stop, and that for a checkpoint (unless `saves` is NULL); before: previous
/// handlers, for bt_halt_let_go.
void bt_halt_catch(void (*stops)(int), void (*saves)(int), struct sigaction before[BT_N_CAUGHT]);
void bt_halt_let_go(const struct sigaction before[BT_N_CAUGHT]);

/// Start threads that leave these signals to the main thread: block them, and set *before for pthread_sigmask.
void bt_halt_block(sigset_t *before);

#endif
