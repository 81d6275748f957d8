// SPDX-License-Identifier: MIT
// HDF5 with one way to fail: every call's result goes through a handle that keeps the first error.
#ifndef BT_H5UTIL_H
#define BT_H5UTIL_H

#include <hdf5.h>

#include "bergtow/comm.h"

// --- chunks ----------------------------------------------------------------------------------------------------------

// A chunk of numbers, shuffled and deflated so that HDF5's own filters can read it.

typedef struct bt_deflater bt_deflater;

/// Compress n numbers of `size` bytes each, and zeros up to `room` numbers, into one zlib stream. Returns its bytes,
/// valid until the next call, and *length; NULL if zlib fails. *deflater: NULL before the first call.
const void *bt_deflate(bt_deflater **deflater, const void *numbers, size_t n, size_t room, size_t size, size_t *length);
void bt_deflater_free(bt_deflater *deflater);

/// An open file and its state. After a failure every function below does nothing, as do those that use HDF5 on a rank
/// where the file is not open in HDF5; so a sequence of writes needs one check at its end.
typedef struct bt_h5 {
    hid_t file;     ///< −1 on ranks other than 0
    int raw;        ///< descriptor for bt_h5_write_raw, −1 on one rank
    char *path;
    bt_status status;
    struct bt_deflater *deflater; ///< of bt_h5_write_chunk, NULL before its first call
    int *errnum;    ///< first error of the file system, set by the file driver below
    bt_errors *err; ///< where the next error goes; the caller of each public function sets it
} bt_h5;

/// Create (truncate) a file that other programs may read while it is being written.
bt_status bt_h5_create(bt_h5 *h5, const char *path, bt_errors *err);
/// Collective. The same on rank 0, for a file to which the other ranks write too, see h5dataset.h. Returns the same
/// status on all ranks.
bt_status bt_h5_create_shared(bt_h5 *h5, const bt_comm *comm, const char *path, bt_errors *err);
/// Do several ranks write to the file?
static inline bool bt_h5_shared(const bt_h5 *h5) { return h5->raw >= 0; }
/// Take over another rank's failure: nothing more is written, so that the file stays as the last flush left it.
void bt_h5_give_up(bt_h5 *h5, bt_status status);
/// Push everything to the file system.
void bt_h5_flush(bt_h5 *h5);
/// Sync to disk what this rank wrote by bt_h5_write_raw, so that other nodes see it.
void bt_h5_sync_raw(bt_h5 *h5);
/// Close the file and release the path. Returns the status of all calls, this one included.
bt_status bt_h5_close(bt_h5 *h5);

/// Call after writes: the handle fails if HDF5 did not report success (done), or if the driver has kept an error.
void bt_h5_check(bt_h5 *h5, bool done);

void bt_h5_group(bt_h5 *h5, const char *name);
/// Write a whole dataset [n] (width 0) or [n][width], contiguous. mem: H5T_NATIVE_...
void bt_h5_write(bt_h5 *h5, const char *name, hid_t mem, hsize_t n, hsize_t width, const void *data);
/// Create a dataset of rank 1 or 2 to be filled later. chunk: rows in a chunk, shuffled and deflated; 0 = contiguous.
/// Returns −1 on failure.
hid_t bt_h5_dataset(bt_h5 *h5, const char *name, hid_t type, int rank, const hsize_t *dims, hsize_t chunk);
void bt_h5_write_text(bt_h5 *h5, const char *name, const char *text);                         ///< scalar, UTF-8
void bt_h5_write_names(bt_h5 *h5, const char *name, hsize_t n, const char *const *names);     ///< [n], UTF-8
/// Attributes of an object ("/" for the root). A second write replaces the first.
void bt_h5_attr_text(bt_h5 *h5, const char *object, const char *name, const char *text);
/// Of fixed length, that of the text: for attributes that a program reads from files that may be damaged.
void bt_h5_attr_word(bt_h5 *h5, const char *object, const char *name, const char *text);
void bt_h5_attr_int(bt_h5 *h5, const char *object, const char *name, int64_t value);
void bt_h5_attr_double(bt_h5 *h5, const char *object, const char *name, double value);

/// Create a dataset of rank 1 to 3 that grows from zero along its first dimension; dims[rank − 1] are the others.
/// chunk: entries of the first two dimensions in a chunk. packed: shuffled and deflated, with chunk[0] = 1: a chunk
/// written again has another length, and a kill may leave neither the old one nor the new. Returns −1 on failure.
hid_t bt_h5_growing(bt_h5 *h5, const char *name, hid_t type, int rank, const hsize_t *dims, const hsize_t *chunk,
                    bool packed);
/// Set the length of the first dimension.
void bt_h5_extend(bt_h5 *h5, hid_t dataset, hsize_t length);
/// Append n entries along the first dimension, which has `at` entries now.
void bt_h5_append(bt_h5 *h5, hid_t dataset, hid_t mem, hsize_t at, hsize_t n, const void *data);

/// Read entries first to first + n − 1 of a dataset [entries] that was appended to.
void bt_h5_read_back(bt_h5 *h5, hid_t dataset, hid_t mem, hsize_t first, hsize_t n, void *data);

/// Write rows first to first + n − 1 of a dataset [rows]... or, with `frames`, of one frame of [frame][rows]...
void bt_h5_write_rows(bt_h5 *h5, hid_t dataset, hid_t mem, bool frames, hsize_t frame, hsize_t first, hsize_t n,
                      const void *rows);
/// The same for a whole packed chunk of `room` rows: the first n are given, the others become zeros.
void bt_h5_write_chunk(bt_h5 *h5, hid_t dataset, bool frames, hsize_t frame, hsize_t first, size_t n, size_t room,
                       size_t row_bytes, const void *rows);
/// Offset of a row in a shared file, bytes; the dataset is not packed.
uint64_t bt_h5_address(bt_h5 *h5, hid_t dataset, bool frames, hsize_t frame, hsize_t row);
/// Write bytes at an offset of a shared file, from any rank.
void bt_h5_write_raw(bt_h5 *h5, uint64_t address, size_t bytes, const void *data);

// --- the file driver -------------------------------------------------------------------------------------------------

/// Select the driver in a file access property list. *errnum is set to the errno value of the first failed operation on
/// the file, and must live until the file is closed. Returns a negative value on failure.
herr_t bt_h5driver_select(hid_t access, int *errnum);

#endif
