// SPDX-License-Identifier: MIT
// Labels of the floes, storage in the order of the cells, and the array of cells; see space/cells.h.
#include "space/cells.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/elementary.h"
#include "base/inside.h"
#include "base/named.h"
#include "body/bodies.h"
#include "space/exchange.h"

double bt_margin_most(const bt_world *world) { return 16 * world->par.size; }

// Contacts make floes faster within the step. With a fifth more than the speeds before the solve, the margin nearly
// always holds for the solution: 300 steps of full-scale tows in 80 and 90 % ice take a sixth fewer updates. Two fifths
// save no more and add a tenth to the time of detection. Plain sweeps, the reference, have no such allowance: fields
// are shaken with them, and must keep their bits.
#define FASTER 1.2

/// A distance, m, rounded up to a power of √2, between the slop and the largest margin.
static double round_up(const bt_world *world, double least)
{
    if (!(least < bt_margin_most(world)) && world->par.size > 0) return bt_margin_most(world);
    if (!(least > world->par.slop)) return world->par.slop;
    const int k = bt_ceil_2log2(least); // 2^(k/2)
    return ldexp(k & 1 ? 0.70710678118654752440 : 1, (k + (k & 1)) / 2);
}

double bt_margin_for(const bt_world *world, double s)
{
    return round_up(world, (world->par.plain_sweeps ? 1 : FASTER) * (2 * world->par.dt * s));
}

bool bt_margin_holds(const bt_world *world, double margin, double s)
{
    return round_up(world, 2 * world->par.dt * s) <= margin;
}

// --- the cells -------------------------------------------------------------------------------------------------------

#define CELL_DIAMETERS 5.0 // least side of a cell by default, in mean floe diameters: 25 floes at 80 %; assumed

bt_cells *bt_cells_create(void) { return bt_alloc(1, sizeof(bt_cells)); }

void bt_cells_forget_pairs(bt_cell *cell)
{
    free(cell->search.pairs);
    free(cell->search.near);
    cell->search = (bt_pair_search){0};
}

void bt_cells_free(bt_cells *cells)
{
    if (!cells) return;
    void *arrays[] = {cells->at,   cells->speed,   cells->bound, cells->moved, cells->asleep, cells->awake,
                      cells->busy, cells->is_busy, cells->order, cells->turn,  cells->share,  cells->swept,
                      cells->cell, cells};
    for (size_t i = 0; i < sizeof arrays / sizeof *arrays; i++) free(arrays[i]);
}

/// Lower of two adjacent coordinates, around a periodic direction of n cells.
static int32_t lower(int32_t p, int32_t q, int32_t n)
{
    if (n > 1) return p == q || bt_cells_wrapped(p + 1, n) == q ? p : q;
    return p < q ? p : q;
}

void bt_cells_owner(const bt_cells *cells, const int32_t p[2], const int32_t q[2], int32_t out[2])
{
    out[0] = lower(p[0], q[0], cells->wrap_x);
    out[1] = lower(p[1], q[1], cells->wrap_y);
}

// --- busy cells ------------------------------------------------------------------------------------------------------

void bt_cells_wake(bt_cells *cells, bt_idx k)
{
    if (cells->is_busy[k]) return;
    cells->is_busy[k] = 1;
    cells->busy_sorted = false;
    cells->busy[cells->n_busy++] = k;
}

void bt_cells_wake_all(bt_cells *cells)
{
    if (cells->n_busy == cells->n) return;
    for (bt_idx k = 0; k < cells->n; k++) {
        cells->busy[k] = k;
        cells->is_busy[k] = 1;
    }
    cells->n_busy = cells->n;
    cells->busy_sorted = true;
}

static int ascending(const void *p, const void *q)
{
    const bt_idx a = *(const bt_idx *)p, b = *(const bt_idx *)q;
    return (a > b) - (a < b);
}

void bt_cells_sort_busy(bt_cells *cells)
{
    if (!cells->busy_sorted) qsort(cells->busy, (size_t)cells->n_busy, sizeof *cells->busy, ascending);
    cells->busy_sorted = true;
}

void bt_cells_leave(bt_cells *cells)
{
    if (!cells->still) return;
    bt_idx kept = 0;
    for (bt_idx i = 0; i < cells->n_busy; i++) {
        const bt_idx k = cells->busy[i];
        if (k == cells->n - 1 || cells->asleep[k] != BT_ASLEEP || cells->awake[k] || cells->bound[k] > 0) {
            cells->busy[kept++] = k;
        } else {
            cells->is_busy[k] = 0;
            cells->cell[k].swept = false; // as after a residual pass: nothing here is extrapolated
        }
    }
    cells->n_busy = kept;
}

double bt_cells_outside(const bt_world *world, bt_idx i)
{
    const bt_cells *cells = world->cells;
    double out = 0;
    if (cells->wrap_x != 1) {
        const double middle = cells->x0 + (world->bodies.cell[i][0] + 0.5) * cells->side_x;
        out = bt_max(out, fabs(bt_nearest_image(world->bodies.pose[i].x - middle, world->par.period_x)) -
                     0.5 * cells->side_x);
    }
    if (cells->wrap_y != 1) {
        const double middle = cells->y0 + (world->bodies.cell[i][1] + 0.5) * cells->side_y;
        out = bt_max(out, fabs(bt_nearest_image(world->bodies.pose[i].y - middle, world->par.period_y)) -
                     0.5 * cells->side_y);
    }
    return out;
}

/// Side of the cells along one direction. Around a period their number is even, or equal colours would meet at the
/// seam; with fewer than four the block of a cell would meet itself, so one cell takes the whole period.
static double side_along(double side, double period, int32_t *wrap)
{
    *wrap = 0;
    if (!(period > 0)) return side;
    const double n = 2 * floor(period / (2 * side));
    *wrap = n >= 4 ? (int32_t)bt_min(n, 1 << 30) : 1;
    return period / *wrap;
}

/// Floor of the coordinate in cells, limited to 32 bits; a body with a NaN pose goes to cell 0, and the run reports it.
static int32_t coordinate(double x, double x0, double side, int32_t wrap)
{
    if (wrap == 1) return 0;
    const double c = floor((x - x0) / side);
    if (wrap) return (int32_t)bt_max(0, bt_min(wrap - 1, c - floor(c / wrap) * wrap));
    return isfinite(c) ? (int32_t)bt_max(-1e9, bt_min(1e9, c)) : 0;
}

static void choose_cells(bt_world *world, double margin)
{
    bt_cells *cells = world->cells;
    const bt_bodies *bodies = &world->bodies;
    // Box of the floes [0..3], largest radius [4], mass [5], restitution [6] and speed [7], as maxima.
    double most[8] = {-INFINITY, -INFINITY, -INFINITY, -INFINITY, 0, 0, 0, 0};
    for (bt_idx i = 0; i < bodies->n; i++) {
        if (bodies->motion[i] == BT_DYNAMIC) most[5] = bt_max(most[5], bodies->mass[i]);
        most[6] = bt_max(most[6], bodies->restitution[i]);
        most[7] = bt_max(most[7], bt_bodies_speed(world, i, &bodies->vel[i]));
        if (bodies->large[i] || !isfinite(bodies->pose[i].x + bodies->pose[i].y)) continue;
        most[0] = bt_max(most[0], -bodies->pose[i].x);
        most[1] = bt_max(most[1], -bodies->pose[i].y);
        most[2] = bt_max(most[2], bodies->pose[i].x);
        most[3] = bt_max(most[3], bodies->pose[i].y);
        most[4] = bt_max(most[4], bodies->radius[i]);
    }
    if (world->exchange) world->exchange->maxima(world, most, 8);
    cells->max_radius = most[4];
    cells->heaviest = most[5];
    cells->rebounds = most[6] > 0;
    cells->margin_max = bt_max(2 * bt_max(margin, bt_margin_for(world, most[7])), 0.25 * world->par.size);
    const bool any = most[0] + most[2] >= 0;
    cells->x0 = world->par.x0 + (world->par.period_x > 0 ? 0 : world->drift_x);
    cells->y0 = world->par.y0 + (world->par.period_y > 0 ? 0 : world->drift_y);
    double side = bt_max((world->par.cell > 0 ? world->par.cell : CELL_DIAMETERS) * world->par.size,
                         2 * cells->max_radius + cells->margin_max + 0.5 * world->par.size);
    if (!(side > 0)) side = 1;
    for (;; side *= 2) { // a floe far out must not cost memory: larger cells, at most 4 per floe
        cells->side_x = side_along(side, world->par.period_x, &cells->wrap_x);
        cells->side_y = side_along(side, world->par.period_y, &cells->wrap_y);
        int32_t low[2] = {0, 0}, high[2] = {0, 0};
        if (any) {
            low[0] = cells->wrap_x ? 0 : coordinate(-most[0], cells->x0, cells->side_x, 0);
            low[1] = cells->wrap_y ? 0 : coordinate(-most[1], cells->y0, cells->side_y, 0);
            high[0] = cells->wrap_x ? cells->wrap_x - 1 : coordinate(most[2], cells->x0, cells->side_x, 0);
            high[1] = cells->wrap_y ? cells->wrap_y - 1 : coordinate(most[3], cells->y0, cells->side_y, 0);
        }
        const double n_x = (double)high[0] - low[0] + 1, n_y = (double)high[1] - low[1] + 1;
        if (n_x * n_y > 4 * (double)(bodies->n_global - bodies->n_kept) + 1024) continue;
        cells->low_x = low[0], cells->low_y = low[1];
        cells->n_x = (int32_t)n_x, cells->n_y = (int32_t)n_y;
        break;
    }
    // In a direction that one cell spans there are no neighbours, and centroids may lie anywhere.
    double slack = INFINITY;
    if (cells->wrap_x != 1) slack = bt_min(slack, cells->side_x - 2 * cells->max_radius - cells->margin_max);
    if (cells->wrap_y != 1) slack = bt_min(slack, cells->side_y - 2 * cells->max_radius - cells->margin_max);
    cells->allowance = 0.5 * slack;
}

/// Clamp to the box of the floes, outside which only a NaN pose lies.
static int32_t within(int32_t c, int32_t low, int32_t n) { return c < low ? low : c >= low + n ? low + n - 1 : c; }

void bt_cells_choose(bt_world *world, double margin)
{
    choose_cells(world, margin);
    const bt_cells *cells = world->cells;
    bt_bodies *bodies = &world->bodies;
    for (bt_idx i = 0; i < bodies->n; i++) {
        if (bodies->large[i]) continue;
        bodies->cell[i][0] = within(coordinate(bodies->pose[i].x, cells->x0, cells->side_x, cells->wrap_x),
                                    cells->low_x, cells->n_x);
        bodies->cell[i][1] = within(coordinate(bodies->pose[i].y, cells->y0, cells->side_y, cells->wrap_y),
                                    cells->low_y, cells->n_y);
    }
}

// --- storage -------------------------------------------------------------------------------------------------------

static void **array_of(bt_bodies *bodies, int k) { return (void **)((char *)bodies + bt_body_fields[k].array); }

/// Permute the bodies to the order of `name`, and their vertices, whose number varies, with them.
static void permute(bt_bodies *bodies, const bt_named *name)
{
    const size_t n = (size_t)bodies->n;
    for (int k = 0; k < bt_bodies_n_fields(bodies); k++) {
        const size_t size = bt_body_fields[k].size;
        char *old = *array_of(bodies, k), *new = bt_alloc_aligned((size_t)bodies->cap, size);
        for (size_t i = 0; i < n; i++) memcpy(new + i * size, old + (size_t)name[i].at * size, size);
        free(old);
        *array_of(bodies, k) = new;
    }
    int64_t *offset = bt_realloc(NULL, (size_t)bodies->cap + 1, sizeof *offset);
    offset[0] = 0;
    for (size_t i = 0; i < n; i++)
        offset[i + 1] = offset[i] + (bodies->offset[name[i].at + 1] - bodies->offset[name[i].at]);
    for (int k = 0; k < bt_n_vertex_fields; k++) {
        const size_t size = bt_vertex_fields[k].size;
        char **array = (char **)((char *)bodies + bt_vertex_fields[k].array),
             *new = bt_realloc(NULL, (size_t)bodies->cap_vertices, size);
        for (size_t i = 0; i < n; i++)
            memcpy(new + (size_t)offset[i] * size, *array + (size_t)bodies->offset[name[i].at] * size,
                   size * (size_t)(offset[i + 1] - offset[i]));
        free(*array);
        *array = new;
    }
    free(bodies->offset);
    bodies->offset = offset;
}

static void sort_bodies(bt_world *world)
{
    bt_bodies *bodies = &world->bodies;
    bt_cells *cells = world->cells;
    const size_t n = (size_t)bodies->n;
    bt_named *name = bt_realloc(NULL, 2 * n + 1, sizeof *name); // by cell, row by row and large bodies last, then id
    bool sorted = true;
    cells->n_in_cells = 0;
    for (bt_idx i = 0; i < bodies->n; i++) {
        name[i] = (bt_named){INT64_MAX, bodies->gid[i], 0, (uint32_t)i};
        if (!bodies->large[i]) {
            name[i].a = (int64_t)(bodies->cell[i][1] - cells->low_y) * cells->n_x +
                        (bodies->cell[i][0] - cells->low_x);
            cells->n_in_cells++;
        }
        sorted = sorted && (i == 0 || bt_named_before(&name[i - 1], &name[i]));
    }
    if (!sorted) {
        bt_named_sort(name, name + n, n);
        permute(bodies, name);
    }
    for (bt_idx i = 0; i < bodies->n; i++) bodies->index_of[bodies->gid[i]] = i;
    free(name);
}

// --- cells ---------------------------------------------------------------------------------------------------------

static bt_cell *new_cell(bt_cells *cells, int32_t x, int32_t y)
{
    if (cells->n == cells->cap) {
        cells->cap = cells->cap ? cells->cap + cells->cap / 2 : 64;
        cells->cell = bt_realloc(cells->cell, (size_t)cells->cap, sizeof *cells->cell);
    }
    bt_cell *cell = &cells->cell[cells->n++];
    *cell = (bt_cell){.x = x, .y = y, .right = -1, .above = -1, .diagonal = -1};
    cell->phase = (int8_t)((x & 1) | (y & 1) << 1);
    return cell;
}

/// Make a cell for every place of the box that this rank owns or whose bodies it holds; the last is for large bodies.
void bt_cells_make(bt_world *world)
{
    bt_cells *cells = world->cells;
    assert(cells->n == 0);
    sort_bodies(world);
    const bt_bodies *bodies = &world->bodies;
    const int64_t n_at = (int64_t)cells->n_x * cells->n_y;
    if (n_at > cells->cap_at) {
        cells->cap_at = n_at;
        cells->at = bt_realloc(cells->at, (size_t)n_at, sizeof *cells->at);
    }
    bt_idx i = 0;
    for (int32_t y = 0; y < cells->n_y; y++)
        for (int32_t x = 0; x < cells->n_x; x++) {
            const int32_t tx = x + cells->low_x, ty = y + cells->low_y;
            const bt_idx first = i;
            while (i < cells->n_in_cells && bodies->cell[i][0] == tx && bodies->cell[i][1] == ty) i++;
            const bool own = !world->exchange || world->exchange->owns_cell(world, tx, ty);
            cells->at[(int64_t)y * cells->n_x + x] = own || i > first ? cells->n : -1;
            if (!own && i == first) continue;
            bt_cell *cell = new_cell(cells, tx, ty);
            cell->first = first;
            cell->end = i;
            cell->own = own;
        }
    assert(i == cells->n_in_cells);
    for (bt_idx k = 0; k < cells->n; k++) {
        bt_cell *cell = &cells->cell[k];
        cell->right = bt_cells_at(cells, cell->x + 1, cell->y);
        cell->above = bt_cells_at(cells, cell->x, cell->y + 1);
        cell->diagonal = bt_cells_at(cells, cell->x + 1, cell->y + 1);
    }
    bt_cell *large = new_cell(cells, 0, 0);
    large->first = cells->n_in_cells;
    large->end = bodies->n;
    large->phase = BT_COLOURS;
    large->own = !world->exchange || world->exchange->owns_large(world);
    const size_t n = (size_t)cells->n;
    cells->speed = bt_realloc(cells->speed, n, sizeof *cells->speed);
    cells->bound = bt_realloc(cells->bound, n, sizeof *cells->bound);
    cells->moved = bt_realloc(cells->moved, n, sizeof *cells->moved);
    cells->asleep = bt_realloc(cells->asleep, n, sizeof *cells->asleep);
    cells->awake = bt_realloc(cells->awake, n, sizeof *cells->awake);
    cells->order = bt_realloc(cells->order, n, sizeof *cells->order);
    cells->swept = bt_realloc(cells->swept, n, sizeof *cells->swept);
    free(cells->turn);
    cells->turn = bt_alloc_aligned(n, sizeof *cells->turn);
    cells->n_passes = 0;
    cells->busy = bt_realloc(cells->busy, n, sizeof *cells->busy);
    cells->is_busy = bt_realloc(cells->is_busy, n, sizeof *cells->is_busy);
    for (size_t k = 0; k < n; k++)
        cells->speed[k] = cells->bound[k] = cells->moved[k] = cells->asleep[k] = cells->awake[k] = 0;
    cells->n_busy = 0;
    bt_cells_wake_all(cells);
}

bt_idx bt_cells_of_pair(const bt_world *world, bt_idx a, bt_idx b)
{
    const bt_cells *cells = world->cells;
    const bt_bodies *bodies = &world->bodies;
    const bool large_a = bodies->large[a], large_b = bodies->large[b];
    if ((large_a && bodies->motion[a] == BT_DYNAMIC) || (large_b && bodies->motion[b] == BT_DYNAMIC))
        return cells->n - 1;
    const bt_idx one = large_a ? b : a, other = large_b ? a : b;
    int32_t at[2];
    bt_cells_owner(cells, bodies->cell[one], bodies->cell[other], at);
    return bt_cells_at(cells, at[0], at[1]);
}

static bool adjacent(int32_t p, int32_t q, int32_t n)
{
    const int32_t d = p < q ? q - p : p - q;
    return d <= 1 || n == 1 || (n > 1 && d == n - 1);
}

bool bt_cells_adjacent(const bt_cells *cells, const int32_t p[2], const int32_t q[2])
{
    return adjacent(p[0], q[0], cells->wrap_x) && adjacent(p[1], q[1], cells->wrap_y);
}
