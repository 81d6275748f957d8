// SPDX-License-Identifier: MIT
// Data and parts of a run (private to this folder).
#ifndef BT_RUN_PARTS_H
#define BT_RUN_PARTS_H

#include "bergtow/comm.h"
#include "bergtow/field.h"
#include "output/record.h"
#include "bergtow/run.h"
#include "bergtow/world.h"
#include "run/guard.h"
#include "run/halt.h"
#include "run/pace.h"
#include "base/progress.h"
#include "base/snapshot.h"

typedef struct bt_running {
    const bt_comm *comm;
    const bt_case *c;
    const bt_run_options *o;
    bt_world *w;
    char *digests;           ///< of the files that the case names (case/case_files.h); on rank 0 of a fresh run
    char *identity;          ///< of the run (bt_running_identity); on rank 0
    bt_field field;          ///< at time zero, with the lead; on rank 0, for checkpoints
    bt_roster roster;
    bt_record *record;       ///< NULL: the run writes no files
    bt_progress progress;
    bt_halt halt;
    bt_guard guard;
    bt_pace pace;
    int64_t until;           ///< last step of a repeated run (failure.h5), −1 = not repeated
    bool begun;              ///< the record, if any, is open
    int64_t failed;          ///< the step that was not sound, −1 = none
    uint64_t asked;          ///< requests to any rank after the last step (halt.h)
    int64_t first_step, end_step; ///< of this call
    double began;            ///< bt_clock when its steps began
    double clocked;          ///< bt_clock at the end of the last timed part of the call
    int64_t frames_due;      ///< frames due by the interval so far
    int64_t frames;          ///< frames taken, without the frame added at the end of --steps
    int64_t framed;          ///< step of the last frame, −1 = none in this call
    bool edited;             ///< bodies were changed by hand since the last checkpoint
    bt_sample sample;        ///< of the last step
    double reference_speed;
    bt_run_totals totals;
} bt_running;

/// How to begin a run.
typedef struct bt_run_start {
    bt_snapshot *kept;   ///< checkpoint to resume from, or NULL
    double start;        ///< bt_clock when the call began
    int64_t until;       ///< only up to this step, for failure.h5; −1 = as in the options
    bool held;           ///< the folder is already locked
    int lock;            ///< out: its lock, on rank 0
} bt_run_start;

/// Collective. Make field, world, folder and record of a run at its first step. comm, `input` and `options` must stay
/// valid until bt_running_close, which must follow whatever the status.
bt_status bt_running_begin(bt_running *running, const bt_comm *comm, const bt_case *input,
                           const bt_run_options *options, bt_run_start *begin, bt_errors *err);

/// Are steps left, and no stop requested?
bool bt_running_has_next(const bt_running *running);

/// Collective. Do one step, observed, guarded and recorded, with frame and checkpoint if due.
bt_status bt_running_step(bt_running *running, bt_errors *err);

/// Collective. End the run here, before bt_running_close, as after --steps.
bt_status bt_running_finish_early(bt_running *running, bt_errors *err);

/// Collective, between steps. Take a frame of the present state, besides those by the interval; does nothing if one was
/// taken after this step.
bt_status bt_running_frame(bt_running *running, bt_errors *err);

/// Collective. Write summary and last checkpoint if all steps were sound; close and free everything except the lock.
/// status: of the last step. Returns the status of the run.
bt_status bt_running_close(bt_running *running, bt_status status, bt_errors *err);

/// Collective, between steps. Save the whole state of the run, on rank 0 to a checkpoint of this name, which is begun
/// here. Errors: BT_ERR_IO, BT_ERR_NUMERIC.
bt_status bt_running_save(bt_running *running, bt_snapshot *snap, const char *name, bt_errors *err);

/// Collective. Publish the record and write a checkpoint of this name.
bt_status bt_running_checkpoint(bt_running *running, const char *name, bt_errors *err);

/// Collective. Have all ranks read the same case, with the tables that it names? Each rank reads them itself. Errors:
/// BT_ERR_CASE.
bt_status bt_running_same_case(const bt_comm *comm, const bt_case *input, bt_errors *err);

/// Identity of a run: a digest of its start, the resolved case, the tables of current and wind and the ice as made.
/// Runs of the same case have the same identity, and are interchangeable. kept: a checkpoint, which contains it, or
/// NULL. The caller frees it.
char *bt_running_identity(const bt_case *input, const bt_field *field, bt_snapshot *kept);

/// Time between frames, s.
double bt_running_frame_interval(const bt_case *input);
/// Does the case ask for frames at all?
static inline bool bt_running_draws(const bt_case *input) { return input->output.frame_interval >= 0; }

/// Read the case and the field of a checkpoint. Errors: BT_ERR_CASE.
bt_status bt_running_load_case(bt_case *input, bt_snapshot *snap, bt_errors *err);
bt_status bt_running_load_field(bt_field *field, bt_lead_stats *lead, bt_snapshot *snap);

/// Collective. Load the state of the world and the counters of the run into a world that was set up, and distribute it
/// over the ranks.
bt_status bt_running_load(bt_running *running, bt_snapshot *snap, bt_errors *err);

/// Collective, after bt_running_close, with the folder still held. After a step that was not sound: compute the state
/// before it again, from the last checkpoint (or options->from, or the start), and write it to failure.h5. The outcome
/// is added to err; options->aloud: print the messages already in err first. start: bt_clock when the call began, from
/// which options->max_wall counts.
void bt_run_keep_failure(const bt_comm *comm, const bt_case *input, const bt_run_options *options, int64_t step,
                         double start, bt_errors *err);

// --- resuming --------------------------------------------------------------------------------------------------------

typedef struct bt_resume {
    bt_snapshot s; ///< the checkpoint; empty if fresh
    bt_case c;
    char *path;    ///< of the checkpoint
    int lock;      ///< on the folder, on rank 0; the caller drops it, whatever the status
    bool fresh;    ///< killed before its first checkpoint: begins at time zero
    bool finished; ///< all its steps are done, and its summary and result are sound
} bt_resume;

/// Collective. Read the point in options->dir (or options->from) from which to resume. bt_resume_end must follow
/// whatever the status. Errors: BT_ERR_IO, BT_ERR_CASE.
bt_status bt_resume_begin(bt_resume *resume, const bt_comm *comm, const bt_run_options *options, bt_errors *err);
void bt_resume_end(bt_resume *resume);

#endif
