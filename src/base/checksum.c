// SPDX-License-Identifier: MIT
// checksums of files: writing and checking; the format is in checksum.h.
#include "base/checksum.h"

#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>
#include <xxhash.h>

#include "base/fileio.h"

#define MAGIC "bergtow sealed file\n"
static const unsigned char hdf5_magic[8] = {0x89, 'H', 'D', 'F', '\r', '\n', 0x1a, '\n'};

static bool read_at(int fd, void *to, size_t bytes, off_t at)
{
    const ssize_t n = bt_file_get(fd, at, to, bytes);
    if (n >= 0 && (size_t)n < bytes) errno = EIO; // it has become shorter meanwhile
    return n == (ssize_t)bytes;
}

static void print_digest(XXH128_hash_t h, char out[BT_CHECKSUM_DIGEST])
{
    snprintf(out, BT_CHECKSUM_DIGEST, "%016" PRIx64 "%016" PRIx64, (uint64_t)h.high64, (uint64_t)h.low64);
}

/// Digest of the bytes from `at` on.
static bool digest(int fd, off_t at, off_t size, char out[BT_CHECKSUM_DIGEST])
{
    enum { PIECE = 1 << 20 };
    XXH3_state_t *state = XXH3_createState();
    char *buffer = bt_alloc(PIECE, 1);
    bool good = state && XXH3_128bits_reset(state) == XXH_OK;
    for (; good && at < size; at += PIECE) {
        const size_t n = size - at < PIECE ? (size_t)(size - at) : PIECE;
        good = read_at(fd, buffer, n, at) && XXH3_128bits_update(state, buffer, n) == XXH_OK;
    }
    free(buffer);
    if (good) print_digest(XXH3_128bits_digest(state), out);
    XXH3_freeState(state);
    return good;
}

/// The checksum that the bytes behind it ask for.
static bool make(int fd, off_t size, const char *kind, char block[BT_CHECKSUM_BYTES])
{
    char text[BT_CHECKSUM_DIGEST];
    if (!digest(fd, BT_CHECKSUM_BYTES, size, text)) return false;
    memset(block, 0, BT_CHECKSUM_BYTES);
    snprintf(block, BT_CHECKSUM_BYTES, MAGIC "kind: %s\nbytes: %" PRId64 "\nxxh128: %s\n", kind, (int64_t)size, text);
    return true;
}

void bt_checksum_digest_text(const void *bytes, size_t n, char out[BT_CHECKSUM_DIGEST])
{
    print_digest(XXH3_128bits(bytes, n), out);
}

bt_status bt_checksum_digest_file(const char *path, char out[BT_CHECKSUM_DIGEST], int64_t *bytes, bt_errors *err)
{
    struct stat st;
    // a pipe must not keep us waiting
    const int fd = bt_file_descriptor(path, O_RDONLY | O_NONBLOCK);
    int reason = fd < 0 || fstat(fd, &st) != 0 ? errno : 0;
    const bool gone = reason == ENOENT || reason == ENXIO, odd = !reason && !S_ISREG(st.st_mode);
    if (!reason && !odd && !digest(fd, 0, st.st_size, out)) reason = errno;
    if (fd >= 0) close(fd);
    if (gone || odd) {
        bt_errors_add(err, "%s: %s", path, gone ? "is missing" : "is no regular file");
        return BT_ERR_CASE;
    }
    *bytes = reason ? 0 : (int64_t)st.st_size;
    return reason ? bt_file_fail(path, "read the file", reason, err) : BT_OK;
}

bt_status bt_checksum_write(const char *path, const char *kind, bt_errors *err)
{
    char block[BT_CHECKSUM_BYTES];
    struct stat st;
    const int fd = bt_file_descriptor(path, O_RDWR);
    int reason = fd < 0 || fstat(fd, &st) != 0 || !make(fd, st.st_size, kind, block) ? errno : 0;
    if (!reason) {
        reason = bt_file_put(fd, 0, block, sizeof block);
        if (!reason) reason = bt_file_sync(fd);
    }
    const int closed = fd < 0 ? 0 : bt_file_close(fd);
    if (!reason) reason = closed;
    return reason ? bt_file_fail(path, "write the file", reason, err) : BT_OK;
}

/// Why a block is not the one it should be, in words.
static bt_status refuse(const char *path, const char *kind, char *block, off_t size, bt_errors *err)
{
    block[BT_CHECKSUM_BYTES - 1] = 0;
    char found[40] = "";
    long long bytes = -1;
    const bool ours = !memcmp(block, MAGIC, sizeof MAGIC - 1) &&
                      sscanf(block + sizeof MAGIC - 1, "kind: %39[^\n]\nbytes: %lld", found, &bytes) >= 1;
    const size_t word = strcspn(kind, " ");
    if (!ours)
        bt_errors_add(err,
                      "%s: is no %.*s file of this program, or its first bytes are damaged; take another copy of it",
                      path, (int)word, kind);
    else if (strncmp(found, kind, word + 1))
        bt_errors_add(err, "%s: is a %.*s file, and a %.*s file is needed here; give the right one", path,
                      (int)strcspn(found, " "), found, (int)word, kind);
    else if (strcmp(found, kind))
        bt_errors_add(err, "%s: has the format \"%s\", this program reads \"%s\"; use the program that wrote it", path,
                      found, kind);
    else if (bytes > (long long)size)
        bt_errors_add(err, "%s: is cut off: %lld of %lld bytes are there; take another copy of it", path,
                      (long long)size, bytes);
    else bt_errors_add(err, "%s: is damaged: its bytes do not fit their digest; take another copy of it", path);
    return BT_ERR_CASE;
}

/// A file that never had a checksum: it begins as HDF5, or it is no HDF5 file with this room in front. What was
/// protected by a checksum does not pass by a damaged first line.
static bool is_bare(int fd, off_t size, const char *block)
{
    char behind[sizeof hdf5_magic] = "";
    if (!memcmp(block, hdf5_magic, sizeof hdf5_magic)) return true;
    if (!memcmp(block, MAGIC, sizeof MAGIC - 1)) return false;
    const bool long_enough = size >= BT_CHECKSUM_BYTES + (off_t)sizeof behind;
    return !long_enough ||
           (read_at(fd, behind, sizeof behind, BT_CHECKSUM_BYTES) && memcmp(behind, hdf5_magic, sizeof behind) != 0);
}

bt_status bt_checksum_check(const char *path, const char *kind, bool *bare, bt_errors *err)
{
    char block[BT_CHECKSUM_BYTES] = "", wanted[BT_CHECKSUM_BYTES];
    struct stat st;
    if (bare) *bare = false;
    char what[48];
    snprintf(what, sizeof what, "a %.*s file of bergtow", (int)strcspn(kind, " "), kind);
    const int fd = bt_file_open(path, what, err);
    if (fd < 0) return BT_ERR_IO;
    bt_status status = BT_OK;
    int reason = fstat(fd, &st) != 0 ? errno : 0;
    if (!reason && !read_at(fd, block, st.st_size < BT_CHECKSUM_BYTES ? (size_t)st.st_size : sizeof block, 0))
        reason = errno;
    if (!reason && bare) *bare = is_bare(fd, st.st_size, block);
    if (!reason && !(bare && *bare)) {
        if (st.st_size < BT_CHECKSUM_BYTES) {
            bt_errors_add(err, "%s: is cut off, or no file of this program: it has %lld bytes; take another copy of it",
                          path, (long long)st.st_size);
            status = BT_ERR_CASE;
        } else if (memcmp(block, MAGIC, sizeof MAGIC - 1)) {
            status = refuse(path, kind, block, st.st_size, err);
        } else if (!make(fd, st.st_size, kind, wanted)) {
            reason = errno;
        } else if (memcmp(block, wanted, sizeof block)) {
            status = refuse(path, kind, block, st.st_size, err);
        }
    }
    close(fd);
    return reason ? bt_file_fail(path, "read the file", reason, err) : status;
}

bool bt_checksum_there(const char *path, const char *kind)
{
    static const char zeros[BT_CHECKSUM_BYTES];
    char block[BT_CHECKSUM_BYTES + sizeof hdf5_magic] = "", front[80];
    snprintf(front, sizeof front, MAGIC "kind: %.*s", kind ? (int)strcspn(kind, " ") : 0, kind ? kind : "");
    struct stat st;
    const int fd = bt_file_descriptor(path, O_RDONLY | O_NOFOLLOW | O_NONBLOCK);
    const bool regular = fd >= 0 && fstat(fd, &st) == 0 && S_ISREG(st.st_mode);
    const ssize_t n = regular ? bt_file_get(fd, 0, block, sizeof block) : -1;
    if (fd >= 0) close(fd);
    if (n < 0) return false;
    if (!strncmp(block, front, strlen(front))) return true;
    // The checksum comes last. Before it the file begins with zeros, and until its first flush HDF5's superblock behind
    // them is zeros, too, as data go to the file at once (h5driver.c).
    const bool blank = !memcmp(block, zeros, BT_CHECKSUM_BYTES), shorter = n < (ssize_t)sizeof block;
    const char *behind = block + BT_CHECKSUM_BYTES;
    return !kind && blank &&
           (shorter || !memcmp(behind, hdf5_magic, sizeof hdf5_magic) || !memcmp(behind, zeros, sizeof hdf5_magic));
}
