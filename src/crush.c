// SPDX-License-Identifier: MIT
// Bounds of the contacts from their geometry, and what crushing leaves behind; equations in bergtow/crush.h.
#include "bergtow/crush.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "bergtow/solver.h"
#include "domain.h"
#include "kernel.h"
#include "phases.h"

// --- memory ----------------------------------------------------------------------------------------------------------

static int by_gids(const void *p, const void *q)
{
    const bt_scar *a = p, *b = q;
    if (a->a != b->a) return a->a < b->a ? -1 : 1;
    return a->b < b->b ? -1 : a->b > b->b;
}

void bt_crush_prune(const bt_world *w, bt_tile *t)
{
    const double memory = BT_CRUSH_MEMORY * w->par.size;
    bt_idx kept = 0;
    for (bt_idx k = 0; k < t->n_scars; k++) {
        const bt_idx a = bt_world_index(w, t->scars[k].a), b = bt_world_index(w, t->scars[k].b);
        bt_manifold m;
        double gap;
        int32_t axis = -1;
        if (a >= 0 && b >= 0 && bt_contacts_pair(w, a, b, memory, -1, &m, &gap, &axis)) t->scars[kept++] = t->scars[k];
    }
    t->n_scars = kept;
}

void bt_crush_add(bt_tile *t, const bt_scar *s)
{
    if (t->n_scars == t->cap_scars) {
        t->cap_scars = t->cap_scars ? 2 * t->cap_scars : 8;
        t->scars = bt_realloc(t->scars, (size_t)t->cap_scars, sizeof *t->scars);
    }
    t->scars[t->n_scars++] = *s;
}

// --- geometry --------------------------------------------------------------------------------------------------------

/// Tangents of the angles of the two edges at a corner from a direction, and how far the edges reach across it.
typedef struct {
    double tan, reach;
} wedge;

/// Corner k of body i; (x, y): unit vector out of the body into what it is pressed on.
static wedge wedge_of(const bt_bodies *s, bt_idx i, int k, double x, double y)
{
    const double *v = s->outline + 2 * s->offset[i];
    const int n = (int)(s->offset[i + 1] - s->offset[i]);
    k %= n;
    wedge c = {0, 0};
    const int ends[2] = {(k + 1) % n, (k + n - 1) % n};
    for (int e = 0; e < 2; e++) {
        const double ex = v[2 * ends[e]] - v[2 * k], ey = v[2 * ends[e] + 1] - v[2 * k + 1];
        const double across = fabs(x * ey - y * ex), inward = -(x * ex + y * ey);
        c.tan += across / bt_max(inward, 1e-9 * (across + fabs(inward)));
        c.reach += across;
    }
    return c;
}

/// Outward normal of the edge of body i that faces (x, y) most squarely: the one that bt_contacts_pair has clipped.
static void facing_normal(const bt_bodies *s, bt_idx i, double x, double y, double out[2])
{
    const double *v = s->outline + 2 * s->offset[i];
    const int n = (int)(s->offset[i + 1] - s->offset[i]);
    double least = INFINITY;
    for (int k = 0; k < n; k++) {
        const double *p = v + 2 * k, *q = v + 2 * ((k + 1) % n), per = s->per_length[s->offset[i] + k];
        const double nx = (q[1] - p[1]) * per, ny = (p[0] - q[0]) * per;
        if (nx * x + ny * y >= least) continue;
        least = nx * x + ny * y;
        out[0] = nx, out[1] = ny;
    }
}

/// The corner that makes contact point i of a manifold, by its feature (manifold.c).
static wedge corner_of(const bt_bodies *s, const bt_manifold *m, int i)
{
    const uint32_t f = m->p[i].feature;
    if ((f & 0xfff00000u) == 0x7ff00000u) { // two corners that point at each other
        const wedge a = wedge_of(s, m->a, (int)(f >> 10 & 0x3ff), m->nx, m->ny), b = wedge_of(s, m->b, (int)(f & 0x3ff), -m->nx, -m->ny);
        return (wedge){1 / (1 / a.tan + 1 / b.tan), bt_min(a.reach, b.reach)};
    }
    const bool ref_b = f >> 31, own = f & 1; // own: the corner is an end of the reference edge
    const int corner = (int)(f >> 1 & 0x7ffff);
    const double sign = ref_b ? -1 : 1, x = sign * m->nx, y = sign * m->ny; // out of the reference polygon
    if (!own) return wedge_of(s, ref_b ? m->a : m->b, corner, -x, -y);
    double facing[2] = {-x, -y};
    facing_normal(s, ref_b ? m->a : m->b, x, y, facing);
    return wedge_of(s, ref_b ? m->b : m->a, corner, -facing[0], -facing[1]);
}

/// Thickness that is crushed when a and b are pressed together, m; 0 = neither is ice.
static double thickness_of(const bt_bodies *s, bt_idx a, bt_idx b)
{
    const double ha = s->thickness[a], hb = s->thickness[b];
    return ha > 0 && hb > 0 ? bt_min(ha, hb) : bt_max(ha, hb);
}

void bt_crush_reserve(bt_tile *t)
{
    if (t->n_units <= t->cap_limits) return;
    t->cap_limits = t->n_units + t->n_units / 4;
    free(t->limits);
    t->limits = bt_alloc_aligned((size_t)t->cap_limits, sizeof *t->limits);
}

/// Depth of each point from what the pair has crushed before.
static void inherit(const bt_tile *t, const bt_manifold *m, bt_limit *l)
{
    if (l->scar < 0) return;
    const bt_scar *s = &t->scars[l->scar];
    const double deepest = bt_max(s->depth[0], s->n > 1 ? s->depth[1] : 0);
    for (int i = 0; i < m->n_points; i++) {
        l->depth[i] = bt_min(deepest, bt_max(0, -m->p[i].gap));
        for (int j = 0; j < s->n; j++)
            if (s->feature[j] == m->p[i].feature) l->depth[i] = s->depth[j];
    }
}

void bt_crush_fill(const bt_world *w, bt_tile *t, bt_idx j, const bt_manifold *m)
{
    const bt_bodies *s = &w->bodies;
    bt_unit *u = &t->units[j];
    bt_limit *l = &t->limits[j];
    *l = (bt_limit){.flat = {INFINITY, INFINITY}, .most = {INFINITY, INFINITY}, .scar = -1};
    const double h = thickness_of(s, m->a, m->b), dt = w->par.dt;
    if (h > 0) {
        const bt_scar name = {.a = s->gid[m->a], .b = s->gid[m->b]};
        const bt_scar *scar = t->n_scars > 0 ? bsearch(&name, t->scars, (size_t)t->n_scars, sizeof name, by_gids) : NULL;
        l->scar = scar ? (int32_t)(scar - t->scars) : -1;
        inherit(t, m, l);
    }
    for (int i = 0; i < m->n_points; i++) {
        u->gap[i] += l->depth[i];
        l->place[i] = bt_max(u->gap[i], 0) / dt;
        if (!(h > 0)) continue;
        const wedge c = corner_of(s, m, i);
        double length = c.reach;
        if (m->n_points > 1) // half of the overlapping part: the points are its ends
            length = 0.5 * fabs((m->p[1].ra[1] - m->p[0].ra[1]) * m->nx - (m->p[1].ra[0] - m->p[0].ra[0]) * m->ny);
        const double per_length = w->par.crush_pressure * h * dt, least = w->par.crush_least * h / m->n_points;
        l->most[i] = per_length * bt_max(length, least);
        const bool parallel = length < c.tan * w->par.slop;
        const double wide = parallel ? length : bt_min(length, c.tan * l->depth[i]);
        l->flat[i] = per_length * bt_max(wide, least);
        if (wide >= length) continue; // as long as it gets
        const double k = w->par.crush_pressure * h * c.tan;
        l->base[i] = k * dt * l->depth[i];
        l->slope[i] = k * dt * dt / (1 + sqrt(1 + dt * dt * k * u->w[i]));
    }
}

double bt_crush_overlap(const bt_tile *t)
{
    double deepest = 0;
    for (bt_idx j = 0; j < t->n_units; j++)
        for (int i = 0; i < t->units[j].n; i++) deepest = bt_max(deepest, -t->units[j].gap[i]);
    return deepest;
}

// --- growth ----------------------------------------------------------------------------------------------------------

enum { WORK, POINTS, N_GROWN };

static void grow_tile(bt_world *w, bt_idx k, const void *context, bt_totals *totals)
{
    (void)context;
    bt_tile *t = &w->tiles->tile[k];
    const bt_gid *gid = w->bodies.gid;
    const bt_vel *v = w->bodies.vel;
    const bt_idx before = t->n_scars;
    for (bt_idx j = 0; j < t->n_units; j++) {
        const bt_unit *u = &t->units[j];
        bt_limit *l = &t->limits[j];
        double deepest = 0;
        for (int i = 0; i < u->n; i++) {
            const double approach = -(bt_normal_velocity(u, i, &v[u->a], &v[u->b]) + l->place[i]);
            if (u->ln[i] >= l->flat[i] && approach > 0) {
                l->grown[i] = w->par.dt * approach;
                l->depth[i] += l->grown[i];
                bt_sum_add(&totals->sum[WORK], -bt_solver_normal_work(w, u, i));
                bt_sum_add(&totals->sum[POINTS], 1);
            }
            deepest = bt_max(deepest, l->depth[i]);
        }
        if (deepest == 0) continue;
        totals->most = bt_max(totals->most, deepest);
        bt_scar s = {.a = gid[u->a], .b = gid[u->b], .n = u->n, .depth = {l->depth[0], l->depth[1]}};
        memcpy(s.feature, t->pairs[u->pair].feature, (size_t)u->n * sizeof *s.feature);
        if (l->scar >= 0) t->scars[l->scar] = s;
        else bt_crush_add(t, &s);
    }
    if (t->n_scars > before) qsort(t->scars, (size_t)t->n_scars, sizeof *t->scars, by_gids);
}

void bt_crush_grow(bt_world *w)
{
    bt_step_stats *st = &w->stats;
    st->crushed_work = st->crushed_depth = 0;
    st->n_crushing = 0;
    if (!bt_crush_on(w)) return;
    bt_totals t = {.n_sums = N_GROWN};
    bt_phases_any_order(w, grow_tile, NULL, &t);
    bt_domain_reduce(w, &t);
    st->crushed_work = bt_sum_value(&t.sum[WORK]);
    st->n_crushing = (int64_t)bt_sum_value(&t.sum[POINTS]);
    st->crushed_depth = t.most;
}
