// SPDX-License-Identifier: MIT
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
#include "force/load.h"
#include "force/forces.h"

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
