// SPDX-License-Identifier: MIT
// The record of a finished member; reasons in ensemble_record.h.
#include "run/ensemble_record.h"

#include <inttypes.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>
#include <xxhash.h>

#include "base/checksum.h"
#include "base/fileio.h"
#include "base/h5dataset.h"
#include "base/inside.h"
#include "case/warning.h"
#include "output/checkpoint.h"

// --- notes of a member -----------------------------------------------------------------------------------------------

static char *copied(const json_t *value)
{
    const char *text = json_string_value(value);
    return bt_text_copy(text ? text : "");
}

void bt_member_notes_take(bt_member_notes *notes, int64_t member, const json_t *array)
{
    size_t i;
    json_t *entry;
    json_array_foreach((json_t *)array, i, entry)
    {
        if (!json_is_object(entry)) continue;
        if (notes->n == notes->cap) {
            notes->cap = notes->cap ? 2 * notes->cap : 64;
            notes->member = bt_realloc(notes->member, (size_t)notes->cap, sizeof *notes->member);
            notes->code = bt_realloc(notes->code, (size_t)notes->cap, sizeof *notes->code);
            notes->text = bt_realloc(notes->text, (size_t)notes->cap, sizeof *notes->text);
            notes->values = bt_realloc(notes->values, (size_t)notes->cap, sizeof *notes->values);
        }
        char *values = json_dumps(json_object_get(entry, "values"), 0);
        notes->member[notes->n] = member;
        notes->code[notes->n] = copied(json_object_get(entry, "code"));
        notes->text[notes->n] = copied(json_object_get(entry, "text"));
        notes->values[notes->n++] = bt_text_copy(values ? values : "{}");
        free(values);
    }
}

static void write_texts(bt_h5 *h5, const char *group, const char *name, const char *axis, int64_t n,
                        const char *const *texts, const char *meaning)
{
    bt_h5_put_names(h5, BT_PATH(group, name), (hsize_t)n, texts, axis, meaning);
}

void bt_member_notes_write(bt_h5 *h5, const bt_member_notes *notes, const char *group, const char *axis,
                           const char *what)
{
    if (notes->n == 0) return;
    bt_h5_group(h5, group);
    bt_h5_put(h5, BT_PATH(group, "member"), H5T_NATIVE_INT64, (hsize_t)notes->n, 0, notes->member, axis, "1",
              "number of the member in the study, from 1");
    write_texts(h5, group, "code", axis, notes->n, (const char *const *)notes->code, what);
    write_texts(h5, group, "text", axis, notes->n, (const char *const *)notes->text, "message text");
    write_texts(h5, group, "values", axis, notes->n, (const char *const *)notes->values,
        "values in the message, as JSON");
}

void bt_member_notes_free(bt_member_notes *notes)
{
    for (int64_t i = 0; i < notes->n; i++)
        BT_FREE(notes->code[i], notes->text[i], notes->values[i]);
    BT_FREE(notes->member, notes->code, notes->text, notes->values);
    *notes = (bt_member_notes){0};
}

void bt_warning_codes_write(bt_h5 *h5)
{
    const char *column[2][BT_N_WARNINGS];
    for (int k = 0; k < BT_N_WARNINGS; k++) {
        column[0][k] = bt_warning_rows[k].code;
        column[1][k] = bt_warning_rows[k].meaning;
    }
    bt_h5_group(h5, "/codes");
    write_texts(h5, "/codes", "code", "warning_code", BT_N_WARNINGS, column[0], "codes of warnings and reasons");
    write_texts(h5, "/codes", "meaning", "warning_code", BT_N_WARNINGS, column[1], "what each stands for");
}

// --- its record ------------------------------------------------------------------------------------------------------

#define RECORD "finished"
static const char *const files[] = {"summary.json", "result.h5", "case.resolved.yml"};
enum { N_FILES = sizeof files / sizeof *files, MAX_TEXT = 1024 };
_Static_assert((int)BT_DIGEST_TEXT == (int)BT_CHECKSUM_DIGEST, "the same digest");

void bt_member_records_begin(bt_member_records *records, const bt_study *s, const char study[BT_DIGEST_TEXT])
{
    *records = (bt_member_records){.n = bt_study_n_members(s)};
    memcpy(records->study, study, sizeof records->study);
    records->seen = bt_alloc((size_t)records->n, sizeof *records->seen);
}

void bt_member_records_end(bt_member_records *records)
{
    free(records->seen);
    *records = (bt_member_records){0};
}

/// Stamp of the files of a member, which shows whether any has changed; 0 if one is missing.
static uint64_t stamp(const char *folder)
{
    uint64_t part[N_FILES + 1][6];
    memset(part, 0, sizeof part);
    for (int k = 0; k <= N_FILES; k++) {
        struct stat st;
        if (stat(BT_PATH(folder, k < N_FILES ? files[k] : RECORD), &st) != 0) return 0;
        const uint64_t of[6] = {(uint64_t)st.st_ino,         (uint64_t)st.st_size,
                                (uint64_t)st.st_mtim.tv_sec, (uint64_t)st.st_mtim.tv_nsec,
                                (uint64_t)st.st_ctim.tv_sec, (uint64_t)st.st_ctim.tv_nsec};
        memcpy(part[k], of, sizeof of);
    }
    const uint64_t all = XXH3_64bits(part, sizeof part);
    return all ? all : 1;
}

/// Make the record of the present files. Errors: BT_ERR_CASE, a file is missing; BT_ERR_IO.
static bt_status make(const bt_member_records *records, const char *name, const char *folder, char text[MAX_TEXT],
                      bt_errors *err)
{
    int n = snprintf(text, MAX_TEXT, "bergtow finished member 1\nname: %.100s\nstudy: %s\n", name, records->study);
    for (int k = 0; k < N_FILES; k++) {
        char digest[BT_CHECKSUM_DIGEST];
        int64_t bytes;
        const bt_status status = bt_checksum_digest_file(BT_PATH(folder, files[k]), digest, &bytes, err);
        if (status != BT_OK) return status;
        n += snprintf(text + n, (size_t)(MAX_TEXT - n), "%s: %" PRId64 " bytes, xxh128 %s\n", files[k], bytes, digest);
    }
    return BT_OK;
}

bt_status bt_member_summary(const char *folder, json_t **root, bt_errors *err)
{
    const char *path = BT_PATH(folder, "summary.json");
    char *text;
    size_t size;
    json_error_t why = {0};
    *root = NULL;
    bt_status status = bt_file_read(path, "a summary", &text, &size, err);
    if (status == BT_OK) *root = json_loadb(text, size, JSON_REJECT_DUPLICATES, &why);
    if (status == BT_OK && !json_is_object(*root)) {
        json_decref(*root);
        *root = NULL;
        status = bt_fail(err, BT_ERR_CASE,
                         "%s: cannot be read as JSON: line %d: %s; check the disk", path, why.line, why.text);
    }
    free(text);
    return status;
}

/// Is it the summary of a whole run, neither truncated nor of a stopped run?
static bt_status check_summary(const char *folder, bt_errors *err)
{
    static const char *const numbers[] = {"n_steps", "n_floes", "sim_time_s", NULL};
    json_t *root;
    if (bt_member_summary(folder, &root, err) != BT_OK) return BT_ERR_IO;
    const char *path = BT_PATH(folder, "summary.json");
    const char *missing = json_is_string(json_object_get(root, "state_hash")) ? NULL : "state_hash";
    for (int k = 0; numbers[k] && !missing; k++)
        if (!json_is_number(json_object_get(root, numbers[k]))) missing = numbers[k];
    const bool stopped = json_is_string(json_object_get(root, "stopped"));
    if (missing) bt_errors_add(err, "%s: has no %s; check the disk", path, missing);
    else if (stopped) bt_errors_add(err, "%s: is of a run that was stopped", path);
    const bt_status status = !missing && !stopped ? BT_OK : BT_ERR_IO;
    json_decref(root);
    return status;
}

bool bt_member_is_whole(const char *folder, int64_t n_steps)
{
    json_t *root;
    const bool whole = bt_member_summary(folder, &root, NULL) == BT_OK &&
                       json_integer_value(json_object_get(root, "n_steps")) >= n_steps;
    json_decref(root);
    return whole;
}

bt_status bt_member_record_write(bt_member_records *records, int64_t m, const char *name, const char *folder,
                                 bt_errors *err)
{
    char text[MAX_TEXT];
    bt_status status = bt_checksum_check(BT_PATH(folder, "result.h5"), BT_CHECKSUM_RESULT, NULL, err);
    if (status == BT_OK) status = check_summary(folder, err);
    if (status == BT_OK) status = make(records, name, folder, text, err);
    if (status == BT_OK) status = bt_file_write(BT_PATH(folder, RECORD), text, err);
    if (status == BT_OK) records->seen[m] = stamp(folder);
    return status == BT_OK ? BT_OK : BT_ERR_IO;
}

/// The value after "key" in its line of a record, "" if there is none.
static void line_of(const char *text, const char *key, char out[128])
{
    const size_t n = strlen(key);
    *out = 0;
    for (const char *at = text; at && *at; at = strchr(at, '\n') ? strchr(at, '\n') + 1 : NULL)
        if (!strncmp(at, key, n) && at[n] == ':')
            snprintf(out, 128, "%.*s", (int)bt_min((double)strcspn(at, "\n"), 127), at);
}

/// Report how a record differs from that of the present files.
static void report(const char *folder, const char *kept, const char *wanted, bt_errors *err)
{
    static const char *const whose[] = {"name", "study"};
    char a[128], b[128];
    if (strncmp(kept, "bergtow finished member 1\n", 26)) {
        bt_errors_add(err, "%s/%s: is not a record of a finished member", folder, RECORD);
        return;
    }
    for (int k = 0; k < 2; k++) {
        line_of(kept, whose[k], a), line_of(wanted, whose[k], b);
        if (strcmp(a, b)) {
            bt_errors_add(err, "%s/%s: is of another %s", folder, RECORD, k ? "study" : "member");
            return;
        }
    }
    for (int k = 0; k < N_FILES; k++) {
        line_of(kept, files[k], a), line_of(wanted, files[k], b);
        if (strcmp(a, b)) bt_errors_add(err, "%s/%s: has changed since the member finished", folder, files[k]);
    }
    if (err->n == 0) bt_errors_add(err, "%s/%s: is damaged", folder, RECORD);
}

bt_status bt_member_record_check(bt_member_records *records, int64_t m, const char *name, const char *folder,
                                 bt_errors *err)
{
    const uint64_t now = stamp(folder);
    if (now && records->seen[m] == now) return BT_OK;
    const char *path = BT_PATH(folder, RECORD);
    char text[MAX_TEXT], digest[BT_CHECKSUM_DIGEST], *kept = NULL;
    size_t size = 0;
    int64_t bytes;
    bt_errors why = {0};
    bt_status status = bt_checksum_digest_file(path, digest, &bytes, &why); // is there a readable record?
    if (status == BT_OK) status = bt_file_read_to(path, "a record", MAX_TEXT, &kept, &size, &why);
    if (status == BT_OK) status = make(records, name, folder, text, &why);
    if (status == BT_OK && (size != strlen(text) || memcmp(kept, text, size))) {
        report(folder, kept, text, &why);
        status = BT_ERR_CASE;
    }
    records->seen[m] = status == BT_OK ? now : 0;
    bt_errors_move(err, &why);
    free(kept);
    return status;
}

bt_status bt_member_record_forget(const char *folder, bt_errors *err)
{
    // first: without it the member is waiting, whatever else is left
    const bt_status status = bt_file_remove(BT_PATH(folder, RECORD), err);
    if (status != BT_OK) return status;
    for (int k = 0; k < N_FILES; k++) bt_file_remove(BT_PATH(folder, files[k]), NULL); // a new run replaces them anyway
    bt_checkpoint_remove(folder);
    return BT_OK;
}
