// SPDX-License-Identifier: MIT
// Forces on the towed body and balances of one step.
//
// Momentum balance of the towed body, along the tow direction d:
//     J_tow = M ΔU·d + J_ice·(−d) + J_ext·(−d)      (tow = inertia + ice resistance + drag)
// On a line J_tow is the line's own impulse, so the balance is a check. Under a prescribed velocity J_tow is what
// the balance leaves; the check is then the resistance found without the rows of the body: from the
// momentum that everything else has gained (ice_resistance_budget).
#include "bergtow/observe.h"

#include <math.h>

#include "bergtow/forces.h"
#include "bergtow/solver.h"
#include "bergtow/sum.h"
#include "bergtow/tow.h"

/// Contact impulse on the towed body along (dx, dy) without using its rows.
static double budget_impulse(const bt_world *w, double dx, double dy)
{
    const bt_bodies *b = &w->bodies;
    const bt_idx t = w->towed;
    if (b->motion[t] == BT_DYNAMIC) {
        double jx = (b->vel[t].x - b->vel_free[t].x) / b->inv[t].m, jy = (b->vel[t].y - b->vel_free[t].y) / b->inv[t].m;
        if (w->tow && w->tow->mode == BT_TOW_LINE) {
            jx -= w->tow->lambda * w->tow->lx;
            jy -= w->tow->lambda * w->tow->ly;
        }
        return jx * dx + jy * dy;
    }
    bt_sum sum = {0};
    for (bt_idx i = 0; i < b->n; i++) {
        if (b->motion[i] != BT_DYNAMIC) continue;
        double ux = b->vel[i].x - b->vel_free[i].x, uy = b->vel[i].y - b->vel_free[i].y;
        if (ux == 0 && uy == 0) continue;
        bt_sum_add(&sum, -(ux * dx + uy * dy) / b->inv[i].m);
    }
    const bt_solver *s = w->solver; // impulses that came from the other bodies of infinite mass
    for (bt_idx k = 0; k < s->n_rows; k++) {
        const bt_row *r = &s->rows[k];
        if (r->ln == 0) continue;
        bt_idx fixed = b->inv[r->b].m == 0 ? r->b : r->a;
        if (b->inv[fixed].m != 0 || fixed == t) continue;
        double jx = r->ln * r->nx - r->lt * r->ny, jy = r->ln * r->ny + r->lt * r->nx;
        bt_sum_add(&sum, (fixed == r->b ? -1 : 1) * (jx * dx + jy * dy));
    }
    return bt_sum_value(&sum);
}

static void observe_body(const bt_world *w, bt_sample *s)
{
    const bt_bodies *b = &w->bodies;
    const bt_idx t = w->towed;
    const bt_tow *tow = w->tow;
    const double dt = w->par.dt, dx = tow->ux, dy = tow->uy;
    double ice[3], external[3];
    bt_solver_impulse_on(w, t, ice);
    bt_forces_impulse(w, t, external);
    s->ice_force_x = ice[0] / dt;
    s->ice_force_y = ice[1] / dt;
    s->ice_moment = ice[2] / dt;
    s->ice_resistance = 0.0 - (ice[0] * dx + ice[1] * dy) / dt; // 0 − x, for no −0 in open water
    s->ice_resistance_budget = -budget_impulse(w, dx, dy) / dt;
    s->drag_force = -(external[0] * dx + external[1] * dy) / dt;
    s->inertia_force = b->mass[t] * ((b->vel[t].x - b->vel_start[t].x) * dx + (b->vel[t].y - b->vel_start[t].y) * dy) / dt;
    s->body_x = tow->travel_x;
    s->body_y = tow->travel_y;
    s->body_yaw = b->pose[t].yaw;
    s->body_vx = b->vel[t].x;
    s->body_vy = b->vel[t].y;
    s->body_yaw_rate = b->vel[t].w;
    if (tow->mode == BT_TOW_LINE) {
        s->line_tension = bt_tow_tension(tow);
        s->line_length = tow->length;
        s->carriage_x = tow->carriage_x;
        s->carriage_y = tow->carriage_y;
        s->tow_force = s->line_tension * (tow->lx * dx + tow->ly * dy);
    } else if (tow->mode == BT_TOW_SPEED) {
        s->tow_force = s->ice_resistance + s->drag_force + s->inertia_force;
    } else {
        s->tow_force = 0;
    }
    const bt_solver *sv = w->solver;
    for (bt_idx k = 0; k < sv->n_rows; k++) s->contacts_body += sv->rows[k].ln > 0 && (sv->rows[k].a == t || sv->rows[k].b == t);
}

void bt_observe(const bt_world *w, double reference_speed, bt_sample *s)
{
    const bt_step_stats *st = &w->stats;
    const bt_bodies *b = &w->bodies;
    *s = (bt_sample){
        .time = (double)w->step * w->par.dt,
        .contacts = (double)st->n_points,
        .sweeps = (double)st->sweeps,
        .position_sweeps = (double)st->position_sweeps,
        .residual = st->residual,
        .unconverged = !st->converged,
        .overlap = st->overlap,
        .momentum_residual = st->momentum_residual,
        .kinetic_energy = st->kinetic_energy,
        .contact_work = st->contact_work,
        .repeats = (double)st->repeats,
        .outrun = st->outrun,
        .restitution_cut = st->restitution_cut,
        .line_tension = NAN,
        .line_length = NAN,
        .carriage_x = NAN,
        .carriage_y = NAN,
    };
    const double slow2 = 1e-4 * reference_speed * reference_speed;
    int64_t moving = 0;
    for (bt_idx i = 0; i < b->n; i++)
        moving += b->motion[i] == BT_DYNAMIC && i != w->towed &&
                  b->vel[i].x * b->vel[i].x + b->vel[i].y * b->vel[i].y > slow2;
    s->moving = (double)moving;
    if (w->towed >= 0) {
        observe_body(w, s);
    } else {
        s->tow_force = s->ice_resistance = s->ice_resistance_budget = s->ice_force_x = s->ice_force_y = s->ice_moment = NAN;
        s->drag_force = s->inertia_force = s->body_x = s->body_y = s->body_yaw = NAN;
        s->body_vx = s->body_vy = s->body_yaw_rate = NAN;
    }
}

void bt_observe_contact_force(const bt_world *w, bt_idx n, double *force)
{
    for (bt_idx i = 0; i < n; i++) force[i] = 0;
    const bt_contacts *c = w->contacts;
    for (bt_idx k = 0; k < c->n_man; k++) {
        const bt_manifold *m = &c->man[k];
        double f = m->p[0].ln;
        if (m->n_points > 1) f += m->p[1].ln;
        f /= w->par.dt;
        if (m->a < n) force[m->a] = bt_max(force[m->a], f);
        if (m->b < n) force[m->b] = bt_max(force[m->b], f);
    }
}

bt_idx bt_observe_not_finite(const bt_world *w)
{
    const bt_bodies *b = &w->bodies;
    for (bt_idx i = 0; i < b->n; i++) {
        double s = b->pose[i].x + b->pose[i].y + b->pose[i].yaw + b->vel[i].x + b->vel[i].y + b->vel[i].w;
        if (!isfinite(s)) return i;
    }
    return -1;
}
