// SPDX-License-Identifier: MIT
// What the datasets of a file are: their units and axes, how they grow by slabs, and where the file comes from.
#ifndef BT_H5DATASET_H
#define BT_H5DATASET_H

#include "bergtow/comm.h"
#include "base/h5util.h"

// --- units and axes --------------------------------------------------------------------------------------------------

// What a dataset holds, for programs that do not know this one: units, a name to print, and the name of each axis.
//
// Axes are HDF5 dimension scales [HDF5 Dimension Scale Specification], as netCDF-4 writes and reads them: an axis is
// the one-dimensional dataset of its name beside the dataset or in the root group (time, member), its coordinate; where
// there is none, it is a dimension alone, in the root group, of netCDF's name for that and without a byte of storage.
// So xarray, the netCDF library and MATLAB's HDF5 functions find them.

/// Units of a dataset, as UDUNITS reads them [CF 1.8, 3.1]: attribute units. Those of columns that differ, with commas
/// between, are no unit there: attribute units_of_columns.
void bt_h5_units(bt_h5 *h5, const char *dataset, const char *units);

/// Units ("1": none, NULL: it is text, or no one unit holds for all of it) and meaning of a dataset, as attributes
/// long_name and description beside the units. axes: the name of each dimension, with blanks between; NULL: they are
/// not named.
void bt_h5_describe(bt_h5 *h5, const char *dataset, const char *axes, const char *units, const char *meaning);

/// bt_h5_write and bt_h5_describe.
void bt_h5_put(bt_h5 *h5, const char *name, hid_t type, hsize_t n, hsize_t width, const void *data, const char *axes,
               const char *units, const char *meaning);
/// The same of texts [n].
void bt_h5_put_names(bt_h5 *h5, const char *name, hsize_t n, const char *const *names, const char *axis,
                     const char *meaning);
/// The same of one text.
void bt_h5_put_text(bt_h5 *h5, const char *name, const char *text, const char *meaning);

/// The axes alone, where a coordinate is made after the dataset.
void bt_h5_axes(bt_h5 *h5, const char *dataset, const char *axes);

/// What a file as a whole is, by the conventions of the Climate and Forecast metadata (CF 1.8: groups).
void bt_h5_describe_file(bt_h5 *h5, const char *title);

// --- slabs -----------------------------------------------------------------------------------------------------------

// A dataset whose rows are written by all ranks, each its own.

/// Rows of one dataset: [n] (width 0) or [n][width]; a growing one has its frames as first dimension.
typedef struct bt_slab {
    bt_h5 *h;
    hid_t dataset, type;  ///< dataset is −1 where the file is not open in HDF5
    int64_t n;            ///< rows of all ranks
    int width;
    size_t row_bytes;
    bool growing, packed;
    int64_t frame;        ///< the frame that is written now
    int64_t piece;        ///< rows that lie together in the file
    uint64_t *address;    ///< [pieces] bytes from the start of the file, after bt_slab_share; NULL on one rank
} bt_slab;

/// A dataset of fixed size. packed: on one rank shuffled and deflated, where that pays. Same call on all ranks.
bt_slab bt_slab_fixed(bt_h5 *h5, const char *name, hid_t type, int64_t n, int width, bool packed);
/// A dataset without frames yet. On one rank it is shuffled and deflated.
bt_slab bt_slab_growing(bt_h5 *h5, const char *name, hid_t type, int64_t n, int width);
/// Make room for one frame after those that are there; `frame` is their number.
void bt_slab_grow(bt_slab *slab, int64_t frame);
/// Collective. Inform all ranks where the rows of these k datasets lie (of the present frame). Returns the status of
/// rank 0.
bt_status bt_slab_share(const bt_comm *comm, bt_slab *const *slab, int k);
/// Write rows first up to first + n. Not collective: each rank writes what it has.
void bt_slab_write(bt_slab *slab, int64_t first, int64_t n, const void *rows);
void bt_slab_close(bt_slab *slab);

/// Rows one after the other by way of a buffer of at most BT_SLAB_BYTES, so that no rank holds them all at once.
#define BT_SLAB_BYTES ((size_t)1 << 18)

typedef struct bt_rows {
    bt_slab *s;
    char *buffer;       ///< of BT_SLAB_BYTES
    int64_t at;         ///< row of the first one in the buffer
    int64_t n, room;
} bt_rows;

bt_rows bt_rows_from(bt_slab *slab, int64_t first, void *buffer);
void bt_rows_end(bt_rows *rows); ///< write what is in the buffer

/// Where the next row goes; to be filled before the next call.
static inline void *bt_rows_next(bt_rows *rows)
{
    if (rows->n == rows->room) bt_rows_end(rows);
    return rows->buffer + (size_t)rows->n++ * rows->s->row_bytes;
}

// --- provenance ------------------------------------------------------------------------------------------------------

// Where a file comes from: version, build, machine, command and time, as attributes of its root.

/// The revision that this program was built from, "unknown" where the build did not know.
const char *bt_provenance_revision(void);

void bt_provenance_write(bt_h5 *h5, const char *command_line);

#endif
