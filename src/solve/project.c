// SPDX-License-Identifier: MIT
// Split-impulse position projection: overlap is removed by displacements that never become velocities.
//
// With the gaps predicted for the end of the step, g2 = g + Δt J_n U2, find displacements D = M̃⁻¹ J_nᵀ p, M̃ as in
// solver.h, with
//     0 ≤ p ⟂ J_n D + g2 + slop ≥ 0
// by the same rows without friction. That is a contact problem of the same form, solved by the solver's own sweeps and
// residuals (solver.h): during the projection, cells have other contacts, with the gaps as biases, without friction and
// bounds. Touching contacts (g2 ≥ −slop) take part, so that pushing two floes apart does not press either into a third.
// Velocity-level correction (Baumgarte) would add spurious kinetic energy and load (Metrikin 2014).
//
// Second pass. The gaps above are linear in the rotations of a step. Two bodies that rotate by θ relative to each other
// may overlap by θ²/2 of their radii at the end, as does, at 5 s, a floe that rolls along a hull. One that slides by s
// along the other while both turn by θ overlaps it by θ s: the surface turns under it. So where a rotation can have
// left more than LEFT slops, the contacts of the pair are found anew at the present poses: the rolling floe
// now touches the hull metres away. If one of them is that deep, the new rows, with the unchanged rows of all other
// pairs, separate the bodies once more. Most steps have no such rotation; most that have need no second pass. Not for
// the plain reference, which also makes the fields: its own sweeps, point by point, keep the bits of fields.
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
enum { LEFT = 5 }; // overlap that a rotation may leave, in slops: half of the warning threshold of a run, assumed

/// May the rotation of the bodies of contact j in this step have left an overlap above `least`, m? Its gaps are those
/// at the end of the step. Only for pairs that touch with unchanged outlines: where ice has given way, or sheets lie on
/// each other, overlap is allowed.
static bool turns(const bt_world *world, const bt_cell *cell, bt_idx j, double least)
{
    const bt_bodies *bodies = &world->bodies;
    const bt_contact *contact = &cell->contacts[j];
    const bt_vel *va = &bodies->vel[contact->a], *vb = &bodies->vel[contact->b];
    const double turn = world->par.dt * fabs(vb->w - va->w),
                 swing = world->par.dt * bt_max(fabs(va->w), fabs(vb->w)); // of the normal, which slip depends on
    if (swing == 0) return false;
    const double *g = cell->gaps[j].gap, gap = contact->n > 1 ? bt_min(g[0], g[1]) : g[0];
    const double slip = world->par.dt * fabs(bt_tangent_velocity(contact, va, vb));
    const double error = 0.5 * turn * turn * (bodies->radius[contact->a] + bodies->radius[contact->b]) + swing * slip;
    if (!(bt_max(gap, -world->par.slop) - error < -least)) return false;
    if (!cell->laws->limits) return true;
    const bt_limit *limit = &cell->laws->limits[j];
    for (int law = 0; law < BT_ALL_LAWS; law++)
        if (limit->record[law] >= 0) return false;
    // a corner that comes over a seam is in the dent of another polygon
    return limit->grown[0] == 0 && limit->grown[1] == 0 && !(limit->rise && limit->rise->dent > 0);
}

static void find_overlap(bt_world *world, bt_idx k, const void *context, bt_totals *totals)
{
    (void)context;
    bt_cell *cell = &world->cells->cell[k];
    double deepest = 0;
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
            if (cell->laws->limits) gaps->gap[i] += cell->laws->limits[j].grown[i]; // crushed or rafted in this step
            deepest = bt_max(deepest, -gaps->gap[i]);
        }
        if (!world->par.plain_sweeps && turns(world, cell, j, LEFT * world->par.slop))
            bt_sum_add(&totals->sum[TURNS], 1);
    }
    cell->work->found.most = deepest;
    totals->most = bt_max(totals->most, deepest);
}

/// Update the gaps after the first pass, and form the row where a pair that has rotated touches now.
static void look_again(bt_world *world, bt_cell *cell, bt_idx j, bt_contact *row, bt_totals *totals)
{
    const bt_contact *contact = &cell->contacts[j];
    const bt_vel *d = world->solver->shift;
    bt_gaps *gaps = &cell->gaps[j];
    for (int i = 0; world->solver->shifted && i < contact->n; i++)
        gaps->gap[i] += bt_normal_velocity(contact, i, &d[contact->a], &d[contact->b]);
    if (!turns(world, cell, j, LEFT * world->par.slop)) return;
    bt_manifold manifold;
    const bt_pair *pair = &cell->search.pairs[contact->pair];
    bt_axes axes = pair->axes;
    if (!bt_contacts_parts(world, contact->a, contact->b, pair->part, 0, (int)(gaps->feature[0] >> 31), &manifold,
                           &axes)) return;
    bt_pack_rows(world, &manifold, row);
    for (int i = 0; i < manifold.n_points; i++) {
        gaps->gap[i] = manifold.p[i].gap;
        totals->most = bt_max(totals->most, -gaps->gap[i]);
    }
}

/// The contacts of a cell, put aside during the projection.
typedef struct bt_aside {
    bool formed; ///< the cell has the rows of the projection, and its contacts are here
    bt_contact *contacts;
    size_t bytes;
    bt_idx n;
    struct bt_limit *limits;
} bt_aside;

/// Replace the contacts of cell k by those of the projection; sheets have none.
static void put_rows(bt_world *world, bt_idx k, const void *again, bt_totals *totals)
{
    bt_cell *cell = &world->cells->cell[k];
    bt_contact *rows = bt_alloc_unset((size_t)cell->n_contacts, sizeof *rows);
    const double slop = world->par.plain_sweeps ? 0 : world->par.slop;
    bt_idx n = 0;
    for (bt_idx j = 0; j < cell->n_contacts; j++) {
        bt_contact *row = &rows[n];
        *row = cell->contacts[j];
        if (*(const bool *)again) look_again(world, cell, j, row, totals);
        row->ln[0] = row->ln[1] = row->lt = row->mu = 0;
        for (int i = 0; i < row->n; i++) row->bias[i] = cell->gaps[j].gap[i] + slop;
        n += row->n > 0;
    }
    world->solver->aside[k] =
        (bt_aside){true, cell->contacts, cell->contact_bytes, cell->n_contacts, cell->laws->limits};
    cell->contacts = rows;
    cell->contact_bytes = (size_t)cell->n_contacts * sizeof *rows;
    cell->n_contacts = n;
    cell->laws->limits = NULL;
    bt_solver_begin_cell(world, cell);
    if (world->par.plain_sweeps) bt_rounds_in_place(cell, world->bodies.inv);
}

/// Residual of a cell that displacements have reached.
static void residual_apart(bt_world *world, bt_idx k, const void *problem, bt_totals *totals)
{
    if (!world->solver->aside[k].formed) put_rows(world, k, &(bool){false}, totals);
    bt_solver_residual_of_cell(world, k, problem, totals);
}

/// Residual before any displacement: 0 where no gap is closed by more than the slop (find_overlap). Most cells stay so,
/// and need no rows. The large bodies move floes anywhere.
static void residual_at_rest(bt_world *world, bt_idx k, const void *problem, bt_totals *totals)
{
    bt_cell *cell = &world->cells->cell[k];
    if (world->par.plain_sweeps || world->solver->aside[k].formed || k == world->cells->n - 1 ||
        cell->work->found.most > world->par.slop) {
        residual_apart(world, k, problem, totals);
        return;
    }
    cell->n_listed = 0;
    bt_rounds_found(cell, &(bt_found){0});
}

static void put_back(bt_world *world)
{
    for (bt_idx i = 0; i < world->cells->n_order; i++) {
        const bt_idx k = world->cells->order[i];
        bt_cell *cell = &world->cells->cell[k];
        const bt_aside *aside = &world->solver->aside[k];
        if (!aside->formed) continue;
        free(cell->contacts);
        cell->contacts = aside->contacts;
        cell->contact_bytes = aside->bytes;
        cell->n_contacts = aside->n;
        cell->laws->limits = aside->limits;
        bt_batch_begin(cell);
    }
    free(world->solver->aside);
    world->solver->aside = NULL;
}

/// Begin to put contacts aside.
static void put_aside(bt_world *world)
{
    world->solver->aside = bt_alloc((size_t)world->cells->n, sizeof *world->solver->aside);
}

static void sweep_plain(bt_world *world, bt_idx k, const void *context, bt_totals *totals)
{
    (void)context;
    bt_cell *cell = &world->cells->cell[k];
    for (bt_idx j = 0; j < cell->n_listed; j++) {
        const bt_idx i = cell->work->list[j];
        totals->most = bt_max(totals->most, bt_project_contact(&cell->contacts[i], &cell->work->in_place[i].mass,
                                                               world->par.slop, world->solver->shift,
                                                               world->bodies.inv));
    }
    bt_sum_add(&totals->sum[BT_SWEEP_UPDATES], cell->n_listed);
}

static void solve_apart(bt_world *world)
{
    bt_step_stats *st = &world->stats;
    bt_problem problem = {.residual = residual_at_rest,
                          .sweep = world->par.plain_sweeps ? sweep_plain : bt_solver_sweep_cell,
                          .vel = world->solver->shift,
                          .tolerance = 0.1 * world->par.slop,
                          .cap = 0.9,
                          .length = 25,
                          .limit = (double)world->par.position_sweeps,
                          .plain = world->par.plain_sweeps};
    bt_rounds_scale(&problem, world->cells);
    bt_work work = {0};
    bt_rounds_residual(world, &problem, BT_BEGINS, &work);
    problem.residual = residual_apart;
    if (problem.plain) // the reference, also used to shake fields: no residual pass, the updates end it
        while (work.sweeps < world->par.position_sweeps && (work.sweeps == 0 || work.residual > problem.tolerance))
            work.residual = bt_rounds_sweep(world, &problem, &work);
    else bt_rounds_run(world, &problem, &work);
    st->position_sweeps += work.sweeps;
    st->position_updates += work.updates;
    st->projected = st->projected && work.residual <= problem.tolerance;
}

/// Solve the rows of the cells for displacements that remove overlap (bt_solver.shift), then restore their contacts.
static void part(bt_world *world)
{
    const bt_cells *ts = world->cells;
    bt_solver *solver = world->solver;
    bt_rounds_make_shift(world);
    for (bt_idx j = 0; j < ts->n_busy; j++) {
        const bt_idx k = ts->busy[j];
        if (k == ts->n - 1 || bt_cells_moves(ts, k))
            memset(solver->shift + ts->cell[k].first, 0,
                   (size_t)(ts->cell[k].end - ts->cell[k].first) * sizeof *solver->shift);
    }
    bt_domain_solve(world, solve_apart, solver->shift);
    put_back(world);
}

void bt_solver_project(bt_world *world)
{
    bt_solver *solver = world->solver;
    bt_step_stats *st = &world->stats;
    st->position_sweeps = st->position_updates = 0;
    st->projected = true;
    bt_totals totals = {.n_sums = N_FOUND};
    bt_phases_any_order(world, find_overlap, NULL, &totals);
    bt_domain_reduce(world, &totals);
    solver->turned = bt_sum_value(&totals.sum[TURNS]) > 0;
    solver->shifted = totals.most > world->par.slop;
    if (!solver->shifted) return;
    put_aside(world);
    part(world);
}

bool bt_solver_project_again(bt_world *world)
{
    bt_solver *solver = world->solver;
    solver->parted_again = false;
    if (!solver->turned) return false;
    put_aside(world);
    bt_totals totals = {0};
    bt_phases_any_order(world, put_rows, &(bool){true}, &totals);
    bt_domain_reduce(world, &totals);
    solver->parted_again = totals.most > LEFT * world->par.slop;
    if (solver->parted_again) part(world);
    else put_back(world);
    solver->shifted = solver->shifted || solver->parted_again;
    return solver->parted_again;
}
