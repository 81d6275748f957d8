// SPDX-License-Identifier: MIT
// Text files that are complete or absent, folders, and the wording of input/output errors.
#include "fileio.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "largest.h"

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
    case EIO: return "the disk reports errors: write to another one with -o DIR";
    default: return "check the path, the free space and the permissions";
    }
}

bt_status bt_file_fail(const char *path, const char *action, int errnum, bt_errors *err)
{
    bt_errors_add(err, "%s: cannot %s: %s; %s", path, action, errnum ? strerror(errnum) : "unknown reason",
                  bt_file_remedy(errnum));
    return BT_ERR_IO;
}

char *bt_file_join(const char *dir, const char *name)
{
    const size_t n = strlen(dir), size = n + strlen(name) + 2;
    char *path = bt_alloc(size, 1);
    snprintf(path, size, "%s%s%s", dir, n && dir[n - 1] == '/' ? "" : "/", name);
    return path;
}

bt_status bt_file_read(const char *path, const char *what, char **text, size_t *size, bt_errors *err)
{
    return bt_file_read_to(path, what, BT_MOST_TEXT_BYTES, text, size, err);
}

bt_status bt_file_read_to(const char *path, const char *what, size_t most, char **text, size_t *size, bt_errors *err)
{
    *text = NULL;
    *size = 0;
    struct stat st;
    if (stat(path, &st)) {
        bt_errors_add(err, "%s: cannot be read: %s; give the path of %s", path, strerror(errno), what);
        return BT_ERR_IO;
    }
    if (S_ISDIR(st.st_mode)) {
        bt_errors_add(err, "%s: is a folder; give the path of %s in it", path, what);
        return BT_ERR_IO;
    }
    FILE *f = fopen(path, "rb");
    if (!f) {
        bt_errors_add(err, "%s: cannot be read: %s; check its permissions", path, strerror(errno));
        return BT_ERR_IO;
    }
    // Read to the end rather than st_size bytes: /dev/stdin and pipes have no size.
    size_t cap = 1 << 14, n = 0;
    *text = bt_alloc(cap, 1);
    for (size_t got; n <= most && (got = fread(*text + n, 1, cap - n - 1, f)) > 0;) {
        n += got;
        if (n == cap - 1) *text = bt_realloc(*text, cap *= 2, 1);
    }
    const int broken = ferror(f) ? errno : 0;
    fclose(f);
    (*text)[n] = 0;
    *size = n;
    if (broken) {
        bt_errors_add(err, "%s: reading failed: %s; check the disk", path, strerror(broken));
        return BT_ERR_IO;
    }
    if (n > most) {
        bt_errors_add(err, "%s: larger than %zu MiB, which %s never is; check the name (large fields belong into an HDF5 file that ice.field names)", path, most >> 20, what);
        return BT_ERR_CASE;
    }
    return BT_OK;
}

bt_status bt_file_write(const char *path, const char *text, bt_errors *err)
{
    const size_t size = strlen(path) + sizeof ".tmp", n = strlen(text);
    char *temporary = bt_alloc(size, 1);
    snprintf(temporary, size, "%s.tmp", path);

    int reason = 0;
    // A link of the temporary name, whoever made it, must not lead the text elsewhere; nor does one of the right name, which the rename replaces.
    unlink(temporary);
    FILE *f = fopen(temporary, "wx");
    if (!f) {
        reason = errno;
    } else {
        // A full disk shows at the flush or at the close as often as at the write itself.
        errno = 0;
        if (fwrite(text, 1, n, f) != n || fflush(f) != 0 || fsync(fileno(f)) != 0) reason = errno ? errno : EIO;
        if (fclose(f) != 0 && !reason) reason = errno ? errno : EIO;
        if (!reason && rename(temporary, path) != 0) reason = errno;
        if (reason) unlink(temporary);
    }
    free(temporary);
    return reason ? bt_file_fail(path, "write the file", reason, err) : BT_OK;
}

bt_status bt_file_make_dir(const char *path, bt_errors *err)
{
    if (!*path) return bt_file_fail("output folder", "make a folder without a name", ENOENT, err);
    char *part = strdup(path);
    int reason = 0;
    for (char *slash = part; slash && !reason; ) {
        slash = strchr(slash + 1, '/');
        if (slash) *slash = '\0';
        if (mkdir(part, 0777) != 0 && errno != EEXIST) {
            // On a read-only or foreign parent mkdir may refuse before it sees that the folder is there.
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
    if (unlink(path) == 0 || errno == ENOENT) return BT_OK;
    return bt_file_fail(path, "replace the file of an earlier run", errno, err);
}
