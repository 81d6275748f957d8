// SPDX-License-Identifier: MIT
// Which points of a contact may close in a step; contact/law.h.
#include <math.h>

#include "contact/law.h"
#include "contact/row.h"

bt_closing bt_law_closing(const bt_world *w, const bt_cell *t, bt_idx j)
{
    const bt_bodies *s = &w->bodies;
    const bt_contact *u = &t->contacts[j];
    const double *gap = t->gaps[j].gap;
    bt_closing c = {.gap = INFINITY};
    for (int i = 0; i < u->n; i++) c.gap = bt_min(c.gap, bt_max(gap[i], 0));
    for (int i = 0; i < u->n; i++) {
        const double before = bt_normal_velocity(u, i, &s->vel_start[u->a], &s->vel_start[u->b]),
                     free = bt_normal_velocity(u, i, &s->vel_free[u->a], &s->vel_free[u->b]);
        const double approach = bt_max(0, -bt_min(before, free));
        // Never beyond the margin, which is at least the slop and at least the way of two bodies at
        // the highest speed (space/margin.h).
        c.point[i] = gap[i] <= bt_max(w->par.dt * approach, w->par.slop) || gap[i] <= c.gap;
        c.n += c.point[i];
        if (c.point[i]) c.approach = bt_max(c.approach, approach);
    }
    return c;
}
