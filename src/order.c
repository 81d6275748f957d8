// SPDX-License-Identifier: MIT
// Order of a pass: hem by phases, inner tiles in strips; reasons in order.h.
#include "order.h"

#include <stdlib.h>

#include "bergtow/tow.h"

#define AHEAD 2   // tiles: what a sweep asks memory for in advance
#ifdef BT_VALIDATE
#define STRIP 8   // so that small cases have strips too
#else
#define STRIP 256 // tiles: a third of a megabyte of velocities, in the second-level cache. From 64 to 512 it matters little
#endif

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

/// Strips: which way they are stacked, and which of them each pair of rows (or columns) begins or continues.
typedef struct {
    bool along_x;
    int32_t low;    ///< even
    bt_idx *of;     ///< [pairs of rows]
    bt_idx n_pairs, n;
} strips;

static bt_idx strip_of(const strips *s, const bt_tile *tile)
{
    const int32_t skew = s->along_x ? tile->phase : tile->phase >> 1, u = s->along_x ? tile->x : tile->y;
    const bt_idx pair = (u + skew - s->low) / 2;
    return s->of[pair < s->n_pairs ? pair : s->n_pairs - 1];
}

static strips cut_strips(const bt_tiles *t)
{
    // Across a periodic x the first column of a later phase would come before the last of an earlier one.
    strips s = {.along_x = t->wrap_x == 0 && t->n_x > t->n_y};
    const int32_t low = s.along_x ? t->low_x : t->low_y, n = s.along_x ? t->n_x : t->n_y;
    s.low = low - (low & 1);
    s.n_pairs = (low + n - s.low + 1) / 2 + 2;
    bt_idx *count = bt_alloc((size_t)s.n_pairs, sizeof *count), filled = 0;
    s.of = bt_alloc((size_t)s.n_pairs, sizeof *s.of);
    for (bt_idx k = 0; k < t->n - 1; k++)
        if (t->tile[k].own && t->tile[k].n_units > 0) count[((s.along_x ? t->tile[k].x : t->tile[k].y) - s.low) / 2]++;
    for (bt_idx p = 0; p < s.n_pairs; p++) {
        if (filled >= STRIP) {
            s.n++;
            filled = 0;
        }
        s.of[p] = s.n;
        filled += count[p];
    }
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

void bt_order_tiles(bt_world *w)
{
    bt_tiles *t = w->tiles;
    strips s = cut_strips(t);
    place *p = bt_alloc((size_t)t->n, sizeof *p);
    const bt_idx last = HEM_GROUPS + BT_COLOURS * s.n;
    t->n_units = t->n_order = 0;
    for (bt_idx k = 0; k < t->n; k++) {
        const bt_tile *tile = &t->tile[k];
        if (!has_work(w, k)) continue;
        t->n_units += tile->n_units;
        bt_idx group = last;
        if (k < t->n - 1) {
            const bool hem = w->domain && tile->depth <= BT_COLOURS - 1 - tile->phase;
            group = hem ? 2 * tile->phase + !tile->border : HEM_GROUPS + BT_COLOURS * strip_of(&s, tile) + tile->phase;
        }
        p[t->n_order++] = (place){group, k};
    }
    qsort(p, (size_t)t->n_order, sizeof *p, by_group);
    free(s.of);

    t->n_runs = 0;
    bt_idx begin = 0;
    for (bt_idx group = 0; group <= last; group++) {
        bt_idx end = begin;
        while (end < t->n_order && p[end].group == group) end++;
        const bool hem = w->domain && group < HEM_GROUPS;
        int send = hem && group % 2 == 0 ? group / 2 : -1, receive = hem && group % 2 == 1 && group / 2 < BT_COLOURS - 1 ? group / 2 : -1;
        if (w->domain && group == last - 1) receive = BT_COLOURS - 1;
        if (w->domain && group == last) send = receive = BT_COLOURS;
        add_run(t, begin, end, send, receive);
        begin = end;
    }
    for (bt_idx i = 0; i < t->n_order; i++) {
        t->order[i] = p[i].tile;
        t->tile[p[i].tile].ahead = i + AHEAD < t->n_order ? p[i + AHEAD].tile : -1;
    }
    free(p);
}
