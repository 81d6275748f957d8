// SPDX-License-Identifier: MIT
// Passes over the active cells by threads, overlapped with the exchange between ranks.
#include "space/phases.h"
#include "base/inside.h"

#include <omp.h>
#include <sched.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>

#include "space/exchange.h"
#include "tow/tow.h"

static void totals_merge(bt_totals *into, const bt_totals *from)
{
    for (int k = 0; k < into->n_sums; k++) bt_sum_join(&into->sum[k], &from->sum[k]);
    into->most = bt_max(into->most, from->most);
    into->most2 = bt_max(into->most2, from->most2);
}

// --- assignment of cells ---------------------------------------------------------------------------------------------

/// Has this rank work in cell k?
static bool has_work(const bt_world *world, bt_idx k)
{
    const bt_cells *cells = world->cells;
    return cells->cell[k].own && (cells->cell[k].n_contacts > 0 || (k == cells->n - 1 && bt_tow_has_line(world->tow)));
}

static bool is_listed(const bt_world *world, bt_idx k)
{
    return world->cells->cell[k].n_listed > 0 || (k == world->cells->n - 1 && bt_tow_has_line(world->tow));
}

/// Cost of a visit to cell k, in contacts. A cell itself costs something, too.
static int64_t cost_of(const bt_cells *cells, bt_idx k, bt_which which)
{
    enum { CELL = 4 };
    return CELL + (which == BT_LISTED ? cells->cell[k].n_listed : cells->cell[k].n_contacts);
}

/// Divide cells [begin, end) of the order into shares of equal work.
static void deal_stretch(bt_cells *cells, bt_which which, bt_idx begin, bt_idx end, bt_share *share)
{
    int64_t all = 0, before = 0;
    for (bt_idx i = begin; i < end; i++) all += cost_of(cells, cells->order[i], which);
    bt_idx i = begin;
    for (bt_idx s = 0; s < cells->n_shares; s++) {
        share[s].begin = i;
        for (; i < end && before * cells->n_shares < all * (s + 1); i++)
            before += cost_of(cells, cells->order[i], which);
        share[s].end = i;
    }
    share[cells->n_shares - 1].end = end;
}

/// Move the listed ones among n cells to the front, in unchanged order. Returns how many they are.
static bt_idx listed_first(const bt_world *world, bt_idx *cell, bt_idx n)
{
    bt_idx listed = 0;
    for (bt_idx i = 0; i < n; i++) {
        const bt_idx k = cell[i];
        if (!is_listed(world, k)) continue;
        memmove(cell + listed + 1, cell + listed, (size_t)(i - listed) * sizeof *cell);
        cell[listed++] = k;
    }
    return listed;
}

void bt_phases_distribute(bt_world *world)
{
    bt_cells *cells = world->cells;
    int64_t listed = 0;
    for (bt_idx i = 0; i < cells->n_order; i++) listed += cells->cell[cells->order[i]].n_listed;
    const bt_idx n = BT_MANY(listed, BT_FEW_CONTACTS) ? omp_get_max_threads() : 1;
    if (n > cells->cap_shares) {
        free(cells->share);
        cells->share = bt_alloc_aligned(2 * BT_STRETCHES * (size_t)n, sizeof *cells->share);
        cells->cap_shares = n;
    }
    cells->n_shares = n;
    for (int s = 0; s < BT_STRETCHES; s++) {
        const bt_idx first = cells->start[s / 2], middle = first + cells->n_border[s / 2],
                     begin = s % 2 ? middle : first, end = s % 2 ? cells->start[s / 2 + 1] : middle;
        const bt_idx n_listed = listed_first(world, cells->order + begin, end - begin);
        deal_stretch(cells, BT_WITH_WORK, begin, end, &cells->share[s * n]);
        deal_stretch(cells, BT_LISTED, begin, begin + n_listed, &cells->share[(BT_STRETCHES + s) * n]);
    }
    for (bt_idx i = 0; n > 1 && i < cells->n_order; i++) {
        bt_turn *turn = &cells->turn[cells->order[i]];
        turn->n_listed = listed_first(world, turn->before, turn->n_before);
    }
}

/// Stretch of the order to which cell k belongs: in each phase the border cells come first.
static int stretch_of(const bt_world *world, bt_idx k)
{
    const bt_cell *cell = &world->cells->cell[k];
    return 2 * cell->phase + !(world->exchange && cell->border);
}

/// List the cells around cell k that share bodies with it and are visited before it.
static void find_before(const bt_world *world, bt_idx k)
{
    const bt_cells *cells = world->cells;
    const bt_cell *cell = &cells->cell[k];
    bt_turn *turn = &cells->turn[k];
    turn->n_before = 0;
    for (int j = 0; j < 9 && k < cells->n - 1; j++) {
        const bt_idx o = bt_cells_at(cells, cell->x + j % 3 - 1, cell->y + j / 3 - 1);
        if (o < 0 || !cells->is_busy[o] || !has_work(world, o) || cells->cell[o].phase >= cell->phase) continue;
        turn->before[turn->n_before++] = o;
    }
}

void bt_phases_order(bt_world *world)
{
    bt_cells *cells = world->cells;
    bt_idx at[BT_STRETCHES + 1] = {0};
    cells->n_contacts = 0;
    for (bt_idx j = 0; j < cells->n_busy; j++)
        at[stretch_of(world, cells->busy[j]) + 1] += has_work(world, cells->busy[j]);
    for (int s = 0; s < BT_STRETCHES; s++) at[s + 1] += at[s];
    for (int p = 0; p < BT_PHASES; p++) {
        cells->start[p] = at[2 * p];
        cells->n_border[p] = at[2 * p + 1] - at[2 * p];
    }
    cells->start[BT_PHASES] = cells->n_order = at[BT_STRETCHES];
    for (bt_idx j = 0; j < cells->n_busy; j++) {
        const bt_idx k = cells->busy[j];
        if (!has_work(world, k)) continue;
        cells->order[at[stretch_of(world, k)]++] = k;
        find_before(world, k);
        cells->n_contacts += cells->cell[k].n_contacts;
        cells->cell[k].n_listed = cells->cell[k].n_contacts; // until there are lists
    }
    bt_phases_distribute(world);
}

// --- passes ----------------------------------------------------------------------------------------------------------

/// A pass, as each thread sees it.
typedef struct pass {
    bt_world *w;
    const bt_idx *list; ///< cells
    bt_share *share;    ///< [n_stretches][n_shares] of the list
    int n_stretches;
    bt_idx n_shares;
    const bt_before *before;
    bt_visit *visit;
    const void *context;
    bt_vel *exchanged;
    uint32_t number; ///< of the pass; 0: in any order
    bt_which which;
    bt_idx me, team; ///< number of the thread, and how many there are
    bt_totals *own;  ///< totals of this thread
} pass;

static pass in_order(bt_world *world, bt_which which, bt_visit *visit, const void *context)
{
    bt_cells *cells = world->cells;
    return (pass){.w = world,
                  .which = which,
                  .list = cells->order,
                  .share = cells->share + (which == BT_LISTED ? BT_STRETCHES * cells->n_shares : 0),
                  .n_stretches = BT_STRETCHES,
                  .n_shares = cells->n_shares,
                  .visit = visit,
                  .context = context,
                  .team = 1};
}

/// Wait until cell k has been visited in this pass.
static void wait_for_cell(const pass *mine, bt_idx k)
{
    enum { TURNS = 2000 }; // some 50 µs: longer than a cell takes, unless its thread has been descheduled
    for (int n = 0; atomic_load_explicit(&mine->w->cells->turn[k].done, memory_order_acquire) != mine->number; n++)
        if (n > TURNS) sched_yield();
}

static void visit_cell(const pass *mine, bt_idx k)
{
    bt_turn *turn = &mine->w->cells->turn[k];
    const bool waits = mine->team > 1 && mine->number;
    const bt_idx n = mine->which == BT_LISTED ? turn->n_listed : turn->n_before;
    for (bt_idx j = 0; waits && j < n; j++) wait_for_cell(mine, turn->before[j]);
    mine->visit(mine->w, k, mine->context, mine->own);
    if (waits) atomic_store_explicit(&turn->done, mine->number, memory_order_release);
}

/// Visit cells of one stretch of the list: first those of this thread's share, then cells that others
/// have not yet taken.
static void visit_stretch(pass *mine, int stretch)
{
    bt_share *share = &mine->share[stretch * mine->n_shares];
    for (bt_idx n = 0; n < mine->n_shares; n++) {
        bt_share *s = &share[(mine->me + n) % mine->n_shares];
        for (;;) {
            if (atomic_load_explicit(&s->next, memory_order_relaxed) >= s->end) break;
            const bt_idx i = atomic_fetch_add_explicit(&s->next, 1, memory_order_relaxed);
            if (i >= s->end) break;
            visit_cell(mine, mine->list[i]);
        }
    }
}

/// Wait for the other threads.
static void wait_for_team(const pass *mine)
{
    if (mine->team == 1) return;
#pragma omp barrier
}

/// Visits before the pass, with one stretch of cells for each thread.
static void visit_before(pass *mine)
{
    if (!mine->before) return;
    const bt_cells *cells = mine->w->cells;
    const bt_idx *list = mine->which == BT_LISTED ? cells->swept : cells->busy;
    const int64_t n = mine->which == BT_LISTED ? cells->n_swept : cells->n_busy;
    for (int64_t j = n * mine->me / mine->team, end = n * (mine->me + 1) / mine->team; j < end; j++)
        mine->before->visit(mine->w, list[j], mine->before->context, NULL);
    wait_for_team(mine);
}

static void run_phases(pass *mine)
{
    bt_world *world = mine->w;
    const bool among = world->exchange != NULL, sends = among && mine->exchanged && mine->me == 0;
    const bt_cells *cells = world->cells;
    visit_before(mine);
    for (int p = 0; p < BT_PHASES; p++) {
        if (p == BT_COLOURS && cells->start[p] < cells->start[p + 1]) wait_for_team(mine);
        if (among) {
            visit_stretch(mine, 2 * p);
            wait_for_team(mine);
            if (sends) world->exchange->send(world, p, mine->exchanged);
        }
        visit_stretch(mine, 2 * p + 1);
        if (sends) world->exchange->receive(world, p, mine->exchanged);
        if (among) wait_for_team(mine);
    }
}

static void run_stretches(pass *mine)
{
    for (int s = 0; s < mine->n_stretches; s++) visit_stretch(mine, s);
}

/// Run the pass on all threads. A single thread runs without OpenMP: in libgomp a team of one and each of its barriers
/// also enter the kernel, which took a sixth of the time of a small run. It adds to `totals` directly: to clear, copy
/// and merge separate totals costs as much as a small cell.
static void run_on_team(void run(pass *), pass *o, bt_totals *totals)
{
    for (bt_idx s = 0; s < o->n_stretches * o->n_shares; s++)
        atomic_store_explicit(&o->share[s].next, o->share[s].begin, memory_order_relaxed);
    if (o->n_shares == 1) {
        o->own = totals;
        run(o);
        return;
    }
    const double t0 = bt_clock();
#pragma omp parallel num_threads(o->n_shares)
    {
        BT_PLAIN_NUMBERS;
        bt_totals own = {.n_sums = totals->n_sums, .most = totals->most, .most2 = totals->most2};
        pass mine = *o;
        mine.me = omp_get_thread_num();
        mine.team = omp_get_num_threads();
        mine.own = &own;
        run(&mine);
#pragma omp critical
        totals_merge(totals, &own);
    }
    o->w->stats.in_team += bt_clock() - t0;
}

/// The reference: equivalent to the schedule above, without threads, shares or overlapped exchange.
static void run_plain(bt_world *world, const bt_before *before, bt_visit *visit, const void *context, bt_vel *exchanged,
                      bt_totals *totals)
{
    const bt_cells *cs = world->cells;
    for (bt_idx j = 0; before && j < cs->n_busy; j++) before->visit(world, cs->busy[j], before->context, NULL);
    for (int p = 0; p < BT_PHASES; p++) {
        for (bt_idx i = cs->start[p]; i < cs->start[p + 1]; i++) visit(world, cs->order[i], context, totals);
        if (!world->exchange || !exchanged) continue;
        world->exchange->send(world, p, exchanged);
        world->exchange->receive(world, p, exchanged);
    }
}

void bt_phases_run(bt_world *world, bt_which which, const bt_before *before, bt_visit *visit, const void *context,
                   bt_vel *exchanged, bt_totals *totals)
{
    if (world->par.plain_schedule) {
        run_plain(world, before, visit, context, exchanged, totals);
        return;
    }
    if (++world->cells->n_passes == 0) world->cells->n_passes = 1;
    pass mine = in_order(world, which, visit, context);
    mine.before = before, mine.exchanged = exchanged, mine.number = world->cells->n_passes;
    run_on_team(run_phases, &mine, totals);
}

void bt_phases_any_order(bt_world *world, bt_visit *visit, const void *context, bt_totals *totals)
{
    pass mine = in_order(world, BT_WITH_WORK, visit, context);
    run_on_team(run_stretches, &mine, totals);
}

void bt_phases_listed(bt_world *world, const bt_idx *list, bt_idx n, bt_idx few, bt_visit *visit, const void *context,
                      bt_totals *totals)
{
    const bt_idx team = BT_MANY(n, few) ? omp_get_max_threads() : 1;
    bt_share share[team];
    for (bt_idx s = 0; s < team; s++)
        share[s] = (bt_share){.begin = (bt_idx)((int64_t)n * s / team), .end = (bt_idx)((int64_t)n * (s + 1) / team)};
    pass mine = {.w = world,
                 .list = list,
                 .share = share,
                 .n_stretches = 1,
                 .n_shares = team,
                 .visit = visit,
                 .context = context,
                 .team = 1};
    run_on_team(run_stretches, &mine, totals);
}

void bt_phases_busy(bt_world *world, bt_visit *visit, const void *context, bt_totals *totals)
{
    bt_phases_listed(world, world->cells->busy, world->cells->n_busy, BT_FEW_CELLS, visit, context, totals);
}
