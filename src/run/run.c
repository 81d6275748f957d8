// SPDX-License-Identifier: MIT
// A run as the commands make it: all its steps, what is kept of it when it fails, and going on from a checkpoint.
#include "bergtow/run.h"

#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

#include "bergtow/checkpoint.h"
#include "base/fileio.h"
#include "output/folder.h"
#include "base/lock.h"
#include "revision.h"
#include "run/run_parts.h"

/// Collective. *failed: the step that was not sound, −1 = none.
static bt_status run_case(const bt_comm *comm, const bt_case *c, const bt_run_options *o, bt_run_manner *m,
                          int64_t *failed, bt_errors *err)
{
    bt_running r;
    bt_status status = bt_running_begin(&r, comm, c, o, m, err);
    while (status == BT_OK && bt_running_goes_on(&r)) status = bt_running_step(&r, err);
    status = bt_running_end(&r, status, err);
    *failed = r.failed;
    return status;
}

/// Collective. A step was not sound: the state before it, made again from the last checkpoint (or the one of o->from,
/// or the start), goes to failure.h5.
static void keep_failure(const bt_comm *comm, const bt_case *c, const bt_run_options *o, int64_t step, bt_errors *err)
{
    bt_run_options quiet = *o;
    quiet.quiet = true;
    quiet.dump_step = -1;
    bt_snapshot s = {0};
    char *path = NULL, *said = NULL;
    bt_errors unheard = {0};
    int from = 0;
    if (comm->rank == 0 && o->from) from = bt_snapshot_read(&s, o->from, &unheard) == BT_OK;
    else if (comm->rank == 0 && bt_checkpoint_there(o->dir))
        from = bt_checkpoint_read(&s, o->dir, &path, &said, &unheard) == BT_OK;
    bt_comm_bcast(comm, &from, sizeof from);
    if (from) bt_snapshot_share(comm, &s);
    s.err = &unheard;
    bt_run_manner m = {.kept = from ? &s : NULL, .start = bt_clock(), .until = step - 1, .held = true};
    int64_t failed;
    const bt_status status = run_case(comm, c, &quiet, &m, &failed, &unheard);
    if (status == BT_OK)
        bt_errors_add(err, "%s/%s holds the state before that step; `bergtow resume %s/%s` meets it again", o->dir,
                      BT_FAILURE_FILE, o->dir, BT_FAILURE_FILE);
    else if (status == BT_ERR_SIGNAL)
        bt_errors_add(err, "the state before that step was not made again: stopped meanwhile");
    else
        for (size_t k = 0; k < unheard.n; k++)
            bt_errors_add(err, "the state before that step could not be kept: %s", unheard.text[k]);
    bt_errors_free(&unheard);
    bt_snapshot_free(&s);
    free(path);
    free(said);
}

/// Collective. A run, and what is kept of it when it fails. held: the caller has locked the folder.
static bt_status run_guarded(const bt_comm *comm, const bt_case *c, const bt_run_options *o, bt_snapshot *kept,
                             bool held, double start, bt_errors *err)
{
    bt_run_manner m = {.kept = kept, .start = start, .until = -1, .held = held, .lock = -1};
    int64_t failed;
    const bt_status status = run_case(comm, c, o, &m, &failed, err);
    if (failed >= 0) keep_failure(comm, c, o, failed, err);
    if (status != BT_OK && m.lock >= 0 && bt_folder_keeps(o->dir))
        bt_errors_add(err, "what %s held before is in %s/%s until a new result stands", o->dir, o->dir,
                      BT_FOLDER_REPLACED);
    bt_lock_drop(o->dir, m.lock);
    return status;
}

bt_status bt_run(const bt_comm *comm, const bt_case *c, const bt_run_options *o, bt_errors *err)
{
    if (comm->size > 1 && o->dump_step >= 0) {
        bt_errors_add(err,
                      "--dump-contacts: the contacts of %d ranks lie apart; start bergtow without mpirun for this (the "
                      "step is the same)",
                      comm->size);
        return BT_ERR_USAGE;
    }
    return run_guarded(comm, c, o, NULL, false, bt_clock(), err);
}

// --- going on --------------------------------------------------------------------------------------------------------

/// Collective. A run that was killed before its first checkpoint: from its case, at time zero.
static bt_status start_again(const bt_comm *comm, const bt_run_options *o, double start, bt_errors *err)
{
    char *path = bt_file_join(o->dir, "case.resolved.yml");
    bt_case c;
    bt_status status = bt_comm_agree(comm, bt_case_read(&c, path, NULL, 0, err));
    if (status == BT_OK && comm->rank == 0 && !o->quiet)
        printf("%s holds no checkpoint: the run starts at time zero\n", o->dir);
    if (status == BT_OK) status = run_guarded(comm, &c, o, NULL, true, start, err);
    bt_case_free(&c);
    free(path);
    return status;
}

/// What the user should know of the checkpoint that is taken.
static void tell(const bt_snapshot *s, const char *said)
{
    bt_errors warnings = {0};
    if (said) bt_errors_add(&warnings, "warning: %s", said);
    const bt_item *i = bt_snapshot_find(s, "about/revision");
    if (i && i->type == BT_ITEM_TEXT && strcmp(i->data, BT_REVISION))
        bt_errors_add(&warnings,
                      "warning: %s was written by revision %s of the program, and this is %s: the run may go on "
                      "otherwise than it would have",
                      s->path, (const char *)i->data, BT_REVISION);
    bt_errors_print(&warnings);
    bt_errors_free(&warnings);
}

static bt_status go_on(const bt_comm *comm, bt_snapshot *s, const bt_run_options *o, double start, bt_errors *err)
{
    bt_case c;
    bt_status status = bt_comm_agree(comm, bt_running_load_case(&c, s, err));
    const int64_t step = bt_snapshot_int(s, "world/step");
    // without its summary it was stopped between its last checkpoint and that: no step is left, but the end is
    int ended = comm->rank == 0 && bt_file_there(o->dir, "summary.json");
    bt_comm_bcast(comm, &ended, sizeof ended);
    const bool finished = status == BT_OK && ended && step >= bt_case_steps(&c);
    if (finished && comm->rank == 0 && !o->quiet)
        printf("%s is finished: all %" PRId64 " steps are done\n", o->dir, step);
    if (status == BT_OK && !finished) status = run_guarded(comm, &c, o, s, true, start, err);
    bt_case_free(&c);
    return status;
}

bt_status bt_run_resume(const bt_comm *comm, const bt_run_options *o, bt_errors *err)
{
    const double start = bt_clock();
    bt_snapshot s = {.path = o->dir};
    char *path = NULL, *said = NULL;
    bt_status status = BT_OK;
    int lock = -1, fresh = 0;
    if (comm->rank == 0) {
        if (!bt_file_there(o->dir, ".")) {
            bt_errors_add(err, "%s: there is no such folder; give the result folder of a run", o->dir);
            status = BT_ERR_IO;
        } else if ((lock = bt_lock_take(o->dir, err)) < 0) {
            status = BT_ERR_IO;
        } else {
            bt_folder_recover(o->dir);
            fresh = !o->from && !bt_checkpoint_there(o->dir) && bt_file_there(o->dir, "case.resolved.yml") &&
                    !bt_file_there(o->dir, "summary.json");
        }
        if (status == BT_OK && fresh) status = bt_folder_check(o->dir, err);
        else if (status == BT_OK) {
            status = o->from ? bt_snapshot_read(&s, o->from, err) : bt_checkpoint_read(&s, o->dir, &path, &said, err);
            if (status == BT_OK) tell(&s, said);
        }
    }
    status = bt_comm_agree(comm, status);
    bt_comm_bcast(comm, &fresh, sizeof fresh);
    if (status == BT_OK && fresh) status = start_again(comm, o, start, err);
    else if (status == BT_OK) {
        bt_snapshot_share(comm, &s);
        s.err = err;
        status = go_on(comm, &s, o, start, err);
    }
    bt_snapshot_free(&s);
    bt_lock_drop(o->dir, lock);
    free(path);
    free(said);
    return status;
}
