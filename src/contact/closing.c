// SPDX-License-Identifier: MIT
// Which points of a contact take part in a step, and on what length they bear; contact/law.h.
#include <math.h>

#include "contact/law.h"
#include "contact/overlap.h"
#include "contact/row.h"

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
        // (space/margin.h, but for its cap): manifold.c looks a slop beyond the nearest point.
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
