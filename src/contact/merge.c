// SPDX-License-Identifier: MIT
// Contacts of several parts of one floe at one place become one.
//
// Parts that share a corner can both touch another floe there: one by the corner, the other by the end of its edge. The
// normals of the two then differ by the tilt of two nearly parallel edges. The rows are a wedge that is not there: it
// stops a floe that slides, and with friction the sweeps find no solution at all (seen: a hexagon in two parts, 20,000
// sweeps, 18 J gained). Normals farther apart than those of edges that face each other squarely (manifold.c) belong to
// different shores, as in a notch, and stay.
#include "contact/merge.h"

#include <math.h>

#include "space/cells.h"

#define SQUARE 0.98 // cosine, as for reference edges
#define PLACE 0.01  // of the smaller radius, as for reference edges

/// Do point i of p and point j of q press at the same place in the same way?
static bool same_place(const bt_manifold *p, int i, const bt_manifold *q, int j, double reach)
{
    if (p->nx * q->nx + p->ny * q->ny < SQUARE) return false;
    const double dx = p->p[i].ra[0] - q->p[j].ra[0], dy = p->p[i].ra[1] - q->p[j].ra[1];
    return fabs(p->nx * dy - p->ny * dx) <= reach; // along the surface: their heights differ by half of the gaps
}

static bool shares(const bt_manifold *p, int i, const bt_manifold *q, double reach)
{
    for (int j = 0; j < q->n_points; j++)
        if (same_place(p, i, q, j, reach)) return true;
    return false;
}

/// Take the points out of p that q has, too.
static void take_out(bt_manifold *p, const bt_manifold *q, double reach)
{
    int kept = 0;
    for (int i = 0; i < p->n_points; i++)
        if (!shares(p, i, q, reach)) p->p[kept++] = p->p[i];
    p->n_points = kept;
}

void bt_merge_parts(const bt_world *w, bt_manifold *man, size_t n)
{
    const bt_bodies *b = &w->bodies;
    for (size_t k = 0, end; k < n; k = end) {
        for (end = k + 1; end < n && man[end].a == man[k].a && man[end].b == man[k].b; end++) {}
        if (end == k + 1) continue;
        const double reach = PLACE * bt_min(b->radius[man[k].a], b->radius[man[k].b]);
        // Edges that lie on each other know more than single points: those go first, whatever their order.
        for (size_t i = k; i < end; i++)
            for (size_t j = k; j < end; j++)
                if (i != j && man[i].n_points == 1 && (man[j].n_points == 2 || (man[j].n_points == 1 && j < i)))
                    take_out(&man[i], &man[j], reach);
        for (size_t i = k; i < end; i++)
            for (size_t j = k; j < i; j++)
                if (man[i].n_points == 2 && man[j].n_points == 2) take_out(&man[i], &man[j], reach);
    }
}
