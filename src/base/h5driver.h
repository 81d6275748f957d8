// SPDX-License-Identifier: MIT
// An HDF5 file driver that keeps the system's first error, never fails a write, and leaves the file whole after each.
#ifndef BT_H5DRIVER_H
#define BT_H5DRIVER_H

#include <hdf5.h>

/// Select the driver on a file access list. *errnum is set to the errno value of the first failed operation on the file
/// and must live until the file is closed. Returns a negative value on failure.
herr_t bt_h5driver_select(hid_t access, int *errnum);

#endif
