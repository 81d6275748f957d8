// SPDX-License-Identifier: MIT
// Passes over the active tiles by threads, with the exchange between ranks under way.
#include "phases.h"

#include <omp.h>
#include <sched.h>
#include <stdatomic.h>

#include "bergtow/tiles.h"
#include "domain.h"

void bt_totals_merge(bt_totals *into, const bt_totals *from)
{
    for (int k = 0; k < into->n_sums; k++) bt_sum_join(&into->sum[k], &from->sum[k]);
    into->most = bt_max(into->most, from->most);
}

// --- among ranks -----------------------------------------------------------------------------------------------------

/// A turn among ranks, as each thread of a rank sees it.
typedef struct {
    bt_world *w;
    const bt_pass *pass;
    bt_vel *exchanged;
    bt_totals own[BT_MAX_TURN];
    int under_way;                ///< phase whose velocities other ranks have not told yet; −1 = none
} shared_turn;

/// Tiles [begin, end) of the order, which share no body, in pass q, by all threads.
static void visit_at_once(shared_turn *o, bt_idx begin, bt_idx end, int q)
{
    if (begin == end) return;
    const bt_pass *pass = &o->pass[q];
#pragma omp for schedule(dynamic, 2)
    for (bt_idx i = begin; i < end; i++) pass->visit(o->w, o->w->tiles->order[i], pass->context, &o->own[q]);
}

/// To be called before anything that other ranks changed is read.
static void receive(shared_turn *o)
{
    if (o->under_way < 0) return;
#pragma omp master
    bt_domain_receive(o->w, o->under_way, o->exchanged);
#pragma omp barrier
    o->under_way = -1;
}

static void send(shared_turn *o, int phase, int q)
{
    if (!o->exchanged || o->pass[q].looks) return;
#pragma omp master
    bt_domain_send(o->w, phase, o->exchanged);
    o->under_way = phase;
}

/// Step `now` of n passes: what other ranks wait for first.
static void walk_step(shared_turn *o, bt_idx now, int n)
{
    const bt_bands *b = &o->w->tiles->bands;
    const int q = (int)(now / BT_COLOURS), phase = (int)(now % BT_COLOURS);
    if (phase == 0 && q > 0 && q <= n) { // the large bodies, which have step BT_COLOURS
        const bt_idx *large = &b->start[BT_COLOURS * BT_PHASES + BT_COLOURS];
        receive(o);
        visit_at_once(o, large[0], large[1], q - 1);
        send(o, BT_COLOURS, q - 1);
    }
    if (q < n) {
        const bt_idx begin = b->start[phase * BT_PHASES + phase];
        receive(o);
        visit_at_once(o, begin, begin + b->n_border[phase], q);
        send(o, phase, q);
    }
    for (int p = 0; p < n; p++) {
        const bt_idx step = now - BT_COLOURS * p;
        if (step < 0 || step >= b->n_steps) continue;
        for (int c = 0; c < BT_COLOURS; c++) {
            const bt_idx *start = &b->start[step * BT_PHASES + c];
            visit_at_once(o, start[0] + (step == c ? b->n_border[c] : 0), start[1], p);
        }
    }
}

static void run_among_ranks(bt_world *w, const bt_pass *pass, int n, bt_vel *exchanged)
{
    const bt_tiles *ts = w->tiles;
    // Four barriers a pass and more: worth while later than bands are.
#pragma omp parallel if (BT_MANY(ts->n_units, 2 * BT_FEW_UNITS))
    {
        shared_turn o = {.w = w, .pass = pass, .exchanged = exchanged, .under_way = -1};
        for (int q = 0; q < n; q++) o.own[q] = (bt_totals){.n_sums = pass[q].totals->n_sums};
        for (bt_idx now = 0; now < ts->bands.n_steps + BT_COLOURS * (n - 1); now++) walk_step(&o, now, n);
        receive(&o);
#pragma omp critical
        for (int q = 0; q < n; q++) bt_totals_merge(pass[q].totals, &o.own[q]);
    }
}

// --- on one rank -----------------------------------------------------------------------------------------------------

/// Wait until a tile may have its pass q of this turn; returns the time it took, s.
static double wait_for_others(const bt_bands *b, const bt_knot *knot, int q)
{
    enum { PATIENCE = 4000 }; // looks: as long as a tile or two; then the other thread has perhaps no core
    double since = 0;
    for (bt_idx i = knot->begin; i < knot->end; i++) {
        const bt_knot *other = &b->knot[b->other[i]];
        const int64_t enough = b->passes + q + (other->phase < knot->phase);
        for (int n = 0; atomic_load_explicit(&other->done, memory_order_acquire) < enough; n++) {
            if (since == 0) since = bt_clock();
            if (n > PATIENCE) sched_yield();
        }
    }
    return since > 0 ? bt_clock() - since : 0;
}

/// Returns the time spent waiting.
static double visit_in_turn(bt_world *w, bt_idx k, const bt_pass *pass, int q, bt_totals *own)
{
    bt_bands *b = &w->tiles->bands;
    const bt_idx tied = w->tiles->tile[k].knot;
    const double waited = tied >= 0 ? wait_for_others(b, &b->knot[tied], q) : 0;
    pass[q].visit(w, k, pass[q].context, &own[q]);
    if (tied >= 0) atomic_store_explicit(&b->knot[tied].done, b->passes + q + 1, memory_order_release);
    return waited;
}

/// Bands first to last − 1, by steps. Returns the time at work, s.
static double walk_bands(bt_world *w, bt_idx first, bt_idx last, const bt_pass *pass, int n, bt_totals *own)
{
    const bt_tiles *ts = w->tiles;
    const bt_bands *b = &ts->bands;
    const double began = bt_clock();
    double waited = 0;
    for (bt_idx now = 0; now < b->n_steps + BT_COLOURS * (n - 1); now++)
        for (int q = 0; q < n; q++) {
            const bt_idx step = now - BT_COLOURS * q;
            if (step < 0 || step >= b->n_steps) continue;
            for (int phase = 0; phase < BT_PHASES; phase++)
                for (bt_idx band = first; band < last; band++) {
                    const bt_idx *start = &b->start[(band * b->n_steps + step) * BT_PHASES + phase];
                    for (bt_idx i = start[0]; i < start[1]; i++) waited += visit_in_turn(w, ts->order[i], pass, q, own);
                }
        }
    return bt_clock() - began - waited;
}

/// Passes on one rank, one behind the other.
static void run_alone(bt_world *w, const bt_pass *pass, int n)
{
    bt_bands *b = &w->tiles->bands;
#pragma omp parallel num_threads(b->n > 1 ? b->n : 1)
    {
        const bt_idx team = omp_get_num_threads(), me = omp_get_thread_num(); // the team may be smaller than asked
        bt_totals own[BT_MAX_TURN];
        for (int q = 0; q < n; q++) own[q] = (bt_totals){.n_sums = pass[q].totals->n_sums};
        const double busy = walk_bands(w, me * b->n / team, (me + 1) * b->n / team, pass, n, own);
        if (team == b->n) b->busy[me] += busy;
#pragma omp critical
        for (int q = 0; q < n; q++) bt_totals_merge(pass[q].totals, &own[q]);
    }
    b->passes += n;
}

// ---------------------------------------------------------------------------------------------------------------------

void bt_phases_turn(bt_world *w, const bt_pass *pass, int n, bt_vel *exchanged)
{
    if (w->domain) run_among_ranks(w, pass, n, exchanged);
    else run_alone(w, pass, n);
}

void bt_phases_run(bt_world *w, bt_visit *visit, const void *context, bt_vel *exchanged, bt_totals *t)
{
    bt_phases_turn(w, &(bt_pass){visit, context, t, false}, 1, exchanged);
}

void bt_phases_any_order(bt_world *w, bt_visit *visit, const void *context, bt_totals *t)
{
    const bt_tiles *ts = w->tiles;
    const bt_bands *b = &ts->bands;
    const bool alone = !w->domain;
#pragma omp parallel if (alone ? b->n > 1 : BT_MANY(ts->n_units, BT_FEW_UNITS))
    {
        bt_totals own = {.n_sums = t->n_sums};
        if (alone) {
#pragma omp for schedule(static, 1)
            for (bt_idx band = 0; band < b->n; band++)
                for (bt_idx i = b->start[band * b->n_steps * BT_PHASES]; i < b->start[(band + 1) * b->n_steps * BT_PHASES]; i++) visit(w, ts->order[i], context, &own);
        } else {
#pragma omp for schedule(dynamic, 4)
            for (bt_idx i = 0; i < ts->n_order; i++) visit(w, ts->order[i], context, &own);
        }
#pragma omp critical
        bt_totals_merge(t, &own);
    }
}

void bt_phases_everywhere(bt_world *w, bt_visit *visit, const void *context)
{
    const bt_tiles *ts = w->tiles;
    const bt_bands *b = &ts->bands;
    if (w->domain) {
#pragma omp parallel for schedule(static) if (BT_MANY(ts->n_units, BT_FEW_UNITS))
        for (bt_idx k = 0; k < ts->n; k++) visit(w, k, context, NULL);
        return;
    }
#pragma omp parallel for schedule(static, 1) num_threads(b->n > 1 ? b->n : 1)
    for (bt_idx band = 0; band < b->n; band++)
        for (bt_idx i = b->first[band]; i < b->first[band + 1]; i++) visit(w, b->member[i], context, NULL);
}
