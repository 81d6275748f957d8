// SPDX-License-Identifier: MIT
// Digests of the files that a case names; reasons in case_files.h.
#include "case/case_files.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/checksum.h"

const char *bt_case_file(const bt_case *c, const bt_key *k)
{
    const char *file = NULL;
    if (k->file) memcpy(&file, (const char *)c + k->offset, sizeof file);
    return file;
}

/// The comment of a key, NULL where it names no file, or one that cannot be read; the caller frees it.
static char *comment_of(const bt_case *c, const bt_key *k)
{
    char digest[BT_CHECKSUM_DIGEST];
    int64_t bytes;
    bt_errors unheard = {0};
    const char *path = bt_case_file(c, k);
    const bool read = path && bt_checksum_digest_file(path, digest, &bytes, &unheard) == BT_OK;
    bt_errors_free(&unheard);
    return read ? bt_text_of("# %s: %" PRId64 " bytes, xxh128 %s\n", k->name, bytes, digest) : NULL;
}

char *bt_case_digests(const bt_case *c)
{
    bt_text t;
    bt_text_begin(&t);
    for (int k = 0; k < bt_n_case_keys; k++) {
        char *comment = comment_of(c, &bt_case_keys[k]);
        fputs(comment ? comment : "", t.out);
        free(comment);
    }
    return bt_text_end(&t);
}

const char *bt_case_said_of(const char *text, const char *name)
{
    const size_t n = strlen(name);
    for (const char *at = text; at && *at; at = strchr(at, '\n') ? strchr(at, '\n') + 1 : NULL)
        if (!strncmp(at, name, n) && !strncmp(at + n, ": ", 2)) return at + n + 2;
    return NULL;
}

bt_status bt_case_files_same(const bt_case *c, const char *dir, bt_errors *warnings, bt_errors *err)
{
    bt_status status = BT_OK;
    for (int k = 0; k < bt_n_case_keys; k++) {
        char *now = comment_of(c, &bt_case_keys[k]), *name = bt_text_of("# %s", bt_case_keys[k].name);
        const char *file = bt_case_file(c, &bt_case_keys[k]), *before = bt_case_said_of(c->text, name);
        if (now && !before) {
            bt_errors_add(warnings, "warning: %s: nothing in %s tells what it held when the run began; it is taken as "
                                    "it is now", file, dir);
        } else if (now && strncmp(before - strlen(name) - 2, now, strlen(now))) {
            bt_errors_add(err, "%s: has changed since the run in %s began; restore it, or begin another run with it "
                               "(bergtow run)", file, dir);
            status = BT_ERR_CASE;
        }
        free(now);
        free(name);
    }
    return status;
}
