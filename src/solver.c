// SPDX-License-Identifier: MIT
// Rows, colours and projected Gauss–Seidel sweeps; equations and layout in bergtow/solver.h.
#include "bergtow/solver.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "anderson.h"
#include "bergtow/sum.h"
#include "bergtow/tow.h"

#define SEQUENTIAL BT_MAX_COLOURS ///< colour of the manifolds done one after the other
#define MIN_PARALLEL_ROWS 6000    ///< fewer rows than this are swept faster by one thread (a barrier a colour)

bt_solver *bt_solver_create(void)
{
    bt_solver *s = bt_alloc(1, sizeof *s);
    s->anderson = bt_alloc(1, sizeof *s->anderson);
    return s;
}

void bt_solver_free(bt_solver *s)
{
    if (!s) return;
    bt_anderson_free(s->anderson);
    void *arrays[] = {s->rows, s->unit, s->row_of, s->used, s->colour, s->shift, s->push, s->step, s->scale, s->anderson, s->island, s->share, s->surplus};
    for (size_t i = 0; i < sizeof arrays / sizeof *arrays; i++) free(arrays[i]);
    free(s);
}

static void reserve(bt_solver *s, bt_idx n_rows, bt_idx n_man, bt_idx n_bodies)
{
    if (n_rows > s->cap_rows) {
        s->cap_rows = n_rows + n_rows / 4;
        free(s->rows);
        s->rows = bt_alloc_aligned((size_t)s->cap_rows, sizeof *s->rows);
        s->step = bt_realloc(s->step, 2 * (size_t)s->cap_rows, sizeof *s->step);
        s->scale = bt_realloc(s->scale, 2 * (size_t)s->cap_rows, sizeof *s->scale);
        s->push = bt_realloc(s->push, (size_t)s->cap_rows, sizeof *s->push);
    }
    if (n_man >= s->cap_man) { // also the first time, when there is none
        s->cap_man = n_man + n_man / 4 + 1;
        s->row_of = bt_realloc(s->row_of, (size_t)s->cap_man, sizeof *s->row_of);
        s->colour = bt_realloc(s->colour, (size_t)s->cap_man, sizeof *s->colour);
        s->unit = bt_realloc(s->unit, (size_t)s->cap_man + 1, sizeof *s->unit);
    }
    if (n_bodies > s->cap_bodies) {
        s->cap_bodies = n_bodies;
        s->used = bt_realloc(s->used, (size_t)n_bodies, sizeof *s->used);
        free(s->shift);
        s->shift = bt_alloc_aligned((size_t)n_bodies, sizeof *s->shift);
    }
}

/// First-fit colours in the order of the manifolds; fills colour and the units' starts by colour.
static void colour_manifolds(bt_world *w)
{
    bt_solver *s = w->solver;
    const bt_contacts *c = w->contacts;
    const bt_bodies *b = &w->bodies;
    memset(s->used, 0, (size_t)b->n * sizeof *s->used);
    bt_idx count[BT_MAX_COLOURS + 1] = {0};
    int n_colours = 0;
    for (bt_idx k = 0; k < c->n_man; k++) {
        bt_idx i = c->man[k].a, j = c->man[k].b;
        bool move_i = b->inv[i].m > 0, move_j = b->inv[j].m > 0;
        uint64_t used = (move_i ? s->used[i] : 0) | (move_j ? s->used[j] : 0);
        int colour = SEQUENTIAL;
        if (!(move_i && b->large[i]) && !(move_j && b->large[j]) && ~used) {
            colour = __builtin_ctzll(~used);
            if (move_i) s->used[i] |= (uint64_t)1 << colour;
            if (move_j) s->used[j] |= (uint64_t)1 << colour;
            if (colour >= n_colours) n_colours = colour + 1;
        }
        s->colour[k] = (uint8_t)colour;
        count[colour]++;
    }
    s->n_colours = n_colours;
    s->start[0] = 0;
    for (int k = 0; k < n_colours; k++) s->start[k + 1] = s->start[k] + count[k];
    s->start[n_colours + 1] = s->start[n_colours] + count[SEQUENTIAL];
}

static double normal_velocity(const bt_row *r, const bt_vel *va, const bt_vel *vb)
{
    return r->nx * (vb->x - va->x) + r->ny * (vb->y - va->y) + r->rbn * vb->w - r->ran * va->w;
}

static double tangent_velocity(const bt_row *r, const bt_vel *va, const bt_vel *vb)
{
    return r->nx * (vb->y - va->y) - r->ny * (vb->x - va->x) + r->rbt * vb->w - r->rat * va->w;
}

/// Normal bias b of model equation (1).
static double bias_of(const bt_world *w, const bt_row *r, double restitution)
{
    const bt_bodies *b = &w->bodies;
    if (restitution > 0) {
        // Newton's law on the approach at the start of the step. A pair that would meet within the step rebounds
        // now: letting it close the gap first would lose the approach speed that the law refers to. "Meets" counts
        // from the slop on, or rounding would decide which of two points of a square hit rebounds.
        // Where drag takes part of the approach within the step, the law refers to what is left: the work of a row is
        // λ (w* + w2)/2, and a rebound faster than −w* would add energy.
        double approach = normal_velocity(r, &b->vel_start[r->a], &b->vel_start[r->b]);
        double closing = normal_velocity(r, &b->vel_free[r->a], &b->vel_free[r->b]);
        if (approach < -w->par.rest_speed && r->gap + w->par.dt * bt_min(closing, 0) < w->par.slop)
            return restitution * bt_max(approach, bt_min(closing, 0));
    }
    return bt_max(r->gap, 0) / w->par.dt;
}

/// Least body that i is joined to (union-find with path halving).
static bt_idx island_of(bt_solver *s, bt_idx i)
{
    while (s->island[i] != i) i = s->island[i] = s->island[s->island[i]];
    return i;
}

static double island_share(const bt_world *w, const bt_manifold *m)
{
    if (!w->solver->rebounds) return 1;
    return w->solver->share[island_of(w->solver, w->bodies.inv[m->a].m > 0 ? m->a : m->b)];
}

static void fill_row(const bt_world *w, const bt_manifold *m, const bt_point *p, bt_row *r)
{
    const bt_bodies *b = &w->bodies;
    const bt_inv ia = b->inv[m->a], ib = b->inv[m->b];
    const double nx = m->nx, ny = m->ny;
    *r = (bt_row){
        .a = m->a,
        .b = m->b,
        .nx = nx,
        .ny = ny,
        .ran = p->ra[0] * ny - p->ra[1] * nx,
        .rbn = p->rb[0] * ny - p->rb[1] * nx,
        .rat = p->ra[0] * nx + p->ra[1] * ny,
        .rbt = p->rb[0] * nx + p->rb[1] * ny,
        .mu = b->friction[m->b],
        .ln = p->ln,
        .lt = p->lt,
        .gap = p->gap,
    };
    r->mn = 1 / (ia.m + ib.m + ia.i * r->ran * r->ran + ib.i * r->rbn * r->rbn);
    r->mt = 1 / (ia.m + ib.m + ia.i * r->rat * r->rat + ib.i * r->rbt * r->rbt);
    r->bias = bias_of(w, r, island_share(w, m) * b->restitution[m->b]);
    if (!w->par.warm_start) r->ln = r->lt = 0;
}

/// Colour the manifolds and pack the rows of this step.
static void prepare(bt_world *w)
{
    bt_solver *s = w->solver;
    const bt_contacts *c = w->contacts;
    reserve(s, (bt_idx)c->n_points, c->n_man, w->bodies.n);
    s->n_rows = (bt_idx)c->n_points;
    colour_manifolds(w);

    // Units (manifolds by colour), their first rows, then the rows themselves.
    bt_idx next[BT_MAX_COLOURS + 1];
    memcpy(next, s->start, (size_t)s->n_colours * sizeof *next);
    next[SEQUENTIAL] = s->start[s->n_colours];
    bt_idx *unit_man = (bt_idx *)s->row_of; // scratch: manifold of each unit, until row_of takes its place
    bt_idx n_units = c->n_man;
    for (bt_idx k = 0; k < n_units; k++) unit_man[next[s->colour[k]]++] = k;
    bt_idx row = 0;
    for (bt_idx u = 0; u < n_units; u++) {
        s->unit[u] = row;
        const bt_manifold *m = &c->man[unit_man[u]];
        for (int i = 0; i < m->n_points; i++, row++) {
            fill_row(w, m, &m->p[i], &s->rows[row]);
            s->scale[2 * row] = 1 / sqrt(s->rows[row].mn);
            s->scale[2 * row + 1] = 1 / sqrt(s->rows[row].mt);
        }
    }
    s->unit[n_units] = row;
    memcpy(next, s->start, (size_t)s->n_colours * sizeof *next);
    next[SEQUENTIAL] = s->start[s->n_colours];
    for (bt_idx k = 0; k < n_units; k++) s->row_of[k] = s->unit[next[s->colour[k]]++];
}

/// Add impulse (ln, lt) of a row to both bodies. Bodies of infinite mass are never written: they are shared by rows
/// of one colour.
static inline void apply(const bt_row *r, double ln, double lt, bt_vel *v, const bt_inv *inv)
{
    const double jx = ln * r->nx - lt * r->ny, jy = ln * r->ny + lt * r->nx;
    const bt_inv ia = inv[r->a], ib = inv[r->b];
    if (ia.m > 0) {
        v[r->a].x -= ia.m * jx;
        v[r->a].y -= ia.m * jy;
        v[r->a].w -= ia.i * (ln * r->ran + lt * r->rat);
    }
    if (ib.m > 0) {
        v[r->b].x += ib.m * jx;
        v[r->b].y += ib.m * jy;
        v[r->b].w += ib.i * (ln * r->rbn + lt * r->rbt);
    }
}

static inline double clamp(double x, double bound) { return bt_max(-bound, bt_min(bound, x)); }

/// Gauss–Seidel update of one contact point, normal then tangent; returns the larger correction, m/s.
static inline double update_row(bt_row *r, bt_vel *v, const bt_inv *inv, double step[2])
{
    double wn = normal_velocity(r, &v[r->a], &v[r->b]) + r->bias;
    double dn = bt_max(0, r->ln - wn * r->mn) - r->ln;
    r->ln += dn;
    apply(r, dn, 0, v, inv);
    double wt = tangent_velocity(r, &v[r->a], &v[r->b]);
    double dt = clamp(r->lt - wt * r->mt, r->mu * r->ln) - r->lt;
    r->lt += dt;
    apply(r, 0, dt, v, inv);
    step[0] = dn;
    step[1] = dt;
    return bt_max(fabs(dn) / r->mn, fabs(dt) / r->mt);
}

/// Gauss–Seidel update of a manifold with two points: both normals together, then the friction of both. The normals are the
/// exact solution of their 2×2 complementarity problem, by its four cases (both press, one of them, none). Two
/// points of one edge are strongly coupled through the turning of the floes: solved one by one they need 2 to 10
/// times the sweeps on rows of floes lying edge to edge. When the coupling is singular (points that coincide) the
/// first of the single cases that holds is taken. The tangential rows of the points are the same (manifold.c), so only
/// the sum of their friction has an effect, bounded by μ (λ1 + λ2); it is shared in proportion to the normals. Two
/// separate unknowns would drift apart along their null space and eat up the friction cone.
static inline double update_pair(bt_row *r, bt_vel *v, const bt_inv *inv, double *step)
{
    bt_row *p = r, *q = r + 1;
    const bt_inv ia = inv[p->a], ib = inv[p->b];
    const double w1 = 1 / p->mn, w2 = 1 / q->mn;
    const double w12 = ia.m + ib.m + ia.i * p->ran * q->ran + ib.i * p->rbn * q->rbn;
    const double u1 = normal_velocity(p, &v[p->a], &v[p->b]) + p->bias, u2 = normal_velocity(q, &v[q->a], &v[q->b]) + q->bias;
    // Velocities with both impulses taken off.
    const double b1 = u1 - w1 * p->ln - w12 * q->ln, b2 = u2 - w12 * p->ln - w2 * q->ln;
    const double det = w1 * w2 - w12 * w12;
    const double only1 = bt_max(0, -b1 * p->mn), only2 = bt_max(0, -b2 * q->mn);
    double l1 = (w12 * b2 - w2 * b1) / det, l2 = (w12 * b1 - w1 * b2) / det;
    if (!(det > 1e-9 * w1 * w2 && l1 >= 0 && l2 >= 0)) {
        const bool first = b2 + w12 * only1 >= 0 || only2 == 0; // then the second point opens by itself
        l1 = first ? only1 : 0;
        l2 = first ? 0 : only2;
    }
    const double d1 = l1 - p->ln, d2 = l2 - q->ln;
    p->ln = l1, q->ln = l2;
    apply(p, d1, 0, v, inv);
    apply(q, d2, 0, v, inv);
    const double total = l1 + l2, t = p->lt + q->lt;
    const double t2 = clamp(t - tangent_velocity(p, &v[p->a], &v[p->b]) * p->mt, p->mu * total);
    apply(p, 0, t2 - t, v, inv);
    const double share = total > 0 ? t2 * (l1 / total) : 0;
    step[0] = d1, step[1] = share - p->lt, step[2] = d2, step[3] = t2 - share - q->lt;
    p->lt = share, q->lt = t2 - share;
    return bt_max(bt_max(fabs(d1) * w1, fabs(d2) * w2), fabs(t2 - t) / p->mt);
}

static inline double update_unit(bt_solver *s, bt_idx u, bt_vel *v, const bt_inv *inv)
{
    const bt_idx i = s->unit[u];
    if (s->unit[u + 1] - i == 2) return update_pair(&s->rows[i], v, inv, s->step + 2 * i);
    return update_row(&s->rows[i], v, inv, s->step + 2 * i);
}

static double sweep(bt_world *w, bool parallel)
{
    bt_solver *s = w->solver;
    bt_vel *v = w->bodies.vel;
    const bt_inv *inv = w->bodies.inv;
    double change = 0;
#pragma omp parallel if (parallel) reduction(max : change)
    for (int k = 0; k < s->n_colours; k++) {
#pragma omp for schedule(static)
        for (bt_idx u = s->start[k]; u < s->start[k + 1]; u++) change = bt_max(change, update_unit(s, u, v, inv));
    }
    for (bt_idx u = s->start[s->n_colours]; u < s->start[s->n_colours + 1]; u++) change = bt_max(change, update_unit(s, u, v, inv));
    if (w->tow && w->tow->mode == BT_TOW_LINE) change = bt_max(change, bt_tow_update(w->tow, &v[w->towed], inv[w->towed]));
    return change;
}

double bt_solver_residual(const bt_world *w)
{
    const bt_solver *s = w->solver;
    const bt_vel *v = w->bodies.vel;
    const bt_idx n_units = w->contacts->n_man;
    double worst = 0;
#pragma omp parallel for schedule(static) reduction(max : worst) if (s->n_rows > MIN_PARALLEL_ROWS)
    for (bt_idx u = 0; u < n_units; u++) {
        double normal = 0, tangent = 0;
        const bt_row *r = &s->rows[s->unit[u]];
        for (bt_idx i = s->unit[u]; i < s->unit[u + 1]; i++) {
            const bt_row *p = &s->rows[i];
            const double wn = normal_velocity(p, &v[p->a], &v[p->b]) + p->bias;
            worst = bt_max(worst, fabs(bt_max(0, p->ln - wn * p->mn) - p->ln) / p->mn);
            normal += p->ln;
            tangent += p->lt;
        }
        const double wt = tangent_velocity(r, &v[r->a], &v[r->b]);
        worst = bt_max(worst, fabs(clamp(tangent - wt * r->mt, r->mu * normal) - tangent) / r->mt);
        if (!isfinite(wt)) worst = INFINITY; // the maximum itself passes over a NaN
    }
    if (w->tow && w->tow->mode == BT_TOW_LINE) worst = bt_max(worst, bt_tow_residual(w->tow, &v[w->towed]));
    return worst;
}

static void warm_start(bt_world *w)
{
    bt_solver *s = w->solver;
    bt_vel *v = w->bodies.vel;
    const bt_inv *inv = w->bodies.inv;
    for (bt_idx i = 0; i < s->n_rows; i++) {
        bt_row *r = &s->rows[i];
        r->lt = clamp(r->lt, r->mu * r->ln);
        if (r->ln != 0) apply(r, r->ln, r->lt, v, inv);
    }
    if (!w->tow || w->tow->mode != BT_TOW_LINE) return;
    bt_tow_warm_start(w->tow, &v[w->towed], inv[w->towed], w->par.warm_start);
    // On a heavy body the residual of a tension that is newtons off, Δλ W, is below the tolerance before the first sweep. So
    // the line has its exact update in every step, not only in steps with sweeps.
    bt_tow_update(w->tow, &v[w->towed], inv[w->towed]);
}

static void move_unit(bt_solver *s, bt_idx u, const double *move, bt_vel *v, const bt_inv *inv)
{
    for (bt_idx i = s->unit[u]; i < s->unit[u + 1]; i++) {
        const double dn = move[2 * i] / s->scale[2 * i], dt = move[2 * i + 1] / s->scale[2 * i + 1];
        if (dn == 0 && dt == 0) continue;
        s->rows[i].ln += dn;
        s->rows[i].lt += dt;
        apply(&s->rows[i], dn, dt, v, inv);
    }
}

/// U* + M⁻¹ Jᵀ λ from scratch: what increments have rounded away does not build up.
static void velocities_from_impulses(bt_world *w)
{
    bt_solver *s = w->solver;
    bt_bodies *b = &w->bodies;
    for (bt_idx i = 0; i < s->n_rows; i++) {
        const bt_row *r = &s->rows[i];
        if (b->inv[r->a].m > 0) b->vel[r->a] = b->vel_free[r->a];
        if (b->inv[r->b].m > 0) b->vel[r->b] = b->vel_free[r->b];
    }
    bt_tow *t = w->tow && w->tow->mode == BT_TOW_LINE ? w->tow : NULL;
    if (t) b->vel[w->towed] = b->vel_free[w->towed];
    for (bt_idx i = 0; i < s->n_rows; i++)
        if (s->rows[i].ln != 0) apply(&s->rows[i], s->rows[i].ln, s->rows[i].lt, b->vel, b->inv);
    if (t) bt_tow_apply(t, t->lambda, &b->vel[w->towed], b->inv[w->towed]);
}

/// One step of Anderson acceleration after a sweep. Unknowns are scaled by √W to the common unit √(N s m/s).
static void accelerate(bt_world *w, bool parallel)
{
    bt_solver *s = w->solver;
    bt_anderson *a = s->anderson;
    bt_tow *t = w->tow && w->tow->mode == BT_TOW_LINE && w->tow->taut ? w->tow : NULL;
    const double line = t ? sqrt(t->w) : 0;
    for (bt_idx i = 0; i < s->n_rows; i++) {
        const bt_row *r = &s->rows[i];
        const double *scale = s->scale + 2 * i;
        a->g[2 * i] = r->ln * scale[0];
        a->g[2 * i + 1] = r->lt * scale[1];
        a->f[2 * i] = s->step[2 * i] * scale[0];
        a->f[2 * i + 1] = s->step[2 * i + 1] * scale[1];
    }
    a->g[2 * s->n_rows] = t ? t->lambda * line : 0;
    a->f[2 * s->n_rows] = t ? t->step * line : 0;
    if (!bt_anderson_advance(a)) return;

    bt_vel *v = w->bodies.vel;
    const bt_inv *inv = w->bodies.inv;
#pragma omp parallel if (parallel)
    for (int k = 0; k < s->n_colours; k++) {
#pragma omp for schedule(static)
        for (bt_idx u = s->start[k]; u < s->start[k + 1]; u++) move_unit(s, u, a->move, v, inv);
    }
    for (bt_idx u = s->start[s->n_colours]; u < s->start[s->n_colours + 1]; u++) move_unit(s, u, a->move, v, inv);
    if (t) bt_tow_apply(t, a->move[2 * s->n_rows] / line, &v[w->towed], inv[w->towed]);
    if (t) t->lambda += a->move[2 * s->n_rows] / line;
}

static void sweep_to_tolerance(bt_world *w)
{
    bt_solver *s = w->solver;
    bt_contacts *c = w->contacts;
    const double tolerance = w->par.tolerance;
    const bool parallel = s->n_rows > MIN_PARALLEL_ROWS;
    warm_start(w);
    bt_step_stats *st = &w->stats;
    st->residual = bt_solver_residual(w);
    const int64_t limit = st->sweeps + w->par.max_sweeps;
    // An impulse below the tolerance that is carried over from step to step would push for ever: one sweep at least.
    bool pressed = false;
    for (bt_idx i = 0; i < s->n_rows && !pressed; i++) pressed = s->rows[i].ln > 0;
    if (pressed && st->residual <= tolerance) {
        sweep(w, parallel);
        st->sweeps++;
        st->residual = bt_solver_residual(w);
    }
    if (st->residual > tolerance) bt_anderson_start(s->anderson, 2 * (size_t)s->n_rows + 1);
    while (st->residual > tolerance && st->sweeps < limit) {
        double change = sweep(w, parallel);
        st->sweeps++;
        if (change <= tolerance || st->sweeps == limit) {
            velocities_from_impulses(w);
            st->residual = bt_solver_residual(w);
            if (st->residual <= tolerance) break;
        }
        if (!w->par.plain_sweeps && st->sweeps < limit) accelerate(w, parallel);
    }
    st->converged = st->residual <= tolerance;
    for (bt_idx k = 0; k < c->n_man; k++) {
        const bt_row *r = &s->rows[s->row_of[k]];
        for (int i = 0; i < c->man[k].n_points; i++) {
            c->man[k].p[i].ln = r[i].ln;
            c->man[k].p[i].lt = r[i].lt;
        }
    }
}

/// Join the movable bodies that touch into islands, named by their least body; full restitution for each.
static void find_islands(bt_world *w)
{
    bt_solver *s = w->solver;
    const bt_bodies *b = &w->bodies;
    const bt_contacts *c = w->contacts;
    if (b->n > s->cap_islands) {
        s->cap_islands = b->n;
        s->island = bt_realloc(s->island, (size_t)b->n, sizeof *s->island);
        s->share = bt_realloc(s->share, (size_t)b->n, sizeof *s->share);
        s->surplus = bt_realloc(s->surplus, (size_t)b->n, sizeof *s->surplus);
    }
    for (bt_idx i = 0; i < b->n; i++) {
        s->island[i] = i;
        s->share[i] = 1;
    }
    for (bt_idx k = 0; k < c->n_man; k++) {
        if (b->inv[c->man[k].a].m == 0 || b->inv[c->man[k].b].m == 0) continue;
        bt_idx i = island_of(s, c->man[k].a), j = island_of(s, c->man[k].b);
        if (i < j) s->island[j] = i;
        else s->island[i] = j;
    }
}

static double row_work(const bt_world *w, const bt_row *r);

/// Lower the restitution of every island whose contacts did positive work, beyond what rows solved to the residual may
/// do (λ times the residual, and rounding). True when there was one.
static bool lower_restitution(bt_world *w)
{
    bt_solver *s = w->solver;
    const bt_bodies *b = &w->bodies;
    const double allowed = w->stats.residual + 1e-12;
    for (bt_idx i = 0; i < b->n; i++) s->surplus[i] = (bt_sum){0};
    for (bt_idx i = 0; i < s->n_rows; i++) {
        const bt_row *r = &s->rows[i];
        if (r->ln == 0) continue;
        const bt_idx own = island_of(s, b->inv[r->a].m > 0 ? r->a : r->b);
        bt_sum_add(&s->surplus[own], row_work(w, r) - allowed * (r->ln + fabs(r->lt)));
    }
    bool any = false;
    for (bt_idx i = 0; i < b->n; i++) {
        if (s->island[i] != i || s->share[i] == 0 || !(bt_sum_value(&s->surplus[i]) > 0)) continue;
        s->share[i] = s->share[i] > 0.2 ? 0.5 * s->share[i] : 0;
        any = true;
    }
    return any;
}

void bt_solver_solve(bt_world *w)
{
    bt_solver *s = w->solver;
    bt_bodies *b = &w->bodies;
    bt_step_stats *st = &w->stats;
    s->rebounds = false;
    for (bt_idx k = 0; k < w->contacts->n_man && !s->rebounds; k++) s->rebounds = b->restitution[w->contacts->man[k].b] > 0;
    if (s->rebounds) find_islands(w);
    st->restitution_cut = false;
    s->prepare_s = 0;
    st->sweeps = 0;
    for (;;) {
        const double t0 = bt_clock();
        prepare(w);
        s->prepare_s += bt_clock() - t0;
        sweep_to_tolerance(w);
        st->contact_work = bt_solver_work(w);
        if (!s->rebounds || !lower_restitution(w)) break;
        st->restitution_cut = true;
        for (bt_idx i = 0; i < b->n; i++) b->vel[i] = b->vel_free[i];
    }
}

/// Velocity without contacts: U*, and for the towed body what the line adds to it.
static bt_vel velocity_without_contacts(const bt_world *w, bt_idx i)
{
    bt_vel v = w->bodies.vel_free[i];
    if (i == w->towed && w->tow && w->tow->mode == BT_TOW_LINE) bt_tow_apply(w->tow, w->tow->lambda, &v, w->bodies.inv[i]);
    return v;
}

static double row_work(const bt_world *w, const bt_row *r)
{
    const bt_vel fa = velocity_without_contacts(w, r->a), fb = velocity_without_contacts(w, r->b);
    const bt_vel *va = &w->bodies.vel[r->a], *vb = &w->bodies.vel[r->b];
    return 0.5 * r->ln * (normal_velocity(r, &fa, &fb) + normal_velocity(r, va, vb)) +
           0.5 * r->lt * (tangent_velocity(r, &fa, &fb) + tangent_velocity(r, va, vb));
}

double bt_solver_work(const bt_world *w)
{
    const bt_solver *s = w->solver;
    bt_sum work = {0};
    for (bt_idx i = 0; i < s->n_rows; i++)
        if (s->rows[i].ln != 0) bt_sum_add(&work, row_work(w, &s->rows[i]));
    return bt_sum_value(&work);
}

void bt_solver_impulse_on(const bt_world *w, bt_idx i, double j[3])
{
    const bt_solver *s = w->solver;
    bt_sum sum[3] = {{0}, {0}, {0}};
    for (bt_idx k = 0; k < s->n_rows; k++) {
        const bt_row *r = &s->rows[k];
        if ((r->a != i && r->b != i) || r->ln == 0) continue;
        double sign = r->b == i ? 1 : -1;
        bt_sum_add(&sum[0], sign * (r->ln * r->nx - r->lt * r->ny));
        bt_sum_add(&sum[1], sign * (r->ln * r->ny + r->lt * r->nx));
        bt_sum_add(&sum[2], sign * (r->b == i ? r->ln * r->rbn + r->lt * r->rbt : r->ln * r->ran + r->lt * r->rat));
    }
    for (int k = 0; k < 3; k++) j[k] = bt_sum_value(&sum[k]);
}
