// SPDX-License-Identifier: MIT
// HDF5 with one way to fail: every call's result goes through a handle that keeps the first error.
#include "base/h5util.h"

#include <errno.h>
#include <fcntl.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>
#include <zlib.h>

#include "base/fileio.h"
#include "base/inside.h"

// --- chunks ----------------------------------------------------------------------------------------------------------

// Shuffling puts byte k of all numbers together, as one plane for each k. Planes differ: the low bytes of coordinates
// are noise, which deflate searches in vain for most of its time; signs and exponents repeat. A zlib stream may change
// its method midway: so each plane is stored, or coded by the frequencies of its bytes alone, or searched for repeats,
// depending on a sample of it. Every reader of HDF5 accepts such a stream.
//
// Two frames of 90,000 floes: 7.75 MB instead of 7.81 MB, in 0.4 of the time. The search uses level 1: half a per cent
// more bytes than level 4 (tows of 700 and 30,000 floes), at three quarters of the work.

enum { LEVEL = 1, SAMPLE = 2048, PIECES = 4 };
static const double GAIN = 0.03; // a plane that gains less is stored; a sample's own table of codes may hide as much

struct bt_deflater {
    z_stream whole, trial;
    unsigned char *plane, *out;
    size_t cap_plane, cap_out;
};

typedef struct way { int level, strategy; } way;
static const way STORED = {0, Z_DEFAULT_STRATEGY}, BY_BYTES = {LEVEL, Z_HUFFMAN_ONLY},
                 BY_REPEATS = {LEVEL, Z_DEFAULT_STRATEGY};

void bt_deflater_free(bt_deflater *deflater)
{
    if (!deflater) return;
    deflateEnd(&deflater->whole);
    deflateEnd(&deflater->trial);
    BT_FREE(deflater->plane, deflater->out, deflater);
}

static bt_deflater *create(void)
{
    bt_deflater *deflater = bt_alloc(1, sizeof *deflater);
    const bool begun = deflateInit(&deflater->whole, LEVEL) == Z_OK && deflateInit(&deflater->trial, LEVEL) == Z_OK;
    if (begun) return deflater;
    bt_deflater_free(deflater);
    return NULL;
}

/// Bytes of a sample compressed by method w; SAMPLE if zlib fails.
static size_t tried(z_stream *z, way w, const unsigned char *sample)
{
    unsigned char out[2 * SAMPLE];
    if (deflateReset(z) != Z_OK || deflateParams(z, w.level, w.strategy) != Z_OK) return SAMPLE;
    z->next_in = (unsigned char *)sample, z->avail_in = SAMPLE;
    z->next_out = out, z->avail_out = sizeof out;
    return deflate(z, Z_FINISH) == Z_STREAM_END ? (size_t)z->total_out : SAMPLE;
}

static way way_of(z_stream *trial, const unsigned char *plane, size_t n)
{
    if (n <= SAMPLE) return BY_REPEATS;
    unsigned char sample[SAMPLE];
    const size_t piece = SAMPLE / PIECES, step = (n - piece) / (PIECES - 1);
    for (size_t k = 0; k < PIECES; k++) memcpy(sample + k * piece, plane + k * step, piece);
    const size_t bytes = tried(trial, BY_BYTES, sample), repeats = tried(trial, BY_REPEATS, sample),
                 least = bytes < repeats ? bytes : repeats;
    if ((double)least > (1 - GAIN) * SAMPLE) return STORED;
    return bytes < repeats ? BY_BYTES : BY_REPEATS;
}

/// Gather every size-th byte from `numbers` on, n in all, and fill the plane up to `room` bytes with zeros.
static void take_plane(unsigned char *plane, const unsigned char *numbers, size_t n, size_t room, size_t size)
{
    for (size_t i = 0; i < n; i++) plane[i] = numbers[i * size];
    memset(plane + n, 0, room - n);
}

const void *bt_deflate(bt_deflater **of, const void *numbers, size_t n, size_t room, size_t size, size_t *length)
{
    if (!*of && !(*of = create())) return NULL;
    bt_deflater *deflater = *of;
    z_stream *z = &deflater->whole;
    // a change of method ends a block, which takes some bytes
    const size_t most = deflateBound(z, (unsigned long)(room * size)) + 64 * (size + 1);
    if (room > deflater->cap_plane) deflater->plane = bt_realloc(deflater->plane, deflater->cap_plane = room, 1);
    if (most > deflater->cap_out) deflater->out = bt_realloc(deflater->out, deflater->cap_out = most, 1);
    if (deflateReset(z) != Z_OK) return NULL;
    z->next_out = deflater->out, z->avail_out = (unsigned)most;
    for (size_t k = 0; k < size; k++) {
        take_plane(deflater->plane, (const unsigned char *)numbers + k, n, room, size);
        const way w = way_of(&deflater->trial, deflater->plane, room);
        z->next_in = deflater->plane, z->avail_in = 0;
        if (deflateParams(z, w.level, w.strategy) != Z_OK) return NULL;
        z->avail_in = (unsigned)room;
        if (deflate(z, Z_NO_FLUSH) != Z_OK || z->avail_in > 0) return NULL;
    }
    if (deflate(z, Z_FINISH) != Z_STREAM_END) return NULL;
    *length = (size_t)z->total_out;
    return deflater->out;
}

// --- files, groups, datasets -----------------------------------------------------------------------------------------

static herr_t innermost_text(unsigned n, const H5E_error2_t *e, void *data)
{
    if (n == 0 && e->desc) snprintf(data, 200, "%s", e->desc);
    return 0;
}

/// Report as "path: cannot ACTION: reason; remedy" and mark the handle as failed.
static void fail(bt_h5 *h5, const char *action)
{
    if (h5->status != BT_OK) return;
    if (*h5->errnum) {
        h5->status = bt_file_fail(h5->path, action, *h5->errnum, h5->err);
        return;
    }
    char text[200] = "unknown reason";
    H5Ewalk2(H5E_DEFAULT, H5E_WALK_UPWARD, innermost_text, text);
    h5->status = BT_ERR_IO;
    bt_errors_add(h5->err, "%s: cannot %s: HDF5: %s; %s", h5->path, action, text, bt_file_remedy(0));
}

void bt_h5_check(bt_h5 *h5, bool done)
{
    if (!done || *h5->errnum) fail(h5, "write the file");
}

static bool idle(const bt_h5 *h5) { return h5->status != BT_OK || h5->file < 0; }

static void begin(bt_h5 *h5, const char *path, bt_errors *err)
{
    *h5 = (bt_h5){.file = -1, .raw = -1, .path = bt_text_copy(path), .errnum = bt_alloc(1, sizeof(int)), .err = err};
}

bt_status bt_h5_create(bt_h5 *h5, const char *path, bt_errors *err)
{
    begin(h5, path, err);
    if ((h5->status = bt_file_may_take(path, err)) != BT_OK) return bt_h5_close(h5);
    H5Eset_auto2(H5E_DEFAULT, NULL, NULL); // HDF5 prints nothing: one message, ours
    const hid_t access = H5Pcreate(H5P_FILE_ACCESS);
    bool set = bt_h5driver_select(access, h5->errnum) >= 0;
    // Metadata stay in memory between flushes, so that a reader, or an interrupted run, finds the state of the last
    // flush. The cache has room for far more than changes between two flushes, so that only old, unchanged entries
    // leave it. It is limited because a flush looks at all of it: without a limit, 3,000 frames of 142 floes took 7 s
    // to write and 10,000 took 89 s; with it, 2 s and 8 s.
    const size_t room = (size_t)1 << 21;
    H5AC_cache_config_t cache = {.version = H5AC__CURR_CACHE_CONFIG_VERSION};
    set = set && H5Pget_mdc_config(access, &cache) >= 0;
    cache.set_initial_size = 1;
    cache.initial_size = cache.min_size = cache.max_size = room;
    cache.min_clean_fraction = 0.01;
    cache.incr_mode = H5C_incr__off;
    cache.flash_incr_mode = H5C_flash_incr__off;
    cache.decr_mode = H5C_decr__off;
    set = set && H5Pset_mdc_config(access, &cache) >= 0;
    // A link of this name is replaced, as by a rename, and not followed.
    struct stat st;
    if (lstat(path, &st) == 0 && S_ISLNK(st.st_mode)) unlink(path);
    if (set) h5->file = H5Fcreate(path, H5F_ACC_TRUNC, H5P_DEFAULT, access);
    if (h5->file < 0) fail(h5, "create the file");
    H5Pclose(access);
    if (h5->status != BT_OK) bt_h5_close(h5);
    return h5->status;
}

bt_status bt_h5_create_shared(bt_h5 *h5, const bt_comm *comm, const char *path, bt_errors *err)
{
    if (comm->rank == 0) bt_h5_create(h5, path, err);
    else begin(h5, path, err);
    if (comm->size == 1) return h5->status;
    bt_status status = bt_comm_agree(comm, h5->status);
    if (status == BT_OK) {
        h5->raw = bt_file_descriptor(path, O_WRONLY);
        if (h5->raw < 0) {
            *h5->errnum = errno;
            fail(h5, "open the file");
        }
        status = bt_comm_agree(comm, h5->status);
    }
    if (status != BT_OK) {
        bt_h5_give_up(h5, status);
        bt_h5_close(h5);
    }
    return status;
}

void bt_h5_give_up(bt_h5 *h5, bt_status status)
{
    if (h5->status == BT_OK) h5->status = status;
    if (h5->errnum && !*h5->errnum) *h5->errnum = EIO; // the driver writes nothing from here on
}

void bt_h5_flush(bt_h5 *h5)
{
    if (idle(h5)) return;
    bt_h5_check(h5, H5Fflush(h5->file, H5F_SCOPE_LOCAL) >= 0);
}

void bt_h5_sync_raw(bt_h5 *h5)
{
    if (h5->raw < 0 || h5->status != BT_OK) return;
    *h5->errnum = bt_file_sync(h5->raw);
    bt_h5_check(h5, true);
}

bt_status bt_h5_close(bt_h5 *h5)
{
    if (h5->file >= 0) {
        bt_h5_flush(h5);
        bt_h5_check(h5, H5Fclose(h5->file) >= 0);
    }
    if (h5->raw >= 0) {
        const int closed = bt_file_close(h5->raw);
        if (!*h5->errnum) *h5->errnum = closed;
        bt_h5_check(h5, true);
    }
    free(h5->path);
    free(h5->errnum);
    bt_deflater_free(h5->deflater);
    const bt_status status = h5->status;
    *h5 = (bt_h5){.file = -1, .raw = -1, .status = status};
    return status;
}

void bt_h5_group(bt_h5 *h5, const char *name)
{
    if (idle(h5)) return;
    const hid_t g = H5Gcreate2(h5->file, name, H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT);
    bt_h5_check(h5, g >= 0 && H5Gclose(g) >= 0);
}

/// Creation properties without time stamps, so that two runs of one case give the same file contents.
static hid_t quiet_creation(void)
{
    const hid_t p = H5Pcreate(H5P_DATASET_CREATE);
    H5Pset_obj_track_times(p, 0);
    return p;
}

/// Takes over `create` and `space`, and closes them.
static void write_in_space(bt_h5 *h5, const char *name, hid_t create, hid_t type, hid_t space, const void *data)
{
    const hid_t d = H5Dcreate2(h5->file, name, type, space, H5P_DEFAULT, create, H5P_DEFAULT);
    const bool filled = data && H5Sget_simple_extent_npoints(space) > 0;
    bt_h5_check(h5, d >= 0 && (!filled || H5Dwrite(d, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, data) >= 0));
    if (d >= 0) bt_h5_check(h5, H5Dclose(d) >= 0); // the data of a small dataset reach the file only here
    H5Sclose(space);
    H5Pclose(create);
}

void bt_h5_write(bt_h5 *h5, const char *name, hid_t mem, hsize_t n, hsize_t width, const void *data)
{
    if (idle(h5)) return;
    write_in_space(h5, name, quiet_creation(), mem, H5Screate_simple(width ? 2 : 1, (hsize_t[]){n, width}, NULL), data);
}

/// Creation properties of a dataset. Other ranks write into a shared file: space is allocated at once, and not filled.
static hid_t layout(const bt_h5 *h5, int rank, const hsize_t *chunk, bool packed)
{
    const hid_t p = quiet_creation();
    if (chunk) H5Pset_chunk(p, rank, chunk);
    if (packed) { // the filters that read the chunks of bt_h5_write_chunk
        H5Pset_shuffle(p);
        H5Pset_deflate(p, 1);
    }
    if (bt_h5_shared(h5)) {
        H5Pset_alloc_time(p, H5D_ALLOC_TIME_EARLY);
        H5Pset_fill_time(p, H5D_FILL_TIME_NEVER);
    }
    return p;
}

/// Access properties. A packed chunk is written whole, and once: without a cache, which would take 1 MB a dataset.
static hid_t opened(bool packed)
{
    if (!packed) return H5P_DEFAULT;
    const hid_t p = H5Pcreate(H5P_DATASET_ACCESS);
    H5Pset_chunk_cache(p, H5D_CHUNK_CACHE_NSLOTS_DEFAULT, 0, H5D_CHUNK_CACHE_W0_DEFAULT);
    return p;
}

/// most: largest size, NULL = the size now; chunk: NULL = contiguous.
static hid_t create_dataset(bt_h5 *h5, const char *name, hid_t type, int rank, const hsize_t *now, const hsize_t *most,
                            const hsize_t *chunk, bool packed)
{
    const hid_t space = H5Screate_simple(rank, now, most), create = layout(h5, rank, chunk, packed),
                access = opened(packed);
    const hid_t d = H5Dcreate2(h5->file, name, type, space, H5P_DEFAULT, create, access);
    bt_h5_check(h5, d >= 0);
    if (access != H5P_DEFAULT) H5Pclose(access);
    H5Pclose(create);
    H5Sclose(space);
    return d;
}

hid_t bt_h5_dataset(bt_h5 *h5, const char *name, hid_t type, int rank, const hsize_t *dims, hsize_t chunk)
{
    if (idle(h5)) return -1;
    return create_dataset(h5, name, type, rank, dims, NULL,
                          chunk ? (hsize_t[]){chunk, rank > 1 ? dims[1] : 1} : NULL, chunk > 0);
}

static hid_t text_type(size_t size)
{
    const hid_t t = H5Tcopy(H5T_C_S1);
    H5Tset_size(t, size);
    H5Tset_cset(t, H5T_CSET_UTF8);
    return t;
}

void bt_h5_write_text(bt_h5 *h5, const char *name, const char *text)
{
    if (idle(h5)) return;
    const hid_t type = text_type(strlen(text) + 1);
    write_in_space(h5, name, quiet_creation(), type, H5Screate(H5S_SCALAR), text);
    H5Tclose(type);
}

void bt_h5_write_names(bt_h5 *h5, const char *name, hsize_t n, const char *const *names)
{
    if (idle(h5)) return;
    const hid_t type = text_type(H5T_VARIABLE);
    write_in_space(h5, name, quiet_creation(), type, H5Screate_simple(1, &n, NULL), names);
    H5Tclose(type);
}

static void attr(bt_h5 *h5, const char *object, const char *name, hid_t type, const void *value)
{
    if (idle(h5)) return;
    const hid_t space = H5Screate(H5S_SCALAR), o = H5Oopen(h5->file, object, H5P_DEFAULT);
    if (o >= 0 && H5Aexists(o, name) > 0) H5Adelete(o, name);
    const hid_t a = o < 0 ? -1 : H5Acreate2(o, name, type, space, H5P_DEFAULT, H5P_DEFAULT);
    bt_h5_check(h5, a >= 0 && H5Awrite(a, type, value) >= 0);
    if (a >= 0) H5Aclose(a);
    if (o >= 0) H5Oclose(o);
    H5Sclose(space);
}

// Variable length, since a fixed-length attribute can be neither empty nor longer than 64 kB.
void bt_h5_attr_text(bt_h5 *h5, const char *object, const char *name, const char *text)
{
    const hid_t type = text_type(H5T_VARIABLE);
    attr(h5, object, name, type, &text);
    H5Tclose(type);
}

void bt_h5_attr_word(bt_h5 *h5, const char *object, const char *name, const char *text)
{
    const hid_t type = text_type(strlen(text) + 1);
    attr(h5, object, name, type, text);
    H5Tclose(type);
}

void bt_h5_attr_int(bt_h5 *h5, const char *object, const char *name, int64_t value)
{
    attr(h5, object, name, H5T_NATIVE_INT64, &value);
}

void bt_h5_attr_double(bt_h5 *h5, const char *object, const char *name, double value)
{
    attr(h5, object, name, H5T_NATIVE_DOUBLE, &value);
}

hid_t bt_h5_growing(bt_h5 *h5, const char *name, hid_t type, int rank, const hsize_t *dims, const hsize_t *chunk,
                    bool packed)
{
    if (idle(h5)) return -1;
    hsize_t now[3] = {0}, most[3] = {H5S_UNLIMITED}, piece[3] = {chunk[0]};
    for (int k = 1; k < rank; k++) {
        now[k] = dims[k - 1];
        // A chunk must be neither empty nor larger than a fixed dimension: an empty dimension gets room for one.
        most[k] = now[k] ? now[k] : 1;
        piece[k] = k == 1 ? chunk[1] : most[k];
    }
    return create_dataset(h5, name, type, rank, now, most, piece, packed);
}

static int extent(hid_t dataset, hsize_t size[3])
{
    const hid_t space = H5Dget_space(dataset);
    const int rank = H5Sget_simple_extent_dims(space, size, NULL);
    H5Sclose(space);
    return rank;
}

void bt_h5_extend(bt_h5 *h5, hid_t dataset, hsize_t length)
{
    if (idle(h5)) return;
    hsize_t size[3] = {0};
    const int rank = extent(dataset, size);
    size[0] = length;
    bt_h5_check(h5, rank >= 1 && H5Dset_extent(dataset, size) >= 0);
}

/// Write a block of a dataset, of the given size, from start on.
static void write_block(bt_h5 *h5, hid_t dataset, hid_t mem, int rank, const hsize_t *start, const hsize_t *size,
                        const void *data)
{
    const hid_t space = H5Dget_space(dataset), here = H5Screate_simple(rank, size, NULL);
    const bool filled = H5Sget_simple_extent_npoints(here) > 0;
    bt_h5_check(h5, H5Sselect_hyperslab(space, H5S_SELECT_SET, start, NULL, size, NULL) >= 0 &&
                  (!filled || H5Dwrite(dataset, mem, here, space, H5P_DEFAULT, data) >= 0));
    H5Sclose(here);
    H5Sclose(space);
}

void bt_h5_append(bt_h5 *h5, hid_t dataset, hid_t mem, hsize_t at, hsize_t n, const void *data)
{
    if (idle(h5) || n == 0) return;
    bt_h5_extend(h5, dataset, at + n);
    if (h5->status != BT_OK) return;
    hsize_t size[3] = {0};
    const int rank = extent(dataset, size);
    size[0] = n;
    write_block(h5, dataset, mem, rank, (hsize_t[3]){at}, size, data);
}

void bt_h5_read_back(bt_h5 *h5, hid_t dataset, hid_t mem, hsize_t first, hsize_t n, void *data)
{
    if (idle(h5) || n == 0) return;
    const hid_t space = H5Dget_space(dataset), here = H5Screate_simple(1, &n, NULL);
    const bool done = H5Sselect_hyperslab(space, H5S_SELECT_SET, &first, NULL, &n, NULL) >= 0 &&
                      H5Dread(dataset, mem, here, space, H5P_DEFAULT, data) >= 0;
    if (!done || *h5->errnum) fail(h5, "read the file back");
    H5Sclose(here);
    H5Sclose(space);
}

void bt_h5_write_rows(bt_h5 *h5, hid_t dataset, hid_t mem, bool frames, hsize_t frame, hsize_t first, hsize_t n,
                      const void *rows)
{
    if (idle(h5) || n == 0) return;
    hsize_t size[3] = {0}, start[3] = {0};
    const int rank = extent(dataset, size);
    if (frames) {
        start[0] = frame;
        size[0] = 1;
    }
    start[frames] = first;
    size[frames] = n;
    write_block(h5, dataset, mem, rank, start, size, rows);
}

void bt_h5_write_chunk(bt_h5 *h5, hid_t dataset, bool frames, hsize_t frame, hsize_t first, size_t n, size_t room,
                       size_t row_bytes, const void *rows)
{
    if (idle(h5) || n == 0) return;
    const hid_t type = H5Dget_type(dataset);
    const size_t size = H5Tget_size(type), wide = row_bytes / size;
    H5Tclose(type);
    hsize_t at[3] = {frame};
    at[frames] = first;
    size_t length = 0;
    const void *chunk = bt_deflate(&h5->deflater, rows, n * wide, room * wide, size, &length);
    bt_h5_check(h5, chunk && H5Dwrite_chunk(dataset, H5P_DEFAULT, 0, at, length, chunk) >= 0);
}

uint64_t bt_h5_address(bt_h5 *h5, hid_t dataset, bool frames, hsize_t frame, hsize_t row)
{
    if (idle(h5)) return 0;
    haddr_t address = HADDR_UNDEF;
    if (!frames) {
        address = H5Dget_offset(dataset);
    } else {
        unsigned mask;
        hsize_t size;
        if (H5Dget_chunk_info_by_coord(dataset, (hsize_t[3]){frame, row}, &mask, &address, &size) < 0)
            address = HADDR_UNDEF;
    }
    bt_h5_check(h5, address != HADDR_UNDEF);
    return address;
}

void bt_h5_write_raw(bt_h5 *h5, uint64_t address, size_t bytes, const void *data)
{
    if (h5->status != BT_OK) return;
    *h5->errnum = bt_file_put(h5->raw, (off_t)address, data, bytes);
    bt_h5_check(h5, true);
}
