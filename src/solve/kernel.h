// SPDX-License-Identifier: MIT
// The innermost arithmetic of a sweep: one contact with its masses, two bodies (private to the solver).
#ifndef BERGTOW_KERNEL_H
#define BERGTOW_KERNEL_H

#include <math.h>

#include "solve/limit.h"
#include "contact/row.h"

/// Normal impulses of a manifold: the exact solution of their 2×2 complementarity problem, by its four cases (both
/// press, one of them, none). Two points of one edge are strongly coupled through the turning of the floes: solved one
/// by one they need 2 to 10 times the sweeps on rows of floes lying edge to edge. If the coupling is singular (points
/// that coincide), the first single case that holds is taken; likewise for one point, as the missing one has no mass
/// (mn 0).
static inline void bt_solve_normals(const bt_contact *contact, const bt_mass *m, const bt_vel *va, const bt_vel *vb,
                                    double *l1, double *l2)
{
    const double dx = vb->x - va->x, dy = vb->y - va->y, un = contact->nx * dx + contact->ny * dy;
    const double u1 = un + contact->rbn[0] * vb->w - contact->ran[0] * va->w + contact->bias[0];
    const double u2 = un + contact->rbn[1] * vb->w - contact->ran[1] * va->w + contact->bias[1];
    // Velocities without both impulses.
    const double b1 = u1 - m->w[0] * contact->ln[0] - m->w12 * contact->ln[1],
                 b2 = u2 - m->w12 * contact->ln[0] - m->w[1] * contact->ln[1];
    *l1 = (m->w12 * b2 - m->w[1] * b1) * m->per_det;
    *l2 = (m->w12 * b1 - m->w[0] * b2) * m->per_det;
    if (!(m->per_det > 0 && *l1 >= 0 && *l2 >= 0)) {
        const double only1 = bt_max(0, -b1 * m->mn[0]), only2 = bt_max(0, -b2 * m->mn[1]);
        const bool first = b2 + m->w12 * only1 >= 0 || only2 == 0; // then the second point opens without load
        *l1 = first ? only1 : 0;
        *l2 = first ? 0 : only2;
    }
}

/// Apply the normal impulses l1 and l2, and the friction that they allow, one impulse for both points. Their tangential
/// rows are the same (manifold.c), so only the sum of their friction has an effect, bounded by μ (λ1 + λ2). Two
/// separate unknowns would drift apart along their null space and use up the friction cone. Returns the largest change
/// of speed of a row by the whole contact, m/s: of two points that share a load each takes only half the impulse, but
/// its residual is the whole speed.
static inline double bt_take_normals(bt_contact *contact, const bt_mass *m, double l1, double l2, bt_vel va, bt_vel vb,
                                     bt_vel *v, const bt_inv *inv)
{
    const bt_inv ia = inv[contact->a], ib = inv[contact->b];
    const double d1 = l1 - contact->ln[0], d2 = l2 - contact->ln[1];
    bt_apply(contact, d1 + d2, d1 * contact->ran[0] + d2 * contact->ran[1], d1 * contact->rbn[0] + d2 * contact->rbn[1],
             0, ia, ib, &va, &vb);
    const double t = bt_clamp(contact->lt - bt_tangent_velocity(contact, &va, &vb) * m->mt, contact->mu * (l1 + l2)),
                 dt = t - contact->lt;
    bt_apply(contact, 0, 0, 0, dt, ia, ib, &va, &vb);
    contact->ln[0] = l1, contact->ln[1] = l2, contact->lt = t;
    bt_store(&v[contact->a], ia, &va);
    bt_store(&v[contact->b], ib, &vb);
    const double u1 = m->w[0] * d1 + m->w12 * d2, u2 = m->w12 * d1 + m->w[1] * d2;
    return bt_max(bt_max(fabs(u1), fabs(u2)), fabs(dt) * m->wt);
}

/// Project (x, y) on the loads that sheets can bear (contact/raft.h): at most ±`ends`, plus friction in any direction.
static inline void bt_onto_sheets(const bt_limit *limit, double *x, double *y)
{
    const double *e = limit->ends, part = bt_part_of_ends(e, *x, *y);
    const double dx = *x - part * e[0], dy = *y - part * e[1];
    const double far = sqrt(dx * dx + dy * dy), radius = limit->flat[0];
    if (!(far > radius)) return;
    *x = part * e[0] + dx * (radius / far);
    *y = part * e[1] + dy * (radius / far);
}

/// The load of sheets after one projected step (contact/raft.h), others held.
static inline void bt_sheets_map(const bt_contact *contact, const bt_mass *m, const bt_limit *limit, const bt_vel *va,
                                 const bt_vel *vb, double *x, double *y)
{
    *x = contact->ln[0] - bt_normal_velocity(contact, 0, va, vb) * m->mn[0];
    *y = contact->lt - bt_tangent_velocity(contact, va, vb) * m->mt;
    bt_onto_sheets(limit, x, y);
}

static inline double bt_update_sheets(bt_contact *contact, const bt_mass *m, const bt_limit *limit, bt_vel *v,
                                      const bt_inv *inv)
{
    const bt_inv ia = inv[contact->a], ib = inv[contact->b];
    bt_vel va = v[contact->a], vb = v[contact->b];
    double x, y;
    bt_sheets_map(contact, m, limit, &va, &vb, &x, &y);
    const double dx = x - contact->ln[0], dy = y - contact->lt;
    bt_apply(contact, dx, dx * contact->ran[0], dx * contact->rbn[0], dy, ia, ib, &va, &vb);
    contact->ln[0] = x, contact->lt = y;
    bt_store(&v[contact->a], ia, &va);
    bt_store(&v[contact->b], ib, &vb);
    return bt_max(fabs(dx), fabs(dy)) * m->wt;
}

/// Gauss–Seidel update of a manifold: its normals together, then its friction. limit: its bounds, NULL = none.
static inline double bt_update_contact(bt_contact *contact, const bt_mass *m, const bt_limit *limit, bt_vel *v,
                                       const bt_inv *inv)
{
    if (limit && contact->n == 0) return bt_update_sheets(contact, m, limit, v, inv);
    const bt_vel va = v[contact->a], vb = v[contact->b];
    double l[2];
    bt_solve_normals(contact, m, &va, &vb, &l[0], &l[1]);
    if (limit) bt_limit_normals(limit, contact, m, &va, &vb, l);
    return bt_take_normals(contact, m, l[0], l[1], va, vb, v, inv);
}

/// The normal impulse of point i after its projected update, with all others held.
static inline double bt_normal_map(const bt_contact *contact, const bt_mass *m, const bt_limit *limit, int i,
                                   const bt_vel *va, const bt_vel *vb)
{
    const double w = bt_normal_velocity(contact, i, va, vb) + contact->bias[i];
    return limit ? bt_limit_point(limit, contact, m, i, w - m->w[i] * contact->ln[i])
                 : bt_max(0, contact->ln[i] - w * m->mn[i]);
}

#define BT_SHORT 0.01 // share of its bound by which an impulse may fall short, assumed

/// Residual, m/s, of a bounded row whose impulse falls short of its map by the share `part`; closing: the speed left,
/// m/s. There the natural map is at most bound × W, whatever the speed. Where that was below the tolerance (a short
/// step, large floes, weak ice), ice that should give way bore nothing, step after step, and the position projection
/// held it without a force. So while more than BT_SHORT of the impulse is missing, the speed counts. The impulse of
/// sheets also has a direction, which turns with the last digits of the slip where that is small: requiring it to 1 %
/// took 331,000 residuals a step in 90 % ice, instead of 187,000. So for sheets `part` is at most the share of the
/// power that the impulse does not take.
static inline double bt_short_residual(double closing, double part, double tolerance)
{
    return bt_min(closing, part * (tolerance / BT_SHORT));
}

static inline double bt_sheets_residual(const bt_contact *contact, const bt_mass *m, const bt_limit *limit,
                                        const bt_vel *v, double tolerance, double *sum)
{
    const bt_vel *va = &v[contact->a], *vb = &v[contact->b];
    double x, y;
    bt_sheets_map(contact, m, limit, va, vb, &x, &y);
    const double *e = limit->ends, friction = limit->flat[0], dx = x - contact->ln[0], dy = y - contact->lt;
    const double un = bt_normal_velocity(contact, 0, va, vb), ut = bt_tangent_velocity(contact, va, vb);
    const double bears = friction + sqrt(e[0] * e[0] + e[1] * e[1]),
                 takes = friction * sqrt(un * un + ut * ut) + fabs(e[0] * un + e[1] * ut);
    x = dx * m->wt, y = dy * m->wt;
    double lacks = 0;
    if (takes > 0) {
        const double braked = -(contact->ln[0] * un + contact->lt * ut);
        const double part = bt_min(sqrt(dx * dx + dy * dy) / bears, 1 - braked / takes);
        lacks = bt_short_residual(takes / bears, part, tolerance);
    }
    *sum += bt_max(x * x + y * y, lacks * lacks);
    return isfinite(x + y) ? bt_max(bt_max(fabs(x), fabs(y)), lacks) : INFINITY;
}

/// Natural-map residual of a contact, m/s, with the shortfall of bounded rows; adds to *sum the squares over its rows
/// (a normal row per point, one tangential; two for sheets). tolerance: of the problem, m/s.
static inline double bt_contact_residual(const bt_contact *contact, const bt_mass *m, const bt_limit *limit,
                                         const bt_vel *v, double tolerance, double *sum)
{
    if (limit && contact->n == 0) return bt_sheets_residual(contact, m, limit, v, tolerance, sum);
    const bt_vel *va = &v[contact->a], *vb = &v[contact->b];
    double worst = 0, total = 0;
    for (int i = 0; i < contact->n; i++) {
        const double map = bt_normal_map(contact, m, limit, i, va, vb), more = map - contact->ln[i];
        double r = fabs(more * m->w[i]);
        if (limit && more > 0) {
            const double w = bt_normal_velocity(contact, i, va, vb) + contact->bias[i];
            r = bt_max(r, bt_short_residual(-w, more / map, tolerance));
        }
        worst = bt_max(worst, r);
        *sum += r * r;
        total += contact->ln[i];
    }
    const double wt = bt_tangent_velocity(contact, va, vb),
                 r = (bt_clamp(contact->lt - wt * m->mt, contact->mu * total) - contact->lt) * m->wt;
    *sum += r * r;
    return isfinite(wt) ? bt_max(worst, fabs(r)) : INFINITY; // bt_max itself ignores a NaN
}

/// Gauss–Seidel update in the plain position projection (solve/project.c): point by point. Biases are gaps, m, impulses
/// the multipliers, kg m; d: displacements. Returns the largest correction, m.
static inline double bt_project_contact(bt_contact *contact, const bt_mass *m, double slop, bt_vel *d,
                                        const bt_inv *inv)
{
    bt_vel da = d[contact->a], db = d[contact->b];
    double most = 0;
    for (int i = 0; i < contact->n; i++) {
        const double open = bt_normal_velocity(contact, i, &da, &db) + contact->bias[i] + slop,
                     p = bt_max(0, contact->ln[i] - open * m->mn[i]), step = p - contact->ln[i];
        contact->ln[i] = p;
        bt_apply(contact, step, step * contact->ran[i], step * contact->rbn[i], 0, inv[contact->a], inv[contact->b],
                 &da, &db);
        most = bt_max(most, fabs(step) * m->w[i]);
    }
    bt_store(&d[contact->a], inv[contact->a], &da);
    bt_store(&d[contact->b], inv[contact->b], &db);
    return most;
}

#endif
