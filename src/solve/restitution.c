// SPDX-License-Identifier: MIT
// The work of each island's contacts, and what of its restitution is left.
#include "solve/restitution.h"

#include <math.h>

#include "solve/islands.h"
#include "solve/solver.h"
#include "bergtow/sum.h"
#include "space/phases.h"
#include "partition/domain.h"
#include "contact/work.h"
#include "contact/pack.h"

/// With the restitution of the bodies, whatever an earlier solution of this step has left of it.
static void restore(bt_world *w, bt_idx k, const void *context, bt_totals *t)
{
    (void)context;
    const bt_cell *cell = &w->cells->cell[k];
    for (bt_idx j = 0; j < cell->n_contacts; j++) {
        t->most = bt_max(t->most, w->bodies.restitution[cell->contacts[j].b]);
        bt_pack_bias(w, &cell->contacts[j], &cell->gaps[j], 1);
    }
}

bool bt_restitution_begin(bt_world *w)
{
    if (!w->cells->rebounds) return false;
    bt_totals t = {0};
    bt_phases_any_order(w, restore, NULL, &t);
    bt_domain_maxima(w, &t.most, 1);
    if (t.most == 0) return false;
    bt_islands_make(w, w->solver->islands, NULL);
    return true;
}

bool bt_restitution_lower(bt_world *w)
{
    const bt_cells *ts = w->cells;
    bt_islands *s = w->solver->islands;
    bt_islands_clear(w, s);
    for (bt_idx i = 0; i < ts->n_order; i++) {
        const bt_cell *cell = &ts->cell[ts->order[i]];
        for (bt_idx j = 0; j < cell->n_contacts; j++) {
            const bt_contact *u = &cell->contacts[j];
            if (u->ln[0] + u->ln[1] == 0 || u->n == 0) continue; // what sheets take must not cover what rebounds give
            bt_sum_add(&s->sum[bt_islands_of(w, s, u)],
                       bt_contacts_work(w, u) - bt_contacts_unsolved_work(u, w->stats.residual));
        }
    }
    bt_islands_add(w, s);
    double any = 0;
    for (bt_idx i = 0; i < w->bodies.n; i++) {
        if (s->root[i] != i || s->share[i] == 0 || !(bt_sum_value(&s->sum[i]) > 0)) continue;
        s->share[i] = s->share[i] > 0.2 ? 0.5 * s->share[i] : 0;
        any = 1;
    }
    bt_domain_maxima(w, &any, 1);
    if (any == 0) return false;
    for (bt_idx i = 0; i < ts->n_order; i++) {
        bt_cell *cell = &ts->cell[ts->order[i]];
        for (bt_idx j = 0; j < cell->n_contacts; j++) {
            bt_contact *u = &cell->contacts[j];
            const double share = s->share[bt_islands_of(w, s, u)];
            if (share < 1) bt_pack_bias(w, u, &cell->gaps[j], share);
        }
    }
    return true;
}
