// SPDX-License-Identifier: MIT
// Memory of a cell's contacts, and contacts that pass to new cells (contact/cell_contacts.h).
#include "contact/cell_contacts.h"

#include <stdlib.h>
#include <string.h>

#include "body/bodies.h"

void bt_cells_make_room(bt_cell *cell, size_t bytes)
{
    if (bytes <= cell->contact_bytes) return;
    free(cell->contacts);
    cell->contact_bytes = bytes + bytes / 32;
    cell->contacts = bt_alloc_unset(cell->contact_bytes, 1);
}

/// Move the contacts to newly allocated memory.
static void move_contacts(bt_cell *cell, size_t bytes)
{
    bt_contact *contacts = bt_alloc_unset(bytes, 1);
    if (cell->n_contacts > 0) memcpy(contacts, cell->contacts, (size_t)cell->n_contacts * sizeof *contacts);
    free(cell->contacts);
    cell->contacts = contacts;
    cell->contact_bytes = bytes;
}

void *bt_cells_after_contacts(bt_cell *cell, size_t bytes)
{
    const size_t own = (size_t)cell->n_contacts * sizeof *cell->contacts;
    if (own + bytes > cell->contact_bytes) move_contacts(cell, own + bytes + (own + bytes) / 32);
    return (char *)cell->contacts + own;
}

void bt_cells_idle(bt_cell *cell)
{
    bt_cells_forget_pairs(cell);
    free(cell->contacts);
    free(cell->gaps);
    free(cell->laws->limits);
    free(cell->laws->rises);
    free(cell->laws->overlaps);
    cell->laws->overlaps = NULL;
    cell->laws->n_overlaps = cell->laws->cap_overlaps = 0;
    cell->contacts = NULL;
    cell->gaps = NULL;
    cell->laws->limits = NULL;
    cell->laws->rises = NULL;
    cell->contact_bytes = 0;
    cell->n_contacts = cell->n_listed = cell->cap_contacts = cell->laws->cap_limits = 0;
    cell->n_points = 0;
    cell->overlap = 0;
}

void bt_cells_empty(bt_cells *cells)
{
    for (bt_idx k = 0; k < cells->n; k++) {
        bt_cells_idle(&cells->cell[k]);
        free(cells->cell[k].laws->memory);
    }
    if (cells->n > 0) free(cells->cell[0].laws);
    cells->n = 0;
}

// --- previous contacts -----------------------------------------------------------------------------------------------

int bt_memory_by_names(const void *p, const void *q)
{
    const bt_memory *a = p, *b = q;
    if (a->a != b->a) return a->a < b->a ? -1 : 1;
    if (a->b != b->b) return a->b < b->b ? -1 : 1;
    if (a->part[0] != b->part[0]) return a->part[0] < b->part[0] ? -1 : 1;
    if (a->part[1] != b->part[1]) return a->part[1] < b->part[1] ? -1 : 1;
    return a->law - b->law;
}

void bt_cells_remember(bt_cell *cell, const bt_memory *memory)
{
    if (cell->laws->n_memory == cell->laws->cap_memory) {
        cell->laws->cap_memory = cell->laws->cap_memory ? 2 * cell->laws->cap_memory : 8;
        cell->laws->memory = bt_realloc(cell->laws->memory, (size_t)cell->laws->cap_memory, sizeof *cell->laws->memory);
    }
    cell->laws->memory[cell->laws->n_memory++] = *memory;
}

static bt_memory memory_of(const bt_gid *gid, const bt_cell *cell, const bt_pair *pair)
{
    const bt_contact *contact = &cell->contacts[pair->contact];
    const bt_gaps *gaps = &cell->gaps[pair->contact];
    return (bt_memory){.a = gid[pair->a], .b = gid[pair->b], .part = {pair->part[0], pair->part[1]},
                       .n_points = contact->n,
                      .feature = {gaps->feature[0], gaps->feature[1]},
                      .value = {contact->ln[0], contact->ln[1], contact->lt}};
}

bt_memory *bt_cells_take_memory(const bt_world *world, int64_t *n)
{
    const bt_cells *cells = world->cells;
    int64_t cap = 0;
    for (bt_idx k = 0; k < cells->n; k++) {
        for (bt_idx i = 0; cells->cell[k].own && i < cells->cell[k].search.n_pairs; i++)
            cap += cells->cell[k].search.pairs[i].contact >= 0;
        if (cells->cell[k].own) cap += cells->cell[k].laws->n_memory;
    }
    bt_memory *memory = bt_alloc((size_t)cap, sizeof *memory);
    *n = 0;
    for (bt_idx k = 0; k < cells->n; k++) {
        const bt_cell *cell = &cells->cell[k];
        for (bt_idx i = 0; cell->own && i < cell->laws->n_memory; i++) memory[(*n)++] = cell->laws->memory[i];
        for (bt_idx i = 0; cell->own && i < cell->search.n_pairs; i++)
            if (cell->search.pairs[i].contact >= 0)
                memory[(*n)++] = memory_of(world->bodies.gid, cell, &cell->search.pairs[i]);
    }
    return memory;
}

/// Append a pair that was in contact to the list of a cell before its first detection.
static void put_pair(bt_cell *cell, bt_idx a, bt_idx b, const bt_memory *memory)
{
    bt_pair_search *search = &cell->search;
    if (search->n_pairs == search->cap_pairs) {
        cell->cap_contacts = search->cap_pairs = search->cap_pairs ? 2 * search->cap_pairs : 16;
        search->pairs = bt_realloc(search->pairs, (size_t)search->cap_pairs, sizeof *search->pairs);
        // not aligned, and without room behind them
        cell->contacts = bt_realloc(cell->contacts, (size_t)search->cap_pairs, sizeof *cell->contacts);
        cell->gaps = bt_realloc(cell->gaps, (size_t)search->cap_pairs, sizeof *cell->gaps);
    }
    const bt_idx at = search->n_pairs++;
    search->pairs[at] = (bt_pair){.a = a, .b = b, .contact = at, .part = {memory->part[0], memory->part[1]},
                                  .axes = BT_NO_AXES};
    cell->contacts[at] = (bt_contact){.n = memory->n_points, .ln = {memory->value[0], memory->value[1]},
                                      .lt = memory->value[2]};
    cell->gaps[at] = (bt_gaps){.feature = {memory->feature[0], memory->feature[1]}};
}

/// Put memory, in any order, into new cells.
static void put_memory(bt_world *world, bt_memory *memory, int64_t n)
{
    bt_cells *cells = world->cells;
    bt_law_state *laws = bt_alloc((size_t)cells->n, sizeof *laws);
    for (bt_idx k = 0; k < cells->n; k++) cells->cell[k].laws = &laws[k];
    if (n > 0) qsort(memory, (size_t)n, sizeof *memory, bt_memory_by_names);
    for (int64_t k = 0; k < n; k++) {
        const bt_idx a = bt_world_index(world, memory[k].a), b = bt_world_index(world, memory[k].b);
        // the floe has shot so far from a large body that this rank no longer holds it
        if (a < 0 || b < 0) continue;
        bt_cell *cell = &cells->cell[bt_cells_of_pair(world, a, b)];
        if (memory[k].law != 0) bt_cells_remember(cell, &memory[k]);
        else put_pair(cell, a, b, &memory[k]);
    }
}

/// Drop pairs that cannot touch under the new labels: floes that have shot apart within one step by more than their
/// margin (the last solve may not have converged). No cell has both in its block, and perhaps no rank holds both.
static void drop_parted(const bt_world *world, bt_memory *memory, int64_t *n)
{
    const bt_bodies *bodies = &world->bodies;
    int64_t kept = 0;
    for (int64_t k = 0; k < *n; k++) {
        const bt_idx i = bt_world_index(world, memory[k].a), j = bt_world_index(world, memory[k].b);
        const bool one_large = bodies->large[i] || bodies->large[j];
        if (one_large || bt_cells_adjacent(world->cells, bodies->cell[i], bodies->cell[j])) memory[kept++] = memory[k];
    }
    *n = kept;
}

/// Move bodies to their ranks and places under the present labels, and make cells with this memory, which is released.
static void place(bt_world *world, bt_memory *memory, int64_t n)
{
    bt_cells *cells = world->cells;
    bt_cells_empty(cells);
    if (world->exchange) memory = world->exchange->migrate(world, memory, &n);
    bt_cells_make(world);
    put_memory(world, memory, n);
    if (world->exchange) world->exchange->connect(world);
    free(memory);
    cells->labelled = true;
}

/// Make new cells and labels, and fill in this memory, which is released.
static void renew(bt_world *world, double margin, bt_memory *memory, int64_t n)
{
    bt_cells_choose(world, margin);
    world->cells->n_labellings++;
    drop_parted(world, memory, &n);
    place(world, memory, n);
    world->cells->relabel = false;
}

static void relabel(bt_world *world, double margin)
{
    int64_t n;
    bt_memory *memory = bt_cells_take_memory(world, &n);
    renew(world, margin, memory, n);
}

/// Give the existing cells new owners.
static void hand_on(bt_world *world)
{
    int64_t n;
    bt_memory *memory = bt_cells_take_memory(world, &n);
    place(world, memory, n);
    world->cells->relabel = false;
}

void bt_cells_change(bt_world *world, bt_bodies_change *change, const void *context)
{
    int64_t n;
    bt_memory *memory = bt_cells_take_memory(world, &n);
    memory = change(world, memory, &n, context);
    renew(world, world->par.slop, memory, n);
}

void bt_cells_restore(bt_world *world, bt_memory *memory, int64_t n) { place(world, memory, n); }

void bt_cells_begin(bt_world *world)
{
    bt_cells *cells = world->cells;
    if (!cells->labelled || cells->relabel) {
        // always stored as a large body, whatever its size
        if (world->towed >= 0) world->bodies.large[bt_world_towed(world)] = 1;
        relabel(world, world->par.slop);
    } else if (world->exchange && world->exchange->due(world)) {
        hand_on(world);
    }
    cells->still = world->par.water_u == 0 && world->par.water_v == 0;
    if (!cells->still) bt_cells_wake_all(cells);
}

bool bt_cells_update(bt_world *world, double margin)
{
    if (margin <= world->cells->margin_max) return false;
    relabel(world, margin);
    return true;
}
