// SPDX-License-Identifier: MIT
// Contacts of a cell: order, geometry, effective masses, biases, warm start.
//
// Order. Contacts that follow each other should not share a body: the processor then works on several at once, where
// each would otherwise wait for the velocities of the one before. So a cell's manifolds are coloured first-fit in the
// order of their gids (every body of the block keeps a mask of the colours it has), and stand by colour. The order
// follows from the manifolds and their gids alone, and is the same wherever and whenever the pair list was made.
#include "contact/pack.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "contact/law.h"
#include "body/bodies.h"
#include "contact/row.h"

enum { MAX_COLOURS = 64 };
#define RELEASED 1e9 // m, a gap that nothing closes

void bt_pack_scratch_free(bt_pack_scratch *s)
{
    free(s->man);
    free(s->pair);
    free(s->held);
    free(s->colour);
    free(s->used);
    *s = (bt_pack_scratch){0};
}

void bt_pack_begin(bt_pack_scratch *s, size_t n)
{
    s->n = 0;
    if (n < s->cap) return;
    s->cap = n + n / 2 + 16;
    s->man = bt_realloc(s->man, s->cap, sizeof *s->man);
    s->pair = bt_realloc(s->pair, s->cap, sizeof *s->pair);
    s->held = bt_realloc(s->held, s->cap, sizeof *s->held);
    s->colour = bt_realloc(s->colour, s->cap, sizeof *s->colour);
}

/// Position of body i in the block of cell t, −1 = a large one.
static bt_idx in_block(const bt_cells *ts, const bt_cell *t, const bt_idx base[4], bt_idx i)
{
    const bt_idx block[4] = {t->right, t->above, t->diagonal};
    if (i >= t->first && i < t->end) return i - t->first;
    for (int k = 0; k < 3; k++)
        if (block[k] >= 0 && i >= ts->cell[block[k]].first && i < ts->cell[block[k]].end)
            return base[k + 1] + i - ts->cell[block[k]].first;
    return -1;
}

static int colour_contacts(const bt_world *w, const bt_cell *t, bt_pack_scratch *s, bt_idx start[MAX_COLOURS + 2])
{
    const bt_cells *ts = w->cells;
    const bt_bodies *b = &w->bodies;
    const bt_idx block[4] = {t->right, t->above, t->diagonal};
    bt_idx base[4] = {0};
    bt_idx n = t->end - t->first;
    for (int k = 0; k < 3; k++) {
        base[k + 1] = n;
        if (block[k] >= 0) n += ts->cell[block[k]].end - ts->cell[block[k]].first;
    }
    if ((size_t)n > s->cap_used) s->used = bt_realloc(s->used, s->cap_used = 2 * (size_t)n, sizeof *s->used);
    if (n > 0) memset(s->used, 0, (size_t)n * sizeof *s->used);
    bt_idx count[MAX_COLOURS + 1] = {0};
    int n_colours = 0;
    for (size_t k = 0; k < s->n; k++) {
        const bt_manifold *m = &s->man[k];
        const bt_idx i = b->inv[m->a].m > 0 ? in_block(ts, t, base, m->a) : -1,
                     j = b->inv[m->b].m > 0 ? in_block(ts, t, base, m->b) : -1;
        const uint64_t used = (i >= 0 ? s->used[i] : 0) | (j >= 0 ? s->used[j] : 0);
        const int colour = ~used ? __builtin_ctzll(~used) : MAX_COLOURS; // none left: at the end, one by one
        if (colour < MAX_COLOURS && i >= 0) s->used[i] |= (uint64_t)1 << colour;
        if (colour < MAX_COLOURS && j >= 0) s->used[j] |= (uint64_t)1 << colour;
        s->colour[k] = (uint8_t)colour;
        count[colour]++;
        if (colour >= n_colours) n_colours = colour + 1;
    }
    start[0] = 0;
    for (int c = 0; c < n_colours; c++) start[c + 1] = start[c] + count[c];
    return n_colours;
}

/// The contacts of the step before, whose memory that of this step takes.
static void hold(const bt_cell *t, bt_pack_scratch *s)
{
    for (size_t k = 0; k < s->n; k++) {
        const bt_idx at = t->search.pairs[s->pair[k]].contact;
        s->held[k].n = 0;
        if (at < 0) continue;
        const bt_contact *u = &t->contacts[at];
        const bt_gaps *g = &t->gaps[at];
        s->held[k] = (bt_held){u->n, {g->feature[0], g->feature[1]}, {u->ln[0], u->ln[1]}, u->lt, g->row};
    }
}

static void inherit(const bt_manifold *m, const bt_held *h, bt_contact *u)
{
    for (int i = 0; i < m->n_points; i++)
        for (int j = 0; j < h->n; j++)
            if (h->feature[j] == m->p[i].feature) u->ln[i] = h->ln[j];
    // The friction of the points is one number: it stays with the normal impulses that stay.
    const double before = h->n > 1 ? h->ln[0] + h->ln[1] : h->n > 0 ? h->ln[0] : 0;
    const double kept = u->ln[0] + u->ln[1];
    u->lt = before == 0 ? 0 : kept == before ? h->lt : h->lt * (kept / before);
}

/// Sheets that lie on each other (contact/raft.h): components along x and y.
static void fill_sheets(const bt_manifold *m, bt_idx pair, bt_contact *u, bt_gaps *g)
{
    const bt_point *q = &m->p[0];
    *u = (bt_contact){
        .a = m->a, .b = m->b, .nx = 1, .ran = {-q->ra[1]}, .rbn = {-q->rb[1]}, .rat = q->ra[0], .rbt = q->rb[0],
        .pair = pair};
    *g = (bt_gaps){0};
}

void bt_pack_rows(const bt_world *w, const bt_manifold *m, bt_contact *u)
{
    const bt_bodies *b = &w->bodies;
    const double nx = m->nx, ny = m->ny;
    *u = (bt_contact){.a = m->a, .b = m->b, .nx = nx, .ny = ny, .mu = bt_pair_friction(b, m->a, m->b), .n = m->n_points,
                      .pair = u->pair};
    for (int i = 0; i < m->n_points; i++) {
        const bt_point *q = &m->p[i];
        u->ran[i] = q->ra[0] * ny - q->ra[1] * nx;
        u->rbn[i] = q->rb[0] * ny - q->rb[1] * nx;
    }
    u->rat = m->p[0].ra[0] * nx + m->p[0].ra[1] * ny;
    u->rbt = m->p[0].rb[0] * nx + m->p[0].rb[1] * ny;
}

static void fill_contact(const bt_world *w, const bt_manifold *m, bt_idx pair, const bt_held *h, bt_contact *u,
                         bt_gaps *g)
{
    u->pair = pair;
    bt_pack_rows(w, m, u);
    *g = (bt_gaps){0};
    for (int i = 0; i < m->n_points; i++) {
        g->gap[i] = m->p[i].gap;
        g->feature[i] = m->p[i].feature;
    }
    if (w->par.warm_start) inherit(m, h, u);
}

/// Velocity at which point i of these gaps comes to touch at the end of the step, m/s; beyond all speeds where the row
/// is released.
static double place_of(const bt_world *w, const bt_gaps *g, int i)
{
    return g->row == BT_ROW_RELEASED ? RELEASED / w->par.dt : bt_max(g->gap[i], 0) / w->par.dt;
}

/// Normal bias b of model equation (1). Of a pair that passes: contact/contacts.h.
static double bias_of(const bt_world *w, const bt_contact *u, const bt_gaps *g, int i, double restitution)
{
    const bt_bodies *b = &w->bodies;
    if (restitution > 0 && g->row != BT_ROW_RELEASED) {
        // Newton's law on the approach at the start of the step. A pair that would meet within the step rebounds
        // now: letting it close the gap first would lose the approach speed that the law refers to. "Meets" counts
        // from the slop on, or rounding would decide which of two points of a square hit rebounds.
        // Where drag takes part of the approach within the step, the law refers to what is left: the work of a row is
        // λ (w* + w2)/2, and a rebound faster than −w* would add energy.
        const double approach = bt_normal_velocity(u, i, &b->vel_start[u->a], &b->vel_start[u->b]);
        const double closing = bt_normal_velocity(u, i, &b->vel_free[u->a], &b->vel_free[u->b]);
        if (approach < -w->par.rest_speed && g->gap[i] + w->par.dt * bt_min(closing, 0) < w->par.slop)
            return restitution * bt_max(approach, bt_min(closing, 0));
    }
    return place_of(w, g, i);
}

void bt_pack_bias(const bt_world *w, bt_contact *u, const bt_gaps *g, double share)
{
    const double restitution = share * bt_pair_restitution(&w->bodies, u->a, u->b);
    for (int i = 0; i < u->n; i++) u->bias[i] = bias_of(w, u, g, i, restitution);
}

void bt_pack_set_row(const bt_world *w, bt_cell *t, bt_idx j, bt_row_state state)
{
    bt_contact *u = &t->contacts[j];
    bt_gaps *g = &t->gaps[j];
    g->row = state;
    if (state == BT_ROW_RELEASED) u->ln[0] = u->ln[1] = u->lt = 0;
    bt_pack_bias(w, u, g, 1);
    if (t->laws.limits)
        for (int i = 0; i < u->n; i++) t->laws.limits[j].place[i] = place_of(w, g, i);
}

/// State of the row of contact j, made from manifold m; held: what it takes over.
static bt_row_state row_state(const bt_world *w, const bt_cell *t, bt_idx j, const bt_manifold *m, const bt_held *held)
{
    if (w->par.plain_sweeps) return BT_ROW_STAYS; // the reference, and what fields are shaken with
    if (w->stats.repeats > 0 && held->n > 0) return held->row; // of the detection before, in the same step
    if (held->n > 0 && (held->ln[0] != 0 || held->ln[1] != 0)) return BT_ROW_STAYS;
    for (int i = 0; i < m->n_points; i++)
        if (m->p[i].gap <= w->par.slop || t->gaps[j].gap[i] <= w->par.slop) return BT_ROW_STAYS;
    for (int law = 0; t->laws.limits && law < BT_ALL_LAWS; law++)
        if (t->laws.limits[j].record[law] >= 0) return BT_ROW_STAYS; // its outlines are not what touches
    return BT_ROW_OPEN;
}

__attribute__((flatten))
void bt_pack_contacts(bt_world *w, bt_idx k, bt_pack_scratch *s)
{
    bt_cell *t = &w->cells->cell[k];
    hold(t, s);
    if ((bt_idx)s->n > t->cap_contacts) {
        t->cap_contacts = bt_cells_room((bt_idx)s->n);
        free(t->gaps);
        t->gaps = bt_alloc_aligned((size_t)t->cap_contacts, sizeof *t->gaps);
    }
    t->n_contacts = (bt_idx)s->n;
    t->n_points = 0;
    t->overlap = 0;
    bt_cells_make_room(t, s->n * sizeof *t->contacts);
    if (s->n == 0) return;
    const bool bounded = bt_laws_on(&w->par);
    t->laws.rising = bt_laws_rise(&w->par);
    if (bounded) bt_laws_reserve(t);
    bt_idx next[MAX_COLOURS + 2] = {0};
    if (t->phase < BT_COLOURS) colour_contacts(w, t, s, next);
    else memset(s->colour, 0, s->n); // in sequence
    for (size_t i = 0; i < s->n; i++) {
        bt_pair *p = &t->search.pairs[s->pair[i]];
        const bt_idx at = next[s->colour[i]]++;
        bt_contact *u = &t->contacts[at];
        if (s->man[i].n_points == 0) {
            fill_sheets(&s->man[i], s->pair[i], u, &t->gaps[at]);
            bt_laws_bound(w, t, at, p, &s->man[i]);
            continue;
        }
        fill_contact(w, &s->man[i], s->pair[i], &s->held[i], u, &t->gaps[at]);
        if (bounded) bt_laws_bound(w, t, at, p, &s->man[i]); // the gaps may be others after it
        bt_pack_set_row(w, t, at, row_state(w, t, at, &s->man[i], &s->held[i]));
        p->contact = at;
        t->n_points += u->n;
        // Of what is left of the outlines. 0 − gap, not −gap: a contact that just touches must not make the deepest
        // overlap −0 on the one rank that holds it alone.
        for (int j = 0; j < u->n; j++) t->overlap = bt_max(t->overlap, 0 - t->gaps[at].gap[j]);
    }
}
