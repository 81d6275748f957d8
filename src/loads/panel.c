// SPDX-License-Identifier: MIT
// Where a point lies on the waterline, and sums of load by panel; see loads/panel.h.
#include "loads/panel.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "bergtow/stats.h"
#include "base/elementary.h"
#include "case/cost.h"

static const double *vertex(const bt_panels *p, int i)
{
    return p->outline + 2 * (i < p->n_vertices ? i : i - p->n_vertices);
}

/// Length along the waterline of the point nearest to (x, y), m.
static double nearest(const bt_panels *p, double x, double y)
{
    double best = INFINITY, at = 0;
    for (int i = 0; i < p->n_vertices; i++) {
        const double *a = vertex(p, i), *b = vertex(p, i + 1);
        const double ex = b[0] - a[0], ey = b[1] - a[1], length = p->arc[i + 1] - p->arc[i];
        const double t = bt_min(1, bt_max(0, ((x - a[0]) * ex + (y - a[1]) * ey) / (ex * ex + ey * ey)));
        const double dx = x - a[0] - t * ex, dy = y - a[1] - t * ey, d = dx * dx + dy * dy;
        if (d < best) {
            best = d;
            at = p->arc[i] + t * length;
        }
    }
    return at;
}

/// Where the ray along +x leaves the waterline: the centroid is inside and the outline convex, so one edge crosses it
/// upwards.
static double bow_of(const bt_panels *p)
{
    for (int i = 0; i < p->n_vertices; i++) {
        const double *a = vertex(p, i), *b = vertex(p, i + 1);
        if (!(a[1] <= 0 && b[1] > 0)) continue;
        const double t = -a[1] / (b[1] - a[1]);
        if (a[0] + t * (b[0] - a[0]) > 0) return p->arc[i] + t * (p->arc[i + 1] - p->arc[i]);
    }
    return 0;
}

void bt_panels_init(bt_panels *p, int n, int n_vertices, const double *outline)
{
    *p = (bt_panels){.n = n, .n_vertices = n_vertices};
    p->outline = bt_alloc(2 * (size_t)n_vertices, sizeof *p->outline);
    memcpy(p->outline, outline, 2 * (size_t)n_vertices * sizeof *p->outline);
    p->arc = bt_alloc((size_t)n_vertices + 1, sizeof *p->arc);
    for (int i = 0; i < n_vertices; i++) {
        const double *a = vertex(p, i), *b = vertex(p, i + 1);
        p->arc[i + 1] = p->arc[i] + bt_hypot(b[0] - a[0], b[1] - a[1]);
    }
    p->bow = bow_of(p);
    p->panel = bt_alloc((size_t)n, sizeof *p->panel);
}

void bt_panels_free(bt_panels *p)
{
    free(p->outline);
    free(p->arc);
    free(p->panel);
    *p = (bt_panels){0};
}

int bt_panels_at(const bt_panels *p, double x, double y)
{
    // Half a panel before the bow begins panel 0.
    const double around = p->arc[p->n_vertices];
    double s = (nearest(p, x, y) - p->bow) / around * p->n + 0.5;
    s -= p->n * floor(s / p->n);
    const int k = (int)s;
    return k < p->n ? k : 0;
}

void bt_panels_point(const bt_panels *p, double s, double xy[2], double normal[2])
{
    const double around = p->arc[p->n_vertices];
    double at = p->bow + (s - 0.5) / p->n * around;
    at -= around * floor(at / around);
    int i = 0;
    while (i < p->n_vertices - 1 && p->arc[i + 1] <= at) i++;
    const double *a = vertex(p, i), *b = vertex(p, i + 1), length = p->arc[i + 1] - p->arc[i],
                 t = (at - p->arc[i]) / length;
    xy[0] = a[0] + t * (b[0] - a[0]);
    xy[1] = a[1] + t * (b[1] - a[1]);
    if (!normal) return;
    normal[0] = (b[1] - a[1]) / length;
    normal[1] = (a[0] - b[0]) / length;
}

void bt_panels_clear(bt_panels *p)
{
    for (int k = 0; k < p->n; k++) p->panel[k].fx = p->panel[k].fy = p->panel[k].normal = 0;
}

void bt_panels_load(bt_panels *p, double x, double y, double normal, double fx, double fy)
{
    bt_panel *k = &p->panel[bt_panels_at(p, x, y)];
    k->normal += normal;
    k->fx += fx;
    k->fy += fy;
}

// --- blocks of steps -------------------------------------------------------------------------------------------------

_Static_assert(sizeof(bt_panel_loads) == BT_COST_PANEL_BYTES, "what check says of memory and disk counts them");

static void add(bt_panel_loads *to, const bt_panel_loads *l)
{
    to->fx += l->fx;
    to->fy += l->fy;
    to->normal += l->normal;
    to->most = bt_max(to->most, l->most);
}

static int64_t blocks_after(int64_t steps)
{
    const int64_t length = bt_stats_start_step(steps);
    return 1 + (steps + length - 1) / length;
}

int64_t bt_panel_blocks_rows(const bt_panel_blocks *b, int64_t steps) { return blocks_after(steps) * b->n; }

static bt_panel_loads *row(const bt_panel_blocks *b, int64_t block) { return b->load + block * b->n; }

static void clear(bt_panel_blocks *b, int64_t from, int64_t to)
{
    memset(row(b, from), 0, (size_t)((to - from) * b->n) * sizeof *b->load);
}

/// Room for so many blocks at least; what is new bears no load.
static void reserve(bt_panel_blocks *b, int64_t blocks)
{
    if (blocks <= b->cap) return;
    const int64_t had = b->cap;
    b->cap = blocks <= BT_STATS_STARTS / 2 ? 2 * blocks : 1 + BT_STATS_STARTS;
    b->load = bt_realloc(b->load, (size_t)(b->cap * b->n), sizeof *b->load);
    clear(b, had, b->cap);
}

void bt_panel_blocks_init(bt_panel_blocks *b, int n)
{
    *b = (bt_panel_blocks){.n = n};
    reserve(b, 1);
}

void bt_panel_blocks_free(bt_panel_blocks *b)
{
    free(b->load);
    *b = (bt_panel_blocks){0};
}

void bt_panel_blocks_restore(bt_panel_blocks *b, int64_t steps, bt_panel_loads *load)
{
    free(b->load);
    b->steps = steps;
    b->load = load;
    b->cap = blocks_after(b->steps);
}

_Static_assert(BT_STATS_STARTS % 2 == 0, "full blocks go in pairs");

/// Blocks 2k − 1 and 2k become block k.
static void merge_pairs(bt_panel_blocks *b)
{
    for (int64_t to = 1; to <= BT_STATS_STARTS / 2; to++) {
        memmove(row(b, to), row(b, 2 * to - 1), (size_t)b->n * sizeof *b->load);
        for (int k = 0; k < b->n; k++) add(row(b, to) + k, row(b, 2 * to) + k);
    }
    clear(b, 1 + BT_STATS_STARTS / 2, 1 + BT_STATS_STARTS);
}

void bt_panel_blocks_add(bt_panel_blocks *b, const bt_panel *panel, bool early)
{
    if (!early) {
        if (bt_stats_start_step(b->steps + 1) > bt_stats_start_step(b->steps)) merge_pairs(b);
        b->steps++;
        reserve(b, blocks_after(b->steps));
    }
    bt_panel_loads *to = row(b, early ? 0 : blocks_after(b->steps) - 1);
    for (int k = 0; k < b->n; k++)
        add(&to[k], &(bt_panel_loads){panel[k].fx, panel[k].fy, panel[k].normal, panel[k].normal});
}

void bt_panel_blocks_reduce(const bt_panel_blocks *b, int64_t first, bt_panel_loads *before, bt_panel_loads *within)
{
    const int64_t blocks = blocks_after(b->steps),
                  start = first < b->steps ? 1 + first / bt_stats_start_step(b->steps) : blocks;
    memset(before, 0, (size_t)b->n * sizeof *before);
    memset(within, 0, (size_t)b->n * sizeof *within);
    for (int64_t i = 0; i < blocks; i++)
        for (int k = 0; k < b->n; k++) add(i < start ? &before[k] : &within[k], row(b, i) + k);
}
