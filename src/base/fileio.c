// SPDX-License-Identifier: MIT
// Text files that are complete or absent, folders, and the wording of input/output errors.
#include "base/fileio.h"

#include <errno.h>
#include <fcntl.h>
#include <linux/fs.h>
#include <string.h>
#include <sys/file.h>
#include <sys/ioctl.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/largest.h"

const char *bt_file_remedy(int errnum)
{
    switch (errnum) {
    case ENOSPC:
    case EDQUOT: return "free some space, or write to another disk with -o DIR";
    case EFBIG: return "raise the limit on file sizes (ulimit -f), or ask for fewer frames (output.frame_interval)";
    case EACCES:
    case EPERM: return "change the permissions, or write to a folder of your own with -o DIR";
    case EROFS: return "the disk is read-only: write to another one with -o DIR";
    case ENOENT: return "check the name and that its folder exists";
    case ENOTDIR: return "a part of the path is a file: give another folder with -o DIR";
    case EISDIR: return "a folder of that name is in the way: remove it, or give another folder with -o DIR";
    case ENAMETOOLONG: return "give a shorter path";
    case EMFILE:
    case ENFILE: return "close other files, or raise the limit on open files (ulimit -n)";
    case ENOMEM: return "use fewer floes or a larger machine";
    case EIO: return "the disk reports errors: write to another one with -o DIR";
    default: return "check the path, the free space and the permissions";
    }
}

bt_status bt_file_fail(const char *path, const char *action, int errnum, bt_errors *err)
{
    return bt_fail(err, BT_ERR_IO, "%s: cannot %s: %s; %s", path, action, errnum ? strerror(errnum) : "unknown reason",
                   bt_file_remedy(errnum));
}

char *bt_file_folder(const char *path)
{
    const char *slash = strrchr(path, '/');
    return slash ? bt_text_of("%.*s", (int)(slash > path ? slash - path : 1), path) : bt_text_copy(".");
}

int bt_file_descriptor(const char *path, int flags)
{
    int fd;
    while ((fd = open(path, flags | O_CLOEXEC, 0666)) < 0 && errno == EINTR) {}
    return fd;
}

ssize_t bt_file_get(int fd, off_t at, void *bytes, size_t n)
{
    size_t done = 0;
    while (done < n) {
        const ssize_t got = pread(fd, (char *)bytes + done, n - done, at + (off_t)done);
        if (got < 0 && errno == EINTR) continue;
        if (got < 0) return -1;
        if (got == 0) break;
        done += (size_t)got;
    }
    return (ssize_t)done;
}

int bt_file_put(int fd, off_t at, const void *bytes, size_t n)
{
    for (const char *p = bytes; n > 0;) {
        const ssize_t done = pwrite(fd, p, n, at);
        if (done < 0 && errno == EINTR) continue;
        if (done <= 0) return done < 0 ? errno : ENOSPC;
        p += done, at += done, n -= (size_t)done;
    }
    return 0;
}

int bt_file_sync(int fd)
{
    int failed;
    while ((failed = fsync(fd)) < 0 && errno == EINTR) {}
    return failed ? errno : 0;
}

int bt_file_resize(int fd, off_t size)
{
    int failed;
    while ((failed = ftruncate(fd, size)) < 0 && errno == EINTR) {}
    return failed ? errno : 0;
}

int bt_file_close(int fd) { return close(fd) != 0 && errno != EINTR ? errno : 0; }

char *bt_file_path(char out[BT_PATH_BYTES], const char *dir, const char *name)
{
    const size_t n = strlen(dir);
    snprintf(out, BT_PATH_BYTES, "%s%s%s", dir, n && dir[n - 1] == '/' ? "" : "/", name);
    return out;
}

char *bt_file_beside(char out[BT_PATH_BYTES], const char *path, const char *ending)
{
    snprintf(out, BT_PATH_BYTES, "%s%s", path, ending);
    return out;
}

char *bt_file_join(const char *dir, const char *name) { return bt_text_copy(BT_PATH(dir, name)); }

/// Is this a descriptor that this process was given, such as a pipe of the shell? Opening it does not block.
static bool is_own_descriptor(const char *path)
{
    return !strcmp(path, "/dev/stdin") || !strncmp(path, "/dev/fd/", 8) || !strncmp(path, "/proc/self/fd/", 14);
}

/// Kind of a file in words, "a folder", ...; NULL for a regular file.
static const char *kind_of(mode_t mode)
{
    if (S_ISREG(mode)) return NULL;
    return S_ISDIR(mode) ? "a folder" : S_ISFIFO(mode) ? "a pipe (FIFO)" : S_ISSOCK(mode) ? "a socket" : "a device";
}

bt_status bt_file_may_take(const char *path, bt_errors *err)
{
    struct stat st;
    const char *kind = stat(path, &st) == 0 && !S_ISDIR(st.st_mode) ? kind_of(st.st_mode) : NULL;
    if (!kind && (is_own_descriptor(path) || !strncmp(path, "/dev/std", 8))) kind = "an open descriptor";
    if (!kind) return BT_OK; // a folder in the way is reported by the system
    return bt_fail(err, BT_ERR_IO,
                   "%s: is %s, not a regular file, and is not replaced; move it away, or give another name",
                   path, kind);
}

/// text: word the errors as bt_file_read does; streams: accept pipes that this process was given.
static int open_input(const char *path, const char *what, bool text, bool streams, bt_errors *err)
{
    // Check the kind before opening, since opening some devices has side effects; and again afterwards, since the name
    // may mean another file by then.
    struct stat st;
    const char *kind = NULL;
    const bool taken = streams && is_own_descriptor(path);
    int fd = -1, reason = stat(path, &st) != 0 ? errno : 0;
    const bool seen = reason == 0;
    if (seen && !(kind = kind_of(st.st_mode))) {
        fd = bt_file_descriptor(path, O_RDONLY | O_NONBLOCK | O_NOCTTY);
        if (fd < 0 || fstat(fd, &st) != 0) reason = errno;
        else kind = kind_of(st.st_mode);
    } else if (seen && taken && !S_ISDIR(st.st_mode)) {
        kind = NULL;
        fd = bt_file_descriptor(path, O_RDONLY);
        if (fd < 0) reason = errno;
    }
    if (!reason && !kind) return fd;
    if (fd >= 0) close(fd);
    if (reason && !text) bt_file_fail(path, "read the file", reason, err);
    else if (reason && seen)
        bt_errors_add(err, "%s: cannot be read: %s; check its permissions", path, strerror(reason));
    else if (reason) bt_errors_add(err, "%s: cannot be read: %s; give the path of %s", path, strerror(reason), what);
    else if (S_ISDIR(st.st_mode)) bt_errors_add(err, "%s: is a folder; give the path of %s in it", path, what);
    else
        bt_errors_add(err,
                      "%s: is %s, not a regular file, and is not opened; write its output to a file, and give that "
                      "file as %s",
                      path, kind, what);
    return -1;
}

int bt_file_open(const char *path, const char *what, bt_errors *err)
{
    return open_input(path, what, false, false, err);
}

static bt_status read_text(const char *path, const char *what, size_t most, bool streams, char **text, size_t *size,
                           bt_errors *err)
{
    *text = NULL;
    *size = 0;
    const int fd = open_input(path, what, true, streams, err);
    if (fd < 0) return BT_ERR_IO;
    // Read to the end rather than st_size bytes: a pipe has no size.
    size_t cap = 1 << 14, n = 0;
    *text = bt_alloc(cap, 1);
    ssize_t got = 0;
    while (n <= most && (got = read(fd, *text + n, cap - n - 1)) != 0) {
        if (got < 0 && errno == EINTR) continue;
        if (got < 0) break;
        n += (size_t)got;
        if (n == cap - 1) *text = bt_realloc(*text, cap *= 2, 1);
    }
    const int broken = got < 0 ? errno : 0;
    close(fd);
    // A byte order mark, which spreadsheets put before UTF-8, is not part of the text.
    if (n >= 3 && !memcmp(*text, "\xef\xbb\xbf", 3)) memmove(*text, *text + 3, n -= 3);
    (*text)[n] = 0;
    *size = n;
    if (broken)
        return bt_fail(err, BT_ERR_IO, "%s: reading failed: %s; check the disk", path, strerror(broken));
    if (n > most)
        return bt_fail(err, BT_ERR_CASE,
            "%s: larger than %zu MiB, which %s never is; check the name (large fields belong in an HDF5 file "
            "that ice.field names)",
            path, most >> 20, what);
    return BT_OK;
}

bt_status bt_file_read(const char *path, const char *what, char **text, size_t *size, bt_errors *err)
{
    return read_text(path, what, BT_MAX_TEXT_BYTES, true, text, size, err);
}

bt_status bt_file_read_to(const char *path, const char *what, size_t most, char **text, size_t *size, bt_errors *err)
{
    return read_text(path, what, most, false, text, size, err);
}

bt_status bt_file_write(const char *path, const char *text, bt_errors *err)
{
    const char *temporary = BT_BESIDE(path, ".tmp");
    if (bt_file_may_take(path, err) != BT_OK || bt_file_may_take(temporary, err) != BT_OK) return BT_ERR_IO;

    // A link under the temporary name must not lead the text elsewhere. One under the final name does not: the rename
    // replaces it.
    unlink(temporary);
    const int fd = bt_file_descriptor(temporary, O_WRONLY | O_CREAT | O_EXCL);
    int reason = fd < 0 ? errno : bt_file_put(fd, 0, text, strlen(text));
    // a full disk shows at the sync or at the close as often as at the write itself
    if (!reason) reason = bt_file_sync(fd);
    const int closed = fd < 0 ? 0 : bt_file_close(fd);
    if (!reason) reason = closed;
    bt_status status = reason ? bt_file_fail(path, "write the file", reason, err) : BT_OK;
    if (status == BT_OK) status = bt_file_rename(temporary, path, err);
    if (status != BT_OK && fd >= 0) unlink(temporary);
    return status;
}

/// Sync the folder of a path, and so the names in it, to disk. Returns errno of a failure, or 0.
static int sync_folder_of(const char *path)
{
    char *folder = bt_file_folder(path);
    const int fd = bt_file_descriptor(folder, O_RDONLY | O_DIRECTORY);
    free(folder);
    // a folder that may be written but not read: the system brings the name to disk in its own time
    if (fd < 0) return 0;
    const int reason = bt_file_sync(fd);
    bt_file_close(fd);
    return reason == EINVAL || reason == EROFS ? 0 : reason; // some file systems do not support this
}

bt_status bt_file_make_dir(const char *path, bt_errors *err)
{
    if (!*path) return bt_file_fail("output folder", "make a folder without a name", ENOENT, err);
    char *part = bt_text_copy(path);
    int reason = 0;
    for (char *slash = part; slash && !reason; ) {
        slash = strchr(slash + 1, '/');
        if (slash) *slash = '\0';
        if (mkdir(part, 0777) == 0) {
            reason = sync_folder_of(part);
        } else if (errno != EEXIST) {
            // On a read-only or foreign parent, mkdir may refuse before it sees that the folder exists.
            const int refused = errno;
            struct stat st;
            if (stat(part, &st) != 0 || !S_ISDIR(st.st_mode)) reason = refused;
        }
        if (slash) *slash = '/';
    }
    free(part);
    struct stat st;
    if (!reason && stat(path, &st) != 0) reason = errno;
    if (!reason && !S_ISDIR(st.st_mode)) reason = ENOTDIR;
    return reason ? bt_file_fail(path, "make the folder", reason, err) : BT_OK;
}

bt_status bt_file_remove(const char *path, bt_errors *err)
{
    if (bt_file_may_take(path, err) != BT_OK) return BT_ERR_IO;
    if (unlink(path) == 0 || errno == ENOENT) return BT_OK;
    return bt_file_fail(path, "replace the file of an earlier run", errno, err);
}

/// Copy all bytes from one open file to another. Returns errno of a failure, or 0.
static int copy_bytes(int from, int to)
{
    enum { PIECE = 1 << 20 };
    if (ioctl(to, FICLONE, from) == 0) return 0;
    char *buffer = bt_alloc(PIECE, 1);
    int reason = 0;
    off_t at = 0;
    for (ssize_t n; !reason && (n = bt_file_get(from, at, buffer, PIECE)) != 0;) {
        if (n < 0) {
            reason = errno;
            break;
        }
        reason = bt_file_put(to, at, buffer, (size_t)n);
        at += n;
    }
    free(buffer);
    return reason;
}

bt_status bt_file_copy(const char *from, const char *to, bt_errors *err)
{
    if (bt_file_may_take(to, err) != BT_OK) return BT_ERR_IO;
    const int in = bt_file_descriptor(from, O_RDONLY);
    if (in < 0) return bt_file_fail(from, "read the file", errno, err);
    unlink(to); // a link of that name must not lead the copy elsewhere
    const int out = bt_file_descriptor(to, O_WRONLY | O_CREAT | O_EXCL);
    int reason = out < 0 ? errno : copy_bytes(in, out);
    const int closed = out < 0 ? 0 : bt_file_close(out);
    if (!reason) reason = closed;
    close(in);
    if (reason && out >= 0) unlink(to);
    return reason ? bt_file_fail(to, "write the file", reason, err) : BT_OK;
}

bt_status bt_file_rename(const char *from, const char *to, bt_errors *err)
{
    if (bt_file_may_take(to, err) != BT_OK) return BT_ERR_IO;
    const int reason = rename(from, to) != 0 ? errno : sync_folder_of(to);
    return reason ? bt_file_fail(to, "write the file", reason, err) : BT_OK;
}

bool bt_file_there(const char *dir, const char *name) { return access(BT_PATH(dir, name), F_OK) == 0; }

bool bt_file_begins(const char *path, const char *text)
{
    const size_t n = strlen(text);
    char *front = bt_alloc(n + 1, 1);
    struct stat st;
    const int fd = bt_file_descriptor(path, O_RDONLY | O_NOFOLLOW | O_NONBLOCK);
    const bool same = fd >= 0 && fstat(fd, &st) == 0 && S_ISREG(st.st_mode) &&
                      bt_file_get(fd, 0, front, n) == (ssize_t)n && !memcmp(front, text, n);
    if (fd >= 0) close(fd);
    free(front);
    return same;
}

// --- locks -----------------------------------------------------------------------------------------------------------

/// Does the name still mean the open file? Its last holder may have removed it between opening and locking.
static bool still_there(int fd, const char *path)
{
    struct stat here, named;
    return fstat(fd, &here) == 0 && stat(path, &named) == 0 && here.st_ino == named.st_ino &&
           here.st_dev == named.st_dev;
}

static void tell_holder(int fd, const char *dir, bt_errors *err)
{
    char who[200] = "";
    const ssize_t n = pread(fd, who, sizeof who - 1, 0);
    who[n > 0 ? n : 0] = 0;
    who[strcspn(who, "\n")] = 0;
    bt_errors_add(err, "%s: another run is using this folder (%s); wait until it ends, or give another folder", dir,
                  *who ? who : "of an unknown process");
}

int bt_lock_take(const char *dir, bool *busy, bt_errors *err) { return bt_lock_take_file(dir, "run.lock", busy, err); }

int bt_lock_take_file(const char *dir, const char *name, bool *busy, bt_errors *err)
{
    if (busy) *busy = false;
    const char *path = BT_PATH(dir, name);
    int fd = -1;
    for (bool taken = bt_file_may_take(path, err) != BT_OK; !taken;) {
        fd = bt_file_descriptor(path, O_RDWR | O_CREAT | O_NOFOLLOW);
        if (fd < 0) {
            bt_file_fail(path, "make the file", errno, err);
            break;
        }
        const int refused = flock(fd, LOCK_EX | LOCK_NB) != 0 ? errno : 0;
        // on a file system without locks, go without one
        const bool without = refused == ENOLCK || refused == EOPNOTSUPP || refused == ENOSYS;
        if (refused && !without) {
            if (busy) *busy = refused == EWOULDBLOCK;
            tell_holder(fd, dir, err);
            close(fd);
            fd = -1;
            break;
        }
        taken = still_there(fd, path);
        if (!taken) close(fd);
        else if (without)
            bt_errors_warn("warning: %s: no locks here (%s), so nothing keeps a second run out of this folder; start "
                           "no other one in it", dir, strerror(refused));
    }
    if (fd >= 0) {
        char host[128] = "unknown host", who[200];
        gethostname(host, sizeof host - 1);
        const int n = snprintf(who, sizeof who, "process %ld on %s\n", (long)getpid(), host);
        // the text only informs the next process; the lock holds without it
        if (ftruncate(fd, 0) != 0 || pwrite(fd, who, (size_t)n, 0) != n) errno = 0;
    }
    return fd;
}

void bt_lock_drop(const char *dir, int lock)
{
    if (lock < 0) return;
    unlink(BT_PATH(dir, "run.lock")); // while the lock is held
    close(lock);
}
