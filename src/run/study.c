// SPDX-License-Identifier: MIT
// Members of a study: the values that each takes.
#include "bergtow/study.h"

#include <inttypes.h>
#include <string.h>
#include <unistd.h>

#include "base/fileio.h"
#include "base/inside.h"
#include "base/largest.h"
#include "base/rng.h"
#include "case/case_check.h"
#include "case/case_derived.h"
#include "case/case_files.h"
#include "case/schema.h"
#include "run/study.h"

static void free_texts(char **text, int n)
{
    for (int i = 0; i < n; i++) free(text[i]);
    free(text);
}

void bt_study_free(bt_study *study)
{
    for (int i = 0; i < study->n_parameters; i++) {
        BT_FREE(study->parameter[i].name, study->parameter[i].at, study->parameter[i].source,
                study->parameter[i].stratum);
        free_texts(study->parameter[i].value, study->parameter[i].n);
    }
    for (int i = 0; i < study->n_variants; i++) {
        free(study->variant[i].name);
        free_texts(study->variant[i].set, study->variant[i].n_set);
        free_texts(study->variant[i].at, study->variant[i].n_set);
    }
    free(study->variant);
    free_texts(study->set, study->n_set);
    free_texts(study->set_at, study->n_set);
    BT_FREE(study->path, study->text, study->title, study->base_name, study->base);
    *study = (bt_study){0};
}

// --- members ---------------------------------------------------------------------------------------------------------

static void add_override(bt_member *member, char *set, const char *at)
{
    member->at[member->n_set] = at;
    member->set[member->n_set++] = set;
}

void bt_study_member(const bt_study *study, int64_t m, bt_member *out)
{
    BT_PLAIN_NUMBERS;
    *out = (bt_member){.condition = m / study->repeats, .repeat = m % study->repeats};
    snprintf(out->name, sizeof out->name, "c%03" PRId64 "-r%03" PRId64, out->condition + 1, out->repeat + 1);
    const int64_t condition = study->fields == BT_FIELDS_OWN ? out->condition : 0;
    bt_rng rng = bt_rng_start(study->seed, BT_RNG_MEMBER, condition * ((int64_t)1 << 32) + out->repeat);
    out->seed = study->fields == BT_FIELDS_NUMBERED ? study->seed + out->repeat
                                                    : (int64_t)(bt_rng_bits(&rng) >> 2); // below 4.7e18
    int most = study->n_set + study->n_parameters + 1;
    for (int i = 0; i < study->n_variants; i++) most += study->variant[i].n_set;
    out->set = bt_alloc((size_t)most, sizeof *out->set);
    out->at = bt_alloc((size_t)most, sizeof *out->at);
    for (int i = 0; i < study->n_set; i++) add_override(out, bt_text_copy(study->set[i]), study->set_at[i]);
    for (int p = 0; p < study->n_parameters; p++) {
        const char *value = out->value[p] = bt_study_value(study, p, out->condition);
        if (study->parameter[p].key >= 0) {
            add_override(out, bt_text_of("%s=%s", study->parameter[p].name, value), study->parameter[p].at);
            value = out->set[out->n_set - 1];
        }
        for (int i = 0; i < study->n_variants; i++) {
            const bt_study_variant *variant = &study->variant[i];
            for (int k = 0; k < variant->n_set && variant->axis == p && !strcmp(variant->name, value); k++)
                add_override(out, bt_text_copy(variant->set[k]), variant->at[k]);
        }
    }
    add_override(out, bt_text_of("ice.seed=%" PRId64, out->seed), NULL);
}

void bt_member_free(bt_member *member)
{
    free_texts(member->set, member->n_set);
    free(member->at);
    for (int i = 0; i < BT_MAX_PARAMETERS; i++) free(member->value[i]);
    *member = (bt_member){0};
}

/// Title of a member from that of the study; the title of the base case, of one condition, would be wrong.
static void name_member(const bt_study *study, const bt_member *member, bt_case *input)
{
    for (int i = 0; i < member->n_set; i++)
        if (!strncmp(member->set[i], "run.title=", 10)) return;
    if (!study->title || !*study->title) return;
    char text[1024];
    size_t n = (size_t)snprintf(text, sizeof text, "%s", study->title);
    for (int p = 0; p < study->n_parameters && n < sizeof text; p++) {
        const char *key = study->parameter[p].key >= 0 ? study->parameter[p].name : "";
        n += (size_t)snprintf(text + n, sizeof text - n, ", %s%s%s", key, *key ? " " : "", member->value[p]);
    }
    if (n >= sizeof text) return;
    free(input->run.title);
    input->run.title = bt_text_of("%s, field %" PRId64, text, member->repeat + 1);
}

bt_status bt_member_case(const bt_study *study, const bt_member *member, bt_case *input, bt_errors *err)
{
    BT_PLAIN_NUMBERS;
    const bt_status status = bt_case_read_placed(input, study->base, (const char *const *)member->set, member->at,
                                                 member->n_set, err);
    if (status == BT_OK) name_member(study, member, input);
    return status;
}

bt_status bt_study_base_case(const bt_study *study, bt_case *input, bt_errors *err)
{
    BT_PLAIN_NUMBERS;
    static const char *const none[] = {NULL};
    return bt_case_read_placed(input, study->base, (const char *const *)study->set,
                               study->set_at ? (const char *const *)study->set_at : none, study->n_set, err);
}

/// Length of a line of YAML without its comment.
static size_t said_in(const char *line)
{
    size_t said = 0;
    bool quoted = false;
    for (size_t i = 0; line[i] && line[i] != '\n'; i++) {
        if (quoted && line[i] == '\\' && line[i + 1] && line[i + 1] != '\n') i++;
        else if (line[i] == '"') quoted = !quoted;
        else if (!quoted && line[i] == '#' && (i == 0 || line[i - 1] == ' ')) break;
        if (line[i] != ' ') said = i + 1;
    }
    return said;
}

/// The first lines that differ, which are empty at the end of a text; false if there are none. section: where the first
/// of them belongs, the last line before it of less indent, or NULL.
static bool first_difference(const char **a, const char **b, const char **section)
{
    const char *above[8] = {NULL}; // by indent
    const size_t most = sizeof above / sizeof *above - 1;
    while (**a || **b) {
        const size_t n = said_in(*a), indent = strspn(*a, " ") / 2;
        *section = indent > 0 ? above[(indent < most ? indent : most) - 1] : NULL;
        if (n != said_in(*b) || memcmp(*a, *b, n)) return true;
        if (n > 0) above[indent < most ? indent : most] = *a;
        *a += strcspn(*a, "\n"), *b += strcspn(*b, "\n");
        *a += **a == '\n', *b += **b == '\n';
    }
    return false;
}

bool bt_study_resolved_alike(const char *a, const char *b)
{
    BT_PLAIN_NUMBERS;
    const char *section;
    return !first_difference(&a, &b, &section);
}

char *bt_study_difference(const char *before, const char *now)
{
    const char *section;
    if (!first_difference(&before, &now, &section)) return NULL;
    const size_t skip[] = {strspn(before, " "), strspn(now, " ")}, n[] = {said_in(before), said_in(now)};
    return bt_text_of("%.*s%s`%.*s` there, `%.*s` now", section ? (int)said_in(section) : 0, section ? section : "",
                      section ? " " : "", n[0] > skip[0] ? (int)(n[0] - skip[0]) : 0, before + skip[0],
                      n[1] > skip[1] ? (int)(n[1] - skip[1]) : 0, now + skip[1]);
}

/// The word for a choice in a study.
static const char *word(const char *key, unsigned choice)
{
    return bt_study_keys[bt_schema_find(bt_study_keys, bt_n_study_keys, key)].choices[choice];
}

char *bt_study_resolved(const bt_study *study, bt_errors *err)
{
    BT_PLAIN_NUMBERS;
    bt_case input;
    const bt_status status = bt_study_base_case(study, &input, err);
    char *base = status == BT_OK ? bt_case_resolved(&input) : NULL;
    bt_case_free(&input);
    if (!base) return NULL;
    bt_text text;
    bt_text_begin(&text);
    FILE *out = text.out;
    fprintf(out, "# bergtow study: what its members are. More repeats may be asked for later; anything else is another "
                 "study.\n");
    fprintf(out, "seed: %" PRId64 "\nsampling: %s\nconditions: %" PRId64 "\n", study->seed,
            word("sampling", study->sampling), study->n_conditions);
    if (study->fields != BT_FIELDS_OWN) fprintf(out, "fields: %s\n", word("fields", study->fields));
    for (int p = 0; p < study->n_parameters; p++) {
        fprintf(out, "%s:", study->parameter[p].name);
        const bt_study_parameter *parameter = &study->parameter[p];
        if (parameter->continuous && study->sampling == BT_SAMPLING_LATIN_HYPERCUBE) {
            fprintf(out, " %s%s from %.17g to %.17g, %s", bt_study_is_whole(parameter) ? "whole numbers, " : "",
                    parameter->logarithmic ? "log" : "linear", parameter->from, parameter->to,
                    bt_distribution_name(parameter->distribution));
        } else
            for (int i = 0; i < study->parameter[p].n; i++)
                fprintf(out, "%s %s", i ? "," : "", study->parameter[p].value[i]);
        fputc('\n', out);
    }
    for (int i = 0; i < study->n_variants; i++)
        for (int k = 0; k < study->variant[i].n_set; k++)
            fprintf(out, "%s %s: %s\n", bt_is_with(study, &study->variant[i]) ? "with" : "variant",
                    study->variant[i].name, study->variant[i].set[k]);
    fprintf(out, "# base case with `set`\n%s", base);
    free(base);
    return bt_text_end(&text);
}

// --- keys that only some members get ---------------------------------------------------------------------------------

/// List all such keys, those of parameters first; the caller frees the list.
static bt_study_setting *study_settings(const bt_study *study, int *n)
{
    size_t most = (size_t)study->n_parameters + 1;
    for (int i = 0; i < study->n_variants; i++) most += (size_t)study->variant[i].n_set;
    bt_study_setting *list = bt_alloc(most, sizeof *list), *to = list;
    for (int p = 0; p < study->n_parameters; p++) {
        const bt_study_parameter *parameter = &study->parameter[p];
        if (parameter->key >= 0)
            *to++ = (bt_study_setting){parameter->name, (int)strlen(parameter->name), parameter->at, "parameters", p};
    }
    for (int i = 0; i < study->n_variants; i++) {
        const bt_study_variant *variant = &study->variant[i];
        for (int k = 0; k < variant->n_set; k++)
            *to++ = (bt_study_setting){variant->set[k], (int)strcspn(variant->set[k], "="), variant->at[k],
                                       bt_is_with(study, variant) ? "with" : "variants", variant->axis};
    }
    *n = (int)(to - list);
    return list;
}

/// Order of their keys.
static int by_key(const bt_study_setting *a, const bt_study_setting *b)
{
    const int order = strncmp(a->text, b->text, (size_t)(a->length < b->length ? a->length : b->length));
    return order ? order : a->length - b->length;
}

const char *bt_study_varied(const bt_study *study, const char *key)
{
    const bt_study_setting wanted = {.text = key, .length = (int)strlen(key)};
    const char *section = NULL;
    int n;
    bt_study_setting *list = study_settings(study, &n);
    for (int i = 0; i < n && !section; i++)
        if (by_key(&list[i], &wanted) == 0) section = list[i].section;
    free(list);
    return section;
}

/// Order that brings equal keys together, in the order of the list.
static int by_key_in_list(const void *a, const void *b)
{
    const bt_study_setting *p = *(const bt_study_setting *const *)a, *q = *(const bt_study_setting *const *)b;
    const int order = by_key(p, q);
    return order ? order : (p > q) - (p < q);
}

void bt_study_check_axes(const bt_study *study, bt_errors *err)
{
    int n;
    bt_study_setting *list = study_settings(study, &n);
    const bt_study_setting **sorted = bt_alloc((size_t)n + 1, sizeof *sorted);
    for (int i = 0; i < n; i++) sorted[i] = &list[i];
    qsort(sorted, (size_t)n, sizeof *sorted, by_key_in_list);
    for (int i = 1, first = 0; i < n; i++) {
        const bt_study_setting *x = sorted[i], *y = sorted[first];
        if (by_key(x, y)) {
            first = i;
            continue;
        }
        // the sets of one parameter go to different members; its own key, which comes first, goes to all
        if (x->axis == y->axis && study->parameter[y->axis].name != y->text) continue;
        bt_errors_add(err, "%s%.*s: is given under `%s`, and under `%s` in %.*s: a member would run with one value and "
                           "be recorded with the other; remove one",
                      x->at, x->length, x->text, x->section, y->section, (int)strlen(y->at) - 2, y->at);
    }
    free(sorted);
    free(list);
}

/// The verdict that the conditions read so far leave open.
typedef struct {
    bt_study_setting *list;
    bool *idle; ///< [n] the key has no effect
    int n;
    bool fixed; ///< the ice does not depend on the seed
} verdict;

static void look_at_condition(const bt_study *study, int64_t condition, verdict *v)
{
    bt_member member;
    bt_case input;
    bt_study_member(study, condition * study->repeats, &member);
    const bool read = bt_member_case(study, &member, &input, NULL) == BT_OK;
    v->fixed = v->fixed && read && !bt_case_ice_is_random(&input);
    for (int i = 0; i < v->n; i++) {
        char key[96];
        snprintf(key, sizeof key, "%.*s", v->list[i].length, v->list[i].text);
        v->idle[i] = v->idle[i] && read && bt_case_key_is_idle(&input, key);
    }
    bt_case_free(&input);
    bt_member_free(&member);
}

bt_status bt_study_check_ice(const bt_study *study, bt_errors *err)
{
    const size_t before = err->n;
    verdict v = {.fixed = study->repeats > 1};
    v.list = study_settings(study, &v.n);
    v.idle = bt_alloc((size_t)v.n + 1, sizeof *v.idle);
    for (int i = 0; i < v.n; i++) v.idle[i] = true;
    bool open = true;
    for (int64_t k = 0; k < study->n_conditions && open; k++) {
        look_at_condition(study, k, &v);
        open = v.fixed;
        for (int i = 0; i < v.n; i++) open = open || v.idle[i];
    }
    if (v.fixed) {
        bt_errors_add(err,
                      "%s: repeats: no ice depends on the seed (ice from a file, or none): the "
                      "%" PRId64 " fields of a condition would be one run; set repeats: 1, and for other ice vary "
                      "the place of the body (body.x, body.y), or the file",
                      study->path, study->repeats);
        bt_errors_code(err, "one_field");
    }
    for (int i = 0; i < v.n; i++)
        if (v.idle[i])
            bt_errors_add(err, "%s%.*s: has no effect, as all ice is read from files: members that differ by it would "
                               "be the same run; remove it from `%s`",
                          v.list[i].at, v.list[i].length, v.list[i].text, v.list[i].section);
    free(v.idle);
    free(v.list);
    return err->n == before ? BT_OK : BT_ERR_CASE;
}

// --- files that a study names ----------------------------------------------------------------------------------------

/// Take over a path. A file that cannot be read is skipped.
static void add(bt_study_files *files, char *path)
{
    bt_named_file file = {.path = path};
    bool wanted = path && stat(path, &file.seen) == 0;
    for (int i = 0; i < files->n && wanted; i++) wanted = strcmp(files->list[i].path, path) != 0;
    if (wanted && bt_checksum_digest_file(path, file.digest, &file.bytes, NULL) == BT_OK) {
        files->list = bt_realloc(files->list, (size_t)files->n + 1, sizeof *files->list);
        files->list[files->n++] = file;
    } else {
        free(path);
    }
}

static char *text_of(const bt_key *key, const bt_case *input)
{
    const char *text = bt_case_file(input, key);
    return text ? bt_text_copy(text) : NULL;
}

/// The file that a value names for a key in a study; its path is relative to the base case, as in a member.
static char *file_of(const bt_study *study, const bt_key *key, const char *value)
{
    bt_case scratch;
    bt_case_defaults(&scratch);
    char why[BT_WHY], *said = NULL;
    if (bt_value_read(key, &scratch, value, true, why)) said = text_of(key, &scratch);
    bt_case_free(&scratch);
    char *absolute = said ? bt_case_named_file(study->base, said) : NULL;
    if (!absolute) return said;
    free(said);
    return absolute;
}

static void add_of_axes(bt_study_files *files, const bt_study *study)
{
    int n;
    bt_study_setting *list = study_settings(study, &n);
    for (int i = 0; i < n; i++) {
        char name[96];
        snprintf(name, sizeof name, "%.*s", list[i].length, list[i].text);
        const bt_key *key = &bt_case_keys[bt_schema_find(bt_case_keys, bt_n_case_keys, name)];
        const bt_study_parameter *parameter = &study->parameter[list[i].axis];
        if (!key->file) continue;
        if (list[i].text[list[i].length] == '=') add(files, file_of(study, key, list[i].text + list[i].length + 1));
        else
            for (int v = 0; v < parameter->n; v++) add(files, file_of(study, key, parameter->value[v]));
    }
    free(list);
}

void bt_study_files_find(bt_study_files *files, const bt_study *study)
{
    char *folder = bt_file_folder(study->base);
    *files = (bt_study_files){.root = realpath(folder, NULL)};
    free(folder);
    bt_case input;
    if (bt_study_base_case(study, &input, NULL) == BT_OK)
        for (int k = 0; k < bt_n_case_keys; k++)
            add(files, text_of(&bt_case_keys[k], &input));
    bt_case_free(&input);
    add_of_axes(files, study);
}

void bt_study_files_free(bt_study_files *files)
{
    for (int i = 0; i < files->n; i++) free(files->list[i].path);
    free(files->list);
    free(files->root);
    *files = (bt_study_files){0};
}

bt_status bt_study_files_keep(const bt_study_files *files, const char *dir, bool old, bt_errors *err)
{
    const char *path = BT_PATH(dir, "study.files");
    const size_t root = files->root ? strlen(files->root) : 0;
    char *kept = NULL;
    size_t size;
    bt_status status = BT_OK;
    if (access(path, F_OK) == 0)
        status = bt_file_read_to(path, "a list of files", BT_MAX_TEXT_BYTES, &kept, &size, err);
    bt_text text;
    bt_text_begin(&text);
    fputs(kept ? kept : "", text.out);
    int added = 0;
    for (int i = 0; i < files->n && status == BT_OK; i++) {
        const bt_named_file *file = &files->list[i];
        char line[96];
        snprintf(line, sizeof line, "%" PRId64 " bytes, xxh128 %s\n", file->bytes, file->digest);
        const bool below = root && !strncmp(file->path, files->root, root) && file->path[root] == '/';
        const char *name = file->path + (below ? root + 1 : 0), *before = bt_case_said_of(kept, name);
        if (!before) before = bt_case_said_of(kept, file->path); // as version 0.1.0 named it
        if (before && strncmp(before, line, strlen(line))) {
            status = bt_fail(err, BT_ERR_CASE,
                             "%s: has changed since members in %s were made with it, and now belongs to another study; "
                             "restore it, or give another folder with -o", file->path, dir);
            bt_errors_code(err, "other_study");
        }
        if (before) continue;
        fprintf(text.out, "%s: %s", name, line);
        added++;
        if (old)
            bt_errors_warn("warning: %s: %s has no digest of this file from when its members were run, so a "
                           "later change cannot be detected; the present contents are used", file->path, dir);
    }
    char *now = bt_text_end(&text);
    if (status == BT_OK && added) status = bt_file_write(path, now, err);
    free(now);
    free(kept);
    return status;
}

static bool same_stat(const struct stat *a, const struct stat *b)
{
    return a->st_ino == b->st_ino && a->st_size == b->st_size && a->st_mtim.tv_sec == b->st_mtim.tv_sec &&
           a->st_mtim.tv_nsec == b->st_mtim.tv_nsec && a->st_ctim.tv_sec == b->st_ctim.tv_sec &&
           a->st_ctim.tv_nsec == b->st_ctim.tv_nsec;
}

bt_status bt_study_files_same(bt_study_files *files, bt_errors *err)
{
    for (int i = 0; i < files->n; i++) {
        bt_named_file *file = &files->list[i], now = {0};
        // a missing file is reported by a member
        if (stat(file->path, &now.seen) != 0 || same_stat(&file->seen, &now.seen)) continue;
        if (bt_checksum_digest_file(file->path, now.digest, &now.bytes, NULL) != BT_OK) continue;
        if (strcmp(now.digest, file->digest))
            return bt_fail(err, BT_ERR_CASE,
                           "%s: has changed while the members of a study were made with it: restore it and call "
                           "again, or give another folder with -o", file->path);
        file->seen = now.seen;
    }
    return BT_OK;
}
