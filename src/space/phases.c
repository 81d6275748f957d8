// SPDX-License-Identifier: MIT
// Passes over the active cells by threads, with the exchange between ranks under way.
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

// --- who does what ---------------------------------------------------------------------------------------------------

/// Has this rank work in cell k?
static bool has_work(const bt_world *w, bt_idx k)
{
    const bt_cells *t = w->cells;
    return t->cell[k].own && (t->cell[k].n_contacts > 0 || (k == t->n - 1 && bt_tow_has_line(w->tow)));
}

/// Stretches of cells [begin, end) of the order with equal parts of the listed contacts, one a share. A cell itself
/// costs something, too.
static void deal_stretch(bt_cells *t, bt_idx begin, bt_idx end, bt_share *share)
{
    enum { CELL = 4 }; // contacts
    int64_t all = 0, before = 0;
    for (bt_idx i = begin; i < end; i++) all += CELL + t->cell[t->order[i]].work.n_list;
    bt_idx i = begin;
    for (bt_idx s = 0; s < t->n_shares; s++) {
        share[s].begin = i;
        for (; i < end && before * t->n_shares < all * (s + 1); i++) before += CELL + t->cell[t->order[i]].work.n_list;
        share[s].end = i;
    }
    share[t->n_shares - 1].end = end;
}

void bt_phases_distribute(bt_world *w)
{
    bt_cells *t = w->cells;
    int64_t listed = 0;
    for (bt_idx i = 0; i < t->n_order; i++) listed += t->cell[t->order[i]].work.n_list;
    const bt_idx n = BT_MANY(listed, BT_FEW_CONTACTS) ? omp_get_max_threads() : 1;
    if (n > t->cap_shares) {
        free(t->share);
        t->share = bt_alloc_aligned(BT_STRETCHES * (size_t)n, sizeof *t->share);
        t->cap_shares = n;
    }
    t->n_shares = n;
    for (int p = 0; p < BT_PHASES; p++) {
        const bt_idx middle = t->start[p] + t->n_border[p];
        deal_stretch(t, t->start[p], middle, &t->share[2 * p * n]);
        deal_stretch(t, middle, t->start[p + 1], &t->share[(2 * p + 1) * n]);
    }
}

/// Stretch of the order that cell k belongs to: of each phase first the cells at the border of the rank.
static int stretch_of(const bt_world *w, bt_idx k)
{
    const bt_cell *cell = &w->cells->cell[k];
    return 2 * cell->phase + !(w->exchange && cell->border);
}

/// List the cells around cell k that share bodies with it and are visited before it.
static void find_before(const bt_world *w, bt_idx k)
{
    const bt_cells *t = w->cells;
    const bt_cell *cell = &t->cell[k];
    bt_turn *turn = &t->turn[k];
    turn->n_before = 0;
    for (int j = 0; j < 9 && k < t->n - 1; j++) {
        const bt_idx o = bt_cells_at(t, cell->x + j % 3 - 1, cell->y + j / 3 - 1);
        if (o < 0 || !t->is_busy[o] || !has_work(w, o) || t->cell[o].phase >= cell->phase) continue;
        turn->before[turn->n_before++] = o;
    }
}

void bt_phases_order(bt_world *w)
{
    bt_cells *t = w->cells;
    bt_idx at[BT_STRETCHES + 1] = {0};
    t->n_contacts = 0;
    for (bt_idx j = 0; j < t->n_busy; j++) at[stretch_of(w, t->busy[j]) + 1] += has_work(w, t->busy[j]);
    for (int s = 0; s < BT_STRETCHES; s++) at[s + 1] += at[s];
    for (int p = 0; p < BT_PHASES; p++) {
        t->start[p] = at[2 * p];
        t->n_border[p] = at[2 * p + 1] - at[2 * p];
    }
    t->start[BT_PHASES] = t->n_order = at[BT_STRETCHES];
    for (bt_idx j = 0; j < t->n_busy; j++) {
        const bt_idx k = t->busy[j];
        if (!has_work(w, k)) continue;
        t->order[at[stretch_of(w, k)]++] = k;
        find_before(w, k);
        t->n_contacts += t->cell[k].n_contacts;
        t->cell[k].work.n_list = t->cell[k].n_contacts; // until they are listed
    }
    bt_phases_distribute(w);
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
    bt_idx me, team; ///< number of the thread, and how many there are
    bt_totals *own;  ///< what the thread adds up
} pass;

/// A pass over the cells with work.
static pass in_order(bt_world *w, bt_visit *visit, const void *context)
{
    bt_cells *t = w->cells;
    return (pass){.w = w,
                  .list = t->order,
                  .share = t->share,
                  .n_stretches = BT_STRETCHES,
                  .n_shares = t->n_shares,
                  .visit = visit,
                  .context = context,
                  .team = 1};
}

/// Waits until cell k has been visited in this pass.
static void wait_for_cell(const pass *o, bt_idx k)
{
    enum { TURNS = 2000 }; // some 50 µs: longer than a cell takes, unless its thread has lost its processor
    for (int n = 0; atomic_load_explicit(&o->w->cells->turn[k].done, memory_order_acquire) != o->number; n++)
        if (n > TURNS) sched_yield();
}

static void visit_cell(const pass *o, bt_idx k)
{
    bt_turn *turn = &o->w->cells->turn[k];
    const bool waits = o->team > 1 && o->number;
    for (bt_idx j = 0; waits && j < turn->n_before; j++) wait_for_cell(o, turn->before[j]);
    o->visit(o->w, k, o->context, o->own);
    if (waits) atomic_store_explicit(&turn->done, o->number, memory_order_release);
}

/// Cells of one stretch of the list: first those of this thread's share, then what others have
/// not yet taken.
static void visit_stretch(pass *o, int stretch)
{
    bt_share *share = &o->share[stretch * o->n_shares];
    for (bt_idx n = 0; n < o->n_shares; n++) {
        bt_share *s = &share[(o->me + n) % o->n_shares];
        for (;;) {
            if (atomic_load_explicit(&s->next, memory_order_relaxed) >= s->end) break;
            const bt_idx i = atomic_fetch_add_explicit(&s->next, 1, memory_order_relaxed);
            if (i >= s->end) break;
            visit_cell(o, o->list[i]);
        }
    }
}

/// Waits for the other threads.
static void wait_for_team(const pass *o)
{
    if (o->team == 1) return;
#pragma omp barrier
}

/// All busy cells, a stretch of them for each thread.
static void visit_before(pass *o)
{
    if (!o->before) return;
    const bt_cells *t = o->w->cells;
    const int64_t n = t->n_busy;
    for (int64_t j = n * o->me / o->team, end = n * (o->me + 1) / o->team; j < end; j++)
        o->before->visit(o->w, t->busy[j], o->before->context, NULL);
    wait_for_team(o);
}

static void run_phases(pass *o)
{
    bt_world *w = o->w;
    const bool among = w->exchange != NULL, sends = among && o->exchanged && o->me == 0;
    const bt_cells *t = w->cells;
    visit_before(o);
    for (int p = 0; p < BT_PHASES; p++) {
        if (p == BT_COLOURS && t->start[p] < t->start[p + 1]) wait_for_team(o);
        if (among) {
            visit_stretch(o, 2 * p);
            wait_for_team(o);
            if (sends) w->exchange->send(w, p, o->exchanged);
        }
        visit_stretch(o, 2 * p + 1);
        if (sends) w->exchange->receive(w, p, o->exchanged);
        if (among) wait_for_team(o);
    }
}

static void run_stretches(pass *o)
{
    for (int s = 0; s < o->n_stretches; s++) visit_stretch(o, s);
}

/// The pass on all threads. One thread goes without OpenMP: in libgomp a team of one and each of its barriers enter the
/// kernel too, to wake nobody, which was a sixth of the time of a small run. It adds to t itself: to clear, copy and
/// merge totals of its own costs as much as a small cell.
static void run_on_team(void run(pass *), pass *o, bt_totals *t)
{
    for (bt_idx s = 0; s < o->n_stretches * o->n_shares; s++)
        atomic_store_explicit(&o->share[s].next, o->share[s].begin, memory_order_relaxed);
    if (o->n_shares == 1) {
        o->own = t;
        run(o);
        return;
    }
    const double t0 = bt_clock();
#pragma omp parallel num_threads(o->n_shares)
    {
        bt_totals own = {.n_sums = t->n_sums, .most = t->most, .most2 = t->most2};
        pass mine = *o;
        mine.me = omp_get_thread_num();
        mine.team = omp_get_num_threads();
        mine.own = &own;
        run(&mine);
#pragma omp critical
        totals_merge(t, &own);
    }
    o->w->stats.in_team += bt_clock() - t0;
}

/// The reference: what the schedule above comes to, without threads, shares, or an exchange under way.
static void run_plain(bt_world *w, const bt_before *before, bt_visit *visit, const void *context, bt_vel *exchanged,
                      bt_totals *t)
{
    const bt_cells *cs = w->cells;
    for (bt_idx j = 0; before && j < cs->n_busy; j++) before->visit(w, cs->busy[j], before->context, NULL);
    for (int p = 0; p < BT_PHASES; p++) {
        for (bt_idx i = cs->start[p]; i < cs->start[p + 1]; i++) visit(w, cs->order[i], context, t);
        if (!w->exchange || !exchanged) continue;
        w->exchange->send(w, p, exchanged);
        w->exchange->receive(w, p, exchanged);
    }
}

void bt_phases_run(bt_world *w, const bt_before *before, bt_visit *visit, const void *context, bt_vel *exchanged,
                   bt_totals *t)
{
    if (w->par.plain_schedule) {
        run_plain(w, before, visit, context, exchanged, t);
        return;
    }
    if (++w->cells->n_passes == 0) w->cells->n_passes = 1;
    pass o = in_order(w, visit, context);
    o.before = before, o.exchanged = exchanged, o.number = w->cells->n_passes;
    run_on_team(run_phases, &o, t);
}

void bt_phases_any_order(bt_world *w, bt_visit *visit, const void *context, bt_totals *t)
{
    pass o = in_order(w, visit, context);
    run_on_team(run_stretches, &o, t);
}

void bt_phases_listed(bt_world *w, const bt_idx *list, bt_idx n, bt_idx few, bt_visit *visit, const void *context,
                      bt_totals *t)
{
    const bt_idx team = BT_MANY(n, few) ? omp_get_max_threads() : 1;
    bt_share share[team];
    for (bt_idx s = 0; s < team; s++)
        share[s] = (bt_share){.begin = (bt_idx)((int64_t)n * s / team), .end = (bt_idx)((int64_t)n * (s + 1) / team)};
    pass o = {.w = w,
              .list = list,
              .share = share,
              .n_stretches = 1,
              .n_shares = team,
              .visit = visit,
              .context = context,
              .team = 1};
    run_on_team(run_stretches, &o, t);
}

void bt_phases_busy(bt_world *w, bt_visit *visit, const void *context, bt_totals *t)
{
    bt_phases_listed(w, w->cells->busy, w->cells->n_busy, BT_FEW_CELLS, visit, context, t);
}
