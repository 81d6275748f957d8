// SPDX-License-Identifier: MIT
// One run from case to result folder: set-up, step loop, record.
#ifndef BERGTOW_RUN_H
#define BERGTOW_RUN_H

#include <signal.h>

#include "bergtow/base.h"
#include "bergtow/case.h"

BT_BEGIN_C

struct bt_comm;

typedef struct bt_run_options {
    const char *dir;          ///< output folder
    /// a result in dir: NULL = replace it, otherwise refuse the run (BT_ERR_IO) with this advice, such as "give another
    /// folder with -o"
    const char *remedy;
    /// OpenMP threads of each rank, 0 = run.threads of the case, or all cores shared by the ranks
    int threads;
    int64_t max_steps;        ///< stop after this many steps of this call, 0 = run the whole duration
    double max_wall;          ///< stop with a checkpoint after this wall time, s; 0 = never
    bool quiet;               ///< no progress, no table (set on ranks other than 0)
    int64_t dump_step;        ///< write the contact problem of this step, −1 = none
    const char *dump_path;    ///< to this FCLIB file
    const char *command_line; ///< for the provenance
    double began;             ///< bt_clock at the start of the program if it does only this run, else 0
    /// a stop signal of the caller, treated like the run's own, and set to a signal that came too late for the run; or
    /// NULL
    volatile sig_atomic_t *stop_signal;
    bool leave_signals;       ///< leave signals to the caller
    /// print the errors of a step (bt_errors_print) before its previous state is computed again, which may take long;
    /// err then has only later errors
    bool aloud;
    bool held;                ///< the caller has locked dir (src/base/fileio.h), and unlocks it
    const char *fields;       ///< folder of fields shared with other runs (src/field/field_kept.h), NULL = none
    const char *from;         ///< resume: this checkpoint file instead of the last one in dir, or NULL
} bt_run_options;

/// Collective. Run a case. Errors, the same status on all ranks: BT_ERR_USAGE (dump_step on several ranks),
/// BT_ERR_CASE, BT_ERR_IO, BT_ERR_NUMERIC, BT_ERR_SIGNAL (a signal at any rank, the stop file, max_wall, see
/// src/run/halt.h: all results so far are on disk, marked as stopped, and can be resumed). Ranks that have
/// different cases are refused (BT_ERR_CASE).
bt_status bt_run(const struct bt_comm *comm, const bt_case *input, const bt_run_options *options, bt_errors *err);

/// Collective. Resume the run in options->dir from its last checkpoint (src/output/checkpoint.h), or from its case if
/// it was killed before the first. A finished run is left as it is: BT_OK, with a line on stdout unless quiet. Errors
/// as for bt_run, and BT_ERR_CASE for a rejected checkpoint.
bt_status bt_run_resume(const struct bt_comm *comm, const bt_run_options *options, bt_errors *err);

/// Collective. Number of OpenMP threads of this rank of comm: `asked` if above 0, else run.threads of the case, else
/// OMP_NUM_THREADS, else its available cores; cores also available to other ranks are divided among them.
int bt_run_threads(const struct bt_comm *comm, const bt_case *input, int asked);

BT_END_C

#endif
