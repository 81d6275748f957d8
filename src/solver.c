// SPDX-License-Identifier: MIT
// Sweeps to tolerance; equations and order in bergtow/solver.h.
#include "bergtow/solver.h"

#include <math.h>
#include <omp.h>
#include <stdlib.h>
#include <string.h>

#include "anderson.h"
#include "bergtow/tow.h"
#include "domain.h"
#include "kernel.h"
#include "limit.h"
#include "pack.h"
#include "phases.h"
#include "restitution.h"

#define ENOUGH 0.3 // of the tolerance: a tile that changes less is not swept again in the same turn

bt_solver *bt_solver_create(void)
{
    bt_solver *s = bt_alloc(1, sizeof *s);
    s->anderson = bt_alloc(1, sizeof *s->anderson);
    s->islands = bt_islands_create();
    return s;
}

void bt_solver_free(bt_solver *s)
{
    if (!s) return;
    bt_islands_free(s->islands);
    free(s->anderson);
    free(s->shift);
    free(s);
}

/// The line, in the pass of the last tile on the rank that owns the large bodies.
static bt_tow *line_of(const bt_world *w, bt_idx tile)
{
    return tile == w->tiles->n - 1 && bt_tow_has_line(w->tow) ? w->tow : NULL;
}

// --- velocities from impulses, and what they leave of the contact law ------------------------------------------------

/// What a new geometry, or a bound, no longer allows of the impulses of the last step.
static void clamp_impulses(bt_tile *tile)
{
    for (bt_idx i = 0; i < tile->n_units; i++) {
        bt_unit *u = &tile->units[i];
        for (int j = 0; tile->limits && j < u->n; j++) u->ln[j] = bt_min(u->ln[j], tile->limits[i].most[j]);
        u->lt = bt_clamp(u->lt, u->mu * (u->ln[0] + u->ln[1]));
    }
}

static void apply_impulses(bt_world *w, bt_idx k, const void *context, bt_totals *t)
{
    const bool warm = *(const bool *)context; // impulses are those of the last step
    bt_tile *tile = &w->tiles->tile[k];
    bt_vel *v = w->bodies.vel;
    const bt_inv *inv = w->bodies.inv;
    if (warm) clamp_impulses(tile);
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

static void add_residual(bt_world *w, bt_idx k, const void *context, bt_totals *t)
{
    const double scale = *(const double *)context;
    const bt_tile *tile = &w->tiles->tile[k];
    double sum = 0;
    int64_t rows = 0;
    for (bt_idx i = 0; i < tile->n_units; i++) {
        const bt_unit *u = &tile->units[i];
        t->most = bt_max(t->most, tile->limits ? bt_limited_residual(u, &tile->limits[i], w->bodies.vel, &sum) : bt_unit_residual(u, w->bodies.vel, &sum));
        rows += tile->units[i].n + 1;
    }
    const bt_tow *line = line_of(w, k);
    if (line) {
        const double r = bt_tow_residual(line, &w->bodies.vel[bt_world_towed(w)]);
        t->most = bt_max(t->most, r);
        sum += r * r;
        rows++;
    }
    bt_sum_add(&t->sum[0], bt_min(sum * scale, 0x1p45));
    bt_sum_add(&t->sum[1], (double)rows);
}

/// Squares in units in which that of the tolerance is 2²⁰: kept to twelve digits from 10⁻⁷ times the tolerance on. What a tile adds ends
/// at 2⁴⁵, some 6,000 times the tolerance: beyond, the root mean square is a lower bound.
static double scale_of_squares(const bt_world *w)
{
    const double tolerance = w->par.tolerance;
    return tolerance > 0 ? exp2(20 - ceil(2 * log2(tolerance))) : 0x1p60;
}

/// Collective. The largest residual from the totals of all tiles, m/s; root mean square into *rms.
static double residual_of(bt_world *w, bt_totals *t, double *rms)
{
    bt_domain_reduce(w, t);
    const double rows = bt_sum_value(&t->sum[1]);
    w->solver->rows = (int64_t)rows;
    if (rms) *rms = rows > 0 ? sqrt(bt_sum_value(&t->sum[0]) / scale_of_squares(w) / rows) : 0;
    return t->most;
}

double bt_solver_residual(bt_world *w, double *rms)
{
    const double scale = scale_of_squares(w);
    bt_totals t = {.n_sums = 2};
    bt_phases_any_order(w, add_residual, &scale, &t);
    return residual_of(w, &t, rms);
}

static void free_velocities(bt_world *w, bt_idx k, const void *context, bt_totals *t)
{
    (void)context, (void)t;
    const bt_tile *tile = &w->tiles->tile[k];
    bt_bodies *b = &w->bodies;
    if (k == w->tiles->n - 1 || w->tiles->awake[k]) memcpy(b->vel + tile->first, b->vel_free + tile->first, (size_t)(tile->end - tile->first) * sizeof *b->vel);
}

/// Velocities U* + M⁻¹ Jᵀ λ from scratch, so that what increments have rounded away does not build up, and their residual. True when some
/// impulse on this rank is not zero.
static bool velocities_from_impulses(bt_world *w, bool warm)
{
    bt_phases_everywhere(w, free_velocities, NULL);
    const double scale = scale_of_squares(w);
    bt_totals applied = {0}, left = {.n_sums = 2};
    const bt_pass pass[2] = {{apply_impulses, &warm, &applied, false}, {add_residual, &scale, &left, true}};
    bt_phases_turn(w, pass, 2, w->bodies.vel);
    w->stats.residual = residual_of(w, &left, &w->stats.residual_rms);
    return applied.most > 0;
}

// --- sweeps ----------------------------------------------------------------------------------------------------------

/// What a sweep is to do.
typedef struct {
    const bt_anderson *record; ///< keep the history of this sweep; NULL: a plain one
    bt_anderson_verdict move;  ///< what is still to be done to the impulses after the last sweep
    int64_t times;             ///< sweeps of a tile in its turn
    bool far;                  ///< the field is larger than the caches
} sweep_order;

/// The next cache lines of the units of a tile that comes later. Memory is read in the order of the units only within a tile, too
/// short a row for the hardware to foresee: 300,000 floes lost a third of a sweep to waiting.
static inline void fetch_ahead(const bt_tile *ahead, bt_idx i)
{
    if (!ahead || i >= ahead->n_units) return;
    const char *line = (const char *)&ahead->units[i];
    for (size_t k = 0; k < sizeof(bt_unit); k += 64) __builtin_prefetch(line + k);
}

static void sweep_tile(bt_world *w, bt_idx k, const void *context, bt_totals *t)
{
    enum { ON_STACK = 192 };
    const sweep_order *o = context;
    bt_tile *tile = &w->tiles->tile[k];
    bt_vel *v = w->bodies.vel;
    const bt_inv *inv = w->bodies.inv;
    const bt_tile *ahead = tile->ahead >= 0 ? &w->tiles->tile[tile->ahead] : NULL;
    double few[6 * ON_STACK], *x = few;
    if (o->move != BT_ANDERSON_STAY && tile->n_units > 0) bt_anderson_move_units(w->solver->anderson, o->move, tile);
    if (o->record) {
        if (o->far) bt_anderson_fetch(tile);
        if (tile->n_units > ON_STACK) x = bt_alloc(6 * (size_t)tile->n_units, sizeof *x);
        for (bt_idx i = 0; i < tile->n_units; i++) {
            x[3 * i] = tile->units[i].ln[0];
            x[3 * i + 1] = tile->units[i].ln[1];
            x[3 * i + 2] = tile->units[i].lt;
        }
    }
    bt_tow *line = line_of(w, k);
    double line_before[BT_MAX_BRANCHES] = {0};
    for (int c = 0; line && c < line->n_branches; c++) line_before[c] = line->branch[c].lambda;
    for (int64_t n = 0; n < o->times; n++) {
        double most = 0;
        for (bt_idx i = 0; !tile->limits && i < tile->n_units; i++) {
            if (n == 0) fetch_ahead(ahead, i);
            most = bt_max(most, bt_update_unit(&tile->units[i], v, inv));
        }
        for (bt_idx i = 0; tile->limits && i < tile->n_units; i++) most = bt_max(most, bt_update_limited(&tile->units[i], &tile->limits[i], v, inv));
        if (line) most = bt_max(most, bt_tow_update(line, &v[bt_world_towed(w)], inv[bt_world_towed(w)]));
        if (n == 0) t->most = bt_max(t->most, most);
        if (most <= ENOUGH * w->par.tolerance) break; // more would be for nothing until the neighbours have changed
    }
    if (o->record) bt_anderson_collect(o->record, tile, x, x + 3 * (size_t)tile->n_units, t);
    for (int c = 0; o->record && line && c < line->n_branches; c++)
        bt_anderson_collect_scalar(o->record, &w->solver->anderson->line[c], line_before[c], line->branch[c].lambda, line->branch[c].w, t);
    if (x != few) free(x);
}

/// n sweeps; returns the largest update of the last, m/s, whose totals are in t[n − 1].
static double sweep(bt_world *w, const sweep_order *o, int n, bt_totals *t)
{
    bt_pass pass[BT_MAX_TURN];
    for (int q = 0; q < n; q++) pass[q] = (bt_pass){sweep_tile, &o[q], &t[q], false};
    bt_phases_turn(w, pass, n, w->bodies.vel);
    bt_domain_reduce(w, &t[n - 1]);
    return t[n - 1].most;
}

/// Does this step have so many rows, those of all ranks, that they do not fit into the caches?
static bool is_far(const bt_world *w) { return w->par.turn_rows > 0 && w->solver->rows >= w->par.turn_rows; }

/// Sweeps until the next look at what they change. In a large field, all that come before the next move: they share the traffic of memory
/// (order.h), and some sweeps too many at the end are cheaper than looking after each.
static int turn_length(const bt_world *w, int64_t left)
{
    if (!is_far(w)) return 1;
    const int64_t n = w->par.plain_sweeps ? BT_MAX_TURN : bt_anderson_period(w->solver->anderson), most = left < BT_MAX_TURN ? left : BT_MAX_TURN;
    return (int)(n < most ? n : most);
}

static void reserve_history(bt_world *w)
{
    bt_tiles *ts = w->tiles;
    for (bt_idx k = 0; k < ts->n; k++)
        if (ts->awake[k] || ts->tile[k].n_units > 0 || k == ts->n - 1) bt_anderson_reserve(&ts->tile[k], ts->tile[k].n_units > 0);
}

typedef struct {
    const bt_anderson *a;
    bt_anderson_verdict verdict;
} bodies_order;

static void move_bodies(bt_world *w, bt_idx k, const void *context, bt_totals *t)
{
    (void)t;
    const bodies_order *o = context;
    bt_tile *tile = &w->tiles->tile[k];
    if (k < w->tiles->n - 1 ? w->tiles->awake[k] : tile->own) bt_anderson_move_bodies(o->a, o->verdict, tile, w->bodies.vel);
}

/// Move the velocities and the line; the impulses of the units are moved at the beginning of the next sweep, which has them at hand.
static bt_anderson_verdict accelerate(bt_world *w, const bt_totals *t)
{
    bt_tiles *ts = w->tiles;
    bt_anderson *a = w->solver->anderson;
    const bt_anderson_verdict verdict = bt_anderson_decide(a, t);
    bt_phases_everywhere(w, move_bodies, &(bodies_order){a, verdict});
    bt_tow *line = ts->tile[ts->n - 1].own ? line_of(w, ts->n - 1) : NULL;
    for (int c = 0; line && verdict != BT_ANDERSON_STAY && c < line->n_branches; c++)
        line->branch[c].lambda = bt_anderson_moved(a, verdict, &a->line[c], line->branch[c].lambda);
    return verdict;
}

/// Start from the impulses of the step before. True when there are any.
static bool warm_start(bt_world *w)
{
    bt_tow *line = w->tiles->tile[w->tiles->n - 1].own ? line_of(w, w->tiles->n - 1) : NULL;
    if (line) bt_tow_warm_start(line, w->par.warm_start);
    double pressed = velocities_from_impulses(w, true);
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
    bt_anderson *a = w->solver->anderson;
    bt_step_stats *st = &w->stats;
    const double tolerance = w->par.tolerance;
    const int64_t limit = st->sweeps + w->par.max_sweeps;
    const int64_t times = w->par.inner_sweeps > 1 ? w->par.inner_sweeps : 1;
    const bool pressed = warm_start(w);
    // An impulse below the tolerance that is carried over from step to step would push for ever: one sweep at least.
    if (pressed && st->residual <= tolerance) {
        sweep(w, &(sweep_order){.move = BT_ANDERSON_STAY, .times = times}, 1, &(bt_totals){0});
        st->sweeps++;
        st->residual = bt_solver_residual(w, &st->residual_rms);
    }
    bt_anderson_start(a, w->tiles->heaviest * tolerance * tolerance, is_far(w) ? BT_ANDERSON_EVERY_FAR : BT_ANDERSON_EVERY);
    if (st->residual > tolerance && !w->par.plain_sweeps) reserve_history(w);
    bt_anderson_verdict move = BT_ANDERSON_STAY;
    while (st->residual > tolerance && st->sweeps < limit) {
        const int n = turn_length(w, limit - st->sweeps);
        bt_totals t[BT_MAX_TURN] = {{.n_sums = 0}};
        sweep_order o[BT_MAX_TURN];
        bool record = false;
        for (int q = 0; q < n; q++) {
            record = !w->par.plain_sweeps && bt_anderson_begin(a, &t[q]);
            o[q] = (sweep_order){record ? a : NULL, q == 0 ? move : BT_ANDERSON_STAY, times << a->effort, n > 1};
        }
        const double change = sweep(w, o, n, t);
        move = BT_ANDERSON_STAY;
        st->sweeps += n;
        if (change <= tolerance || st->sweeps == limit) {
            velocities_from_impulses(w, false);
            if (st->residual <= tolerance) break;
        }
        if (record && st->sweeps < limit) move = accelerate(w, &t[n - 1]);
    }
    st->converged = st->residual <= tolerance;
    bt_phases_any_order(w, store, NULL, &(bt_totals){0});
    bt_domain_settle(w);
}

void bt_solver_solve(bt_world *w)
{
    bt_solver *s = w->solver;
    bt_step_stats *st = &w->stats;
    st->restitution_cut = false;
    s->shifted = false; // the displacements of the last step are over, and their array is of the bodies that were here then
    s->prepare_s = 0;
    st->sweeps = 0;
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

/// Velocity without contacts: U*, and for the towed body what the line adds to it.
static bt_vel velocity_without_contacts(const bt_world *w, bt_idx i)
{
    bt_vel v = w->bodies.vel_free[i];
    if (i >= w->tiles->n_tiled && i == bt_world_towed(w) && bt_tow_has_line(w->tow)) bt_tow_apply(w->tow, &v, w->bodies.inv[i]);
    return v;
}

double bt_solver_normal_work(const bt_world *w, const bt_unit *u, int i)
{
    const bt_vel fa = velocity_without_contacts(w, u->a), fb = velocity_without_contacts(w, u->b);
    return 0.5 * u->ln[i] * (bt_normal_velocity(u, i, &fa, &fb) + bt_normal_velocity(u, i, &w->bodies.vel[u->a], &w->bodies.vel[u->b]));
}

double bt_solver_work(const bt_world *w, const bt_unit *u)
{
    const bt_vel fa = velocity_without_contacts(w, u->a), fb = velocity_without_contacts(w, u->b);
    const bt_vel *va = &w->bodies.vel[u->a], *vb = &w->bodies.vel[u->b];
    double work = 0.5 * u->lt * (bt_tangent_velocity(u, &fa, &fb) + bt_tangent_velocity(u, va, vb));
    for (int i = 0; i < u->n; i++) work += 0.5 * u->ln[i] * (bt_normal_velocity(u, i, &fa, &fb) + bt_normal_velocity(u, i, va, vb));
    return work;
}
