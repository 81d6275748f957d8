// SPDX-License-Identifier: MIT
// Passes over the active tiles by threads, with the exchange between ranks under way.
#include "phases.h"

#include <omp.h>
#include <sched.h>
#include <stdatomic.h>
#include <stdlib.h>

#include "bergtow/tiles.h"
#include "domain.h"
#include "order.h"

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
    bool shared;                  ///< with other threads
} shared_turn;

/// Tiles [begin, end) of the order, which share no body, in pass q, by all threads.
static void visit_at_once(shared_turn *o, bt_idx begin, bt_idx end, int q)
{
    if (begin == end) return;
    const bt_pass *pass = &o->pass[q];
    const bt_idx *order = o->w->tiles->order;
    if (!o->shared) { // a group has few tiles: handing them out would cost one thread some per cent
        for (bt_idx i = begin; i < end; i++) pass->visit(o->w, order[i], pass->context, &o->own[q]);
        return;
    }
#pragma omp for schedule(dynamic, 2)
    for (bt_idx i = begin; i < end; i++) pass->visit(o->w, order[i], pass->context, &o->own[q]);
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
    if (phase == 0 && q > 0 && q <= n) { // the large bodies, whose tile is in group 0
        const bt_idx *large = &b->start[BT_COLOURS];
        receive(o);
        visit_at_once(o, large[0], large[1], q - 1);
        send(o, BT_COLOURS, q - 1);
    }
    if (q < n) {
        const bt_idx begin = b->start[phase];
        receive(o);
        visit_at_once(o, begin, begin + b->n_border[phase], q);
        send(o, phase, q);
    }
    for (int p = 0; p < n; p++) {
        for (int c = 0; c < BT_COLOURS; c++) {
            const bt_idx level = now - BT_COLOURS * p - c;
            if (level < 0 || level >= b->n_groups) continue;
            const bt_idx *start = &b->start[level * BT_PHASES + c];
            visit_at_once(o, start[0] + (level == 0 ? b->n_border[c] : 0), start[1], p);
        }
    }
}

static void run_among_ranks(bt_world *w, const bt_pass *pass, int n, bt_vel *exchanged)
{
    const bt_tiles *ts = w->tiles;
    // Four barriers a pass and more: worth while later than bands are.
#pragma omp parallel if (BT_MANY(ts->n_units, 2 * BT_FEW_UNITS))
    {
        shared_turn o = {.w = w, .pass = pass, .exchanged = exchanged, .under_way = -1, .shared = omp_get_num_threads() > 1};
        for (int q = 0; q < n; q++) o.own[q] = (bt_totals){.n_sums = pass[q].totals->n_sums};
        for (bt_idx now = 0; now < ts->bands.n_groups + BT_PHASES - 1 + BT_COLOURS * (n - 1); now++) walk_step(&o, now, n);
        receive(&o);
#pragma omp critical
        for (int q = 0; q < n; q++) bt_totals_merge(pass[q].totals, &o.own[q]);
    }
}

// --- on one rank -----------------------------------------------------------------------------------------------------

/// A band on its way through a turn.
typedef struct {
    bt_idx band, taken;           ///< groups
    bool open;                    ///< it may take more
    bool over;
    bt_idx now;                   ///< step, pass and phase,
    int q, phase;
    bt_idx i, end;                ///< and what is left of their tiles in the order
    int64_t worked;               ///< units
    double busy;                  ///< s
} walk;

/// Take the next of the groups that both bands of a segment may do. False when the other has taken it.
static bool take(bt_segment *s, bool up)
{
    uint64_t seen = atomic_load_explicit(&s->free, memory_order_relaxed), left;
    do {
        const uint64_t first = seen & UINT32_MAX, end = seen >> 32;
        if (first == end) return false;
        left = up ? (first + 1) | end << 32 : first | (end - 1) << 32;
    } while (!atomic_compare_exchange_weak_explicit(&s->free, &seen, left, memory_order_relaxed, memory_order_relaxed));
    return true; // what the other did to these floes is known from the knots
}

static walk set_out(const bt_bands *b, bt_idx band)
{
    const bt_segment *s = &b->segment[band / 2];
    return (walk){.band = band, .taken = band % 2 == 0 ? s->free_begin - s->begin : s->end - s->free_end, .open = s->free_begin < s->free_end, .phase = -1};
}

/// To the next tiles of one step, pass and phase; false after the last.
static bool go_on(const bt_bands *b, walk *f, int n)
{
    const bool up = f->band % 2 == 0;
    bt_segment *s = &b->segment[f->band / 2];
    do {
        if (++f->phase == BT_PHASES) {
            f->phase = 0;
            if (++f->q == n) f->q = 0, f->now++;
        }
        if (f->open && f->now == f->taken) { // in pass 0 and phase 0: before the step has a tile that could wait for this group
            f->open = take(s, up);
            f->taken += f->open;
        }
        if (!f->open && f->now >= f->taken + BT_PHASES - 1 + BT_COLOURS * (n - 1)) return false;
        const bt_idx level = f->now - BT_COLOURS * f->q - f->phase;
        if (level < 0 || level >= f->taken) continue;
        const bt_idx *start = &b->start[(up ? s->begin + level : s->end - 1 - level) * BT_PHASES + f->phase];
        f->i = start[0], f->end = start[1];
    } while (f->i == f->end);
    return true;
}

/// May a tile have its pass q of this turn?
static bool is_ready(const bt_bands *b, const bt_knot *knot, int q)
{
    for (bt_idx i = knot->begin; i < knot->end; i++) {
        const bt_knot *other = &b->knot[b->other[i]];
        if (atomic_load_explicit(&other->done, memory_order_acquire) < b->passes + q + (other->phase < knot->phase)) return false;
    }
    return true;
}

/// On until a tile has to wait for others, or to the end. Returns whether it has moved.
static bool advance(bt_world *w, walk *f, const bt_pass *pass, int n, bt_totals *own)
{
    const bt_tiles *ts = w->tiles;
    bt_bands *b = &w->tiles->bands;
    double began = 0;
    for (;; f->i++) {
        if (f->i == f->end && !go_on(b, f, n)) {
            f->over = true;
            break;
        }
        const bt_idx k = ts->order[f->i];
        bt_knot *knot = ts->tile[k].knot >= 0 ? &b->knot[ts->tile[k].knot] : NULL;
        if (knot && !is_ready(b, knot, f->q)) break;
        if (began == 0) began = bt_clock();
        pass[f->q].visit(w, k, pass[f->q].context, &own[f->q]);
        f->worked += ts->tile[k].n_units;
        if (knot) atomic_store_explicit(&knot->done, b->passes + f->q + 1, memory_order_release);
    }
    if (began > 0) f->busy += bt_clock() - began;
    return began > 0 || f->over;
}

/// All bands of one thread, each as far as it comes.
static void walk_bands(bt_world *w, walk *band, bt_idx n_bands, const bt_pass *pass, int n, bt_totals *own)
{
    enum { PATIENCE = 4000 }; // looks: as long as a tile or two; then the other thread has perhaps no core
    bt_idx left = n_bands;
    int idle = 0;
    while (left > 0) {
        bool moved = false;
        for (bt_idx k = 0; k < n_bands; k++) {
            if (band[k].over || !advance(w, &band[k], pass, n, own)) continue;
            moved = true;
            left -= band[k].over;
        }
        idle = moved ? 0 : idle + (idle < PATIENCE);
        if (idle == PATIENCE) sched_yield();
    }
}

/// Passes on one rank, one behind the other.
static void run_alone(bt_world *w, const bt_pass *pass, int n)
{
    bt_bands *b = &w->tiles->bands;
    for (bt_idx s = 0; s < (b->n + 1) / 2; s++) b->segment[s].free = (uint64_t)b->segment[s].free_begin | (uint64_t)b->segment[s].free_end << 32;
#pragma omp parallel num_threads(b->n_threads)
    {
        const bt_idx team = omp_get_num_threads(), me = omp_get_thread_num(); // the team may be smaller than asked
        const bt_idx first = bt_bands_of(b, me, team), end = bt_bands_of(b, me + 1, team);
        bt_totals own[BT_MAX_TURN];
        for (int q = 0; q < n; q++) own[q] = (bt_totals){.n_sums = pass[q].totals->n_sums};
        walk *band = bt_alloc_aligned((size_t)(end - first), sizeof *band);
        for (bt_idx k = first; k < end; k++) band[k - first] = set_out(b, k);
        walk_bands(w, band, end - first, pass, n, own);
#pragma omp critical
        {
            for (int q = 0; q < n; q++) bt_totals_merge(pass[q].totals, &own[q]);
            for (bt_idx k = first; k < end; k++) {
                b->busy[k] += band[k - first].busy;
                b->worked[k] += (double)band[k - first].worked;
            }
        }
        free(band);
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
#pragma omp parallel if (alone || BT_MANY(ts->n_units, BT_FEW_UNITS)) num_threads(alone ? b->n_threads : omp_get_max_threads())
    {
        bt_totals own = {.n_sums = t->n_sums};
        if (alone) {
#pragma omp for schedule(static)
            for (bt_idx thread = 0; thread < b->n_threads; thread++) {
                const bt_idx first = b->edge[bt_bands_of(b, thread, b->n_threads)], end = b->edge[bt_bands_of(b, thread + 1, b->n_threads)];
                for (bt_idx i = b->start[first * BT_PHASES]; i < b->start[end * BT_PHASES]; i++) visit(w, ts->order[i], context, &own);
            }
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
#pragma omp parallel for schedule(static) num_threads(b->n_threads)
    for (bt_idx thread = 0; thread < b->n_threads; thread++) {
        const bt_idx first = b->first[bt_bands_of(b, thread, b->n_threads)], end = b->first[bt_bands_of(b, thread + 1, b->n_threads)];
        for (bt_idx i = first; i < end; i++) visit(w, b->member[i], context, NULL);
    }
}
