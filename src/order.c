// SPDX-License-Identifier: MIT
// Order of a pass: levels of rows, bands of threads, hem of ranks; reasons in order.h.
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
static bt_idx count_bands(const bt_world *w, int64_t n_units, bt_idx n_rows)
{
    if (w->domain || !BT_MANY(n_units, BT_FEW_UNITS)) return 1;
    const bt_idx threads = omp_get_max_threads(), most = n_rows / 2; // a row at a border waits for the next band
    return threads < most ? threads : most > 1 ? most : 1;
}

/// Least tiles of a level. A large field is swept fastest in levels as low as they may be: six sweeps that follow each other then find most of their
/// tiles in the second-level cache. In a small one, where all is there anyway, jumping between colours costs one thread 4 %, and several wait less
/// often for a neighbour that has steps of few tiles. Threads of a rank among others share the tiles of one phase, and wait for each other after it.
static bt_idx least_tiles(const bt_world *w, int64_t n_units, bt_idx n_bands)
{
#ifdef BT_VALIDATE
    (void)w, (void)n_units, (void)n_bands;
    return 8; // so that small cases have levels too
#else
    enum { LARGE = 20000, THICK = 256, THIN = 32, THREAD = 32 };
    if (w->domain && omp_get_max_threads() > 1) return THREAD * omp_get_max_threads();
    return n_units >= (int64_t)LARGE * n_bands ? 1 : n_bands > 1 ? THIN : THICK;
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

void bt_order_measure(bt_tiles *t)
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
    bt_idx *level;  ///< [n]
    bt_idx *away;   ///< [n] rows to the nearest where the levels are least
    bt_idx *band;   ///< [n]
    bt_idx n_bands, n_levels;
    bt_idx large;   ///< a row of the level that holds all floes of the tile of the large bodies
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
static void join_met(rows *r, const bool *met, bool *joined)
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
    for (bt_idx u = first; u < last; u++) joined[u % r->n] = true;
    r->large = first;
}

/// Shares of the work that let the bands end together: as in the last step, but from the time that each took for what it had.
static void learn_shares(bt_bands *b, bt_idx n)
{
    enum { WORTH = 10 }; // µs of each thread: less says nothing
    if (b->n_shares != n) {
        b->n_shares = n;
        double **each[] = {&b->share, &b->busy, &b->dealt};
        for (size_t i = 0; i < sizeof each / sizeof *each; i++) *each[i] = bt_realloc(*each[i], (size_t)n, sizeof **each[i]);
        for (bt_idx k = 0; k < n; k++) b->share[k] = 1.0 / n, b->busy[k] = 0;
    }
    double pace = 0, sum = 0;
    for (bt_idx k = 0; k < n; k++) {
        if (b->busy[k] < 1e-6 * WORTH || b->dealt[k] <= 0) return;
        pace += b->dealt[k] / b->busy[k];
    }
    for (bt_idx k = 0; k < n; k++) {
        const double even = b->dealt[k] / b->busy[k] / pace, share = 0.5 * (b->share[k] + even);
        b->share[k] = bt_min(bt_max(share, 0.5 / n), 2.0 / n);
        sum += b->share[k];
    }
    for (bt_idx k = 0; k < n; k++) b->share[k] /= sum;
}

static void deal_bands(rows *r, int64_t n_units, bt_bands *b)
{
    learn_shares(b, r->n_bands);
    for (bt_idx k = 0; k < r->n_bands; k++) b->busy[k] = b->dealt[k] = 0;
    int64_t before = 0;
    bt_idx band = 0;
    double end = b->share[0];
    for (bt_idx u = 0; u < r->n; u++) {
        while (band < r->n_bands - 1 && (double)before + 0.5 * (double)r->units[u] > end * (double)n_units) end += b->share[++band];
        r->band[u] = band;
        if (n_units > 0) b->dealt[band] += (double)r->units[u] / (double)n_units;
        before += r->units[u];
    }
}

/// Distances from the nearest zero, when it is cut[u] (1 if NULL) from row u to the next.
static void relax(const rows *r, const bool *cut, bt_idx *distance)
{
    for (int rounds = r->ring ? 2 : 1; rounds > 0; rounds--) {
        for (bt_idx u = r->ring ? 0 : 1; u < r->n; u++) {
            const bt_idx before = (u + r->n - 1) % r->n, there = distance[before] + (cut ? cut[before] : 1);
            if (there < distance[u]) distance[u] = there;
        }
        for (bt_idx u = r->n - 1 - !r->ring; u >= 0; u--) {
            const bt_idx there = distance[(u + 1) % r->n] + (cut ? cut[u] : 1);
            if (there < distance[u]) distance[u] = there;
        }
    }
}

/// Levels that are least at every other border of bands.
static void set_levels(rows *r, const bool *joined, bt_idx least)
{
    bool *cut = bt_alloc((size_t)r->n, sizeof *cut);
    bt_idx filled = 0;
    for (bt_idx u = 0; u < r->n; u++) {
        filled += r->tiles[u];
        cut[u] = filled >= least && !joined[u];
        if (cut[u]) filled = 0;
        const bool low = u == 0 ? r->n_bands == 1 : r->band[u] != r->band[u - 1] && r->band[u] % 2 == 1;
        const bool top = u == r->n - 1 && r->n_bands > 1 && r->n_bands % 2 == 1;
        r->level[u] = low || top ? 0 : r->n;
        if (low && u > 0) r->level[u - 1] = 0;
    }
    memcpy(r->away, r->level, (size_t)r->n * sizeof *r->away);
    relax(r, NULL, r->away);
    relax(r, cut, r->level);
    for (bt_idx u = 0; u < r->n; u++) r->n_levels = r->level[u] >= r->n_levels ? r->level[u] + 1 : r->n_levels;
    free(cut);
}

static rows make_rows(const bt_world *w)
{
    const bt_tiles *t = w->tiles;
    rows r = {.by_depth = w->domain != NULL, .along_x = t->n_x > t->n_y};
    const int32_t wrap = r.along_x ? t->wrap_x : t->wrap_y, n = r.along_x ? t->n_x : t->n_y;
    r.low = r.along_x ? t->low_x : t->low_y;
    r.n = n > 0 ? n : 1;
    r.ring = !r.by_depth && wrap > 1 && n == wrap;
    if (r.by_depth) {
        r.n = 2;
        for (bt_idx k = 0; k < t->n - 1; k++) r.n = t->tile[k].depth >= r.n ? t->tile[k].depth + 1 : r.n;
    }
    bt_idx **each[] = {&r.tiles, &r.level, &r.away, &r.band};
    for (size_t i = 0; i < sizeof each / sizeof *each; i++) *each[i] = bt_alloc((size_t)r.n, sizeof **each[i]);
    r.units = bt_alloc((size_t)r.n, sizeof *r.units);
    bool *met = bt_alloc((size_t)r.n, sizeof *met), *joined = bt_alloc((size_t)r.n, sizeof *joined);
    const int64_t n_units = count_rows(w, &r, met);
    join_met(&r, met, joined);
    joined[0] = joined[0] || r.by_depth;
    r.n_bands = count_bands(w, n_units, r.n);
    deal_bands(&r, n_units, &w->tiles->bands);
    set_levels(&r, joined, least_tiles(w, n_units, r.n_bands));
    free(met);
    free(joined);
    return r;
}

static void free_rows(rows *r)
{
    void *arrays[] = {r->units, r->tiles, r->level, r->away, r->band};
    for (size_t i = 0; i < sizeof arrays / sizeof *arrays; i++) free(arrays[i]);
}

static bt_idx step_of(const bt_world *w, const rows *r, bt_idx k)
{
    const bt_tile *tile = &w->tiles->tile[k];
    return r->level[k == w->tiles->n - 1 ? r->large : row_of_tile(r, tile)] + tile->phase;
}

static bt_idx band_of(const bt_world *w, const rows *r, bt_idx k) { return r->band[k == w->tiles->n - 1 ? r->large : row_of_tile(r, &w->tiles->tile[k])]; }

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

// --- on one rank -----------------------------------------------------------------------------------------------------

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

/// Tiles with work that may share a floe with tile k, itself among them; some may be there twice.
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

/// Make knots of all tiles that share a floe with one of another band, and tie them to each other. band[tile].
static void tie_knots(const bt_world *w, const bt_idx *band)
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
            if (band[beside[j]] == band[k]) continue;
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
                if (near[l] && has_work(w, l) && band[l] != band[k]) b->other[at++] = t->tile[l].knot;
        } else {
            const int n = list_neighbours(w, near, k, beside);
            for (int j = 0; j < n; j++)
                if (band[beside[j]] != band[k]) b->other[at++] = t->tile[beside[j]].knot;
        }
        knot->end = at;
    }
    assert(at == n_ties);
    free(near);
}

// ---------------------------------------------------------------------------------------------------------------------

void bt_order_tiles(bt_world *w)
{
    bt_tiles *t = w->tiles;
    bt_bands *b = &t->bands;
    rows r = make_rows(w);
    b->n = r.n_bands;
    b->n_steps = r.n_levels + BT_PHASES - 1;
    const bt_idx n_keys = b->n * b->n_steps * BT_PHASES;
    bt_idx *list = bt_alloc((size_t)t->n, sizeof *list), *by_row = bt_alloc((size_t)t->n, sizeof *by_row);
    bt_idx *key = bt_alloc((size_t)t->n, sizeof *key), *band = bt_alloc((size_t)t->n, sizeof *band);
    for (bt_idx k = 0; k < t->n; k++) list[k] = k, band[k] = band_of(w, &r, k);
    b->member = bt_realloc(b->member, (size_t)t->n, sizeof *b->member);
    b->first = bt_realloc(b->first, (size_t)b->n + 1, sizeof *b->first);
    sort_by(t->n, list, band, b->n, b->member, b->first);
    t->n_units = t->n_order = 0;
    memset(b->n_border, 0, sizeof b->n_border);
    for (bt_idx k = 0; k < t->n; k++) {
        if (!has_work(w, k)) continue;
        const bt_tile *tile = &t->tile[k];
        t->n_units += tile->n_units;
        list[t->n_order++] = k;
        key[k] = k < t->n - 1 ? r.away[row_of_tile(&r, tile)] + !tile->border : 0;
        if (tile->border && k < t->n - 1) b->n_border[tile->phase]++;
    }
    // In each step a thread begins at the border that the next band, or rank, looks at.
    sort_by(t->n_order, list, key, r.n + 1, by_row, NULL);
    for (bt_idx i = 0; i < t->n_order; i++) {
        const bt_idx k = list[i];
        key[k] = (band[k] * b->n_steps + step_of(w, &r, k)) * BT_PHASES + t->tile[k].phase;
    }
    b->start = bt_realloc(b->start, (size_t)n_keys + 1, sizeof *b->start);
    sort_by(t->n_order, by_row, key, n_keys, t->order, b->start);
    tie_knots(w, band);
    for (bt_idx i = 0; i < t->n_order; i++) t->tile[t->order[i]].ahead = i + AHEAD < t->n_order ? t->order[i + AHEAD] : -1;
    free(list);
    free(by_row);
    free(key);
    free(band);
    free_rows(&r);
}
