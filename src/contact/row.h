// SPDX-License-Identifier: MIT
// Velocities and impulses of one contact, two bodies.
#ifndef BERGTOW_ROW_H
#define BERGTOW_ROW_H

#include <math.h>

#include "space/cells.h"

static inline double bt_normal_velocity(const bt_contact *u, int i, const bt_vel *va, const bt_vel *vb)
{
    return u->nx * (vb->x - va->x) + u->ny * (vb->y - va->y) + u->rbn[i] * vb->w - u->ran[i] * va->w;
}

/// At the middle of the two points of a contact.
static inline double bt_mean_normal_velocity(const bt_contact *u, const bt_vel *va, const bt_vel *vb)
{
    return 0.5 * (bt_normal_velocity(u, 0, va, vb) + bt_normal_velocity(u, 1, va, vb));
}

static inline double bt_tangent_velocity(const bt_contact *u, const bt_vel *va, const bt_vel *vb)
{
    return u->nx * (vb->y - va->y) - u->ny * (vb->x - va->x) + u->rbt * vb->w - u->rat * va->w;
}

/// Effective masses of a contact.
typedef struct bt_mass {
    double w[2], w12; ///< W of the normals and their coupling, 1/kg; 0 for a point that is not there
    double mn[2];     ///< 1/W, kg; 0 for the second of one point
    double per_det;   ///< 1/(W1 W2 − W12²), kg²; 0 when singular or one point
    double wt, mt;    ///< W of the tangent and its inverse
} bt_mass;

/// W of arms p and q on body a with the inverse masses ia, and of r and s on b.
static inline double bt_coupling(bt_inv ia, bt_inv ib, double p, double q, double r, double s)
{
    return ia.m + ib.m + ia.i * p * q + ib.i * r * s;
}

/// Sheets that lie on each other (contact/raft.h): one step length for the components along x and y.
static inline bt_mass bt_mass_of_sheets(const bt_contact *u, bt_inv ia, bt_inv ib)
{
    const double free = ia.m + ib.m, x = ia.i * u->ran[0] * u->ran[0] + ib.i * u->rbn[0] * u->rbn[0];
    const double y = ia.i * u->rat * u->rat + ib.i * u->rbt * u->rbt,
                 xy = ia.i * u->ran[0] * u->rat + ib.i * u->rbn[0] * u->rbt;
    const double w = free + 0.5 * (x + y) + sqrt(0.25 * (x - y) * (x - y) + xy * xy);
    return (bt_mass){.w = {w}, .mn = {1 / w}, .wt = w, .mt = 1 / w};
}

/// Always by these expressions, or by the same four at a time (solve/rows.h): bits are the same wherever it is formed.
static inline bt_mass bt_mass_of(const bt_contact *u, const bt_inv *inv)
{
    const bt_inv ia = inv[u->a], ib = inv[u->b];
    if (u->n == 0) return bt_mass_of_sheets(u, ia, ib);
    bt_mass m = {0};
    for (int i = 0; i < u->n; i++) {
        m.w[i] = bt_coupling(ia, ib, u->ran[i], u->ran[i], u->rbn[i], u->rbn[i]);
        m.mn[i] = 1 / m.w[i];
    }
    m.wt = bt_coupling(ia, ib, u->rat, u->rat, u->rbt, u->rbt);
    m.mt = 1 / m.wt;
    if (u->n == 1) return m;
    m.w12 = bt_coupling(ia, ib, u->ran[0], u->ran[1], u->rbn[0], u->rbn[1]);
    const double det = m.w[0] * m.w[1] - m.w12 * m.w12;
    m.per_det = det > 1e-9 * m.w[0] * m.w[1] ? 1 / det : 0;
    return m;
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

/// The impulse that comes in by a contact whose other body has infinite mass: on the one that can move. False where
/// both can or neither. inv: of all bodies.
static inline bool bt_impulse_from_outside(const bt_contact *u, const bt_inv *inv, double *x, double *y)
{
    const double sign = (inv[u->b].m > 0) - (inv[u->a].m > 0);
    bt_impulse_on_b(u, x, y);
    *x *= sign, *y *= sign;
    return sign != 0;
}

static inline double bt_clamp(double x, double bound) { return bt_max(-bound, bt_min(bound, x)); }

/// Part of the ends of an overlap, e (bt_limit.ends), that is nearest to the load (x, y) of sheets.
static inline double bt_part_of_ends(const double e[2], double x, double y)
{
    const double square = e[0] * e[0] + e[1] * e[1];
    return square > 0 ? bt_clamp((x * e[0] + y * e[1]) / square, 1) : 0;
}

/// Bodies of infinite mass are never written: they are shared by cells that are done at once.
static inline void bt_store(bt_vel *v, bt_inv inv, const bt_vel *x)
{
    if (inv.m > 0) *v = *x;
}

#endif
