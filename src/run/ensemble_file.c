// SPDX-License-Identifier: MIT
// ensemble.h5: one row per member, gathered from the members' folders.
//
//     /members/id, condition, repeat, seed, status [M]   status: 0 waiting, 1 finished, 2 failed; id from 1
//     /members/name, state_hash, reason [M]              texts, "" if there is none; reason: of a failure; that a
//                                                        waiting member's process died, or that its result is not sound
//     /members/hole [M]                                  which of these, by a permanent name: failed, no_solution
//                                                        (failed by guard.no_solution), died, unsound, unreadable
//     /parameters/KEY [M]                                value in SI with attribute units, or text; NaN or "" if the
//                                                        case could not be read
//     /summary/NAME [M]                                  every number of summary.json that does not depend on time or
//                                                        machine; nested ones as A_B; NaN if there is none; the
//                                                        verdict as a number;
//                                                        attributes: key (A.B), order and, as registered, units,
//                                                        description; of an estimate also its name, label, kind
//     /series/time, ice_resistance, tow_force [M][T]     NaN after the end of a run
//     /events/member, time, kind, subject, value [E]     as in /events of result.h5, kind by its name; no group
//                                                        without events
//     /warnings, /reasons, /codes                        ensemble_record.h
//     /study, /study_resolved                            texts; attributes of the root: complete, n_members,
//                                                        n_finished, n_failed
//
// Each time the whole file is made under a temporary name, protected by a checksum and renamed: a reader finds the old
// or the new file. Only members whose files match their record (ensemble_record.h) are included. Members are written in
// their order, columns in the order of their first appearance, so the file depends on the set of finished members
// alone.
#include <inttypes.h>
#include <jansson.h>
#include <string.h>
#include <unistd.h>

#include "bergtow/ensemble.h"
#include "bergtow/event.h"
#include "run/ensemble_record.h"
#include "base/fileio.h"
#include "base/h5read.h"
#include "base/h5dataset.h"
#include "case/schema.h"
#include "base/checksum.h"
#include "bergtow/quantity.h"
#include "output/folder.h"
#include "output/summary_keys.h"
#include "base/inside.h"
#include "base/units.h"

static const char *const series[] = {"time", "ice_resistance", "tow_force"};
enum { N_SERIES = sizeof series / sizeof *series };
#define VERDICT "window.verdict"

typedef struct {
    char *name, *key; ///< A_B, and A.B as registered
    double *value;    ///< [M]
} column;

typedef struct {
    int64_t n;
    int64_t *id, *condition, *repeat, *seed, *status; ///< [n]
    char **name, **hash, **reason, **hole;
    bt_member_notes warnings, reasons;
    column *column;
    int n_columns;
    int64_t unread; ///< finished members that could not be read
} table;

/// Data of each member: numbers, and texts, which have no units.
static const struct {
    const char *path, *units, *meaning;
    size_t offset;
} columns[] = {
    {"/members/id", "1", "number of the member in the study, from 1", offsetof(table, id)},
    {"/members/condition", "1", "which condition of the study, from 0", offsetof(table, condition)},
    {"/members/repeat", "1", "which field of the condition, from 0", offsetof(table, repeat)},
    {"/members/seed", "1", "seed of the member's field", offsetof(table, seed)},
    {"/members/status", "1", "0 waiting, 1 finished, 2 failed", offsetof(table, status)},
    {"/members/name", NULL, "folder of the member", offsetof(table, name)},
    {"/members/state_hash", NULL, "hash of the state at the end of the run", offsetof(table, hash)},
    {"/members/reason", NULL, "why the member failed, died or is not sound", offsetof(table, reason)},
    {"/members/hole", NULL,
        "why the member has no numbers: failed, no_solution, died, unsound or unreadable", offsetof(table, hole)},
};
enum { N_COLUMNS = sizeof columns / sizeof *columns };

static void **array_of(const table *t, int k) { return (void **)(void *)((char *)t + columns[k].offset); }

static void put_text(char **to, const char *text)
{
    free(*to);
    *to = bt_text_copy(text);
}

static double *column_of(table *t, const char *name, const char *key)
{
    for (int k = 0; k < t->n_columns; k++)
        if (!strcmp(t->column[k].name, name)) return t->column[k].value;
    t->column = bt_realloc(t->column, (size_t)t->n_columns + 1, sizeof *t->column);
    column *c = &t->column[t->n_columns++];
    *c = (column){bt_text_copy(name), bt_text_copy(key), bt_alloc((size_t)t->n, sizeof(double))};
    for (int64_t m = 0; m < t->n; m++) c->value[m] = NAN;
    return c->value;
}

/// Verdict as 0, 1 or 2; NaN for other texts.
static double verdict_number(const char *name)
{
    for (int k = 0; name && k <= BT_TOO_SHORT; k++)
        if (!strcmp(name, bt_verdict_names[k])) return k;
    return NAN;
}

/// Add the numbers of a summary, nested ones too. prefix: of the registered key, with its dots.
static void take_numbers(table *t, int64_t m, const json_t *object, const char *prefix)
{
    const char *key;
    json_t *value;
    json_object_foreach((json_t *)object, key, value)
    {
        char path[200], name[200];
        snprintf(path, sizeof path, "%s%s%.80s", prefix, *prefix ? "." : "", key);
        if (bt_summary_meaning(path).machine) continue;
        for (size_t i = 0; i <= strlen(path); i++) name[i] = (char)(path[i] == '.' ? '_' : path[i]);
        if (json_is_object(value)) take_numbers(t, m, value, path);
        else if (json_is_number(value)) column_of(t, name, path)[m] = json_number_value(value);
        else if (json_is_boolean(value)) column_of(t, name, path)[m] = json_is_true(value);
        else if (!strcmp(path, VERDICT)) column_of(t, name, path)[m] = verdict_number(json_string_value(value));
    }
}

static bt_status take_summary(table *t, int64_t m, const char *folder, bt_errors *err)
{
    json_t *root;
    const bt_status status = bt_member_summary(folder, &root, err);
    if (status != BT_OK) return status;
    take_numbers(t, m, root, "");
    const char *hash = json_string_value(json_object_get(root, "state_hash"));
    if (hash) put_text(&t->hash[m], hash);
    bt_member_notes_take(&t->warnings, t->id[m], json_object_get(root, "warnings"));
    bt_member_notes_take(&t->reasons, t->id[m], json_object_get(json_object_get(root, "window"), "reasons"));
    json_decref(root);
    return BT_OK;
}

/// Read a column of a member's result.h5; returns its length, 0 if there is none. `h5` keeps a read error: a row
/// without the numbers of a finished member would be taken for an unfinished one.
static hsize_t read_column(bt_h5 *h5, const char *folder, const char *group, const char *column_name, double **out)
{
    *out = NULL;
    const char *path = BT_PATH(folder, "result.h5");
    hsize_t n = 0;
    int errnum = 0;
    const hid_t file = bt_h5_open_file(path, &errnum),
                set = file >= 0 ? H5Dopen2(file, BT_PATH(group, column_name), H5P_DEFAULT) : -1;
    if (set >= 0) {
        const hid_t space = H5Dget_space(set);
        hsize_t dims[H5S_MAX_RANK] = {0};
        if (H5Sget_simple_extent_dims(space, dims, NULL) == 1) {
            *out = bt_alloc(dims[0], sizeof **out);
            if (H5Dread(set, H5T_NATIVE_DOUBLE, H5S_ALL, H5S_ALL, H5P_DEFAULT, *out) >= 0) n = dims[0];
        }
        H5Sclose(space);
        H5Dclose(set);
    }
    if (file >= 0) H5Fclose(file);
    if (errnum && h5->status == BT_OK) bt_h5_give_up(h5, bt_file_fail(path, "read the file", errnum, h5->err));
    return n;
}

static void write_series(bt_h5 *h5, const table *t, const char *dir)
{
    hsize_t most = 0;
    for (int64_t m = 0; m < t->n; m++) {
        if (t->status[m] != BT_MEMBER_FINISHED) continue;
        const char *folder = BT_PATH(BT_PATH(dir, "members"), t->name[m]);
        double *x;
        const hsize_t n = read_column(h5, folder, "/series", series[0], &x);
        if (n > most) most = n;
        free(x);
    }
    bt_h5_group(h5, "/series");
    for (int k = 0; k < N_SERIES; k++) {
        const char *name = BT_PATH("/series", series[k]);
        hid_t set =
            bt_h5_growing(h5, name, H5T_NATIVE_DOUBLE, 2, (hsize_t[]){most}, (hsize_t[]){1, most ? most : 1}, true);
        double *row = bt_alloc(most, sizeof *row);
        for (int64_t m = 0; m < t->n; m++) {
            const char *folder = BT_PATH(BT_PATH(dir, "members"), t->name[m]);
            double *x;
            const hsize_t n = t->status[m] == BT_MEMBER_FINISHED ? read_column(h5, folder, "/series", series[k], &x)
                                                                    : (x = NULL, 0);
            for (hsize_t i = 0; i < most; i++) row[i] = i < n ? x[i] : (double)NAN;
            bt_h5_append(h5, set, H5T_NATIVE_DOUBLE, (hsize_t)m, 1, row);
            free(x);
        }
        free(row);
        bt_h5_describe(h5, name, "member sample", bt_series_find(series[k])->units,
                       bt_series_find(series[k])->description);
    }
}

/// Write the events of all members: statistics ask when a line broke, and which.
static void write_events(bt_h5 *h5, const table *t, const char *dir)
{
    static const char *const names[] = {"time", "kind", "subject", "value"};
    enum { TIME, KIND, SUBJECT, VALUE, N_NAMES };
    bt_events all = {0};
    int64_t *member = NULL;
    for (int64_t m = 0; m < t->n; m++) {
        if (t->status[m] != BT_MEMBER_FINISHED) continue;
        const char *folder = BT_PATH(BT_PATH(dir, "members"), t->name[m]);
        double *x[N_NAMES];
        hsize_t n = read_column(h5, folder, "/events", names[TIME], &x[TIME]);
        for (int k = KIND; k < N_NAMES; k++) {
            x[k] = NULL;
            const hsize_t others = n ? read_column(h5, folder, "/events", names[k], &x[k]) : 0;
            n = others < n ? others : n;
        }
        member = bt_realloc(member, (size_t)all.n + n + 1, sizeof *member);
        for (hsize_t i = 0; i < n; i++) {
            member[all.n] = t->id[m];
            bt_events_add(&all, x[TIME][i], (bt_event_kind)x[KIND][i], (int64_t)x[SUBJECT][i], x[VALUE][i]);
        }
        for (int k = 0; k < N_NAMES; k++) free(x[k]);
    }
    const hsize_t n = (hsize_t)all.n;
    double *time = bt_alloc(n, sizeof *time), *value = bt_alloc(n, sizeof *value);
    int64_t *subject = bt_alloc(n, sizeof *subject);
    const char **kind = bt_alloc(n, sizeof *kind);
    for (hsize_t i = 0; i < n; i++) {
        const bt_event *event = &all.event[i];
        time[i] = event->time, subject[i] = event->subject, value[i] = event->value;
        kind[i] = event->kind >= 0 && event->kind < BT_EVENT_KINDS ? bt_event_names[event->kind] : "unknown";
    }
    if (n > 0) {
        bt_h5_group(h5, "/events");
        bt_h5_put(h5, "/events/member", H5T_NATIVE_INT64, n, 0, member, "event", columns[0].units, columns[0].meaning);
        bt_h5_put(h5, "/events/time", H5T_NATIVE_DOUBLE, n, 0, time, "event", "s", "end of the step");
        bt_h5_put_names(h5, "/events/kind", n, kind, "event", "what happened");
        bt_h5_put(h5, "/events/subject", H5T_NATIVE_INT64, n, 0, subject, "event", "1",
                  "which branch (line_broken) or way-point (waypoint), from 1");
        bt_h5_put(h5, "/events/value", H5T_NATIVE_DOUBLE, n, 0, value, "event", NULL,
                  "tension N (line_broken), speed of the body m/s (adrift), distance along the path m (waypoint)");
    }
    BT_FREE(member, time, value, subject, kind);
    bt_events_free(&all);
}

/// Write a parameter as numbers, or as texts if it is a choice or a name.
static void write_parameter(bt_h5 *h5, const bt_study *study, int p, int64_t n)
{
    const bt_study_parameter *parameter = &study->parameter[p];
    const bt_key *key = parameter->key >= 0 ? &bt_case_keys[parameter->key] : NULL;
    const bool number = key && (key->type == BT_KEY_REAL || key->type == BT_KEY_INT || key->type == BT_KEY_BOOL);
    char **text = bt_alloc((size_t)n, sizeof *text);
    double *value = bt_alloc((size_t)n, sizeof *value);
    bt_member member;
    for (int64_t m = 0; m < n; m++) {
        bt_study_member(study, m, &member);
        text[m] = bt_text_copy(member.value[p]);
        bt_case input;
        bt_case_defaults(&input);
        char why[BT_WHY];
        const bool read = number && bt_value_read(key, &input, text[m], true, why);
        value[m] = read ? bt_value_number(key, &input) : (double)NAN;
        bt_case_free(&input);
        bt_member_free(&member);
    }
    const char *name = BT_PATH("/parameters", parameter->name);
    if (number) bt_h5_write(h5, name, H5T_NATIVE_DOUBLE, (hsize_t)n, 0, value);
    else bt_h5_write_names(h5, name, (hsize_t)n, (const char *const *)text);
    const char *unit = key && key->type == BT_KEY_REAL ? bt_units_symbol(key->unit) : "";
    bt_h5_describe(h5, name, "member", number ? *unit ? unit : "1" : NULL,
                   key ? key->doc : "which variant of the study");
    bt_h5_attr_text(h5, name, "key", parameter->name);
    char *distribution = bt_study_distribution(parameter);
    bt_h5_attr_text(h5, name, "distribution", distribution);
    bt_h5_attr_text(h5, name, "source", parameter->source ? parameter->source : "");
    free(distribution);
    for (int64_t m = 0; m < n; m++) free(text[m]);
    free(text);
    free(value);
}

/// Status of a member recorded as finished: finished if its files are sound, otherwise waiting, with the reason.
static bt_member_state take_finished(table *t, int64_t m, const char *folder, bt_member_records *records)
{
    bt_errors why = {0};
    bt_status status = bt_member_record_check(records, m, t->name[m], folder, &why);
    if (status == BT_OK) status = take_summary(t, m, folder, &why);
    t->unread += status == BT_ERR_IO;
    if (status != BT_OK) {
        free(t->reason[m]);
        t->reason[m] =
            bt_text_of("its result %s: %s", status == BT_ERR_IO ? "cannot be read" : "is not sound and is run again",
                       why.n ? why.text[0] : "no reason given");
        put_text(&t->hole[m], status == BT_ERR_IO ? "unreadable" : "unsound");
    }
    bt_errors_free(&why);
    return status == BT_OK ? BT_MEMBER_FINISHED : BT_MEMBER_WAITING;
}

static void fill(table *t, const bt_study *study, const char *dir, bt_member_records *records)
{
    t->n = bt_study_n_members(study);
    for (int k = 0; k < N_COLUMNS; k++)
        *array_of(t, k) = bt_alloc((size_t)t->n, columns[k].units ? sizeof(int64_t) : sizeof(char *));
    for (int64_t m = 0; m < t->n; m++) {
        bt_member member;
        bt_study_member(study, m, &member);
        const char *folder = BT_PATH(BT_PATH(dir, "members"), member.name);
        t->id[m] = m + 1;
        t->condition[m] = member.condition;
        t->repeat[m] = member.repeat;
        t->seed[m] = member.seed;
        t->name[m] = bt_text_copy(member.name);
        t->hash[m] = bt_text_copy("");
        t->status[m] = bt_ensemble_state(folder, NULL, &t->hole[m], &t->reason[m]);
        const bool died = t->status[m] == BT_MEMBER_WAITING && t->reason[m];
        if (!t->hole[m]) put_text(&t->hole[m], t->status[m] == BT_MEMBER_FAILED ? "failed" : died ? "died" : "");
        if (t->status[m] == BT_MEMBER_FINISHED) t->status[m] = take_finished(t, m, folder, records);
        if (!t->reason[m]) t->reason[m] = bt_text_copy("");
        bt_member_free(&member);
    }
}

static void release(table *t)
{
    for (int k = 0; k < N_COLUMNS; k++) {
        char **text = *array_of(t, k);
        for (int64_t m = 0; m < t->n && !columns[k].units; m++) free(text[m]);
        free(text);
    }
    bt_member_notes_free(&t->warnings);
    bt_member_notes_free(&t->reasons);
    for (int k = 0; k < t->n_columns; k++)
        BT_FREE(t->column[k].name, t->column[k].key, t->column[k].value);
    free(t->column);
}

/// Write the registered properties of a number as attributes.
static void describe(bt_h5 *h5, const char *name, const char *key, int order)
{
    const bt_meaning meaning = bt_summary_meaning(key);
    bt_h5_attr_text(h5, name, "key", key);
    bt_h5_attr_int(h5, name, "order", order);
    bt_h5_describe(h5, name, "member", meaning.known && *meaning.units ? meaning.units : "1",
                   meaning.known ? meaning.description : key);
    if (!strcmp(key, VERDICT)) bt_h5_attr_text(h5, name, "meaning", "0 steady, 1 not steady, 2 too short");
    if (!meaning.known) return;
    const struct {
        const char *name, *text;
    } texts[] = {{"estimate", meaning.estimate},
                 {"label", meaning.label},
                 {"kind", meaning.kind}};
    for (size_t i = 0; i < sizeof texts / sizeof *texts; i++)
        if (*texts[i].text) bt_h5_attr_text(h5, name, texts[i].name, texts[i].text);
}

static void write_members(bt_h5 *h5, const table *t)
{
    const hsize_t n = (hsize_t)t->n;
    bt_h5_put(h5, "/member", H5T_NATIVE_INT64, n, 0, t->id, "member", columns[0].units, columns[0].meaning);
    bt_h5_group(h5, "/members");
    for (int k = 0; k < N_COLUMNS; k++) {
        void *array = *array_of(t, k);
        if (columns[k].units)
            bt_h5_put(h5, columns[k].path, H5T_NATIVE_INT64, n, 0, array, "member", "1", columns[k].meaning);
        else bt_h5_put_names(h5, columns[k].path, n, array, "member", columns[k].meaning);
    }
    bt_h5_attr_text(h5, "/members/status", "meaning", "0 waiting, 1 finished, 2 failed");
}

static void write_all(bt_h5 *h5, const table *t, const bt_study *study, const char *dir)
{
    int64_t finished = 0, failed = 0;
    for (int64_t m = 0; m < t->n; m++) {
        finished += t->status[m] == BT_MEMBER_FINISHED;
        failed += t->status[m] == BT_MEMBER_FAILED;
    }
    write_members(h5, t);
    bt_h5_group(h5, "/parameters");
    for (int p = 0; p < study->n_parameters; p++) write_parameter(h5, study, p, t->n);
    bt_h5_group(h5, "/summary");
    for (int k = 0; k < t->n_columns; k++) {
        const char *name = BT_PATH("/summary", t->column[k].name);
        bt_h5_write(h5, name, H5T_NATIVE_DOUBLE, (hsize_t)t->n, 0, t->column[k].value);
        describe(h5, name, t->column[k].key, k);
    }
    write_series(h5, t, dir);
    write_events(h5, t, dir);
    bt_member_notes_write(h5, &t->warnings, "/warnings", "warning", "code of the warning");
    bt_member_notes_write(h5, &t->reasons, "/reasons", "reason", "code of a reason of the verdict");
    bt_warning_codes_write(h5);
    bt_h5_put_text(h5, "/study", study->text, "the study file as it was given");
    bt_h5_describe_file(h5, study->title);
    char *resolved;
    size_t size;
    if (bt_file_read(BT_PATH(dir, BT_FOLDER_STUDY), "a study", &resolved, &size, NULL) == BT_OK)
        bt_h5_put_text(h5, "/study_resolved", resolved, "what the members are, and the base case with every key");
    free(resolved);
    bt_h5_attr_text(h5, "/", "program", "bergtow " BT_VERSION);
    bt_h5_attr_int(h5, "/", "n_members", t->n);
    bt_h5_attr_int(h5, "/", "n_finished", finished);
    bt_h5_attr_int(h5, "/", "n_failed", failed);
    bt_h5_attr_int(h5, "/", "complete", finished + failed == t->n);
}

bt_status bt_ensemble_gather(const bt_study *study, const char *dir, bt_member_records *records,
                             bt_member_notes *warnings, bt_errors *err)
{
    table t = {0};
    fill(&t, study, dir, records);
    const char *path = BT_PATH(dir, "ensemble.h5"), *part = BT_PATH(dir, "ensemble.h5.tmp");
    bt_h5 h5;
    bt_status status = bt_h5_create(&h5, part, err);
    if (status == BT_OK) {
        write_all(&h5, &t, study, dir);
        status = bt_h5_close(&h5);
        if (status == BT_OK) status = bt_checksum_publish(part, path, BT_CHECKSUM_ENSEMBLE, err);
        if (status != BT_OK) unlink(part);
    }
    if (status == BT_OK && t.unread)
        status = bt_fail(err, BT_ERR_IO,
            "%s: %" PRId64 " finished members are not in it, because their files could not be read; correct that, and "
            "call again",
            path, t.unread);
    bt_member_notes_free(warnings);
    *warnings = t.warnings;
    t.warnings = (bt_member_notes){0};
    release(&t);
    return status;
}
