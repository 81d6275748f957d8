// SPDX-License-Identifier: MIT
// Split-impulse position projection: overlap is removed by displacements that never become velocities.
//
// With the gaps predicted for the end of the step, g2 = g + Δt J_n U2, find displacements D = M̃⁻¹ J_nᵀ p, M̃ as in
// solver.h, with
//     0 ≤ p ⟂ J_n D + g2 + slop ≥ 0
// by the same rows without friction, in rounds over the points that bear or overlap (rounds.h). Touching contacts (g2 ≥
// −slop) take part, so that pushing two floes apart does not press either into a third. Velocity-level correction
// (Baumgarte) would add kinetic energy and load that is not there (Metrikin 2014).
//
// Second pass. The gaps above are linear in the turns of a step. Two bodies that turn by θ against each other may end
// θ²/2 of their radii inside each other: at 5 s a floe that rolls along a hull does. So where a turn can have left more
// than LEFT slops, those pairs are looked for anew where they are now: the floe that rolls along a hull touches it
// metres from where it did. If one of them is that deep, their new rows part the bodies once more, with the rows of all
// other pairs as they were; then contacts are again those that bore the loads of the step. Most steps have no such
// turn; most that have need no second pass. Not for the plain reference, which also makes the fields.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "contact/law.h"
#include "contact/pack.h"
#include "contact/row.h"
#include "solve/solver.h"
#include "partition/domain.h"
#include "solve/batch.h"
#include "solve/kernel.h"
#include "space/phases.h"
#include "solve/rounds.h"

enum { TURNS, N_FOUND };
enum { LEFT = 5 }; // slops that a turn may leave as overlap: half of what a run warns of, assumed

/// May the turn of contact j in this step, whose gaps are those at its end, have left more than `least` of overlap, m?
/// Only of pairs that touch with their outlines as they are: what has given way, as that of sheets, is no overlap.
static bool turns(const bt_world *w, const bt_cell *cell, bt_idx j, double least)
{
    const bt_bodies *b = &w->bodies;
    const bt_contact *u = &cell->contacts[j];
    const bt_vel *va = &b->vel[u->a], *vb = &b->vel[u->b];
    const double turn = w->par.dt * fabs(vb->w - va->w);
    if (turn == 0) return false;
    const double *g = cell->gaps[j].gap, gap = u->n > 1 ? bt_min(g[0], g[1]) : g[0];
    const double slip = w->par.dt * fabs(bt_tangent_velocity(u, va, vb));
    const double error = turn * (0.5 * turn * (b->radius[u->a] + b->radius[u->b]) + slip);
    if (!(bt_max(gap, -w->par.slop) - error < -least)) return false;
    if (!cell->laws.limits) return true;
    const bt_limit *l = &cell->laws.limits[j];
    for (int law = 0; law < BT_ALL_LAWS; law++)
        if (l->record[law] >= 0) return false;
    return l->grown[0] == 0 && l->grown[1] == 0;
}

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
            if (g->row == BT_ROW_RELEASED) { // no row
                g->gap[i] = w->par.dt * u->bias[i];
                continue;
            }
            g->gap[i] += w->par.dt * bt_normal_velocity(u, i, &w->bodies.vel[u->a], &w->bodies.vel[u->b]);
            if (cell->laws.limits) g->gap[i] += cell->laws.limits[j].grown[i]; // what has given way in this step
            t->most = bt_max(t->most, -g->gap[i]);
        }
        if (!w->par.plain_sweeps && turns(w, cell, j, LEFT * w->par.slop)) bt_sum_add(&t->sum[TURNS], 1);
    }
}

/// Keep contact j of cell k as it is.
static void keep(bt_solver *s, bt_idx k, bt_idx j, const bt_contact *u)
{
#pragma omp critical
    {
        if (s->n_kept == s->cap_kept)
            s->kept = bt_realloc(s->kept, (size_t)(s->cap_kept = 2 * s->cap_kept + 8), sizeof *s->kept);
        s->kept[s->n_kept++] = (bt_kept_rows){k, j, *u};
    }
}

/// Gaps after the first pass, and new rows of the pairs that have turned.
static void find_left(bt_world *w, bt_idx k, const void *shifted, bt_totals *t)
{
    bt_cell *cell = &w->cells->cell[k];
    const bt_vel *d = w->solver->shift;
    for (bt_idx j = 0; j < cell->n_contacts; j++) {
        bt_contact *u = &cell->contacts[j];
        bt_gaps *g = &cell->gaps[j];
        for (int i = 0; i < u->n; i++)
            if (*(const bool *)shifted) g->gap[i] += bt_normal_velocity(u, i, &d[u->a], &d[u->b]);
        if (!turns(w, cell, j, LEFT * w->par.slop)) continue;
        bt_manifold m;
        const bt_pair *p = &cell->search.pairs[u->pair];
        bt_axes axes = p->axes;
        if (!bt_contacts_parts(w, u->a, u->b, p->part, 0, (int)(g->feature[0] >> 31), &m, &axes)) continue;
        keep(w->solver, k, j, u);
        bt_pack_rows(w, &m, u);
        for (int i = 0; i < m.n_points; i++) {
            g->gap[i] = m.p[i].gap;
            t->most = bt_max(t->most, -g->gap[i]);
        }
    }
    begin(w, cell); // with the new rows
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
    (void)t;
    const bt_problem *p = context;
    bt_cell *cell = &w->cells->cell[k];
    const bt_vel *d = w->solver->shift;
    const double slop = w->par.slop;
    bt_batch_unpack(cell);
    bt_rounds_list(cell);
    const bt_found f = in_batches(cell, p->plain) ? bt_batch_projection_residual(cell, slop, d, w->bodies.inv, p)
                                                  : residual_in_place(cell, slop, d, p);
    bt_rounds_found(cell, &f);
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

static void solve_apart(bt_world *w)
{
    bt_step_stats *st = &w->stats;
    bt_problem p = {.residual = residual_of_cell,
                    .sweep = project_cell,
                    .vel = w->solver->shift,
                    .tolerance = 0.1 * w->par.slop,
                    .cap = 0.9,
                    .length = 25,
                    .limit = (double)w->par.position_sweeps,
                    .plain = w->par.plain_sweeps};
    bt_rounds_scale(&p, w->cells);
    bt_work work = {0};
    bt_rounds_residual(w, &p, BT_BEGINS, &work);
    if (p.plain) // the reference, and what fields are shaken with: no residual pass, it ends with the updates
        while (work.sweeps < w->par.position_sweeps && (work.sweeps == 0 || work.residual > p.tolerance))
            work.residual = bt_rounds_sweep(w, &p, &work);
    else bt_rounds_run(w, &p, &work);
    st->position_sweeps += work.sweeps;
    st->position_updates += work.updates;
    st->projected = st->projected && work.residual <= p.tolerance;
}

/// Part what overlaps by the gaps as they have been found: bt_solver.shift.
static void part(bt_world *w)
{
    const bt_cells *ts = w->cells;
    bt_solver *s = w->solver;
    bt_solver_make_shift(w);
    for (bt_idx j = 0; j < ts->n_busy; j++) {
        const bt_idx k = ts->busy[j];
        if (k == ts->n - 1 || bt_cells_moves(ts, k))
            memset(s->shift + ts->cell[k].first, 0, (size_t)(ts->cell[k].end - ts->cell[k].first) * sizeof *s->shift);
    }
    bt_domain_solve(w, solve_apart, s->shift);
}

void bt_solver_project(bt_world *w)
{
    bt_solver *s = w->solver;
    bt_step_stats *st = &w->stats;
    st->position_sweeps = st->position_updates = 0;
    st->projected = true;
    s->n_kept = 0;
    bt_totals t = {.n_sums = N_FOUND};
    bt_phases_any_order(w, find_overlap, NULL, &t);
    bt_domain_reduce(w, &t);
    s->turned = bt_sum_value(&t.sum[TURNS]) > 0;
    s->shifted = t.most > w->par.slop;
    if (s->shifted) part(w);
}

bool bt_solver_project_again(bt_world *w)
{
    bt_solver *s = w->solver;
    if (!s->turned) return false;
    bt_totals t = {0};
    bt_phases_any_order(w, find_left, &s->shifted, &t);
    bt_domain_reduce(w, &t);
    const bool deep = t.most > LEFT * w->par.slop;
    if (deep) part(w);
    for (bt_idx i = 0; i < s->n_kept; i++) {
        const bt_kept_rows *q = &s->kept[i];
        w->cells->cell[q->cell].contacts[q->at] = q->was;
    }
    s->shifted = s->shifted || deep;
    return deep;
}
