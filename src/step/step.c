// SPDX-License-Identifier: MIT
// One time step, equations (1)–(3) of Yulmetov & Løset 2017 in the order in which they are solved.
#include <math.h>
#include <string.h>

#include "contact/law_pair.h"
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

/// Move body i by its velocity over dt, and by its displacement; returns the length of its path through the water's
/// frame, m. Displacements of the projection are there only for cells that contacts may move: for others their array
/// still holds what it held, maybe of other bodies.
static double move(bt_world *w, bt_idx i, double dt, bool shifted)
{
    bt_bodies *b = &w->bodies;
    const bt_solver *s = w->solver;
    const double drift_x = w->par.water_u, drift_y = w->par.water_v;
    double dx = dt * b->vel[i].x, dy = dt * b->vel[i].y, turn = dt * b->vel[i].w;
    double x = dt * (b->vel[i].x - drift_x), y = dt * (b->vel[i].y - drift_y);
    if (dt > 0) b->disturbed[i] = 0;
    if (shifted) {
        const bt_vel d = s->shift[i];
        dx += d.x, dy += d.y, turn += d.w;
        x += d.x, y += d.y;
        if (d.x != 0 || d.y != 0 || d.w != 0) b->disturbed[i] = 1;
    }
    if (dx == 0 && dy == 0 && turn == 0 && w->cells->still) return 0; // most floes of a cell that moves
    bt_pose *p = &b->pose[i];
    if (dx != 0 || dy != 0) {
        int32_t across = 0;
        p->x = bt_into_period(p->x + dx, w->par.x0, w->par.period_x, &b->lap[i]);
        p->y = bt_into_period(p->y + dy, w->par.y0, w->par.period_y, &across);
    }
    if (turn != 0) {
        p->yaw += turn;
        bt_bodies_turn(&w->bodies, i);
    }
    if (w->tow && i >= w->cells->n_in_cells && i == bt_world_towed(w)) {
        w->tow->travel_x += dx;
        w->tow->travel_y += dy;
    }
    if (x == 0 && y == 0 && turn == 0) return 0;
    // Rounding of a pose of kilometres must not make the path shorter than the move.
    const double path = (sqrt(x * x + y * y) + b->radius[i] * fabs(turn)) * (1 + 1e-9);
    b->path[i] += path;
    return path;
}

/// All bodies of cell t drift with the water, and nothing pushed them apart.
static bool at_rest(const bt_world *w, const bt_cell *t)
{
    const bt_bodies *b = &w->bodies;
    for (bt_idx i = t->first; i < t->end; i++)
        if (b->disturbed[i] || b->vel[i].x != w->par.water_u || b->vel[i].y != w->par.water_v || b->vel[i].w != 0)
            return false;
    return true;
}

typedef struct {
    double dt; ///< s, 0: by the displacements alone
    bool can_sleep, shifted;
} way;

/// The maxima: the farthest path, and how far a floe stands outside its cell, m.
static void advance_cell(bt_world *w, bt_idx k, const void *context, bt_totals *most)
{
    const way *by = context;
    bt_cells *ts = w->cells;
    const bt_cell *t = &ts->cell[k];
    const bool last = k == ts->n - 1, moves = last || bt_cells_moves(ts, k), shifted = by->shifted && moves;
    if (!moves && ts->still) return;
    double path = 0, out = 0;
    for (bt_idx i = t->first; i < t->end; i++) {
        const double length = move(w, i, by->dt, shifted);
        path = bt_max(path, length);
        if (!last && (length > 0 || !ts->still)) out = bt_max(out, bt_cells_outside(w, i)); // no farther than before
    }
    ts->moved[k] += path;
    most->most2 = bt_max(most->most2, out);
    if (!last) most->most = bt_max(most->most, path);
    if (!moves || last) return;
    if (!by->can_sleep || !at_rest(w, t)) ts->asleep[k] = BT_AWAKE;
    // where forces have been informed, they would find what they found
    else if (!ts->asleep[k]) ts->asleep[k] = BT_ASLEEP_NEW;
}

static void move_bodies(bt_world *w, way by)
{
    bt_cells *ts = w->cells;
    bt_totals t = {0};
    bt_phases_busy(w, advance_cell, &by, &t);
    ts->moved_any += t.most;
    bt_domain_maxima(w, &t.most2, 1);
    ts->relabel = ts->relabel || t.most2 > ts->allowance;
}

/// X2 = X1 + U2 Δt + D.
static void advance(bt_world *w)
{
    bt_cells *ts = w->cells;
    // Cells move with the water where that is not periodic.
    bt_environment_advance(w);
    if (!(w->par.period_x > 0)) ts->x0 = w->par.x0 + w->drift_x;
    if (!(w->par.period_y > 0)) ts->y0 = w->par.y0 + w->drift_y;
    const bool can_sleep = bt_forces_rest(w);
    ts->relabel = false;
    move_bodies(w, (way){w->par.dt, can_sleep, w->solver->shifted});
    if (bt_solver_project_again(w)) move_bodies(w, (way){0, can_sleep, true});
    bt_tow_advance(w);
}

#define WORK_ROUNDING 1e-10 // of the kinetic energy: work of the contacts above it is no rounding

enum { GAINED_X, GAINED_Y, APPLIED_X, APPLIED_Y, EXCHANGED, CARRIED, WORK, UNSOLVED, ENERGY, POINTS, ACTIVE,
       N_BALANCE };

/// Momentum that bodies gained and impulses that came in from bodies of infinite mass, separately.
static void balance_cell(bt_world *w, bt_idx k, const void *context, bt_totals *t)
{
    (void)context;
    const bt_bodies *b = &w->bodies;
    const bt_cells *ts = w->cells;
    const bt_cell *cell = &ts->cell[k];
    if (!cell->own) return;
    if (cell->active) bt_sum_add(&t->sum[ACTIVE], cell->end - cell->first);
    if (k != ts->n - 1 && !bt_cells_moves(ts, k) && ts->still) return;
    for (bt_idx i = cell->first; i < cell->end; i++) {
        if (b->motion[i] != BT_DYNAMIC) continue;
        const bt_vel *v = &b->vel[i];
        const double dx = v->x - b->vel_free[i].x, dy = v->y - b->vel_free[i].y;
        if (dx != 0 || dy != 0) { // also of a floe that its contacts have stopped
            bt_sum_add(&t->sum[GAINED_X], dx / b->inv[i].m);
            bt_sum_add(&t->sum[GAINED_Y], dy / b->inv[i].m);
        }
        if (v->x == 0 && v->y == 0 && v->w == 0) continue;
        bt_sum_add(&t->sum[CARRIED], b->mass[i] * (fabs(v->x) + fabs(v->y)));
        bt_sum_add(&t->sum[ENERGY], 0.5 * (b->mass[i] * (v->x * v->x + v->y * v->y) + b->inertia[i] * v->w * v->w));
    }
    for (bt_idx j = 0; j < cell->n_contacts; j++) {
        const bt_contact *u = &cell->contacts[j];
        const double normal = u->ln[0] + u->ln[1];
        if (normal == 0 && u->lt == 0) continue;
        bt_sum_add(&t->sum[EXCHANGED], u->n > 0 ? normal : sqrt(normal * normal + u->lt * u->lt));
        bt_sum_add(&t->sum[WORK], bt_contacts_work(w, u));
        bt_sum_add(&t->sum[UNSOLVED], bt_contacts_unsolved_work(u, w->stats.residual));
        double jx, jy;
        if (!bt_impulse_from_outside(u, b->inv, &jx, &jy)) continue;
        bt_sum_add(&t->sum[APPLIED_X], jx);
        bt_sum_add(&t->sum[APPLIED_Y], jy);
    }
    bt_sum_add(&t->sum[POINTS], (double)cell->n_points);
    t->most = bt_max(t->most, cell->overlap);
}

/// Σ (M + Δt K) (U2 − U*) over dynamic bodies must equal the impulses that came in from bodies of infinite mass and the
/// line; the difference over the momentum exchanged is the residual. Also work, energy, counts and overlap of the step.
static void balance(bt_world *w)
{
    const bt_cells *ts = w->cells;
    bt_step_stats *st = &w->stats;
    bt_totals all = {.n_sums = N_BALANCE};
    bt_phases_busy(w, balance_cell, NULL, &all);
    for (int k = 0; bt_tow_has_line(w->tow) && ts->cell[ts->n - 1].own && k < w->tow->n_branches; k++) {
        const bt_branch *b = &w->tow->branch[k];
        bt_sum_add(&all.sum[APPLIED_X], b->lambda * b->lx);
        bt_sum_add(&all.sum[APPLIED_Y], b->lambda * b->ly);
        bt_sum_add(&all.sum[EXCHANGED], b->lambda);
    }
    bt_domain_reduce(w, &all);
    double x[N_BALANCE];
    for (int k = 0; k < N_BALANCE; k++) x[k] = bt_sum_value(&all.sum[k]);
    const double ex = x[GAINED_X] - x[APPLIED_X], ey = x[GAINED_Y] - x[APPLIED_Y];
    // A step that exchanges next to nothing is measured against the momentum carried: rounding is relative to that.
    const double scale = bt_max(x[EXCHANGED], 1e-4 * x[CARRIED]);
    st->momentum_residual = scale > 0 ? sqrt(ex * ex + ey * ey) / scale : 0;
    st->contact_work = x[WORK];
    st->kinetic_energy = x[ENERGY];
    st->added_energy = x[WORK] - x[UNSOLVED] > WORK_ROUNDING * x[ENERGY];
    st->n_points = (int64_t)x[POINTS];
    st->n_active = (int64_t)x[ACTIVE];
    st->overlap = all.most;
}

/// Add to a phase the time since *t0, less what was spent waiting for other ranks, which has its own entry.
static void clock_phase(bt_world *w, double *phase, double *t0)
{
    bt_step_stats *st = &w->stats;
    const double now = bt_clock(), waited = bt_domain_exchange_time(w);
    *phase += now - *t0 - waited;
    ((double *)&st->shared)[phase - (double *)&st->phases] += st->in_team;
    st->phases.exchange += waited;
    st->in_team = 0;
    *t0 = now;
}

/// Detect and solve. The step is solved again, from the impulses found so far, for two reasons. Pairs that bear load
/// are found to pass each other, or pairs that were let pass to meet (contact/contacts.h): the last rounds only give
/// rows back. And the margin of the detection holds for the velocities before the solve; contacts can make a floe
/// faster (squeezed out of a wedge, spun, rebounding). When a solution that converged outruns the margin, cells whose
/// margin has grown are detected again.
static void solve_contacts(bt_world *w)
{
    enum { MAX_REPEATS = 4, MAX_ROUNDS = 8, MAX_RELEASES = 3 };
    bt_step_stats *st = &w->stats;
    bt_bodies *b = &w->bodies;
    double t0 = bt_clock();
    double fastest = bt_contacts_bound(w, b->vel_start, b->vel_free, false);
    if (bt_cells_update(w, bt_margin_for(w, fastest))) bt_contacts_bound(w, b->vel_start, b->vel_free, false);
    int64_t sweeps = 0, updates = 0, moves = 0, checks = 0;
    bool again = false;
    st->repeats = 0;
    for (int round = 0;;) {
        if (round == 0) bt_contacts_detect(w, again); // gaps and J at X1
        clock_phase(w, &st->phases.detect, &t0);
        bt_solver_solve(w, again && round == 0); // U2 = U* + M̃⁻¹ Jᵀ λ
        sweeps += st->sweeps;
        updates += st->contact_updates;
        moves += st->contact_moves;
        checks += st->residual_checks;
        st->misjudged = st->converged ? bt_passing_review(w, round < MAX_RELEASES) : 0;
        clock_phase(w, &st->phases.solve, &t0);
        if (st->misjudged > 0 && round++ < MAX_ROUNDS) continue;
        fastest = bt_max(fastest, bt_contacts_bound(w, b->vel, b->vel, true));
        st->outrun = bt_contacts_outrun(w);
        if (!st->outrun || !st->converged || st->repeats == MAX_REPEATS) break;
        st->repeats++;
        round = 0;
        again = !bt_cells_update(w, bt_margin_for(w, fastest));
        if (!again) {
            bt_contacts_bound(w, b->vel_start, b->vel_free, false);
            bt_contacts_bound(w, b->vel, b->vel, true);
        }
    }
    clock_phase(w, &st->phases.detect, &t0);
    st->phases.detect -= st->phases.colour; // which it holds
    st->sweeps = sweeps;
    st->contact_updates = updates;
    st->contact_moves = moves;
    st->residual_checks = checks;
}

/// Free velocities and contacts, again with the pieces of floes that split (step/splitting.h).
static void solve_split(bt_world *w)
{
    bt_step_stats *st = &w->stats, all = {0};
    for (int round = 0;; round++) {
        double t0 = bt_clock();
        bt_forces_begin(w);
        bt_forces_predict(w); // U*, effective M
        bt_tow_begin(w);
        clock_phase(w, &st->phases.forces, &t0);
        solve_contacts(w); // U2
        t0 = bt_clock();
        all.sweeps += st->sweeps;
        all.contact_updates += st->contact_updates;
        all.contact_moves += st->contact_moves;
        all.residual_checks += st->residual_checks;
        const bool again = bt_splitting_step(w, round);
        clock_phase(w, &st->phases.split, &t0);
        if (!again) break;
    }
    st->sweeps = all.sweeps;
    st->contact_updates = all.contact_updates;
    st->contact_moves = all.contact_moves;
    st->residual_checks = all.residual_checks;
}

void bt_world_step(bt_world *w)
{
    bt_step_stats *st = &w->stats;
    st->phases = st->shared = (bt_phases){0};
    st->in_team = 0;
    bt_domain_exchange_time(w); // waited since the last step, for its record: not in the time of this one
    double t0 = bt_clock();
    bt_environment_begin(w); // U_w, U_a
    bt_window_begin(w);
    bt_cells_begin(w);
    clock_phase(w, &st->phases.detect, &t0);
    if (w->tow)
        memcpy(w->forces->towed_at, (const double[]){w->tow->travel_x, w->tow->travel_y}, sizeof w->forces->towed_at);
    bt_tow_lead(w);
    bt_exposure_begin(w); // of floes, in some steps
    clock_phase(w, &st->phases.forces, &t0);
    solve_split(w); // U2
    t0 = bt_clock();
    bt_laws_grow(w);
    bt_solver_project(w); // D
    clock_phase(w, &st->phases.project, &t0);
    balance(w);
    bt_forces_record(w); // of the towed body, at X1
    bt_impacts_take(w); // of the towed body, at X1
    advance(w); // X2 = X1 + U2 Δt + D
    bt_undisturbed_advance(w);
    bt_domain_note(w);
    w->step++;
#ifdef BT_VALIDATE
    if (w->step % BT_VALIDATE_STEPS == 0) bt_domain_validate(w);
#endif
    clock_phase(w, &st->phases.advance, &t0);
}
