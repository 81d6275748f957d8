// SPDX-License-Identifier: MIT
// The map of the cells: owners, holders of the bodies of a cell, and renewal of the map.
#include "partition/division.h"

#include "base/inside.h"
#include <string.h>

#define TOLERANCE 0.01 // imbalance accepted from the cut
/// Extra cost of a sweep with two ranks, s: exchanges of four phases, and a sum; the rest of a step costs as much as
/// REST sweeps.
#define EXCHANGES 20e-6
#define REST 5
/// Largest number of bodies for a single rank: some gigabytes.
enum { MAX_UNDIVIDED = 2000000 };

int64_t bt_division_place(const bt_world *world, int32_t x, int32_t y)
{
    const bt_cells *cells = world->cells;
    const bt_domain *domain = world->domain;
    if ((cells->wrap_x == 1 && x != 0) || (cells->wrap_y == 1 && y != 0)) return -1;
    if (cells->wrap_x) x = bt_cells_wrapped(x, cells->wrap_x);
    if (cells->wrap_y) y = bt_cells_wrapped(y, cells->wrap_y);
    x -= domain->low_x, y -= domain->low_y;
    return x < 0 || y < 0 || x >= domain->n_x || y >= domain->n_y ? -1 : (int64_t)y * domain->n_x + x;
}

int bt_division_owner(const bt_world *world, int32_t x, int32_t y)
{
    const int64_t p = bt_division_place(world, x, y);
    return p < 0 ? -1 : world->domain->owner[p];
}

int bt_division_sharers(const bt_world *world, int32_t x, int32_t y, int rank[BT_MAX_SHARERS])
{
    int n = 0;
    for (int k = 0; k < BT_MAX_SHARERS; k++) {
        const int64_t here = k == 4 ? bt_division_place(world, x, y) : 0;
        const int r = k < 4                                 ? bt_division_owner(world, x - (k & 1), y - (k >> 1))
                      : here >= 0 && world->domain->under[here] ? world->domain->large_owner
                                                                : -1;
        bool known = r < 0;
        for (int i = 0; i < n && !known; i++) known = rank[i] == r;
        if (!known) rank[n++] = r;
    }
    return n;
}

bool bt_division_toucher(const bt_world *world, int phase, int32_t x, int32_t y, int32_t out[2])
{
    const bt_cells *cells = world->cells;
    out[0] = ((x ^ phase) & 1) ? x - 1 : x;
    out[1] = ((y ^ phase >> 1) & 1) ? y - 1 : y;
    if (cells->wrap_x > 1) out[0] = (out[0] + cells->wrap_x) % cells->wrap_x;
    if (cells->wrap_y > 1) out[1] = (out[1] + cells->wrap_y) % cells->wrap_y;
    return bt_division_place(world, out[0], out[1]) >= 0;
}

static bool movable_large(const bt_world *world, bt_idx i)
{
    return world->bodies.large[i] && world->bodies.motion[i] == BT_DYNAMIC;
}

/// Mark the cells whose floes large movable bodies may meet before they have moved by two floes.
static void mark_under(bt_world *world)
{
    const bt_cells *cells = world->cells;
    bt_domain *domain = world->domain;
    memset(domain->under, 0, (size_t)domain->n_x * (size_t)domain->n_y);
    domain->drift = 0;
    domain->movable = false;
    for (bt_idx i = 0; i < world->bodies.n; i++) {
        if (!movable_large(world, i)) continue;
        domain->movable = true;
        const bt_cell_range range =
            bt_pairs_range(world, i, cells->margin_max + 4 * world->par.size + cells->max_radius + cells->allowance);
        for (int32_t y = range.y0; y <= range.y1; y++)
            for (int32_t x = range.x0; x <= range.x1; x++) {
                const int64_t p = bt_division_place(world, x, y);
                if (p >= 0) domain->under[p] = 1;
            }
    }
}

/// Owners in the new box from the previous map: the rank of the place, or of the nearest place in that map.
static int *carry_over(const bt_world *world, const bt_domain *before)
{
    const bt_cells *cells = world->cells;
    int *owner = bt_alloc((size_t)cells->n_x * (size_t)cells->n_y, sizeof *owner);
    for (int32_t y = 0; y < cells->n_y; y++)
        for (int32_t x = 0; x < cells->n_x; x++) {
            const double px = (cells->low_x + x + 0.5) * cells->side_x / before->side_x,
                         py = (cells->low_y + y + 0.5) * cells->side_y / before->side_y;
            const int32_t bx = (int32_t)bt_max(0, bt_min(before->n_x - 1, floor(px) - before->low_x));
            const int32_t by = (int32_t)bt_max(0, bt_min(before->n_y - 1, floor(py) - before->low_y));
            owner[(int64_t)y * cells->n_x + x] = before->owner ? before->owner[(int64_t)by * before->n_x + bx] : -1;
        }
    return owner;
}

/// Work counted since the last check, on the places of the new box, for a cut that is due now.
static double (*carry_work(const bt_world *world, const bt_domain *before))[BT_CUT_KINDS]
{
    const bt_cells *cells = world->cells;
    double (*work)[BT_CUT_KINDS] = bt_alloc((size_t)cells->n_x * (size_t)cells->n_y, sizeof *work);
    for (int64_t p = 0; before->work && p < (int64_t)before->n_x * before->n_y; p++) {
        const double px = (before->low_x + p % before->n_x + 0.5) * before->side_x / cells->side_x,
                     py = (before->low_y + p / before->n_x + 0.5) * before->side_y / cells->side_y;
        const int32_t x = (int32_t)bt_max(0, bt_min(cells->n_x - 1, floor(px) - cells->low_x)),
                      y = (int32_t)bt_max(0, bt_min(cells->n_y - 1, floor(py) - cells->low_y));
        for (int k = 0; k < BT_CUT_KINDS; k++) work[(int64_t)y * cells->n_x + x][k] += before->work[p][k];
    }
    return work;
}

/// Work of every cell of the box, over the ranks, ns a step: as counted, or from the number of bodies.
static bt_cut_work *gather_work(bt_world *world)
{
    const bt_domain *domain = world->domain;
    const bt_bodies *bodies = &world->bodies;
    const size_t n = (size_t)domain->n_x * (size_t)domain->n_y;
    bt_cut_work *work = bt_alloc(n, sizeof *work);
    for (bt_idx i = 0; i < bodies->n; i++) {
        if (bodies->large[i] || (domain->distributed && !domain->owned[i])) continue;
        const int64_t p = bt_division_place(world, bodies->cell[i][0], bodies->cell[i][1]);
        if (p >= 0) work[p].of[BT_WORK_REST] += domain->distributed ? (int64_t)(BT_WORK_AT_REST * 1e9) : 1;
    }
    if (!domain->distributed) return work; // every rank has counted all bodies
    for (size_t p = 0; p < n; p++)
        for (int k = 0; k < BT_CUT_KINDS; k++)
            work[p].of[k] += (int64_t)(1e9 * domain->work[p][k] / (double)(domain->steps > 0 ? domain->steps : 1));
    MPI_Allreduce(MPI_IN_PLACE, work, (int)n * BT_CUT_KINDS, MPI_INT64_T, MPI_SUM, domain->comm->mpi);
    return work;
}

bool bt_division_is_forced(const bt_world *world)
{
    return world->domain->comm->divides || world->bodies.n_global > MAX_UNDIVIDED;
}

double bt_division_gain(const bt_world *world, double work)
{
    const bt_domain *domain = world->domain;
    const double sweeps = (double)domain->sweeps / (double)domain->steps;
    return work * (1 - 1.0 / domain->comm->size) - EXCHANGES * (REST + sweeps);
}

/// Cut the graph of the cells: edges to the eight neighbours, weighted with the bodies held twice if cut there.
static void cut_map(bt_world *world)
{
    const bt_cells *cells = world->cells;
    bt_domain *domain = world->domain;
    const int n = domain->n_x * domain->n_y;
    bt_cut_work *work = gather_work(world);
    domain->imbalance_at_cut = domain->time_lost = domain->spared = 0;
    domain->cut_without_work = false;
    domain->undivided = domain->distributed ? domain->for_one : !bt_division_is_forced(world);
    if (domain->undivided) {
        memset(domain->owner, 0, (size_t)n * sizeof *domain->owner);
        domain->stats.cut = 0;
    } else if (domain->comm->rank == 0) {
        int *start = bt_alloc((size_t)n + 1, sizeof *start), *to = bt_alloc(8 * (size_t)n, sizeof *to),
            *group = bt_alloc((size_t)n, sizeof *group);
        int64_t *edge = bt_alloc(8 * (size_t)n, sizeof *edge);
        double (*at)[2] = bt_alloc((size_t)n, sizeof *at);
        int64_t cut = 0, all = 0;
        for (int p = 0; p < n; p++) {
            const int32_t x = domain->low_x + p % domain->n_x, y = domain->low_y + p / domain->n_x;
            int m = start[p];
            for (int k = 0; k < 9; k++) {
                if (k == 4) continue;
                const int64_t q = bt_division_place(world, x + k % 3 - 1, y + k / 3 - 1);
                bool known = q < 0 || q == p;
                for (int i = start[p]; i < m && !known; i++) known = to[i] == q;
                if (known) continue;
                to[m] = (int)q;
                edge[m++] = k % 2 ? 4 : 1;
            }
            start[p + 1] = m;
            group[p] = domain->under[p] ? 0 : -1;
            at[p][0] = x * cells->side_x, at[p][1] = y * cells->side_y;
        }
        const bt_graph graph = {.n = n,
                                .start = start,
                                .to = to,
                                .edge = edge,
                                .weight = work,
                                .at = (const double(*)[2])at,
                                .group = group};
        bt_cut_quality quality;
        bt_cut(&graph, domain->comm->size, TOLERANCE, domain->owner, &quality);
        domain->imbalance_at_cut = quality.imbalance;
        for (int p = 0; p < n; p++)
            for (int i = start[p]; i < start[p + 1]; i++) {
                all += edge[i];
                cut += domain->owner[p] != domain->owner[to[i]] ? edge[i] : 0;
            }
        domain->stats.cut = all ? (double)cut / (double)all : 0;
        BT_FREE(start, to, group, edge, at);
    }
    free(work);
    MPI_Bcast(domain->owner, n, MPI_INT, 0, domain->comm->mpi);
    MPI_Bcast(&domain->stats.cut, 1, MPI_DOUBLE, 0, domain->comm->mpi);
    MPI_Bcast(&domain->imbalance_at_cut, 1, MPI_DOUBLE, 0, domain->comm->mpi);
    if (!domain->distributed && !domain->undivided) {
        domain->cut_without_work = true;
    } else if (!domain->undivided) {
        domain->stats.repartition_imbalance += domain->imbalance_at_cut;
        domain->stats.worst_repartition_imbalance =
            bt_max(domain->stats.worst_repartition_imbalance, domain->imbalance_at_cut);
        domain->stats.divisions++;
    }
}

void bt_division_map(bt_world *world, bool cut)
{
    const bt_cells *cells = world->cells;
    bt_domain *domain = world->domain;
    int *owner = carry_over(world, domain);
    double (*work)[BT_CUT_KINDS] = carry_work(world, domain);
    free(domain->owner);
    free(domain->work);
    domain->owner = owner;
    domain->work = work;
    domain->low_x = cells->low_x, domain->low_y = cells->low_y, domain->n_x = cells->n_x, domain->n_y = cells->n_y;
    domain->side_x = cells->side_x, domain->side_y = cells->side_y;
    domain->under = bt_realloc(domain->under, (size_t)cells->n_x * (size_t)cells->n_y, sizeof *domain->under);
    mark_under(world);
    if (cut || !domain->distributed) {
        cut_map(world);
        memset(domain->work, 0, (size_t)domain->n_x * (size_t)domain->n_y * sizeof *domain->work);
        // only now: if floes drift through the cells, labels are renewed more often than the balance is checked
        domain->steps = domain->sweeps = 0;
    }
    domain->due = false;
    int64_t at = 0; // with no cell under a large body, the last
    while (at < (int64_t)domain->n_x * domain->n_y - 1 && !domain->under[at]) at++;
    domain->large_place = at;
    domain->large_owner = domain->owner[at];
}
