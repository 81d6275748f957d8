// SPDX-License-Identifier: MIT
// What a result folder holds to go on from: its last checkpoint, one that is named, or the case of a run that was
// killed before its first.
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/fileio.h"
#include "case/case_files.h"
#include "output/checkpoint.h"
#include "output/folder.h"
#include "revision.h"
#include "run/run_parts.h"

/// What the user should know of the checkpoint that is taken.
static void report(const bt_snapshot *s, const char *said)
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

/// Rank 0. The folder is ours, and what it holds is read; but for the case.
static bt_status open_folder(bt_resume *k, const bt_run_options *o, bt_errors *err)
{
    if (!bt_file_there(o->dir, ".")) {
        bt_errors_add(err, "%s: there is no such folder; give the result folder of a run", o->dir);
        return BT_ERR_IO;
    }
    if (!o->held && (k->lock = bt_lock_take(o->dir, NULL, err)) < 0) return BT_ERR_IO;
    bt_folder_recover(o->dir);
    k->fresh = !o->from && !bt_checkpoint_there(o->dir) && bt_file_there(o->dir, "case.resolved.yml") &&
               !bt_file_there(o->dir, "summary.json");
    if (k->fresh) return bt_folder_check(o->dir, err);
    char *said = NULL;
    const bt_status status =
        o->from ? bt_snapshot_read(&k->s, o->from, err) : bt_checkpoint_read(&k->s, o->dir, &k->path, &said, err);
    if (status == BT_OK) report(&k->s, said);
    free(said);
    return status;
}

/// Rank 0. Before the case is read: what is wrong in one that was edited is of no concern.
static bt_status check_itself(const char *path, const char *dir, bt_errors *err)
{
    char *text = NULL;
    size_t size = 0;
    bt_status status = bt_file_read(path, "a case", &text, &size, err);
    if (status == BT_OK) status = bt_case_itself_same(path, text, dir, err);
    free(text);
    return status;
}

/// Collective. The case that the run began with, at time zero, and the files that it names.
static bt_status start_again(bt_resume *k, const bt_comm *comm, const bt_run_options *o, bt_errors *err)
{
    char *path = bt_file_join(o->dir, "case.resolved.yml");
    bt_status status = bt_comm_agree(comm, comm->rank == 0 ? check_itself(path, o->dir, err) : BT_OK);
    if (status == BT_OK) status = bt_comm_agree(comm, bt_case_read(&k->c, path, NULL, 0, err));
    if (status == BT_OK && comm->rank == 0) status = bt_case_files_same(&k->c, o->dir, err);
    status = bt_comm_agree(comm, status);
    if (status == BT_OK && comm->rank == 0 && !o->quiet)
        printf("%s holds no checkpoint: the run starts at time zero\n", o->dir);
    free(path);
    return status;
}

/// Collective. The case of the checkpoint, and whether any step of it is left.
static bt_status go_on(bt_resume *k, const bt_comm *comm, const bt_run_options *o, bt_errors *err)
{
    bt_snapshot_share(comm, &k->s);
    k->s.err = err;
    const bt_status status = bt_comm_agree(comm, bt_running_load_case(&k->c, &k->s, err));
    // without its summary it was stopped between its last checkpoint and that: no step is left, but the end is
    int ended = comm->rank == 0 && bt_file_there(o->dir, "summary.json");
    bt_comm_bcast(comm, &ended, sizeof ended);
    k->finished = status == BT_OK && ended && bt_snapshot_int(&k->s, "world/step") >= bt_case_steps(&k->c);
    return status;
}

bt_status bt_resume_begin(bt_resume *k, const bt_comm *comm, const bt_run_options *o, bt_errors *err)
{
    *k = (bt_resume){.s = {.path = o->dir}, .lock = -1};
    bt_status status = comm->rank == 0 ? open_folder(k, o, err) : BT_OK;
    status = bt_comm_agree(comm, status);
    bt_comm_bcast(comm, &k->fresh, sizeof k->fresh);
    if (status != BT_OK) return status;
    return k->fresh ? start_again(k, comm, o, err) : go_on(k, comm, o, err);
}

void bt_resume_end(bt_resume *k)
{
    bt_snapshot_free(&k->s);
    bt_case_free(&k->c);
    free(k->path);
}
