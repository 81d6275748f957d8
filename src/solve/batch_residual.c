// SPDX-License-Identifier: MIT
// Residual passes four contacts at a time: the same numbers and the same list as contact by contact (solver.c).
// Contacts are read where they are, in batches or not; they leave their batches only when the list has changed, as in a
// tenth of the cells.
#include "solve/batch.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "solve/batch_layout.h"
#include "solve/kernel.h"
#include "solve/rows.h"

/// Lanes of a vector for loops over contacts.
typedef struct {
    double of[BT_LANES];
} lanes;

static inline lanes lanes_of(bt_vec a)
{
    lanes o;
    memcpy(&o, &a, sizeof o);
    return o;
}

/// Four contacts with their masses and the velocities of their bodies.
typedef struct {
    bt_four_rows r;
    bt_masses m;
    bt_motions a, b;
} four;

BT_INLINE four four_from(const bt_contact *const contact[BT_LANES], const bt_vel *v, const bt_inv *inv)
{
    four o;
    bt_idx a[BT_LANES], b[BT_LANES];
    for (int l = 0; l < BT_LANES; l++) a[l] = contact[l]->a, b[l] = contact[l]->b;
    o.r = bt_rows_of(contact);
    o.m = bt_masses_of(&o.r, bt_take_inv(inv, a), bt_take_inv(inv, b));
    o.a = bt_take_four(v, a), o.b = bt_take_four(v, b);
    return o;
}

BT_INLINE four four_of(const bt_batch *batch, const bt_vel *v)
{
    const bt_mask n = {batch->points[0], batch->points[1], batch->points[2], batch->points[3]}, none = {0};
    return (four){.r = {.nx = batch->nx, .ny = batch->ny, .rat = batch->rat, .rbt = batch->rbt,
                        .ran = {batch->ran[0], batch->ran[1]}, .rbn = {batch->rbn[0], batch->rbn[1]},
                        .bias = {batch->bias[0], batch->bias[1]}, .mu = batch->mu,
                        .ln = {batch->x[0], batch->x[1]}, .lt = batch->x[2], .one = n > none, .two = n > none + 1},
                  .m = {.w = {batch->w[0], batch->w[1]}, .mn = {batch->mn[0], batch->mn[1]}, .wt = batch->wt,
                        .mt = batch->mt},
                  .a = bt_take_four(v, batch->a), .b = bt_take_four(v, batch->b)};
}

/// The first n lanes.
BT_INLINE bt_mask first_lanes(int64_t n) { return (bt_mask){0, 1, 2, 3} < (bt_mask){n, n, n, n}; }

BT_INLINE int64_t sum_of(bt_mask a) { return a[0] + a[1] + a[2] + a[3]; }

/// A residual pass over a cell.
typedef struct {
    const bt_problem *problem;
    const bt_vel *v;
    const bt_inv *inv;
    bt_found found;
    bt_vec most;
    bt_mask rows, bad;
} look;

/// The lower of `most` and `flat`: nothing rises here.
BT_INLINE bt_vec limits_of(const bt_limit *const limit[BT_LANES], int c)
{
    bt_vec most = {limit[0]->most[c], limit[1]->most[c], limit[2]->most[c], limit[3]->most[c]};
    return bt_smaller(most, (bt_vec){limit[0]->flat[c], limit[1]->flat[c], limit[2]->flat[c], limit[3]->flat[c]});
}

/// Result for four contacts, lane by lane: the squares of their rows, whether any of these is not 0, and which contacts
/// bear load or close.
typedef struct {
    lanes square[3];
    bool misses;
    bt_mask on;
} seen;

/// As bt_contact_residual, for the first n lanes, except sheets; limit: their bounds, or NULL.
BT_INLINE seen look_at(look *o, const four *f, const bt_limit *const *limit, int n)
{
    const bt_vec zero = {0}, endless = {INFINITY, INFINITY, INFINITY, INFINITY};
    const double tolerance = o->problem->tolerance;
    const bt_four_rows *r = &f->r;
    const bt_masses *m = &f->m;
    const bt_vec dx = f->b.x - f->a.x, dy = f->b.y - f->a.y, un = r->nx * dx + r->ny * dy;
    bt_vec worst = zero, total = zero;
    bt_mask right = ~(bt_mask){0};
    seen s = {.on = (r->ln[0] + r->ln[1] > zero) | (r->lt != zero)};
    for (int c = 0; c < 2; c++) {
        const bt_mask there = c ? r->two : r->one;
        const bt_vec w = un + r->rbn[c] * f->b.w - r->ran[c] * f->a.w + r->bias[c];
        bt_vec map;
        if (limit) map = bt_larger(zero, bt_smaller(-(w - m->w[c] * r->ln[c]) * m->mn[c], limits_of(limit, c)));
        else map = bt_larger(zero, r->ln[c] - w * m->mn[c]);
        const bt_vec more = map - r->ln[c];
        bt_vec e = bt_only(there, bt_size_of(more * m->w[c]));
        if (limit) { // bt_short_residual
            const bt_vec lacks = bt_smaller(-w, (more / map) * (tolerance / BT_SHORT));
            e = bt_larger(e, bt_only(there & (more > zero), lacks));
        }
        worst = bt_larger(worst, e);
        s.square[c] = lanes_of(e * e);
        right &= e * e == zero;
        total += bt_only(there, r->ln[c]);
        s.on |= there & ~(w >= zero);
    }
    const bt_vec wt = r->nx * dy - r->ny * dx + r->rbt * f->b.w - r->rat * f->a.w, bound = r->mu * total;
    const bt_vec e = (bt_larger(-bound, bt_smaller(bound, r->lt - wt * m->mt)) - r->lt) * m->wt;
    s.square[2] = lanes_of(e * e);
    s.misses = bt_joined(~(right & (e * e == zero))) != 0;
    worst = bt_choose(bt_size_of(wt) < endless, bt_larger(worst, bt_size_of(e)), endless);
    const bt_mask counts = first_lanes(n) & (limit ? r->one : ~(bt_mask){0});
    o->most = bt_larger(o->most, bt_only(counts, worst));
    o->bad -= counts & (worst > BT_NEAR * tolerance);
    o->rows += counts & (1 - r->one - r->two);
    return s;
}

/// Add the squares of lane l.
BT_INLINE void add_squares(look *o, const seen *s, int l)
{
    for (int c = 0; c < 3; c++) o->found.squares += s->square[c].of[l];
}

/// The same for sheets, one by one.
static bool sheets_are_on(look *o, const bt_contact *contact, const bt_mass *m, const bt_limit *limit)
{
    const double r = bt_sheets_residual(contact, m, limit, o->v, o->problem->tolerance, &o->found.squares);
    o->found.most = bt_max(o->found.most, r);
    o->found.bad += r > BT_NEAR * o->problem->tolerance;
    o->found.rows += 2;
    return contact->ln[0] + contact->ln[1] > 0 || contact->lt != 0 || r > 0;
}

/// Marks of contacts. UNSEEN: in no batch. LEAVES: in a batch, but no longer to be swept. LISTED: to be swept; a lane
/// of a mask.
enum { UNSEEN = 0, LEAVES = 1, LISTED = -1 };

/// Residuals of contacts index[n] of the cell. Returns which are to be swept.
BT_INLINE bt_mask look_at_records(look *o, const bt_cell *cell, bool bounded,
                                  const bt_contact *const contact[BT_LANES], const bt_idx index[BT_LANES], int n)
{
    const bt_limit *limit[BT_LANES];
    for (int l = 0; bounded && l < BT_LANES; l++) limit[l] = &cell->laws->limits[index[l]];
    const four f = four_from(contact, o->v, o->inv);
    seen s = bounded ? look_at(o, &f, limit, n) : look_at(o, &f, NULL, n);
    bool sheets = false;
    for (int l = 0; bounded && l < n; l++) sheets = sheets || contact[l]->n == 0;
    for (int l = 0; (sheets || s.misses) && l < n; l++) { // in sequence: the sum depends on the order
        if (sheets && contact[l]->n == 0) {
            const bt_mass m = bt_mass_of(contact[l], o->inv);
            s.on[l] = sheets_are_on(o, contact[l], &m, limit[l]) ? LISTED : UNSEEN;
        } else {
            add_squares(o, &s, l);
        }
    }
    return o->problem->plain ? (bt_mask){LISTED, LISTED, LISTED, LISTED} : s.on;
}

/// The sheets in lane l of a batch, with the members that their residual needs.
static bt_contact sheets_of(const bt_batch *batch, int l)
{
    return (bt_contact){.nx = batch->nx[l], .ny = batch->ny[l], .rat = batch->rat[l], .rbt = batch->rbt[l],
                        .ran = {batch->ran[0][l]}, .rbn = {batch->rbn[0][l]}, .ln = {batch->x[0][l]},
                        .lt = batch->x[2][l], .a = batch->a[l], .b = batch->b[l]};
}

BT_INLINE void look_at_batch(look *o, const bt_cell *cell, bool bounded, const bt_batch *batch, int64_t *mark)
{
    const bt_limit *limit[BT_LANES];
    const bool sheets = bounded && batch->kind == BT_BATCH_SHEETS;
    for (int l = 0; bounded && l < BT_LANES; l++) limit[l] = &cell->laws->limits[batch->contact[l]];
    // which the last sweep has changed
    bt_mask on = (batch->x[0] != batch->before[0]) | (batch->x[1] != batch->before[1]) |
                 (batch->x[2] != batch->before[2]);
    if (sheets) {
        for (int l = 0; l < batch->n; l++) {
            const bt_contact contact = sheets_of(batch, l);
            const bt_mass m = {.w = {batch->w[0][l]}, .mn = {batch->mn[0][l]}, .wt = batch->wt[l], .mt = batch->mt[l]};
            if (sheets_are_on(o, &contact, &m, limit[l])) on[l] = LISTED;
        }
    } else {
        const four f = four_of(batch, o->v);
        const seen s = bounded ? look_at(o, &f, limit, batch->n) : look_at(o, &f, NULL, batch->n);
        for (int l = 0; s.misses && l < batch->n; l++) add_squares(o, &s, l);
        on |= s.on;
    }
    for (int l = 0; l < batch->n; l++) mark[batch->contact[l]] = on[l] || o->problem->plain ? LISTED : LEAVES;
}

/// Mark the contacts that the last sweep has changed.
static void mark_moved(const bt_cell *cell, int64_t *mark)
{
    for (bt_idx k = 0; k < cell->work->n_last; k++) {
        const bt_unknowns *last = &cell->work->last[k];
        const bt_contact *contact = &cell->contacts[last->contact];
        if (contact->ln[0] != last->before[0] || contact->ln[1] != last->before[1] || contact->lt != last->before[2])
            mark[last->contact] = LISTED;
    }
}

/// Does a contact without load, other than sheets, open? Then its residual is 0, and sweeps would not change it. Half
/// of a jam is like that: the residual passes over 10,000 packed floes took a quarter less time with this test.
BT_INLINE bool is_quiet(const bt_contact *contact, const bt_vel *v)
{
    const bt_vel *a = &v[contact->a], *b = &v[contact->b];
    const double un = contact->nx * (b->x - a->x) + contact->ny * (b->y - a->y);
    bool opens = contact->n > 0 && contact->ln[0] == 0 && contact->ln[1] == 0 && contact->lt == 0;
    for (int c = 0; opens && c < contact->n; c++) {
        const double w = un + contact->rbn[c] * b->w - contact->ran[c] * a->w + contact->bias[c];
        opens = w >= 0 && w < INFINITY;
    }
    return opens;
}

/// Process the contacts of a cell that are in no batch: those that may miss four at a time.
BT_INLINE void look_at_others(look *o, const bt_cell *cell, bool bounded, int64_t *mark)
{
    const bool packed = cell->work->packed;
    const bt_contact *records = packed ? bt_batch_others(cell) : cell->contacts, *contact[BT_LANES];
    bt_idx index[BT_LANES];
    int n = 0;
    for (bt_idx i = 0; i <= cell->n_contacts; i++) {
        const bool ends = i == cell->n_contacts;
        if (!ends && packed && mark[i] != UNSEEN) continue;
        if (!ends && !o->problem->plain && is_quiet(records, o->v)) {
            o->found.rows += records++->n + 1;
            continue;
        }
        if (!ends) contact[n] = records++, index[n++] = i;
        if (n == 0 || !(ends || n == BT_LANES)) continue;
        for (int l = n; l < BT_LANES; l++) contact[l] = contact[n - 1], index[l] = index[n - 1];
        const bt_mask on = look_at_records(o, cell, bounded, contact, index, n);
        for (int l = 0; l < n; l++) mark[index[l]] |= on[l];
        n = 0;
    }
}

BT_INLINE void look_at_all(look *o, const bt_cell *cell, bool bounded, int64_t *mark)
{
    if (cell->work->packed) {
        for (bt_idx k = 0; k < cell->work->n_batches; k++)
            look_at_batch(o, cell, bounded, &cell->work->batch[k], mark);
    } else {
        mark_moved(cell, mark);
    }
    look_at_others(o, cell, bounded, mark);
    o->found.most = bt_max(o->found.most, bt_largest_lane(o->most));
    o->found.bad += sum_of(o->bad);
    o->found.rows += sum_of(o->rows);
}

BT_FOR_EACH_CPU
static void look_at_rigid(look *o, const bt_cell *cell, int64_t *mark) { look_at_all(o, cell, false, mark); }

BT_FOR_EACH_CPU
static void look_at_bounded(look *o, const bt_cell *cell, int64_t *mark) { look_at_all(o, cell, true, mark); }

/// Are the marked contacts those in the batches of the cell? *listed: their number.
static bool same_list(const bt_cell *cell, const int64_t *mark, bt_idx *listed)
{
    bt_idx in_batches = 0;
    *listed = 0;
    for (bt_idx k = 0; k < cell->work->n_batches; k++) in_batches += cell->work->batch[k].n;
    for (bt_idx i = 0; i < cell->n_contacts; i++) {
        if (mark[i] == LEAVES) return false;
        *listed += mark[i] == LISTED;
    }
    return *listed == in_batches;
}

/// List the marked contacts; batches of the same contacts stay as they are.
static void list_marked(bt_cell *cell, const int64_t *mark)
{
    bt_idx n = 0;
    if (!cell->work->packed || !same_list(cell, mark, &n)) {
        bt_batch_unpack(cell);
        bt_rounds_list(cell);
        bt_idx *list = cell->work->list;
        n = 0;
        for (bt_idx i = 0; i < cell->n_contacts; i++) {
            list[n] = i;
            n += mark[i] == LISTED;
        }
    }
    cell->n_listed = n;
}

bt_found bt_batch_residual(bt_cell *cell, const bt_vel *v, const bt_inv *inv, const bt_problem *problem)
{
    const size_t n = (size_t)cell->n_contacts;
    int64_t few[BT_FEW], *mark = n <= BT_FEW ? few : bt_realloc(NULL, n, sizeof *mark);
    if (n > 0) memset(mark, 0, n * sizeof *mark); // UNSEEN
    look o = {.problem = problem, .v = v, .inv = inv};
    (cell->laws->limits ? look_at_bounded : look_at_rigid)(&o, cell, mark);
    list_marked(cell, mark);
    if (mark != few) free(mark);
    return o.found;
}
