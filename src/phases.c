// SPDX-License-Identifier: MIT
// Passes over the active tiles by threads, with the exchange between ranks under way.
#include "phases.h"

#include "bergtow/tiles.h"
#include "domain.h"

void bt_totals_merge(bt_totals *into, const bt_totals *from)
{
    for (int k = 0; k < into->n_sums; k++) bt_sum_join(&into->sum[k], &from->sum[k]);
    into->most = bt_max(into->most, from->most);
}

/// A pass among ranks.
static void run_among_ranks(bt_world *w, const bt_pass *pass, bt_vel *exchanged)
{
    const bt_tiles *ts = w->tiles;
#pragma omp parallel if (BT_MANY(ts->n_units, BT_FEW_UNITS))
    {
        bt_totals own = {.n_sums = pass->totals->n_sums};
        for (bt_idx r = 0; r < ts->n_runs; r++) {
            const bt_run_of_tiles *run = &ts->run[r];
#pragma omp for schedule(dynamic, 2)
            for (bt_idx i = run->begin; i < run->end; i++) pass->visit(w, ts->order[i], pass->context, &own);
            if (!exchanged) continue;
            if (run->send >= 0) {
#pragma omp master
                bt_domain_send(w, run->send, exchanged);
            }
            if (run->receive >= 0) {
#pragma omp master
                bt_domain_receive(w, run->receive, exchanged);
#pragma omp barrier
            }
        }
#pragma omp critical
        bt_totals_merge(pass->totals, &own);
    }
}

/// Tiles of one pass that are done at the same time as those of the others.
typedef struct {
    bt_idx begin, end;
    int pass;
} piece;

enum { LAG = 2 }; // strips between two passes

/// Place of pass q in beat `beat`: strips of its way that it has done, −1 = it does not work now. On a ring it begins with strip LAG q, when the
/// one before has gone LAG strips beyond that. A ring of any length will do: while pass q is on the last strip of its way, and on its seam
/// before the first, the passes behind it are LAG strips and more from both, or have not begun.
static bt_idx place_of(const bt_tiles *ts, int q, bt_idx beat)
{
    const bt_idx done = beat - (ts->ring ? 2 * LAG : LAG) * q;
    return done >= 0 && done < ts->n_strips ? done : -1;
}

static bt_idx strip_at(const bt_tiles *ts, int q, bt_idx done) { return ts->ring ? (LAG * q + done) % ts->n_strips : done; }

/// What is done in one phase of a beat.
static int pieces_of(const bt_tiles *ts, int n, bt_idx beat, int phase, piece out[2 * BT_MAX_TURN])
{
    int n_pieces = 0;
    for (int q = 0; q < n; q++) {
        const bt_idx done = place_of(ts, q, beat);
        if (done < 0) continue;
        const bt_strip *s = &ts->strip[strip_at(ts, q, done)], *source = &ts->strip[strip_at(ts, q, 0)];
        const bt_idx begin = ts->ring && done == 0 ? s->seam[phase] : s->begin[phase];
        if (begin < s->end[phase]) out[n_pieces++] = (piece){begin, s->end[phase], q};
        if (ts->ring && done == ts->n_strips - 1 && source->begin[phase] < source->seam[phase])
            out[n_pieces++] = (piece){source->begin[phase], source->seam[phase], q};
    }
    return n_pieces;
}

/// Passes on one rank, one behind the other.
static void run_alone(bt_world *w, const bt_pass *pass, int n)
{
    const bt_tiles *ts = w->tiles;
    const bt_idx beats = ts->n_strips + (n - 1) * (ts->ring ? 2 * LAG : LAG);
#pragma omp parallel if (BT_MANY(ts->n_units, BT_FEW_UNITS))
    {
        bt_totals own[BT_MAX_TURN];
        for (int q = 0; q < n; q++) own[q] = (bt_totals){.n_sums = pass[q].totals->n_sums};
        for (bt_idx beat = 0; beat < beats; beat++) {
            for (int phase = 0; phase < BT_COLOURS; phase++) {
                piece p[2 * BT_MAX_TURN];
                const int n_pieces = pieces_of(ts, n, beat, phase, p);
                bt_idx count = 0;
                for (int k = 0; k < n_pieces; k++) count += p[k].end - p[k].begin;
                if (count == 0) continue;
#pragma omp for schedule(dynamic, 2)
                for (bt_idx i = 0; i < count; i++) {
                    bt_idx at = i;
                    int k = 0;
                    for (; at >= p[k].end - p[k].begin; k++) at -= p[k].end - p[k].begin;
                    const bt_pass *of = &pass[p[k].pass];
                    of->visit(w, ts->order[p[k].begin + at], of->context, &own[p[k].pass]);
                }
            }
            for (int q = 0; q < n && ts->large_after >= 0; q++) {
                const bt_idx done = place_of(ts, q, beat);
                if (done < 0 || strip_at(ts, q, done) != ts->large_after) continue;
#pragma omp single
                pass[q].visit(w, ts->n - 1, pass[q].context, &own[q]);
            }
        }
#pragma omp critical
        for (int q = 0; q < n; q++) bt_totals_merge(pass[q].totals, &own[q]);
    }
}

void bt_phases_turn(bt_world *w, const bt_pass *pass, int n, bt_vel *exchanged)
{
    if (w->domain) {
        for (int q = 0; q < n; q++) run_among_ranks(w, &pass[q], pass[q].looks ? NULL : exchanged);
        return;
    }
    run_alone(w, pass, n);
}

void bt_phases_run(bt_world *w, bt_visit *visit, const void *context, bt_vel *exchanged, bt_totals *t)
{
    bt_phases_turn(w, &(bt_pass){visit, context, t, false}, 1, exchanged);
}

void bt_phases_any_order(bt_world *w, bt_visit *visit, const void *context, bt_totals *t)
{
    const bt_tiles *ts = w->tiles;
#pragma omp parallel if (BT_MANY(ts->n_units, BT_FEW_UNITS))
    {
        bt_totals own = {.n_sums = t->n_sums};
#pragma omp for schedule(dynamic, 4)
        for (bt_idx i = 0; i < ts->n_order; i++) visit(w, ts->order[i], context, &own);
#pragma omp critical
        bt_totals_merge(t, &own);
    }
}
