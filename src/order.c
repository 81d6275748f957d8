// SPDX-License-Identifier: MIT
// Order of a pass: groups of rows, bands of threads, depths among ranks; reasons in order.h.
#include "order.h"

#include <assert.h>
#include <omp.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "bergtow/tow.h"
#include "phases.h"

#define AHEAD 2   // tiles: what a sweep asks memory for in advance

/// Threads that so many units feed.
static bt_idx count_threads(const bt_world *w, int64_t n_units, bt_idx n_rows)
{
    if (w->domain || !BT_MANY(n_units, BT_FEW_UNITS)) return 1;
    const bt_idx threads = omp_get_max_threads(), most = n_rows / 2; // a row at a border waits for the next band
    return threads < most ? threads : most > 1 ? most : 1;
}

/// Least tiles of a group. A large field is swept fastest in groups as small as they may be: six sweeps that follow each other then find most of their
/// tiles in the second-level cache. In a small one, where all is there anyway, jumping between colours costs one thread 4 %, and several wait less
/// often for a neighbour that has steps of few tiles. Threads of a rank among others share the tiles of one phase, and wait for each other after it.
static bt_idx least_tiles(const bt_world *w, int64_t n_units, bt_idx n_threads)
{
#ifdef BT_VALIDATE
    (void)w, (void)n_units, (void)n_threads;
    return 8; // so that small cases have groups too
#else
    enum { LARGE = 20000, THICK = 256, THIN = 32, THREAD = 32 };
    if (w->domain && omp_get_max_threads() > 1) return THREAD * omp_get_max_threads();
    return n_units >= (int64_t)LARGE * n_threads ? 1 : n_threads > 1 ? THIN : THICK;
#endif
}

/// Distances in tiles from those that have 0, over the sides and corners of tiles; more[n] is room.
static void spread_depths(bt_tiles *t, bt_idx *more, bt_idx n)
{
    for (bt_idx i = 0; i < n; i++) {
        const bt_tile *tile = &t->tile[more[i]];
        for (int32_t dy = -1; dy <= 1; dy++)
            for (int32_t dx = -1; dx <= 1; dx++) {
                const bt_idx beside = bt_tiles_at(t, tile->x + dx, tile->y + dy);
                if (beside < 0 || t->tile[beside].depth >= 0) continue;
                t->tile[beside].depth = tile->depth + 1;
                more[n++] = beside;
            }
    }
}

void bt_order_depths(bt_tiles *t)
{
    bt_idx *reached = bt_alloc((size_t)t->n, sizeof *reached), n = 0;
    for (bt_idx k = 0; k < t->n - 1; k++)
        if (t->tile[k].depth == 0) reached[n++] = k;
    spread_depths(t, reached, n);
    for (bt_idx k = 0; k < t->n - 1; k++) { // ice that no way over tiles here connects to a border
        if (t->tile[k].depth >= 0) continue;
        t->tile[k].depth = 0;
        reached[0] = k;
        spread_depths(t, reached, 1);
    }
    free(reached);
}

/// Has this rank work in tile k?
static bool has_work(const bt_world *w, bt_idx k)
{
    const bt_tiles *t = w->tiles;
    return t->tile[k].own && (t->tile[k].n_units > 0 || (k == t->n - 1 && bt_tow_has_line(w->tow)));
}

/// Rows of tiles, across the longer side of the field; among ranks, the tiles of one depth.
typedef struct {
    bool by_depth, along_x, ring;
    bt_idx n;
    int32_t low;
    int64_t *units; ///< [n] in tiles of this rank
    bt_idx *tiles;  ///< [n] with work
    bool *joined;   ///< [n] in one group, or in two of one level, with the row after it
    bt_idx *group;  ///< [n]
    bt_idx n_groups, n_bands;
    bt_idx large;   ///< a row whose level holds all floes of the tile of the large bodies
} rows;

static bt_idx row_of(const rows *r, const int32_t at[2]) { return at[r->along_x ? 0 : 1] - r->low; }

static bt_idx row_of_tile(const rows *r, const bt_tile *tile) { return r->by_depth ? tile->depth : row_of(r, (const int32_t[2]){tile->x, tile->y}); }

/// What is to be done in each row; true in met[row] where its tiles may share a floe with that of the large bodies.
static int64_t count_rows(const bt_world *w, rows *r, bool *met)
{
    const bt_tiles *t = w->tiles;
    int64_t n_units = 0;
    for (bt_idx k = 0; k < t->n - 1; k++) {
        const bt_tile *tile = &t->tile[k];
        if (!has_work(w, k)) continue;
        const bt_idx u = row_of_tile(r, tile);
        r->tiles[u]++;
        r->units[u] += tile->n_units;
        n_units += tile->n_units;
    }
    const bt_tile *large = &t->tile[t->n - 1];
    for (bt_idx j = 0; j < large->n_units && !r->by_depth; j++) {
        const bt_idx ends[2] = {large->units[j].a, large->units[j].b};
        for (int e = 0; e < 2; e++) {
            if (w->bodies.large[ends[e]]) continue;
            const bt_idx u = row_of(r, w->bodies.tile[ends[e]]);
            met[u] = true;
            if (u > 0 || r->ring) met[(u + r->n - 1) % r->n] = true;
        }
    }
    return n_units;
}

/// Rows that must have one level with the row after them: all from the first to the last that was met; on a ring, all but the widest gap.
static void join_met(rows *r, const bool *met)
{
    bt_idx first = -1, last = -1, gap_end = -1, widest = 0;
    for (bt_idx u = 0; u < r->n; u++) {
        if (!met[u]) continue;
        if (first < 0) first = u;
        else if (u - last > widest) widest = u - last, gap_end = u;
        last = u;
    }
    if (first < 0) return;
    if (r->ring && first + r->n - last < widest) first = gap_end, last = gap_end - widest + r->n;
    for (bt_idx u = first; u < last; u++) r->joined[u % r->n] = true;
    r->large = first;
}

bt_idx bt_bands_of(const bt_bands *b, bt_idx t, bt_idx n_threads)
{
    if (n_threads > 1 && b->n == n_threads + 1) return t > 1 ? t + 1 : t; // thread 1 has two, of different pairs: it can be relieved on both sides
    return t * b->n / n_threads;
}

/// Shares of the work that let the threads end together: as in the last step, but from the time that each band took for what it did.
static void learn_shares(bt_bands *b)
{
    enum { WORTH = 10 }; // µs of each band: less says nothing
    const bool known = b->n_shares == b->n;
    if (!known) {
        double **each[] = {&b->share, &b->busy, &b->worked};
        for (size_t i = 0; i < sizeof each / sizeof *each; i++) *each[i] = bt_realloc(*each[i], (size_t)b->n, sizeof **each[i]);
        b->n_shares = b->n;
    }
    double *even = bt_alloc((size_t)b->n, sizeof *even), sum = 0, total = 0;
    bool enough = known;
    for (bt_idx k = 0; known && k < b->n; k++) enough = enough && b->busy[k] >= 1e-6 * WORTH && b->worked[k] > 0;
    for (bt_idx t = 0; t < b->n_threads; t++) {
        const bt_idx first = bt_bands_of(b, t, b->n_threads), end = bt_bands_of(b, t + 1, b->n_threads);
        for (bt_idx k = first; k < end; k++) sum += even[k] = (enough ? b->worked[k] / b->busy[k] : 1) / (end - first);
    }
    for (bt_idx k = 0; k < b->n; k++) {
        even[k] /= sum;
        if (!known) b->share[k] = even[k];
        else if (enough) b->share[k] = bt_min(bt_max(0.5 * (b->share[k] + even[k]), 0.5 / b->n), 2.0 / b->n);
        total += b->share[k];
        b->busy[k] = b->worked[k] = 0;
    }
    for (bt_idx k = 0; k < b->n; k++) b->share[k] /= total;
    free(even);
}

/// Where bands begin, first[n_bands + 1], in rows: by their shares, none empty.
static void deal_rows(const rows *r, int64_t n_units, const double *share, bt_idx *first)
{
    int64_t before = 0;
    double end = 0;
    bt_idx u = 0;
    for (bt_idx k = 0; k < r->n_bands; k++) {
        first[k] = u;
        end += share[k];
        const bt_idx last = r->n - (r->n_bands - k - 1); // a row for each of the others
        do before += r->units[u++];
        while (u < last && (k == r->n_bands - 1 || (double)before + 0.5 * (double)r->units[u] <= end * (double)n_units));
    }
    first[r->n_bands] = r->n;
}

/// Number the groups of rows [begin, end), from `group` on; from the last row on if `down`, whose groups have numbers from `group` downwards. Returns how many there are.
static bt_idx group_rows(rows *r, bt_idx begin, bt_idx end, bt_idx group, bool down, bt_idx least)
{
    bt_idx n = 0, filled = 0;
    for (bt_idx i = 0; i < end - begin; i++) {
        const bt_idx u = down ? end - 1 - i : begin + i;
        const bool joined = i > 0 && r->joined[down ? u : u - 1];
        if (i > 0 && filled >= least && !joined) n++, filled = 0;
        filled += r->tiles[u];
        r->group[u] = down ? group - n : group + n;
    }
    return n + 1;
}

/// Join groups of rows [begin, end), n of them from `group` on (or downwards), so that `most` are left.
static void thin_out(rows *r, bt_idx begin, bt_idx end, bt_idx group, bool down, bt_idx n, bt_idx most)
{
    if (n <= most) return;
    for (bt_idx u = begin; u < end; u++) {
        const bt_idx level = down ? group - r->group[u] : r->group[u] - group;
        const bt_idx now = (bt_idx)((int64_t)level * most / n);
        r->group[u] = down ? group - now : group + now;
    }
}

enum { LEAST_LEVEL = BT_COLOURS * BT_MAX_TURN }; // of a group that either band may take: reason in order.h

/// Groups of the two bands of rows [begin, middle) and [middle, end).
static void meet(rows *r, bt_idx begin, bt_idx middle, bt_idx end, bt_idx least, bt_segment *s, bt_idx *edge)
{
    s->begin = r->n_groups;
    const bt_idx n = group_rows(r, begin, end, s->begin, false, least);
    if (n > 2 * LEAST_LEVEL) {
        s->end = s->begin + n;
        const bt_idx low = s->begin + LEAST_LEVEL, high = s->end - LEAST_LEVEL, about = r->group[middle], reach = n / 8 + 1;
        *edge = about < low ? low : about > high ? high : about;
        s->free_begin = *edge - reach > low ? *edge - reach : low;
        s->free_end = *edge + reach < high ? *edge + reach : high;
    } else { // as many of each: they meet at one level
        const bt_idx up = group_rows(r, begin, middle, s->begin, false, least), down = group_rows(r, middle, end, 0, true, least);
        const bt_idx each = up < down ? up : down;
        thin_out(r, begin, middle, s->begin, false, up, each);
        thin_out(r, middle, end, 0, true, down, each);
        s->end = s->begin + 2 * each;
        for (bt_idx u = middle; u < end; u++) r->group[u] += s->end - 1;
        *edge = s->free_begin = s->free_end = s->begin + each;
    }
    r->n_groups = s->end;
}

static void make_groups(rows *r, int64_t n_units, bt_idx least, bt_bands *b)
{
    bt_idx *first = bt_alloc((size_t)r->n_bands + 1, sizeof *first);
    deal_rows(r, n_units, b->share, first);
    free(b->segment);
    b->segment = bt_alloc_aligned(((size_t)r->n_bands + 1) / 2, sizeof *b->segment);
    b->edge = bt_realloc(b->edge, (size_t)r->n_bands + 1, sizeof *b->edge);
    for (bt_idx k = 0; k < r->n_bands; k += 2) {
        bt_segment *s = &b->segment[k / 2];
        b->edge[k] = r->n_groups;
        if (k + 1 < r->n_bands) {
            meet(r, first[k], first[k + 1], first[k + 2], least, s, &b->edge[k + 1]);
            continue;
        }
        s->begin = r->n_groups;
        r->n_groups += group_rows(r, first[k], first[k + 1], s->begin, false, least);
        s->end = s->free_begin = s->free_end = r->n_groups;
    }
    b->edge[r->n_bands] = b->n_groups = r->n_groups;
    free(first);
}

static rows make_rows(const bt_world *w)
{
    const bt_tiles *t = w->tiles;
    bt_bands *b = &w->tiles->bands;
    rows r = {.by_depth = w->domain != NULL, .along_x = t->n_x > t->n_y};
    const int32_t wrap = r.along_x ? t->wrap_x : t->wrap_y, n = r.along_x ? t->n_x : t->n_y;
    r.low = r.along_x ? t->low_x : t->low_y;
    r.n = n > 0 ? n : 1;
    r.ring = !r.by_depth && wrap > 1 && n == wrap;
    if (r.by_depth) {
        r.n = 2;
        for (bt_idx k = 0; k < t->n - 1; k++) r.n = t->tile[k].depth >= r.n ? t->tile[k].depth + 1 : r.n;
    }
    r.units = bt_alloc((size_t)r.n, sizeof *r.units);
    r.tiles = bt_alloc((size_t)r.n, sizeof *r.tiles);
    r.group = bt_alloc((size_t)r.n, sizeof *r.group);
    r.joined = bt_alloc((size_t)r.n, sizeof *r.joined);
    bool *met = bt_alloc((size_t)r.n, sizeof *met);
    const int64_t n_units = count_rows(w, &r, met);
    if (r.by_depth) r.joined[0] = true;
    else join_met(&r, met);
    free(met);
    b->n_threads = count_threads(w, n_units, r.n);
    b->n = r.n_bands = b->n_threads + (r.ring && b->n_threads % 2 == 1);
    learn_shares(b);
    make_groups(&r, n_units, least_tiles(w, n_units, b->n_threads), b);
    return r;
}

static void free_rows(rows *r)
{
    void *arrays[] = {r->units, r->tiles, r->group, r->joined};
    for (size_t i = 0; i < sizeof arrays / sizeof *arrays; i++) free(arrays[i]);
}

/// Stable: out[] holds in[] by rising key[tile] < n_keys; start[n_keys + 1], if any, where each key begins.
static void sort_by(bt_idx n, const bt_idx *in, const bt_idx *key, bt_idx n_keys, bt_idx *out, bt_idx *start)
{
    bt_idx *at = bt_alloc((size_t)n_keys + 1, sizeof *at);
    for (bt_idx i = 0; i < n; i++) at[key[in[i]] + 1]++;
    for (bt_idx g = 0; g < n_keys; g++) at[g + 1] += at[g];
    if (start) memcpy(start, at, ((size_t)n_keys + 1) * sizeof *start);
    for (bt_idx i = 0; i < n; i++) out[at[key[in[i]]]++] = in[i];
    free(at);
}

// --- knots -----------------------------------------------------------------------------------------------------------

/// What decides which thread does a tile.
typedef struct {
    const bt_bands *bands;
    const bt_idx *group;  ///< [tiles]
    const bt_idx *band;   ///< [tiles] that is expected to do it
} deal;

static bool is_free(const deal *d, bt_idx k)
{
    const bt_segment *s = &d->bands->segment[d->band[k] / 2];
    return d->group[k] >= s->free_begin && d->group[k] < s->free_end;
}

static bool same_thread(const deal *d, bt_idx k, bt_idx l) { return k == l || (d->band[k] == d->band[l] && !is_free(d, k) && !is_free(d, l)); }

/// near[k]: tile k may share a floe with the tile of the large bodies.
static void mark_near_large(const bt_world *w, bool *near)
{
    const bt_tiles *t = w->tiles;
    const bt_tile *large = &t->tile[t->n - 1];
    for (bt_idx j = 0; j < large->n_units; j++) {
        const bt_idx ends[2] = {large->units[j].a, large->units[j].b};
        for (int e = 0; e < 2; e++) {
            if (w->bodies.large[ends[e]]) continue;
            const int32_t *at = w->bodies.tile[ends[e]];
            for (int c = 0; c < BT_COLOURS; c++) {
                const bt_idx k = bt_tiles_at(t, at[0] - c % 2, at[1] - c / 2);
                if (k >= 0) near[k] = true;
            }
        }
    }
}

/// Tiles with work that may share a floe with tile k, itself among them.
static int list_neighbours(const bt_world *w, const bool *near, bt_idx k, bt_idx out[10])
{
    const bt_tiles *t = w->tiles;
    const bt_tile *tile = &t->tile[k];
    int n = 0;
    for (int32_t dy = -1; dy <= 1; dy++)
        for (int32_t dx = -1; dx <= 1; dx++) {
            const bt_idx l = bt_tiles_at(t, tile->x + dx, tile->y + dy);
            if (l >= 0 && has_work(w, l)) out[n++] = l;
        }
    if (near[k] && has_work(w, t->n - 1)) out[n++] = t->n - 1;
    return n;
}

/// Make knots of all tiles that share a floe with one that another thread may do, and tie them to each other.
static void tie_knots(const bt_world *w, const deal *d)
{
    bt_tiles *t = w->tiles;
    bt_bands *b = &t->bands;
    b->n_knots = 0;
    b->passes = 0;
    for (bt_idx i = 0; i < t->n_order; i++) t->tile[t->order[i]].knot = -1;
    if (b->n == 1) return;
    const bt_idx large = t->n - 1;
    bool *near = bt_alloc((size_t)t->n, sizeof *near);
    mark_near_large(w, near);
    bt_idx n_ties = 0, beside[10];
    for (bt_idx i = 0; i < t->n_order; i++) {
        const bt_idx k = t->order[i];
        if (k == large) continue;
        const int n = list_neighbours(w, near, k, beside);
        for (int j = 0; j < n; j++) {
            if (same_thread(d, beside[j], k)) continue;
            if (t->tile[k].knot < 0) t->tile[k].knot = b->n_knots++;
            if (beside[j] != large) {
                n_ties++;
                continue;
            }
            if (t->tile[large].knot < 0) t->tile[large].knot = b->n_knots++;
            n_ties += 2;
        }
    }
    free(b->knot);
    b->knot = bt_alloc_aligned((size_t)b->n_knots, sizeof *b->knot);
    b->other = bt_realloc(b->other, (size_t)n_ties, sizeof *b->other);
    bt_idx at = 0;
    for (bt_idx i = 0; i < t->n_order; i++) {
        const bt_idx k = t->order[i];
        if (t->tile[k].knot < 0) continue;
        bt_knot *knot = &b->knot[t->tile[k].knot];
        knot->phase = t->tile[k].phase;
        knot->begin = at;
        if (k == large) {
            for (bt_idx l = 0; l < large; l++)
                if (near[l] && has_work(w, l) && !same_thread(d, l, k)) b->other[at++] = t->tile[l].knot;
        } else {
            const int n = list_neighbours(w, near, k, beside);
            for (int j = 0; j < n; j++)
                if (!same_thread(d, beside[j], k)) b->other[at++] = t->tile[beside[j]].knot;
        }
        knot->end = at;
    }
    assert(at == n_ties);
    free(near);
}

// ---------------------------------------------------------------------------------------------------------------------

/// Band that is expected to do each group; the caller frees.
static bt_idx *list_bands(const bt_bands *b)
{
    bt_idx *band = bt_alloc((size_t)b->n_groups, sizeof *band);
    for (bt_idx k = 0; k < b->n; k++)
        for (bt_idx g = b->edge[k]; g < b->edge[k + 1]; g++) band[g] = k;
    return band;
}

/// What is swept next but one: tiles of one group and phase, then, in a step, those of the group behind and the next phase.
static void look_ahead(bt_tiles *t, const bt_idx *group)
{
    const bt_bands *b = &t->bands;
    for (bt_idx k = 0; k < b->n; k++)
        for (bt_idx i = b->start[b->edge[k] * BT_PHASES]; i < b->start[b->edge[k + 1] * BT_PHASES]; i++) {
            const bt_segment *s = &b->segment[k / 2];
            bt_tile *tile = &t->tile[t->order[i]];
            const bt_idx g = group[t->order[i]], end = b->start[g * BT_PHASES + tile->phase + 1], behind = k % 2 == 0 ? g - 1 : g + 1;
            bt_idx at = i + AHEAD;
            if (at >= end && behind >= s->begin && behind < s->end && tile->phase < BT_COLOURS) {
                const bt_idx *next = &b->start[behind * BT_PHASES + (tile->phase + 1) % BT_COLOURS];
                at = next[0] + at - end < next[1] ? next[0] + at - end : -1;
            } else if (at >= end) at = -1;
            tile->ahead = at >= 0 ? t->order[at] : -1;
        }
}

void bt_order_tiles(bt_world *w)
{
    bt_tiles *t = w->tiles;
    bt_bands *b = &t->bands;
    rows r = make_rows(w);
    bt_idx *list = bt_alloc((size_t)t->n, sizeof *list), *by_row = bt_alloc((size_t)t->n, sizeof *by_row), *key = bt_alloc((size_t)t->n, sizeof *key);
    bt_idx *group = bt_alloc((size_t)t->n, sizeof *group), *band = bt_alloc((size_t)t->n, sizeof *band), *band_of_group = list_bands(b);
    for (bt_idx k = 0; k < t->n; k++) {
        list[k] = k;
        group[k] = r.group[k == t->n - 1 ? r.large : row_of_tile(&r, &t->tile[k])];
        band[k] = band_of_group[group[k]];
    }
    b->member = bt_realloc(b->member, (size_t)t->n, sizeof *b->member);
    b->first = bt_realloc(b->first, (size_t)b->n + 1, sizeof *b->first);
    sort_by(t->n, list, band, b->n, b->member, b->first);
    t->n_units = t->n_order = 0;
    memset(b->n_border, 0, sizeof b->n_border);
    for (bt_idx k = 0; k < t->n; k++) {
        if (!has_work(w, k)) continue;
        const bt_tile *tile = &t->tile[k];
        const bt_idx u = k < t->n - 1 ? row_of_tile(&r, tile) : 0;
        t->n_units += tile->n_units;
        list[t->n_order++] = k;
        key[k] = band[k] % 2 == 0 ? u + !tile->border : r.n - 1 - u;
        if (tile->border && k < t->n - 1) b->n_border[tile->phase]++;
    }
    // In each step a thread begins at the border that the next band, or rank, looks at.
    sort_by(t->n_order, list, key, r.n + 1, by_row, NULL);
    for (bt_idx i = 0; i < t->n_order; i++) key[list[i]] = group[list[i]] * BT_PHASES + t->tile[list[i]].phase;
    b->start = bt_realloc(b->start, (size_t)b->n_groups * BT_PHASES + 1, sizeof *b->start);
    sort_by(t->n_order, by_row, key, b->n_groups * BT_PHASES, t->order, b->start);
    tie_knots(w, &(deal){b, group, band});
    look_ahead(t, group);
    void *arrays[] = {list, by_row, key, group, band, band_of_group};
    for (size_t i = 0; i < sizeof arrays / sizeof *arrays; i++) free(arrays[i]);
    free_rows(&r);
}
