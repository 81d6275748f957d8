// SPDX-License-Identifier: MIT
// Broad phase: the list of a cell's pairs near enough to be tested for contact, kept over many steps.
//
// The boxes of the bodies of a cell are compared all with all, and with those of neighbouring cells where both are near
// the border; a cell has some dozens, and comparing boxes in contiguous memory is faster than any finer grid. The list
// holds while no body of the block has travelled (path of its fastest point) farther than its share of the clearance;
// then it is made anew. A large body that cannot be moved (a wall, a berg at a set speed) pairs with floes in their own
// cells; a movable large body has its pairs in the last cell. Shores have their own tree (shore.h).
//
// Few pairs of a list are nearer than a twentieth of a floe beyond the margin. Until bodies of the block have moved
// that far towards each other, a step tests only these near pairs.
#include "space/pairs.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "body/bodies.h"
#include "space/exchange.h"

enum { X, Y, LOW_X, LOW_Y, HIGH_X, HIGH_Y, N_BOX };

void bt_pair_scratch_free(bt_pair_scratch *scratch)
{
    free(scratch->box);
    free(scratch->body);
    free(scratch->found);
    free(scratch->name);
    free(scratch->shore.found);
    *scratch = (bt_pair_scratch){0};
}

/// Box about n vertices of body i, from vertex `part` on.
static void box_of_part(const bt_bodies *bodies, bt_idx i, int part, int n, double box[N_BOX])
{
    box[X] = bodies->pose[i].x;
    box[Y] = bodies->pose[i].y;
    box[LOW_X] = box[LOW_Y] = INFINITY;
    box[HIGH_X] = box[HIGH_Y] = -INFINITY;
    for (int k = part; k < part + n; k++) {
        const double *v = bodies->outline + 2 * (bodies->offset[i] + k);
        box[LOW_X] = bt_min(box[LOW_X], v[0]);
        box[LOW_Y] = bt_min(box[LOW_Y], v[1]);
        box[HIGH_X] = bt_max(box[HIGH_X], v[0]);
        box[HIGH_Y] = bt_max(box[HIGH_Y], v[1]);
    }
}

static void box_of(const bt_bodies *bodies, bt_idx i, double box[N_BOX])
{
    box_of_part(bodies, i, 0, (int)(bodies->offset[i + 1] - bodies->offset[i]), box);
}

/// Do two boxes come within clearance? With periodic images a long wall can reach around the period: its box is
/// compared at the nearest image of the centroids, which is right for bodies shorter than half a period, and for walls
/// that span the whole period.
static inline bool near(const bt_params *par, const double *a, const double *b, double clearance)
{
    const double dx = bt_nearest_image(b[X] - a[X], par->period_x), dy = bt_nearest_image(b[Y] - a[Y], par->period_y);
    return (b[LOW_X] + dx - a[HIGH_X] <= clearance) & (a[LOW_X] - b[HIGH_X] - dx <= clearance) &
           (b[LOW_Y] + dy - a[HIGH_Y] <= clearance) & (a[LOW_Y] - b[HIGH_Y] - dy <= clearance);
}

static void append_parts(bt_pair_scratch *scratch, size_t *n, bt_idx a, bt_idx b, int part_a, int part_b)
{
    if (*n == scratch->cap_found)
        scratch->found = bt_realloc(scratch->found, scratch->cap_found = scratch->cap_found
                                    ? 2 * scratch->cap_found : 256, sizeof *scratch->found);
    scratch->found[(*n)++] = (bt_pair){.a = a, .b = b, .contact = -1, .part = {(uint16_t)part_a, (uint16_t)part_b},
                                       .axes = BT_NO_AXES};
}

/// Append the pair of bodies i and j, whose boxes come within clearance; if one of them is not convex, the pairs of its
/// parts that do.
static void append(const bt_world *world, bt_pair_scratch *scratch, size_t *n, bt_idx i, bt_idx j, double clearance)
{
    const bt_bodies *bd = &world->bodies;
    if (bd->motion[i] != BT_DYNAMIC && bd->motion[j] != BT_DYNAMIC) return;
    const bool ordered = bd->gid[i] < bd->gid[j];
    const bt_idx a = ordered ? i : j, b = ordered ? j : i;
    const int first_a = bt_part_first(bd, a), first_b = bt_part_first(bd, b);
    if (first_a == 0 && first_b == 0) {
        append_parts(scratch, n, a, b, 0, 0);
        return;
    }
    for (int p = first_a; p >= 0; p = bt_part_next(bd, a, p)) {
        double box[N_BOX];
        box_of_part(bd, a, p, bd->mark[bd->offset[a] + p].count, box);
        for (int q = first_b; q >= 0; q = bt_part_next(bd, b, q)) {
            double other[N_BOX];
            box_of_part(bd, b, q, bd->mark[bd->offset[b] + q].count, other);
            if (near(&world->par, box, other, clearance)) append_parts(scratch, n, a, b, p, q);
        }
    }
}

/// Append the pairs of body i, with this box, and the polygons of shores whose boxes come within clearance of it.
static void append_shore(const bt_world *world, bt_pair_scratch *scratch, size_t *n, bt_idx i, const double *box,
                         double clearance)
{
    const bt_bodies *bodies = &world->bodies;
    if (!world->shore || bodies->motion[i] != BT_DYNAMIC) return;
    const double low[2] = {box[X] + box[LOW_X] - clearance, box[Y] + box[LOW_Y] - clearance},
                 high[2] = {box[X] + box[HIGH_X] + clearance, box[Y] + box[HIGH_Y] + clearance};
    bt_shore_near(world, box[X], box[Y], low, high, &scratch->shore);
    for (size_t k = 0; k < scratch->shore.n; k++) {
        const bt_shore_polygon *polygon = &scratch->shore.found[k];
        const bt_idx l = bt_world_index(world, polygon->gid);
        const bool first = bodies->gid[i] < polygon->gid;
        double other[N_BOX];
        box_of_part(bodies, l, polygon->part, polygon->count, other);
        for (int q = bt_part_first(bodies, i); q >= 0; q = bt_part_next(bodies, i, q)) {
            double own[N_BOX];
            box_of_part(bodies, i, q, bodies->mark[bodies->offset[i] + q].count, own);
            if (!near(&world->par, own, other, clearance)) continue;
            append_parts(scratch, n, first ? i : l, first ? l : i, first ? q : polygon->part,
                         first ? polygon->part : q);
        }
    }
}

/// Append the boxes of the bodies of cell k to the n present ones; returns the new number.
static size_t add_boxes(const bt_world *world, bt_idx k, bt_pair_scratch *scratch, size_t n)
{
    if (k < 0) return n;
    const bt_cell *cell = &world->cells->cell[k];
    const size_t most = n + (size_t)(cell->end - cell->first);
    if (most > scratch->cap_boxes) {
        scratch->cap_boxes = 2 * most;
        scratch->box = bt_realloc(scratch->box, N_BOX * scratch->cap_boxes, sizeof *scratch->box);
        scratch->body = bt_realloc(scratch->body, scratch->cap_boxes, sizeof *scratch->body);
    }
    for (bt_idx i = cell->first; i < cell->end; i++, n++) {
        scratch->body[n] = i;
        box_of(&world->bodies, i, scratch->box + N_BOX * n);
    }
    return n;
}

/// Bodies [begin, end) of the scratch.
typedef struct { size_t begin, end; } boxes;

/// Box about several boxes, and about the centroid of the first.
static void box_about(const bt_params *par, const bt_pair_scratch *scratch, boxes group, double box[N_BOX])
{
    const double *first = scratch->box + N_BOX * group.begin;
    box[X] = first[X], box[Y] = first[Y];
    box[LOW_X] = box[LOW_Y] = INFINITY;
    box[HIGH_X] = box[HIGH_Y] = -INFINITY;
    for (size_t i = group.begin; i < group.end; i++) {
        const double *b = scratch->box + N_BOX * i;
        const double dx = bt_nearest_image(b[X] - box[X], par->period_x),
                     dy = bt_nearest_image(b[Y] - box[Y], par->period_y);
        box[LOW_X] = bt_min(dx + b[LOW_X], box[LOW_X]); // ignores a NaN
        box[LOW_Y] = bt_min(dy + b[LOW_Y], box[LOW_Y]);
        box[HIGH_X] = bt_max(dx + b[HIGH_X], box[HIGH_X]);
        box[HIGH_Y] = bt_max(dy + b[HIGH_Y], box[HIGH_Y]);
    }
}

static void swap_boxes(bt_pair_scratch *scratch, size_t i, size_t j)
{
    const bt_idx body = scratch->body[i];
    scratch->body[i] = scratch->body[j], scratch->body[j] = body;
    for (int k = 0; k < N_BOX; k++) {
        const double x = scratch->box[N_BOX * i + (size_t)k];
        scratch->box[N_BOX * i + (size_t)k] = scratch->box[N_BOX * j + (size_t)k];
        scratch->box[N_BOX * j + (size_t)k] = x;
    }
}

/// The members of `group` whose boxes come within clearance of another box; they are moved to the front.
static boxes in_front(const bt_params *par, bt_pair_scratch *scratch, boxes group, const double *box, double clearance)
{
    size_t end = group.begin;
    for (size_t i = group.begin; i < group.end; i++)
        if (near(par, box, scratch->box + N_BOX * i, clearance)) swap_boxes(scratch, end++, i);
    return (boxes){group.begin, end};
}

static void among(const bt_world *world, bt_pair_scratch *scratch, boxes group, double clearance, size_t *n)
{
    for (size_t i = group.begin; i < group.end; i++)
        for (size_t j = i + 1; j < group.end; j++)
            if (near(&world->par, scratch->box + N_BOX * i, scratch->box + N_BOX * j, clearance))
                append(world, scratch, n, scratch->body[i], scratch->body[j], clearance);
}

/// Is the nearest image of two bodies in neighbouring cells unique? They are at most three sides apart.
static bool one_image(int32_t wrap) { return wrap == 0 || wrap >= 8; }

/// Append pairs of a body in each of two cells. Few of either are near the border: first find those near the box about
/// the whole other cell, with some room for the rounding of that box.
static void between(const bt_world *world, bt_pair_scratch *scratch, boxes p, boxes q, double clearance, size_t *n)
{
    const bt_cells *ts = world->cells;
    if (p.begin == p.end || q.begin == q.end) return;
    if (one_image(ts->wrap_x) && one_image(ts->wrap_y)) {
        const double wide = clearance + 0.05 * world->par.size;
        double box[N_BOX];
        box_about(&world->par, scratch, p, box);
        q = in_front(&world->par, scratch, q, box, wide);
        if (q.begin == q.end) return;
        box_about(&world->par, scratch, q, box);
        p = in_front(&world->par, scratch, p, box, wide);
    }
    for (size_t i = p.begin; i < p.end; i++)
        for (size_t j = q.begin; j < q.end; j++)
            if (near(&world->par, scratch->box + N_BOX * i, scratch->box + N_BOX * j, clearance))
                append(world, scratch, n, scratch->body[i], scratch->body[j], clearance);
}

static size_t pairs_of_block(const bt_world *world, const bt_cell *cell, bt_idx k, double clearance,
                             double clearance_large, bt_pair_scratch *scratch)
{
    const bt_cells *ts = world->cells;
    const bt_bodies *bodies = &world->bodies;
    size_t n = 0;
    const boxes own = {0, add_boxes(world, k, scratch, 0)},
                right = {own.end, add_boxes(world, cell->right, scratch, own.end)},
                above = {right.end, add_boxes(world, cell->above, scratch, right.end)},
                diagonal = {above.end, add_boxes(world, cell->diagonal, scratch, above.end)};
    among(world, scratch, own, clearance, &n);
    between(world, scratch, own, right, clearance, &n);
    between(world, scratch, own, above, clearance, &n);
    between(world, scratch, own, diagonal, clearance, &n);
    between(world, scratch, right, above, clearance, &n);
    for (bt_idx l = ts->n_in_cells; l < bodies->n; l++) {
        if (bodies->motion[l] == BT_DYNAMIC || bt_shore_holds(world, l)) continue;
        double box[N_BOX];
        box_of(bodies, l, box);
        for (size_t i = own.begin; i < own.end; i++)
            if (near(&world->par, box, scratch->box + N_BOX * i, clearance_large))
                append(world, scratch, &n, l, scratch->body[i], clearance_large);
    }
    for (size_t i = own.begin; i < own.end; i++)
        append_shore(world, scratch, &n, scratch->body[i], scratch->box + N_BOX * i, clearance_large);
    return n;
}

/// Row or column of cells at a distance, m, from their corner; a body may be farther off than 32-bit cell coordinates
/// reach.
static int32_t line_at(double distance, double side)
{
    const double fence = 1e9;
    return (int32_t)bt_max(-fence, bt_min(fence, floor(distance / side)));
}

bt_cell_range bt_pairs_range(const bt_world *world, bt_idx i, double pad)
{
    const bt_cells *cells = world->cells;
    double box[N_BOX];
    box_of(&world->bodies, i, box);
    const double x = box[X] - cells->x0, y = box[Y] - cells->y0;
    bt_cell_range range = {
        .x0 = line_at(x + box[LOW_X] - pad, cells->side_x), .x1 = line_at(x + box[HIGH_X] + pad, cells->side_x),
        .y0 = line_at(y + box[LOW_Y] - pad, cells->side_y), .y1 = line_at(y + box[HIGH_Y] + pad, cells->side_y),
    };
    // Only existing cells, and each of them once.
    if (cells->wrap_x && range.x1 - range.x0 >= cells->wrap_x - 1) range.x0 = 0, range.x1 = cells->wrap_x - 1;
    if (cells->wrap_y && range.y1 - range.y0 >= cells->wrap_y - 1) range.y0 = 0, range.y1 = cells->wrap_y - 1;
    if (cells->wrap_x == 1) range.x0 = range.x1 = 0;
    if (cells->wrap_y == 1) range.y0 = range.y1 = 0;
    if (!cells->wrap_x)
        range.x0 = range.x0 > cells->low_x - 2 ? range.x0 : cells->low_x - 2,
        range.x1 = range.x1 < cells->low_x + cells->n_x + 1 ? range.x1 : cells->low_x + cells->n_x + 1;
    if (!cells->wrap_y)
        range.y0 = range.y0 > cells->low_y - 2 ? range.y0 : cells->low_y - 2,
        range.y1 = range.y1 < cells->low_y + cells->n_y + 1 ? range.y1 : cells->low_y + cells->n_y + 1;
    return range;
}

static size_t pairs_of_large(const bt_world *world, double clearance_small, double clearance_large,
                             bt_pair_scratch *scratch)
{
    const bt_cells *ts = world->cells;
    const bt_bodies *bodies = &world->bodies;
    size_t n = 0;
    for (bt_idx l = ts->n_in_cells; l < bodies->n; l++) {
        if (bt_shore_holds(world, l)) continue;
        double box[N_BOX];
        box_of(bodies, l, box);
        append_shore(world, scratch, &n, l, box, clearance_large);
        for (bt_idx o = l + 1; o < bodies->n; o++) {
            if (bt_shore_holds(world, o)) continue;
            double other[N_BOX];
            box_of(bodies, o, other);
            if (near(&world->par, box, other, clearance_large)) append(world, scratch, &n, l, o, clearance_large);
        }
        if (bodies->motion[l] != BT_DYNAMIC) continue;
        const bt_cell_range range = bt_pairs_range(world, l, clearance_small + ts->max_radius + ts->allowance);
        for (int32_t y = range.y0; y <= range.y1; y++)
            for (int32_t x = range.x0; x <= range.x1; x++) {
                const bt_idx k = bt_cells_at(ts, x, y);
                if (world->exchange) world->exchange->need(world, x, y);
                if (k < 0) continue;
                const size_t end = add_boxes(world, k, scratch, 0);
                for (size_t i = 0; i < end; i++)
                    if (near(&world->par, box, scratch->box + N_BOX * i, clearance_small))
                        append(world, scratch, &n, l, scratch->body[i], clearance_small);
            }
    }
    return n;
}

static bt_named name_of(const bt_gid *gid, const bt_pair *pair, size_t at)
{
    return (bt_named){gid[pair->a], gid[pair->b], (uint32_t)pair->part[0] << 16 | pair->part[1], (uint32_t)at};
}

/// Replace the list, keeping the data of pairs that stay: both lists are sorted, so one pass matches them.
static void replace(bt_world *world, bt_cell *cell, bt_pair_scratch *scratch, size_t n)
{
    const bt_gid *gid = world->bodies.gid;
    bt_pair_search *of = &cell->search;
    if (n > scratch->cap_names)
        scratch->name = bt_realloc(scratch->name, 2 * (scratch->cap_names = 2 * n), sizeof *scratch->name);
    for (size_t i = 0; i < n; i++) scratch->name[i] = name_of(gid, &scratch->found[i], i);
    bt_named_sort(scratch->name, scratch->name + scratch->cap_names, n);
    bt_pair *list = bt_realloc(NULL, n, sizeof *list);
    bt_idx k = 0;
    for (size_t i = 0; i < n; i++) {
        bt_named old = {0};
        while (k < of->n_pairs && (old = name_of(gid, &of->pairs[k], 0), bt_named_before(&old, &scratch->name[i]))) k++;
        const bool stays = k < of->n_pairs && !bt_named_before(&scratch->name[i], &old);
        list[i] = stays ? of->pairs[k] : scratch->found[scratch->name[i].at];
    }
    free(of->pairs);
    of->pairs = list;
    of->n_pairs = of->cap_pairs = (bt_idx)n;
}

/// Path lengths, m, of the bodies in the pairs of cell k: of its four cells, or of any cell for the last one; and of
/// large bodies.
static void paths_of(const bt_world *world, bt_idx k, const bt_cell *cell, double moved[4], double *large)
{
    const bt_cells *ts = world->cells;
    const bool last = k == ts->n - 1;
    const bt_idx block[4] = {k, cell->right, cell->above, cell->diagonal};
    for (int i = 0; i < 4; i++) moved[i] = last ? ts->moved_any : block[i] >= 0 ? ts->moved[block[i]] : 0;
    *large = ts->moved[ts->n - 1];
}

double bt_pairs_near_gap(const bt_world *world) { return 0.05 * world->par.size; }

bool bt_pairs_near(const bt_world *world, bt_idx k, bt_cell *cell, double margin)
{
    double moved[4], large, most;
    paths_of(world, k, cell, moved, &large);
    most = large - cell->search.large_near;
    for (int i = 0; i < 4; i++) most = bt_max(most, moved[i] - cell->search.moved_near[i]);
    // One per cent is left for the rounding of sums of paths.
    if (cell->search.near_known && 2 * most + margin - cell->search.margin_near <= 0.99 * bt_pairs_near_gap(world))
        return true;
    memcpy(cell->search.moved_near, moved, sizeof moved);
    cell->search.large_near = large;
    cell->search.margin_near = margin;
    cell->search.n_near = 0;
    cell->search.near_known = true;
    return false;
}

void bt_pairs_add_near(bt_cell *cell, bt_idx i)
{
    if (cell->search.n_near == cell->search.cap_near) {
        cell->search.cap_near += cell->search.cap_near / 8 + 4;
        cell->search.near = bt_realloc(cell->search.near, (size_t)cell->search.cap_near, sizeof *cell->search.near);
    }
    cell->search.near[cell->search.n_near++] = i;
}

void bt_pairs_update(bt_world *world, bt_idx k, bt_cell *cell, double margin, bt_pair_scratch *scratch)
{
    bt_cells *ts = world->cells;
    const bool last = k == ts->n - 1;
    const double skin = 0.2 * world->par.size, skin_large = world->par.size;
    double moved[4], large_moved;
    paths_of(world, k, cell, moved, &large_moved);
    bool stale = !cell->search.listed || margin > cell->search.margin_listed ||
                 large_moved - cell->search.large_listed > 0.5 * skin_large;
    for (int i = 0; i < 4 && !stale; i++) stale = moved[i] - cell->search.moved_listed[i] > 0.5 * skin;
    if (!stale) return;
    const double large = margin + 0.5 * skin + 0.5 * skin_large;
    const size_t n =
        last ? pairs_of_large(world, large, margin + skin_large, scratch)
             : pairs_of_block(world, cell, k, margin + skin, large, scratch);
    replace(world, cell, scratch, n);
    cell->search.listed = true;
    cell->search.margin_listed = margin;
    cell->search.near_known = false;
    cell->search.large_listed = large_moved;
    memcpy(cell->search.moved_listed, moved, sizeof moved);
}
