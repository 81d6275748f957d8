// SPDX-License-Identifier: MIT
// Passes over the active cells by threads, with the exchange between ranks under way.
#include "space/phases.h"
#include "base/inside.h"

#include <omp.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>

#include "space/exchange.h"
#include "tow/tow.h"

void bt_totals_merge(bt_totals *into, const bt_totals *from)
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
        t->n_contacts += t->cell[k].n_contacts;
        t->cell[k].work.n_list = t->cell[k].n_contacts; // until they are listed
    }
    bt_phases_distribute(w);
}

// --- passes ----------------------------------------------------------------------------------------------------------

/// A pass, as each thread sees it.
typedef struct pass {
    bt_world *w;
    bt_visit *visit;
    const void *context;
    bt_vel *exchanged;
    bt_idx me, team; ///< number of the thread, and how many there are
    bt_totals *own;  ///< what the thread adds up
} pass;

static void open_shares(bt_cells *t)
{
    for (bt_idx s = 0; s < BT_STRETCHES * t->n_shares; s++)
        atomic_store_explicit(&t->share[s].next, t->share[s].begin, memory_order_relaxed);
}

/// Cells of one stretch of the order, which share no body: first those of this thread's share, then what others have
/// not yet taken.
static void visit_stretch(pass *o, int stretch)
{
    bt_cells *t = o->w->cells;
    bt_share *share = &t->share[stretch * t->n_shares];
    for (bt_idx n = 0; n < t->n_shares; n++) {
        bt_share *s = &share[(o->me + n) % t->n_shares];
        for (;;) {
            if (atomic_load_explicit(&s->next, memory_order_relaxed) >= s->end) break;
            const bt_idx i = atomic_fetch_add_explicit(&s->next, 1, memory_order_relaxed);
            if (i >= s->end) break;
            o->visit(o->w, t->order[i], o->context, o->own);
        }
    }
}

/// Waits for the other threads.
static void wait_for_team(const pass *o)
{
    if (o->team == 1) return;
#pragma omp barrier
}

static void run_phases(pass *o)
{
    bt_world *w = o->w;
    const bool among = w->exchange != NULL, sends = among && o->exchanged && o->me == 0;
    const bt_cells *t = w->cells;
    for (int p = 0; p < BT_PHASES; p++) {
        if (among) {
            visit_stretch(o, 2 * p);
            wait_for_team(o);
            if (sends) w->exchange->send(w, p, o->exchanged);
        }
        if (t->start[p] + t->n_border[p] < t->start[p + 1]) visit_stretch(o, 2 * p + 1);
        else if (!among) continue; // no other cell was here
        if (sends) w->exchange->receive(w, p, o->exchanged);
        wait_for_team(o);
    }
}

static void run_stretches(pass *o)
{
    for (int s = 0; s < BT_STRETCHES; s++) visit_stretch(o, s);
}

/// The pass on all threads. One thread goes without OpenMP: in libgomp a team of one and each of its barriers enter the
/// kernel too, to wake nobody, which was a sixth of the time of a small run. It adds to t itself: to clear, copy and
/// merge totals of its own costs as much as a small cell.
static void run_on_team(void run(pass *), pass *o, bt_totals *t)
{
    bt_cells *cells = o->w->cells;
    open_shares(cells);
    if (cells->n_shares == 1) {
        o->own = t;
        run(o);
        return;
    }
#pragma omp parallel num_threads(cells->n_shares)
    {
        bt_totals own = {.n_sums = t->n_sums};
        pass mine = *o;
        mine.me = omp_get_thread_num();
        mine.team = omp_get_num_threads();
        mine.own = &own;
        run(&mine);
#pragma omp critical
        bt_totals_merge(t, &own);
    }
}

/// The reference: what the schedule above comes to, without threads, shares, or an exchange under way.
static void run_plain(bt_world *w, bt_visit *visit, const void *context, bt_vel *exchanged, bt_totals *t)
{
    const bt_cells *cs = w->cells;
    for (int p = 0; p < BT_PHASES; p++) {
        for (bt_idx i = cs->start[p]; i < cs->start[p + 1]; i++) visit(w, cs->order[i], context, t);
        if (!w->exchange || !exchanged) continue;
        w->exchange->send(w, p, exchanged);
        w->exchange->receive(w, p, exchanged);
    }
}

void bt_phases_run(bt_world *w, bt_visit *visit, const void *context, bt_vel *exchanged, bt_totals *t)
{
    if (w->par.plain_schedule) {
        run_plain(w, visit, context, exchanged, t);
        return;
    }
    pass o = {.w = w, .visit = visit, .context = context, .exchanged = exchanged, .team = 1};
    run_on_team(run_phases, &o, t);
}

void bt_phases_any_order(bt_world *w, bt_visit *visit, const void *context, bt_totals *t)
{
    pass o = {.w = w, .visit = visit, .context = context, .team = 1};
    run_on_team(run_stretches, &o, t);
}

void bt_phases_everywhere(bt_world *w, bt_visit *visit, const void *context)
{
    const bt_cells *ts = w->cells;
    if (ts->n_shares == 1) {
        for (bt_idx j = 0; j < ts->n_busy; j++) visit(w, ts->busy[j], context, NULL);
        return;
    }
#pragma omp parallel for schedule(static) num_threads(ts->n_shares)
    for (bt_idx j = 0; j < ts->n_busy; j++) visit(w, ts->busy[j], context, NULL);
}

void bt_phases_busy(bt_world *w, bt_visit *visit, const void *context, bt_totals *t)
{
    const bt_cells *ts = w->cells;
    const bt_idx n = ts->n_busy;
    if (!BT_MANY(n, BT_FEW_CELLS)) {
        for (bt_idx j = 0; j < n; j++) visit(w, ts->busy[j], context, t);
        return;
    }
#pragma omp parallel
    {
        bt_totals own = {.n_sums = t->n_sums, .most = t->most, .most2 = t->most2};
#pragma omp for schedule(dynamic, 16)
        for (bt_idx j = 0; j < n; j++) visit(w, ts->busy[j], context, &own);
#pragma omp critical
        bt_totals_merge(t, &own);
    }
}
