// SPDX-License-Identifier: MIT
// Checksums of files: writing and checking; the format is in checksum.h.
#include "base/checksum.h"

#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
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
    if (n >= 0 && (size_t)n < bytes) errno = EIO; // the file has become shorter in the meantime
    return n == (ssize_t)bytes;
}

static void print_digest(XXH128_hash_t h, char out[BT_CHECKSUM_DIGEST])
{
    snprintf(out, BT_CHECKSUM_DIGEST, "%016" PRIx64 "%016" PRIx64, (uint64_t)h.high64, (uint64_t)h.low64);
}

/// Digest of the first `size` bytes.
static bool digest(int fd, off_t size, char out[BT_CHECKSUM_DIGEST])
{
    enum { PIECE = 1 << 20 };
    XXH3_state_t *state = XXH3_createState();
    char *buffer = bt_alloc(PIECE, 1);
    bool good = state && XXH3_128bits_reset(state) == XXH_OK;
    for (off_t at = 0; good && at < size; at += PIECE) {
        const size_t n = size - at < PIECE ? (size_t)(size - at) : PIECE;
        good = read_at(fd, buffer, n, at) && XXH3_128bits_update(state, buffer, n) == XXH_OK;
    }
    free(buffer);
    if (good) print_digest(XXH3_128bits_digest(state), out);
    XXH3_freeState(state);
    return good;
}

/// Form the checksum of the first `size` bytes.
static bool make(int fd, off_t size, const char *kind, char block[BT_CHECKSUM_BYTES])
{
    char text[BT_CHECKSUM_DIGEST];
    if (!digest(fd, size, text)) return false;
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
    // non-blocking: to open a pipe must not wait for its other end
    const int fd = bt_file_descriptor(path, O_RDONLY | O_NONBLOCK);
    int reason = fd < 0 || fstat(fd, &st) != 0 ? errno : 0;
    const bool gone = reason == ENOENT || reason == ENXIO, odd = !reason && !S_ISREG(st.st_mode);
    if (!reason && !odd && !digest(fd, st.st_size, out)) reason = errno;
    if (fd >= 0) close(fd);
    if (gone || odd)
        return bt_fail(err, BT_ERR_CASE, "%s: %s", path, gone ? "is missing" : "is not a regular file");
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
        reason = bt_file_put(fd, st.st_size, block, sizeof block);
        if (!reason) reason = bt_file_sync(fd);
    }
    const int closed = fd < 0 ? 0 : bt_file_close(fd);
    if (!reason) reason = closed;
    return reason ? bt_file_fail(path, "write the file", reason, err) : BT_OK;
}

bt_status bt_checksum_publish(const char *part, const char *path, const char *kind, bt_errors *err)
{
    const bt_status status = bt_checksum_write(part, kind, err);
    return status == BT_OK ? bt_file_rename(part, path, err) : status;
}

typedef struct {
    off_t size;
    char front[BT_CHECKSUM_BYTES + 1], back[BT_CHECKSUM_BYTES + 1]; ///< first and last bytes, terminated
} ends;

static bool read_ends(int fd, ends *e)
{
    *e = (ends){0};
    struct stat st;
    if (fstat(fd, &st) != 0) return false;
    e->size = st.st_size;
    const size_t n = e->size < BT_CHECKSUM_BYTES ? (size_t)e->size : BT_CHECKSUM_BYTES;
    return read_at(fd, e->front, n, 0) && read_at(fd, e->back, n, e->size - (off_t)n);
}

static bool is_seal(const char *block) { return !strncmp(block, MAGIC, sizeof MAGIC - 1); }
static bool is_hdf5(const ends *e) { return !memcmp(e->front, hdf5_magic, sizeof hdf5_magic); }

/// End of HDF5's part of a file, from its superblock [HDF5 File Format Specification, II.A: addresses of 8 bytes, least
/// significant byte first]; −1 if the superblock does not give it.
static off_t end_of_hdf5(const ends *e)
{
    static const struct { int size_of_address, end; } place[] = {{13, 40}, {13, 44}, {9, 28}, {9, 28}};
    const unsigned char *front = (const unsigned char *)e->front;
    const unsigned version = front[sizeof hdf5_magic];
    if (!is_hdf5(e) || version >= sizeof place / sizeof *place || front[place[version].size_of_address] != 8) return -1;
    uint64_t end = 0;
    for (int k = 8; k-- > 0;) end = end << 8 | front[place[version].end + k];
    return end < (uint64_t)1 << 62 ? (off_t)end : -1;
}

/// Report what is wrong with a file.
static bt_status refuse(const char *path, const char *kind, const ends *e, bt_errors *err)
{
    const char *seal = is_seal(e->back) ? e->back : NULL;
    char found[40] = "";
    if (seal) sscanf(seal + sizeof MAGIC - 1, "kind: %39[^\n]", found);
    const size_t word = strcspn(kind, " ");
    const off_t end = end_of_hdf5(e);
    const bool ends_there = end >= 0 && end != e->size;
    if (*found && strncmp(found, kind, word + 1))
        bt_errors_add(err, "%s: is a %.*s file, but a %.*s file is needed here; give the right one", path,
                      (int)strcspn(found, " "), found, (int)word, kind);
    else if (*found && strcmp(found, kind))
        bt_errors_add(err, "%s: has the format \"%s\", but this program reads \"%s\"; use the program that wrote "
                           "it", path,
                      found, kind);
    else if (!seal && ends_there && e->size < end + BT_CHECKSUM_BYTES)
        bt_errors_add(err, "%s: is truncated: only %lld of %lld bytes are there; use another copy of it", path,
                      (long long)e->size, (long long)end + BT_CHECKSUM_BYTES);
    else if (!seal && end == e->size)
        bt_errors_add(err,
                      "%s: has no seal at its end: it is truncated, or another program has changed or written it; use "
                      "another copy of it",
                      path);
    else if (!seal && end < 0)
        bt_errors_add(err, "%s: is not this program's %.*s file, or is damaged; give the right one, or another copy",
                      path, (int)word, kind);
    else bt_errors_add(err, "%s: is damaged: its bytes do not match their digest; use another copy of it", path);
    return BT_ERR_CASE;
}

bt_status bt_checksum_check(const char *path, const char *kind, bool *bare, bt_errors *err)
{
    ends e;
    char what[48], wanted[BT_CHECKSUM_BYTES];
    if (bare) *bare = false;
    snprintf(what, sizeof what, "a %.*s file of bergtow", (int)strcspn(kind, " "), kind);
    const int fd = bt_file_open(path, what, err);
    if (fd < 0) return BT_ERR_IO;
    bt_status status = BT_OK;
    int reason = read_ends(fd, &e) ? 0 : errno;
    if (!reason) {
        const off_t end = end_of_hdf5(&e), rest = e.size - BT_CHECKSUM_BYTES;
        if (bare && !is_seal(e.back) && (end < 0 || end == e.size)) *bare = true;
        else if (!is_seal(e.back)) status = refuse(path, kind, &e, err);
        else if (!make(fd, rest, kind, wanted)) reason = errno;
        else if (memcmp(e.back, wanted, sizeof wanted)) status = refuse(path, kind, &e, err);
    }
    close(fd);
    return reason ? bt_file_fail(path, "read the file", reason, err) : status;
}

/// Read the ends of a regular file; false if it is not one or cannot be read.
static bool ends_of(const char *path, ends *e)
{
    struct stat st;
    const int fd = bt_file_descriptor(path, O_RDONLY | O_NOFOLLOW | O_NONBLOCK);
    const bool read = fd >= 0 && fstat(fd, &st) == 0 && S_ISREG(st.st_mode) && read_ends(fd, e);
    if (fd >= 0) close(fd);
    return read;
}

bool bt_checksum_there(const char *path, const char *kind)
{
    ends e;
    char begin[80];
    const int n = snprintf(begin, sizeof begin, MAGIC "kind: %.*s", (int)strcspn(kind, " "), kind);
    return ends_of(path, &e) && !strncmp(e.back, begin, (size_t)n);
}

bool bt_checksum_to_come(const char *path)
{
    static const char zeros[sizeof hdf5_magic];
    ends e;
    return ends_of(path, &e) && (is_hdf5(&e) || !memcmp(e.front, zeros, sizeof zeros));
}
