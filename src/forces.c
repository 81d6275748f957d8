// SPDX-License-Identifier: MIT
// External forces on every body; equations in bergtow/forces.h.
#include "bergtow/forces.h"

#include <math.h>

#include "bergtow/tiles.h"

/// Implicit drag: K = Σ k|U_ref−U| (kg/s), K·U_ref (N), and the yaw coefficient k|ω| (kg m²/s).
typedef struct {
    double k, jx, jy, kw;
} drag_load;

/// Width of the turned outline across (ux, uy), m.
static double width_across(const bt_bodies *b, bt_idx i, double ux, double uy)
{
    double low = INFINITY, high = -INFINITY;
    for (int64_t k = b->offset[i]; k < b->offset[i + 1]; k++) {
        double s = ux * b->outline[2 * k + 1] - uy * b->outline[2 * k];
        low = bt_min(low, s);
        high = bt_max(high, s);
    }
    return high - low;
}

static void add_fluid(const bt_bodies *b, bt_idx i, double rx, double ry, double skin, double form, double ref_x,
                      double ref_y, drag_load *l)
{
    double s = sqrt(rx * rx + ry * ry);
    if (s == 0 || (skin == 0 && form == 0)) return;
    double k = skin;
    if (form > 0) k += form * width_across(b, i, rx / s, ry / s);
    l->k += k * s;
    l->jx += k * s * ref_x;
    l->jy += k * s * ref_y;
}

static drag_load drag_at(const bt_world *w, bt_idx i, const bt_vel *u)
{
    const bt_params *p = &w->par;
    const bt_drag *d = &w->bodies.drag[i];
    drag_load l = {.kw = d->yaw * fabs(u->w)};
    add_fluid(&w->bodies, i, p->water_u - u->x, p->water_v - u->y, d->water_skin, d->water_form, p->water_u, p->water_v, &l);
    add_fluid(&w->bodies, i, p->air_u - u->x, p->air_v - u->y, d->air_skin, d->air_form, p->air_u, p->air_v, &l);
    return l;
}

static void predict(bt_world *w, bt_idx i, double cos_f, double sin_f)
{
    const bt_params *p = &w->par;
    bt_bodies *b = &w->bodies;
    const double dt = p->dt, m = b->mass[i], inertia = b->inertia[i];
    bt_vel u = b->vel[i];
    b->vel_start[i] = u;
    const drag_load l = drag_at(w, i, &u);
    if (sin_f != 0) {
        double rx = u.x - p->balance_u, ry = u.y - p->balance_v;
        u.x = p->balance_u + cos_f * rx - sin_f * ry;
        u.y = p->balance_v + sin_f * rx + cos_f * ry;
    }
    u.x += dt * p->tilt_ax;
    u.y += dt * p->tilt_ay;
    const bt_inv inv = {1 / (m + dt * l.k), 1 / (inertia + dt * l.kw)};
    if (l.k > 0) { // without drag exactly as it was: a floe that drifts with the water is at rest to the last bit
        u.x = (m * u.x + dt * l.jx) * inv.m;
        u.y = (m * u.y + dt * l.jy) * inv.m;
    }
    if (l.kw > 0) u.w = inertia * u.w * inv.i;
    b->inv[i] = inv;
    b->vel[i] = b->vel_free[i] = u;
}

void bt_forces_predict(bt_world *w)
{
    bt_bodies *b = &w->bodies;
    bt_tiles *t = w->tiles;
    const double turn = w->par.coriolis * w->par.dt, cos_f = cos(turn), sin_f = sin(turn);
#pragma omp parallel for schedule(dynamic, 16) if (BT_MANY(t->n_busy, BT_FEW_TILES))
    for (bt_idx j = 0; j < t->n_busy; j++) {
        const bt_idx k = t->busy[j];
        if (t->rest[k] == BT_REST_KNOWN) continue;
        for (bt_idx i = t->tile[k].first; i < t->tile[k].end; i++) {
            if (b->motion[i] == BT_DYNAMIC) predict(w, i, cos_f, sin_f);
            else b->vel_free[i] = b->vel[i];
        }
        if (t->rest[k]) t->rest[k] = BT_REST_KNOWN;
    }
}

bt_external bt_forces_external(const bt_world *w, bt_idx i)
{
    const bt_bodies *b = &w->bodies;
    const bt_params *p = &w->par;
    const double m = b->mass[i], dt = p->dt, ub = p->balance_u, vb = p->balance_v;
    const bt_vel *u = &b->vel[i];
    if (b->motion[i] != BT_DYNAMIC) {
        const drag_load l = drag_at(w, i, u);
        const double turn = dt * m * p->coriolis;
        return (bt_external){
            .drag = {dt * (l.jx - l.k * u->x), dt * (l.jy - l.k * u->y)},
            .turn = -dt * l.kw * u->w,
            .coriolis = {-turn * u->y, turn * u->x},
            .tilt = {dt * m * p->tilt_ax + turn * vb, dt * m * p->tilt_ay - turn * ub},
        };
    }
    const bt_vel *u1 = &b->vel_start[i], *f = &b->vel_free[i];
    const double angle = p->coriolis * dt, s = sin(angle), c1 = cos(angle) - 1;
    bt_external e = {
        .coriolis = {m * (c1 * u1->x - s * u1->y), m * (s * u1->x + c1 * u1->y)},
        .tilt = {m * (dt * p->tilt_ax - (c1 * ub - s * vb)), m * (dt * p->tilt_ay - (s * ub + c1 * vb))},
    };
    // Drag is Δt (Σ K U_ref − K U2) = (M + Δt K)(U* − U2) − M (U' − U2), U' = U1 + Coriolis and tilt.
    const double me = 1 / b->inv[i].m, ie = 1 / b->inv[i].i;
    e.drag[0] = me * (f->x - u->x) - m * (u1->x - u->x) - e.coriolis[0] - e.tilt[0];
    e.drag[1] = me * (f->y - u->y) - m * (u1->y - u->y) - e.coriolis[1] - e.tilt[1];
    e.turn = ie * (f->w - u->w) - b->inertia[i] * (u1->w - u->w);
    return e;
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
