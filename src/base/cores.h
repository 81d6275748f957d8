// SPDX-License-Identifier: MIT
// The cores that this process may use, and its part of those that several ranks share.
#ifndef BT_CORES_H
#define BT_CORES_H

#include <sched.h>

#include "bergtow/comm.h"

/// The cores that this process was given, whichever of them OpenMP has bound this thread to. False where the system
/// does not say.
bool bt_cores_given(cpu_set_t *cores);

/// Collective. Cores for this rank, at least 1: each that it was given counts as one part in as many as there are ranks
/// of c that were given it, too; no more than the tasks of a Slurm step were promised.
int bt_cores_share(const bt_comm *c);

#endif
