// SPDX-License-Identifier: MIT
// Union-find over contacts; names and sums over ranks: partition/share.c.
#include "solve/islands.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/elementary.h"
#include "contact/row.h"
#include "partition/domain.h"
#include "solve/kernel.h"
#include "solve/solver.h"
#include "space/phases.h"

bt_islands *bt_islands_create(void) { return bt_alloc(1, sizeof(bt_islands)); }

void bt_islands_free(bt_islands *s)
{
    if (!s) return;
    free(s->root);
    free(s->name);
    free(s->share);
    free(s->sum);
    free(s);
}

/// With path halving.
static bt_idx islands_root(bt_islands *s, bt_idx i)
{
    while (s->root[i] != i) i = s->root[i] = s->root[s->root[i]];
    return i;
}

bt_idx bt_islands_of(const bt_world *w, bt_islands *s, const bt_contact *u)
{
    return islands_root(s, w->bodies.inv[u->a].m > 0 ? u->a : u->b);
}

static void make_room(const bt_bodies *b, bt_islands *s)
{
    if (b->n > s->cap) {
        s->cap = b->n;
        s->root = bt_realloc(s->root, (size_t)b->n, sizeof *s->root);
        s->name = bt_realloc(s->name, (size_t)b->n, sizeof *s->name);
        s->share = bt_realloc(s->share, (size_t)b->n, sizeof *s->share);
        s->sum = bt_realloc(s->sum, (size_t)b->n, sizeof *s->sum);
    }
    for (bt_idx i = 0; i < b->n; i++) {
        s->root[i] = i;
        s->name[i] = b->gid[i];
        s->share[i] = 1;
    }
}

void bt_islands_make(bt_world *w, bt_islands *s, bool (*joins)(const bt_cell *cell, bt_idx contact))
{
    const bt_cells *ts = w->cells;
    const bt_bodies *b = &w->bodies;
    make_room(b, s);
    for (bt_idx i = 0; i < ts->n_order; i++) {
        const bt_cell *cell = &ts->cell[ts->order[i]];
        for (bt_idx j = 0; j < cell->n_contacts; j++) {
            const bt_contact *u = &cell->contacts[j];
            if (b->inv[u->a].m == 0 || b->inv[u->b].m == 0 || (joins && !joins(cell, j))) continue;
            s->root[islands_root(s, u->b)] = islands_root(s, u->a);
        }
    }
    if (!w->domain) return;
    bt_gid *name = bt_alloc((size_t)b->n, sizeof *name);
    for (bt_idx i = 0; i < b->n; i++) name[i] = s->name[islands_root(s, i)];
    bt_domain_join_names(w, name);
    for (bt_idx i = 0; i < b->n; i++)
        if (s->root[i] == i) s->name[i] = name[i];
    free(name);
}

void bt_islands_clear(const bt_world *w, bt_islands *s)
{
    for (bt_idx i = 0; i < w->bodies.n; i++) s->sum[i] = (bt_sum){0};
}

void bt_islands_add(const bt_world *w, bt_islands *s)
{
    if (w->domain) bt_domain_add_by_name(w, s->root, s->name, s->sum);
}

// --- bodies that cannot give way -------------------------------------------------------------------------------------

// A and P of islands.h by island; sums are exact, so that ranks and threads do not matter.

/// A contact whose load has no bound, with the load λ of the proof.
typedef struct {
    bt_contact u;    ///< without its bias; friction 0 where the proof takes none
    double bias[2];
    double at_first; ///< sum of the normal impulses that the sweeps have come to, N s
} hard;

/// Those of this rank: cell k has contact[first[k]] to contact[first[k + 1] − 1].
typedef struct {
    hard *contact;
    bt_idx *first;
    double closing; ///< the largest speed of closing without loads, m/s
} loads;

/// Does it bear load, and any load?
static bool is_hard(const bt_cell *cell, bt_idx j)
{
    const bt_contact *u = &cell->contacts[j];
    if (u->n == 0 || u->ln[0] + u->ln[1] == 0) return false;
    const bt_limit *k = cell->laws.limits ? &cell->laws.limits[j] : NULL;
    return !k || !(isfinite(k->most[0]) || (u->n > 1 && isfinite(k->most[1])));
}

/// The contacts of this rank, and how fast they would close.
static loads collect(const bt_world *w)
{
    const bt_cells *cells = w->cells;
    const bt_vel *at_first = w->bodies.vel_free;
    loads l = {.first = bt_alloc((size_t)cells->n + 1, sizeof *l.first), .closing = w->par.tolerance};
    bool *works = bt_alloc((size_t)cells->n, sizeof *works);
    size_t n = 0;
    for (bt_idx i = 0; i < cells->n_order; i++) {
        works[cells->order[i]] = true;
        n += (size_t)cells->cell[cells->order[i]].n_contacts;
    }
    l.contact = bt_alloc(n + 1, sizeof *l.contact);
    for (bt_idx k = 0; k < cells->n; k++) {
        const bt_cell *cell = &cells->cell[k];
        l.first[k + 1] = l.first[k];
        for (bt_idx j = 0; works[k] && j < cell->n_contacts; j++) {
            if (!is_hard(cell, j)) continue;
            const bt_contact *u = &cell->contacts[j];
            hard *h = &l.contact[l.first[k + 1]++];
            *h = (hard){*u, {u->bias[0], u->bias[1]}, u->ln[0] + u->ln[1]};
            h->u.bias[0] = h->u.bias[1] = 0;
            for (int c = 0; c < u->n; c++)
                l.closing = bt_max(l.closing, -bt_normal_velocity(u, c, &at_first[u->a], &at_first[u->b]));
        }
    }
    free(works);
    bt_domain_maxima(w, &l.closing, 1);
    return l;
}

static void no_change(bt_world *w, bt_idx k, const void *context, bt_totals *t)
{
    (void)context, (void)t;
    const bt_cell *cell = &w->cells->cell[k];
    memset(w->solver->shift + cell->first, 0, (size_t)(cell->end - cell->first) * sizeof *w->solver->shift);
}

static void push(bt_world *w, bt_idx k, const void *context, bt_totals *t)
{
    (void)t;
    const loads *l = context;
    bt_vel *change = w->solver->shift;
    const bt_inv *inv = w->bodies.inv;
    for (bt_idx i = l->first[k]; i < l->first[k + 1]; i++) {
        const bt_contact *u = &l->contact[i].u;
        bt_vel va = change[u->a], vb = change[u->b];
        bt_apply(u, u->ln[0] + u->ln[1], u->ln[0] * u->ran[0] + u->ln[1] * u->ran[1],
                 u->ln[0] * u->rbn[0] + u->ln[1] * u->rbn[1], u->lt, inv[u->a], inv[u->b], &va, &vb);
        bt_store(&change[u->a], inv[u->a], &va);
        bt_store(&change[u->b], inv[u->b], &vb);
    }
}

/// M⁻¹Jᵀλ into the array of the position projection.
static void form_change(bt_world *w, const loads *l)
{
    bt_totals t = {0};
    bt_phases_run(w, &(bt_before){no_change, NULL}, push, l, w->solver->shift, &t);
    bt_domain_settle(w, w->solver->shift);
}

static void relax(bt_world *w, bt_idx k, const void *context, bt_totals *t)
{
    const loads *l = context;
    for (bt_idx i = l->first[k]; i < l->first[k + 1]; i++) {
        bt_contact *u = &l->contact[i].u;
        const bt_mass m = bt_mass_of(u, w->bodies.inv);
        t->most = bt_max(t->most, bt_update_contact(u, &m, NULL, w->solver->shift, w->bodies.inv));
    }
}

/// λ to loads that balance each other, with the friction of contacts that stick: sweeps of the same problem with all
/// that drives it at rest.
static void balance(bt_world *w, const loads *l)
{
    form_change(w, l);
    for (int sweep = 0; sweep < BT_LOCKED_SWEEPS; sweep++) {
        bt_totals t = {0};
        bt_phases_run(w, NULL, relax, l, w->solver->shift, &t);
        bt_domain_maxima(w, &t.most, 1);
        if (t.most <= BT_LOCKED_AT_REST * l->closing) break;
    }
}

/// A of each island into share.
static void power_of_closing(bt_world *w, bt_islands *s, const loads *l)
{
    const bt_vel *v = w->bodies.vel;
    bt_islands_clear(w, s);
    for (bt_idx i = 0; i < l->first[w->cells->n]; i++) {
        const bt_contact *u = &l->contact[i].u;
        double power = -u->lt * bt_tangent_velocity(u, &v[u->a], &v[u->b]);
        for (int c = 0; c < u->n; c++)
            power -= u->ln[c] * (bt_normal_velocity(u, c, &v[u->a], &v[u->b]) + l->contact[i].bias[c]);
        bt_sum_add(&s->sum[bt_islands_of(w, s, u)], power);
    }
    bt_islands_add(w, s);
    for (bt_idx i = 0; i < w->bodies.n; i++) s->share[i] = bt_sum_value(&s->sum[i]);
}

/// P of each island into sum.
static void imbalance(bt_world *w, bt_islands *s)
{
    const bt_bodies *b = &w->bodies;
    const bt_cells *ts = w->cells;
    bt_islands_clear(w, s);
    for (bt_idx k = 0; k < ts->n_busy; k++) {
        const bt_cell *cell = &ts->cell[ts->busy[k]];
        for (bt_idx i = cell->first; cell->own && i < cell->end; i++) {
            const bt_vel *d = &w->solver->shift[i];
            if (b->inv[i].m == 0 || (d->x == 0 && d->y == 0 && d->w == 0)) continue;
            const double moment = b->inv[i].i > 0 ? fabs(d->w) / (b->inv[i].i * b->radius[i]) : 0;
            bt_sum_add(&s->sum[islands_root(s, i)], bt_hypot(d->x, d->y) / b->inv[i].m + moment);
        }
    }
    bt_islands_add(w, s);
}

/// Strike out islands whose A is no more than `speed` times their sum.
static void drop_islands_below(bt_world *w, bt_islands *s, double speed)
{
    for (bt_idx i = 0; i < w->bodies.n; i++)
        if (!(s->share[i] > speed * bt_sum_value(&s->sum[i]))) s->share[i] = 0;
}

/// Strike out islands that close by no more than the tolerance.
static void drop_islands_not_closing(bt_world *w, bt_islands *s, const loads *l)
{
    bt_islands_clear(w, s);
    for (bt_idx i = 0; i < l->first[w->cells->n]; i++) {
        const bt_contact *u = &l->contact[i].u;
        bt_sum_add(&s->sum[bt_islands_of(w, s, u)], u->ln[0] + u->ln[1]);
    }
    bt_islands_add(w, s);
    drop_islands_below(w, s, w->par.tolerance);
}

/// Strike out islands whose loads are not those that the sweeps have come to.
static void drop_islands_moved(bt_world *w, bt_islands *s, const loads *l)
{
    bt_islands_clear(w, s);
    for (bt_idx i = 0; i < l->first[w->cells->n]; i++) {
        const bt_contact *u = &l->contact[i].u;
        const double was = l->contact[i].at_first;
        bt_sum_add(&s->sum[bt_islands_of(w, s, u)], fabs(u->ln[0] + u->ln[1] - was) - BT_LOCKED_OTHER * was);
    }
    bt_islands_add(w, s);
    for (bt_idx i = 0; i < w->bodies.n; i++)
        if (bt_sum_value(&s->sum[i]) > 0) s->share[i] = 0;
}

/// A of the islands in which A/P is beyond what gives way into share, 0 for all others.
static void mark(bt_world *w, bt_islands *s, const loads *l, double speeds)
{
    form_change(w, l);
    power_of_closing(w, s, l);
    imbalance(w, s);
    drop_islands_below(w, s, speeds * l->closing);
}

/// Is an island marked, and one that presses on the towed body?
static bt_lock marked(const bt_world *w, bt_islands *s, const loads *l)
{
    const bt_idx towed = bt_world_towed(w);
    double found[2] = {0};
    for (bt_idx i = 0; i < w->bodies.n; i++)
        if (s->root[i] == i && s->share[i] > 0) found[0] = 1;
    for (bt_idx i = 0; towed >= 0 && i < l->first[w->cells->n]; i++) {
        const bt_contact *u = &l->contact[i].u;
        if ((u->a == towed || u->b == towed) && s->share[bt_islands_of(w, s, u)] > 0) found[1] = 1;
    }
    bt_domain_maxima(w, found, 2);
    return (bt_lock){found[0] > 0, found[1] > 0};
}

/// Friction of the contacts that stick, or of none, is in the proof.
static void take_friction(const bt_world *w, const loads *l, bool held)
{
    for (bt_idx i = 0; i < l->first[w->cells->n]; i++) {
        bt_contact *u = &l->contact[i].u;
        u->mu *= BT_LOCKED_STICKS;
        if (!held || fabs(u->lt) > u->mu * (u->ln[0] + u->ln[1])) u->mu = 0, u->lt = 0;
    }
}

/// The proof by loads that are balanced first, of normals alone or with the friction that holds.
static bt_lock by_balance(bt_world *w, bt_islands *s, const loads *found, bool held)
{
    const size_t n = (size_t)found->first[w->cells->n];
    loads l = *found;
    l.contact = bt_alloc(n + 1, sizeof *l.contact);
    memcpy(l.contact, found->contact, n * sizeof *l.contact);
    take_friction(w, &l, held);
    balance(w, &l);
    mark(w, s, &l, held ? BT_LOCKED_HELD_SPEEDS : BT_LOCKED_SPEEDS);
    drop_islands_not_closing(w, s, &l);
    if (held) drop_islands_moved(w, s, &l);
    free(l.contact);
    return marked(w, s, found);
}

bt_lock bt_locked(bt_world *w)
{
    bt_islands *s = w->solver->islands;
    const loads l = collect(w);
    bt_solver_make_shift(w);
    bt_islands_make(w, s, is_hard);
    bt_lock lock = {0};
    for (int held = 0; held < 2 && !lock.towed; held++) {
        const bt_lock more = by_balance(w, s, &l, held);
        lock = (bt_lock){lock.found || more.found, more.towed};
    }
    free(l.contact), free(l.first);
    return lock;
}
