// SPDX-License-Identifier: MIT
// Split-impulse position projection: overlap is removed by displacements that never become velocities.
//
// With the gaps predicted for the end of the step, g2 = g + Δt J_n U2, find displacements D = M⁻¹ J_nᵀ p with
//     0 ≤ p ⟂ J_n D + g2 + slop ≥ 0
// by the same rows without friction, swept in the same order. Touching contacts (g2 ≥ −slop) take part, so that pushing two floes apart
// does not press either into a third. Velocity-level correction (Baumgarte) would add kinetic energy and load that
// is not there (Metrikin 2014).
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "bergtow/crush.h"
#include "bergtow/solver.h"
#include "domain.h"
#include "kernel.h"
#include "phases.h"

static void find_overlap(bt_world *w, bt_idx k, const void *context, bt_totals *t)
{
    (void)context;
    bt_tile *tile = &w->tiles->tile[k];
    for (bt_idx j = 0; j < tile->n_units; j++) {
        const bt_unit *u = &tile->units[j];
        bt_gaps *g = &tile->gaps[j];
        for (int i = 0; i < u->n; i++) {
            g->push[i] = 0;
            g->after[i] = g->gap[i] + w->par.dt * bt_normal_velocity(u, i, &w->bodies.vel[u->a], &w->bodies.vel[u->b]);
            if (tile->limits) g->after[i] += tile->limits[j].grown[i]; // crushed in this step
            t->most = bt_max(t->most, -g->after[i]);
        }
    }
}

static void push_tile(bt_world *w, bt_idx k, const void *context, bt_totals *t)
{
    (void)context;
    bt_tile *tile = &w->tiles->tile[k];
    bt_vel *d = w->solver->shift;
    const bt_inv *inv = w->bodies.inv;
    for (bt_idx j = 0; j < tile->n_units; j++) {
        const bt_unit *u = &tile->units[j];
        bt_gaps *g = &tile->gaps[j];
        bt_vel da = d[u->a], db = d[u->b];
        bool moved = false;
        for (int i = 0; i < u->n; i++) {
            const double open = bt_normal_velocity(u, i, &da, &db) + g->after[i] + w->par.slop;
            const double p = bt_max(0, g->push[i] - open * u->mn[i]), step = p - g->push[i];
            if (step == 0) continue;
            g->push[i] = p;
            moved = true;
            bt_apply(u, step, step * u->ran[i], step * u->rbn[i], 0, inv[u->a], inv[u->b], &da, &db);
            t->most = bt_max(t->most, fabs(step) * u->w[i]);
        }
        if (!moved) continue;
        bt_store(&d[u->a], inv[u->a], &da);
        bt_store(&d[u->b], inv[u->b], &db);
    }
}

void bt_solver_project(bt_world *w)
{
    bt_solver *s = w->solver;
    const bt_tiles *ts = w->tiles;
    const double slop = w->par.slop;
    w->stats.position_sweeps = 0;
    bt_totals t = {0};
    bt_phases_any_order(w, find_overlap, NULL, &t);
    bt_domain_reduce(w, &t);
    s->shifted = t.most > slop;
    if (!s->shifted) return;

    if (!s->shift || w->bodies.n > s->cap_bodies) { // a rank may own nothing
        s->cap_bodies = w->bodies.n > 0 ? w->bodies.n : 1;
        free(s->shift);
        s->shift = bt_alloc_aligned((size_t)s->cap_bodies, sizeof *s->shift);
    }
    for (bt_idx k = 0; k < ts->n; k++)
        if (k == ts->n - 1 || bt_tiles_moves(ts, k))
            memset(s->shift + ts->tile[k].first, 0, (size_t)(ts->tile[k].end - ts->tile[k].first) * sizeof *s->shift);
    double worst = INFINITY;
    while (worst > 0.1 * slop && w->stats.position_sweeps < w->par.position_sweeps) {
        t = (bt_totals){0};
        bt_phases_run(w, push_tile, NULL, s->shift, &t);
        bt_domain_reduce(w, &t);
        worst = t.most;
        w->stats.position_sweeps++;
    }
    bt_domain_settle(w);
}
