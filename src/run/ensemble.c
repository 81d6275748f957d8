// SPDX-License-Identifier: MIT
// The members of a study, assigned to groups of ranks; reasons in bergtow/ensemble.h.
#include "bergtow/ensemble.h"

#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <signal.h>
#include <time.h>
#include <unistd.h>

#include "base/inside.h"
#include "output/checkpoint.h"
#include "field/field_kept.h"
#include "bergtow/run.h"
#include "run/ensemble_list.h"
#include "run/halt.h"
#include "run/run_parts.h"
#include "run/study.h"
#include "base/fileio.h"
#include "base/process.h"

// Least wall time between updates of ensemble.h5, s, and the largest share of wall time that they may take.
#define GATHER_SECONDS 1.0
#define GATHER_SHARE 0.05
// Two threads do 1.5 times the work of one at 10,000 floes, 1.7 to 1.9 times from 30,000 on (cases/scaling), two
// processes twice at any size.
#define FLOES_OF_A_THREAD 15000.0

// A run has its own handlers, which end it after a step; these are for the time between runs and during set-up.
static volatile sig_atomic_t stop_signal;
static void on_signal(int number) { stop_signal = number; }

/// Add the journal lines that are missing because a process was killed between the end of a member and its line. By one
/// process at a time, with the lock of the folder.
static void complete_journal(const bt_ensemble *ensemble)
{
    // A process that works on a member holds its lock until the line is written, so test the locks first.
    bool *lacking = bt_alloc((size_t)ensemble->n, sizeof *lacking);
    for (int64_t i = 0; i < ensemble->n; i++) {
        const bt_entry *entry = &ensemble->list[i];
        lacking[entry->index] =
            bt_ensemble_state(entry->folder, NULL, NULL, NULL) == BT_MEMBER_FINISHED && !bt_member_held(entry->folder);
    }
    bt_journal_strike_ended(ensemble->o->dir, ensemble->s->repeats, ensemble->n, lacking);
    for (int64_t i = 0; i < ensemble->n; i++)
        if (lacking[ensemble->list[i].index])
            bt_ensemble_journal(ensemble, BT_EVENT_FINISHED, &ensemble->list[i].m, NAN, 0);
    free(lacking);
}

// --- assignment of members -------------------------------------------------------------------------------------------

/// Settle a member that has failed; if not even that can be recorded (a full disk), it stays open, is reported at the
/// end, and the next call tries it again.
static void settle_failed(bt_ensemble *ensemble, bt_entry *entry, bt_status status, const bt_errors *why)
{
    entry->settled = true;
    if (bt_member_record_failure(entry->folder, status, why, NULL) != BT_OK &&
        ensemble->lost++ < BT_MAX_REPORTED)
        bt_errors_add(ensemble->err,
                      "member %s failed (%d): %s; this could not be recorded, so the next call tries it again",
                      entry->m.name, (int)status, why->n ? why->text[0] : "no reason given");
}

/// May this group run suspects: members whose process has died before? A suspect that ends the program would also end
/// another member run beside it, at every call, until both are given up. So suspects are run one at a time, when
/// nothing else is left to begin.
static bool may_take_suspects(bt_ensemble *ensemble)
{
    if (ensemble->alone >= 0) return true;
    const int fd = bt_file_descriptor(BT_PATH(ensemble->o->dir, "suspects.lock"), O_RDWR | O_CREAT);
    if (fd < 0) return true; // better unprotected than never
    if (bt_member_take_lock(fd, false)) ensemble->alone = fd;
    else close(fd);
    return ensemble->alone >= 0;
}

static void drop_member(bt_ensemble *ensemble, const bt_entry *entry)
{
    bt_lock_drop(entry->folder, ensemble->run_lock);
    if (ensemble->lock >= 0) close(ensemble->lock);
    ensemble->lock = ensemble->run_lock = -1;
}

/// Make the folder of a member and take its locks; false if another process works on it, an ensemble or `bergtow
/// resume`, or if this failed, which settles the member.
static bool lock_member(bt_ensemble *ensemble, bt_entry *entry)
{
    bt_errors why = {0};
    bt_status status = bt_file_make_dir(entry->folder, &why);
    entry->busy = false;
    ensemble->run_lock = -1;
    ensemble->lock = status == BT_OK ? bt_file_descriptor(BT_PATH(entry->folder, "lock"), O_RDWR | O_CREAT) : -1;
    if (status == BT_OK && ensemble->lock < 0)
        status = bt_file_fail(entry->folder, "make a lock in the folder", errno, &why);
    if (status == BT_OK && bt_member_take_lock(ensemble->lock, false) &&
        (ensemble->run_lock = bt_lock_take(entry->folder, &entry->busy, &why)) < 0 && !entry->busy)
        status = BT_ERR_IO;
    if (status != BT_OK) {
        settle_failed(ensemble, entry, status, &why);
        bt_ensemble_journal(ensemble, BT_EVENT_FAILED, &entry->m, 0, (int)status);
        bt_ensemble_say(ensemble, entry, status, 0);
    }
    bt_errors_free(&why);
    if (ensemble->run_lock >= 0) return true;
    drop_member(ensemble, entry);
    return false;
}

/// Does the member belong to another group? With a limit of steps members are divided among groups, because a paused
/// member looks like a waiting one.
static bool is_for_another(const bt_ensemble *ensemble, const bt_entry *entry)
{
    return ensemble->o->max_steps > 0 && (entry->paused || entry->index % ensemble->n_groups != ensemble->of_group);
}

enum { NONE = -1, CHANGED = -2 };

/// Take the lock of the next free member; NONE if there is none, CHANGED if the files that the study names have
/// changed. On the first rank of a group.
static int64_t claim(bt_ensemble *ensemble)
{
    if (bt_study_files_same(&ensemble->files, ensemble->err) != BT_OK) return CHANGED;
    for (int64_t i = 0; i < ensemble->n; i++) {
        bt_entry *entry = &ensemble->list[i];
        bt_entry_look(entry);
        if (entry->settled || is_for_another(ensemble, entry) ||
            (bt_entry_is_suspect(entry) && !may_take_suspects(ensemble))) continue;
        if (!lock_member(ensemble, entry)) continue;
        bt_entry_look(entry); // it may have finished before the lock was taken
        if (!entry->settled) return i;
        drop_member(ensemble, entry);
    }
    return NONE;
}

/// Collective over the group. Run a member, from its checkpoint if it was stopped; if that is refused, from the start.
static bt_status run_or_resume(const bt_comm *group, const bt_case *input, const bt_run_options *options,
                               bt_errors *why)
{
    // a checkpoint alone is of no use: the run continues its result
    int kept = group->rank == 0 && bt_checkpoint_there(options->dir) && bt_file_there(options->dir, "result.h5");
    bt_comm_bcast(group, &kept, sizeof kept);
    if (kept) {
        const bt_status status = bt_run_resume(group, options, why);
        if (status != BT_ERR_CASE) return status;
        bt_errors_free(why);
    }
    return bt_run(group, input, options, why);
}

/// Make ensemble.h5, one process at a time. wait: wait for the turn and report errors; otherwise leave both to the
/// process at work, or to the end.
static bt_status gather(bt_ensemble *ensemble, bool wait)
{
    bt_status status = BT_OK;
    const double t0 = bt_clock();
    bt_errors *err = wait ? ensemble->err : NULL;
    const int fd = bt_ensemble_take_lock(ensemble->o->dir, wait, err);
    if (fd >= 0)
        status = bt_ensemble_gather(ensemble->s, ensemble->o->dir, &ensemble->records, &ensemble->warnings, err);
    else if (wait) status = BT_ERR_IO;
    if (fd >= 0 && wait) complete_journal(ensemble);
    if (fd >= 0) close(fd);
    ensemble->gathered = bt_clock();
    ensemble->gathering = ensemble->gathered - t0;
    return status;
}

static bt_status run_member(bt_ensemble *ensemble, bt_entry *entry)
{
    const bool first = ensemble->group->rank == 0;
    const double t0 = bt_clock();
    bt_errors why = {0};
    bt_status status = BT_OK;
    int64_t n_steps = 0;
    if (first && entry->attempts >= BT_MAX_ATTEMPTS)
        status = bt_fail(&why, BT_ERR_NUMERIC,
                         "%s: its process died in each of %d attempts; run the case alone to see why", entry->m.name,
                         entry->attempts);
    if (first) {
        if (entry->attempts == 0) unlink(BT_PATH(entry->folder, "attempts"));
        if (entry->attempts < BT_MAX_ATTEMPTS) bt_member_note_attempt(entry->folder);
        if (entry->attempts > 0) gather(ensemble, false); // its process may die again; the file should show its state
        bt_ensemble_journal(ensemble, BT_EVENT_START, &entry->m, 0, 0);
    }
    status = bt_comm_agree(ensemble->group, status);
    if (status == BT_OK) {
        bt_case input;
        status = bt_member_case(ensemble->s, &entry->m, &input, &why);
        status = bt_comm_agree(ensemble->group, status);
        if (status == BT_OK) n_steps = bt_case_steps(&input);
        const bt_run_options options = {.dir = entry->folder,
                                        .threads = ensemble->threads,
                                        .quiet = true,
                                        .dump_step = -1,
                                        .max_steps = ensemble->o->max_steps,
                                        .max_wall = ensemble->o->max_wall > 0
                                                    ? bt_max(1e-3, bt_ensemble_wall_left(ensemble)) : 0,
                                        .stop_signal = &stop_signal,
                                        .command_line = ensemble->o->command_line,
                                        .held = true,
                                        .fields = entry->shares ? ensemble->fields : NULL};
        if (status == BT_OK) status = run_or_resume(ensemble->group, &input, &options, &why);
        bt_case_free(&input);
    }
    bt_comm_errors(ensemble->group, &why);
    if (first) {
        const double wall = bt_clock() - t0;
        unlink(BT_PATH(entry->folder, "attempts"));
        entry->paused = status == BT_OK && ensemble->o->max_steps > 0 && !bt_member_is_whole(entry->folder, n_steps);
        if (status == BT_OK && !entry->paused) {
            status = bt_member_record_write(&ensemble->records, entry->index, entry->m.name, entry->folder, &why);
            if (status == BT_OK) bt_checkpoint_remove(entry->folder);
        }
        if (status != BT_OK && status != BT_ERR_SIGNAL) settle_failed(ensemble, entry, status, &why);
        bt_ensemble_journal(ensemble,
                            entry->paused || status == BT_ERR_SIGNAL ? BT_EVENT_STOPPED
                            : status == BT_OK                        ? BT_EVENT_FINISHED
                                                                     : BT_EVENT_FAILED,
                            &entry->m, wall, (int)status);
        if (status != BT_ERR_SIGNAL && !entry->paused) bt_ensemble_say(ensemble, entry, status, wall);
    }
    bt_errors_free(&why);
    return status;
}

static bt_status work(bt_ensemble *ensemble)
{
    for (;;) {
        const bool stop = bt_comm_any(ensemble->group, stop_signal != 0 || bt_ensemble_wall_left(ensemble) <= 0);
        if (stop) return BT_ERR_SIGNAL;
        int64_t i = ensemble->group->rank == 0 ? claim(ensemble) : 0;
        bt_comm_bcast(ensemble->group, &i, sizeof i);
        if (i == CHANGED) return BT_ERR_CASE;
        if (i == NONE) return ensemble->lost > 0 ? BT_ERR_IO : BT_OK;
        const bt_status status = run_member(ensemble, &ensemble->list[i]);
        if (ensemble->group->rank == 0) {
            drop_member(ensemble, &ensemble->list[i]);
            if (status != BT_ERR_SIGNAL &&
                bt_clock() - ensemble->gathered >
                ensemble->n_groups * bt_max(GATHER_SECONDS, ensemble->gathering / GATHER_SHARE))
                gather(ensemble, false);
        }
        if (status == BT_ERR_SIGNAL) return status;
    }
}

/// Forget failures, so that failed members are tried again: all, or only those of input and output, whose cause, such
/// as a full disk, lies outside the member.
static void forget_failures(const bt_study *study, const char *dir, bool all)
{
    for (int64_t i = 0; i < bt_study_n_members(study); i++) {
        bt_member member;
        bt_study_member(study, i, &member);
        char *folder = bt_member_folder(dir, &member);
        int code;
        if (bt_ensemble_state(folder, &code, NULL, NULL) == BT_MEMBER_FAILED && (all || code == BT_ERR_IO))
            bt_member_forget_failure(folder);
        free(folder);
        bt_member_free(&member);
    }
}

/// Collective. Nothing is left to begin: wait a moment if other processes work on members, which may finish or die;
/// false if none do. looks: calls so far; the first waits are short, as short members end soon.
static bool wait_for_others(bt_ensemble *ensemble, int looks)
{
    int64_t n = 0;
    for (int64_t i = 0; ensemble->world->rank == 0 && i < ensemble->n; i++) {
        bt_entry_look(&ensemble->list[i]);
        n += !ensemble->list[i].settled;
    }
    bt_comm_bcast(ensemble->world, &n, sizeof n);
    if (n == 0) return false;
    if (looks == 0 && !ensemble->o->quiet && ensemble->jobs == 1 && ensemble->world->rank == 0) {
        printf("waiting for %" PRId64 " member%s in other processes (--no-wait: do not wait)\n", n, bt_plural(n));
        fflush(stdout);
    }
    nanosleep(&(struct timespec){.tv_nsec = looks < 50 ? 10000000 : 500000000}, NULL);
    return true;
}

/// Collective. Number of threads as for a run of the base case. *open: neither options nor environment set it.
static bt_status choose_threads(const bt_comm *comm, const bt_study *study, const bt_ensemble_options *options,
                                int *threads, bool *open, bt_errors *err)
{
    bt_case input;
    bt_status status = bt_comm_agree(comm, bt_study_base_case(study, &input, err));
    if (status == BT_OK) status = bt_running_same_case(comm, &input, err);
    if (status == BT_OK) {
        *threads = bt_run_threads(comm, &input, options->threads);
        *open = options->threads == 0 && input.run.threads == 0 && !getenv("OMP_NUM_THREADS");
    }
    bt_case_free(&input);
    return status;
}

/// Give members as many threads as their floes keep busy, and the other cores to other members. open: as of
/// choose_threads.
static void share_cores(bt_ensemble *ensemble, bool open)
{
    const bt_ensemble_options *options = ensemble->o;
    ensemble->jobs = 1;
    if (!options->helpers || options->job || options->max_steps > 0 || bt_launcher_find().found) return;
    const double busy = bt_max(1, ceil(ensemble->most_floes / FLOES_OF_A_THREAD));
    const double left = bt_max(1, (double)(ensemble->n - ensemble->before)),
                 most = options->jobs ? options->jobs : open ? floor(ensemble->threads / busy) : 1;
    ensemble->jobs = (int)bt_max(1, bt_min(most, left));
    if (open) ensemble->threads = bt_max(1, ensemble->threads / ensemble->jobs);
}

/// Collective. Check the study, prepare the folder. digest: of the study. threads, open: as of choose_threads.
static bt_status prepare(const bt_comm *comm, const bt_study *study, const bt_ensemble_options *options,
                         char digest[BT_DIGEST_TEXT], int *threads, bool *open, bt_errors *err)
{
    bt_status status = bt_comm_same(comm, study->path, study->text, err);
    if (status == BT_OK) status = bt_study_fits(study, comm->size, err);
    if (status == BT_OK) status = choose_threads(comm, study, options, threads, open, err);
    if (status == BT_OK && comm->rank == 0) status = bt_study_check_ice(study, err);
    if (status == BT_OK && comm->rank == 0) status = bt_ensemble_prepare_folder(study, options, digest, err);
    status = bt_comm_agree(comm, status);
    if (status == BT_OK) bt_comm_bcast(comm, digest, BT_DIGEST_TEXT);
    return status;
}

/// On rank 0: say what is to be done.
static void print_head(const bt_ensemble *ensemble)
{
    const bt_study *study = ensemble->s;
    if (ensemble->o->job) return;
    if (!ensemble->o->quiet) {
        printf("%" PRId64 " member%s: %" PRId64 " condition%s x %" PRId64 " field%s, %" PRId64
               " settled before; %d at a time, %" PRId64 " ranks x %d threads each\n",
               ensemble->n, bt_plural(ensemble->n), study->n_conditions, bt_plural(study->n_conditions), study->repeats,
               bt_plural(study->repeats), ensemble->before, ensemble->n_groups * ensemble->jobs, study->ranks,
               ensemble->threads);
        fflush(stdout);
    }
    if (ensemble->fixed > 0 && study->repeats > 1)
        bt_errors_warn("warning: in %" PRId64 " of %" PRId64 " conditions no ice depends on the seed (ice from a file, "
                       "or none): the fields of each are one run", ensemble->fixed, study->n_conditions);
}

/// Collective. Work until no member is left to start or to wait for, or a signal comes. idle: on a rank of no group.
static bt_status work_all(bt_ensemble *ensemble, bool idle)
{
    const bt_ensemble_options *options = ensemble->o;
    struct sigaction before[BT_N_CAUGHT];
    stop_signal = 0;
    bt_halt_catch(on_signal, NULL, before);
    const bool helped = ensemble->jobs > 1;
    if (helped) options->helpers->start(options->helpers->of, ensemble->jobs - 1, ensemble->threads);
    bt_status status = BT_OK;
    bool others;
    int looks = 0;
    do {
        if (!idle) status = work(ensemble);
        bt_comm_rest(ensemble->world);
        status = bt_comm_agree(ensemble->world, status);
        others = status == BT_OK && !options->leave && options->max_steps == 0 && wait_for_others(ensemble, looks++);
    } while (others);
    if (helped) options->helpers->end(options->helpers->of, status == BT_ERR_SIGNAL);
    bt_halt_let_go(before);
    if (ensemble->alone >= 0) close(ensemble->alone);
    return status;
}

static void release(bt_ensemble *ensemble)
{
    for (int64_t i = 0; i < ensemble->n; i++) {
        bt_member_free(&ensemble->list[i].m);
        free(ensemble->list[i].folder);
    }
    free(ensemble->list);
    free(ensemble->fields);
    bt_study_files_free(&ensemble->files);
    bt_member_records_end(&ensemble->records);
    bt_member_notes_free(&ensemble->warnings);
}

bt_status bt_ensemble_run(const bt_comm *comm, const bt_study *study, const bt_ensemble_options *options,
                          bt_errors *err)
{
    BT_PLAIN_NUMBERS;
    char digest[BT_DIGEST_TEXT] = "";
    int threads = 1;
    bool open = false;
    bt_status status = prepare(comm, study, options, digest, &threads, &open, err);
    if (status != BT_OK) return status;
    bt_comm group;
    const int n_groups = comm->size / (int)study->ranks, of_group = comm->rank / (int)study->ranks;
    bt_comm_split(comm, of_group, &group);
    bt_ensemble ensemble = {.world = comm,
                            .group = &group,
                            .s = study,
                            .o = options,
                            .began = bt_clock(),
                            .gathered = bt_clock(),
                            .err = err,
                            .n_groups = n_groups,
                            .of_group = of_group,
                            .threads = threads,
                            .alone = -1};
    bt_member_records_begin(&ensemble.records, study, digest);
    if (group.rank == 0) bt_study_files_find(&ensemble.files, study);
    // not in a helper: the call that started it has done so, and records new failures
    if (comm->rank == 0 && !options->job) forget_failures(study, options->dir, options->retry);
    bt_comm_rest(comm);
    bt_ensemble_list(&ensemble);
    bt_ensemble_count_settled(&ensemble);
    share_cores(&ensemble, open);
    if (comm->rank == 0) {
        print_head(&ensemble);
        gather(&ensemble, false); // after a kill the file may be out of date
    }
    status = work_all(&ensemble, of_group >= n_groups); // ranks left over after whole groups
    bt_ensemble_share_records(&ensemble);
    if (comm->rank == 0) {
        const bt_status gathered = gather(&ensemble, true);
        if (!options->job) status = bt_ensemble_tell_end(&ensemble, status, err);
        if (!options->job && status == BT_OK) bt_field_forget_kept(ensemble.fields);
        if (status == BT_OK) status = gathered;
    }
    bt_comm_split_end(&group);
    release(&ensemble);
    return bt_comm_agree(comm, status);
}
