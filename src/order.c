// SPDX-License-Identifier: MIT
// Order of a pass: hem by phases, inner tiles in strips; reasons in order.h.
#include "order.h"

#include <omp.h>
#include <stdint.h>
#include <stdlib.h>

#include "bergtow/tow.h"

#define AHEAD 2   // tiles: what a sweep asks memory for in advance

/// Least tiles of a strip in a field of so many units. Several threads share the tiles of one phase, and wait for each other after it. One thread goes
/// through a large field fastest in strips as narrow as they may be: six sweeps that follow each other then find most of their tiles in the
/// second-level cache. In a small one, where all is there anyway, jumping between colours costs 4 %.
static bt_idx least_tiles(int64_t n_units)
{
#ifdef BT_VALIDATE
    (void)n_units;
    return 8; // so that small cases have strips too
#else
    enum { LARGE = 20000, THICK = 256, THREAD = 32 };
    const bt_idx threads = omp_get_max_threads();
    return threads > 1 ? THREAD * threads : n_units < LARGE ? THICK : 1;
#endif
}

/// What sorts a tile: hem or strip, then phase; in the hem those at the border first.
typedef struct {
    bt_idx group, tile;
} place;

static int by_group(const void *a, const void *b)
{
    const place *p = a, *q = b;
    if (p->group != q->group) return (p->group > q->group) - (p->group < q->group);
    return (p->tile > q->tile) - (p->tile < q->tile);
}

enum { HEM_GROUPS = 2 * BT_COLOURS };

void bt_order_measure(bt_tiles *t)
{
    for (bt_idx k = 0; k < t->n - 1; k++) t->tile[k].depth = t->tile[k].border ? 0 : BT_PHASES;
    for (int8_t depth = 1; depth < (int8_t)BT_PHASES; depth++)
        for (bt_idx k = 0; k < t->n - 1; k++) {
            const bt_tile *tile = &t->tile[k];
            if (tile->depth != depth - 1) continue;
            for (int32_t dy = -1; dy <= 1; dy++)
                for (int32_t dx = -1; dx <= 1; dx++) {
                    const bt_idx beside = bt_tiles_at(t, tile->x + dx, tile->y + dy);
                    if (beside >= 0 && t->tile[beside].depth > depth) t->tile[beside].depth = depth;
                }
        }
}

/// Has this rank work in tile k?
static bool has_work(const bt_world *w, bt_idx k)
{
    const bt_tiles *t = w->tiles;
    return t->tile[k].own && (t->tile[k].n_units > 0 || (k == t->n - 1 && bt_tow_has_line(w->tow)));
}

/// Strips: which way they are stacked, and to which of them each pair of rows (or columns) belongs.
typedef struct {
    bool along_x, ring;
    int32_t low;    ///< even
    bt_idx *of;     ///< [n_pairs]
    bt_idx *first;  ///< [n] its first pair
    bt_idx n_pairs, n, large;
} strips;

static bt_idx pair_of(const strips *s, const bt_tile *tile)
{
    const int32_t skew = s->along_x ? tile->phase : tile->phase >> 1, u = s->along_x ? tile->x : tile->y;
    const bt_idx pair = (u + skew - s->low) / 2;
    if (s->ring) return pair % s->n_pairs; // the last row, odd, is the lowest of strip 0
    return pair < s->n_pairs ? pair : s->n_pairs - 1;
}

/// Pairs of rows of all tiles that meet floes of the tile of the large bodies, first and last; none when it has no contacts.
static void span_of_large(const bt_world *w, const strips *s, bt_idx joint[2])
{
    const bt_tile *large = &w->tiles->tile[w->tiles->n - 1];
    const bt_bodies *b = &w->bodies;
    int32_t low = INT32_MAX, high = INT32_MIN;
    for (bt_idx j = 0; j < large->n_units; j++) {
        const bt_idx ends[2] = {large->units[j].a, large->units[j].b};
        for (int e = 0; e < 2; e++) {
            if (b->large[ends[e]]) continue;
            const int32_t u = b->tile[ends[e]][s->along_x ? 0 : 1];
            low = u < low ? u : low;
            high = u > high ? u : high;
        }
    }
    joint[0] = 0, joint[1] = -1;
    if (low > high) return;
    // Tiles low − 1 to high, each up to three columns farther by its skew; below them one row that may be a seam.
    const bt_idx first = (low - 2 - s->low) / 2, last = (high + 3 - s->low) / 2;
    const bool across = s->ring && (low < 3 || last >= s->n_pairs);
    joint[0] = across || first < 0 ? 0 : first;
    joint[1] = across || last >= s->n_pairs ? s->n_pairs - 1 : last;
}

static strips cut_strips(const bt_world *w)
{
    const bt_tiles *t = w->tiles;
    // Across a periodic x the first column of a later phase would come before the last of an earlier one.
    strips s = {.along_x = t->wrap_x == 0 && t->n_x > t->n_y};
    // Without floes there are no tiles to go round, only a count of them that may be huge.
    s.ring = !w->domain && !s.along_x && t->wrap_y > 1 && t->n_y == t->wrap_y;
    const int32_t low = s.along_x ? t->low_x : t->low_y, n = s.along_x ? t->n_x : t->n_y;
    s.low = low - (low & 1);
    s.n_pairs = s.ring ? t->wrap_y / 2 : (low + n - s.low + 1) / 2 + 2;
    bt_idx *count = bt_alloc((size_t)s.n_pairs, sizeof *count), filled = 0, joint[2];
    s.of = bt_alloc((size_t)s.n_pairs, sizeof *s.of);
    s.first = bt_alloc((size_t)s.n_pairs, sizeof *s.first);
    int64_t n_units = 0;
    for (bt_idx k = 0; k < t->n - 1; k++) {
        if (!t->tile[k].own || t->tile[k].n_units == 0) continue;
        count[pair_of(&s, &t->tile[k])]++;
        n_units += t->tile[k].n_units;
    }
    span_of_large(w, &s, joint);
    const bt_idx least = least_tiles(n_units), width = s.along_x ? 2 : 1; // pairs, see order.h
    for (bt_idx p = 0; p < s.n_pairs; p++) {
        if (filled >= least && p - s.first[s.n] >= width && !(joint[0] < p && p <= joint[1])) {
            s.first[++s.n] = p;
            filled = 0;
        }
        s.of[p] = s.n;
        filled += count[p];
    }
    s.large = has_work(w, t->n - 1) ? s.of[joint[1] > 0 ? joint[1] : 0] : -1;
    s.n++;
    free(count);
    return s;
}

static void add_run(bt_tiles *t, bt_idx begin, bt_idx end, int send, int receive)
{
    if (begin == end && send < 0 && receive < 0) return;
    if (t->n_runs == t->cap_runs) {
        t->cap_runs = t->cap_runs ? 2 * t->cap_runs : 16;
        t->run = bt_realloc(t->run, (size_t)t->cap_runs, sizeof *t->run);
    }
    t->run[t->n_runs++] = (bt_run_of_tiles){begin, end, (int8_t)send, (int8_t)receive};
}

/// Group of a tile among ranks: the hem by phases, then the strips.
static bt_idx group_among_ranks(const strips *s, const bt_tile *tile)
{
    const bool hem = tile->depth <= BT_COLOURS - 1 - tile->phase;
    return hem ? 2 * tile->phase + !tile->border : HEM_GROUPS + BT_COLOURS * s->of[pair_of(s, tile)] + tile->phase;
}

static void list_runs(bt_tiles *t, const place *p, bt_idx last)
{
    t->n_runs = 0;
    bt_idx begin = 0;
    for (bt_idx group = 0; group <= last; group++) {
        bt_idx end = begin;
        while (end < t->n_order && p[end].group == group) end++;
        const bool hem = group < HEM_GROUPS;
        int send = hem && group % 2 == 0 ? group / 2 : -1, receive = hem && group % 2 == 1 && group / 2 < BT_COLOURS - 1 ? group / 2 : -1;
        if (group == last - 1) receive = BT_COLOURS - 1;
        if (group == last) send = receive = BT_COLOURS;
        add_run(t, begin, end, send, receive);
        begin = end;
    }
}

/// Group of a tile on one rank: strip, phase, seam first.
static bt_idx group_alone(const strips *s, const bt_tile *tile)
{
    const bt_idx pair = pair_of(s, tile), strip = s->of[pair];
    const bool seam = tile->phase >= BT_COLOURS / 2 && pair == s->first[strip];
    return 2 * (BT_COLOURS * strip + tile->phase) + !seam;
}

static void list_strips(bt_tiles *t, const strips *s, const place *p)
{
    if (s->n > t->cap_strips) {
        t->cap_strips = 2 * s->n;
        t->strip = bt_realloc(t->strip, (size_t)t->cap_strips, sizeof *t->strip);
    }
    t->n_strips = s->n;
    t->large_after = s->large;
    t->ring = s->ring;
    bt_idx at = 0;
    for (bt_idx k = 0; k < s->n; k++)
        for (bt_idx c = 0; c < BT_COLOURS; c++) {
            bt_strip *strip = &t->strip[k];
            const bt_idx group = 2 * (BT_COLOURS * k + c);
            strip->begin[c] = at;
            while (at < t->n_order && p[at].group == group) at++;
            strip->seam[c] = at;
            while (at < t->n_order && p[at].group == group + 1) at++;
            strip->end[c] = at;
        }
}

void bt_order_tiles(bt_world *w)
{
    bt_tiles *t = w->tiles;
    strips s = cut_strips(w);
    place *p = bt_alloc((size_t)t->n, sizeof *p);
    const bt_idx last = w->domain ? HEM_GROUPS + BT_COLOURS * s.n : 2 * BT_COLOURS * s.n;
    t->n_units = t->n_order = 0;
    for (bt_idx k = 0; k < t->n; k++) {
        const bt_tile *tile = &t->tile[k];
        if (!has_work(w, k)) continue;
        t->n_units += tile->n_units;
        p[t->n_order++] = (place){k == t->n - 1 ? last : w->domain ? group_among_ranks(&s, tile) : group_alone(&s, tile), k};
    }
    qsort(p, (size_t)t->n_order, sizeof *p, by_group);
    if (w->domain) list_runs(t, p, last);
    else list_strips(t, &s, p);
    for (bt_idx i = 0; i < t->n_order; i++) {
        t->order[i] = p[i].tile;
        t->tile[p[i].tile].ahead = i + AHEAD < t->n_order ? p[i + AHEAD].tile : -1;
    }
    free(s.of);
    free(s.first);
    free(p);
}
