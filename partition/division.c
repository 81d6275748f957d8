// SPDX-License-Identifier: MIT
// The map of the cells: which rank owns which, who holds the bodies of one, and how the map is cut anew.
#include "partition/division.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "partition/cut.h"

#define TOLERANCE 0.01 // asked of the cut
/// What a sweep costs two ranks and not one, s: exchanges of four phases, and a sum; the rest of a step is as much as
/// so many sweeps.
#define EXCHANGES 40e-6
#define REST 5
#define STAYS 1.25 // times what another division must be better by: each change moves the bodies
/// Bodies that one rank takes at most: some gigabytes.
enum { MOST_UNDIVIDED = 2000000 };

int64_t bt_division_place(const bt_world *w, int32_t x, int32_t y)
{
    const bt_cells *t = w->cells;
    const bt_domain *d = w->domain;
    if ((t->wrap_x == 1 && x != 0) || (t->wrap_y == 1 && y != 0)) return -1;
    if (t->wrap_x) x = ((x % t->wrap_x) + t->wrap_x) % t->wrap_x;
    if (t->wrap_y) y = ((y % t->wrap_y) + t->wrap_y) % t->wrap_y;
    x -= d->low_x, y -= d->low_y;
    return x < 0 || y < 0 || x >= d->n_x || y >= d->n_y ? -1 : (int64_t)y * d->n_x + x;
}

int bt_division_owner(const bt_world *w, int32_t x, int32_t y)
{
    const int64_t p = bt_division_place(w, x, y);
    return p < 0 ? -1 : w->domain->owner[p];
}

int bt_division_sharers(const bt_world *w, int32_t x, int32_t y, int rank[BT_MAX_SHARERS])
{
    int n = 0;
    for (int k = 0; k < BT_MAX_SHARERS; k++) {
        const int64_t here = k == 4 ? bt_division_place(w, x, y) : 0;
        const int r = k < 4                                 ? bt_division_owner(w, x - (k & 1), y - (k >> 1))
                      : here >= 0 && w->domain->under[here] ? w->domain->large_owner
                                                            : -1;
        bool known = r < 0;
        for (int i = 0; i < n && !known; i++) known = rank[i] == r;
        if (!known) rank[n++] = r;
    }
    return n;
}

bool bt_division_toucher(const bt_world *w, int phase, int32_t x, int32_t y, int32_t out[2])
{
    const bt_cells *t = w->cells;
    out[0] = ((x ^ phase) & 1) ? x - 1 : x;
    out[1] = ((y ^ phase >> 1) & 1) ? y - 1 : y;
    if (t->wrap_x > 1) out[0] = (out[0] + t->wrap_x) % t->wrap_x;
    if (t->wrap_y > 1) out[1] = (out[1] + t->wrap_y) % t->wrap_y;
    return bt_division_place(w, out[0], out[1]) >= 0;
}

static bool movable_large(const bt_world *w, bt_idx i)
{
    return w->bodies.large[i] && w->bodies.motion[i] == BT_DYNAMIC;
}

double bt_division_large_path(const bt_world *w)
{
    double most = -1;
    for (bt_idx i = 0; i < w->bodies.n; i++)
        if (movable_large(w, i)) most = bt_max(most, w->bodies.path[i]);
    return most;
}

/// Cells that large movable bodies may meet floes of, until they have moved by two floes.
static void mark_under(bt_world *w)
{
    const bt_cells *t = w->cells;
    bt_domain *d = w->domain;
    memset(d->under, 0, (size_t)d->n_x * (size_t)d->n_y);
    d->large_path = bt_division_large_path(w);
    d->drift = 0;
    for (bt_idx i = 0; i < w->bodies.n; i++) {
        if (!movable_large(w, i)) continue;
        const bt_cell_range r = bt_pairs_range(w, i, t->margin_max + 4 * w->par.size + t->reach + t->allowance);
        for (int32_t y = r.y0; y <= r.y1; y++)
            for (int32_t x = r.x0; x <= r.x1; x++) {
                const int64_t p = bt_division_place(w, x, y);
                if (p >= 0) d->under[p] = 1;
            }
    }
}

/// Owners of the new box from the map before: the rank of the place, or of the nearest place there was.
static int *carry_over(const bt_world *w, const bt_domain *before)
{
    const bt_cells *t = w->cells;
    int *owner = bt_alloc((size_t)t->n_x * (size_t)t->n_y, sizeof *owner);
    for (int32_t y = 0; y < t->n_y; y++)
        for (int32_t x = 0; x < t->n_x; x++) {
            const double px = (t->low_x + x + 0.5) * t->side_x / before->side_x,
                         py = (t->low_y + y + 0.5) * t->side_y / before->side_y;
            const int32_t bx = (int32_t)bt_max(0, bt_min(before->n_x - 1, floor(px) - before->low_x));
            const int32_t by = (int32_t)bt_max(0, bt_min(before->n_y - 1, floor(py) - before->low_y));
            owner[(int64_t)y * t->n_x + x] = before->owner ? before->owner[(int64_t)by * before->n_x + bx] : -1;
        }
    return owner;
}

/// Work counted since the last check, on the places of the new box: a cut that is due now is made from it.
static double *carry_work(const bt_world *w, const bt_domain *before)
{
    const bt_cells *t = w->cells;
    double *work = bt_alloc((size_t)t->n_x * (size_t)t->n_y, sizeof *work);
    for (int64_t p = 0; before->work && p < (int64_t)before->n_x * before->n_y; p++) {
        const double px = (before->low_x + p % before->n_x + 0.5) * before->side_x / t->side_x,
                     py = (before->low_y + p / before->n_x + 0.5) * before->side_y / t->side_y;
        const int32_t x = (int32_t)bt_max(0, bt_min(t->n_x - 1, floor(px) - t->low_x)),
                      y = (int32_t)bt_max(0, bt_min(t->n_y - 1, floor(py) - t->low_y));
        work[(int64_t)y * t->n_x + x] += before->work[p];
    }
    return work;
}

/// Work of every cell of the box, over the ranks: what was counted, or the number of bodies.
static int64_t *gather_work(bt_world *w)
{
    const bt_domain *d = w->domain;
    const bt_bodies *b = &w->bodies;
    const size_t n = (size_t)d->n_x * (size_t)d->n_y;
    int64_t *work = bt_alloc(n, sizeof *work);
    for (bt_idx i = 0; i < b->n; i++) {
        if (b->large[i] || (d->distributed && !d->owned[i])) continue;
        const int64_t p = bt_division_place(w, b->cell[i][0], b->cell[i][1]);
        if (p >= 0) work[p] += d->distributed ? (int64_t)(BT_WORK_AT_REST * 1e9) : 1;
    }
    if (!d->distributed) return work; // every rank has counted them all
    for (size_t p = 0; p < n; p++) work[p] += (int64_t)(1e9 * d->work[p] / (double)(d->steps > 0 ? d->steps : 1));
    MPI_Allreduce(MPI_IN_PLACE, work, (int)n, MPI_INT64_T, MPI_SUM, d->comm->mpi);
    return work;
}

bool bt_division_is_for_one(const bt_world *w, double work)
{
    const bt_domain *d = w->domain;
    if (d->comm->divides || w->bodies.n_global > MOST_UNDIVIDED) return false;
    if (d->steps == 0) return !d->distributed; // nothing is known of it before the first step
    const double saved = work * (1 - 1.0 / d->comm->size);
    const double lost = EXCHANGES * (REST + (double)d->sweeps / (double)d->steps);
    return saved * (d->undivided ? 1 / STAYS : STAYS) < lost;
}

/// The graph of the cells: edges to the eight neighbours, weighted with what a cut there makes the ranks hold twice.
static void cut_map(bt_world *w)
{
    const bt_cells *t = w->cells;
    bt_domain *d = w->domain;
    const int n = d->n_x * d->n_y;
    int64_t *work = gather_work(w), all_work = 0;
    double fresh = 0;
    for (int p = 0; p < n; p++) all_work += work[p];
    d->undivided = bt_division_is_for_one(w, 1e-9 * (double)all_work);
    if (d->undivided) {
        memset(d->owner, 0, (size_t)n * sizeof *d->owner);
        d->stats.cut = 0;
    } else if (d->comm->rank == 0) {
        int *start = bt_alloc((size_t)n + 1, sizeof *start), *to = bt_alloc(8 * (size_t)n, sizeof *to),
            *group = bt_alloc((size_t)n, sizeof *group);
        int64_t *edge = bt_alloc(8 * (size_t)n, sizeof *edge);
        double (*at)[2] = bt_alloc((size_t)n, sizeof *at);
        int64_t cut = 0, all = 0;
        for (int p = 0; p < n; p++) {
            const int32_t x = d->low_x + p % d->n_x, y = d->low_y + p / d->n_x;
            int m = start[p];
            for (int k = 0; k < 9; k++) {
                if (k == 4) continue;
                const int64_t q = bt_division_place(w, x + k % 3 - 1, y + k / 3 - 1);
                bool known = q < 0 || q == p;
                for (int i = start[p]; i < m && !known; i++) known = to[i] == q;
                if (known) continue;
                to[m] = (int)q;
                edge[m++] = k % 2 ? 4 : 1;
            }
            start[p + 1] = m;
            group[p] = d->under[p] ? 0 : -1;
            at[p][0] = x * t->side_x, at[p][1] = y * t->side_y;
        }
        const bt_graph g = {.n = n,
                            .start = start,
                            .to = to,
                            .edge = edge,
                            .weight = work,
                            .at = (const double(*)[2])at,
                            .group = group};
        bt_cut_quality q;
        bt_cut(&g, d->comm->size, TOLERANCE, d->owner, &q);
        fresh = q.imbalance;
        for (int p = 0; p < n; p++)
            for (int i = start[p]; i < start[p + 1]; i++) {
                all += edge[i];
                cut += d->owner[p] != d->owner[to[i]] ? edge[i] : 0;
            }
        d->stats.cut = all ? (double)cut / (double)all : 0;
        void *arrays[] = {start, to, group, edge, at};
        for (size_t i = 0; i < sizeof arrays / sizeof *arrays; i++) free(arrays[i]);
    }
    free(work);
    MPI_Bcast(d->owner, n, MPI_INT, 0, d->comm->mpi);
    MPI_Bcast(&d->stats.cut, 1, MPI_DOUBLE, 0, d->comm->mpi);
    MPI_Bcast(&fresh, 1, MPI_DOUBLE, 0, d->comm->mpi);
    if (d->distributed && !d->undivided) { // the first division knew no work yet
        d->stats.repartition_imbalance += fresh;
        d->stats.worst_repartition_imbalance = bt_max(d->stats.worst_repartition_imbalance, fresh);
    }
    d->stats.divisions++;
}

void bt_division_map(bt_world *w, bool cut)
{
    const bt_cells *t = w->cells;
    bt_domain *d = w->domain;
    int *owner = carry_over(w, d);
    double *work = carry_work(w, d);
    free(d->owner);
    free(d->work);
    d->owner = owner;
    d->work = work;
    d->low_x = t->low_x, d->low_y = t->low_y, d->n_x = t->n_x, d->n_y = t->n_y;
    d->side_x = t->side_x, d->side_y = t->side_y;
    d->under = bt_realloc(d->under, (size_t)t->n_x * (size_t)t->n_y, sizeof *d->under);
    mark_under(w);
    if (cut || !d->distributed) {
        cut_map(w);
        memset(d->work, 0, (size_t)d->n_x * (size_t)d->n_y * sizeof *d->work);
        // only now: where floes drift through the cells, labels are renewed more often than the balance is looked at
        d->steps = d->sweeps = 0;
    }
    d->due = false;
    for (int64_t p = 0; p < (int64_t)d->n_x * d->n_y; p++)
        if (d->under[p]) {
            d->large_owner = d->owner[p];
            break;
        }
}
