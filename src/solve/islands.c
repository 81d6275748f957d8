// SPDX-License-Identifier: MIT
// Union-find over contacts; names and sums over ranks: partition/share.c.
#include "solve/islands.h"

#include <stdlib.h>

#include "partition/domain.h"

bt_islands *bt_islands_create(void) { return bt_alloc(1, sizeof(bt_islands)); }

void bt_islands_free(bt_islands *s)
{
    if (!s) return;
    free(s->root);
    free(s->name);
    free(s->share);
    free(s->sum);
    free(s);
}

/// With path halving.
bt_idx bt_islands_root(bt_islands *s, bt_idx i)
{
    while (s->root[i] != i) i = s->root[i] = s->root[s->root[i]];
    return i;
}

bt_idx bt_islands_of(const bt_world *w, bt_islands *s, const bt_contact *u)
{
    return bt_islands_root(s, w->bodies.inv[u->a].m > 0 ? u->a : u->b);
}

static void make_room(const bt_bodies *b, bt_islands *s)
{
    if (b->n > s->cap) {
        s->cap = b->n;
        s->root = bt_realloc(s->root, (size_t)b->n, sizeof *s->root);
        s->name = bt_realloc(s->name, (size_t)b->n, sizeof *s->name);
        s->share = bt_realloc(s->share, (size_t)b->n, sizeof *s->share);
        s->sum = bt_realloc(s->sum, (size_t)b->n, sizeof *s->sum);
    }
    for (bt_idx i = 0; i < b->n; i++) {
        s->root[i] = i;
        s->name[i] = b->gid[i];
        s->share[i] = 1;
    }
}

void bt_islands_make(bt_world *w, bt_islands *s, bool (*joins)(const bt_cell *cell, bt_idx contact))
{
    const bt_cells *ts = w->cells;
    const bt_bodies *b = &w->bodies;
    make_room(b, s);
    for (bt_idx i = 0; i < ts->n_order; i++) {
        const bt_cell *cell = &ts->cell[ts->order[i]];
        for (bt_idx j = 0; j < cell->n_contacts; j++) {
            const bt_contact *u = &cell->contacts[j];
            if (b->inv[u->a].m == 0 || b->inv[u->b].m == 0 || (joins && !joins(cell, j))) continue;
            s->root[bt_islands_root(s, u->b)] = bt_islands_root(s, u->a);
        }
    }
    if (!w->domain) return;
    bt_gid *name = bt_alloc((size_t)b->n, sizeof *name);
    for (bt_idx i = 0; i < b->n; i++) name[i] = s->name[bt_islands_root(s, i)];
    bt_domain_join_names(w, name);
    for (bt_idx i = 0; i < b->n; i++)
        if (s->root[i] == i) s->name[i] = name[i];
    free(name);
}

void bt_islands_clear(const bt_world *w, bt_islands *s)
{
    for (bt_idx i = 0; i < w->bodies.n; i++) s->sum[i] = (bt_sum){0};
}

void bt_islands_add(const bt_world *w, bt_islands *s)
{
    if (w->domain) bt_domain_add_by_name(w, s->root, s->name, s->sum);
}
