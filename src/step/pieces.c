// SPDX-License-Identifier: MIT
// The history of splits, and the pieces as bodies in place of their parents; see step/splitting.h.
#include "step/splitting.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/elementary.h"
#include "base/inside.h"
#include "body/bodies.h"
#include "contact/cell_contacts.h"
#include "contact/law.h"
#include "partition/domain.h"

// --- the history -----------------------------------------------------------------------------------------------------

static bool is_piece(const bt_splitting *splitting, bt_gid gid)
{
    return gid >= splitting->first && gid < splitting->first + 2 * splitting->n;
}

int64_t bt_splitting_generation(const bt_splitting *splitting, bt_gid gid)
{
    return splitting && is_piece(splitting, gid) ? bt_splitting_birth(splitting, gid - splitting->first)->generation
                                                 : 0;
}

bt_gid bt_splitting_ancestor(const bt_splitting *splitting, bt_gid gid, int64_t *path)
{
    int64_t way = 0, bit = 1;
    for (; splitting && is_piece(splitting, gid); bit <<= 1) {
        const bt_gid k = gid - splitting->first;
        way |= k % 2 ? bit : 0;
        gid = bt_splitting_birth(splitting, k)->parent;
    }
    *path = bit | way;
    return gid;
}

double bt_splitting_size(const bt_splitting *splitting, bool before, double percent)
{
    if (splitting->n == 0) return NAN;
    double *size = bt_alloc(2 * (size_t)splitting->n, sizeof *size); // of pieces; 0: it has split
    size_t n = 0;
    for (int64_t k = 0; k < splitting->n; k++) {
        const bt_split_record *record = &splitting->split[k];
        if (before) {
            if (record->generation == 1) size[n++] = sqrt(record->area[0] + record->area[1]);
            continue;
        }
        for (int i = 0; i < 2; i++) size[n++] = sqrt(record->area[i]);
        if (record->generation > 1) size[record->parent - splitting->first] = 0;
    }
    qsort(size, n, sizeof *size, bt_ascending);
    size_t gone = 0;
    while (size[gone] == 0) gone++;
    const double found = bt_percentile(size + gone, (int64_t)(n - gone), percent);
    free(size);
    return found;
}

double bt_splitting_polar(const bt_world *world, bt_idx i)
{
    const bt_bodies *bodies = &world->bodies;
    const bt_splitting *splitting = world->splitting;
    const bt_gid k = bodies->gid[i] - splitting->first;
    if (is_piece(splitting, bodies->gid[i])) return bt_splitting_birth(splitting, k)->polar[k % 2];
    return bt_shape_area_moments(bt_body_corners(bodies, i), bodies->vertices + 2 * bodies->offset[i]).polar;
}

void bt_splitting_append(bt_splitting *splitting, const bt_split_record *record, const double *vertex)
{
    if (splitting->n == splitting->cap) {
        splitting->cap = splitting->cap ? 2 * splitting->cap : 64;
        splitting->split = bt_realloc(splitting->split, (size_t)splitting->cap, sizeof *splitting->split);
        splitting->begin = bt_realloc(splitting->begin, (size_t)splitting->cap, sizeof *splitting->begin);
    }
    splitting->begin[splitting->n] = splitting->n_vertices;
    splitting->split[splitting->n++] = *record;
    const int64_t more = record->corners[0] + record->corners[1] + record->corners[2];
    if (splitting->n_vertices + more > splitting->cap_vertices) {
        splitting->cap_vertices = 2 * splitting->cap_vertices + more;
        splitting->vertex = bt_realloc(splitting->vertex, (size_t)splitting->cap_vertices,
                                       2 * sizeof *splitting->vertex);
    }
    memcpy(splitting->vertex + 2 * splitting->n_vertices, vertex, 2 * (size_t)more * sizeof *vertex);
    splitting->n_vertices += more;
}

void bt_splitting_free(bt_splitting *splitting)
{
    if (!splitting) return;
    free(splitting->split);
    free(splitting->begin);
    free(splitting->vertex);
    free(splitting->sum);
    free(splitting->borne);
    free(splitting);
}

uint64_t bt_splitting_hash(const bt_splitting *splitting)
{
    uint64_t h = (uint64_t)splitting->n;
    for (int64_t k = 0; k < splitting->n; k++) h = h * UINT64_C(0x100000001b3) ^ (uint64_t)splitting->split[k].parent;
    for (int64_t k = 0; k < 2 * splitting->n_vertices; k++) {
        uint64_t u;
        memcpy(&u, &splitting->vertex[k], sizeof u);
        h = h * UINT64_C(0x100000001b3) ^ u;
    }
    return h;
}

// --- pieces ----------------------------------------------------------------------------------------------------------

/// Make a body of piece k of body i, with the velocity field of i at the start of the step. v: its outline.
static void put_piece(bt_world *world, bt_idx i, const bt_split_record *record, int k, const double *v, bt_gid gid)
{
    bt_bodies *bodies = &world->bodies;
    const int n = (int)record->corners[k];
    const double whole = bt_shape_moments(bt_body_corners(bodies, i), bodies->vertices + 2 * bodies->offset[i]).cubic,
                 own = bt_shape_moments(n, v).cubic;
    double s, c;
    bt_sincos(bodies->pose[i].yaw, &s, &c);
    const double *at = record->at[k], dx = c * at[0] - s * at[1], dy = s * at[0] + c * at[1],
                 share = record->area[k] / bodies->area[i];
    const bt_vel u = bodies->vel_start[i];
    int32_t lap = bodies->lap[i], across = 0;
    bt_body_def def = {
        .motion = BT_DYNAMIC, .n_vertices = n, .vertices = v,
        .x = bt_into_period(bodies->pose[i].x + dx, world->par.x0, world->par.period_x, &lap),
        .y = bt_into_period(bodies->pose[i].y + dy, world->par.y0, world->par.period_y, &across),
        .yaw = bodies->pose[i].yaw, .vx = u.x - u.w * dy, .vy = u.y + u.w * dx, .yaw_rate = u.w,
        .mass = bodies->mass[i] * share,
        .inertia = bodies->inertia[i] * (record->polar[k] / bt_splitting_polar(world, i)),
        .friction = bodies->friction[i], .restitution = bodies->restitution[i], .thickness = bodies->thickness[i],
        .drag = bodies->drag[i], .large = bodies->large[i] && sqrt(record->area[k] / BT_PI) > world->splitting->large,
    };
    def.drag.water_skin *= share;
    def.drag.air_skin *= share;
    def.drag.yaw *= own / whole;
    bt_parts parts;
    if (!bt_outline_convex(n, v) && bt_outline_split(n, v, &parts)) def.parts = &parts;
    const bt_idx j = bt_bodies_put(bodies, &def, gid);
    bodies->area[j] = record->area[k];
    bodies->share[j] = bodies->share[i];
    bodies->exposure[j] = bodies->exposure[i];
    bodies->path[j] = bodies->path[i];
    bodies->lap[j] = lap;
}

/// Splits from..n of the history: put pieces in place of the parents that this rank holds.
static void put_pieces(bt_world *world, int64_t from)
{
    bt_bodies *bodies = &world->bodies;
    const bt_splitting *splitting = world->splitting;
    const bt_idx n = bodies->n;
    const size_t most = (size_t)n + 2 * (size_t)(splitting->n - from);
    bt_idx *source = bt_alloc(most, sizeof *source);
    uint8_t *keep = bt_alloc(most, sizeof *keep);
    for (bt_idx i = 0; i < n; i++) source[i] = i, keep[i] = 1;
    for (int64_t k = from; k < splitting->n; k++) {
        const bt_split_record *record = &splitting->split[k];
        const bt_idx i = bodies->index_of[record->parent];
        for (int p = 0; p < 2; p++) {
            const bt_gid gid = splitting->first + 2 * k + p;
            bodies->gone[gid] = 0;
            if (i >= 0) {
                source[bodies->n] = source[i], keep[bodies->n] = 1;
                put_piece(world, i, record, p, bt_splitting_outline(splitting, k, p), gid);
            }
        }
        if (i >= 0) keep[i] = 0;
        bodies->index_of[record->parent] = -1;
        bodies->gone[record->parent] = 1;
    }
    bt_idx kept = 0;
    for (bt_idx i = 0; i < bodies->n; i++)
        if (keep[i]) source[kept++] = source[i];
    bt_bodies_compact(bodies, keep);
    for (bt_idx i = 0; i < bodies->n; i++) bodies->index_of[bodies->gid[i]] = i;
    bt_domain_follow(world, source);
    free(source);
    free(keep);
}

static double deepest(const bt_memory *r) { return r->n_points > 1 ? bt_max(r->value[0], r->value[1]) : r->value[0]; }

/// Turn the records of pairs with parents into records of pairs with their pieces. Impulses are not passed on: the
/// points of a piece have other names. Several parts of a parent may have had records with the same body: of these a
/// piece takes over the deepest.
static bt_memory *hand_on(const bt_world *world, bt_memory *memory, int64_t *n, int64_t from)
{
    const bt_splitting *splitting = world->splitting;
    const bt_bodies *bodies = &world->bodies;
    bt_memory *out = bt_alloc(4 * (size_t)*n + 1, sizeof *out);
    int64_t m = 0;
    for (int64_t k = 0; k < *n; k++) {
        const bt_memory *r = &memory[k];
        if (!bodies->gone[r->a] && !bodies->gone[r->b]) {
            out[m++] = *r;
            continue;
        }
        if (r->law == BT_LAW_RIGID) continue;
        bt_gid side[2][2];
        int n_side[2];
        for (int e = 0; e < 2; e++) {
            const bt_gid g = e ? r->b : r->a;
            side[e][0] = g, n_side[e] = 1;
            for (int64_t q = from; bodies->gone[g] && q < splitting->n; q++) // few, of one step
                if (splitting->split[q].parent == g)
                    side[e][0] = splitting->first + 2 * q, side[e][1] = side[e][0] + 1, n_side[e] = 2;
        }
        for (int p = 0; p < n_side[0]; p++)
            for (int q = 0; q < n_side[1]; q++) {
                bt_memory piece = *r;
                bt_gid x = side[0][p], y = side[1][q];
                if (n_side[0] > 1) piece.part[0] = (uint16_t)bt_part_first(bodies, bt_world_index(world, x));
                if (n_side[1] > 1) piece.part[1] = (uint16_t)bt_part_first(bodies, bt_world_index(world, y));
                if (x > y) {
                    const bt_gid g = x;
                    const uint16_t part = piece.part[0];
                    x = y, y = g;
                    piece.part[0] = piece.part[1], piece.part[1] = part;
                }
                piece.a = x, piece.b = y;
                out[m++] = piece;
            }
    }
    free(memory);
    if (m > 0) qsort(out, (size_t)m, sizeof *out, bt_memory_by_names);
    *n = 0;
    for (int64_t k = 0; k < m; k++) {
        const bool same = *n > 0 && bt_memory_by_names(&out[*n - 1], &out[k]) == 0;
        if (!same) out[(*n)++] = out[k];
        else if (deepest(&out[k]) > deepest(&out[*n - 1])) out[*n - 1] = out[k];
    }
    return out;
}

/// context: the first of the new splits.
static bt_memory *change(bt_world *world, bt_memory *memory, int64_t *n, const void *context)
{
    bt_bodies *bodies = &world->bodies;
    const int64_t from = *(const int64_t *)context;
    for (bt_idx i = 0; i < bodies->n; i++)
        if (bodies->motion[i] == BT_DYNAMIC) bodies->vel[i] = bodies->vel_start[i];
    put_pieces(world, from);
    return hand_on(world, memory, n, from);
}

void bt_splitting_put(bt_world *world, int64_t from) { bt_cells_change(world, change, &from); }

void bt_splitting_restore(bt_world *world) { put_pieces(world, 0); }
