// SPDX-License-Identifier: MIT
// The table of contact laws, and what is the same for all of them; contact/law.h.
#include "contact/law.h"

#include <math.h>
#include <stdlib.h>

#include "contact/crush.h"
#include "partition/domain.h"
#include "solve/kernel.h"

const bt_law bt_laws[BT_LAWS] = {
    [BT_LAW_RIGID] = {.name = "rigid", .what = "a contact bears any load"},
    [BT_LAW_CRUSHING] = {.name = "crushing", .keys = "ice.crushing", .on = bt_crush_on,
                         .what = "ice bears a pressure, and what cannot be borne is crushed", .applies = bt_crush_applies,
                         .bound = bt_crush_bound, .keeps = bt_crush_keeps, .gives_way = bt_crush_gives_way,
                         .give_way = bt_crush_give_way, .remember = bt_crush_remember, .depth = bt_crush_depth},
};

bool bt_law_on(const bt_params *p, int law) { return bt_laws[law].on && bt_laws[law].on(p); }

bool bt_laws_on(const bt_params *p)
{
    for (int law = 0; law < BT_LAWS; law++)
        if (bt_law_on(p, law)) return true;
    return false;
}

// --- memory ----------------------------------------------------------------------------------------------------------

void bt_laws_prune(const bt_world *w, bt_tile *t)
{
    bt_idx kept = 0;
    for (bt_idx k = 0; k < t->n_memory; k++)
        if (bt_laws[t->memory[k].law].keeps(w, &t->memory[k])) t->memory[kept++] = t->memory[k];
    t->n_memory = kept;
}

bt_idx bt_law_find(const bt_tile *t, const bt_trace *names)
{
    if (t->n_memory == 0) return -1;
    const bt_trace *r = bsearch(names, t->memory, (size_t)t->n_memory, sizeof *names, bt_trace_by_names);
    return r ? (bt_idx)(r - t->memory) : -1;
}

void bt_law_put(bt_tile *t, bt_idx at, const bt_trace *r)
{
    if (at >= 0) t->memory[at] = *r;
    else bt_tiles_remember(t, r);
}

// --- bounds ----------------------------------------------------------------------------------------------------------

void bt_laws_reserve(bt_tile *t)
{
    if (t->n_units <= t->cap_limits) return;
    t->cap_limits = t->n_units + t->n_units / 4;
    free(t->limits);
    t->limits = bt_alloc_aligned((size_t)t->cap_limits, sizeof *t->limits);
}

void bt_laws_bound(const bt_world *w, bt_tile *t, bt_idx j, const bt_pair *p, const bt_manifold *m)
{
    bt_limit *l = &t->limits[j];
    *l = (bt_limit){.flat = {INFINITY, INFINITY}, .most = {INFINITY, INFINITY}};
    for (int law = 0; law < BT_LAWS; law++) {
        l->trace[law] = -1;
        if (bt_law_on(&w->par, law) && bt_laws[law].applies(w, m->a, m->b)) bt_laws[law].bound(w, t, j, p, m);
    }
    for (int i = 0; i < m->n_points; i++) l->place[i] = bt_max(t->gaps[j].gap[i], 0) / w->par.dt;
}

double bt_laws_overlap(const bt_tile *t)
{
    // 0 − gap, not −gap: a contact that just touches must not make the deepest overlap −0 on the one rank that holds it alone.
    double deepest = 0;
    for (bt_idx j = 0; j < t->n_units; j++)
        for (int i = 0; i < t->units[j].n; i++) deepest = bt_max(deepest, 0 - t->gaps[j].gap[i]);
    return deepest;
}

// --- growth ----------------------------------------------------------------------------------------------------------

/// Where each number of a step comes from.
static void tell(bt_step_stats *st, const bt_totals *t)
{
    st->crushed_work = bt_sum_value(&t->sum[BT_CRUSHED_WORK]);
    st->n_crushing = (int64_t)bt_sum_value(&t->sum[BT_CRUSHING_POINTS]);
}

static void grow_unit(bt_world *w, bt_tile *t, bt_idx j, bt_totals *totals)
{
    const bt_unit *u = &t->units[j];
    const bt_vel *v = w->bodies.vel;
    bt_limit *l = &t->limits[j];
    for (int i = 0; i < u->n; i++) {
        const double approach = -(bt_normal_velocity(u, i, &v[u->a], &v[u->b]) + l->place[i]);
        if (!(approach > 0)) continue;
        int law = BT_LAWS - 1;
        while (law > BT_LAW_RIGID && !bt_laws[law].gives_way(u, l, i)) law--;
        if (law == BT_LAW_RIGID) continue;
        l->grown[i] = w->par.dt * approach;
        bt_laws[law].give_way(w, t, j, i, totals);
    }
}

static void grow_tile(bt_world *w, bt_idx k, const void *context, bt_totals *totals)
{
    (void)context;
    bt_tile *t = &w->tiles->tile[k];
    const bt_idx before = t->n_memory;
    for (bt_idx j = 0; j < t->n_units; j++) {
        grow_unit(w, t, j, totals);
        for (int law = 0; law < BT_LAWS; law++)
            if (bt_law_on(&w->par, law)) totals->most = bt_max(totals->most, bt_laws[law].remember(w, t, j));
    }
    if (t->n_memory > before) qsort(t->memory, (size_t)t->n_memory, sizeof *t->memory, bt_trace_by_names);
}

void bt_laws_grow(bt_world *w)
{
    bt_step_stats *st = &w->stats;
    bt_totals t = {.n_sums = BT_LAW_SUMS};
    st->crushed_depth = 0;
    if (bt_laws_on(&w->par)) {
        bt_phases_any_order(w, grow_tile, NULL, &t);
        bt_domain_reduce(w, &t);
        // Pairs that have come to rest against each other have no units.
        const bt_tiles *ts = w->tiles;
        for (bt_idx k = 0; k < ts->n; k++)
            for (bt_idx i = 0; ts->tile[k].own && ts->tile[k].n_units == 0 && i < ts->tile[k].n_memory; i++)
                t.most = bt_max(t.most, bt_laws[ts->tile[k].memory[i].law].depth(&ts->tile[k].memory[i]));
        bt_domain_maxima(w, &t.most, 1);
        st->crushed_depth = t.most;
    }
    tell(st, &t);
}
