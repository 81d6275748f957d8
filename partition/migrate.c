// SPDX-License-Identifier: MIT
// Bodies and contact memory to the ranks that own or hold them.
//
// Every owned body is sent, complete, to all ranks that hold its cell under the new map; ghosts are dropped first and
// come back the same way. So after a migration every copy of a body is that of its owner.
#include <stdlib.h>
#include <string.h>

#include "body/bodies.h"
#include "partition/division.h"
#include "partition/domain.h"

/// Bytes for every rank.
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

static void add(parcels *p, int rank, const void *data, size_t n)
{
    if (p->n[rank] + n > p->cap[rank]) {
        p->cap[rank] = 2 * (p->n[rank] + n);
        p->data[rank] = bt_realloc(p->data[rank], p->cap[rank], 1);
    }
    memcpy(p->data[rank] + p->n[rank], data, n);
    p->n[rank] += n;
}

static void free_parcels(parcels *p)
{
    for (int r = 0; r < p->size; r++) free(p->data[r]);
    free(p->data);
    free(p->n);
    free(p->cap);
}

enum { PIECE = 1 << 30 };

/// Collective. What all others have for this rank, one after the other; the caller frees.
static char *deliver(const bt_comm *c, parcels *p, int tag, size_t *n_in)
{
    uint64_t *out = bt_alloc((size_t)c->size, sizeof *out), *in = bt_alloc((size_t)c->size, sizeof *in);
    for (int r = 0; r < c->size; r++) out[r] = p->n[r];
    MPI_Alltoall(out, 1, MPI_UINT64_T, in, 1, MPI_UINT64_T, c->mpi);
    size_t n_requests = 0;
    *n_in = 0;
    for (int r = 0; r < c->size; r++) {
        *n_in += in[r];
        n_requests += out[r] / PIECE + in[r] / PIECE + 2;
    }
    char *all = bt_realloc(NULL, *n_in ? *n_in : 1, 1);
    MPI_Request *request = bt_alloc(n_requests, sizeof *request);
    int n = 0;
    size_t at = 0;
    for (int r = 0; r < c->size; r++)
        for (uint64_t done = 0; done < in[r]; done += PIECE) {
            const int piece = (int)(in[r] - done < PIECE ? in[r] - done : PIECE);
            MPI_Irecv(all + at, piece, MPI_BYTE, r, tag, c->mpi, &request[n++]);
            at += (size_t)piece;
        }
    for (int r = 0; r < c->size; r++)
        for (uint64_t done = 0; done < out[r]; done += PIECE)
            MPI_Isend(p->data[r] + done, (int)(out[r] - done < PIECE ? out[r] - done : PIECE), MPI_BYTE, r, tag, c->mpi,
                      &request[n++]);
    bt_comm_wait(n, request);
    free(request);
    free(out);
    free(in);
    return all;
}

// --- bodies ----------------------------------------------------------------------------------------------------------

static char *field_of(const bt_bodies *b, int k, bt_idx i)
{
    return *(char **)((char *)b + bt_body_fields[k].array) + (size_t)i * bt_body_fields[k].size;
}

static char *vertices_of(const bt_bodies *b, int k, int64_t first)
{
    return *(char **)((char *)b + bt_vertex_fields[k].array) + (size_t)first * bt_vertex_fields[k].size;
}

static void pack(const bt_bodies *b, bt_idx i, parcels *p, int rank)
{
    for (int k = 0; k < bt_bodies_n_fields(b); k++) add(p, rank, field_of(b, k, i), bt_body_fields[k].size);
    const int64_t first = b->offset[i], n = b->offset[i + 1] - first;
    add(p, rank, &n, sizeof n);
    for (int k = 0; k < bt_n_vertex_fields; k++)
        add(p, rank, vertices_of(b, k, first), (size_t)n * bt_vertex_fields[k].size);
}

/// Append the bodies of a delivery.
static void unpack(bt_bodies *b, const char *data, size_t n_bytes)
{
    size_t at = 0;
    while (at < n_bytes) {
        int64_t n;
        size_t record = 0;
        for (int k = 0; k < bt_bodies_n_fields(b); k++) record += bt_body_fields[k].size;
        memcpy(&n, data + at + record, sizeof n);
        const int64_t first = b->offset[b->n];
        bt_bodies_reserve(b, b->n + 1, first + n);
        const bt_idx i = b->n++;
        for (int k = 0; k < bt_bodies_n_fields(b); k++) {
            memcpy(field_of(b, k, i), data + at, bt_body_fields[k].size);
            at += bt_body_fields[k].size;
        }
        at += sizeof n;
        b->offset[i + 1] = first + n;
        for (int k = 0; k < bt_n_vertex_fields; k++) {
            const size_t bytes = (size_t)n * bt_vertex_fields[k].size;
            memcpy(vertices_of(b, k, first), data + at, bytes);
            at += bytes;
        }
    }
}

/// Give back the memory of bodies that have gone.
static void shrink(bt_bodies *b)
{
    const bt_idx cap = b->n + b->n / 8 + 16;
    if (b->cap <= cap + cap / 4) return;
    for (int k = 0; k < bt_bodies_n_fields(b); k++) {
        void **array = (void **)((char *)b + bt_body_fields[k].array),
             *small = bt_alloc_aligned((size_t)cap, bt_body_fields[k].size);
        memcpy(small, *array, (size_t)b->n * bt_body_fields[k].size);
        free(*array);
        *array = small;
    }
    b->offset = bt_realloc(b->offset, (size_t)cap + 1, sizeof *b->offset);
    b->cap = cap;
    const int64_t vertices = b->offset[b->n] + b->offset[b->n] / 8 + 64;
    for (int k = 0; k < bt_n_vertex_fields; k++) {
        void **array = (void **)((char *)b + bt_vertex_fields[k].array);
        *array = bt_realloc(*array, (size_t)vertices, bt_vertex_fields[k].size);
    }
    b->cap_vertices = vertices;
}

static void move_bodies(bt_world *w)
{
    bt_bodies *b = &w->bodies;
    bt_domain *d = w->domain;
    const int me = d->comm->rank;
    parcels p = new_parcels(d->comm->size);
    uint8_t *keep = bt_alloc((size_t)b->n, 1);
    for (bt_idx i = 0; i < b->n; i++) {
        if (b->large[i]) {
            keep[i] = 1; // on every rank
            continue;
        }
        if (d->distributed && !d->owned[i]) continue;
        int rank[BT_MAX_SHARERS];
        const int n = bt_division_sharers(w, b->cell[i][0], b->cell[i][1], rank);
        for (int k = 0; k < n; k++) {
            if (rank[k] == me) keep[i] = 1;
            else if (d->distributed) pack(b, i, &p, rank[k]); // at first every rank has all
        }
        d->stats.moved += d->distributed && bt_division_owner(w, b->cell[i][0], b->cell[i][1]) != me;
    }
    for (bt_gid g = 0; g < b->n_global; g++) b->index_of[g] = -1;
    bt_bodies_compact(b, keep);
    free(keep);
    size_t n_in;
    char *in = deliver(d->comm, &p, 1, &n_in);
    free_parcels(&p);
    unpack(b, in, n_in);
    free(in);
    shrink(b);
}

// --- for the moment --------------------------------------------------------------------------------------------------

/// Is floe i within `reach` of a large floe that moves?
static bool near_large(const bt_world *w, bt_idx i, double reach)
{
    const bt_bodies *b = &w->bodies;
    for (bt_idx j = w->cells->n_in_cells; j < b->n; j++) {
        if (b->motion[j] != BT_DYNAMIC || !(b->thickness[j] > 0)) continue;
        double d[2];
        bt_bodies_offset(w, i, j, d);
        const double far = b->radius[i] + b->radius[j] + reach;
        if (d[0] * d[0] + d[1] * d[1] < far * far) return true;
    }
    return false;
}

void bt_domain_around(const bt_world *w, const int rings[2], double reach, bt_bodies *copies)
{
    *copies = (bt_bodies){.offset = bt_alloc(1, sizeof *copies->offset)};
    if (!w->domain) return;
    const bt_domain *d = w->domain;
    const bt_bodies *b = &w->bodies;
    const bt_cells *t = w->cells;
    if (b->home) bt_bodies_make_homes(copies);
    parcels p = new_parcels(d->comm->size);
    uint8_t *to = bt_alloc((size_t)d->comm->size, 1);
    for (bt_idx k = 0; k < t->n - 1; k++) {
        const bt_cell *cell = &t->cell[k];
        if (!cell->own || cell->first == cell->end) continue;
        memset(to, 0, (size_t)d->comm->size);
        for (int32_t y = -rings[1]; y <= rings[1]; y++)
            for (int32_t x = -rings[0]; x <= rings[0]; x++) {
                const int r = bt_division_owner(w, cell->x + x, cell->y + y);
                if (r >= 0) to[r] = 1;
            }
        int holder[BT_MAX_SHARERS];
        const int n = bt_division_sharers(w, cell->x, cell->y, holder);
        bool held = false; // by the rank that owns the large bodies
        for (int h = 0; h < n; h++) to[holder[h]] = 0, held = held || holder[h] == 0;
        for (bt_idx i = cell->first; i < cell->end; i++)
            for (int r = 0; r < d->comm->size; r++)
                if (to[r] || (r == 0 && !held && near_large(w, i, reach))) pack(b, i, &p, r);
    }
    free(to);
    size_t n_in;
    char *in = deliver(d->comm, &p, 3, &n_in);
    free_parcels(&p);
    unpack(copies, in, n_in);
    free(in);
}

void bt_domain_share(const bt_world *w, double *x, int width)
{
    if (!w->domain) return;
    const bt_domain *d = w->domain;
    const bt_bodies *b = &w->bodies;
    const size_t bytes = (size_t)width * sizeof *x;
    parcels p = new_parcels(d->comm->size);
    for (bt_idx i = 0; i < b->n; i++) {
        int rank[BT_MAX_SHARERS];
        if (!d->owned[i]) continue;
        const int n = b->large[i] ? d->comm->size : bt_division_sharers(w, b->cell[i][0], b->cell[i][1], rank);
        for (int k = 0; k < n; k++) {
            const int r = b->large[i] ? k : rank[k];
            if (r == d->comm->rank) continue;
            add(&p, r, &b->gid[i], sizeof *b->gid);
            add(&p, r, x + (size_t)i * (size_t)width, bytes);
        }
    }
    size_t n_in;
    char *in = deliver(d->comm, &p, 4, &n_in);
    free_parcels(&p);
    for (size_t at = 0; at < n_in; at += sizeof(bt_gid) + bytes) {
        bt_gid gid;
        memcpy(&gid, in + at, sizeof gid);
        memcpy(x + (size_t)bt_world_index(w, gid) * (size_t)width, in + at + sizeof gid, bytes);
    }
    free(in);
}

// --- contact memory --------------------------------------------------------------------------------------------------

/// Rank that solves the contacts of a and b, both held here, under the new map and labels.
static int solver_of(const bt_world *w, bt_idx a, bt_idx b)
{
    const bt_bodies *s = &w->bodies;
    if ((s->large[a] && s->motion[a] == BT_DYNAMIC) || (s->large[b] && s->motion[b] == BT_DYNAMIC))
        return w->domain->large_owner;
    int32_t at[2];
    bt_cells_owner(w->cells, s->cell[s->large[a] ? b : a], s->cell[s->large[b] ? a : b], at);
    return bt_division_owner(w, at[0], at[1]);
}

/// Records by the rank they go to; those that stay are kept in memory [*n].
static void sort_memory(const bt_world *w, bt_memory *memory, int64_t *n, parcels *p)
{
    const bt_domain *d = w->domain;
    int64_t kept = 0;
    for (int64_t k = 0; k < *n; k++) {
        const int to = solver_of(w, bt_world_index(w, memory[k].a), bt_world_index(w, memory[k].b));
        if (to == d->comm->rank) memory[kept++] = memory[k];
        else if (d->distributed) add(p, to, &memory[k], sizeof *memory);
    }
    *n = kept;
}

bt_memory *bt_domain_migrate(bt_world *w, bt_memory *memory, int64_t *n)
{
    bt_domain *d = w->domain;
    if (!d) return memory;
    bt_division_map(w, d->due);
    parcels p = new_parcels(d->comm->size);
    sort_memory(w, memory, n, &p);
    move_bodies(w);
    size_t n_in;
    char *in = deliver(d->comm, &p, 2, &n_in);
    free_parcels(&p);
    const int64_t more = (int64_t)(n_in / sizeof *memory);
    memory = bt_realloc(memory, (size_t)(*n + more) + 1, sizeof *memory);
    if (more) memcpy(memory + *n, in, n_in);
    *n += more;
    free(in);
    d->distributed = true;
    return memory;
}
