// SPDX-License-Identifier: MIT
// Storage of the bodies: growth, and outlines and parts of a new body.
#include "body/bodies.h"
#include "base/elementary.h"
#include "geometry/polygons.h"

#include <assert.h>
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
int bt_bodies_n_fields(const bt_bodies *bodies)
{
    return (int)(sizeof bt_body_fields / sizeof *bt_body_fields) - (bodies->home == NULL);
}

const bt_body_field bt_vertex_fields[] = {
    {offsetof(bt_bodies, vertices), 2 * sizeof(double)},
    {offsetof(bt_bodies, outline), 2 * sizeof(double)},
    FIELD(per_length),
    FIELD(mark),
};
const int bt_n_vertex_fields = sizeof bt_vertex_fields / sizeof *bt_vertex_fields;

void bt_bodies_free(bt_bodies *bodies)
{
    for (int k = 0; k < bt_bodies_n_fields(bodies); k++) free(*(void **)((char *)bodies + bt_body_fields[k].array));
    for (int k = 0; k < bt_n_vertex_fields; k++) free(*(void **)((char *)bodies + bt_vertex_fields[k].array));
    free(bodies->offset);
    free(bodies->index_of);
    free(bodies->gone);
}

void bt_bodies_reserve(bt_bodies *bodies, bt_idx n, int64_t n_vertices)
{
    if (n > bodies->cap) {
        const bt_idx cap = bodies->cap == 0 ? n : n > bodies->cap + bodies->cap / 4 ? n : bodies->cap + bodies->cap / 4;
        for (int k = 0; k < bt_bodies_n_fields(bodies); k++) {
            void **array = (void **)((char *)bodies + bt_body_fields[k].array), *old = *array;
            *array = bt_alloc_aligned((size_t)cap, bt_body_fields[k].size);
            if (old) memcpy(*array, old, (size_t)bodies->n * bt_body_fields[k].size);
            free(old);
        }
        bodies->offset = bt_realloc(bodies->offset, (size_t)cap + 1, sizeof *bodies->offset);
        bodies->cap = cap;
    }
    if (n_vertices > bodies->cap_vertices) {
        const int64_t more = bodies->cap_vertices + bodies->cap_vertices / 4,
                      cap = n_vertices > more ? n_vertices : more;
        for (int k = 0; k < bt_n_vertex_fields; k++) {
            void **array = (void **)((char *)bodies + bt_vertex_fields[k].array);
            *array = bt_realloc(*array, (size_t)cap, bt_vertex_fields[k].size);
        }
        bodies->cap_vertices = cap;
    }
}

void bt_bodies_make_homes(bt_bodies *bodies)
{
    bodies->home = bt_alloc_aligned((size_t)bodies->cap, sizeof *bodies->home);
}

/// Set the marks and edge lengths of the n vertices of one polygon, from `first` on.
static void close_polygon(bt_bodies *bodies, int64_t first, int n)
{
    for (int k = 0; k < n; k++) {
        const double *p = bodies->vertices + 2 * (first + k), *q = bodies->vertices + 2 * (first + (k + 1) % n);
        bodies->per_length[first + k] = 1 / bt_hypot(q[0] - p[0], q[1] - p[1]);
        bodies->mark[first + k].count = 0;
    }
    bodies->mark[first].count = (uint8_t)n;
}

/// Mark the convex hull of the outline of body i: the vertices left in the hull of a copy.
static void mark_hull(bt_bodies *bodies, bt_idx i, int n, bool convex)
{
    bt_mark *mark = bodies->mark + bodies->offset[i];
    const double *v = bodies->vertices + 2 * bodies->offset[i];
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

/// Add the outline of a new body i, and its parts.
static void add_polygons(bt_bodies *bodies, bt_idx i, const bt_body_def *def)
{
    int64_t at = bodies->offset[i];
    memcpy(bodies->vertices + 2 * at, def->vertices, 2 * sizeof(double) * (size_t)def->n_vertices);
    for (int k = 0; k < def->n_vertices; k++) bodies->mark[at + k].corner = (uint8_t)k;
    close_polygon(bodies, at, def->n_vertices);
    mark_hull(bodies, i, def->n_vertices, !def->parts);
    at += def->n_vertices;
    const bt_parts *parts = def->parts;
    for (int j = 0, from = 0; parts && j < parts->n; from += parts->count[j++],
         at = bodies->offset[i] + def->n_vertices + from) {
        for (int k = 0; k < parts->count[j]; k++) {
            bodies->mark[at + k].corner = parts->corner[from + k];
            memcpy(bodies->vertices + 2 * (at + k), def->vertices + 2 * parts->corner[from + k], 2 * sizeof(double));
        }
        close_polygon(bodies, at, parts->count[j]);
    }
}

/// Make room in index_of for ids below n_global + n.
static void make_ids(bt_bodies *bodies, bt_gid n)
{
    if (bodies->n_global + n <= bodies->cap_global) return;
    bodies->cap_global = 2 * bodies->cap_global > bodies->n_global + n ? 2 * bodies->cap_global : bodies->n_global + n;
    bodies->index_of = bt_realloc(bodies->index_of, (size_t)bodies->cap_global, sizeof *bodies->index_of);
    bodies->gone = bt_realloc(bodies->gone, (size_t)bodies->cap_global, sizeof *bodies->gone);
}

void bt_bodies_skip(bt_bodies *bodies, bt_gid n)
{
    make_ids(bodies, n);
    for (bt_gid g = bodies->n_global; g < bodies->n_global + n; g++) bodies->index_of[g] = -1, bodies->gone[g] = 1;
    bodies->n_global += n;
    bodies->n_kept += n;
}

bt_gid bt_bodies_add(bt_bodies *bodies, const bt_body_def *def)
{
    make_ids(bodies, 1);
    const bt_gid gid = bodies->n_global++;
    bt_bodies_put(bodies, def, gid);
    return gid;
}

bt_idx bt_bodies_put(bt_bodies *bodies, const bt_body_def *def, bt_gid gid)
{
    assert(gid >= 0 && gid < bodies->n_global);
    assert(def->n_vertices >= 3 && def->n_vertices <= BT_MAX_VERTICES);
    assert(def->motion != BT_DYNAMIC || (def->mass > 0 && def->inertia > 0));
    int64_t first = bodies->offset[bodies->n];
    const int n_vertices = def->n_vertices + (def->parts ? def->parts->n_vertices : 0);
    bt_bodies_reserve(bodies, bodies->n + 1, first + n_vertices);
    const bt_idx i = bodies->n++;
    bodies->index_of[gid] = i;
    bodies->gone[gid] = 0;
    bodies->offset[i + 1] = first + n_vertices;
    add_polygons(bodies, i, def);
    bt_moments moments = bt_shape_area_moments(def->n_vertices, def->vertices);
    bodies->gid[i] = gid;
    bodies->pose[i] = (bt_pose){.x = def->x, .y = def->y, .yaw = def->yaw};
    bodies->vel[i] = bodies->vel_start[i] = bodies->vel_free[i] =
        def->motion == BT_STATIC ? (bt_vel){0} : (bt_vel){.x = def->vx, .y = def->vy, .w = def->yaw_rate};
    bodies->inv[i] = def->motion == BT_DYNAMIC ? (bt_inv){1 / def->mass, 1 / def->inertia} : (bt_inv){0};
    bodies->path[i] = 0;
    bodies->radius[i] = moments.radius;
    bodies->area[i] = moments.area;
    bodies->mass[i] = def->mass;
    bodies->inertia[i] = def->inertia;
    bodies->share[i] = def->added > 0 ? 1 - def->added / def->mass : 1;
    bodies->friction[i] = def->friction;
    bodies->restitution[i] = def->restitution;
    bodies->thickness[i] = def->thickness;
    bodies->drag[i] = def->drag;
    bodies->exposure[i] = bt_exposed;
    bodies->motion[i] = (uint8_t)def->motion;
    bodies->large[i] = def->large;
    bodies->disturbed[i] = 1;
    bodies->cell[i][0] = bodies->cell[i][1] = 0;
    bodies->lap[i] = 0;
    bt_bodies_turn(bodies, i);
    return i;
}

void bt_bodies_compact(bt_bodies *bodies, const uint8_t *keep)
{
    bt_idx n = 0;
    for (bt_idx i = 0; i < bodies->n; i++) {
        if (!keep[i]) continue;
        if (n != i) {
            for (int k = 0; k < bt_bodies_n_fields(bodies); k++) {
                char *array = *(char **)((char *)bodies + bt_body_fields[k].array);
                const size_t size = bt_body_fields[k].size;
                memcpy(array + (size_t)n * size, array + (size_t)i * size, size);
            }
            const int64_t from = bodies->offset[i], to = bodies->offset[n], m = bodies->offset[i + 1] - from;
            for (int k = 0; k < bt_n_vertex_fields; k++) {
                char *array = *(char **)((char *)bodies + bt_vertex_fields[k].array);
                const size_t size = bt_vertex_fields[k].size;
                memmove(array + (size_t)to * size, array + (size_t)from * size, (size_t)m * size);
            }
            bodies->offset[n + 1] = to + m;
        }
        n++;
    }
    bodies->n = n;
}

void bt_bodies_turn(bt_bodies *bodies, bt_idx i)
{
    double s, c;
    bt_sincos(bodies->pose[i].yaw, &s, &c);
    for (int64_t k = bodies->offset[i]; k < bodies->offset[i + 1]; k++) {
        const double *v = bodies->vertices + 2 * k;
        bodies->outline[2 * k] = c * v[0] - s * v[1];
        bodies->outline[2 * k + 1] = s * v[0] + c * v[1];
    }
}

/// First convex polygon of n vertices (the outline, or its first part), and the one after it, −1 = none: as
/// bt_part_first.
static int64_t first_polygon(const bt_mark *mark, int64_t n) { return mark[0].count < n ? mark[0].count : 0; }
static int64_t next_polygon(const bt_mark *mark, int64_t n, int64_t at)
{
    return at + mark[at].count < n ? at + mark[at].count : -1;
}

double bt_bodies_depth(const bt_bodies *bodies, bt_idx i, const bt_mark *mark, const double *vertex, int64_t n,
                       double dx, double dy)
{
    const bt_mark *own = bodies->mark + bodies->offset[i];
    const double *own_vertex = bodies->outline + 2 * bodies->offset[i];
    const int64_t n_own = bodies->offset[i + 1] - bodies->offset[i];
    double deepest = 0;
    for (int64_t p = first_polygon(mark, n); p >= 0; p = next_polygon(mark, n, p))
        for (int64_t q = first_polygon(own, n_own); q >= 0; q = next_polygon(own, n_own, q))
            deepest = bt_max(deepest, -bt_apart_of(mark[p].count, vertex + 2 * p, own[q].count, own_vertex + 2 * q, dx,
                                                   dy).gap);
    return deepest;
}
