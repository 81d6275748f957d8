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
static bool turns(const bt_world *world, const bt_cell *cell, bt_idx j, double least)
{
    const bt_bodies *bodies = &world->bodies;
    const bt_contact *contact = &cell->contacts[j];
    const bt_vel *va = &bodies->vel[contact->a], *vb = &bodies->vel[contact->b];
    const double turn = world->par.dt * fabs(vb->w - va->w);
    if (turn == 0) return false;
    const double *g = cell->gaps[j].gap, gap = contact->n > 1 ? bt_min(g[0], g[1]) : g[0];
    const double slip = world->par.dt * fabs(bt_tangent_velocity(contact, va, vb));
    const double error = turn * (0.5 * turn * (bodies->radius[contact->a] + bodies->radius[contact->b]) + slip);
    if (!(bt_max(gap, -world->par.slop) - error < -least)) return false;
    if (!cell->laws->limits) return true;
    const bt_limit *limit = &cell->laws->limits[j];
    for (int law = 0; law < BT_ALL_LAWS; law++)
        if (limit->record[law] >= 0) return false;
    return limit->grown[0] == 0 && limit->grown[1] == 0;
}

/// Fields are shaken plain, and keep their bits.
static bool in_batches(const bt_cell *cell, bool plain) { return bt_batch_projects(cell) && !plain; }

/// No multipliers yet.
static void begin(const bt_world *world, bt_cell *cell)
{
    bt_rounds_list(cell);
    bt_batch_begin(cell);
    if (!in_batches(cell, world->par.plain_sweeps)) bt_rounds_in_place(cell, world->bodies.inv);
}

static void find_overlap(bt_world *world, bt_idx k, const void *context, bt_totals *totals)
{
    (void)context;
    bt_cell *cell = &world->cells->cell[k];
    begin(world, cell);
    for (bt_idx j = 0; j < cell->n_contacts; j++) {
        const bt_contact *contact = &cell->contacts[j];
        bt_gaps *gaps = &cell->gaps[j];
        for (int i = 0; i < contact->n; i++) {
            if (gaps->row == BT_ROW_RELEASED) { // no row
                gaps->gap[i] = world->par.dt * contact->bias[i];
                continue;
            }
            gaps->gap[i] += world->par.dt * bt_normal_velocity(contact, i, &world->bodies.vel[contact->a],
                                                               &world->bodies.vel[contact->b]);
            if (cell->laws->limits) gaps->gap[i] += cell->laws->limits[j].grown[i]; // what has given way in this step
            totals->most = bt_max(totals->most, -gaps->gap[i]);
        }
        if (!world->par.plain_sweeps && turns(world, cell, j, LEFT * world->par.slop))
            bt_sum_add(&totals->sum[TURNS], 1);
    }
}

/// Keep contact j of cell k as it is.
static void keep(bt_solver *solver, bt_idx k, bt_idx j, const bt_contact *contact)
{
#pragma omp critical
    {
        if (solver->n_kept == solver->cap_kept)
            solver->kept = bt_realloc(solver->kept, (size_t)(solver->cap_kept = 2 * solver->cap_kept + 8),
                                      sizeof *solver->kept);
        solver->kept[solver->n_kept++] = (bt_kept_rows){k, j, *contact};
    }
}

/// Gaps after the first pass, and new rows of the pairs that have turned.
static void find_left(bt_world *world, bt_idx k, const void *shifted, bt_totals *totals)
{
    bt_cell *cell = &world->cells->cell[k];
    const bt_vel *d = world->solver->shift;
    for (bt_idx j = 0; j < cell->n_contacts; j++) {
        bt_contact *contact = &cell->contacts[j];
        bt_gaps *gaps = &cell->gaps[j];
        for (int i = 0; i < contact->n; i++)
            if (*(const bool *)shifted) gaps->gap[i] += bt_normal_velocity(contact, i, &d[contact->a], &d[contact->b]);
        if (!turns(world, cell, j, LEFT * world->par.slop)) continue;
        bt_manifold manifold;
        const bt_pair *pair = &cell->search.pairs[contact->pair];
        bt_axes axes = pair->axes;
        if (!bt_contacts_parts(world, contact->a, contact->b, pair->part, 0, (int)(gaps->feature[0] >> 31), &manifold,
                               &axes)) continue;
        keep(world->solver, k, j, contact);
        bt_pack_rows(world, &manifold, contact);
        for (int i = 0; i < manifold.n_points; i++) {
            gaps->gap[i] = manifold.p[i].gap;
            totals->most = bt_max(totals->most, -gaps->gap[i]);
        }
    }
    begin(world, cell); // with the new rows
}

static bt_found residual_in_place(bt_cell *cell, double slop, const bt_vel *d, const bt_problem *problem)
{
    bt_found found = {0};
    for (bt_idx j = 0; j < cell->n_contacts; j++) {
        const bt_contact *contact = &cell->contacts[j];
        const bt_gaps *gaps = &cell->gaps[j];
        const bt_in_place *in_place = &cell->work->in_place[j];
        double worst = 0;
        bool on = problem->plain;
        for (int i = 0; i < contact->n; i++) {
            const double open = bt_opening(contact, gaps, slop, i, &d[contact->a], &d[contact->b]),
                         x = in_place->multiplier[i];
            const double r = fabs(bt_max(0, x - open * in_place->mass.mn[i]) - x) * in_place->mass.w[i];
            worst = bt_max(worst, r);
            found.squares += r * r;
            on = on || x > 0 || x != in_place->before[i] || !(open >= 0);
        }
        found.most = bt_max(found.most, worst);
        found.bad += worst > BT_NEAR * problem->tolerance;
        found.rows += contact->n;
        if (on) cell->work->list[cell->n_listed++] = j;
    }
    return found;
}

static void residual_of_cell(bt_world *world, bt_idx k, const void *context, bt_totals *totals)
{
    (void)totals;
    const bt_problem *problem = context;
    bt_cell *cell = &world->cells->cell[k];
    const bt_vel *d = world->solver->shift;
    const double slop = world->par.slop;
    bt_batch_unpack(cell);
    bt_rounds_list(cell);
    const bt_found found = in_batches(cell, problem->plain)
                           ? bt_batch_projection_residual(cell, slop, d, world->bodies.inv, problem)
                                                            : residual_in_place(cell, slop, d, problem);
    bt_rounds_found(cell, &found);
}

static void project_cell(bt_world *world, bt_idx k, const void *context, bt_totals *totals)
{
    const bt_sweep *sweep = context;
    bt_cell *cell = &world->cells->cell[k];
    if (cell->n_listed == 0) return;
    if (in_batches(cell, sweep->problem->plain)) {
        bt_batch_project(cell, world->par.slop, world->solver->shift, world->bodies.inv, sweep, totals);
        return;
    }
    bt_moved moved;
    if (sweep->moves) bt_moved_begin(&moved, cell);
    for (bt_idx j = 0; sweep->moves && j < cell->n_listed; j++) {
        bt_in_place *in_place = &cell->work->in_place[cell->work->list[j]];
        bt_rounds_move(sweep, in_place->multiplier, in_place->before, moved.y[j], 2);
    }
    for (bt_idx j = 0; j < cell->n_listed; j++) {
        const bt_idx u = cell->work->list[j];
        bt_in_place *in_place = &cell->work->in_place[u];
        totals->most = bt_max(totals->most, bt_project_contact(&cell->contacts[u], &in_place->mass, &cell->gaps[u],
                                                               in_place->multiplier, world->par.slop,
                                                               world->solver->shift, world->bodies.inv));
    }
    bt_sum_add(&totals->sum[BT_SWEEP_UPDATES], cell->n_listed);
    if (!sweep->moves) return;
    double against = 0;
    for (bt_idx j = 0; j < cell->n_listed; j++) {
        const bt_in_place *in_place = &cell->work->in_place[cell->work->list[j]];
        for (int i = 0; i < 2; i++)
            against += bt_rounds_against(in_place->mass.w[i], in_place->multiplier[i], in_place->before[i],
                                         moved.y[j][i]);
    }
    bt_moved_end(&moved, cell, sweep, against, totals);
}

void bt_solver_make_shift(bt_world *world)
{
    bt_solver *solver = world->solver;
    if (solver->shift && world->bodies.n <= solver->cap_bodies) return;
    solver->cap_bodies = world->bodies.n > 0 ? world->bodies.n : 1; // a rank may own nothing
    free(solver->shift);
    solver->shift = bt_alloc_aligned((size_t)solver->cap_bodies, sizeof *solver->shift);
}

static void solve_apart(bt_world *world)
{
    bt_step_stats *st = &world->stats;
    bt_problem problem = {.residual = residual_of_cell,
                          .sweep = project_cell,
                          .vel = world->solver->shift,
                          .tolerance = 0.1 * world->par.slop,
                          .cap = 0.9,
                          .length = 25,
                          .limit = (double)world->par.position_sweeps,
                          .plain = world->par.plain_sweeps};
    bt_rounds_scale(&problem, world->cells);
    bt_work work = {0};
    bt_rounds_residual(world, &problem, BT_BEGINS, &work);
    if (problem.plain) // the reference, and what fields are shaken with: no residual pass, it ends with the updates
        while (work.sweeps < world->par.position_sweeps && (work.sweeps == 0 || work.residual > problem.tolerance))
            work.residual = bt_rounds_sweep(world, &problem, &work);
    else bt_rounds_run(world, &problem, &work);
    st->position_sweeps += work.sweeps;
    st->position_updates += work.updates;
    st->projected = st->projected && work.residual <= problem.tolerance;
}

/// Part what overlaps by the gaps as they have been found: bt_solver.shift.
static void part(bt_world *world)
{
    const bt_cells *ts = world->cells;
    bt_solver *solver = world->solver;
    bt_solver_make_shift(world);
    for (bt_idx j = 0; j < ts->n_busy; j++) {
        const bt_idx k = ts->busy[j];
        if (k == ts->n - 1 || bt_cells_moves(ts, k))
            memset(solver->shift + ts->cell[k].first, 0,
                   (size_t)(ts->cell[k].end - ts->cell[k].first) * sizeof *solver->shift);
    }
    bt_domain_solve(world, solve_apart, solver->shift);
}

void bt_solver_project(bt_world *world)
{
    bt_solver *solver = world->solver;
    bt_step_stats *st = &world->stats;
    st->position_sweeps = st->position_updates = 0;
    st->projected = true;
    solver->n_kept = 0;
    bt_totals totals = {.n_sums = N_FOUND};
    bt_phases_any_order(world, find_overlap, NULL, &totals);
    bt_domain_reduce(world, &totals);
    solver->turned = bt_sum_value(&totals.sum[TURNS]) > 0;
    solver->shifted = totals.most > world->par.slop;
    if (solver->shifted) part(world);
}

bool bt_solver_project_again(bt_world *world)
{
    bt_solver *solver = world->solver;
    if (!solver->turned) return false;
    bt_totals totals = {0};
    bt_phases_any_order(world, find_left, &solver->shifted, &totals);
    bt_domain_reduce(world, &totals);
    const bool deep = totals.most > LEFT * world->par.slop;
    if (deep) part(world);
    for (bt_idx i = 0; i < solver->n_kept; i++) {
        const bt_kept_rows *kept = &solver->kept[i];
        world->cells->cell[kept->cell].contacts[kept->at] = kept->was;
    }
    solver->shifted = solver->shifted || deep;
    return deep;
}
