// SPDX-License-Identifier: MIT
#include "run/ensemble_folder.h"

#include <fcntl.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "base/fileio.h"
#include "run/ensemble_member.h"
#include "run/study_files.h"

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

bt_status bt_ensemble_prepare_folder(const bt_study *s, const bt_ensemble_options *o, char digest[BT_DIGEST_TEXT],
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
