// SPDX-License-Identifier: MIT
// The collision part of a contact's impulse, and the corner in contact; see loads/collision.h.
#include "loads/collision.h"

#include <math.h>

#include "base/elementary.h"
#include "contact/row.h"
#include "space/shore.h"

/// Interior angle of the outline of body i, rad, at vertex v of a part; NaN if there is no such vertex. Every corner of
/// a part is a corner of the outline: a cut leads from one corner of the outline to another. Fixed bodies that lie
/// against each other have one outline: the corner turns as far as its normal cone is wide.
static double interior_angle(const bt_world *world, bt_idx i, int part, uint32_t v)
{
    const bt_bodies *bodies = &world->bodies;
    const bt_mark *mark = bodies->mark + bodies->offset[i] + part;
    const uint32_t count = mark->count;
    if (v > count) return NAN;
    if (bt_shore_holds(world, i)) {
        const bt_face *face = bt_shore_faces(world->shore, bodies->gid[i], part) + (v < count ? v : 0);
        const double *u = face->u, *w = face->w;
        if (u[0] == 0 && u[1] == 0) return NAN;
        return BT_PI - bt_atan2(u[0] * w[1] - u[1] * w[0], u[0] * w[0] + u[1] * w[1]);
    }
    const int n = bt_body_corners(bodies, i), k = mark[v < count ? v : 0].corner; // v = count: the end of the last edge
    const double *o = bodies->outline + 2 * bodies->offset[i], *at = o + 2 * k, *before = o + 2 * (k ? k - 1 : n - 1),
                 *after = o + 2 * (k + 1 < n ? k + 1 : 0);
    const double px = at[0] - before[0], py = at[1] - before[1], qx = after[0] - at[0], qy = after[1] - at[1];
    return BT_PI - bt_atan2(px * qy - py * qx, px * qx + py * qy);
}

bt_contact_corner bt_contact_corner_of(const bt_world *world, const bt_contact *contact, const uint16_t part[2],
                                       uint32_t feature)
{
    if ((feature >> 20) == 0x7ffu)
        return (bt_contact_corner){bt_min(interior_angle(world, contact->a, part[0], (feature >> 10) & 0x3ffu),
                                          interior_angle(world, contact->b, part[1], feature & 0x3ffu)), -1};
    const bool reference_b = feature >> 31, of_reference = feature & 1u, of_b = reference_b == of_reference;
    return (bt_contact_corner){interior_angle(world, of_b ? contact->b : contact->a, part[of_b],
                                              (feature & 0xfffffu) >> 1), of_b};
}

/// Masses without the drag included in the solver's: a collision is short compared with the step.
static bt_inv bare(const bt_bodies *bodies, bt_idx i)
{
    return bodies->inv[i].m > 0 ? (bt_inv){1 / bodies->mass[i], 1 / bodies->inertia[i]} : (bt_inv){0};
}

bt_collision bt_contact_collision(const bt_world *world, const bt_contact *contact)
{
    const bt_bodies *bodies = &world->bodies;
    const double total = contact->ln[0] + contact->ln[1], share[2] = {contact->ln[0] / total, contact->ln[1] / total};
    const bt_inv ia = bare(bodies, contact->a), ib = bare(bodies, contact->b);
    bt_collision collision = {0};
    double v1 = 0, v2 = 0;
    for (int i = 0; i < contact->n; i++) {
        v1 += share[i] * bt_normal_velocity(contact, i, &bodies->vel_start[contact->a], &bodies->vel_start[contact->b]);
        v2 += share[i] * bt_normal_velocity(contact, i, &bodies->vel[contact->a], &bodies->vel[contact->b]);
        collision.ran += share[i] * contact->ran[i];
        collision.rbn += share[i] * contact->rbn[i];
    }
    const double effect = ia.m + ib.m + ia.i * collision.ran * collision.ran + ib.i * collision.rbn * collision.rbn;
    const double coupled = effect + (ia.i * collision.ran * contact->rat + ib.i * collision.rbn * contact->rbt) *
                           (contact->lt / total);
    if (v1 < 0 && v2 > v1) collision.impulse = coupled > 0 ? bt_min(total, (v2 - v1) / coupled) : total;
    collision.approach = bt_max(0, -v1);
    collision.rest = bt_max(0, -v2);
    collision.mass = 1 / effect;
    collision.whole = collision.impulse;
    if (collision.impulse > 0 && collision.rest > 0)
        collision.whole *= collision.approach / (collision.approach - collision.rest);
    return collision;
}
