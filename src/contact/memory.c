// SPDX-License-Identifier: MIT
// Records of contact laws in the memory of a cell; contact/law.h.
#include <stdlib.h>

#include "contact/contacts.h"
#include "contact/law.h"

bool bt_law_near(const bt_world *w, const bt_memory *r)
{
    const bt_idx a = bt_world_index(w, r->a), b = bt_world_index(w, r->b);
    bt_manifold m;
    return a >= 0 && b >= 0 && bt_contacts_parts(w, a, b, r->part, BT_LAW_MEMORY * w->par.size, -1, &m, NULL);
}

bt_idx bt_law_find(const bt_cell *t, const bt_memory *names)
{
    if (t->laws.n_memory == 0) return -1;
    const bt_memory *r = bsearch(names, t->laws.memory, (size_t)t->laws.n_memory, sizeof *names, bt_memory_by_names);
    return r ? (bt_idx)(r - t->laws.memory) : -1;
}

void bt_law_put(bt_cell *t, bt_idx at, const bt_memory *r)
{
    if (at >= 0) t->laws.memory[at] = *r;
    else bt_cells_remember(t, r);
}
