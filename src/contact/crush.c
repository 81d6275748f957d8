// SPDX-License-Identifier: MIT
// Bounds of the contacts from their geometry, and what crushing leaves behind; equations in contact/crush.h.
#include "contact/crush.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "solve/solver.h"
#include "solve/kernel.h"

#define LEAST_WAY 0.01 // of the mean floe size: the contact length is linear over the approach of the step, or over this

bool bt_crush_on(const bt_params *p) { return p->crush_pressure > 0; }

/// Thickness that is crushed when a and b are pressed together, m; 0 = neither is ice.
static double thickness_of(const bt_bodies *s, bt_idx a, bt_idx b)
{
    const double ha = s->thickness[a], hb = s->thickness[b];
    return ha > 0 && hb > 0 ? bt_min(ha, hb) : bt_max(ha, hb);
}

bool bt_crush_applies(const bt_world *w, bt_idx a, bt_idx b) { return thickness_of(&w->bodies, a, b) > 0; }

// --- memory ----------------------------------------------------------------------------------------------------------

bool bt_crush_keeps(const bt_world *w, const bt_trace *r)
{
    const bt_idx a = bt_world_index(w, r->a), b = bt_world_index(w, r->b);
    bt_manifold m;
    double gap;
    int32_t axis = -1;
    return a >= 0 && b >= 0 && bt_contacts_parts(w, a, b, r->part, BT_CRUSH_MEMORY * w->par.size, -1, &m, &gap, &axis);
}

double bt_crush_depth(const bt_trace *r) { return bt_max(r->value[0], r->n_points > 1 ? r->value[1] : 0); }

static int by_bodies(const void *p, const void *q)
{
    const bt_trace *a = p, *b = q;
    if (a->a != b->a) return a->a < b->a ? -1 : 1;
    return a->b < b->b ? -1 : a->b > b->b;
}

/// Depth of each point from what the two bodies have crushed before, in these parts or in others: contact that moves on from part to part is
/// sliding.
static void inherit(const bt_tile *t, const bt_trace *names, const bt_manifold *m, bt_limit *l)
{
    if (t->n_memory == 0) return;
    const bt_trace *any = bsearch(names, t->memory, (size_t)t->n_memory, sizeof *names, by_bodies);
    if (!any) return;
    const bt_trace *end = any + 1, *own = NULL;
    while (any > t->memory && by_bodies(any - 1, names) == 0) any--;
    while (end < t->memory + t->n_memory && by_bodies(end, names) == 0) end++;
    double deepest = 0;
    for (const bt_trace *s = any; s < end; s++) {
        if (s->law != BT_LAW_CRUSHING) continue;
        deepest = bt_max(deepest, bt_crush_depth(s));
        if (bt_trace_by_names(s, names) == 0) own = s;
    }
    if (own) l->trace[BT_LAW_CRUSHING] = (int32_t)(own - t->memory);
    for (int i = 0; i < m->n_points; i++) {
        l->depth[i] = bt_min(deepest, bt_max(0, -m->p[i].gap));
        for (int j = 0; own && j < own->n_points; j++)
            if (own->feature[j] == m->p[i].feature) l->depth[i] = own->value[j];
    }
}

// --- geometry --------------------------------------------------------------------------------------------------------

/// Part of the tangent line that a contact bears on.
typedef struct {
    double length, middle; ///< m, m from the centroid of a along the tangent
} patch;

/// Where a and b overlap when b has come nearer by `way` along the normal: their intersection (Sutherland & Hodgman 1974, Comm. ACM 17: a cut by
/// the edges of b one after the other), seen along the tangent.
static patch patch_of(const bt_world *w, const uint16_t part[2], const bt_manifold *m, double way)
{
    const bt_bodies *s = &w->bodies;
    double off[2], v[2][4 * BT_MAX_VERTICES];
    bt_world_offset(w, m->a, m->b, off);
    off[0] -= way * m->nx, off[1] -= way * m->ny;
    const int64_t first_a = s->offset[m->a] + part[0], first_b = s->offset[m->b] + part[1];
    const double *q = s->outline + 2 * first_b;
    const int n_b = part[1] ? s->mark[first_b].count : (int)(s->offset[m->b + 1] - first_b);
    int n = part[0] ? s->mark[first_a].count : (int)(s->offset[m->a + 1] - first_a), from = 0;
    memcpy(v[0], s->outline + 2 * first_a, 2 * (size_t)n * sizeof(double));
    for (int e = 0; e < n_b && n > 0; e++, from = 1 - from) {
        const double *p0 = q + 2 * e, *p1 = q + 2 * (e + 1 < n_b ? e + 1 : 0);
        const double ex = p1[0] - p0[0], ey = p1[1] - p0[1], x0 = p0[0] + off[0], y0 = p0[1] + off[1];
        const double *in = v[from], *last = in + 2 * (n - 1);
        double *out = v[1 - from], before = ex * (last[1] - y0) - ey * (last[0] - x0);
        int kept = 0;
        for (int k = 0; k < n; k++) {
            const double *now = in + 2 * k, inside = ex * (now[1] - y0) - ey * (now[0] - x0);
            if ((inside >= 0) != (before >= 0)) {
                const double f = before / (before - inside);
                out[2 * kept] = last[0] + f * (now[0] - last[0]);
                out[2 * kept++ + 1] = last[1] + f * (now[1] - last[1]);
            }
            if (inside >= 0) {
                out[2 * kept] = now[0];
                out[2 * kept++ + 1] = now[1];
            }
            last = now, before = inside;
        }
        n = kept;
    }
    double low = INFINITY, high = -INFINITY;
    for (int k = 0; k < n; k++) {
        const double t = m->nx * v[from][2 * k + 1] - m->ny * v[from][2 * k];
        low = bt_min(low, t), high = bt_max(high, t);
    }
    return n > 0 ? (patch){high - low, 0.5 * (low + high)} : (patch){0, NAN};
}

/// Length of a patch that falls to point i of the manifold: uniform pressure on it, as forces at the points. NaN: to each alike.
static double share_of(const bt_manifold *m, int i, patch c)
{
    if (m->n_points == 1) return 1;
    const double t0 = m->nx * m->p[0].ra[1] - m->ny * m->p[0].ra[0], t1 = m->nx * m->p[1].ra[1] - m->ny * m->p[1].ra[0];
    if (!(t1 != t0) || isnan(c.middle)) return 0.5;
    const double second = bt_max(0, bt_min(1, (c.middle - t0) / (t1 - t0)));
    return i ? second : 1 - second;
}

void bt_crush_bound(const bt_world *w, bt_tile *t, bt_idx j, const bt_pair *p, const bt_manifold *m)
{
    const bt_bodies *s = &w->bodies;
    const bt_unit *u = &t->units[j];
    bt_gaps *g = &t->gaps[j];
    bt_limit *l = &t->limits[j];
    const double h = thickness_of(s, m->a, m->b), dt = w->par.dt;
    const bt_trace names = bt_law_names(w, p, BT_LAW_CRUSHING);
    inherit(t, &names, m, l);
    double gap = INFINITY, approach = 0;
    for (int i = 0; i < m->n_points; i++) {
        g->gap[i] += l->depth[i];
        gap = bt_min(gap, bt_max(g->gap[i], 0));
        const double before = bt_normal_velocity(u, i, &s->vel_start[m->a], &s->vel_start[m->b]);
        approach = bt_max(approach, -bt_min(before, bt_normal_velocity(u, i, &s->vel_free[m->a], &s->vel_free[m->b])));
    }
    const double per_length = w->par.crush_pressure * h * dt, least = w->par.crush_least * h / m->n_points;
    const double way = bt_max(dt * approach - gap, LEAST_WAY * w->par.size);
    const patch now = patch_of(w, p->part, m, gap + w->par.slop), then = patch_of(w, p->part, m, gap + w->par.slop + way);
    for (int i = 0; i < m->n_points; i++) {
        const double length = now.length * share_of(m, i, now), later = bt_max(length, then.length * share_of(m, i, then));
        l->flat[i] = per_length * bt_max(length, least);
        l->most[i] = per_length * bt_max(later, least);
        if (later <= bt_max(length, least)) continue; // as long as it gets
        const double k = w->par.crush_pressure * h * (later - length) / way;
        l->base[i] = per_length * length;
        l->slope[i] = k * dt * dt / (1 + sqrt(1 + dt * dt * k * u->w[i]));
    }
}

// --- growth ----------------------------------------------------------------------------------------------------------

bool bt_crush_gives_way(const bt_unit *u, const bt_limit *l, int i) { return u->ln[i] >= l->flat[i]; }

void bt_crush_give_way(bt_world *w, bt_tile *t, bt_idx j, int i, bt_totals *totals)
{
    t->limits[j].depth[i] += t->limits[j].grown[i];
    bt_sum_add(&totals->sum[BT_CRUSHED_WORK], -bt_solver_normal_work(w, &t->units[j], i));
    bt_sum_add(&totals->sum[BT_CRUSHING_POINTS], 1);
}

double bt_crush_remember(bt_world *w, bt_tile *t, bt_idx j)
{
    const bt_unit *u = &t->units[j];
    const bt_limit *l = &t->limits[j];
    double deepest = 0;
    for (int i = 0; i < u->n; i++) deepest = bt_max(deepest, l->depth[i]);
    if (deepest == 0) return 0;
    const bt_pair *p = &t->pairs[t->gaps[j].pair];
    bt_trace r = bt_law_names(w, p, BT_LAW_CRUSHING);
    r.n_points = u->n;
    for (int i = 0; i < u->n; i++) r.feature[i] = p->feature[i], r.value[i] = l->depth[i];
    bt_law_put(t, l->trace[BT_LAW_CRUSHING], &r);
    return deepest;
}
