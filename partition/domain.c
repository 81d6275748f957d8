// SPDX-License-Identifier: MIT
// The division of a world among ranks as the program sees it: sums over the ranks, the measure of balance.
//
// Work of a cell, modelled from counts rather than timed, so that a run can be repeated: what a contact, a pair and a
// body cost in a step. Timing single cells costs more than it tells, and noise would move cells to and fro.
#include "partition/domain.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "partition/division.h"

#define IMBALANCE 0.05 // of the work, above which cells are divided anew
enum { CHECK_STEPS = 10 };
// Seconds, measured on one core (see partition/README.md): only their ratios matter.
#define CONTACT_SWEEP 30e-9
#define CONTACT_STEP 300e-9
#define PAIR 60e-9
#define BODY 120e-9

static bool owns_cell(const bt_world *w, int32_t x, int32_t y)
{
    return !w->domain || bt_division_owner(w, x, y) == w->domain->comm->rank;
}

static bool owns_large(const bt_world *w) { return !w->domain || w->domain->large_owner == w->domain->comm->rank; }

static bool is_due(const bt_world *w) { return w->domain && w->domain->due; }

static const bt_exchange exchange = {
    .maxima = bt_domain_maxima,
    .owns_cell = owns_cell,
    .owns_large = owns_large,
    .due = is_due,
    .migrate = bt_domain_migrate,
    .connect = bt_domain_connect,
    .send = bt_domain_send,
    .receive = bt_domain_receive,
};

void bt_domain_create(bt_world *w, const bt_comm *comm)
{
    if (comm->size == 1) return;
    bt_domain *d = w->domain = bt_alloc(1, sizeof *d);
    d->comm = comm;
    d->due = true;
    w->exchange = &exchange;
}

void bt_domain_free(bt_domain *d)
{
    if (!d) return;
    bt_halo_free(d);
    void *arrays[] = {d->owner, d->under, d->owned, d->touched, d->work, d};
    for (size_t i = 0; i < sizeof arrays / sizeof *arrays; i++) free(arrays[i]);
}

bt_domain_stats bt_domain_get_stats(const bt_world *w)
{
    bt_domain_stats s = w->domain ? w->domain->stats : (bt_domain_stats){0};
    if (s.checks > 0) s.imbalance /= (double)s.checks;
    if (s.divisions > 1) s.repartition_imbalance /= (double)(s.divisions - 1);
    return s;
}

double bt_domain_exchange_time(const bt_world *w)
{
    if (!w->domain) return 0;
    const double t = w->domain->exchange_s;
    w->domain->exchange_s = 0;
    return t;
}

bool bt_domain_owns(const bt_world *w, bt_idx i)
{
    return !w->domain || !w->domain->distributed || w->domain->owned[i];
}

void bt_domain_follow(bt_world *w, const bt_idx *from)
{
    bt_domain *d = w->domain;
    if (!d || !d->distributed) return;
    const bt_idx n = w->bodies.n;
    if (n > d->cap_owned) {
        d->cap_owned = n;
        d->touched = bt_realloc(d->touched, (size_t)n, 1);
    }
    uint8_t *owned = bt_alloc((size_t)d->cap_owned, sizeof *owned);
    for (bt_idx i = 0; i < n; i++) owned[i] = d->owned[from[i]];
    free(d->owned);
    d->owned = owned;
}

// --- sums ------------------------------------------------------------------------------------------------------------

void bt_domain_maxima(const bt_world *w, double *x, int n)
{
    if (!w->domain) return;
    const double t0 = bt_clock();
    bt_comm_reduce(w->domain->comm, NULL, 0, x, n, NULL, 0);
    w->domain->exchange_s += bt_clock() - t0;
}

void bt_domain_reduce(const bt_world *w, bt_totals *t)
{
    if (!w->domain) return;
    const double t0 = bt_clock();
    bt_comm_reduce(w->domain->comm, t->sum, t->n_sums, &t->most, 1, NULL, 0);
    w->domain->exchange_s += bt_clock() - t0;
}

double *bt_domain_gather(const bt_world *w, int64_t n, int width, const double *rows, int64_t *total)
{
    const double t0 = bt_clock();
    double *all = bt_comm_gather(w->domain->comm, n, width, rows, total);
    w->domain->exchange_s += bt_clock() - t0;
    return all;
}

uint64_t bt_domain_sum_words(const bt_world *w, uint64_t x)
{
    if (!w->domain) return x;
    bt_sum s = {.v = (bt_int128)x};
    bt_comm_reduce(w->domain->comm, &s, 1, NULL, 0, NULL, 0);
    return (uint64_t)s.v;
}

// --- one rank for all ------------------------------------------------------------------------------------------------

bool bt_domain_is_idle(const bt_world *w) { return w->domain && w->domain->undivided && w->domain->comm->rank != 0; }

void bt_domain_solve(bt_world *w, void (*solve)(bt_world *w), bt_vel *shift)
{
    bt_domain *d = w->domain;
    if (!d || !d->undivided) {
        solve(w);
    } else {
        if (d->comm->rank == 0) {
            const bt_exchange *others = w->exchange;
            w->domain = NULL, w->exchange = NULL;
            solve(w);
            w->domain = d, w->exchange = others;
        }
        const double t0 = bt_clock();
        const bt_step_stats mine = w->stats;
        MPI_Bcast(&w->stats, sizeof w->stats, MPI_BYTE, 0, d->comm->mpi);
        w->stats.phases = mine.phases, w->stats.shared = mine.shared, w->stats.in_team = mine.in_team;
        d->exchange_s += bt_clock() - t0;
    }
    bt_domain_settle(w, shift);
}

// --- balance ---------------------------------------------------------------------------------------------------------

void bt_domain_note(bt_world *w)
{
    bt_domain *d = w->domain;
    if (!d) return;
    const bt_cells *t = w->cells;
    int64_t large = 0; // the large bodies' own work is done where they are
    while (large < (int64_t)d->n_x * d->n_y - 1 && !d->under[large]) large++;
    for (bt_idx k = 0; k < t->n; k++) {
        bt_cell *cell = &t->cell[k];
        if (!cell->own) continue;
        const bool last = k == t->n - 1;
        d->work[last ? large : bt_division_place(w, cell->x, cell->y)] +=
            cell->n_contacts * CONTACT_STEP + (double)cell->work.updates * CONTACT_SWEEP + cell->search.n_pairs * PAIR +
            (cell->end - cell->first) * (last || bt_cells_moves(t, k) ? BODY : BT_WORK_AT_REST);
        cell->work.updates = 0;
    }
    d->drift += w->par.dt *
                ((w->par.period_x > 0 ? fabs(w->par.water_u) : 0) + (w->par.period_y > 0 ? fabs(w->par.water_v) : 0));
    const double path = bt_division_large_path(w);
    const bool far = path >= 0 && path - d->large_path + d->drift > 2 * w->par.size;
    d->sweeps += w->stats.sweeps + w->stats.position_sweeps;
    d->stats.undivided += d->undivided;
    const bool first = d->undivided && d->stats.undivided == 1;
    if (++d->steps >= CHECK_STEPS || first) {
        bt_sum total = {0};
        double mine = 0;
        for (int64_t p = 0; p < (int64_t)d->n_x * d->n_y; p++) mine += d->work[p];
        bt_sum_add(&total, mine * 0x1p40);
        bt_comm_reduce(d->comm, &total, 1, &mine, 1, NULL, 0);
        const double mean = bt_sum_value(&total) * 0x1p-40 / d->comm->size, imbalance = mean > 0 ? mine / mean - 1 : 0;
        const bool for_one = bt_division_is_for_one(w, mean * d->comm->size / (double)d->steps);
        if (!d->undivided && (d->stats.divisions > 1 || imbalance <= IMBALANCE)) {
            d->stats.checks++;
            d->stats.imbalance += imbalance;
            d->stats.worst_imbalance = bt_max(d->stats.worst_imbalance, imbalance);
        }
        d->due = for_one ? !d->undivided : d->undivided || imbalance > IMBALANCE;
        if (!d->due) {
            d->steps = d->sweeps = 0;
            memset(d->work, 0, (size_t)d->n_x * (size_t)d->n_y * sizeof *d->work);
        }
    }
    if (far) d->due = true;
}
