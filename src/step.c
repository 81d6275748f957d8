// SPDX-License-Identifier: MIT
// One time step, equations (1)–(3) of Yulmetov & Løset 2017 in the order in which they are solved.
#include <math.h>

#include "bergtow/contacts.h"
#include "bergtow/forces.h"
#include "bergtow/solver.h"
#include "bergtow/sum.h"
#include "bergtow/tow.h"
#include "bergtow/world.h"

static double wrap(double x, double low, double period)
{
    if (period > 0) {
        if (x < low) return x + period;
        if (x >= low + period) return x - period;
    }
    return x;
}

/// X2 = X1 + U2 Δt + D.
static void advance(bt_world *w)
{
    bt_bodies *b = &w->bodies;
    const bt_solver *s = w->solver;
    const double dt = w->par.dt;
#pragma omp parallel for schedule(static) if (b->n > 2000)
    for (bt_idx i = 0; i < b->n; i++) {
        double dx = dt * b->vel[i].x, dy = dt * b->vel[i].y, turn = dt * b->vel[i].w;
        if (s->shifted) {
            dx += s->shift[i].x;
            dy += s->shift[i].y;
            turn += s->shift[i].w;
        }
        if (dx == 0 && dy == 0 && turn == 0) continue;
        bt_pose *p = &b->pose[i];
        p->x = wrap(p->x + dx, w->par.x0, w->par.period_x);
        p->y = wrap(p->y + dy, w->par.y0, w->par.period_y);
        if (turn != 0) {
            p->yaw += turn;
            bt_world_turn_outline(w, i);
        }
        // Rounding of a pose of kilometres must not make the path shorter than the move.
        b->path[i] += (sqrt(dx * dx + dy * dy) + b->radius[i] * fabs(turn)) * (1 + 1e-9);
        if (i == w->towed && w->tow) {
            w->tow->travel_x += dx;
            w->tow->travel_y += dy;
        }
    }
    if (w->tow) {
        bt_tow *t = w->tow;
        double speed = bt_tow_speed(t, t->time + dt);
        t->carriage_x += dt * speed * t->ux;
        t->carriage_y += dt * speed * t->uy;
        t->time = (double)(w->step + 1) * dt;
    }
}

/// Σ (M + Δt K) (U2 − U*) over dynamic bodies must equal the impulses that came in from bodies of infinite mass and the
/// line; returns the difference over the momentum exchanged (both from the velocities and the rows, independently).
static double momentum_residual(const bt_world *w)
{
    const bt_bodies *b = &w->bodies;
    const bt_solver *s = w->solver;
    bt_sum gained[2] = {{0}, {0}}, applied[2] = {{0}, {0}}, exchanged = {0}, carried = {0};
    for (bt_idx i = 0; i < b->n; i++) {
        if (b->motion[i] != BT_DYNAMIC) continue;
        if (b->vel[i].x != 0 || b->vel[i].y != 0) bt_sum_add(&carried, b->mass[i] * (fabs(b->vel[i].x) + fabs(b->vel[i].y)));
        double dx = b->vel[i].x - b->vel_free[i].x, dy = b->vel[i].y - b->vel_free[i].y;
        if (dx == 0 && dy == 0) continue;
        bt_sum_add(&gained[0], dx / b->inv[i].m);
        bt_sum_add(&gained[1], dy / b->inv[i].m);
    }
    for (bt_idx k = 0; k < s->n_rows; k++) {
        const bt_row *r = &s->rows[k];
        if (r->ln == 0) continue;
        double sign = (b->inv[r->b].m > 0) - (b->inv[r->a].m > 0);
        bt_sum_add(&exchanged, r->ln);
        if (sign == 0) continue;
        bt_sum_add(&applied[0], sign * (r->ln * r->nx - r->lt * r->ny));
        bt_sum_add(&applied[1], sign * (r->ln * r->ny + r->lt * r->nx));
    }
    if (w->tow && w->tow->mode == BT_TOW_LINE) {
        bt_sum_add(&applied[0], w->tow->lambda * w->tow->lx);
        bt_sum_add(&applied[1], w->tow->lambda * w->tow->ly);
        bt_sum_add(&exchanged, w->tow->lambda);
    }
    double ex = bt_sum_value(&gained[0]) - bt_sum_value(&applied[0]);
    double ey = bt_sum_value(&gained[1]) - bt_sum_value(&applied[1]);
    // A step that exchanges next to nothing is measured against the momentum carried: rounding is relative to that.
    double scale = bt_max(bt_sum_value(&exchanged), 1e-4 * bt_sum_value(&carried));
    return scale > 0 ? sqrt(ex * ex + ey * ey) / scale : 0;
}

static double kinetic_energy(const bt_world *w)
{
    const bt_bodies *b = &w->bodies;
    bt_sum e = {0};
    for (bt_idx i = 0; i < b->n; i++) {
        if (b->motion[i] != BT_DYNAMIC) continue;
        const bt_vel *v = &b->vel[i];
        if (v->x == 0 && v->y == 0 && v->w == 0) continue;
        bt_sum_add(&e, 0.5 * (b->mass[i] * (v->x * v->x + v->y * v->y) + b->inertia[i] * v->w * v->w));
    }
    return bt_sum_value(&e);
}

/// Detect and solve. The margin of the detection holds for the velocities before the solve; contacts can make a floe
/// faster (squeezed out of a wedge, spun, rebounding). When the solution outruns the margin, the step is
/// detected and solved again with the margin that it needs, from the impulses found so far.
static void solve_contacts(bt_world *w)
{
    enum { MAX_REPEATS = 4 };
    bt_step_stats *st = &w->stats;
    bt_bodies *b = &w->bodies;
    double margin = bt_max(bt_contacts_margin(w, b->vel_start), bt_contacts_margin(w, b->vel_free));
    int64_t sweeps = 0;
    st->repeats = 0;
    st->detect_s = st->colour_s = st->solve_s = 0;
    for (;;) {
        const double t0 = bt_clock();
        bt_contacts_detect(w, margin); // gaps and J at X1
        const double t1 = bt_clock();
        bt_solver_solve(w); // U2 = U* + M⁻¹ Jᵀ λ
        const double t2 = bt_clock();
        sweeps += st->sweeps;
        st->detect_s += t1 - t0;
        st->colour_s += w->solver->prepare_s;
        st->solve_s += t2 - t1 - w->solver->prepare_s;
        const double needed = bt_contacts_margin(w, b->vel);
        st->outrun = needed > margin;
        if (!st->outrun || st->repeats == MAX_REPEATS) break;
        margin = needed;
        st->repeats++;
        for (bt_idx i = 0; i < b->n; i++) b->vel[i] = b->vel_free[i];
    }
    st->sweeps = sweeps;
}

void bt_world_step(bt_world *w)
{
    bt_step_stats *st = &w->stats;
    const double t0 = bt_clock();
    bt_forces_predict(w); // U*, effective M
    bt_tow_begin(w);
    st->forces_s = bt_clock() - t0;
    solve_contacts(w); // U2
    const double t1 = bt_clock();
    bt_solver_project(w); // D
    st->momentum_residual = momentum_residual(w);
    const double t2 = bt_clock();
    advance(w); // X2 = X1 + U2 Δt + D
    st->kinetic_energy = kinetic_energy(w);
    st->n_points = w->contacts->n_points;
    st->overlap = w->contacts->overlap;
    w->step++;
    st->solve_s += t2 - t1;
    st->advance_s = bt_clock() - t2;
}
