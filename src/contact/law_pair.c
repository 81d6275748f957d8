// SPDX-License-Identifier: MIT
// Services for contact laws: the records of a pair, the points that take part in a step, and their work.
#include "contact/law_pair.h"

#include <math.h>
#include <stdlib.h>

#include "contact/contacts.h"
#include "contact/law.h"
#include "contact/overlap.h"
#include "contact/row.h"
#include "tow/tow.h"

bool bt_law_near(const bt_world *world, const bt_memory *memory)
{
    const bt_idx a = bt_world_index(world, memory->a), b = bt_world_index(world, memory->b);
    return a >= 0 && b >= 0 && bt_contacts_near(world, a, b, memory->part, BT_LAW_MEMORY * world->par.size);
}

bt_idx bt_law_find(const bt_cell *cell, const bt_memory *names)
{
    if (cell->laws->n_memory == 0) return -1;
    const bt_memory *memory = bsearch(names, cell->laws->memory, (size_t)cell->laws->n_memory, sizeof *names,
                                      bt_memory_by_names);
    return memory ? (bt_idx)(memory - cell->laws->memory) : -1;
}

void bt_law_put(bt_cell *cell, bt_idx at, const bt_memory *memory)
{
    if (at >= 0) cell->laws->memory[at] = *memory;
    else bt_cells_remember(cell, memory);
}

// --- points that take part -------------------------------------------------------------------------------------------

double bt_law_approach(const bt_world *world, const bt_contact *contact, int i)
{
    const bt_bodies *bodies = &world->bodies;
    const bt_idx a = contact->a, b = contact->b;
    const double before = bt_normal_velocity(contact, i, &bodies->vel_start[a], &bodies->vel_start[b]),
                 free = bt_normal_velocity(contact, i, &bodies->vel_free[a], &bodies->vel_free[b]);
    return bt_max(0, -bt_min(before, free));
}

bool bt_law_takes_part(const bt_world *world, double gap, double outline, double approach, double least,
                       double nearest)
{
    // These points are found whatever the margin: it is at least the slop, and the distance that two bodies at the
    // highest speed nearby cover (space/cells.h, except for its cap); and manifold.c looks a slop farther.
    const double slop = world->par.slop;
    return gap <= bt_max(world->par.dt * approach, slop) || gap <= least || outline <= nearest + slop;
}

bt_closing bt_law_closing(const bt_world *world, const bt_cell *cell, bt_idx j, const bt_manifold *manifold)
{
    const bt_contact *contact = &cell->contacts[j];
    const double *gap = cell->gaps[j].gap;
    bt_closing closing = {.gap = INFINITY};
    double nearest = INFINITY;
    for (int i = 0; i < contact->n; i++)
        closing.gap = bt_min(closing.gap, bt_max(gap[i], 0)), nearest = bt_min(nearest, manifold->p[i].gap);
    for (int i = 0; i < contact->n; i++) {
        const double approach = bt_law_approach(world, contact, i);
        closing.point[i] = bt_law_takes_part(world, gap[i], manifold->p[i].gap, approach, closing.gap, nearest);
        closing.n += closing.point[i];
        if (closing.point[i]) closing.approach = bt_max(closing.approach, approach);
    }
    return closing;
}

bt_patch bt_law_patch(const bt_world *world, const uint16_t part[2], const bt_manifold *manifold, double way,
                      double *area)
{
    bt_overlap overlap;
    double centroid[2];
    bt_overlap_clip(world, manifold->a, manifold->b, part, -way * manifold->nx, -way * manifold->ny, &overlap);
    double low = INFINITY, high = -INFINITY;
    for (int k = 0; k < overlap.n; k++) {
        const double t = manifold->nx * overlap.v[overlap.now][2 * k + 1] -
                         manifold->ny * overlap.v[overlap.now][2 * k];
        low = bt_min(low, t), high = bt_max(high, t);
    }
    *area = bt_overlap_area(&overlap, centroid);
    return overlap.n > 0 ? (bt_patch){high - low, 0.5 * (low + high)} : (bt_patch){0, NAN};
}

double bt_law_share(const bt_manifold *manifold, int i, bt_patch patch, const bt_closing *closing)
{
    if (manifold->n_points == 1 || !closing->point[1 - i]) return 1;
    if (!closing->point[i]) return 0;
    const double t0 = bt_law_along(manifold, 0), t1 = bt_law_along(manifold, 1);
    if (!(t1 != t0) || isnan(patch.middle)) return 0.5;
    const double second = bt_max(0, bt_min(1, (patch.middle - t0) / (t1 - t0)));
    return i ? second : 1 - second;
}

// --- work of its impulses --------------------------------------------------------------------------------------------

/// Work of the impulses of a contact on the velocities of its bodies from (fa, fb) to the present ones.
static double work_from(const bt_world *world, const bt_contact *contact, const bt_vel *fa, const bt_vel *fb)
{
    const bt_vel *va = &world->bodies.vel[contact->a], *vb = &world->bodies.vel[contact->b];
    double work = 0.5 * contact->lt * (bt_tangent_velocity(contact, fa, fb) + bt_tangent_velocity(contact, va, vb));
    const int n = contact->n > 0 ? contact->n : 1; // sheets have one component here
    for (int i = 0; i < n; i++)
        work += 0.5 * contact->ln[i] *
            (bt_normal_velocity(contact, i, fa, fb) + bt_normal_velocity(contact, i, va, vb));
    return work;
}

double bt_contacts_work(const bt_world *world, const bt_contact *contact)
{
    const bt_vel *start = world->bodies.vel_start;
    return work_from(world, contact, &start[contact->a], &start[contact->b]);
}

double bt_contacts_normal_work(const bt_world *world, const bt_contact *contact, int i)
{
    const bt_vel *start = world->bodies.vel_start, *vel = world->bodies.vel;
    return 0.5 * contact->ln[i] * (bt_normal_velocity(contact, i, &start[contact->a], &start[contact->b]) +
                                   bt_normal_velocity(contact, i, &vel[contact->a], &vel[contact->b]));
}

/// Velocity without contacts: U*, plus, for the towed body, the change by the line.
static bt_vel velocity_without_contacts(const bt_world *world, bt_idx i)
{
    bt_vel v = world->bodies.vel_free[i];
    if (i >= world->cells->n_in_cells && i == bt_world_towed(world) && bt_tow_has_line(world->tow))
        bt_tow_apply(world->tow, &v, world->bodies.inv[i]);
    return v;
}

double bt_contacts_gain(const bt_world *world, const bt_contact *contact)
{
    const bt_vel fa = velocity_without_contacts(world, contact->a), fb = velocity_without_contacts(world, contact->b);
    return work_from(world, contact, &fa, &fb);
}

double bt_contacts_unsolved_gain(const bt_contact *contact, double residual)
{
    return (residual + 1e-12) * (fabs(contact->ln[0]) + fabs(contact->ln[1]) + fabs(contact->lt));
}
