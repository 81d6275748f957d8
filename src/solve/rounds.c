// SPDX-License-Identifier: MIT
// Residual passes, sweeps over lists, momentum and its cap; method and reasons in rounds.h.
#include "solve/rounds.h"

#include <limits.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/elementary.h"
#include "solve/solver.h"
#include "solve/vector.h"
#include "partition/domain.h"

#define GAIN 0.8        // factor below which ROUNDS rounds must bring the sum of squares
#define MAX_CAP 0.98
#define NARROWER 1.25   // factor on the distance of the cap from 1, and on the length of a round
#define WIDER 1.5
#define LEAST_CAP 0.3   // below this: no momentum
#define NO_MOMENTUM 0.3 // further work, over the limit of work, without momentum
#define HARD 0.5        // share of the limit of work, from where the best unknowns are kept
#define PROOF 0x1p-4    // share of the limit of work after which a proof is first tried, and again after each doubling
#define FAR 4           // tolerances: with a larger residual the iteration continues beyond the limit of work
#define LEAST_LOWERED 0.5 // least factor on the update that ends a round
#define LEAST_SWEEP 0.01 // share of the contacts that a sweep costs in itself, in the limit of work
enum { ROUNDS = 3, MAX_LENGTH = 300, FREE_LENGTH = 400, FEW_BAD = 100, MAX_MORE = 2 };

// Squares, in units where the squared tolerance is 2²⁰, have twelve digits from 10⁻⁷ times the tolerance on. The sum of
// a cell is cut off at 2⁴⁵, some 6,000 times the tolerance, or lower in a field of so many cells that the total would
// overflow: the root mean square is then a lower bound. Energies: the quantum 2⁻⁶⁴ is 10⁻¹⁰ of the energy of one
// contact at convergence, and 10²⁷ times that still fits.
void bt_rounds_scale(bt_problem *problem, const bt_cells *t)
{
    const double heaviest = t->heaviest, cells = (double)t->n_x * t->n_y + 1;
    const double energy = heaviest * problem->tolerance * problem->tolerance;
    problem->per_square = problem->tolerance > 0 ? ldexp(1, 20 - bt_ceil_2log2(problem->tolerance)) : 0x1p60;
    problem->most_squares = bt_min(0x1p45, 0x1p62 / cells);
    const bool scaled = energy > 0 && isfinite(energy);
    problem->per_energy = scaled ? ldexp(1, (int)bt_max(-500, bt_min(500, -30 - bt_ceil_log2(energy)))) : 1;
}

// --- residual passes -------------------------------------------------------------------------------------------------

void bt_rounds_free_lists(bt_solver *solver)
{
    for (bt_idx k = 0; k < solver->n_work; k++) {
        free(solver->work[k].list);
        solver->work[k].list = NULL;
        solver->work[k].cap_list = solver->work[k].n_last = 0;
    }
}

void bt_rounds_begin(bt_world *world)
{
    bt_cells *cells = world->cells;
    bt_solver *solver = world->solver;
    if (cells->cell[0].work) return;
    bt_rounds_free_lists(solver);
    free(solver->work);
    solver->work = bt_alloc((size_t)cells->n, sizeof *solver->work);
    solver->n_work = cells->n;
    for (bt_idx k = 0; k < cells->n; k++) cells->cell[k].work = &solver->work[k];
}

void bt_rounds_list(bt_cell *cell)
{
    cell->n_listed = 0;
    if (cell->n_contacts <= cell->work->cap_list) return;
    cell->work->cap_list = bt_cells_room(cell->n_contacts);
    free(cell->work->list);
    cell->work->list = bt_alloc((size_t)cell->work->cap_list, sizeof *cell->work->list);
}

void bt_rounds_in_place(bt_cell *cell, const bt_inv *inv)
{
    bt_work_list *work = cell->work;
    work->in_place = bt_cells_after_contacts(cell, (size_t)cell->n_contacts * sizeof *work->in_place);
    for (bt_idx i = 0; i < cell->n_contacts; i++)
        work->in_place[i] = (bt_in_place){.mass = bt_mass_of(&cell->contacts[i], inv)};
}

void bt_rounds_found(bt_cell *cell, const bt_found *found)
{
    cell->work->found = *found;
    cell->work->found_listed = cell->n_listed;
}

/// Mark that sweeps may move the bodies in the cell of body i.
static void mark_cell_of(bt_world *world, bt_idx i)
{
    const int32_t *at = world->bodies.cell[i];
    if (!world->bodies.large[i]) world->cells->cell[bt_cells_at(world->cells, at[0], at[1])].swept = true;
}

/// Mark that sweeps may move the bodies of the block of cell (x, y), if it has a list.
static void mark_block(bt_cells *cells, int32_t x, int32_t y, double listed)
{
    for (int j = 0; listed > 0 && j < 4; j++) {
        const bt_idx k = bt_cells_at(cells, x + (j & 1), y + (j >> 1));
        if (k >= 0) cells->cell[k].swept = true;
    }
}

/// Collective. Pass the value, 1 or 0, of each cell with work to `take` on all ranks, which spreads it.
static void spread(bt_world *world, double (*value_of)(const bt_cell *cell), bt_take_cell *take)
{
    bt_cells *cells = world->cells;
    double *value = world->domain ? bt_alloc((size_t)cells->n, sizeof *value) : NULL;
    for (bt_idx i = 0; i < cells->n_order; i++) {
        const bt_idx k = cells->order[i];
        const double x = value_of(&cells->cell[k]);
        if (value) value[k] = x;
        if (k < cells->n - 1) take(cells, cells->cell[k].x, cells->cell[k].y, x);
    }
    if (value) bt_domain_tell_cells(world, value, take);
    free(value);
}

static double has_list(const bt_cell *cell) { return cell->n_listed > 0; }
static double is_bad(const bt_cell *cell) { return cell->work->found.bad > 0; }

/// Collective. Mark the cells whose bodies sweeps over the present lists of all ranks may move; always those of floes
/// beside a large body. Exactly these are extrapolated: a floe elsewhere would follow the rounding error of its last
/// change, and the marks must not depend on ranks.
static void mark_swept(bt_world *world)
{
    bt_cells *cells = world->cells;
    const bt_idx last = cells->n - 1;
    const bt_cell *large = &cells->cell[last];
    for (bt_idx j = 0; j < cells->n_busy; j++) {
        const bt_idx k = cells->busy[j];
        if (k == last) continue;
        cells->cell[k].work->still = !cells->cell[k].swept;
        cells->cell[k].swept = false;
    }
    spread(world, has_list, mark_block);
    cells->cell[last].swept = large->own;
    for (bt_idx j = 0; large->own && j < large->n_contacts; j++) {
        mark_cell_of(world, large->contacts[j].a);
        mark_cell_of(world, large->contacts[j].b);
    }
    bt_domain_beside_large(world, mark_cell_of);
    cells->n_swept = 0;
    for (bt_idx j = 0; j < cells->n_busy; j++)
        if (cells->cell[cells->busy[j]].swept) cells->swept[cells->n_swept++] = cells->busy[j];
}

static void lists_are_new(bt_world *world)
{
    mark_swept(world);
    bt_phases_distribute(world);
}

typedef struct {
    const bt_problem *problem;
    bool everywhere;
} residual_pass;

/// May sweeps over the present lists move bodies that the contacts of cell k touch?
static bool is_touched(const bt_cells *cells, bt_idx k)
{
    const bt_cell *cell = &cells->cell[k];
    const bt_idx block[4] = {k, cell->right, cell->above, cell->diagonal};
    bool any = cell->phase == BT_COLOURS;
    for (int j = 0; j < 4 && !any; j++) { // a cell without bodies may exist on some ranks only
        const bt_cell *o = block[j] >= 0 ? &cells->cell[block[j]] : NULL;
        any = o && o->end > o->first && o->swept;
    }
    return any;
}

static void residual_of_cell(bt_world *world, bt_idx k, const void *context, bt_totals *totals)
{
    const residual_pass *o = context;
    const bt_problem *problem = o->problem;
    bt_cell *cell = &world->cells->cell[k];
    const bool looks = o->everywhere || is_touched(world->cells, k);
    if (looks) problem->residual(world, k, problem, totals);
    else cell->n_listed = cell->work->found_listed;
    totals->most = bt_max(totals->most, cell->work->found.most);
    bt_sum_add(&totals->sum[BT_RESIDUAL_SQUARES],
               bt_min(cell->work->found.squares * problem->per_square, problem->most_squares));
    bt_sum_add(&totals->sum[BT_RESIDUAL_ROWS], (double)cell->work->found.rows);
    bt_sum_add(&totals->sum[BT_RESIDUAL_CONTACTS], cell->n_contacts);
    bt_sum_add(&totals->sum[BT_RESIDUAL_CHECKS], looks ? cell->n_contacts : 0);
    bt_sum_add(&totals->sum[BT_RESIDUAL_LISTED], cell->n_listed);
    bt_sum_add(&totals->sum[BT_RESIDUAL_BAD], (double)cell->work->found.bad);
}

void bt_rounds_residual(bt_world *world, const bt_problem *problem, bt_since since, bt_work *work)
{
    bt_totals totals = {.n_sums = BT_RESIDUAL_N};
    const bool settles = since == BT_SETTLES && problem->settle;
    if (settles) problem->settle(world);
    bt_phases_any_order(world, residual_of_cell, &(residual_pass){problem, settles || since == BT_BEGINS}, &totals);
    bt_domain_reduce(world, &totals);
    work->residual = totals.most;
    work->squares = bt_sum_value(&totals.sum[BT_RESIDUAL_SQUARES]) / problem->per_square;
    work->rows = (int64_t)bt_sum_value(&totals.sum[BT_RESIDUAL_ROWS]);
    work->contacts = (int64_t)bt_sum_value(&totals.sum[BT_RESIDUAL_CONTACTS]);
    work->listed = (int64_t)bt_sum_value(&totals.sum[BT_RESIDUAL_LISTED]);
    work->bad = (int64_t)bt_sum_value(&totals.sum[BT_RESIDUAL_BAD]);
    work->checks += (int64_t)bt_sum_value(&totals.sum[BT_RESIDUAL_CHECKS]) + (settles ? work->contacts : 0);
    lists_are_new(world);
}

// --- rounds over a part of the field --------------------------------------------------------------------------------

/// If the cell at (x, y) is bad, keep its list and those of its neighbours.
static void keep_beside(bt_cells *cells, int32_t x, int32_t y, double bad)
{
    for (int32_t dy = -1; bad > 0 && dy <= 1; dy++)
        for (int32_t dx = -1; dx <= 1; dx++) {
            const bt_idx k = bt_cells_at(cells, x + dx, y + dy);
            if (k >= 0) cells->cell[k].work->kept = true;
        }
}

/// Collective. Empty the lists of cells that are neither bad nor next to a bad cell; the contacts of large bodies reach
/// anywhere and stay.
static void keep_near_bad(bt_world *world)
{
    bt_cells *cells = world->cells;
    for (bt_idx i = 0; i < cells->n_order; i++)
        cells->cell[cells->order[i]].work->kept = cells->order[i] == cells->n - 1;
    spread(world, is_bad, keep_beside);
    for (bt_idx i = 0; i < cells->n_order; i++)
        if (!cells->cell[cells->order[i]].work->kept) cells->cell[cells->order[i]].n_listed = 0;
    lists_are_new(world);
}

// --- sweeps ----------------------------------------------------------------------------------------------------------

typedef struct {
    bt_vel *vel, *before;
    double beta;
} body_move;

/// Extrapolate n velocities by beta along their last change; with 0 only store them in `before`. A velocity is four
/// adjacent numbers; the last stays 0.
BT_FOR_EACH_CPU
static void move_on_bodies(bt_vel *vel, bt_vel *before, bt_idx n, double beta)
{
    _Static_assert(sizeof(bt_vel) == sizeof(bt_vec), "a velocity a vector");
    if (!(beta > 0)) {
        memcpy(before, vel, (size_t)n * sizeof *vel);
        return;
    }
    for (bt_idx i = 0; i < n; i++) {
        bt_vec now, last;
        memcpy(&now, &vel[i], sizeof now);
        memcpy(&last, &before[i], sizeof last);
        memcpy(&before[i], &now, sizeof now);
        now = now + beta * (now - last);
        memcpy(&vel[i], &now, sizeof now);
    }
}

static void move_bodies(bt_world *world, bt_idx k, const void *context, bt_totals *totals)
{
    (void)totals;
    const body_move *m = context;
    bt_cell *cell = &world->cells->cell[k];
    const double beta = cell->work->still ? 0 : m->beta;
    cell->work->still = false;
    move_on_bodies(m->vel + cell->first, m->before + cell->first, cell->end - cell->first, beta);
}

/// Extrapolation factors β of the next sweep and of the sweeps before it.
typedef struct {
    double theta, beta[BT_REST + 1];
    double against; ///< of the last sweep
} momentum;

/// One sweep over the lists. Returns the largest update.
static double sweep(bt_world *world, const bt_problem *problem, const bt_before *first, bool all, momentum *m,
                    bt_work *work)
{
    bt_totals totals = {.n_sums = BT_SWEEP_N};
    bt_sweep sweep = {.problem = problem, .moves = !problem->plain, .all = all, .beta = m->beta[0],
                      .lead = {m->beta[0]}};
    for (int k = 1; k <= BT_REST; k++) {
        sweep.lead[k] = m->beta[k] * (1 + sweep.lead[k - 1]);
        sweep.lag[k] = m->beta[k] * (1 + sweep.lag[k - 1]);
    }
    bt_phases_run(world, BT_LISTED, first, problem->sweep, &sweep, problem->vel, &totals);
    bt_domain_reduce(world, &totals);
    work->sweeps++;
    work->updates += (int64_t)bt_sum_value(&totals.sum[BT_SWEEP_UPDATES]);
    work->moves += (int64_t)bt_sum_value(&totals.sum[BT_SWEEP_MOVED]);
    m->against = bt_sum_value(&totals.sum[BT_SWEEP_AGAINST]);
    return totals.most;
}

double bt_rounds_sweep(bt_world *world, const bt_problem *problem, bt_work *work)
{
    return sweep(world, problem, NULL, true, &(momentum){0}, work);
}

/// The work that counts against the limit.
static double spent(const bt_problem *problem, const bt_work *work)
{
    if (problem->plain) return (double)work->sweeps;
    return (double)(work->updates + work->checks) + (1 + LEAST_SWEEP * (double)work->contacts) * (double)work->sweeps;
}

/// Set the extrapolation factor of the next sweep.
static void gather(double cap, momentum *m)
{
    double *beta = m->beta;
    memmove(beta + 1, beta, BT_REST * sizeof *beta);
    if (!(m->against <= 0)) { // or not a number
        m->theta = 1, *beta = 0;
    } else {
        const double next = 0.5 * (1 + sqrt(1 + 4 * m->theta * m->theta));
        *beta = bt_min(cap, (m->theta - 1) / next);
        m->theta = next;
    }
}

/// One round. With `on`, the momentum of the previous round continues. True if the last update was at most `small`.
static bool run_round(bt_world *world, const bt_problem *problem, int length, double cap, bool on, double limit,
                      double small, momentum *m, bt_work *work)
{
    if (!on) *m = (momentum){.theta = 1};
    bool all = true;
    for (int n = 1;; n++) {
        const bool moves_on = !problem->plain && (n > 1 || on);
        if (moves_on) gather(cap, m);
        const bt_before move = {move_bodies, &(body_move){problem->vel, world->solver->before, *m->beta}};
        const double most = sweep(world, problem, moves_on ? &move : NULL, all, m, work);
        const bool over = spent(problem, work) >= limit;
        if (all && most <= small) return true;
        if (all && (n >= length || over)) return false;
        all = problem->plain || n + 1 >= length || over || most <= small;
    }
}

/// The cap and the length of rounds, adapted to their gain.
typedef struct {
    double cap, mark; ///< mark: misfit at the last residual pass
    int length;
} pace;

/// The sum of squares, or the largest square if the sum of a cell is cut off (bt_rounds_scale), as that shows no gain.
static double misfit_of(const bt_problem *problem, const bt_work *work)
{
    const double largest = work->residual * work->residual;
    return largest * problem->per_square > problem->most_squares ? largest : work->squares;
}

static void adapt(pace *a, const bt_problem *problem, double misfit)
{
    const bool gained = !(misfit > GAIN * a->mark), first = isinf(a->mark);
    a->mark = misfit;
    if (first || (gained && a->cap == 1)) return;
    if (gained) {
        a->cap = bt_min(MAX_CAP, 1 - (1 - a->cap) / NARROWER);
        a->length = (int)bt_min(MAX_LENGTH, NARROWER * a->length);
        return;
    }
    a->length = problem->length;
    if (a->cap == 0) a->cap = 1, a->length = FREE_LENGTH;
    else if (a->cap == 1) a->cap = problem->cap;
    else a->cap = 1 - WIDER * (1 - a->cap);
    if (a->cap < LEAST_CAP) a->cap = 0;
}

/// Keep the unknowns of a hard problem if they are the best so far; best: the residual of those kept, INFINITY = none.
static void keep_better(bt_world *world, const bt_problem *problem, const bt_work *work, double *best)
{
    if (!(work->residual < *best)) return;
    *best = work->residual;
    bt_phases_any_order(world, problem->keep, &(bt_keeping){BT_KEEP}, &(bt_totals){0});
}

/// Restore the best unknowns if they are better than the present ones. True if so, with the velocities formed from
/// them.
static bool back_to_best(bt_world *world, const bt_problem *problem, bt_work *work, double best)
{
    if (!(work->residual > problem->tolerance && best < work->residual)) return false;
    bt_phases_any_order(world, problem->keep, &(bt_keeping){BT_PUT_BACK}, &(bt_totals){0});
    bt_rounds_residual(world, problem, BT_SETTLES, work);
    return true;
}

void bt_rounds_make_shift(bt_world *world)
{
    bt_solver *solver = world->solver;
    if (solver->shift && world->bodies.n <= solver->cap_bodies) return;
    solver->cap_bodies = world->bodies.n > 0 ? world->bodies.n : 1; // a rank may own nothing
    free(solver->shift);
    solver->shift = bt_alloc_unset((size_t)solver->cap_bodies, sizeof *solver->shift);
}

void bt_rounds_run(bt_world *world, const bt_problem *problem, bt_work *work)
{
    bt_solver *solver = world->solver;
    if (world->bodies.n > solver->cap_before) {
        solver->cap_before = world->bodies.n;
        free(solver->before);
        solver->before = bt_alloc_unset((size_t)solver->cap_before, sizeof *solver->before);
    }
    pace a = {.cap = problem->cap, .mark = INFINITY, .length = problem->plain ? INT_MAX : problem->length};
    momentum m = {.theta = 1};
    double best = INFINITY, small = (problem->plain ? 1 : BT_NEAR) * problem->tolerance; // update that ends a round
    const double all_work = problem->limit * (problem->plain ? 1 : (double)(work->contacts + 1));
    // between `fast` and `limit`: no momentum
    const double begun = spent(problem, work);
    double fast = begun + all_work, limit = fast + (problem->plain ? 0 : NO_MOMENTUM * all_work);
    double proof = problem->refuted ? begun + PROOF * all_work : INFINITY; // when to try next
    int more = 0; // further attempts
    bool settled = true; // velocities and residual have been formed from the impulses
    bool all = false;    // the last round was over the whole field
    for (int n = 0; work->residual > problem->tolerance && spent(problem, work) < limit; n++) {
        const bool last = !problem->plain && spent(problem, work) >= fast;
        if (last) {
            // from the best state that momentum has reached
            if (a.cap > 0 && back_to_best(world, problem, work, best)) settled = true, all = false;
            a.cap = 0, a.length = problem->length;
        } else if (n % ROUNDS == 0 && !problem->plain) adapt(&a, problem, misfit_of(problem, work));
        const bool part = !problem->plain && n % 2 == 1 && FEW_BAD * work->bad < work->listed,
                   on = all && !part && !settled;
        if (part) keep_near_bad(world);
        const bool ended = run_round(world, problem, a.length, a.cap, on, last ? limit : fast, small, &m, work);
        settled = ended && !part;
        all = !part;
        bt_rounds_residual(world, problem, settled ? BT_SETTLES : BT_SWEPT, work);
        if (ended && !problem->plain && work->residual > problem->tolerance)
            small *= bt_max(LEAST_LOWERED, BT_NEAR * problem->tolerance / work->residual);
        if (problem->keep && !problem->plain && spent(problem, work) > fast - HARD * all_work)
            keep_better(world, problem, work, &best);
        if (!settled && work->residual <= problem->tolerance) {
            bt_rounds_residual(world, problem, BT_SETTLES, work);
            settled = true;
        }
        if (work->residual > problem->tolerance && spent(problem, work) >= proof) {
            proof += proof - begun;
            if (problem->refuted(world)) break;
        }
        if (spent(problem, work) < limit || bt_min(best, work->residual) <= FAR * problem->tolerance) continue;
        if (problem->plain || !problem->keep || more++ == MAX_MORE) continue;
        a = (pace){.cap = problem->cap, .mark = INFINITY, .length = problem->length};
        all = false;
        fast = spent(problem, work) + HARD * all_work, limit = fast + NO_MOMENTUM * all_work;
    }
    if (!settled) bt_rounds_residual(world, problem, BT_SETTLES, work);
    back_to_best(world, problem, work, best);
    if (!isinf(best)) bt_phases_any_order(world, problem->keep, &(bt_keeping){BT_FORGET}, &(bt_totals){0});
}
