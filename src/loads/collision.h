// SPDX-License-Identifier: MIT
// One contact of the step just solved as a collision: the part of its impulse that stops the approach, and the corner
// in contact. Equations: loads/impact.h.
#ifndef BERGTOW_COLLISION_H
#define BERGTOW_COLLISION_H

#include "contact/cell_contacts.h"

typedef struct bt_collision {
    double impulse;   ///< λ_c, N s
    double whole;     ///< Λ: of this step and the next, if the collision continues there, N s
    double approach;  ///< −v1 if the contact closes, otherwise 0, m/s
    double rest;      ///< −v2 if it still closes, otherwise 0, m/s
    double mass;      ///< m_e, kg
    double ran, rbn;  ///< ra×n, rb×n of the pressure centre, m
} bt_collision;

/// The collision part of a contact with a normal impulse above 0, after the solve and before poses move.
bt_collision bt_contact_collision(const bt_world *world, const bt_contact *contact);

typedef struct bt_contact_corner {
    double angle;     ///< interior, rad; NaN if there is none
    int of;           ///< 0 = corner of a, 1 = of b; −1 = the sharper of two corners that meet
} bt_contact_corner;

/// The corner that makes a contact point of a pair of parts, from its feature as numbered by manifold.c.
bt_contact_corner bt_contact_corner_of(const bt_world *world, const bt_contact *contact, const uint16_t part[2],
                                       uint32_t feature);

#endif
