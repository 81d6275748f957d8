// SPDX-License-Identifier: MIT
// Broad phase: the list of pairs near enough to be looked at, kept over many steps.
//
// Small bodies are sorted into square cells no smaller than the largest of them plus the clearance, so that
// partners stand in the 3×3 cells around. A large body (flag `large`: berg, walls) is kept out of the cells and
// meets every small body in the cells under its box. The list holds for as long as no body has travelled
// (path of its fastest point) farther than its share of the clearance; then it is built anew.
#include "pairs.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

typedef struct {
    double x0, y0, size_x, size_y; ///< of a cell
    bt_idx nx, ny;
    bool wrap_x, wrap_y;
} grid;

static void update_box(const bt_bodies *b, bt_idx i, double box[4])
{
    box[0] = box[1] = INFINITY;
    box[2] = box[3] = -INFINITY;
    for (int64_t k = b->offset[i]; k < b->offset[i + 1]; k++) {
        const double *v = b->outline + 2 * k;
        box[0] = bt_min(box[0], v[0]);
        box[1] = bt_min(box[1], v[1]);
        box[2] = bt_max(box[2], v[0]);
        box[3] = bt_max(box[3], v[1]);
    }
}

/// Do the boxes of a and b come within `clearance`? With periodic images a long wall can reach round: its box is
/// compared at the nearest image of the centroids, which holds for bodies shorter than half a period, and for
/// walls that span the whole period.
static bool boxes_near(const bt_world *w, const double *box, bt_idx a, bt_idx b, double clearance)
{
    double d[2];
    bt_world_offset(w, a, b, d);
    const double *p = box + 4 * (size_t)a, *q = box + 4 * (size_t)b;
    return q[0] + d[0] - p[2] <= clearance && p[0] - q[2] - d[0] <= clearance && q[1] + d[1] - p[3] <= clearance &&
           p[1] - q[3] - d[1] <= clearance;
}

static bt_idx cell_along(double x, double x0, double size, bt_idx n, bool wrap)
{
    double c = floor((x - x0) / size);
    if (wrap) {
        c -= floor(c / n) * n;
        return (bt_idx)bt_min(c, n - 1);
    }
    return (bt_idx)bt_max(0, bt_min(c, n - 1)); // clamping is monotone: neighbours stay neighbours
}

static grid make_grid(const bt_world *w, double clearance)
{
    const bt_bodies *b = &w->bodies;
    double low_x = INFINITY, low_y = INFINITY, high_x = -INFINITY, high_y = -INFINITY, reach = 0;
    for (bt_idx i = 0; i < b->n; i++) {
        if (b->large[i]) continue;
        low_x = bt_min(low_x, b->pose[i].x);
        low_y = bt_min(low_y, b->pose[i].y);
        high_x = bt_max(high_x, b->pose[i].x);
        high_y = bt_max(high_y, b->pose[i].y);
        reach = bt_max(reach, b->radius[i]);
    }
    double cell = 2 * reach + clearance;
    grid g = {.x0 = low_x, .y0 = low_y, .wrap_x = w->par.period_x > 0, .wrap_y = w->par.period_y > 0};
    double lx = high_x - low_x, ly = high_y - low_y;
    if (!(lx >= 0)) return (grid){.size_x = 1, .size_y = 1, .nx = 1, .ny = 1}; // no small body at all
    if (g.wrap_x) g.x0 = w->par.x0, lx = w->par.period_x;
    if (g.wrap_y) g.y0 = w->par.y0, ly = w->par.period_y;
    // A body far out must not ask for memory: at most 4 cells a body, by larger cells.
    double limit = 4.0 * b->n + 64;
    if ((lx / cell + 1) * (ly / cell + 1) > limit) cell = bt_max(cell, bt_max(sqrt(lx * ly / limit) * 1.1, bt_max(lx, ly) / limit * 2));
    double nx = g.wrap_x ? floor(lx / cell) : floor(lx / cell) + 1, ny = g.wrap_y ? floor(ly / cell) : floor(ly / cell) + 1;
    if (g.wrap_x && nx < 3) nx = 1, g.wrap_x = false; // fewer than three: the 3×3 block would meet a cell twice
    if (g.wrap_y && ny < 3) ny = 1, g.wrap_y = false;
    g.nx = (bt_idx)bt_max(nx, 1);
    g.ny = (bt_idx)bt_max(ny, 1);
    g.size_x = w->par.period_x > 0 ? lx / g.nx : cell;
    g.size_y = w->par.period_y > 0 ? ly / g.ny : cell;
    return g;
}

static void sort_into_cells(bt_world *w, const grid *g)
{
    const bt_bodies *b = &w->bodies;
    bt_contacts *c = w->contacts;
    int64_t n_cells = (int64_t)g->nx * g->ny;
    if (n_cells + 1 > c->cap_cells) {
        c->cap_cells = n_cells + 1;
        c->cell_start = bt_realloc(c->cell_start, (size_t)c->cap_cells, sizeof *c->cell_start);
    }
    memset(c->cell_start, 0, (size_t)(n_cells + 1) * sizeof *c->cell_start);
    for (bt_idx i = 0; i < b->n; i++) {
        if (b->large[i]) continue;
        bt_idx cx = cell_along(b->pose[i].x, g->x0, g->size_x, g->nx, g->wrap_x);
        bt_idx cy = cell_along(b->pose[i].y, g->y0, g->size_y, g->ny, g->wrap_y);
        c->cell_of[i] = cy * g->nx + cx;
        c->cell_start[c->cell_of[i] + 1]++;
    }
    for (int64_t k = 0; k < n_cells; k++) c->cell_start[k + 1] += c->cell_start[k];
    for (bt_idx i = b->n - 1; i >= 0; i--) { // backwards: within a cell bodies stand in the order of their ids
        if (b->large[i]) continue;
        c->cell_item[--c->cell_start[c->cell_of[i] + 1]] = i;
    }
    // Filling moved every start one cell down: cell k now begins at cell_start[k + 1].
}

static inline bt_idx cell_begin(const bt_contacts *c, bt_idx cell) { return c->cell_start[cell + 1]; }
static inline bt_idx cell_end(const bt_contacts *c, bt_idx cell, bt_idx n_cells, bt_idx n_small)
{
    return cell + 2 <= n_cells ? c->cell_start[cell + 2] : n_small;
}

/// First and last cell (unwrapped) that an interval covers, with one cell of slack for bodies that moved in from beside.
static void cell_span(double low, double high, double x0, double size, bt_idx n, bool wrap, bt_idx *first, bt_idx *last)
{
    double a = floor((low - x0) / size), z = floor((high - x0) / size);
    if (!wrap) {
        *first = (bt_idx)bt_max(0, bt_min(a, n - 1));
        *last = (bt_idx)bt_max(0, bt_min(z, n - 1));
        return;
    }
    if (z - a + 1 >= n) a = 0, z = n - 1;
    *first = (bt_idx)a;
    *last = (bt_idx)z;
}

static inline bt_idx wrapped(bt_idx c, bt_idx n) { return ((c % n) + n) % n; }

static void push_large(bt_contacts *c, bt_idx low, bt_idx high, bt_idx *n_large_pairs)
{
    if (*n_large_pairs == c->cap_large) {
        c->cap_large = c->cap_large ? 2 * c->cap_large : 256;
        c->large_next = bt_realloc(c->large_next, (size_t)c->cap_large, sizeof *c->large_next);
        c->large_item = bt_realloc(c->large_item, (size_t)c->cap_large, sizeof *c->large_item);
    }
    bt_idx k = (*n_large_pairs)++;
    c->large_item[k] = high;
    c->large_next[k] = c->large_head[low];
    c->large_head[low] = k;
}

/// Pairs with a large body, as lists hung on the body with the lower index (= lower gid).
static void collect_large(bt_world *w, const grid *g, bt_idx n_small, double clearance)
{
    const bt_bodies *b = &w->bodies;
    bt_contacts *c = w->contacts;
    bt_idx n_pairs = 0, n_cells = g->nx * g->ny;
    for (bt_idx i = 0; i < b->n; i++) c->large_head[i] = -1;
    double reach = 0;
    for (bt_idx i = 0; i < b->n; i++)
        if (!b->large[i]) reach = bt_max(reach, b->radius[i]);
    for (bt_idx l = 0; l < b->n; l++) {
        if (!b->large[l]) continue;
        for (bt_idx o = l + 1; o < b->n; o++)
            if (b->large[o] && (b->motion[l] == BT_DYNAMIC || b->motion[o] == BT_DYNAMIC) &&
                boxes_near(w, c->box, l, o, clearance))
                push_large(c, l, o, &n_pairs);
        if (n_small == 0) continue;
        const double *box = c->box + 4 * (size_t)l;
        const bt_pose *p = &b->pose[l];
        bt_idx x0, x1, y0, y1;
        double pad = clearance + reach;
        cell_span(p->x + box[0] - pad, p->x + box[2] + pad, g->x0, g->size_x, g->nx, g->wrap_x, &x0, &x1);
        cell_span(p->y + box[1] - pad, p->y + box[3] + pad, g->y0, g->size_y, g->ny, g->wrap_y, &y0, &y1);
        for (bt_idx cy = y0; cy <= y1; cy++)
            for (bt_idx cx = x0; cx <= x1; cx++) {
                bt_idx cell = wrapped(cy, g->ny) * g->nx + wrapped(cx, g->nx);
                for (bt_idx k = cell_begin(c, cell); k < cell_end(c, cell, n_cells, n_small); k++) {
                    bt_idx s = c->cell_item[k];
                    if (b->motion[s] != BT_DYNAMIC && b->motion[l] != BT_DYNAMIC) continue;
                    if (boxes_near(w, c->box, s, l, clearance)) push_large(c, s < l ? s : l, s < l ? l : s, &n_pairs);
                }
            }
    }
}

static void append_pair(bt_contacts *c, bt_idx a, bt_idx b)
{
    if (c->n_pairs == c->cap_pairs) {
        c->cap_pairs = c->cap_pairs ? c->cap_pairs + c->cap_pairs / 2 : 1024;
        c->pairs = bt_realloc(c->pairs, (size_t)c->cap_pairs, sizeof *c->pairs);
    }
    c->pairs[c->n_pairs++] = (bt_pair){.a = a, .b = b, .man = -1, .axis = -1, .reach = -INFINITY};
}

/// What the old list knew of the pairs that stay: both lists are sorted, one walk matches them.
static void carry_over(bt_contacts *c, bt_idx n_before)
{
    bt_idx k = 0;
    for (bt_idx i = 0; i < c->n_pairs; i++) {
        bt_pair *p = &c->pairs[i];
        while (k < n_before && (c->pairs_before[k].a < p->a || (c->pairs_before[k].a == p->a && c->pairs_before[k].b < p->b))) k++;
        if (k < n_before && c->pairs_before[k].a == p->a && c->pairs_before[k].b == p->b) *p = c->pairs_before[k];
    }
}

static void build(bt_world *w, double margin)
{
    const bt_bodies *b = &w->bodies;
    bt_contacts *c = w->contacts;
    if (b->n > c->cap_bodies) {
        size_t n = (size_t)b->n;
        c->cap_bodies = b->n;
        c->path_built = bt_realloc(c->path_built, n, sizeof *c->path_built);
        c->box = bt_realloc(c->box, 4 * n, sizeof *c->box);
        c->cell_of = bt_realloc(c->cell_of, n, sizeof *c->cell_of);
        c->cell_item = bt_realloc(c->cell_item, n, sizeof *c->cell_item);
        c->large_head = bt_realloc(c->large_head, n, sizeof *c->large_head);
    }
    c->skin = 0.2 * w->par.size;
    c->skin_large = 1.0 * w->par.size;
    c->margin_built = margin;

    bt_idx n_small = 0;
    for (bt_idx i = 0; i < b->n; i++) {
        c->path_built[i] = b->path[i];
        update_box(b, i, c->box + 4 * (size_t)i);
        n_small += !b->large[i];
    }
    const double near_small = margin + c->skin, near_large = margin + 0.5 * c->skin + c->skin_large;
    const grid g = make_grid(w, near_small);
    sort_into_cells(w, &g);
    collect_large(w, &g, n_small, near_large);

    bt_pair *swap = c->pairs_before;
    bt_idx swap_cap = c->cap_pairs_before, n_before = c->n_pairs;
    c->pairs_before = c->pairs, c->cap_pairs_before = c->cap_pairs;
    c->pairs = swap, c->cap_pairs = swap_cap, c->n_pairs = 0;

    const bt_idx n_cells = g.nx * g.ny;
    for (bt_idx a = 0; a < b->n; a++) {
        bt_idx first = c->n_pairs;
        if (!b->large[a]) {
            bt_idx ax = c->cell_of[a] % g.nx, ay = c->cell_of[a] / g.nx;
            for (bt_idx dy = -1; dy <= 1; dy++) {
                bt_idx cy = ay + dy;
                if (g.wrap_y) cy = wrapped(cy, g.ny);
                else if (cy < 0 || cy >= g.ny) continue;
                for (bt_idx dx = -1; dx <= 1; dx++) {
                    bt_idx cx = ax + dx;
                    if (g.wrap_x) cx = wrapped(cx, g.nx);
                    else if (cx < 0 || cx >= g.nx) continue;
                    bt_idx cell = cy * g.nx + cx;
                    for (bt_idx k = cell_begin(c, cell); k < cell_end(c, cell, n_cells, n_small); k++) {
                        bt_idx o = c->cell_item[k];
                        if (o <= a || (b->motion[a] != BT_DYNAMIC && b->motion[o] != BT_DYNAMIC)) continue;
                        if (boxes_near(w, c->box, a, o, near_small)) append_pair(c, a, o);
                    }
                }
            }
        }
        for (bt_idx k = c->large_head[a]; k >= 0; k = c->large_next[k]) append_pair(c, a, c->large_item[k]);
        for (bt_idx i = first + 1; i < c->n_pairs; i++) { // a dozen partners: insertion sort
            bt_pair p = c->pairs[i];
            bt_idx j = i;
            for (; j > first && c->pairs[j - 1].b > p.b; j--) c->pairs[j] = c->pairs[j - 1];
            c->pairs[j] = p;
        }
    }
    carry_over(c, n_before);
    c->built = true;
    c->n_builds++;
}

void bt_pairs_update(bt_world *w, double margin)
{
    bt_contacts *c = w->contacts;
    const bt_bodies *b = &w->bodies;
    bool stale = !c->built || margin > c->margin_built;
    // Allowances: two small bodies close in by at most skin/2 each; a large one may use skin_large by itself.
    for (bt_idx i = 0; !stale && i < b->n; i++)
        stale = b->path[i] - c->path_built[i] > (b->large[i] ? 0.5 * c->skin_large : 0.5 * c->skin);
    if (stale) build(w, margin);
}
