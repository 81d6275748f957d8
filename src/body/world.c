// SPDX-License-Identifier: MIT
// Storage of the bodies: creation, growth, outlines, hash.
#include "bergtow/world.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "contact/contacts.h"
#include "contact/crush.h"
#include "loads/impact.h"
#include "force/environment.h"
#include "bergtow/forces.h"
#include "solve/solver.h"
#include "space/tiles.h"
#include "tow/tow.h"
#include "step/window.h"
#include "partition/domain.h"

bt_world *bt_world_create(const bt_params *p)
{
    bt_world *w = bt_alloc(1, sizeof *w);
    w->par = *p;
    w->towed = -1;
    w->bodies.offset = bt_alloc(1, sizeof *w->bodies.offset);
    w->tiles = bt_tiles_create();
    w->solver = bt_solver_create();
    w->forces = bt_forces_create();
    return w;
}

#define FIELD(name) {offsetof(bt_bodies, name), sizeof *((bt_bodies *)0)->name}
const bt_body_field bt_body_fields[] = {
    FIELD(vel),  FIELD(inv),    FIELD(pose), FIELD(path),    FIELD(vel_start), FIELD(vel_free),    FIELD(gid),  FIELD(radius),
    FIELD(area), FIELD(mass),   FIELD(inertia), FIELD(share), FIELD(friction), FIELD(restitution), FIELD(thickness), FIELD(drag), FIELD(motion), FIELD(large),
    FIELD(stirred), FIELD(tile), FIELD(home),
};
const int bt_n_body_fields = sizeof bt_body_fields / sizeof *bt_body_fields;

const bt_body_field bt_vertex_fields[] = {
    {offsetof(bt_bodies, vertices), 2 * sizeof(double)}, {offsetof(bt_bodies, outline), 2 * sizeof(double)}, FIELD(per_length), FIELD(mark),
};
const int bt_n_vertex_fields = sizeof bt_vertex_fields / sizeof *bt_vertex_fields;

void bt_world_free(bt_world *w)
{
    if (!w) return;
    bt_bodies *b = &w->bodies;
    for (int k = 0; k < bt_n_body_fields; k++) free(*(void **)((char *)b + bt_body_fields[k].array));
    for (int k = 0; k < bt_n_vertex_fields; k++) free(*(void **)((char *)b + bt_vertex_fields[k].array));
    free(b->offset);
    free(b->index_of);
    bt_tiles_free(w->tiles);
    bt_solver_free(w->solver);
    bt_forces_free(w->forces);
    bt_domain_free(w->domain);
    bt_impacts_free(w->impacts);
    bt_environment_free(w->environment);
    bt_tow_free(w->tow);
    bt_events_free(&w->events);
    free(w->window);
    free(w);
}

void bt_world_reserve(bt_bodies *b, bt_idx n, int64_t n_vertices)
{
    if (n > b->cap) {
        const bt_idx cap = b->cap == 0 ? n : n > b->cap + b->cap / 4 ? n : b->cap + b->cap / 4;
        for (int k = 0; k < bt_n_body_fields; k++) {
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

/// Marks and lengths of the n vertices of one polygon, from `first` on.
static void close_polygon(bt_bodies *b, int64_t first, int n)
{
    for (int k = 0; k < n; k++) {
        const double *p = b->vertices + 2 * (first + k), *q = b->vertices + 2 * (first + (k + 1) % n);
        b->per_length[first + k] = 1 / hypot(q[0] - p[0], q[1] - p[1]);
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

bt_gid bt_world_add(bt_world *w, const bt_body_def *d)
{
    bt_bodies *b = &w->bodies;
    assert(d->n_vertices >= 3 && d->n_vertices <= BT_MAX_VERTICES);
    assert(d->motion != BT_DYNAMIC || (d->mass > 0 && d->inertia > 0));
    assert(b->n == b->n_global); // bodies are added before they are dealt to ranks
    int64_t first = b->offset[b->n];
    const int n_vertices = d->n_vertices + (d->parts ? d->parts->n_vertices : 0);
    bt_world_reserve(b, b->n + 1, first + n_vertices);
    const bt_idx i = b->n++;
    if ((b->n_global & (b->n_global - 1)) == 0) // a power of two: room for twice as many
        b->index_of = bt_realloc(b->index_of, 2 * (size_t)b->n_global + 2, sizeof *b->index_of);
    b->index_of[b->n_global] = i;
    b->offset[i + 1] = first + n_vertices;
    add_polygons(b, i, d);
    bt_moments m = bt_shape_extent(d->n_vertices, d->vertices);
    b->gid[i] = b->n_global++;
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
    b->motion[i] = (uint8_t)d->motion;
    b->large[i] = d->large;
    b->stirred[i] = 1;
    b->tile[i][0] = b->tile[i][1] = 0;
    b->home[i] = (bt_home){0};
    bt_world_turn_outline(w, i);
    w->tiles->labelled = false;
    return b->gid[i];
}

void bt_world_turn_outline(bt_world *w, bt_idx i)
{
    bt_bodies *b = &w->bodies;
    bt_pose *p = &b->pose[i];
    p->c = cos(p->yaw);
    p->s = sin(p->yaw);
    for (int64_t k = b->offset[i]; k < b->offset[i + 1]; k++) {
        const double *v = b->vertices + 2 * k;
        b->outline[2 * k] = p->c * v[0] - p->s * v[1];
        b->outline[2 * k + 1] = p->s * v[0] + p->c * v[1];
    }
}

/// Mix of a 64-bit word: the finaliser of SplitMix64 (Steele, Lea & Flood 2014).
static uint64_t mix(uint64_t z)
{
    z += 0x9e3779b97f4a7c15u;
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
    return z ^ (z >> 31);
}

static uint64_t mix_double(uint64_t h, double x)
{
    uint64_t u;
    x += 0.0; // −0 and +0 are the same state
    memcpy(&u, &x, sizeof u);
    return mix(h ^ u);
}

static uint64_t hash_scar(const bt_scar *s)
{
    uint64_t h = mix(mix(mix((uint64_t)s->a) ^ (uint64_t)s->b) ^ ((uint64_t)s->part[0] << 16 | s->part[1]));
    for (int i = 0; i < s->n; i++) h = mix_double(mix(h ^ s->feature[i]), s->depth[i]);
    return h;
}

uint64_t bt_world_hash(const bt_world *w)
{
    // The sum over bodies is associative: any order, any distribution.
    const bt_bodies *b = &w->bodies;
    uint64_t sum = 0;
    for (bt_idx i = 0; i < b->n; i++) {
        if (!bt_domain_owns(w, i)) continue;
        uint64_t h = mix((uint64_t)b->gid[i]);
        const double state[] = {b->pose[i].x, b->pose[i].y, b->pose[i].yaw, b->vel[i].x, b->vel[i].y, b->vel[i].w};
        for (int k = 0; k < 6; k++) h = mix_double(h, state[k]);
        if (w->window) h = mix(h ^ ((uint64_t)(uint32_t)b->home[i].copy << 32 | (uint32_t)b->home[i].lap));
        sum += h;
    }
    for (bt_idx k = 0; k < w->tiles->n; k++)
        for (bt_idx i = 0; w->tiles->tile[k].own && i < w->tiles->tile[k].n_scars; i++) sum += hash_scar(&w->tiles->tile[k].scars[i]);
    sum = bt_domain_sum_words(w, sum) + mix((uint64_t)w->step);
    if (w->window) sum = mix(sum ^ bt_window_hash(w->window));
    if (w->environment) sum = mix_double(mix_double(sum, w->drift_x), w->drift_y);
    return w->tow ? mix(sum ^ bt_tow_hash(w->tow)) : sum;
}
