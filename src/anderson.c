// SPDX-License-Identifier: MIT
// Anderson acceleration over the tiles; method and reasons in anderson.h.
#include "anderson.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define DEPTH BT_ANDERSON_DEPTH
#define DROP_COLUMNS 10.0
#define GO_BACK 1e12
#define MAX_GAMMA 1e6
#define RIDGE 1e-9 // relative to the diagonal: keeps the normal equations solvable when columns nearly repeat
enum { MAX_REST = 3, STALL = 30, MAX_EFFORT = 5 };

// History of a tile: f and g of the iteration before, [n_units][3]; velocities before, [n_bodies][4] as bt_vel. Columns in single
// precision: they only point the way, each iterate is swept again, and velocities are formed anew from the impulses at the end.
enum { UNIT_BYTES = 3 * (2 * sizeof(double) + 2 * DEPTH * sizeof(float)), BODY_BYTES = 4 * (sizeof(double) + DEPTH * sizeof(float)) };

void bt_anderson_start(bt_anderson *a, double energy, int every)
{
    *a = (bt_anderson){.best = INFINITY, .mark = INFINITY, .before = INFINITY, .every = every, .wait = every - 1};
    // Quantum 2⁻⁶⁴ of the sums: 10⁻¹⁰ of the energy at convergence, so that 10²⁷ times that energy still fits.
    a->scale = energy > 0 && isfinite(energy) ? exp2(bt_max(-500, bt_min(500, -30 - ceil(log2(energy))))) : 1;
}

bool bt_anderson_begin(bt_anderson *a, bt_totals *t)
{
    if (a->wait > 0) {
        a->wait--;
        return false;
    }
    a->has_column = a->started;
    a->column = a->head;
    t->n_sums = a->has_column ? 1 + 2 * DEPTH : 1;
    return true;
}

void bt_anderson_reserve(bt_tile *tile, bool units)
{
    const bt_idx n_bodies = tile->end - tile->first;
    if (n_bodies > tile->cap_body_history) {
        tile->cap_body_history = n_bodies;
        free(tile->body_history);
        tile->body_history = bt_alloc_aligned((size_t)n_bodies, BODY_BYTES);
    }
    if (units && tile->n_units > tile->cap_unit_history) {
        tile->cap_unit_history = tile->n_units + tile->n_units / 4;
        free(tile->unit_history);
        tile->unit_history = bt_alloc_aligned((size_t)tile->cap_unit_history, UNIT_BYTES);
    }
}

/// Arrays of a tile's unit history, each [3 n_units].
typedef struct {
    double *f, *g;
    float *dg[DEPTH], *df[DEPTH];
} history;

static history history_of(const bt_tile *tile)
{
    const size_t n = 3 * (size_t)tile->cap_unit_history;
    history h = {.f = tile->unit_history, .g = tile->unit_history + n};
    float *columns = (float *)(tile->unit_history + 2 * n);
    for (int j = 0; j < DEPTH; j++) {
        h.dg[j] = columns + (size_t)j * n;
        h.df[j] = columns + (size_t)(DEPTH + j) * n;
    }
    return h;
}

static void fetch(const void *from, size_t bytes)
{
    for (size_t k = 0; k < bytes; k += 64) __builtin_prefetch((const char *)from + k);
}

void bt_anderson_fetch(const bt_tile *tile)
{
    if (tile->n_units == 0) return;
    const history h = history_of(tile);
    const size_t n = 3 * (size_t)tile->n_units;
    fetch(h.f, n * sizeof *h.f);
    fetch(h.g, n * sizeof *h.g);
    for (int j = 0; j < DEPTH; j++) fetch(h.df[j], n * sizeof *h.df[j]);
}

static void add(const bt_anderson *a, bt_totals *t, int k, double x) { bt_sum_add(&t->sum[k], x * a->scale); }

static int columns(const bt_anderson *a) { return a->depth < DEPTH ? a->depth + 1 : DEPTH; }

// Sums in four lanes, by hand: which term goes to which lane is then the same in every build and for any alignment of the arrays.
typedef struct { double lane[4]; } lanes;

static double total(const lanes *s) { return (s->lane[0] + s->lane[1]) + (s->lane[2] + s->lane[3]); }

/// Σ weight x y
static double weighted(const double *restrict weight, const float *restrict x, const float *restrict y, size_t n)
{
    lanes s = {{0}};
    size_t k = 0;
    for (; k + 4 <= n; k += 4)
        for (size_t c = 0; c < 4; c++) s.lane[c] += weight[k + c] * (double)x[k + c] * (double)y[k + c];
    for (; k < n; k++) s.lane[k & 3] += weight[k] * (double)x[k] * (double)y[k];
    return total(&s);
}

static double weighted_f(const double *restrict weight, const float *restrict x, const double *restrict y, size_t n)
{
    lanes s = {{0}};
    size_t k = 0;
    for (; k + 4 <= n; k += 4)
        for (size_t c = 0; c < 4; c++) s.lane[c] += weight[k + c] * (double)x[k + c] * y[k + c];
    for (; k < n; k++) s.lane[k & 3] += weight[k] * (double)x[k] * y[k];
    return total(&s);
}

static double weighted_square(const double *restrict weight, const double *restrict x, size_t n)
{
    lanes s = {{0}};
    size_t k = 0;
    for (; k + 4 <= n; k += 4)
        for (size_t c = 0; c < 4; c++) s.lane[c] += weight[k + c] * x[k + c] * x[k + c];
    for (; k < n; k++) s.lane[k & 3] += weight[k] * x[k] * x[k];
    return total(&s);
}

void bt_anderson_collect(const bt_anderson *a, bt_tile *tile, double *x, double *weight, bt_totals *t)
{
    if (tile->n_units == 0) return; // it may have no history, and has nothing to add
    const history h = history_of(tile);
    const size_t n = 3 * (size_t)tile->n_units;
    float *restrict df = h.df[a->column], *restrict dg = h.dg[a->column];
    double *restrict f = h.f, *restrict g = h.g;
    for (bt_idx i = 0; i < tile->n_units; i++) { // x becomes f
        const bt_unit *u = &tile->units[i];
        double *now = x + 3 * i, *w = weight + 3 * i;
        const double value[3] = {u->ln[0], u->ln[1], u->lt};
        w[0] = u->w[0], w[1] = u->w[1], w[2] = u->wt;
        for (int c = 0; c < 3; c++) {
            const size_t k = 3 * (size_t)i + (size_t)c;
            if (a->has_column) dg[k] = (float)(value[c] - g[k]);
            g[k] = value[c];
            now[c] = value[c] - now[c];
        }
    }
    add(a, t, 0, weighted_square(weight, x, n));
    if (a->has_column) {
#pragma omp simd
        for (size_t k = 0; k < n; k++) df[k] = (float)(x[k] - f[k]);
        for (int j = 0; j < columns(a); j++) {
            add(a, t, 1 + j, weighted(weight, h.df[j], df, n));
            add(a, t, 1 + DEPTH + j, weighted_f(weight, h.df[j], x, n));
        }
    }
    memcpy(f, x, n * sizeof *f);
}

void bt_anderson_collect_scalar(const bt_anderson *a, bt_anderson_scalar *s, double x, double g, double weight, bt_totals *t)
{
    const double f = g - x;
    add(a, t, 0, weight * f * f);
    if (a->has_column) {
        s->df[a->column] = f - s->f_before;
        s->dg[a->column] = g - s->g_before;
        for (int j = 0; j < columns(a); j++) {
            add(a, t, 1 + j, weight * s->df[j] * s->df[a->column]);
            add(a, t, 1 + DEPTH + j, weight * s->df[j] * f);
        }
    }
    s->f_before = f;
    s->g_before = g;
}

/// Solve the m×m symmetric positive definite system A γ = b by Cholesky; false when it is not.
static bool solve_spd(int m, double a[DEPTH][DEPTH], double *b)
{
    for (int i = 0; i < m; i++)
        for (int j = 0; j <= i; j++) {
            double s = a[i][j];
            for (int k = 0; k < j; k++) s -= a[i][k] * a[j][k];
            if (i == j) {
                if (!(s > 0)) return false;
                a[i][i] = sqrt(s);
            } else {
                a[i][j] = s / a[j][j];
            }
        }
    for (int i = 0; i < m; i++) {
        for (int k = 0; k < i; k++) b[i] -= a[i][k] * b[k];
        b[i] /= a[i][i];
    }
    for (int i = m - 1; i >= 0; i--) {
        for (int k = i + 1; k < m; k++) b[i] -= a[k][i] * b[k];
        b[i] /= a[i][i];
    }
    return true;
}

/// Forget the columns and leave more sweeps plain, 0, 1, 3, 3...: the plain sweep always gets there.
static void drop(bt_anderson *a)
{
    a->depth = a->head = 0;
    a->wait += a->rest;
    a->rest = a->rest < MAX_REST ? 2 * a->rest + 1 : MAX_REST;
}

bt_anderson_verdict bt_anderson_decide(bt_anderson *a, const bt_totals *t)
{
    const double norm = bt_sum_value(&t->sum[0]);
    a->wait = a->every - 1;
    if (a->has_column && (!isfinite(norm) || norm > GO_BACK * a->before)) {
        drop(a);
        a->started = false;
        return BT_ANDERSON_BACK;
    }
    a->started = true; // this iteration is the one before of the next
    a->before = norm;
    const bool grown = norm > DROP_COLUMNS * a->best, better = norm < 0.25 * a->mark;
    const bool stalled = !better && ++a->stalled > STALL;
    a->best = grown ? norm : bt_min(a->best, norm); // the measure from here on: another piece of the problem
    if (better || stalled) {
        a->mark = norm;
        a->stalled = 0;
    }
    if (stalled && a->effort < MAX_EFFORT) a->effort++;
    if (grown || stalled) drop(a);
    if (grown || stalled || !a->has_column) return BT_ANDERSON_STAY;
    a->depth = columns(a);
    a->head = (a->column + 1) % DEPTH;
    double matrix[DEPTH][DEPTH];
    for (int j = 0; j < a->depth; j++) a->gram[a->column][j] = a->gram[j][a->column] = bt_sum_value(&t->sum[1 + j]);
    for (int i = 0; i < a->depth; i++) {
        for (int j = 0; j < a->depth; j++) matrix[i][j] = a->gram[i][j];
        matrix[i][i] *= 1 + RIDGE;
        a->gamma[i] = bt_sum_value(&t->sum[1 + DEPTH + i]);
    }
    bool usable = solve_spd(a->depth, matrix, a->gamma);
    for (int i = 0; usable && i < a->depth; i++) usable = fabs(a->gamma[i]) < MAX_GAMMA;
    if (usable) return BT_ANDERSON_MOVE;
    drop(a);
    return BT_ANDERSON_STAY;
}

void bt_anderson_move_units(const bt_anderson *a, bt_anderson_verdict v, bt_tile *tile)
{
    if (tile->n_units == 0) return;
    const history h = history_of(tile);
    for (bt_idx i = 0; i < tile->n_units; i++) {
        double move[3] = {0, 0, 0};
        const size_t k = 3 * (size_t)i;
        if (v == BT_ANDERSON_BACK)
            for (size_t c = 0; c < 3; c++) move[c] = h.dg[a->column][k + c];
        else
            for (int j = 0; j < a->depth; j++)
                for (size_t c = 0; c < 3; c++) move[c] += a->gamma[j] * h.dg[j][k + c];
        bt_unit *u = &tile->units[i];
        u->ln[0] -= move[0];
        u->ln[1] -= move[1];
        u->lt -= move[2];
    }
}

double bt_anderson_moved(const bt_anderson *a, bt_anderson_verdict v, const bt_anderson_scalar *s, double g)
{
    if (v == BT_ANDERSON_BACK) return g - s->dg[a->column];
    double move = 0;
    for (int j = 0; j < a->depth; j++) move += a->gamma[j] * s->dg[j];
    return g - move;
}

void bt_anderson_move_bodies(const bt_anderson *a, bt_anderson_verdict v, bt_tile *tile, bt_vel *vel)
{
    // Velocities as a plain row of numbers; those of bodies of infinite mass do not change, and their columns are zero.
    _Static_assert(sizeof *vel == 4 * sizeof(double), "a velocity is a row of four");
    const size_t n = 4 * (size_t)(tile->end - tile->first), cap = 4 * (size_t)tile->cap_body_history;
    if (n == 0) return; // a tile without bodies has no history
    double *restrict x = (double *)(vel + tile->first), *restrict before = tile->body_history;
    float *columns_of = (float *)(before + cap), *restrict new = columns_of + (size_t)a->column * cap;
    if (a->has_column) {
#pragma omp simd
        for (size_t k = 0; k < n; k++) new[k] = (float)(x[k] - before[k]);
    }
    memcpy(before, x, n * sizeof *x);
    if (v == BT_ANDERSON_STAY) return;
    for (int j = 0; j < (v == BT_ANDERSON_BACK ? 1 : a->depth); j++) {
        const float *restrict column = v == BT_ANDERSON_BACK ? new : columns_of + (size_t)j * cap;
        const double gamma = v == BT_ANDERSON_BACK ? 1 : a->gamma[j];
#pragma omp simd
        for (size_t k = 0; k < n; k++) x[k] -= gamma * (double)column[k];
    }
}
