// SPDX-License-Identifier: MIT
// Units, axes and slabs of datasets, and the provenance of a file; see h5dataset.h.
#include "base/h5dataset.h"

#include <errno.h>
#include <hdf5_hl.h>
#include <inttypes.h>
#include <omp.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "bergtow/base.h"
#include "revision.h"

// --- units and axes --------------------------------------------------------------------------------------------------

// What a dataset holds, for programs that do not know this one.

enum { MOST_AXES = 3, PATH = 200 };

/// The name by which netCDF knows a dimension without a coordinate.
static const char no_variable[] = "This is a netCDF dimension but not a netCDF variable. %10" PRIu64;

static bool there(const bt_h5 *h, const char *path) { return H5Lexists(h->file, path, H5P_DEFAULT) > 0; }

/// A dimension without a coordinate: no value is ever written, and no storage taken.
static hid_t make_dimension(bt_h5 *h, const char *path, hsize_t length, bool grows)
{
    const hsize_t most = grows ? H5S_UNLIMITED : length;
    const hid_t space = H5Screate_simple(1, &length, &most), how = H5Pcreate(H5P_DATASET_CREATE);
    H5Pset_obj_track_times(how, false);
    H5Pset_fill_time(how, H5D_FILL_TIME_NEVER);
    if (grows) H5Pset_chunk(how, 1, (hsize_t[]){1024});
    const hid_t d = H5Dcreate2(h->file, path, H5T_IEEE_F32BE, space, H5P_DEFAULT, how, H5P_DEFAULT);
    char name[100];
    snprintf(name, sizeof name, no_variable, (uint64_t)length);
    bt_h5_check(h, d >= 0 && H5DSset_scale(d, name) >= 0);
    H5Pclose(how);
    H5Sclose(space);
    return d;
}

/// The scale of an axis of a dataset: beside it, in the root group, or new there.
static hid_t scale_of(bt_h5 *h, const char *dataset, const char *axis, hsize_t length, bool grows)
{
    char path[PATH];
    snprintf(path, sizeof path, "%.*s/%s", (int)(strrchr(dataset, '/') - dataset), dataset, axis);
    if (!there(h, path)) snprintf(path, sizeof path, "/%s", axis);
    if (!there(h, path)) return make_dimension(h, path, length, grows);
    const hid_t d = H5Dopen2(h->file, path, H5P_DEFAULT);
    bt_h5_check(h, d >= 0 && (H5DSis_scale(d) > 0 || H5DSset_scale(d, axis) >= 0));
    return d;
}

void bt_h5_axes(bt_h5 *h, const char *dataset, const char *axes)
{
    if (h->status != BT_OK || h->file < 0) return;
    const hid_t d = H5Dopen2(h->file, dataset, H5P_DEFAULT), space = H5Dget_space(d);
    hsize_t now[MOST_AXES] = {0}, most[MOST_AXES] = {0};
    const int rank = H5Sget_simple_extent_ndims(space);
    bt_h5_check(h, d >= 0 && rank >= 1 && rank <= MOST_AXES && H5Sget_simple_extent_dims(space, now, most) == rank);
    const char *word = axes;
    for (int k = 0; k < rank && h->status == BT_OK; k++) {
        char axis[40];
        const size_t n = strcspn(word, " ");
        snprintf(axis, sizeof axis, "%.*s", (int)n, word);
        word += n + (word[n] == ' ');
        const hid_t scale = scale_of(h, dataset, axis, now[k], most[k] == H5S_UNLIMITED);
        // a coordinate is its own axis, and has none
        if (scale >= 0 && H5DSis_scale(d) <= 0) bt_h5_check(h, H5DSattach_scale(d, scale, (unsigned)k) >= 0);
        if (scale >= 0) H5Dclose(scale);
    }
    H5Sclose(space);
    if (d >= 0) H5Dclose(d);
}

void bt_h5_units(bt_h5 *h, const char *dataset, const char *units)
{
    bt_h5_attr_text(h, dataset, strchr(units, ',') ? "units_of_columns" : "units", units);
}

void bt_h5_describe(bt_h5 *h, const char *dataset, const char *axes, const char *units, const char *meaning)
{
    if (h->status != BT_OK || h->file < 0) return;
    if (units) bt_h5_units(h, dataset, units);
    bt_h5_attr_text(h, dataset, "long_name", meaning);
    bt_h5_attr_text(h, dataset, "description", meaning);
    if (axes) bt_h5_axes(h, dataset, axes);
}

void bt_h5_describe_file(bt_h5 *h, const char *title)
{
    bt_h5_attr_text(h, "/", "Conventions", "CF-1.8");
    bt_h5_attr_text(h, "/", "source", "bergtow " BT_VERSION ", a simulation");
    if (title && *title) bt_h5_attr_text(h, "/", "title", title);
}

// --- slabs -----------------------------------------------------------------------------------------------------------

// A dataset whose rows are written by all ranks, each its own.
//
// On one rank rows go through HDF5, in chunks of at most 256 kB, shuffled and deflated. On several, HDF5 has the file
// open on rank 0 alone: it lays the datasets out (space allocated when a dataset is made or grows, no fill values),
// says where the rows lie, and every rank writes its rows there with pwrite. Such rows are not compressed.
//
// Rejected: HDF5's own parallel driver. It must keep one copy of all metadata a rank, and each change of it is
// collective. A write that fails on one rank (full disk, quota) leaves the others waiting inside the library or inside
// MPI-IO, and a file that cannot be closed crashes in MPI_Finalize; the reason, a number from the system, is lost on
// the way. Here errors are plain errno values on the rank that met them. What deflate gains on poses and vertices, a
// quarter to a third, is the price.

#define SMALL 8192 // bytes; the index of a chunked dataset takes 2 kB

static bt_slab describe(bt_h5 *h, hid_t type, int64_t n, int width)
{
    const size_t row = H5Tget_size(type) * (size_t)(width ? width : 1);
    // Pieces of equal length, as the last one is stored whole too.
    const int64_t most = (int64_t)(BT_SLAB_BYTES / row), pieces = n > 0 ? (n + most - 1) / most : 1;
    return (bt_slab){.h = h,
                     .dataset = -1,
                     .type = type,
                     .n = n,
                     .width = width,
                     .row_bytes = row,
                     .piece = n > 0 ? (n + pieces - 1) / pieces : 1};
}

bt_slab bt_slab_fixed(bt_h5 *h, const char *name, hid_t type, int64_t n, int width, bool packed)
{
    bt_slab s = describe(h, type, n, width);
    s.packed = packed && !bt_h5_shared(h) && (size_t)n * s.row_bytes > SMALL;
    if (!s.packed && n > 0) s.piece = n;
    s.dataset = bt_h5_dataset(h, name, type, width ? 2 : 1, (hsize_t[]){(hsize_t)n, (hsize_t)width},
                              s.packed ? (hsize_t)s.piece : 0);
    return s;
}

bt_slab bt_slab_growing(bt_h5 *h, const char *name, hid_t type, int64_t n, int width)
{
    bt_slab s = describe(h, type, n, width);
    s.growing = true;
    s.packed = !bt_h5_shared(h);
    s.dataset = bt_h5_growing(h, name, type, width ? 3 : 2, (hsize_t[]){(hsize_t)n, (hsize_t)width},
                              (hsize_t[]){1, (hsize_t)s.piece}, s.packed);
    return s;
}

void bt_slab_grow(bt_slab *s, int64_t frame)
{
    s->frame = frame;
    bt_h5_extend(s->h, s->dataset, (hsize_t)frame + 1);
}

static int64_t pieces_of(const bt_slab *s) { return (s->n + s->piece - 1) / s->piece; }

bt_status bt_slab_share(const bt_comm *c, bt_slab *const *s, int k)
{
    if (c->size == 1) return s[0]->h->status;
    size_t n = 1;
    for (int i = 0; i < k; i++) n += (size_t)pieces_of(s[i]);
    uint64_t *words = bt_alloc(n, sizeof *words), *p = words + 1;
    if (c->rank == 0)
        for (int i = 0; i < k; i++) {
            const int64_t pieces = pieces_of(s[i]);
            for (int64_t j = 0; j < pieces; j++)
                p[j] = bt_h5_address(s[i]->h, s[i]->dataset, s[i]->growing, (hsize_t)s[i]->frame,
                                     (hsize_t)(j * s[i]->piece));
            p += pieces;
        }
    words[0] = (uint64_t)s[0]->h->status;
    bt_comm_bcast(c, words, n * sizeof *words);
    const bt_status status = (bt_status)words[0];
    p = words + 1;
    for (int i = 0; i < k; i++) {
        const size_t pieces = (size_t)pieces_of(s[i]);
        s[i]->address = bt_realloc(s[i]->address, pieces, sizeof *s[i]->address);
        memcpy(s[i]->address, p, pieces * sizeof *p);
        p += pieces;
    }
    free(words);
    return status;
}

void bt_slab_write(bt_slab *s, int64_t first, int64_t n, const void *rows)
{
    const bool whole = first % s->piece == 0 && (n == s->piece || first + n == s->n);
    if (s->packed && whole && n <= s->piece) {
        bt_h5_write_chunk(s->h, s->dataset, s->growing, (hsize_t)s->frame, (hsize_t)first, (size_t)n, (size_t)s->piece,
                          s->row_bytes, rows);
        return;
    }
    if (!bt_h5_shared(s->h)) {
        bt_h5_write_rows(s->h, s->dataset, s->type, s->growing, (hsize_t)s->frame, (hsize_t)first, (hsize_t)n, rows);
        return;
    }
    const char *p = rows;
    while (n > 0 && s->h->status == BT_OK) {
        const int64_t piece = first / s->piece, left = (piece + 1) * s->piece - first, now = n < left ? n : left;
        const size_t bytes = (size_t)now * s->row_bytes;
        bt_h5_write_raw(s->h, s->address[piece] + (uint64_t)(first - piece * s->piece) * s->row_bytes, bytes, p);
        p += bytes;
        first += now;
        n -= now;
    }
}

void bt_slab_close(bt_slab *s)
{
    if (s->dataset >= 0) H5Dclose(s->dataset);
    free(s->address);
    s->dataset = -1;
    s->address = NULL;
}

// Writes end where pieces do: so each chunk is deflated once.
static int64_t room_from(const bt_slab *s, int64_t at)
{
    const int64_t buffer = (int64_t)(BT_SLAB_BYTES / s->row_bytes), left = s->piece - at % s->piece;
    return left < buffer ? left : buffer;
}

bt_rows bt_rows_from(bt_slab *s, int64_t first, void *buffer)
{
    return (bt_rows){.s = s, .buffer = buffer, .at = first, .room = room_from(s, first)};
}

void bt_rows_end(bt_rows *r)
{
    if (r->n > 0) bt_slab_write(r->s, r->at, r->n, r->buffer);
    r->at += r->n;
    r->n = 0;
    r->room = room_from(r->s, r->at);
}

// --- provenance ------------------------------------------------------------------------------------------------------

// Where a file comes from: version, build, machine, command and time, as attributes of its root.

const char *bt_provenance_revision(void) { return BT_REVISION; }

void bt_provenance_write(bt_h5 *h, const char *command_line)
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

    bt_h5_attr_text(h, "/", "program", "bergtow");
    bt_h5_attr_text(h, "/", "version", BT_VERSION);
    bt_h5_attr_text(h, "/", "revision", BT_REVISION);
    bt_h5_attr_text(h, "/", "compiler", BT_COMPILER);
    bt_h5_attr_text(h, "/", "flags", BT_FLAGS);
    bt_h5_attr_text(h, "/", "libraries", text);
    bt_h5_attr_text(h, "/", "command_line", command_line ? command_line : "");
    bt_h5_attr_text(h, "/", "host", host);
    bt_h5_attr_text(h, "/", "start_time", start);
    bt_h5_attr_int(h, "/", "ranks", bt_comm_world()->size);
    bt_h5_attr_int(h, "/", "threads", omp_get_max_threads());
}
