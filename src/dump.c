// SPDX-License-Identifier: MIT
// The contact problem of the step just solved, as a local problem in FCLIB's format.
//
// Rows in the order of the manifolds (the order of the ids), normal then tangent. W = J M⁻¹ Jᵀ couples contacts that
// share a movable body. q follows from the solution, q = u − W r with u = J U2 + b, so that what a tow line adds
// (it is no contact) is held at its solved value.
#include <math.h>
#include <stdlib.h>

#include "bergtow/fclib.h"
#include "bergtow/solver.h"

typedef struct {
    int32_t contact; ///< in the order of the manifolds
    int side;        ///< −1: the body is a, +1: it is b
} touch;

/// Inverse-mass product of two rows' directions at the shared body: [n n', n t'; t n', t t'].
static void couple(const bt_row *r, int sr, const bt_row *q, int sq, bt_inv inv, double out[4])
{
    const double rn = sr > 0 ? r->rbn : r->ran, rt = sr > 0 ? r->rbt : r->rat;
    const double qn = sq > 0 ? q->rbn : q->ran, qt = sq > 0 ? q->rbt : q->rat;
    const double s = sr * sq, c = r->nx * q->nx + r->ny * q->ny, d = r->nx * q->ny - r->ny * q->nx;
    out[0] += s * (inv.m * c + inv.i * rn * qn);  // n·n'
    out[1] += s * (-inv.m * d + inv.i * rn * qt); // n·t' with t' = (−n'_y, n'_x)
    out[2] += s * (inv.m * d + inv.i * rt * qn);  // t·n'
    out[3] += s * (inv.m * c + inv.i * rt * qt);  // t·t'
}

static int by_contact(const void *a, const void *b)
{
    const touch *p = a, *q = b;
    return (p->contact > q->contact) - (p->contact < q->contact);
}

bt_status bt_solver_dump(const bt_world *w, const char *path, bt_errors *err)
{
    const bt_solver *s = w->solver;
    const bt_contacts *c = w->contacts;
    const bt_bodies *b = &w->bodies;
    const int n = (int)c->n_points;
    const bt_row **row = bt_alloc((size_t)n, sizeof *row);
    for (int k = 0, m = 0; m < c->n_man; m++)
        for (int i = 0; i < c->man[m].n_points; i++) row[k++] = &s->rows[s->row_of[m] + i];

    // Which contacts touch each movable body.
    int64_t *first = bt_alloc((size_t)b->n + 1, sizeof *first);
    for (int k = 0; k < n; k++) {
        if (b->inv[row[k]->a].m > 0) first[row[k]->a + 1]++;
        if (b->inv[row[k]->b].m > 0) first[row[k]->b + 1]++;
    }
    for (bt_idx i = 0; i < b->n; i++) first[i + 1] += first[i];
    touch *at = bt_alloc((size_t)first[b->n], sizeof *at);
    int64_t *next = bt_alloc((size_t)b->n, sizeof *next);
    for (bt_idx i = 0; i < b->n; i++) next[i] = first[i];
    for (int k = 0; k < n; k++) {
        if (b->inv[row[k]->a].m > 0) at[next[row[k]->a]++] = (touch){k, -1};
        if (b->inv[row[k]->b].m > 0) at[next[row[k]->b]++] = (touch){k, 1};
    }

    int64_t most = 0;
    for (int k = 0; k < n; k++) {
        const bt_idx ends[2] = {row[k]->a, row[k]->b};
        for (int e = 0; e < 2; e++) most += first[ends[e] + 1] - first[ends[e]];
    }
    int64_t *ptr = bt_alloc(2 * (size_t)n + 1, sizeof *ptr);
    int32_t *col = bt_alloc(4 * (size_t)most, sizeof *col);
    double *val = bt_alloc(4 * (size_t)most, sizeof *val);
    double *q = bt_alloc(2 * (size_t)n, sizeof *q), *mu = bt_alloc((size_t)n, sizeof *mu);
    double *u = bt_alloc(2 * (size_t)n, sizeof *u), *r = bt_alloc(2 * (size_t)n, sizeof *r);
    for (int k = 0; k < n; k++) {
        const bt_row *p = row[k];
        const bt_vel *va = &b->vel[p->a], *vb = &b->vel[p->b];
        const double dx = vb->x - va->x, dy = vb->y - va->y;
        u[2 * k] = p->nx * dx + p->ny * dy + p->rbn * vb->w - p->ran * va->w + p->bias;
        u[2 * k + 1] = p->nx * dy - p->ny * dx + p->rbt * vb->w - p->rat * va->w;
        r[2 * k] = p->ln;
        r[2 * k + 1] = p->lt;
        mu[k] = p->mu;
    }
    // Neighbours of a contact: the union of the contacts at its two bodies, in the order of the contacts.
    touch *near = NULL;
    size_t cap = 0;
    for (int k = 0; k < n; k++) {
        const bt_row *p = row[k];
        size_t m = 0;
        const bt_idx ends[2] = {p->a, p->b};
        for (int e = 0; e < 2; e++) {
            const size_t add = (size_t)(first[ends[e] + 1] - first[ends[e]]);
            if (m + add > cap) near = bt_realloc(near, cap = 2 * (m + add), sizeof *near);
            for (size_t i = 0; i < add; i++) near[m++] = at[first[ends[e]] + (int64_t)i];
        }
        if (m) qsort(near, m, sizeof *near, by_contact);
        int64_t entries = ptr[2 * k];
        int64_t blocks = 0;
        for (size_t i = 0; i < m; i++) blocks += i == 0 || near[i].contact != near[i - 1].contact;
        int64_t e0 = entries, e1 = entries + 2 * blocks;
        ptr[2 * k + 1] = e1;
        ptr[2 * k + 2] = e1 + 2 * blocks;
        for (size_t i = 0; i < m;) {
            const int o = near[i].contact;
            double block[4] = {0};
            for (; i < m && near[i].contact == o; i++) {
                const bt_idx body = near[i].side > 0 ? row[o]->b : row[o]->a;
                couple(p, body == p->b ? 1 : -1, row[o], near[i].side, b->inv[body], block);
            }
            for (int t = 0; t < 2; t++) {
                col[e0] = col[e1] = 2 * o + t;
                val[e0++] = block[t];
                val[e1++] = block[2 + t];
            }
        }
    }
    for (int i = 0; i < 2 * n; i++) {
        double wr = 0;
        for (int64_t e = ptr[i]; e < ptr[i + 1]; e++) wr += val[e] * r[col[e]];
        q[i] = u[i] - wr;
    }
    bt_status status = bt_fclib_write_local(path, n, ptr, col, val, q, mu, NULL, u, r, "bergtow",
                                            "contact problem of one time step of broken sea ice, 2-D, with its solution", err);
    void *arrays[] = {row, first, at, next, ptr, col, val, q, mu, u, r, near};
    for (size_t i = 0; i < sizeof arrays / sizeof *arrays; i++) free(arrays[i]);
    return status;
}
