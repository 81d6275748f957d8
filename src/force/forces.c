// SPDX-License-Identifier: MIT
// Free velocity of every body by the forces on it, and the rest and free drift of floes; equations in bergtow/forces.h.
#include "force/forces.h"


#include "base/elementary.h"
#include "base/inside.h"
#include "body/bodies.h"
#include "force/laws.h"
#include "force/load.h"
#include "space/cells.h"
#include "space/phases.h"

// --- a load and its integration --------------------------------------------------------------------------------------

// The load on a body, and its implicit part at a velocity; equations in bergtow/forces.h.

/// Dampers g = form max(0, −v·n) dl at the arms a = t (t·r) + τ n (n·r); (rx, ry): U_ref − U, w: ω. On an edge v and a
/// are linear and n constant, so that g and its moments up to a² are polynomials of at most third degree on the inflow
/// part: two Gauss points are exact.
void bt_linear_add_outline(const bt_bodies *bodies, bt_idx i, bt_stream stream, double rx, double ry, double w,
                           bt_linear *linear)
{
    const double form = stream.form, ref_x = stream.u, ref_y = stream.v, share = bodies->drag[i].tangential;
    const double gauss = 0.57735026918962576451; // 1/√3
    const int n = bt_body_corners(bodies, i);
    const double *v = bodies->outline + 2 * bodies->offset[i];
    const bt_mark *mark = bodies->mark + bodies->offset[i];
    for (int k = 0; k < n; k++) {
        if (mark[k].next == k) continue;
        const double *p = v + 2 * k, *q = v + 2 * mark[k].next, ex = q[0] - p[0], ey = q[1] - p[1];
        // Inflow −v·n times the length of the edge, at its two ends.
        const double in0 = -((rx + w * p[1]) * ey - (ry - w * p[0]) * ex),
                     in1 = -((rx + w * q[1]) * ey - (ry - w * q[0]) * ex);
        if (in0 <= 0 && in1 <= 0) continue;
        const double from = in0 < 0 ? in0 / (in0 - in1) : 0, to = in1 < 0 ? in0 / (in0 - in1) : 1;
        const double along = (1 - share) / (ex * ex + ey * ey);
        for (int side = -1; side <= 1; side += 2) {
            const double s = 0.5 * (from + to + side * gauss * (to - from));
            const double g = 0.5 * (to - from) * form * bt_max(0, in0 + s * (in1 - in0));
            const double at_x = p[0] + s * ex, at_y = p[1] + s * ey, way = along * (at_x * ex + at_y * ey);
            const double x = share * at_x + way * ex, y = share * at_y + way * ey;
            linear->g += g;
            linear->gx += g * x;
            linear->gy += g * y;
            linear->gw += g * (x * x + y * y);
            linear->jx += g * ref_x;
            linear->jy += g * ref_y;
            linear->jw += g * (x * ref_y - y * ref_x);
        }
    }
}

void bt_forces_load(const bt_world *world, bt_idx i, const bt_vel *u, bt_load *load)
{
    BT_PLAIN_NUMBERS;
    bt_force_body body = bt_load_body(world, i, u);
    bt_load_clear(load);
    bt_load_fill(world->forces, 0, &body, load);
}

// --- record of the towed body ----------------------------------------------------------------------------------------

// The record: what each law has done to a body in the step just solved.
//
// The impulses follow from the load of the law alone, by the scheme of bergtow/forces.h:
//     rotation   M (R − I) (U1 − U_b): the part with U1 belongs to the law that turns, that with U_b to the law that
//                sets U_b
//     gain       M times the gain;   explicit: Δt F
//     implicit   Δt (j − D U2 − O U*), K = D + O with the diagonal D: contacts and line see only D, so the coupling
//                of rotation and drift is taken at U*. From (M + Δt K) U* = M U' + Δt j and (M + Δt D)(U2 − U*) =
//                J_contacts + J_line: Δt (j − D U2 − O U*) = M (U2 − U') − J_contacts − J_line, all that is not
//                rotation, gain or explicit
// Thus every impulse is computed from its law, and their sum, M (U2 − U1), is a check. Rejected: drag as the remainder
// of M (U2 − U1): a forgotten law would be booked as drag, and the balance would still close. For a kinematic body U1 =
// U* = U2 is the prescribed velocity, and the rotation is that of its rate, Δt m f k×U.

/// State of a body over a step.
typedef struct {
    const bt_vel *u1, *free, *u2;
    bt_turning r;         ///< of all laws
    double turn;          ///< of all laws, rad/s
    double m, share, dt;
    bool led;             ///< kinematic
} motion;

static bt_impulse turned(const motion *moving, const bt_load *load)
{
    const double m = moving->m, ax = load->about_x, ay = load->about_y;
    if (moving->led) {
        const double own = moving->dt * moving->share * m * load->turn,
                     all = moving->dt * moving->share * m * moving->turn;
        return (bt_impulse){-own * moving->u2->y + (m * load->gain_x + all * ay),
                            own * moving->u2->x + (m * load->gain_y - all * ax), 0};
    }
    const double s = moving->r.s, c1 = moving->r.c - 1, part = load->turn == 0 ? 0 : load->turn / moving->turn;
    return (bt_impulse){
        part * (m * (c1 * moving->u1->x - s * moving->u1->y)) + m * (load->gain_x - (c1 * ax - s * ay)),
        part * (m * (s * moving->u1->x + c1 * moving->u1->y)) + m * (load->gain_y - (s * ax + c1 * ay)),
        0,
    };
}

/// Coefficients are those of the start of the step, linearised about U1.
static bt_impulse impulse_of(const bt_bodies *bodies, bt_idx i, const motion *moving, const bt_load *load)
{
    const bt_linear linear = bt_load_implicit(bodies, i, load, moving->u1);
    const bt_vel *u = moving->u2, *f = moving->free;
    bt_impulse j = turned(moving, load);
    j.x += moving->dt * (linear.jx - linear.g * u->x + linear.gy * f->w) + moving->dt * load->fx;
    j.y += moving->dt * (linear.jy - linear.g * u->y - linear.gx * f->w) + moving->dt * load->fy;
    j.turn += moving->dt * (linear.jw - linear.gx * f->y + linear.gy * f->x - linear.gw * u->w) +
        moving->dt * load->moment;
    return j;
}

/// The load of all laws that share a series, added up as in the step itself: summed impulses would round differently.
static void load_of_sum(const bt_forces *forces, const char *name, bt_force_body *body, bt_load *load)
{
    bt_load_clear(load);
    for (int k = 0; k < forces->n; k++)
        if (bt_force_laws[k]->part_of && !strcmp(bt_force_laws[k]->part_of, name)) bt_load_add(forces, k, body, load);
}

void bt_forces_impulses(const bt_world *world, bt_idx i, bt_impulse *law, bt_impulse *series)
{
    BT_PLAIN_NUMBERS;
    const bt_bodies *bodies = &world->bodies;
    const bt_forces *forces = world->forces;
    const bool led = bodies->motion[i] != BT_DYNAMIC;
    motion moving = {.u1 = led ? &bodies->vel[i] : &bodies->vel_start[i],
                     .free = led ? &bodies->vel[i] : &bodies->vel_free[i],
                     .u2 = &bodies->vel[i],
                     .r = BT_TURNING_NONE,
                     .m = bodies->mass[i],
                     .share = bodies->share[i],
                     .dt = world->par.dt,
                     .led = led};
    bt_force_body body = bt_load_body(world, i, moving.u1);
    bt_load load;
    bt_load_clear(&load);
    bt_load_fill(forces, 0, &body, &load);
    moving.turn = load.turn;
    bt_turning_set(&moving.r, moving.share * moving.turn * moving.dt);
    for (int k = 0; k < forces->n; k++) {
        bt_load_clear(&load);
        bt_load_add(forces, k, &body, &load);
        law[k] = impulse_of(bodies, i, &moving, &load);
    }
    for (int n = 0; n < forces->n_series; n++) {
        const bt_force_series *of = &bt_force_series_of[n];
        for (int k = 0; k < forces->n; k++)
            if (of->law == bt_force_laws[k]) series[n] = law[k];
        if (of->law) continue;
        load_of_sum(forces, of->name, &body, &load);
        series[n] = impulse_of(bodies, i, &moving, &load);
    }
}

void bt_forces_record(bt_world *world)
{
    const bt_idx i = bt_world_towed(world);
    if (i >= 0) bt_forces_impulses(world, i, world->forces->law, world->forces->series);
}

// --- free velocities -------------------------------------------------------------------------------------------------

/// Load of all laws on a body: the listed laws inline, added laws through the table.
static inline void load_of(const bt_forces *forces, bool added, bt_force_body *body, bt_load *load)
{
    bt_load_clear(load);
    int k = 0;
#define ADD(name) \
    body->own = forces->own[k++]; \
    if (!bt_law_##name.towed_only || body->towed) bt_add_##name(body, load);
    BT_FORCE_LAWS(ADD)
    if (added) bt_load_fill(forces, BT_LISTED_LAWS, body, load);
}

/// Compiled twice, without and with added laws: if the load of a body leaves the function, the compiler must keep all
/// of it in memory.
__attribute__((always_inline)) static inline void predict(bt_world *world, bt_idx i, bool added, bt_turning *turning)
{
    bt_bodies *bodies = &world->bodies;
    const double dt = world->par.dt, m = bodies->mass[i], inertia = bodies->inertia[i];
    bt_vel u = bodies->vel[i];
    bodies->vel_start[i] = u;
    bt_force_body body = bt_load_body(world, i, &u);
    bt_load load;
    load_of(world->forces, added, &body, &load);
    const bt_linear linear = bt_load_implicit(bodies, i, &load, &u);
    bt_turning_set(turning, body.share * load.turn * dt);
    bt_load_turn(&load, turning, dt, m, inertia, &u);
    const bt_inv inv = {1 / (m + dt * linear.g), 1 / (inertia + dt * linear.gw)};
    bt_linear_take(&linear, dt, m, inertia, inv, &u);
    bodies->inv[i] = inv;
    bodies->vel[i] = bodies->vel_free[i] = u;
}

/// The result of predict() for a body that drifts with the water when all laws let it rest: no load, and an unchanged
/// velocity, except that −0 becomes 0 as the gain of the slope adds 0.
static void drift(bt_bodies *bodies, bt_idx i)
{
    const bt_vel u = bodies->vel[i];
    bodies->vel_start[i] = u;
    bodies->vel[i] = bodies->vel_free[i] = (bt_vel){u.x + 0.0, u.y + 0.0, u.w, u.unused};
    bodies->inv[i] = (bt_inv){1 / bodies->mass[i], 1 / bodies->inertia[i]};
}

/// rest: no listed law acts on a body that drifts with the water, and there are no added laws.
static void predict_cell(bt_world *world, bt_idx k, const void *rest, bt_totals *none)
{
    (void)none;
    bt_bodies *bodies = &world->bodies;
    bt_cells *cells = world->cells;
    if (cells->asleep[k] == BT_ASLEEP) return;
    const bool added = world->forces->n > BT_LISTED_LAWS;
    bt_turning turning = BT_TURNING_NONE;
    for (bt_idx i = cells->cell[k].first; i < cells->cell[k].end; i++) {
        if (bodies->motion[i] != BT_DYNAMIC) bodies->vel_free[i] = bodies->vel[i];
        else if (*(const bool *)rest && bt_bodies_drift(world, &bodies->vel[i])) drift(bodies, i);
        else if (added) predict(world, i, true, &turning);
        else predict(world, i, false, &turning);
    }
    if (cells->asleep[k]) cells->asleep[k] = BT_ASLEEP;
}

void bt_forces_predict(bt_world *world)
{
    bt_totals none = {0};
    const bool rest = world->forces->n == BT_LISTED_LAWS && bt_forces_rest(world);
    bt_phases_busy(world, predict_cell, &rest, &none);
}

void bt_forces_begin(bt_world *world)
{
    bt_forces *forces = world->forces;
    bool any = false;
    for (int k = BT_LISTED_LAWS; k < forces->n; k++) any = any || bt_force_laws[k]->begin;
    if (!any) return;
    const bool rested = bt_forces_rest(world);
    forces->under_way = true;
    for (int k = BT_LISTED_LAWS; k < forces->n; k++) {
        const bt_force_law *law = bt_force_laws[k];
        const char *why = law->begin ? law->begin(world, forces->own[k], law->context) : NULL;
        if (why) forces->failed = law, forces->why = why;
        forces->acted[k] |= !bt_force_waits(law, forces->own[k]);
    }
    forces->under_way = false;
    if (!rested || bt_forces_rest(world)) return;
    bt_cells_wake_all(world->cells);
    for (bt_idx k = 0; k < world->cells->n; k++) world->cells->asleep[k] = BT_AWAKE;
}

bool bt_forces_rest(const bt_world *world)
{
    for (int k = 0; k < world->forces->n; k++) {
        const bt_force_law *law = bt_force_laws[k];
        if (!law->towed_only && !(law->rests && law->rests(&world->par, world->forces->own[k]))) return false;
    }
    return true;
}

bt_vel bt_forces_drift(const bt_world *world, bt_force_body *body)
{
    const double dt = world->par.dt, m = body->mass;
    body->par = &world->par, body->time = bt_load_time(world), body->towed_at = world->forces->towed_at;
    bt_vel u = body->vel;
    bt_load load;
    bt_load_clear(&load);
    bt_load_fill(world->forces, 0, body, &load);
    bt_linear linear = bt_load_linear(&load, u.w);
    for (int k = 0; k < load.n_streams; k++)
        bt_linear_add_skin(&linear, &load.stream[k], bt_hypot(load.stream[k].u - u.x, load.stream[k].v - u.y));
    bt_turning turning = BT_TURNING_NONE;
    bt_turning_set(&turning, body->share * load.turn * dt);
    bt_load_turn(&load, &turning, dt, m, body->inertia, &u);
    bt_linear_take(&linear, dt, m, body->inertia,
                   (bt_inv){1 / (m + dt * linear.g), 1 / (body->inertia + dt * linear.gw)}, &u);
    return u;
}

bt_drag bt_forces_drag(const bt_moments *moments, double draft, double sail, double water_density, double air_density,
                       double water_form, double water_skin, double air_form, double air_skin)
{
    BT_PLAIN_NUMBERS;
    return (bt_drag){
        .water_skin = water_density * water_skin * moments->area,
        .water_form = 0.5 * water_density * water_form * draft,
        .air_skin = air_density * air_skin * moments->area,
        .air_form = 0.5 * air_density * air_form * sail,
        .yaw = (water_density * water_skin + air_density * air_skin) * moments->cubic,
    };
}
