// SPDX-License-Identifier: MIT
// Applied forces as laws of the table: each has a row of loads for every body, filled before the step is solved; see
// bergtow/applied.h.
//
// Rest. own[0] says whether any row of the step is not zero: while none is, the law lets floes rest.
#include "bergtow/applied.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "bergtow/forces.h"
#include "base/inside.h"
#include "base/name.h"
#include "force/forces.h"
#include "force/load.h"
#include "partition/domain.h"

enum { ACTS }; // own[]

/// Input and answer of a force in the present step. Its texts stay in place to the end of the program.
typedef struct slot {
    char name[BT_MAX_LAW_NAME + 1];
    char doc[200];
    bt_force_law law;
    bt_applied_force *force;
    void *user;
    const bt_bodies *of; ///< the rows are those of this world; compared, never followed
    bt_idx *row;         ///< [n_global] of a body
    int64_t *id;
    double *place, *velocity, *mass, *inertia, *load;
    int64_t cap;         ///< capacity in bodies
} slot;

static slot *slots[BT_MAX_FORCE_LAWS]; // never moved: the table of laws points into them
static int n_slots;

static void reserve(slot *arrays, int64_t n)
{
    if (n <= arrays->cap) return;
    const size_t cap = (size_t)n;
    arrays->row = bt_realloc(arrays->row, cap, sizeof *arrays->row);
    arrays->id = bt_realloc(arrays->id, cap, sizeof *arrays->id);
    arrays->place = bt_realloc(arrays->place, cap, 3 * sizeof *arrays->place);
    arrays->velocity = bt_realloc(arrays->velocity, cap, 3 * sizeof *arrays->velocity);
    arrays->mass = bt_realloc(arrays->mass, cap, sizeof *arrays->mass);
    arrays->inertia = bt_realloc(arrays->inertia, cap, sizeof *arrays->inertia);
    arrays->load = bt_realloc(arrays->load, cap, BT_APPLIED_NUMBERS * sizeof *arrays->load);
    arrays->cap = n;
}

/// List the rows of this rank's bodies by their ids; returns their number.
static int64_t list_bodies(slot *arrays, const bt_bodies *bodies)
{
    int64_t n = 0;
    for (bt_gid gid = 0; gid < bodies->n_global; gid++) {
        const bt_idx i = bodies->index_of[gid];
        arrays->row[gid] = i < 0 ? -1 : (bt_idx)n;
        if (i < 0) continue;
        arrays->id[n] = gid;
        memcpy(arrays->place + 3 * n, (const double[]){bodies->pose[i].x, bodies->pose[i].y, bodies->pose[i].yaw},
               3 * sizeof(double));
        memcpy(arrays->velocity + 3 * n, (const double[]){bodies->vel[i].x, bodies->vel[i].y, bodies->vel[i].w},
               3 * sizeof(double));
        arrays->mass[n] = bodies->mass[i];
        arrays->inertia[n] = bodies->inertia[i];
        n++;
    }
    memset(arrays->load, 0, (size_t)n * BT_APPLIED_NUMBERS * sizeof *arrays->load);
    return n;
}

/// Reason to reject the answer, or NULL. K must be positive semidefinite: g >= 0, and g gw >= gx² + gy² to rounding.
static const char *fault_of(const slot *arrays, int64_t n, double *acts)
{
    for (int64_t k = 0; k < n; k++) {
        const double *l = arrays->load + BT_APPLIED_NUMBERS * k;
        for (int j = 0; j < BT_APPLIED_NUMBERS; j++) {
            if (!isfinite(l[j])) return "a number that it has filled in is not finite";
            if (l[j] != 0) *acts = 1;
        }
        const double g = l[BT_APPLIED_G], gw = l[BT_APPLIED_GW], gx = l[BT_APPLIED_GX], gy = l[BT_APPLIED_GY];
        if (g < 0 || gw < 0 || gx * gx + gy * gy > g * gw * (1 + 1e-9))
            return "its linear part drives a body that it should damp: g, gw or g gw - gx^2 - gy^2 is negative";
    }
    return NULL;
}

static const char *begin(const bt_world *world, double *own, void *context)
{
    slot *arrays = context;
    own[ACTS] = 0;
    arrays->of = NULL;
    if (!arrays->force) return NULL; // the same on all ranks
    reserve(arrays, world->bodies.n_global);
    const int64_t n = list_bodies(arrays, &world->bodies);
    const bt_applied applied = {
        .n = n,
        .id = arrays->id, .place = arrays->place, .velocity = arrays->velocity, .mass = arrays->mass,
        .inertia = arrays->inertia, .load = arrays->load,
        .time = bt_load_time(world),
        .dt = world->par.dt,
        .water = {world->par.water_u, world->par.water_v},
        .air = {world->par.air_u, world->par.air_v},
        .towed = world->towed,
        .towed_row = world->towed < 0 ? -1 : arrays->row[world->towed],
    };
    const char *fault = arrays->force(&applied, arrays->user) != 0 ? "its function failed"
                                                                   : fault_of(arrays, applied.n, &own[ACTS]);
    bt_domain_maxima(world, &own[ACTS], 1); // so the same bodies rest, and are left out, on any ranks
    if (!fault) arrays->of = &world->bodies;
    return fault;
}

static void add(const bt_force_body *body, bt_load *load)
{
    const slot *arrays = body->context;
    if (body->own[ACTS] == 0 || arrays->of != body->all) return; // or a body without a position (step/window.c)
    const double *x = arrays->load + BT_APPLIED_NUMBERS * arrays->row[body->all->gid[body->i]];
    load->fx += x[BT_APPLIED_FX];
    load->fy += x[BT_APPLIED_FY];
    load->moment += x[BT_APPLIED_MOMENT];
    load->g += x[BT_APPLIED_G];
    load->gx += x[BT_APPLIED_GX];
    load->gy += x[BT_APPLIED_GY];
    load->gw += x[BT_APPLIED_GW];
    load->jx += x[BT_APPLIED_JX];
    load->jy += x[BT_APPLIED_JY];
    load->jw += x[BT_APPLIED_JW];
}

static bool rests(const bt_params *par, const double *own)
{
    (void)par;
    return own[ACTS] == 0;
}

bool bt_force_waits(const bt_force_law *law, const double *own) { return law->begin == begin && own[ACTS] == 0; }

bool bt_force_is_released(const bt_force_law *law)
{
    return law->begin == begin && !((const slot *)law->context)->force;
}

static slot *find(const char *name)
{
    for (int k = 0; k < n_slots; k++)
        if (!strcmp(slots[k]->name, name)) return slots[k];
    return NULL;
}

bool bt_force_is_applied(void)
{
    for (int k = 0; k < n_slots; k++)
        if (slots[k]->force) return true;
    return false;
}

/// Copy as much of a text as fits, in whole characters.
static void copy_line(char *to, size_t room, const char *text)
{
    size_t n = strlen(text);
    if (n >= room)
        for (n = room - 1; n > 0 && ((unsigned char)text[n] & 0xc0) == 0x80;) n--;
    memcpy(to, text, n);
    to[n] = '\0';
}

bt_status bt_force_apply(const char *name, const char *doc, bt_applied_force *force, void *user, bt_errors *err)
{
    BT_PLAIN_NUMBERS;
    slot *arrays = name ? find(name) : NULL;
    if (!arrays) {
        arrays = bt_alloc(1, sizeof *arrays);
        snprintf(arrays->name, sizeof arrays->name, "%s", name ? name : "");
        copy_line(arrays->doc, sizeof arrays->doc, doc ? doc : "");
        arrays->law = (bt_force_law){
            .name = arrays->name, .doc = arrays->doc, .rests = rests, .begin = begin, .add = add, .context = arrays};
        const bool fits = !name || strlen(name) < sizeof arrays->name;
        if (!fits) bt_errors_add(err, "force %s: the name is longer than %d letters", name, BT_MAX_LAW_NAME);
        if (!fits || bt_force_register(&arrays->law, err) != BT_OK) {
            free(arrays);
            return BT_ERR_USAGE;
        }
        slots[n_slots++] = arrays;
    }
    arrays->force = force;
    arrays->user = user;
    return BT_OK;
}
