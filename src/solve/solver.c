// SPDX-License-Identifier: MIT
// Sweeps to tolerance; equations and order in solve/solver.h.
#include "solve/solver.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "tow/tow.h"
#include "solve/batch.h"
#include "partition/domain.h"
#include "solve/kernel.h"
#include "contact/pack.h"
#include "space/phases.h"
#include "solve/restitution.h"
#include "solve/rounds.h"

#define UPDATES 6.0 // of every unit that one of max_sweeps stands for
#define ENOUGH 0.3 // of the tolerance: a tile that changes less is not swept again in the same turn

bt_solver *bt_solver_create(void)
{
    bt_solver *s = bt_alloc(1, sizeof *s);
    s->islands = bt_islands_create();
    return s;
}

void bt_solver_free(bt_solver *s)
{
    if (!s) return;
    bt_islands_free(s->islands);
    free(s->before);
    free(s->shift);
    free(s);
}

/// The line, in the pass of the last tile on the rank that owns the large bodies.
static bt_tow *line_of(const bt_world *w, bt_idx tile)
{
    return tile == w->tiles->n - 1 && bt_tow_has_line(w->tow) ? w->tow : NULL;
}

// --- velocities from impulses, and what they leave of the contact law ------------------------------------------------

/// Impulses of the last step, without what a new geometry, or a bound, no longer allows; nothing moves yet.
static void start_impulses(bt_tile *tile)
{
    bt_rounds_list(tile);
    for (bt_idx i = 0; i < tile->n_units; i++) {
        bt_unit *u = &tile->units[i];
        for (int j = 0; tile->limits && j < u->n; j++) u->ln[j] = bt_min(u->ln[j], tile->limits[i].most[j]);
        if (u->n > 0) u->lt = bt_clamp(u->lt, u->mu * (u->ln[0] + u->ln[1]));
        else bt_onto_disc(tile->limits[i].flat[0], &u->ln[0], &u->lt);
        double *x = tile->before[i];
        x[0] = u->ln[0], x[1] = u->ln[1], x[2] = u->lt;
    }
}

static void apply_impulses(bt_world *w, bt_idx k, const void *context, bt_totals *t)
{
    const bool warm = *(const bool *)context; // impulses are those of the last step
    bt_tile *tile = &w->tiles->tile[k];
    bt_vel *v = w->bodies.vel;
    const bt_inv *inv = w->bodies.inv;
    bt_batch_unpack(tile);
    if (warm) start_impulses(tile);
    for (bt_idx i = 0; i < tile->n_units; i++) {
        const bt_unit *u = &tile->units[i];
        const double total = u->ln[0] + u->ln[1];
        if (total == 0 && u->lt == 0) continue;
        t->most = 1;
        bt_vel va = v[u->a], vb = v[u->b];
        bt_apply(u, total, u->ln[0] * u->ran[0] + u->ln[1] * u->ran[1], u->ln[0] * u->rbn[0] + u->ln[1] * u->rbn[1], u->lt, inv[u->a], inv[u->b], &va, &vb);
        bt_store(&v[u->a], inv[u->a], &va);
        bt_store(&v[u->b], inv[u->b], &vb);
    }
    bt_tow *line = line_of(w, k);
    if (!line) return;
    bt_vel *towed = &v[bt_world_towed(w)];
    const bt_inv by = inv[bt_world_towed(w)];
    bt_tow_apply(line, towed, by);
    // On a heavy body the residual of a tension that is newtons off, Δλ W, is below the tolerance before the first sweep. So
    // the line has its exact update in every step, not only in steps with sweeps.
    if (warm) bt_tow_update(line, towed, by);
}

/// Residual of a tile, and its list: units that bear load, or close. Others would be left as they are.
static void look_at_tile(bt_world *w, bt_idx k, const void *context, bt_totals *t)
{
    const bt_problem *p = context;
    bt_tile *tile = &w->tiles->tile[k];
    const bt_vel *v = w->bodies.vel;
    const double near = BT_NEAR * p->tolerance;
    double sum = 0;
    int64_t rows = 0, bad = 0;
    bt_batch_unpack(tile);
    bt_rounds_list(tile);
    for (bt_idx i = 0; i < tile->n_units; i++) {
        const bt_unit *u = &tile->units[i];
        const double r = tile->limits ? bt_unit_residual(u, &tile->limits[i], v, &sum) : bt_unit_residual(u, NULL, v, &sum);
        t->most = bt_max(t->most, r);
        bad += r > near;
        rows += u->n + 1 + (u->n == 0);
        const double *x = tile->before[i];
        bool on = p->plain || u->ln[0] + u->ln[1] > 0 || u->lt != 0 || x[0] != u->ln[0] || x[1] != u->ln[1] || x[2] != u->lt; // or did before the last sweep
        if (tile->limits && u->n == 0) on = on || r > 0;
        for (int c = 0; !on && c < u->n; c++) on = !(bt_normal_velocity(u, c, &v[u->a], &v[u->b]) + u->bias[c] >= 0);
        if (on) tile->list[tile->n_list++] = i;
    }
    const bt_tow *line = line_of(w, k);
    if (line) {
        const double r = bt_tow_residual(line, &v[bt_world_towed(w)]);
        t->most = bt_max(t->most, r);
        sum += r * r;
        rows++;
        bad += r > near;
    }
    bt_rounds_found(p, tile, sum, rows, bad, t);
}

static void free_velocities(bt_world *w, bt_idx k, const void *context, bt_totals *t)
{
    (void)context, (void)t;
    const bt_tile *tile = &w->tiles->tile[k];
    bt_bodies *b = &w->bodies;
    if (k == w->tiles->n - 1 || w->tiles->awake[k]) memcpy(b->vel + tile->first, b->vel_free + tile->first, (size_t)(tile->end - tile->first) * sizeof *b->vel);
}

/// Velocities U* + M⁻¹ Jᵀ λ from scratch, so that what increments have rounded away does not build up. True when some impulse on this
/// rank is not zero.
static bool form_velocities(bt_world *w, bool warm)
{
    bt_phases_everywhere(w, free_velocities, NULL);
    bt_totals t = {0};
    bt_phases_run(w, apply_impulses, &warm, w->bodies.vel, &t);
    return t.most > 0;
}

static void settle(bt_world *w) { form_velocities(w, false); }

// --- sweeps ----------------------------------------------------------------------------------------------------------

/// Memory is read in the order of the units, but with gaps too wide for the hardware to foresee.
static inline void fetch_ahead(const bt_tile *tile, bt_idx j)
{
    if (j >= tile->n_list) return;
    const char *line = (const char *)&tile->units[tile->list[j]];
    for (size_t k = 0; k < sizeof(bt_unit); k += 64) __builtin_prefetch(line + k);
}

/// Every listed unit once; returns the largest update, m/s.
static double update_list(bt_tile *tile, bt_vel *v, const bt_inv *inv)
{
    enum { AHEAD = 3 };
    double most = 0;
    for (bt_idx j = 0; j < tile->n_list; j++) {
        const bt_idx i = tile->list[j];
        fetch_ahead(tile, j + AHEAD);
        const bt_limit *k = tile->limits ? &tile->limits[i] : NULL;
        most = bt_max(most, bt_update_unit(&tile->units[i], k, v, inv));
    }
    return most;
}

static void move_units(const bt_sweep *o, bt_tile *tile, double (*y)[3])
{
    for (bt_idx j = 0; j < tile->n_list; j++) {
        bt_unit *u = &tile->units[tile->list[j]];
        double *x = tile->before[tile->list[j]];
        bt_rounds_move(o, u->ln, x, y[j], 2);
        bt_rounds_move(o, &u->lt, x + 2, y[j] + 2, 1);
    }
}

static double units_against(const bt_tile *tile, double (*y)[3])
{
    double sum = 0;
    for (bt_idx j = 0; j < tile->n_list; j++) {
        const bt_unit *u = &tile->units[tile->list[j]];
        const double *x = tile->before[tile->list[j]];
        sum += bt_rounds_against(u->w[0], u->ln[0], x[0], y[j][0]) + bt_rounds_against(u->w[1], u->ln[1], x[1], y[j][1]) +
               bt_rounds_against(u->wt, u->lt, x[2], y[j][2]);
    }
    return sum;
}

static void sweep_in_batches(bt_world *w, bt_tile *tile, const bt_sweep *o, bt_totals *t)
{
    int64_t done = 0;
    double most = 0;
    const double against = bt_batch_sweep(tile, w->bodies.vel, w->bodies.inv, o, w->par.inner_sweeps, ENOUGH * o->problem->tolerance, &done, &most);
    t->most = bt_max(t->most, most);
    tile->updates += done;
    bt_sum_add(&t->sum[BT_SWEEP_UPDATES], (double)done);
    if (o->moves) bt_rounds_moved(tile, o, against, t);
}

static void sweep_tile(bt_world *w, bt_idx k, const void *context, bt_totals *t)
{
    const bt_sweep *o = context;
    bt_tile *tile = &w->tiles->tile[k];
    bt_tow *line = line_of(w, k);
    if (tile->n_list == 0 && !line) return;
    if (bt_batch_is_for(tile)) {
        sweep_in_batches(w, tile, o, t);
        return;
    }
    bt_vel *v = w->bodies.vel, *towed = line ? &v[bt_world_towed(w)] : NULL;
    double line_y[BT_MAX_BRANCHES] = {0};
    bt_moved moved;
    if (o->moves) {
        bt_moved_begin(&moved, tile);
        move_units(o, tile, moved.y);
        for (int c = 0; line && c < line->n_branches; c++) bt_rounds_move(o, &line->branch[c].lambda, &w->solver->line_before[c], &line_y[c], 1);
    }
    int64_t times = 0;
    double most = INFINITY;
    for (; times < w->par.inner_sweeps || times == 0; times++) {
        if (most <= ENOUGH * o->problem->tolerance) break; // more would be for nothing until the neighbours have changed
        most = update_list(tile, v, w->bodies.inv);
        if (line) most = bt_max(most, bt_tow_update(line, towed, w->bodies.inv[bt_world_towed(w)]));
        if (times == 0) t->most = bt_max(t->most, most);
    }
    tile->updates += times * tile->n_list;
    bt_sum_add(&t->sum[BT_SWEEP_UPDATES], (double)(times * tile->n_list));
    if (!o->moves) return;
    double against = units_against(tile, moved.y);
    for (int c = 0; line && c < line->n_branches; c++)
        against += bt_rounds_against(line->branch[c].w, line->branch[c].lambda, w->solver->line_before[c], line_y[c]);
    bt_moved_end(&moved, tile, o, against, t);
}

static bt_problem contact_problem(const bt_world *w)
{
    bt_problem p = {
        .look = look_at_tile, .sweep = sweep_tile, .settle = settle, .vel = w->bodies.vel, .tolerance = w->par.tolerance, .cap = 0.9, .length = 50,
        .limit = (double)w->par.max_sweeps * (w->par.plain_sweeps ? 1 : UPDATES), .plain = w->par.plain_sweeps,
    };
    bt_rounds_scale(&p, w->tiles->heaviest);
    return p;
}

double bt_solver_residual(bt_world *w, double *rms)
{
    const bt_problem p = contact_problem(w);
    bt_work work = {0};
    bt_rounds_look(w, &p, false, &work);
    if (rms) *rms = work.rows > 0 ? sqrt(work.squares / (double)work.rows) : 0;
    return work.residual;
}

/// Start from the impulses of the step before. True when there are any.
static bool warm_start(bt_world *w)
{
    bt_tow *line = w->tiles->tile[w->tiles->n - 1].own ? line_of(w, w->tiles->n - 1) : NULL;
    if (line) bt_tow_warm_start(line, w->par.warm_start);
    double pressed = form_velocities(w, true);
    bt_domain_maxima(w, &pressed, 1);
    return pressed > 0;
}

static void store(bt_world *w, bt_idx k, const void *context, bt_totals *t)
{
    (void)context, (void)t;
    bt_pack_store(w, k);
}

static void sweep_to_tolerance(bt_world *w)
{
    bt_step_stats *st = &w->stats;
    const bt_problem p = contact_problem(w);
    bt_work work = {0};
    const bool pressed = warm_start(w);
    bt_rounds_look(w, &p, false, &work);
    // An impulse below the tolerance that is carried over from step to step would push for ever: one sweep at least.
    if (pressed && work.residual <= p.tolerance) {
        bt_rounds_sweep(w, &p, &work);
        bt_rounds_look(w, &p, false, &work);
    }
    if (work.residual > p.tolerance) bt_rounds_run(w, &p, &work);
    st->sweeps += work.sweeps;
    st->unit_updates += work.updates;
    st->unit_moves += work.moves;
    st->residual = work.residual;
    st->residual_rms = work.rows > 0 ? sqrt(work.squares / (double)work.rows) : 0;
    st->converged = work.residual <= p.tolerance;
    bt_phases_any_order(w, store, NULL, &(bt_totals){0});
    bt_domain_settle(w, w->solver->shifted ? w->solver->shift : NULL);
}

void bt_solver_solve(bt_world *w)
{
    bt_solver *s = w->solver;
    bt_step_stats *st = &w->stats;
    st->restitution_cut = false;
    s->shifted = false; // the displacements of the last step are over, and their array is of the bodies that were here then
    s->prepare_s = 0;
    st->sweeps = st->unit_updates = st->unit_moves = 0;
    const double t0 = bt_clock();
    s->rebounds = bt_restitution_begin(w);
    s->prepare_s += bt_clock() - t0;
    for (;;) {
        sweep_to_tolerance(w);
        if (!s->rebounds) break;
        const double t1 = bt_clock();
        const bool lowered = bt_restitution_lower(w);
        s->prepare_s += bt_clock() - t1;
        if (!lowered) break;
        st->restitution_cut = true;
    }
}
