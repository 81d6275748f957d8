// SPDX-License-Identifier: MIT
// Further processes of an ensemble on this machine: the same call again, on the same folder.
#ifndef BERGTOW_JOBS_H
#define BERGTOW_JOBS_H

#include "bergtow/ensemble.h"

/// What bt_ensemble_run calls to have help. argv: of the command `ensemble`; it must outlive the calls.
typedef struct bt_jobs {
    int argc;
    char **argv;
    int n;
    long pid[BT_MAX_JOBS]; ///< [n] 0: could not be started
    char threads[16];
} bt_jobs;

/// Is this process one of them? Then it also ends, with checkpoints, when the one that started it has ended.
bool bt_jobs_is_one(void);

/// `start` and `end` of bt_ensemble_helpers; of: a bt_jobs. One that cannot be started, or is killed, is reported and
/// done without.
void bt_jobs_start(void *of, int n, int threads);
void bt_jobs_end(void *of, bool stop);

#endif
