// SPDX-License-Identifier: MIT
// Batches of four contacts; what for, in batch.h. The arithmetic is that of bt_update_contact (kernel.h), four at a
// time.
#include "solve/batch.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "solve/kernel.h"
#include "solve/rows.h"

enum { LANES = BT_LANES, OPEN = 8 }; // OPEN: batches that wait for more contacts, when a cell is packed

typedef bt_vec vec;
typedef bt_mask mask;

typedef enum { RIGID, BOUNDED, SHEETS, PROJECTION } kind_of_batch;

/// Names as in bt_contact and bt_mass; lanes without a contact are zero. It is all there is of its contacts while they
/// are packed.
typedef struct bt_batch {
    vec nx, ny, ran[2], rbn[2], rat, rbt, w[2], w12, mn[2], per_det, wt, mt, bias[2];
    vec mu;                    // friction; of the projection: the overlap that is left alone, m
    vec ma, ia, mb, ib;        // inverse masses and moments of inertia of a and b
    vec x[3], before[3];       // impulses, or multipliers: now, before the last sweep
    bt_idx a[LANES], b[LANES], contact[LANES], pair[LANES];
    bool moves_a[LANES], moves_b[LANES];
    uint8_t points[LANES], n, kind;
} bt_batch;
_Static_assert(sizeof(bt_batch) == 32 * sizeof(vec), "the listed contacts of dense ice, 256 bytes each");

/// The projection has two unknowns and no friction, and keeps what it has no use for in the place of what it does not
/// use.
#define KEPT_BIAS_0 w12
#define KEPT_BIAS_1 per_det
#define KEPT_MU wt
#define KEPT_LT mt
#define KEPT_LN_0 x[2]
#define KEPT_LN_1 before[2]

/// Of the normals; [0] of sheets: the radius of their disc. After the batches of a cell whose contacts have bounds.
typedef struct bounds {
    vec of[2];
} bounds;

static bounds *bounds_of(const bt_cell *cell) { return (bounds *)(cell->work.batch + cell->work.n_batches); }

static size_t batch_bytes(const bt_cell *cell) { return sizeof(bt_batch) + (cell->laws.limits ? sizeof(bounds) : 0); }

/// The records of the contacts that are not listed.
static bt_contact *rest_of(const bt_cell *cell)
{
    return (bt_contact *)((char *)cell->work.batch + (size_t)cell->work.n_batches * batch_bytes(cell));
}

/// Of one contact: unknowns before the last sweep, and the multipliers of the projection.
typedef struct bt_unknowns {
    double before[3], multiplier[2];
    bt_idx contact;
} bt_unknowns;

bool bt_batch_is_for(const bt_cell *cell)
{
    return !(cell->laws.limits && cell->laws.rising) && cell->phase != BT_COLOURS;
}

bool bt_batch_projects(const bt_cell *cell) { return cell->phase != BT_COLOURS; }

size_t bt_batch_bytes(const bt_cell *cell)
{
    const size_t own = bt_batch_is_for(cell) ? batch_bytes(cell) / LANES
                                             : sizeof(bt_contact) + sizeof(bt_in_place) + 2 * sizeof(bt_inv);
    return own + 2 * sizeof(bt_vel);
}

// --- packing ---------------------------------------------------------------------------------------------------------

void bt_batch_begin(bt_cell *cell) { cell->work.n_last = 0; }

static kind_of_batch kind_of(const bt_cell *cell, const bt_contact *u, bool projection)
{
    return projection ? PROJECTION : !cell->laws.limits ? RIGID : u->n > 0 ? BOUNDED : SHEETS;
}

/// The contacts of a batch, and those of their bodies that can be moved.
typedef struct {
    bt_idx contact[LANES], body[2 * LANES];
    uint8_t n, n_bodies, kind;
} place;

/// What a thread needs to pack a cell, or to unpack it: on its stack for nearly all cells, which have some sixty
/// contacts. The records have to stand aside: they and the batches are in the same memory.
enum { FEW = 128 };
typedef struct {
    place few_places[FEW], *place;      // [n_list]
    bt_unknowns few_unknowns[FEW], *of; // [n_contacts]
    bt_contact few_records[FEW], *u;    // [n_contacts]
    bool few_listed[FEW], *listed;      // [n_contacts]
} packing;

static void begin_packing(packing *s, const bt_cell *cell)
{
    const size_t n = (size_t)cell->n_contacts, n_list = (size_t)cell->work.n_list;
    const bool few = n <= FEW;
    s->place = n_list > FEW ? bt_realloc(NULL, n_list, sizeof *s->place) : s->few_places;
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
static bool fits(const place *o, kind_of_batch kind, const bt_idx body[2], int n)
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
        const kind_of_batch kind = kind_of(cell, u, projection);
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
        if (p->n < LANES) continue;
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
static void put_sheets(bt_batch *o, const bt_contact *const u[LANES], const bt_inv *inv)
{
    for (int l = 0; l < o->n; l++) {
        const bt_mass m = bt_mass_of(u[l], inv);
        o->w[0][l] = m.w[0], o->mn[0][l] = m.mn[0], o->wt[l] = m.wt, o->mt[l] = m.mt;
    }
}

BT_INLINE void put(bt_batch *o, const bt_contact *contacts, const place *p, const bt_unknowns *of, const bt_inv *inv)
{
    static const bt_contact nothing;
    static const bt_unknowns nowhere;
    const bt_contact *u[LANES];
    const bt_unknowns *x[LANES];
    o->n = p->n, o->kind = p->kind;
    for (int l = 0; l < LANES; l++) {
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
        o->before[c] = (vec){x[0]->before[c], x[1]->before[c], x[2]->before[c], x[3]->before[c]};
    if (p->kind == SHEETS) put_sheets(o, u, inv);
}

/// n records, of which none lies in the other place; a call of the library takes longer for so few.
BT_INLINE void copy_records(bt_contact *to, const bt_contact *from, bt_idx n)
{
    for (bt_idx i = 0; i < n; i++) {
        vec line[4];
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
        put(o, s->u, &s->place[k], s->of, inv);
        if (slop) put_projection(o, cell, s->of, *slop);
        if (!cell->laws.limits) continue;
        bounds *at = &bounds_of(cell)[k];
        *at = (bounds){0};
        for (int l = 0; l < o->n; l++)
            for (int c = 0; c < 2; c++) at->of[c][l] = cell->laws.limits[o->contact[l]].flat[c];
    }
    bt_contact *rest = rest_of(cell);
    for (bt_idx i = 0; i < cell->n_contacts; i++)
        if (!s->listed[i]) copy_records(rest++, &s->u[i], 1);
}

static void pack(bt_cell *cell, const bt_inv *inv, const double *slop)
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

/// The records of the contacts of a batch.
BT_INLINE void take_records(const bt_batch *o, bt_contact *u)
{
    const bool projection = o->kind == PROJECTION;
    vec line[4][LANES];
    int32_t bodies[LANES][2], tail[LANES][2];
    for (int l = 0; l < LANES; l++) {
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
    const bool projection = o->kind == PROJECTION;
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

// --- residuals -------------------------------------------------------------------------------------------------------

/// Which contacts the last sweep has moved, and their multipliers unless NULL; 0 of contacts that are in no batch.
typedef struct {
    uint8_t few_moved[FEW], *moved;          // [n_contacts]
    double few_x[FEW][2], (*x)[2];           // [n_contacts]
} last_sweep;

static void take_last(const bt_cell *cell, bool projection, last_sweep *s)
{
    const size_t n = (size_t)cell->n_contacts;
    const bool few = n <= FEW;
    s->moved = few ? s->few_moved : bt_realloc(NULL, n, sizeof *s->moved);
    s->x = !projection ? NULL : few ? s->few_x : bt_realloc(NULL, n, sizeof *s->x);
    if (n > 0) memset(s->moved, 0, n * sizeof *s->moved);
    if (n > 0 && projection) memset(s->x, 0, n * sizeof *s->x);
    for (bt_idx k = 0; k < cell->work.n_last; k++) {
        const bt_unknowns *o = &cell->work.last[k];
        const bt_idx i = o->contact;
        const bt_contact *u = &cell->contacts[i];
        const double *b = o->before;
        if (projection) {
            s->moved[i] = o->multiplier[0] != b[0] || o->multiplier[1] != b[1];
            s->x[i][0] = o->multiplier[0], s->x[i][1] = o->multiplier[1];
        } else {
            s->moved[i] = u->ln[0] != b[0] || u->ln[1] != b[1] || u->lt != b[2];
        }
    }
}

static void free_last(last_sweep *s)
{
    if (s->moved != s->few_moved) free(s->moved);
    if (s->x && s->x != s->few_x) free(s->x);
}

/// Lanes of a vector for loops over contacts.
typedef struct {
    double of[LANES];
} lanes;

static inline lanes lanes_of(vec a)
{
    lanes o;
    memcpy(&o, &a, sizeof o);
    return o;
}

/// The records of contacts i to i + 3 and their bodies; the last one again where there are no more.
BT_INLINE void four_from(const bt_cell *cell, bt_idx i, const bt_contact *u[LANES], bt_idx a[LANES], bt_idx b[LANES])
{
    for (int l = 0; l < LANES; l++) {
        u[l] = &cell->contacts[i + l < cell->n_contacts ? i + l : cell->n_contacts - 1];
        a[l] = u[l]->a, b[l] = u[l]->b;
    }
}

/// Lanes of contacts i to i + 3 that there are.
BT_INLINE mask there_are(const bt_cell *cell, bt_idx i)
{
    const int64_t left = cell->n_contacts - i;
    return (mask){0, 1, 2, 3} < (mask){left, left, left, left};
}

BT_INLINE double largest_lane(vec a) { return bt_max(bt_max(a[0], a[1]), bt_max(a[2], a[3])); }
BT_INLINE int64_t sum_of(mask a) { return a[0] + a[1] + a[2] + a[3]; }

BT_INLINE vec limits_of(const bt_limit *const k[LANES], int c)
{
    // of `most` and `flat` the lower one: nothing rises here
    vec most = {k[0]->most[c], k[1]->most[c], k[2]->most[c], k[3]->most[c]};
    return bt_smaller(most, (vec){k[0]->flat[c], k[1]->flat[c], k[2]->flat[c], k[3]->flat[c]});
}

/// As bt_contact_residual and the list of residual_in_place (solver.c).
BT_INLINE bt_found residual(bt_cell *cell, const bt_vel *v, const bt_inv *inv, const bt_problem *p,
                            const uint8_t *moved, bool bounded)
{
    const double near = BT_NEAR * p->tolerance;
    const vec zero = {0}, endless = {INFINITY, INFINITY, INFINITY, INFINITY};
    const bt_limit *limits = cell->laws.limits;
    bt_found f = {0};
    vec most = zero;
    mask rows = {0}, bad = {0};
    for (bt_idx i = 0; i < cell->n_contacts; i += LANES) {
        const bt_contact *u[LANES];
        bt_idx at_a[LANES], at_b[LANES];
        four_from(cell, i, u, at_a, at_b);
        const bt_four_rows r = bt_rows_of(u);
        const bt_masses m = bt_masses_of(&r, bt_take_inv(inv, at_a), bt_take_inv(inv, at_b));
        const bt_motions a = bt_take_four(v, at_a), b = bt_take_four(v, at_b);
        const bt_limit *k[LANES];
        for (int l = 0; bounded && l < LANES; l++) k[l] = &limits[u[l] - cell->contacts];
        const vec dx = b.x - a.x, dy = b.y - a.y, un = r.nx * dx + r.ny * dy;
        vec worst = zero, square[3], total = zero;
        mask on = (r.ln[0] + r.ln[1] > zero) | (r.lt != zero);
        for (int c = 0; c < 2; c++) {
            const mask there = c ? r.two : r.one;
            const vec w = un + r.rbn[c] * b.w - r.ran[c] * a.w + r.bias[c];
            vec map;
            if (bounded) {
                const vec to = w - m.w[c] * r.ln[c];
                map = bt_larger(zero, bt_smaller(-to * m.mn[c], limits_of(k, c)));
            } else {
                map = bt_larger(zero, r.ln[c] - w * m.mn[c]);
            }
            const vec e = bt_only(there, (map - r.ln[c]) * m.w[c]);
            worst = bt_larger(worst, bt_size_of(e));
            square[c] = e * e;
            total += bt_only(there, r.ln[c]);
            on |= there & ~(w >= zero);
        }
        const vec wt = r.nx * dy - r.ny * dx + r.rbt * b.w - r.rat * a.w, bound = r.mu * total;
        const vec e = (bt_larger(-bound, bt_smaller(bound, r.lt - wt * m.mt)) - r.lt) * m.wt;
        square[2] = e * e;
        worst = bt_choose(bt_size_of(wt) < endless, bt_larger(worst, bt_size_of(e)), endless);
        const mask counts = there_are(cell, i) & (bounded ? r.one : ~(mask){0}); // sheets one by one
        most = bt_larger(most, bt_only(counts, worst));
        bad -= counts & (worst > near);
        rows += counts & (1 - r.one - r.two);
        const lanes normal = lanes_of(square[0]), second = lanes_of(square[1]), tangent = lanes_of(square[2]);
        for (int l = 0; l < LANES && i + l < cell->n_contacts; l++) {
            bool listed = p->plain || on[l] || moved[i + l];
            if (bounded && u[l]->n == 0) {
                const bt_mass own = bt_mass_of(u[l], inv);
                const double largest = bt_sheets_residual(u[l], &own, k[l], v, &f.squares);
                listed = p->plain || u[l]->ln[0] + u[l]->ln[1] > 0 || u[l]->lt != 0 || moved[i + l] || largest > 0;
                f.most = bt_max(f.most, largest);
                f.bad += largest > near;
                f.rows += 2;
            } else {
                f.squares += normal.of[l];
                f.squares += second.of[l];
                f.squares += tangent.of[l];
            }
            cell->work.list[cell->work.n_list] = i + l;
            cell->work.n_list += listed;
        }
    }
    f.most = bt_max(f.most, largest_lane(most));
    f.bad += sum_of(bad);
    f.rows += sum_of(rows);
    return f;
}

BT_FOR_EACH_CPU
static bt_found residual_of_rigid(bt_cell *cell, const bt_vel *v, const bt_inv *inv, const bt_problem *p,
                                  const uint8_t *moved)
{
    return residual(cell, v, inv, p, moved, false);
}

BT_FOR_EACH_CPU
static bt_found residual_of_bounded(bt_cell *cell, const bt_vel *v, const bt_inv *inv, const bt_problem *p,
                                    const uint8_t *moved)
{
    return residual(cell, v, inv, p, moved, true);
}

bt_found bt_batch_residual(bt_cell *cell, const bt_vel *v, const bt_inv *inv, const bt_problem *p)
{
    last_sweep s;
    take_last(cell, false, &s);
    const bt_found f = cell->laws.limits ? residual_of_bounded(cell, v, inv, p, s.moved)
                                         : residual_of_rigid(cell, v, inv, p, s.moved);
    free_last(&s);
    return f;
}

/// As residual_in_place of project.c.
BT_FOR_EACH_CPU
static bt_found residual_of_projection(bt_cell *cell, double slop, const bt_vel *d, const bt_inv *inv,
                                       const bt_problem *p, const last_sweep *s)
{
    const double near = BT_NEAR * p->tolerance;
    const vec zero = {0};
    bt_found f = {0};
    vec most = zero;
    mask rows = {0}, bad = {0};
    for (bt_idx i = 0; i < cell->n_contacts; i += LANES) {
        const bt_contact *u[LANES];
        bt_idx at_a[LANES], at_b[LANES];
        four_from(cell, i, u, at_a, at_b);
        const bt_four_rows r = bt_rows_of(u);
        const bt_masses m = bt_masses_of(&r, bt_take_inv(inv, at_a), bt_take_inv(inv, at_b));
        const bt_motions a = bt_take_four(d, at_a), b = bt_take_four(d, at_b);
        const vec un = r.nx * (b.x - a.x) + r.ny * (b.y - a.y);
        vec worst = zero, square[2];
        mask on = {0};
        for (int c = 0; c < 2; c++) {
            const mask there = c ? r.two : r.one;
            vec gap, x;
            for (int l = 0; l < LANES; l++) {
                const bt_idx j = (bt_idx)(u[l] - cell->contacts);
                gap[l] = cell->gaps[j].gap[c], x[l] = s->x[j][c];
            }
            const vec open = un + r.rbn[c] * b.w - r.ran[c] * a.w + gap + slop;
            const vec e = bt_only(there, bt_size_of(bt_larger(zero, x - open * m.mn[c]) - x) * m.w[c]);
            worst = bt_larger(worst, e);
            square[c] = e * e;
            on |= there & ((x > zero) | ~(open >= zero));
        }
        const mask counts = there_are(cell, i);
        most = bt_larger(most, bt_only(counts, worst));
        bad -= counts & (worst > near);
        rows += counts & (-r.one - r.two);
        const lanes first = lanes_of(square[0]), second = lanes_of(square[1]);
        for (int l = 0; l < LANES && i + l < cell->n_contacts; l++) {
            f.squares += first.of[l];
            f.squares += second.of[l];
            cell->work.list[cell->work.n_list] = i + l;
            cell->work.n_list += on[l] || s->moved[i + l];
        }
    }
    f.most = bt_max(f.most, largest_lane(most));
    f.bad += sum_of(bad);
    f.rows += sum_of(rows);
    return f;
}

bt_found bt_batch_projection_residual(bt_cell *cell, double slop, const bt_vel *d, const bt_inv *inv,
                                      const bt_problem *p)
{
    last_sweep s;
    take_last(cell, true, &s);
    const bt_found f = residual_of_projection(cell, slop, d, inv, p, &s);
    free_last(&s);
    return f;
}

// --- arithmetic ------------------------------------------------------------------------------------------------------

typedef bt_motions motion;

BT_INLINE void store(bt_vel *v, const bt_idx *body, const bool *moves, motion m)
{
    const uint32_t all = 0x01010101; // of nearly all batches
    bt_transpose(&m);
    if (memcmp(moves, &all, sizeof all) == 0) {
        memcpy(&v[body[0]], &m.x, sizeof m.x);
        memcpy(&v[body[1]], &m.y, sizeof m.y);
        memcpy(&v[body[2]], &m.w, sizeof m.w);
        memcpy(&v[body[3]], &m.unused, sizeof m.unused);
        return;
    }
    if (moves[0]) memcpy(&v[body[0]], &m.x, sizeof m.x);
    if (moves[1]) memcpy(&v[body[1]], &m.y, sizeof m.y);
    if (moves[2]) memcpy(&v[body[2]], &m.w, sizeof m.w);
    if (moves[3]) memcpy(&v[body[3]], &m.unused, sizeof m.unused);
}

/// As bt_solve_normals.
BT_INLINE void solve_normals(const bt_batch *o, const motion *a, const motion *b, vec *l1, vec *l2)
{
    const vec zero = {0}, un = o->nx * (b->x - a->x) + o->ny * (b->y - a->y);
    const vec u1 = un + o->rbn[0] * b->w - o->ran[0] * a->w + o->bias[0],
              u2 = un + o->rbn[1] * b->w - o->ran[1] * a->w + o->bias[1];
    const vec b1 = u1 - o->w[0] * o->x[0] - o->w12 * o->x[1], b2 = u2 - o->w12 * o->x[0] - o->w[1] * o->x[1];
    const vec both1 = (o->w12 * b2 - o->w[1] * b1) * o->per_det, both2 = (o->w12 * b1 - o->w[0] * b2) * o->per_det;
    const vec only1 = bt_larger(zero, -b1 * o->mn[0]), only2 = bt_larger(zero, -b2 * o->mn[1]);
    const mask both = (o->per_det > zero) & (both1 >= zero) & (both2 >= zero),
               first = (b2 + o->w12 * only1 >= zero) | (only2 == zero);
    *l1 = bt_choose(both, both1, bt_choose(first, only1, zero));
    *l2 = bt_choose(both, both2, bt_choose(first, zero, only2));
}

BT_INLINE bool any_of(mask m) { return (m[0] | m[1] | m[2] | m[3]) != 0; }

/// As bt_limit_rim.
BT_INLINE void rim(const bt_batch *o, const vec bound[2], const vec b[2], vec l[2])
{
    const vec zero = {0}, endless = {INFINITY, INFINITY, INFINITY, INFINITY}, half = {0.5, 0.5, 0.5, 0.5};
    vec least = endless;
    mask done = {0};
    for (int side = 0; side < 4; side++) {
        const int i = side >> 1, k = 1 - i;
        vec x[2];
        x[i] = side & 1 ? bound[i] : zero;
        x[k] = bt_larger(zero, bt_smaller(bound[k], -(b[k] + o->w12 * x[i]) * o->mn[k]));
        const vec slope = b[i] + o->w[i] * x[i] + o->w12 * x[k];
        const vec value = x[0] * (half * (o->w[0] * x[0] + o->w12 * x[1]) + b[0]) +
                          x[1] * (half * (o->w12 * x[0] + o->w[1] * x[1]) + b[1]);
        const mask right = side & 1 ? slope <= zero : slope >= zero, open = ~done & (x[i] < endless),
                   take = open & (right | (value < least));
        l[0] = bt_choose(take, x[0], l[0]);
        l[1] = bt_choose(take, x[1], l[1]);
        least = bt_choose(take, value, least);
        done |= open & right;
    }
}

/// As bt_limit_normals where no bound rises.
BT_INLINE void bound_normals(const bt_batch *o, const vec bound[2], const motion *p, const motion *q, vec *l1, vec *l2)
{
    const mask over = (*l1 > bound[0]) | (*l2 > bound[1]);
    if (!any_of(over)) return;
    const vec zero = {0}, un = o->nx * (q->x - p->x) + o->ny * (q->y - p->y);
    vec b[2], l[2] = {*l1, *l2};
    for (int i = 0; i < 2; i++)
        b[i] = un + o->rbn[i] * q->w - o->ran[i] * p->w + o->bias[i] - o->w[i] * o->x[i] - o->w12 * o->x[1 - i];
    const vec alone = bt_larger(zero, bt_smaller(-b[0] * o->mn[0], bound[0]));
    rim(o, bound, b, l);
    const mask one = o->mn[1] == zero;
    *l1 = bt_choose(over, bt_choose(one, alone, l[0]), *l1);
    *l2 = bt_choose(over & ~one, l[1], *l2);
}

/// As bt_update_sheets; lanes without a contact have a disc of 0 and no step.
BT_INLINE vec update_sheets(bt_batch *o, vec disc, bt_vel *v)
{
    motion a = bt_take_four(v, o->a), b = bt_take_four(v, o->b);
    const vec dvx = b.x - a.x, dvy = b.y - a.y;
    vec x = o->x[0] - (o->nx * dvx + o->ny * dvy + o->rbn[0] * b.w - o->ran[0] * a.w) * o->mn[0];
    vec y = o->x[2] - (o->nx * dvy - o->ny * dvx + o->rbt * b.w - o->rat * a.w) * o->mt, far = {0};
    const vec square = x * x + y * y, one = {1, 1, 1, 1};
    for (int l = 0; l < LANES; l++) far[l] = sqrt(square[l]); // one instruction for all
    const vec scale = bt_choose(far > disc, disc / far, one);
    x *= scale;
    y *= scale;
    const vec dx = x - o->x[0], dy = y - o->x[2], jx = dx * o->nx - dy * o->ny, jy = dx * o->ny + dy * o->nx;
    a.x -= o->ma * jx;
    a.y -= o->ma * jy;
    a.w -= o->ia * (dx * o->ran[0] + dy * o->rat);
    b.x += o->mb * jx;
    b.y += o->mb * jy;
    b.w += o->ib * (dx * o->rbn[0] + dy * o->rbt);
    o->x[0] = x, o->x[2] = y;
    store(v, o->a, o->moves_a, a);
    store(v, o->b, o->moves_b, b);
    return bt_larger(bt_size_of(dx), bt_size_of(dy)) * o->wt;
}

/// As bt_update_contact, with bounds of the normals or NULL; the largest corrections, m/s.
BT_INLINE vec update(bt_batch *o, const vec *limits, bt_vel *v)
{
    motion a = bt_take_four(v, o->a), b = bt_take_four(v, o->b);
    vec l1, l2;
    solve_normals(o, &a, &b, &l1, &l2);
    if (limits) bound_normals(o, limits, &a, &b, &l1, &l2);
    const vec d1 = l1 - o->x[0], d2 = l2 - o->x[1], jn = d1 + d2, jx = jn * o->nx, jy = jn * o->ny;
    a.x -= o->ma * jx;
    a.y -= o->ma * jy;
    a.w -= o->ia * (d1 * o->ran[0] + d2 * o->ran[1]);
    b.x += o->mb * jx;
    b.y += o->mb * jy;
    b.w += o->ib * (d1 * o->rbn[0] + d2 * o->rbn[1]);
    const vec ut = o->nx * (b.y - a.y) - o->ny * (b.x - a.x) + o->rbt * b.w - o->rat * a.w, bound = o->mu * (l1 + l2);
    const vec t = bt_larger(-bound, bt_smaller(bound, o->x[2] - ut * o->mt)), dt = t - o->x[2], tx = dt * o->ny,
              ty = dt * o->nx;
    a.x += o->ma * tx;
    a.y -= o->ma * ty;
    a.w -= o->ia * (dt * o->rat);
    b.x -= o->mb * tx;
    b.y += o->mb * ty;
    b.w += o->ib * (dt * o->rbt);
    o->x[0] = l1, o->x[1] = l2, o->x[2] = t;
    store(v, o->a, o->moves_a, a);
    store(v, o->b, o->moves_b, b);
    return bt_larger(bt_larger(bt_size_of(d1) * o->w[0], bt_size_of(d2) * o->w[1]), bt_size_of(dt) * o->wt);
}

/// As the update of one contact in project.c: its points one after the other.
BT_INLINE vec project(bt_batch *o, bt_vel *d)
{
    motion a = bt_take_four(d, o->a), b = bt_take_four(d, o->b);
    const vec zero = {0};
    vec most = zero;
    for (int i = 0; i < 2; i++) {
        const vec un = o->nx * (b.x - a.x) + o->ny * (b.y - a.y) + o->rbn[i] * b.w - o->ran[i] * a.w;
        const vec open = un + o->bias[i] + o->mu, p = bt_larger(zero, o->x[i] - open * o->mn[i]), step = p - o->x[i];
        const vec x = step * o->nx, y = step * o->ny;
        a.x -= o->ma * x;
        a.y -= o->ma * y;
        a.w -= o->ia * (step * o->ran[i]);
        b.x += o->mb * x;
        b.y += o->mb * y;
        b.w += o->ib * (step * o->rbn[i]);
        o->x[i] = p;
        most = bt_larger(most, bt_size_of(step) * o->w[i]);
    }
    store(d, o->a, o->moves_a, a);
    store(d, o->b, o->moves_b, b);
    return most;
}

BT_FOR_EACH_CPU
static double pass(bt_batch *batch, bt_idx n, bt_vel *v)
{
    vec most = {0};
    for (bt_idx k = 0; k < n; k++) most = bt_larger(most, update(&batch[k], NULL, v));
    return largest_lane(most);
}

BT_FOR_EACH_CPU
static double pass_projection(bt_batch *batch, bt_idx n, bt_vel *d)
{
    vec most = {0};
    for (bt_idx k = 0; k < n; k++) most = bt_larger(most, project(&batch[k], d));
    return largest_lane(most);
}

/// The same where contacts have bounds; apart, or rigid ice would pay for the registers that this takes.
BT_FOR_EACH_CPU
static double pass_bounded(bt_batch *batch, bt_idx n, bt_vel *v)
{
    vec most = {0};
    for (bt_idx k = 0; k < n; k++) {
        bt_batch *o = &batch[k];
        const vec *limits = ((const bounds *)(batch + n))[k].of;
        most = bt_larger(most, o->kind == SHEETS ? update_sheets(o, limits[0], v) : update(o, limits, v));
    }
    return largest_lane(most);
}

/// Unknowns of a batch after their move: of one visit to a cell.
typedef struct {
    vec x[3];
} moved;

BT_INLINE void move_unknowns(bt_batch *batch, bt_idx n, int unknowns, double beta, moved *y)
{
    for (bt_idx k = 0; k < n; k++) {
        bt_batch *o = &batch[k];
        for (int c = 0; c < unknowns; c++) {
            const vec now = o->x[c];
            if (beta > 0) o->x[c] = now + beta * (now - o->before[c]);
            o->before[c] = now;
            y[k].x[c] = o->x[c];
        }
    }
}

BT_INLINE double sum_against(const bt_batch *batch, bt_idx n, int unknowns, const moved *y)
{
    vec sum = {0};
    for (bt_idx k = 0; k < n; k++) {
        const bt_batch *o = &batch[k];
        for (int c = 0; c < unknowns; c++)
            sum += (c < 2 ? o->w[c] : o->wt) * (y[k].x[c] - o->x[c]) * (o->x[c] - o->before[c]);
    }
    return sum[0] + sum[1] + sum[2] + sum[3];
}

BT_FOR_EACH_CPU
static void move(bt_batch *batch, bt_idx n, double beta, moved *y) { move_unknowns(batch, n, 3, beta, y); }

BT_FOR_EACH_CPU
static double against(const bt_batch *batch, bt_idx n, const moved *y) { return sum_against(batch, n, 3, y); }

BT_FOR_EACH_CPU
static void move_projection(bt_batch *batch, bt_idx n, double beta, moved *y) { move_unknowns(batch, n, 2, beta, y); }

BT_FOR_EACH_CPU
static double against_projection(const bt_batch *batch, bt_idx n, const moved *y)
{
    return sum_against(batch, n, 2, y);
}

typedef double pass_of_batches(bt_batch *batch, bt_idx n, bt_vel *v);

static double visit(bt_cell *cell, bt_vel *v, pass_of_batches *once, const bt_sweep *s, int times, double enough,
                    int64_t *done, double *most)
{
    bt_batch *batch = cell->work.batch;
    const bt_idx n_batches = cell->work.n_batches;
    moved few[FEW / LANES], *y = few;
    if (s->moves && n_batches > FEW / LANES) y = bt_alloc_aligned((size_t)n_batches, sizeof *y);
    const bool projection = once == pass_projection;
    if (s->moves) (projection ? move_projection : move)(batch, n_batches, s->beta, y);
    double last = INFINITY;
    for (int n = 0; n == 0 || (n < times && last > enough); n++) {
        last = once(batch, n_batches, v);
        if (n == 0) *most = last;
        *done += cell->work.n_list;
    }
    const double turned = !s->moves ? 0 : (projection ? against_projection : against)(batch, n_batches, y);
    if (y != few) free(y);
    return turned;
}

double bt_batch_sweep(bt_cell *cell, bt_vel *v, const bt_inv *inv, const bt_sweep *s, int times, double enough,
                      int64_t *done, double *most)
{
    if (!cell->work.packed) pack(cell, inv, NULL);
    return visit(cell, v, cell->laws.limits ? pass_bounded : pass, s, times, enough, done, most);
}

double bt_batch_project(bt_cell *cell, double slop, bt_vel *d, const bt_inv *inv, const bt_sweep *s, int64_t *done,
                        double *most)
{
    if (!cell->work.packed) pack(cell, inv, &slop);
    return visit(cell, d, pass_projection, s, 1, 0, done, most);
}
