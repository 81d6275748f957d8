// SPDX-License-Identifier: MIT
// Reading back what this program wrote: a file protected by a checksum, with one way to fail.
#ifndef BT_H5READ_H
#define BT_H5READ_H

#include <hdf5.h>

#include "bergtow/base.h"

/// Does the file hold all that it seems to? Refused, by the name of the object: soft and external links, datasets whose
/// numbers lie in other files (external storage) or in other datasets (virtual). HDF5 opens and reads whatever these
/// name: any file of the disk as raw numbers, a FIFO for ever. No other file is opened here. Errors: BT_ERR_CASE.
bt_status bt_h5_whole(hid_t file, const char *path, bt_errors *err);

/// Open a file for reading through the driver of h5util.h: a read that fails leaves its errno in *errnum, so that a
/// disk that reports errors is not taken for a file that is damaged. −1 where HDF5 cannot open it.
hid_t bt_h5_open_file(const char *path, int *errnum);

/// An open file; after a failure, which is reported once, every function below does nothing.
typedef struct bt_h5_reader {
    hid_t file;
    const char *path;
    bt_status status;
    int *errnum; ///< of a read that failed
    bt_errors *err;
} bt_h5_reader;

/// Check the checksum, open, and bt_h5_whole. path must stay valid. Errors: those of bt_checksum_check and bt_h5_whole.
/// bt_h5_end follows, also after an error.
bt_status bt_h5_open(bt_h5_reader *reader, const char *path, const char *kind, bt_errors *err);
bt_status bt_h5_end(bt_h5_reader *reader); ///< close; the status of the whole

/// Note that the file, or what is named, could not be read: with the errno of a read that failed, or `why` of the file.
void bt_h5_fail(bt_h5_reader *reader, const char *why);

/// Is there a dataset of this name in a group that there is?
bool bt_h5_there(const bt_h5_reader *reader, const char *name);
/// Size of a dataset's dimension k, 0 = not so many.
int64_t bt_h5_size(bt_h5_reader *reader, const char *name, int k);
/// An attribute of the root that bt_h5_attr_word has written; the caller frees it. NULL: there is none.
char *bt_h5_read_word(bt_h5_reader *reader, const char *name);
/// Rows first up to first + n along the first dimension, each of `width` numbers in all others together. mem:
/// H5T_NATIVE_...
void bt_h5_read(bt_h5_reader *reader, const char *name, hid_t mem, int64_t first, int64_t n, int64_t width, void *to);

#endif
