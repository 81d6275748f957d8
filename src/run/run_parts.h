// SPDX-License-Identifier: MIT
// A run as its parts see it (private to this folder).
#ifndef BT_RUN_PARTS_H
#define BT_RUN_PARTS_H

#include "bergtow/comm.h"
#include "bergtow/field.h"
#include "output/record.h"
#include "bergtow/run.h"
#include "run/setup.h"
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
    bt_field field;          ///< at time zero, with the lead in it; on rank 0, for the checkpoints
    bt_roster roster;
    bt_record *record;       ///< NULL: the run leaves no files
    bt_progress progress;
    bt_halt halt;
    bt_guard guard;
    bt_pace pace;
    int64_t until;           ///< the run is only made again up to this step, −1 = it is not
    bool begun;              ///< the record, if there is to be one, is open
    int64_t failed;          ///< the step that was not sound, −1 = none
    uint64_t asked;          ///< what some rank has been asked for after the last step (halt.h)
    int64_t first_step, end_step; ///< of this call
    double began;            ///< bt_clock when its steps began
    double clocked;          ///< bt_clock at the end of the last part of the call that has been timed
    int64_t frames_due;      ///< frames by the interval, so far
    int64_t frames;          ///< frames taken, but for one that the end of --steps has added
    int64_t framed;          ///< step of the last frame, −1 = none in this call
    bool edited;             ///< bodies were changed by hand since the last checkpoint
    bt_sample sample;        ///< of the last step
    double reference_speed;
    bt_run_totals totals;
} bt_running;

/// How a run begins.
typedef struct bt_run_manner {
    bt_snapshot *kept;   ///< go on from there, or NULL
    double start;        ///< bt_clock when the call began
    int64_t until;       ///< only up to this step, for failure.h5; −1 = as the options say
    bool held;           ///< the folder is held already
    int lock;            ///< out: by this, on rank 0
} bt_run_manner;

/// Collective. Field, world, folder and record of a run at its first step. comm, `input` and `options` must stay where
/// they are until bt_running_end, which follows whatever the status is.
bt_status bt_running_begin(bt_running *running, const bt_comm *comm, const bt_case *input,
                           const bt_run_options *options, bt_run_manner *manner, bt_errors *err);

/// Is a step left, and has no stop been asked for?
bool bt_running_goes_on(const bt_running *running);

/// Collective. One step, observed, guarded and recorded; frame and checkpoint when they are due.
bt_status bt_running_step(bt_running *running, bt_errors *err);

/// Collective. The run ends here, before bt_running_end, as it does after --steps.
bt_status bt_running_stop(bt_running *running, bt_errors *err);

/// Collective, between steps. A frame of the bodies as they are, beside those by the interval; nothing where one was
/// taken after this step.
bt_status bt_running_frame(bt_running *running, bt_errors *err);

/// Collective. status: of the last step. Summary and last checkpoint of a run whose steps were sound; closes and frees
/// everything but the lock. Returns the status of the run.
bt_status bt_running_end(bt_running *running, bt_status status, bt_errors *err);

/// Collective, between steps. The whole state of the run, on rank 0 into a checkpoint of this name that is begun here.
/// Errors: BT_ERR_IO, BT_ERR_NUMERIC.
bt_status bt_running_save(bt_running *running, bt_snapshot *snap, const char *name, bt_errors *err);

/// Collective. Publish the record and write a checkpoint of this name.
bt_status bt_running_checkpoint(bt_running *running, const char *name, bt_errors *err);

/// What tells a run from others: a digest of what it begins with, the resolved case, the tables of current and wind and
/// the ice as made. Those of the same case are alike, and may take each other's place. kept: the checkpoint, which has
/// it, or NULL. The caller frees it.
char *bt_running_identity(const bt_case *input, const bt_field *field, bt_snapshot *kept);

/// Time between frames, s.
double bt_running_frame_interval(const bt_case *input);
/// Does the case ask for frames at all?
static inline bool bt_running_draws(const bt_case *input) { return input->output.frame_interval >= 0; }

/// The case and the field of a checkpoint. Errors: BT_ERR_CASE.
bt_status bt_running_load_case(bt_case *input, bt_snapshot *snap, bt_errors *err);
bt_status bt_running_load_field(bt_field *field, bt_lead_stats *lead, bt_snapshot *snap);

/// Collective. State of the world and counters of the run, into a world that was set up; distributes it over the ranks.
bt_status bt_running_load(bt_running *running, bt_snapshot *snap, bt_errors *err);

/// Collective, after bt_running_end, with the folder still held. A step was not sound: the state before it, made again
/// from the last checkpoint (or the one of options->from, or the start), goes to failure.h5. What has come of it goes
/// to err; options->aloud: what is in err before is printed first. start: bt_clock when the call began;
/// options->max_wall counts from it.
void bt_run_keep_failure(const bt_comm *comm, const bt_case *input, const bt_run_options *options, int64_t step,
                         double start, bt_errors *err);

// --- going on --------------------------------------------------------------------------------------------------------

typedef struct bt_resume {
    bt_snapshot s; ///< the checkpoint; empty where fresh
    bt_case c;
    char *path;    ///< of the checkpoint
    int lock;      ///< on the folder, on rank 0; the caller drops it, whatever the status was
    bool fresh;    ///< killed before its first checkpoint: begins at time zero
    bool finished; ///< all its steps are done, and its summary is written
} bt_resume;

/// Collective. What options->dir (or options->from) holds to go on from. bt_resume_end follows whatever the status is.
/// Errors: BT_ERR_IO, BT_ERR_CASE.
bt_status bt_resume_begin(bt_resume *resume, const bt_comm *comm, const bt_run_options *options, bt_errors *err);
void bt_resume_end(bt_resume *resume);

#endif
