// SPDX-License-Identifier: MIT
// Velocities and impulses of one contact, two bodies.
#ifndef BERGTOW_ROW_H
#define BERGTOW_ROW_H

#include <math.h>

#include "contact/cell_contacts.h"

static inline double bt_normal_velocity(const bt_contact *contact, int i, const bt_vel *va, const bt_vel *vb)
{
    return contact->nx * (vb->x - va->x) + contact->ny * (vb->y - va->y) + contact->rbn[i] * vb->w -
           contact->ran[i] * va->w;
}

/// Does a point of a contact with these biases rebound? Gaps give no negative one.
static inline bool bt_rebounds(const double bias[2]) { return bias[0] < 0 || bias[1] < 0; }

/// Normal velocity at the middle of the two points of a contact, m/s.
static inline double bt_mean_normal_velocity(const bt_contact *contact, const bt_vel *va, const bt_vel *vb)
{
    return 0.5 * (bt_normal_velocity(contact, 0, va, vb) + bt_normal_velocity(contact, 1, va, vb));
}

static inline double bt_tangent_velocity(const bt_contact *contact, const bt_vel *va, const bt_vel *vb)
{
    return contact->nx * (vb->y - va->y) - contact->ny * (vb->x - va->x) + contact->rbt * vb->w - contact->rat * va->w;
}

/// Effective masses of a contact.
typedef struct bt_mass {
    double w[2], w12; ///< W of the normals and their coupling, 1/kg; 0 for a missing point
    double mn[2];     ///< 1/W, kg; 0 for a missing second point
    double per_det;   ///< 1/(W1 W2 − W12²), kg²; 0 if singular or with one point
    double wt, mt;    ///< W of the tangent and its inverse
} bt_mass;

/// Entry of W for arms p and q on body a, with inverse masses ia, and r and s on b, with ib.
static inline double bt_coupling(bt_inv ia, bt_inv ib, double p, double q, double r, double s)
{
    return ia.m + ib.m + ia.i * p * q + ib.i * r * s;
}

/// Sheets that lie on each other (contact/raft.h): one step length for the components along x and y.
static inline bt_mass bt_mass_of_sheets(const bt_contact *contact, bt_inv ia, bt_inv ib)
{
    const double free = ia.m + ib.m,
                 x = ia.i * contact->ran[0] * contact->ran[0] + ib.i * contact->rbn[0] * contact->rbn[0];
    const double y = ia.i * contact->rat * contact->rat + ib.i * contact->rbt * contact->rbt,
                 xy = ia.i * contact->ran[0] * contact->rat + ib.i * contact->rbn[0] * contact->rbt;
    const double w = free + 0.5 * (x + y) + sqrt(0.25 * (x - y) * (x - y) + xy * xy);
    return (bt_mass){.w = {w}, .mn = {1 / w}, .wt = w, .mt = 1 / w};
}

/// Always formed by these expressions, or the same ones four at a time (solve/rows.h), for the same bits everywhere.
static inline bt_mass bt_mass_of(const bt_contact *contact, const bt_inv *inv)
{
    const bt_inv ia = inv[contact->a], ib = inv[contact->b];
    if (contact->n == 0) return bt_mass_of_sheets(contact, ia, ib);
    bt_mass m = {0};
    for (int i = 0; i < contact->n; i++) {
        m.w[i] = bt_coupling(ia, ib, contact->ran[i], contact->ran[i], contact->rbn[i], contact->rbn[i]);
        m.mn[i] = 1 / m.w[i];
    }
    m.wt = bt_coupling(ia, ib, contact->rat, contact->rat, contact->rbt, contact->rbt);
    m.mt = 1 / m.wt;
    if (contact->n == 1) return m;
    m.w12 = bt_coupling(ia, ib, contact->ran[0], contact->ran[1], contact->rbn[0], contact->rbn[1]);
    const double det = m.w[0] * m.w[1] - m.w12 * m.w12;
    m.per_det = det > 1e-9 * m.w[0] * m.w[1] ? 1 / det : 0;
    return m;
}

/// Add impulses to both velocities: normal total jn = Σ λ, its moments Σ λ ra×n and Σ λ rb×n, tangential jt.
static inline void bt_apply(const bt_contact *contact, double jn, double ma, double mb, double jt, bt_inv ia, bt_inv ib,
                            bt_vel *va, bt_vel *vb)
{
    const double jx = jn * contact->nx - jt * contact->ny, jy = jn * contact->ny + jt * contact->nx;
    va->x -= ia.m * jx;
    va->y -= ia.m * jy;
    va->w -= ia.i * (ma + jt * contact->rat);
    vb->x += ib.m * jx;
    vb->y += ib.m * jy;
    vb->w += ib.i * (mb + jt * contact->rbt);
}

/// Impulse of a contact on its body b, N s; that on a is opposite.
static inline void bt_impulse_on_b(const bt_contact *contact, double *x, double *y)
{
    const double normal = contact->ln[0] + contact->ln[1];
    *x = normal * contact->nx - contact->lt * contact->ny;
    *y = normal * contact->ny + contact->lt * contact->nx;
}

/// Impulse, N s, on the movable body of a contact whose other body has infinite mass. False if both or neither can
/// move. inv: of all bodies.
static inline bool bt_impulse_from_outside(const bt_contact *contact, const bt_inv *inv, double *x, double *y)
{
    const double sign = (inv[contact->b].m > 0) - (inv[contact->a].m > 0);
    bt_impulse_on_b(contact, x, y);
    *x *= sign, *y *= sign;
    return sign != 0;
}

static inline double bt_clamp(double x, double bound) { return bt_max(-bound, bt_min(bound, x)); }

/// Factor on the load e of the ends of an overlap (bt_limit.ends) that brings it nearest to the load (x, y) of the
/// sheets.
static inline double bt_part_of_ends(const double e[2], double x, double y)
{
    const double square = e[0] * e[0] + e[1] * e[1];
    return square > 0 ? bt_clamp((x * e[0] + y * e[1]) / square, 1) : 0;
}

/// Store a velocity, but never that of a body of infinite mass: cells processed in parallel share it.
static inline void bt_store(bt_vel *v, bt_inv inv, const bt_vel *x)
{
    if (inv.m > 0) *v = *x;
}

#endif
