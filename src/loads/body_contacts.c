// SPDX-License-Identifier: MIT
// Contacts of the towed body as a step leaves them: where, how hard, how fast; see loads/impact.h for the equations.
#include "loads/body_contacts.h"
#include "loads/collision.h"
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

static bt_body_contact row_of(const bt_world *w, const bt_impacts *m, const bt_cell *cell, bt_idx j,
                              bt_idx towed, double c, double s)
{
    const bt_bodies *b = &w->bodies;
    const bt_contact *u = &cell->contacts[j];
    const bool is_b = u->b == towed;
    const bt_idx other = is_b ? u->a : u->b;
    const double sign = is_b ? 1 : -1;
    const bt_collision q = bt_collision_of(w, u);

    // Arms in the world's axes from their products with n and t, turned into the body's frame at X1.
    const double along = is_b ? u->rbt : u->rat, arm = is_b ? q.rbn : q.ran;
    const double nx = c * u->nx + s * u->ny, ny = c * u->ny - s * u->nx;
    bt_body_contact t = {
        .gid = (double)b->gid[other],
        .x = along * nx + arm * ny,
        .y = along * ny - arm * nx,
        .nx = sign * nx,
        .ny = sign * ny,
        .normal = u->ln[0] + u->ln[1],
        .friction = u->lt,
        .collision = q.impulse,
        .approach = q.approach,
        .rest = q.rest,
        .mass = q.mass,
        .thickness = b->mass[other] > 0 ? b->mass[other] / (m->sheet * b->area[other]) : m->body_height,
        .corner = bt_contact_corner_of(b, u, cell->search.pairs[u->pair].part,
                               cell->gaps[j].feature[u->n > 1 && u->ln[1] > u->ln[0]]).angle,
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
