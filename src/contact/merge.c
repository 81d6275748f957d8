// SPDX-License-Identifier: MIT
// Contacts of several parts of one floe, or of several pieces of a shore, at one place become one.
//
// Parts that share a corner can both touch another floe there: one by the corner, the other by the end of its edge. The
// normals of the two then differ by the tilt of two nearly parallel edges. The rows are a wedge that is not there: it
// stops a floe that slides, and with friction the sweeps find no solution at all (seen: a hexagon in two parts, 20,000
// sweeps, 18 J gained). Normals farther apart than those of edges that face each other squarely (manifold.c) belong to
// different sides, as in a notch, and stay. Of two points at one place the deeper one stays: the other may be the end
// of an edge that is cut off at the seam, and above the corner that lies just beyond it.
#include "contact/merge.h"

#include <math.h>
#include <stdlib.h>

#include "space/cells.h"
#include "space/shore.h"

#define SQUARE 0.98 // cosine, as for reference edges
#define PLACE 0.01  // of the smaller radius, as for reference edges

/// A contact as the body has it that touches several polygons of one outline.
typedef struct {
    bt_manifold *m;
    bt_gid body;   ///< that one
    size_t place;  ///< in the list
    int n_points;  ///< that were found
    bool flip;     ///< it is b of the pair
} touch;

static const double *arm(const touch *t, int i) { return t->flip ? t->m->p[i].rb : t->m->p[i].ra; }

/// Do point i of p and point j of q press at the same place in the same way?
static bool same_place(const touch *p, int i, const touch *q, int j, double reach)
{
    const double sign = p->flip == q->flip ? 1 : -1;
    if (sign * (p->m->nx * q->m->nx + p->m->ny * q->m->ny) < SQUARE) return false;
    const double *x = arm(p, i), *y = arm(q, j), dx = x[0] - y[0], dy = x[1] - y[1];
    return fabs(p->m->nx * dy - p->m->ny * dx) <= reach; // along the surface: their heights differ by half of the gaps
}

static void drop(bt_manifold *m, int i)
{
    if (i + 1 < m->n_points) m->p[i] = m->p[i + 1];
    m->n_points--;
}

/// Points that p and q have both: those of q stay, unless that of p is deeper by more than the slop.
static void settle(const bt_world *w, const touch *p, const touch *q)
{
    const bt_bodies *b = &w->bodies;
    bt_manifold *m = p->m, *o = q->m;
    const double reach = PLACE * bt_min(bt_min(b->radius[m->a], b->radius[m->b]),
                                        bt_min(b->radius[o->a], b->radius[o->b])),
                 deeper = w->par.slop;
    for (int i = m->n_points - 1; i >= 0; i--)
        for (int j = o->n_points - 1; j >= 0; j--) {
            if (!same_place(p, i, q, j, reach)) continue;
            if (m->p[i].gap < o->p[j].gap - deeper) {
                drop(o, j);
            } else {
                drop(m, i);
                break;
            }
        }
}

/// The contacts t[n] of one body with the polygons of one outline.
static void merge(const bt_world *w, const touch *t, size_t n)
{
    // Edges that lie on each other know more than single points: those go first, whatever their order.
    for (size_t i = 0; i < n; i++)
        for (size_t j = 0; j < n; j++)
            if (i != j && t[i].m->n_points == 1 && (t[j].m->n_points == 2 || (t[j].m->n_points == 1 && j < i)))
                settle(w, &t[i], &t[j]);
    for (size_t i = 0; i < n; i++)
        for (size_t j = 0; j < i; j++)
            if (t[i].n_points == 2 && t[j].n_points == 2) settle(w, &t[i], &t[j]);
}

static int by_body(const void *p, const void *q)
{
    const touch *a = p, *b = q;
    return a->body != b->body ? (a->body < b->body ? -1 : 1) : a->place < b->place ? -1 : a->place > b->place;
}

void bt_merge_parts(const bt_world *w, bt_manifold *man, size_t n)
{
    const bt_bodies *b = &w->bodies;
    touch *t = bt_alloc(n, sizeof *t);
    size_t on_shore = 0;
    for (size_t k = 0, end; k < n; k = end) {
        const bool shore_a = bt_shore_holds(w, man[k].a), shore_b = bt_shore_holds(w, man[k].b);
        end = k + 1;
        if (shore_a || shore_b) {
            t[on_shore++] = (touch){&man[k], b->gid[shore_a ? man[k].b : man[k].a], k, man[k].n_points, shore_a};
            continue;
        }
        touch *of_pair = t + on_shore; // until the next one comes
        for (; end < n && man[end].a == man[k].a && man[end].b == man[k].b; end++) {}
        for (size_t i = k; i < end; i++) of_pair[i - k] = (touch){.m = &man[i], .n_points = man[i].n_points};
        if (end > k + 1) merge(w, of_pair, end - k);
    }
    if (on_shore > 0) qsort(t, on_shore, sizeof *t, by_body);
    for (size_t k = 0, end; k < on_shore; k = end) {
        for (end = k + 1; end < on_shore && t[end].body == t[k].body; end++) {}
        if (end > k + 1) merge(w, t + k, end - k);
    }
    free(t);
}
