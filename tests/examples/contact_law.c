// SPDX-License-Identifier: MIT
// Example of a contact law of one's own: a fender around the hull. A contact point of the towed body bears at most
//     F = F0 + k d
// d: how deep a floe has pressed it in. It does not come back: while the floe stays, it meets the fender at that depth.
#include "bergtow/contact.h"

#include <math.h>

enum { LOAD, STIFFNESS }; // own[]: the keys in their order
enum { DEPTH };           // value[]: what a pair remembers

static const bt_law_key fender_keys[] = {
    {"load", "N", "0 N", "[0, 1e12]", "load at which the fender begins to give way, 0 = there is none"},
    {"stiffness", "N/m", "0 N/m", "[0, 1e12]", "what the load rises by for each metre"},
};

static const bt_contact_number fender_numbers[] = {
    {"fender_points", "1", "contact points at which the fender gives way", false},
    {"fender_pressed", "m", "depth to which the fender is pressed in, summed over the floes that lie there", true},
};

static bool fender_on(const double *own) { return own[LOAD] > 0; }

static bool fender_applies(const bt_world *w, bt_idx a, bt_idx b, const double *own)
{
    (void)own;
    return w->bodies.gid[a] == w->towed || w->bodies.gid[b] == w->towed;
}

static void fender_bound(const bt_law_contact *t, double load[2], double given[2])
{
    for (int i = 0; i < t->n; i++) {
        given[i] = t->value[DEPTH];
        load[i] = t->own[LOAD] + t->own[STIFFNESS] * t->value[DEPTH];
    }
}

static bool fender_remember(bt_law_contact *t, double *number)
{
    double deeper = 0;
    for (int i = 0; i < t->n; i++) {
        if (t->grown[i] > 0) number[0] += 1;
        deeper = fmax(deeper, t->grown[i]);
    }
    t->value[DEPTH] += deeper;
    return t->value[DEPTH] > 0;
}

static void fender_count(const double value[4], const double *own, double *number)
{
    (void)own;
    number[1] += value[DEPTH];
}

static const bt_contact_law fender_law = {
    .name = "fender",
    .doc = "the fender of the towed body is pressed in",
    .keys = fender_keys,
    .n_keys = 2,
    .numbers = fender_numbers,
    .n_numbers = 2,
    .on = fender_on,
    .applies = fender_applies,
    .bound = fender_bound,
    .remember = fender_remember,
    .count = fender_count,
};
