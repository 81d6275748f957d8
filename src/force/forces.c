// SPDX-License-Identifier: MIT
// External forces on every body; equations in bergtow/forces.h.
#include "bergtow/forces.h"

#include <math.h>

#include "space/tiles.h"

/// Implicit drag Σ g Jᵀ (U_ref − J U), J U = U + ω×r, a symmetric matrix over (U, ω): g = Σ g (kg/s), gx, gy = Σ g r
/// (kg m/s), gw = Σ g r² and the skin's k|ω| (kg m²/s); jx, jy = Σ g U_ref (N), jw = Σ g r×U_ref (N m).
typedef struct {
    double g, gx, gy, gw, jx, jy, jw;
} drag_load;

/// Skin drag of one fluid, k |v| v, v = ref − U.
static void add_skin(double rx, double ry, double k, double ref_x, double ref_y, drag_load *l)
{
    const double g = k * sqrt(rx * rx + ry * ry);
    l->g += g;
    l->jx += g * ref_x;
    l->jy += g * ref_y;
}

/// Form drag along the convex hull of the outline of body i, form · v max(0, −v·n) dl; (rx, ry): U_ref − U, w: ω. On an
/// edge v is linear and n constant, so that g = form max(0, −v·n) dl and its moments to r² are polynomials up to the
/// third degree where water comes in: two points of Gauss are exact.
static void add_outline(const bt_bodies *b, bt_idx i, double rx, double ry, double w, double form, double ref_x, double ref_y, drag_load *l)
{
    if (form == 0 || (rx == 0 && ry == 0 && w == 0)) return;
    const double gauss = 0.57735026918962576451; // 1/√3
    const int n = bt_body_corners(b, i);
    const double *v = b->outline + 2 * b->offset[i];
    const bt_mark *mark = b->mark + b->offset[i];
    for (int k = 0; k < n; k++) {
        if (mark[k].next == k) continue;
        const double *p = v + 2 * k, *q = v + 2 * mark[k].next, ex = q[0] - p[0], ey = q[1] - p[1];
        // Inflow −v·n times the length of the edge, at its ends.
        const double in0 = -((rx + w * p[1]) * ey - (ry - w * p[0]) * ex), in1 = -((rx + w * q[1]) * ey - (ry - w * q[0]) * ex);
        if (in0 <= 0 && in1 <= 0) continue;
        const double from = in0 < 0 ? in0 / (in0 - in1) : 0, to = in1 < 0 ? in0 / (in0 - in1) : 1;
        for (int side = -1; side <= 1; side += 2) {
            const double s = 0.5 * (from + to + side * gauss * (to - from));
            const double g = 0.5 * (to - from) * form * bt_max(0, in0 + s * (in1 - in0)), x = p[0] + s * ex, y = p[1] + s * ey;
            l->g += g;
            l->gx += g * x;
            l->gy += g * y;
            l->gw += g * (x * x + y * y);
            l->jx += g * ref_x;
            l->jy += g * ref_y;
            l->jw += g * (x * ref_y - y * ref_x);
        }
    }
}

static drag_load drag_at(const bt_world *w, bt_idx i, const bt_vel *u)
{
    const bt_params *p = &w->par;
    const bt_bodies *b = &w->bodies;
    const bt_drag *d = &b->drag[i];
    const double wx = p->water_u - u->x, wy = p->water_v - u->y, ax = p->air_u - u->x, ay = p->air_v - u->y;
    drag_load l = {.gw = d->yaw * fabs(u->w)};
    add_skin(wx, wy, d->water_skin, p->water_u, p->water_v, &l);
    add_skin(ax, ay, d->air_skin, p->air_u, p->air_v, &l);
    add_outline(b, i, wx, wy, u->w, d->water_form, p->water_u, p->water_v, &l);
    add_outline(b, i, ax, ay, u->w, d->air_form, p->air_u, p->air_v, &l);
    return l;
}

bt_turning bt_forces_turning(const bt_params *p, double share)
{
    const double angle = share * p->coriolis * p->dt, push = p->tilt_moves_water ? 1 : share;
    return (bt_turning){.share = share, .c = cos(angle), .s = sin(angle), .vx = p->dt * push * p->tilt_ax, .vy = p->dt * push * p->tilt_ay};
}

/// (M + Δt K) U* = M U' + Δt Σ g Jᵀ U_ref; inv: of the diagonal of M + Δt K.
static void take_drag(const drag_load *l, double dt, double m, double inertia, bt_inv inv, bt_vel *u)
{
    if (l->gx == 0 && l->gy == 0) { // no coupling
        if (l->g > 0) { // without drag exactly as it was: a floe that drifts with the water is at rest to the last bit
            u->x = (m * u->x + dt * l->jx) * inv.m;
            u->y = (m * u->y + dt * l->jy) * inv.m;
        }
        if (l->gw > 0) u->w = inertia * u->w * inv.i;
        return;
    }
    const double x = dt * l->gx, y = dt * l->gy, bx = m * u->x + dt * l->jx, by = m * u->y + dt * l->jy;
    // The last denominator is positive: (Σ g r)² <= Σ g Σ g r².
    u->w = (inertia * u->w + dt * l->jw + (y * bx - x * by) * inv.m) / (1 / inv.i - (x * x + y * y) * inv.m);
    u->x = (bx + y * u->w) * inv.m;
    u->y = (by - x * u->w) * inv.m;
}

static void predict(bt_world *w, bt_idx i, const bt_turning *all)
{
    const bt_params *p = &w->par;
    bt_bodies *b = &w->bodies;
    const double dt = p->dt, m = b->mass[i], inertia = b->inertia[i];
    bt_vel u = b->vel[i];
    b->vel_start[i] = u;
    const drag_load l = drag_at(w, i, &u);
    const bt_turning own = b->share[i] == all->share ? *all : bt_forces_turning(p, b->share[i]);
    bt_forces_turn(p, &own, &u);
    const bt_inv inv = {1 / (m + dt * l.g), 1 / (inertia + dt * l.gw)};
    take_drag(&l, dt, m, inertia, inv, &u);
    b->inv[i] = inv;
    b->vel[i] = b->vel_free[i] = u;
}

void bt_forces_predict(bt_world *w)
{
    bt_bodies *b = &w->bodies;
    bt_tiles *t = w->tiles;
    const bt_turning all = bt_forces_turning(&w->par, 1);
#pragma omp parallel for schedule(dynamic, 16) if (BT_MANY(t->n_busy, BT_FEW_TILES))
    for (bt_idx j = 0; j < t->n_busy; j++) {
        const bt_idx k = t->busy[j];
        if (t->rest[k] == BT_REST_KNOWN) continue;
        for (bt_idx i = t->tile[k].first; i < t->tile[k].end; i++) {
            if (b->motion[i] == BT_DYNAMIC) predict(w, i, &all);
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
    const bt_turning r = bt_forces_turning(p, b->share[i]);
    if (b->motion[i] != BT_DYNAMIC) {
        const drag_load l = drag_at(w, i, u);
        const double turn = dt * b->share[i] * m * p->coriolis;
        return (bt_external){
            .drag = {dt * (l.jx - l.g * u->x + l.gy * u->w), dt * (l.jy - l.g * u->y - l.gx * u->w)},
            .turn = dt * (l.jw - l.gx * u->y + l.gy * u->x - l.gw * u->w),
            .coriolis = {-turn * u->y, turn * u->x},
            .tilt = {m * r.vx + turn * vb, m * r.vy - turn * ub},
        };
    }
    const bt_vel *u1 = &b->vel_start[i], *f = &b->vel_free[i];
    const double s = r.s, c1 = r.c - 1;
    bt_external e = {
        .coriolis = {m * (c1 * u1->x - s * u1->y), m * (s * u1->x + c1 * u1->y)},
        .tilt = {m * (r.vx - (c1 * ub - s * vb)), m * (r.vy - (s * ub + c1 * vb))},
    };
    // Of the step, M_e (U2 − U*) is what contacts and line gave, M_e = M + Δt diag K; the rest of M (U2 − U') is drag,
    // U' = U1 + Coriolis and tilt.
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
