// SPDX-License-Identifier: MIT
// Reading back a file of this program, protected by a checksum, with one way to fail.
#ifndef BT_H5READ_H
#define BT_H5READ_H

#include <hdf5.h>

#include "bergtow/base.h"

/// Does the file itself hold all its data? Refused, by the name of the object: soft and external links, and datasets
/// whose numbers lie in other files (external storage) or in other datasets (virtual). HDF5 opens and reads whatever
/// these name: any file on disk as raw numbers, or a FIFO for ever. Here no other file is opened. Errors: BT_ERR_CASE.
bt_status bt_h5_whole(hid_t file, const char *path, bt_errors *err);

/// Open a file for reading through the driver of h5util.h. A failed read leaves its errno in *errnum, so that a disk
/// error is not taken for a damaged file. Returns −1 if HDF5 cannot open the file.
hid_t bt_h5_open_file(const char *path, int *errnum);

/// An open file. After a failure, which is reported once, every function below does nothing.
typedef struct bt_h5_reader {
    hid_t file;
    const char *path;
    bt_status status;
    int *errnum; ///< of a failed read
    bt_errors *err;
} bt_h5_reader;

/// Check the checksum, open the file, call bt_h5_whole. path must remain valid. Errors: those of bt_checksum_check and
/// bt_h5_whole. Call bt_h5_end also after an error.
bt_status bt_h5_open(bt_h5_reader *reader, const char *path, const char *kind, bt_errors *err);
bt_status bt_h5_end(bt_h5_reader *reader); ///< close; returns the status of all calls

/// Report that the file, or an object in it, could not be read: by the errno of a failed read, or else by `why`.
void bt_h5_fail(bt_h5_reader *reader, const char *why);

/// Is there a dataset of this name? Its group must exist.
bool bt_h5_there(const bt_h5_reader *reader, const char *name);
/// Size of dimension k of a dataset; 0 if it has fewer dimensions.
int64_t bt_h5_size(bt_h5_reader *reader, const char *name, int k);
/// Read a text attribute of the root; the caller frees it. NULL if there is none.
char *bt_h5_read_word(bt_h5_reader *reader, const char *name);
/// Read rows first to first + n − 1 along the first dimension; the other dimensions together give `width` numbers a
/// row. mem: H5T_NATIVE_...
void bt_h5_read(bt_h5_reader *reader, const char *name, hid_t mem, int64_t first, int64_t n, int64_t width, void *to);

#endif
