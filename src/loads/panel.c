// SPDX-License-Identifier: MIT
// Position of a point on the waterline, and sums of load by panel; see loads/panel.h.
#include "loads/panel.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "bergtow/stats.h"
#include "base/elementary.h"
#include "case/cost.h"

static const double *vertex(const bt_panels *panels, int i)
{
    return panels->outline + 2 * (i < panels->n_vertices ? i : i - panels->n_vertices);
}

/// Length along the waterline of the point nearest to (x, y), m, and not quite at the end of an edge: a panel may end
/// there. Of edges equally near, the one that the load presses on most squarely.
static double nearest(const bt_panels *panels, double x, double y, double nx, double ny)
{
    const double END = 1e-9; // of an edge, and of the waterline
    const double same = END * panels->arc[panels->n_vertices];
    double best = INFINITY, fit = 0, at = 0;
    for (int i = 0; i < panels->n_vertices; i++) {
        const double *a = vertex(panels, i), *b = vertex(panels, i + 1);
        const double ex = b[0] - a[0], ey = b[1] - a[1], length = panels->arc[i + 1] - panels->arc[i];
        const double t = bt_min(1 - END, bt_max(END, ((x - a[0]) * ex + (y - a[1]) * ey) / (ex * ex + ey * ey)));
        const double d = bt_hypot(x - a[0] - t * ex, y - a[1] - t * ey), square = (ex * ny - ey * nx) / length;
        if (d > best + same || (d > best - same && !(square > fit))) continue;
        best = bt_min(best, d), fit = square;
        at = panels->arc[i] + t * length;
    }
    return at;
}

/// Position where the ray along +x leaves the waterline: the centroid is inside and the outline convex, so exactly one
/// edge crosses the ray upwards.
static double bow_of(const bt_panels *panels)
{
    for (int i = 0; i < panels->n_vertices; i++) {
        const double *a = vertex(panels, i), *b = vertex(panels, i + 1);
        if (!(a[1] <= 0 && b[1] > 0)) continue;
        const double t = -a[1] / (b[1] - a[1]);
        if (a[0] + t * (b[0] - a[0]) > 0) return panels->arc[i] + t * (panels->arc[i + 1] - panels->arc[i]);
    }
    return 0;
}

void bt_panels_init(bt_panels *panels, int n, int n_vertices, const double *outline)
{
    *panels = (bt_panels){.n = n, .n_vertices = n_vertices};
    panels->outline = bt_alloc(2 * (size_t)n_vertices, sizeof *panels->outline);
    memcpy(panels->outline, outline, 2 * (size_t)n_vertices * sizeof *panels->outline);
    panels->arc = bt_alloc((size_t)n_vertices + 1, sizeof *panels->arc);
    for (int i = 0; i < n_vertices; i++) {
        const double *a = vertex(panels, i), *b = vertex(panels, i + 1);
        panels->arc[i + 1] = panels->arc[i] + bt_hypot(b[0] - a[0], b[1] - a[1]);
    }
    panels->bow = bow_of(panels);
    panels->panel = bt_alloc((size_t)n, sizeof *panels->panel);
}

void bt_panels_free(bt_panels *panels)
{
    free(panels->outline);
    free(panels->arc);
    free(panels->panel);
    *panels = (bt_panels){0};
}

int bt_panels_at(const bt_panels *panels, double x, double y, double nx, double ny)
{
    // Panel 0 begins half a panel before the bow.
    const double around = panels->arc[panels->n_vertices];
    double s = (nearest(panels, x, y, nx, ny) - panels->bow) / around * panels->n + 0.5;
    s -= panels->n * floor(s / panels->n);
    const int k = (int)s;
    return k < panels->n ? k : 0;
}

void bt_panels_point(const bt_panels *panels, double s, double xy[2], double normal[2])
{
    const double around = panels->arc[panels->n_vertices];
    double at = panels->bow + (s - 0.5) / panels->n * around;
    at -= around * floor(at / around);
    int i = 0;
    while (i < panels->n_vertices - 1 && panels->arc[i + 1] <= at) i++;
    const double *a = vertex(panels, i), *b = vertex(panels, i + 1), length = panels->arc[i + 1] - panels->arc[i],
                 t = (at - panels->arc[i]) / length;
    xy[0] = a[0] + t * (b[0] - a[0]);
    xy[1] = a[1] + t * (b[1] - a[1]);
    if (!normal) return;
    normal[0] = (b[1] - a[1]) / length;
    normal[1] = (a[0] - b[0]) / length;
}

void bt_panels_clear(bt_panels *panels)
{
    for (int k = 0; k < panels->n; k++) panels->panel[k].fx = panels->panel[k].fy = panels->panel[k].normal = 0;
}

void bt_panels_load(bt_panels *panels, const bt_point_load *load)
{
    bt_panel *panel = &panels->panel[bt_panels_at(panels, load->x, load->y, load->nx, load->ny)];
    panel->normal += load->normal;
    panel->fx += load->fx;
    panel->fy += load->fy;
}

// --- blocks of steps -------------------------------------------------------------------------------------------------

_Static_assert(sizeof(bt_panel_loads) == BT_COST_PANEL_BYTES, "what check says of memory and disk counts them");

static void add(bt_panel_loads *to, const bt_panel_loads *loads)
{
    to->fx += loads->fx;
    to->fy += loads->fy;
    to->normal += loads->normal;
    to->most = bt_max(to->most, loads->most);
}

static int64_t blocks_after(int64_t steps)
{
    const int64_t length = bt_stats_start_step(steps);
    return 1 + (steps + length - 1) / length;
}

int64_t bt_panel_blocks_rows(const bt_panel_blocks *blocks, int64_t steps) { return blocks_after(steps) * blocks->n; }

static bt_panel_loads *row(const bt_panel_blocks *blocks, int64_t block) { return blocks->load + block * blocks->n; }

static void clear(bt_panel_blocks *blocks, int64_t from, int64_t to)
{
    memset(row(blocks, from), 0, (size_t)((to - from) * blocks->n) * sizeof *blocks->load);
}

/// Make room for at least this many blocks; new ones have no load.
static void reserve(bt_panel_blocks *b, int64_t blocks)
{
    if (blocks <= b->cap) return;
    const int64_t had = b->cap;
    b->cap = blocks <= BT_STATS_STARTS / 2 ? 2 * blocks : 1 + BT_STATS_STARTS;
    b->load = bt_realloc(b->load, (size_t)(b->cap * b->n), sizeof *b->load);
    clear(b, had, b->cap);
}

void bt_panel_blocks_init(bt_panel_blocks *blocks, int n)
{
    *blocks = (bt_panel_blocks){.n = n};
    reserve(blocks, 1);
}

void bt_panel_blocks_free(bt_panel_blocks *blocks)
{
    free(blocks->load);
    *blocks = (bt_panel_blocks){0};
}

void bt_panel_blocks_restore(bt_panel_blocks *blocks, int64_t steps, bt_panel_loads *load)
{
    free(blocks->load);
    blocks->steps = steps;
    blocks->load = load;
    blocks->cap = blocks_after(blocks->steps);
}

_Static_assert(BT_STATS_STARTS % 2 == 0, "full blocks go in pairs");

/// Merge blocks 2k − 1 and 2k into block k.
static void merge_pairs(bt_panel_blocks *blocks)
{
    for (int64_t to = 1; to <= BT_STATS_STARTS / 2; to++) {
        memmove(row(blocks, to), row(blocks, 2 * to - 1), (size_t)blocks->n * sizeof *blocks->load);
        for (int k = 0; k < blocks->n; k++) add(row(blocks, to) + k, row(blocks, 2 * to) + k);
    }
    clear(blocks, 1 + BT_STATS_STARTS / 2, 1 + BT_STATS_STARTS);
}

void bt_panel_blocks_add(bt_panel_blocks *blocks, const bt_panel *panel, bool early)
{
    if (!early) {
        if (bt_stats_start_step(blocks->steps + 1) > bt_stats_start_step(blocks->steps)) merge_pairs(blocks);
        blocks->steps++;
        reserve(blocks, blocks_after(blocks->steps));
    }
    bt_panel_loads *to = row(blocks, early ? 0 : blocks_after(blocks->steps) - 1);
    for (int k = 0; k < blocks->n; k++)
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
