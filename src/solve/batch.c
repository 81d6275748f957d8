// SPDX-License-Identifier: MIT
// Batches of four contacts; what for, in batch.h. The arithmetic is that of bt_update_contact (kernel.h), four at a
// time.
#include "solve/batch.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "solve/kernel.h"
#include "solve/vector.h"

enum { LANES = BT_LANES, OPEN = 8 }; // OPEN: batches that wait for more contacts, when a cell is packed

typedef bt_vec vec;
typedef bt_mask mask;

typedef enum { RIGID, BOUNDED, SHEETS, PROJECTION } kind_of_batch;

/// Names as in bt_contact; lanes without a contact are zero.
typedef struct bt_batch {
    vec nx, ny, ran[2], rbn[2], rat, rbt, w[2], w12, mn[2], per_det, wt, mt, bias[2];
    vec mu;                    // friction; of the projection: the overlap that is left alone, m
    vec ma, ia, mb, ib;        // inverse masses and moments of inertia of a and b
    vec x[3], before[3], y[3]; // impulses, or multipliers: now, before the last sweep, after the move
    vec bound[2];              // of the normals; bound[0] of sheets: the radius of their disc
    bt_idx a[LANES], b[LANES], contact[LANES];
    bool moves_a[LANES], moves_b[LANES];
    int n;
    kind_of_batch kind;
} bt_batch;

bool bt_batch_is_for(const bt_cell *cell)
{
    return !(cell->laws.limits && cell->laws.rising) && cell->phase != BT_COLOURS;
}

bool bt_batch_projects(const bt_cell *cell) { return cell->phase != BT_COLOURS; }

size_t bt_batch_bytes(const bt_cell *cell)
{
    return bt_batch_is_for(cell) ? sizeof(bt_batch) / LANES + 2 * sizeof(bt_vel)
                                 : sizeof(bt_contact) + 2 * (sizeof(bt_vel) + sizeof(bt_inv));
}

// --- packing ---------------------------------------------------------------------------------------------------------

static kind_of_batch kind_of(const bt_cell *cell, const bt_contact *u, bool projection)
{
    return projection ? PROJECTION : !cell->laws.limits ? RIGID : u->n > 0 ? BOUNDED : SHEETS;
}

static bool holds(const bt_batch *o, bt_idx body)
{
    for (int l = 0; l < o->n; l++)
        if ((o->moves_a[l] && o->a[l] == body) || (o->moves_b[l] && o->b[l] == body)) return true;
    return false;
}

/// What the position projection has in place of impulses, biases and friction. Sheets, and a point that is not there,
/// have none.
static void put_projection(bt_batch *o, int l, const bt_contact *u, const bt_gaps *g, double slop)
{
    o->mu[l] = slop;
    for (int c = 0; c < 2; c++) {
        const bool there = c < u->n;
        o->mn[c][l] = there ? u->mn[c] : 0;
        o->bias[c][l] = there ? g->gap[c] : 0;
        o->x[c][l] = there ? g->multiplier[c] : 0;
    }
    o->x[2][l] = o->before[2][l] = 0;
}

static void put(bt_batch *o, const bt_cell *cell, bt_idx i, const bt_inv *inv)
{
    const bt_contact *u = &cell->contacts[i];
    const int l = o->n++;
    o->nx[l] = u->nx, o->ny[l] = u->ny;
    for (int c = 0; c < 2; c++) {
        o->ran[c][l] = u->ran[c], o->rbn[c][l] = u->rbn[c];
        o->w[c][l] = u->w[c], o->mn[c][l] = u->mn[c], o->bias[c][l] = u->bias[c];
        o->x[c][l] = u->ln[c];
    }
    o->rat[l] = u->rat, o->rbt[l] = u->rbt;
    o->w12[l] = u->w12, o->per_det[l] = u->per_det;
    o->wt[l] = u->wt, o->mt[l] = u->mt, o->mu[l] = u->mu;
    o->x[2][l] = u->lt;
    for (int c = 0; c < 3; c++) o->before[c][l] = cell->work.before[i][c];
    o->ma[l] = inv[u->a].m, o->ia[l] = inv[u->a].i, o->mb[l] = inv[u->b].m, o->ib[l] = inv[u->b].i;
    for (int c = 0; cell->laws.limits && c < 2; c++) o->bound[c][l] = cell->laws.limits[i].flat[c];
    o->a[l] = u->a, o->b[l] = u->b, o->contact[l] = i;
    o->moves_a[l] = inv[u->a].m > 0, o->moves_b[l] = inv[u->b].m > 0;
}

static bt_batch *begin_batch(bt_cell *cell, const bt_contact *u, kind_of_batch kind)
{
    if (cell->work.n_batches == cell->work.cap_batches) {
        const bt_idx cap = cell->work.cap_batches + bt_max(2, cell->work.cap_batches / 4);
        bt_batch *more = bt_alloc_aligned((size_t)cap, sizeof *more);
        if (cell->work.n_batches > 0) memcpy(more, cell->work.batch, (size_t)cell->work.n_batches * sizeof *more);
        free(cell->work.batch);
        cell->work.batch = more;
        cell->work.cap_batches = cap;
    }
    bt_batch *o = &cell->work.batch[cell->work.n_batches++];
    memset(o, 0, sizeof *o);
    o->kind = kind;
    for (int l = 0; l < LANES; l++) o->a[l] = u->a, o->b[l] = u->b; // of lanes that stay empty: read, never written
    return o;
}

/// May a contact stand in a batch?
static bool fits(const bt_batch *o, const bt_contact *u, kind_of_batch kind, const bt_inv *inv)
{
    return o->kind == kind && !(inv[u->a].m > 0 && holds(o, u->a)) && !(inv[u->b].m > 0 && holds(o, u->b));
}

/// Each contact goes into the first of the last OPEN batches that is not full, is of its kind and has none of its
/// bodies. Those that filled up leave the window.
static void pack(bt_cell *cell, const bt_inv *inv, const double *slop)
{
    bt_idx open[OPEN];
    int n_open = 0;
    cell->work.n_batches = 0;
    cell->work.packed = true;
    for (bt_idx j = 0; j < cell->work.n_list; j++) {
        const bt_contact *u = &cell->contacts[cell->work.list[j]];
        int k = 0;
        const kind_of_batch kind = kind_of(cell, u, slop != NULL);
        while (k < n_open && !fits(&cell->work.batch[open[k]], u, kind, inv)) k++;
        if (k == n_open) {
            if (n_open == OPEN) memmove(open, open + 1, (OPEN - 1) * sizeof *open), k = --n_open;
            begin_batch(cell, u, kind);
            open[n_open++] = cell->work.n_batches - 1;
        }
        bt_batch *o = &cell->work.batch[open[k]];
        put(o, cell, cell->work.list[j], inv);
        if (slop) put_projection(o, o->n - 1, u, &cell->gaps[cell->work.list[j]], *slop);
        if (o->n < LANES) continue;
        n_open--;
        memmove(open + k, open + k + 1, (size_t)(n_open - k) * sizeof *open);
    }
}

void bt_batch_unpack(bt_cell *cell)
{
    if (!cell->work.packed) return;
    cell->work.packed = false;
    for (bt_idx k = 0; k < cell->work.n_batches; k++) {
        const bt_batch *o = &cell->work.batch[k];
        for (int l = 0; l < o->n; l++) {
            bt_contact *u = &cell->contacts[o->contact[l]];
            if (o->kind == PROJECTION) {
                bt_gaps *g = &cell->gaps[o->contact[l]];
                g->multiplier[0] = o->x[0][l], g->multiplier[1] = o->x[1][l];
            } else {
                u->ln[0] = o->x[0][l], u->ln[1] = o->x[1][l], u->lt = o->x[2][l];
            }
            for (int c = 0; c < 3; c++) cell->work.before[o->contact[l]][c] = o->before[c][l];
        }
    }
}

// --- arithmetic ------------------------------------------------------------------------------------------------------

/// Velocities of four bodies, component by component.
typedef struct {
    vec x, y, w, unused;
} motion;

/// Rows to columns; its own inverse.
BT_INLINE void transpose(motion *m)
{
    const vec a = __builtin_shufflevector(m->x, m->y, 0, 4, 2, 6), b = __builtin_shufflevector(m->x, m->y, 1, 5, 3, 7);
    const vec c = __builtin_shufflevector(m->w, m->unused, 0, 4, 2, 6),
              d = __builtin_shufflevector(m->w, m->unused, 1, 5, 3, 7);
    m->x = __builtin_shufflevector(a, c, 0, 1, 4, 5);
    m->y = __builtin_shufflevector(b, d, 0, 1, 4, 5);
    m->w = __builtin_shufflevector(a, c, 2, 3, 6, 7);
    m->unused = __builtin_shufflevector(b, d, 2, 3, 6, 7);
}

BT_INLINE motion load(const bt_vel *v, const bt_idx *body)
{
    motion m;
    memcpy(&m.x, &v[body[0]], sizeof m.x);
    memcpy(&m.y, &v[body[1]], sizeof m.y);
    memcpy(&m.w, &v[body[2]], sizeof m.w);
    memcpy(&m.unused, &v[body[3]], sizeof m.unused);
    transpose(&m);
    return m;
}

BT_INLINE void store(bt_vel *v, const bt_idx *body, const bool *moves, motion m)
{
    transpose(&m);
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
BT_INLINE void rim(const bt_batch *o, const vec b[2], vec l[2])
{
    const vec zero = {0}, endless = {INFINITY, INFINITY, INFINITY, INFINITY}, half = {0.5, 0.5, 0.5, 0.5};
    vec least = endless;
    mask done = {0};
    for (int side = 0; side < 4; side++) {
        const int i = side >> 1, k = 1 - i;
        vec x[2];
        x[i] = side & 1 ? o->bound[i] : zero;
        x[k] = bt_larger(zero, bt_smaller(o->bound[k], -(b[k] + o->w12 * x[i]) * o->mn[k]));
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
BT_INLINE void bound_normals(const bt_batch *o, const motion *p, const motion *q, vec *l1, vec *l2)
{
    const mask over = (*l1 > o->bound[0]) | (*l2 > o->bound[1]);
    if (!any_of(over)) return;
    const vec zero = {0}, un = o->nx * (q->x - p->x) + o->ny * (q->y - p->y);
    vec b[2], l[2] = {*l1, *l2};
    for (int i = 0; i < 2; i++)
        b[i] = un + o->rbn[i] * q->w - o->ran[i] * p->w + o->bias[i] - o->w[i] * o->x[i] - o->w12 * o->x[1 - i];
    const vec alone = bt_larger(zero, bt_smaller(-b[0] * o->mn[0], o->bound[0]));
    rim(o, b, l);
    const mask one = o->mn[1] == zero;
    *l1 = bt_choose(over, bt_choose(one, alone, l[0]), *l1);
    *l2 = bt_choose(over & ~one, l[1], *l2);
}

/// As bt_update_sheets; lanes without a contact have a disc of 0 and no step.
BT_INLINE vec update_sheets(bt_batch *o, bt_vel *v)
{
    motion a = load(v, o->a), b = load(v, o->b);
    const vec dvx = b.x - a.x, dvy = b.y - a.y;
    vec x = o->x[0] - (o->nx * dvx + o->ny * dvy + o->rbn[0] * b.w - o->ran[0] * a.w) * o->mn[0];
    vec y = o->x[2] - (o->nx * dvy - o->ny * dvx + o->rbt * b.w - o->rat * a.w) * o->mt, far = {0};
    const vec square = x * x + y * y, one = {1, 1, 1, 1};
    for (int l = 0; l < LANES; l++) far[l] = sqrt(square[l]); // one instruction for all
    const vec scale = bt_choose(far > o->bound[0], o->bound[0] / far, one);
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

/// As bt_update_contact; the largest corrections, m/s.
BT_INLINE vec update(bt_batch *o, bt_vel *v, bool bounded)
{
    motion a = load(v, o->a), b = load(v, o->b);
    vec l1, l2;
    solve_normals(o, &a, &b, &l1, &l2);
    if (bounded) bound_normals(o, &a, &b, &l1, &l2);
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
    motion a = load(d, o->a), b = load(d, o->b);
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

BT_INLINE double largest_lane(vec a) { return bt_max(bt_max(a[0], a[1]), bt_max(a[2], a[3])); }

BT_FOR_EACH_CPU
static double pass(bt_batch *batch, bt_idx n, bt_vel *v)
{
    vec most = {0};
    for (bt_idx k = 0; k < n; k++) most = bt_larger(most, update(&batch[k], v, false));
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
        most = bt_larger(most, o->kind == SHEETS ? update_sheets(o, v) : update(o, v, true));
    }
    return largest_lane(most);
}

BT_FOR_EACH_CPU
static void move(bt_batch *batch, bt_idx n, double beta)
{
    for (bt_idx k = 0; k < n; k++) {
        bt_batch *o = &batch[k];
        for (int c = 0; c < 3; c++) {
            const vec now = o->x[c];
            if (beta > 0) o->x[c] = now + beta * (now - o->before[c]);
            o->before[c] = now;
            o->y[c] = o->x[c];
        }
    }
}

BT_FOR_EACH_CPU
static double against(const bt_batch *batch, bt_idx n)
{
    vec sum = {0};
    for (bt_idx k = 0; k < n; k++) {
        const bt_batch *o = &batch[k];
        for (int c = 0; c < 3; c++) sum += (c < 2 ? o->w[c] : o->wt) * (o->y[c] - o->x[c]) * (o->x[c] - o->before[c]);
    }
    return sum[0] + sum[1] + sum[2] + sum[3];
}

typedef double pass_of_batches(bt_batch *batch, bt_idx n, bt_vel *v);

static double visit(bt_cell *cell, bt_vel *v, pass_of_batches *once, const bt_sweep *s, int times, double enough,
                    int64_t *done, double *most)
{
    if (s->moves) move(cell->work.batch, cell->work.n_batches, s->beta);
    double last = INFINITY;
    for (int n = 0; n == 0 || (n < times && last > enough); n++) {
        last = once(cell->work.batch, cell->work.n_batches, v);
        if (n == 0) *most = last;
        *done += cell->work.n_list;
    }
    return s->moves ? against(cell->work.batch, cell->work.n_batches) : 0;
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
