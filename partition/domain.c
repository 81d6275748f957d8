// SPDX-License-Identifier: MIT
// The division of a world among ranks, as used by the program: sums over the ranks, the measure of balance.
//
// The work of a cell is modelled from counts and the costs of a contact, a pair and a body in a step, not timed, so
// that a run is reproducible. Timing single cells costs more than it tells, and noise would move cells to and fro.
#include "partition/domain.h"

#include <math.h>
#include <string.h>

#include "partition/division.h"

#define LASTS 4         // a gain that has lasted for some steps is expected to last for so many times these steps
#define IMBALANCE 0.05  // of the work; a division that was made without knowing the work, and has more, is made anew
enum { CHECK_STEPS = 10 };
// Seconds, measured on one core.
#define CONTACT_SWEEP 30e-9
#define CONTACT_STEP 300e-9
#define PAIR 60e-9
#define BODY 120e-9
#define DIVISION 0.5e-6 // a new division, per body of a rank: the cut and the migration
#define NEW_LISTS 4     // and, in the work of a step besides its sweeps: new lists of pairs

static bool owns_cell(const bt_world *world, int32_t x, int32_t y)
{
    return !world->domain || bt_division_owner(world, x, y) == world->domain->comm->rank;
}

static bool owns_large(const bt_world *world)
{
    return !world->domain || world->domain->large_owner == world->domain->comm->rank;
}

static void need(const bt_world *world, int32_t x, int32_t y)
{
    const bt_domain *domain = world->domain;
    const int64_t p = bt_division_place(world, x, y);
    if (p < 0 || domain->under[p] || domain->undivided) return;
    fprintf(stderr,
            "bergtow: step %lld: rank %d has a large body near floes that the ranks do not exchange; please report "
            "this case, and run it on one rank\n",
            (long long)world->step, domain->comm->rank);
    bt_comm_abort(BT_ERR_NUMERIC);
}

static bool is_due(const bt_world *world) { return world->domain && world->domain->due; }

static const bt_exchange exchange = {
    .maxima = bt_domain_maxima,
    .owns_cell = owns_cell,
    .owns_large = owns_large,
    .need = need,
    .due = is_due,
    .migrate = bt_domain_migrate,
    .connect = bt_domain_connect,
    .send = bt_domain_send,
    .receive = bt_domain_receive,
};

void bt_domain_create(bt_world *world, const bt_comm *comm)
{
    if (comm->size == 1) return;
    bt_domain *domain = world->domain = bt_alloc(1, sizeof *domain);
    domain->comm = comm;
    domain->due = true;
    domain->wait = 1;
    world->exchange = &exchange;
}

void bt_domain_free(bt_domain *domain)
{
    if (!domain) return;
    bt_halo_free(domain);
    void *arrays[] = {domain->owner, domain->under, domain->owned, domain->touched, domain->work, domain};
    for (size_t i = 0; i < sizeof arrays / sizeof *arrays; i++) free(arrays[i]);
}

bt_domain_stats bt_domain_get_stats(const bt_world *world)
{
    bt_domain_stats stats = world->domain ? world->domain->stats : (bt_domain_stats){0};
    stats.imbalance /= (double)stats.checks;
    stats.repartition_imbalance /= (double)stats.divisions;
    if (stats.checks == 0) stats.worst_imbalance = NAN;
    if (stats.divisions == 0) stats.worst_repartition_imbalance = NAN;
    return stats;
}

double bt_domain_exchange_time(const bt_world *world)
{
    if (!world->domain) return 0;
    const double t = world->domain->exchange_s;
    world->domain->exchange_s = 0;
    return t;
}

bool bt_domain_owns(const bt_world *world, bt_idx i)
{
    return !world->domain || !world->domain->distributed || world->domain->owned[i];
}

void bt_domain_follow(bt_world *world, const bt_idx *from)
{
    bt_domain *domain = world->domain;
    if (!domain || !domain->distributed) return;
    const bt_idx n = world->bodies.n;
    if (n > domain->cap_owned) {
        domain->cap_owned = n;
        domain->touched = bt_realloc(domain->touched, (size_t)n, 1);
    }
    uint8_t *owned = bt_alloc((size_t)domain->cap_owned, sizeof *owned);
    for (bt_idx i = 0; i < n; i++) owned[i] = domain->owned[from[i]];
    free(domain->owned);
    domain->owned = owned;
}

// --- sums ------------------------------------------------------------------------------------------------------------

void bt_domain_maxima(const bt_world *world, double *x, int n)
{
    if (!world->domain) return;
    const double t0 = bt_clock();
    bt_comm_reduce(world->domain->comm, NULL, 0, x, n, NULL, 0);
    world->domain->exchange_s += bt_clock() - t0;
}

void bt_domain_reduce(const bt_world *world, bt_totals *totals)
{
    if (!world->domain) return;
    const double t0 = bt_clock();
    bt_comm_reduce(world->domain->comm, totals->sum, totals->n_sums, &totals->most, 1, NULL, 0);
    world->domain->exchange_s += bt_clock() - t0;
}

double *bt_domain_gather(const bt_world *world, int64_t n, int width, const double *rows, int64_t *total)
{
    const double t0 = bt_clock();
    double *all = bt_comm_gather(world->domain->comm, n, width, rows, total);
    world->domain->exchange_s += bt_clock() - t0;
    return all;
}

uint64_t bt_domain_sum_words(const bt_world *world, uint64_t x)
{
    if (!world->domain) return x;
    bt_sum sum = {.v = (bt_int128)x};
    bt_comm_reduce(world->domain->comm, &sum, 1, NULL, 0, NULL, 0);
    return (uint64_t)sum.v;
}

// --- one rank for all ------------------------------------------------------------------------------------------------

bool bt_domain_is_idle(const bt_world *world)
{
    return world->domain && world->domain->undivided && world->domain->comm->rank != 0;
}

void bt_domain_solve(bt_world *world, void (*solve)(bt_world *world), bt_vel *shift)
{
    bt_domain *domain = world->domain;
    if (!domain || !domain->undivided) {
        solve(world);
    } else {
        if (domain->comm->rank == 0) {
            const bt_exchange *others = world->exchange;
            world->domain = NULL, world->exchange = NULL;
            solve(world);
            world->domain = domain, world->exchange = others;
        }
        const double t0 = bt_clock();
        const bt_step_stats mine = world->stats;
        MPI_Bcast(&world->stats, sizeof world->stats, MPI_BYTE, 0, domain->comm->mpi);
        world->stats.phases = mine.phases, world->stats.shared = mine.shared, world->stats.in_team = mine.in_team;
        domain->exchange_s += bt_clock() - t0;
    }
    bt_domain_settle(world, shift);
}

// --- balance ---------------------------------------------------------------------------------------------------------

// gain: time that dividing the cells saves, since the last check, s, modelled; lists: to make the lists of pairs of one
// rank's cells anew, s, modelled (of all cells where one rank has them).

/// One rank has all cells. They are divided once
///     division of all bodies + lists made by all ranks < LASTS × time lost since.
static void check_undivided(bt_world *world, double gain, double lists)
{
    bt_domain *domain = world->domain;
    domain->time_lost = bt_max(0, domain->time_lost + gain);
    domain->due = DIVISION * (double)world->bodies.n_global + lists / domain->comm->size < LASTS * domain->time_lost;
    domain->for_one = !domain->due;
}

/// Each rank has cells. One takes them all once
///     division of all bodies + lists < LASTS × time that one rank would have saved since;
/// they are cut anew if the last cut did not know the work of the cells, and once
///     division of the bodies of a rank + lists < time lost by imbalance beyond that which the last cut left.
/// mean: work of a rank since the last check, s.
static void check_divided(bt_world *world, double gain, double lists, double mean, double imbalance)
{
    bt_domain *domain = world->domain;
    const double division = DIVISION * (double)world->bodies.n_global;
    if (imbalance <= IMBALANCE) domain->cut_without_work = false;
    if (!domain->cut_without_work) {
        domain->stats.checks++;
        domain->stats.imbalance += imbalance;
        domain->stats.worst_imbalance = bt_max(domain->stats.worst_imbalance, imbalance);
        // a jam that has dissolved must not earn a credit
        domain->imbalance_at_cut = bt_min(domain->imbalance_at_cut, imbalance);
        domain->time_lost += (imbalance - domain->imbalance_at_cut) * mean;
    }
    domain->spared = bt_max(0, domain->spared - gain);
    domain->for_one = division + lists < LASTS * domain->spared && !bt_division_is_forced(world);
    domain->due = domain->for_one || domain->cut_without_work ||
                  division / domain->comm->size + lists < domain->time_lost;
}

/// Collective. Is a new division due? Adds the work counted since the last check to what the present division has cost;
/// once a change would have paid for itself, it is due.
static void check_balance(bt_world *world)
{
    bt_domain *domain = world->domain;
    bt_sum total = {0};
    double most[BT_CUT_KINDS] = {0}, mine = 0, heaviest = 0;
    for (int64_t p = 0; p < (int64_t)domain->n_x * domain->n_y; p++)
        for (int k = 0; k < BT_CUT_KINDS; k++) most[k] += domain->work[p][k];
    for (int k = 0; k < BT_CUT_KINDS; k++) mine += most[k];
    bt_sum_add(&total, mine * 0x1p40);
    bt_comm_reduce(domain->comm, &total, 1, most, BT_CUT_KINDS, NULL, 0);
    for (int k = 0; k < BT_CUT_KINDS; k++) heaviest += most[k];
    const double steps = (double)domain->steps, work = bt_sum_value(&total) * 0x1p-40, mean = work / domain->comm->size;
    const double gain = steps * bt_division_gain(world, work / steps), lists = NEW_LISTS * most[BT_WORK_REST] / steps;
    if (domain->undivided) check_undivided(world, gain, lists);
    else check_divided(world, gain, lists, mean, mean > 0 ? heaviest / mean - 1 : 0);
    domain->wait = domain->wait < CHECK_STEPS / 2 ? 2 * domain->wait : CHECK_STEPS;
    if (domain->due) return;
    domain->steps = domain->sweeps = 0;
    memset(domain->work, 0, (size_t)domain->n_x * (size_t)domain->n_y * sizeof *domain->work);
}

void bt_domain_note(bt_world *world)
{
    bt_domain *domain = world->domain;
    if (!domain) return;
    const bt_cells *cells = world->cells;
    for (bt_idx j = 0; j < cells->n_busy; j++) { // the others rest
        const bt_idx k = cells->busy[j];
        bt_cell *cell = &cells->cell[k];
        const bool last = k == cells->n - 1; // the work of large bodies is done by their owner
        if (!cell->own) continue;
        double *work = domain->work[last ? domain->large_place : bt_division_place(world, cell->x, cell->y)];
        work[BT_WORK_SWEEPS] += (double)cell->updates * CONTACT_SWEEP;
        work[BT_WORK_REST] += cell->n_contacts * CONTACT_STEP + cell->search.n_pairs * PAIR +
                              (cell->end - cell->first) *
                                  (last || bt_cells_moves(cells, k) ? BODY : BT_WORK_AT_REST);
        cell->updates = 0;
    }
    domain->drift += world->par.dt *
                     ((world->par.period_x > 0 ? fabs(world->par.water_u) : 0) +
                      (world->par.period_y > 0 ? fabs(world->par.water_v) : 0));
    // The paths of large bodies since the cells were made, which is when the map was renewed: the sum of the longest of
    // each step, as one may run on after another has stopped.
    const bool far = domain->movable && cells->moved[cells->n - 1] + domain->drift > 2 * world->par.size;
    domain->sweeps += world->stats.sweeps + world->stats.position_sweeps;
    domain->stats.undivided += domain->undivided;
    if (++domain->steps >= domain->wait) check_balance(world);
    if (far) domain->due = true;
}
