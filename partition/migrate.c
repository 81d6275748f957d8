// SPDX-License-Identifier: MIT
// Migration of bodies and contact memory to the ranks that own or hold them.
//
// Every owned body is sent, complete, to all ranks that hold its cell under the new map; ghosts are dropped first and
// come back the same way. So after a migration every copy of a body is that of its owner.
#include <string.h>

#include "body/bodies.h"
#include "partition/division.h"
#include "partition/domain.h"
#include "base/inside.h"

/// Bytes to send to every rank.
typedef struct {
    char **data;  ///< [size]
    size_t *n, *cap;
    int size;
} parcels;

static parcels new_parcels(int size)
{
    return (parcels){bt_alloc((size_t)size, sizeof(char *)), bt_alloc((size_t)size, sizeof(size_t)),
                     bt_alloc((size_t)size, sizeof(size_t)), size};
}

static void add(parcels *outgoing, int rank, const void *data, size_t n)
{
    if (outgoing->n[rank] + n > outgoing->cap[rank]) {
        outgoing->cap[rank] = 2 * (outgoing->n[rank] + n);
        outgoing->data[rank] = bt_realloc(outgoing->data[rank], outgoing->cap[rank], 1);
    }
    memcpy(outgoing->data[rank] + outgoing->n[rank], data, n);
    outgoing->n[rank] += n;
}

static void free_parcels(parcels *outgoing)
{
    for (int r = 0; r < outgoing->size; r++) free(outgoing->data[r]);
    BT_FREE(outgoing->data, outgoing->n, outgoing->cap);
}

enum { PIECE = 1 << 30 };

/// Collective. Exchange and release parcels; returns the bytes for this rank from all others, for the caller to free.
static char *deliver(const bt_comm *comm, parcels *outgoing, int tag, size_t *n_in)
{
    uint64_t *out = bt_alloc((size_t)comm->size, sizeof *out), *in = bt_alloc((size_t)comm->size, sizeof *in);
    for (int r = 0; r < comm->size; r++) out[r] = outgoing->n[r];
    MPI_Alltoall(out, 1, MPI_UINT64_T, in, 1, MPI_UINT64_T, comm->mpi);
    size_t n_requests = 0;
    *n_in = 0;
    for (int r = 0; r < comm->size; r++) {
        *n_in += in[r];
        n_requests += out[r] / PIECE + in[r] / PIECE + 2;
    }
    char *all = bt_realloc(NULL, *n_in ? *n_in : 1, 1);
    MPI_Request *request = bt_alloc(n_requests, sizeof *request);
    int n = 0;
    size_t at = 0;
    for (int r = 0; r < comm->size; r++)
        for (uint64_t done = 0; done < in[r]; done += PIECE) {
            const int piece = (int)(in[r] - done < PIECE ? in[r] - done : PIECE);
            MPI_Irecv(all + at, piece, MPI_BYTE, r, tag, comm->mpi, &request[n++]);
            at += (size_t)piece;
        }
    for (int r = 0; r < comm->size; r++)
        for (uint64_t done = 0; done < out[r]; done += PIECE)
            MPI_Isend(outgoing->data[r] + done, (int)(out[r] - done < PIECE ? out[r] - done : PIECE), MPI_BYTE, r, tag,
                      comm->mpi, &request[n++]);
    bt_comm_wait(n, request);
    BT_FREE(request, out, in);
    free_parcels(outgoing);
    return all;
}

// --- bodies ----------------------------------------------------------------------------------------------------------

static char *field_of(const bt_bodies *bodies, int k, bt_idx i)
{
    return *(char **)((char *)bodies + bt_body_fields[k].array) + (size_t)i * bt_body_fields[k].size;
}

static char *vertices_of(const bt_bodies *bodies, int k, int64_t first)
{
    return *(char **)((char *)bodies + bt_vertex_fields[k].array) + (size_t)first * bt_vertex_fields[k].size;
}

static void pack(const bt_bodies *bodies, bt_idx i, parcels *outgoing, int rank)
{
    for (int k = 0; k < bt_bodies_n_fields(bodies); k++)
        add(outgoing, rank, field_of(bodies, k, i), bt_body_fields[k].size);
    const int64_t first = bodies->offset[i], n = bodies->offset[i + 1] - first;
    add(outgoing, rank, &n, sizeof n);
    for (int k = 0; k < bt_n_vertex_fields; k++)
        add(outgoing, rank, vertices_of(bodies, k, first), (size_t)n * bt_vertex_fields[k].size);
}

/// Append the bodies of a received parcel.
static void unpack(bt_bodies *bodies, const char *data, size_t n_bytes)
{
    size_t at = 0;
    while (at < n_bytes) {
        int64_t n;
        size_t record = 0;
        for (int k = 0; k < bt_bodies_n_fields(bodies); k++) record += bt_body_fields[k].size;
        memcpy(&n, data + at + record, sizeof n);
        const int64_t first = bodies->offset[bodies->n];
        bt_bodies_reserve(bodies, bodies->n + 1, first + n);
        const bt_idx i = bodies->n++;
        for (int k = 0; k < bt_bodies_n_fields(bodies); k++) {
            memcpy(field_of(bodies, k, i), data + at, bt_body_fields[k].size);
            at += bt_body_fields[k].size;
        }
        at += sizeof n;
        bodies->offset[i + 1] = first + n;
        for (int k = 0; k < bt_n_vertex_fields; k++) {
            const size_t bytes = (size_t)n * bt_vertex_fields[k].size;
            memcpy(vertices_of(bodies, k, first), data + at, bytes);
            at += bytes;
        }
    }
}

/// Give back the memory of bodies that have left.
static void shrink(bt_bodies *bodies)
{
    const bt_idx cap = bodies->n + bodies->n / 8 + 16;
    if (bodies->cap <= cap + cap / 4) return;
    for (int k = 0; k < bt_bodies_n_fields(bodies); k++) {
        void **array = (void **)((char *)bodies + bt_body_fields[k].array),
             *small = bt_alloc_aligned((size_t)cap, bt_body_fields[k].size);
        memcpy(small, *array, (size_t)bodies->n * bt_body_fields[k].size);
        free(*array);
        *array = small;
    }
    bodies->offset = bt_realloc(bodies->offset, (size_t)cap + 1, sizeof *bodies->offset);
    bodies->cap = cap;
    const int64_t vertices = bodies->offset[bodies->n] + bodies->offset[bodies->n] / 8 + 64;
    for (int k = 0; k < bt_n_vertex_fields; k++) {
        void **array = (void **)((char *)bodies + bt_vertex_fields[k].array);
        *array = bt_realloc(*array, (size_t)vertices, bt_vertex_fields[k].size);
    }
    bodies->cap_vertices = vertices;
}

static void move_bodies(bt_world *world)
{
    bt_bodies *bodies = &world->bodies;
    bt_domain *domain = world->domain;
    const int me = domain->comm->rank;
    parcels outgoing = new_parcels(domain->comm->size);
    uint8_t *keep = bt_alloc((size_t)bodies->n, 1);
    const int32_t *of = NULL; // cell of the ranks below
    int rank[BT_MAX_SHARERS], n = 0;
    for (bt_idx i = 0; i < bodies->n; i++) {
        const int32_t *cell = bodies->cell[i];
        if (bodies->large[i]) {
            keep[i] = 1; // on every rank
            continue;
        }
        if (domain->distributed && !domain->owned[i]) continue;
        if (!of || of[0] != cell[0] || of[1] != cell[1]) n = bt_division_sharers(world, cell[0], cell[1], rank);
        of = cell;
        for (int k = 0; k < n; k++) {
            if (rank[k] == me) keep[i] = 1;
            else if (domain->distributed) pack(bodies, i, &outgoing, rank[k]); // at first every rank has all
        }
        domain->stats.moved += domain->distributed && rank[0] != me; // the first is the owner
    }
    for (bt_gid g = 0; g < bodies->n_global; g++) bodies->index_of[g] = -1;
    bt_bodies_compact(bodies, keep);
    free(keep);
    size_t n_in;
    char *in = deliver(domain->comm, &outgoing, 1, &n_in);
    unpack(bodies, in, n_in);
    free(in);
    shrink(bodies);
}

// --- temporary copies ------------------------------------------------------------------------------------------------

/// Is floe i within `reach` of a large floe that moves?
static bool near_large(const bt_world *world, bt_idx i, double reach)
{
    const bt_bodies *bodies = &world->bodies;
    for (bt_idx j = world->cells->n_in_cells; j < bodies->n; j++) {
        if (bodies->motion[j] != BT_DYNAMIC || !(bodies->thickness[j] > 0)) continue;
        double d[2];
        bt_bodies_offset(world, i, j, d);
        const double far = bodies->radius[i] + bodies->radius[j] + reach;
        if (d[0] * d[0] + d[1] * d[1] < far * far) return true;
    }
    return false;
}

/// Does a rank hold the bodies of cell (x, y)?
static bool holds(const bt_world *world, int rank, int32_t x, int32_t y)
{
    int sharer[BT_MAX_SHARERS];
    const int n = bt_division_sharers(world, x, y, sharer);
    bool held = false;
    for (int h = 0; h < n; h++) held = held || sharer[h] == rank;
    return held;
}

/// A cell whose floes a rank asks for.
typedef struct wish {
    int32_t cell[2];
    int rank;
} wish;

/// Ask the owners for the cells around those that this rank needs, if it does not hold them.
static void ask_around(const bt_world *world, const bool *needs, const int rings[2], parcels *outgoing)
{
    const bt_domain *domain = world->domain;
    const bt_cells *cells = world->cells;
    uint8_t *asked = bt_alloc((size_t)domain->n_x * (size_t)domain->n_y, 1);
    for (bt_idx k = 0; k < cells->n - 1; k++) {
        const bt_cell *cell = &cells->cell[k];
        for (int32_t y = cell->y - rings[1]; needs[k] && y <= cell->y + rings[1]; y++)
            for (int32_t x = cell->x - rings[0]; x <= cell->x + rings[0]; x++) {
                const int64_t p = bt_division_place(world, x, y);
                if (p < 0 || asked[p]) continue;
                asked[p] = 1;
                const wish w = {.cell = {domain->low_x + (int32_t)(p % domain->n_x),
                                         domain->low_y + (int32_t)(p / domain->n_x)},
                                .rank = domain->comm->rank};
                if (!holds(world, w.rank, x, y)) add(outgoing, domain->owner[p], &w, sizeof w);
            }
    }
    free(asked);
}

/// Pack the owned floes near large floes for rank 0, which owns these, unless it holds or has got their cell.
static void pack_near_large(const bt_world *world, const bool *got, double reach, parcels *outgoing)
{
    const bt_cells *cells = world->cells;
    for (bt_idx k = 0; k < cells->n - 1; k++) {
        const bt_cell *cell = &cells->cell[k];
        if (!cell->own || cell->first == cell->end || got[k]) continue;
        if (holds(world, 0, cell->x, cell->y)) continue;
        for (bt_idx i = cell->first; i < cell->end; i++)
            if (near_large(world, i, reach)) pack(&world->bodies, i, outgoing, 0);
    }
}

void bt_domain_around(const bt_world *world, const bool *needs, const int rings[2], double reach, bt_bodies *copies)
{
    *copies = (bt_bodies){.offset = bt_alloc(1, sizeof *copies->offset)};
    if (!world->domain) return;
    const bt_domain *domain = world->domain;
    const bt_cells *cells = world->cells;
    if (world->bodies.home) bt_bodies_make_homes(copies);
    parcels wishes = new_parcels(domain->comm->size), outgoing = new_parcels(domain->comm->size);
    ask_around(world, needs, rings, &wishes);
    size_t n_in;
    wish *asked = (wish *)deliver(domain->comm, &wishes, 3, &n_in);
    bool *got = bt_alloc((size_t)cells->n, sizeof *got); // by rank 0
    for (size_t j = 0; j < n_in / sizeof *asked; j++) {
        const bt_idx k = bt_cells_at(cells, asked[j].cell[0], asked[j].cell[1]);
        got[k] = got[k] || asked[j].rank == 0;
        for (bt_idx i = cells->cell[k].first; i < cells->cell[k].end; i++)
            pack(&world->bodies, i, &outgoing, asked[j].rank);
    }
    free(asked);
    pack_near_large(world, got, reach, &outgoing);
    free(got);
    char *in = deliver(domain->comm, &outgoing, 3, &n_in);
    unpack(copies, in, n_in);
    free(in);
}

void bt_domain_share(const bt_world *world, double *x, int width)
{
    if (!world->domain) return;
    const bt_domain *domain = world->domain;
    const bt_bodies *bodies = &world->bodies;
    const bt_cells *cells = world->cells;
    const size_t bytes = (size_t)width * sizeof *x;
    parcels outgoing = new_parcels(domain->comm->size);
    for (bt_idx k = 0; k < cells->n; k++) {
        const bt_cell *cell = &cells->cell[k];
        const bool large = k == cells->n - 1; // on every rank
        int rank[BT_MAX_SHARERS];
        if (cell->first == cell->end || !domain->owned[cell->first]) continue;
        const int n = large ? domain->comm->size : bt_division_sharers(world, cell->x, cell->y, rank);
        for (int j = 0; j < n; j++) {
            const int r = large ? j : rank[j];
            for (bt_idx i = cell->first; r != domain->comm->rank && i < cell->end; i++) {
                add(&outgoing, r, &bodies->gid[i], sizeof *bodies->gid);
                add(&outgoing, r, x + (size_t)i * (size_t)width, bytes);
            }
        }
    }
    size_t n_in;
    char *in = deliver(domain->comm, &outgoing, 4, &n_in);
    for (size_t at = 0; at < n_in; at += sizeof(bt_gid) + bytes) {
        bt_gid gid;
        memcpy(&gid, in + at, sizeof gid);
        memcpy(x + (size_t)bt_world_index(world, gid) * (size_t)width, in + at + sizeof gid, bytes);
    }
    free(in);
}

// --- contact memory --------------------------------------------------------------------------------------------------

/// Rank that solves the contacts of a and b, both held here, under the new map and labels.
static int solver_of(const bt_world *world, bt_idx a, bt_idx b)
{
    const bt_bodies *bodies = &world->bodies;
    if ((bodies->large[a] && bodies->motion[a] == BT_DYNAMIC) || (bodies->large[b] && bodies->motion[b] == BT_DYNAMIC))
        return world->domain->large_owner;
    int32_t at[2];
    bt_cells_owner(world->cells, bodies->cell[bodies->large[a] ? b : a], bodies->cell[bodies->large[b] ? a : b], at);
    return bt_division_owner(world, at[0], at[1]);
}

/// Sort records by destination rank; those that stay are kept in memory [*n].
static void sort_memory(const bt_world *world, bt_memory *memory, int64_t *n, parcels *outgoing)
{
    const bt_domain *domain = world->domain;
    int64_t kept = 0;
    for (int64_t k = 0; k < *n; k++) {
        const int to = solver_of(world, bt_world_index(world, memory[k].a), bt_world_index(world, memory[k].b));
        if (to == domain->comm->rank) memory[kept++] = memory[k];
        else if (domain->distributed) add(outgoing, to, &memory[k], sizeof *memory);
    }
    *n = kept;
}

bt_memory *bt_domain_migrate(bt_world *world, bt_memory *memory, int64_t *n)
{
    bt_domain *domain = world->domain;
    if (!domain) return memory;
    bt_division_map(world, domain->due);
    parcels outgoing = new_parcels(domain->comm->size);
    sort_memory(world, memory, n, &outgoing);
    move_bodies(world);
    size_t n_in;
    char *in = deliver(domain->comm, &outgoing, 2, &n_in);
    const int64_t more = (int64_t)(n_in / sizeof *memory);
    memory = bt_realloc(memory, (size_t)(*n + more) + 1, sizeof *memory);
    if (more) memcpy(memory + *n, in, n_in);
    *n += more;
    free(in);
    domain->distributed = true;
    return memory;
}
