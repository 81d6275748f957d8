// SPDX-License-Identifier: MIT
// A chunk of numbers, shuffled and deflated as HDF5's own filters would read it back.
#ifndef BT_DEFLATER_H
#define BT_DEFLATER_H

#include "bergtow/base.h"

typedef struct bt_deflater bt_deflater;

/// n numbers of `size` bytes each, and zeros up to `room` numbers, as one stream of zlib. Returns its bytes, which stay
/// until the next call, and *length; NULL where zlib refuses. *d: NULL before the first call.
const void *bt_deflate(bt_deflater **d, const void *numbers, size_t n, size_t room, size_t size, size_t *length);
void bt_deflater_free(bt_deflater *d);

#endif
