// SPDX-License-Identifier: MIT
// Bounds of the contacts from their geometry, and what crushing leaves behind; equations in contact/crush.h.
#include "contact/crush.h"
#include "case/warning.h"

#include <math.h>
#include <stdlib.h>

#include "contact/overlap.h"
#include "contact/row.h"
#include "contact/work.h"

// Of the mean floe size: the contact length is linear over the approach of the step, or over this.
#define LEAST_WAY 0.01
#define MOST_DEPTH 0.3 // of the mean floe size: beyond, outlines that stay as they were are no model

// --- numbers ---------------------------------------------------------------------------------------------------------

enum { CRUSHING, CRUSHED_WORK, CRUSHED_DEPTH };
static const bt_law_number numbers[] = {
    [CRUSHING] = {"crushing", "1",
                  "contact points that crush: their normal force is at the limit pressure x thickness x length",
                  BT_KEEP_MEAN, .key = "max_crushing_contacts"},
    [CRUSHED_WORK] = {"crushed_work", "J", "work taken by contact points that crush", BT_KEEP_SUM,
                      .key = "crushed_work_j"},
    [CRUSHED_DEPTH] = {"crushed_depth", "m",
                       "deepest crush of a pair of bodies that touch, or touched and are still near", BT_KEEP_MAX,
                       .largest = true, .key = "max_crushed_depth_m"},
};

enum { WORK, DEPTH, STEPS, MOST };
static const bt_law_total totals[] = {
    [WORK] = {CRUSHED_WORK, BT_TOTAL_SUM, "crushed_work", .key = "crushed_work_j", .units = "J",
              .description = "work taken by contact points that crush"},
    [DEPTH] = {CRUSHED_DEPTH, BT_TOTAL_MAX, "max_crushed_depth", .key = "max_crushed_depth_m", .units = "m",
               .description = "deepest crush of a pair of bodies"},
    [STEPS] = {CRUSHING, BT_TOTAL_STEPS, "crushing_steps", .key = "crushing_steps", .units = "1",
               .description = "steps with contact points that crush"},
    [MOST] = {CRUSHING, BT_TOTAL_MAX, "max_crushing", .key = "max_crushing_contacts", .units = "1",
              .description = "most of them at once"},
};

static void setup(const bt_case *c, double own[BT_MAX_CONTACT_OWN])
{
    own[BT_CRUSH_PRESSURE] = c->ice.crushing_pressure;
    own[BT_CRUSH_LEAST] = c->ice.crushing_least;
}

static bool on(const double *own) { return own[BT_CRUSH_PRESSURE] > 0; }

static char *check(const bt_case *c, double thickness, double size)
{
    if (!(c->ice.crushing_pressure > 0)) return NULL;
    const double line = c->ice.crushing_pressure * thickness;
    return bt_text_of(
        "crushing             %.4g N per m of contact, %.4g N at the first touch; a mean floe's width bears %.4g N\n",
        line, line * c->ice.crushing_least * thickness, line * size);
}

static char *result(const bt_case *c, const bt_total_value *total, double ice_area)
{
    (void)ice_area;
    if (!(c->ice.crushing_pressure > 0)) return NULL;
    return bt_text_of(
        "  crushed             %.4g J in %lld steps, at most %.0f contact points at once, deepest %.3g m\n",
        total[WORK].real, (long long)total[STEPS].whole, total[MOST].real, total[DEPTH].real);
}

static void warn(const bt_total_value *total, double size, bt_errors *warnings)
{
    const double depth = total[DEPTH].real;
    if (depth <= MOST_DEPTH * size) return;
    bt_warn(warnings, BT_WARN_CRUSHED,
            "floes were crushed to a depth of %.2g m, %.0f %% of the mean floe size: outlines and masses stay as they "
            "were, which is no model of that",
            depth, 100 * depth / size);
}

/// Thickness that is crushed when a and b are pressed together, m; 0 = neither is ice.
static double thickness_of(const bt_bodies *s, bt_idx a, bt_idx b)
{
    const double ha = s->thickness[a], hb = s->thickness[b];
    return ha > 0 && hb > 0 ? bt_min(ha, hb) : bt_max(ha, hb);
}

static bool applies(const bt_world *w, bt_idx a, bt_idx b) { return thickness_of(&w->bodies, a, b) > 0; }

// --- memory ----------------------------------------------------------------------------------------------------------

enum { UNSEEN = 2 }; // value[UNSEEN + i]: 1 = point i was not found when the record was written: as deep as before

static bool keeps(const bt_world *w, bt_memory *r) { return bt_law_near(w, r); }

static double depth_of(const bt_memory *r) { return bt_max(r->value[0], r->n_points > 1 ? r->value[1] : 0); }

static double count(const bt_world *w, const bt_memory *r, bt_sum *number)
{
    (void)w, (void)number;
    return depth_of(r);
}

static int by_bodies(const void *p, const void *q)
{
    const bt_memory *a = p, *b = q;
    if (a->a != b->a) return a->a < b->a ? -1 : 1;
    return a->b < b->b ? -1 : a->b > b->b;
}

/// Depth of each point from what the two bodies have crushed before, in these parts or in others: contact that moves on
/// from part to part is sliding. So is a point that comes back into sight: meanwhile they may have crushed each other
/// deeper under another name.
static void inherit(const bt_cell *t, const bt_memory *names, const bt_manifold *m, bt_limit *l)
{
    if (t->laws.n_memory == 0) return;
    const bt_memory *any = bsearch(names, t->laws.memory, (size_t)t->laws.n_memory, sizeof *names, by_bodies);
    if (!any) return;
    const bt_memory *end = any + 1, *own = NULL;
    while (any > t->laws.memory && by_bodies(any - 1, names) == 0) any--;
    while (end < t->laws.memory + t->laws.n_memory && by_bodies(end, names) == 0) end++;
    double deepest = 0;
    for (const bt_memory *s = any; s < end; s++) {
        if (s->law != BT_LAW_CRUSHING) continue;
        deepest = bt_max(deepest, depth_of(s));
        if (bt_memory_by_names(s, names) == 0) own = s;
    }
    if (own) l->record[BT_LAW_CRUSHING] = (int32_t)(own - t->laws.memory);
    for (int i = 0; i < m->n_points; i++) {
        l->rise->depth[i] = bt_min(deepest, bt_max(0, -m->p[i].gap));
        for (int j = 0; own && j < own->n_points; j++)
            if (own->feature[j] == m->p[i].feature)
                l->rise->depth[i] =
                    own->value[UNSEEN + j] > 0 ? bt_max(own->value[j], l->rise->depth[i]) : own->value[j];
    }
}

// --- geometry --------------------------------------------------------------------------------------------------------

static void bound(const bt_world *w, bt_cell *t, bt_idx j, const bt_pair *p, const bt_manifold *m)
{
    const bt_bodies *s = &w->bodies;
    const bt_contact *u = &t->contacts[j];
    bt_gaps *g = &t->gaps[j];
    bt_limit *l = &t->laws.limits[j];
    const double h = thickness_of(s, m->a, m->b), dt = w->par.dt, *own = w->par.law_own[BT_LAW_CRUSHING];
    const bt_mass mass = bt_mass_of(u, s->inv);
    const bt_memory names = bt_law_names(w, p, BT_LAW_CRUSHING);
    // then its edges bear no more than this, and give way as they do when they raft
    const bool rafts = l->record[BT_LAW_RAFTING] >= 0;
    if (!rafts) inherit(t, &names, m, l);
    for (int i = 0; i < m->n_points; i++) g->gap[i] += l->rise->depth[i];
    const bt_closing c = bt_law_closing(w, t, j, m);
    const double per_length = own[BT_CRUSH_PRESSURE] * h * dt, least = own[BT_CRUSH_LEAST] * h / c.n;
    const double way = bt_max(dt * c.approach - c.gap, LEAST_WAY * w->par.size);
    const bt_patch now = bt_law_patch(w, p->part, m, c.gap + w->par.slop),
                then = bt_law_patch(w, p->part, m, c.gap + w->par.slop + way);
    for (int i = 0; i < m->n_points; i++) {
        const double length = now.length * bt_law_share(m, i, now, &c),
                     later = bt_max(length, then.length * bt_law_share(m, i, then, &c));
        l->flat[i] = bt_min(l->flat[i], per_length * bt_max(length, least));
        l->most[i] = bt_min(l->most[i], per_length * bt_max(later, least));
        if (later <= bt_max(length, least)) continue; // as long as it gets
        const double k = own[BT_CRUSH_PRESSURE] * h * (later - length) / way;
        l->rise->base[i] = bt_min(l->flat[i], per_length * length);
        l->rise->slope[i] = k * dt * dt / (1 + sqrt(1 + dt * dt * k * mass.w[i]));
    }
}

// --- growth ----------------------------------------------------------------------------------------------------------

static bool gives_way(const bt_contact *u, const bt_limit *l, int i) { return u->ln[i] >= l->flat[i]; }

static void give_way(bt_world *w, bt_cell *t, bt_idx j, int i, bt_sum *number)
{
    t->laws.limits[j].rise->depth[i] += t->laws.limits[j].grown[i];
    bt_sum_add(&number[CRUSHED_WORK], -bt_contacts_normal_work(w, &t->contacts[j], i));
    bt_sum_add(&number[CRUSHING], 1);
}

/// Where there is room, and the record does not have that feature yet.
static void keep_depth(bt_memory *r, uint32_t feature, double depth, bool unseen)
{
    for (int i = 0; i < r->n_points; i++)
        if (r->feature[i] == feature) return;
    if (r->n_points == 2) return;
    r->feature[r->n_points] = feature, r->value[r->n_points] = depth, r->value[UNSEEN + r->n_points] = unseen;
    r->n_points++;
}

static void remember(bt_world *w, bt_cell *t, bt_idx j, bt_sum *number)
{
    (void)number;
    const bt_contact *u = &t->contacts[j];
    const bt_limit *l = &t->laws.limits[j];
    const bt_idx at = l->record[BT_LAW_CRUSHING];
    if (l->record[BT_LAW_RAFTING] >= 0) return;
    double deepest = 0;
    for (int i = 0; i < u->n; i++) deepest = bt_max(deepest, l->rise->depth[i]);
    if (deepest == 0) return;
    const uint32_t *feature = t->gaps[j].feature;
    bt_memory r = bt_law_names(w, &t->search.pairs[u->pair], BT_LAW_CRUSHING);
    // What is crushed or touches; then crushed points that were not found, as deep as before; then the rest.
    for (int i = 0; i < u->n; i++)
        if (l->rise->depth[i] > 0 || t->gaps[j].gap[i] <= 0) keep_depth(&r, feature[i], l->rise->depth[i], false);
    for (int i = 0; at >= 0 && i < t->laws.memory[at].n_points; i++) {
        const bt_memory *before = &t->laws.memory[at];
        if (before->value[i] > 0) keep_depth(&r, before->feature[i], before->value[i], true);
    }
    for (int i = 0; i < u->n; i++) keep_depth(&r, feature[i], l->rise->depth[i], false);
    bt_law_put(t, at, &r);
}

const bt_law bt_crush_law = {.name = "crushing",
                             .keys = "ice.crushing",
                             .what = "ice bears a pressure, and what cannot be borne is crushed",
                             .setup = setup,
                             .on = on,
                             .rises = true,
                             .numbers = numbers,
                             .n_numbers = sizeof numbers / sizeof *numbers,
                             .totals = totals,
                             .n_totals = sizeof totals / sizeof *totals,
                             .applies = applies,
                             .bound = bound,
                             .keeps = keeps,
                             .gives_way = gives_way,
                             .give_way = give_way,
                             .remember = remember,
                             .count = count,
                             .check = check,
                             .result = result,
                             .warn = warn};
