// SPDX-License-Identifier: MIT
// Example of quantities of one's own: the inertia of the water that the towed body carries along, and how much ice
// moves.
#include "bergtow/quantity.h"

#include <math.h>

/// Inertia of the added mass along the course of the body, M − m of its mass M: (M − m) (U2 − U1)·û / Δt, N.
static double carried_water(const bt_world *w, const void *context)
{
    (void)context;
    const bt_bodies *b = &w->bodies;
    const bt_idx t = bt_world_towed(w);
    const bt_vel *u1 = &b->vel_start[t], *u2 = &b->vel[t];
    const double speed = hypot(u2->x, u2->y);
    if (!(speed > 0)) return 0;
    const double gained = ((u2->x - u1->x) * u2->x + (u2->y - u1->y) * u2->y) / speed;
    return (1 - b->share[t]) * b->mass[t] * gained / w->par.dt;
}

/// Mass of a floe that moves faster than 1 cm/s, kg.
static double moving_mass(const bt_world *w, bt_idx floe, const void *context)
{
    (void)context;
    const bt_vel *v = &w->bodies.vel[floe];
    return hypot(v->x, v->y) > 0.01 ? w->bodies.share[floe] * w->bodies.mass[floe] : 0;
}

static const bt_quantity example_quantities[] = {
    {.name = "carried_water_force",
     .units = "N",
     .description = "inertia of the added mass of the towed body along its course",
     .label = "carried water",
     .keep = BT_KEEP_MEAN,
     .applies = BT_APPLIES_BODY,
     .role = BT_ROLE_FORCE,
     .of_world = carried_water},
    {.name = "moving_ice",
     .units = "kg",
     .description = "mass of the floes that move faster than 1 cm/s",
     .label = "moving ice",
     .keep = BT_KEEP_MAX,
     .applies = BT_APPLIES_ALWAYS,
     .role = BT_ROLE_DIAGNOSTIC,
     .of_floe = moving_mass},
};
enum { N_EXAMPLE_QUANTITIES = sizeof example_quantities / sizeof *example_quantities };
