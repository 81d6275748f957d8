// SPDX-License-Identifier: MIT
// Bodies from the ranks that hold them to the ranks that record them.
//
// The ranks hold the bodies as the computation needs them; result.h5 has them in the order of their ids. Each body is
// sent once, by the rank responsible for it, to the rank whose block of ids contains it (bt_record_blocks). Lost and
// duplicate bodies are detected here.
#include "output/gather.h"

#include "base/inside.h"
#include "output/observe.h"
#include "partition/domain.h"
#include "step/splitting.h"
#include "tow/tow.h"
#include "base/elementary.h"

typedef struct list {
    bt_idx n;       ///< bodies for which this rank is responsible; rank 0 also for floes that have split
    bt_gid *row;    ///< [n] among all rows (bt_roster_row)
    int64_t *body;  ///< [n]; for a floe that has split, −1 − its split (step/splitting.h)
    int64_t *first; ///< [ranks + 1] blocks
    int64_t count;  ///< bodies of this rank's block
} list;

static list make_list(const bt_comm *comm, const bt_world *world, const bt_roster *roster)
{
    const bt_splitting *splitting = world->splitting;
    const size_t most = (size_t)world->bodies.n + (splitting ? (size_t)splitting->n : 0);
    list block = {.row = bt_alloc(most, sizeof *block.row), .body = bt_alloc(most, sizeof *block.body),
                  .first = bt_alloc((size_t)comm->size + 1, sizeof *block.first)};
    for (bt_idx i = 0; i < world->bodies.n; i++) {
        const bt_gid row = bt_roster_row(roster, world->bodies.gid[i]);
        if (row < 0 || !bt_domain_owns(world, i)) continue;
        block.row[block.n] = row;
        block.body[block.n++] = i;
    }
    for (int64_t k = 0; splitting && k < splitting->n && comm->rank == 0; k++) {
        if (splitting->split[k].generation > 1) continue;
        block.row[block.n] = bt_roster_row(roster, splitting->split[k].parent);
        block.body[block.n++] = -1 - k;
    }
    bt_record_blocks(comm, roster->n_floes, (bt_idx)(world->bodies.n_global - roster->n_kept), block.first);
    block.count = block.first[comm->rank + 1] - block.first[comm->rank];
    return block;
}

static void free_list(list *block)
{
    BT_FREE(block->row, block->body, block->first);
}

/// Outline of a body in its own frame; returns the number of vertices.
static int outline_of(const bt_world *world, int64_t body, const double **v)
{
    if (body < 0) {
        *v = bt_splitting_outline(world->splitting, -1 - body, 2);
        return (int)world->splitting->split[-1 - body].corners[2];
    }
    *v = world->bodies.vertices + 2 * world->bodies.offset[body];
    return bt_body_corners(&world->bodies, (bt_idx)body);
}

static int most_vertices(const bt_comm *comm, const bt_world *world, const list *block)
{
    double most = 0;
    const double *v;
    for (bt_idx i = 0; i < block->n; i++) most = bt_max(most, outline_of(world, block->body[i], &v));
    bt_comm_reduce(comm, NULL, 0, &most, 1, NULL, 0);
    return (int)most;
}

/// Send vertices in portions: rows as long as the longest outline would take several times the memory of the outlines.
static bt_status hand_over_vertices(const bt_comm *comm, const bt_world *world, const list *l, const int64_t *offsets,
                                    double *vertices, bt_errors *err)
{
    enum { PORTION = 4 };
    const int most = most_vertices(comm, world, l);
    double(*rows)[PORTION][2] = bt_alloc((size_t)l->n, sizeof *rows),
    (*block)[PORTION][2] = bt_alloc((size_t)l->count, sizeof *block);
    bt_status status = BT_OK;
    for (int from = 0; from < most && status == BT_OK; from += PORTION) {
        for (bt_idx i = 0; i < l->n; i++) {
            const double *v;
            const int n = outline_of(world, l->body[i], &v);
            for (int k = 0; k < PORTION; k++) {
                const bool there = from + k < n;
                rows[i][k][0] = there ? v[2 * (from + k)] : 0;
                rows[i][k][1] = there ? v[2 * (from + k) + 1] : 0;
            }
        }
        status = bt_comm_rows_by_gid(comm, l->first, l->n, l->row, 2 * PORTION, &rows[0][0][0], &block[0][0][0], err);
        for (int64_t i = 0; i < l->count; i++)
            for (int k = 0; k < PORTION; k++) {
                const int64_t v = offsets[i] + from + k;
                if (v >= offsets[i + 1]) break;
                vertices[2 * v] = block[i][k][0];
                vertices[2 * v + 1] = block[i][k][1];
            }
    }
    free(rows);
    free(block);
    return status;
}

bt_status bt_gather_bodies(const bt_comm *comm, const bt_world *world, const bt_roster *roster, bt_record_bodies *out,
                             bt_errors *err)
{
    const bt_bodies *bodies = &world->bodies;
    list l = make_list(comm, world, roster);
    double (*rows)[4] = bt_alloc((size_t)l.n, sizeof *rows), (*block)[4] = bt_alloc((size_t)l.count, sizeof *block);
    for (bt_idx i = 0; i < l.n; i++) {
        const int64_t k = l.body[i];
        const double *v;
        const int n = outline_of(world, k, &v);
        rows[i][0] = n;
        rows[i][1] = roster->thickness[l.row[i]];
        rows[i][2] = k < 0 ? bt_shape_area_moments(n, v).area : bodies->area[k];
        rows[i][3] = k >= 0 && bodies->motion[k] == BT_STATIC; // a floe that has split was not
    }
    bt_status status = bt_comm_rows_by_gid(comm, l.first, l.n, l.row, 4, &rows[0][0], &block[0][0], err);
    int64_t *offsets = bt_alloc((size_t)l.count + 1, sizeof *offsets);
    double *thickness = bt_alloc((size_t)l.count, sizeof *thickness), *area = bt_alloc((size_t)l.count, sizeof *area);
    int32_t *fixed = bt_alloc((size_t)l.count, sizeof *fixed);
    for (int64_t i = 0; i < l.count; i++) {
        offsets[i + 1] = offsets[i] + (int64_t)block[i][0];
        thickness[i] = block[i][1];
        area[i] = block[i][2];
        fixed[i] = block[i][3] != 0;
    }
    free(rows);
    free(block);
    double *vertices = bt_alloc(2 * (size_t)offsets[l.count], sizeof *vertices);
    if (status == BT_OK) status = hand_over_vertices(comm, world, &l, offsets, vertices, err);
    free_list(&l);
    *out = (bt_record_bodies){.n_floes = roster->n_floes,
                              .n_bodies = (bt_idx)(bodies->n_global - roster->n_kept),
                              .offsets = offsets,
                              .vertices = vertices,
                              .thickness = thickness,
                              .area = area,
                              .fixed = fixed,
                              .names = roster->names,
                              .all = comm->size == 1 && !world->splitting ? bodies : NULL, // no floe goes
                              .towed = world->towed < 0 ? -1 : (bt_idx)bt_roster_row(roster, world->towed),
                              .branches = bt_tow_has_line(world->tow) ? world->tow->n_branches : 0};
    if (status != BT_OK) bt_gather_free(out);
    return status;
}

void bt_gather_free(bt_record_bodies *bodies)
{
    BT_FREE((void *)bodies->offsets, (void *)bodies->vertices, (void *)bodies->thickness, (void *)bodies->area,
            (void *)bodies->fixed);
    *bodies = (bt_record_bodies){0};
}

/// Row of body k in a frame; k < 0: a floe that has split.
static bt_frame_row row_of(const bt_bodies *bodies, int64_t k, const double *force, double (*net)[2])
{
    if (k < 0) return (bt_frame_row){NAN, NAN, NAN, NAN, NAN, NAN, NAN, NAN, NAN};
    return (bt_frame_row){
        .x = bodies->pose[k].x, .y = bodies->pose[k].y, .yaw = bodies->pose[k].yaw, .contact_force = force[k],
        .speed = bt_hypot(bodies->vel[k].x, bodies->vel[k].y), .vx = bodies->vel[k].x, .vy = bodies->vel[k].y,
        .fx = net[k][0], .fy = net[k][1]};
}

BT_ASCENDING(by_piece, bt_piece_row, piece)

/// Collective. The existing pieces, in the order of their ids, on rank 0.
static bt_piece_row *gather_pieces(const bt_comm *comm, const bt_world *world, const double *force, double (*net)[2],
                                   int64_t *n)
{
    *n = 0;
    const bt_splitting *splitting = world->splitting;
    if (!splitting) return NULL;
    const bt_bodies *bodies = &world->bodies;
    bt_piece_row *mine = bt_alloc((size_t)bodies->n, sizeof *mine);
    int64_t count = 0;
    for (bt_idx i = 0; i < bodies->n; i++) {
        const bt_gid k = bodies->gid[i] - splitting->first;
        if (k < 0 || k >= splitting->reserve || !bt_domain_owns(world, i)) continue;
        mine[count++] = (bt_piece_row){(double)k, row_of(bodies, i, force, net),
                                       bt_splitting_birth(splitting, k)->thickness};
    }
    bt_piece_row *all = (bt_piece_row *)(void *)bt_comm_gather(comm, count, BT_PIECE_ROW,
                                                               (const double *)(const void *)mine, n);
    free(mine);
    if (*n > 0) qsort(all, (size_t)*n, sizeof *all, by_piece);
    return all;
}

bt_status bt_gather_frame(const bt_comm *comm, const bt_world *world, const bt_roster *roster, bt_frame_row **out,
                          bt_piece_row **pieces, int64_t *n_pieces, bt_errors *err)
{
    const bt_bodies *bodies = &world->bodies;
    double *force = bt_alloc((size_t)bodies->n, sizeof *force);
    double (*net)[2] = bt_alloc((size_t)bodies->n, sizeof *net);
    bt_observe_contact_force(world, force);
    bt_observe_net_force(comm, world, roster, net);
    if (world->stats.locked) // the contacts of this step have no solution
        for (bt_idx i = 0; i < bodies->n; i++) force[i] = net[i][0] = net[i][1] = NAN;
    list l = make_list(comm, world, roster);
    const bool alone = comm->size == 1; // all bodies are in one block: each row is put in its place directly
    bt_frame_row *rows = bt_alloc((size_t)(alone ? l.count : l.n), sizeof *rows);
    for (bt_idx i = 0; i < l.n; i++) rows[alone ? l.row[i] : i] = row_of(bodies, l.body[i], force, net);
    *pieces = gather_pieces(comm, world, force, net, n_pieces);
    free(force);
    free(net);
    bt_frame_row *block = rows;
    bt_status status = BT_OK;
    if (!alone) {
        block = bt_alloc((size_t)l.count, sizeof *block);
        status = bt_comm_rows_by_gid(comm, l.first, l.n, l.row, BT_FRAME_ROW, (const double *)rows, (double *)block,
                                     err);
        free(rows);
    }
    free_list(&l);
    *out = status == BT_OK ? block : NULL;
    if (status != BT_OK) free(block);
    return status;
}

_Static_assert((int)BT_FRAME_BRANCHES == (int)BT_MAX_BRANCHES, "a frame has room for every branch");

/// The towing end and the travel of the body are not wrapped, but the pose is: draw it relative to the body.
bt_frame_line bt_gather_line(const bt_world *world)
{
    bt_frame_line line = {0};
    const bt_tow *tow = world->tow;
    if (!bt_tow_has_line(tow)) return line;
    const bt_pose *pose = &world->bodies.pose[bt_world_towed(world)];
    const double c = bt_cos(pose->yaw), s = bt_sin(pose->yaw);
    for (int k = 0; k < tow->n_branches; k++) {
        const bt_branch *branch = &tow->branch[k];
        double (*at)[2] = line.point[k];
        at[0][0] = pose->x + c * branch->hull_x - s * branch->hull_y;
        at[0][1] = pose->y + s * branch->hull_x + c * branch->hull_y;
        at[1][0] = branch->broken ? at[0][0] : pose->x + (tow->carriage_x - tow->travel_x);
        at[1][1] = branch->broken ? at[0][1] : pose->y + (tow->carriage_y - tow->travel_y);
        line.tension[k] = branch->broken ? 0 : bt_tow_tension(tow, k);
    }
    return line;
}

void bt_roster_free(bt_roster *roster)
{
    free(roster->thickness);
    free(roster->names);
    *roster = (bt_roster){0};
}
