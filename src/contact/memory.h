// SPDX-License-Identifier: MIT
// What contact laws remember of a pair: one named record a law (bt_trace, space/tiles.h), found and written by name.
#ifndef BERGTOW_CONTACT_MEMORY_H
#define BERGTOW_CONTACT_MEMORY_H

#include "space/tiles.h"

/// Record of the pair of names.a, b, part, law in tile t, −1 = none.
bt_idx bt_law_find(const bt_tile *t, const bt_trace *names);

/// Write record r: over the one at `at`, or, −1, as a new one; new ones are in their order after bt_laws_grow.
void bt_law_put(bt_tile *t, bt_idx at, const bt_trace *r);

/// Names of the record that a law has, or would have, of pair p.
static inline bt_trace bt_law_names(const bt_world *w, const bt_pair *p, int law)
{
    const bt_gid *gid = w->bodies.gid;
    return (bt_trace){.a = gid[p->a], .b = gid[p->b], .part = {p->part[0], p->part[1]}, .law = (uint16_t)law};
}

#endif
