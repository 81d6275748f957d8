// SPDX-License-Identifier: MIT
// Free velocity of every body by the forces on it, and the rest and free drift of floes; equations in bergtow/forces.h.
#include "force/forces.h"

#include <math.h>

#include "base/elementary.h"
#include "body/bodies.h"
#include "force/laws.h"
#include "force/load.h"
#include "space/cells.h"
#include "space/phases.h"

// --- a load and its integration --------------------------------------------------------------------------------------

// The load on a body, and all that is implicit of it at a velocity; equations in bergtow/forces.h.

/// Dampers g = form max(0, −v·n) dl at the arms a = t (t·r) + τ n (n·r); (rx, ry): U_ref − U, w: ω. On an edge v and a
/// are linear and n constant, so that g and its moments to a² are polynomials up to the third degree where water comes
/// in: two points of Gauss are exact.
void bt_linear_add_outline(const bt_bodies *b, bt_idx i, bt_stream stream, double rx, double ry, double w, bt_linear *a)
{
    const double form = stream.form, ref_x = stream.u, ref_y = stream.v, share = b->drag[i].tangential;
    const double gauss = 0.57735026918962576451; // 1/√3
    const int n = bt_body_corners(b, i);
    const double *v = b->outline + 2 * b->offset[i];
    const bt_mark *mark = b->mark + b->offset[i];
    for (int k = 0; k < n; k++) {
        if (mark[k].next == k) continue;
        const double *p = v + 2 * k, *q = v + 2 * mark[k].next, ex = q[0] - p[0], ey = q[1] - p[1];
        // Inflow −v·n times the length of the edge, at its ends.
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
            a->g += g;
            a->gx += g * x;
            a->gy += g * y;
            a->gw += g * (x * x + y * y);
            a->jx += g * ref_x;
            a->jy += g * ref_y;
            a->jw += g * (x * ref_y - y * ref_x);
        }
    }
}

void bt_forces_load(const bt_world *w, bt_idx i, const bt_vel *u, bt_load *l)
{
    bt_force_body b = bt_load_body(w, i, u);
    bt_load_clear(l);
    bt_load_fill(w->forces, 0, &b, l);
}

// --- what each law did to the towed body -----------------------------------------------------------------------------

// The record: what each law has done to a body in the step just solved.
//
// The impulses follow from the load of the law alone, by the scheme of bergtow/forces.h:
//     rotation   M (R − I) (U1 − U_b): with U1 the part of the law whose turn it is, with U_b that of the law that says
//                U_b
//     gain       M times the gain;   explicit: Δt F
//     implicit   Δt (j − D U2 − O U*), K = D + O with the diagonal D: contacts and line see D alone, so that what
//                couples turning and drift is that of U*. From (M + Δt K) U* = M U' + Δt j and (M + Δt D)(U2 − U*) =
//                J_contacts + J_line: Δt (j − D U2 − O U*) = M (U2 − U') − J_contacts − J_line, all that is not
//                rotation, gain or explicit
// Every impulse is so computed from its law, and that they add up to M (U2 − U1) is a check. Rejected: drag as what is
// left of M (U2 − U1) when all else is taken away. A law that is forgotten there is booked as drag, and the balance
// closes. Of a kinematic body U1 = U* = U2 is the prescribed velocity, and the rotation that of its rate, Δt m f k×U.

/// State of a body over a step.
typedef struct {
    const bt_vel *u1, *free, *u2;
    bt_turning r;         ///< of all laws
    double turn;          ///< of all laws, rad/s
    double m, share, dt;
    bool led;             ///< kinematic
} motion;

static bt_impulse turned(const motion *q, const bt_load *l)
{
    const double m = q->m, ax = l->about_x, ay = l->about_y;
    if (q->led) {
        const double own = q->dt * q->share * m * l->turn, all = q->dt * q->share * m * q->turn;
        return (bt_impulse){-own * q->u2->y + (m * l->gain_x + all * ay), own * q->u2->x + (m * l->gain_y - all * ax),
                            0};
    }
    const double s = q->r.s, c1 = q->r.c - 1, part = l->turn == 0 ? 0 : l->turn / q->turn;
    return (bt_impulse){
        part * (m * (c1 * q->u1->x - s * q->u1->y)) + m * (l->gain_x - (c1 * ax - s * ay)),
        part * (m * (s * q->u1->x + c1 * q->u1->y)) + m * (l->gain_y - (s * ax + c1 * ay)),
        0,
    };
}

/// Coefficients are those of the start of the step, linearised about U1.
static bt_impulse impulse_of(const bt_bodies *b, bt_idx i, const motion *q, const bt_load *l)
{
    const bt_linear a = bt_load_implicit(b, i, l, q->u1);
    const bt_vel *u = q->u2, *f = q->free;
    bt_impulse j = turned(q, l);
    j.x += q->dt * (a.jx - a.g * u->x + a.gy * f->w) + q->dt * l->fx;
    j.y += q->dt * (a.jy - a.g * u->y - a.gx * f->w) + q->dt * l->fy;
    j.turn += q->dt * (a.jw - a.gx * f->y + a.gy * f->x - a.gw * u->w) + q->dt * l->moment;
    return j;
}

/// The load of all laws of a sum: as the step itself adds them up, where a sum of their impulses would round otherwise.
static void load_of_sum(const bt_forces *f, const char *name, bt_force_body *b, bt_load *l)
{
    bt_load_clear(l);
    for (int k = 0; k < f->n; k++)
        if (bt_force_laws[k]->part_of && !strcmp(bt_force_laws[k]->part_of, name)) bt_load_add(f, k, b, l);
}

void bt_forces_impulses(const bt_world *w, bt_idx i, bt_impulse *law, bt_impulse *series)
{
    const bt_bodies *b = &w->bodies;
    const bt_forces *f = w->forces;
    const bool led = b->motion[i] != BT_DYNAMIC;
    motion q = {.u1 = led ? &b->vel[i] : &b->vel_start[i],
                .free = led ? &b->vel[i] : &b->vel_free[i],
                .u2 = &b->vel[i],
                .r = BT_TURNING_NONE,
                .m = b->mass[i],
                .share = b->share[i],
                .dt = w->par.dt,
                .led = led};
    bt_force_body s = bt_load_body(w, i, q.u1);
    bt_load l;
    bt_load_clear(&l);
    bt_load_fill(f, 0, &s, &l);
    q.turn = l.turn;
    bt_turning_set(&q.r, q.share * q.turn * q.dt);
    for (int k = 0; k < f->n; k++) {
        bt_load_clear(&l);
        bt_load_add(f, k, &s, &l);
        law[k] = impulse_of(b, i, &q, &l);
    }
    for (int n = 0; n < f->n_series; n++) {
        const bt_force_series *of = &bt_force_series_of[n];
        for (int k = 0; k < f->n; k++)
            if (of->law == bt_force_laws[k]) series[n] = law[k];
        if (of->law) continue;
        load_of_sum(f, of->name, &s, &l);
        series[n] = impulse_of(b, i, &q, &l);
    }
}

void bt_forces_record(bt_world *w)
{
    const bt_idx i = bt_world_towed(w);
    if (i >= 0) bt_forces_impulses(w, i, w->forces->law, w->forces->series);
}

// --- free velocities -------------------------------------------------------------------------------------------------

/// All laws of a body: those of the list inline, those that a program has added through the table.
static inline void load_of(const bt_forces *f, bool added, bt_force_body *b, bt_load *l)
{
    bt_load_clear(l);
    int k = 0;
#define ADD(name) \
    b->own = f->own[k++]; \
    if (!bt_law_##name.towed_only || b->towed) bt_add_##name(b, l);
    BT_FORCE_LAWS(ADD)
    if (added) bt_load_fill(f, BT_LISTED_LAWS, b, l);
}

/// Two programs, without and with laws that are added: where the load of a body leaves the function, the compiler must
/// keep all of it in memory.
__attribute__((always_inline)) static inline void predict(bt_world *w, bt_idx i, bool added, bt_turning *r)
{
    bt_bodies *b = &w->bodies;
    const double dt = w->par.dt, m = b->mass[i], inertia = b->inertia[i];
    bt_vel u = b->vel[i];
    b->vel_start[i] = u;
    bt_force_body s = bt_load_body(w, i, &u);
    bt_load l;
    load_of(w->forces, added, &s, &l);
    const bt_linear a = bt_load_implicit(b, i, &l, &u);
    bt_turning_set(r, s.share * l.turn * dt);
    bt_load_turn(&l, r, dt, m, inertia, &u);
    const bt_inv inv = {1 / (m + dt * a.g), 1 / (inertia + dt * a.gw)};
    bt_linear_take(&a, dt, m, inertia, inv, &u);
    b->inv[i] = inv;
    b->vel[i] = b->vel_free[i] = u;
}

/// What predict() comes to for a body that drifts with the water where all forces let it: no load, and the velocity as
/// it is, but for the sign of a zero, to which the gain of the slope adds 0.
static void drift(bt_bodies *b, bt_idx i)
{
    const bt_vel u = b->vel[i];
    b->vel_start[i] = u;
    b->vel[i] = b->vel_free[i] = (bt_vel){u.x + 0.0, u.y + 0.0, u.w, u.unused};
    b->inv[i] = (bt_inv){1 / b->mass[i], 1 / b->inertia[i]};
}

/// rest: no listed law has anything to say to a body that drifts with the water, and none is added.
static void predict_cell(bt_world *w, bt_idx k, const void *rest, bt_totals *none)
{
    (void)none;
    bt_bodies *b = &w->bodies;
    bt_cells *t = w->cells;
    if (t->asleep[k] == BT_ASLEEP) return;
    const bool added = w->forces->n > BT_LISTED_LAWS;
    bt_turning r = BT_TURNING_NONE;
    for (bt_idx i = t->cell[k].first; i < t->cell[k].end; i++) {
        if (b->motion[i] != BT_DYNAMIC) b->vel_free[i] = b->vel[i];
        else if (*(const bool *)rest && bt_bodies_drift(w, &b->vel[i])) drift(b, i);
        else if (added) predict(w, i, true, &r);
        else predict(w, i, false, &r);
    }
    if (t->asleep[k]) t->asleep[k] = BT_ASLEEP;
}

void bt_forces_predict(bt_world *w)
{
    bt_totals none = {0};
    const bool rest = w->forces->n == BT_LISTED_LAWS && bt_forces_rest(w);
    bt_phases_busy(w, predict_cell, &rest, &none);
}

void bt_forces_begin(bt_world *w)
{
    bt_forces *f = w->forces;
    bool any = false;
    for (int k = BT_LISTED_LAWS; k < f->n; k++) any = any || bt_force_laws[k]->begin;
    if (!any) return;
    const bool rested = bt_forces_rest(w);
    for (int k = BT_LISTED_LAWS; k < f->n; k++) {
        const bt_force_law *law = bt_force_laws[k];
        const char *why = law->begin ? law->begin(w, f->own[k], law->context) : NULL;
        if (why) f->failed = law, f->why = why;
        f->acted[k] |= !bt_force_waits(law, f->own[k]);
    }
    if (!rested || bt_forces_rest(w)) return;
    bt_cells_wake_all(w->cells);
    for (bt_idx k = 0; k < w->cells->n; k++) w->cells->asleep[k] = BT_AWAKE;
}

bool bt_forces_rest(const bt_world *w)
{
    for (int k = 0; k < w->forces->n; k++) {
        const bt_force_law *law = bt_force_laws[k];
        if (!law->towed_only && !(law->rests && law->rests(&w->par, w->forces->own[k]))) return false;
    }
    return true;
}

bt_vel bt_forces_drift(const bt_world *w, bt_force_body *b)
{
    const double dt = w->par.dt, m = b->mass;
    b->par = &w->par, b->time = bt_load_time(w), b->towed_at = w->forces->towed_at;
    bt_vel u = b->vel;
    bt_load l;
    bt_load_clear(&l);
    bt_load_fill(w->forces, 0, b, &l);
    bt_linear a = bt_load_linear(&l, u.w);
    for (int k = 0; k < l.n_streams; k++)
        bt_linear_add_skin(&a, &l.stream[k], bt_hypot(l.stream[k].u - u.x, l.stream[k].v - u.y));
    bt_turning r = BT_TURNING_NONE;
    bt_turning_set(&r, b->share * l.turn * dt);
    bt_load_turn(&l, &r, dt, m, b->inertia, &u);
    bt_linear_take(&a, dt, m, b->inertia, (bt_inv){1 / (m + dt * a.g), 1 / (b->inertia + dt * a.gw)}, &u);
    return u;
}

bt_drag bt_forces_drag(const bt_moments *m, double draft, double sail, double water_density, double air_density,
                       double water_form, double water_skin, double air_form, double air_skin)
{
    return (bt_drag){
        .water_skin = water_density * water_skin * m->area,
        .water_form = 0.5 * water_density * water_form * draft,
        .air_skin = air_density * air_skin * m->area,
        .air_form = 0.5 * air_density * air_form * sail,
        .yaw = (water_density * water_skin + air_density * air_skin) * m->cubic,
    };
}
