// SPDX-License-Identifier: MIT
// The world: creation and release of all data of a step, and the hash of its state.
#include "bergtow/world.h"

#include <stdlib.h>
#include <string.h>

#include "base/inside.h"
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

bt_world *bt_world_create(const bt_params *par)
{
    BT_PLAIN_NUMBERS;
    bt_world *world = bt_alloc(1, sizeof *world);
    world->par = *par;
    world->towed = -1;
    world->bodies.offset = bt_alloc(1, sizeof *world->bodies.offset);
    world->cells = bt_cells_create();
    world->solver = bt_solver_create();
    world->forces = bt_forces_create();
    return world;
}

void bt_world_free(bt_world *world)
{
    if (!world) return;
    bt_bodies_free(&world->bodies);
    bt_cells_empty(world->cells);
    bt_cells_free(world->cells);
    bt_solver_free(world->solver);
    bt_forces_free(world->forces);
    bt_domain_free(world->domain);
    bt_shore_free(world->shore);
    bt_impacts_free(world->impacts);
    bt_environment_free(world->environment);
    bt_splitting_free(world->splitting);
    bt_tow_free(world->tow);
    bt_events_free(&world->events);
    free(world->window);
    free(world->undisturbed);
    free(world);
}

bt_gid bt_world_add(bt_world *world, const bt_body_def *def)
{
    BT_PLAIN_NUMBERS;
    world->cells->labelled = false;
    return bt_bodies_add(&world->bodies, def);
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

/// Name of a body in the hash: ids reserved for pieces come last, so that a world where nothing has split has the same
/// hash as one where nothing can.
static uint64_t name_of(const bt_world *world, bt_gid gid) { return (uint64_t)bt_splitting_row(world, gid); }

/// Hash of a record of a contact law other than the rigid one. The first such law enters as 0, so that states keep
/// their old hashes.
static uint64_t hash_memory(const bt_world *world, const bt_memory *memory)
{
    const uint64_t where = (uint64_t)(memory->law - 1) << 32 | (uint64_t)memory->part[0] << 16 | memory->part[1];
    uint64_t h = mix(mix(mix(name_of(world, memory->a)) ^ name_of(world, memory->b)) ^ where);
    for (int i = 0; i < memory->n_points; i++) h = mix_double(mix(h ^ memory->feature[i]), memory->value[i]);
    return memory->law > 1 ? mix_double(mix_double(h, memory->value[2]), memory->value[3]) : h;
}

uint64_t bt_world_hash(const bt_world *world)
{
    BT_PLAIN_NUMBERS;
    // The sum over bodies does not depend on order or distribution.
    const bt_bodies *bodies = &world->bodies;
    uint64_t sum = 0;
    for (bt_idx i = 0; i < bodies->n; i++) {
        if (!bt_domain_owns(world, i)) continue;
        uint64_t h = mix(name_of(world, bodies->gid[i]));
        const double state[] = {bodies->pose[i].x, bodies->pose[i].y, bodies->pose[i].yaw, bodies->vel[i].x,
                                bodies->vel[i].y, bodies->vel[i].w};
        for (int k = 0; k < 6; k++) h = mix_double(h, state[k]);
        const bt_exposure *exposure = &bodies->exposure[i];
        if (exposure->skin != 1 || exposure->water_form != 1 || exposure->air_form != 1)
            h = mix_double(mix_double(mix_double(h, exposure->skin), exposure->water_form), exposure->air_form);
        if (world->window) h = mix(h ^ ((uint64_t)(uint32_t)bodies->home[i].copy << 32 | (uint32_t)bodies->lap[i]));
        sum += h;
    }
    for (bt_idx k = 0; k < world->cells->n; k++)
        for (bt_idx i = 0; world->cells->cell[k].own && i < world->cells->cell[k].laws->n_memory; i++)
            sum += hash_memory(world, &world->cells->cell[k].laws->memory[i]);
    sum = bt_domain_sum_words(world, sum) + mix((uint64_t)world->step);
    if (world->window) sum = mix(sum ^ bt_window_hash(world));
    if (world->splitting && world->splitting->n > 0) sum = mix(sum ^ bt_splitting_hash(world->splitting));
    if (world->environment) sum = mix_double(mix_double(sum, world->drift_x), world->drift_y);
    return world->tow ? mix(sum ^ bt_tow_hash(world->tow)) : sum;
}
