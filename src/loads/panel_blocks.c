// SPDX-License-Identifier: MIT
// Blocks of panel loads between the possible starts of the window; see panel_blocks.h.
#include "loads/panel_blocks.h"
#include "case/cost.h"

#include <stdlib.h>
#include <string.h>

#include "bergtow/stats.h"

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
