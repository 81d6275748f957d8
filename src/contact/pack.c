// SPDX-License-Identifier: MIT
// Contacts of a cell: order, geometry, effective masses, biases, warm start.
//
// Order. Successive contacts should not share a body: the processor can then overlap them, where each would otherwise
// wait for the velocities of the previous one. So a cell's manifolds are coloured first-fit in the order of their gids
// (every body of the block keeps a mask of the colours it has), and sorted by colour. The order follows from the
// manifolds and their gids alone, wherever and whenever the pair list was made.
#include "contact/pack.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "contact/bearing.h"
#include "contact/law.h"
#include "body/bodies.h"
#include "contact/row.h"

enum { MAX_COLOURS = 64 };
#define RELEASED 1e9 // m, a gap that nothing closes

void bt_pack_scratch_free(bt_pack_scratch *scratch)
{
    free(scratch->man);
    free(scratch->pair);
    free(scratch->place);
    free(scratch->held);
    free(scratch->colour);
    free(scratch->used);
    *scratch = (bt_pack_scratch){0};
}

void bt_pack_begin(bt_pack_scratch *scratch, size_t n)
{
    scratch->n = 0;
    if (n < scratch->cap) return;
    scratch->cap = n + n / 2 + 16;
    scratch->man = bt_realloc(scratch->man, scratch->cap, sizeof *scratch->man);
    scratch->pair = bt_realloc(scratch->pair, scratch->cap, sizeof *scratch->pair);
    scratch->place = bt_realloc(scratch->place, scratch->cap, sizeof *scratch->place);
    scratch->held = bt_realloc(scratch->held, scratch->cap, sizeof *scratch->held);
    scratch->colour = bt_realloc(scratch->colour, scratch->cap, sizeof *scratch->colour);
}

/// Position of body i in the block of the cell, −1 = a large one.
static bt_idx in_block(const bt_cells *ts, const bt_cell *cell, const bt_idx base[4], bt_idx i)
{
    const bt_idx block[4] = {cell->right, cell->above, cell->diagonal};
    if (i >= cell->first && i < cell->end) return i - cell->first;
    for (int k = 0; k < 3; k++)
        if (block[k] >= 0 && i >= ts->cell[block[k]].first && i < ts->cell[block[k]].end)
            return base[k + 1] + i - ts->cell[block[k]].first;
    return -1;
}

static int colour_contacts(const bt_world *world, const bt_cell *cell, bt_pack_scratch *scratch,
                           bt_idx start[MAX_COLOURS + 2])
{
    const bt_cells *ts = world->cells;
    const bt_bodies *bodies = &world->bodies;
    const bt_idx block[4] = {cell->right, cell->above, cell->diagonal};
    bt_idx base[4] = {0};
    bt_idx n = cell->end - cell->first;
    for (int k = 0; k < 3; k++) {
        base[k + 1] = n;
        if (block[k] >= 0) n += ts->cell[block[k]].end - ts->cell[block[k]].first;
    }
    if ((size_t)n > scratch->cap_used)
        scratch->used = bt_realloc(scratch->used, scratch->cap_used = 2 * (size_t)n, sizeof *scratch->used);
    if (n > 0) memset(scratch->used, 0, (size_t)n * sizeof *scratch->used);
    bt_idx count[MAX_COLOURS + 1] = {0};
    int n_colours = 0;
    for (size_t k = 0; k < scratch->n; k++) {
        const bt_manifold *manifold = &scratch->man[k];
        const bt_idx i = bodies->inv[manifold->a].m > 0 ? in_block(ts, cell, base, manifold->a) : -1,
                     j = bodies->inv[manifold->b].m > 0 ? in_block(ts, cell, base, manifold->b) : -1;
        const uint64_t used = (i >= 0 ? scratch->used[i] : 0) | (j >= 0 ? scratch->used[j] : 0);
        const int colour = ~used ? __builtin_ctzll(~used) : MAX_COLOURS; // none left: at the end, uncoloured
        if (colour < MAX_COLOURS && i >= 0) scratch->used[i] |= (uint64_t)1 << colour;
        if (colour < MAX_COLOURS && j >= 0) scratch->used[j] |= (uint64_t)1 << colour;
        scratch->colour[k] = (uint8_t)colour;
        count[colour]++;
        if (colour >= n_colours) n_colours = colour + 1;
    }
    start[0] = 0;
    for (int c = 0; c < n_colours; c++) start[c + 1] = start[c] + count[c];
    return n_colours;
}

/// Save the contacts of the previous step: those of this step overwrite them.
static void hold(const bt_cell *cell, bt_pack_scratch *scratch)
{
    for (size_t k = 0; k < scratch->n; k++) {
        const bt_idx at = cell->search.pairs[scratch->pair[k]].contact;
        scratch->held[k].n = 0;
        if (at < 0) continue;
        const bt_contact *contact = &cell->contacts[at];
        const bt_gaps *gaps = &cell->gaps[at];
        scratch->held[k] = (bt_held){contact->n, {gaps->feature[0], gaps->feature[1]}, {contact->ln[0], contact->ln[1]},
                                     contact->lt, gaps->row};
    }
}

static void inherit(const bt_manifold *manifold, const bt_held *held, bt_contact *contact)
{
    for (int i = 0; i < manifold->n_points; i++)
        for (int j = 0; j < held->n; j++)
            if (held->feature[j] == manifold->p[i].feature) contact->ln[i] = held->ln[j];
    // The points share one friction impulse: it is kept in the proportion of the normal impulses that are kept.
    const double before = held->n > 1 ? held->ln[0] + held->ln[1] : held->n > 0 ? held->ln[0] : 0;
    const double kept = contact->ln[0] + contact->ln[1];
    contact->lt = before == 0 ? 0 : kept == before ? held->lt : held->lt * (kept / before);
}

/// Sheets that lie on each other (contact/raft.h): components along x and y.
static void fill_sheets(const bt_manifold *manifold, bt_idx pair, bt_contact *contact, bt_gaps *gaps)
{
    const bt_point *q = &manifold->p[0];
    *contact = (bt_contact){
        .a = manifold->a, .b = manifold->b, .nx = 1, .ran = {-q->ra[1]}, .rbn = {-q->rb[1]}, .rat = q->ra[0],
        .rbt = q->rb[0], .pair = pair};
    *gaps = (bt_gaps){0};
}

void bt_pack_rows(const bt_world *world, const bt_manifold *manifold, bt_contact *contact)
{
    const bt_bodies *bodies = &world->bodies;
    const double nx = manifold->nx, ny = manifold->ny;
    *contact = (bt_contact){.a = manifold->a, .b = manifold->b, .nx = nx, .ny = ny,
                            .mu = bt_pair_friction(bodies, manifold->a, manifold->b), .n = manifold->n_points,
                            .pair = contact->pair};
    for (int i = 0; i < manifold->n_points; i++) {
        const bt_point *q = &manifold->p[i];
        contact->ran[i] = q->ra[0] * ny - q->ra[1] * nx;
        contact->rbn[i] = q->rb[0] * ny - q->rb[1] * nx;
    }
    contact->rat = manifold->p[0].ra[0] * nx + manifold->p[0].ra[1] * ny;
    contact->rbt = manifold->p[0].rb[0] * nx + manifold->p[0].rb[1] * ny;
}

static void fill_contact(const bt_world *world, const bt_manifold *manifold, bt_idx pair, const bt_held *held,
                         bt_contact *contact, bt_gaps *gaps)
{
    contact->pair = pair;
    bt_pack_rows(world, manifold, contact);
    *gaps = (bt_gaps){0};
    for (int i = 0; i < manifold->n_points; i++) {
        gaps->gap[i] = manifold->p[i].gap;
        gaps->feature[i] = manifold->p[i].feature;
    }
    if (world->par.warm_start) inherit(manifold, held, contact);
}

/// Approach velocity at which point i just touches at the end of the step, m/s; huge if the row is released.
static double place_of(const bt_world *world, const bt_gaps *gaps, int i)
{
    return gaps->row == BT_ROW_RELEASED ? RELEASED / world->par.dt : bt_max(gaps->gap[i], 0) / world->par.dt;
}

/// Normal bias b of model equation (1). For pairs that pass, see contact/contacts.h.
static double bias_of(const bt_world *world, const bt_contact *contact, const bt_gaps *gaps, int i, double restitution)
{
    const bt_bodies *bodies = &world->bodies;
    if (restitution > 0 && gaps->row != BT_ROW_RELEASED) {
        // Newton's law on the approach at the start of the step. A pair that would meet within the step rebounds now:
        // letting it close the gap first would lose the approach speed that the law refers to. "Meets" includes gaps up
        // to the slop, or rounding would decide which of two points of a square hit rebounds.
        // If drag takes part of the approach within the step, the law refers to the rest: the work of a row is λ (w* +
        // w2)/2, and a rebound faster than −w* would add energy.
        const double approach = bt_normal_velocity(contact, i, &bodies->vel_start[contact->a],
                                                   &bodies->vel_start[contact->b]);
        const double closing = bt_normal_velocity(contact, i, &bodies->vel_free[contact->a],
                                                  &bodies->vel_free[contact->b]);
        if (approach < -world->par.rest_speed && gaps->gap[i] + world->par.dt * bt_min(closing, 0) < world->par.slop)
            return restitution * bt_max(approach, bt_min(closing, 0));
    }
    return place_of(world, gaps, i);
}

void bt_pack_bias(const bt_world *world, bt_contact *contact, const bt_gaps *gaps, double share)
{
    const double restitution = share * bt_pair_restitution(&world->bodies, contact->a, contact->b);
    for (int i = 0; i < contact->n; i++) contact->bias[i] = bias_of(world, contact, gaps, i, restitution);
}

void bt_pack_set_row(const bt_world *world, bt_cell *cell, bt_idx j, bt_row_state state)
{
    bt_contact *contact = &cell->contacts[j];
    bt_gaps *gaps = &cell->gaps[j];
    gaps->row = state;
    if (state == BT_ROW_RELEASED) contact->ln[0] = contact->ln[1] = contact->lt = 0;
    bt_pack_bias(world, contact, gaps, 1);
    if (cell->laws->limits)
        for (int i = 0; i < contact->n; i++) cell->laws->limits[j].place[i] = place_of(world, gaps, i);
}

/// State of the row of contact j, made from the manifold; held: the contact that it replaces.
static bt_row_state row_state(const bt_world *world, const bt_cell *cell, bt_idx j, const bt_manifold *manifold,
                              const bt_held *held)
{
    if (world->par.plain_sweeps) return BT_ROW_STAYS; // the reference, and what fields are shaken with
    if (world->stats.repeats > 0 && held->n > 0) return held->row; // from the previous detection in this step
    for (int i = 0; i < manifold->n_points; i++)
        if (manifold->p[i].gap <= world->par.slop || cell->gaps[j].gap[i] <= world->par.slop) return BT_ROW_STAYS;
    for (int law = 0; cell->laws->limits && law < BT_LAWS; law++) // it is not the outlines that touch
        if (bt_laws[law]->contact && cell->laws->limits[j].record[law] >= 0) return BT_ROW_STAYS;
    return BT_ROW_OPEN;
}

uint64_t bt_contacts_load(const bt_cell *cell)
{
    uint64_t sum = 0;
    for (bt_idx i = 0; i < cell->n_contacts; i++) {
        // + 0 turns −0 into 0: an unloaded contact may have either, and loses −0 when it is made anew
        const double x[3] = {cell->contacts[i].ln[0] + 0.0, cell->contacts[i].ln[1] + 0.0, cell->contacts[i].lt + 0.0};
        uint64_t bits[3];
        memcpy(bits, x, sizeof bits);
        sum += bits[0] + bits[1] + bits[2];
    }
    return sum;
}

__attribute__((flatten))
void bt_pack_contacts(bt_world *world, bt_idx k, bt_pack_scratch *scratch)
{
    bt_cell *cell = &world->cells->cell[k];
    hold(cell, scratch);
    cell->load = world->stats.repeats > 0 ? bt_contacts_load(cell) : 0;
    if ((bt_idx)scratch->n > cell->cap_contacts) {
        cell->cap_contacts = bt_cells_room((bt_idx)scratch->n);
        free(cell->gaps);
        cell->gaps = bt_alloc_unset((size_t)cell->cap_contacts, sizeof *cell->gaps);
    }
    cell->n_contacts = (bt_idx)scratch->n;
    cell->n_points = 0;
    cell->overlap = 0;
    bt_cells_make_room(cell, scratch->n * sizeof *cell->contacts);
    if (scratch->n == 0) return;
    const bool bounded = bt_laws_on(&world->par);
    cell->laws->rising = bt_laws_rise(&world->par);
    if (bounded) bt_laws_reserve(cell);
    bt_idx next[MAX_COLOURS + 2] = {0};
    if (cell->phase < BT_COLOURS) colour_contacts(world, cell, scratch, next);
    else memset(scratch->colour, 0, scratch->n); // in sequence
    bt_idx *place = scratch->place;
    for (size_t i = 0; i < scratch->n; i++) {
        const bt_idx at = place[i] = next[scratch->colour[i]]++;
        if (scratch->man[i].n_points == 0) {
            fill_sheets(&scratch->man[i], scratch->pair[i], &cell->contacts[at], &cell->gaps[at]);
        } else {
            fill_contact(world, &scratch->man[i], scratch->pair[i], &scratch->held[i], &cell->contacts[at],
                         &cell->gaps[at]);
            cell->search.pairs[scratch->pair[i]].contact = at;
        }
        if (bounded) bt_laws_recall(world, cell, at, &cell->search.pairs[scratch->pair[i]], &scratch->man[i]);
    }
    if (cell->laws->n_overlaps > 0) bt_bearing_assign(world, cell);
    for (size_t i = 0; i < scratch->n; i++) {
        const bt_idx at = place[i];
        bt_contact *contact = &cell->contacts[at];
        if (bounded) // this may change the gaps
            bt_laws_bound(world, cell, at, &cell->search.pairs[scratch->pair[i]], &scratch->man[i]);
        if (contact->n == 0) continue;
        bt_pack_set_row(world, cell, at, row_state(world, cell, at, &scratch->man[i], &scratch->held[i]));
        cell->n_points += contact->n;
        // Overlap of the remaining outlines. 0 − gap, not −gap: a contact that just touches must not make the deepest
        // overlap −0 on the only rank that holds it.
        for (int j = 0; j < contact->n; j++) cell->overlap = bt_max(cell->overlap, 0 - cell->gaps[at].gap[j]);
    }
}
