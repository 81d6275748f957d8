// SPDX-License-Identifier: MIT
// Contact detection of one step: pair list, narrow phase where needed, manifolds with last step's impulses.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "bergtow/contacts.h"
#include "pairs.h"

bt_contacts *bt_contacts_create(void) { return bt_alloc(1, sizeof(bt_contacts)); }

void bt_contacts_free(bt_contacts *c)
{
    if (!c) return;
    void *arrays[] = {c->pairs,     c->man,     c->man_before, c->path_built, c->pairs_before, c->cell_start,
                      c->cell_item, c->cell_of, c->large_head, c->large_next, c->large_item,   c->box};
    for (size_t i = 0; i < sizeof arrays / sizeof *arrays; i++) free(arrays[i]);
    free(c);
}

double bt_contacts_margin(const bt_world *w, const bt_vel *v)
{
    const bt_bodies *b = &w->bodies;
    double fastest = 0;
    for (bt_idx i = 0; i < b->n; i++)
        fastest = bt_max(fastest, sqrt(v[i].x * v[i].x + v[i].y * v[i].y) + b->radius[i] * fabs(v[i].w));
    const double least = 2 * w->par.dt * fastest;
    if (!(least > w->par.slop)) return w->par.slop;
    return exp2(0.5 * ceil(2 * log2(least)));
}

static bt_manifold *next_manifold(bt_contacts *c)
{
    if (c->n_man == c->cap_man) {
        c->cap_man = c->cap_man ? c->cap_man + c->cap_man / 2 : 1024;
        c->man = bt_realloc(c->man, (size_t)c->cap_man, sizeof *c->man);
    }
    return &c->man[c->n_man];
}

static void inherit_impulses(bt_manifold *m, const bt_manifold *before)
{
    for (int i = 0; i < m->n_points; i++)
        for (int j = 0; j < before->n_points; j++)
            if (before->p[j].feature == m->p[i].feature) {
                m->p[i].ln = before->p[j].ln;
                m->p[i].lt = before->p[j].lt;
            }
}

void bt_contacts_detect(bt_world *w, double margin)
{
    bt_contacts *c = w->contacts;
    const bt_bodies *b = &w->bodies;
    c->margin = margin;
    bt_pairs_update(w, margin);

    bt_manifold *swap = c->man_before;
    bt_idx cap = c->cap_man_before;
    c->man_before = c->man, c->n_man_before = c->n_man, c->cap_man_before = c->cap_man;
    c->man = swap, c->cap_man = cap, c->n_man = 0;
    c->n_points = 0;
    c->overlap = 0;
    for (bt_idx k = 0; k < c->n_pairs; k++) {
        bt_pair *p = &c->pairs[k];
        double paths = b->path[p->a] + b->path[p->b], gap;
        if (paths + margin < p->reach) {
            p->man = -1;
            continue;
        }
        const bt_manifold *before = p->man >= 0 ? &c->man_before[p->man] : NULL;
        bt_manifold *m = next_manifold(c);
        bool near = bt_contacts_pair(w, p->a, p->b, margin, before, m, &gap, &p->axis);
        p->reach = gap + paths;
        p->man = -1;
        if (!near) continue;
        if (before) inherit_impulses(m, before);
        p->man = c->n_man++;
        c->n_points += m->n_points;
        for (int i = 0; i < m->n_points; i++) c->overlap = bt_max(c->overlap, -m->p[i].gap);
    }
}

void bt_contacts_brute_force(const bt_world *w, double margin, bt_manifold **man, bt_idx *n_man)
{
    const bt_bodies *b = &w->bodies;
    bt_idx cap = 64;
    *man = bt_alloc((size_t)cap, sizeof **man);
    *n_man = 0;
    for (bt_idx i = 0; i < b->n; i++)
        for (bt_idx j = i + 1; j < b->n; j++) {
            if (b->motion[i] != BT_DYNAMIC && b->motion[j] != BT_DYNAMIC) continue;
            if (*n_man == cap) *man = bt_realloc(*man, (size_t)(cap *= 2), sizeof **man);
            double gap;
            int32_t axis = -1;
            if (bt_contacts_pair(w, i, j, margin, NULL, &(*man)[*n_man], &gap, &axis)) ++*n_man;
        }
}

double bt_world_overlap(bt_world *w)
{
    bt_contacts *c = w->contacts;
    bt_pairs_update(w, bt_max(c->margin, w->par.slop));
    double deepest = 0;
    for (bt_idx k = 0; k < c->n_pairs; k++) {
        const bt_pair *p = &c->pairs[k];
        bt_manifold m;
        double gap;
        int32_t axis = p->axis;
        if (!bt_contacts_pair(w, p->a, p->b, 0, NULL, &m, &gap, &axis)) continue;
        for (int i = 0; i < m.n_points; i++) deepest = bt_max(deepest, -m.p[i].gap);
    }
    return deepest;
}
