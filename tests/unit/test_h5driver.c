// SPDX-License-Identifier: MIT
// The HDF5 file driver: what a file under way holds when its writer is killed between any two writes.
#include <errno.h>
#include <hdf5.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>


#include "base/fileio.h"
#include "base/h5util.h"
#include "scene.h"

// 160 chunks: an index of three nodes, two of which have been divided
enum { SERIES = 2, CHUNK = 8, ROWS = 4 * CHUNK, FLUSHES = 40, WIDTH = 5 };

static long writes_left = -1; // until the writer dies; −1: it lives
static size_t most_at_once = SIZE_MAX;

typedef struct {
    size_t begin, end;
} span;

enum { MAX_SPANS = 4096 };
static span written[MAX_SPANS]; // of the writes since somebody set the number to 0
static int n_written;

/// In place of the C library's: writes as it does, until the one at which the program is killed.
ssize_t pwrite(int fd, const void *data, size_t n, off_t at)
{
    if (writes_left == 0) _exit(9);
    if (writes_left > 0) writes_left--;
    if (n > most_at_once) n = most_at_once;
    if (n_written < MAX_SPANS) written[n_written++] = (span){(size_t)at, (size_t)at + n};
    return syscall(SYS_pwrite64, fd, data, n, at);
}

static double entry(int series, hsize_t row) { return 1 + (double)row + 0.01 * series; }

/// Series and packed tables that grow, flushed after every ROWS rows. Returns the number of writes after the first
/// flush.
static long write_file(const char *path, long die_after)
{
    bt_errors err = {0};
    bt_h5 h = {0};
    bt_h5_create(&h, path, &err);
    hid_t series[SERIES];
    char name[32];
    for (int k = 0; k < SERIES; k++) {
        snprintf(name, sizeof name, "/series%d", k);
        series[k] = bt_h5_growing(&h, name, H5T_NATIVE_DOUBLE, 1, NULL, (hsize_t[]){CHUNK, 1}, false);
        bt_h5_attr_text(&h, name, "description", "grows");
    }
    const hid_t table =
        bt_h5_growing(&h, "/table", H5T_NATIVE_DOUBLE, 2, (hsize_t[]){WIDTH}, (hsize_t[]){1, WIDTH}, true);
    long used = 0;
    for (int n = 0; n < FLUSHES; n++) {
        for (int k = 0; k < SERIES; k++) {
            double row[ROWS];
            for (int i = 0; i < ROWS; i++) row[i] = entry(k, (hsize_t)(n * ROWS + i));
            bt_h5_append(&h, series[k], H5T_NATIVE_DOUBLE, (hsize_t)n * ROWS, ROWS, row);
        }
        double cells[WIDTH];
        for (int i = 0; i < WIDTH; i++) cells[i] = entry(SERIES + i, (hsize_t)n);
        bt_h5_append(&h, table, H5T_NATIVE_DOUBLE, (hsize_t)n, 1, cells);
        snprintf(name, sizeof name, "flush %*d", 3 + n % 9, n);
        bt_h5_attr_text(&h, "/", "note", name);
        bt_h5_flush(&h);
        if (n == 0) writes_left = die_after >= 0 ? die_after : 1000000000;
    }
    used = 1000000000 - writes_left;
    writes_left = -1;
    for (int k = 0; k < SERIES; k++) H5Dclose(series[k]);
    H5Dclose(table);
    assert_int_equal(bt_h5_close(&h), BT_OK);
    bt_errors_free(&err);
    return used;
}

/// Rows of a dataset that opens; fails when one of them is not what was written.
static hsize_t whole_rows(hid_t file, const char *name, int series, int width)
{
    const hid_t d = H5Dopen2(file, name, H5P_DEFAULT), space = H5Dget_space(d);
    hsize_t n[2] = {0};
    H5Sget_simple_extent_dims(space, n, NULL);
    double *x = calloc(n[0] * (hsize_t)width + 1, sizeof *x);
    assert_true(H5Dread(d, H5T_NATIVE_DOUBLE, H5S_ALL, H5S_ALL, H5P_DEFAULT, x) >= 0);
    for (hsize_t i = 0; i < n[0]; i++)
        for (int c = 0; c < width; c++)
            if (x[i * (hsize_t)width + (hsize_t)c] != entry(series + c, i))
                fail_msg("%s, row %d of %d: %g, not %g", name, (int)i, (int)n[0], x[i * (hsize_t)width + (hsize_t)c],
                         entry(series + c, i));
    free(x);
    H5Sclose(space);
    H5Dclose(d);
    return n[0];
}

/// The number in a text that every flush writes anew: in a heap, to which a header leads.
static int note_of(hid_t file)
{
    const hid_t a = H5Aopen(file, "note", H5P_DEFAULT), type = H5Aget_type(a), space = H5Aget_space(a);
    char *text = NULL;
    int n = -1;
    assert_true(H5Aread(a, type, &text) >= 0 && text && sscanf(text, "flush %d", &n) == 1);
    H5Dvlen_reclaim(type, space, H5P_DEFAULT, &text);
    H5Sclose(space);
    H5Tclose(type);
    H5Aclose(a);
    return n;
}

// Red: metadata that are written as HDF5 hands them over, or lowest address first: rows announced before their index is
// there.
TEST(killed_at_any_write_it_holds_whole_rows)
{
    char path[] = "/tmp/bt_h5driver_XXXXXX";
    close(mkstemp(path));
    const long writes = write_file(path, -1);
    assert_true(writes > 2 * FLUSHES && writes < 100 * FLUSHES);
    H5Eset_auto2(H5E_DEFAULT, NULL, NULL);
    hsize_t last = 0;
    // every write of the first flushes, where the indices come to be; then every third
    for (long n = 0; n < writes; n += n < writes / 4 ? 1 : 3) {
        const pid_t child = fork();
        if (child == 0) {
            write_file(path, n);
            _exit(0);
        }
        int how;
        assert_int_equal(waitpid(child, &how, 0), child);
        assert_true(WIFEXITED(how) && WEXITSTATUS(how) == 9);
        const hid_t file = H5Fopen(path, H5F_ACC_RDONLY, H5P_DEFAULT);
        if (file < 0) fail_msg("killed at write %ld of %ld: the file does not open", n, writes);
        hsize_t least = (hsize_t)-1, most = 0;
        for (int k = 0; k < SERIES; k++) {
            char name[32];
            snprintf(name, sizeof name, "/series%d", k);
            const hsize_t rows = whole_rows(file, name, k, 1);
            least = rows < least ? rows : least;
            most = rows > most ? rows : most;
        }
        assert_true(note_of(file) % FLUSHES == note_of(file));
        const hsize_t tables = whole_rows(file, "/table", SERIES, WIDTH);
        H5Fclose(file);
        // Of one flush, or of that one and the next.
        assert_true(least % ROWS == 0 && least >= ROWS && most <= least + ROWS && tables * ROWS >= least &&
                    tables * ROWS <= least + ROWS);
        assert_true(least >= last);
        last = least;
    }
    assert_true(last >= (FLUSHES - 1) * ROWS);
    unlink(path);
}

enum { NAMES = 60, OPERATIONS = 4000 };

/// A dataset holds k, k + 1, ..., n of them.
static void check_series(hid_t file, const char *name, int k, hsize_t n)
{
    const hid_t d = H5Dopen2(file, name, H5P_DEFAULT), space = H5Dget_space(d);
    int *x = calloc(n, sizeof *x);
    assert_int_equal(H5Sget_simple_extent_npoints(space), n);
    assert_true(H5Dread(d, H5T_NATIVE_INT, H5S_ALL, H5S_ALL, H5P_DEFAULT, x) >= 0);
    for (hsize_t i = 0; i < n; i++) assert_int_equal(x[i], k + (int)i);
    free(x);
    H5Sclose(space);
    H5Dclose(d);
}

/// Datasets made, extended, read and deleted by turns, with a small cache of metadata, from a seed; flushed now and
/// then.
static void shuffle(hid_t access, const char *path, uint64_t seed_given, hsize_t length[NAMES])
{
    uint64_t seed = seed_given;
    H5AC_cache_config_t cache = {.version = H5AC__CURR_CACHE_CONFIG_VERSION};
    H5Pget_mdc_config(access, &cache);
    cache.set_initial_size = true;
    // so that metadata leave it before they are flushed, and are read again
    cache.initial_size = cache.min_size = cache.max_size = 4096;
    cache.incr_mode = H5C_incr__off, cache.flash_incr_mode = H5C_flash_incr__off, cache.decr_mode = H5C_decr__off;
    assert_true(H5Pset_mdc_config(access, &cache) >= 0);
    const hid_t file = H5Fcreate(path, H5F_ACC_TRUNC, H5P_DEFAULT, access), quiet = H5Pcreate(H5P_DATASET_CREATE);
    assert_true(file >= 0);
    H5Pset_obj_track_times(quiet, false);
    H5Pset_chunk(quiet, 1, (hsize_t[]){16});
    for (int n = 0; n < OPERATIONS; n++) {
        const int which = (int)(scene_uniform(&seed) * NAMES);
        const double choice = scene_uniform(&seed);
        char name[20];
        snprintf(name, sizeof name, "/d%d", which);
        if (choice < 0.02 && seed_given % 2 == 1) H5Fflush(file, H5F_SCOPE_LOCAL);
        if (length[which] == 0) {
            const hid_t space = H5Screate_simple(1, (hsize_t[]){0}, (hsize_t[]){H5S_UNLIMITED});
            H5Dclose(H5Dcreate2(file, name, H5T_NATIVE_INT, space, H5P_DEFAULT, quiet, H5P_DEFAULT));
            H5Sclose(space);
            length[which] = 1;
        } else if (choice < 0.25) {
            H5Ldelete(file, name, H5P_DEFAULT);
            length[which] = 0;
            continue;
        }
        const hsize_t now = length[which], more = now + (hsize_t)(200 * scene_uniform(&seed));
        if (now > 1) check_series(file, name, which, now);
        const hid_t d = H5Dopen2(file, name, H5P_DEFAULT);
        int *x = calloc(more, sizeof *x);
        for (hsize_t i = 0; i < more; i++) x[i] = which + (int)i;
        assert_true(H5Dset_extent(d, &more) >= 0 && H5Dwrite(d, H5T_NATIVE_INT, H5S_ALL, H5S_ALL, H5P_DEFAULT, x) >= 0);
        length[which] = more;
        free(x);
        H5Dclose(d);
    }
    // the file becomes short: much of what waits lies beyond its end
    for (int k = 0; k < NAMES && seed_given % 2 == 0; k++) {
        char name[20];
        snprintf(name, sizeof name, "/d%d", k);
        if (length[k] > 0) H5Ldelete(file, name, H5P_DEFAULT);
        length[k] = 0;
    }
    H5Pclose(quiet);
    assert_true(H5Fclose(file) >= 0);
}

// Red: what waits not seen by a read, written over data that took its place, or written beyond the end of the file.
TEST(a_file_of_many_changes_is_whole)
{
    char ours[] = "/tmp/bt_h5driver_XXXXXX", theirs[] = "/tmp/bt_h5driver_XXXXXX";
    close(mkstemp(ours));
    close(mkstemp(theirs));
    for (uint64_t seed = 1; seed <= 4; seed++) {
        int errnum = 0;
        hsize_t length[NAMES] = {0}, other[NAMES] = {0};
        const hid_t access = H5Pcreate(H5P_FILE_ACCESS), plain = H5Pcreate(H5P_FILE_ACCESS);
        assert_true(bt_h5driver_select(access, &errnum) >= 0);
        shuffle(access, ours, seed, length);
        shuffle(plain, theirs, seed, other);
        assert_int_equal(errnum, 0);
        H5Pclose(access);
        H5Pclose(plain);
        assert_memory_equal(length, other, sizeof length);
        struct stat a, b;
        assert_true(stat(ours, &a) == 0 && stat(theirs, &b) == 0);
        assert_int_equal(a.st_size, b.st_size); // as long as with the library's own driver
        const hid_t file = H5Fopen(ours, H5F_ACC_RDONLY, H5P_DEFAULT);
        for (int k = 0; k < NAMES; k++) {
            char name[20];
            snprintf(name, sizeof name, "/d%d", k);
            assert_int_equal(H5Lexists(file, name, H5P_DEFAULT) > 0, length[k] > 0);
            if (length[k] > 1) check_series(file, name, k, length[k]);
        }
        H5Fclose(file);
    }
    unlink(ours);
    unlink(theirs);
}

enum { LENGTH = 20000, NONE = 0, HEADER = 1, INDEX = 2 };

/// What the driver should hold, a byte each.
typedef struct {
    unsigned char byte[LENGTH], waits[LENGTH]; ///< waits: NONE, HEADER or INDEX
    size_t end, flushed;
} plain_file;

static int kind_of(const plain_file *m, size_t i)
{
    return i < m->flushed && m->waits[i] == INDEX ? INDEX : HEADER;
}

/// The runs of bytes that a flush should write, in their order. Returns their number.
static int expected_runs(const plain_file *m, span out[MAX_SPANS])
{
    static span by_address[MAX_SPANS];
    int n = 0, k = 0;
    for (size_t i = 0; i < LENGTH; i++) {
        if (m->waits[i] == NONE) continue;
        span *last = n ? &by_address[n - 1] : NULL;
        if (last && last->end == i && i != m->flushed && kind_of(m, i) == kind_of(m, last->begin)) last->end++;
        else by_address[n++] = (span){i, i + 1};
    }
    for (int r = 0; r < n; r++)
        if (by_address[r].begin >= m->flushed) out[k++] = by_address[r];
    for (int r = 0; r < n; r++)
        if (by_address[r].begin < m->flushed && kind_of(m, by_address[r].begin) == INDEX) out[k++] = by_address[r];
    for (int r = n - 1; r >= 0; r--)
        if (by_address[r].begin < m->flushed && kind_of(m, by_address[r].begin) != INDEX) out[k++] = by_address[r];
    assert_int_equal(k, n);
    return n;
}

static void check_flush(H5FD_t *file, plain_file *m)
{
    static span wanted[MAX_SPANS];
    const int n = expected_runs(m, wanted);
    n_written = 0;
    assert_true(H5FDflush(file, H5P_DEFAULT, false) >= 0);
    assert_int_equal(n_written, n);
    assert_memory_equal(written, wanted, (size_t)n * sizeof *wanted);
    memset(m->waits, NONE, sizeof m->waits);
    m->flushed = m->end;
}

// Red: a run that goes over a gap, over the end of the last flush, or from an index to a header; what waits not seen by
// a read, or seen after data took its place.
TEST(every_byte_and_every_write_is_that_of_a_file_held_byte_by_byte)
{
    char path[] = "/tmp/bt_h5driver_XXXXXX";
    close(mkstemp(path));
    static plain_file m;
    unsigned char some[600], back[600];
    uint64_t seed = 1;
    int errnum = 0, flushes = 0;
    const hid_t access = H5Pcreate(H5P_FILE_ACCESS);
    assert_true(bt_h5driver_select(access, &errnum) >= 0);
    H5FD_t *file = H5FDopen(path, H5F_ACC_RDWR | H5F_ACC_TRUNC, access, HADDR_UNDEF);
    assert_non_null(file);
    assert_true(H5FDset_eoa(file, H5FD_MEM_DEFAULT, LENGTH) >= 0);
    m = (plain_file){0};
    for (int n = 0; n < 20000; n++) {
        const size_t most = n < 2000 ? 1 + (size_t)n * 9 : LENGTH - 700; // the file grows
        const size_t at = 1 + (size_t)(scene_uniform(&seed) * (double)most);
        const size_t size = 1 + (size_t)(scene_uniform(&seed) * (scene_uniform(&seed) < 0.8 ? 40 : 600));
        const double choice = scene_uniform(&seed);
        if (choice < 0.25) {
            assert_true(H5FDread(file, H5FD_MEM_OHDR, H5P_DEFAULT, at, size, back) >= 0);
            assert_memory_equal(back, m.byte + at, size);
        } else if (choice < 0.99) {
            const int kind = choice < 0.35 ? NONE : choice < 0.7 ? HEADER : INDEX;
            for (size_t i = 0; i < size; i++) some[i] = (unsigned char)(256 * scene_uniform(&seed));
            const H5FD_mem_t type = kind == NONE ? H5FD_MEM_DRAW : kind == HEADER ? H5FD_MEM_OHDR : H5FD_MEM_BTREE;
            assert_true(H5FDwrite(file, type, H5P_DEFAULT, at, size, some) >= 0);
            memcpy(m.byte + at, some, size);
            memset(m.waits + at, kind, size);
            if (at + size > m.end) m.end = at + size;
        } else {
            check_flush(file, &m);
            flushes++;
        }
    }
    check_flush(file, &m);
    assert_true(flushes > 100 && errnum == 0);
    assert_true(H5FDclose(file) >= 0);
    H5Pclose(access);
    unlink(path);
}

/// The system may write less than it was given: what is left follows, at its place.
TEST(a_write_cut_short_goes_on)
{
    char bytes[1000], back[1016] = {0}, name[] = "/tmp/bergtow-short-XXXXXX";
    for (size_t k = 0; k < sizeof bytes; k++) bytes[k] = (char)(k % 251);
    const int fd = mkstemp(name);
    assert_true(fd >= 0 && unlink(name) == 0);
    most_at_once = 300;
    const int reason = bt_file_put(fd, 16, bytes, sizeof bytes);
    most_at_once = SIZE_MAX;
    assert_int_equal(reason, 0);
    assert_int_equal(pread(fd, back, sizeof back, 0), sizeof back);
    assert_memory_equal(back + 16, bytes, sizeof bytes);
    assert_int_equal(bt_file_close(fd), 0);
    assert_int_equal(bt_file_close(fd), EBADF); // what the system says of a close is passed on
}

/// Where a text cannot have its name, because a folder has it, nothing is left under the temporary one.
TEST(a_text_that_fails_leaves_nothing)
{
    char folder[] = "/tmp/bergtow-text-XXXXXX", path[64], part[80];
    bt_errors err = {0};
    assert_non_null(mkdtemp(folder));
    snprintf(path, sizeof path, "%s/text", folder);
    snprintf(part, sizeof part, "%s.tmp", path);
    assert_int_equal(mkdir(path, 0700), 0);
    assert_int_equal(bt_file_write(path, "words", &err), BT_ERR_IO);
    assert_int_equal(access(part, F_OK), -1);
    assert_int_equal(rmdir(path), 0);
    assert_int_equal(rmdir(folder), 0);
    bt_errors_free(&err);
}

TEST_MAIN(NULL, NULL)
