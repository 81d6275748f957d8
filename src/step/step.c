// SPDX-License-Identifier: MIT
// One time step, equations (1)–(3) of Yulmetov & Løset 2017 in the order in which they are solved.
#include <math.h>
#include <string.h>

#include "contact/law_pair.h"
#include "base/inside.h"
#include "contact/contacts.h"
#include "contact/row.h"
#include "contact/law.h"
#include "force/environment.h"
#include "force/exposure.h"
#include "force/forces.h"
#include "loads/impact.h"
#include "solve/solver.h"
#include "bergtow/sum.h"
#include "space/cells.h"
#include "tow/tow.h"
#include "step/splitting.h"
#include "step/window.h"
#include "bergtow/world.h"
#include "partition/domain.h"
#include "space/phases.h"

/// Move body i by its velocity over dt, and by its displacement if `shifted`; returns the length of its path relative
/// to the water, m. Displacements of the projection exist only for cells that contacts may move: elsewhere the array
/// holds stale values, perhaps of other bodies.
static double move(bt_world *world, bt_idx i, double dt, bool shifted)
{
    bt_bodies *bodies = &world->bodies;
    const bt_solver *solver = world->solver;
    const double drift_x = world->par.water_u, drift_y = world->par.water_v;
    double dx = dt * bodies->vel[i].x, dy = dt * bodies->vel[i].y, turn = dt * bodies->vel[i].w;
    double x = dt * (bodies->vel[i].x - drift_x), y = dt * (bodies->vel[i].y - drift_y);
    if (dt > 0) bodies->disturbed[i] = 0;
    if (shifted) {
        const bt_vel d = solver->shift[i];
        dx += d.x, dy += d.y, turn += d.w;
        x += d.x, y += d.y;
        if (d.x != 0 || d.y != 0 || d.w != 0) bodies->disturbed[i] = 1;
    }
    if (dx == 0 && dy == 0 && turn == 0 && world->cells->still) return 0; // true of most floes of a moving cell
    bt_pose *pose = &bodies->pose[i];
    if (dx != 0 || dy != 0) {
        int32_t across = 0;
        pose->x = bt_into_period(pose->x + dx, world->par.x0, world->par.period_x, &bodies->lap[i]);
        pose->y = bt_into_period(pose->y + dy, world->par.y0, world->par.period_y, &across);
    }
    if (turn != 0) {
        pose->yaw += turn;
        bt_bodies_turn(&world->bodies, i);
    }
    if (world->tow && i >= world->cells->n_in_cells && i == bt_world_towed(world)) {
        world->tow->travel_x += dx;
        world->tow->travel_y += dy;
    }
    if (x == 0 && y == 0 && turn == 0) return 0;
    // Rounding of a pose of kilometres must not make the path shorter than the move.
    const double path = (sqrt(x * x + y * y) + bodies->radius[i] * fabs(turn)) * (1 + 1e-9);
    bodies->path[i] += path;
    return path;
}

/// Do all bodies of the cell drift with the water, undisturbed?
static bool at_rest(const bt_world *world, const bt_cell *cell)
{
    const bt_bodies *bodies = &world->bodies;
    for (bt_idx i = cell->first; i < cell->end; i++)
        if (bodies->disturbed[i] || bodies->vel[i].x != world->par.water_u || bodies->vel[i].y != world->par.water_v ||
            bodies->vel[i].w != 0)
            return false;
    return true;
}

typedef struct {
    double dt; ///< s; 0: displacements alone
    bool can_sleep, shifted;
} way;

/// Maxima: the longest path, and the distance of a floe outside its cell, m.
static void advance_cell(bt_world *world, bt_idx k, const void *context, bt_totals *most)
{
    const way *by = context;
    bt_cells *ts = world->cells;
    const bt_cell *cell = &ts->cell[k];
    const bool last = k == ts->n - 1, moves = last || bt_cells_moves(ts, k), shifted = by->shifted && moves;
    if (!moves && ts->still) return;
    double path = 0, out = 0;
    for (bt_idx i = cell->first; i < cell->end; i++) {
        const double length = move(world, i, by->dt, shifted);
        path = bt_max(path, length);
        // a floe at rest lies no farther out than before
        if (!last && (length > 0 || !ts->still)) out = bt_max(out, bt_cells_outside(world, i));
    }
    ts->moved[k] += path;
    most->most2 = bt_max(most->most2, out);
    if (!last) most->most = bt_max(most->most, path);
    if (!moves || last) return;
    if (!by->can_sleep || !at_rest(world, cell)) ts->asleep[k] = BT_AWAKE;
    // a cell already asleep stays so: its forces would be the same
    else if (!ts->asleep[k]) ts->asleep[k] = BT_ASLEEP_NEW;
}

static void move_bodies(bt_world *world, way by)
{
    bt_cells *ts = world->cells;
    bt_totals totals = {0};
    bt_phases_busy(world, advance_cell, &by, &totals);
    ts->moved_any += totals.most;
    bt_domain_maxima(world, &totals.most2, 1);
    ts->relabel = ts->relabel || totals.most2 > ts->allowance;
}

/// X2 = X1 + U2 Δt + D.
static void advance(bt_world *world)
{
    bt_cells *ts = world->cells;
    // Cells move with the water along directions that are not periodic.
    bt_environment_advance(world);
    if (!(world->par.period_x > 0)) ts->x0 = world->par.x0 + world->drift_x;
    if (!(world->par.period_y > 0)) ts->y0 = world->par.y0 + world->drift_y;
    const bool can_sleep = bt_forces_rest(world);
    ts->relabel = false;
    move_bodies(world, (way){world->par.dt, can_sleep, world->solver->shifted});
    if (bt_solver_project_again(world)) move_bodies(world, (way){0, can_sleep, true});
    bt_tow_advance(world);
}

#define WORK_ROUNDING 1e-10 // share of the kinetic energy: a larger gain by the contacts is not rounding

enum { GAINED_X, GAINED_Y, APPLIED_X, APPLIED_Y, EXCHANGED, CARRIED, TOUCHED, WORK, GAIN, ENERGY, POINTS, ACTIVE,
       N_BALANCE };

/// Momentum gained by bodies, and impulses received from bodies of infinite mass, separately. An energy with which the
/// total might exceed what a sum holds is not a number.
static void balance_cell(bt_world *world, bt_idx k, const void *context, bt_totals *totals)
{
    (void)context;
    const bt_bodies *bodies = &world->bodies;
    const double most = 0x1p62 / bodies->n_global;
    const bt_cells *ts = world->cells;
    const bt_cell *cell = &ts->cell[k];
    if (!cell->own) return;
    if (cell->active) bt_sum_add(&totals->sum[ACTIVE], cell->end - cell->first);
    if (k != ts->n - 1 && !bt_cells_moves(ts, k) && ts->still) return;
    for (bt_idx i = cell->first; i < cell->end; i++) {
        if (bodies->motion[i] != BT_DYNAMIC) continue;
        const bt_vel *v = &bodies->vel[i];
        const double dx = v->x - bodies->vel_free[i].x, dy = v->y - bodies->vel_free[i].y;
        if (dx != 0 || dy != 0) { // also of a floe stopped by its contacts
            bt_sum_add(&totals->sum[GAINED_X], dx / bodies->inv[i].m);
            bt_sum_add(&totals->sum[GAINED_Y], dy / bodies->inv[i].m);
            bt_sum_add(&totals->sum[TOUCHED], bodies->mass[i]);
        }
        if (v->x == 0 && v->y == 0 && v->w == 0) continue;
        bt_sum_add(&totals->sum[CARRIED], bodies->mass[i] * (fabs(v->x) + fabs(v->y)));
        const double energy = 0.5 * (bodies->mass[i] * (v->x * v->x + v->y * v->y) + bodies->inertia[i] * v->w * v->w);
        bt_sum_add(&totals->sum[ENERGY], energy < most ? energy : NAN);
    }
    for (bt_idx j = 0; j < cell->n_contacts; j++) {
        const bt_contact *contact = &cell->contacts[j];
        const double normal = contact->ln[0] + contact->ln[1];
        if (normal == 0 && contact->lt == 0) continue;
        bt_sum_add(&totals->sum[EXCHANGED], contact->n > 0 ? normal
                                                           : sqrt(normal * normal + contact->lt * contact->lt));
        bt_sum_add(&totals->sum[WORK], bt_contacts_work(world, contact));
        bt_sum_add(&totals->sum[GAIN],
                   bt_contacts_gain(world, contact) - bt_contacts_unsolved_gain(contact, world->stats.residual));
        double jx, jy;
        if (!bt_impulse_from_outside(contact, bodies->inv, &jx, &jy)) continue;
        bt_sum_add(&totals->sum[APPLIED_X], jx);
        bt_sum_add(&totals->sum[APPLIED_Y], jy);
    }
    bt_sum_add(&totals->sum[POINTS], (double)cell->n_points);
    totals->most = bt_max(totals->most, cell->overlap);
}

/// Σ (M + Δt K) (U2 − U*) over dynamic bodies must equal the impulses from bodies of infinite mass and the line; the
/// difference over the momentum exchanged is the balance residual. Also sets work, energy, counts and overlap of the
/// step.
///
/// A velocity is rounded relative to the largest value that it had during the solve, which begins with the impulses of
/// the step before and takes back what is too much. So a step in which bodies come to rest exchanges less than the
/// rounding of the motion before it, and a difference relative to that exchange says nothing. The least momentum to
/// measure against is that of the bodies that contacts changed, at the speed to which the solver finds velocities, ε. A
/// run reports a share of 1e-9 (MOMENTUM_LIMIT in output/summary.c): with the default ε of 1e-3 reference speeds this
/// is 1e-12 of a reference speed, thousands of its roundings. Bodies that exchange more than ε of velocity are measured
/// against that alone. Rejected: all bodies in place of those that changed, since a field of floes at rest would hide
/// what a few of them lose; solver.rest_speed in place of ε, which is larger and may be 0.
static void balance(bt_world *world)
{
    const bt_cells *ts = world->cells;
    bt_step_stats *st = &world->stats;
    bt_totals all = {.n_sums = N_BALANCE};
    bt_phases_busy(world, balance_cell, NULL, &all);
    for (int k = 0; bt_tow_has_line(world->tow) && ts->cell[ts->n - 1].own && k < world->tow->n_branches; k++) {
        const bt_branch *branch = &world->tow->branch[k];
        bt_sum_add(&all.sum[APPLIED_X], branch->lambda * branch->lx);
        bt_sum_add(&all.sum[APPLIED_Y], branch->lambda * branch->ly);
        bt_sum_add(&all.sum[EXCHANGED], branch->lambda);
    }
    bt_domain_reduce(world, &all);
    double x[N_BALANCE];
    for (int k = 0; k < N_BALANCE; k++) x[k] = bt_sum_value(&all.sum[k]);
    const double ex = x[GAINED_X] - x[APPLIED_X], ey = x[GAINED_Y] - x[APPLIED_Y];
    // A step that exchanges almost nothing is measured against the momentum carried, to which rounding is relative.
    const double scale =
        bt_max(bt_max(x[EXCHANGED], 1e-4 * x[CARRIED]), world->par.tolerance * x[TOUCHED]);
    st->momentum_residual = scale > 0 ? sqrt(ex * ex + ey * ey) / scale : 0;
    st->contact_work = x[WORK];
    st->kinetic_energy = x[ENERGY];
    st->added_energy = x[GAIN] > WORK_ROUNDING * x[ENERGY];
    st->n_points = (int64_t)x[POINTS];
    st->n_active = (int64_t)x[ACTIVE];
    st->overlap = all.most;
}

/// Add to a phase the time since *t0, less the time spent waiting for other ranks, which has its own entry.
static void clock_phase(bt_world *world, double *phase, double *t0)
{
    bt_step_stats *st = &world->stats;
    const double now = bt_clock(), waited = bt_domain_exchange_time(world);
    *phase += now - *t0 - waited;
    ((double *)&st->shared)[phase - (double *)&st->phases] += st->in_team;
    st->phases.exchange += waited;
    st->in_team = 0;
    *t0 = now;
}

/// Detect and solve. The step is solved again, from the impulses found so far, for two reasons. First, loaded pairs
/// turn out to pass each other, or released pairs to meet (contact/contacts.h); the last rounds only restore rows.
/// Second, the margin of the detection is valid for the velocities before the solve; contacts can make a floe faster
/// (squeezed out of a wedge, spun, rebounding). When a converged solution outruns the margin, cells whose margin has
/// grown are detected again.
static void solve_contacts(bt_world *world)
{
    enum { MAX_REPEATS = 4, MAX_ROUNDS = 16, MAX_RELEASES = 7 };
    bt_step_stats *st = &world->stats;
    bt_bodies *bodies = &world->bodies;
    double t0 = bt_clock();
    double fastest = bt_contacts_bound(world, bodies->vel_start, bodies->vel_free, false);
    if (bt_cells_update(world, bt_margin_for(world, fastest)))
        bt_contacts_bound(world, bodies->vel_start, bodies->vel_free, false);
    int64_t sweeps = 0, updates = 0, moves = 0, checks = 0;
    bool again = false;
    st->repeats = 0;
    for (int round = 0;;) {
        if (round == 0) bt_contacts_detect(world, again); // gaps and J at X1
        clock_phase(world, &st->phases.detect, &t0);
        bt_solver_solve(world, again && round == 0); // U2 = U* + M̃⁻¹ Jᵀ λ
        sweeps += st->sweeps;
        updates += st->contact_updates;
        moves += st->contact_moves;
        checks += st->residual_checks;
        st->misjudged = st->converged ? bt_passing_review(world, round < MAX_RELEASES) : 0;
        clock_phase(world, &st->phases.solve, &t0);
        if (st->misjudged > 0 && round++ < MAX_ROUNDS) continue;
        fastest = bt_max(fastest, bt_contacts_bound(world, bodies->vel, bodies->vel, true));
        st->outrun = bt_contacts_outrun(world);
        if (!st->outrun || !st->converged || st->repeats == MAX_REPEATS) break;
        st->repeats++;
        round = 0;
        again = !bt_cells_update(world, bt_margin_for(world, fastest));
        if (!again) {
            bt_contacts_bound(world, bodies->vel_start, bodies->vel_free, false);
            bt_contacts_bound(world, bodies->vel, bodies->vel, true);
        }
    }
    clock_phase(world, &st->phases.detect, &t0);
    st->phases.detect -= st->phases.colour; // `detect` includes it
    st->sweeps = sweeps;
    st->contact_updates = updates;
    st->contact_moves = moves;
    st->residual_checks = checks;
}

/// Free velocities and contacts, repeated with the pieces of floes that split (step/splitting.h).
static void solve_split(bt_world *world)
{
    bt_step_stats *st = &world->stats, all = {0};
    for (int round = 0;; round++) {
        double t0 = bt_clock();
        bt_forces_begin(world);
        bt_forces_predict(world); // U*, effective M
        bt_tow_begin(world);
        clock_phase(world, &st->phases.forces, &t0);
        solve_contacts(world); // U2
        t0 = bt_clock();
        all.sweeps += st->sweeps;
        all.contact_updates += st->contact_updates;
        all.contact_moves += st->contact_moves;
        all.residual_checks += st->residual_checks;
        const bool again = bt_splitting_step(world, round);
        clock_phase(world, &st->phases.split, &t0);
        if (!again) break;
    }
    st->sweeps = all.sweeps;
    st->contact_updates = all.contact_updates;
    st->contact_moves = all.contact_moves;
    st->residual_checks = all.residual_checks;
}

void bt_world_step(bt_world *world)
{
    BT_PLAIN_NUMBERS;
    bt_step_stats *st = &world->stats;
    st->phases = st->shared = (bt_phases){0};
    st->in_team = 0;
    bt_domain_exchange_time(world); // waiting since the last step belongs to its record, not to this step
    double t0 = bt_clock();
    bt_environment_begin(world); // U_w, U_a
    bt_window_begin(world);
    bt_cells_begin(world);
    clock_phase(world, &st->phases.detect, &t0);
    if (world->tow)
        memcpy(world->forces->towed_at, (const double[]){world->tow->travel_x, world->tow->travel_y},
               sizeof world->forces->towed_at);
    bt_tow_prescribe(world);
    bt_exposure_begin(world); // of floes, only in some steps
    clock_phase(world, &st->phases.forces, &t0);
    solve_split(world); // U2
    t0 = bt_clock();
    bt_impacts_take(world); // of the towed body, by gaps and depths at X1
    clock_phase(world, &st->phases.advance, &t0);
    bt_laws_grow(world);
    bt_solver_project(world); // D
    clock_phase(world, &st->phases.project, &t0);
    balance(world);
    bt_forces_record(world); // of the towed body, at X1
    advance(world); // X2 = X1 + U2 Δt + D
    bt_undisturbed_advance(world);
    bt_domain_note(world);
    world->step++;
#ifdef BT_VALIDATE
    if (world->step % BT_VALIDATE_STEPS == 0) bt_domain_validate(world);
#endif
    clock_phase(world, &st->phases.advance, &t0);
}
