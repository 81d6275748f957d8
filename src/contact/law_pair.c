// SPDX-License-Identifier: MIT
// What a contact law asks of a pair of bodies: what it remembers of it, which points take part in a step, their work.
#include "contact/law_pair.h"

#include <math.h>
#include <stdlib.h>

#include "contact/contacts.h"
#include "contact/law.h"
#include "contact/overlap.h"
#include "contact/row.h"
#include "tow/tow.h"

bool bt_law_near(const bt_world *w, const bt_memory *r)
{
    const bt_idx a = bt_world_index(w, r->a), b = bt_world_index(w, r->b);
    bt_manifold m;
    return a >= 0 && b >= 0 && bt_contacts_parts(w, a, b, r->part, BT_LAW_MEMORY * w->par.size, -1, &m, NULL);
}

bt_idx bt_law_find(const bt_cell *t, const bt_memory *names)
{
    if (t->laws.n_memory == 0) return -1;
    const bt_memory *r = bsearch(names, t->laws.memory, (size_t)t->laws.n_memory, sizeof *names, bt_memory_by_names);
    return r ? (bt_idx)(r - t->laws.memory) : -1;
}

void bt_law_put(bt_cell *t, bt_idx at, const bt_memory *r)
{
    if (at >= 0) t->laws.memory[at] = *r;
    else bt_cells_remember(t, r);
}

// --- points that take part -------------------------------------------------------------------------------------------

bt_closing bt_law_closing(const bt_world *w, const bt_cell *t, bt_idx j, const bt_manifold *m)
{
    const bt_bodies *s = &w->bodies;
    const bt_contact *u = &t->contacts[j];
    const double *gap = t->gaps[j].gap, slop = w->par.slop;
    bt_closing c = {.gap = INFINITY};
    double nearest = INFINITY; // of the outlines
    for (int i = 0; i < u->n; i++) c.gap = bt_min(c.gap, bt_max(gap[i], 0)), nearest = bt_min(nearest, m->p[i].gap);
    for (int i = 0; i < u->n; i++) {
        const double before = bt_normal_velocity(u, i, &s->vel_start[u->a], &s->vel_start[u->b]),
                     free = bt_normal_velocity(u, i, &s->vel_free[u->a], &s->vel_free[u->b]);
        const double approach = bt_max(0, -bt_min(before, free));
        // Found whatever the margin, which is at least the slop and the way of two bodies at the highest speed nearby
        // (space/cells.h, but for its cap): manifold.c looks a slop beyond the nearest point.
        c.point[i] = gap[i] <= bt_max(w->par.dt * approach, slop) || gap[i] <= c.gap || m->p[i].gap <= nearest + slop;
        c.n += c.point[i];
        if (c.point[i]) c.approach = bt_max(c.approach, approach);
    }
    return c;
}

bt_patch bt_law_patch(const bt_world *w, const uint16_t part[2], const bt_manifold *m, double way, double *area)
{
    bt_overlap o;
    double centroid[2];
    bt_overlap_clip(w, m->a, m->b, part, -way * m->nx, -way * m->ny, &o);
    double low = INFINITY, high = -INFINITY;
    for (int k = 0; k < o.n; k++) {
        const double t = m->nx * o.v[o.now][2 * k + 1] - m->ny * o.v[o.now][2 * k];
        low = bt_min(low, t), high = bt_max(high, t);
    }
    *area = bt_overlap_area(&o, centroid);
    return o.n > 0 ? (bt_patch){high - low, 0.5 * (low + high)} : (bt_patch){0, NAN};
}

double bt_law_share(const bt_manifold *m, int i, bt_patch p, const bt_closing *c)
{
    if (m->n_points == 1 || !c->point[1 - i]) return 1;
    if (!c->point[i]) return 0;
    const double t0 = bt_law_along(m, 0), t1 = bt_law_along(m, 1);
    if (!(t1 != t0) || isnan(p.middle)) return 0.5;
    const double second = bt_max(0, bt_min(1, (p.middle - t0) / (t1 - t0)));
    return i ? second : 1 - second;
}

// --- work of its impulses --------------------------------------------------------------------------------------------

// Work of the impulses of a contact, from velocities without and with contacts.

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
