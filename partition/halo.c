// SPDX-License-Identifier: MIT
// What ranks exchange: velocities of shared bodies after each phase, values of cells, and what only some of them know.
//
// Lists. A body of cell t is touched in phase p by one cell, T_p(t), whose rank sends its velocity to all others that
// hold t. Both sides go through the cells they hold in the same order, so they make the same lists without
// communication. Of these bodies few have a contact in a given step: after the detection the sender says which (one
// byte each), and only those travel in the sweeps.
#include <stdlib.h>
#include <string.h>

#include "partition/division.h"
#include "partition/domain.h"

enum { TAG_FLAGS = 10, TAG_CELLS = 11, TAG_VELOCITIES = 20 };

void bt_halo_free(bt_domain *d)
{
    for (int k = 0; k < d->n_links; k++) {
        bt_link *l = &d->link[k];
        for (int p = 0; p < BT_PHASES; p++) {
            free(l->send[p]);
            free(l->receive[p]);
            free(l->send_now[p]);
            free(l->receive_now[p]);
        }
        void *arrays[] = {l->out,       l->in,           l->flags_out, l->flags_in,
                          l->tell_send, l->tell_receive, l->tell_out,  l->tell_in};
        for (size_t i = 0; i < sizeof arrays / sizeof *arrays; i++) free(arrays[i]);
    }
    free(d->link);
    free(d->request);
    d->link = NULL;
    d->request = NULL;
    d->n_links = 0;
}

static bt_link *link_to(bt_domain *d, int rank)
{
    for (int k = 0; k < d->n_links; k++)
        if (d->link[k].rank == rank) return &d->link[k];
    d->link = bt_realloc(d->link, (size_t)d->n_links + 1, sizeof *d->link);
    d->link[d->n_links] = (bt_link){.rank = rank};
    return &d->link[d->n_links++];
}

/// Append the movable bodies of a cell to a list whose capacity is the power of two above its length.
static void append(bt_idx **list, bt_idx *n, const bt_world *w, const bt_cell *t)
{
    for (bt_idx i = t->first; i < t->end; i++) {
        if (w->bodies.motion[i] != BT_DYNAMIC) continue;
        if ((*n & (*n - 1)) == 0) *list = bt_realloc(*list, *n ? 2 * (size_t)*n : 1, sizeof **list);
        (*list)[(*n)++] = i;
    }
}

static bool is_under(const bt_domain *d, const bt_cell *t)
{
    return d->under[(int64_t)(t->y - d->low_y) * d->n_x + t->x - d->low_x];
}

/// Lists of bodies for the cells that this rank holds.
static void list_bodies(bt_world *w)
{
    bt_domain *d = w->domain;
    const bt_cells *t = w->cells;
    const int me = d->comm->rank;
    for (bt_idx k = 0; k < t->n - 1; k++) {
        const bt_cell *cell = &t->cell[k];
        if (cell->end == cell->first) continue;
        int sharer[BT_MAX_SHARERS];
        const int n = bt_division_sharers(w, cell->x, cell->y, sharer);
        for (int p = 0; p < BT_PHASES; p++) {
            int32_t at[2];
            int solver = -1;
            if (p == BT_COLOURS) solver = is_under(d, cell) ? d->large_owner : -1;
            else if (bt_division_toucher(w, p, cell->x, cell->y, at)) solver = bt_division_owner(w, at[0], at[1]);
            if (solver < 0) continue;
            for (int h = 0; h < n; h++) {
                if (sharer[h] == me && solver != me) {
                    bt_link *l = link_to(d, solver);
                    append(&l->receive[p], &l->n_receive[p], w, cell);
                } else if (sharer[h] != me && solver == me) {
                    bt_link *l = link_to(d, sharer[h]);
                    append(&l->send[p], &l->n_send[p], w, cell);
                }
            }
        }
    }
}

/// Does rank r hold a cell beside (x, y)? It then owns one from (x − 2, y − 2) to (x + 1, y + 1), whose bounds depend
/// on the speed there, or has floes there that a large body may move; and what it sweeps depends on how far (x, y) has
/// converged.
static void near_ranks(const bt_world *w, int32_t x, int32_t y, uint8_t *near)
{
    const bt_cells *t = w->cells;
    memset(near, 0, (size_t)w->domain->comm->size);
    for (int32_t dy = -1; dy <= 1; dy++)
        for (int32_t dx = -1; dx <= 1; dx++) {
            if ((t->wrap_x == 1 && dx) || (t->wrap_y == 1 && dy)) continue;
            int sharer[BT_MAX_SHARERS];
            const int n = bt_division_sharers(w, x + dx, y + dy, sharer);
            for (int h = 0; h < n; h++) near[sharer[h]] = 1;
        }
}

/// Lists of cells of which a value is sent: at the border of the map's parts only.
static void list_sent(bt_world *w)
{
    bt_domain *d = w->domain;
    const bt_cells *t = w->cells;
    const int me = d->comm->rank;
    uint8_t *near = bt_alloc((size_t)d->comm->size, 1);
    for (int32_t y = d->low_y; y < d->low_y + d->n_y; y++)
        for (int32_t x = d->low_x; x < d->low_x + d->n_x; x++) {
            const int owner = bt_division_owner(w, x, y);
            near_ranks(w, x, y, near);
            if (owner != me && near[me]) {
                bt_link *l = link_to(d, owner);
                l->tell_receive = bt_realloc(l->tell_receive, (size_t)l->n_tell_receive + 1, sizeof *l->tell_receive);
                l->tell_receive[l->n_tell_receive][0] = x;
                l->tell_receive[l->n_tell_receive++][1] = y;
            } else if (owner == me) {
                for (int r = 0; r < d->comm->size; r++) {
                    if (r == me || !near[r]) continue;
                    bt_link *l = link_to(d, r);
                    l->tell_send = bt_realloc(l->tell_send, (size_t)l->n_tell_send + 1, sizeof *l->tell_send);
                    l->tell_send[l->n_tell_send++] = bt_cells_at(t, x, y);
                }
            }
        }
    free(near);
}

static void mark_owned(bt_world *w)
{
    bt_domain *d = w->domain;
    bt_cells *t = w->cells;
    const bt_bodies *b = &w->bodies;
    if (b->n > d->cap_owned) {
        d->cap_owned = b->n;
        d->owned = bt_realloc(d->owned, (size_t)b->n, 1);
        d->touched = bt_realloc(d->touched, (size_t)b->n, 1);
    }
    double held[2] = {0, 0};
    for (bt_idx k = 0; k < t->n; k++) {
        bt_cell *cell = &t->cell[k];
        const bool own = k < t->n - 1 ? cell->own : d->comm->rank == 0;
        for (bt_idx i = cell->first; i < cell->end; i++) d->owned[i] = own;
        if (k < t->n - 1) held[own] += cell->end - cell->first;
        // Whoever holds a body of the block waits for what the cell does to it.
        const bt_idx block[4] = {k, cell->right, cell->above, cell->diagonal};
        cell->border = k == t->n - 1 && !d->undivided;
        for (int j = 0; j < 4 && cell->own && k < t->n - 1; j++) {
            if (block[j] < 0) continue;
            const bt_cell *other = &t->cell[block[j]];
            int sharer[BT_MAX_SHARERS];
            if (bt_division_sharers(w, other->x, other->y, sharer) > 1) cell->border = true;
        }
    }
    bt_sum sums[2] = {{0}, {0}};
    for (int k = 0; k < 2; k++) bt_sum_add(&sums[k], held[k]);
    bt_comm_reduce(d->comm, sums, 2, NULL, 0, NULL, 0);
    d->stats.halo = bt_sum_value(&sums[1]) > 0 ? bt_sum_value(&sums[0]) / bt_sum_value(&sums[1]) : 0;
}

/// The links for the cells as they are now.
static void make_links(bt_world *w)
{
    bt_domain *d = w->domain;
    bt_halo_free(d);
    list_bodies(w);
    list_sent(w);
    for (int k = 0; k < d->n_links; k++) {
        bt_link *l = &d->link[k];
        bt_idx most_out = 0, most_in = 0;
        for (int p = 0; p < BT_PHASES; p++) {
            l->send_now[p] = bt_alloc((size_t)l->n_send[p], sizeof(bt_idx));
            l->receive_now[p] = bt_alloc((size_t)l->n_receive[p], sizeof(bt_idx));
            l->n_flags_out += l->n_send[p];
            l->n_flags_in += l->n_receive[p];
            most_out = most_out > l->n_send[p] ? most_out : l->n_send[p];
            most_in = most_in > l->n_receive[p] ? most_in : l->n_receive[p];
        }
        l->out = bt_alloc(3 * (size_t)most_out, sizeof *l->out);
        l->in = bt_alloc(3 * (size_t)most_in, sizeof *l->in);
        l->flags_out = bt_alloc((size_t)l->n_flags_out, 1);
        l->flags_in = bt_alloc((size_t)l->n_flags_in, 1);
        l->tell_out = bt_alloc((size_t)l->n_tell_send, sizeof *l->tell_out);
        l->tell_in = bt_alloc((size_t)l->n_tell_receive, sizeof *l->tell_in);
    }
    d->request = bt_alloc(2 * (size_t)d->n_links, sizeof *d->request);
}

void bt_domain_connect(bt_world *w)
{
    if (!w->domain) return;
    mark_owned(w);
    make_links(w);
    bt_domain_check(w);
}

static void wait_all(bt_domain *d)
{
    const double t0 = bt_clock();
    bt_comm_wait(d->n_requests, d->request);
    d->exchange_s += bt_clock() - t0;
    d->n_requests = 0;
}

void bt_domain_tell_cells(bt_world *w, const double *value, bt_take_cell *take)
{
    bt_domain *d = w->domain;
    if (!d) return;
    for (int k = 0; k < d->n_links; k++) {
        bt_link *l = &d->link[k];
        for (bt_idx i = 0; i < l->n_tell_send; i++) l->tell_out[i] = value[l->tell_send[i]];
        if (l->n_tell_receive)
            MPI_Irecv(l->tell_in, l->n_tell_receive, MPI_DOUBLE, l->rank, TAG_CELLS, d->comm->mpi,
                      &d->request[d->n_requests++]);
        if (l->n_tell_send)
            MPI_Isend(l->tell_out, l->n_tell_send, MPI_DOUBLE, l->rank, TAG_CELLS, d->comm->mpi,
                      &d->request[d->n_requests++]);
    }
    wait_all(d);
    for (int k = 0; k < d->n_links; k++) {
        const bt_link *l = &d->link[k];
        for (bt_idx i = 0; i < l->n_tell_receive; i++)
            if (l->tell_in[i] > 0) take(w->cells, l->tell_receive[i][0], l->tell_receive[i][1], l->tell_in[i]);
    }
}

void bt_domain_select(bt_world *w)
{
    bt_domain *d = w->domain;
    if (!d) return;
    const bt_cells *t = w->cells;
    if (w->bodies.n > 0) memset(d->touched, 0, (size_t)w->bodies.n); // a rank that owns nothing has no array
    for (bt_idx i = 0; i < t->n_order; i++) {
        const bt_cell *cell = &t->cell[t->order[i]];
        if (!cell->border) continue;
        for (bt_idx j = 0; j < cell->n_contacts; j++) {
            d->touched[cell->contacts[j].a] |= (uint8_t)(1 << cell->phase);
            d->touched[cell->contacts[j].b] |= (uint8_t)(1 << cell->phase);
        }
    }
    for (int k = 0; k < d->n_links; k++) {
        bt_link *l = &d->link[k];
        bt_idx n = 0;
        for (int p = 0; p < BT_PHASES; p++) {
            l->n_send_now[p] = 0;
            for (bt_idx i = 0; i < l->n_send[p]; i++) {
                const bool now = d->touched[l->send[p][i]] >> p & 1;
                l->flags_out[n++] = now;
                if (now) l->send_now[p][l->n_send_now[p]++] = l->send[p][i];
            }
        }
        if (l->n_flags_in)
            MPI_Irecv(l->flags_in, l->n_flags_in, MPI_BYTE, l->rank, TAG_FLAGS, d->comm->mpi,
                      &d->request[d->n_requests++]);
        if (l->n_flags_out)
            MPI_Isend(l->flags_out, l->n_flags_out, MPI_BYTE, l->rank, TAG_FLAGS, d->comm->mpi,
                      &d->request[d->n_requests++]);
    }
    wait_all(d);
    for (int k = 0; k < d->n_links; k++) {
        bt_link *l = &d->link[k];
        bt_idx n = 0;
        for (int p = 0; p < BT_PHASES; p++) {
            l->n_receive_now[p] = 0;
            for (bt_idx i = 0; i < l->n_receive[p]; i++)
                if (l->flags_in[n++]) l->receive_now[p][l->n_receive_now[p]++] = l->receive[p][i];
        }
    }
}

static void mark_received(bt_world *w, int first_phase, void (*mark)(bt_world *w, bt_idx body))
{
    const bt_domain *d = w->domain;
    for (int k = 0; d && k < d->n_links; k++)
        for (int p = first_phase; p < BT_PHASES; p++)
            for (bt_idx i = 0; i < d->link[k].n_receive_now[p]; i++) mark(w, d->link[k].receive_now[p][i]);
}

void bt_domain_beside_large(bt_world *w, void (*mark)(bt_world *w, bt_idx body)) { mark_received(w, BT_COLOURS, mark); }

void bt_domain_moved_elsewhere(bt_world *w, void (*mark)(bt_world *w, bt_idx body)) { mark_received(w, 0, mark); }

void bt_domain_send(bt_world *w, int phase, bt_vel *v)
{
    bt_domain *d = w->domain;
    for (int k = 0; k < d->n_links; k++) {
        bt_link *l = &d->link[k];
        const bt_idx n_in = l->n_receive_now[phase], n_out = l->n_send_now[phase];
        if (n_in)
            MPI_Irecv(l->in, 3 * n_in, MPI_DOUBLE, l->rank, TAG_VELOCITIES + phase, d->comm->mpi,
                      &d->request[d->n_requests++]);
        for (bt_idx i = 0; i < n_out; i++) {
            const bt_vel *x = &v[l->send_now[phase][i]];
            l->out[3 * i] = x->x, l->out[3 * i + 1] = x->y, l->out[3 * i + 2] = x->w;
        }
        if (n_out)
            MPI_Isend(l->out, 3 * n_out, MPI_DOUBLE, l->rank, TAG_VELOCITIES + phase, d->comm->mpi,
                      &d->request[d->n_requests++]);
    }
}

void bt_domain_receive(bt_world *w, int phase, bt_vel *v)
{
    bt_domain *d = w->domain;
    wait_all(d);
    for (int k = 0; k < d->n_links; k++) {
        const bt_link *l = &d->link[k];
        for (bt_idx i = 0; i < l->n_receive_now[phase]; i++) {
            bt_vel *x = &v[l->receive_now[phase][i]];
            x->x = l->in[3 * i], x->y = l->in[3 * i + 1], x->w = l->in[3 * i + 2];
        }
    }
}
