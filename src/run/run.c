// SPDX-License-Identifier: MIT
// A whole run, as the commands do it: all steps, from the start or from a checkpoint, and the state kept if it fails.
#include "bergtow/run.h"

#include <inttypes.h>
#include <string.h>

#include "base/checksum.h"
#include "base/fileio.h"
#include "base/inside.h"
#include "base/process.h"
#include "case/case_files.h"
#include "output/checkpoint.h"
#include "output/folder.h"
#include "revision.h"
#include "run/ensemble_record.h"
#include "run/run_parts.h"

// --- contents of a folder --------------------------------------------------------------------------------------------

/// Warn the user about the checkpoint in use.
static void report(const bt_snapshot *snap, const char *said)
{
    if (said) bt_errors_warn("warning: %s", said);
    const bt_item *item = bt_snapshot_find(snap, "about/revision");
    if (item && item->type == BT_ITEM_TEXT && strcmp(item->data, BT_REVISION))
        bt_errors_warn("warning: %s was written by revision %s of the program, and this is %s: the run may continue "
                       "differently",
                       snap->path, (const char *)item->data, BT_REVISION);
}

/// Rank 0. Lock the folder and read its contents, except for the case.
static bt_status open_folder(bt_resume *resume, const bt_run_options *options, bt_errors *err)
{
    if (!bt_file_there(options->dir, "."))
        return bt_fail(err, BT_ERR_IO, "%s: there is no such folder; give the result folder of a run", options->dir);
    if (!options->held && (resume->lock = bt_lock_take(options->dir, NULL, err)) < 0) return BT_ERR_IO;
    bt_folder_recover(options->dir);
    resume->fresh = !options->from && !bt_checkpoint_there(options->dir) &&
                    bt_file_there(options->dir, "case.resolved.yml") && !bt_file_there(options->dir, "summary.json");
    if (resume->fresh) return bt_folder_check(options->dir, err);
    char *said = NULL;
    const bt_status status =
        options->from ? bt_snapshot_read(&resume->s, options->from, err)
                      : bt_checkpoint_read(&resume->s, options->dir, &resume->path, &said, err);
    if (status == BT_OK) report(&resume->s, said);
    free(said);
    return status;
}

/// Rank 0. Before the case is read, check that it was not edited: errors in an edited case are irrelevant.
static bt_status check_itself(const char *path, const char *dir, bt_errors *err)
{
    char *text = NULL;
    size_t size = 0;
    bt_status status = bt_file_read(path, "a case", &text, &size, err);
    if (status == BT_OK) status = bt_case_itself_same(path, text, dir, err);
    free(text);
    return status;
}

/// Collective. Read the case with which the run began, at time zero, and check the files that it names.
static bt_status start_again(bt_resume *resume, const bt_comm *comm, const bt_run_options *options, bt_errors *err)
{
    const char *path = BT_PATH(options->dir, "case.resolved.yml");
    bt_status status = bt_comm_agree(comm, comm->rank == 0 ? check_itself(path, options->dir, err) : BT_OK);
    if (status == BT_OK) status = bt_comm_agree(comm, bt_case_read(&resume->c, path, NULL, 0, err));
    if (status == BT_OK && comm->rank == 0) status = bt_case_files_same(&resume->c, options->dir, err);
    status = bt_comm_agree(comm, status);
    char *given = status == BT_OK ? bt_case_given_in(resume->c.text) : NULL;
    if (given) { // the result shows the case as given
        free(resume->c.text);
        resume->c.text = given;
    }
    if (status == BT_OK && comm->rank == 0 && !options->quiet)
        printf("%s holds no checkpoint: the run starts at time zero\n", options->dir);
    return status;
}

/// Collective. Read the case of the checkpoint, and find whether any of its steps are left.
static bt_status continue_run(bt_resume *resume, const bt_comm *comm, const bt_run_options *options, bt_errors *err)
{
    bt_snapshot_share(comm, &resume->s);
    resume->s.err = err;
    const bt_status status = bt_comm_agree(comm, bt_running_load_case(&resume->c, &resume->s, err));
    if (status != BT_OK) return status;
    // without a sound summary and result no steps are left, but the end of the run is
    const int64_t steps = bt_case_steps(&resume->c);
    int ended = bt_snapshot_int(&resume->s, "world/step") >= steps && comm->rank == 0 &&
                bt_member_is_whole(options->dir, steps) &&
                bt_checksum_check(BT_PATH(options->dir, "result.h5"), BT_CHECKSUM_RESULT, NULL, NULL) == BT_OK;
    bt_comm_bcast(comm, &ended, sizeof ended);
    resume->finished = ended;
    return BT_OK;
}

bt_status bt_resume_begin(bt_resume *resume, const bt_comm *comm, const bt_run_options *options, bt_errors *err)
{
    *resume = (bt_resume){.s = {.path = options->dir}, .lock = -1};
    bt_status status = comm->rank == 0 ? open_folder(resume, options, err) : BT_OK;
    status = bt_comm_agree(comm, status);
    bt_comm_bcast(comm, &resume->fresh, sizeof resume->fresh);
    if (status != BT_OK) return status;
    return resume->fresh ? start_again(resume, comm, options, err) : continue_run(resume, comm, options, err);
}

void bt_resume_end(bt_resume *resume)
{
    bt_snapshot_free(&resume->s);
    bt_case_free(&resume->c);
    free(resume->path);
}

// --- a run -----------------------------------------------------------------------------------------------------------

/// Collective. Do a run. *failed: the step that was not sound, −1 = none.
static bt_status run_case(const bt_comm *comm, const bt_case *input, const bt_run_options *options,
                          bt_run_start *begin, int64_t *failed, bt_errors *err)
{
    bt_memory_forget_peak(); // of the run before, in an ensemble
    bt_running running;
    bt_status status = bt_running_begin(&running, comm, input, options, begin, err);
    while (status == BT_OK && bt_running_has_next(&running)) status = bt_running_step(&running, err);
    status = bt_running_close(&running, status, err);
    *failed = running.failed;
    return status;
}

/// Collective. Print messages now, in case the call is ended early, by a limit of its job or by hand.
static void tell(const bt_comm *comm, const bt_run_options *options, bt_errors *err)
{
    if (!options->aloud) return;
    bt_comm_errors(comm, err);
    bt_errors_print(err);
    bt_errors_free(err);
}

void bt_run_keep_failure(const bt_comm *comm, const bt_case *input, const bt_run_options *options, int64_t step,
                         double start, bt_errors *err)
{
    tell(comm, options, err);
    bt_run_options quiet = *options;
    quiet.quiet = true;
    quiet.dump_step = -1;
    bt_snapshot snap = {0};
    char *path = NULL, *said = NULL;
    bt_errors unheard = {0};
    int from = 0;
    if (comm->rank == 0 && options->from) from = bt_snapshot_read(&snap, options->from, &unheard) == BT_OK;
    else if (comm->rank == 0 && bt_checkpoint_there(options->dir))
        from = bt_checkpoint_read(&snap, options->dir, &path, &said, &unheard) == BT_OK;
    bt_comm_bcast(comm, &from, sizeof from);
    if (from) bt_snapshot_share(comm, &snap);
    snap.err = &unheard;
    const int64_t again = step - 1 - (from ? bt_snapshot_int(&snap, "world/step") : 0);
    if (again > 0 && options->aloud)
        bt_errors_add(err, "the %" PRId64 " steps up to the state before that one are computed again", again);
    tell(comm, options, err);
    bt_run_start begin = {.kept = from ? &snap : NULL, .start = start, .until = step - 1, .held = true};
    int64_t failed;
    const bt_status status = run_case(comm, input, &quiet, &begin, &failed, &unheard);
    if (status == BT_OK)
        bt_errors_add(err, "%s/%s holds the state before that step; `bergtow resume %s/%s` reaches it again",
                      options->dir, BT_FAILURE_FILE, options->dir, BT_FAILURE_FILE);
    else if (status == BT_ERR_SIGNAL)
        bt_errors_add(err,
                      "the state before that step was not computed again: stopped meanwhile; `bergtow resume %s` "
                      "reaches it",
                      options->dir);
    else
        for (size_t k = 0; k < unheard.n; k++)
            bt_errors_add(err, "the state before that step could not be kept: %s", unheard.text[k]);
    bt_errors_free(&unheard);
    bt_snapshot_free(&snap);
    free(path);
    free(said);
}

/// Collective. A run, and the state kept if it fails. held: the caller has locked the folder.
static bt_status run_guarded(const bt_comm *comm, const bt_case *input, const bt_run_options *options,
                             bt_snapshot *kept, bool held, double start, bt_errors *err)
{
    bt_run_start begin = {.kept = kept, .start = start, .until = -1, .held = held, .lock = -1};
    int64_t failed;
    const bt_status status = run_case(comm, input, options, &begin, &failed, err);
    if (failed >= 0) bt_run_keep_failure(comm, input, options, failed, start, err);
    const bool taken = begin.lock >= 0 || (options->held && comm->rank == 0);
    if (status != BT_OK && taken && bt_folder_keeps(options->dir))
        bt_errors_add(err, "the previous contents of %s are in %s/%s until a new result is complete", options->dir,
                      options->dir, BT_FOLDER_REPLACED);
    bt_lock_drop(options->dir, begin.lock);
    return status;
}

bt_status bt_run(const bt_comm *comm, const bt_case *input, const bt_run_options *options, bt_errors *err)
{
    BT_PLAIN_NUMBERS;
    if (comm->size > 1 && options->dump_step >= 0)
        return bt_fail(err, BT_ERR_USAGE,
            "--dump-contacts: the contacts of %d ranks lie apart; start bergtow without mpirun for this (the "
            "step is the same)",
            comm->size);
    return run_guarded(comm, input, options, NULL, false, bt_clock(), err);
}

bt_status bt_run_resume(const bt_comm *comm, const bt_run_options *options, bt_errors *err)
{
    BT_PLAIN_NUMBERS;
    const double start = bt_clock();
    bt_resume resume;
    bt_status status = bt_resume_begin(&resume, comm, options, err);
    if (status == BT_OK && resume.finished && comm->rank == 0 && !options->quiet)
        printf("%s is finished: all %" PRId64 " steps are done\n", options->dir, bt_case_steps(&resume.c));
    if (status == BT_OK && !resume.finished)
        status = run_guarded(comm, &resume.c, options, resume.fresh ? NULL : &resume.s, true, start, err);
    bt_resume_end(&resume);
    bt_lock_drop(options->dir, resume.lock);
    return status;
}
