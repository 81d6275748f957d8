// SPDX-License-Identifier: MIT
// A checksum at the end of an HDF5 file: its kind, its length, and a digest of every byte.
//
// HDF5 checks almost nothing of what it reads, and 1.10 crashes on damaged files. So bergtow's files end in a seal of
// 128 bytes, which is compared with all the bytes before it, before HDF5 reads any of them:
//
//     bergtow sealed file\nkind: checkpoint 5\nbytes: 123456\nxxh128: 0123...\n, then zeros
//
// HDF5 records in its first bytes where its own part ends, and no reader of HDF5 or netCDF looks further. The seal must
// equal, byte for byte, the one formed from length and digest (XXH3, 128 bits) of that part: any flipped bit, any cut,
// any swapped part is refused. A program that opens the file to change it cuts the seal off; the file then no longer
// counts as bergtow's. The seal protects against damage, not against intent.
//
// Rejected: HDF5's Fletcher-32, which does not cover metadata or the pairing of datasets; a digest in a separate file,
// which may belong to another moment; an attribute, which HDF5 would have to read; a user block in front, behind which
// netCDF, xarray and CDO do not look for HDF5; a dataset of known bytes, whose place only HDF5 knows.
#ifndef BT_CHECKSUM_H
#define BT_CHECKSUM_H

#include "bergtow/base.h"

enum {
    BT_CHECKSUM_BYTES = 128,
    BT_CHECKSUM_DIGEST = 33, ///< characters of a digest as text, with the 0 at its end
};

// A kind includes the version of the format: a file of another version is refused, and the message names both.
#define BT_CHECKSUM_CHECKPOINT "checkpoint 5"
#define BT_CHECKSUM_RESULT "result 3"
#define BT_CHECKSUM_FIELD "field 2"
#define BT_CHECKSUM_ENSEMBLE "ensemble 3"

/// Append the checksum to a complete file, and sync the whole file to disk. Errors: BT_ERR_IO.
bt_status bt_checksum_write(const char *path, const char *kind, bt_errors *err);
/// The same, and give the file its final name.
bt_status bt_checksum_publish(const char *part, const char *path, const char *kind, bt_errors *err);

/// Does the file have a sound checksum of this kind? If bare is not NULL, a file that never had a checksum passes too,
/// and *bare is true. Errors: BT_ERR_IO from the system, BT_ERR_CASE for the content of the file.
bt_status bt_checksum_check(const char *path, const char *kind, bool *bare, bt_errors *err);

/// Is this a regular file with a checksum, sound or not? kind: of this kind, in any version; "": of any kind.
bool bt_checksum_there(const char *path, const char *kind);

/// May this be a file of bergtow that has no checksum yet? It begins as HDF5, or with zeros, or is empty: data go to
/// the file at once, HDF5's first bytes only at the first flush (h5driver.c).
bool bt_checksum_to_come(const char *path);

/// Digest (XXH3, 128 bits) of n bytes, and of a whole file of any kind, in hexadecimal digits. Errors: BT_ERR_CASE if
/// the file is missing or not a regular file; BT_ERR_IO from the system.
void bt_checksum_digest_text(const void *bytes, size_t n, char out[BT_CHECKSUM_DIGEST]);
bt_status bt_checksum_digest_file(const char *path, char out[BT_CHECKSUM_DIGEST], int64_t *bytes, bt_errors *err);

#endif
