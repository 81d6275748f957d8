// SPDX-License-Identifier: MIT
// Datasets of a file: their units and axes, and how ranks write their rows; and the provenance of the file.
#ifndef BT_H5DATASET_H
#define BT_H5DATASET_H

#include "bergtow/comm.h"
#include "base/h5read.h"
#include "base/h5util.h"

// --- units and axes --------------------------------------------------------------------------------------------------

// Description of datasets for programs that do not know bergtow: units, a name to print, and the name of each axis.
//
// Axes are HDF5 dimension scales [HDF5 Dimension Scale Specification], as netCDF-4 writes and reads them. The
// coordinate of an axis is the one-dimensional dataset of that name beside the dataset or in the root group (time,
// member). Without a coordinate the axis is a bare dimension: a dataset in the root group, marked with netCDF's phrase
// for it, without a byte of storage. So xarray, the netCDF library and MATLAB's HDF5 functions find the axes.

/// Units of a dataset, as UDUNITS reads them [CF 1.8, 3.1]: attribute `units`. Units that differ between columns,
/// separated by commas, are not valid there: attribute `units_of_columns`.
void bt_h5_units(bt_h5 *h5, const char *dataset, const char *units);

/// Units and meaning of a dataset; attributes long_name and description hold the meaning. units: "1": none, NULL: it is
/// text, or no single unit holds for all of it. axes: names of the dimensions, separated by blanks; NULL: not named.
void bt_h5_describe(bt_h5 *h5, const char *dataset, const char *axes, const char *units, const char *meaning);

/// bt_h5_write and bt_h5_describe.
void bt_h5_put(bt_h5 *h5, const char *name, hid_t type, hsize_t n, hsize_t width, const void *data, const char *axes,
               const char *units, const char *meaning);
/// The same for texts [n].
void bt_h5_put_names(bt_h5 *h5, const char *name, hsize_t n, const char *const *names, const char *axis,
                     const char *meaning);
/// The same for one text.
void bt_h5_put_text(bt_h5 *h5, const char *name, const char *text, const char *meaning);

/// The axes alone, for a dataset whose coordinate is made later.
void bt_h5_axes(bt_h5 *h5, const char *dataset, const char *axes);

/// Describe the file as a whole, by the Climate and Forecast metadata conventions (CF 1.8: groups).
void bt_h5_describe_file(bt_h5 *h5, const char *title);

// --- slabs -----------------------------------------------------------------------------------------------------------

// A dataset to which each rank writes its own rows.

/// Rows of one dataset: [n] (width 0) or [n][width]; a growing one has frames as its first dimension.
typedef struct bt_slab {
    bt_h5 *h;
    hid_t dataset, type;  ///< dataset is −1 where the file is not open in HDF5
    int64_t n;            ///< rows of all ranks
    int width;
    size_t row_bytes;
    bool growing, packed;
    int64_t frame;        ///< the frame being written
    int64_t piece;        ///< rows stored together in the file
    uint64_t *address;    ///< [pieces] bytes from the start of the file, after bt_slab_share; NULL on one rank
} bt_slab;

/// A dataset of fixed size. packed: shuffled and deflated, on one rank and where that pays. Same call on all ranks.
bt_slab bt_slab_fixed(bt_h5 *h5, const char *name, hid_t type, int64_t n, int width, bool packed);
/// A dataset without frames yet; shuffled and deflated on one rank.
bt_slab bt_slab_growing(bt_h5 *h5, const char *name, hid_t type, int64_t n, int width);
/// Make room for one more frame; `frame` is the number of frames so far.
void bt_slab_grow(bt_slab *slab, int64_t frame);
/// Collective. Tell all ranks where the rows of these k datasets lie (in the current frame). Returns rank 0's status.
bt_status bt_slab_share(const bt_comm *comm, bt_slab *const *slab, int k);
/// Write rows first to first + n − 1. Not collective: each rank writes the rows that it has.
void bt_slab_write(bt_slab *slab, int64_t first, int64_t n, const void *rows);
void bt_slab_close(bt_slab *slab);

/// Write rows one after the other through a buffer of at most BT_SLAB_BYTES, so that no rank holds them all at once.
#define BT_SLAB_BYTES ((size_t)1 << 18)

typedef struct bt_rows {
    bt_slab *s;
    char *buffer;       ///< of BT_SLAB_BYTES
    int64_t at;         ///< index of the first row in the buffer
    int64_t n, room;
} bt_rows;

bt_rows bt_rows_from(bt_slab *slab, int64_t first, void *buffer);
void bt_rows_end(bt_rows *rows); ///< write the rows in the buffer

/// The place of the next row; the caller fills it before the next call.
static inline void *bt_rows_next(bt_rows *rows)
{
    if (rows->n == rows->room) bt_rows_end(rows);
    return rows->buffer + (size_t)rows->n++ * rows->s->row_bytes;
}

// --- provenance ------------------------------------------------------------------------------------------------------

// Where a file comes from: version, build, machine, command and time, as attributes of its root.

/// The revision that this program was built from; "unknown" if the build did not know it.
const char *bt_provenance_revision(void);

void bt_provenance_write(bt_h5 *h5, const char *command_line);

/// Of a resumed run: keep start time and command line of the old result, and add the revision if it differs from the
/// last one there.
void bt_provenance_keep(bt_h5 *h5, bt_h5_reader *old);

#endif
