// SPDX-License-Identifier: MIT
// Rows of pairs that pass each other are released, and come back where the pair meets; contacts.h.
#include "contact/contacts.h"

#include "contact/pack.h"
#include "contact/row.h"
#include "geometry/polygons.h"
#include "partition/domain.h"
#include "space/phases.h"
#include "space/shore.h"

/// Part `part` of body i, as bt_contacts_parts sees it.
static bt_moving moving_part(const bt_bodies *b, bt_idx i, int part, const bt_vel *v)
{
    const int64_t first = b->offset[i] + part;
    return (bt_moving){b->mark[first].count, b->outline + 2 * first, v->x, v->y, v->w};
}

/// Is pair p of the same bodies as contact u, or of another piece of the same shore?
static bool of_same_outlines(const bt_world *w, const bt_pair *p, const bt_contact *u)
{
    return (p->a == u->a || (bt_shore_holds(w, p->a) && bt_shore_holds(w, u->a))) &&
           (p->b == u->b || (bt_shore_holds(w, p->b) && bt_shore_holds(w, u->b)));
}

/// Do the bodies of contact u meet if they bear no load on each other, and all others as they do? All of their parts
/// and pieces nearby count: where several touch at one place, one row stands for all (detect.c).
static bool meet_without(const bt_world *w, const bt_cell *t, const bt_contact *u)
{
    const bt_bodies *b = &w->bodies;
    const bt_pair *pairs = t->search.pairs;
    bt_vel va = b->vel[u->a], vb = b->vel[u->b];
    bt_apply(u, -(u->ln[0] + u->ln[1]), -(u->ln[0] * u->ran[0] + u->ln[1] * u->ran[1]),
             -(u->ln[0] * u->rbn[0] + u->ln[1] * u->rbn[1]), -u->lt, b->inv[u->a], b->inv[u->b], &va, &vb);
    bt_idx first = u->pair, end = u->pair + 1; // the list is in the order of gids
    if (bt_shore_holds(w, u->a) || bt_shore_holds(w, u->b)) first = 0, end = t->search.n_pairs;
    while (first > 0 && of_same_outlines(w, &pairs[first - 1], u)) first--;
    while (end < t->search.n_pairs && of_same_outlines(w, &pairs[end], u)) end++;
    for (bt_idx i = first; i < end; i++) {
        if (!of_same_outlines(w, &pairs[i], u)) continue;
        double d[2];
        bt_bodies_offset(w, pairs[i].a, pairs[i].b, d);
        const bt_moving p = moving_part(b, pairs[i].a, pairs[i].part[0], &va),
                        q = moving_part(b, pairs[i].b, pairs[i].part[1], &vb);
        if (bt_sweep_meets(&p, &q, d[0], d[1], w->par.slop, w->par.dt)) return true;
    }
    return false;
}

static void review_cell(bt_world *w, bt_idx k, const void *context, bt_totals *totals)
{
    const bool release = *(const bool *)context;
    bt_cell *t = &w->cells->cell[k];
    int changed = 0;
    for (bt_idx j = 0; j < t->n_contacts; j++) {
        const bt_contact *u = &t->contacts[j];
        const bool released = t->gaps[j].row == BT_ROW_RELEASED;
        if (t->gaps[j].row == BT_ROW_STAYS || (!released && u->ln[0] == 0 && u->ln[1] == 0)) continue;
        if (meet_without(w, t, u) != released) continue;
        if (released) bt_pack_set_row(w, t, j, BT_ROW_STAYS);
        else if (release) bt_pack_set_row(w, t, j, BT_ROW_RELEASED);
        changed++;
    }
    if (changed > 0) bt_sum_add(&totals->sum[0], changed);
}

int64_t bt_passing_review(bt_world *w, bool release)
{
    bt_totals t = {.n_sums = 1};
    bt_phases_any_order(w, review_cell, &release, &t);
    bt_domain_reduce(w, &t);
    return (int64_t)bt_sum_value(&t.sum[0]);
}
