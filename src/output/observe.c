// SPDX-License-Identifier: MIT
// Forces on the towed body and balances of one step.
//
// Momentum balance of the towed body, along the tow direction d:
//     J_tow = M ΔU·d + (J_ice + Σ J_law)·(−d)
// tow = inertia + ice resistance + what the table of force laws has: drag, Coriolis, tilt, ... On a line J_tow is the
// line's own impulse, so the balance is a check. Under a prescribed velocity J_tow is what the balance leaves; the
// check is then the resistance found without the rows of the body: from the momentum that everything else has gained
// (ice_resistance_budget).
#include "output/observe.h"

#include <math.h>
#include <stdlib.h>

#include "bergtow/forces.h"
#include "loads/impact.h"
#include "solve/solver.h"
#include "bergtow/sum.h"
#include "contact/row.h"
#include "space/cells.h"
#include "tow/tow.h"
#include "step/window.h"
#include "partition/domain.h"
#include "space/phases.h"

enum { ICE_X, ICE_Y, ICE_TURN, BUDGET, TOUCHING, MOVING, N_SEEN };

/// One cell's share of the sums over contacts and floes.
static void observe_cell(bt_world *w, bt_idx k, const void *context, bt_totals *t)
{
    const bt_bodies *b = &w->bodies;
    const bt_cells *ts = w->cells;
    const bt_cell *cell = &ts->cell[k];
    const double slow2 = *(const double *)context;
    if (!cell->own || !(k == ts->n - 1 || bt_cells_moves(ts, k) || cell->n_contacts > 0 || !ts->still)) return;
    const bt_idx towed = bt_world_towed(w);
    const double dx = w->tow ? w->tow->ux : 0, dy = w->tow ? w->tow->uy : 0;
    const bool prescribed = towed >= 0 && b->motion[towed] != BT_DYNAMIC;
    int64_t moving = 0, touching = 0;
    for (bt_idx i = cell->first; i < cell->end; i++) {
        if (b->motion[i] != BT_DYNAMIC || i == towed) continue;
        const bt_vel *v = &b->vel[i];
        moving += v->x * v->x + v->y * v->y > slow2;
        const double ux = v->x - b->vel_free[i].x, uy = v->y - b->vel_free[i].y;
        if (prescribed && (ux != 0 || uy != 0)) bt_sum_add(&t->sum[BUDGET], -(ux * dx + uy * dy) / b->inv[i].m);
    }
    bt_sum_add(&t->sum[MOVING], (double)moving);
    if (towed < 0) return;
    for (bt_idx j = 0; j < cell->n_contacts; j++) {
        const bt_contact *u = &cell->contacts[j];
        const double normal = u->ln[0] + u->ln[1];
        if (normal == 0 && u->lt == 0) continue;
        double jx, jy;
        bt_impulse_on_b(u, &jx, &jy);
        if (u->a == towed || u->b == towed) {
            const bool is_b = u->b == towed;
            const double sign = is_b ? 1 : -1;
            const double *arm = is_b ? u->rbn : u->ran;
            bt_sum_add(&t->sum[ICE_X], sign * jx);
            bt_sum_add(&t->sum[ICE_Y], sign * jy);
            bt_sum_add(&t->sum[ICE_TURN],
                       sign * (u->ln[0] * arm[0] + u->ln[1] * arm[1] + u->lt * (is_b ? u->rbt : u->rat)));
            touching += (u->ln[0] > 0) + (u->ln[1] > 0);
        } else if (prescribed && bt_impulse_from_outside(u, b->inv, &jx, &jy)) { // from the others of infinite mass
            bt_sum_add(&t->sum[BUDGET], jx * dx + jy * dy);
        }
    }
    bt_sum_add(&t->sum[TOUCHING], (double)touching);
}

static bt_totals observe_cells(bt_world *w, double slow2)
{
    bt_totals all = {.n_sums = N_SEEN};
    bt_phases_busy(w, observe_cell, &slow2, &all);
    bt_domain_reduce(w, &all);
    return all;
}

/// Contact impulse on the towed body along (dx, dy) without using its rows.
static double budget_impulse(const bt_world *w, const bt_totals *seen, double dx, double dy)
{
    const bt_bodies *b = &w->bodies;
    const bt_idx t = bt_world_towed(w);
    if (b->motion[t] != BT_DYNAMIC) return bt_sum_value(&seen->sum[BUDGET]);
    double jx = (b->vel[t].x - b->vel_free[t].x) / b->inv[t].m, jy = (b->vel[t].y - b->vel_free[t].y) / b->inv[t].m;
    for (int k = 0; bt_tow_has_line(w->tow) && k < w->tow->n_branches; k++) {
        jx -= w->tow->branch[k].lambda * w->tow->branch[k].lx;
        jy -= w->tow->branch[k].lambda * w->tow->branch[k].ly;
    }
    return jx * dx + jy * dy;
}

/// Tension, length and end of the line; the body's share along the course.
static void observe_line(const bt_tow *tow, bt_sample *s)
{
    const bt_branch *b = &tow->branch[0];
    s->line_tension = bt_tow_tension(tow, 0);
    s->line_length = b->length;
    s->carriage_x = tow->carriage_x;
    s->carriage_y = tow->carriage_y;
    s->tow_force = bt_tow_pull(tow, 0) * (b->lx * tow->ux + b->ly * tow->uy);
    for (int k = 1; k < tow->n_branches; k++) {
        const double t = bt_tow_tension(tow, k);
        s->tow_force += bt_tow_pull(tow, k) * (tow->branch[k].lx * tow->ux + tow->branch[k].ly * tow->uy);
        s->line_tension = bt_max(s->line_tension, t);
    }
    s->line_tension_1 = bt_tow_tension(tow, 0);
    if (tow->n_branches > 1) s->line_tension_2 = bt_tow_tension(tow, 1);
    if (tow->mode != BT_TOW_THRUST) return;
    const bt_vessel *v = &tow->vessel;
    s->vessel_x = tow->carriage_x;
    s->vessel_y = tow->carriage_y;
    s->vessel_speed = v->vd2;
    s->vessel_thrust = v->thrust / tow->dt;
    s->vessel_drag = v->kd * (v->vd2 - v->ud);
    s->vessel_inertia = v->mass * (v->vd2 - v->vd1) / tow->dt;
    s->vessel_line = s->tow_force; // both along the course
}

/// What holds the body back beside ice and inertia, in the order of the table: water, air, Coriolis, tilt, ….
static double add_forces(const bt_world *w, double sum)
{
    for (int k = 0; k < w->forces->n_series; k++)
        if (!bt_force_series_of[k].part) sum += bt_force_against(w, k);
    return sum;
}

static void observe_body(const bt_world *w, const bt_totals *seen, bt_sample *s)
{
    const bt_bodies *b = &w->bodies;
    const bt_idx t = bt_world_towed(w);
    const bt_tow *tow = w->tow;
    const double dt = w->par.dt, dx = tow->ux, dy = tow->uy;
    const double ice[3] = {bt_sum_value(&seen->sum[ICE_X]), bt_sum_value(&seen->sum[ICE_Y]),
                           bt_sum_value(&seen->sum[ICE_TURN])};
    s->ice_force_x = ice[0] / dt;
    s->ice_force_y = ice[1] / dt;
    s->ice_moment = ice[2] / dt;
    s->ice_resistance = 0.0 - (ice[0] * dx + ice[1] * dy) / dt;
    s->ice_resistance_budget = -budget_impulse(w, seen, dx, dy) / dt;
    s->inertia_force =
        b->mass[t] * ((b->vel[t].x - b->vel_start[t].x) * dx + (b->vel[t].y - b->vel_start[t].y) * dy) / dt;
    s->body_x = tow->travel_x;
    s->body_y = tow->travel_y;
    s->body_yaw = b->pose[t].yaw;
    s->body_vx = b->vel[t].x;
    s->body_vy = b->vel[t].y;
    s->body_yaw_rate = b->vel[t].w;
    const double water_x = w->par.water_u, water_y = w->par.water_v;
    const bt_vel drift = w->undisturbed ? w->undisturbed->vel : (bt_vel){.x = water_x, .y = water_y};
    const double through_ice[2] = {b->vel[t].x - drift.x, b->vel[t].y - drift.y},
                 through_water[2] = {b->vel[t].x - water_x, b->vel[t].y - water_y};
    s->speed_through_ice = through_ice[0] * dx + through_ice[1] * dy;
    s->leeway_through_ice = through_ice[1] * dx - through_ice[0] * dy;
    s->speed_through_water = through_water[0] * dx + through_water[1] * dy;
    s->leeway_through_water = through_water[1] * dx - through_water[0] * dy;
    double place[2];
    bt_undisturbed_place(w, place);
    s->body_in_ice_x = place[0], s->body_in_ice_y = place[1];
    if (bt_tow_has_line(tow)) {
        observe_line(tow, s);
    } else if (tow->mode == BT_TOW_SPEED) {
        s->tow_force = add_forces(w, s->ice_resistance) + s->inertia_force;
    } else {
        s->tow_force = 0;
    }
    s->contacts_body = bt_sum_value(&seen->sum[TOUCHING]);
}

/// Collisions of the towed body; on rank 0, which records.
static void observe_impacts(const bt_world *w, bt_sample *s)
{
    const bt_impacts *m = w->impacts;
    s->collision_resistance = 0.0 - (m->collision_x * w->tow->ux + m->collision_y * w->tow->uy) / w->par.dt;
    s->collisions = (double)m->n_closed;
    s->largest_quasi_static_load = m->largest_quasi_static_load;
    s->impact_peak = 0;
    for (int64_t i = 0; i < m->n_closed; i++) s->impact_peak = bt_max(s->impact_peak, m->closed[i].peak);
}

unsigned bt_observe_applies(const bt_world *w)
{
    const bool body = w->towed >= 0, line = body && bt_tow_has_line(w->tow);
    return 1u << BT_APPLIES_ALWAYS | (unsigned)body << BT_APPLIES_BODY | (unsigned)line << BT_APPLIES_LINE |
           (unsigned)(line && w->tow->n_branches > 1) << BT_APPLIES_BRIDLE |
           (unsigned)(line && w->tow->mode == BT_TOW_THRUST) << BT_APPLIES_VESSEL |
           (unsigned)(body && w->impacts && w->tow) << BT_APPLIES_IMPACTS |
           (unsigned)(w->window != NULL) << BT_APPLIES_WINDOW;
}

/// Collective. Sum of a quantity over the floes of all ranks.
static double sum_of_floes(const bt_world *w, const bt_quantity *q)
{
    bt_totals all = {.n_sums = 1};
    for (bt_idx k = 0; k < w->cells->n; k++) {
        const bt_cell *cell = &w->cells->cell[k];
        for (bt_idx i = cell->first; cell->own && i < cell->end; i++)
            if (w->bodies.motion[i] == BT_DYNAMIC && i != bt_world_towed(w))
                bt_sum_add(&all.sum[0], q->of_floe(w, i, q->context));
    }
    bt_domain_reduce(w, &all);
    return bt_sum_value(&all.sum[0]);
}

/// What the rows of the series say themselves, by one thread: their functions need not know of threads.
static void observe_rows(const bt_world *w, unsigned has, bt_sample *s)
{
    for (int k = 0, n = bt_n_series(); k < n; k++) {
        const bt_quantity *q = bt_series(k);
        if (!(has & 1u << q->applies)) bt_sample_set(s, q, NAN); // alike on all ranks
        else if (q->of_floe) bt_sample_set(s, q, sum_of_floes(w, q));
        else if (q->of_world) bt_sample_set(s, q, q->of_world(w, q->context));
    }
}

void bt_observe(bt_world *w, double reference_speed, bt_sample *s)
{
    *s = (bt_sample){.time = (double)w->step * w->par.dt};
    const double slow2 = 1e-4 * reference_speed * reference_speed;
    const bt_totals seen = observe_cells(w, slow2);
    s->moving = bt_sum_value(&seen.sum[MOVING]);
    const unsigned has = bt_observe_applies(w);
    if (has & 1u << BT_APPLIES_BODY) observe_body(w, &seen, s);
    if (has & 1u << BT_APPLIES_IMPACTS) observe_impacts(w, s);
    if (w->window) {
        s->window_x = bt_window_low(w->window, w->undisturbed);
        s->window_renewed = (double)w->window->renewed_now;
        s->window_waiting = (double)w->window->waiting;
    }
    observe_rows(w, has, s);
    if (w->stats.locked) s->contact_work = NAN; // by loads that are none
    if (w->stats.no_load) bt_sample_lose_load(s, !bt_tow_has_line(w->tow) && w->tow->mode == BT_TOW_SPEED);
}

double bt_observe_ice_area(const bt_world *w)
{
    const bt_bodies *b = &w->bodies;
    bt_totals t = {.n_sums = 1};
    for (bt_idx i = 0; i < b->n; i++)
        if (b->thickness[i] > 0 && b->gid[i] != w->towed && bt_domain_owns(w, i)) bt_sum_add(&t.sum[0], b->area[i]);
    bt_domain_reduce(w, &t);
    return bt_sum_value(&t.sum[0]);
}

void bt_observe_contact_force(const bt_world *w, double *force)
{
    for (bt_idx i = 0; i < w->bodies.n; i++) force[i] = 0;
    for (bt_idx k = 0; k < w->cells->n; k++)
        for (bt_idx j = 0; j < w->cells->cell[k].n_contacts; j++) {
            const bt_contact *u = &w->cells->cell[k].contacts[j];
            if (u->n == 0) continue; // sheets: friction, and the ends of their overlap
            const double f = (u->ln[0] + u->ln[1]) / w->par.dt;
            force[u->a] = bt_max(force[u->a], f);
            force[u->b] = bt_max(force[u->b], f);
        }
    bt_domain_largest(w, force);
}

/// Which of the bodies after the floes that move freely, < 0: such a floe, or a piece of one.
static bt_gid other_of(const bt_roster *r, bt_gid gid) { return bt_roster_row(r, gid) - r->n_free; }

void bt_observe_net_force(const bt_comm *c, const bt_world *w, const bt_roster *roster, double (*force)[2])
{
    const bt_bodies *b = &w->bodies;
    const int others = (int)(b->n_global - roster->n_kept - roster->n_free);
    bt_sum *sum = bt_alloc(2 * (size_t)others, sizeof *sum);
    for (bt_idx k = 0; k < w->cells->n; k++) {
        const bt_cell *cell = &w->cells->cell[k];
        for (bt_idx j = 0; cell->own && j < cell->n_contacts; j++) {
            const bt_contact *u = &cell->contacts[j];
            double jx, jy;
            bt_impulse_on_b(u, &jx, &jy);
            const bt_idx side[] = {u->a, u->b};
            for (int s = 0; s < 2; s++) {
                const bt_gid other = other_of(roster, b->gid[side[s]]);
                if (other < 0) continue;
                bt_sum_add(&sum[2 * other], s ? jx : -jx);
                bt_sum_add(&sum[2 * other + 1], s ? jy : -jy);
            }
        }
    }
    bt_comm_reduce(c, sum, 2 * others, NULL, 0, NULL, 0);
    for (bt_idx i = 0; i < b->n; i++) {
        const bt_gid other = other_of(roster, b->gid[i]);
        const double m = b->inv[i].m;
        if (other >= 0) {
            for (int k = 0; k < 2; k++) force[i][k] = bt_sum_value(&sum[2 * other + k]) / w->par.dt;
        } else { // m is 0 until a step has been taken
            force[i][0] = m > 0 ? (b->vel[i].x - b->vel_free[i].x) / m / w->par.dt : 0;
            force[i][1] = m > 0 ? (b->vel[i].y - b->vel_free[i].y) / m / w->par.dt : 0;
        }
    }
    free(sum);
}
