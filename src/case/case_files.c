// SPDX-License-Identifier: MIT
// Digests of the files that a case names; reasons in case_files.h.
#include "case/case_files.h"

#include <inttypes.h>
#include <string.h>

#include "base/checksum.h"
#include "base/largest.h"
#include "base/tree.h"
#include "case/warning.h"

#define ITSELF "case" // no key has this name: all have a section
#define GIVEN "#> "   // before each line of the case as given

const char *bt_case_file(const bt_case *input, const bt_key *key)
{
    const char *file = NULL;
    if (key->file) memcpy(&file, (const char *)input + key->offset, sizeof file);
    return file;
}

/// The comment for a key; the caller frees it. NULL if the key names no file, or the file cannot be read.
static char *comment_of(const bt_case *input, const bt_key *key)
{
    char digest[BT_CHECKSUM_DIGEST];
    int64_t bytes;
    const char *path = bt_case_file(input, key);
    const bool read = path && bt_checksum_digest_file(path, digest, &bytes, NULL) == BT_OK;
    return read ? bt_text_of("# %s: %" PRId64 " bytes, xxh128 %s\n", key->name, bytes, digest) : NULL;
}

char *bt_case_digests(const bt_case *input)
{
    bt_text text;
    bt_text_begin(&text);
    for (int k = 0; k < bt_n_case_keys; k++) {
        char *comment = comment_of(input, &bt_case_keys[k]);
        fputs(comment ? comment : "", text.out);
        free(comment);
    }
    return bt_text_end(&text);
}

/// Length of a line, its end included.
static size_t line_length(const char *line)
{
    const size_t n = strcspn(line, "\n");
    return n + (line[n] == '\n');
}

/// The comment line for a name in a text; NULL if there is none.
static const char *comment_in(const char *text, const char *name)
{
    char *comment = bt_text_of("# %s", name);
    const char *said = bt_case_said_of(text, comment), *line = said ? said - strlen(comment) - 2 : NULL;
    free(comment);
    return line;
}

char *bt_case_digests_in(const bt_case *input, const char *text)
{
    bt_text t;
    bt_text_begin(&t);
    for (int k = 0; k < bt_n_case_keys; k++) {
        const char *line = bt_case_file(input, &bt_case_keys[k]) ? comment_in(text, bt_case_keys[k].name) : NULL;
        if (line) fprintf(t.out, "%.*s\n", (int)strcspn(line, "\n"), line);
    }
    return bt_text_end(&t);
}

/// Length of the first piece of a text that holds no line break but at its end. YAML 1.1 breaks lines also at a
/// carriage return, and at the characters U+0085, U+2028 and U+2029, and the reader of cases follows it.
static size_t piece_length(const char *text)
{
    static const char *const breaks[] = {"\r\n", "\n", "\r", "\xc2\x85", "\xe2\x80\xa8", "\xe2\x80\xa9"};
    for (const char *at = text; *at; at++)
        for (size_t k = 0; k < sizeof breaks / sizeof *breaks; k++)
            if (!strncmp(at, breaks[k], strlen(breaks[k]))) return (size_t)(at - text) + strlen(breaks[k]);
    return strlen(text);
}

char *bt_case_with_comments(const char *resolved, const char *digests, const char *given)
{
    char digest[BT_CHECKSUM_DIGEST];
    const size_t n = strlen(resolved), head = line_length(resolved);
    bt_checksum_digest_text(resolved, n, digest);
    bt_text text;
    bt_text_begin(&text);
    fprintf(text.out, "%.*s# " ITSELF ": %zu bytes, xxh128 %s\n%s%s", (int)head, resolved, n, digest, resolved + head,
            digests ? digests : "");
    for (const char *at = given; at && *at; at += piece_length(at))
        fprintf(text.out, GIVEN "%.*s", (int)piece_length(at), at);
    fputs(given ? "\n" : "", text.out); // ends the last line, which may have no end of its own
    char *whole = bt_text_end(&text);
    if (!given || strlen(whole) <= BT_MAX_TEXT_BYTES) return whole;
    free(whole); // a case that could not be read would be worse than one without its source
    return bt_case_with_comments(resolved, digests, NULL);
}

char *bt_case_given_in(const char *text)
{
    bt_text given;
    bt_text_begin(&given);
    const char *at = text;
    while (*at && strncmp(at, GIVEN, strlen(GIVEN)) != 0) at += line_length(at);
    const bool there = *at;
    for (; !strncmp(at, GIVEN, strlen(GIVEN)); at += piece_length(at))
        fprintf(given.out, "%.*s", (int)(piece_length(at) - strlen(GIVEN)), at + strlen(GIVEN));
    char *made = bt_text_end(&given);
    const size_t n = strlen(made);
    if (there && !*at) made[n - 1] = 0; // an end that the last line has only here
    if (there) return made;
    free(made);
    return NULL;
}

/// Is a text the output of bt_case_with_comments, except for comments at its end? line: its comment about itself.
static bool is_itself(const char *text, const char *line)
{
    const size_t before = (size_t)(line - text);
    char *resolved = bt_text_of("%.*s%s", (int)before, text, line + line_length(line));
    const long long n = strtoll(line + sizeof "# " ITSELF ":", NULL, 10);
    bool same = n > 0 && (size_t)n <= strlen(resolved);
    for (const char *at = same ? resolved + n : ""; *at && same; at += line_length(at))
        same = *at == '#' || *at == '\n';
    if (same) resolved[n] = 0;
    char *made = bt_case_with_comments(resolved, NULL, NULL);
    same = same && !strncmp(text, made, strlen(made));
    free(made);
    free(resolved);
    return same;
}

const char *bt_case_said_of(const char *text, const char *name)
{
    const size_t n = strlen(name);
    for (const char *at = text; at && *at; at = strchr(at, '\n') ? strchr(at, '\n') + 1 : NULL)
        if (!strncmp(at, name, n) && !strncmp(at + n, ": ", 2)) return at + n + 2;
    return NULL;
}

bt_status bt_case_itself_same(const char *path, const char *text, const char *dir, bt_errors *err)
{
    const char *line = comment_in(text, ITSELF);
    if (line && is_itself(text, line)) return BT_OK;
    return bt_fail(err, BT_ERR_CASE,
                   "%s: has changed since the run in %s began; restore it, or start a new run with it (bergtow "
                   "run)", path, dir);
}

/// Do two comments say the same of a file? Either may be NULL.
static bool alike(const char *before, const char *now)
{
    const size_t n = now ? strcspn(now, "\n") : 0;
    return before && now && strcspn(before, "\n") == n && !strncmp(before, now, n);
}

bt_status bt_case_files_same(const bt_case *input, const char *dir, bt_errors *err)
{
    bt_status status = BT_OK;
    char *digests = bt_case_digests(input);
    for (int k = 0; k < bt_n_case_keys; k++) {
        const char *name = bt_case_keys[k].name, *now = comment_in(digests, name);
        if (now && !alike(comment_in(input->text, name), now))
            status = bt_fail(err, BT_ERR_CASE,
                             "%s: has changed since the run in %s began; restore it, or start a new run with it "
                             "(bergtow run)", bt_case_file(input, &bt_case_keys[k]), dir);
    }
    free(digests);
    return status;
}

/// Is `path` what the key is in the document with this comment? If not, the key has been set again beside or above it.
/// The text is that of bt_case.
static bool is_recorded(const char *text, const char *comment, const char *name, const char *path)
{
    const char *from = text, *end;
    while ((end = strstr(from, "\n--- # ")) && end < comment) from = end + 1;
    bt_node *document = bt_tree_parse(from, end ? (size_t)(end - from) : strlen(from), "", NULL);
    const bt_node *node = document;
    for (const char *at = name, *dot; node && at; at = dot ? dot + 1 : NULL) {
        dot = strchr(at, '.');
        char *key = bt_text_of("%.*s", (int)strcspn(at, "."), at);
        int line;
        node = bt_tree_find(node, key, &line);
        free(key);
    }
    const bool same = node && node->kind == BT_NODE_SCALAR && !strcmp(node->text, path);
    bt_tree_free(document);
    return same;
}

void bt_case_warn_files(const bt_case *input, const char *digests, bt_errors *warnings)
{
    for (int k = 0; k < bt_n_case_keys; k++) {
        const char *name = bt_case_keys[k].name, *now = comment_in(digests, name),
                   *before = comment_in(input->text, name);
        const char *path = bt_case_file(input, &bt_case_keys[k]);
        if (!now || !before || alike(before, now) || !is_recorded(input->text, before, name, path)) continue;
        const char *line[2] = {now, before};
        char *said[2];
        for (int i = 0; i < 2; i++) {
            const size_t skip = strlen("# : ") + strlen(name);
            said[i] = bt_text_of("%.*s", (int)(strcspn(line[i], "\n") - skip), line[i] + skip);
        }
        bt_warn(warnings, BT_WARN_FILE_CHANGED,
                "%s: %s is not the file that this case was recorded with: now %s, then %s; restore it, or the result "
                "will differ",
                name, path, said[0], said[1]);
        free(said[0]);
        free(said[1]);
    }
}
