// SPDX-License-Identifier: MIT
// Free velocity of every body by the forces on it, and the rest and free drift of floes; equations in bergtow/forces.h.
#include "force/forces.h"

#include <math.h>

#include "body/bodies.h"
#include "force/added.h"
#include "force/laws.h"
#include "force/load.h"
#include "space/cells.h"
#include "space/phases.h"
#include "base/elementary.h"

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
