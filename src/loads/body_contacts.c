// SPDX-License-Identifier: MIT
// Contacts of the towed body as a step leaves them: where, how hard, how fast; see loads/impact.h for the equations.
#include "loads/body_contacts.h"
#include "base/inside.h"

#include <math.h>
#include <stdlib.h>

#include "space/cells.h"
#include "partition/domain.h"
#include "solve/kernel.h"
#include "space/phases.h"
#include "base/elementary.h"

enum { CONTACT_WIDTH = sizeof(bt_body_contact) / sizeof(double) };
_Static_assert(sizeof(bt_body_contact) % sizeof(double) == 0, "a contact is a row of doubles");

typedef struct {
    bt_body_contact *row;
    int64_t n, cap;
    double c, s; ///< of the yaw of the towed body at X1
} contact_rows;

/// Interior angle of the outline of body i, rad, where vertex v of its part stands; NaN when there is no such vertex.
/// Parts have no corners of their own: a cut leads from one corner of the outline to another.
static double interior_angle(const bt_bodies *b, bt_idx i, int part, uint32_t v)
{
    const bt_mark *mark = b->mark + b->offset[i] + part;
    const uint32_t count = mark->count;
    if (v > count) return NAN;
    const int n = bt_body_corners(b, i), k = mark[v < count ? v : 0].corner; // v = count: the end of the last edge
    const double *o = b->outline + 2 * b->offset[i], *at = o + 2 * k, *before = o + 2 * (k ? k - 1 : n - 1),
                 *after = o + 2 * (k + 1 < n ? k + 1 : 0);
    const double px = at[0] - before[0], py = at[1] - before[1], qx = after[0] - at[0], qy = after[1] - at[1];
    return BT_PI - bt_atan2(px * qy - py * qx, px * qx + py * qy);
}

/// Interior angle of the corner that makes a contact point of a pair of parts: features as manifold.c numbers them. Of
/// two corners that meet, the sharper.
static double corner_of(const bt_bodies *b, const bt_contact *u, const uint16_t part[2], uint32_t feature)
{
    if ((feature >> 20) == 0x7ffu)
        return bt_min(interior_angle(b, u->a, part[0], (feature >> 10) & 0x3ffu),
                      interior_angle(b, u->b, part[1], feature & 0x3ffu));
    const bool reference_b = feature >> 31, of_reference = feature & 1u, of_b = reference_b == of_reference;
    return interior_angle(b, of_b ? u->b : u->a, part[of_b], (feature & 0xfffffu) >> 1);
}

/// Masses without the drag that the solver's contain: a collision is short against the step.
static bt_inv bare(const bt_bodies *b, bt_idx i)
{
    return b->inv[i].m > 0 ? (bt_inv){1 / b->mass[i], 1 / b->inertia[i]} : (bt_inv){0};
}

static bt_body_contact row_of(const bt_world *w, const bt_impacts *m, const bt_cell *cell, bt_idx j,
                              bt_idx towed, double c, double s)
{
    const bt_bodies *b = &w->bodies;
    const bt_contact *u = &cell->contacts[j];
    const bool is_b = u->b == towed;
    const bt_idx other = is_b ? u->a : u->b;
    const double sign = is_b ? 1 : -1, total = u->ln[0] + u->ln[1], share[2] = {u->ln[0] / total, u->ln[1] / total};
    const bt_inv ia = bare(b, u->a), ib = bare(b, u->b);
    double v1 = 0, v2 = 0, ran = 0, rbn = 0, arm = 0;
    for (int i = 0; i < u->n; i++) {
        v1 += share[i] * bt_normal_velocity(u, i, &b->vel_start[u->a], &b->vel_start[u->b]);
        v2 += share[i] * bt_normal_velocity(u, i, &b->vel[u->a], &b->vel[u->b]);
        ran += share[i] * u->ran[i];
        rbn += share[i] * u->rbn[i];
    }
    arm = is_b ? rbn : ran;
    const double effect = ia.m + ib.m + ia.i * ran * ran + ib.i * rbn * rbn;
    const double coupled = effect + (ia.i * ran * u->rat + ib.i * rbn * u->rbt) * (u->lt / total);
    double collision = 0;
    if (v1 < 0 && v2 > v1) collision = coupled > 0 ? bt_min(total, (v2 - v1) / coupled) : total;

    // Arms in the world's axes from their products with n and t, turned into the body's frame at X1.
    const double along = is_b ? u->rbt : u->rat;
    const double nx = c * u->nx + s * u->ny, ny = c * u->ny - s * u->nx;
    bt_body_contact t = {
        .gid = (double)b->gid[other],
        .x = along * nx + arm * ny,
        .y = along * ny - arm * nx,
        .nx = sign * nx,
        .ny = sign * ny,
        .normal = total,
        .friction = u->lt,
        .collision = collision,
        .approach = bt_max(0, -v1),
        .rest = bt_max(0, -v2),
        .mass = 1 / effect,
        .thickness = b->mass[other] > 0 ? b->mass[other] / (m->sheet * b->area[other]) : m->body_height,
        .corner = corner_of(b, u, cell->search.pairs[u->pair].part,
                            cell->gaps[j].feature[u->n > 1 && u->ln[1] > u->ln[0]]),
    };
    for (int i = 0; i < u->n; i++) {
        const double a = is_b ? u->rbn[i] : u->ran[i];
        t.px[i] = along * nx + a * ny;
        t.py[i] = along * ny - a * nx;
        t.point[i] = u->ln[i];
    }
    return t;
}

static void add(contact_rows *t, const bt_body_contact *row)
{
    if (t->n == t->cap) t->row = bt_realloc(t->row, (size_t)(t->cap = t->cap ? 2 * t->cap : 64), sizeof *t->row);
    t->row[t->n++] = *row;
}

static void add_cell(const bt_world *w, const bt_impacts *m, bt_idx k, contact_rows *to)
{
    const bt_cell *cell = &w->cells->cell[k];
    const bt_idx towed = bt_world_towed(w);
    for (bt_idx j = 0; j < cell->n_contacts; j++) {
        const bt_contact *u = &cell->contacts[j];
        if ((u->a != towed && u->b != towed) || u->ln[0] + u->ln[1] == 0) continue;
        const bt_body_contact t = row_of(w, m, cell, j, towed, to->c, to->s);
        add(to, &t);
    }
}

static int by_gid(const void *a, const void *b)
{
    // A pair has one manifold. A floe of several parts has more: then by place.
    const bt_body_contact *p = a, *q = b;
    if (p->gid != q->gid) return p->gid < q->gid ? -1 : 1;
    if (p->x != q->x) return p->x < q->x ? -1 : 1;
    return (p->y > q->y) - (p->y < q->y);
}

bt_body_contact *bt_body_contacts_collect(const bt_world *w, const bt_impacts *m, int64_t *n)
{
    const bt_cells *ts = w->cells;
    const bt_idx towed = bt_world_towed(w);
    // A large movable body has its contacts in the last cell, which comes last of all; one of infinite mass has them in
    // the cells of the floes.
    const bt_idx from = w->bodies.large[towed] && w->bodies.motion[towed] == BT_DYNAMIC ? ts->start[BT_COLOURS] : 0;
    contact_rows all = {0};
    bt_sincos(w->bodies.pose[towed].yaw, &all.s, &all.c);
    if (!BT_MANY(ts->n_order - from, BT_FEW_CELLS))
        for (bt_idx i = from; i < ts->n_order; i++) add_cell(w, m, ts->order[i], &all);
    else {
#pragma omp parallel
        {
            contact_rows mine = {.c = all.c, .s = all.s};
#pragma omp for schedule(dynamic, 16)
            for (bt_idx i = from; i < ts->n_order; i++) add_cell(w, m, ts->order[i], &mine);
#pragma omp critical
            for (int64_t i = 0; i < mine.n; i++) add(&all, &mine.row[i]);
            free(mine.row);
        }
    }
    bt_body_contact *rows = all.row;
    *n = all.n;
    if (w->domain) {
        const double *mine = (const double *)(const void *)all.row;
        rows = (bt_body_contact *)(void *)bt_domain_gather(w, all.n, CONTACT_WIDTH, mine, n);
        free(all.row);
    }
    if (*n > 0) qsort(rows, (size_t)*n, sizeof *rows, by_gid);
    return rows;
}
