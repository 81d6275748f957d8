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

// The work of each island's contacts, and the remaining share of its restitution.

/// Restore the full restitution of the bodies after an earlier solution of this step.
static void restore(bt_world *world, bt_idx k, const void *context, bt_totals *totals)
{
    (void)context;
    const bt_cell *cell = &world->cells->cell[k];
    for (bt_idx j = 0; j < cell->n_contacts; j++) {
        bt_contact *contact = &cell->contacts[j];
        totals->most = bt_max(totals->most, bt_pair_restitution(&world->bodies, contact->a, contact->b));
        bt_pack_bias(world, contact, &cell->gaps[j], 1);
    }
}

bool bt_restitution_begin(bt_world *world)
{
    if (!world->cells->rebounds) return false;
    bt_totals totals = {0};
    bt_phases_any_order(world, restore, NULL, &totals);
    bt_domain_maxima(world, &totals.most, 1);
    if (totals.most == 0) return false;
    bt_islands_make(world, world->solver->islands);
    return true;
}

/// The energy that a contact has given beyond the error of the solution, J.
static double gain(const bt_world *world, const bt_cell *cell, bt_idx j)
{
    const bt_contact *contact = &cell->contacts[j];
    // work lost by sheets must not hide energy gained by rebounds
    if (contact->ln[0] + contact->ln[1] == 0 || contact->n == 0) return 0;
    return bt_contacts_gain(world, contact) - bt_contacts_unsolved_gain(contact, world->stats.residual);
}

static double rebounds(const bt_world *world, const bt_cell *cell, bt_idx j)
{
    (void)world;
    return bt_rebounds(cell->contacts[j].bias);
}

static double is_unsolved(const bt_world *world, const bt_cell *cell, bt_idx j)
{
    const bt_contact *contact = &cell->contacts[j];
    const bt_limit *limit = cell->laws->limits ? &cell->laws->limits[j] : NULL;
    const bt_mass m = bt_mass_of(contact, world->bodies.inv);
    double squares = 0;
    return !(bt_contact_residual(contact, &m, limit, world->bodies.vel, world->par.tolerance, &squares) <=
             world->par.tolerance);
}

/// Write the sum of a quantity of the contacts of each island to sum.
static void add_up(bt_world *world, double (*of)(const bt_world *world, const bt_cell *cell, bt_idx j))
{
    const bt_cells *ts = world->cells;
    bt_islands *islands = world->solver->islands;
    bt_islands_clear(world, islands);
    for (bt_idx i = 0; i < ts->n_order; i++) {
        const bt_cell *cell = &ts->cell[ts->order[i]];
        for (bt_idx j = 0; j < cell->n_contacts; j++)
            bt_sum_add(&islands->sum[bt_islands_of(world, islands, &cell->contacts[j])], of(world, cell, j));
    }
    bt_islands_add(world, islands);
}

/// Is the sum of an island more than 0, and has it any restitution left?
static bool is_named(const bt_islands *islands, bt_idx root)
{
    return islands->share[root] > 0 && bt_sum_value(&islands->sum[root]) > 0;
}

static bool any_named(const bt_world *world)
{
    const bt_islands *islands = world->solver->islands;
    double any = 0;
    for (bt_idx i = 0; i < world->bodies.n; i++)
        if (islands->root[i] == i && is_named(islands, i)) any = 1;
    bt_domain_maxima(world, &any, 1);
    return any > 0;
}

/// Name the islands that hold rebounds and are not solved. True if there are any.
static bool name_unsolved(bt_world *world)
{
    const bt_islands *islands = world->solver->islands;
    add_up(world, rebounds);
    for (bt_idx i = 0; i < world->bodies.n; i++)
        if (!is_named(islands, i)) islands->share[i] = 0;
    add_up(world, is_unsolved);
    return any_named(world);
}

static void drop_named_impulses(bt_world *world)
{
    const bt_cells *ts = world->cells;
    bt_islands *islands = world->solver->islands;
    for (bt_idx i = 0; i < ts->n_order; i++) {
        bt_cell *cell = &ts->cell[ts->order[i]];
        for (bt_idx j = 0; j < cell->n_contacts; j++) {
            bt_contact *contact = &cell->contacts[j];
            if (is_named(islands, bt_islands_of(world, islands, contact)))
                contact->ln[0] = contact->ln[1] = contact->lt = 0;
        }
    }
}

bool bt_restitution_lower(bt_world *world)
{
    const bt_cells *ts = world->cells;
    bt_solver *solver = world->solver;
    bt_islands *islands = solver->islands;
    bool unsolved = false;
    if (!solver->refuted) {
        add_up(world, gain);
        unsolved = !any_named(world);
        // plain sweeps are the reference, and what fields are shaken with, never to convergence
        if (unsolved && (world->stats.converged || world->par.plain_sweeps || !name_unsolved(world))) return false;
    }
    if (solver->refuted || unsolved) drop_named_impulses(world);
    solver->refuted = false;
    for (bt_idx i = 0; i < world->bodies.n; i++)
        if (is_named(islands, i))
            islands->share[i] = islands->share[i] > 0.2 && !unsolved ? 0.5 * islands->share[i] : 0;
    for (bt_idx i = 0; i < ts->n_order; i++) {
        bt_cell *cell = &ts->cell[ts->order[i]];
        for (bt_idx j = 0; j < cell->n_contacts; j++) {
            bt_contact *contact = &cell->contacts[j];
            const double share = islands->share[bt_islands_of(world, islands, contact)];
            if (share < 1) bt_pack_bias(world, contact, &cell->gaps[j], share);
        }
    }
    return true;
}

// --- a step ----------------------------------------------------------------------------------------------------------

#define UPDATES 6.0 // updates of every contact that one of max_sweeps allows

bt_solver *bt_solver_create(void)
{
    bt_solver *solver = bt_alloc(1, sizeof *solver);
    solver->islands = bt_islands_create();
    return solver;
}

void bt_solver_free(bt_solver *solver)
{
    if (!solver) return;
    bt_islands_free(solver->islands);
    bt_rounds_free_lists(solver);
    free(solver->work);
    free(solver->before);
    free(solver->shift);
    free(solver);
}

/// The tow line when the cell is the last one, on the rank that owns the large bodies; otherwise NULL.
static bt_tow *line_of(const bt_world *world, bt_idx cell)
{
    return cell == world->cells->n - 1 && bt_tow_has_line(world->tow) ? world->tow : NULL;
}

// --- velocities from impulses, and residuals -------------------------------------------------------------------------

void bt_solver_begin_cell(bt_world *world, bt_cell *cell)
{
    const bool in_place = !bt_batch_is_for(cell);
    bt_batch_unpack(cell);
    bt_rounds_list(cell);
    bt_batch_begin(cell);
    if (in_place) bt_rounds_in_place(cell, world->bodies.inv);
    for (bt_idx i = 0; i < cell->n_contacts; i++) {
        bt_contact *contact = &cell->contacts[i];
        for (int j = 0; cell->laws->limits && j < contact->n; j++)
            contact->ln[j] = bt_min(contact->ln[j], cell->laws->limits[i].most[j]);
        if (contact->n > 0) contact->lt = bt_clamp(contact->lt, contact->mu * (contact->ln[0] + contact->ln[1]));
        else bt_onto_sheets(&cell->laws->limits[i], &contact->ln[0], &contact->lt);
        if (!in_place) continue;
        double *x = cell->work->in_place[i].before;
        x[0] = contact->ln[0], x[1] = contact->ln[1], x[2] = contact->lt;
    }
}

static void apply_impulses(bt_world *world, bt_idx k, const void *context, bt_totals *totals)
{
    const bool warm = *(const bool *)context; // impulses are those of the last step
    bt_cell *cell = &world->cells->cell[k];
    bt_vel *v = world->bodies.vel;
    const bt_inv *inv = world->bodies.inv;
    if (warm) bt_solver_begin_cell(world, cell);
    if (world->par.plain_sweeps) bt_batch_unpack(cell); // contact by contact: keeps the bits of fields
    if (cell->work->packed) bt_batch_apply(cell, v);
    for (bt_idx i = 0; !cell->work->packed && i < cell->n_contacts; i++) {
        const bt_contact *contact = &cell->contacts[i];
        const double total = contact->ln[0] + contact->ln[1];
        if (total == 0 && contact->lt == 0) continue;
        totals->most = 1;
        bt_vel va = v[contact->a], vb = v[contact->b];
        bt_apply(contact, total, contact->ln[0] * contact->ran[0] + contact->ln[1] * contact->ran[1],
                 contact->ln[0] * contact->rbn[0] + contact->ln[1] * contact->rbn[1], contact->lt, inv[contact->a],
                 inv[contact->b], &va, &vb);
        bt_store(&v[contact->a], inv[contact->a], &va);
        bt_store(&v[contact->b], inv[contact->b], &vb);
    }
    bt_tow *line = line_of(world, k);
    if (!line) return;
    bt_vel *towed = &v[bt_world_towed(world)];
    const bt_inv by = inv[bt_world_towed(world)];
    bt_tow_apply(line, towed, by);
    // On a heavy body the residual Δλ W of a tension that is off by newtons is below the tolerance before the first
    // sweep. So the line gets its exact update in every step, not only in steps with sweeps.
    if (warm) bt_tow_update(line, towed, by);
}

/// Residual of the contacts of a cell that is swept in place.
static bt_found residual_in_place(bt_cell *cell, const bt_vel *v, const bt_problem *problem)
{
    const double near = BT_NEAR * problem->tolerance;
    bt_found found = {0};
    bt_rounds_list(cell);
    for (bt_idx i = 0; i < cell->n_contacts; i++) {
        const bt_contact *contact = &cell->contacts[i];
        const bt_mass *m = &cell->work->in_place[i].mass;
        const bt_limit *limit = cell->laws->limits ? &cell->laws->limits[i] : NULL;
        const double r = limit ? bt_contact_residual(contact, m, limit, v, problem->tolerance, &found.squares)
                               : bt_contact_residual(contact, m, NULL, v, problem->tolerance, &found.squares);
        found.most = bt_max(found.most, r);
        found.bad += r > near;
        found.rows += contact->n + 1 + (contact->n == 0);
        const double *x = cell->work->in_place[i].before;
        // or changed in the last sweep
        bool on =
            problem->plain || contact->ln[0] + contact->ln[1] > 0 || contact->lt != 0 || x[0] != contact->ln[0] ||
            x[1] != contact->ln[1] || x[2] != contact->lt;
        if (limit && contact->n == 0) on = on || r > 0;
        for (int c = 0; !on && c < contact->n; c++)
            on = !(bt_normal_velocity(contact, c, &v[contact->a], &v[contact->b]) + contact->bias[c] >= 0);
        if (on) cell->work->list[cell->n_listed++] = i;
    }
    return found;
}

/// Residual of a cell, and its list: contacts that bear load or close. Sweeps would not change the others.
void bt_solver_residual_of_cell(bt_world *world, bt_idx k, const void *context, bt_totals *totals)
{
    (void)totals;
    const bt_problem *problem = context;
    bt_cell *cell = &world->cells->cell[k];
    const bt_vel *v = problem->vel;
    if (problem->plain) bt_batch_unpack(cell);
    bt_found found = bt_batch_is_for(cell) ? bt_batch_residual(cell, v, world->bodies.inv, problem)
                                           : residual_in_place(cell, v, problem);
    const bt_tow *line = k == world->cells->n - 1 ? problem->line : NULL;
    if (line) {
        const double r = bt_tow_residual(line, &v[bt_world_towed(world)]);
        found.most = bt_max(found.most, r);
        found.squares += r * r;
        found.rows++;
        found.bad += r > BT_NEAR * problem->tolerance;
    }
    bt_rounds_found(cell, &found);
}

static void free_velocities(bt_world *world, bt_idx k, const void *context, bt_totals *totals)
{
    (void)context, (void)totals;
    const bt_cell *cell = &world->cells->cell[k];
    bt_bodies *bodies = &world->bodies;
    if (k == world->cells->n - 1 || world->cells->awake[k])
        memcpy(bodies->vel + cell->first, bodies->vel_free + cell->first,
               (size_t)(cell->end - cell->first) * sizeof *bodies->vel);
}

/// Form the velocities U* + M⁻¹ Jᵀ λ from scratch, so that rounding errors of increments do not accumulate. True if
/// some impulse on this rank is not zero.
static bool form_velocities(bt_world *world, bool warm)
{
    bt_totals totals = {0};
    bt_phases_run(world, BT_WITH_WORK, &(bt_before){free_velocities, NULL}, apply_impulses, &warm, world->bodies.vel,
                  &totals);
    return totals.most > 0;
}

static void settle(bt_world *world) { form_velocities(world, false); }

// --- sweeps ----------------------------------------------------------------------------------------------------------

/// Memory is read in the order of the contacts, but with gaps too wide for the hardware prefetcher.
static inline void fetch_ahead(const bt_cell *cell, bt_idx j)
{
    if (j >= cell->n_listed) return;
    const char *line = (const char *)&cell->contacts[cell->work->list[j]];
    for (size_t k = 0; k < sizeof(bt_contact); k += 64) __builtin_prefetch(line + k);
}

/// Update every listed contact once; returns the largest update, m/s.
static double update_list(bt_cell *cell, bt_vel *v, const bt_inv *inv)
{
    enum { AHEAD = 3 };
    double most = 0;
    for (bt_idx j = 0; j < cell->n_listed; j++) {
        const bt_idx i = cell->work->list[j];
        fetch_ahead(cell, j + AHEAD);
        const bt_limit *limit = cell->laws->limits ? &cell->laws->limits[i] : NULL;
        most = bt_max(most, bt_update_contact(&cell->contacts[i], &cell->work->in_place[i].mass, limit, v, inv));
    }
    return most;
}

static void move_contacts(const bt_sweep *sweep, bt_cell *cell, double (*y)[3])
{
    for (bt_idx j = 0; j < cell->n_listed; j++) {
        bt_contact *contact = &cell->contacts[cell->work->list[j]];
        double *x = cell->work->in_place[cell->work->list[j]].before;
        bt_rounds_move(sweep, contact->ln, x, y[j], 2);
        bt_rounds_move(sweep, &contact->lt, x + 2, y[j] + 2, 1);
    }
}

static double contacts_against(const bt_cell *cell, double (*y)[3])
{
    double sum = 0;
    for (bt_idx j = 0; j < cell->n_listed; j++) {
        const bt_contact *contact = &cell->contacts[cell->work->list[j]];
        const bt_in_place *in_place = &cell->work->in_place[cell->work->list[j]];
        const bt_mass *m = &in_place->mass;
        const double *x = in_place->before;
        sum += bt_rounds_against(m->w[0], contact->ln[0], x[0], y[j][0]) +
               bt_rounds_against(m->w[1], contact->ln[1], x[1], y[j][1]) +
               bt_rounds_against(m->wt, contact->lt, x[2], y[j][2]);
    }
    return sum;
}

void bt_solver_sweep_cell(bt_world *world, bt_idx k, const void *context, bt_totals *totals)
{
    const bt_sweep *sweep = context;
    bt_cell *cell = &world->cells->cell[k];
    bt_tow *line = k == world->cells->n - 1 ? sweep->problem->line : NULL;
    bt_vel *v = sweep->problem->vel, *towed = line ? &v[bt_world_towed(world)] : NULL;
    if (cell->n_listed == 0 && !line) return;
    if (bt_batch_is_for(cell)) {
        bt_batch_sweep(cell, v, world->bodies.inv, sweep, world->par.inner_sweeps, totals);
        return;
    }
    double line_y[BT_MAX_BRANCHES] = {0};
    bt_moved moved;
    if (sweep->moves) {
        bt_moved_begin(&moved, cell);
        move_contacts(sweep, cell, moved.y);
        for (int c = 0; line && c < line->n_branches; c++)
            bt_rounds_move(sweep, &line->branch[c].lambda, &world->solver->line_before[c], &line_y[c], 1);
    }
    int64_t times = 0;
    double most = INFINITY;
    for (; times < world->par.inner_sweeps || times == 0; times++) {
        // further passes gain nothing until the neighbours have changed
        if (most <= BT_ENOUGH * sweep->problem->tolerance) break;
        most = update_list(cell, v, world->bodies.inv);
        if (line) most = bt_max(most, bt_tow_update(line, towed, world->bodies.inv[bt_world_towed(world)]));
        if (times == 0) totals->most = bt_max(totals->most, most);
    }
    cell->updates += times * cell->n_listed;
    bt_sum_add(&totals->sum[BT_SWEEP_UPDATES], (double)(times * cell->n_listed));
    if (!sweep->moves) return;
    double against = contacts_against(cell, moved.y);
    for (int c = 0; line && c < line->n_branches; c++)
        against += bt_rounds_against(line->branch[c].w, line->branch[c].lambda, world->solver->line_before[c],
                                     line_y[c]);
    bt_moved_end(&moved, cell, sweep, against, totals);
}

static void keep_impulses(bt_world *world, bt_idx k, const void *context, bt_totals *totals)
{
    (void)totals;
    const bt_keeping what = *(const bt_keeping *)context;
    bt_cell *cell = &world->cells->cell[k];
    bt_tow *line = line_of(world, k);
    if (what == BT_FORGET) {
        free(cell->work->best);
        cell->work->best = NULL;
        return;
    }
    bt_batch_unpack(cell);
    if (!cell->work->best) cell->work->best = bt_alloc((size_t)cell->n_contacts + 1, sizeof *cell->work->best);
    for (bt_idx i = 0; i < cell->n_contacts; i++) {
        bt_contact *contact = &cell->contacts[i];
        double *x = cell->work->best[i];
        if (what == BT_PUT_BACK) contact->ln[0] = x[0], contact->ln[1] = x[1], contact->lt = x[2];
        else x[0] = contact->ln[0], x[1] = contact->ln[1], x[2] = contact->lt;
    }
    for (int c = 0; line && c < line->n_branches; c++) {
        double *x = &world->solver->line_best[c], *now = &line->branch[c].lambda;
        if (what == BT_PUT_BACK) *now = *x;
        else *x = *now;
    }
}

static void unpack_cell(bt_world *world, bt_idx k, const void *context, bt_totals *totals)
{
    (void)context, (void)totals;
    bt_batch_unpack(&world->cells->cell[k]);
}

/// Do rebounds lock bodies?
static bool refuted(bt_world *world)
{
    return world->solver->refuted = bt_locked_by_rebounds(world, world->solver->islands);
}

static bt_problem contact_problem(const bt_world *world)
{
    bt_problem problem = {
        .residual = bt_solver_residual_of_cell,
        .sweep = bt_solver_sweep_cell,
        .keep = keep_impulses,
        .settle = settle,
        .vel = world->bodies.vel,
        .line = line_of(world, world->cells->n - 1),
        .tolerance = world->par.tolerance,
        .cap = 0.9,
        .length = 20,
        .limit = (double)world->par.max_sweeps * (world->par.plain_sweeps ? 1 : UPDATES),
        .plain = world->par.plain_sweeps,
        .refuted = world->solver->rebounds && !world->par.plain_sweeps ? refuted : NULL,
    };
    bt_rounds_scale(&problem, world->cells);
    return problem;
}

/// Start from the impulses of the previous step. True if there are any.
static bool warm_start(bt_world *world)
{
    bt_tow *line = world->cells->cell[world->cells->n - 1].own ? line_of(world, world->cells->n - 1) : NULL;
    if (line) bt_tow_warm_start(line, world->par.warm_start);
    double pressed = form_velocities(world, true);
    bt_domain_maxima(world, &pressed, 1);
    return pressed > 0;
}

static void residual_of_more(bt_world *world, bt_idx k, const void *context, bt_totals *totals)
{
    bt_cell *cell = &world->cells->cell[k];
    if (!cell->just_detected) return;
    bt_solver_begin_cell(world, cell);
    bt_solver_residual_of_cell(world, k, context, totals);
    const bool same = bt_contacts_load(cell) == cell->load;
    totals->most = bt_max(totals->most, same ? cell->work->found.most : INFINITY);
    bt_sum_add(&totals->sum[0], cell->n_contacts);
}

/// Does the present solution still hold with the contacts that were added? If the impulses are still the same, the
/// velocities belong to them, and the residual elsewhere is unchanged. An impulse can be lost: a point was replaced by
/// an edge of another part of the floe, or a bound has cut it.
static bool holds_with_more(bt_world *world)
{
    bt_step_stats *st = &world->stats;
    const bt_problem problem = contact_problem(world);
    bt_totals totals = {.n_sums = 1};
    bt_phases_any_order(world, residual_of_more, &problem, &totals);
    bt_domain_reduce(world, &totals);
    st->residual_checks += (int64_t)bt_sum_value(&totals.sum[0]);
    if (!(totals.most <= problem.tolerance)) return false;
    st->residual = bt_max(st->residual, totals.most);
    return true;
}

static void sweep_to_tolerance(bt_world *world)
{
    bt_step_stats *st = &world->stats;
    const bt_problem problem = contact_problem(world);
    bt_work work = {0};
    const bool pressed = warm_start(world);
    bt_rounds_residual(world, &problem, BT_BEGINS, &work);
    // An impulse below the tolerance, carried over from step to step, would push for ever: at least one sweep.
    if (pressed && work.residual <= problem.tolerance) {
        bt_rounds_sweep(world, &problem, &work);
        bt_rounds_residual(world, &problem, BT_SWEPT, &work);
    }
    if (work.residual > problem.tolerance) bt_rounds_run(world, &problem, &work);
    bt_phases_any_order(world, unpack_cell, NULL, &(bt_totals){0});
    st->sweeps += work.sweeps;
    st->contact_updates += work.updates;
    st->contact_moves += work.moves;
    st->residual_checks += work.checks;
    st->residual = work.residual;
    st->residual_rms = work.rows > 0 ? sqrt(work.squares / (double)work.rows) : 0;
    st->converged = work.residual <= problem.tolerance;
}

static void solve(bt_world *world)
{
    bt_solver *solver = world->solver;
    if (solver->extends && holds_with_more(world)) return;
    solver->rebounds = bt_restitution_begin(world);
    for (;;) {
        sweep_to_tolerance(world);
        if (!solver->rebounds) break;
        bt_domain_settle(world, NULL);
        if (!bt_restitution_lower(world)) break;
        world->stats.restitution_cut = true;
    }
}

void bt_solver_solve(bt_world *world, bool extends)
{
    bt_rounds_begin(world);
    bt_solver *solver = world->solver;
    solver->extends = extends && !solver->rebounds && !world->par.plain_sweeps;
    bt_step_stats *st = &world->stats;
    st->restitution_cut = false;
    // the displacements of the last step are void: their array belongs to the bodies held then
    solver->shifted = false;
    st->sweeps = st->contact_updates = st->contact_moves = st->residual_checks = 0;
    if (bt_domain_is_idle(world)) settle(world);
    bt_domain_solve(world, solve, NULL);
}
