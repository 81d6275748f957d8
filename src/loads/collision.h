// SPDX-License-Identifier: MIT
// One contact of the step just solved as a collision: what of its impulse the approach takes, and which corner is in
// it. Equations: loads/impact.h.
#ifndef BERGTOW_COLLISION_H
#define BERGTOW_COLLISION_H

#include "contact/cell_contacts.h"

typedef struct bt_collision {
    double impulse;   ///< λ_c, N s
    double approach;  ///< −v1 where the contact closes, otherwise 0, m/s
    double rest;      ///< −v2 where it still closes, otherwise 0, m/s
    double mass;      ///< m_e, kg
    double ran, rbn;  ///< ra×n, rb×n of the pressure centre, m
} bt_collision;

/// The contact with a normal impulse above 0, after the solve and before poses move.
bt_collision bt_contact_collision(const bt_world *world, const bt_contact *contact);

typedef struct bt_contact_corner {
    double angle;     ///< interior, rad; NaN if there is none
    int of;           ///< whose: 0 = of a, 1 = of b; −1 = of two corners that meet the sharper
} bt_contact_corner;

/// The corner that makes a contact point of a pair of parts, by its feature as manifold.c numbers them.
bt_contact_corner bt_contact_corner_of(const bt_bodies *bodies, const bt_contact *contact, const uint16_t part[2],
                                       uint32_t feature);

#endif
