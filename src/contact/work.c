// SPDX-License-Identifier: MIT
// Work of the impulses of a contact, from velocities without and with contacts.
#include "contact/work.h"

#include <math.h>

#include "contact/row.h"
#include "tow/tow.h"

/// Velocity without contacts: U*, and for the towed body what the line adds to it.
static bt_vel velocity_without_contacts(const bt_world *w, bt_idx i)
{
    bt_vel v = w->bodies.vel_free[i];
    if (i >= w->cells->n_in_cells && i == bt_world_towed(w) && bt_tow_has_line(w->tow))
        bt_tow_apply(w->tow, &v, w->bodies.inv[i]);
    return v;
}

double bt_contacts_normal_work(const bt_world *w, const bt_contact *u, int i)
{
    const bt_vel fa = velocity_without_contacts(w, u->a), fb = velocity_without_contacts(w, u->b);
    return 0.5 * u->ln[i] *
           (bt_normal_velocity(u, i, &fa, &fb) + bt_normal_velocity(u, i, &w->bodies.vel[u->a], &w->bodies.vel[u->b]));
}

double bt_contacts_work(const bt_world *w, const bt_contact *u)
{
    const bt_vel fa = velocity_without_contacts(w, u->a), fb = velocity_without_contacts(w, u->b);
    const bt_vel *va = &w->bodies.vel[u->a], *vb = &w->bodies.vel[u->b];
    double work = 0.5 * u->lt * (bt_tangent_velocity(u, &fa, &fb) + bt_tangent_velocity(u, va, vb));
    const int n = u->n > 0 ? u->n : 1; // sheets have one component here
    for (int i = 0; i < n; i++)
        work += 0.5 * u->ln[i] * (bt_normal_velocity(u, i, &fa, &fb) + bt_normal_velocity(u, i, va, vb));
    return work;
}

double bt_contacts_unsolved_work(const bt_contact *u, double residual)
{
    return (residual + 1e-12) * (fabs(u->ln[0]) + fabs(u->ln[1]) + fabs(u->lt));
}
