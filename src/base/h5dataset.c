// SPDX-License-Identifier: MIT
// Units, axes and slabs of datasets, and the provenance of a file; see h5dataset.h.
#include "base/h5dataset.h"

#include <hdf5_hl.h>
#include <inttypes.h>
#include <omp.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "bergtow/base.h"
#include "revision.h"

// --- units and axes --------------------------------------------------------------------------------------------------

enum { MAX_AXES = 3, PATH = 200 };

/// The name that netCDF gives a dimension without a coordinate.
static const char no_variable[] = "This is a netCDF dimension but not a netCDF variable. %10" PRIu64;

static bool there(const bt_h5 *h5, const char *path) { return H5Lexists(h5->file, path, H5P_DEFAULT) > 0; }

/// Make a dimension without a coordinate: no value is ever written, and no storage allocated.
static hid_t make_dimension(bt_h5 *h5, const char *path, hsize_t length, bool grows)
{
    const hsize_t most = grows ? H5S_UNLIMITED : length;
    const hid_t space = H5Screate_simple(1, &length, &most), how = H5Pcreate(H5P_DATASET_CREATE);
    H5Pset_obj_track_times(how, false);
    H5Pset_fill_time(how, H5D_FILL_TIME_NEVER);
    if (grows) H5Pset_chunk(how, 1, (hsize_t[]){1024});
    const hid_t d = H5Dcreate2(h5->file, path, H5T_IEEE_F32BE, space, H5P_DEFAULT, how, H5P_DEFAULT);
    char name[100];
    snprintf(name, sizeof name, no_variable, (uint64_t)length);
    bt_h5_check(h5, d >= 0 && H5DSset_scale(d, name) >= 0);
    H5Pclose(how);
    H5Sclose(space);
    return d;
}

/// The scale of an axis of a dataset: beside the dataset, else in the root group, else made there.
static hid_t scale_of(bt_h5 *h5, const char *dataset, const char *axis, hsize_t length, bool grows)
{
    char path[PATH];
    snprintf(path, sizeof path, "%.*s/%s", (int)(strrchr(dataset, '/') - dataset), dataset, axis);
    if (!there(h5, path)) snprintf(path, sizeof path, "/%s", axis);
    if (!there(h5, path)) return make_dimension(h5, path, length, grows);
    const hid_t d = H5Dopen2(h5->file, path, H5P_DEFAULT);
    bt_h5_check(h5, d >= 0 && (H5DSis_scale(d) > 0 || H5DSset_scale(d, axis) >= 0));
    return d;
}

void bt_h5_axes(bt_h5 *h5, const char *dataset, const char *axes)
{
    if (h5->status != BT_OK || h5->file < 0) return;
    const hid_t d = H5Dopen2(h5->file, dataset, H5P_DEFAULT), space = H5Dget_space(d);
    hsize_t now[MAX_AXES] = {0}, most[MAX_AXES] = {0};
    const int rank = H5Sget_simple_extent_ndims(space);
    bt_h5_check(h5, d >= 0 && rank >= 1 && rank <= MAX_AXES && H5Sget_simple_extent_dims(space, now, most) == rank);
    const char *word = axes;
    for (int k = 0; k < rank && h5->status == BT_OK; k++) {
        char axis[40];
        const size_t n = strcspn(word, " ");
        snprintf(axis, sizeof axis, "%.*s", (int)n, word);
        word += n + (word[n] == ' ');
        const hid_t scale = scale_of(h5, dataset, axis, now[k], most[k] == H5S_UNLIMITED);
        // a coordinate is a scale itself, and takes none
        if (scale >= 0 && H5DSis_scale(d) <= 0) bt_h5_check(h5, H5DSattach_scale(d, scale, (unsigned)k) >= 0);
        if (scale >= 0) H5Dclose(scale);
    }
    H5Sclose(space);
    if (d >= 0) H5Dclose(d);
}

void bt_h5_units(bt_h5 *h5, const char *dataset, const char *units)
{
    bt_h5_attr_text(h5, dataset, strchr(units, ',') ? "units_of_columns" : "units", units);
}

void bt_h5_describe(bt_h5 *h5, const char *dataset, const char *axes, const char *units, const char *meaning)
{
    if (h5->status != BT_OK || h5->file < 0) return;
    if (units) bt_h5_units(h5, dataset, units);
    bt_h5_attr_text(h5, dataset, "long_name", meaning);
    bt_h5_attr_text(h5, dataset, "description", meaning);
    if (axes) bt_h5_axes(h5, dataset, axes);
}

void bt_h5_put(bt_h5 *h5, const char *name, hid_t type, hsize_t n, hsize_t width, const void *data, const char *axes,
               const char *units, const char *meaning)
{
    bt_h5_write(h5, name, type, n, width, data);
    bt_h5_describe(h5, name, axes, units, meaning);
}

void bt_h5_put_names(bt_h5 *h5, const char *name, hsize_t n, const char *const *names, const char *axis,
                     const char *meaning)
{
    bt_h5_write_names(h5, name, n, names);
    bt_h5_describe(h5, name, axis, NULL, meaning);
}

void bt_h5_put_text(bt_h5 *h5, const char *name, const char *text, const char *meaning)
{
    bt_h5_write_text(h5, name, text);
    bt_h5_describe(h5, name, NULL, NULL, meaning);
}

void bt_h5_describe_file(bt_h5 *h5, const char *title)
{
    bt_h5_attr_text(h5, "/", "Conventions", "CF-1.8");
    bt_h5_attr_text(h5, "/", "source", "bergtow " BT_VERSION ", a simulation");
    if (title && *title) bt_h5_attr_text(h5, "/", "title", title);
}

// --- slabs -----------------------------------------------------------------------------------------------------------

// On one rank, rows go through HDF5, in chunks of at most 256 kB, shuffled and deflated. On several, only rank 0 has
// the file open in HDF5: it lays out the datasets (space allocated when a dataset is made or grows, no fill values) and
// tells the others where the rows lie; every rank then writes its rows there with pwrite, without compression.
//
// Rejected: HDF5's own parallel driver. It keeps a copy of all metadata on each rank, and each change to them is
// collective. A write that fails on one rank (full disk, quota) leaves the others waiting inside the library or MPI-IO,
// a file that cannot be closed crashes in MPI_Finalize, and the system's error number is lost on the way. Here errors
// are plain errno values on the rank where they occur. The price is compression, which would save a quarter to a third
// of poses and vertices.

#define SMALL 8192 // bytes, not packed up to here: the index of a chunked dataset takes 2 kB

static bt_slab describe(bt_h5 *h5, hid_t type, int64_t n, int width)
{
    const size_t row = H5Tget_size(type) * (size_t)(width ? width : 1);
    // Pieces of equal length, since HDF5 stores the last one whole, too.
    const int64_t most = (int64_t)(BT_SLAB_BYTES / row), pieces = n > 0 ? (n + most - 1) / most : 1;
    return (bt_slab){.h = h5,
                     .dataset = -1,
                     .type = type,
                     .n = n,
                     .width = width,
                     .row_bytes = row,
                     .piece = n > 0 ? (n + pieces - 1) / pieces : 1};
}

bt_slab bt_slab_fixed(bt_h5 *h5, const char *name, hid_t type, int64_t n, int width, bool packed)
{
    bt_slab slab = describe(h5, type, n, width);
    slab.packed = packed && !bt_h5_shared(h5) && (size_t)n * slab.row_bytes > SMALL;
    if (!slab.packed && n > 0) slab.piece = n;
    slab.dataset = bt_h5_dataset(h5, name, type, width ? 2 : 1, (hsize_t[]){(hsize_t)n, (hsize_t)width},
                                 slab.packed ? (hsize_t)slab.piece : 0);
    return slab;
}

bt_slab bt_slab_growing(bt_h5 *h5, const char *name, hid_t type, int64_t n, int width)
{
    bt_slab slab = describe(h5, type, n, width);
    slab.growing = true;
    slab.packed = !bt_h5_shared(h5);
    slab.dataset = bt_h5_growing(h5, name, type, width ? 3 : 2, (hsize_t[]){(hsize_t)n, (hsize_t)width},
                                 (hsize_t[]){1, (hsize_t)slab.piece}, slab.packed);
    return slab;
}

void bt_slab_grow(bt_slab *slab, int64_t frame)
{
    slab->frame = frame;
    bt_h5_extend(slab->h, slab->dataset, (hsize_t)frame + 1);
}

static int64_t pieces_of(const bt_slab *slab) { return (slab->n + slab->piece - 1) / slab->piece; }

bt_status bt_slab_share(const bt_comm *comm, bt_slab *const *slab, int k)
{
    if (comm->size == 1) return slab[0]->h->status;
    size_t n = 1;
    for (int i = 0; i < k; i++) n += (size_t)pieces_of(slab[i]);
    uint64_t *words = bt_alloc(n, sizeof *words), *p = words + 1;
    if (comm->rank == 0)
        for (int i = 0; i < k; i++) {
            const int64_t pieces = pieces_of(slab[i]);
            for (int64_t j = 0; j < pieces; j++)
                p[j] = bt_h5_address(slab[i]->h, slab[i]->dataset, slab[i]->growing, (hsize_t)slab[i]->frame,
                                     (hsize_t)(j * slab[i]->piece));
            p += pieces;
        }
    words[0] = (uint64_t)slab[0]->h->status;
    bt_comm_bcast(comm, words, n * sizeof *words);
    const bt_status status = (bt_status)words[0];
    p = words + 1;
    for (int i = 0; i < k; i++) {
        const size_t pieces = (size_t)pieces_of(slab[i]);
        slab[i]->address = bt_realloc(slab[i]->address, pieces, sizeof *slab[i]->address);
        memcpy(slab[i]->address, p, pieces * sizeof *p);
        p += pieces;
    }
    free(words);
    return status;
}

void bt_slab_write(bt_slab *slab, int64_t first, int64_t n, const void *rows)
{
    const bool whole = first % slab->piece == 0 && (n == slab->piece || first + n == slab->n);
    if (slab->packed && whole && n <= slab->piece) {
        bt_h5_write_chunk(slab->h, slab->dataset, slab->growing, (hsize_t)slab->frame, (hsize_t)first, (size_t)n,
                          (size_t)slab->piece, slab->row_bytes, rows);
        return;
    }
    if (!bt_h5_shared(slab->h)) {
        bt_h5_write_rows(slab->h, slab->dataset, slab->type, slab->growing, (hsize_t)slab->frame, (hsize_t)first,
                         (hsize_t)n, rows);
        return;
    }
    const char *p = rows;
    while (n > 0 && slab->h->status == BT_OK) {
        const int64_t piece = first / slab->piece, left = (piece + 1) * slab->piece - first, now = n < left ? n : left;
        const size_t bytes = (size_t)now * slab->row_bytes;
        bt_h5_write_raw(slab->h, slab->address[piece] + (uint64_t)(first - piece * slab->piece) * slab->row_bytes,
                        bytes, p);
        p += bytes;
        first += now;
        n -= now;
    }
}

void bt_slab_close(bt_slab *slab)
{
    if (slab->dataset >= 0) H5Dclose(slab->dataset);
    free(slab->address);
    slab->dataset = -1;
    slab->address = NULL;
}

// Rows up to the end of the piece or of the buffer: writes end where pieces do, so that each chunk is deflated once.
static int64_t room_from(const bt_slab *slab, int64_t at)
{
    const int64_t buffer = (int64_t)(BT_SLAB_BYTES / slab->row_bytes), left = slab->piece - at % slab->piece;
    return left < buffer ? left : buffer;
}

bt_rows bt_rows_from(bt_slab *slab, int64_t first, void *buffer)
{
    return (bt_rows){.s = slab, .buffer = buffer, .at = first, .room = room_from(slab, first)};
}

void bt_rows_end(bt_rows *rows)
{
    if (rows->n > 0) bt_slab_write(rows->s, rows->at, rows->n, rows->buffer);
    rows->at += rows->n;
    rows->n = 0;
    rows->room = room_from(rows->s, rows->at);
}

// --- provenance ------------------------------------------------------------------------------------------------------

const char *bt_provenance_revision(void) { return BT_REVISION; }

void bt_provenance_write(bt_h5 *h5, const char *command_line)
{
    char host[256] = "unknown", mpi[MPI_MAX_LIBRARY_VERSION_STRING], text[sizeof mpi + 60];
    if (gethostname(host, sizeof host - 1) != 0) snprintf(host, sizeof host, "unknown");

    const time_t now = time(NULL);
    struct tm utc;
    char start[40] = "unknown";
    if (gmtime_r(&now, &utc)) strftime(start, sizeof start, "%Y-%m-%dT%H:%M:%SZ", &utc);

    unsigned major = 0, minor = 0, release = 0;
    H5get_libversion(&major, &minor, &release);
    snprintf(text, sizeof text, "HDF5 %u.%u.%u, %s", major, minor, release, bt_comm_library(mpi));

    bt_h5_attr_text(h5, "/", "program", "bergtow");
    bt_h5_attr_text(h5, "/", "version", BT_VERSION);
    bt_h5_attr_text(h5, "/", "revision", BT_REVISION);
    bt_h5_attr_text(h5, "/", "compiler", BT_COMPILER);
    bt_h5_attr_text(h5, "/", "flags", BT_FLAGS);
    bt_h5_attr_text(h5, "/", "libraries", text);
    bt_h5_attr_text(h5, "/", "command_line", command_line ? command_line : "");
    bt_h5_attr_text(h5, "/", "host", host);
    bt_h5_attr_text(h5, "/", "start_time", start);
    bt_h5_attr_int(h5, "/", "ranks", bt_comm_world()->size);
    bt_h5_attr_int(h5, "/", "threads", omp_get_max_threads());
}

void bt_provenance_keep(bt_h5 *h5, bt_h5_reader *old)
{
    static const char *const names[] = {"start_time", "command_line", "revision"};
    for (size_t k = 0; k < sizeof names / sizeof *names; k++) {
        char *before = bt_h5_read_word(old, names[k]);
        if (!before) continue;
        static const char own[] = ", " BT_REVISION;
        const size_t n = strlen(before), most = sizeof own - 1;
        const bool last = !strcmp(before, BT_REVISION) || (n > most && !strcmp(before + n - most, own));
        char *text = bt_text_of("%s%s", before, strcmp(names[k], "revision") || last ? "" : own);
        bt_h5_attr_text(h5, "/", names[k], text);
        free(text);
        free(before);
    }
}
