// SPDX-License-Identifier: MIT
// Velocities and impulses of one contact, two bodies.
#ifndef BERGTOW_ROW_H
#define BERGTOW_ROW_H

#include "space/cells.h"

static inline double bt_normal_velocity(const bt_contact *u, int i, const bt_vel *va, const bt_vel *vb)
{
    return u->nx * (vb->x - va->x) + u->ny * (vb->y - va->y) + u->rbn[i] * vb->w - u->ran[i] * va->w;
}

static inline double bt_tangent_velocity(const bt_contact *u, const bt_vel *va, const bt_vel *vb)
{
    return u->nx * (vb->y - va->y) - u->ny * (vb->x - va->x) + u->rbt * vb->w - u->rat * va->w;
}

/// Add impulses to both velocities: normal total jn = Σ λ, its moments Σ λ ra×n and Σ λ rb×n, tangential jt.
static inline void bt_apply(const bt_contact *u, double jn, double ma, double mb, double jt, bt_inv ia, bt_inv ib,
                            bt_vel *va, bt_vel *vb)
{
    const double jx = jn * u->nx - jt * u->ny, jy = jn * u->ny + jt * u->nx;
    va->x -= ia.m * jx;
    va->y -= ia.m * jy;
    va->w -= ia.i * (ma + jt * u->rat);
    vb->x += ib.m * jx;
    vb->y += ib.m * jy;
    vb->w += ib.i * (mb + jt * u->rbt);
}

/// Impulse of a contact on its body b; on a the opposite.
static inline void bt_impulse_on_b(const bt_contact *u, double *x, double *y)
{
    const double normal = u->ln[0] + u->ln[1];
    *x = normal * u->nx - u->lt * u->ny;
    *y = normal * u->ny + u->lt * u->nx;
}

static inline double bt_clamp(double x, double bound) { return bt_max(-bound, bt_min(bound, x)); }

/// Bodies of infinite mass are never written: they are shared by cells that are done at once.
static inline void bt_store(bt_vel *v, bt_inv inv, const bt_vel *x)
{
    if (inv.m > 0) *v = *x;
}

#endif
