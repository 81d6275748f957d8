// SPDX-License-Identifier: MIT
// Storage of the bodies: growth, outlines and parts of a new one.
#include "body/bodies.h"
#include "base/elementary.h"
#include "geometry/polygons.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

const bt_exposure bt_exposed = {1, 1, 1};

#define FIELD(name) {offsetof(bt_bodies, name), sizeof *((bt_bodies *)0)->name}
const bt_body_field bt_body_fields[] = {
    FIELD(vel),       FIELD(inv),  FIELD(pose),     FIELD(path),    FIELD(vel_start), FIELD(vel_free), FIELD(gid),
    FIELD(radius),    FIELD(area), FIELD(mass),     FIELD(inertia), FIELD(share),     FIELD(friction),
    FIELD(restitution), FIELD(thickness), FIELD(drag), FIELD(exposure), FIELD(motion), FIELD(large),
    FIELD(disturbed), FIELD(cell), FIELD(lap),      FIELD(home),
};
int bt_bodies_n_fields(const bt_bodies *b)
{
    return (int)(sizeof bt_body_fields / sizeof *bt_body_fields) - (b->home == NULL);
}

const bt_body_field bt_vertex_fields[] = {
    {offsetof(bt_bodies, vertices), 2 * sizeof(double)},
    {offsetof(bt_bodies, outline), 2 * sizeof(double)},
    FIELD(per_length),
    FIELD(mark),
};
const int bt_n_vertex_fields = sizeof bt_vertex_fields / sizeof *bt_vertex_fields;

void bt_bodies_free(bt_bodies *b)
{
    for (int k = 0; k < bt_bodies_n_fields(b); k++) free(*(void **)((char *)b + bt_body_fields[k].array));
    for (int k = 0; k < bt_n_vertex_fields; k++) free(*(void **)((char *)b + bt_vertex_fields[k].array));
    free(b->offset);
    free(b->index_of);
    free(b->gone);
}

void bt_bodies_reserve(bt_bodies *b, bt_idx n, int64_t n_vertices)
{
    if (n > b->cap) {
        const bt_idx cap = b->cap == 0 ? n : n > b->cap + b->cap / 4 ? n : b->cap + b->cap / 4;
        for (int k = 0; k < bt_bodies_n_fields(b); k++) {
            void **array = (void **)((char *)b + bt_body_fields[k].array), *old = *array;
            *array = bt_alloc_aligned((size_t)cap, bt_body_fields[k].size);
            if (old) memcpy(*array, old, (size_t)b->n * bt_body_fields[k].size);
            free(old);
        }
        b->offset = bt_realloc(b->offset, (size_t)cap + 1, sizeof *b->offset);
        b->cap = cap;
    }
    if (n_vertices > b->cap_vertices) {
        const int64_t more = b->cap_vertices + b->cap_vertices / 4, cap = n_vertices > more ? n_vertices : more;
        for (int k = 0; k < bt_n_vertex_fields; k++) {
            void **array = (void **)((char *)b + bt_vertex_fields[k].array);
            *array = bt_realloc(*array, (size_t)cap, bt_vertex_fields[k].size);
        }
        b->cap_vertices = cap;
    }
}

void bt_bodies_make_homes(bt_bodies *b) { b->home = bt_alloc_aligned((size_t)b->cap, sizeof *b->home); }

/// Marks and lengths of the n vertices of one polygon, from `first` on.
static void close_polygon(bt_bodies *b, int64_t first, int n)
{
    for (int k = 0; k < n; k++) {
        const double *p = b->vertices + 2 * (first + k), *q = b->vertices + 2 * (first + (k + 1) % n);
        b->per_length[first + k] = 1 / bt_hypot(q[0] - p[0], q[1] - p[1]);
        b->mark[first + k].count = 0;
    }
    b->mark[first].count = (uint8_t)n;
}

/// The convex hull of the outline of body i: its vertices are those that the hull of a copy has kept.
static void mark_hull(bt_bodies *b, bt_idx i, int n, bool convex)
{
    bt_mark *mark = b->mark + b->offset[i];
    const double *v = b->vertices + 2 * b->offset[i];
    for (int k = 0; k < n; k++) mark[k].next = (uint8_t)((k + 1) % n);
    if (convex) return;
    double hull[2 * BT_MAX_VERTICES];
    memcpy(hull, v, 2 * sizeof *v * (size_t)n);
    const int n_hull = bt_shape_hull(n, hull);
    int first = -1, last = -1;
    for (int k = 0; k < n; k++) {
        bool on = false;
        for (int j = 0; j < n_hull; j++) on = on || (hull[2 * j] == v[2 * k] && hull[2 * j + 1] == v[2 * k + 1]);
        mark[k].next = (uint8_t)k;
        if (!on) continue;
        if (last >= 0) mark[last].next = (uint8_t)k;
        else first = k;
        last = k;
    }
    mark[last].next = (uint8_t)first;
}

/// The outline of a new body i, and its parts.
static void add_polygons(bt_bodies *b, bt_idx i, const bt_body_def *d)
{
    int64_t at = b->offset[i];
    memcpy(b->vertices + 2 * at, d->vertices, 2 * sizeof(double) * (size_t)d->n_vertices);
    for (int k = 0; k < d->n_vertices; k++) b->mark[at + k].corner = (uint8_t)k;
    close_polygon(b, at, d->n_vertices);
    mark_hull(b, i, d->n_vertices, !d->parts);
    at += d->n_vertices;
    const bt_parts *p = d->parts;
    for (int j = 0, from = 0; p && j < p->n; from += p->count[j++], at = b->offset[i] + d->n_vertices + from) {
        for (int k = 0; k < p->count[j]; k++) {
            b->mark[at + k].corner = p->corner[from + k];
            memcpy(b->vertices + 2 * (at + k), d->vertices + 2 * p->corner[from + k], 2 * sizeof(double));
        }
        close_polygon(b, at, p->count[j]);
    }
}

/// Ids up to n_global + n have a place in index_of.
static void make_ids(bt_bodies *b, bt_gid n)
{
    if (b->n_global + n <= b->cap_global) return;
    b->cap_global = 2 * b->cap_global > b->n_global + n ? 2 * b->cap_global : b->n_global + n;
    b->index_of = bt_realloc(b->index_of, (size_t)b->cap_global, sizeof *b->index_of);
    b->gone = bt_realloc(b->gone, (size_t)b->cap_global, sizeof *b->gone);
}

void bt_bodies_skip(bt_bodies *b, bt_gid n)
{
    make_ids(b, n);
    for (bt_gid g = b->n_global; g < b->n_global + n; g++) b->index_of[g] = -1, b->gone[g] = 1;
    b->n_global += n;
    b->n_kept += n;
}

bt_gid bt_bodies_add(bt_bodies *b, const bt_body_def *d)
{
    make_ids(b, 1);
    const bt_gid gid = b->n_global++;
    bt_bodies_put(b, d, gid);
    return gid;
}

bt_idx bt_bodies_put(bt_bodies *b, const bt_body_def *d, bt_gid gid)
{
    assert(gid >= 0 && gid < b->n_global);
    assert(d->n_vertices >= 3 && d->n_vertices <= BT_MAX_VERTICES);
    assert(d->motion != BT_DYNAMIC || (d->mass > 0 && d->inertia > 0));
    int64_t first = b->offset[b->n];
    const int n_vertices = d->n_vertices + (d->parts ? d->parts->n_vertices : 0);
    bt_bodies_reserve(b, b->n + 1, first + n_vertices);
    const bt_idx i = b->n++;
    b->index_of[gid] = i;
    b->gone[gid] = 0;
    b->offset[i + 1] = first + n_vertices;
    add_polygons(b, i, d);
    bt_moments m = bt_shape_extent(d->n_vertices, d->vertices);
    b->gid[i] = gid;
    b->pose[i] = (bt_pose){.x = d->x, .y = d->y, .yaw = d->yaw};
    b->vel[i] = b->vel_start[i] = b->vel_free[i] =
        d->motion == BT_STATIC ? (bt_vel){0} : (bt_vel){.x = d->vx, .y = d->vy, .w = d->yaw_rate};
    b->inv[i] = d->motion == BT_DYNAMIC ? (bt_inv){1 / d->mass, 1 / d->inertia} : (bt_inv){0};
    b->path[i] = 0;
    b->radius[i] = m.radius;
    b->area[i] = m.area;
    b->mass[i] = d->mass;
    b->inertia[i] = d->inertia;
    b->share[i] = d->added > 0 ? 1 - d->added / d->mass : 1;
    b->friction[i] = d->friction;
    b->restitution[i] = d->restitution;
    b->thickness[i] = d->thickness;
    b->drag[i] = d->drag;
    b->exposure[i] = bt_exposed;
    b->motion[i] = (uint8_t)d->motion;
    b->large[i] = d->large;
    b->disturbed[i] = 1;
    b->cell[i][0] = b->cell[i][1] = 0;
    b->lap[i] = 0;
    bt_bodies_turn(b, i);
    return i;
}

void bt_bodies_compact(bt_bodies *b, const uint8_t *keep)
{
    bt_idx n = 0;
    for (bt_idx i = 0; i < b->n; i++) {
        if (!keep[i]) continue;
        if (n != i) {
            for (int k = 0; k < bt_bodies_n_fields(b); k++) {
                char *array = *(char **)((char *)b + bt_body_fields[k].array);
                const size_t size = bt_body_fields[k].size;
                memcpy(array + (size_t)n * size, array + (size_t)i * size, size);
            }
            const int64_t from = b->offset[i], to = b->offset[n], m = b->offset[i + 1] - from;
            for (int k = 0; k < bt_n_vertex_fields; k++) {
                char *array = *(char **)((char *)b + bt_vertex_fields[k].array);
                const size_t size = bt_vertex_fields[k].size;
                memmove(array + (size_t)to * size, array + (size_t)from * size, (size_t)m * size);
            }
            b->offset[n + 1] = to + m;
        }
        n++;
    }
    b->n = n;
}

void bt_bodies_turn(bt_bodies *b, bt_idx i)
{
    double s, c;
    bt_sincos(b->pose[i].yaw, &s, &c);
    for (int64_t k = b->offset[i]; k < b->offset[i + 1]; k++) {
        const double *v = b->vertices + 2 * k;
        b->outline[2 * k] = c * v[0] - s * v[1];
        b->outline[2 * k + 1] = s * v[0] + c * v[1];
    }
}

/// First convex polygon of n vertices (the outline, or its first part), and the one after it, −1 = none: as
/// bt_part_first.
static int64_t first_polygon(const bt_mark *mark, int64_t n) { return mark[0].count < n ? mark[0].count : 0; }
static int64_t next_polygon(const bt_mark *mark, int64_t n, int64_t at)
{
    return at + mark[at].count < n ? at + mark[at].count : -1;
}

double bt_bodies_depth(const bt_bodies *b, bt_idx i, const bt_mark *mark, const double *vertex, int64_t n, double dx,
                       double dy)
{
    const bt_mark *own = b->mark + b->offset[i];
    const double *own_vertex = b->outline + 2 * b->offset[i];
    const int64_t n_own = b->offset[i + 1] - b->offset[i];
    double deepest = 0;
    for (int64_t p = first_polygon(mark, n); p >= 0; p = next_polygon(mark, n, p))
        for (int64_t q = first_polygon(own, n_own); q >= 0; q = next_polygon(own, n_own, q))
            deepest = bt_max(deepest, -bt_apart_of(mark[p].count, vertex + 2 * p, own[q].count, own_vertex + 2 * q, dx,
                                                   dy).gap);
    return deepest;
}
