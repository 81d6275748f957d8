// SPDX-License-Identifier: MIT
// Broad phase: the list of a cell's pairs near enough to be looked at, kept over many steps.
//
// Boxes of the bodies of a cell are compared all with all, and with those of the cells beside it where both come near
// the border; a cell has some dozens, and comparing boxes that lie in a row in memory is quicker than any finer grid.
// The list holds while no body of the block has travelled (path of its fastest point) farther than its share of the
// clearance; then it is made anew. A large body that cannot be moved (a wall, a berg at a set speed) pairs with the
// floes of the cell itself; one that can be moved has its pairs in the last cell. Shores have a tree of their own
// (shore.h).
//
// Few pairs of a list are nearer than a twentieth of a floe beyond the margin. Until bodies of the block have moved so
// far towards each other, a step looks at these near ones alone.
#include "space/pairs.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "body/bodies.h"

enum { X, Y, LOW_X, LOW_Y, HIGH_X, HIGH_Y, N_BOX };

void bt_pair_scratch_free(bt_pair_scratch *s)
{
    free(s->box);
    free(s->body);
    free(s->found);
    free(s->name);
    free(s->shore.found);
    *s = (bt_pair_scratch){0};
}

/// Box of n vertices of body i, from its vertex `part` on.
static void box_of_part(const bt_bodies *b, bt_idx i, int part, int n, double box[N_BOX])
{
    box[X] = b->pose[i].x;
    box[Y] = b->pose[i].y;
    box[LOW_X] = box[LOW_Y] = INFINITY;
    box[HIGH_X] = box[HIGH_Y] = -INFINITY;
    for (int k = part; k < part + n; k++) {
        const double *v = b->outline + 2 * (b->offset[i] + k);
        box[LOW_X] = bt_min(box[LOW_X], v[0]);
        box[LOW_Y] = bt_min(box[LOW_Y], v[1]);
        box[HIGH_X] = bt_max(box[HIGH_X], v[0]);
        box[HIGH_Y] = bt_max(box[HIGH_Y], v[1]);
    }
}

static void box_of(const bt_bodies *b, bt_idx i, double box[N_BOX])
{
    box_of_part(b, i, 0, (int)(b->offset[i + 1] - b->offset[i]), box);
}

/// Do two boxes come within clearance? With periodic images a long wall can reach round: its box is compared at the
/// nearest image of the centroids, which holds for bodies shorter than half a period, and for walls that span the whole
/// period.
static inline bool near(const bt_params *p, const double *a, const double *b, double clearance)
{
    const double dx = bt_nearest_image(b[X] - a[X], p->period_x), dy = bt_nearest_image(b[Y] - a[Y], p->period_y);
    return (b[LOW_X] + dx - a[HIGH_X] <= clearance) & (a[LOW_X] - b[HIGH_X] - dx <= clearance) &
           (b[LOW_Y] + dy - a[HIGH_Y] <= clearance) & (a[LOW_Y] - b[HIGH_Y] - dy <= clearance);
}

static void append_parts(bt_pair_scratch *s, size_t *n, bt_idx a, bt_idx b, int part_a, int part_b)
{
    if (*n == s->cap_found)
        s->found = bt_realloc(s->found, s->cap_found = s->cap_found ? 2 * s->cap_found : 256, sizeof *s->found);
    s->found[(*n)++] = (bt_pair){.a = a, .b = b, .contact = -1, .part = {(uint16_t)part_a, (uint16_t)part_b},
                                 .axes = BT_NO_AXES};
}

/// Bodies i and j, whose boxes come within clearance; where one of them is not convex, those of its parts that do.
static void append(const bt_world *w, bt_pair_scratch *s, size_t *n, bt_idx i, bt_idx j, double clearance)
{
    const bt_bodies *bd = &w->bodies;
    if (bd->motion[i] != BT_DYNAMIC && bd->motion[j] != BT_DYNAMIC) return;
    const bool ordered = bd->gid[i] < bd->gid[j];
    const bt_idx a = ordered ? i : j, b = ordered ? j : i;
    const int first_a = bt_part_first(bd, a), first_b = bt_part_first(bd, b);
    if (first_a == 0 && first_b == 0) {
        append_parts(s, n, a, b, 0, 0);
        return;
    }
    for (int p = first_a; p >= 0; p = bt_part_next(bd, a, p)) {
        double box[N_BOX];
        box_of_part(bd, a, p, bd->mark[bd->offset[a] + p].count, box);
        for (int q = first_b; q >= 0; q = bt_part_next(bd, b, q)) {
            double other[N_BOX];
            box_of_part(bd, b, q, bd->mark[bd->offset[b] + q].count, other);
            if (near(&w->par, box, other, clearance)) append_parts(s, n, a, b, p, q);
        }
    }
}

/// Body i, whose box this is, and the polygons of shores whose boxes come within clearance of it.
static void append_shore(const bt_world *w, bt_pair_scratch *s, size_t *n, bt_idx i, const double *box,
                         double clearance)
{
    const bt_bodies *b = &w->bodies;
    if (!w->shore || b->motion[i] != BT_DYNAMIC) return;
    const double low[2] = {box[X] + box[LOW_X] - clearance, box[Y] + box[LOW_Y] - clearance},
                 high[2] = {box[X] + box[HIGH_X] + clearance, box[Y] + box[HIGH_Y] + clearance};
    bt_shore_near(w, box[X], box[Y], low, high, &s->shore);
    for (size_t k = 0; k < s->shore.n; k++) {
        const bt_shore_polygon *p = &s->shore.found[k];
        const bt_idx l = bt_world_index(w, p->gid);
        const bool first = b->gid[i] < p->gid;
        double other[N_BOX];
        box_of_part(b, l, p->part, p->count, other);
        for (int q = bt_part_first(b, i); q >= 0; q = bt_part_next(b, i, q)) {
            double own[N_BOX];
            box_of_part(b, i, q, b->mark[b->offset[i] + q].count, own);
            if (!near(&w->par, own, other, clearance)) continue;
            append_parts(s, n, first ? i : l, first ? l : i, first ? q : p->part, first ? p->part : q);
        }
    }
}

/// Boxes of the bodies of cell k, after those there are; returns their number then.
static size_t add_boxes(const bt_world *w, bt_idx k, bt_pair_scratch *s, size_t n)
{
    if (k < 0) return n;
    const bt_cell *t = &w->cells->cell[k];
    const size_t most = n + (size_t)(t->end - t->first);
    if (most > s->cap_boxes) {
        s->cap_boxes = 2 * most;
        s->box = bt_realloc(s->box, N_BOX * s->cap_boxes, sizeof *s->box);
        s->body = bt_realloc(s->body, s->cap_boxes, sizeof *s->body);
    }
    for (bt_idx i = t->first; i < t->end; i++, n++) {
        s->body[n] = i;
        box_of(&w->bodies, i, s->box + N_BOX * n);
    }
    return n;
}

/// Bodies [i0, i1) of the scratch.
typedef struct { size_t begin, end; } boxes;

/// Box about several boxes, and about the centroid of the first.
static void box_about(const bt_params *p, const bt_pair_scratch *s, boxes r, double box[N_BOX])
{
    const double *first = s->box + N_BOX * r.begin;
    box[X] = first[X], box[Y] = first[Y];
    box[LOW_X] = box[LOW_Y] = INFINITY;
    box[HIGH_X] = box[HIGH_Y] = -INFINITY;
    for (size_t i = r.begin; i < r.end; i++) {
        const double *b = s->box + N_BOX * i;
        const double dx = bt_nearest_image(b[X] - box[X], p->period_x),
                     dy = bt_nearest_image(b[Y] - box[Y], p->period_y);
        box[LOW_X] = bt_min(dx + b[LOW_X], box[LOW_X]); // passes over a NaN
        box[LOW_Y] = bt_min(dy + b[LOW_Y], box[LOW_Y]);
        box[HIGH_X] = bt_max(dx + b[HIGH_X], box[HIGH_X]);
        box[HIGH_Y] = bt_max(dy + b[HIGH_Y], box[HIGH_Y]);
    }
}

static void swap_boxes(bt_pair_scratch *s, size_t i, size_t j)
{
    const bt_idx body = s->body[i];
    s->body[i] = s->body[j], s->body[j] = body;
    for (int k = 0; k < N_BOX; k++) {
        const double x = s->box[N_BOX * i + (size_t)k];
        s->box[N_BOX * i + (size_t)k] = s->box[N_BOX * j + (size_t)k];
        s->box[N_BOX * j + (size_t)k] = x;
    }
}

/// Those of r whose boxes come within clearance of another box, which are put in front of the others.
static boxes in_front(const bt_params *p, bt_pair_scratch *s, boxes r, const double *box, double clearance)
{
    size_t end = r.begin;
    for (size_t i = r.begin; i < r.end; i++)
        if (near(p, box, s->box + N_BOX * i, clearance)) swap_boxes(s, end++, i);
    return (boxes){r.begin, end};
}

static void among(const bt_world *w, bt_pair_scratch *s, boxes r, double clearance, size_t *n)
{
    for (size_t i = r.begin; i < r.end; i++)
        for (size_t j = i + 1; j < r.end; j++)
            if (near(&w->par, s->box + N_BOX * i, s->box + N_BOX * j, clearance))
                append(w, s, n, s->body[i], s->body[j], clearance);
}

/// Do bodies of cells side by side, at most three sides apart with what they stand outside, have one nearest image?
static bool one_image(int32_t wrap) { return wrap == 0 || wrap >= 8; }

/// Pairs of a body of one cell and one of the other. Few of either are near the border: first those are found that come
/// near the box about all of the other cell, with some room for the rounding of that box.
static void between(const bt_world *w, bt_pair_scratch *s, boxes p, boxes q, double clearance, size_t *n)
{
    const bt_cells *ts = w->cells;
    if (p.begin == p.end || q.begin == q.end) return;
    if (one_image(ts->wrap_x) && one_image(ts->wrap_y)) {
        const double wide = clearance + 0.05 * w->par.size;
        double box[N_BOX];
        box_about(&w->par, s, p, box);
        q = in_front(&w->par, s, q, box, wide);
        if (q.begin == q.end) return;
        box_about(&w->par, s, q, box);
        p = in_front(&w->par, s, p, box, wide);
    }
    for (size_t i = p.begin; i < p.end; i++)
        for (size_t j = q.begin; j < q.end; j++)
            if (near(&w->par, s->box + N_BOX * i, s->box + N_BOX * j, clearance))
                append(w, s, n, s->body[i], s->body[j], clearance);
}

static size_t pairs_of_block(const bt_world *w, const bt_cell *t, bt_idx k, double clearance, double clearance_large,
                             bt_pair_scratch *s)
{
    const bt_cells *ts = w->cells;
    const bt_bodies *b = &w->bodies;
    size_t n = 0;
    const boxes own = {0, add_boxes(w, k, s, 0)}, right = {own.end, add_boxes(w, t->right, s, own.end)},
                above = {right.end, add_boxes(w, t->above, s, right.end)},
                diagonal = {above.end, add_boxes(w, t->diagonal, s, above.end)};
    among(w, s, own, clearance, &n);
    between(w, s, own, right, clearance, &n);
    between(w, s, own, above, clearance, &n);
    between(w, s, own, diagonal, clearance, &n);
    between(w, s, right, above, clearance, &n);
    for (bt_idx l = ts->n_in_cells; l < b->n; l++) {
        if (b->motion[l] == BT_DYNAMIC || bt_shore_holds(w, l)) continue;
        double box[N_BOX];
        box_of(b, l, box);
        for (size_t i = own.begin; i < own.end; i++)
            if (near(&w->par, box, s->box + N_BOX * i, clearance_large))
                append(w, s, &n, l, s->body[i], clearance_large);
    }
    for (size_t i = own.begin; i < own.end; i++)
        append_shore(w, s, &n, s->body[i], s->box + N_BOX * i, clearance_large);
    return n;
}

/// Row or column of cells at a distance from their corner, m; a body may be farther off than cells can be counted.
static int32_t line_at(double distance, double side)
{
    const double fence = 1e9;
    return (int32_t)bt_max(-fence, bt_min(fence, floor(distance / side)));
}

bt_cell_range bt_pairs_range(const bt_world *w, bt_idx i, double pad)
{
    const bt_cells *t = w->cells;
    double box[N_BOX];
    box_of(&w->bodies, i, box);
    const double x = box[X] - t->x0, y = box[Y] - t->y0;
    bt_cell_range r = {
        .x0 = line_at(x + box[LOW_X] - pad, t->side_x), .x1 = line_at(x + box[HIGH_X] + pad, t->side_x),
        .y0 = line_at(y + box[LOW_Y] - pad, t->side_y), .y1 = line_at(y + box[HIGH_Y] + pad, t->side_y),
    };
    // Within the cells there are, and each of them once.
    if (t->wrap_x && r.x1 - r.x0 >= t->wrap_x - 1) r.x0 = 0, r.x1 = t->wrap_x - 1;
    if (t->wrap_y && r.y1 - r.y0 >= t->wrap_y - 1) r.y0 = 0, r.y1 = t->wrap_y - 1;
    if (t->wrap_x == 1) r.x0 = r.x1 = 0;
    if (t->wrap_y == 1) r.y0 = r.y1 = 0;
    if (!t->wrap_x)
        r.x0 = r.x0 > t->low_x - 2 ? r.x0 : t->low_x - 2,
        r.x1 = r.x1 < t->low_x + t->n_x + 1 ? r.x1 : t->low_x + t->n_x + 1;
    if (!t->wrap_y)
        r.y0 = r.y0 > t->low_y - 2 ? r.y0 : t->low_y - 2,
        r.y1 = r.y1 < t->low_y + t->n_y + 1 ? r.y1 : t->low_y + t->n_y + 1;
    return r;
}

static size_t pairs_of_large(const bt_world *w, double clearance_small, double clearance_large, bt_pair_scratch *s)
{
    const bt_cells *ts = w->cells;
    const bt_bodies *b = &w->bodies;
    size_t n = 0;
    for (bt_idx l = ts->n_in_cells; l < b->n; l++) {
        if (bt_shore_holds(w, l)) continue;
        double box[N_BOX];
        box_of(b, l, box);
        append_shore(w, s, &n, l, box, clearance_large);
        for (bt_idx o = l + 1; o < b->n; o++) {
            if (bt_shore_holds(w, o)) continue;
            double other[N_BOX];
            box_of(b, o, other);
            if (near(&w->par, box, other, clearance_large)) append(w, s, &n, l, o, clearance_large);
        }
        if (b->motion[l] != BT_DYNAMIC) continue;
        const bt_cell_range r = bt_pairs_range(w, l, clearance_small + ts->reach + ts->allowance);
        for (int32_t y = r.y0; y <= r.y1; y++)
            for (int32_t x = r.x0; x <= r.x1; x++) {
                const bt_idx k = bt_cells_at(ts, x, y);
                if (k < 0) continue;
                const size_t end = add_boxes(w, k, s, 0);
                for (size_t i = 0; i < end; i++)
                    if (near(&w->par, box, s->box + N_BOX * i, clearance_small))
                        append(w, s, &n, l, s->body[i], clearance_small);
            }
    }
    return n;
}

static bt_named name_of(const bt_gid *gid, const bt_pair *p, size_t at)
{
    return (bt_named){gid[p->a], gid[p->b], (uint32_t)p->part[0] << 16 | p->part[1], (uint32_t)at};
}

/// What the old list knew of the pairs that stay: both lists are sorted, one walk matches them.
static void replace(bt_world *w, bt_cell *t, bt_pair_scratch *s, size_t n)
{
    const bt_gid *gid = w->bodies.gid;
    bt_pair_search *of = &t->search;
    if (n > s->cap_names) s->name = bt_realloc(s->name, 2 * (s->cap_names = 2 * n), sizeof *s->name);
    for (size_t i = 0; i < n; i++) s->name[i] = name_of(gid, &s->found[i], i);
    bt_named_sort(s->name, s->name + s->cap_names, n);
    bt_pair *list = bt_realloc(NULL, n, sizeof *list);
    bt_idx k = 0;
    for (size_t i = 0; i < n; i++) {
        bt_named old = {0};
        while (k < of->n_pairs && (old = name_of(gid, &of->pairs[k], 0), bt_named_before(&old, &s->name[i]))) k++;
        const bool stays = k < of->n_pairs && !bt_named_before(&s->name[i], &old);
        list[i] = stays ? of->pairs[k] : s->found[s->name[i].at];
    }
    free(of->pairs);
    of->pairs = list;
    of->n_pairs = of->cap_pairs = (bt_idx)n;
}

/// What moves the bodies of the pairs of cell k, m: of its four cells, or of any for the last one; and large bodies.
static void paths_of(const bt_world *w, bt_idx k, const bt_cell *t, double moved[4], double *large)
{
    const bt_cells *ts = w->cells;
    const bool last = k == ts->n - 1;
    const bt_idx block[4] = {k, t->right, t->above, t->diagonal};
    for (int i = 0; i < 4; i++) moved[i] = last ? ts->moved_any : block[i] >= 0 ? ts->moved[block[i]] : 0;
    *large = ts->moved[ts->n - 1];
}

double bt_pairs_near_gap(const bt_world *w) { return 0.05 * w->par.size; }

bool bt_pairs_near(const bt_world *w, bt_idx k, bt_cell *t, double margin)
{
    double moved[4], large, most;
    paths_of(w, k, t, moved, &large);
    most = large - t->search.large_near;
    for (int i = 0; i < 4; i++) most = bt_max(most, moved[i] - t->search.moved_near[i]);
    // A hundredth is for the rounding of sums of paths.
    if (t->search.near_known && 2 * most + margin - t->search.margin_near <= 0.99 * bt_pairs_near_gap(w)) return true;
    memcpy(t->search.moved_near, moved, sizeof moved);
    t->search.large_near = large;
    t->search.margin_near = margin;
    t->search.n_near = 0;
    t->search.near_known = true;
    return false;
}

void bt_pairs_add_near(bt_cell *t, bt_idx i)
{
    if (t->search.n_near == t->search.cap_near) {
        t->search.cap_near += t->search.cap_near / 8 + 4;
        t->search.near = bt_realloc(t->search.near, (size_t)t->search.cap_near, sizeof *t->search.near);
    }
    t->search.near[t->search.n_near++] = i;
}

void bt_pairs_update(bt_world *w, bt_idx k, bt_cell *t, double margin, bt_pair_scratch *s)
{
    bt_cells *ts = w->cells;
    const bool last = k == ts->n - 1;
    const double skin = 0.2 * w->par.size, skin_large = w->par.size;
    double moved[4], large_moved;
    paths_of(w, k, t, moved, &large_moved);
    bool stale = !t->search.listed || margin > t->search.margin_listed ||
                 large_moved - t->search.large_listed > 0.5 * skin_large;
    for (int i = 0; i < 4 && !stale; i++) stale = moved[i] - t->search.moved_listed[i] > 0.5 * skin;
    if (!stale) return;
    const double large = margin + 0.5 * skin + 0.5 * skin_large;
    const size_t n =
        last ? pairs_of_large(w, large, margin + skin_large, s) : pairs_of_block(w, t, k, margin + skin, large, s);
    replace(w, t, s, n);
    t->search.listed = true;
    t->search.margin_listed = margin;
    t->search.near_known = false;
    t->search.large_listed = large_moved;
    memcpy(t->search.moved_listed, moved, sizeof moved);
}
