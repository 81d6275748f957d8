// SPDX-License-Identifier: MIT
// One run from case to result folder: set-up, step loop, record.
#ifndef BERGTOW_RUN_H
#define BERGTOW_RUN_H

#include <signal.h>

#include "bergtow/base.h"
#include "bergtow/case.h"
#include "bergtow/comm.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct bt_run_options {
    const char *dir;          ///< output folder
    /// OpenMP threads of each rank, 0 = run.threads of the case, or all cores shared by the ranks
    int threads;
    int64_t max_steps;        ///< stop after so many steps of this call, 0 = run the whole duration
    double max_wall;          ///< stop with a checkpoint after this wall time, s; 0 = never
    bool quiet;               ///< no progress, no table (on ranks other than 0: set)
    int64_t dump_step;        ///< write the contact problem of this step, −1 = none
    const char *dump_path;    ///< to this FCLIB file
    const char *command_line; ///< for the provenance
    double began;             ///< bt_clock when the program was started for this run alone, 0 = it was not
    /// a stop signal of the caller's, looked at as one of the run's own, and set to one that the run was too late for;
    /// or NULL
    volatile sig_atomic_t *stop_signal;
    bool leave_signals;       ///< catch no signal: they are the caller's
    /// print what is wrong with a step (bt_errors_print) before the state before it is made again, which may take long;
    /// errors then have what comes after
    bool aloud;
    bool held;                ///< the caller has locked dir (src/base/fileio.h), and lifts that
    const char *fields;       ///< folder of fields that other runs have, too (src/field/field_kept.h), NULL = none
    const char *from;         ///< resume: this checkpoint file instead of the last one in dir, or NULL
} bt_run_options;

/// Collective. Run a case. Errors, the same status on all ranks: BT_ERR_USAGE (dump_step on several ranks),
/// BT_ERR_CASE, BT_ERR_IO, BT_ERR_NUMERIC, BT_ERR_SIGNAL (a signal at any rank, the stop file, max_wall, see
/// src/run/halt.h: what was computed is on disk, complete, marked as stopped, and can be taken up again). The case is
/// the same on all ranks.
bt_status bt_run(const bt_comm *comm, const bt_case *input, const bt_run_options *options, bt_errors *err);

/// Collective. Go on with the run in options->dir from its last checkpoint (src/output/checkpoint.h), or from its case
/// if it was killed before the first. A run that is finished is left as it is: BT_OK, with a line on stdout unless
/// quiet. Errors as bt_run, and BT_ERR_CASE for a checkpoint that is refused.
bt_status bt_run_resume(const bt_comm *comm, const bt_run_options *options, bt_errors *err);

/// Collective. OpenMP threads of this rank of comm: as asked (0 = not), else run.threads of the case, else
/// OMP_NUM_THREADS, else the cores that it was given; those that other ranks were given, too, are shared among them.
int bt_run_threads(const bt_comm *comm, const bt_case *input, int asked);

#ifdef __cplusplus
}
#endif

#endif
