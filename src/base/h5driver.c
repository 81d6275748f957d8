// SPDX-License-Identifier: MIT
// An HDF5 file driver: it keeps the system's first error, lets no write fail, and leaves the file whole after each.
//
// After a failed write (full disk, quota, file size limit) HDF5 1.10 cannot close the file: H5Fclose frees memory that
// the file's identifier still points to, and the library's exit handler then crashes, in MPI_Finalize too. So this
// driver tells HDF5 that the write succeeded, keeps errno for the caller, and writes nothing from then on. The library
// stays sound, the reason is a number instead of a text in an error stack, and the file on disk stays as the last
// complete flush left it.
//
// Metadata (headers, indices) wait in memory until HDF5 ends a flush; data go to the file at once. HDF5 writes metadata
// in any order, and headers may then announce rows that are not yet in the file: a reader at that moment, or a kill,
// finds rows of zeros. This driver writes them at the end of a flush, each run of bytes in one call: first the
// superblock, which must know the length of the file; then new bytes; then old nodes of indices, from the lowest
// address to the highest (a root stays where it was made, and must know the new half of a node before that node gives
// it up); last the other old bytes, from the highest address to the lowest (headers lead to all others). After each
// write, a dataset thus has the length of this flush or of the last one, and all of its rows. The exception is a packed
// chunk to which rows are added, since it moves: packed chunks here have one row (h5util.h).
//
// The driver takes no lock, so that a file can be read while it is being written. Otherwise it does what HDF5's own
// POSIX driver does, and that driver can read the files.
#include "base/h5util.h"

#include <errno.h>
#include <fcntl.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/fileio.h"

#define MAX_ADDRESS (((haddr_t)1 << 62) - 1)

typedef struct driver_info { int *errnum; } driver_info;

enum { PAGE = 4096, WORD = 64 };

/// Waiting metadata in one page of the file. The other bytes of the page are data, which other ranks may be writing.
typedef struct page {
    haddr_t at;                  ///< a multiple of PAGE
    uint64_t waits[PAGE / WORD], index[PAGE / WORD]; ///< one bit per byte: it waits; it is part of an index
    char byte[PAGE];
} page;

typedef struct driver_file {
    H5FD_t pub; ///< first, as HDF5 requires
    int fd;
    bool writes;
    haddr_t eoa, eof; ///< end of the allocated addresses; end of the file, waiting bytes included
    page **pages;     ///< [n_pages] in order of address
    size_t n_pages, cap_pages;
    haddr_t super, super_end; ///< the superblock
    haddr_t flushed;  ///< end of the file at the last flush
    dev_t device;
    ino_t inode;
    int *errnum;
} driver_file;

static H5FD_t *driver_open(const char *name, unsigned flags, hid_t access, haddr_t maxaddr)
{
    (void)maxaddr;
    const driver_info *info = H5Pget_driver_info(access);
    if (!info) return NULL;
    const int how = (flags & H5F_ACC_RDWR ? O_RDWR : O_RDONLY) | (flags & H5F_ACC_TRUNC ? O_TRUNC : 0) |
                    (flags & H5F_ACC_CREAT ? O_CREAT : 0) | (flags & H5F_ACC_EXCL ? O_EXCL : 0);
    const int fd = bt_file_descriptor(name, how);
    struct stat st;
    if (fd < 0 || fstat(fd, &st) != 0) {
        *info->errnum = errno;
        if (fd >= 0) close(fd);
        return NULL;
    }
    driver_file *file = calloc(1, sizeof *file);
    if (!file) {
        *info->errnum = ENOMEM;
        close(fd);
        return NULL;
    }
    file->fd = fd;
    file->writes = flags & H5F_ACC_RDWR;
    file->eof = file->flushed = (haddr_t)st.st_size;
    file->device = st.st_dev;
    file->inode = st.st_ino;
    file->errnum = info->errnum;
    *file->errnum = 0; // clear the error of HDF5's test whether the file exists
    return &file->pub;
}

/// Write data to the file, unless an operation on it has failed before.
static void put(driver_file *file, haddr_t address, size_t size, const char *p)
{
    if (!*file->errnum) *file->errnum = bt_file_put(file->fd, (off_t)address, p, size);
}

static bool bit_of(const uint64_t *bits, size_t i) { return bits[i / WORD] >> i % WORD & 1; }

/// The first place from i on whose bit is `set`; PAGE if there is none. By words, since pages are searched often.
static size_t first_place(const uint64_t *bits, size_t i, bool set)
{
    while (i < PAGE) {
        const uint64_t word = (set ? bits[i / WORD] : ~bits[i / WORD]) >> i % WORD;
        if (word) return i + (size_t)__builtin_ctzll(word);
        i += WORD - i % WORD;
    }
    return PAGE;
}

static void set_bits(uint64_t *bits, size_t from, size_t to, bool set)
{
    while (from < to) {
        const size_t n = to - from < WORD - from % WORD ? to - from : WORD - from % WORD;
        const uint64_t mask = (n == WORD ? ~(uint64_t)0 : ((uint64_t)1 << n) - 1) << from % WORD;
        if (set) bits[from / WORD] |= mask;
        else bits[from / WORD] &= ~mask;
        from += n;
    }
}

/// The part of a page between two addresses: from place *from up to the place returned.
static size_t part_of(const page *waiting, haddr_t address, haddr_t end, size_t *from)
{
    *from = address > waiting->at ? (size_t)(address - waiting->at) : 0;
    return waiting->at + PAGE < end ? PAGE : (size_t)(end - waiting->at);
}

/// Index of the first page that ends beyond an address.
static size_t page_from(const driver_file *file, haddr_t address)
{
    size_t low = 0, high = file->n_pages;
    while (low < high) {
        const size_t mid = (low + high) / 2;
        if (file->pages[mid]->at + PAGE <= address) low = mid + 1;
        else high = mid;
    }
    return low;
}

/// The page that contains an address, made if necessary; NULL if out of memory.
static page *page_at(driver_file *file, haddr_t address)
{
    const size_t k = page_from(file, address);
    if (k < file->n_pages && file->pages[k]->at <= address) return file->pages[k];
    if (file->n_pages == file->cap_pages) {
        const size_t cap = 2 * file->cap_pages + 16;
        page **more = realloc(file->pages, cap * sizeof *more);
        if (!more) return NULL;
        file->pages = more;
        file->cap_pages = cap;
    }
    page *waiting = calloc(1, sizeof *waiting);
    if (!waiting) return NULL;
    waiting->at = address - address % PAGE;
    memmove(file->pages + k + 1, file->pages + k, (file->n_pages - k) * sizeof *file->pages);
    file->pages[k] = waiting;
    file->n_pages++;
    return waiting;
}

static void keep_waiting(driver_file *file, bool index, haddr_t address, size_t size, const char *p)
{
    while (size > 0) {
        page *waiting = page_at(file, address);
        if (!waiting) {
            if (!*file->errnum) *file->errnum = ENOMEM;
            return;
        }
        const size_t from = (size_t)(address - waiting->at), n = size < PAGE - from ? size : PAGE - from;
        memcpy(waiting->byte + from, p, n);
        set_bits(waiting->waits, from, from + n, true);
        set_bits(waiting->index, from, from + n, index);
        address += n;
        p += n;
        size -= n;
    }
}

/// Drop bytes that wait between address and end: other data have replaced them, or the file ends before them.
static void forget(driver_file *file, haddr_t address, haddr_t end)
{
    for (size_t k = page_from(file, address); k < file->n_pages && file->pages[k]->at < end; k++) {
        size_t from;
        const size_t to = part_of(file->pages[k], address, end, &from);
        set_bits(file->pages[k]->waits, from, to, false);
    }
}

/// Copy waiting bytes over those read from the file.
static void overlay(const driver_file *file, haddr_t address, size_t size, char *p)
{
    for (size_t k = page_from(file, address); k < file->n_pages && file->pages[k]->at < address + size; k++) {
        const page *waiting = file->pages[k];
        size_t from;
        const size_t to = part_of(waiting, address, address + size, &from);
        while ((from = first_place(waiting->waits, from, true)) < to) {
            const size_t gap = first_place(waiting->waits, from, false), n = (gap < to ? gap : to) - from;
            memcpy(p + (waiting->at + from - address), waiting->byte + from, n);
            from += n;
        }
    }
}

/// Write the bytes from address to end, all of which wait, in one call.
static void put_run(driver_file *file, haddr_t address, haddr_t end)
{
    const size_t size = (size_t)(end - address);
    char *whole = calloc(size, 1);
    if (whole) {
        overlay(file, address, size, whole);
        put(file, address, size, whole);
    } else if (!*file->errnum) {
        *file->errnum = ENOMEM;
    }
    free(whole);
}

/// The superblock states the length of the file: it is written when the file has that length, and before anything that
/// leads beyond the old length.
static void put_superblock(driver_file *file)
{
    const size_t k = page_from(file, file->super);
    if (k == file->n_pages || file->pages[k]->at > file->super) return;
    if (!bit_of(file->pages[k]->waits, (size_t)(file->super - file->pages[k]->at))) return;
    struct stat st;
    if (!*file->errnum && fstat(file->fd, &st) != 0) *file->errnum = errno;
    if (!*file->errnum && (haddr_t)st.st_size < file->eoa) *file->errnum = bt_file_resize(file->fd, (off_t)file->eoa);
    put_run(file, file->super, file->super_end);
    forget(file, file->super, file->super_end);
}

/// Bytes without a gap: all in an old index or none, all old or all new.
typedef struct run {
    haddr_t begin, end;
    bool index;
} run;

/// End of the run of waiting bytes from place i: at a gap, or where an index begins or ends, or old bytes end.
static size_t end_of_run(const driver_file *file, const page *waiting, size_t i)
{
    const size_t gap = first_place(waiting->waits, i, false),
                 other = first_place(waiting->index, i, !bit_of(waiting->index, i));
    const size_t end = gap < other ? gap : other;
    return waiting->at + i < file->flushed && file->flushed < waiting->at + end
           ? (size_t)(file->flushed - waiting->at) : end;
}

/// All waiting bytes as runs, in order of address. NULL if out of memory, or if nothing waits.
static run *runs_of(driver_file *file, size_t *n)
{
    run *all = NULL;
    size_t cap = *n = 0;
    for (size_t k = 0; k < file->n_pages; k++) {
        const page *waiting = file->pages[k];
        for (size_t i = 0, end; (i = first_place(waiting->waits, i, true)) < PAGE; i = end) {
            end = end_of_run(file, waiting, i);
            const bool index = waiting->at + i < file->flushed && bit_of(waiting->index, i);
            run *last = *n > 0 ? &all[*n - 1] : NULL;
            if (last && last->end == waiting->at + i && last->index == index && last->end != file->flushed) {
                last->end = waiting->at + end;
                continue;
            }
            if (*n == cap) {
                run *more = realloc(all, (cap = 2 * cap + 64) * sizeof *more);
                if (!more) {
                    if (!*file->errnum) *file->errnum = ENOMEM;
                    return all;
                }
                all = more;
            }
            all[(*n)++] = (run){waiting->at + i, waiting->at + end, index};
        }
    }
    return all;
}

/// Write all waiting bytes, in the order that keeps the file whole after each write.
static void put_waiting(driver_file *file)
{
    put_superblock(file);
    size_t n, first_new = 0;
    run *all = runs_of(file, &n);
    while (first_new < n && all[first_new].end <= file->flushed) first_new++;
    for (size_t k = first_new; k < n; k++) put_run(file, all[k].begin, all[k].end);
    for (size_t k = 0; k < first_new; k++)
        if (all[k].index) put_run(file, all[k].begin, all[k].end);
    for (size_t k = first_new; k-- > 0;)
        if (!all[k].index) put_run(file, all[k].begin, all[k].end);
    free(all);
    while (file->n_pages > 0) free(file->pages[--file->n_pages]);
    file->flushed = file->eof;
}

static herr_t driver_flush(H5FD_t *file, hid_t transfer, hbool_t closing)
{
    (void)transfer, (void)closing;
    put_waiting((driver_file *)file);
    return 0;
}

static herr_t driver_close(H5FD_t *file)
{
    driver_file *f = (driver_file *)file;
    put_waiting(f);
    free(f->pages);
    if (f->writes && !*f->errnum) *f->errnum = bt_file_sync(f->fd);
    const int closed = bt_file_close(f->fd);
    if (!*f->errnum) *f->errnum = closed;
    free(f);
    return 0;
}

static int driver_cmp(const H5FD_t *a, const H5FD_t *b)
{
    const driver_file *f = (const driver_file *)a, *g = (const driver_file *)b;
    if (f->device != g->device) return f->device < g->device ? -1 : 1;
    if (f->inode != g->inode) return f->inode < g->inode ? -1 : 1;
    return 0;
}

static herr_t driver_query(const H5FD_t *file, unsigned long *flags)
{
    (void)file;
    if (flags)
        *flags = H5FD_FEAT_AGGREGATE_METADATA | H5FD_FEAT_DATA_SIEVE | H5FD_FEAT_AGGREGATE_SMALLDATA |
                 H5FD_FEAT_DEFAULT_VFD_COMPATIBLE;
    return 0;
}

static haddr_t driver_get_eoa(const H5FD_t *file, H5FD_mem_t type)
{
    (void)type;
    return ((const driver_file *)file)->eoa;
}

static herr_t driver_set_eoa(H5FD_t *file, H5FD_mem_t type, haddr_t address)
{
    (void)type;
    ((driver_file *)file)->eoa = address;
    return 0;
}

static haddr_t driver_get_eof(const H5FD_t *file, H5FD_mem_t type)
{
    (void)type;
    return ((const driver_file *)file)->eof;
}

static herr_t driver_read(H5FD_t *file, H5FD_mem_t type, hid_t transfer, haddr_t address, size_t size, void *buffer)
{
    (void)type, (void)transfer;
    driver_file *f = (driver_file *)file;
    const ssize_t n = bt_file_get(f->fd, (off_t)address, buffer, size);
    if (n < 0) {
        if (!*f->errnum) *f->errnum = errno;
        return -1;
    }
    memset((char *)buffer + n, 0, size - (size_t)n); // beyond the end: zeros, as HDF5 defines
    overlay(f, address, size, buffer);
    return 0;
}

static herr_t driver_write(H5FD_t *file, H5FD_mem_t type, hid_t transfer, haddr_t address, size_t size,
                           const void *buffer)
{
    (void)transfer;
    driver_file *f = (driver_file *)file;
    if (type == H5FD_MEM_DRAW) {
        forget(f, address, address + size);
        put(f, address, size, buffer);
    } else {
        if (type == H5FD_MEM_SUPER) f->super = address, f->super_end = address + size;
        keep_waiting(f, type == H5FD_MEM_BTREE, address, size, buffer);
    }
    if (address + size > f->eof) f->eof = address + size;
    return 0;
}

static herr_t driver_truncate(H5FD_t *file, hid_t transfer, hbool_t closing)
{
    (void)transfer, (void)closing;
    driver_file *f = (driver_file *)file;
    if (f->eoa == f->eof) return 0;
    forget(f, f->eoa, MAX_ADDRESS);
    if (!*f->errnum) *f->errnum = bt_file_resize(f->fd, (off_t)f->eoa);
    f->eof = f->eoa;
    return 0;
}

static const H5FD_class_t driver = {
#if H5_VERSION_GE(1, 13, 0)
    .version = H5FD_CLASS_VERSION,
    .value = (H5FD_class_value_t)600, // from the range for drivers not registered with the HDF Group
#endif
    .name = "bergtow",
    .maxaddr = MAX_ADDRESS,
    .fc_degree = H5F_CLOSE_STRONG, // datasets that are still open close with the file
    .fapl_size = sizeof(driver_info),
    .open = driver_open,
    .close = driver_close,
    .cmp = driver_cmp,
    .query = driver_query,
    .get_eoa = driver_get_eoa,
    .set_eoa = driver_set_eoa,
    .get_eof = driver_get_eof,
    .read = driver_read,
    .write = driver_write,
    .flush = driver_flush,
    .truncate = driver_truncate,
    .fl_map = H5FD_FLMAP_DICHOTOMY,
};

herr_t bt_h5driver_select(hid_t access, int *errnum)
{
    static hid_t id = -1;
    if (id < 0 || H5Iis_valid(id) <= 0) id = H5FDregister(&driver);
    return id < 0 ? -1 : H5Pset_driver(access, id, &(driver_info){errnum});
}
