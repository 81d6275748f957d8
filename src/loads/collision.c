// SPDX-License-Identifier: MIT
// What of a contact's impulse is a collision, and the corner that it meets; see loads/collision.h.
#include "loads/collision.h"

#include <math.h>

#include "base/elementary.h"
#include "contact/row.h"

/// Interior angle of the outline of body i, rad, where vertex v of its part stands; NaN when there is no such vertex.
/// Parts have no corners of their own: a cut leads from one corner of the outline to another.
static double interior_angle(const bt_bodies *b, bt_idx i, int part, uint32_t v)
{
    const bt_mark *mark = b->mark + b->offset[i] + part;
    const uint32_t count = mark->count;
    if (v > count) return NAN;
    const int n = bt_body_corners(b, i), k = mark[v < count ? v : 0].corner; // v = count: the end of the last edge
    const double *o = b->outline + 2 * b->offset[i], *at = o + 2 * k, *before = o + 2 * (k ? k - 1 : n - 1),
                 *after = o + 2 * (k + 1 < n ? k + 1 : 0);
    const double px = at[0] - before[0], py = at[1] - before[1], qx = after[0] - at[0], qy = after[1] - at[1];
    return BT_PI - bt_atan2(px * qy - py * qx, px * qx + py * qy);
}

bt_contact_corner bt_contact_corner_of(const bt_bodies *b, const bt_contact *u, const uint16_t part[2],
                                       uint32_t feature)
{
    if ((feature >> 20) == 0x7ffu)
        return (bt_contact_corner){bt_min(interior_angle(b, u->a, part[0], (feature >> 10) & 0x3ffu),
                                          interior_angle(b, u->b, part[1], feature & 0x3ffu)), -1};
    const bool reference_b = feature >> 31, of_reference = feature & 1u, of_b = reference_b == of_reference;
    return (bt_contact_corner){interior_angle(b, of_b ? u->b : u->a, part[of_b], (feature & 0xfffffu) >> 1), of_b};
}

/// Masses without the drag that the solver's contain: a collision is short against the step.
static bt_inv bare(const bt_bodies *b, bt_idx i)
{
    return b->inv[i].m > 0 ? (bt_inv){1 / b->mass[i], 1 / b->inertia[i]} : (bt_inv){0};
}

bt_collision bt_contact_collision(const bt_world *w, const bt_contact *u)
{
    const bt_bodies *b = &w->bodies;
    const double total = u->ln[0] + u->ln[1], share[2] = {u->ln[0] / total, u->ln[1] / total};
    const bt_inv ia = bare(b, u->a), ib = bare(b, u->b);
    bt_collision c = {0};
    double v1 = 0, v2 = 0;
    for (int i = 0; i < u->n; i++) {
        v1 += share[i] * bt_normal_velocity(u, i, &b->vel_start[u->a], &b->vel_start[u->b]);
        v2 += share[i] * bt_normal_velocity(u, i, &b->vel[u->a], &b->vel[u->b]);
        c.ran += share[i] * u->ran[i];
        c.rbn += share[i] * u->rbn[i];
    }
    const double effect = ia.m + ib.m + ia.i * c.ran * c.ran + ib.i * c.rbn * c.rbn;
    const double coupled = effect + (ia.i * c.ran * u->rat + ib.i * c.rbn * u->rbt) * (u->lt / total);
    if (v1 < 0 && v2 > v1) c.impulse = coupled > 0 ? bt_min(total, (v2 - v1) / coupled) : total;
    c.approach = bt_max(0, -v1);
    c.rest = bt_max(0, -v2);
    c.mass = 1 / effect;
    return c;
}
