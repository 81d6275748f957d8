// SPDX-License-Identifier: MIT
// This process: its launcher, its memory, and the cores that it may use.
#ifndef BT_PROCESS_H
#define BT_PROCESS_H

#include <sched.h>

#include "bergtow/comm.h"

// --- the launcher ----------------------------------------------------------------------------------------------------

// Was this process started by a launcher of parallel programs? The environment tells.

typedef struct bt_launcher {
    bool found; ///< a launcher started this process
    bool first; ///< this is rank 0, as far as the launcher tells
    int size;   ///< processes that it started; 0 = unknown
} bt_launcher;

bt_launcher bt_launcher_find(void);

/// The value of bt_clock when the system started this process, before any library was loaded, to a hundredth of a
/// second; now, if the system does not tell.
double bt_launcher_began(void);

/// Unset the launcher's variables: processes that this one starts would otherwise take themselves for its rank.
void bt_launcher_forget(void);

// --- its memory ------------------------------------------------------------------------------------------------------

/// Forget the peak of memory so far, where the system allows it.
void bt_memory_forget_peak(void);

/// Peak resident memory since then, or since the program was started, B.
double bt_memory_peak(void);

// --- the cores -------------------------------------------------------------------------------------------------------

/// The cores that this process was given, whichever of them OpenMP has bound this thread to. False if the system does
/// not tell.
bool bt_cores_given(cpu_set_t *cores);

/// Collective. Cores for this rank, at least 1: a core that was given to k ranks of `comm` counts as 1/k for each of
/// them. No more than Slurm has promised a task of the step.
int bt_cores_share(const bt_comm *comm);

/// Lower the number of OpenMP threads to BT_MAX_THREADS: OMP_NUM_THREADS may hold any number.
void bt_limit_threads(void);

#endif
