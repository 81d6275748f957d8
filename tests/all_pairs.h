// SPDX-License-Identifier: MIT
// Reference for the detection of contacts: bodies at rest included, and by testing all pairs.
#ifndef BT_ALL_PAIRS_H
#define BT_ALL_PAIRS_H

#include "scene.h"
#include "contact/contacts.h"

/// Detect the contacts of all bodies within the margin, at rest or not.
static inline void detect_all(bt_world *w, double margin)
{
    bt_cells_begin(w);
    bt_cells_update(w, margin);
    bt_cells_wake_all(w->cells);
    // A speed with the margin asked for; a margin already rounded must not be rounded up again.
    for (bt_idx k = 0; k < w->cells->n; k++)
        w->cells->bound[k] = bt_max(0.4 * margin / w->par.dt, 1e-300);
    bool movable = false;
    for (bt_idx l = w->cells->n_in_cells; l < w->bodies.n; l++) movable = movable || w->bodies.motion[l] == BT_DYNAMIC;
    if (!movable) w->cells->bound[w->cells->n - 1] = 0;
    bt_contacts_detect(w, false);
}

/// All manifolds by testing all pairs, in the order of gids.
static inline void brute_force(const bt_world *w, double margin, bt_manifold **man, bt_idx *n_man)
{
    const bt_bodies *b = &w->bodies;
    bt_idx cap = 64;
    *man = bt_alloc((size_t)cap, sizeof **man);
    *n_man = 0;
    for (bt_gid g = 0; g < b->n_global; g++)
        for (bt_gid h = g + 1; h < b->n_global; h++) {
            const bt_idx i = bt_world_index(w, g), j = bt_world_index(w, h);
            if (b->motion[i] != BT_DYNAMIC && b->motion[j] != BT_DYNAMIC) continue;
            for (int p = bt_part_first(b, i); p >= 0; p = bt_part_next(b, i, p))
                for (int q = bt_part_first(b, j); q >= 0; q = bt_part_next(b, j, q)) {
                    if (*n_man == cap) *man = bt_realloc(*man, (size_t)(cap *= 2), sizeof **man);
                    if (bt_contacts_parts(w, i, j, (uint16_t[]){(uint16_t)p, (uint16_t)q}, margin, -1, &(*man)[*n_man],
                                          NULL))
                        ++*n_man;
                }
        }
    bt_merge_parts(w, *man, (size_t)*n_man);
    bt_idx kept = 0;
    for (bt_idx k = 0; k < *n_man; k++)
        if ((*man)[k].n_points > 0) (*man)[kept++] = (*man)[k];
    *n_man = kept;
}

#endif
