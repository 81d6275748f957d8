// SPDX-License-Identifier: MIT
// One run from case to result folder: set-up, step loop, record.
#ifndef BERGTOW_RUN_H
#define BERGTOW_RUN_H

#include "bergtow/base.h"
#include "bergtow/case.h"

typedef struct bt_run_options {
    const char *dir;          ///< output folder
    int threads;              ///< OpenMP threads, 0 = run.threads of the case, or all cores
    int64_t max_steps;        ///< stop after so many steps, 0 = run the whole duration
    bool quiet;               ///< no progress, no table
    int64_t dump_step;        ///< write the contact problem of this step, −1 = none
    const char *dump_path;    ///< to this FCLIB file
    const char *command_line; ///< for the provenance
} bt_run_options;

/// Run a case. Errors: BT_ERR_CASE, BT_ERR_IO, BT_ERR_NUMERIC, BT_ERR_SIGNAL (SIGINT, SIGTERM: what was computed is
/// on disk, complete, and marked as stopped).
bt_status bt_run(const bt_case *c, const bt_run_options *o, bt_errors *err);

#endif
