// SPDX-License-Identifier: MIT
// Sweeps to tolerance; equations and order in solve/solver.h.
#include "solve/solver.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "bergtow/sum.h"
#include "body/bodies.h"
#include "contact/law_pair.h"
#include "contact/pack.h"
#include "partition/domain.h"
#include "solve/batch.h"
#include "solve/islands.h"
#include "solve/kernel.h"
#include "solve/rounds.h"
#include "space/phases.h"
#include "tow/tow.h"

// --- restitution -----------------------------------------------------------------------------------------------------

// The work of each island's contacts, and what of its restitution is left.

/// With the restitution of the bodies, whatever an earlier solution of this step has left of it.
static void restore(bt_world *w, bt_idx k, const void *context, bt_totals *t)
{
    (void)context;
    const bt_cell *cell = &w->cells->cell[k];
    for (bt_idx j = 0; j < cell->n_contacts; j++) {
        bt_contact *u = &cell->contacts[j];
        t->most = bt_max(t->most, bt_pair_restitution(&w->bodies, u->a, u->b));
        bt_pack_bias(w, u, &cell->gaps[j], 1);
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

// --- a step ----------------------------------------------------------------------------------------------------------

#ifdef __GLIBC__
#include <malloc.h>
#endif

#define UPDATES 6.0 // of every contact that one of max_sweeps stands for
#define ENOUGH 0.3 // of the tolerance: a cell that changes less is not swept again in the same turn

bt_solver *bt_solver_create(void)
{
    bt_solver *s = bt_alloc(1, sizeof *s);
    s->islands = bt_islands_create();
    return s;
}

static void give_back(bt_solver *s)
{
    free(s->before);
    free(s->shift);
    free(s->kept);
    s->before = s->shift = NULL;
    s->kept = NULL;
    s->cap_before = s->cap_bodies = s->cap_kept = 0;
}

void bt_solver_free(bt_solver *s)
{
    if (!s) return;
    bt_islands_free(s->islands);
    give_back(s);
    free(s);
}

void bt_solver_rest(bt_world *w)
{
    give_back(w->solver);
    bt_cells_rest(w->cells);
#ifdef __GLIBC__
    // Free pieces of some kilobytes between pieces in use are of no use to arrays of all floes, and would stay.
    malloc_trim(0);
#endif
}

/// The line, in the pass of the last cell on the rank that owns the large bodies.
static bt_tow *line_of(const bt_world *w, bt_idx cell)
{
    return cell == w->cells->n - 1 && bt_tow_has_line(w->tow) ? w->tow : NULL;
}

// --- velocities from impulses, and what they leave of the contact law ------------------------------------------------

/// Impulses of the last step, without what a new geometry, or a bound, no longer allows; nothing moves yet.
static void start_impulses(bt_cell *cell, const bt_inv *inv)
{
    const bool in_place = !bt_batch_is_for(cell);
    bt_rounds_list(cell);
    bt_batch_begin(cell);
    if (in_place) bt_rounds_in_place(cell, inv);
    for (bt_idx i = 0; i < cell->n_contacts; i++) {
        bt_contact *u = &cell->contacts[i];
        for (int j = 0; cell->laws.limits && j < u->n; j++) u->ln[j] = bt_min(u->ln[j], cell->laws.limits[i].most[j]);
        if (u->n > 0) u->lt = bt_clamp(u->lt, u->mu * (u->ln[0] + u->ln[1]));
        else bt_onto_sheets(&cell->laws.limits[i], &u->ln[0], &u->lt);
        if (!in_place) continue;
        double *x = cell->work.in_place[i].before;
        x[0] = u->ln[0], x[1] = u->ln[1], x[2] = u->lt;
    }
}

static void apply_impulses(bt_world *w, bt_idx k, const void *context, bt_totals *t)
{
    const bool warm = *(const bool *)context; // impulses are those of the last step
    bt_cell *cell = &w->cells->cell[k];
    bt_vel *v = w->bodies.vel;
    const bt_inv *inv = w->bodies.inv;
    bt_batch_unpack(cell);
    if (warm) start_impulses(cell, inv);
    for (bt_idx i = 0; i < cell->n_contacts; i++) {
        const bt_contact *u = &cell->contacts[i];
        const double total = u->ln[0] + u->ln[1];
        if (total == 0 && u->lt == 0) continue;
        t->most = 1;
        bt_vel va = v[u->a], vb = v[u->b];
        bt_apply(u, total, u->ln[0] * u->ran[0] + u->ln[1] * u->ran[1], u->ln[0] * u->rbn[0] + u->ln[1] * u->rbn[1],
                 u->lt, inv[u->a], inv[u->b], &va, &vb);
        bt_store(&v[u->a], inv[u->a], &va);
        bt_store(&v[u->b], inv[u->b], &vb);
    }
    bt_tow *line = line_of(w, k);
    if (!line) return;
    bt_vel *towed = &v[bt_world_towed(w)];
    const bt_inv by = inv[bt_world_towed(w)];
    bt_tow_apply(line, towed, by);
    // On a heavy body the residual of a tension that is newtons off, Δλ W, is below the tolerance before the first
    // sweep. So the line has its exact update in every step, not only in steps with sweeps.
    if (warm) bt_tow_update(line, towed, by);
}

/// Of the contacts of a cell that is swept in place.
static bt_found residual_in_place(bt_cell *cell, const bt_vel *v, const bt_problem *p)
{
    const double near = BT_NEAR * p->tolerance;
    bt_found f = {0};
    for (bt_idx i = 0; i < cell->n_contacts; i++) {
        const bt_contact *u = &cell->contacts[i];
        const bt_mass *m = &cell->work.in_place[i].mass;
        const bt_limit *limit = cell->laws.limits ? &cell->laws.limits[i] : NULL;
        const double r = limit ? bt_contact_residual(u, m, limit, v, p->tolerance, &f.squares)
                               : bt_contact_residual(u, m, NULL, v, p->tolerance, &f.squares);
        f.most = bt_max(f.most, r);
        f.bad += r > near;
        f.rows += u->n + 1 + (u->n == 0);
        const double *x = cell->work.in_place[i].before;
        // or did before the last sweep
        bool on =
            p->plain || u->ln[0] + u->ln[1] > 0 || u->lt != 0 || x[0] != u->ln[0] || x[1] != u->ln[1] || x[2] != u->lt;
        if (limit && u->n == 0) on = on || r > 0;
        for (int c = 0; !on && c < u->n; c++) on = !(bt_normal_velocity(u, c, &v[u->a], &v[u->b]) + u->bias[c] >= 0);
        if (on) cell->work.list[cell->work.n_list++] = i;
    }
    return f;
}

/// Residual of a cell, and its list: contacts that bear load, or close. Others would be left as they are.
static void residual_of_cell(bt_world *w, bt_idx k, const void *context, bt_totals *t)
{
    (void)t;
    const bt_problem *p = context;
    bt_cell *cell = &w->cells->cell[k];
    const bt_vel *v = w->bodies.vel;
    bt_batch_unpack(cell);
    bt_rounds_list(cell);
    bt_found f = bt_batch_is_for(cell) ? bt_batch_residual(cell, v, w->bodies.inv, p) : residual_in_place(cell, v, p);
    const bt_tow *line = line_of(w, k);
    if (line) {
        const double r = bt_tow_residual(line, &v[bt_world_towed(w)]);
        f.most = bt_max(f.most, r);
        f.squares += r * r;
        f.rows++;
        f.bad += r > BT_NEAR * p->tolerance;
    }
    bt_rounds_found(cell, &f);
}

static void free_velocities(bt_world *w, bt_idx k, const void *context, bt_totals *t)
{
    (void)context, (void)t;
    const bt_cell *cell = &w->cells->cell[k];
    bt_bodies *b = &w->bodies;
    if (k == w->cells->n - 1 || w->cells->awake[k])
        memcpy(b->vel + cell->first, b->vel_free + cell->first, (size_t)(cell->end - cell->first) * sizeof *b->vel);
}

/// Velocities U* + M⁻¹ Jᵀ λ from scratch, so that what increments have rounded away does not build up. True when some
/// impulse on this rank is not zero.
static bool form_velocities(bt_world *w, bool warm)
{
    bt_totals t = {0};
    bt_phases_run(w, &(bt_before){free_velocities, NULL}, apply_impulses, &warm, w->bodies.vel, &t);
    return t.most > 0;
}

static void settle(bt_world *w) { form_velocities(w, false); }

// --- sweeps ----------------------------------------------------------------------------------------------------------

/// Memory is read in the order of the contacts, but with gaps too wide for the hardware to foresee.
static inline void fetch_ahead(const bt_cell *cell, bt_idx j)
{
    if (j >= cell->work.n_list) return;
    const char *line = (const char *)&cell->contacts[cell->work.list[j]];
    for (size_t k = 0; k < sizeof(bt_contact); k += 64) __builtin_prefetch(line + k);
}

/// Every listed contact once; returns the largest update, m/s.
static double update_list(bt_cell *cell, bt_vel *v, const bt_inv *inv)
{
    enum { AHEAD = 3 };
    double most = 0;
    for (bt_idx j = 0; j < cell->work.n_list; j++) {
        const bt_idx i = cell->work.list[j];
        fetch_ahead(cell, j + AHEAD);
        const bt_limit *k = cell->laws.limits ? &cell->laws.limits[i] : NULL;
        most = bt_max(most, bt_update_contact(&cell->contacts[i], &cell->work.in_place[i].mass, k, v, inv));
    }
    return most;
}

static void move_contacts(const bt_sweep *o, bt_cell *cell, double (*y)[3])
{
    for (bt_idx j = 0; j < cell->work.n_list; j++) {
        bt_contact *u = &cell->contacts[cell->work.list[j]];
        double *x = cell->work.in_place[cell->work.list[j]].before;
        bt_rounds_move(o, u->ln, x, y[j], 2);
        bt_rounds_move(o, &u->lt, x + 2, y[j] + 2, 1);
    }
}

static double contacts_against(const bt_cell *cell, double (*y)[3])
{
    double sum = 0;
    for (bt_idx j = 0; j < cell->work.n_list; j++) {
        const bt_contact *u = &cell->contacts[cell->work.list[j]];
        const bt_in_place *o = &cell->work.in_place[cell->work.list[j]];
        const bt_mass *m = &o->mass;
        const double *x = o->before;
        sum += bt_rounds_against(m->w[0], u->ln[0], x[0], y[j][0]) +
               bt_rounds_against(m->w[1], u->ln[1], x[1], y[j][1]) + bt_rounds_against(m->wt, u->lt, x[2], y[j][2]);
    }
    return sum;
}

static void sweep_in_batches(bt_world *w, bt_cell *cell, const bt_sweep *o, bt_totals *t)
{
    int64_t done = 0;
    double most = 0;
    const double against = bt_batch_sweep(cell, w->bodies.vel, w->bodies.inv, o, w->par.inner_sweeps,
                                          ENOUGH * o->problem->tolerance, &done, &most);
    t->most = bt_max(t->most, most);
    cell->work.updates += done;
    bt_sum_add(&t->sum[BT_SWEEP_UPDATES], (double)done);
    if (o->moves) bt_rounds_moved(cell, o, against, t);
}

static void sweep_cell(bt_world *w, bt_idx k, const void *context, bt_totals *t)
{
    const bt_sweep *o = context;
    bt_cell *cell = &w->cells->cell[k];
    bt_tow *line = line_of(w, k);
    if (cell->work.n_list == 0 && !line) return;
    if (bt_batch_is_for(cell)) {
        sweep_in_batches(w, cell, o, t);
        return;
    }
    bt_vel *v = w->bodies.vel, *towed = line ? &v[bt_world_towed(w)] : NULL;
    double line_y[BT_MAX_BRANCHES] = {0};
    bt_moved moved;
    if (o->moves) {
        bt_moved_begin(&moved, cell);
        move_contacts(o, cell, moved.y);
        for (int c = 0; line && c < line->n_branches; c++)
            bt_rounds_move(o, &line->branch[c].lambda, &w->solver->line_before[c], &line_y[c], 1);
    }
    int64_t times = 0;
    double most = INFINITY;
    for (; times < w->par.inner_sweeps || times == 0; times++) {
        // more would be for nothing until the neighbours have changed
        if (most <= ENOUGH * o->problem->tolerance) break;
        most = update_list(cell, v, w->bodies.inv);
        if (line) most = bt_max(most, bt_tow_update(line, towed, w->bodies.inv[bt_world_towed(w)]));
        if (times == 0) t->most = bt_max(t->most, most);
    }
    cell->work.updates += times * cell->work.n_list;
    bt_sum_add(&t->sum[BT_SWEEP_UPDATES], (double)(times * cell->work.n_list));
    if (!o->moves) return;
    double against = contacts_against(cell, moved.y);
    for (int c = 0; line && c < line->n_branches; c++)
        against += bt_rounds_against(line->branch[c].w, line->branch[c].lambda, w->solver->line_before[c], line_y[c]);
    bt_moved_end(&moved, cell, o, against, t);
}

static void keep_impulses(bt_world *w, bt_idx k, const void *context, bt_totals *t)
{
    (void)t;
    const bt_keeping what = *(const bt_keeping *)context;
    bt_cell *cell = &w->cells->cell[k];
    bt_tow *line = line_of(w, k);
    if (what == BT_FORGET) {
        free(cell->work.best);
        cell->work.best = NULL;
        return;
    }
    bt_batch_unpack(cell);
    if (!cell->work.best) cell->work.best = bt_alloc((size_t)cell->n_contacts + 1, sizeof *cell->work.best);
    for (bt_idx i = 0; i < cell->n_contacts; i++) {
        bt_contact *u = &cell->contacts[i];
        double *x = cell->work.best[i];
        if (what == BT_PUT_BACK) u->ln[0] = x[0], u->ln[1] = x[1], u->lt = x[2];
        else x[0] = u->ln[0], x[1] = u->ln[1], x[2] = u->lt;
    }
    for (int c = 0; line && c < line->n_branches; c++) {
        double *x = &w->solver->line_best[c], *now = &line->branch[c].lambda;
        if (what == BT_PUT_BACK) *now = *x;
        else *x = *now;
    }
}

static bt_problem contact_problem(const bt_world *w)
{
    bt_problem p = {
        .residual = residual_of_cell,
        .sweep = sweep_cell,
        .keep = keep_impulses,
        .settle = settle,
        .vel = w->bodies.vel,
        .tolerance = w->par.tolerance,
        .cap = 0.9,
        .length = 20,
        .limit = (double)w->par.max_sweeps * (w->par.plain_sweeps ? 1 : UPDATES),
        .plain = w->par.plain_sweeps,
    };
    bt_rounds_scale(&p, w->cells);
    return p;
}

/// Start from the impulses of the step before. True when there are any.
static bool warm_start(bt_world *w)
{
    bt_tow *line = w->cells->cell[w->cells->n - 1].own ? line_of(w, w->cells->n - 1) : NULL;
    if (line) bt_tow_warm_start(line, w->par.warm_start);
    double pressed = form_velocities(w, true);
    bt_domain_maxima(w, &pressed, 1);
    return pressed > 0;
}

static void residual_of_more(bt_world *w, bt_idx k, const void *context, bt_totals *t)
{
    bt_cell *cell = &w->cells->cell[k];
    if (cell->news == BT_SAME_CONTACTS) return;
    start_impulses(cell, w->bodies.inv);
    residual_of_cell(w, k, context, t);
    t->most = bt_max(t->most, cell->news == BT_MORE_CONTACTS ? cell->work.found.most : INFINITY);
    bt_sum_add(&t->sum[0], cell->n_contacts);
}

/// Does the solution at hand hold with the contacts that have been added to it? They bear no load, so that it has the
/// velocities of all impulses still, and the residual elsewhere is as it was.
static bool holds_with_more(bt_world *w)
{
    bt_step_stats *st = &w->stats;
    const bt_problem p = contact_problem(w);
    bt_totals t = {.n_sums = 1};
    bt_phases_any_order(w, residual_of_more, &p, &t);
    bt_domain_reduce(w, &t);
    st->residual_checks += (int64_t)bt_sum_value(&t.sum[0]);
    if (!(t.most <= p.tolerance)) return false;
    st->residual = bt_max(st->residual, t.most);
    return true;
}

static void sweep_to_tolerance(bt_world *w)
{
    bt_step_stats *st = &w->stats;
    const bt_problem p = contact_problem(w);
    bt_work work = {0};
    const bool pressed = warm_start(w);
    bt_rounds_residual(w, &p, BT_BEGINS, &work);
    // An impulse below the tolerance that is carried over from step to step would push for ever: one sweep at least.
    if (pressed && work.residual <= p.tolerance) {
        bt_rounds_sweep(w, &p, &work);
        bt_rounds_residual(w, &p, BT_SWEPT, &work);
    }
    if (work.residual > p.tolerance) bt_rounds_run(w, &p, &work);
    st->sweeps += work.sweeps;
    st->contact_updates += work.updates;
    st->contact_moves += work.moves;
    st->residual_checks += work.checks;
    st->residual = work.residual;
    st->residual_rms = work.rows > 0 ? sqrt(work.squares / (double)work.rows) : 0;
    st->converged = work.residual <= p.tolerance;
}

static void solve(bt_world *w)
{
    bt_solver *s = w->solver;
    if (s->extends && holds_with_more(w)) return;
    s->rebounds = bt_restitution_begin(w);
    for (;;) {
        sweep_to_tolerance(w);
        if (!s->rebounds) break;
        bt_domain_settle(w, NULL);
        if (!bt_restitution_lower(w)) break;
        w->stats.restitution_cut = true;
    }
}

void bt_solver_solve(bt_world *w, bool extends)
{
    bt_solver *s = w->solver;
    s->extends = extends && !s->rebounds && !w->par.plain_sweeps;
    bt_step_stats *st = &w->stats;
    st->restitution_cut = false;
    // the displacements of the last step are over, and their array is of the bodies that were here then
    s->shifted = false;
    st->sweeps = st->contact_updates = st->contact_moves = st->residual_checks = 0;
    if (bt_domain_is_idle(w)) settle(w);
    bt_domain_solve(w, solve, NULL);
}
