// SPDX-License-Identifier: MIT
// Forces on the towed body and balances of one step.
//
// Momentum balance of the towed body, along the tow direction d:
//     J_tow = M ΔU·d + (J_ice + Σ J_law)·(−d)
// tow = inertia + ice resistance + the force laws of the table: drag, Coriolis, tilt, ... On a line J_tow is the line's
// own impulse, so the balance is a check. Under a prescribed velocity J_tow is the remainder of the balance; the check
// is then the resistance found without the rows of the body, from the momentum gained by all other bodies
// (ice_resistance_budget).
#include "output/observe.h"

#include <math.h>

#include "bergtow/forces.h"
#include "loads/impact.h"
#include "bergtow/sum.h"
#include "contact/row.h"
#include "space/cells.h"
#include "tow/tow.h"
#include "step/window.h"
#include "partition/domain.h"
#include "space/phases.h"

enum { ICE_X, ICE_Y, ICE_TURN, BUDGET, TOUCHING, MOVING, N_SEEN };

/// One cell's share of the sums over contacts and floes.
static void observe_cell(bt_world *world, bt_idx k, const void *context, bt_totals *totals)
{
    const bt_bodies *bodies = &world->bodies;
    const bt_cells *ts = world->cells;
    const bt_cell *cell = &ts->cell[k];
    const double slow2 = *(const double *)context;
    if (!cell->own || !(k == ts->n - 1 || bt_cells_moves(ts, k) || cell->n_contacts > 0 || !ts->still)) return;
    const bt_idx towed = bt_world_towed(world);
    const double dx = world->tow ? world->tow->ux : 0, dy = world->tow ? world->tow->uy : 0;
    const bool prescribed = towed >= 0 && bodies->motion[towed] != BT_DYNAMIC;
    int64_t moving = 0, touching = 0;
    for (bt_idx i = cell->first; i < cell->end; i++) {
        if (bodies->motion[i] != BT_DYNAMIC || i == towed) continue;
        const bt_vel *v = &bodies->vel[i];
        moving += v->x * v->x + v->y * v->y > slow2;
        const double ux = v->x - bodies->vel_free[i].x, uy = v->y - bodies->vel_free[i].y;
        if (prescribed && (ux != 0 || uy != 0))
            bt_sum_add(&totals->sum[BUDGET], -(ux * dx + uy * dy) / bodies->inv[i].m);
    }
    bt_sum_add(&totals->sum[MOVING], (double)moving);
    if (towed < 0) return;
    for (bt_idx j = 0; j < cell->n_contacts; j++) {
        const bt_contact *contact = &cell->contacts[j];
        const double normal = contact->ln[0] + contact->ln[1];
        if (normal == 0 && contact->lt == 0) continue;
        double jx, jy;
        bt_impulse_on_b(contact, &jx, &jy);
        if (contact->a == towed || contact->b == towed) {
            const bool is_b = contact->b == towed;
            const double sign = is_b ? 1 : -1;
            const double *arm = is_b ? contact->rbn : contact->ran;
            bt_sum_add(&totals->sum[ICE_X], sign * jx);
            bt_sum_add(&totals->sum[ICE_Y], sign * jy);
            bt_sum_add(&totals->sum[ICE_TURN],
                       sign * (contact->ln[0] * arm[0] + contact->ln[1] * arm[1] +
                               contact->lt * (is_b ? contact->rbt : contact->rat)));
            touching += (contact->ln[0] > 0) + (contact->ln[1] > 0);
        // from other bodies of infinite mass
        } else if (prescribed && bt_impulse_from_outside(contact, bodies->inv, &jx, &jy)) {
            bt_sum_add(&totals->sum[BUDGET], jx * dx + jy * dy);
        }
    }
    bt_sum_add(&totals->sum[TOUCHING], (double)touching);
}

/// Contact impulse on the towed body along (dx, dy) without using its rows.
static double budget_impulse(const bt_world *world, const bt_totals *seen, double dx, double dy)
{
    const bt_bodies *bodies = &world->bodies;
    const bt_idx t = bt_world_towed(world);
    if (bodies->motion[t] != BT_DYNAMIC) return bt_sum_value(&seen->sum[BUDGET]);
    double jx = (bodies->vel[t].x - bodies->vel_free[t].x) / bodies->inv[t].m,
           jy = (bodies->vel[t].y - bodies->vel_free[t].y) / bodies->inv[t].m;
    for (int k = 0; bt_tow_has_line(world->tow) && k < world->tow->n_branches; k++) {
        jx -= world->tow->branch[k].lambda * world->tow->branch[k].lx;
        jy -= world->tow->branch[k].lambda * world->tow->branch[k].ly;
    }
    return jx * dx + jy * dy;
}

/// Tension, length and end of the line; its force on the body along the course.
static void observe_line(const bt_tow *tow, bt_sample *sample)
{
    const bt_branch *branch = &tow->branch[0];
    sample->line_tension = bt_tow_tension(tow, 0);
    sample->line_length = branch->length;
    sample->carriage_x = tow->carriage_x;
    sample->carriage_y = tow->carriage_y;
    sample->tow_force = bt_tow_pull(tow, 0) * (branch->lx * tow->ux + branch->ly * tow->uy);
    for (int k = 1; k < tow->n_branches; k++) {
        const double t = bt_tow_tension(tow, k);
        sample->tow_force += bt_tow_pull(tow, k) * (tow->branch[k].lx * tow->ux + tow->branch[k].ly * tow->uy);
        sample->line_tension = bt_max(sample->line_tension, t);
    }
    sample->line_tension_1 = bt_tow_tension(tow, 0);
    if (tow->n_branches > 1) sample->line_tension_2 = bt_tow_tension(tow, 1);
    if (tow->mode != BT_TOW_THRUST) return;
    const bt_vessel *vessel = &tow->vessel;
    sample->vessel_x = tow->carriage_x;
    sample->vessel_y = tow->carriage_y;
    sample->vessel_speed = vessel->vd2;
    sample->vessel_thrust = vessel->thrust / tow->dt;
    sample->vessel_drag = vessel->kd * (vessel->vd2 - vessel->ud);
    sample->vessel_inertia = vessel->mass * (vessel->vd2 - vessel->vd1) / tow->dt;
    sample->vessel_line = sample->tow_force; // both along the course
}

static void observe_body(const bt_world *world, const bt_totals *seen, bt_sample *sample)
{
    const bt_bodies *bodies = &world->bodies;
    const bt_idx t = bt_world_towed(world);
    const bt_tow *tow = world->tow;
    const double dt = world->par.dt, dx = tow->ux, dy = tow->uy;
    const double ice[3] = {bt_sum_value(&seen->sum[ICE_X]), bt_sum_value(&seen->sum[ICE_Y]),
                           bt_sum_value(&seen->sum[ICE_TURN])};
    sample->ice_force_x = ice[0] / dt;
    sample->ice_force_y = ice[1] / dt;
    sample->ice_moment = ice[2] / dt;
    sample->ice_resistance = 0.0 - (ice[0] * dx + ice[1] * dy) / dt;
    sample->ice_resistance_budget = -budget_impulse(world, seen, dx, dy) / dt;
    sample->inertia_force =
        bodies->mass[t] *
        ((bodies->vel[t].x - bodies->vel_start[t].x) * dx + (bodies->vel[t].y - bodies->vel_start[t].y) * dy) / dt;
    sample->body_x = tow->travel_x;
    sample->body_y = tow->travel_y;
    sample->body_yaw = bodies->pose[t].yaw;
    sample->body_vx = bodies->vel[t].x;
    sample->body_vy = bodies->vel[t].y;
    sample->body_yaw_rate = bodies->vel[t].w;
    const double water_x = world->par.water_u, water_y = world->par.water_v;
    const bt_vel drift = world->undisturbed ? world->undisturbed->vel : (bt_vel){.x = water_x, .y = water_y};
    const double through_ice[2] = {bodies->vel[t].x - drift.x, bodies->vel[t].y - drift.y},
                 through_water[2] = {bodies->vel[t].x - water_x, bodies->vel[t].y - water_y};
    sample->speed_through_ice = through_ice[0] * dx + through_ice[1] * dy;
    sample->leeway_through_ice = through_ice[1] * dx - through_ice[0] * dy;
    sample->speed_through_water = through_water[0] * dx + through_water[1] * dy;
    sample->leeway_through_water = through_water[1] * dx - through_water[0] * dy;
    double place[2];
    bt_undisturbed_place(world, place);
    sample->body_in_ice_x = place[0], sample->body_in_ice_y = place[1];
    if (bt_tow_has_line(tow)) {
        observe_line(tow, sample);
    } else if (tow->mode == BT_TOW_SPEED) {
        double sum = sample->ice_resistance; // and water, air, Coriolis, tilt, …, in table order
        for (int k = 0; k < world->forces->n_series; k++)
            if (!bt_force_series_of[k].part) sum += bt_force_against(world, k);
        sample->tow_force = sum + sample->inertia_force;
    } else {
        sample->tow_force = 0;
    }
    sample->contacts_body = bt_sum_value(&seen->sum[TOUCHING]);
}

/// Collisions of the towed body, on rank 0, which records.
static void observe_impacts(const bt_world *world, bt_sample *sample)
{
    const bt_impacts *impacts = world->impacts;
    sample->collision_resistance =
        0.0 - (impacts->collision_x * world->tow->ux + impacts->collision_y * world->tow->uy) / world->par.dt;
    sample->collisions = (double)impacts->n_closed;
    sample->largest_quasi_static_load = impacts->largest_quasi_static_load;
    sample->impact_peak = 0;
    for (int64_t i = 0; i < impacts->n_closed; i++)
        sample->impact_peak = bt_max(sample->impact_peak, impacts->closed[i].peak);
}

unsigned bt_observe_applies(const bt_world *world)
{
    const bool body = world->towed >= 0, line = body && bt_tow_has_line(world->tow);
    return 1u << BT_APPLIES_ALWAYS | (unsigned)body << BT_APPLIES_BODY | (unsigned)line << BT_APPLIES_LINE |
           (unsigned)(line && world->tow->n_branches > 1) << BT_APPLIES_BRIDLE |
           (unsigned)(line && world->tow->mode == BT_TOW_THRUST) << BT_APPLIES_VESSEL |
           (unsigned)(body && world->impacts && world->tow) << BT_APPLIES_IMPACTS |
           (unsigned)(world->window != NULL) << BT_APPLIES_WINDOW;
}

/// Collective. Sum of a quantity over the floes of all ranks.
static double sum_of_floes(const bt_world *world, const bt_quantity *quantity)
{
    bt_totals all = {.n_sums = 1};
    for (bt_idx k = 0; k < world->cells->n; k++) {
        const bt_cell *cell = &world->cells->cell[k];
        for (bt_idx i = cell->first; cell->own && i < cell->end; i++)
            if (world->bodies.motion[i] == BT_DYNAMIC && i != bt_world_towed(world))
                bt_sum_add(&all.sum[0], quantity->of_floe(world, i, quantity->context));
    }
    bt_domain_reduce(world, &all);
    return bt_sum_value(&all.sum[0]);
}

/// Numbers given by the rows of the series themselves, by one thread, so that their functions need not be thread-safe.
static void observe_rows(const bt_world *world, unsigned has, bt_sample *sample)
{
    for (int k = 0, n = bt_n_series(); k < n; k++) {
        const bt_quantity *quantity = bt_series(k);
        if (!(has & 1u << quantity->applies)) bt_sample_set(sample, quantity, NAN); // the same on all ranks
        else if (quantity->of_floe) bt_sample_set(sample, quantity, sum_of_floes(world, quantity));
        else if (quantity->of_world) bt_sample_set(sample, quantity, quantity->of_world(world, quantity->context));
    }
}

void bt_observe(bt_world *world, double reference_speed, bt_sample *sample)
{
    *sample = (bt_sample){.time = (double)world->step * world->par.dt};
    const double slow2 = 1e-4 * reference_speed * reference_speed;
    bt_totals seen = {.n_sums = N_SEEN};
    bt_phases_busy(world, observe_cell, &slow2, &seen);
    bt_domain_reduce(world, &seen);
    sample->moving = bt_sum_value(&seen.sum[MOVING]);
    const unsigned has = bt_observe_applies(world);
    if (has & 1u << BT_APPLIES_BODY) observe_body(world, &seen, sample);
    if (has & 1u << BT_APPLIES_IMPACTS) observe_impacts(world, sample);
    if (world->window) {
        sample->window_x = bt_window_low(world->window, world->undisturbed);
        sample->window_renewed = (double)world->window->renewed_now;
        sample->window_waiting = (double)world->window->waiting;
    }
    observe_rows(world, has, sample);
    if (world->stats.locked) sample->contact_work = NAN; // the loads are not valid
    if (world->stats.no_load)
        bt_sample_lose_load(sample, !bt_tow_has_line(world->tow) && world->tow->mode == BT_TOW_SPEED);
}

double bt_observe_ice_area(const bt_world *world)
{
    const bt_bodies *bodies = &world->bodies;
    bt_totals totals = {.n_sums = 1};
    for (bt_idx i = 0; i < bodies->n; i++)
        if (bodies->thickness[i] > 0 && bodies->gid[i] != world->towed && bt_domain_owns(world, i))
            bt_sum_add(&totals.sum[0], bodies->area[i]);
    bt_domain_reduce(world, &totals);
    return bt_sum_value(&totals.sum[0]);
}

void bt_observe_contact_force(const bt_world *world, double *force)
{
    for (bt_idx i = 0; i < world->bodies.n; i++) force[i] = 0;
    for (bt_idx k = 0; k < world->cells->n; k++)
        for (bt_idx j = 0; j < world->cells->cell[k].n_contacts; j++) {
            const bt_contact *contact = &world->cells->cell[k].contacts[j];
            if (contact->n == 0) continue; // sheets: friction, and the ends of their overlap
            const double f = (contact->ln[0] + contact->ln[1]) / world->par.dt;
            force[contact->a] = bt_max(force[contact->a], f);
            force[contact->b] = bt_max(force[contact->b], f);
        }
    bt_domain_largest(world, force);
}

/// Index among the bodies after the free floes; < 0: a free floe or a piece.
static bt_gid other_of(const bt_roster *roster, bt_gid gid) { return bt_roster_row(roster, gid) - roster->n_free; }

void bt_observe_net_force(const bt_comm *comm, const bt_world *world, const bt_roster *roster, double (*force)[2])
{
    const bt_bodies *bodies = &world->bodies;
    const int others = (int)(bodies->n_global - roster->n_kept - roster->n_free);
    bt_sum *sum = bt_alloc(2 * (size_t)others, sizeof *sum);
    for (bt_idx k = 0; k < world->cells->n; k++) {
        const bt_cell *cell = &world->cells->cell[k];
        for (bt_idx j = 0; cell->own && j < cell->n_contacts; j++) {
            const bt_contact *contact = &cell->contacts[j];
            double jx, jy;
            bt_impulse_on_b(contact, &jx, &jy);
            const bt_idx side[] = {contact->a, contact->b};
            for (int s = 0; s < 2; s++) {
                const bt_gid other = other_of(roster, bodies->gid[side[s]]);
                if (other < 0) continue;
                bt_sum_add(&sum[2 * other], s ? jx : -jx);
                bt_sum_add(&sum[2 * other + 1], s ? jy : -jy);
            }
        }
    }
    bt_comm_reduce(comm, sum, 2 * others, NULL, 0, NULL, 0);
    for (bt_idx i = 0; i < bodies->n; i++) {
        const bt_gid other = other_of(roster, bodies->gid[i]);
        const double m = bodies->inv[i].m;
        if (other >= 0) {
            for (int k = 0; k < 2; k++) force[i][k] = bt_sum_value(&sum[2 * other + k]) / world->par.dt;
        } else { // m is 0 before the first step
            force[i][0] = m > 0 ? (bodies->vel[i].x - bodies->vel_free[i].x) / m / world->par.dt : 0;
            force[i][1] = m > 0 ? (bodies->vel[i].y - bodies->vel_free[i].y) / m / world->par.dt : 0;
        }
    }
    free(sum);
}
