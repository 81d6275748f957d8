// SPDX-License-Identifier: MIT
// The world: who makes and frees all that a step works on, and the hash of its state.
#include "bergtow/world.h"

#include <stdlib.h>
#include <string.h>

#include "body/bodies.h"
#include "force/environment.h"
#include "force/forces.h"
#include "loads/impact.h"
#include "partition/domain.h"
#include "solve/solver.h"
#include "space/cells.h"
#include "space/shore.h"
#include "step/splitting.h"
#include "step/window.h"
#include "tow/tow.h"

bt_world *bt_world_create(const bt_params *p)
{
    bt_world *w = bt_alloc(1, sizeof *w);
    w->par = *p;
    w->towed = -1;
    w->bodies.offset = bt_alloc(1, sizeof *w->bodies.offset);
    w->cells = bt_cells_create();
    w->solver = bt_solver_create();
    w->forces = bt_forces_create();
    return w;
}

void bt_world_free(bt_world *w)
{
    if (!w) return;
    bt_bodies_free(&w->bodies);
    bt_cells_free(w->cells);
    bt_solver_free(w->solver);
    bt_forces_free(w->forces);
    bt_domain_free(w->domain);
    bt_shore_free(w->shore);
    bt_impacts_free(w->impacts);
    bt_environment_free(w->environment);
    bt_splitting_free(w->splitting);
    bt_tow_free(w->tow);
    bt_events_free(&w->events);
    free(w->window);
    free(w->undisturbed);
    free(w);
}

bt_gid bt_world_add(bt_world *w, const bt_body_def *d)
{
    w->cells->labelled = false;
    return bt_bodies_add(&w->bodies, d);
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

/// What a body is called in the hash: ids that are kept for pieces count last, so that a world in which nothing splits
/// is called as one in which nothing can.
static uint64_t name_of(const bt_world *w, bt_gid gid)
{
    const bt_splitting *s = w->splitting;
    if (!s || gid < s->first) return (uint64_t)gid;
    if (gid >= s->first + s->reserve) return (uint64_t)(gid - s->reserve);
    return (uint64_t)(w->bodies.n_global - s->reserve + (gid - s->first));
}

/// Of what a contact law other than the rigid one remembers. The first of them counts as no law: so states keep their
/// names.
static uint64_t hash_memory(const bt_world *w, const bt_memory *r)
{
    const uint64_t where = (uint64_t)(r->law - 1) << 32 | (uint64_t)r->part[0] << 16 | r->part[1];
    uint64_t h = mix(mix(mix(name_of(w, r->a)) ^ name_of(w, r->b)) ^ where);
    for (int i = 0; i < r->n_points; i++) h = mix_double(mix(h ^ r->feature[i]), r->value[i]);
    return r->law > 1 ? mix_double(mix_double(h, r->value[2]), r->value[3]) : h;
}

uint64_t bt_world_hash(const bt_world *w)
{
    // The sum over bodies is associative: any order, any distribution.
    const bt_bodies *b = &w->bodies;
    uint64_t sum = 0;
    for (bt_idx i = 0; i < b->n; i++) {
        if (!bt_domain_owns(w, i)) continue;
        uint64_t h = mix(name_of(w, b->gid[i]));
        const double state[] = {b->pose[i].x, b->pose[i].y, b->pose[i].yaw, b->vel[i].x, b->vel[i].y, b->vel[i].w};
        for (int k = 0; k < 6; k++) h = mix_double(h, state[k]);
        const bt_exposure *e = &b->exposure[i];
        if (e->skin != 1 || e->water_form != 1 || e->air_form != 1)
            h = mix_double(mix_double(mix_double(h, e->skin), e->water_form), e->air_form);
        if (w->window) h = mix(h ^ ((uint64_t)(uint32_t)b->home[i].copy << 32 | (uint32_t)b->lap[i]));
        sum += h;
    }
    for (bt_idx k = 0; k < w->cells->n; k++)
        for (bt_idx i = 0; w->cells->cell[k].own && i < w->cells->cell[k].laws.n_memory; i++)
            sum += hash_memory(w, &w->cells->cell[k].laws.memory[i]);
    sum = bt_domain_sum_words(w, sum) + mix((uint64_t)w->step);
    if (w->window) sum = mix(sum ^ bt_window_hash(w));
    if (w->splitting && w->splitting->n > 0) sum = mix(sum ^ bt_splitting_hash(w->splitting));
    if (w->environment) sum = mix_double(mix_double(sum, w->drift_x), w->drift_y);
    return w->tow ? mix(sum ^ bt_tow_hash(w->tow)) : sum;
}
