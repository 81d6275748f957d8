// SPDX-License-Identifier: MIT
// A chunk of numbers, shuffled and deflated as HDF5's own filters would read it back.
//
// Shuffled, the bytes of one rank of all numbers lie together, one plane for each rank. Planes differ: the low bytes of
// coordinates are noise, which deflate searches in vain for most of its time; signs and exponents repeat. One stream of
// zlib may change its way within: so each plane is stored, or coded by the frequencies of its bytes alone, or searched
// for repeats, by what a sample of it says. A stream is a stream: every reader of HDF5 takes it.
//
// Two frames of 90,000 floes: 7.75 MB in place of 7.81 MB, at 0.4 of the time. Level 1 for the search: half a per cent
// more bytes than level 4 (tows of 700 and 30,000 floes), at three quarters of the work.
#include "base/deflater.h"

#include <stdlib.h>
#include <string.h>
#include <zlib.h>

enum { LEVEL = 1, SAMPLE = 2048, PIECES = 4 };
static const double GAIN = 0.03; // below this a plane is stored: what a sample's own table of codes may hide

struct bt_deflater {
    z_stream whole, trial;
    unsigned char *plane, *out;
    size_t cap_plane, cap_out;
};

typedef struct way { int level, strategy; } way;
static const way STORED = {0, Z_DEFAULT_STRATEGY}, BY_BYTES = {LEVEL, Z_HUFFMAN_ONLY},
                 BY_REPEATS = {LEVEL, Z_DEFAULT_STRATEGY};

void bt_deflater_free(bt_deflater *d)
{
    if (!d) return;
    deflateEnd(&d->whole);
    deflateEnd(&d->trial);
    free(d->plane);
    free(d->out);
    free(d);
}

static bt_deflater *create(void)
{
    bt_deflater *d = bt_alloc(1, sizeof *d);
    const bool begun = deflateInit(&d->whole, LEVEL) == Z_OK && deflateInit(&d->trial, LEVEL) == Z_OK;
    if (begun) return d;
    bt_deflater_free(d);
    return NULL;
}

/// Bytes that a sample takes one way.
static size_t tried(z_stream *z, way w, const unsigned char *sample, size_t n)
{
    unsigned char out[2 * SAMPLE];
    if (deflateReset(z) != Z_OK || deflateParams(z, w.level, w.strategy) != Z_OK) return n;
    z->next_in = (unsigned char *)sample, z->avail_in = (unsigned)n;
    z->next_out = out, z->avail_out = sizeof out;
    return deflate(z, Z_FINISH) == Z_STREAM_END ? (size_t)z->total_out : n;
}

static way way_of(z_stream *trial, const unsigned char *plane, size_t n)
{
    if (n <= SAMPLE) return BY_REPEATS;
    unsigned char sample[SAMPLE];
    const size_t piece = SAMPLE / PIECES, step = (n - piece) / (PIECES - 1);
    for (size_t k = 0; k < PIECES; k++) memcpy(sample + k * piece, plane + k * step, piece);
    const size_t bytes = tried(trial, BY_BYTES, sample, SAMPLE), repeats = tried(trial, BY_REPEATS, sample, SAMPLE),
                 least = bytes < repeats ? bytes : repeats;
    if ((double)least > (1 - GAIN) * SAMPLE) return STORED;
    return bytes < repeats ? BY_BYTES : BY_REPEATS;
}

/// Bytes k, k + size, ... of the numbers, and zeros behind them.
static void take_plane(unsigned char *plane, const unsigned char *numbers, size_t n, size_t room, size_t size)
{
    for (size_t i = 0; i < n; i++) plane[i] = numbers[i * size];
    memset(plane + n, 0, room - n);
}

const void *bt_deflate(bt_deflater **of, const void *numbers, size_t n, size_t room, size_t size, size_t *length)
{
    if (!*of && !(*of = create())) return NULL;
    bt_deflater *d = *of;
    z_stream *z = &d->whole;
    // a change of the way ends a block, which takes some bytes
    const size_t most = deflateBound(z, (unsigned long)(room * size)) + 64 * (size + 1);
    if (room > d->cap_plane) d->plane = bt_realloc(d->plane, d->cap_plane = room, 1);
    if (most > d->cap_out) d->out = bt_realloc(d->out, d->cap_out = most, 1);
    if (deflateReset(z) != Z_OK) return NULL;
    z->next_out = d->out, z->avail_out = (unsigned)most;
    for (size_t k = 0; k < size; k++) {
        take_plane(d->plane, (const unsigned char *)numbers + k, n, room, size);
        const way w = way_of(&d->trial, d->plane, room);
        z->next_in = d->plane, z->avail_in = 0;
        if (deflateParams(z, w.level, w.strategy) != Z_OK) return NULL;
        z->avail_in = (unsigned)room;
        if (deflate(z, Z_NO_FLUSH) != Z_OK || z->avail_in > 0) return NULL;
    }
    if (deflate(z, Z_FINISH) != Z_STREAM_END) return NULL;
    *length = (size_t)z->total_out;
    return d->out;
}
