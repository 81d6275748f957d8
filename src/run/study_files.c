// SPDX-License-Identifier: MIT
// The files that the cases of a study name; reasons in study.h.
#include "run/study.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "base/fileio.h"
#include "base/largest.h"
#include "case/case_check.h"
#include "case/case_files.h"
#include "case/value.h"

/// Take over a path. A file that cannot be read is left out.
static void add(bt_study_files *f, char *path)
{
    bt_named_file x = {.path = path};
    bt_errors unheard = {0};
    bool wanted = path && stat(path, &x.seen) == 0;
    for (int i = 0; i < f->n && wanted; i++) wanted = strcmp(f->list[i].path, path) != 0;
    if (wanted && bt_checksum_digest_file(path, x.digest, &x.bytes, &unheard) == BT_OK) {
        f->list = bt_realloc(f->list, (size_t)f->n + 1, sizeof *f->list);
        f->list[f->n++] = x;
    } else {
        free(path);
    }
    bt_errors_free(&unheard);
}

static char *text_of(const bt_key *k, const bt_case *c)
{
    const char *text = bt_case_file(c, k);
    return text ? bt_text_copy(text) : NULL;
}

/// The file that a text says for a key that stands in a study; the path is relative to the base case, as in a member.
static char *file_of(const bt_study *s, const bt_key *k, const char *value)
{
    bt_case scratch;
    bt_case_defaults(&scratch);
    char why[BT_WHY], *said = NULL;
    if (bt_value_read(k, &scratch, value, true, why)) said = text_of(k, &scratch);
    bt_case_free(&scratch);
    char *absolute = said ? bt_case_named_file(s->base, said) : NULL;
    if (!absolute) return said;
    free(said);
    return absolute;
}

static void add_of_axes(bt_study_files *f, const bt_study *s)
{
    int n;
    bt_study_setting *list = bt_study_settings(s, &n);
    for (int i = 0; i < n; i++) {
        char name[96];
        snprintf(name, sizeof name, "%.*s", list[i].length, list[i].text);
        const bt_key *k = &bt_case_keys[bt_schema_find(bt_case_keys, bt_n_case_keys, name)];
        const bt_study_parameter *p = &s->parameter[list[i].axis];
        if (!k->file) continue;
        if (list[i].text[list[i].length] == '=') add(f, file_of(s, k, list[i].text + list[i].length + 1));
        else
            for (int v = 0; v < p->n; v++) add(f, file_of(s, k, p->value[v]));
    }
    free(list);
}

void bt_study_files_find(bt_study_files *f, const bt_study *s)
{
    *f = (bt_study_files){0};
    bt_case c;
    bt_errors unheard = {0};
    if (bt_study_base_case(s, &c, &unheard) == BT_OK)
        for (int k = 0; k < bt_n_case_keys; k++)
            add(f, text_of(&bt_case_keys[k], &c));
    bt_case_free(&c);
    bt_errors_free(&unheard);
    add_of_axes(f, s);
}

void bt_study_files_free(bt_study_files *f)
{
    for (int i = 0; i < f->n; i++) free(f->list[i].path);
    free(f->list);
    *f = (bt_study_files){0};
}

bt_status bt_study_files_keep(const bt_study_files *f, const char *dir, bool old, bt_errors *warnings, bt_errors *err)
{
    char *path = bt_file_join(dir, "study.files"), *kept = NULL;
    size_t size;
    bt_status status = BT_OK;
    if (access(path, F_OK) == 0)
        status = bt_file_read_to(path, "a list of files", BT_MOST_TEXT_BYTES, &kept, &size, err);
    bt_text text;
    bt_text_begin(&text);
    fputs(kept ? kept : "", text.out);
    int added = 0;
    for (int i = 0; i < f->n && status == BT_OK; i++) {
        const bt_named_file *x = &f->list[i];
        char line[96];
        snprintf(line, sizeof line, "%" PRId64 " bytes, xxh128 %s\n", x->bytes, x->digest);
        const char *before = bt_case_said_of(kept, x->path);
        if (before && strncmp(before, line, strlen(line))) {
            bt_errors_add(err, "%s: has changed since members in %s were made with it, and is of another study now; "
                               "restore it, or give another folder with -o", x->path, dir);
            status = BT_ERR_CASE;
        }
        if (before) continue;
        fprintf(text.out, "%s: %s", x->path, line);
        added++;
        if (old)
            bt_errors_add(warnings, "warning: %s: nothing in %s tells what it held when members were made with it; it "
                                    "is taken as it is now", x->path, dir);
    }
    char *now = bt_text_end(&text);
    if (status == BT_OK && added) status = bt_file_write(path, now, err);
    free(now);
    free(kept);
    free(path);
    return status;
}

static bool same_stat(const struct stat *a, const struct stat *b)
{
    return a->st_ino == b->st_ino && a->st_size == b->st_size && a->st_mtim.tv_sec == b->st_mtim.tv_sec &&
           a->st_mtim.tv_nsec == b->st_mtim.tv_nsec && a->st_ctim.tv_sec == b->st_ctim.tv_sec &&
           a->st_ctim.tv_nsec == b->st_ctim.tv_nsec;
}

bt_status bt_study_files_same(bt_study_files *f, bt_errors *err)
{
    for (int i = 0; i < f->n; i++) {
        bt_named_file *x = &f->list[i], now = {0};
        bt_errors unheard = {0};
        // of one that is gone a member says so
        if (stat(x->path, &now.seen) != 0 || same_stat(&x->seen, &now.seen)) continue;
        const bool read = bt_checksum_digest_file(x->path, now.digest, &now.bytes, &unheard) == BT_OK;
        bt_errors_free(&unheard);
        if (!read) continue;
        if (strcmp(now.digest, x->digest)) {
            bt_errors_add(err, "%s: has changed while the members of a study were made with it: restore it and call "
                               "again, or give another folder with -o", x->path);
            return BT_ERR_CASE;
        }
        x->seen = now.seen;
    }
    return BT_OK;
}
