// SPDX-License-Identifier: MIT
// Storage of the bodies: creation, growth, outlines, hash.
#include "bergtow/world.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "bergtow/contacts.h"
#include "bergtow/solver.h"
#include "bergtow/tow.h"

bt_world *bt_world_create(const bt_params *p)
{
    bt_world *w = bt_alloc(1, sizeof *w);
    w->par = *p;
    w->towed = -1;
    w->bodies.offset = bt_alloc(1, sizeof *w->bodies.offset);
    w->contacts = bt_contacts_create();
    w->solver = bt_solver_create();
    return w;
}

void bt_world_free(bt_world *w)
{
    if (!w) return;
    bt_bodies *b = &w->bodies;
    void *arrays[] = {b->vel,  b->inv,     b->pose,    b->outline,  b->normal,    b->path,   b->vel_start,
                      b->gid,  b->offset,  b->vertices, b->normals, b->radius,    b->mass,   b->inertia,
                      b->drag, b->friction, b->restitution, b->motion, b->large,  b->vel_free, b->area};
    for (size_t i = 0; i < sizeof arrays / sizeof *arrays; i++) free(arrays[i]);
    bt_contacts_free(w->contacts);
    bt_solver_free(w->solver);
    free(w->tow);
    free(w);
}

static void *grow_aligned(void *p, size_t n_old, size_t n_new, size_t size)
{
    void *q = bt_alloc_aligned(n_new, size);
    if (p) memcpy(q, p, n_old * size);
    free(p);
    return q;
}

static void reserve(bt_bodies *b, bt_idx n)
{
    if (n <= b->cap) return;
    bt_idx cap = b->cap ? 2 * b->cap : 64;
    if (cap < n) cap = n;
    size_t c = (size_t)cap, old = (size_t)b->n;
    b->vel = grow_aligned(b->vel, old, c, sizeof *b->vel);
    b->inv = grow_aligned(b->inv, old, c, sizeof *b->inv);
    b->vel_start = grow_aligned(b->vel_start, old, c, sizeof *b->vel_start);
    b->vel_free = grow_aligned(b->vel_free, old, c, sizeof *b->vel_free);
    b->pose = bt_realloc(b->pose, c, sizeof *b->pose);
    b->path = bt_realloc(b->path, c, sizeof *b->path);
    b->gid = bt_realloc(b->gid, c, sizeof *b->gid);
    b->offset = bt_realloc(b->offset, c + 1, sizeof *b->offset);
    b->radius = bt_realloc(b->radius, c, sizeof *b->radius);
    b->area = bt_realloc(b->area, c, sizeof *b->area);
    b->mass = bt_realloc(b->mass, c, sizeof *b->mass);
    b->inertia = bt_realloc(b->inertia, c, sizeof *b->inertia);
    b->friction = bt_realloc(b->friction, c, sizeof *b->friction);
    b->restitution = bt_realloc(b->restitution, c, sizeof *b->restitution);
    b->drag = bt_realloc(b->drag, c, sizeof *b->drag);
    b->motion = bt_realloc(b->motion, c, sizeof *b->motion);
    b->large = bt_realloc(b->large, c, sizeof *b->large);
    b->cap = cap;
}

static void reserve_vertices(bt_bodies *b, int64_t n)
{
    if (n <= b->cap_vertices) return;
    int64_t cap = b->cap_vertices ? 2 * b->cap_vertices : 512;
    if (cap < n) cap = n;
    size_t c = 2 * (size_t)cap;
    b->vertices = bt_realloc(b->vertices, c, sizeof *b->vertices);
    b->normals = bt_realloc(b->normals, c, sizeof *b->normals);
    b->outline = bt_realloc(b->outline, c, sizeof *b->outline);
    b->normal = bt_realloc(b->normal, c, sizeof *b->normal);
    b->cap_vertices = cap;
}

bt_idx bt_world_add(bt_world *w, const bt_body_def *d)
{
    bt_bodies *b = &w->bodies;
    assert(d->n_vertices >= 3 && d->n_vertices <= BT_MAX_VERTICES);
    assert(d->motion != BT_DYNAMIC || (d->mass > 0 && d->inertia > 0));
    reserve(b, b->n + 1);
    bt_idx i = b->n++;
    int64_t first = b->offset[i];
    reserve_vertices(b, first + d->n_vertices);
    b->offset[i + 1] = first + d->n_vertices;
    memcpy(b->vertices + 2 * first, d->vertices, 2 * sizeof(double) * (size_t)d->n_vertices);
    bt_moments m = bt_shape_moments(d->n_vertices, d->vertices);
    for (int k = 0; k < d->n_vertices; k++) {
        const double *p = d->vertices + 2 * k, *q = d->vertices + 2 * ((k + 1) % d->n_vertices);
        double ex = q[0] - p[0], ey = q[1] - p[1], l = hypot(ex, ey);
        b->normals[2 * (first + k)] = ey / l;
        b->normals[2 * (first + k) + 1] = -ex / l;
    }
    b->gid[i] = i;
    b->pose[i] = (bt_pose){.x = d->x, .y = d->y, .yaw = d->yaw};
    b->vel[i] = b->vel_start[i] = b->vel_free[i] =
        d->motion == BT_STATIC ? (bt_vel){0} : (bt_vel){.x = d->vx, .y = d->vy, .w = d->yaw_rate};
    b->inv[i] = d->motion == BT_DYNAMIC ? (bt_inv){1 / d->mass, 1 / d->inertia} : (bt_inv){0};
    b->path[i] = 0;
    b->radius[i] = m.radius;
    b->area[i] = m.area;
    b->mass[i] = d->mass;
    b->inertia[i] = d->inertia;
    b->friction[i] = d->friction;
    b->restitution[i] = d->restitution;
    b->drag[i] = d->drag;
    b->motion[i] = (uint8_t)d->motion;
    b->large[i] = d->large;
    bt_world_turn_outline(w, i);
    w->contacts->built = false;
    return i;
}

void bt_world_turn_outline(bt_world *w, bt_idx i)
{
    bt_bodies *b = &w->bodies;
    bt_pose *p = &b->pose[i];
    p->c = cos(p->yaw);
    p->s = sin(p->yaw);
    for (int64_t k = b->offset[i]; k < b->offset[i + 1]; k++) {
        const double *v = b->vertices + 2 * k, *n = b->normals + 2 * k;
        b->outline[2 * k] = p->c * v[0] - p->s * v[1];
        b->outline[2 * k + 1] = p->s * v[0] + p->c * v[1];
        b->normal[2 * k] = p->c * n[0] - p->s * n[1];
        b->normal[2 * k + 1] = p->s * n[0] + p->c * n[1];
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

uint64_t bt_world_hash(const bt_world *w)
{
    // The sum over bodies is associative: any order, any distribution.
    const bt_bodies *b = &w->bodies;
    uint64_t sum = mix((uint64_t)w->step);
    for (bt_idx i = 0; i < b->n; i++) {
        uint64_t h = mix((uint64_t)b->gid[i]);
        const double state[] = {b->pose[i].x, b->pose[i].y, b->pose[i].yaw, b->vel[i].x, b->vel[i].y, b->vel[i].w};
        for (int k = 0; k < 6; k++) h = mix_double(h, state[k]);
        sum += h;
    }
    return w->tow ? mix(sum ^ bt_tow_hash(w->tow)) : sum;
}
