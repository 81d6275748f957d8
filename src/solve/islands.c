// SPDX-License-Identifier: MIT
// Union-find over contacts; names and sums over ranks: partition/share.c.
#include "solve/islands.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/elementary.h"
#include "contact/row.h"
#include "partition/domain.h"
#include "solve/batch.h"
#include "solve/kernel.h"
#include "solve/rounds.h"
#include "solve/solver.h"
#include "space/phases.h"

bt_islands *bt_islands_create(void) { return bt_alloc(1, sizeof(bt_islands)); }

void bt_islands_free(bt_islands *islands)
{
    if (!islands) return;
    free(islands->root);
    free(islands->name);
    free(islands->share);
    free(islands->sum);
    free(islands);
}

/// With path halving.
static bt_idx islands_root(bt_islands *islands, bt_idx i)
{
    while (islands->root[i] != i) i = islands->root[i] = islands->root[islands->root[i]];
    return i;
}

bt_idx bt_islands_of(const bt_world *world, bt_islands *islands, const bt_contact *contact)
{
    return islands_root(islands, world->bodies.inv[contact->a].m > 0 ? contact->a : contact->b);
}

static void make_room(const bt_bodies *bodies, bt_islands *islands)
{
    if (bodies->n > islands->cap) {
        islands->cap = bodies->n;
        islands->root = bt_realloc(islands->root, (size_t)bodies->n, sizeof *islands->root);
        islands->name = bt_realloc(islands->name, (size_t)bodies->n, sizeof *islands->name);
        islands->share = bt_realloc(islands->share, (size_t)bodies->n, sizeof *islands->share);
        islands->sum = bt_realloc(islands->sum, (size_t)bodies->n, sizeof *islands->sum);
    }
    for (bt_idx i = 0; i < bodies->n; i++) {
        islands->root[i] = i;
        islands->name[i] = bodies->gid[i];
        islands->share[i] = 1;
    }
}

static void join(const bt_world *world, bt_islands *islands, const bt_contact *contact)
{
    const bt_inv *inv = world->bodies.inv;
    if (inv[contact->a].m == 0 || inv[contact->b].m == 0) return;
    islands->root[islands_root(islands, contact->b)] = islands_root(islands, contact->a);
}

/// Collective. Give the islands of several ranks that meet in a body one name.
static void join_ranks(bt_world *world, bt_islands *islands)
{
    const bt_bodies *bodies = &world->bodies;
    if (!world->domain) return;
    bt_gid *name = bt_alloc((size_t)bodies->n, sizeof *name);
    for (bt_idx i = 0; i < bodies->n; i++) name[i] = islands->name[islands_root(islands, i)];
    bt_domain_join_names(world, name);
    for (bt_idx i = 0; i < bodies->n; i++)
        if (islands->root[i] == i) islands->name[i] = name[i];
    free(name);
}

void bt_islands_make(bt_world *world, bt_islands *islands)
{
    const bt_cells *ts = world->cells;
    make_room(&world->bodies, islands);
    for (bt_idx i = 0; i < ts->n_order; i++) {
        const bt_cell *cell = &ts->cell[ts->order[i]];
        for (bt_idx j = 0; j < cell->n_contacts; j++) join(world, islands, &cell->contacts[j]);
    }
    join_ranks(world, islands);
}

void bt_islands_clear(const bt_world *world, bt_islands *islands)
{
    for (bt_idx i = 0; i < world->bodies.n; i++) islands->sum[i] = (bt_sum){0};
}

void bt_islands_add(const bt_world *world, bt_islands *islands)
{
    if (world->domain) bt_domain_add_by_name(world, islands->root, islands->name, islands->sum);
}

// --- bodies that cannot give way -------------------------------------------------------------------------------------

// A and P of islands.h by island; sums are exact, so that ranks and threads do not matter.

/// A contact whose load is unbounded, with its load λ in the proof.
typedef struct {
    bt_contact u;    ///< without its bias; friction 0 where the proof takes none
    double bias[2];
    double at_first; ///< sum of the normal impulses at the end of the sweeps, N s
} hard;

/// These contacts on this rank: cell k has contact[first[k]] to contact[first[k + 1] − 1].
typedef struct {
    hard *contact;
    bt_idx *first;
    double closing; ///< the largest closing speed without loads, m/s
} loads;

/// Is contact j of the cell loaded, and its load unbounded?
static bool is_hard(const bt_cell *cell, const bt_contact *contact, bt_idx j)
{
    if (contact->n == 0 || contact->ln[0] + contact->ln[1] == 0) return false;
    const bt_limit *limit = cell->laws->limits ? &cell->laws->limits[j] : NULL;
    return !limit || !(isfinite(limit->most[0]) || (contact->n > 1 && isfinite(limit->most[1])));
}

/// Collect these contacts, and the largest closing speed without loads. whole: only those of these islands whose share
/// is not 0, or NULL.
static loads collect(const bt_world *world, bt_islands *whole)
{
    const bt_cells *cells = world->cells;
    const bt_vel *at_first = world->bodies.vel_free;
    loads found = {.first = bt_alloc((size_t)cells->n + 1, sizeof *found.first), .closing = world->par.tolerance};
    bool *works = bt_alloc((size_t)cells->n, sizeof *works);
    size_t n = 0, most = 0;
    for (bt_idx i = 0; i < cells->n_order; i++) {
        const size_t n_here = (size_t)cells->cell[cells->order[i]].n_contacts;
        works[cells->order[i]] = true;
        n += n_here, most = bt_max(most, n_here);
    }
    bt_contact *copy = bt_alloc_unset(most + 1, sizeof *copy);
    found.contact = bt_alloc(n + 1, sizeof *found.contact);
    for (bt_idx k = 0; k < cells->n; k++) {
        const bt_cell *cell = &cells->cell[k];
        found.first[k + 1] = found.first[k];
        const bt_contact *contacts = works[k] ? bt_batch_read(cell, copy) : NULL;
        for (bt_idx j = 0; works[k] && j < cell->n_contacts; j++) {
            const bt_contact *contact = &contacts[j];
            if (!is_hard(cell, contact, j) || (whole && whole->share[bt_islands_of(world, whole, contact)] == 0))
                continue;
            hard *h = &found.contact[found.first[k + 1]++];
            *h = (hard){*contact, {contact->bias[0], contact->bias[1]}, contact->ln[0] + contact->ln[1]};
            h->u.bias[0] = h->u.bias[1] = 0;
            for (int c = 0; c < contact->n; c++)
                found.closing = bt_max(found.closing,
                                       -bt_normal_velocity(contact, c, &at_first[contact->a], &at_first[contact->b]));
        }
    }
    free(works), free(copy);
    bt_domain_maxima(world, &found.closing, 1);
    return found;
}

/// Collective. The islands of these contacts.
static bt_islands *islands_of(bt_world *world, const loads *found)
{
    bt_islands *islands = bt_islands_create();
    make_room(&world->bodies, islands);
    for (bt_idx i = 0; i < found->first[world->cells->n]; i++) join(world, islands, &found->contact[i].u);
    join_ranks(world, islands);
    return islands;
}

static void no_change(bt_world *world, bt_idx k, const void *context, bt_totals *totals)
{
    (void)context, (void)totals;
    const bt_cell *cell = &world->cells->cell[k];
    memset(world->solver->shift + cell->first, 0, (size_t)(cell->end - cell->first) * sizeof *world->solver->shift);
}

static void push(bt_world *world, bt_idx k, const void *context, bt_totals *totals)
{
    (void)totals;
    const loads *found = context;
    bt_vel *change = world->solver->shift;
    const bt_inv *inv = world->bodies.inv;
    for (bt_idx i = found->first[k]; i < found->first[k + 1]; i++) {
        const bt_contact *contact = &found->contact[i].u;
        bt_vel va = change[contact->a], vb = change[contact->b];
        bt_apply(contact, contact->ln[0] + contact->ln[1],
                 contact->ln[0] * contact->ran[0] + contact->ln[1] * contact->ran[1], contact->ln[0] * contact->rbn[0] +
                 contact->ln[1] * contact->rbn[1], contact->lt, inv[contact->a], inv[contact->b], &va, &vb);
        bt_store(&change[contact->a], inv[contact->a], &va);
        bt_store(&change[contact->b], inv[contact->b], &vb);
    }
}

/// Write M⁻¹Jᵀλ to the array of the position projection.
static void form_change(bt_world *world, const loads *found)
{
    bt_totals totals = {0};
    bt_phases_run(world, BT_WITH_WORK, &(bt_before){no_change, NULL}, push, found, world->solver->shift, &totals);
    bt_domain_settle(world, world->solver->shift);
}

static void relax(bt_world *world, bt_idx k, const void *context, bt_totals *totals)
{
    const loads *found = context;
    for (bt_idx i = found->first[k]; i < found->first[k + 1]; i++) {
        bt_contact *contact = &found->contact[i].u;
        const bt_mass m = bt_mass_of(contact, world->bodies.inv);
        totals->most =
            bt_max(totals->most, bt_update_contact(contact, &m, NULL, world->solver->shift, world->bodies.inv));
    }
}

/// Bring λ to loads that balance each other, with the friction of sticking contacts: sweeps of the same problem with U*
/// = 0 and b = 0.
static void balance(bt_world *world, const loads *found)
{
    form_change(world, found);
    for (int sweep = 0; sweep < BT_LOCKED_SWEEPS; sweep++) {
        bt_totals totals = {0};
        bt_phases_run(world, BT_WITH_WORK, NULL, relax, found, world->solver->shift, &totals);
        bt_domain_maxima(world, &totals.most, 1);
        if (totals.most <= BT_LOCKED_AT_REST * found->closing) break;
    }
}

/// Write A of each island to share.
static void power_of_closing(bt_world *world, bt_islands *islands, const loads *found)
{
    const bt_vel *v = world->bodies.vel;
    bt_islands_clear(world, islands);
    for (bt_idx i = 0; i < found->first[world->cells->n]; i++) {
        const bt_contact *contact = &found->contact[i].u;
        double power = -contact->lt * bt_tangent_velocity(contact, &v[contact->a], &v[contact->b]);
        for (int c = 0; c < contact->n; c++)
            power -= contact->ln[c] * (bt_normal_velocity(contact, c, &v[contact->a], &v[contact->b]) +
                                       found->contact[i].bias[c]);
        bt_sum_add(&islands->sum[bt_islands_of(world, islands, contact)], power);
    }
    bt_islands_add(world, islands);
    for (bt_idx i = 0; i < world->bodies.n; i++) islands->share[i] = bt_sum_value(&islands->sum[i]);
}

/// Write P of each island to sum.
static void imbalance(bt_world *world, bt_islands *islands)
{
    const bt_bodies *bodies = &world->bodies;
    const bt_cells *ts = world->cells;
    bt_islands_clear(world, islands);
    for (bt_idx k = 0; k < ts->n_busy; k++) {
        const bt_cell *cell = &ts->cell[ts->busy[k]];
        for (bt_idx i = cell->first; cell->own && i < cell->end; i++) {
            const bt_vel *d = &world->solver->shift[i];
            if (bodies->inv[i].m == 0 || (d->x == 0 && d->y == 0 && d->w == 0)) continue;
            const double moment = bodies->inv[i].i > 0 ? fabs(d->w) / (bodies->inv[i].i * bodies->radius[i]) : 0;
            bt_sum_add(&islands->sum[islands_root(islands, i)], bt_hypot(d->x, d->y) / bodies->inv[i].m + moment);
        }
    }
    bt_islands_add(world, islands);
}

/// Strike out islands whose A is at most `speed` times their sum.
static void drop_islands_below(bt_world *world, bt_islands *islands, double speed)
{
    for (bt_idx i = 0; i < world->bodies.n; i++)
        if (!(islands->share[i] > speed * bt_sum_value(&islands->sum[i]))) islands->share[i] = 0;
}

static double normal_load(const hard *h) { return h->u.ln[0] + h->u.ln[1]; }
static double above_rounding(const hard *h) { return normal_load(h) - BT_LOCKED_ROUNDING * h->at_first; }
static double moved(const hard *h) { return fabs(normal_load(h) - h->at_first) - BT_LOCKED_OTHER * h->at_first; }

/// Write the sum of a quantity of the contacts of each island to sum.
static void add_contacts(bt_world *world, bt_islands *islands, const loads *found, double (*of)(const hard *h))
{
    bt_islands_clear(world, islands);
    for (bt_idx i = 0; i < found->first[world->cells->n]; i++)
        bt_sum_add(&islands->sum[bt_islands_of(world, islands, &found->contact[i].u)], of(&found->contact[i]));
    bt_islands_add(world, islands);
}

/// Strike out islands that close no faster than the tolerance.
static void drop_islands_not_closing(bt_world *world, bt_islands *islands, const loads *found)
{
    add_contacts(world, islands, found, normal_load);
    drop_islands_below(world, islands, world->par.tolerance);
}

/// Strike out islands whose balanced loads are no more than rounding errors: they prove nothing.
static void drop_islands_without_loads(bt_world *world, bt_islands *islands, const loads *found)
{
    add_contacts(world, islands, found, above_rounding);
    for (bt_idx i = 0; i < world->bodies.n; i++)
        if (!(bt_sum_value(&islands->sum[i]) > 0)) islands->share[i] = 0;
}

/// Strike out islands whose balanced loads differ from those at the end of the sweeps.
static void drop_islands_moved(bt_world *world, bt_islands *islands, const loads *found)
{
    add_contacts(world, islands, found, moved);
    for (bt_idx i = 0; i < world->bodies.n; i++)
        if (bt_sum_value(&islands->sum[i]) > 0) islands->share[i] = 0;
}

/// Write A to share for islands whose A/P exceeds any plausible speed, 0 for all others.
static void mark(bt_world *world, bt_islands *islands, const loads *found, double speeds)
{
    form_change(world, found);
    power_of_closing(world, islands, found);
    imbalance(world, islands);
    drop_islands_below(world, islands, speeds * found->closing);
}

/// Is any island marked, and is one of these in contact with the towed body?
static bt_lock marked(const bt_world *world, bt_islands *islands, const loads *l)
{
    const bt_idx towed = bt_world_towed(world);
    double found[2] = {0};
    for (bt_idx i = 0; i < world->bodies.n; i++)
        if (islands->root[i] == i && islands->share[i] > 0) found[0] = 1;
    for (bt_idx i = 0; towed >= 0 && i < l->first[world->cells->n]; i++) {
        const bt_contact *contact = &l->contact[i].u;
        if ((contact->a == towed || contact->b == towed) && islands->share[bt_islands_of(world, islands, contact)] > 0)
            found[1] = 1;
    }
    bt_domain_maxima(world, found, 2);
    return (bt_lock){found[0] > 0, found[1] > 0};
}

/// Keep in the proof the friction of sticking contacts (if `held`), or none.
static void take_friction(const bt_world *world, const loads *found, bool held)
{
    for (bt_idx i = 0; i < found->first[world->cells->n]; i++) {
        bt_contact *contact = &found->contact[i].u;
        contact->mu *= BT_LOCKED_STICKS;
        if (!held || fabs(contact->lt) > contact->mu * (contact->ln[0] + contact->ln[1]))
            contact->mu = 0, contact->lt = 0;
    }
}

/// The proof by balanced loads, from normal impulses alone or with the friction that holds.
static bt_lock by_balance(bt_world *world, bt_islands *islands, const loads *found, bool held)
{
    const size_t n = (size_t)found->first[world->cells->n];
    loads l = *found;
    l.contact = bt_alloc(n + 1, sizeof *l.contact);
    memcpy(l.contact, found->contact, n * sizeof *l.contact);
    take_friction(world, &l, held);
    balance(world, &l);
    mark(world, islands, &l, held ? BT_LOCKED_HELD_SPEEDS : BT_LOCKED_SPEEDS);
    drop_islands_not_closing(world, islands, &l);
    drop_islands_without_loads(world, islands, &l);
    if (held) drop_islands_moved(world, islands, &l);
    free(l.contact);
    return marked(world, islands, found);
}

bt_lock bt_locked(bt_world *world)
{
    const loads found = collect(world, NULL);
    bt_islands *islands = islands_of(world, &found);
    bt_rounds_make_shift(world);
    bt_lock lock = {0};
    for (int held = 0; held < 2 && !lock.towed; held++) {
        const bt_lock more = by_balance(world, islands, &found, held);
        lock = (bt_lock){lock.found || more.found, more.towed};
    }
    bt_islands_free(islands);
    free(found.contact), free(found.first);
    return lock;
}

static double rebounds(const hard *h) { return bt_rebounds(h->bias); }

bool bt_locked_by_rebounds(bt_world *world, bt_islands *whole)
{
    bt_domain_settle(world, NULL);
    const loads found = collect(world, whole);
    bt_islands *islands = islands_of(world, &found);
    bt_rounds_make_shift(world);
    double any = 0;
    bt_islands_clear(world, whole);
    for (int held = 0; held < 2; held++) {
        if (!by_balance(world, islands, &found, held).found) continue;
        add_contacts(world, islands, &found, rebounds);
        for (bt_idx i = 0; i < found.first[world->cells->n]; i++) {
            const bt_contact *contact = &found.contact[i].u;
            const bt_idx part = bt_islands_of(world, islands, contact);
            if (!(islands->share[part] > 0 && bt_sum_value(&islands->sum[part]) > 0)) continue;
            bt_sum_add(&whole->sum[bt_islands_of(world, whole, contact)], 1);
            any = 1;
        }
    }
    bt_islands_add(world, whole);
    bt_domain_maxima(world, &any, 1);
    bt_islands_free(islands);
    free(found.contact), free(found.first);
    return any > 0;
}
