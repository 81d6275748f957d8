// SPDX-License-Identifier: MIT
// Islands of touching bodies, over ranks too, and the work of their contacts.
//
// An island is named by the gid of a body in it, that of its root. Where islands of several ranks meet in a body that
// both hold, the names belong together: every rank gathers these few (name here, name there) links and joins them by
// the same union-find; works of islands that reach over ranks are added as exact sums, so it does not matter which of
// its bodies names an island.
#include "solve/restitution.h"

#include <math.h>
#include <stdlib.h>

#include "solve/solver.h"
#include "bergtow/sum.h"
#include "space/cells.h"
#include "partition/domain.h"
#include "contact/work.h"
#include "contact/pack.h"

typedef struct bt_islands {
    bt_idx *root;    ///< [n bodies] union-find of the movable bodies that touch
    bt_gid *name;    ///< [n bodies] at the roots: gid of a body of the island, the same on all ranks
    double *share;   ///< [n bodies] at the roots: factor on the restitution
    bt_sum *surplus; ///< [n bodies] at the roots: work of the island's contacts on this rank, less what is allowed, J
    bt_idx cap;
} islands;

islands *bt_islands_create(void) { return bt_alloc(1, sizeof(islands)); }

void bt_islands_free(islands *s)
{
    if (!s) return;
    free(s->root);
    free(s->name);
    free(s->share);
    free(s->surplus);
    free(s);
}

/// Representative of body i (union-find with path halving).
static bt_idx root_of(islands *s, bt_idx i)
{
    while (s->root[i] != i) i = s->root[i] = s->root[s->root[i]];
    return i;
}

static bt_idx island_of(const bt_world *w, const bt_contact *u)
{
    return root_of(w->solver->islands, w->bodies.inv[u->a].m > 0 ? u->a : u->b);
}

bool bt_restitution_begin(bt_world *w)
{
    const bt_cells *ts = w->cells;
    const bt_bodies *b = &w->bodies;
    islands *s = w->solver->islands;
    if (!ts->rebounds) return false;
    double any = 0;
    for (bt_idx k = 0; k < ts->n && any == 0; k++)
        for (bt_idx i = 0; i < ts->cell[k].n_contacts && any == 0; i++)
            any = b->restitution[ts->cell[k].contacts[i].b] > 0;
    bt_domain_maxima(w, &any, 1);
    if (any == 0) return false;
    // Contacts of an earlier detection in this step may still have the lowered restitution of its solution.
    for (bt_idx k = 0; k < ts->n; k++)
        for (bt_idx i = 0; i < ts->cell[k].n_contacts; i++)
            bt_pack_bias(w, &ts->cell[k].contacts[i], &ts->cell[k].gaps[i], 1);

    if (b->n > s->cap) {
        s->cap = b->n;
        s->root = bt_realloc(s->root, (size_t)b->n, sizeof *s->root);
        s->name = bt_realloc(s->name, (size_t)b->n, sizeof *s->name);
        s->share = bt_realloc(s->share, (size_t)b->n, sizeof *s->share);
        s->surplus = bt_realloc(s->surplus, (size_t)b->n, sizeof *s->surplus);
    }
    for (bt_idx i = 0; i < b->n; i++) {
        s->root[i] = i;
        s->name[i] = b->gid[i];
        s->share[i] = 1;
    }
    for (bt_idx k = 0; k < ts->n; k++)
        for (bt_idx j = 0; j < ts->cell[k].n_contacts; j++) {
            const bt_contact *u = &ts->cell[k].contacts[j];
            if (b->inv[u->a].m == 0 || b->inv[u->b].m == 0) continue;
            s->root[root_of(s, u->b)] = root_of(s, u->a);
        }
    if (w->domain) {
        bt_gid *name = bt_alloc((size_t)b->n, sizeof *name);
        for (bt_idx i = 0; i < b->n; i++) name[i] = s->name[root_of(s, i)];
        bt_domain_join_names(w, name);
        for (bt_idx i = 0; i < b->n; i++)
            if (s->root[i] == i) s->name[i] = name[i];
        free(name);
    }
    return true;
}

bool bt_restitution_lower(bt_world *w)
{
    const bt_cells *ts = w->cells;
    const bt_bodies *b = &w->bodies;
    islands *s = w->solver->islands;
    const double allowed = w->stats.residual + 1e-12;
    for (bt_idx i = 0; i < b->n; i++) s->surplus[i] = (bt_sum){0};
    for (bt_idx k = 0; k < ts->n; k++)
        for (bt_idx j = 0; j < ts->cell[k].n_contacts; j++) {
            const bt_contact *u = &ts->cell[k].contacts[j];
            const double normal = u->ln[0] + u->ln[1];
            if (normal == 0 || u->n == 0) continue; // what sheets take must not cover what rebounds give
            bt_sum_add(&s->surplus[island_of(w, u)], bt_contacts_work(w, u) - allowed * (normal + fabs(u->lt)));
        }
    if (w->domain) bt_domain_add_by_name(w, s->root, s->name, s->surplus);
    double any = 0;
    for (bt_idx i = 0; i < b->n; i++) {
        if (s->root[i] != i || s->share[i] == 0 || !(bt_sum_value(&s->surplus[i]) > 0)) continue;
        s->share[i] = s->share[i] > 0.2 ? 0.5 * s->share[i] : 0;
        any = 1;
    }
    bt_domain_maxima(w, &any, 1);
    if (any == 0) return false;
    for (bt_idx k = 0; k < ts->n; k++)
        for (bt_idx j = 0; j < ts->cell[k].n_contacts; j++) {
            bt_contact *u = &ts->cell[k].contacts[j];
            const double share = s->share[island_of(w, u)];
            if (share < 1) bt_pack_bias(w, u, &ts->cell[k].gaps[j], share);
        }
    return true;
}
