// SPDX-License-Identifier: MIT
// Normal impulses of a contact under bounds (private to the solver); the shape of a bound is in contact/law.h.
#ifndef BERGTOW_LIMIT_H
#define BERGTOW_LIMIT_H

#include <math.h>

#include "contact/law.h"
#include "contact/row.h"

/// The rising part of the bounds, all 0 if there is none.
static inline const bt_rise *bt_rise_of(const bt_limit *limit)
{
    static const bt_rise none;
    return limit->rise ? limit->rise : &none;
}

/// Impulse of point i alone; b: its normal velocity with bias and without this impulse. With w = b + W λ, a rising line
/// λ = base − slope (w − bias + place) is met at λ = (base − slope (b − bias + place)) / (1 + slope W), and the curve
/// of a hit at the root of a quadratic equation; the rising part is above the flat one there exactly if it is so at the
/// solution. `place` and not the bias: a rebound does not crush.
static inline double bt_limit_point(const bt_limit *limit, const bt_contact *contact, const bt_mass *m, int i, double b)
{
    const bt_rise *rise = bt_rise_of(limit);
    const double free = contact->bias[i] - b, w = m->w[i]; // approach
    const double rising = rise->hit[i].before > 0
                              ? (free - limit->place[i] - bt_hit_end(&rise->hit[i], limit->place[i], free, w)) / w
                              : (rise->base[i] + rise->slope[i] * (free - limit->place[i])) / (1 + rise->slope[i] * w);
    return bt_max(0, bt_min(-b * m->mn[i], bt_min(limit->most[i], bt_max(limit->flat[i], rising))));
}

/// Bound of point i at these velocities, N s.
static inline double bt_limit_bound(const bt_limit *limit, const bt_contact *contact, int i, const bt_vel *v)
{
    const double approach =
        bt_max(0, -(bt_normal_velocity(contact, i, &v[contact->a], &v[contact->b]) + limit->place[i]));
    const bt_rise *rise = bt_rise_of(limit);
    const double rising = rise->hit[i].before > 0 ? bt_hit_bound(&rise->hit[i], limit->place[i], approach)
                                                  : rise->base[i] + rise->slope[i] * approach;
    return bt_min(limit->most[i], bt_max(limit->flat[i], rising));
}

/// Minimum of ½ λᵀ W λ + bᵀ λ on the rim of the box 0 <= λ <= c, where the solution is if not inside: on the side whose
/// multiplier has the right sign; if rounding leaves that in doubt, on the side of least value.
static inline void bt_limit_rim(const bt_mass *m, const double b[2], const double c[2], double l[2])
{
    double least = INFINITY;
    for (int side = 0; side < 4; side++) {
        const int i = side >> 1, o = 1 - i;
        double x[2];
        x[i] = side & 1 ? c[i] : 0;
        if (isinf(x[i])) continue;
        x[o] = bt_max(0, bt_min(c[o], -(b[o] + m->w12 * x[i]) * m->mn[o]));
        const double slope = b[i] + m->w[i] * x[i] + m->w12 * x[o];
        const double value = x[0] * (0.5 * (m->w[0] * x[0] + m->w12 * x[1]) + b[0]) +
                             x[1] * (0.5 * (m->w12 * x[0] + m->w[1] * x[1]) + b[1]);
        const bool right = side & 1 ? slope <= 0 : slope >= 0;
        if (right || value < least) l[0] = x[0], l[1] = x[1], least = value;
        if (right) return;
    }
}

/// Both impulses of a manifold. Exact if neither bound is reached, or both are flat; otherwise point by point, a few
/// times: the sweeps do the rest.
static inline void bt_limit_two(const bt_limit *limit, const bt_contact *contact, const bt_mass *m, const double b[2],
                                double l[2])
{
    enum { TURNS = 4 };
    l[0] = (m->w12 * b[1] - m->w[1] * b[0]) * m->per_det;
    l[1] = (m->w12 * b[0] - m->w[0] * b[1]) * m->per_det;
    if (m->per_det > 0 && l[0] >= 0 && l[1] >= 0 && l[0] <= limit->flat[0] && l[1] <= limit->flat[1]) return;
    const bt_rise *rise = bt_rise_of(limit);
    if (rise->slope[0] == 0 && rise->slope[1] == 0 && !(rise->hit[0].before > 0 || rise->hit[1].before > 0)) {
        bt_limit_rim(m, b, limit->flat, l);
        return;
    }
    l[0] = contact->ln[0], l[1] = contact->ln[1];
    for (int turn = 0; turn < TURNS; turn++)
        for (int i = 0; i < 2; i++) l[i] = bt_limit_point(limit, contact, m, i, b[i] + m->w12 * l[1 - i]);
}

/// Both normal impulses under bounds at these velocities; l: on entry, the impulses without bounds, nearly always below
/// the flat parts.
static inline void bt_limit_normals(const bt_limit *limit, const bt_contact *contact, const bt_mass *m,
                                    const bt_vel *va, const bt_vel *vb, double l[2])
{
    if (!(l[0] > limit->flat[0] || l[1] > limit->flat[1])) return;
    double b[2] = {0};
    for (int i = 0; i < contact->n; i++)
        b[i] = bt_normal_velocity(contact, i, va, vb) + contact->bias[i] - m->w[i] * contact->ln[i] -
               m->w12 * contact->ln[1 - i];
    if (contact->n == 1) l[0] = bt_limit_point(limit, contact, m, 0, b[0]);
    else bt_limit_two(limit, contact, m, b, l);
}

#endif
