// SPDX-License-Identifier: MIT
// Batches of four contacts; reasons in batch.h. Here: which cells have them, how contacts are assigned to batches, and
// copying from records into batches and back.
#include "solve/batch.h"

#include <stdlib.h>
#include <string.h>

#include "contact/law.h"
#include "solve/batch_layout.h"
#include "solve/rows.h"

enum { OPEN = 8 }; // batches that are open for more contacts while a cell is packed

static bt_batch_bounds *bounds_of(const bt_cell *cell)
{
    return (bt_batch_bounds *)(cell->work->batch + cell->work->n_batches);
}

static size_t batch_bytes(const bt_cell *cell)
{
    return sizeof(bt_batch) + (cell->laws->limits ? sizeof(bt_batch_bounds) : 0);
}

/// Bytes for the rests of n batches, rounded up to whole records.
static size_t rest_bytes(bt_idx n)
{
    return ((size_t)n * sizeof(bt_rest) + sizeof(bt_contact) - 1) / sizeof(bt_contact) * sizeof(bt_contact);
}

bt_rest *bt_batch_rests(const bt_cell *cell)
{
    return (bt_rest *)((char *)cell->work->batch + (size_t)cell->work->n_batches * batch_bytes(cell));
}

bt_contact *bt_batch_others(const bt_cell *cell)
{
    return (bt_contact *)((char *)bt_batch_rests(cell) + rest_bytes(cell->work->n_batches));
}

bool bt_batch_is_for(const bt_cell *cell)
{
    return !(cell->laws->limits && cell->laws->rising) && cell->phase != BT_COLOURS;
}

size_t bt_batch_bytes(const bt_cell *cell)
{
    const size_t own = bt_batch_is_for(cell) ? batch_bytes(cell) / BT_LANES
                                             : sizeof(bt_contact) + sizeof(bt_in_place) + 2 * sizeof(bt_inv);
    return own + 2 * sizeof(bt_vel);
}

// --- packing ---------------------------------------------------------------------------------------------------------

void bt_batch_begin(bt_cell *cell)
{
    cell->work->packed = false;
    cell->work->batch = NULL;
    cell->work->n_batches = cell->work->n_last = 0;
}

static bt_batch_kind kind_of(const bt_cell *cell, const bt_contact *contact)
{
    return !cell->laws->limits ? BT_BATCH_RIGID : contact->n > 0 ? BT_BATCH_BOUNDED : BT_BATCH_SHEETS;
}

typedef bt_idx held_bodies __attribute__((vector_size(2 * BT_LANES * sizeof(bt_idx))));

/// The contacts of a batch and their movable bodies; NOBODY in free places.
typedef struct {
    held_bodies body;
    bt_idx contact[BT_LANES];
    uint8_t n, kind;
} place;

enum { NOBODY = -1, FIXED = -2 };

/// Scratch of a thread that packs or unpacks a cell: on its stack unless there are many contacts. The records have to
/// be copied aside, because batches use the same memory.
typedef struct {
    place few_places[BT_FEW], *place;      // [n_list]
    bt_unknowns few_unknowns[BT_FEW], *of; // [n_contacts]
    bt_contact few_records[BT_FEW], *u;    // [n_contacts]
    bool few_listed[BT_FEW], *listed;      // [n_contacts]
} packing;

static void begin_packing(packing *pack, const bt_cell *cell)
{
    const size_t n = (size_t)cell->n_contacts, n_list = (size_t)cell->n_listed;
    const bool few = n <= BT_FEW;
    pack->place = n_list > BT_FEW ? bt_alloc_unset(n_list, sizeof *pack->place) : pack->few_places;
    pack->of = few ? pack->few_unknowns : bt_realloc(NULL, n, sizeof *pack->of);
    pack->u = few ? pack->few_records : bt_realloc(NULL, n, sizeof *pack->u);
    pack->listed = few ? pack->few_listed : bt_realloc(NULL, n, sizeof *pack->listed);
    if (n > 0) memset(pack->listed, 0, n * sizeof *pack->listed);
}

static void end_packing(packing *pack)
{
    if (pack->place != pack->few_places) free(pack->place);
    if (pack->of != pack->few_unknowns) free(pack->of);
    if (pack->u != pack->few_records) free(pack->u);
    if (pack->listed != pack->few_listed) free(pack->listed);
}

/// May a contact between bodies a and b (or FIXED) join this batch?
BT_INLINE bool fits(const place *slot, bt_batch_kind kind, bt_idx a, bt_idx b)
{
    const held_bodies held = (slot->body == a) | (slot->body == b);
    uint64_t any[sizeof held / sizeof(uint64_t)];
    memcpy(any, &held, sizeof held);
    return slot->kind == kind && (any[0] | any[1] | any[2] | any[3]) == 0;
}

/// Put each contact into the first of the last OPEN batches that is not full, is of its kind and has none of its
/// movable bodies. Full batches leave the window. Returns the number of batches.
BT_FOR_EACH_CPU
static bt_idx deal(const bt_cell *cell, const bt_contact *contacts, const bt_inv *inv, place *o)
{
    bt_idx open[OPEN], n_batches = 0;
    int n_open = 0;
    for (bt_idx j = 0; j < cell->n_listed; j++) {
        const bt_idx i = cell->work->list[j];
        const bt_contact *contact = &contacts[i];
        const bt_batch_kind kind = kind_of(cell, contact);
        const bt_idx a = inv[contact->a].m > 0 ? contact->a : FIXED, b = inv[contact->b].m > 0 ? contact->b : FIXED;
        int k = 0;
        while (k < n_open && !fits(&o[open[k]], kind, a, b)) k++;
        if (k == n_open) {
            if (n_open == OPEN) memmove(open, open + 1, (OPEN - 1) * sizeof *open), k = --n_open;
            o[n_batches] = (place){.kind = (uint8_t)kind, .body = (held_bodies){0} + NOBODY};
            open[n_open++] = n_batches++;
        }
        place *p = &o[open[k]];
        p->body[2 * p->n] = a == FIXED ? NOBODY : a, p->body[2 * p->n + 1] = b == FIXED ? NOBODY : b;
        p->contact[p->n++] = i;
        if (p->n < BT_LANES) continue;
        n_open--;
        memmove(open + k, open + k + 1, (size_t)(n_open - k) * sizeof *open);
    }
    return n_batches;
}

/// Take the previous unknowns from the last list. A contact that was not in it has not changed since.
static void take_unknowns(const bt_cell *cell, packing *pack)
{
    for (bt_idx j = 0; j < cell->n_listed; j++) {
        const bt_idx i = cell->work->list[j];
        const bt_contact *contact = &pack->u[i];
        pack->of[i] = (bt_unknowns){.before = {contact->ln[0], contact->ln[1], contact->lt}};
        pack->listed[i] = true;
    }
    for (bt_idx k = 0; k < cell->work->n_last; k++) pack->of[cell->work->last[k].contact] = cell->work->last[k];
}

/// The effective masses of sheets are formed one by one: they contain a root.
BT_INLINE void put_sheets(bt_batch *batch, const bt_contact *const contact[BT_LANES], const bt_limit *limits,
                          const bt_inv *inv)
{
    for (int l = 0; l < batch->n; l++) {
        const bt_mass m = bt_mass_of(contact[l], inv);
        batch->w[0][l] = m.w[0], batch->mn[0][l] = m.mn[0], batch->wt[l] = m.wt, batch->mt[l] = m.mt;
        batch->BT_ENDS_X[l] = limits[batch->contact[l]].ends[0],
        batch->BT_ENDS_Y[l] = limits[batch->contact[l]].ends[1];
    }
}

BT_INLINE void put(bt_batch *batch, const bt_contact *contacts, const bt_limit *limits, const place *slot,
                   const bt_unknowns *of, const bt_inv *inv)
{
    static const bt_contact nothing;
    static const bt_unknowns nowhere;
    const bt_contact *contact[BT_LANES];
    const bt_unknowns *unknowns[BT_LANES];
    batch->n = slot->n, batch->kind = slot->kind;
    for (int l = 0; l < BT_LANES; l++) {
        const bool there = l < slot->n;
        const bt_contact *at = &contacts[slot->contact[there ? l : 0]]; // empty lanes read its bodies, never write
        contact[l] = there ? at : &nothing;
        unknowns[l] = there ? &of[slot->contact[l]] : &nowhere;
        batch->a[l] = at->a, batch->b[l] = at->b, batch->contact[l] = there ? slot->contact[l] : 0;
        batch->pair[l] = contact[l]->pair, batch->points[l] = (uint8_t)contact[l]->n;
        batch->moves_a[l] = there && inv[at->a].m > 0, batch->moves_b[l] = there && inv[at->b].m > 0;
    }
    const bt_four_rows rows = bt_rows_of(contact);
    bt_invs a = bt_take_inv(inv, batch->a), b = bt_take_inv(inv, batch->b);
    const bt_mask there = (bt_mask){0, 1, 2, 3} < (bt_mask){slot->n, slot->n, slot->n, slot->n};
    a.m = bt_only(there, a.m), a.i = bt_only(there, a.i), b.m = bt_only(there, b.m), b.i = bt_only(there, b.i);
    const bt_masses m = bt_masses_of(&rows, a, b);
    batch->nx = rows.nx, batch->ny = rows.ny, batch->rat = rows.rat, batch->rbt = rows.rbt, batch->mu = rows.mu;
    batch->ma = a.m, batch->ia = a.i, batch->mb = b.m, batch->ib = b.i;
    batch->w12 = m.w12, batch->per_det = m.per_det, batch->wt = m.wt, batch->mt = m.mt;
    for (int c = 0; c < 2; c++) {
        batch->ran[c] = rows.ran[c], batch->rbn[c] = rows.rbn[c], batch->bias[c] = rows.bias[c], batch->w[c] = m.w[c],
        batch->mn[c] = m.mn[c];
        batch->x[c] = rows.ln[c];
    }
    batch->x[2] = rows.lt;
    for (int c = 0; c < 3; c++)
        batch->before[c] = (bt_vec){unknowns[0]->before[c], unknowns[1]->before[c], unknowns[2]->before[c],
                                    unknowns[3]->before[c]};
    if (slot->kind == BT_BATCH_SHEETS) put_sheets(batch, contact, limits, inv);
}

/// Copy n records between places that do not overlap; memcpy takes longer for so few.
BT_INLINE void copy_records(bt_contact *to, const bt_contact *from, bt_idx n)
{
    for (bt_idx i = 0; i < n; i++) {
        bt_vec line[4];
        memcpy(line, &from[i], sizeof line);
        memcpy(&to[i], line, sizeof line);
    }
}

BT_FOR_EACH_CPU
static void put_aside(const bt_cell *cell,
                      bt_contact *contact) { copy_records(contact, cell->contacts, cell->n_contacts); }

BT_FOR_EACH_CPU
static void put_all(bt_cell *cell, const packing *pack, const bt_inv *inv)
{
    for (bt_idx k = 0; k < cell->work->n_batches; k++) {
        bt_batch *batch = &cell->work->batch[k];
        put(batch, pack->u, cell->laws->limits, &pack->place[k], pack->of, inv);
        if (!cell->laws->limits) continue;
        bt_batch_bounds *at = &bounds_of(cell)[k];
        *at = (bt_batch_bounds){0};
        for (int l = 0; l < batch->n; l++)
            for (int c = 0; c < 2; c++) at->of[c][l] = cell->laws->limits[batch->contact[l]].flat[c];
    }
    memset(bt_batch_rests(cell), 0, (size_t)cell->work->n_batches * sizeof(bt_rest));
    bt_contact *other = bt_batch_others(cell);
    for (bt_idx i = 0; i < cell->n_contacts; i++)
        if (!pack->listed[i]) copy_records(other++, &pack->u[i], 1);
}

void bt_batch_pack(bt_cell *cell, const bt_inv *inv)
{
    packing pack;
    begin_packing(&pack, cell);
    put_aside(cell, pack.u);
    take_unknowns(cell, &pack);
    const bt_idx n_batches = deal(cell, pack.u, inv, pack.place);
    const size_t n_others = (size_t)(cell->n_contacts - cell->n_listed);
    bt_cells_make_room(cell, (size_t)n_batches * batch_bytes(cell) + rest_bytes(n_batches) +
                                 n_others * sizeof(bt_contact));
    cell->work->n_batches = n_batches;
    cell->work->batch = (bt_batch *)cell->contacts;
    cell->work->packed = true;
    put_all(cell, &pack, inv);
    end_packing(&pack);
}

// --- unpacking -------------------------------------------------------------------------------------------------------

/// Write the contacts of a batch back to their records.
BT_INLINE void take_records(const bt_batch *batch, bt_contact *contact)
{
    bt_vec line[4][BT_LANES];
    int32_t bodies[BT_LANES][2], tail[BT_LANES][2];
    for (int l = 0; l < BT_LANES; l++) {
        bodies[l][0] = batch->a[l], bodies[l][1] = batch->b[l];
        tail[l][0] = batch->points[l], tail[l][1] = batch->pair[l];
    }
    bt_motions m[4] = {{batch->nx, batch->ny, batch->rat, batch->rbt},
                       {batch->ran[0], batch->ran[1], batch->rbn[0], batch->rbn[1]},
                       {.x = batch->bias[0], .y = batch->bias[1], .w = batch->mu},
                       {.x = batch->x[0], .y = batch->x[1], .w = batch->x[2]}};
    _Static_assert(offsetof(bt_contact, a) == 88 && offsetof(bt_contact, b) == 92, "end of the third line");
    _Static_assert(offsetof(bt_contact, n) == 120 && offsetof(bt_contact, pair) == 124, "end of the fourth line");
    memcpy(&m[2].unused, bodies, sizeof bodies);
    memcpy(&m[3].unused, tail, sizeof tail);
    for (int k = 0; k < 4; k++) {
        bt_transpose(&m[k]);
        line[k][0] = m[k].x, line[k][1] = m[k].y, line[k][2] = m[k].w, line[k][3] = m[k].unused;
    }
    for (int l = 0; l < batch->n; l++)
        for (int k = 0; k < 4; k++)
            memcpy((char *)&contact[batch->contact[l]] + 32 * k, &line[k][l], sizeof line[k][l]);
}

static void take_out(const bt_batch *batch, bt_unknowns *of)
{
    for (int l = 0; l < batch->n; l++) {
        of[l].contact = batch->contact[l];
        for (int c = 0; c < 3; c++) of[l].before[c] = batch->before[c][l];
    }
}

/// Write all batches back. Returns how many contacts were in them.
BT_FOR_EACH_CPU
static bt_idx take_all(const bt_cell *cell, packing *pack)
{
    bt_unknowns *of = pack->of;
    for (bt_idx k = 0; k < cell->work->n_batches; k++) {
        const bt_batch *batch = &cell->work->batch[k];
        take_records(batch, pack->u);
        take_out(batch, of);
        of += batch->n;
        for (int l = 0; l < batch->n; l++) pack->listed[batch->contact[l]] = true;
    }
    const bt_contact *other = bt_batch_others(cell);
    for (bt_idx i = 0; i < cell->n_contacts; i++)
        if (!pack->listed[i]) copy_records(&pack->u[i], other++, 1);
    return (bt_idx)(of - pack->of);
}

BT_FOR_EACH_CPU
static void put_back(bt_cell *cell,
                     const bt_contact *contact) { copy_records(cell->contacts, contact, cell->n_contacts); }

const bt_contact *bt_batch_read(const bt_cell *cell, bt_contact *copy)
{
    if (!cell->work->packed) return cell->contacts;
    packing pack;
    begin_packing(&pack, cell);
    take_all(cell, &pack);
    memcpy(copy, pack.u, (size_t)cell->n_contacts * sizeof *copy);
    end_packing(&pack);
    return copy;
}

void bt_batch_unpack(bt_cell *cell)
{
    if (!cell->work->packed) return;
    packing pack;
    begin_packing(&pack, cell);
    const bt_idx n_last = take_all(cell, &pack);
    const size_t bytes = (size_t)cell->n_contacts * sizeof *pack.u, more = (size_t)n_last * sizeof *pack.of;
    bt_cells_make_room(cell, bytes + more);
    bt_batch_begin(cell);
    cell->work->last = (bt_unknowns *)((char *)cell->contacts + bytes);
    cell->work->n_last = n_last;
    put_back(cell, pack.u);
    memcpy(cell->work->last, pack.of, more);
    end_packing(&pack);
}
