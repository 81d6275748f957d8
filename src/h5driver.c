// SPDX-License-Identifier: MIT
// An HDF5 file driver that keeps the system's first error and never fails a write.
//
// When a write fails (full disk, quota, file size limit) HDF5 1.10 cannot close the file any more: H5Fclose frees what
// the file's identifier still points to, and the library's exit handler then crashes, in MPI_Finalize too. So this driver
// tells HDF5 that the write was done, keeps errno for the caller, and from then on writes nothing: the library stays
// sound, the reason is a number instead of a text in an error stack, and the file on disk stays as the last complete
// flush left it as far as HDF5's order of writing allows. It takes no lock, so that a file can be read while it is
// being written. Otherwise it does what HDF5's own POSIX driver does, and that one reads the files.
#include "h5driver.h"

#include <errno.h>
#include <fcntl.h>
#include <stdlib.h>
#include <sys/stat.h>
#include <unistd.h>

#define MAX_ADDRESS (((haddr_t)1 << 62) - 1)

typedef struct driver_info { int *errnum; } driver_info;

typedef struct driver_file {
    H5FD_t pub; ///< first, as HDF5 asks
    int fd;
    haddr_t eoa, eof; ///< end of the allocated addresses, end of the file
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
                    (flags & H5F_ACC_CREAT ? O_CREAT : 0) | (flags & H5F_ACC_EXCL ? O_EXCL : 0) | O_CLOEXEC;
    const int fd = open(name, how, 0666);
    struct stat st;
    if (fd < 0 || fstat(fd, &st) != 0) {
        *info->errnum = errno;
        if (fd >= 0) close(fd);
        return NULL;
    }
    driver_file *f = calloc(1, sizeof *f);
    if (!f) {
        *info->errnum = ENOMEM;
        close(fd);
        return NULL;
    }
    f->fd = fd;
    f->eof = (haddr_t)st.st_size;
    f->device = st.st_dev;
    f->inode = st.st_ino;
    f->errnum = info->errnum;
    *f->errnum = 0; // HDF5 first tries whether the file is there
    return &f->pub;
}

static herr_t driver_close(H5FD_t *file)
{
    driver_file *f = (driver_file *)file;
    if (close(f->fd) != 0 && !*f->errnum) *f->errnum = errno;
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
        *flags = H5FD_FEAT_AGGREGATE_METADATA | H5FD_FEAT_ACCUMULATE_METADATA | H5FD_FEAT_DATA_SIEVE |
                 H5FD_FEAT_AGGREGATE_SMALLDATA | H5FD_FEAT_DEFAULT_VFD_COMPATIBLE;
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
    char *p = buffer;
    while (size > 0) {
        const ssize_t n = pread(f->fd, p, size, (off_t)address);
        if (n < 0 && errno == EINTR) continue;
        if (n < 0) {
            if (!*f->errnum) *f->errnum = errno;
            return -1;
        }
        if (n == 0) { // beyond the end: zeros, as HDF5 defines it
            while (size > 0) p[--size] = 0;
            break;
        }
        size -= (size_t)n;
        address += (haddr_t)n;
        p += n;
    }
    return 0;
}

static herr_t driver_write(H5FD_t *file, H5FD_mem_t type, hid_t transfer, haddr_t address, size_t size, const void *buffer)
{
    (void)type, (void)transfer;
    driver_file *f = (driver_file *)file;
    const char *p = buffer;
    const haddr_t end = address + size;
    while (size > 0 && !*f->errnum) {
        const ssize_t n = pwrite(f->fd, p, size, (off_t)address);
        if (n < 0 && errno == EINTR) continue;
        if (n <= 0) {
            *f->errnum = n < 0 ? errno : ENOSPC;
            break;
        }
        size -= (size_t)n;
        address += (haddr_t)n;
        p += n;
    }
    if (end > f->eof) f->eof = end;
    return 0;
}

static herr_t driver_truncate(H5FD_t *file, hid_t transfer, hbool_t closing)
{
    (void)transfer, (void)closing;
    driver_file *f = (driver_file *)file;
    if (f->eoa == f->eof) return 0;
    if (!*f->errnum && ftruncate(f->fd, (off_t)f->eoa) != 0) *f->errnum = errno;
    f->eof = f->eoa;
    return 0;
}

static const H5FD_class_t driver = {
#if H5_VERSION_GE(1, 13, 0)
    .version = H5FD_CLASS_VERSION,
    .value = (H5FD_class_value_t)600, // of the range for drivers that are not registered with the HDF Group
#endif
    .name = "bergtow",
    .maxaddr = MAX_ADDRESS,
    .fc_degree = H5F_CLOSE_WEAK,
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
    .truncate = driver_truncate,
    .fl_map = H5FD_FLMAP_DICHOTOMY,
};

herr_t bt_h5driver_select(hid_t access, int *errnum)
{
    static hid_t id = -1;
    if (id < 0 || H5Iis_valid(id) <= 0) id = H5FDregister(&driver);
    return id < 0 ? -1 : H5Pset_driver(access, id, &(driver_info){errnum});
}
