// SPDX-License-Identifier: MIT
// This process: what started it, and the cores that it may use.
#ifndef BT_PROCESS_H
#define BT_PROCESS_H

#include <sched.h>

#include "bergtow/base.h"
#include "bergtow/comm.h"

// --- the launcher ----------------------------------------------------------------------------------------------------

// What started this process, as its environment tells: a launcher of parallel programs, or not.

typedef struct bt_launcher {
    bool found; ///< a launcher has started this process
    bool first; ///< of its processes, as far as it says
    int size;   ///< processes that it started; 0 = it does not say
} bt_launcher;

bt_launcher bt_launcher_find(void);

/// bt_clock when the system started this process, before any library was loaded, to a hundredth of a second; where it
/// does not say: now.
double bt_launcher_began(void);

/// What this process starts from here on has not been started by a launcher: it would take itself for this rank.
void bt_launcher_forget(void);

// --- the cores -------------------------------------------------------------------------------------------------------

// The cores that this process may use, and its part of those that several ranks share.

/// The cores that this process was given, whichever of them OpenMP has bound this thread to. False where the system
/// does not say.
bool bt_cores_given(cpu_set_t *cores);

/// Collective. Cores for this rank, at least 1: each that it was given counts as one part in as many as there are ranks
/// of `comm` that were given it, too; no more than the tasks of a Slurm step were promised.
int bt_cores_share(const bt_comm *comm);

#endif
