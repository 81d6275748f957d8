// SPDX-License-Identifier: MIT
// Batches of four contacts; what for, in batch.h. Here: which cells have them, how contacts are dealt to batches, and
// the way from their records into batches and back.
#include "solve/batch.h"

#include <stdlib.h>
#include <string.h>

#include "contact/law.h"
#include "solve/batch_layout.h"
#include "solve/rows.h"

enum { OPEN = 8 }; // batches that wait for more contacts, when a cell is packed

/// The projection has two unknowns and no friction, and keeps what it has no use for in the place of what it does not
/// use.
#define KEPT_BIAS_0 w12
#define KEPT_BIAS_1 per_det
#define KEPT_MU wt
#define KEPT_LT mt
#define KEPT_LN_0 x[2]
#define KEPT_LN_1 before[2]

static bt_batch_bounds *bounds_of(const bt_cell *cell)
{
    return (bt_batch_bounds *)(cell->work.batch + cell->work.n_batches);
}

static size_t batch_bytes(const bt_cell *cell)
{
    return sizeof(bt_batch) + (cell->laws.limits ? sizeof(bt_batch_bounds) : 0);
}

/// The records of the contacts that are not listed.
static bt_contact *rest_of(const bt_cell *cell)
{
    return (bt_contact *)((char *)cell->work.batch + (size_t)cell->work.n_batches * batch_bytes(cell));
}

bool bt_batch_is_for(const bt_cell *cell)
{
    return !(cell->laws.limits && cell->laws.rising) && cell->phase != BT_COLOURS;
}

bool bt_batch_projects(const bt_cell *cell) { return cell->phase != BT_COLOURS; }

size_t bt_batch_bytes(const bt_cell *cell)
{
    const size_t own = bt_batch_is_for(cell) ? batch_bytes(cell) / BT_LANES
                                             : sizeof(bt_contact) + sizeof(bt_in_place) + 2 * sizeof(bt_inv);
    return own + 2 * sizeof(bt_vel);
}

// --- packing ---------------------------------------------------------------------------------------------------------

void bt_batch_begin(bt_cell *cell) { cell->work.n_last = 0; }

static bt_batch_kind kind_of(const bt_cell *cell, const bt_contact *u, bool projection)
{
    if (projection) return BT_BATCH_PROJECTION;
    return !cell->laws.limits ? BT_BATCH_RIGID : u->n > 0 ? BT_BATCH_BOUNDED : BT_BATCH_SHEETS;
}

/// The contacts of a batch, and those of their bodies that can be moved.
typedef struct {
    bt_idx contact[BT_LANES], body[2 * BT_LANES];
    uint8_t n, n_bodies, kind;
} place;

/// What a thread needs to pack a cell, or to unpack it: on its stack unless there are many contacts. The records
/// have to stand aside: they and the batches are in the same memory.
typedef struct {
    place few_places[BT_FEW], *place;      // [n_list]
    bt_unknowns few_unknowns[BT_FEW], *of; // [n_contacts]
    bt_contact few_records[BT_FEW], *u;    // [n_contacts]
    bool few_listed[BT_FEW], *listed;      // [n_contacts]
} packing;

static void begin_packing(packing *s, const bt_cell *cell)
{
    const size_t n = (size_t)cell->n_contacts, n_list = (size_t)cell->work.n_list;
    const bool few = n <= BT_FEW;
    s->place = n_list > BT_FEW ? bt_realloc(NULL, n_list, sizeof *s->place) : s->few_places;
    s->of = few ? s->few_unknowns : bt_realloc(NULL, n, sizeof *s->of);
    s->u = few ? s->few_records : bt_realloc(NULL, n, sizeof *s->u);
    s->listed = few ? s->few_listed : bt_realloc(NULL, n, sizeof *s->listed);
    if (n > 0) memset(s->listed, 0, n * sizeof *s->listed);
}

static void end_packing(packing *s)
{
    if (s->place != s->few_places) free(s->place);
    if (s->of != s->few_unknowns) free(s->of);
    if (s->u != s->few_records) free(s->u);
    if (s->listed != s->few_listed) free(s->listed);
}

static bool holds(const place *o, bt_idx body)
{
    for (int l = 0; l < o->n_bodies; l++)
        if (o->body[l] == body) return true;
    return false;
}

/// May a contact stand in a batch?
static bool fits(const place *o, bt_batch_kind kind, const bt_idx body[2], int n)
{
    return o->kind == kind && !(n > 0 && holds(o, body[0])) && !(n > 1 && holds(o, body[1]));
}

/// Each contact goes into the first of the last OPEN batches that is not full, is of its kind and has none of its
/// bodies that can be moved. Those that filled up leave the window. Returns the number of batches.
static bt_idx deal(const bt_cell *cell, const bt_contact *contacts, const bt_inv *inv, bool projection, place *o)
{
    bt_idx open[OPEN], n_batches = 0;
    int n_open = 0;
    for (bt_idx j = 0; j < cell->work.n_list; j++) {
        const bt_idx i = cell->work.list[j];
        const bt_contact *u = &contacts[i];
        const bt_batch_kind kind = kind_of(cell, u, projection);
        bt_idx body[2];
        int n = 0, k = 0;
        if (inv[u->a].m > 0) body[n++] = u->a;
        if (inv[u->b].m > 0) body[n++] = u->b;
        while (k < n_open && !fits(&o[open[k]], kind, body, n)) k++;
        if (k == n_open) {
            if (n_open == OPEN) memmove(open, open + 1, (OPEN - 1) * sizeof *open), k = --n_open;
            o[n_batches] = (place){.kind = (uint8_t)kind};
            open[n_open++] = n_batches++;
        }
        place *p = &o[open[k]];
        p->contact[p->n++] = i;
        for (int l = 0; l < n; l++) p->body[p->n_bodies++] = body[l];
        if (p->n < BT_LANES) continue;
        n_open--;
        memmove(open + k, open + k + 1, (size_t)(n_open - k) * sizeof *open);
    }
    return n_batches;
}

/// What the last list hands on to the next one. A contact that was not in it has not been moved since; it has no
/// multiplier.
static void take_unknowns(const bt_cell *cell, bool projection, packing *s)
{
    for (bt_idx j = 0; j < cell->work.n_list; j++) {
        const bt_idx i = cell->work.list[j];
        const bt_contact *u = &s->u[i];
        s->of[i] = projection ? (bt_unknowns){0} : (bt_unknowns){.before = {u->ln[0], u->ln[1], u->lt}};
        s->listed[i] = true;
    }
    for (bt_idx k = 0; k < cell->work.n_last; k++) s->of[cell->work.last[k].contact] = cell->work.last[k];
}

/// What the position projection has in place of impulses, biases and friction. Sheets, and a point that is not there,
/// have none.
static void put_projection(bt_batch *o, const bt_cell *cell, const bt_unknowns *of, double slop)
{
    o->KEPT_BIAS_0 = o->bias[0], o->KEPT_BIAS_1 = o->bias[1], o->KEPT_MU = o->mu;
    o->KEPT_LN_1 = o->x[1], o->KEPT_LT = o->x[2], o->KEPT_LN_0 = o->x[0];
    for (int l = 0; l < o->n; l++) {
        const bt_idx i = o->contact[l];
        o->mu[l] = slop;
        for (int c = 0; c < 2; c++) {
            o->bias[c][l] = c < o->points[l] ? cell->gaps[i].gap[c] : 0;
            o->x[c][l] = of[i].multiplier[c];
        }
    }
}

/// Masses of sheets one by one: they have a root.
BT_INLINE void put_sheets(bt_batch *o, const bt_contact *const u[BT_LANES], const bt_limit *limits, const bt_inv *inv)
{
    for (int l = 0; l < o->n; l++) {
        const bt_mass m = bt_mass_of(u[l], inv);
        o->w[0][l] = m.w[0], o->mn[0][l] = m.mn[0], o->wt[l] = m.wt, o->mt[l] = m.mt;
        o->BT_ENDS_X[l] = limits[o->contact[l]].ends[0], o->BT_ENDS_Y[l] = limits[o->contact[l]].ends[1];
    }
}

BT_INLINE void put(bt_batch *o, const bt_contact *contacts, const bt_limit *limits, const place *p,
                   const bt_unknowns *of, const bt_inv *inv)
{
    static const bt_contact nothing;
    static const bt_unknowns nowhere;
    const bt_contact *u[BT_LANES];
    const bt_unknowns *x[BT_LANES];
    o->n = p->n, o->kind = p->kind;
    for (int l = 0; l < BT_LANES; l++) {
        const bool there = l < p->n;
        const bt_contact *at = &contacts[p->contact[there ? l : 0]]; // empty lanes read its bodies, never write
        u[l] = there ? at : &nothing;
        x[l] = there ? &of[p->contact[l]] : &nowhere;
        o->a[l] = at->a, o->b[l] = at->b, o->contact[l] = there ? p->contact[l] : 0;
        o->pair[l] = u[l]->pair, o->points[l] = (uint8_t)u[l]->n;
        o->moves_a[l] = there && inv[at->a].m > 0, o->moves_b[l] = there && inv[at->b].m > 0;
    }
    const bt_four_rows r = bt_rows_of(u);
    bt_invs a = bt_take_inv(inv, o->a), b = bt_take_inv(inv, o->b);
    const bt_mask there = (bt_mask){0, 1, 2, 3} < (bt_mask){p->n, p->n, p->n, p->n};
    a.m = bt_only(there, a.m), a.i = bt_only(there, a.i), b.m = bt_only(there, b.m), b.i = bt_only(there, b.i);
    const bt_masses m = bt_masses_of(&r, a, b);
    o->nx = r.nx, o->ny = r.ny, o->rat = r.rat, o->rbt = r.rbt, o->mu = r.mu;
    o->ma = a.m, o->ia = a.i, o->mb = b.m, o->ib = b.i;
    o->w12 = m.w12, o->per_det = m.per_det, o->wt = m.wt, o->mt = m.mt;
    for (int c = 0; c < 2; c++) {
        o->ran[c] = r.ran[c], o->rbn[c] = r.rbn[c], o->bias[c] = r.bias[c], o->w[c] = m.w[c], o->mn[c] = m.mn[c];
        o->x[c] = r.ln[c];
    }
    o->x[2] = r.lt;
    for (int c = 0; c < 3; c++)
        o->before[c] = (bt_vec){x[0]->before[c], x[1]->before[c], x[2]->before[c], x[3]->before[c]};
    if (p->kind == BT_BATCH_SHEETS) put_sheets(o, u, limits, inv);
}

/// n records, of which none lies in the other place; a call of the library takes longer for so few.
BT_INLINE void copy_records(bt_contact *to, const bt_contact *from, bt_idx n)
{
    for (bt_idx i = 0; i < n; i++) {
        bt_vec line[4];
        memcpy(line, &from[i], sizeof line);
        memcpy(&to[i], line, sizeof line);
    }
}

BT_FOR_EACH_CPU
static void put_aside(const bt_cell *cell, bt_contact *u) { copy_records(u, cell->contacts, cell->n_contacts); }

BT_FOR_EACH_CPU
static void put_all(bt_cell *cell, const packing *s, const bt_inv *inv, const double *slop)
{
    for (bt_idx k = 0; k < cell->work.n_batches; k++) {
        bt_batch *o = &cell->work.batch[k];
        put(o, s->u, cell->laws.limits, &s->place[k], s->of, inv);
        if (slop) put_projection(o, cell, s->of, *slop);
        if (!cell->laws.limits) continue;
        bt_batch_bounds *at = &bounds_of(cell)[k];
        *at = (bt_batch_bounds){0};
        for (int l = 0; l < o->n; l++)
            for (int c = 0; c < 2; c++) at->of[c][l] = cell->laws.limits[o->contact[l]].flat[c];
    }
    bt_contact *rest = rest_of(cell);
    for (bt_idx i = 0; i < cell->n_contacts; i++)
        if (!s->listed[i]) copy_records(rest++, &s->u[i], 1);
}

void bt_batch_pack(bt_cell *cell, const bt_inv *inv, const double *slop)
{
    packing s;
    begin_packing(&s, cell);
    put_aside(cell, s.u);
    take_unknowns(cell, slop != NULL, &s);
    const bt_idx n_batches = deal(cell, s.u, inv, slop != NULL, s.place);
    const size_t n_rest = (size_t)(cell->n_contacts - cell->work.n_list);
    bt_cells_make_room(cell, (size_t)n_batches * batch_bytes(cell) + n_rest * sizeof(bt_contact));
    cell->work.n_batches = n_batches;
    cell->work.batch = (bt_batch *)cell->contacts;
    cell->work.packed = true;
    put_all(cell, &s, inv, slop);
    end_packing(&s);
}

// --- unpacking -------------------------------------------------------------------------------------------------------

/// The records of the contacts of a batch.
BT_INLINE void take_records(const bt_batch *o, bt_contact *u)
{
    const bool projection = o->kind == BT_BATCH_PROJECTION;
    bt_vec line[4][BT_LANES];
    int32_t bodies[BT_LANES][2], tail[BT_LANES][2];
    for (int l = 0; l < BT_LANES; l++) {
        bodies[l][0] = o->a[l], bodies[l][1] = o->b[l];
        tail[l][0] = o->points[l], tail[l][1] = o->pair[l];
    }
    bt_motions m[4] = {{o->nx, o->ny, o->rat, o->rbt}, {o->ran[0], o->ran[1], o->rbn[0], o->rbn[1]}};
    m[2] = projection ? (bt_motions){.x = o->KEPT_BIAS_0, .y = o->KEPT_BIAS_1, .w = o->KEPT_MU}
                      : (bt_motions){.x = o->bias[0], .y = o->bias[1], .w = o->mu};
    m[3] = projection ? (bt_motions){.x = o->KEPT_LN_0, .y = o->KEPT_LN_1, .w = o->KEPT_LT}
                      : (bt_motions){.x = o->x[0], .y = o->x[1], .w = o->x[2]};
    _Static_assert(offsetof(bt_contact, a) == 88 && offsetof(bt_contact, b) == 92, "end of the third line");
    _Static_assert(offsetof(bt_contact, n) == 120 && offsetof(bt_contact, pair) == 124, "end of the fourth line");
    memcpy(&m[2].unused, bodies, sizeof bodies);
    memcpy(&m[3].unused, tail, sizeof tail);
    for (int k = 0; k < 4; k++) {
        bt_transpose(&m[k]);
        line[k][0] = m[k].x, line[k][1] = m[k].y, line[k][2] = m[k].w, line[k][3] = m[k].unused;
    }
    for (int l = 0; l < o->n; l++)
        for (int k = 0; k < 4; k++) memcpy((char *)&u[o->contact[l]] + 32 * k, &line[k][l], sizeof line[k][l]);
}

static void take_out(const bt_batch *o, bt_unknowns *of)
{
    const bool projection = o->kind == BT_BATCH_PROJECTION;
    for (int l = 0; l < o->n; l++) {
        bt_unknowns *to = &of[l];
        to->contact = o->contact[l];
        for (int c = 0; c < 2; c++) to->before[c] = o->before[c][l], to->multiplier[c] = o->x[c][l];
        to->before[2] = projection ? 0 : o->before[2][l];
    }
}

/// Returns how many contacts are in batches.
BT_FOR_EACH_CPU
static bt_idx take_all(const bt_cell *cell, packing *s)
{
    bt_unknowns *of = s->of;
    for (bt_idx k = 0; k < cell->work.n_batches; k++) {
        const bt_batch *o = &cell->work.batch[k];
        take_records(o, s->u);
        take_out(o, of);
        of += o->n;
        for (int l = 0; l < o->n; l++) s->listed[o->contact[l]] = true;
    }
    const bt_contact *rest = rest_of(cell);
    for (bt_idx i = 0; i < cell->n_contacts; i++)
        if (!s->listed[i]) copy_records(&s->u[i], rest++, 1);
    return (bt_idx)(of - s->of);
}

BT_FOR_EACH_CPU
static void put_back(bt_cell *cell, const bt_contact *u) { copy_records(cell->contacts, u, cell->n_contacts); }

void bt_batch_unpack(bt_cell *cell)
{
    if (!cell->work.packed) return;
    packing s;
    begin_packing(&s, cell);
    const bt_idx n_last = take_all(cell, &s);
    const size_t bytes = (size_t)cell->n_contacts * sizeof *s.u, more = (size_t)n_last * sizeof *s.of;
    bt_cells_make_room(cell, bytes + more);
    cell->work.packed = false;
    cell->work.batch = NULL;
    cell->work.n_batches = 0;
    cell->work.last = (bt_unknowns *)((char *)cell->contacts + bytes);
    cell->work.n_last = n_last;
    put_back(cell, s.u);
    memcpy(cell->work.last, s.of, more);
    end_packing(&s);
}
