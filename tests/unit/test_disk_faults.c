// SPDX-License-Identifier: MIT
// Reads, writes, syncs and closes that fail once, at every place of a small file in turn: each is reported in the
// system's own words, none is taken for damage, and none passes because the next call succeeds. Files cut off early are
// known as ours.
#include <errno.h>
#include <hdf5.h>
#include <sys/syscall.h>
#include <unistd.h>


#include "test.h"
#include "base/checksum.h"
#include "base/fileio.h"
#include "base/h5read.h"
#include "base/h5util.h"

enum { WRITE, READ, CLOSE, SYNC };
static int reason_of[] = {[WRITE] = ENOSPC, [READ] = EIO, [CLOSE] = EDQUOT, [SYNC] = EIO};
static int failing = -1;  // a call of this kind, once
static long calls_before; // so many that succeed come first
static int syncs, closes; // calls so far

static bool fails(int kind)
{
    if (kind != failing || calls_before-- > 0) return false;
    failing = -1;
    errno = reason_of[kind];
    return true;
}

// In place of the C library's.
ssize_t pwrite(int fd, const void *data, size_t n, off_t at)
{
    return fails(WRITE) ? -1 : syscall(SYS_pwrite64, fd, data, n, at);
}

ssize_t pread(int fd, void *to, size_t n, off_t at)
{
    return fails(READ) ? -1 : syscall(SYS_pread64, fd, to, n, at);
}

int close(int fd)
{
    const int status = (int)syscall(SYS_close, fd);
    closes++;
    return fails(CLOSE) ? -1 : status;
}

int fsync(int fd)
{
    syncs++;
    return fails(SYNC) ? -1 : (int)syscall(SYS_fsync, fd);
}

static bt_status make(const char *path, bt_errors *err)
{
    bt_h5 h = {0};
    if (bt_h5_create(&h, path, err) != BT_OK) return BT_ERR_IO;
    const hid_t d = bt_h5_growing(&h, "/series", H5T_NATIVE_DOUBLE, 1, NULL, (hsize_t[]){8, 1}, false);
    for (int n = 0; n < 6; n++) {
        const double row[4] = {n, n + 1, n + 2, n + 3};
        bt_h5_append(&h, d, H5T_NATIVE_DOUBLE, (hsize_t)n * 4, 4, row);
        if (n % 2) bt_h5_flush(&h);
    }
    if (d >= 0) H5Dclose(d);
    return bt_h5_close(&h);
}

static bt_status take(const char *path, bt_errors *err)
{
    bt_h5_reader r;
    double series[24] = {0};
    if (bt_h5_open(&r, path, BT_CHECKSUM_FIELD, err) == BT_OK)
        bt_h5_read(&r, "/series", H5T_NATIVE_DOUBLE, 0, 24, 1, series);
    const bt_status status = bt_h5_end(&r);
    if (status == BT_OK) assert_true(series[0] == 0 && series[23] == 8);
    return status;
}

/// The n-th call of a kind fails, for each n from the first one on. Returns how many there are.
static int every(int kind, int first, const char *path, bt_status (*work)(const char *, bt_errors *))
{
    for (int n = first;; n++) {
        bt_errors err = {0};
        failing = kind, calls_before = n;
        const bt_status status = work(path, &err);
        const bool met = failing < 0;
        failing = -1;
        if (!met) {
            assert_int_equal(status, BT_OK);
            return n;
        }
        if (status != BT_ERR_IO || err.n != 1 || !strstr(err.text[0], strerror(reason_of[kind])))
            fail_msg("call %d of kind %d: status %d, %zu errors: %s", n, kind, status, err.n, err.n ? err.text[0] : "");
        bt_errors_free(&err);
    }
}

TEST(each_failed_call_is_reported)
{
    char path[] = "/tmp/bergtow-faults-XXXXXX";
    bt_errors err = {0};
    assert_int_equal(close(mkstemp(path)), 0);
    assert_in_range(every(WRITE, 0, path, make), 10, 200);
    failing = CLOSE, calls_before = 100;
    assert_int_equal(make(path, &err), BT_OK);
    const int n_closes = 100 - (int)calls_before; // of which the last is that of the file that was written
    assert_int_equal(every(CLOSE, n_closes - 1, path, make), n_closes);
    assert_int_equal(bt_checksum_write(path, BT_CHECKSUM_FIELD, &err), BT_OK);
    assert_in_range(every(READ, 0, path, take), 5, 100);
    unlink(path);
}

/// A signal in the middle of a sync is no failure, nor proof that bytes are on the disk: it is made again. After one at
/// a close the descriptor is gone all the same, and may be another file's by then: it is not closed again. What is no
/// signal is a failure.
TEST(a_signal_at_a_sync_and_at_a_close)
{
    char path[] = "/tmp/bergtow-signal-XXXXXX";
    for (int signal = 0; signal < 2; signal++) {
        const int sync_reason = reason_of[SYNC], close_reason = reason_of[CLOSE];
        if (signal) reason_of[SYNC] = reason_of[CLOSE] = EINTR;
        int fd = mkstemp(path);
        syncs = closes = 0;
        failing = SYNC, calls_before = 0;
        assert_int_equal(bt_file_sync(fd), signal ? 0 : sync_reason);
        assert_int_equal(syncs, 1 + signal);
        failing = CLOSE, calls_before = 0;
        assert_int_equal(bt_file_close(fd), signal ? 0 : close_reason);
        assert_int_equal(closes, 1);
        reason_of[SYNC] = sync_reason, reason_of[CLOSE] = close_reason;
        unlink(path);
        memcpy(strrchr(path, '-'), "-XXXXXX", 8);
    }
}

/// A signal while bytes go to the disk or come from it is no failure: the call is made again.
TEST(a_signal_while_bytes_move)
{
    char path[] = "/tmp/bergtow-signal-XXXXXX", back[8] = "";
    const int write_reason = reason_of[WRITE], read_reason = reason_of[READ];
    const int fd = mkstemp(path);
    reason_of[WRITE] = reason_of[READ] = EINTR;
    failing = WRITE, calls_before = 0;
    assert_int_equal(bt_file_put(fd, 2, "berg", 4), 0);
    assert_int_equal(failing, -1);
    failing = READ, calls_before = 0;
    assert_int_equal(bt_file_get(fd, 2, back, sizeof back), 4); // and no more where the file ends
    assert_int_equal(failing, -1);
    assert_string_equal(back, "berg");
    reason_of[WRITE] = write_reason, reason_of[READ] = read_reason;
    failing = READ, calls_before = 0;
    assert_int_equal(bt_file_get(fd, 0, back, 1), -1);
    assert_int_equal(errno, read_reason);
    assert_int_equal(bt_file_resize(fd, 3), 0);
    assert_int_equal(bt_file_get(fd, 0, back, sizeof back), 3);
    close(fd);
    unlink(path);
    assert_int_equal(bt_file_resize(-1, 3), EBADF);
}

/// A text of which the system gives a part and then an error: here nothing at all, and the error at once.
TEST(a_text_that_cannot_be_read)
{
    char *text = NULL;
    size_t size = 0;
    bt_errors err = {0};
    assert_int_equal(bt_file_read("/proc/self/mem", "a text", &text, &size, &err), BT_ERR_IO);
    assert_non_null(strstr(err.text[0], "reading failed: Input/output error"));
    free(text);
    bt_errors_free(&err);
}

/// It has fewer bytes than the system said it has, as one that becomes shorter while it is read.
TEST(a_file_with_fewer_bytes_than_its_size)
{
    bt_errors err = {0};
    assert_int_equal(bt_checksum_check("/sys/kernel/fscaps", BT_CHECKSUM_FIELD, NULL, &err), BT_ERR_IO);
    bt_errors_free(&err);
}

/// Nothing, zeros, or HDF5: what a file of ours is before its seal. A seal is found at the end; anything else is
/// somebody else's.
TEST(what_was_cut_off_early_is_ours)
{
    static const char seal[] = "bergtow sealed file\nkind: field 9\n", hdf5[] = "\x89HDF\r\n\x1a\n";
    const struct {
        const char *name;
        size_t bytes;
        const char *front, *back;
        bool to_come, sealed;
    } files[] = {{"nothing", 0, "", "", true, false},
                 {"a few zeros", 5, "", "", true, false},
                 {"zeros", 600, "", "", true, false},
                 {"HDF5", 600, hdf5, "", true, false},
                 {"HDF5 under a seal", 600, hdf5, seal, true, true},
                 {"a seal alone", BT_CHECKSUM_BYTES, "", seal, false, true},
                 {"a seal at the front", 600, seal, "", false, false},
                 {"a stranger", 600, "words", "", false, false}};
    for (size_t k = 0; k < sizeof files / sizeof *files; k++) {
        char bytes[600] = {0}, path[] = "/tmp/bergtow-cut-XXXXXX";
        memcpy(bytes, files[k].front, strlen(files[k].front));
        if (*files[k].back) memcpy(bytes + files[k].bytes - BT_CHECKSUM_BYTES, files[k].back, strlen(files[k].back));
        const int fd = mkstemp(path);
        assert_int_equal(write(fd, bytes, files[k].bytes), files[k].bytes);
        close(fd);
        if (bt_checksum_to_come(path) != files[k].to_come || bt_checksum_there(path, "") != files[k].sealed ||
            bt_checksum_there(path, BT_CHECKSUM_FIELD) != files[k].sealed)
            fail_msg("%s", files[k].name);
        assert_false(bt_checksum_there(path, BT_CHECKSUM_RESULT));
        unlink(path);
    }
}

TEST_MAIN(NULL, NULL)
