// SPDX-License-Identifier: MIT
// One run from case to result folder: set-up, step loop, record.
#ifndef BERGTOW_RUN_H
#define BERGTOW_RUN_H

#include "bergtow/base.h"
#include "bergtow/case.h"
#include "bergtow/comm.h"

typedef struct bt_run_options {
    const char *dir;          ///< output folder
    int threads;              ///< OpenMP threads of each rank, 0 = run.threads of the case, or all cores shared by the ranks
    int64_t max_steps;        ///< stop after so many steps, 0 = run the whole duration
    bool quiet;               ///< no progress, no table (on ranks other than 0: set)
    int64_t dump_step;        ///< write the contact problem of this step, −1 = none
    const char *dump_path;    ///< to this FCLIB file
    const char *command_line; ///< for the provenance
} bt_run_options;

/// Collective. Run a case. Errors, the same status on all ranks: BT_ERR_CASE, BT_ERR_IO, BT_ERR_NUMERIC, BT_ERR_SIGNAL (SIGINT,
/// SIGTERM, SIGUSR1 at any rank: what was computed is on disk, complete, and marked as stopped). The case is the same on all ranks.
bt_status bt_run(const bt_comm *comm, const bt_case *c, const bt_run_options *o, bt_errors *err);

#endif
