// SPDX-License-Identifier: MIT
// State of a member of an ensemble, from its files.
#include "run/ensemble_list.h"

#include <errno.h>
#include <fcntl.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/inside.h"
#include "output/checkpoint.h"
#include "bergtow/ensemble.h"
#include "base/fileio.h"

char *bt_member_folder(const char *dir, const bt_member *member)
{
    return bt_text_of("%s/members/%s", dir, member->name);
}

bool bt_member_take_lock(int fd, bool wait)
{
    struct flock l = {.l_type = F_WRLCK, .l_whence = SEEK_SET};
    int failed;
    while ((failed = fcntl(fd, wait ? F_OFD_SETLKW : F_OFD_SETLK, &l)) < 0 && errno == EINTR) {}
    return !failed;
}

int bt_ensemble_take_lock(const char *dir, bool wait, bt_errors *err)
{
    const int fd = bt_file_descriptor(BT_PATH(dir, "lock"), O_RDWR | O_CREAT);
    if (fd < 0) {
        bt_file_fail(dir, "open the lock in the folder", errno, err);
    } else if (!bt_member_take_lock(fd, wait)) {
        bt_errors_add(err, "%s: cannot lock a file here (%s), and without locks the processes of an ensemble cannot "
                      "share its members; mount the disk with locks (Lustre: flock), or give a folder on another disk "
                      "with -o",
                      dir, strerror(errno));
        close(fd);
        return -1;
    }
    return fd;
}

bool bt_member_held(const char *folder)
{
    const int fd = bt_file_descriptor(BT_PATH(folder, "lock"), O_RDWR);
    if (fd < 0) return false;
    struct flock l = {.l_type = F_WRLCK, .l_whence = SEEK_SET};
    const bool held = fcntl(fd, F_OFD_GETLK, &l) == 0 && l.l_type != F_UNLCK;
    close(fd);
    return held;
}

// --- attempts: one byte each -----------------------------------------------------------------------------------------

int bt_member_attempts(const char *folder)
{
    struct stat st, last;
    int n = stat(BT_PATH(folder, "attempts"), &st) == 0 ? (int)bt_min((double)st.st_size, BT_MAX_ATTEMPTS) : 0;
    if (n > 0 && stat(BT_PATH(folder, BT_CHECKPOINT_FILE), &last) == 0 &&
        (last.st_mtim.tv_sec > st.st_mtim.tv_sec ||
         (last.st_mtim.tv_sec == st.st_mtim.tv_sec && last.st_mtim.tv_nsec > st.st_mtim.tv_nsec)))
        n = 0;
    return n;
}

void bt_member_note_attempt(const char *folder)
{
    const int fd = bt_file_descriptor(BT_PATH(folder, "attempts"), O_WRONLY | O_CREAT | O_APPEND);
    if (fd < 0) return;
    if (write(fd, ".", 1) == 1) fsync(fd);
    close(fd);
}

// --- failures --------------------------------------------------------------------------------------------------------

/// The record is in the folder, or beside it.
static const char *const records[] = {"/failed.txt", ".failed.txt"};

bt_status bt_member_record_failure(const char *folder, bt_status code, const bt_errors *why, bt_errors *err)
{
    bt_text lines;
    bt_text_begin(&lines);
    const char *failure = "";
    for (size_t i = why->n; i-- > 0;)
        if (why->note[i].code) failure = why->note[i].code;
    fprintf(lines.out, "%d%s%s\n", (int)code, *failure ? " " : "", failure);
    for (size_t i = 0; i < why->n; i++) fprintf(lines.out, "%s\n", why->text[i]);
    char *text = bt_text_end(&lines);
    bt_status status = BT_ERR_IO;
    for (int k = 0; k < 2 && status != BT_OK; k++)
        status = bt_file_write(BT_BESIDE(folder, records[k]), text, k ? err : NULL);
    free(text);
    return status;
}

void bt_member_forget_failure(const char *folder)
{
    for (int k = 0; k < 2; k++) unlink(BT_BESIDE(folder, records[k]));
}

static bool read_failure(const char *folder, int which, int *code, char **failure, char **why)
{
    const char *path = BT_BESIDE(folder, records[which]);
    char *text = NULL;
    size_t size;
    const bool there = access(path, F_OK) == 0;
    if (there && bt_file_read(path, "a record", &text, &size, NULL) == BT_OK) {
        char *rest = strchr(text, '\n'), *end;
        const long number = strtol(text, &end, 10);
        if (code) *code = (int)number;
        if (why && rest) *why = bt_text_copy(rest + 1);
        if (failure && *end == ' ') *failure = bt_text_of("%.*s", (int)strcspn(end + 1, "\n"), end + 1);
    }
    free(text);
    return there;
}

bt_member_state bt_ensemble_state(const char *folder, int *code, char **failure, char **why)
{
    BT_PLAIN_NUMBERS;
    if (why) *why = NULL;
    if (failure) *failure = NULL;
    if (code) *code = 0;
    if (bt_file_there(folder, "finished")) return BT_MEMBER_FINISHED;
    for (int k = 0; k < 2; k++)
        if (read_failure(folder, k, code, failure, why)) return BT_MEMBER_FAILED;
    // the present attempt has not ended yet
    const int n = why ? bt_member_attempts(folder) : 0, died = n > 0 && bt_member_held(folder) ? n - 1 : n;
    if (died > 0)
        *why = bt_text_of("its process died in %d attempt%s without a checkpoint; it is tried again after all others, "
                          "%d times in all",
                          died, bt_plural(died), BT_MAX_ATTEMPTS);
    return BT_MEMBER_WAITING;
}
