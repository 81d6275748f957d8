// SPDX-License-Identifier: MIT
// Exchanges between ranks: velocities of shared bodies after each phase, values of cells, and data known only to some.
//
// Lists. A body of cell t is touched in phase p by one cell, T_p(t), whose rank sends its velocity to all others that
// hold t. Both sides traverse the cells that they hold in the same order, so they make the same lists without
// communication. Few of these bodies have a contact in a given step: after the detection the sender marks them (one
// byte each), and only these are sent in the sweeps.
#include <string.h>

#include "partition/division.h"
#include "partition/domain.h"
#include "base/inside.h"

enum { TAG_FLAGS = 10, TAG_CELLS = 11, TAG_VELOCITIES = 20 };

void bt_halo_free(bt_domain *domain)
{
    for (int k = 0; k < domain->n_links; k++) {
        bt_link *link = &domain->link[k];
        for (int p = 0; p < BT_PHASES; p++)
            BT_FREE(link->send[p], link->receive[p], link->send_now[p], link->receive_now[p]);
        BT_FREE(link->out, link->in, link->flags_out, link->flags_in);
        BT_FREE(link->tell_send, link->tell_receive, link->tell_out, link->tell_in);
    }
    free(domain->link);
    free(domain->request);
    domain->link = NULL;
    domain->request = NULL;
    domain->n_links = 0;
}

static bt_link *link_to(bt_domain *domain, int rank)
{
    for (int k = 0; k < domain->n_links; k++)
        if (domain->link[k].rank == rank) return &domain->link[k];
    domain->link = bt_realloc(domain->link, (size_t)domain->n_links + 1, sizeof *domain->link);
    domain->link[domain->n_links] = (bt_link){.rank = rank};
    return &domain->link[domain->n_links++];
}

/// Append the movable bodies of a cell to a list whose capacity is the power of two above its length.
static void append(bt_idx **list, bt_idx *n, const bt_world *world, const bt_cell *cell)
{
    for (bt_idx i = cell->first; i < cell->end; i++) {
        if (world->bodies.motion[i] != BT_DYNAMIC) continue;
        if ((*n & (*n - 1)) == 0) *list = bt_realloc(*list, *n ? 2 * (size_t)*n : 1, sizeof **list);
        (*list)[(*n)++] = i;
    }
}

static bool is_under(const bt_domain *domain, const bt_cell *cell)
{
    return domain->under[(int64_t)(cell->y - domain->low_y) * domain->n_x + cell->x - domain->low_x];
}

/// Make the lists of bodies for the cells that this rank holds.
static void list_bodies(bt_world *world)
{
    bt_domain *domain = world->domain;
    const bt_cells *cells = world->cells;
    const int me = domain->comm->rank;
    for (bt_idx k = 0; k < cells->n - 1; k++) {
        const bt_cell *cell = &cells->cell[k];
        if (cell->end == cell->first) continue;
        int sharer[BT_MAX_SHARERS];
        const int n = bt_division_sharers(world, cell->x, cell->y, sharer);
        for (int p = 0; p < BT_PHASES; p++) {
            int32_t at[2];
            int solver = -1;
            if (p == BT_COLOURS) solver = is_under(domain, cell) ? domain->large_owner : -1;
            else if (bt_division_toucher(world, p, cell->x, cell->y, at))
                solver = bt_division_owner(world, at[0], at[1]);
            if (solver < 0) continue;
            for (int h = 0; h < n; h++) {
                if (sharer[h] == me && solver != me) {
                    bt_link *link = link_to(domain, solver);
                    append(&link->receive[p], &link->n_receive[p], world, cell);
                } else if (sharer[h] != me && solver == me) {
                    bt_link *link = link_to(domain, sharer[h]);
                    append(&link->send[p], &link->n_send[p], world, cell);
                }
            }
        }
    }
}

/// Mark the ranks that hold a cell next to (x, y). Such a rank owns a cell from (x − 2, y − 2) to (x + 1, y + 1), whose
/// bounds depend on the speed there, or has floes there that a large body may move; and its sweeps depend on the
/// convergence in (x, y).
static void near_ranks(const bt_world *world, int32_t x, int32_t y, uint8_t *near)
{
    const bt_cells *cells = world->cells;
    memset(near, 0, (size_t)world->domain->comm->size);
    for (int32_t dy = -1; dy <= 1; dy++)
        for (int32_t dx = -1; dx <= 1; dx++) {
            if ((cells->wrap_x == 1 && dx) || (cells->wrap_y == 1 && dy)) continue;
            int sharer[BT_MAX_SHARERS];
            const int n = bt_division_sharers(world, x + dx, y + dy, sharer);
            for (int h = 0; h < n; h++) near[sharer[h]] = 1;
        }
}

/// Lists of cells whose value is sent: only at the borders of the parts of the map.
static void list_sent(bt_world *world)
{
    bt_domain *domain = world->domain;
    const bt_cells *cells = world->cells;
    const int me = domain->comm->rank;
    uint8_t *near = bt_alloc((size_t)domain->comm->size, 1);
    for (int32_t y = domain->low_y; y < domain->low_y + domain->n_y; y++)
        for (int32_t x = domain->low_x; x < domain->low_x + domain->n_x; x++) {
            const int owner = bt_division_owner(world, x, y);
            near_ranks(world, x, y, near);
            if (owner != me && near[me]) {
                bt_link *link = link_to(domain, owner);
                link->tell_receive = bt_realloc(link->tell_receive, (size_t)link->n_tell_receive + 1,
                                                sizeof *link->tell_receive);
                link->tell_receive[link->n_tell_receive][0] = x;
                link->tell_receive[link->n_tell_receive++][1] = y;
            } else if (owner == me) {
                for (int r = 0; r < domain->comm->size; r++) {
                    if (r == me || !near[r]) continue;
                    bt_link *link = link_to(domain, r);
                    link->tell_send = bt_realloc(link->tell_send, (size_t)link->n_tell_send + 1,
                                                 sizeof *link->tell_send);
                    link->tell_send[link->n_tell_send++] = bt_cells_at(cells, x, y);
                }
            }
        }
    free(near);
}

static void mark_owned(bt_world *world)
{
    bt_domain *domain = world->domain;
    bt_cells *cells = world->cells;
    const bt_bodies *bodies = &world->bodies;
    if (bodies->n > domain->cap_owned) {
        domain->cap_owned = bodies->n;
        domain->owned = bt_realloc(domain->owned, (size_t)bodies->n, 1);
        domain->touched = bt_realloc(domain->touched, (size_t)bodies->n, 1);
    }
    double held[2] = {0, 0};
    for (bt_idx k = 0; k < cells->n; k++) {
        bt_cell *cell = &cells->cell[k];
        const bool own = k < cells->n - 1 ? cell->own : domain->comm->rank == 0;
        for (bt_idx i = cell->first; i < cell->end; i++) domain->owned[i] = own;
        if (k < cells->n - 1) held[own] += cell->end - cell->first;
        // Every rank that holds a body of the block waits for the changes by the cell.
        const bt_idx block[4] = {k, cell->right, cell->above, cell->diagonal};
        cell->border = k == cells->n - 1 && !domain->undivided;
        for (int j = 0; j < 4 && cell->own && k < cells->n - 1; j++) {
            if (block[j] < 0) continue;
            const bt_cell *other = &cells->cell[block[j]];
            int sharer[BT_MAX_SHARERS];
            if (bt_division_sharers(world, other->x, other->y, sharer) > 1) cell->border = true;
        }
    }
    bt_sum sums[2] = {{0}, {0}};
    for (int k = 0; k < 2; k++) bt_sum_add(&sums[k], held[k]);
    bt_comm_reduce(domain->comm, sums, 2, NULL, 0, NULL, 0);
    domain->stats.halo = bt_sum_value(&sums[1]) > 0 ? bt_sum_value(&sums[0]) / bt_sum_value(&sums[1]) : 0;
}

/// Make the links for the present cells.
static void make_links(bt_world *world)
{
    bt_domain *domain = world->domain;
    bt_halo_free(domain);
    list_bodies(world);
    list_sent(world);
    for (int k = 0; k < domain->n_links; k++) {
        bt_link *link = &domain->link[k];
        bt_idx most_out = 0, most_in = 0;
        for (int p = 0; p < BT_PHASES; p++) {
            link->send_now[p] = bt_alloc((size_t)link->n_send[p], sizeof(bt_idx));
            link->receive_now[p] = bt_alloc((size_t)link->n_receive[p], sizeof(bt_idx));
            link->n_flags_out += link->n_send[p];
            link->n_flags_in += link->n_receive[p];
            most_out = most_out > link->n_send[p] ? most_out : link->n_send[p];
            most_in = most_in > link->n_receive[p] ? most_in : link->n_receive[p];
        }
        link->out = bt_alloc(3 * (size_t)most_out, sizeof *link->out);
        link->in = bt_alloc(3 * (size_t)most_in, sizeof *link->in);
        link->flags_out = bt_alloc((size_t)link->n_flags_out, 1);
        link->flags_in = bt_alloc((size_t)link->n_flags_in, 1);
        link->tell_out = bt_alloc((size_t)link->n_tell_send, sizeof *link->tell_out);
        link->tell_in = bt_alloc((size_t)link->n_tell_receive, sizeof *link->tell_in);
    }
    domain->request = bt_alloc(2 * (size_t)domain->n_links, sizeof *domain->request);
}

void bt_domain_connect(bt_world *world)
{
    if (!world->domain) return;
    mark_owned(world);
    make_links(world);
    bt_domain_check(world);
}

/// Begin to receive numbers from the other end of a link, and to send it some, where there are any.
static void begin_exchange(bt_domain *domain, const bt_link *link, MPI_Datatype type, int tag, void *in, bt_idx n_in,
                           const void *out, bt_idx n_out)
{
    MPI_Request *request = domain->request;
    if (n_in) MPI_Irecv(in, n_in, type, link->rank, tag, domain->comm->mpi, &request[domain->n_requests++]);
    if (n_out) MPI_Isend(out, n_out, type, link->rank, tag, domain->comm->mpi, &request[domain->n_requests++]);
}

static void wait_all(bt_domain *domain)
{
    const double t0 = bt_clock();
    bt_comm_wait(domain->n_requests, domain->request);
    domain->exchange_s += bt_clock() - t0;
    domain->n_requests = 0;
}

void bt_domain_tell_cells(bt_world *world, const double *value, bt_take_cell *take)
{
    bt_domain *domain = world->domain;
    if (!domain) return;
    for (int k = 0; k < domain->n_links; k++) {
        bt_link *link = &domain->link[k];
        for (bt_idx i = 0; i < link->n_tell_send; i++) link->tell_out[i] = value[link->tell_send[i]];
        begin_exchange(domain, link, MPI_DOUBLE, TAG_CELLS, link->tell_in, link->n_tell_receive, link->tell_out,
                       link->n_tell_send);
    }
    wait_all(domain);
    for (int k = 0; k < domain->n_links; k++) {
        const bt_link *link = &domain->link[k];
        for (bt_idx i = 0; i < link->n_tell_receive; i++)
            if (link->tell_in[i] > 0)
                take(world->cells, link->tell_receive[i][0], link->tell_receive[i][1], link->tell_in[i]);
    }
}

void bt_domain_select(bt_world *world, bt_touch *touch)
{
    bt_domain *domain = world->domain;
    if (!domain) return;
    const bt_cells *cells = world->cells;
    // a rank that owns nothing has no array
    if (world->bodies.n > 0) memset(domain->touched, 0, (size_t)world->bodies.n);
    for (bt_idx i = 0; i < cells->n_order; i++) {
        const bt_cell *cell = &cells->cell[cells->order[i]];
        if (cell->border) touch(cell, (uint8_t)(1 << cell->phase), domain->touched);
    }
    for (int k = 0; k < domain->n_links; k++) {
        bt_link *link = &domain->link[k];
        bt_idx n = 0;
        for (int p = 0; p < BT_PHASES; p++) {
            link->n_send_now[p] = 0;
            for (bt_idx i = 0; i < link->n_send[p]; i++) {
                const bool now = domain->touched[link->send[p][i]] >> p & 1;
                link->flags_out[n++] = now;
                if (now) link->send_now[p][link->n_send_now[p]++] = link->send[p][i];
            }
        }
        begin_exchange(domain, link, MPI_BYTE, TAG_FLAGS, link->flags_in, link->n_flags_in, link->flags_out,
                       link->n_flags_out);
    }
    wait_all(domain);
    for (int k = 0; k < domain->n_links; k++) {
        bt_link *link = &domain->link[k];
        bt_idx n = 0;
        for (int p = 0; p < BT_PHASES; p++) {
            link->n_receive_now[p] = 0;
            for (bt_idx i = 0; i < link->n_receive[p]; i++)
                if (link->flags_in[n++]) link->receive_now[p][link->n_receive_now[p]++] = link->receive[p][i];
        }
    }
}

static void mark_received(bt_world *world, int first_phase, void (*mark)(bt_world *world, bt_idx body))
{
    const bt_domain *domain = world->domain;
    for (int k = 0; domain && k < domain->n_links; k++)
        for (int p = first_phase; p < BT_PHASES; p++)
            for (bt_idx i = 0; i < domain->link[k].n_receive_now[p]; i++)
                mark(world, domain->link[k].receive_now[p][i]);
}

void bt_domain_beside_large(bt_world *world, void (*mark)(bt_world *world, bt_idx body))
{
    mark_received(world, BT_COLOURS, mark);
}

void bt_domain_moved_elsewhere(bt_world *world, void (*mark)(bt_world *world, bt_idx body))
{
    mark_received(world, 0, mark);
}

void bt_domain_send(bt_world *world, int phase, bt_vel *v)
{
    bt_domain *domain = world->domain;
    for (int k = 0; k < domain->n_links; k++) {
        bt_link *link = &domain->link[k];
        const bt_idx n_in = link->n_receive_now[phase], n_out = link->n_send_now[phase];
        for (bt_idx i = 0; i < n_out; i++) {
            const bt_vel *x = &v[link->send_now[phase][i]];
            link->out[3 * i] = x->x, link->out[3 * i + 1] = x->y, link->out[3 * i + 2] = x->w;
        }
        begin_exchange(domain, link, MPI_DOUBLE, TAG_VELOCITIES + phase, link->in, 3 * n_in, link->out, 3 * n_out);
    }
}

void bt_domain_receive(bt_world *world, int phase, bt_vel *v)
{
    bt_domain *domain = world->domain;
    wait_all(domain);
    for (int k = 0; k < domain->n_links; k++) {
        const bt_link *link = &domain->link[k];
        for (bt_idx i = 0; i < link->n_receive_now[phase]; i++) {
            bt_vel *x = &v[link->receive_now[phase][i]];
            x->x = link->in[3 * i], x->y = link->in[3 * i + 1], x->w = link->in[3 * i + 2];
        }
    }
}
