// SPDX-License-Identifier: MIT
// Case files with a base: "base: other.yml" reads that file first; the keys beside it replace keys of the base one by
// one, and the list of floes as a whole. Rejected: YAML's own merge key `<<` with anchors, which stays within one file
// and merges only maps of the first level.
#include "case/case_base.h"

#include <string.h>
#include <sys/stat.h>

#include "base/fileio.h"
#include "base/inside.h"
#include "base/largest.h"

const bt_key bt_base_key = {
    .name = "base",
    .type = BT_KEY_TEXT,
    .preset = "none",
    .doc = "a case file whose keys apply where this file gives none; paths in either file are relative to the folder "
           "of that file",
};

/// Does this word of the first level occur in cases only: a section, a key with a dot, floes?
static bool is_of_cases(const char *word)
{
    char section[64] = "";
    const size_t n = strcspn(word, ".");
    if (n < sizeof section) memcpy(section, word, n);
    return !strcmp(word, "floes") || (strcmp(word, "report") && bt_schema_is_section(section));
}

/// Is the file a study? Studies and cases with a base both have the key `base`: the file is a study if it has any other
/// key of studies, or none of cases (`report` belongs to both).
static bool case_is_study(const bt_node *root)
{
    int line;
    bool of_cases = false;
    if (!bt_tree_find(root, "base", &line)) return false;
    for (int i = 0; i < root->n; i++) {
        const char *word = root->key[i];
        const bool both = !strcmp(word, "base") || !strcmp(word, "report");
        if (!both && bt_schema_find(bt_study_keys, bt_n_study_keys, word) >= 0) return true;
        of_cases = of_cases || is_of_cases(word);
    }
    return !of_cases;
}

bt_file_kind bt_case_kind(const bt_node *root)
{
    if (!root || root->kind != BT_NODE_MAP) return BT_FILE_OTHER;
    if (case_is_study(root)) return BT_FILE_STUDY;
    for (int i = 0; i < root->n; i++)
        if (is_of_cases(root->key[i])) return BT_FILE_CASE;
    return BT_FILE_OTHER;
}

bt_file_kind bt_case_kind_of(const char *path)
{
    struct stat st;
    char *text = NULL;
    size_t size;
    bt_file_kind kind = BT_FILE_OTHER;
    if (stat(path, &st) == 0 && S_ISREG(st.st_mode) &&
        bt_file_read(path, "a case file", &text, &size, NULL) == BT_OK) {
        bt_node *root = bt_tree_parse(text, size, path, NULL);
        kind = bt_case_kind(root);
        bt_tree_free(root);
    }
    free(text);
    return kind;
}

static bt_case_file *add(bt_case_files *files, char *path, char *text, size_t size)
{
    files->file = bt_realloc(files->file, (size_t)files->n + 1, sizeof *files->file);
    files->file[files->n] = (bt_case_file){.path = path, .text = text, .size = size};
    return &files->file[files->n++];
}

/// Parse the last file, which must hold keys of a case.
static bt_status parse(bt_case_files *files, bt_errors *err)
{
    bt_case_file *file = &files->file[files->n - 1];
    const bt_node *root = file->root = bt_tree_parse(file->text, file->size, file->path, err);
    if (!root) return BT_ERR_CASE;
    if (root->kind != BT_NODE_MAP)
        bt_errors_add(err,
                      "%s: is not a case: the file holds a %s; write sections with keys, as in the files of cases/",
                      file->path, root->kind == BT_NODE_LIST ? "list" : "single text");
    else if (case_is_study(root))
        bt_errors_add(err,
                      "%s: is a study: it has the key `base` and no section of a case; run it with `bergtow ensemble`, "
                      "look at it with `bergtow check`",
                      file->path);
    else if (!root->n)
        bt_errors_add(err, "%s: holds no keys; a case needs at least run.dt and run.duration", file->path);
    else return BT_OK;
    return BT_ERR_CASE;
}

/// The file of this absolute path, or NULL.
static const bt_case_file *find(const bt_case_files *files, const char *absolute)
{
    for (int i = 0; i < files->n; i++) {
        char *other = realpath(files->file[i].path, NULL);
        const bool same = other && !strcmp(other, absolute);
        free(other);
        if (same) return &files->file[i];
    }
    return NULL;
}

static bt_status read_base(bt_case_files *files, const bt_node *value, int line, bt_errors *err)
{
    const char *from = files->file[files->n - 1].path;
    if (value->kind != BT_NODE_SCALAR || !*value->text)
        return bt_fail(err, BT_ERR_CASE, "%s:%d: base: needs the name of one file, as in base: basin-80.yml", from,
                       line);
    char *folder = bt_file_folder(from),
         *path = *value->text == '/' ? bt_text_copy(value->text) : bt_file_join(folder, value->text),
         *absolute = realpath(path, NULL), *text = NULL;
    const bt_case_file *twin = absolute ? find(files, absolute) : NULL;
    bt_status status = BT_ERR_CASE;
    size_t size = 0;
    bt_errors why = {0};
    if (twin)
        bt_errors_add(err, "%s:%d: base: %s is being read already: it, or its base, leads back here; remove one of "
                           "these keys",
                      from, line, twin->path);
    else if (files->n > BT_MAX_BASES)
        bt_errors_add(err, "%s:%d: base: more than %d files, each based on the next; write the keys into fewer "
                           "files", from,
                      line, BT_MAX_BASES);
    else status = bt_file_read_to(path, "a case file", BT_MAX_TEXT_BYTES, &text, &size, &why);
    for (size_t i = 0; i < why.n; i++) bt_errors_add(err, "%s:%d: base: %s", from, line, why.text[i]);
    bt_errors_free(&why);
    if (status == BT_OK) {
        add(files, path, text, size);
        path = text = NULL;
        status = parse(files, err);
    }
    BT_FREE(folder, path, absolute, text);
    return status;
}

bt_status bt_case_files_read(bt_case_files *files, const char *path, const char *text, size_t size, bool alone,
                             bt_errors *err)
{
    *files = (bt_case_files){0};
    char *copy = bt_alloc(size + 1, 1);
    add(files, bt_text_copy(path), memcpy(copy, text, size), size);
    bt_status status = parse(files, err);
    int line = 0;
    if (status == BT_OK && alone && bt_tree_find(files->file[0].root, "base", &line))
        status = bt_fail(err, BT_ERR_CASE, "%s: base: a case stored with a result has none; the file is damaged", path);
    for (const bt_node *base; status == BT_OK && (base = bt_tree_find(files->file[files->n - 1].root, "base", &line));)
        status = read_base(files, base, line, err);
    return status;
}

void bt_case_files_free(bt_case_files *files)
{
    for (int i = 0; i < files->n; i++) {
        free(files->file[i].path);
        free(files->file[i].text);
        bt_tree_free(files->file[i].root);
    }
    free(files->file);
    *files = (bt_case_files){0};
}

char *bt_case_files_text(const bt_case_files *files)
{
    if (files->n == 1) return bt_text_copy(files->file[0].text);
    bt_text text;
    bt_text_begin(&text);
    for (int i = 0; i < files->n; i++) {
        const char *slash = strrchr(files->file[i].path, '/');
        fprintf(text.out, "--- # %s\n%s\n", slash ? slash + 1 : files->file[i].path, files->file[i].text);
    }
    return bt_text_end(&text);
}
