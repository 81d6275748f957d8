// SPDX-License-Identifier: MIT
// A and P of locked.h by island; sums are exact, so that ranks and threads do not matter.
#include "solve/locked.h"

#include <math.h>
#include <string.h>

#include "base/elementary.h"
#include "contact/law.h"
#include "contact/row.h"
#include "partition/domain.h"
#include "solve/islands.h"
#include "solve/solver.h"
#include "space/phases.h"

/// Does it bear load, and any load?
static bool is_hard(const bt_cell *cell, bt_idx j)
{
    const bt_contact *u = &cell->contacts[j];
    if (u->n == 0 || u->ln[0] + u->ln[1] == 0) return false;
    const bt_limit *k = cell->laws.limits ? &cell->laws.limits[j] : NULL;
    return !k || !(isfinite(k->most[0]) || (u->n > 1 && isfinite(k->most[1])));
}

static void no_change(bt_world *w, bt_idx k, const void *context, bt_totals *t)
{
    (void)context, (void)t;
    const bt_cell *cell = &w->cells->cell[k];
    memset(w->solver->shift + cell->first, 0, (size_t)(cell->end - cell->first) * sizeof *w->solver->shift);
}

/// M⁻¹Jᵀλ, and how fast contacts would close.
static void push(bt_world *w, bt_idx k, const void *context, bt_totals *t)
{
    (void)context;
    const bt_cell *cell = &w->cells->cell[k];
    bt_vel *change = w->solver->shift;
    const bt_vel *free = w->bodies.vel_free;
    const bt_inv *inv = w->bodies.inv;
    for (bt_idx j = 0; j < cell->n_contacts; j++) {
        if (!is_hard(cell, j)) continue;
        const bt_contact *u = &cell->contacts[j];
        for (int c = 0; c < u->n; c++)
            t->most = bt_max(t->most, -bt_normal_velocity(u, c, &free[u->a], &free[u->b]));
        bt_vel va = change[u->a], vb = change[u->b];
        bt_apply(u, u->ln[0] + u->ln[1], u->ln[0] * u->ran[0] + u->ln[1] * u->ran[1],
                 u->ln[0] * u->rbn[0] + u->ln[1] * u->rbn[1], 0, inv[u->a], inv[u->b], &va, &vb);
        bt_store(&change[u->a], inv[u->a], &va);
        bt_store(&change[u->b], inv[u->b], &vb);
    }
}

/// A of each island into share.
static void approach(bt_world *w, bt_islands *s)
{
    const bt_cells *ts = w->cells;
    const bt_vel *v = w->bodies.vel;
    bt_islands_clear(w, s);
    for (bt_idx i = 0; i < ts->n_order; i++) {
        const bt_cell *cell = &ts->cell[ts->order[i]];
        for (bt_idx j = 0; j < cell->n_contacts; j++) {
            if (!is_hard(cell, j)) continue;
            const bt_contact *u = &cell->contacts[j];
            double power = 0;
            for (int c = 0; c < u->n; c++)
                power -= u->ln[c] * (bt_normal_velocity(u, c, &v[u->a], &v[u->b]) + u->bias[c]);
            bt_sum_add(&s->sum[bt_islands_of(w, s, u)], power);
        }
    }
    bt_islands_add(w, s);
    for (bt_idx i = 0; i < w->bodies.n; i++) s->share[i] = bt_sum_value(&s->sum[i]);
}

/// P of each island into sum.
static void imbalance(bt_world *w, bt_islands *s)
{
    const bt_bodies *b = &w->bodies;
    const bt_cells *ts = w->cells;
    bt_islands_clear(w, s);
    for (bt_idx k = 0; k < ts->n_busy; k++) {
        const bt_cell *cell = &ts->cell[ts->busy[k]];
        for (bt_idx i = cell->first; cell->own && i < cell->end; i++) {
            const bt_vel *d = &w->solver->shift[i];
            if (b->inv[i].m == 0 || (d->x == 0 && d->y == 0 && d->w == 0)) continue;
            const double moment = b->inv[i].i > 0 ? fabs(d->w) / (b->inv[i].i * b->radius[i]) : 0;
            bt_sum_add(&s->sum[bt_islands_root(s, i)], bt_hypot(d->x, d->y) / b->inv[i].m + moment);
        }
    }
    bt_islands_add(w, s);
}

bool bt_locked(bt_world *w)
{
    bt_islands *s = w->solver->islands;
    bt_totals t = {.most = w->par.tolerance};
    bt_solver_make_shift(w);
    bt_phases_everywhere(w, no_change, NULL);
    bt_phases_run(w, push, NULL, w->solver->shift, &t);
    bt_domain_maxima(w, &t.most, 1);
    bt_domain_settle(w, w->solver->shift);
    bt_islands_make(w, s, is_hard);
    approach(w, s);
    imbalance(w, s);
    double found = 0;
    for (bt_idx i = 0; i < w->bodies.n; i++)
        if (s->root[i] == i && s->share[i] > BT_LOCKED_SPEEDS * t.most * bt_sum_value(&s->sum[i])) found = 1;
    bt_domain_maxima(w, &found, 1);
    return found > 0;
}
