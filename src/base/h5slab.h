// SPDX-License-Identifier: MIT
// A dataset whose rows are written by all ranks, each its own.
#ifndef BT_H5SLAB_H
#define BT_H5SLAB_H

#include "bergtow/comm.h"
#include "base/h5util.h"

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
bt_slab bt_slab_fixed(bt_h5 *h, const char *name, hid_t type, int64_t n, int width, bool packed);
/// A dataset without frames yet. On one rank it is shuffled and deflated.
bt_slab bt_slab_growing(bt_h5 *h, const char *name, hid_t type, int64_t n, int width);
/// Make room for one frame after those that are there; `frame` is their number.
void bt_slab_grow(bt_slab *s, int64_t frame);
/// Collective. Inform all ranks where the rows of these k datasets lie (of the present frame). Returns the status of
/// rank 0.
bt_status bt_slab_share(const bt_comm *c, bt_slab *const *s, int k);
/// Write rows first up to first + n. Not collective: each rank writes what it has.
void bt_slab_write(bt_slab *s, int64_t first, int64_t n, const void *rows);
void bt_slab_close(bt_slab *s);

/// Rows one after the other by way of a buffer of at most BT_SLAB_BYTES, so that no rank holds them all at once.
#define BT_SLAB_BYTES ((size_t)1 << 18)

typedef struct bt_rows {
    bt_slab *s;
    char *buffer;       ///< of BT_SLAB_BYTES
    int64_t at;         ///< row of the first one in the buffer
    int64_t n, room;
} bt_rows;

bt_rows bt_rows_from(bt_slab *s, int64_t first, void *buffer);
void bt_rows_end(bt_rows *r); ///< write what is in the buffer

/// Where the next row goes; to be filled before the next call.
static inline void *bt_rows_next(bt_rows *r)
{
    if (r->n == r->room) bt_rows_end(r);
    return r->buffer + (size_t)r->n++ * r->s->row_bytes;
}

#endif
