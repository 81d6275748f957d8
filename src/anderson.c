// SPDX-License-Identifier: MIT
// Anderson acceleration over the tiles; method and reasons in anderson.h.
#include "anderson.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define DEPTH BT_ANDERSON_DEPTH
#define DROP_COLUMNS 10.0
#define MAX_REST 15
#define GO_BACK 1e12
#define STALL 150      // iterations without halving |f|
#define MAX_GAMMA 1e6
#define RIDGE 1e-11 // relative to the diagonal: keeps the normal equations solvable when columns nearly repeat

enum { UNIT_ARRAYS = 2 + 2 * DEPTH, BODY_ARRAYS = 1 + DEPTH }; // f, g before, ΔG, ΔF; v before, ΔV

void bt_anderson_start(bt_anderson *a, double energy)
{
    *a = (bt_anderson){.best = INFINITY, .mark = INFINITY, .before = INFINITY, .long_rest = STALL};
    // Quantum 2⁻⁶⁴ of the sums: 10⁻¹⁰ of the energy at convergence, so that 10²⁷ times that energy still fits.
    a->scale = energy > 0 && isfinite(energy) ? exp2(bt_max(-500, bt_min(500, -30 - ceil(log2(energy))))) : 1;
}

int bt_anderson_begin(bt_anderson *a)
{
    a->recording = a->rest == 0;
    a->has_column = a->recording && a->started;
    a->column = a->head;
    return a->has_column ? 1 + 2 * DEPTH : 1;
}

void bt_anderson_reserve(bt_tile *tile, bool units)
{
    const bt_idx n_bodies = tile->end - tile->first;
    if (n_bodies > tile->cap_body_history) {
        tile->cap_body_history = n_bodies;
        tile->body_history = bt_realloc(tile->body_history, 3 * BODY_ARRAYS * (size_t)n_bodies, sizeof(double));
    }
    if (units && tile->n_units > tile->cap_unit_history) {
        tile->cap_unit_history = tile->n_units + tile->n_units / 4;
        free(tile->unit_history);
        tile->unit_history = bt_realloc(NULL, 3 * UNIT_ARRAYS * (size_t)tile->cap_unit_history, sizeof(double));
    }
}

/// Arrays of a tile's unit history.
typedef struct {
    double *f, *g, *dg[DEPTH], *df[DEPTH];
} history;

static history history_of(const bt_tile *tile)
{
    const size_t n = 3 * (size_t)tile->cap_unit_history;
    history h = {tile->unit_history, tile->unit_history + n, {0}, {0}};
    for (int j = 0; j < DEPTH; j++) {
        h.dg[j] = tile->unit_history + (size_t)(2 + j) * n;
        h.df[j] = tile->unit_history + (size_t)(2 + DEPTH + j) * n;
    }
    return h;
}

static void add(const bt_anderson *a, bt_totals *t, int k, double x) { bt_sum_add(&t->sum[k], x * a->scale); }

static int columns(const bt_anderson *a) { return a->depth < DEPTH ? a->depth + 1 : DEPTH; }

void bt_anderson_collect(const bt_anderson *a, bt_tile *tile, const double *x, bt_totals *t)
{
    const history h = history_of(tile);
    double norm = 0, gram[DEPTH] = {0}, right[DEPTH] = {0};
    const int n_columns = a->has_column ? columns(a) : 0;
    for (bt_idx i = 0; i < tile->n_units; i++) {
        const bt_unit *u = &tile->units[i];
        const double g[3] = {u->ln[0], u->ln[1], u->lt}, weight[3] = {u->w[0], u->w[1], u->wt};
        for (int c = 0; c < 3; c++) {
            const size_t k = 3 * (size_t)i + (size_t)c;
            const double f = g[c] - x[k];
            norm += weight[c] * f * f;
            if (!a->recording) continue;
            if (a->has_column) {
                const double df = f - h.f[k];
                h.df[a->column][k] = df;
                h.dg[a->column][k] = g[c] - h.g[k];
                for (int j = 0; j < n_columns; j++) {
                    const double wd = weight[c] * h.df[j][k];
                    gram[j] += wd * df;
                    right[j] += wd * f;
                }
            }
            h.f[k] = f;
            h.g[k] = g[c];
        }
    }
    add(a, t, 0, norm);
    for (int j = 0; j < n_columns; j++) {
        add(a, t, 1 + j, gram[j]);
        add(a, t, 1 + DEPTH + j, right[j]);
    }
}

void bt_anderson_collect_scalar(const bt_anderson *a, bt_anderson_scalar *s, double x, double g, double weight, bt_totals *t)
{
    const double f = g - x;
    add(a, t, 0, weight * f * f);
    if (!a->recording) return;
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

/// Forget the columns and leave the next sweeps plain, twice as many each time: the plain sweep always gets there.
static void drop(bt_anderson *a)
{
    a->depth = a->head = 0;
    a->rest = a->next_rest;
    a->next_rest = a->next_rest < MAX_REST ? 2 * a->next_rest + 1 : MAX_REST;
    a->started = a->recording && a->rest == 0; // this iteration is then the first of the next history
}

bt_anderson_verdict bt_anderson_decide(bt_anderson *a, const bt_totals *t)
{
    const double norm = bt_sum_value(&t->sum[0]);
    const bool plain = a->rest > 0;
    if (a->has_column && (!isfinite(norm) || norm > GO_BACK * a->before)) {
        drop(a);
        a->started = false;
        return BT_ANDERSON_BACK;
    }
    a->before = norm;
    bool dropped = false;
    if (norm > DROP_COLUMNS * a->best) {
        drop(a);
        dropped = true;
        a->best = norm; // the measure from here on: another piece of the problem
    }
    a->best = bt_min(a->best, norm);
    if (norm < 0.25 * a->mark) {
        a->mark = norm;
        a->stalled = 0;
    } else if (!plain && ++a->stalled > STALL) {
        drop(a);
        dropped = true;
        a->started = false;
        a->rest = a->long_rest;
        a->long_rest *= 2;
        a->mark = norm;
        a->stalled = 0;
    }
    if (plain) {
        a->rest--;
        return BT_ANDERSON_STAY;
    }
    if (dropped) return BT_ANDERSON_STAY;
    if (!a->has_column) {
        a->started = true;
        return BT_ANDERSON_STAY;
    }
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
    const history h = history_of(tile);
    for (bt_idx i = 0; i < tile->n_units; i++) {
        double move[3] = {0, 0, 0};
        for (int c = 0; c < 3; c++) {
            const size_t k = 3 * (size_t)i + (size_t)c;
            if (v == BT_ANDERSON_BACK) move[c] = h.dg[a->column][k];
            else
                for (int j = 0; j < a->depth; j++) move[c] += a->gamma[j] * h.dg[j][k];
        }
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

void bt_anderson_move_bodies(const bt_anderson *a, bt_anderson_verdict v, bt_tile *tile, bt_vel *vel, const bt_inv *inv)
{
    const size_t n = 3 * (size_t)tile->cap_body_history;
    double *before = tile->body_history, *dv[DEPTH];
    for (int j = 0; j < DEPTH; j++) dv[j] = tile->body_history + (size_t)(1 + j) * n;
    for (bt_idx i = tile->first; i < tile->end; i++) {
        if (!(inv[i].m > 0)) continue;
        const size_t k = 3 * (size_t)(i - tile->first);
        double x[3] = {vel[i].x, vel[i].y, vel[i].w};
        for (size_t c = 0; c < 3; c++) {
            const double now = x[c];
            if (a->has_column) dv[a->column][k + c] = now - before[k + c];
            before[k + c] = now;
            double move = 0;
            if (v == BT_ANDERSON_BACK) move = dv[a->column][k + c];
            else if (v == BT_ANDERSON_MOVE)
                for (int j = 0; j < a->depth; j++) move += a->gamma[j] * dv[j][k + c];
            x[c] = now - move;
        }
        vel[i].x = x[0], vel[i].y = x[1], vel[i].w = x[2];
    }
}
