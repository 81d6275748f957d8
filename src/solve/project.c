// SPDX-License-Identifier: MIT
// Split-impulse position projection: overlap is removed by displacements that never become velocities.
//
// With the gaps predicted for the end of the step, g2 = g + Δt J_n U2, find displacements D = M̃⁻¹ J_nᵀ p, M̃ as in
// solver.h, with
//     0 ≤ p ⟂ J_n D + g2 + slop ≥ 0
// by the same rows without friction, in rounds over the points that bear or overlap (rounds.h). Touching contacts (g2 ≥
// −slop) take part, so that pushing two floes apart does not press either into a third. Velocity-level correction
// (Baumgarte) would add kinetic energy and load that is not there (Metrikin 2014).
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "contact/law.h"
#include "solve/solver.h"
#include "partition/domain.h"
#include "solve/batch.h"
#include "solve/kernel.h"
#include "space/phases.h"
#include "solve/rounds.h"

/// Fields are shaken plain, and keep their bits.
static bool in_batches(const bt_cell *cell, bool plain) { return bt_batch_projects(cell) && !plain; }

/// No multipliers yet.
static void begin(const bt_world *w, bt_cell *cell)
{
    bt_rounds_list(cell);
    bt_batch_begin(cell);
    if (!in_batches(cell, w->par.plain_sweeps)) bt_rounds_in_place(cell, w->bodies.inv);
}

static void find_overlap(bt_world *w, bt_idx k, const void *context, bt_totals *t)
{
    (void)context;
    bt_cell *cell = &w->cells->cell[k];
    begin(w, cell);
    for (bt_idx j = 0; j < cell->n_contacts; j++) {
        const bt_contact *u = &cell->contacts[j];
        bt_gaps *g = &cell->gaps[j];
        for (int i = 0; i < u->n; i++) {
            g->gap[i] += w->par.dt * bt_normal_velocity(u, i, &w->bodies.vel[u->a], &w->bodies.vel[u->b]);
            if (cell->laws.limits) g->gap[i] += cell->laws.limits[j].grown[i]; // what has given way in this step
            t->most = bt_max(t->most, -g->gap[i]);
        }
    }
}

static bt_found residual_in_place(bt_cell *cell, double slop, const bt_vel *d, const bt_problem *p)
{
    bt_found f = {0};
    for (bt_idx j = 0; j < cell->n_contacts; j++) {
        const bt_contact *u = &cell->contacts[j];
        const bt_gaps *g = &cell->gaps[j];
        const bt_in_place *o = &cell->work.in_place[j];
        double worst = 0;
        bool on = p->plain;
        for (int i = 0; i < u->n; i++) {
            const double open = bt_opening(u, g, slop, i, &d[u->a], &d[u->b]), x = o->multiplier[i];
            const double r = fabs(bt_max(0, x - open * o->mass.mn[i]) - x) * o->mass.w[i];
            worst = bt_max(worst, r);
            f.squares += r * r;
            on = on || x > 0 || x != o->before[i] || !(open >= 0);
        }
        f.most = bt_max(f.most, worst);
        f.bad += worst > BT_NEAR * p->tolerance;
        f.rows += u->n;
        if (on) cell->work.list[cell->work.n_list++] = j;
    }
    return f;
}

static void residual_of_cell(bt_world *w, bt_idx k, const void *context, bt_totals *t)
{
    const bt_problem *p = context;
    bt_cell *cell = &w->cells->cell[k];
    const bt_vel *d = w->solver->shift;
    const double slop = w->par.slop;
    bt_batch_unpack(cell);
    bt_rounds_list(cell);
    const bt_found f = in_batches(cell, p->plain) ? bt_batch_projection_residual(cell, slop, d, w->bodies.inv, p)
                                                  : residual_in_place(cell, slop, d, p);
    t->most = bt_max(t->most, f.most);
    bt_rounds_found(p, cell, &f, t);
}

static void project_cell(bt_world *w, bt_idx k, const void *context, bt_totals *t)
{
    const bt_sweep *o = context;
    bt_cell *cell = &w->cells->cell[k];
    if (cell->work.n_list == 0) return;
    if (in_batches(cell, o->problem->plain)) {
        int64_t done = 0;
        double most = 0;
        const double against = bt_batch_project(cell, w->par.slop, w->solver->shift, w->bodies.inv, o, &done, &most);
        t->most = bt_max(t->most, most);
        bt_sum_add(&t->sum[BT_SWEEP_UPDATES], (double)done);
        if (o->moves) bt_rounds_moved(cell, o, against, t);
        return;
    }
    bt_moved moved;
    if (o->moves) bt_moved_begin(&moved, cell);
    for (bt_idx j = 0; o->moves && j < cell->work.n_list; j++) {
        bt_in_place *u = &cell->work.in_place[cell->work.list[j]];
        bt_rounds_move(o, u->multiplier, u->before, moved.y[j], 2);
    }
    for (bt_idx j = 0; j < cell->work.n_list; j++) {
        const bt_idx u = cell->work.list[j];
        bt_in_place *p = &cell->work.in_place[u];
        t->most = bt_max(t->most, bt_project_contact(&cell->contacts[u], &p->mass, &cell->gaps[u], p->multiplier,
                                                     w->par.slop, w->solver->shift, w->bodies.inv));
    }
    bt_sum_add(&t->sum[BT_SWEEP_UPDATES], cell->work.n_list);
    if (!o->moves) return;
    double against = 0;
    for (bt_idx j = 0; j < cell->work.n_list; j++) {
        const bt_in_place *u = &cell->work.in_place[cell->work.list[j]];
        for (int i = 0; i < 2; i++)
            against += bt_rounds_against(u->mass.w[i], u->multiplier[i], u->before[i], moved.y[j][i]);
    }
    bt_moved_end(&moved, cell, o, against, t);
}

void bt_solver_make_shift(bt_world *w)
{
    bt_solver *s = w->solver;
    if (s->shift && w->bodies.n <= s->cap_bodies) return;
    s->cap_bodies = w->bodies.n > 0 ? w->bodies.n : 1; // a rank may own nothing
    free(s->shift);
    s->shift = bt_alloc_aligned((size_t)s->cap_bodies, sizeof *s->shift);
}

void bt_solver_project(bt_world *w)
{
    bt_solver *s = w->solver;
    const bt_cells *ts = w->cells;
    bt_step_stats *st = &w->stats;
    st->position_sweeps = st->position_updates = 0;
    st->projected = true;
    bt_totals t = {0};
    bt_phases_any_order(w, find_overlap, NULL, &t);
    bt_domain_reduce(w, &t);
    s->shifted = t.most > w->par.slop;
    if (!s->shifted) return;

    bt_solver_make_shift(w);
    for (bt_idx j = 0; j < ts->n_busy; j++) {
        const bt_idx k = ts->busy[j];
        if (k == ts->n - 1 || bt_cells_moves(ts, k))
            memset(s->shift + ts->cell[k].first, 0, (size_t)(ts->cell[k].end - ts->cell[k].first) * sizeof *s->shift);
    }
    bt_problem p = {.residual = residual_of_cell,
                    .sweep = project_cell,
                    .vel = s->shift,
                    .tolerance = 0.1 * w->par.slop,
                    .cap = 0.9,
                    .length = 25,
                    .limit = (double)w->par.position_sweeps,
                    .plain = w->par.plain_sweeps};
    bt_rounds_scale(&p, ts);
    bt_work work = {0};
    bt_rounds_residual(w, &p, false, &work);
    if (p.plain) // the reference, and what fields are shaken with: no residual pass, it ends with the updates
        while (work.sweeps < w->par.position_sweeps && (work.sweeps == 0 || work.residual > p.tolerance))
            work.residual = bt_rounds_sweep(w, &p, &work);
    else bt_rounds_run(w, &p, &work);
    st->position_sweeps = work.sweeps;
    st->position_updates = work.updates;
    st->projected = work.residual <= p.tolerance;
    bt_domain_settle(w, w->solver->shifted ? w->solver->shift : NULL);
}
