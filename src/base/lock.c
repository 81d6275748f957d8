// SPDX-License-Identifier: MIT
// One process at a time in a result folder.
#include "base/lock.h"

#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/fileio.h"

/// Is the open file still the one of that name? Its last holder may have removed it between the opening and the lock.
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
    bt_errors_add(err, "%s: another run is at work in this folder (%s); wait for its end, or give another folder", dir,
                  *who ? who : "it has not said who");
}

int bt_lock_take(const char *dir, bool *busy, bt_errors *err) { return bt_lock_take_file(dir, "run.lock", busy, err); }

int bt_lock_take_file(const char *dir, const char *name, bool *busy, bt_errors *err)
{
    if (busy) *busy = false;
    char *path = bt_file_join(dir, name);
    int fd = -1;
    for (bool taken = bt_file_may_take(path, err) != BT_OK; !taken;) {
        fd = bt_file_descriptor(path, O_RDWR | O_CREAT | O_NOFOLLOW);
        if (fd < 0) {
            bt_file_fail(path, "make the file", errno, err);
            break;
        }
        // a file system without locks has to do without
        if (flock(fd, LOCK_EX | LOCK_NB) != 0 && errno != ENOLCK && errno != EOPNOTSUPP && errno != ENOSYS) {
            if (busy) *busy = errno == EWOULDBLOCK;
            tell_holder(fd, dir, err);
            close(fd);
            fd = -1;
            break;
        }
        taken = still_there(fd, path);
        if (!taken) close(fd);
    }
    if (fd >= 0) {
        char host[128] = "unknown host", who[200];
        gethostname(host, sizeof host - 1);
        const int n = snprintf(who, sizeof who, "process %ld on %s\n", (long)getpid(), host);
        // who it is helps the next one; the lock holds without
        if (ftruncate(fd, 0) != 0 || pwrite(fd, who, (size_t)n, 0) != n) errno = 0;
    }
    free(path);
    return fd;
}

void bt_lock_drop(const char *dir, int lock)
{
    if (lock < 0) return;
    char *path = bt_file_join(dir, "run.lock");
    unlink(path); // while it is held
    close(lock);
    free(path);
}
