// SPDX-License-Identifier: MIT
// A checksum in front of an HDF5 file: what it is, how long it is, and a digest of every byte.
//
// HDF5 checks next to nothing of what it reads, and 1.10 crashes on damaged files. So a file of ours begins with a user
// block of 512 bytes, which readers of HDF5 skip (h5py, ParaView, h5dump), and is compared with it before HDF5 sees a
// byte:
//
//     bergtow sealed file\nkind: checkpoint 2\nbytes: 123456\nxxh128: 0123...\n, then zeros
//
// The block must be, to the last byte, what the file's length and digest (XXH3, 128 bits) make it: any flipped bit, any
// cut, any swapped part is refused. It protects against damage, not against intent. Rejected: HDF5's Fletcher-32, which
// leaves metadata and the pairing of datasets open; a digest in a file beside it, which can be of another moment.
#ifndef BT_CHECKSUM_H
#define BT_CHECKSUM_H

#include "bergtow/base.h"

enum {
    BT_CHECKSUM_BYTES = 512,
    BT_CHECKSUM_DIGEST = 33, ///< characters of a digest as text, with its end
};

// Kinds carry the version of the format: another one is refused with both names.
#define BT_CHECKSUM_CHECKPOINT "checkpoint 2"
#define BT_CHECKSUM_RESULT "result 1"
#define BT_CHECKSUM_FIELD "field 1"
#define BT_CHECKSUM_ENSEMBLE "ensemble 1"

/// Write the checksum into the room at the front of a file that is complete, and bring all of it to the disk. Errors:
/// BT_ERR_IO.
bt_status bt_checksum_write(const char *path, const char *kind, bt_errors *err);

/// Does the file have a sound checksum of this kind? bare: a file without checksum, one that begins as HDF5, is let
/// through (or NULL). Errors: BT_ERR_IO from the system, BT_ERR_CASE for what the file holds.
bt_status bt_checksum_check(const char *path, const char *kind, bool *bare, bt_errors *err);

/// Is this a file that this program writes with a checksum, sound or not? kind: of this kind, in whatever version,
/// or NULL. One that is not complete has zeros in the room, or nothing at all.
bool bt_checksum_there(const char *path, const char *kind);

/// Digest (XXH3, 128 bits) of n bytes, and of a whole file of any kind, in hexadecimal digits. Errors: BT_ERR_CASE,
/// there is no regular file; BT_ERR_IO from the system.
void bt_checksum_digest_text(const void *bytes, size_t n, char out[BT_CHECKSUM_DIGEST]);
bt_status bt_checksum_digest_file(const char *path, char out[BT_CHECKSUM_DIGEST], int64_t *bytes, bt_errors *err);

#endif
