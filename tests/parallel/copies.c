// SPDX-License-Identifier: MIT
// What ranks hold of each other after every step of a world in which much lies on other ranks: exactly the floes that
// the contacts of their cells may touch, the same bits of each, the same marks of the cells that sweeps may move, and
// bounds that know of every floe near. Held against sums over all floes.
//
//     mpirun -n N copies
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "bergtow/shape.h"
#include "contact/contacts.h"
#include "partition/division.h"
#include "partition/domain.h"
#include "tests/parallel/squares.h"

enum { ALONG = 24, ACROSS = 12, STEPS = 300 };

/// Ice at rest, so loose that a floe meets one other at a time; some fly, and a heavy body goes through it towards low
/// x and y, where others hold the floes that it meets.
static bt_world *make_world(void)
{
    bt_world *w = squares_world();
    double disc[2 * BT_MAX_VERTICES];
    for (int k = 0; k < ALONG * ACROSS; k++) {
        const double x = 3.0 * (k % ALONG), y = 3.0 * (k / ALONG);
        if (hypot(x - 55, y - 24) < 3) continue;
        const bool flies = k % 31 == 0;
        bt_body_def d = square_at(x, y);
        d.drag.water_skin = 2;
        if (flies) d.vx = 1.2 * cos(k), d.vy = 1.2 * sin(k);
        bt_world_add(w, &d);
    }
    const int n = bt_shape_named("disc", 4, 4, disc);
    const bt_body_def d = {.motion = BT_DYNAMIC, .large = true, .n_vertices = n, .vertices = disc, .x = 55, .y = 24,
                           .vx = -1, .vy = -0.5, .mass = 1e5, .inertia = 2e5};
    bt_world_add(w, &d);
    return w;
}

static _Noreturn void fail(const bt_world *w, const char *what, int64_t x, int64_t y)
{
    fprintf(stderr, "copies: step %ld, rank %d: %s: %ld %ld\n", (long)w->step, w->domain->comm->rank, what, (long)x,
            (long)y);
    fflush(stderr);
    bt_comm_abort(1);
}

/// A contact of bodies in cells p and q is of the cell at the lower of both coordinates: so a rank may touch a floe of
/// (x, y) from its own cells at x − 1, x and y − 1, y; and that with the large body has all floes near it.
static void check_held(const bt_world *w)
{
    const bt_domain *d = w->domain;
    const int me = d->comm->rank;
    for (bt_idx i = 0; i < w->cells->n_in_cells; i++) {
        const int32_t x = w->bodies.cell[i][0], y = w->bodies.cell[i][1];
        bool needed = d->large_owner == me && d->under[bt_division_place(w, x, y)];
        for (int k = 0; k < 4; k++) needed = needed || bt_division_owner(w, x - k % 2, y - k / 2) == me;
        if (!needed) fail(w, "a floe is held that no contact here can touch", w->bodies.gid[i], -1);
    }
}

/// Marks of the cells that are looked at, 1 or 0, are the same wherever they are. Returns in how many cells beside a
/// large body of another rank contacts with it are all that may move a floe.
static int check_marks(const bt_world *w)
{
    typedef struct { int32_t x, y, swept, spare; } mark;
    const bt_cells *t = w->cells;
    mark *mine = bt_alloc((size_t)t->n, sizeof *mine);
    size_t n = 0, n_all;
    for (bt_idx j = 0; j < t->n_busy; j++) {
        const bt_cell *c = &t->cell[t->busy[j]];
        if (t->busy[j] < t->n - 1) mine[n++] = (mark){c->x, c->y, c->swept, 0};
    }
    mark *all = bt_domain_gather_all(w, mine, n, sizeof *mine, &n_all);
    free(mine);
    for (size_t k = 0; k < n_all; k++) {
        const bt_idx here = bt_cells_at(t, all[k].x, all[k].y);
        if (here >= 0 && t->is_busy[here] && t->cell[here].swept != all[k].swept)
            fail(w, "a cell is swept on one rank and not on another", all[k].x, all[k].y);
    }
    free(all);
    int beside = 0;
    for (int k = 0; k < w->domain->n_links; k++) beside += w->domain->link[k].n_receive_now[BT_COLOURS] > 0;
    return beside;
}

/// Labels are renewed on all ranks or on none.
static void check_labels(const bt_world *w)
{
    double is[2] = {w->cells->relabel, !w->cells->relabel};
    bt_domain_maxima(w, is, 2);
    if (is[0] > 0 && is[1] > 0) fail(w, "new labels are due on some ranks and not on others", w->cells->relabel, -1);
}

/// The margin of a cell is made for the fastest floe of its block of four and of a ring around that.
static void check_bounds(const bt_world *w)
{
    typedef struct { int32_t x, y; double speed; } fast;
    const bt_cells *t = w->cells;
    const bt_bodies *b = &w->bodies;
    fast *mine = bt_alloc((size_t)b->n, sizeof *mine);
    size_t n = 0, n_all;
    for (bt_idx i = 0; i < t->n_in_cells; i++) {
        const double s = bt_max(bt_bodies_speed(w, i, &b->vel_start[i]),
                                bt_max(bt_bodies_speed(w, i, &b->vel_free[i]), bt_bodies_speed(w, i, &b->vel[i])));
        if (s > 0 && bt_domain_owns(w, i)) mine[n++] = (fast){b->cell[i][0], b->cell[i][1], s};
    }
    fast *all = bt_domain_gather_all(w, mine, n, sizeof *mine, &n_all);
    free(mine);
    for (bt_idx k = 0; k < t->n - 1; k++)
        for (size_t f = 0; f < n_all && t->cell[k].own; f++) {
            const int32_t x = all[f].x - t->cell[k].x, y = all[f].y - t->cell[k].y;
            if (x >= -1 && x <= 2 && y >= -1 && y <= 2 && !(t->bound[k] >= all[f].speed))
                fail(w, "a cell does not know of a fast floe near", t->cell[k].x, t->cell[k].y);
        }
    free(all);
}

int main(int argc, char **argv)
{
    bt_comm_start(&argc, &argv);
    const bt_comm *c = bt_comm_world();
    if (c->size < 2) {
        fprintf(stderr, "start me with: mpirun -n N copies\n");
        return bt_comm_end(BT_ERR_USAGE);
    }
    bt_world *w = make_world();
    bt_domain_create(w, c);
    double beside = 0;
    for (int n = 0; n < STEPS; n++) {
        bt_world_step(w);
        check_held(w);
        beside += check_marks(w) > 0;
        check_bounds(w);
        check_labels(w);
        bt_domain_validate(w);
    }
    bt_domain_maxima(w, &beside, 1);
    const bt_domain_stats s = bt_domain_get_stats(w);
    bt_totals moved = {.n_sums = 1};
    bt_sum_add(&moved.sum[0], (double)s.moved);
    bt_domain_reduce(w, &moved);
    if (c->rank == 0)
        printf("%d labellings, %d divisions, %d floes went over, %d steps with contacts of the body elsewhere\n",
               (int)w->cells->n_labellings, (int)s.divisions, (int)bt_sum_value(&moved.sum[0]), (int)beside);
    bt_world_free(w);
    return bt_comm_end(BT_OK);
}
