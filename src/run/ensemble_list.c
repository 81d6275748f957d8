// SPDX-License-Identifier: MIT
// The members of a study in the order in which they are run, and checks of finished members.
#include "run/ensemble_list.h"

#include <fcntl.h>
#include <inttypes.h>
#include <jansson.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "base/fileio.h"
#include "base/inside.h"
#include "case/case_derived.h"
#include "case/cost.h"
#include "field/field_kept.h"
#include "output/checkpoint.h"
#include "output/folder.h"

// --- the journal -----------------------------------------------------------------------------------------------------

#define JOURNAL "journal.jsonl"

static const char *const event_name[] = {
    [BT_EVENT_START] = "start",
    [BT_EVENT_STOPPED] = "stopped",
    [BT_EVENT_FINISHED] = "finished",
    [BT_EVENT_FAILED] = "failed",
    [BT_EVENT_UNSOUND] = "unsound",
};

/// Add a line, in one write: lines of several processes do not mix. If it cannot be written, it is left out.
void bt_ensemble_journal(const bt_ensemble *ensemble, bt_member_event event, const bt_member *member, double wall,
                         int code)
{
    struct timespec now;
    clock_gettime(CLOCK_REALTIME, &now);
    char line[256], took[32] = "null";
    if (isfinite(wall)) snprintf(took, sizeof took, "%.3f", wall);
    const int n = snprintf(line, sizeof line,
                           "{\"time\": %.3f, \"event\": \"%s\", \"member\": \"%s\", \"pid\": %ld, \"wall_time_s\": "
                           "%s, \"exit_code\": %d}\n",
                           (double)now.tv_sec + 1e-9 * (double)now.tv_nsec, event_name[event], member->name,
                           (long)getpid(), took, code);
    const int fd = bt_file_descriptor(BT_PATH(ensemble->o->dir, JOURNAL), O_WRONLY | O_CREAT | O_APPEND);
    if (fd < 0) return;
    if (write(fd, line, (size_t)n) == n) fsync(fd);
    close(fd);
}

void bt_journal_strike_ended(const char *dir, int64_t repeats, int64_t n, bool *lacking)
{
    bool *ended = bt_alloc((size_t)n, sizeof *ended);
    // Line by line: a journal may be longer than bt_file_read allows.
    const int fd = bt_file_descriptor(BT_PATH(dir, JOURNAL), O_RDONLY);
    FILE *f = fd < 0 ? NULL : fdopen(fd, "r");
    char *line = NULL;
    size_t room = 0;
    while (f && getline(&line, &room, f) > 0) {
        json_t *entry = json_loads(line, 0, NULL); // NULL for a line that a full disk cut short
        const char *name = json_string_value(json_object_get(entry, "member"));
        const char *event = json_string_value(json_object_get(entry, "event"));
        int64_t condition = 0, repeat = 0;
        const bool known = name && event && sscanf(name, "c%" SCNd64 "-r%" SCNd64, &condition, &repeat) == 2;
        const int64_t i = (condition - 1) * repeats + repeat - 1;
        // after a reduction of repeats there are lines of members no longer in the study
        if (known && i >= 0 && i < n && repeat >= 1 && repeat <= repeats)
            ended[i] = !strcmp(event, event_name[BT_EVENT_FINISHED]);
        json_decref(entry);
    }
    const bool whole = f && !ferror(f); // the unread rest may say anything
    for (int64_t i = 0; i < n; i++) lacking[i] = lacking[i] && whole && !ended[i];
    free(line);
    free(ended);
    if (f) fclose(f);
    else if (fd >= 0) close(fd);
}

// --- the folder ------------------------------------------------------------------------------------------------------

/// Check that the folder belongs to this study (*old), or is new. digest: of the text that the folder keeps, which may
/// have the comments of another program version. The caller holds its lock.
static bt_status keep_resolved(const char *dir, const char *text, bool *old, char digest[BT_DIGEST_TEXT],
                               bt_errors *err)
{
    const char *path = BT_PATH(dir, BT_FOLDER_STUDY);
    char *before = NULL;
    size_t size;
    *old = access(path, F_OK) == 0;
    bt_status status = *old ? bt_file_read(path, "a study", &before, &size, err) : bt_file_write(path, text, err);
    char *other = status == BT_OK && *old ? bt_study_difference(before, text) : NULL;
    if (other) {
        status = bt_fail(err, BT_ERR_CASE,
                         "%s: holds the members of another study (%s; see %s): only `repeats` may change; give another "
                         "folder with -o, or restore the study and its base case",
                         dir, other, path);
        bt_errors_code(err, "other_study");
    }
    free(other);
    const char *kept = *old ? before : text;
    if (status == BT_OK) bt_checksum_digest_text(kept, strlen(kept), digest);
    free(before);
    return status;
}

bt_status bt_ensemble_prepare_folder(const bt_study *study, const bt_ensemble_options *options,
                                     char digest[BT_DIGEST_TEXT], bt_errors *err)
{
    if (bt_file_there(options->dir, BT_FOLDER_CASE) && !bt_file_there(options->dir, BT_FOLDER_STUDY))
        return bt_fail(err, BT_ERR_IO, "%s: holds a run; give the ensemble another folder with -o", options->dir);
    char *text = bt_study_resolved(study, err);
    if (!text) return BT_ERR_CASE;
    bt_study_files files;
    bool old = false;
    bt_study_files_find(&files, study);
    bt_status status = bt_file_make_dir(BT_PATH(options->dir, "members"), err);
    // for calls that begin together; without locks no process could tell a member that is taken from one that waits
    const int fd = status == BT_OK ? bt_ensemble_take_lock(options->dir, true, err) : -1;
    if (fd < 0) status = BT_ERR_IO;
    if (status == BT_OK) status = keep_resolved(options->dir, text, &old, digest, err);
    if (status == BT_OK) status = bt_study_files_keep(&files, options->dir, old, err);
    if (status == BT_OK) status = bt_file_write(BT_PATH(options->dir, "study.yml"), study->text, err);
    if (fd >= 0) close(fd);
    bt_study_files_free(&files);
    free(text);
    return status;
}

// --- the list --------------------------------------------------------------------------------------------------------

bool bt_entry_is_suspect(const bt_entry *entry) { return entry->attempts >= BT_SUSPECT_ATTEMPTS; }

static int by_turn(const void *a, const void *b)
{
    const bt_entry *p = a, *q = b;
    const int doubt[2] = {(p->attempts > 0) + bt_entry_is_suspect(p), (q->attempts > 0) + bt_entry_is_suspect(q)};
    if (doubt[0] != doubt[1]) return doubt[0] - doubt[1]; // members whose process has died come last
    if (p->turn != q->turn) return p->turn < q->turn ? -1 : 1;
    if (p->first != q->first) return p->first > q->first ? -1 : 1;
    return p->index < q->index ? -1 : 1;
}

void bt_entry_look(bt_entry *entry)
{
    if (!entry->settled) entry->settled = bt_ensemble_state(entry->folder, NULL, NULL, NULL) != BT_MEMBER_WAITING;
}

// --- soundness -------------------------------------------------------------------------------------------------------

enum { SOUND, DAMAGED, UNREADABLE };

/// Check a member recorded as finished. A damaged result is removed, unless another process works on the member.
static int check_member(bt_ensemble *ensemble, bt_entry *entry, bt_errors *warnings)
{
    bt_errors why = {0};
    bt_status status = bt_member_record_check(&ensemble->records, entry->index, entry->m.name, entry->folder, &why);
    if (status == BT_ERR_CASE) {
        const int fd = bt_file_descriptor(BT_PATH(entry->folder, "lock"), O_RDWR | O_CREAT);
        bool busy = false; // with a single run, as by `bergtow resume`
        const int run =
            fd >= 0 && bt_member_take_lock(fd, false) ? bt_lock_take(entry->folder, &busy, NULL) : -1;
        if (run < 0 || bt_ensemble_state(entry->folder, NULL, NULL, NULL) != BT_MEMBER_FINISHED) {
            bt_errors_free(&why); // another process has found this too, or works on it
        } else if (bt_member_record_check(&ensemble->records, entry->index, entry->m.name, entry->folder, NULL) ==
                   BT_OK) {
            bt_errors_free(&why); // another process has repaired it meanwhile
            status = BT_OK;
        } else {
            status = bt_member_record_forget(entry->folder, &why) == BT_OK ? BT_ERR_CASE : BT_ERR_IO;
            bt_ensemble_journal(ensemble, BT_EVENT_UNSOUND, &entry->m, 0, (int)status);
        }
        bt_lock_drop(entry->folder, run);
        if (fd >= 0) close(fd);
    }
    for (size_t k = 0; k < why.n && k < 1; k++)
        bt_errors_add(warnings, "warning: member %s is not sound%s: %s%s", entry->m.name,
                      status == BT_ERR_CASE ? " and is run again" : ", and stays so", why.text[k],
                      why.n > 1 ? ", ..." : "");
    bt_errors_free(&why);
    return status == BT_OK ? SOUND : status == BT_ERR_CASE ? DAMAGED : UNREADABLE;
}

static void print_warnings(bt_errors *list)
{
    const size_t more = list->n > BT_MAX_REPORTED ? list->n - BT_MAX_REPORTED : 0;
    for (size_t k = 0; k < list->n - more; k++) bt_errors_warn("%s", list->text[k]);
    if (more) bt_errors_warn("warning: and %zu more members that are not sound; see journal.jsonl", more);
}

void bt_ensemble_share_records(bt_ensemble *ensemble)
{
    bt_comm_reduce(ensemble->world, NULL, 0, NULL, 0, ensemble->records.seen, (int)ensemble->records.n);
}

/// Collective. Check every finished member once, by one of the ranks; the list is still in the order of the study.
static void check_members(bt_ensemble *ensemble)
{
    enum { PER_WORD = 32 }; // two bits each
    const int n = (int)(ensemble->n / PER_WORD + 1);
    uint64_t *found = bt_alloc((size_t)n, sizeof *found);
    memset(found, 0, (size_t)n * sizeof *found);
    bt_errors warnings = {0};
    for (int64_t i = ensemble->world->rank; i < ensemble->n; i += ensemble->world->size) {
        bt_entry *entry = &ensemble->list[i];
        if (bt_ensemble_state(entry->folder, NULL, NULL, NULL) != BT_MEMBER_FINISHED) continue;
        found[i / PER_WORD] |= (uint64_t)check_member(ensemble, entry, &warnings) << 2 * (i % PER_WORD);
    }
    bt_comm_reduce(ensemble->world, NULL, 0, NULL, 0, found, n);
    bt_ensemble_share_records(ensemble);
    for (int64_t i = 0; i < ensemble->n; i++) {
        const int how = (int)(found[i / PER_WORD] >> 2 * (i % PER_WORD) & 3);
        if (how == DAMAGED) ensemble->list[i].settled = false;
        if (how == UNREADABLE) ensemble->list[i].settled = true; // nothing can be done about it here
    }
    bt_comm_errors(ensemble->world, &warnings);
    if (ensemble->world->rank == 0) print_warnings(&warnings);
    bt_errors_free(&warnings);
    free(found);
}

typedef struct { char digest[BT_CHECKSUM_DIGEST]; int64_t member; } ice_of;

static int by_digest(const void *a, const void *b)
{
    const ice_of *p = a, *q = b;
    return strcmp(p->digest, q->digest);
}

/// Find conditions that share their ice, by the ice of the first field of each; in the order of the study.
static void find_shared(bt_ensemble *ensemble, ice_of *ice, int64_t n)
{
    qsort(ice, (size_t)n, sizeof *ice, by_digest);
    for (int64_t k = 1; k < n; k++) {
        if (by_digest(&ice[k - 1], &ice[k])) continue;
        for (int64_t r = 0; r < ensemble->s->repeats; r++)
            ensemble->list[ice[k - 1].member + r].shares = ensemble->list[ice[k].member + r].shares = true;
    }
    ensemble->fields = bt_text_of("%s/fields", ensemble->o->dir);
}

void bt_ensemble_list(bt_ensemble *ensemble)
{
    ensemble->n = bt_study_n_members(ensemble->s);
    ensemble->list = bt_alloc((size_t)ensemble->n, sizeof *ensemble->list);
    const bool limited = ensemble->o->max_wall > 0;
    double cost = 0;
    bool alike = false;
    int64_t priced = -1, n_ice = 0;
    ice_of *ice = bt_alloc((size_t)ensemble->s->n_conditions, sizeof *ice);
    for (int64_t i = 0; i < ensemble->n; i++) {
        bt_entry *entry = &ensemble->list[i];
        entry->index = i;
        bt_study_member(ensemble->s, i, &entry->m);
        entry->folder = bt_member_folder(ensemble->o->dir, &entry->m);
        // fields of one condition cost the same; an unreadable case fails when its turn comes
        if (entry->m.condition != priced) {
            bt_case input;
            priced = entry->m.condition;
            const bool read = bt_member_case(ensemble->s, &entry->m, &input, NULL) == BT_OK;
            cost = read ? bt_cost_seconds(&input) : 0;
            alike = read && !bt_case_ice_is_random(&input);
            ensemble->fixed += alike;
            if (read) {
                ensemble->most_floes = bt_max(ensemble->most_floes, bt_case_floes_made(&input) + (double)input.n_floes);
                bt_field_digest(&input, ice[n_ice].digest);
                ice[n_ice++].member = i;
            }
            bt_case_free(&input);
        }
        entry->cost = cost;
        entry->shares = alike && ensemble->s->repeats > 1;
        entry->turn = limited ? entry->m.repeat : 0;
        entry->first = limited && ensemble->s->sampling == BT_SAMPLING_LATIN_HYPERCUBE ? 0 : cost;
        entry->attempts = bt_member_attempts(entry->folder);
        bt_entry_look(entry);
    }
    find_shared(ensemble, ice, n_ice);
    free(ice);
    check_members(ensemble);
    qsort(ensemble->list, (size_t)ensemble->n, sizeof *ensemble->list, by_turn);
}

void bt_ensemble_count_settled(bt_ensemble *ensemble)
{
    for (int64_t i = 0; i < ensemble->n; i++) {
        if (!ensemble->list[i].settled) continue;
        ensemble->before++;
        ensemble->cost_before += ensemble->list[i].cost;
    }
}

// --- the report ------------------------------------------------------------------------------------------------------

/// Remaining wall time, s; infinite without a limit.
double bt_ensemble_wall_left(const bt_ensemble *ensemble)
{
    return ensemble->o->max_wall > 0 ? ensemble->o->max_wall - (bt_clock() - ensemble->began) : INFINITY;
}

void bt_ensemble_say(const bt_ensemble *ensemble, const bt_entry *entry, bt_status status, double wall)
{
    if (ensemble->o->quiet) return;
    int64_t done = 0;
    double cost = 0, all = 0;
    for (int64_t i = 0; i < ensemble->n; i++) {
        bt_entry_look(&ensemble->list[i]);
        all += ensemble->list[i].cost;
        if (!ensemble->list[i].settled) continue;
        done++;
        cost += ensemble->list[i].cost;
    }
    const double passed = bt_clock() - ensemble->began, spent = cost - ensemble->cost_before,
                 left = spent > 0 ? passed * (all - cost) / spent : NAN;
    char line[512];
    int n = snprintf(line, sizeof line, "[%" PRId64 "/%" PRId64 "] %s %s, %.3g s", done, ensemble->n, entry->m.name,
                     status == BT_OK ? "finished" : "FAILED", wall);
    for (int p = 0; p < ensemble->s->n_parameters && n < 400; p++)
        n += snprintf(line + n, sizeof line - (size_t)n, ", %.40s %.40s", ensemble->s->parameter[p].name,
                      entry->m.value[p]);
    if (isfinite(left) && done < ensemble->n)
        snprintf(line + n, sizeof line - (size_t)n, left < 120 ? "; about %.0f s left" : "; about %.0f min left",
                 left < 120 ? left : left / 60);
    printf("%s\n", line);
    fflush(stdout);
}

typedef struct {
    int64_t finished, failed, left, at_work, unsound;
} counts;

/// Count one member at the end, and report it if it is a hole.
static bt_status tell_member(bt_ensemble *ensemble, const bt_entry *entry, counts *n, bt_errors *err)
{
    int code;
    char *why;
    bt_errors damage = {0};
    bt_status status = BT_OK;
    const bt_member_state state = bt_ensemble_state(entry->folder, &code, NULL, &why);
    const bt_status sound = state == BT_MEMBER_FINISHED
                                ? bt_member_record_check(&ensemble->records, entry->index, entry->m.name, entry->folder,
                                                         &damage)
                                : BT_OK;
    if (sound != BT_OK) {
        if (n->unsound++ < BT_MAX_REPORTED)
            bt_errors_add(err, "member %s is not sound: %s; %s", entry->m.name, damage.text[0],
                          sound == BT_ERR_IO ? "correct that, and call again" : "repeat the command to run it again");
        status = BT_ERR_IO;
    } else if (state == BT_MEMBER_FINISHED) {
        n->finished++;
        if (bt_checkpoint_there(entry->folder)) bt_checkpoint_remove(entry->folder); // killed before its removal
    } else if (state == BT_MEMBER_FAILED) {
        if (why) why[strcspn(why, "\n")] = 0;
        if (n->failed++ < BT_MAX_REPORTED)
            bt_errors_add(err, "member %s failed (%d): %s%s", entry->m.name, code, why ? why : "no reason recorded",
                          code == BT_ERR_IO ? "; the next call tries it again" : "");
        status = code > 0 && code <= BT_ERR_NUMERIC ? (bt_status)code : BT_ERR_NUMERIC;
    } else {
        n->left++;
        n->at_work += entry->busy || bt_member_held(entry->folder);
    }
    free(why);
    bt_errors_free(&damage);
    return status;
}

BT_ASCENDING(by_index, bt_entry, index)

/// Report the warnings of members: for each code the text of the first, and the number of others.
static void report_warnings(const bt_ensemble *ensemble)
{
    const bt_member_notes *notes = &ensemble->warnings;
    for (int64_t i = 0; i < notes->n; i++) {
        int64_t others = 0, last = notes->member[i];
        bool first = true;
        for (int64_t k = 0; k < i && first; k++) first = strcmp(notes->code[k], notes->code[i]) != 0;
        for (int64_t k = i + 1; k < notes->n && first; k++)
            if (notes->member[k] != last && !strcmp(notes->code[k], notes->code[i])) others++, last = notes->member[k];
        if (!first) continue;
        printf("  warning: %s (%s", notes->text[i], ensemble->list[notes->member[i] - 1].m.name);
        if (others) printf("; and %" PRId64 " more", others);
        printf(")\n");
    }
}

bt_status bt_ensemble_tell_end(bt_ensemble *ensemble, bt_status status, bt_errors *err)
{
    counts n = {0};
    bt_status worst = BT_OK;
    qsort(ensemble->list, (size_t)ensemble->n, sizeof *ensemble->list, by_index);
    for (int64_t i = 0; i < ensemble->n; i++) {
        const bt_status of = tell_member(ensemble, &ensemble->list[i], &n, err);
        if (worst == BT_OK) worst = of;
    }
    if (n.failed > BT_MAX_REPORTED)
        bt_errors_add(err, "and %" PRId64 " more failed member%s; see %s/members/*/failed.txt",
                      n.failed - BT_MAX_REPORTED, bt_plural(n.failed - BT_MAX_REPORTED), ensemble->o->dir);
    if (n.unsound > BT_MAX_REPORTED)
        bt_errors_add(err, "and %" PRId64 " more unsound member%s", n.unsound - BT_MAX_REPORTED,
                      bt_plural(n.unsound - BT_MAX_REPORTED));
    if (status == BT_ERR_SIGNAL && n.left == 0) status = BT_OK; // it came after the last member
    if (status != BT_OK) worst = status;
    if (status == BT_ERR_SIGNAL)
        bt_errors_add(err, "stopped; repeat the command to continue with the %" PRId64 " remaining member%s", n.left,
                      bt_plural(n.left));
    else if (n.at_work)
        bt_errors_add(err,
                      "%" PRId64
                          " member%s still running in other processes; repeat the command later to include their "
                      "results",
                      n.at_work, bt_plural(n.at_work));
    else if (n.left && worst == BT_OK)
        bt_errors_add(err, "%" PRId64 " member%s left; repeat the command to run the rest", n.left, bt_plural(n.left));
    if (n.left && worst == BT_OK) worst = BT_ERR_SIGNAL;
    if (!ensemble->o->quiet) {
        printf("%" PRId64 " member%s finished, %" PRId64 " failed, %" PRId64 " left", n.finished, bt_plural(n.finished),
               n.failed, n.left);
        if (n.unsound) printf(", %" PRId64 " not sound", n.unsound);
        printf("; %s/ensemble.h5\n", ensemble->o->dir);
        report_warnings(ensemble);
    }
    return worst;
}
