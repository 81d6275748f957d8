// SPDX-License-Identifier: MIT
// Anderson acceleration (Anderson 1965, J. ACM 12; Walker & Ni 2011, SIAM J. Numer. Anal. 49, type II).
//
//     f_k = g(x_k) − x_k,   γ = argmin |f_k − ΔF γ|,   x_{k+1} = g(x_k) − ΔG γ
// with the last m differences of f and g as columns of ΔF and ΔG. On a linear problem this is GMRES on
// the fixed-point map, whether or not that map is symmetric (a Gauss–Seidel sweep is not; conjugate gradients around
// it need 10 to 100 times the sweeps on long chains and on heavy bodies, see heavy_body_squeezes_a_row in tests/physics).
//
// The contact problem is only piecewise smooth, so: when |f|² has grown tenfold over its best, the columns
// describe another piece and are dropped; when it has grown a million-fold, x also goes back to the best g. A γ beyond
// 10⁶ (columns nearly dependent) drops the columns as well. And where |f| has not halved in 150 iterations, extrapolation may undo
// what sweeps achieve, for ever (seen: two points of an edge, one of them about to let go, which plain sweeps settle in 300): a
// long rest follows, 150, 300, 600... sweeps. After each drop a few sweeps stay plain, 0, 1, 3, 7, 15.
//
// Order-free sums: the scalar products steer the solver, so they must have the same bits in any order of
// summation. Each term is first rounded to a multiple of one quantum, chosen from bounds (max-norms, order-free
// themselves) such that every partial sum is exact in double precision: adding C = 1.5·2^p and taking it away again
// rounds to a multiple of 2^(p−52), and sums below 2^p of such multiples are exact. Relative to n times the
// largest term the rounding is 2⁻⁵². This vectorises; a 128-bit accumulator costs as much as the sweep itself.
#include "anderson.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define DROP_COLUMNS 10.0
#define MAX_REST 15
#define GO_BACK 1e12
#define STALL 150      // iterations without halving |f|
#define MAX_GAMMA 1e6
#define RIDGE 1e-11 // relative to the diagonal: keeps the normal equations solvable when columns nearly repeat

void bt_anderson_start(bt_anderson *a, size_t n)
{
    if (n > a->cap) {
        a->cap = n + n / 4;
        double **arrays[] = {&a->g, &a->f, &a->g_before, &a->f_before, &a->move, &a->best_g};
        for (size_t k = 0; k < sizeof arrays / sizeof *arrays; k++) *arrays[k] = bt_realloc(*arrays[k], a->cap, sizeof(double));
        for (int j = 0; j < BT_ANDERSON_DEPTH; j++) {
            a->df[j] = bt_realloc(a->df[j], a->cap, sizeof(double));
            a->dg[j] = bt_realloc(a->dg[j], a->cap, sizeof(double));
        }
    }
    a->n = n;
    a->depth = a->head = 0;
    a->rest = a->next_rest = 0;
    a->started = false;
    a->best = a->mark = INFINITY;
    a->stalled = 0;
    a->long_rest = STALL;
}

void bt_anderson_free(bt_anderson *a)
{
    double *arrays[] = {a->g, a->f, a->g_before, a->f_before, a->move, a->best_g};
    for (size_t k = 0; k < sizeof arrays / sizeof *arrays; k++) free(arrays[k]);
    for (int j = 0; j < BT_ANDERSON_DEPTH; j++) {
        free(a->df[j]);
        free(a->dg[j]);
    }
}

static double max_norm(const double *x, size_t n)
{
    double m = 0;
#pragma omp simd reduction(max : m)
    for (size_t i = 0; i < n; i++) m = bt_max(m, fabs(x[i]));
    return m;
}

/// Σ x y, order-free; bound_x, bound_y: max-norms.
static double dot(const double *x, const double *y, size_t n, double bound_x, double bound_y)
{
    const double bound = (double)n * bound_x * bound_y;
    if (!(bound > 0)) return 0;
    const double c = 1.5 * exp2(ceil(log2(bound)) + 1);
    double sum = 0;
#pragma omp simd reduction(+ : sum)
    for (size_t i = 0; i < n; i++) {
        double t = x[i] * y[i] + c;
        sum += t - c;
    }
    return sum;
}

/// Solve the m×m symmetric positive definite system A γ = b by Cholesky; false when it is not.
static bool solve_spd(int m, double a[BT_ANDERSON_DEPTH][BT_ANDERSON_DEPTH], double *b)
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

static void add_column(bt_anderson *a)
{
    const int h = a->head;
    double *df = a->df[h], *dg = a->dg[h];
    for (size_t i = 0; i < a->n; i++) {
        df[i] = a->f[i] - a->f_before[i];
        dg[i] = a->g[i] - a->g_before[i];
    }
    a->largest_df[h] = max_norm(df, a->n);
    a->head = (h + 1) % BT_ANDERSON_DEPTH;
    if (a->depth < BT_ANDERSON_DEPTH) a->depth++;
    for (int j = 0; j < a->depth; j++)
        a->gram[h][j] = a->gram[j][h] = dot(df, a->df[j], a->n, a->largest_df[h], a->largest_df[j]);
}

/// Forget the columns and leave the next sweeps plain, twice as many each time: the plain sweep always gets there.
static void drop(bt_anderson *a)
{
    a->depth = a->head = 0;
    a->started = false;
    a->rest = a->next_rest;
    a->next_rest = a->next_rest < MAX_REST ? 2 * a->next_rest + 1 : MAX_REST;
}

bool bt_anderson_advance(bt_anderson *a)
{
    const size_t n = a->n;
    const double largest_f = max_norm(a->f, n), norm = dot(a->f, a->f, n, largest_f, largest_f);
    if (norm > GO_BACK * a->best || !isfinite(norm)) {
        for (size_t i = 0; i < n; i++) a->move[i] = a->best_g[i] - a->g[i];
        drop(a);
        return true;
    }
    if (norm > DROP_COLUMNS * a->best) {
        drop(a);
        a->best = norm; // the measure from here on: another piece of the problem
    }
    if (norm <= a->best) {
        a->best = norm;
        memcpy(a->best_g, a->g, n * sizeof *a->g);
    }
    if (norm < 0.25 * a->mark) {
        a->mark = norm;
        a->stalled = 0;
    } else if (a->rest == 0 && ++a->stalled > STALL) {
        drop(a);
        a->rest = a->long_rest;
        a->long_rest *= 2;
        a->mark = norm;
        a->stalled = 0;
    }
    if (a->rest > 0) {
        a->rest--;
        return false;
    }
    if (a->started) add_column(a);
    memcpy(a->f_before, a->f, n * sizeof *a->f);
    memcpy(a->g_before, a->g, n * sizeof *a->g);
    a->started = true;
    if (a->depth == 0) return false;

    double matrix[BT_ANDERSON_DEPTH][BT_ANDERSON_DEPTH], gamma[BT_ANDERSON_DEPTH];
    for (int i = 0; i < a->depth; i++) {
        for (int j = 0; j < a->depth; j++) matrix[i][j] = a->gram[i][j];
        matrix[i][i] *= 1 + RIDGE;
        gamma[i] = dot(a->df[i], a->f, n, a->largest_df[i], largest_f);
    }
    bool usable = solve_spd(a->depth, matrix, gamma);
    for (int i = 0; usable && i < a->depth; i++) usable = fabs(gamma[i]) < MAX_GAMMA;
    if (!usable) {
        drop(a);
        return false;
    }
    memset(a->move, 0, n * sizeof *a->move);
    for (int j = 0; j < a->depth; j++) {
        const double *dg = a->dg[j];
        for (size_t i = 0; i < n; i++) a->move[i] -= gamma[j] * dg[i];
    }
    return true;
}
