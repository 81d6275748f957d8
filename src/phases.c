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
        for (int phase = 0; phase < BT_PHASES; phase++) {
            const bt_idx begin = ts->phase_start[phase], inner = ts->phase_inner[phase], end = ts->phase_start[phase + 1];
            if (exchange) {
#pragma omp for schedule(dynamic, 1)
                for (bt_idx i = begin; i < inner; i++) visit(w, ts->phase_tile[i], context, &own);
#pragma omp master
                bt_domain_send(w, phase, exchanged);
            }
#pragma omp for schedule(dynamic, 2)
            for (bt_idx i = exchange ? inner : begin; i < end; i++) visit(w, ts->phase_tile[i], context, &own);
            if (exchange) {
#pragma omp master
                bt_domain_receive(w, phase, exchanged);
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
        for (bt_idx i = 0; i < ts->phase_start[BT_PHASES]; i++) visit(w, ts->phase_tile[i], context, &own);
#pragma omp critical
        bt_totals_merge(t, &own);
    }
}
