// SPDX-License-Identifier: MIT
// Bounds of the contacts from their geometry, and what crushing leaves behind; equations in contact/crush.h.
#include "contact/crush.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "solve/solver.h"
#include "partition/domain.h"
#include "solve/kernel.h"
#include "space/phases.h"

#define LEAST_WAY 0.01 // of the mean floe size: the contact length is linear over the approach of the step, or over this

// --- memory ----------------------------------------------------------------------------------------------------------

static int by_gids(const void *p, const void *q)
{
    const bt_scar *a = p, *b = q;
    if (a->a != b->a) return a->a < b->a ? -1 : 1;
    if (a->b != b->b) return a->b < b->b ? -1 : 1;
    if (a->part[0] != b->part[0]) return a->part[0] < b->part[0] ? -1 : 1;
    return (a->part[1] > b->part[1]) - (a->part[1] < b->part[1]);
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
        if (a >= 0 && b >= 0 && bt_contacts_parts(w, a, b, t->scars[k].part, memory, -1, &m, &gap, &axis)) t->scars[kept++] = t->scars[k];
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
    bt_bodies_offset(w, m->a, m->b, off);
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

static int by_bodies(const void *p, const void *q)
{
    const bt_scar *a = p, *b = q;
    if (a->a != b->a) return a->a < b->a ? -1 : 1;
    return a->b < b->b ? -1 : a->b > b->b;
}

/// Depth of each point from what the two bodies have crushed before, in these parts or in others: contact that moves on from part to part is
/// sliding.
static void inherit(const bt_tile *t, const bt_scar *name, const bt_manifold *m, bt_limit *l)
{
    if (t->n_scars == 0) return;
    const bt_scar *any = bsearch(name, t->scars, (size_t)t->n_scars, sizeof *name, by_bodies);
    if (!any) return;
    const bt_scar *end = any + 1, *own = NULL;
    while (any > t->scars && by_bodies(any - 1, name) == 0) any--;
    while (end < t->scars + t->n_scars && by_bodies(end, name) == 0) end++;
    double deepest = 0;
    for (const bt_scar *s = any; s < end; s++) {
        deepest = bt_max(deepest, bt_max(s->depth[0], s->n > 1 ? s->depth[1] : 0));
        if (by_gids(s, name) == 0) own = s;
    }
    if (own) l->scar = (int32_t)(own - t->scars);
    for (int i = 0; i < m->n_points; i++) {
        l->depth[i] = bt_min(deepest, bt_max(0, -m->p[i].gap));
        for (int j = 0; own && j < own->n; j++)
            if (own->feature[j] == m->p[i].feature) l->depth[i] = own->depth[j];
    }
}

void bt_crush_fill(const bt_world *w, bt_tile *t, bt_idx j, const bt_pair *p, const bt_manifold *m)
{
    const bt_bodies *s = &w->bodies;
    const bt_unit *u = &t->units[j];
    bt_gaps *g = &t->gaps[j];
    bt_limit *l = &t->limits[j];
    *l = (bt_limit){.flat = {INFINITY, INFINITY}, .most = {INFINITY, INFINITY}, .scar = -1};
    const double h = thickness_of(s, m->a, m->b), dt = w->par.dt;
    if (h > 0) {
        const bt_scar name = {.a = s->gid[m->a], .b = s->gid[m->b], .part = {p->part[0], p->part[1]}};
        inherit(t, &name, m, l);
    }
    double gap = INFINITY, approach = 0;
    for (int i = 0; i < m->n_points; i++) {
        g->gap[i] += l->depth[i];
        l->place[i] = bt_max(g->gap[i], 0) / dt;
        gap = bt_min(gap, bt_max(g->gap[i], 0));
        const double before = bt_normal_velocity(u, i, &s->vel_start[m->a], &s->vel_start[m->b]);
        approach = bt_max(approach, -bt_min(before, bt_normal_velocity(u, i, &s->vel_free[m->a], &s->vel_free[m->b])));
    }
    if (!(h > 0)) return;
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

double bt_crush_overlap(const bt_tile *t)
{
    // 0 − gap, not −gap: a contact that just touches must not make the deepest overlap −0 on the one rank that holds it alone.
    double deepest = 0;
    for (bt_idx j = 0; j < t->n_units; j++)
        for (int i = 0; i < t->units[j].n; i++) deepest = bt_max(deepest, 0 - t->gaps[j].gap[i]);
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
        const bt_pair *p = &t->pairs[t->gaps[j].pair];
        bt_scar s = {.a = gid[u->a], .b = gid[u->b], .part = {p->part[0], p->part[1]}, .n = u->n, .depth = {l->depth[0], l->depth[1]}};
        memcpy(s.feature, p->feature, (size_t)u->n * sizeof *s.feature);
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
    // Pairs that have come to rest against each other have no units.
    const bt_tiles *ts = w->tiles;
    for (bt_idx k = 0; k < ts->n; k++)
        for (bt_idx i = 0; ts->tile[k].own && ts->tile[k].n_units == 0 && i < ts->tile[k].n_scars; i++)
            for (int j = 0; j < ts->tile[k].scars[i].n; j++) t.most = bt_max(t.most, ts->tile[k].scars[i].depth[j]);
    bt_domain_maxima(w, &t.most, 1);
    st->crushed_depth = t.most;
}
