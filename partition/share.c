// SPDX-License-Identifier: MIT
// Data that all ranks need from one: large bodies after the solve, islands across ranks, largest values; and the checks
// of a division.
#include <inttypes.h>
#include <string.h>

#include "base/inside.h"
#include "tow/tow.h"
#include "partition/division.h"
#include "partition/domain.h"

void bt_domain_settle(bt_world *world, bt_vel *shift)
{
    bt_domain *domain = world->domain;
    if (!domain) return;
    bt_bodies *bodies = &world->bodies;
    const bt_cells *cells = world->cells;
    const size_t most = 6 * (size_t)(bodies->n - cells->n_in_cells) + BT_MAX_BRANCHES;
    double *x = bt_alloc(most, sizeof *x);
    for (int pass = 0; pass < 2; pass++) {
        size_t n = 0;
        for (bt_idx i = cells->n_in_cells; i < bodies->n; i++) {
            if (bodies->motion[i] != BT_DYNAMIC) continue;
            double *from[6] = {&bodies->vel[i].x, &bodies->vel[i].y, &bodies->vel[i].w, NULL, NULL, NULL};
            if (shift) from[3] = &shift[i].x, from[4] = &shift[i].y, from[5] = &shift[i].w;
            for (int c = 0; c < (shift ? 6 : 3); c++, n++) {
                if (pass == 0) x[n] = *from[c];
                else *from[c] = x[n];
            }
        }
        if (n == 0) break; // no large body can be moved: nothing to share
        for (int k = 0; world->tow && k < BT_MAX_BRANCHES; k++, n++) {
            if (pass == 0) x[n] = world->tow->branch[k].lambda;
            else world->tow->branch[k].lambda = x[n];
        }
        if (pass == 0) MPI_Bcast(x, (int)n, MPI_DOUBLE, domain->large_owner, domain->comm->mpi);
    }
    free(x);
}

/// Collective. Gather records of `size` bytes from all ranks; the caller frees.
static void *gather(const bt_comm *comm, const void *mine, size_t n, size_t size, size_t *n_all)
{
    int *count = bt_alloc((size_t)comm->size, sizeof *count), *first = bt_alloc((size_t)comm->size + 1, sizeof *first);
    uint64_t total[1] = {n * size}; // in 64 bits first: a sum beyond 2 GB is an error, not a wrong length
    MPI_Allreduce(MPI_IN_PLACE, total, 1, MPI_UINT64_T, MPI_SUM, comm->mpi);
    if (total[0] > INT32_MAX) {
        fprintf(stderr,
                "bergtow: rank %d: %" PRIu64 " bytes of shared bodies are too many for one message; take fewer ranks\n",
                comm->rank, total[0]);
        bt_comm_abort(BT_ERR_NUMERIC);
    }
    const int bytes = (int)(n * size);
    MPI_Allgather(&bytes, 1, MPI_INT, count, 1, MPI_INT, comm->mpi);
    for (int r = 0; r < comm->size; r++) first[r + 1] = first[r] + count[r];
    char *all = bt_realloc(NULL, (size_t)first[comm->size] + 1, 1);
    MPI_Allgatherv(mine, bytes, MPI_BYTE, all, count, first, MPI_BYTE, comm->mpi);
    *n_all = (size_t)first[comm->size] / size;
    free(count);
    free(first);
    return all;
}

void *bt_domain_gather_all(const bt_world *world, const void *mine, size_t n, size_t size, size_t *n_all)
{
    if (world->domain) return gather(world->domain->comm, mine, n, size, n_all);
    char *copy = bt_realloc(NULL, n * size + 1, 1);
    if (n > 0) memcpy(copy, mine, n * size);
    *n_all = n;
    return copy;
}

/// Is body i held by another rank too?
static bool shared(const bt_world *world, bt_idx i)
{
    int sharer[BT_MAX_SHARERS];
    return world->bodies.large[i] ||
           bt_division_sharers(world, world->bodies.cell[i][0], world->bodies.cell[i][1], sharer) > 1;
}

typedef struct { bt_gid gid; double x; } value;

void bt_domain_largest(const bt_world *world, double *x)
{
    if (!world->domain) return;
    const bt_bodies *bodies = &world->bodies;
    value *mine = bt_alloc((size_t)bodies->n, sizeof *mine);
    size_t n = 0, n_all;
    for (bt_idx i = 0; i < bodies->n; i++)
        if (x[i] != 0 && shared(world, i)) mine[n++] = (value){bodies->gid[i], x[i]};
    value *all = gather(world->domain->comm, mine, n, sizeof *mine, &n_all);
    for (size_t k = 0; k < n_all; k++) {
        const bt_idx i = bt_world_index(world, all[k].gid);
        if (i >= 0) x[i] = bt_max(x[i], all[k].x);
    }
    free(mine);
    free(all);
}

// --- islands ---------------------------------------------------------------------------------------------------------

/// An island here and a body that may join it to an island elsewhere.
typedef struct { bt_gid body, name; } membership;

BT_ASCENDING_BY(by_body, membership, body, name)

static int by_gid(const void *p, const void *q)
{
    const bt_gid *a = p, *b = q;
    return (*a > *b) - (*a < *b);
}

static size_t find(const bt_gid *names, size_t n, bt_gid name)
{
    const bt_gid *p = bsearch(&name, names, n, sizeof *names, by_gid);
    return p ? (size_t)(p - names) : n;
}

static size_t root(size_t *up, size_t i)
{
    while (up[i] != i) i = up[i] = up[up[i]];
    return i;
}

void bt_domain_join_names(const bt_world *world, bt_gid *name)
{
    if (!world->domain) return;
    const bt_bodies *bodies = &world->bodies;
    membership *mine = bt_alloc((size_t)bodies->n, sizeof *mine);
    size_t n = 0, n_all;
    for (bt_idx i = 0; i < bodies->n; i++)
        if (bodies->motion[i] == BT_DYNAMIC && shared(world, i)) mine[n++] = (membership){bodies->gid[i], name[i]};
    membership *all = gather(world->domain->comm, mine, n, sizeof *mine, &n_all);
    free(mine);
    if (n_all) qsort(all, n_all, sizeof *all, by_body);
    bt_gid *names = bt_alloc(n_all, sizeof *names);
    for (size_t k = 0; k < n_all; k++) names[k] = all[k].name;
    if (n_all) qsort(names, n_all, sizeof *names, by_gid);
    size_t m = 0;
    for (size_t k = 0; k < n_all; k++)
        if (m == 0 || names[m - 1] != names[k]) names[m++] = names[k];
    size_t *up = bt_alloc(m, sizeof *up);
    for (size_t k = 0; k < m; k++) up[k] = k;
    for (size_t k = 1; k < n_all; k++) {
        if (all[k].body != all[k - 1].body) continue;
        const size_t p = root(up, find(names, m, all[k - 1].name)), q = root(up, find(names, m, all[k].name));
        up[p > q ? p : q] = p < q ? p : q; // the least name becomes the name of the island
    }
    for (bt_idx i = 0; i < bodies->n; i++) {
        const size_t k = find(names, m, name[i]);
        if (k < m) name[i] = names[root(up, k)];
    }
    BT_FREE(all, names, up);
}

typedef struct { bt_gid name; bt_sum sum; } named_sum;

static int by_name(const void *p, const void *q)
{
    const named_sum *a = p, *b = q;
    return (a->name > b->name) - (a->name < b->name);
}

void bt_domain_add_by_name(const bt_world *world, const bt_idx *up, const bt_gid *name, bt_sum *sum)
{
    if (!world->domain) return;
    const bt_bodies *bodies = &world->bodies;
    // Islands that may extend to other ranks: those with a shared body.
    uint8_t *reaches = bt_alloc((size_t)bodies->n, 1);
    for (bt_idx i = 0; i < bodies->n; i++) {
        if (bodies->motion[i] != BT_DYNAMIC || !shared(world, i)) continue;
        bt_idx r = i;
        while (up[r] != r) r = up[r];
        reaches[r] = 1;
    }
    // Two islands here may be joined through another rank: a name can occur twice in one rank's list.
    named_sum *mine = bt_alloc((size_t)bodies->n, sizeof *mine);
    size_t n = 0, n_all;
    for (bt_idx i = 0; i < bodies->n; i++)
        if (up[i] == i && reaches[i]) mine[n++] = (named_sum){name[i], sum[i]};
    named_sum *all = gather(world->domain->comm, mine, n, sizeof *mine, &n_all);
    free(mine);
    if (n_all) qsort(all, n_all, sizeof *all, by_name);
    size_t m = 0;
    for (size_t k = 0; k < n_all; k++) {
        if (m == 0 || all[m - 1].name != all[k].name) {
            all[m++] = all[k];
        } else {
            bt_sum_join(&all[m - 1].sum, &all[k].sum);
        }
    }
    for (bt_idx i = 0; i < bodies->n; i++) {
        if (up[i] != i || !reaches[i]) continue;
        const named_sum *s = bsearch(&(named_sum){.name = name[i]}, all, m, sizeof *all, by_name);
        if (s) sum[i] = s->sum;
    }
    free(reaches);
    free(all);
}

// --- checks ----------------------------------------------------------------------------------------------------------

/// Collective. End the run after rank 0 has reported why: a rank that exits at once would cut its message short.
static _Noreturn void end_all(const bt_comm *comm, bt_errors *err)
{
    bt_comm_errors(comm, err);
    bt_errors_print(err);
    fflush(stderr);
    bt_comm_rest(comm);
    bt_comm_abort(BT_ERR_NUMERIC);
}

/// Check that every body is owned once: by their number and the sum of their mixed gids; if that fails, by name.
void bt_domain_check(bt_world *world)
{
    const bt_domain *domain = world->domain;
    const bt_bodies *bodies = &world->bodies;
    bt_idx n = 0;
    uint64_t mixed = 0, wanted = 0;
    bt_gid *gid = bt_alloc((size_t)bodies->n, sizeof *gid);
    for (bt_idx i = 0; i < bodies->n; i++) {
        if (!domain->owned[i]) continue;
        gid[n++] = bodies->gid[i];
        mixed += ((uint64_t)bodies->gid[i] + 1) * UINT64_C(0x9e3779b97f4a7c15) >> 7;
    }
    bt_gid there = 0;
    for (bt_gid g = 0; g < bodies->n_global; g++) {
        there += !bodies->gone[g];
        wanted += bodies->gone[g] ? 0 : ((uint64_t)g + 1) * UINT64_C(0x9e3779b97f4a7c15) >> 7;
    }
    bt_sum sums[2] = {{.v = n}, {.v = (bt_int128)mixed}};
    bt_comm_reduce(domain->comm, sums, 2, NULL, 0, NULL, 0);
    if ((bt_gid)sums[0].v != there || (uint64_t)sums[1].v != wanted) {
        int64_t *first = bt_alloc((size_t)domain->comm->size + 1, sizeof *first);
        for (int r = 0; r <= domain->comm->size; r++) first[r] = bt_comm_first(domain->comm, r, bodies->n_global);
        double *rows = bt_alloc((size_t)n, sizeof *rows),
               *block = bt_alloc((size_t)(first[domain->comm->rank + 1] - first[domain->comm->rank]), sizeof *block);
        bt_errors err = {0};
        bt_comm_rows_by_gid(domain->comm, first, n, gid, 1, rows, block, &err);
        bt_errors_add(&err,
                      "step %" PRId64 ": after a migration %" PRId64 " of %" PRId64
                      " bodies are owned; this is an error of the program: report the case, and go on with another "
                      "number of ranks",
                      world->step, (int64_t)sums[0].v, there);
        end_all(domain->comm, &err);
    }
    free(gid);
#ifdef BT_VALIDATE
    bt_domain_validate(world);
#endif
}

typedef struct { bt_gid gid; int64_t sharers; uint64_t state; } copy;

BT_ASCENDING_BY(by_copy, copy, gid, state)

/// Least gid of a body here in the wrong cell or under the wrong name; INT64_MAX = none.
static bt_gid misplaced(const bt_world *world)
{
    const bt_bodies *bodies = &world->bodies;
    const bt_cells *cells = world->cells;
    bt_gid bad = INT64_MAX;
    for (bt_idx k = 0; k < cells->n; k++)
        for (bt_idx i = cells->cell[k].first; i < cells->cell[k].end; i++) {
            const bool here =
                k == cells->n - 1 ? bodies->large[i] : bodies->cell[i][0] == cells->cell[k].x &&
                bodies->cell[i][1] == cells->cell[k].y;
            if ((!here || bt_world_index(world, bodies->gid[i]) != i) && bodies->gid[i] < bad) bad = bodies->gid[i];
        }
    return bad;
}

/// Collective. Least gid of a body that differs between the ranks that must hold it, or is missing on one; −1 = none.
static bt_gid find_fault(const bt_world *world)
{
    const bt_domain *domain = world->domain;
    const bt_bodies *bodies = &world->bodies;
    bt_gid bad = misplaced(world);
    copy *mine = bt_alloc((size_t)bodies->n, sizeof *mine);
    size_t n = 0, n_all;
    for (bt_idx i = 0; i < bodies->n; i++) {
        int sharer[BT_MAX_SHARERS];
        const int sharers = bodies->large[i] ? domain->comm->size : bt_division_sharers(world, bodies->cell[i][0],
                                                                                        bodies->cell[i][1], sharer);
        if (sharers == 1) continue;
        const bt_vel *v = &bodies->vel[i];
        const bt_pose *pose = &bodies->pose[i];
        const double state[] = {
            pose->x,          pose->y, pose->yaw, v->x, v->y, v->w, bodies->inv[i].m, bodies->inv[i].i,
            bodies->disturbed[i], bodies->home ? bodies->home[i].copy : 0, bodies->lap[i], bodies->exposure[i].skin,
            bodies->exposure[i].water_form, bodies->exposure[i].air_form};
        uint64_t h = 0;
        for (size_t k = 0; k < sizeof state / sizeof *state; k++) {
            uint64_t u;
            const double x = state[k] + 0.0;
            memcpy(&u, &x, sizeof u);
            h = (h ^ u) * UINT64_C(0x9e3779b97f4a7c15);
            h ^= h >> 29;
        }
        if (bodies->gid[i] == world->towed && world->tow) h ^= bt_tow_hash(world->tow);
        mine[n++] = (copy){bodies->gid[i], sharers, h};
    }
    copy *all = gather(domain->comm, mine, n, sizeof *mine, &n_all);
    if (n_all) qsort(all, n_all, sizeof *all, by_copy);
    for (size_t k = 0, same = 0; k < n_all; k++) {
        same = k > 0 && all[k].gid == all[k - 1].gid ? same + 1 : 1;
        const bool last = k + 1 == n_all || all[k + 1].gid != all[k].gid;
        const bool sound = (same == 1 || (all[k].state == all[k - 1].state && all[k].sharers == all[k - 1].sharers)) &&
                           (!last || (int64_t)same == all[k].sharers);
        if (!sound && all[k].gid < bad) bad = all[k].gid;
    }
    free(mine);
    free(all);
    // As a maximum of doubles: exact below 2⁵³, enough for a gid.
    double least = -(double)bad;
    bt_comm_reduce(domain->comm, NULL, 0, &least, 1, NULL, 0);
    return least > -(double)INT64_MAX ? (bt_gid)-least : -1;
}

void bt_domain_validate(bt_world *world)
{
    if (!world->domain) return;
    const bt_gid bad = find_fault(world);
    if (bad < 0) return;
    bt_errors err = {0};
    bt_errors_add(&err,
                  "step %" PRId64 ": body %" PRId64
                  " is not the same on all ranks that need it; this is an error of the program: report the case, and "
                  "go on with another number of ranks",
                  world->step, bad);
    end_all(world->domain->comm, &err);
}
