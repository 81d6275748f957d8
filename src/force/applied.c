// SPDX-License-Identifier: MIT
// Applied forces as laws of the table: each has a row of loads for every body, filled once a step; see
// bergtow/applied.h.
//
// Rest. own[0] says whether any row of the step is not zero: while none is, the law lets floes rest.
#include "bergtow/applied.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "bergtow/forces.h"
#include "base/name.h"
#include "force/forces.h"
#include "force/load.h"
#include "partition/domain.h"

enum { ACTS }; // own[]

/// What a force was given and has answered in the step at hand. The texts stay where they are to the end of the
/// program, as those of every law.
typedef struct slot {
    char name[BT_MOST_LAW_NAME + 1];
    char doc[200];
    bt_force_law law;
    bt_applied_force *force;
    void *user;
    const bt_bodies *of; ///< the rows are those of this world; compared, never followed
    bt_idx *row;         ///< [n_global] of a body
    int64_t *id;
    double *place, *velocity, *mass, *inertia, *load;
    int64_t cap;         ///< bodies that there is room for
} slot;

static slot *slots[BT_MAX_FORCE_LAWS]; // each stays where it is: the table of laws points into it
static int n_slots;

static void reserve(slot *s, int64_t n)
{
    if (n <= s->cap) return;
    const size_t cap = (size_t)n;
    s->row = bt_realloc(s->row, cap, sizeof *s->row);
    s->id = bt_realloc(s->id, cap, sizeof *s->id);
    s->place = bt_realloc(s->place, cap, 3 * sizeof *s->place);
    s->velocity = bt_realloc(s->velocity, cap, 3 * sizeof *s->velocity);
    s->mass = bt_realloc(s->mass, cap, sizeof *s->mass);
    s->inertia = bt_realloc(s->inertia, cap, sizeof *s->inertia);
    s->load = bt_realloc(s->load, cap, BT_APPLIED_NUMBERS * sizeof *s->load);
    s->cap = n;
}

/// Rows of the bodies of this rank by their ids; returns their number.
static int64_t list_bodies(slot *s, const bt_bodies *b)
{
    int64_t n = 0;
    for (bt_gid gid = 0; gid < b->n_global; gid++) {
        const bt_idx i = b->index_of[gid];
        s->row[gid] = i < 0 ? -1 : (bt_idx)n;
        if (i < 0) continue;
        s->id[n] = gid;
        memcpy(s->place + 3 * n, (const double[]){b->pose[i].x, b->pose[i].y, b->pose[i].yaw}, 3 * sizeof(double));
        memcpy(s->velocity + 3 * n, (const double[]){b->vel[i].x, b->vel[i].y, b->vel[i].w}, 3 * sizeof(double));
        s->mass[n] = b->mass[i];
        s->inertia[n] = b->inertia[i];
        n++;
    }
    memset(s->load, 0, (size_t)n * BT_APPLIED_NUMBERS * sizeof *s->load);
    return n;
}

/// K must not be negative: g >= 0, and g gw >= gx² + gy², but for rounding.
static const char *fault_of(const slot *s, int64_t n, double *acts)
{
    for (int64_t k = 0; k < n; k++) {
        const double *l = s->load + BT_APPLIED_NUMBERS * k;
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

static const char *begin(const bt_world *w, double *own, void *context)
{
    slot *s = context;
    own[ACTS] = 0;
    s->of = NULL;
    if (!s->force) return NULL; // alike on all ranks
    reserve(s, w->bodies.n_global);
    const bt_applied a = {
        .n = list_bodies(s, &w->bodies),
        .id = s->id, .place = s->place, .velocity = s->velocity, .mass = s->mass, .inertia = s->inertia,
        .load = s->load,
        .time = bt_load_time(w),
        .dt = w->par.dt,
        .water = {w->par.water_u, w->par.water_v},
        .air = {w->par.air_u, w->par.air_v},
        .towed = w->towed,
    };
    const char *fault = s->force(&a, s->user) != 0 ? "its function has failed" : fault_of(s, a.n, &own[ACTS]);
    bt_domain_maxima(w, &own[ACTS], 1); // what rests, and is so left out, is the same on any ranks
    if (!fault) s->of = &w->bodies;
    return fault;
}

static void add(const bt_force_body *b, bt_load *l)
{
    const slot *s = b->context;
    if (b->own[ACTS] == 0 || s->of != b->all) return; // or a body that stands nowhere (step/window.c)
    const double *x = s->load + BT_APPLIED_NUMBERS * s->row[b->all->gid[b->i]];
    l->fx += x[BT_APPLIED_FX];
    l->fy += x[BT_APPLIED_FY];
    l->moment += x[BT_APPLIED_MOMENT];
    l->g += x[BT_APPLIED_G];
    l->gx += x[BT_APPLIED_GX];
    l->gy += x[BT_APPLIED_GY];
    l->gw += x[BT_APPLIED_GW];
    l->jx += x[BT_APPLIED_JX];
    l->jy += x[BT_APPLIED_JY];
    l->jw += x[BT_APPLIED_JW];
}

static bool rests(const bt_params *p, const double *own)
{
    (void)p;
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

/// As much of a text as there is room for, up to the end of a character.
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
    slot *s = name ? find(name) : NULL;
    if (!s) {
        s = bt_alloc(1, sizeof *s);
        snprintf(s->name, sizeof s->name, "%s", name ? name : "");
        copy_line(s->doc, sizeof s->doc, doc ? doc : "");
        s->law = (bt_force_law){
            .name = s->name, .doc = s->doc, .rests = rests, .begin = begin, .add = add, .context = s};
        const bool fits = !name || strlen(name) < sizeof s->name;
        if (!fits) bt_errors_add(err, "force %s: the name is longer than %d letters", name, BT_MOST_LAW_NAME);
        if (!fits || bt_force_register(&s->law, err) != BT_OK) {
            free(s);
            return BT_ERR_USAGE;
        }
        slots[n_slots++] = s;
    }
    s->force = force;
    s->user = user;
    return BT_OK;
}
