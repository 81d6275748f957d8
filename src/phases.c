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

void bt_phases_run(bt_world *w, bt_visit *visit, const void *context, bt_vel *exchanged, bt_totals *t)
{
    const bt_tiles *ts = w->tiles;
    const bool exchange = exchanged && w->domain;
#pragma omp parallel if (BT_MANY(ts->n_units, BT_FEW_UNITS))
    {
        bt_totals own = {.n_sums = t->n_sums};
        for (bt_idx r = 0; r < ts->n_runs; r++) {
            const bt_run_of_tiles *run = &ts->run[r];
#pragma omp for schedule(dynamic, 2)
            for (bt_idx i = run->begin; i < run->end; i++) visit(w, ts->order[i], context, &own);
            if (!exchange) continue;
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
        bt_totals_merge(t, &own);
    }
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
