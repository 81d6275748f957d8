// SPDX-License-Identifier: MIT
// Sweeps through the batches of a cell: the arithmetic of bt_update_contact (kernel.h), four contacts at a time,
// preceded by the extrapolation of their unknowns.
#include "solve/batch.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "solve/batch_layout.h"
#include "solve/rows.h"

typedef bt_vec vec;
typedef bt_mask mask;
typedef bt_motions motion;

BT_INLINE void store(bt_vel *v, const bt_idx *body, const bool *moves, motion m)
{
    const uint32_t all = 0x01010101; // true of nearly all batches
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
BT_INLINE void solve_normals(const bt_batch *batch, const motion *a, const motion *b, vec *l1, vec *l2)
{
    const vec zero = {0}, un = batch->nx * (b->x - a->x) + batch->ny * (b->y - a->y);
    const vec u1 = un + batch->rbn[0] * b->w - batch->ran[0] * a->w + batch->bias[0],
              u2 = un + batch->rbn[1] * b->w - batch->ran[1] * a->w + batch->bias[1];
    const vec b1 = u1 - batch->w[0] * batch->x[0] - batch->w12 * batch->x[1],
              b2 = u2 - batch->w12 * batch->x[0] - batch->w[1] * batch->x[1];
    const vec both1 = (batch->w12 * b2 - batch->w[1] * b1) * batch->per_det,
              both2 = (batch->w12 * b1 - batch->w[0] * b2) * batch->per_det;
    const vec only1 = bt_larger(zero, -b1 * batch->mn[0]), only2 = bt_larger(zero, -b2 * batch->mn[1]);
    const mask both = (batch->per_det > zero) & (both1 >= zero) & (both2 >= zero),
               first = (b2 + batch->w12 * only1 >= zero) | (only2 == zero);
    *l1 = bt_choose(both, both1, bt_choose(first, only1, zero));
    *l2 = bt_choose(both, both2, bt_choose(first, zero, only2));
}

/// As bt_limit_rim.
BT_INLINE void rim(const bt_batch *batch, const vec bound[2], const vec b[2], vec l[2])
{
    const vec zero = {0}, endless = {INFINITY, INFINITY, INFINITY, INFINITY}, half = {0.5, 0.5, 0.5, 0.5};
    vec least = endless;
    mask done = {0};
    for (int side = 0; side < 4; side++) {
        const int i = side >> 1, k = 1 - i;
        vec x[2];
        x[i] = side & 1 ? bound[i] : zero;
        x[k] = bt_larger(zero, bt_smaller(bound[k], -(b[k] + batch->w12 * x[i]) * batch->mn[k]));
        const vec slope = b[i] + batch->w[i] * x[i] + batch->w12 * x[k];
        const vec value = x[0] * (half * (batch->w[0] * x[0] + batch->w12 * x[1]) + b[0]) +
                          x[1] * (half * (batch->w12 * x[0] + batch->w[1] * x[1]) + b[1]);
        const mask right = side & 1 ? slope <= zero : slope >= zero, open = ~done & (x[i] < endless),
                   take = open & (right | (value < least));
        l[0] = bt_choose(take, x[0], l[0]);
        l[1] = bt_choose(take, x[1], l[1]);
        least = bt_choose(take, value, least);
        done |= open & right;
    }
}

/// As bt_limit_normals where no bound rises. The missing second point of a contact has no mass and no bound: it stays
/// at 0 on every side of the rim, and the first point reaches its bound as it does alone.
BT_INLINE void bound_normals(const bt_batch *batch, const vec bound[2], const motion *p, const motion *q, vec *l1,
                             vec *l2)
{
    const mask over = (*l1 > bound[0]) | (*l2 > bound[1]);
    if (bt_joined(over) == 0) return;
    const vec un = batch->nx * (q->x - p->x) + batch->ny * (q->y - p->y);
    vec b[2], l[2] = {*l1, *l2};
    for (int i = 0; i < 2; i++)
        b[i] = un + batch->rbn[i] * q->w - batch->ran[i] * p->w + batch->bias[i] - batch->w[i] * batch->x[i] -
               batch->w12 * batch->x[1 - i];
    rim(batch, bound, b, l);
    *l1 = bt_choose(over, l[0], *l1);
    *l2 = bt_choose(over, l[1], *l2);
}

/// As bt_update_sheets; lanes without a contact bear nothing and have step length 0.
BT_INLINE vec update_sheets(bt_batch *batch, vec friction, bt_vel *v)
{
    const vec zero = {0}, one = {1, 1, 1, 1};
    motion a = bt_take_four(v, batch->a), b = bt_take_four(v, batch->b);
    const vec dvx = b.x - a.x, dvy = b.y - a.y;
    vec x = batch->x[0] - (batch->nx * dvx + batch->ny * dvy + batch->rbn[0] * b.w - batch->ran[0] * a.w) *
            batch->mn[0];
    vec y = batch->x[2] - (batch->nx * dvy - batch->ny * dvx + batch->rbt * b.w - batch->rat * a.w) * batch->mt,
        far = {0};
    const vec ends = batch->BT_ENDS_X * batch->BT_ENDS_X + batch->BT_ENDS_Y * batch->BT_ENDS_Y;
    const vec along = (x * batch->BT_ENDS_X + y * batch->BT_ENDS_Y) / ends;
    const vec part = bt_choose(ends > zero, bt_larger(-one, bt_smaller(one, along)), zero);
    const vec out_x = x - part * batch->BT_ENDS_X, out_y = y - part * batch->BT_ENDS_Y,
              square = out_x * out_x + out_y * out_y;
    for (int l = 0; l < BT_LANES; l++) far[l] = sqrt(square[l]); // one instruction for all
    const mask outside = far > friction;
    x = bt_choose(outside, part * batch->BT_ENDS_X + out_x * (friction / far), x);
    y = bt_choose(outside, part * batch->BT_ENDS_Y + out_y * (friction / far), y);
    const vec dx = x - batch->x[0], dy = y - batch->x[2], jx = dx * batch->nx - dy * batch->ny,
              jy = dx * batch->ny + dy * batch->nx;
    a.x -= batch->ma * jx;
    a.y -= batch->ma * jy;
    a.w -= batch->ia * (dx * batch->ran[0] + dy * batch->rat);
    b.x += batch->mb * jx;
    b.y += batch->mb * jy;
    b.w += batch->ib * (dx * batch->rbn[0] + dy * batch->rbt);
    batch->x[0] = x, batch->x[2] = y;
    store(v, batch->a, batch->moves_a, a);
    store(v, batch->b, batch->moves_b, b);
    return bt_larger(bt_size_of(dx), bt_size_of(dy)) * batch->wt;
}

/// As bt_update_contact; limits: bounds of the normal impulses, or NULL. Returns, per lane, the largest change of a
/// row's speed, m/s.
BT_INLINE vec update(bt_batch *batch, const vec *limits, bt_vel *v)
{
    motion a = bt_take_four(v, batch->a), b = bt_take_four(v, batch->b);
    vec l1, l2;
    solve_normals(batch, &a, &b, &l1, &l2);
    if (limits) bound_normals(batch, limits, &a, &b, &l1, &l2);
    const vec d1 = l1 - batch->x[0], d2 = l2 - batch->x[1], jn = d1 + d2, jx = jn * batch->nx, jy = jn * batch->ny;
    a.x -= batch->ma * jx;
    a.y -= batch->ma * jy;
    a.w -= batch->ia * (d1 * batch->ran[0] + d2 * batch->ran[1]);
    b.x += batch->mb * jx;
    b.y += batch->mb * jy;
    b.w += batch->ib * (d1 * batch->rbn[0] + d2 * batch->rbn[1]);
    const vec ut = batch->nx * (b.y - a.y) - batch->ny * (b.x - a.x) + batch->rbt * b.w - batch->rat * a.w,
              bound = batch->mu * (l1 + l2);
    const vec t = bt_larger(-bound, bt_smaller(bound, batch->x[2] - ut * batch->mt)), dt = t - batch->x[2],
              tx = dt * batch->ny, ty = dt * batch->nx;
    a.x += batch->ma * tx;
    a.y -= batch->ma * ty;
    a.w -= batch->ia * (dt * batch->rat);
    b.x -= batch->mb * tx;
    b.y += batch->mb * ty;
    b.w += batch->ib * (dt * batch->rbt);
    batch->x[0] = l1, batch->x[1] = l2, batch->x[2] = t;
    store(v, batch->a, batch->moves_a, a);
    store(v, batch->b, batch->moves_b, b);
    const vec u1 = batch->w[0] * d1 + batch->w12 * d2, u2 = batch->w12 * d1 + batch->w[1] * d2;
    return bt_larger(bt_larger(bt_size_of(u1), bt_size_of(u2)), bt_size_of(dt) * batch->wt);
}

/// As bt_apply, with the whole impulses.
BT_INLINE void apply(const bt_batch *batch, bt_vel *v)
{
    motion a = bt_take_four(v, batch->a), b = bt_take_four(v, batch->b);
    const vec jn = batch->x[0] + batch->x[1], t = batch->x[2], jx = jn * batch->nx - t * batch->ny,
              jy = jn * batch->ny + t * batch->nx;
    a.x -= batch->ma * jx;
    a.y -= batch->ma * jy;
    a.w -= batch->ia * (batch->x[0] * batch->ran[0] + batch->x[1] * batch->ran[1] + t * batch->rat);
    b.x += batch->mb * jx;
    b.y += batch->mb * jy;
    b.w += batch->ib * (batch->x[0] * batch->rbn[0] + batch->x[1] * batch->rbn[1] + t * batch->rbt);
    store(v, batch->a, batch->moves_a, a);
    store(v, batch->b, batch->moves_b, b);
}

BT_FOR_EACH_CPU
static void apply_all(const bt_batch *batches, bt_idx n, bt_vel *v)
{
    for (bt_idx k = 0; k < n; k++) apply(&batches[k], v);
}

void bt_batch_apply(const bt_cell *cell, bt_vel *v) { apply_all(cell->work->batch, cell->work->n_batches, v); }

/// Extrapolated unknowns of a batch, for one visit to a cell.
typedef struct {
    vec x[3];
} moved;

/// Settings and results of a visit to a cell.
typedef struct {
    const bt_sweep *sweep;
    int times;            // passes at most
    double calm;          // largest update after which a batch rests, m/s
    moved *y;             // [n_batches]
    bt_rest *rests;       // [n_batches]
    bt_idx *due, *again;  // [n_batches] of the first pass; of the next
    int64_t moved, done;  // contacts that were moved; updates
    double most, against; // largest update of the first pass; J
} visit;

/// Extrapolate a batch, including the moves that it missed while it rested.
BT_INLINE void move(bt_batch *batch, double lead, double lag, moved *y)
{
    for (int c = 0; c < 3; c++) {
        const vec now = batch->x[c], change = now - batch->before[c];
        batch->x[c] = now + lead * change;
        batch->before[c] = now + lag * change;
        y->x[c] = batch->x[c];
    }
}

/// How far a batch turned against its move, as bt_rounds_against.
BT_INLINE vec turned(const bt_batch *batch, const moved *y)
{
    vec sum = {0};
    for (int c = 0; c < 3; c++)
        sum += (c < 2 ? batch->w[c] : batch->wt) * (y->x[c] - batch->x[c]) * (batch->x[c] - batch->before[c]);
    return sum;
}

/// Find the batches that do not rest; the others then have one sweep less to rest. Returns how many are due.
BT_INLINE bt_idx find_due(bt_rest *rests, bt_idx n, bool all, bt_idx *due)
{
    bt_idx n_due = 0;
    for (bt_idx k = 0; k < n; k++) {
        const bool rests_on = rests[k].to_come > 0 && !all;
        due[n_due] = k;
        n_due += !rests_on;
        rests[k].to_come -= rests_on, rests[k].done += rests_on;
    }
    return n_due;
}

/// The first pass is over the due batches, each later one over those that the previous pass has not left calm.
BT_INLINE void go_through(bt_batch *batches, bt_idx n, bt_vel *v, bool bounded, visit *o)
{
    const bt_batch_bounds *bounds = (const bt_batch_bounds *)(batches + n);
    const bt_sweep *sweep = o->sweep;
    vec most = {0}, against = {0};
    const bt_idx n_due = find_due(o->rests, n, sweep->all, o->due);
    bt_idx left = n_due;
    for (int t = 0; left > 0 && t < o->times; t++) {
        const bt_idx *now = t == 0 ? o->due : o->again, n_now = left;
        left = 0;
        for (bt_idx j = 0; j < n_now; j++) {
            const bt_idx k = now[j];
            bt_batch *batch = &batches[k];
            bt_rest *rest = &o->rests[k];
            if (t == 0 && sweep->moves) {
                move(batch, sweep->lead[rest->done], sweep->lag[rest->done], &o->y[k]);
                o->moved += sweep->beta > 0 ? batch->n : 0;
            }
            vec change;
            if (!bounded) change = update(batch, NULL, v);
            else if (batch->kind == BT_BATCH_SHEETS) change = update_sheets(batch, bounds[k].of[0], v);
            else change = update(batch, bounds[k].of, v);
            if (t == 0) most = bt_larger(most, change);
            o->done += batch->n;
            const bool calm = bt_largest_lane(change) <= o->calm;
            rest->in_all = calm ? (uint8_t)bt_min(BT_REST, 2 * rest->in_all + 1) : 0;
            rest->to_come = rest->in_all, rest->done = 0;
            o->again[left] = k;
            left += !calm;
        }
    }
    for (bt_idx j = 0; sweep->moves && j < n_due; j++)
        against += turned(&batches[o->due[j]], &o->y[o->due[j]]);
    o->most = bt_largest_lane(most);
    o->against = against[0] + against[1] + against[2] + against[3];
}

BT_FOR_EACH_CPU
static void go_through_rigid(bt_batch *batches, bt_idx n, bt_vel *v, visit *o)
{
    go_through(batches, n, v, false, o);
}

/// For contacts with bounds; a separate function, or rigid ice would pay for the registers that this takes.
BT_FOR_EACH_CPU
static void go_through_bounded(bt_batch *batches, bt_idx n, bt_vel *v, visit *o)
{
    go_through(batches, n, v, true, o);
}

void bt_batch_sweep(bt_cell *cell, bt_vel *v, const bt_inv *inv, const bt_sweep *sweep, int times, bt_totals *totals)
{
    if (!cell->work->packed) bt_batch_pack(cell, inv);
    visit o = {.sweep = sweep, .times = times > 1 ? times : 1, .calm = BT_ENOUGH * sweep->problem->tolerance};
    const bt_idx n = cell->work->n_batches;
    moved few[BT_FEW / BT_LANES];
    bt_idx few_due[2 * BT_FEW / BT_LANES];
    const bool many = n > BT_FEW / BT_LANES;
    o.y = many ? bt_alloc_unset((size_t)n, sizeof *o.y) : few;
    o.due = many ? bt_alloc(2 * (size_t)n, sizeof *o.due) : few_due;
    o.again = o.due + n;
    o.rests = bt_batch_rests(cell);
    (cell->laws->limits ? go_through_bounded : go_through_rigid)(cell->work->batch, n, v, &o);
    if (many) free(o.y), free(o.due);
    totals->most = bt_max(totals->most, o.most);
    cell->updates += o.done;
    bt_sum_add(&totals->sum[BT_SWEEP_UPDATES], (double)o.done);
    if (sweep->moves) bt_rounds_moved(sweep, o.moved, o.against, totals);
}
