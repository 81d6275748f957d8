// SPDX-License-Identifier: MIT
// The members of a study, assigned to groups of ranks; reasons in bergtow/ensemble.h.
#include "bergtow/ensemble.h"

#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <math.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "output/checkpoint.h"
#include "field/field_kept.h"
#include "bergtow/run.h"
#include "run/ensemble_list.h"
#include "run/halt.h"
#include "run/study.h"
#include "base/fileio.h"
#include "base/process.h"

// Wall time between two looks at ensemble.h5: 1 s or more, and so much that they take a twentieth of it.
#define GATHER_SECONDS 1.0
#define GATHER_SHARE 0.05
// Two threads do 1.5 times the work of one at 10,000 floes, 1.7 to 1.9 times from 30,000 on (cases/scaling), two
// processes twice at any size.
#define FLOES_OF_A_THREAD 15000.0

// A run has handlers of its own, which end it after a step; these are for the time between, and while it is set up.
static volatile sig_atomic_t stop_signal;
static void on_signal(int number) { stop_signal = number; }

/// A process that is killed between the end of a member and the line for it leaves that line out: here it is added. By
/// one process at a time, with the lock of the folder.
static void complete_journal(const bt_ensemble *e)
{
    // Whoever works on a member holds its lock until the line is written, so the locks are looked at first.
    bool *lacking = bt_alloc((size_t)e->n, sizeof *lacking);
    for (int64_t i = 0; i < e->n; i++) {
        const bt_entry *x = &e->list[i];
        lacking[x->index] =
            bt_ensemble_state(x->folder, NULL, NULL) == BT_MEMBER_FINISHED && !bt_member_held(x->folder);
    }
    bt_journal_strike_ended(e->o->dir, e->s->repeats, e->n, lacking);
    for (int64_t i = 0; i < e->n; i++)
        if (lacking[e->list[i].index]) bt_ensemble_journal(e, "finished", &e->list[i].m, NAN, 0);
    free(lacking);
}

// --- who does what ---------------------------------------------------------------------------------------------------

/// A member that has failed; where not even that can be recorded (a full disk) it stays open, is reported at the end,
/// and is tried again by the next call.
static void settle_failed(bt_ensemble *e, bt_entry *x, bt_status status, const bt_errors *why)
{
    bt_errors unrecorded = {0};
    x->settled = true;
    if (bt_member_record_failure(x->folder, status, why, &unrecorded) != BT_OK && e->lost++ < BT_MOST_REPORTED)
        bt_errors_add(e->err, "member %s failed (%d): %s; nor could that be recorded, so the next call tries it again",
                      x->m.name, (int)status, why->n ? why->text[0] : "no reason given");
    bt_errors_free(&unrecorded);
}

/// A suspect that is run beside another member takes that with it when it ends the program, and again at every call,
/// until both are given up. So one at a time is run, once nothing else is left to begin.
static bool may_take_suspects(bt_ensemble *e)
{
    if (e->alone >= 0) return true;
    const int fd = bt_member_open(e->o->dir, "suspects.lock", O_RDWR | O_CREAT);
    if (fd < 0) return true; // better than never
    if (bt_member_take_lock(fd, false)) e->alone = fd;
    else close(fd);
    return e->alone >= 0;
}

static void drop_member(bt_ensemble *e, const bt_entry *x)
{
    bt_lock_drop(x->folder, e->run_lock);
    if (e->lock >= 0) close(e->lock);
    e->lock = e->run_lock = -1;
}

/// Make the folder of a member and take its locks; false: somebody is at it, an ensemble or a `bergtow resume`, or it
/// has failed by that.
static bool lock_member(bt_ensemble *e, bt_entry *x)
{
    bt_errors why = {0};
    bt_status status = bt_file_make_dir(x->folder, &why);
    x->busy = false;
    e->run_lock = -1;
    e->lock = status == BT_OK ? bt_member_open(x->folder, "lock", O_RDWR | O_CREAT) : -1;
    if (status == BT_OK && e->lock < 0) status = bt_file_fail(x->folder, "make a lock in the folder", errno, &why);
    if (status == BT_OK && bt_member_take_lock(e->lock, false) &&
        (e->run_lock = bt_lock_take(x->folder, &x->busy, &why)) < 0 && !x->busy)
        status = BT_ERR_IO;
    if (status != BT_OK) {
        settle_failed(e, x, status, &why);
        bt_ensemble_journal(e, "failed", &x->m, 0, (int)status);
        bt_ensemble_say(e, x, status, 0);
    }
    bt_errors_free(&why);
    if (e->run_lock >= 0) return true;
    drop_member(e, x);
    return false;
}

/// With a limit of steps each group has members of its own: one that has paused looks like one that waits.
static bool is_for_another(const bt_ensemble *e, const bt_entry *x)
{
    return e->o->max_steps > 0 && (x->paused || x->index % e->n_groups != e->of_group);
}

enum { NONE = -1, CHANGED = -2 };

/// Take the lock of the next member that is free; NONE, or CHANGED: what it would be made with is not what others were
/// made with. On the first rank of a group.
static int64_t claim(bt_ensemble *e)
{
    if (bt_study_files_same(&e->files, e->err) != BT_OK) return CHANGED;
    for (int64_t i = 0; i < e->n; i++) {
        bt_entry *x = &e->list[i];
        bt_entry_look(x);
        if (x->settled || is_for_another(e, x) || (bt_entry_is_suspect(x) && !may_take_suspects(e))) continue;
        if (!lock_member(e, x)) continue;
        bt_entry_look(x); // it may have been finished between the look and the lock
        if (!x->settled) return i;
        drop_member(e, x);
    }
    return NONE;
}

/// Collective over the group. A member that was stopped goes on from its checkpoint; where that is refused, it starts
/// anew.
static bt_status run_or_go_on(const bt_comm *group, const bt_case *c, const bt_run_options *o, bt_errors *why)
{
    int kept = group->rank == 0 && bt_checkpoint_there(o->dir);
    bt_comm_bcast(group, &kept, sizeof kept);
    if (kept) {
        const bt_status status = bt_run_resume(group, o, why);
        if (status != BT_ERR_CASE) return status;
        bt_errors_free(why);
    }
    return bt_run(group, c, o, why);
}

/// Make ensemble.h5. One process at a time does; wait: for its turn, or leave it to the one that is at it, as well as
/// errors, which are reported at the end.
static bt_status gather(bt_ensemble *e, bool wait)
{
    bt_status status = BT_OK;
    bt_errors unheard = {0};
    const double t0 = bt_clock();
    const int fd = bt_member_open(e->o->dir, "lock", O_RDWR | O_CREAT);
    if (fd < 0 && wait) status = bt_file_fail(e->o->dir, "open the lock in the folder", errno, e->err);
    else if (fd >= 0 && bt_member_take_lock(fd, wait))
        status = bt_ensemble_gather(e->s, e->o->dir, &e->records, &e->warnings,
                                    wait ? e->err : &unheard);
    if (fd >= 0 && wait) complete_journal(e);
    if (fd >= 0) close(fd);
    bt_errors_free(&unheard);
    e->gathered = bt_clock();
    e->gathering = e->gathered - t0;
    return status;
}

static bt_status run_member(bt_ensemble *e, bt_entry *x)
{
    const bool first = e->group->rank == 0;
    const double t0 = bt_clock();
    bt_errors why = {0};
    bt_status status = BT_OK;
    int64_t n_steps = 0;
    if (first && x->attempts >= BT_MAX_ATTEMPTS) {
        bt_errors_add(&why, "%s: its process died in each of %d attempts; run the case alone to see why", x->m.name,
                      x->attempts);
        status = BT_ERR_NUMERIC;
    }
    if (first) {
        if (x->attempts == 0) bt_member_forget_attempts(x->folder);
        if (x->attempts < BT_MAX_ATTEMPTS) bt_member_note_attempt(x->folder);
        if (x->attempts > 0) gather(e, false); // its process may die again, and the file should say so
        bt_ensemble_journal(e, "start", &x->m, 0, 0);
    }
    status = bt_comm_agree(e->group, status);
    if (status == BT_OK) {
        bt_case c;
        status = bt_member_case(e->s, &x->m, &c, &why);
        status = bt_comm_agree(e->group, status);
        if (status == BT_OK) n_steps = bt_case_steps(&c);
        const bt_run_options o = {.dir = x->folder,
                                  .threads = e->threads,
                                  .quiet = true,
                                  .dump_step = -1,
                                  .max_steps = e->o->max_steps,
                                  .max_wall = e->o->max_wall > 0 ? bt_max(1e-3, bt_ensemble_wall_left(e)) : 0,
                                  .stop_signal = &stop_signal,
                                  .command_line = e->o->command_line,
                                  .held = true,
                                  .fields = x->shares ? e->fields : NULL};
        if (status == BT_OK) status = run_or_go_on(e->group, &c, &o, &why);
        bt_case_free(&c);
    }
    bt_comm_errors(e->group, &why);
    if (first) {
        const double wall = bt_clock() - t0;
        bt_member_forget_attempts(x->folder);
        x->paused = status == BT_OK && e->o->max_steps > 0 && !bt_member_is_whole(x->folder, n_steps);
        if (status == BT_OK && !x->paused) {
            status = bt_member_record_write(&e->records, x->index, x->m.name, x->folder, &why);
            if (status == BT_OK) bt_checkpoint_remove(x->folder);
        }
        if (status != BT_OK && status != BT_ERR_SIGNAL) settle_failed(e, x, status, &why);
        bt_ensemble_journal(e,
                x->paused                 ? "stopped"
                : status == BT_OK         ? "finished"
                : status == BT_ERR_SIGNAL ? "stopped"
                                          : "failed",
                &x->m, wall, (int)status);
        if (status != BT_ERR_SIGNAL && !x->paused) bt_ensemble_say(e, x, status, wall);
    }
    bt_errors_free(&why);
    return status;
}

static bt_status work(bt_ensemble *e)
{
    for (;;) {
        const bool stop = bt_comm_any(e->group, stop_signal != 0 || bt_ensemble_wall_left(e) <= 0);
        if (stop) return BT_ERR_SIGNAL;
        int64_t i = e->group->rank == 0 ? claim(e) : 0;
        bt_comm_bcast(e->group, &i, sizeof i);
        if (i == CHANGED) return BT_ERR_CASE;
        if (i == NONE) return e->lost > 0 ? BT_ERR_IO : BT_OK;
        const bt_status status = run_member(e, &e->list[i]);
        if (e->group->rank == 0) {
            drop_member(e, &e->list[i]);
            if (status != BT_ERR_SIGNAL &&
                bt_clock() - e->gathered > e->n_groups * bt_max(GATHER_SECONDS, e->gathering / GATHER_SHARE))
                gather(e, false);
        }
        if (status == BT_ERR_SIGNAL) return status;
    }
}

/// Failed members that are to be tried again.
static void forget_failures(const bt_ensemble *e)
{
    for (int64_t i = 0; i < e->n; i++) {
        bt_member_forget_failure(e->list[i].folder);
        e->list[i].settled = false;
    }
}

/// Collective. Nothing is left to begin: wait a moment if other processes are at work on members, which may finish or
/// die. reported: that has been said.
static bool wait_for_others(bt_ensemble *e, bool reported)
{
    int64_t n = 0;
    for (int64_t i = 0; e->world->rank == 0 && i < e->n; i++) {
        bt_entry_look(&e->list[i]);
        n += !e->list[i].settled;
    }
    bt_comm_bcast(e->world, &n, sizeof n);
    if (n == 0) return false;
    if (!reported && !e->o->quiet && e->jobs == 1 && e->world->rank == 0) {
        printf("waiting for %" PRId64 " members that other processes are at work on (--no-wait does not)\n", n);
        fflush(stdout);
    }
    nanosleep(&(struct timespec){.tv_nsec = 500000000}, NULL);
    return true;
}

/// Collective. As for a run of the base case. *open: nobody has asked for a number.
static bt_status choose_threads(const bt_comm *comm, const bt_study *s, const bt_ensemble_options *o, int *threads,
                                bool *open, bt_errors *err)
{
    bt_case c;
    const bt_status status = bt_comm_agree(comm, bt_study_base_case(s, &c, err));
    if (status == BT_OK) {
        *threads = bt_run_threads(comm, &c, o->threads);
        *open = o->threads == 0 && c.run.threads == 0 && !getenv("OMP_NUM_THREADS");
    }
    bt_case_free(&c);
    return status;
}

/// Members have as many threads as their floes keep busy, and the other cores go to other members. open: the number of
/// threads is.
static void share_cores(bt_ensemble *e, bool open)
{
    const bt_ensemble_options *o = e->o;
    e->jobs = 1;
    if (!o->helpers || o->job || o->max_steps > 0 || bt_launcher_find().found) return;
    const double busy = bt_max(1, ceil(e->most_floes / FLOES_OF_A_THREAD));
    const double left = bt_max(1, (double)(e->n - e->before)),
                 most = o->jobs ? o->jobs : open ? floor(e->threads / busy) : 1;
    e->jobs = (int)bt_max(1, bt_min(most, left));
    if (open) e->threads = bt_max(1, e->threads / e->jobs);
}

static bt_status check_ice(const bt_study *s, bt_errors *err)
{
    const size_t before = err->n;
    bt_study_check_ice(s, err);
    return err->n == before ? BT_OK : BT_ERR_CASE;
}

static void warn_fixed(const bt_ensemble *e)
{
    if (e->fixed == 0 || e->s->repeats == 1) return;
    bt_errors warnings = {0};
    bt_errors_add(&warnings,
                  "warning: in %" PRId64 " of %" PRId64 " conditions the ice does not depend on the seed, as it is "
                  "read from a file, or there is none: the fields of each are one run",
                  e->fixed, e->s->n_conditions);
    bt_errors_print(&warnings);
    bt_errors_free(&warnings);
}

bt_status bt_ensemble_run(const bt_comm *comm, const bt_study *s, const bt_ensemble_options *o, bt_errors *err)
{
    bt_status status = bt_study_fits(s, comm->size, err);
    bt_member_records records;
    char digest[BT_DIGEST_TEXT] = "";
    int threads = 1;
    bool open = false;
    if (status == BT_OK) status = choose_threads(comm, s, o, &threads, &open, err);
    if (status == BT_OK && comm->rank == 0) status = check_ice(s, err);
    if (status == BT_OK && comm->rank == 0) status = bt_ensemble_prepare_folder(s, o, digest, err);
    status = bt_comm_agree(comm, status);
    if (status != BT_OK) return status;
    bt_comm_bcast(comm, digest, sizeof digest);
    bt_member_records_begin(&records, s, digest);

    bt_comm group;
    bt_comm_split(comm, comm->rank / (int)s->ranks, &group);
    const bool idle = comm->rank / (int)s->ranks >= comm->size / (int)s->ranks; // ranks that make no whole group
    bt_ensemble e = {.world = comm,
                  .group = &group,
                  .s = s,
                  .o = o,
                  .began = bt_clock(),
                  .gathered = bt_clock(),
                  .err = err,
                  .n_groups = comm->size / (int)s->ranks,
                  .of_group = comm->rank / (int)s->ranks,
                  .alone = -1};
    e.threads = threads;
    e.records = records;
    if (group.rank == 0) bt_study_files_find(&e.files, s);
    bt_ensemble_list(&e);
    if (o->retry && comm->rank == 0) forget_failures(&e);
    if (o->retry) bt_comm_rest(comm);
    if (o->retry)
        for (int64_t i = 0; i < e.n; i++)
            e.list[i].settled = bt_ensemble_state(e.list[i].folder, NULL, NULL) != BT_MEMBER_WAITING;
    bt_ensemble_count_settled(&e);
    share_cores(&e, open);
    if (comm->rank == 0 && !o->quiet && !o->job) {
        printf("%" PRId64 " members: %" PRId64 " conditions x %" PRId64 " fields, %" PRId64
               " settled before; %d at a time, %" PRId64 " ranks x %d threads each\n",
               e.n, s->n_conditions, s->repeats, e.before, e.n_groups * e.jobs, s->ranks, e.threads);
        fflush(stdout);
    }
    if (comm->rank == 0 && !o->job) warn_fixed(&e);
    if (comm->rank == 0) gather(&e, false); // after a kill the file may be behind
    struct sigaction before[BT_N_CAUGHT];
    stop_signal = 0;
    bt_halt_catch(on_signal, NULL, before);
    const bool helped = e.jobs > 1;
    if (helped) o->helpers->start(o->helpers->of, e.jobs - 1, e.threads);
    bool others = false;
    do {
        if (!idle) status = work(&e);
        bt_comm_rest(comm);
        status = bt_comm_agree(comm, status);
        others = status == BT_OK && !o->leave && o->max_steps == 0 && wait_for_others(&e, others);
    } while (others);
    if (helped) o->helpers->end(o->helpers->of, status == BT_ERR_SIGNAL);
    bt_halt_let_go(before);
    if (e.alone >= 0) close(e.alone);
    bt_ensemble_share_records(&e);
    if (comm->rank == 0) {
        const bt_status gathered = gather(&e, true);
        if (!o->job) status = bt_ensemble_tell_end(&e, status, err);
        if (!o->job && status == BT_OK) bt_field_forget_kept(e.fields);
        if (status == BT_OK) status = gathered;
    }
    bt_comm_split_end(&group);
    for (int64_t i = 0; i < e.n; i++) {
        bt_member_free(&e.list[i].m);
        free(e.list[i].folder);
    }
    free(e.list);
    free(e.fields);
    bt_study_files_free(&e.files);
    bt_member_records_end(&e.records);
    bt_member_notes_free(&e.warnings);
    return bt_comm_agree(comm, status);
}
