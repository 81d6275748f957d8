// SPDX-License-Identifier: MIT
// Labels of the floes, storage in the order of the cells, and the array of cells; what they are for: space/cells.h.
#include "space/cells.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/elementary.h"
#include "body/bodies.h"
#include "space/exchange.h"

double bt_margin_most(const bt_world *w) { return 16 * w->par.size; }

// Contacts make floes faster within the step. With a fifth more than the speeds before the solve, the margin holds for
// the solution nearly wherever that matters: of 300 steps of full-scale tows in 80 and 90 % ice, 6 and 8 take sweeps
// again instead of 105 and 181, and the updates are a sixth fewer. Two fifths save no more and add a tenth to the time
// of detection. Plain sweeps, the reference, have no such room: fields are shaken with them, and keep their bits.
#define FASTER 1.2

/// The way, m, rounded up to a power of √2, between the slop and the largest margin.
static double round_up(const bt_world *w, double least)
{
    if (!(least < bt_margin_most(w)) && w->par.size > 0) return bt_margin_most(w);
    if (!(least > w->par.slop)) return w->par.slop;
    const int k = bt_ceil_2log2(least); // 2^(k/2)
    return ldexp(k & 1 ? 0.70710678118654752440 : 1, (k + (k & 1)) / 2);
}

double bt_margin_for(const bt_world *w, double s)
{
    return round_up(w, (w->par.plain_sweeps ? 1 : FASTER) * (2 * w->par.dt * s));
}

bool bt_margin_holds(const bt_world *w, double margin, double s) { return round_up(w, 2 * w->par.dt * s) <= margin; }

// --- the cells -------------------------------------------------------------------------------------------------------

#define CELL_DIAMETERS 5.0 // least side of a cell by default, in mean floe diameters: 25 floes at 80 %; assumed

bt_cells *bt_cells_create(void) { return bt_alloc(1, sizeof(bt_cells)); }

static void free_work(bt_work_list *k)
{
    free(k->list);
    k->list = NULL;
    k->in_place = NULL;
    k->n_list = k->cap_list = k->n_last = 0;
}

void bt_cells_make_room(bt_cell *t, size_t bytes)
{
    if (bytes <= t->contact_bytes) return;
    free(t->contacts);
    t->contact_bytes = bytes + bytes / 32;
    t->contacts = bt_alloc_aligned(t->contact_bytes, 1);
}

/// The contacts into memory of their own.
static void move_contacts(bt_cell *t, size_t bytes)
{
    bt_contact *contacts = bt_alloc_aligned(bytes, 1);
    if (t->n_contacts > 0) memcpy(contacts, t->contacts, (size_t)t->n_contacts * sizeof *contacts);
    free(t->contacts);
    t->contacts = contacts;
    t->contact_bytes = bytes;
}

void *bt_cells_after_contacts(bt_cell *t, size_t bytes)
{
    const size_t own = (size_t)t->n_contacts * sizeof *t->contacts;
    if (own + bytes > t->contact_bytes) move_contacts(t, own + bytes + (own + bytes) / 32);
    return (char *)t->contacts + own;
}

/// Only the contacts stay.
static void rest(bt_cell *t)
{
    assert(!t->work.packed);
    free_work(&t->work);
    const size_t bytes = (size_t)t->n_contacts * sizeof *t->contacts;
    if (t->contact_bytes - t->contact_bytes / 8 > bytes) move_contacts(t, bytes);
}

void bt_cells_rest(bt_cells *t)
{
    for (bt_idx k = 0; k < t->n; k++) rest(&t->cell[k]);
}

void bt_cells_idle(bt_cell *t)
{
    free(t->search.pairs);
    free(t->search.near);
    free(t->contacts);
    free(t->gaps);
    free(t->laws.limits);
    free(t->laws.rises);
    free_work(&t->work);
    t->search = (bt_pair_search){0};
    t->contacts = NULL;
    t->gaps = NULL;
    t->laws.limits = NULL;
    t->laws.rises = NULL;
    t->contact_bytes = 0;
    t->n_contacts = t->cap_contacts = t->laws.cap_limits = 0;
    t->n_points = 0;
    t->overlap = 0;
}

static void free_cell(bt_cell *t)
{
    bt_cells_idle(t);
    free(t->laws.memory);
    *t = (bt_cell){0};
}

void bt_cells_free(bt_cells *t)
{
    if (!t) return;
    for (bt_idx k = 0; k < t->n; k++) free_cell(&t->cell[k]);
    void *arrays[] = {t->at,   t->speed,   t->bound, t->moved, t->asleep, t->awake,
                      t->busy, t->is_busy, t->order, t->turn,  t->share,  t->cell,  t};
    for (size_t i = 0; i < sizeof arrays / sizeof *arrays; i++) free(arrays[i]);
}

/// Lower of two adjacent coordinates, around a periodic direction of n cells.
static int32_t lower(int32_t p, int32_t q, int32_t n)
{
    if (n > 1) return p == q || bt_cells_wrapped(p + 1, n) == q ? p : q;
    return p < q ? p : q;
}

void bt_cells_owner(const bt_cells *t, const int32_t p[2], const int32_t q[2], int32_t out[2])
{
    out[0] = lower(p[0], q[0], t->wrap_x);
    out[1] = lower(p[1], q[1], t->wrap_y);
}

// --- busy cells ------------------------------------------------------------------------------------------------------

void bt_cells_wake(bt_cells *t, bt_idx k)
{
    if (t->is_busy[k]) return;
    t->is_busy[k] = 1;
    t->busy_sorted = false;
    t->busy[t->n_busy++] = k;
}

void bt_cells_wake_all(bt_cells *t)
{
    if (t->n_busy == t->n) return;
    for (bt_idx k = 0; k < t->n; k++) {
        t->busy[k] = k;
        t->is_busy[k] = 1;
    }
    t->n_busy = t->n;
    t->busy_sorted = true;
}

static int ascending(const void *p, const void *q)
{
    const bt_idx a = *(const bt_idx *)p, b = *(const bt_idx *)q;
    return (a > b) - (a < b);
}

void bt_cells_sort_busy(bt_cells *t)
{
    if (!t->busy_sorted) qsort(t->busy, (size_t)t->n_busy, sizeof *t->busy, ascending);
    t->busy_sorted = true;
}

void bt_cells_leave(bt_cells *t)
{
    if (!t->still) return;
    bt_idx kept = 0;
    for (bt_idx i = 0; i < t->n_busy; i++) {
        const bt_idx k = t->busy[i];
        if (k == t->n - 1 || t->asleep[k] != BT_ASLEEP || t->awake[k] || t->bound[k] > 0) {
            t->busy[kept++] = k;
        } else {
            t->is_busy[k] = 0;
            t->cell[k].work.swept = false; // as a residual pass would have it: nothing here moved on
        }
    }
    t->n_busy = kept;
}

double bt_cells_outside(const bt_world *w, bt_idx i)
{
    const bt_cells *t = w->cells;
    double out = 0;
    if (t->wrap_x != 1) {
        const double middle = t->x0 + (w->bodies.cell[i][0] + 0.5) * t->side_x;
        out = bt_max(out, fabs(bt_nearest_image(w->bodies.pose[i].x - middle, w->par.period_x)) - 0.5 * t->side_x);
    }
    if (t->wrap_y != 1) {
        const double middle = t->y0 + (w->bodies.cell[i][1] + 0.5) * t->side_y;
        out = bt_max(out, fabs(bt_nearest_image(w->bodies.pose[i].y - middle, w->par.period_y)) - 0.5 * t->side_y);
    }
    return out;
}

/// Side of the cells along one direction. Around a period their number is even, or the colours would meet at the seam;
/// below four the block of a cell would meet itself, and one cell takes the whole period.
static double side_along(double side, double period, int32_t *wrap)
{
    *wrap = 0;
    if (!(period > 0)) return side;
    const double n = 2 * floor(period / (2 * side));
    *wrap = n >= 4 ? (int32_t)bt_min(n, 1 << 30) : 1;
    return period / *wrap;
}

/// Floor of the coordinate, within what 32 bits hold; a body with a pose that is not a number lands in cell 0 and is
/// reported by the run.
static int32_t coordinate(double x, double x0, double side, int32_t wrap)
{
    if (wrap == 1) return 0;
    const double c = floor((x - x0) / side);
    if (wrap) return (int32_t)bt_max(0, bt_min(wrap - 1, c - floor(c / wrap) * wrap));
    return isfinite(c) ? (int32_t)bt_max(-1e9, bt_min(1e9, c)) : 0;
}

/// Choose the cells for the poses of now and margins up to twice the present one.
static void choose(bt_world *w, double margin)
{
    bt_cells *t = w->cells;
    const bt_bodies *b = &w->bodies;
    // Box of the floes [0..3], largest radius [4], mass [5], restitution [6] and speed [7], as maxima.
    double most[8] = {-INFINITY, -INFINITY, -INFINITY, -INFINITY, 0, 0, 0, 0};
    for (bt_idx i = 0; i < b->n; i++) {
        if (b->motion[i] == BT_DYNAMIC) most[5] = bt_max(most[5], b->mass[i]);
        most[6] = bt_max(most[6], b->restitution[i]);
        most[7] = bt_max(most[7], bt_bodies_speed(w, i, &b->vel[i]));
        if (b->large[i] || !isfinite(b->pose[i].x + b->pose[i].y)) continue;
        most[0] = bt_max(most[0], -b->pose[i].x);
        most[1] = bt_max(most[1], -b->pose[i].y);
        most[2] = bt_max(most[2], b->pose[i].x);
        most[3] = bt_max(most[3], b->pose[i].y);
        most[4] = bt_max(most[4], b->radius[i]);
    }
    if (w->exchange) w->exchange->maxima(w, most, 8);
    t->reach = most[4];
    t->heaviest = most[5];
    t->rebounds = most[6] > 0;
    t->margin_max = bt_max(2 * bt_max(margin, bt_margin_for(w, most[7])), 0.25 * w->par.size);
    const bool any = most[0] + most[2] >= 0;
    t->x0 = w->par.x0 + (w->par.period_x > 0 ? 0 : w->drift_x);
    t->y0 = w->par.y0 + (w->par.period_y > 0 ? 0 : w->drift_y);
    double side = bt_max((w->par.cell > 0 ? w->par.cell : CELL_DIAMETERS) * w->par.size,
                         2 * t->reach + t->margin_max + 0.5 * w->par.size);
    if (!(side > 0)) side = 1;
    for (;; side *= 2) { // a floe far out must not ask for memory: at most 4 cells a floe, by larger cells
        t->side_x = side_along(side, w->par.period_x, &t->wrap_x);
        t->side_y = side_along(side, w->par.period_y, &t->wrap_y);
        int32_t low[2] = {0, 0}, high[2] = {0, 0};
        if (any) {
            low[0] = t->wrap_x ? 0 : coordinate(-most[0], t->x0, t->side_x, 0);
            low[1] = t->wrap_y ? 0 : coordinate(-most[1], t->y0, t->side_y, 0);
            high[0] = t->wrap_x ? t->wrap_x - 1 : coordinate(most[2], t->x0, t->side_x, 0);
            high[1] = t->wrap_y ? t->wrap_y - 1 : coordinate(most[3], t->y0, t->side_y, 0);
        }
        const double n_x = (double)high[0] - low[0] + 1, n_y = (double)high[1] - low[1] + 1;
        if (n_x * n_y > 4 * (double)(b->n_global - b->n_kept) + 1024) continue;
        t->low_x = low[0], t->low_y = low[1];
        t->n_x = (int32_t)n_x, t->n_y = (int32_t)n_y;
        break;
    }
    // A direction that one cell spans has no neighbours, and no bound on where a centroid stands.
    double slack = INFINITY;
    if (t->wrap_x != 1) slack = bt_min(slack, t->side_x - 2 * t->reach - t->margin_max);
    if (t->wrap_y != 1) slack = bt_min(slack, t->side_y - 2 * t->reach - t->margin_max);
    t->allowance = 0.5 * slack;
}

/// Only a pose that is not a number lies outside the box of the floes.
static int32_t within(int32_t c, int32_t low, int32_t n) { return c < low ? low : c >= low + n ? low + n - 1 : c; }

static void label(bt_world *w)
{
    const bt_cells *t = w->cells;
    bt_bodies *b = &w->bodies;
    for (bt_idx i = 0; i < b->n; i++) {
        if (b->large[i]) continue;
        b->cell[i][0] = within(coordinate(b->pose[i].x, t->x0, t->side_x, t->wrap_x), t->low_x, t->n_x);
        b->cell[i][1] = within(coordinate(b->pose[i].y, t->y0, t->side_y, t->wrap_y), t->low_y, t->n_y);
    }
}

// --- storage -------------------------------------------------------------------------------------------------------

typedef struct {
    int64_t cell; ///< row-major, large bodies last
    bt_gid gid;
    bt_idx from;
} sort_key;

static int by_cell(const void *p, const void *q)
{
    const sort_key *a = p, *b = q;
    if (a->cell != b->cell) return a->cell < b->cell ? -1 : 1;
    return a->gid < b->gid ? -1 : a->gid > b->gid;
}

static void **array_of(bt_bodies *b, int k) { return (void **)((char *)b + bt_body_fields[k].array); }

/// Bodies in the order of `from`; vertices, whose number differs, follow.
static void permute(bt_bodies *b, const sort_key *key)
{
    const size_t n = (size_t)b->n;
    for (int k = 0; k < bt_bodies_n_fields(b); k++) {
        const size_t size = bt_body_fields[k].size;
        char *old = *array_of(b, k), *new = bt_alloc_aligned((size_t)b->cap, size);
        for (size_t i = 0; i < n; i++) memcpy(new + i * size, old + (size_t)key[i].from * size, size);
        free(old);
        *array_of(b, k) = new;
    }
    int64_t *offset = bt_realloc(NULL, (size_t)b->cap + 1, sizeof *offset);
    offset[0] = 0;
    for (size_t i = 0; i < n; i++) offset[i + 1] = offset[i] + (b->offset[key[i].from + 1] - b->offset[key[i].from]);
    for (int k = 0; k < bt_n_vertex_fields; k++) {
        const size_t size = bt_vertex_fields[k].size;
        char **array = (char **)((char *)b + bt_vertex_fields[k].array),
             *new = bt_realloc(NULL, (size_t)b->cap_vertices, size);
        for (size_t i = 0; i < n; i++)
            memcpy(new + (size_t)offset[i] * size, *array + (size_t)b->offset[key[i].from] * size,
                   size * (size_t)(offset[i + 1] - offset[i]));
        free(*array);
        *array = new;
    }
    free(b->offset);
    b->offset = offset;
}

static void sort_bodies(bt_world *w)
{
    bt_bodies *b = &w->bodies;
    bt_cells *t = w->cells;
    sort_key *key = bt_alloc((size_t)b->n, sizeof *key);
    bool sorted = true;
    t->n_in_cells = 0;
    for (bt_idx i = 0; i < b->n; i++) {
        key[i] = (sort_key){INT64_MAX, b->gid[i], i};
        if (!b->large[i]) {
            key[i].cell = (int64_t)(b->cell[i][1] - t->low_y) * t->n_x + (b->cell[i][0] - t->low_x);
            t->n_in_cells++;
        }
        sorted = sorted && (i == 0 || by_cell(&key[i - 1], &key[i]) < 0);
    }
    if (!sorted) {
        qsort(key, (size_t)b->n, sizeof *key, by_cell);
        permute(b, key);
    }
    for (bt_idx i = 0; i < b->n; i++) b->index_of[b->gid[i]] = i;
    free(key);
}

// --- cells ---------------------------------------------------------------------------------------------------------

static bt_cell *new_cell(bt_cells *t, int32_t x, int32_t y)
{
    if (t->n == t->cap) {
        t->cap = t->cap ? t->cap + t->cap / 2 : 64;
        t->cell = bt_realloc(t->cell, (size_t)t->cap, sizeof *t->cell);
    }
    bt_cell *cell = &t->cell[t->n++];
    *cell = (bt_cell){.x = x, .y = y, .right = -1, .above = -1, .diagonal = -1};
    cell->phase = (int8_t)((x & 1) | (y & 1) << 1);
    return cell;
}

/// A cell for every place of the box that this rank owns or whose bodies it holds; the last one for the large bodies.
static void make_cells(bt_world *w)
{
    bt_cells *t = w->cells;
    const bt_bodies *b = &w->bodies;
    const int64_t n_at = (int64_t)t->n_x * t->n_y;
    if (n_at > t->cap_at) {
        t->cap_at = n_at;
        t->at = bt_realloc(t->at, (size_t)n_at, sizeof *t->at);
    }
    bt_idx i = 0;
    for (int32_t y = 0; y < t->n_y; y++)
        for (int32_t x = 0; x < t->n_x; x++) {
            const int32_t tx = x + t->low_x, ty = y + t->low_y;
            const bt_idx first = i;
            while (i < t->n_in_cells && b->cell[i][0] == tx && b->cell[i][1] == ty) i++;
            const bool own = !w->exchange || w->exchange->owns_cell(w, tx, ty);
            t->at[(int64_t)y * t->n_x + x] = own || i > first ? t->n : -1;
            if (!own && i == first) continue;
            bt_cell *cell = new_cell(t, tx, ty);
            cell->first = first;
            cell->end = i;
            cell->own = own;
        }
    assert(i == t->n_in_cells);
    for (bt_idx k = 0; k < t->n; k++) {
        bt_cell *cell = &t->cell[k];
        cell->right = bt_cells_at(t, cell->x + 1, cell->y);
        cell->above = bt_cells_at(t, cell->x, cell->y + 1);
        cell->diagonal = bt_cells_at(t, cell->x + 1, cell->y + 1);
    }
    bt_cell *large = new_cell(t, 0, 0);
    large->first = t->n_in_cells;
    large->end = b->n;
    large->phase = BT_COLOURS;
    large->own = !w->exchange || w->exchange->owns_large(w);
    const size_t n = (size_t)t->n;
    t->speed = bt_realloc(t->speed, n, sizeof *t->speed);
    t->bound = bt_realloc(t->bound, n, sizeof *t->bound);
    t->moved = bt_realloc(t->moved, n, sizeof *t->moved);
    t->asleep = bt_realloc(t->asleep, n, sizeof *t->asleep);
    t->awake = bt_realloc(t->awake, n, sizeof *t->awake);
    t->order = bt_realloc(t->order, n, sizeof *t->order);
    free(t->turn);
    t->turn = bt_alloc_aligned(n, sizeof *t->turn);
    t->n_passes = 0;
    t->busy = bt_realloc(t->busy, n, sizeof *t->busy);
    t->is_busy = bt_realloc(t->is_busy, n, sizeof *t->is_busy);
    for (size_t k = 0; k < n; k++) t->speed[k] = t->bound[k] = t->moved[k] = t->asleep[k] = t->awake[k] = 0;
    t->n_busy = 0;
    bt_cells_wake_all(t);
}

// --- what the contacts were ------------------------------------------------------------------------------------------

int bt_memory_by_names(const void *p, const void *q)
{
    const bt_memory *a = p, *b = q;
    if (a->a != b->a) return a->a < b->a ? -1 : 1;
    if (a->b != b->b) return a->b < b->b ? -1 : 1;
    if (a->part[0] != b->part[0]) return a->part[0] < b->part[0] ? -1 : 1;
    if (a->part[1] != b->part[1]) return a->part[1] < b->part[1] ? -1 : 1;
    return a->law - b->law;
}

void bt_cells_remember(bt_cell *t, const bt_memory *r)
{
    if (t->laws.n_memory == t->laws.cap_memory) {
        t->laws.cap_memory = t->laws.cap_memory ? 2 * t->laws.cap_memory : 8;
        t->laws.memory = bt_realloc(t->laws.memory, (size_t)t->laws.cap_memory, sizeof *t->laws.memory);
    }
    t->laws.memory[t->laws.n_memory++] = *r;
}

static bt_memory memory_of(const bt_gid *gid, const bt_cell *t, const bt_pair *p)
{
    const bt_contact *u = &t->contacts[p->contact];
    const bt_gaps *g = &t->gaps[p->contact];
    return (bt_memory){.a = gid[p->a], .b = gid[p->b], .part = {p->part[0], p->part[1]}, .n_points = u->n,
                      .feature = {g->feature[0], g->feature[1]}, .value = {u->ln[0], u->ln[1], u->lt}};
}

bt_memory *bt_cells_take_memory(const bt_world *w, int64_t *n)
{
    const bt_cells *t = w->cells;
    int64_t cap = 0;
    for (bt_idx k = 0; k < t->n; k++) {
        for (bt_idx i = 0; t->cell[k].own && i < t->cell[k].search.n_pairs; i++)
            cap += t->cell[k].search.pairs[i].contact >= 0;
        if (t->cell[k].own) cap += t->cell[k].laws.n_memory;
    }
    bt_memory *memory = bt_alloc((size_t)cap, sizeof *memory);
    *n = 0;
    for (bt_idx k = 0; k < t->n; k++) {
        const bt_cell *cell = &t->cell[k];
        for (bt_idx i = 0; cell->own && i < cell->laws.n_memory; i++) memory[(*n)++] = cell->laws.memory[i];
        for (bt_idx i = 0; cell->own && i < cell->search.n_pairs; i++)
            if (cell->search.pairs[i].contact >= 0)
                memory[(*n)++] = memory_of(w->bodies.gid, cell, &cell->search.pairs[i]);
    }
    return memory;
}

bt_idx bt_cells_of_pair(const bt_world *w, bt_idx a, bt_idx b)
{
    const bt_cells *t = w->cells;
    const bt_bodies *s = &w->bodies;
    const bool large_a = s->large[a], large_b = s->large[b];
    if ((large_a && s->motion[a] == BT_DYNAMIC) || (large_b && s->motion[b] == BT_DYNAMIC)) return t->n - 1;
    const bt_idx one = large_a ? b : a, other = large_b ? a : b;
    int32_t at[2];
    bt_cells_owner(t, s->cell[one], s->cell[other], at);
    return bt_cells_at(t, at[0], at[1]);
}

/// A pair that was in contact into the list of a cell that has had no detection yet.
static void put_pair(bt_cell *t, bt_idx a, bt_idx b, const bt_memory *r)
{
    bt_pair_search *s = &t->search;
    if (s->n_pairs == s->cap_pairs) {
        t->cap_contacts = s->cap_pairs = s->cap_pairs ? 2 * s->cap_pairs : 16;
        s->pairs = bt_realloc(s->pairs, (size_t)s->cap_pairs, sizeof *s->pairs);
        t->contacts = bt_realloc(t->contacts, (size_t)s->cap_pairs, sizeof *t->contacts); // not aligned: no room here
        t->gaps = bt_realloc(t->gaps, (size_t)s->cap_pairs, sizeof *t->gaps);
    }
    const bt_idx at = s->n_pairs++;
    s->pairs[at] = (bt_pair){.a = a, .b = b, .contact = at, .part = {r->part[0], r->part[1]},
                             .axes = BT_NO_AXES};
    t->contacts[at] = (bt_contact){.n = r->n_points, .ln = {r->value[0], r->value[1]}, .lt = r->value[2]};
    t->gaps[at] = (bt_gaps){.feature = {r->feature[0], r->feature[1]}};
}

/// Put memory, in any order, into empty cells.
static void put_memory(bt_world *w, bt_memory *memory, int64_t n)
{
    bt_cells *t = w->cells;
    if (n > 0) qsort(memory, (size_t)n, sizeof *memory, bt_memory_by_names);
    for (int64_t k = 0; k < n; k++) {
        const bt_idx a = bt_world_index(w, memory[k].a), b = bt_world_index(w, memory[k].b);
        // a floe that has shot so far away from a large body that its rank does not hold it any more
        if (a < 0 || b < 0) continue;
        bt_cell *cell = &t->cell[bt_cells_of_pair(w, a, b)];
        if (memory[k].law != 0) bt_cells_remember(cell, &memory[k]);
        else put_pair(cell, a, b, &memory[k]);
    }
}

static bool adjacent(int32_t p, int32_t q, int32_t n)
{
    const int32_t d = p < q ? q - p : p - q;
    return d <= 1 || n == 1 || (n > 1 && d == n - 1);
}

bool bt_cells_adjacent(const bt_cells *t, const int32_t p[2], const int32_t q[2])
{
    return adjacent(p[0], q[0], t->wrap_x) && adjacent(p[1], q[1], t->wrap_y);
}

/// Leave out what cannot touch under the new labels: floes that have shot apart within one step, by more than the
/// margin they had (the last solution may be one that did not converge). No cell has both in its block, and no rank may
/// hold both.
static void drop_parted(const bt_world *w, bt_memory *memory, int64_t *n)
{
    const bt_bodies *b = &w->bodies;
    int64_t kept = 0;
    for (int64_t k = 0; k < *n; k++) {
        const bt_idx i = bt_world_index(w, memory[k].a), j = bt_world_index(w, memory[k].b);
        const bool one_large = b->large[i] || b->large[j];
        if (one_large || bt_cells_adjacent(w->cells, b->cell[i], b->cell[j])) memory[kept++] = memory[k];
    }
    *n = kept;
}

/// Bodies to their ranks and places under the labels they have, and cells around them with this memory, which is
/// released.
static void place(bt_world *w, bt_memory *memory, int64_t n)
{
    bt_cells *t = w->cells;
    for (bt_idx k = 0; k < t->n; k++) free_cell(&t->cell[k]);
    t->n = 0;
    if (w->exchange) memory = w->exchange->migrate(w, memory, &n);
    sort_bodies(w);
    make_cells(w);
    put_memory(w, memory, n);
    if (w->exchange) w->exchange->connect(w);
    free(memory);
    t->labelled = true;
}

/// New cells and labels, for this memory, which is released.
static void renew(bt_world *w, double margin, bt_memory *memory, int64_t n)
{
    choose(w, margin);
    label(w);
    w->cells->n_labellings++;
    drop_parted(w, memory, &n);
    place(w, memory, n);
    w->cells->relabel = false;
}

static void relabel(bt_world *w, double margin)
{
    int64_t n;
    bt_memory *memory = bt_cells_take_memory(w, &n);
    renew(w, margin, memory, n);
}

/// New owners of the cells there are.
static void hand_on(bt_world *w)
{
    int64_t n;
    bt_memory *memory = bt_cells_take_memory(w, &n);
    place(w, memory, n);
    w->cells->relabel = false;
}

void bt_cells_change(bt_world *w, bt_bodies_change *change, const void *context)
{
    int64_t n;
    bt_memory *memory = bt_cells_take_memory(w, &n);
    memory = change(w, memory, &n, context);
    renew(w, w->par.slop, memory, n);
}

void bt_cells_restore(bt_world *w, bt_memory *memory, int64_t n) { place(w, memory, n); }

void bt_cells_begin(bt_world *w)
{
    bt_cells *t = w->cells;
    if (!t->labelled || t->relabel) {
        if (w->towed >= 0) w->bodies.large[bt_world_towed(w)] = 1; // it has a place of its own, whatever its size
        relabel(w, w->par.slop);
    } else if (w->exchange && w->exchange->due(w)) {
        hand_on(w);
    }
    t->still = w->par.water_u == 0 && w->par.water_v == 0;
    if (!t->still) bt_cells_wake_all(t);
}

bool bt_cells_update(bt_world *w, double margin)
{
    if (margin <= w->cells->margin_max) return false;
    relabel(w, margin);
    return true;
}
