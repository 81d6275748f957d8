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
#include "bergtow/run.h"
#include "case/case_derived.h"
#include "case/cost.h"
#include "run/ensemble_journal.h"
#include "run/ensemble_member.h"
#include "run/ensemble_record.h"
#include "run/study_axes.h"
#include "run/study_files.h"
#include "base/fileio.h"
#include "base/json.h"
#include "base/launcher.h"

// Wall time between two looks at ensemble.h5: 1 s or more, and so much that they take a twentieth of it.
#define GATHER_SECONDS 1.0
#define GATHER_SHARE 0.05
enum { MOST_REPORTED = 10 }; // failed members that are reported one by one
// Two threads do 1.5 times the work of one at 10,000 floes, 1.7 to 1.9 times from 30,000 on (cases/scaling), two
// processes twice at any size.
#define FLOES_OF_A_THREAD 15000.0

typedef struct {
    bt_member m;
    int64_t index; ///< among the members of the study
    char *folder;
    int64_t turn;  ///< repeat where wall time is limited: a call that is stopped leaves whole fields; otherwise 0
    double cost;   ///< estimated, s of one core
    /// within a turn the largest comes first: the cost; 0 where wall time is limited and the conditions are a random
    /// sample: those that are done are to be one, too, and the costly ones alone have another mean
    double first;
    bool settled;  ///< finished or failed, as far as this process knows
    bool paused;   ///< has done the steps that this call was to do
    int attempts;  ///< starts without an end
} entry;

typedef struct {
    const bt_comm *world, *group;
    const bt_study *s;
    const bt_ensemble_options *o;
    entry *list;        ///< [n] in the order in which they are taken
    int64_t n, before;  ///< members; settled when this call began
    double cost_before; ///< of those
    double most_floes;  ///< of the member with the most
    int64_t fixed;      ///< conditions whose ice does not depend on the seed
    int n_groups, of_group, threads, jobs, lock; ///< lock: descriptor held for the member at hand
    /// descriptor held by the one group that may work on members that look hopeless, −1 = not this one
    int alone;
    int64_t lost;       ///< members whose failure could not be recorded
    bt_member_records records;
    bt_study_files files; ///< on the first rank of a group
    double began, gathered, gathering; ///< gathered: when ensemble.h5 was last looked at; gathering: s that took
    bt_errors *err;
} ensemble;

// A run has handlers of its own, which end it after a step; these are for the time between, and while it is set up.
static volatile sig_atomic_t stop_signal;
static void on_signal(int number) { stop_signal = number; }
static const int caught[] = {SIGINT, SIGTERM, SIGUSR2};
enum { N_CAUGHT = sizeof caught / sizeof *caught };

static void journal(const ensemble *e, const char *event, const bt_member *m, double wall, int code)
{
    bt_journal_add(e->o->dir, event, m->name, wall, code);
}

/// A process that is killed between the end of a member and the line for it leaves that line out: here it is added. By
/// one process at a time, with the lock of the folder.
static void complete_journal(const ensemble *e)
{
    // Whoever works on a member holds its lock until the line is written, so the locks are looked at first.
    bool *lacking = bt_alloc((size_t)e->n, sizeof *lacking);
    for (int64_t i = 0; i < e->n; i++) {
        const entry *x = &e->list[i];
        lacking[x->index] =
            bt_ensemble_state(x->folder, NULL, NULL) == BT_MEMBER_FINISHED && !bt_member_held(x->folder);
    }
    bt_journal_strike_ended(e->o->dir, e->s->repeats, e->n, lacking);
    for (int64_t i = 0; i < e->n; i++)
        if (lacking[e->list[i].index]) journal(e, "finished", &e->list[i].m, NAN, 0);
    free(lacking);
}

/// The wall time that is left, s; infinite where none was given.
static double left_of_wall(const ensemble *e)
{
    return e->o->max_wall > 0 ? e->o->max_wall - (bt_clock() - e->began) : INFINITY;
}

// --- the list --------------------------------------------------------------------------------------------------------

static bool suspect(const entry *x) { return x->attempts >= BT_SUSPECT_ATTEMPTS; }

static int by_turn(const void *a, const void *b)
{
    const entry *p = a, *q = b;
    const int doubt[2] = {(p->attempts > 0) + suspect(p), (q->attempts > 0) + suspect(q)};
    if (doubt[0] != doubt[1]) return doubt[0] - doubt[1]; // those whose process died come last
    if (p->turn != q->turn) return p->turn < q->turn ? -1 : 1;
    if (p->first != q->first) return p->first > q->first ? -1 : 1;
    return p->index < q->index ? -1 : 1;
}

static void look(entry *x)
{
    if (!x->settled) x->settled = bt_ensemble_state(x->folder, NULL, NULL) != BT_MEMBER_WAITING;
}

// --- soundness -------------------------------------------------------------------------------------------------------

enum { SOUND, DAMAGED, UNREADABLE };

/// Check a member that says it has finished. What is damaged is taken away, unless somebody is at it already.
static int check_member(ensemble *e, entry *x, bt_errors *warnings)
{
    bt_errors why = {0};
    bt_status status = bt_member_record_check(&e->records, x->index, x->m.name, x->folder, &why);
    if (status == BT_ERR_CASE) {
        const int fd = bt_member_open(x->folder, "lock", O_RDWR | O_CREAT);
        bt_errors again = {0};
        if (fd < 0 || !bt_member_take_lock(fd, false) ||
            bt_ensemble_state(x->folder, NULL, NULL) != BT_MEMBER_FINISHED) {
            bt_errors_free(&why); // another process has found it out, too
        } else if (bt_member_record_check(&e->records, x->index, x->m.name, x->folder, &again) == BT_OK) {
            bt_errors_free(&why); // and made it good meanwhile
            status = BT_OK;
        } else {
            status = bt_member_record_forget(x->folder, &why) == BT_OK ? BT_ERR_CASE : BT_ERR_IO;
            journal(e, "unsound", &x->m, 0, (int)status);
        }
        bt_errors_free(&again);
        if (fd >= 0) close(fd);
    }
    for (size_t k = 0; k < why.n && k < 1; k++)
        bt_errors_add(warnings, "warning: member %s is not sound%s: %s%s", x->m.name,
                      status == BT_ERR_CASE ? " and is run again" : ", and stays so", why.text[k],
                      why.n > 1 ? ", ..." : "");
    bt_errors_free(&why);
    return status == BT_OK ? SOUND : status == BT_ERR_CASE ? DAMAGED : UNREADABLE;
}

static void print_warnings(bt_errors *list)
{
    const size_t more = list->n > MOST_REPORTED ? list->n - MOST_REPORTED : 0;
    for (size_t k = 0; k < list->n - more; k++) fprintf(stderr, "bergtow: %s\n", list->text[k]);
    if (more) fprintf(stderr, "bergtow: warning: and %zu more members that are not sound; see journal.jsonl\n", more);
}

/// Collective. Each rank makes what it knows of sound files known to the others, so that none reads them again.
static void share_records(ensemble *e)
{
    bt_comm_reduce(e->world, NULL, 0, NULL, 0, e->records.seen, (int)e->records.n);
}

/// Collective. Every finished member is read once, by one of the ranks; the list is still in the order of the study.
static void check_members(ensemble *e)
{
    enum { PER_WORD = 32 }; // two bits each
    const int n = (int)(e->n / PER_WORD + 1);
    uint64_t *found = bt_alloc((size_t)n, sizeof *found);
    memset(found, 0, (size_t)n * sizeof *found);
    bt_errors warnings = {0};
    for (int64_t i = e->world->rank; i < e->n; i += e->world->size) {
        entry *x = &e->list[i];
        if (bt_ensemble_state(x->folder, NULL, NULL) != BT_MEMBER_FINISHED) continue;
        found[i / PER_WORD] |= (uint64_t)check_member(e, x, &warnings) << 2 * (i % PER_WORD);
    }
    bt_comm_reduce(e->world, NULL, 0, NULL, 0, found, n);
    share_records(e);
    for (int64_t i = 0; i < e->n; i++) {
        const int how = (int)(found[i / PER_WORD] >> 2 * (i % PER_WORD) & 3);
        if (how == DAMAGED) e->list[i].settled = false;
        if (how == UNREADABLE) e->list[i].settled = true; // nothing can be done about it here
    }
    bt_comm_errors(e->world, &warnings);
    if (e->world->rank == 0) print_warnings(&warnings);
    bt_errors_free(&warnings);
    free(found);
}

/// Collective.
static void make_list(ensemble *e)
{
    e->n = bt_study_n_members(e->s);
    e->list = bt_alloc((size_t)e->n, sizeof *e->list);
    const bool limited = e->o->max_wall > 0;
    double cost = 0;
    int64_t priced = -1;
    for (int64_t i = 0; i < e->n; i++) {
        entry *x = &e->list[i];
        x->index = i;
        bt_study_member(e->s, i, &x->m);
        x->folder = bt_text_of("%s/members/%s", e->o->dir, x->m.name);
        // fields of one condition cost the same; a case that cannot be read fails when its turn comes
        if (x->m.condition != priced) {
            bt_case c;
            bt_errors unheard = {0};
            priced = x->m.condition;
            const bool read = bt_member_case(e->s, &x->m, &c, &unheard) == BT_OK;
            cost = read ? bt_cost_seconds(&c) : 0;
            e->fixed += read && !bt_case_ice_is_random(&c);
            if (read) e->most_floes = bt_max(e->most_floes, bt_case_expected_floes(&c) + (double)c.n_floes);
            bt_case_free(&c);
            bt_errors_free(&unheard);
        }
        x->cost = cost;
        x->turn = limited ? x->m.repeat : 0;
        x->first = limited && e->s->sampling == BT_SAMPLING_LATIN_HYPERCUBE ? 0 : cost;
        x->attempts = bt_member_attempts(x->folder);
        look(x);
    }
    check_members(e);
    qsort(e->list, (size_t)e->n, sizeof *e->list, by_turn);
}

/// What is settled when the work begins.
static void count_settled(ensemble *e)
{
    for (int64_t i = 0; i < e->n; i++) {
        if (!e->list[i].settled) continue;
        e->before++;
        e->cost_before += e->list[i].cost;
    }
}

/// The folder is of this study, or new; old: which of these. digest: of the text that the folder keeps, which may have
/// the comments of another version of the program. The caller holds its lock.
static bt_status keep_resolved(const char *dir, const char *text, bool *old, char digest[BT_DIGEST_TEXT],
                               bt_errors *err)
{
    char *path = bt_file_join(dir, "study.resolved.yml"), *before = NULL;
    size_t size;
    *old = access(path, F_OK) == 0;
    bt_status status = *old ? bt_file_read(path, "a study", &before, &size, err) : bt_file_write(path, text, err);
    if (status == BT_OK && *old && !bt_study_resolved_alike(before, text)) {
        bt_errors_add(err,
                      "%s: holds the members of another study (see %s): only `repeats` may change; give another "
                      "folder with -o, or restore the study and its base case",
                      dir, path);
        status = BT_ERR_CASE;
    }
    const char *kept = *old ? before : text;
    if (status == BT_OK) bt_checksum_digest_text(kept, strlen(kept), digest);
    free(before);
    free(path);
    return status;
}

/// Folder, resolved study, files that it names; refuses a folder of another study. On rank 0.
static bt_status prepare_folder(const bt_study *s, const bt_ensemble_options *o, char digest[BT_DIGEST_TEXT],
                                bt_errors *err)
{
    char *text = bt_study_resolved(s, err);
    if (!text) return BT_ERR_CASE;
    char *members = bt_file_join(o->dir, "members"), *copy = bt_file_join(o->dir, "study.yml");
    bt_study_files files;
    bt_errors warnings = {0};
    bool old = false;
    bt_study_files_find(&files, s);
    bt_status status = bt_file_make_dir(members, err);
    const int fd = status == BT_OK ? bt_member_open(o->dir, "lock", O_RDWR | O_CREAT) : -1;
    if (fd >= 0) bt_member_take_lock(fd, true); // calls that begin together
    if (status == BT_OK) status = keep_resolved(o->dir, text, &old, digest, err);
    if (status == BT_OK) status = bt_study_files_keep(&files, o->dir, old, &warnings, err);
    if (status == BT_OK) status = bt_file_write(copy, s->text, err);
    if (fd >= 0) close(fd);
    bt_errors_print(&warnings);
    bt_errors_free(&warnings);
    bt_study_files_free(&files);
    free(members);
    free(copy);
    free(text);
    return status;
}

// --- who does what ---------------------------------------------------------------------------------------------------

static void say(const ensemble *e, const entry *x, bt_status status, double wall)
{
    if (e->o->quiet) return;
    int64_t done = 0;
    double cost = 0, all = 0;
    for (int64_t i = 0; i < e->n; i++) {
        look(&e->list[i]);
        all += e->list[i].cost;
        if (!e->list[i].settled) continue;
        done++;
        cost += e->list[i].cost;
    }
    const double passed = bt_clock() - e->began, spent = cost - e->cost_before,
                 left = spent > 0 ? passed * (all - cost) / spent : NAN;
    char line[512];
    int n = snprintf(line, sizeof line, "[%" PRId64 "/%" PRId64 "] %s %s, %.3g s", done, e->n, x->m.name,
                     status == BT_OK ? "finished" : "FAILED", wall);
    for (int p = 0; p < e->s->n_parameters && n < 400; p++)
        n += snprintf(line + n, sizeof line - (size_t)n, ", %.40s %.40s", e->s->parameter[p].name, x->m.value[p]);
    if (isfinite(left) && done < e->n)
        snprintf(line + n, sizeof line - (size_t)n, left < 120 ? "; about %.0f s left" : "; about %.0f min left",
                 left < 120 ? left : left / 60);
    printf("%s\n", line);
    fflush(stdout);
}

/// A member that has failed; where not even that can be recorded (a full disk) it stays open, is reported at the end,
/// and is tried again by the next call.
static void settle_failed(ensemble *e, entry *x, bt_status status, const bt_errors *why)
{
    bt_errors unrecorded = {0};
    x->settled = true;
    if (bt_member_record_failure(x->folder, status, why, &unrecorded) != BT_OK && e->lost++ < MOST_REPORTED)
        bt_errors_add(e->err, "member %s failed (%d): %s; nor could that be recorded, so the next call tries it again",
                      x->m.name, (int)status, why->n ? why->text[0] : "no reason given");
    bt_errors_free(&unrecorded);
}

/// A suspect that is run beside another member takes that with it when it ends the program, and again at every call,
/// until both are given up. So one at a time is run, once nothing else is left to begin.
static bool may_take_suspects(ensemble *e)
{
    if (e->alone >= 0) return true;
    const int fd = bt_member_open(e->o->dir, "suspects.lock", O_RDWR | O_CREAT);
    if (fd < 0) return true; // better than never
    if (bt_member_take_lock(fd, false)) e->alone = fd;
    else close(fd);
    return e->alone >= 0;
}

/// Make the folder of a member and take its lock; −1: somebody is at it, or it has failed by that.
static int lock_member(ensemble *e, entry *x)
{
    bt_errors why = {0};
    bt_status status = bt_file_make_dir(x->folder, &why);
    const int fd = status == BT_OK ? bt_member_open(x->folder, "lock", O_RDWR | O_CREAT) : -1;
    if (status == BT_OK && fd < 0) status = bt_file_fail(x->folder, "make a lock in the folder", errno, &why);
    if (status != BT_OK) {
        settle_failed(e, x, status, &why);
        journal(e, "failed", &x->m, 0, (int)status);
        say(e, x, status, 0);
    }
    bt_errors_free(&why);
    if (fd < 0 || bt_member_take_lock(fd, false)) return fd;
    close(fd);
    return -1;
}

/// With a limit of steps each group has members of its own: one that has paused looks like one that waits.
static bool is_for_another(const ensemble *e, const entry *x)
{
    return e->o->max_steps > 0 && (x->paused || x->index % e->n_groups != e->of_group);
}

enum { NONE = -1, CHANGED = -2 };

/// Take the lock of the next member that is free; NONE, or CHANGED: what it would be made with is not what others were
/// made with. On the first rank of a group.
static int64_t claim(ensemble *e)
{
    if (bt_study_files_same(&e->files, e->err) != BT_OK) return CHANGED;
    for (int64_t i = 0; i < e->n; i++) {
        entry *x = &e->list[i];
        look(x);
        if (x->settled || is_for_another(e, x) || (suspect(x) && !may_take_suspects(e))) continue;
        const int fd = lock_member(e, x);
        if (fd < 0) continue;
        look(x); // it may have been finished between the look and the lock
        if (x->settled) {
            close(fd);
            continue;
        }
        e->lock = fd;
        return i;
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
static bt_status gather(ensemble *e, bool wait)
{
    bt_status status = BT_OK;
    bt_errors unheard = {0};
    const double t0 = bt_clock();
    const int fd = bt_member_open(e->o->dir, "lock", O_RDWR | O_CREAT);
    if (fd < 0 && wait) status = bt_file_fail(e->o->dir, "open the lock in the folder", errno, e->err);
    else if (fd >= 0 && bt_member_take_lock(fd, wait))
        status = bt_ensemble_gather(e->s, e->o->dir, &e->records, wait ? e->err : &unheard);
    if (fd >= 0 && wait) complete_journal(e);
    if (fd >= 0) close(fd);
    bt_errors_free(&unheard);
    e->gathered = bt_clock();
    e->gathering = e->gathered - t0;
    return status;
}

static bt_status run_member(ensemble *e, entry *x)
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
        journal(e, "start", &x->m, 0, 0);
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
                                  .max_wall = e->o->max_wall > 0 ? bt_max(1e-3, left_of_wall(e)) : 0,
                                  .stop_signal = &stop_signal,
                                  .command_line = e->o->command_line};
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
        journal(e,
                x->paused                 ? "stopped"
                : status == BT_OK         ? "finished"
                : status == BT_ERR_SIGNAL ? "stopped"
                                          : "failed",
                &x->m, wall, (int)status);
        if (status != BT_ERR_SIGNAL && !x->paused) say(e, x, status, wall);
    }
    bt_errors_free(&why);
    return status;
}

static bt_status work(ensemble *e)
{
    for (;;) {
        const bool stop = bt_comm_any(e->group, stop_signal != 0 || left_of_wall(e) <= 0);
        if (stop) return BT_ERR_SIGNAL;
        int64_t i = e->group->rank == 0 ? claim(e) : 0;
        bt_comm_bcast(e->group, &i, sizeof i);
        if (i == CHANGED) return BT_ERR_CASE;
        if (i == NONE) return e->lost > 0 ? BT_ERR_IO : BT_OK;
        const bt_status status = run_member(e, &e->list[i]);
        if (e->group->rank == 0) {
            close(e->lock);
            if (status != BT_ERR_SIGNAL &&
                bt_clock() - e->gathered > e->n_groups * bt_max(GATHER_SECONDS, e->gathering / GATHER_SHARE))
                gather(e, false);
        }
        if (status == BT_ERR_SIGNAL) return status;
    }
}

typedef struct {
    int64_t finished, failed, left, at_work, unsound;
} counts;

/// One member's part in the end: counted, and reported where it is a hole.
static bt_status tell_member(ensemble *e, const entry *x, counts *n, bt_errors *err)
{
    int code;
    char *why;
    bt_errors damage = {0};
    bt_status status = BT_OK;
    const bt_member_state state = bt_ensemble_state(x->folder, &code, &why);
    const bt_status sound = state == BT_MEMBER_FINISHED
                                ? bt_member_record_check(&e->records, x->index, x->m.name, x->folder, &damage)
                                : BT_OK;
    if (sound != BT_OK) {
        if (n->unsound++ < MOST_REPORTED)
            bt_errors_add(err, "member %s is not sound: %s; %s", x->m.name, damage.text[0],
                          sound == BT_ERR_IO ? "mend that, and call again" : "the same call runs it again");
        status = BT_ERR_IO;
    } else if (state == BT_MEMBER_FINISHED) {
        n->finished++;
        if (bt_checkpoint_there(x->folder)) bt_checkpoint_remove(x->folder); // killed between the two
    } else if (state == BT_MEMBER_FAILED) {
        if (why) why[strcspn(why, "\n")] = 0;
        if (n->failed++ < MOST_REPORTED)
            bt_errors_add(err, "member %s failed (%d): %s", x->m.name, code, why ? why : "no reason recorded");
        status = code > 0 && code <= BT_ERR_NUMERIC ? (bt_status)code : BT_ERR_NUMERIC;
    } else {
        n->left++;
        n->at_work += bt_member_held(x->folder);
    }
    free(why);
    bt_errors_free(&damage);
    return status;
}

static int by_index(const void *a, const void *b)
{
    return ((const entry *)a)->index < ((const entry *)b)->index ? -1 : 1;
}

/// What became of the members: the worst status of the failed, each with its first reason. BT_OK only where there is no
/// hole.
static bt_status tell_end(ensemble *e, bt_status status, bt_errors *err)
{
    counts n = {0};
    bt_status worst = status;
    qsort(e->list, (size_t)e->n, sizeof *e->list, by_index);
    for (int64_t i = 0; i < e->n; i++) {
        const bt_status of = tell_member(e, &e->list[i], &n, err);
        if (worst == BT_OK) worst = of;
    }
    if (n.failed > MOST_REPORTED)
        bt_errors_add(err, "and %" PRId64 " more failed members; see %s/members/*/failed.txt", n.failed - MOST_REPORTED,
                      e->o->dir);
    if (n.unsound > MOST_REPORTED)
        bt_errors_add(err, "and %" PRId64 " more members that are not sound", n.unsound - MOST_REPORTED);
    if (status == BT_ERR_SIGNAL)
        bt_errors_add(err, "stopped by %s; the same call goes on with the %" PRId64 " members that are left",
                      left_of_wall(e) <= 0 ? "the limit of wall time" : "a signal", n.left);
    else if (n.at_work)
        bt_errors_add(
            err,
            "%" PRId64
            " members are being worked on by other processes; the same call takes them in when those have ended",
            n.at_work);
    else if (n.left && worst == BT_OK)
        bt_errors_add(err, "%" PRId64 " members are left; the same call goes on with them", n.left);
    if (n.left && worst == BT_OK) worst = BT_ERR_SIGNAL;
    if (!e->o->quiet) {
        printf("%" PRId64 " members finished, %" PRId64 " failed, %" PRId64 " left", n.finished, n.failed, n.left);
        if (n.unsound) printf(", %" PRId64 " not sound", n.unsound);
        printf("; %s/ensemble.h5\n", e->o->dir);
    }
    return worst;
}

/// Failed members that are to be tried again.
static void forget_failures(const ensemble *e)
{
    for (int64_t i = 0; i < e->n; i++) {
        bt_member_forget_failure(e->list[i].folder);
        e->list[i].settled = false;
    }
}

/// Collective. Nothing is left to begin: wait a moment if other processes are at work on members, which may finish or
/// die. reported: that has been said.
static bool wait_for_others(ensemble *e, bool reported)
{
    int64_t n = 0;
    for (int64_t i = 0; e->world->rank == 0 && i < e->n; i++) {
        look(&e->list[i]);
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

/// As for a run of the base case. *open: nobody has asked for a number.
static bt_status choose_threads(const bt_comm *comm, const bt_study *s, const bt_ensemble_options *o, int *threads,
                                bool *open, bt_errors *err)
{
    bt_case c;
    const bt_status status = bt_study_base_case(s, &c, err);
    if (status == BT_OK) {
        *threads = bt_run_threads(comm, &c, o->threads);
        *open = o->threads == 0 && c.run.threads == 0 && !getenv("OMP_NUM_THREADS");
    }
    bt_case_free(&c);
    return status;
}

/// Members have as many threads as their floes keep busy, and the other cores go to other members. open: the number of
/// threads is.
static void share_cores(ensemble *e, bool open)
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

static void warn_fixed(const ensemble *e)
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
    if (status == BT_OK && comm->rank == 0) status = prepare_folder(s, o, digest, err);
    status = bt_comm_agree(comm, status);
    if (status != BT_OK) return status;
    bt_comm_bcast(comm, digest, sizeof digest);
    bt_member_records_begin(&records, s, digest);

    bt_comm group;
    bt_comm_split(comm, comm->rank / (int)s->ranks, &group);
    const bool idle = comm->rank / (int)s->ranks >= comm->size / (int)s->ranks; // ranks that make no whole group
    ensemble e = {.world = comm,
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
    make_list(&e);
    if (o->retry && comm->rank == 0) forget_failures(&e);
    if (o->retry) bt_comm_rest(comm);
    if (o->retry)
        for (int64_t i = 0; i < e.n; i++)
            e.list[i].settled = bt_ensemble_state(e.list[i].folder, NULL, NULL) != BT_MEMBER_WAITING;
    count_settled(&e);
    share_cores(&e, open);
    if (comm->rank == 0 && !o->quiet && !o->job) {
        printf("%" PRId64 " members: %" PRId64 " conditions x %" PRId64 " fields, %" PRId64
               " settled before; %d at a time, %" PRId64 " ranks x %d threads each\n",
               e.n, s->n_conditions, s->repeats, e.before, e.n_groups * e.jobs, s->ranks, e.threads);
        fflush(stdout);
    }
    if (comm->rank == 0 && !o->job) warn_fixed(&e);
    if (comm->rank == 0) gather(&e, false); // after a kill the file may be behind
    struct sigaction before[N_CAUGHT], act = {.sa_handler = on_signal, .sa_flags = SA_RESTART};
    sigemptyset(&act.sa_mask);
    stop_signal = 0;
    for (int k = 0; k < N_CAUGHT; k++) sigaction(caught[k], &act, &before[k]);
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
    for (int k = 0; k < N_CAUGHT; k++) sigaction(caught[k], &before[k], NULL);
    if (e.alone >= 0) close(e.alone);
    share_records(&e);
    if (comm->rank == 0) {
        const bt_status gathered = gather(&e, true);
        if (!o->job) status = tell_end(&e, status, err);
        if (status == BT_OK) status = gathered;
    }
    bt_comm_split_end(&group);
    for (int64_t i = 0; i < e.n; i++) {
        bt_member_free(&e.list[i].m);
        free(e.list[i].folder);
    }
    free(e.list);
    bt_study_files_free(&e.files);
    bt_member_records_end(&e.records);
    return bt_comm_agree(comm, status);
}
