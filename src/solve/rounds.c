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

#define GAIN 0.8        // of the sum of squares, that ROUNDS rounds must take it below
#define MOST_CAP 0.98
#define NARROWER 1.25   // of the distance of the cap from 1, and of the length of a round
#define WIDER 1.5
#define LEAST_CAP 0.3   // less is none
#define NO_MOMENTUM 0.3 // of the limit of work, beyond it: without momentum
#define HARD 0.5        // of the limit of work: from here on the best unknowns are kept
#define FAR 4           // tolerances: a residual that is not left at the limit of work
#define LEAST_SWEEP 0.01 // of the contacts, that a sweep counts for against the limit of work at least
enum { ROUNDS = 3, MOST_LENGTH = 300, FREE_LENGTH = 400, FEW_BAD = 100, MOST_MORE = 2 };

// Squares in units in which that of the tolerance is 2²⁰: kept to twelve digits from 10⁻⁷ times the tolerance on.
// What a cell adds ends at 2⁴⁵, some 6,000 times the tolerance, and earlier in a field of so many cells that a sum
// would not hold them: beyond, the root mean square is a lower bound. Energies: the quantum 2⁻⁶⁴ is 10⁻¹⁰ of the
// energy of one contact at convergence, so that 10²⁷ times that still fits.
void bt_rounds_scale(bt_problem *p, const bt_cells *t)
{
    const double heaviest = t->heaviest, cells = (double)t->n_x * t->n_y + 1;
    const double energy = heaviest * p->tolerance * p->tolerance;
    p->per_square = p->tolerance > 0 ? ldexp(1, 20 - bt_ceil_2log2(p->tolerance)) : 0x1p60;
    p->most_squares = bt_min(0x1p45, 0x1p62 / cells);
    const bool scaled = energy > 0 && isfinite(energy);
    p->per_energy = scaled ? ldexp(1, (int)bt_max(-500, bt_min(500, -30 - bt_ceil_log2(energy)))) : 1;
}

// --- residual passes -------------------------------------------------------------------------------------------------

void bt_rounds_list(bt_cell *cell)
{
    cell->work.n_list = 0;
    if (cell->n_contacts <= cell->work.cap_list) return;
    cell->work.cap_list = bt_cells_room(cell->n_contacts);
    free(cell->work.list);
    cell->work.list = bt_alloc((size_t)cell->work.cap_list, sizeof *cell->work.list);
}

void bt_rounds_in_place(bt_cell *cell, const bt_inv *inv)
{
    bt_work_list *k = &cell->work;
    k->in_place = bt_cells_after_contacts(cell, (size_t)cell->n_contacts * sizeof *k->in_place);
    for (bt_idx i = 0; i < cell->n_contacts; i++)
        k->in_place[i] = (bt_in_place){.mass = bt_mass_of(&cell->contacts[i], inv)};
}

void bt_rounds_found(bt_cell *cell, const bt_found *f)
{
    bt_work_list *o = &cell->work;
    o->found.most = f->most, o->found.squares = f->squares, o->found.rows = f->rows, o->found.bad = f->bad;
    o->found.listed = o->n_list;
}

/// The bodies of the cell of body i may be moved.
static void mark_cell_of(bt_world *w, bt_idx i)
{
    const int32_t *at = w->bodies.cell[i];
    if (!w->bodies.large[i]) w->cells->cell[bt_cells_at(w->cells, at[0], at[1])].work.swept = true;
}

/// Bodies of the block of cell (x, y) may be moved.
static void mark_block(bt_cells *t, int32_t x, int32_t y, double listed)
{
    for (int j = 0; listed > 0 && j < 4; j++) {
        const bt_idx k = bt_cells_at(t, x + (j & 1), y + (j >> 1));
        if (k >= 0) t->cell[k].work.swept = true;
    }
}

/// Collective. Tell the value of each cell that has work, 1 or 0, to `take` on all ranks, which spreads it to the cells
/// around.
static void spread(bt_world *w, double (*value_of)(const bt_cell *cell), bt_take_cell *take)
{
    bt_cells *t = w->cells;
    double *value = w->domain ? bt_alloc((size_t)t->n, sizeof *value) : NULL;
    for (bt_idx i = 0; i < t->n_order; i++) {
        const bt_idx k = t->order[i];
        const double x = value_of(&t->cell[k]);
        if (value) value[k] = x;
        if (k < t->n - 1) take(t, t->cell[k].x, t->cell[k].y, x);
    }
    if (value) bt_domain_tell_cells(w, value, take);
    free(value);
}

static double has_list(const bt_cell *cell) { return cell->work.n_list > 0; }
static double is_bad(const bt_cell *cell) { return cell->work.found.bad > 0; }

/// Collective. Mark the cells whose bodies sweeps over the present lists may move, of all ranks; those of floes beside
/// a large body always. Exactly these are moved on: a floe elsewhere would follow what rounding has left of its last
/// change, and the marks must not depend on ranks.
static void mark_swept(bt_world *w)
{
    bt_cells *t = w->cells;
    const bt_idx last = t->n - 1;
    const bt_cell *large = &t->cell[last];
    for (bt_idx j = 0; j < t->n_busy; j++) {
        const bt_idx k = t->busy[j];
        if (k == last) continue;
        t->cell[k].work.still = !t->cell[k].work.swept;
        t->cell[k].work.swept = false;
    }
    spread(w, has_list, mark_block);
    t->cell[last].work.swept = large->own;
    for (bt_idx j = 0; large->own && j < large->n_contacts; j++) {
        mark_cell_of(w, large->contacts[j].a);
        mark_cell_of(w, large->contacts[j].b);
    }
    bt_domain_beside_large(w, mark_cell_of);
}

static void lists_are_new(bt_world *w)
{
    mark_swept(w);
    bt_phases_distribute(w);
}

typedef struct {
    const bt_problem *problem;
    bool everywhere;
} residual_pass;

/// May sweeps over the present lists move bodies that the contacts of cell k touch?
static bool is_touched(const bt_cells *t, bt_idx k)
{
    const bt_cell *cell = &t->cell[k];
    const bt_idx block[4] = {k, cell->right, cell->above, cell->diagonal};
    bool any = cell->phase == BT_COLOURS;
    for (int j = 0; j < 4 && !any; j++) { // a cell without bodies may be there on some ranks only
        const bt_cell *o = block[j] >= 0 ? &t->cell[block[j]] : NULL;
        any = o && o->end > o->first && o->work.swept;
    }
    return any;
}

static void residual_of_cell(bt_world *w, bt_idx k, const void *context, bt_totals *t)
{
    const residual_pass *o = context;
    const bt_problem *p = o->problem;
    bt_cell *cell = &w->cells->cell[k];
    const bool looks = o->everywhere || is_touched(w->cells, k);
    if (looks) p->residual(w, k, p, t);
    else cell->work.n_list = cell->work.found.listed;
    t->most = bt_max(t->most, cell->work.found.most);
    bt_sum_add(&t->sum[BT_RESIDUAL_SQUARES], bt_min(cell->work.found.squares * p->per_square, p->most_squares));
    bt_sum_add(&t->sum[BT_RESIDUAL_ROWS], (double)cell->work.found.rows);
    bt_sum_add(&t->sum[BT_RESIDUAL_CONTACTS], cell->n_contacts);
    bt_sum_add(&t->sum[BT_RESIDUAL_CHECKS], looks ? cell->n_contacts : 0);
    bt_sum_add(&t->sum[BT_RESIDUAL_LISTED], cell->work.n_list);
    bt_sum_add(&t->sum[BT_RESIDUAL_BAD], (double)cell->work.found.bad);
}

void bt_rounds_residual(bt_world *w, const bt_problem *p, bt_since since, bt_work *work)
{
    bt_totals t = {.n_sums = BT_RESIDUAL_N};
    const bool settles = since == BT_SETTLES && p->settle;
    if (settles) p->settle(w);
    bt_phases_any_order(w, residual_of_cell, &(residual_pass){p, settles || since == BT_BEGINS}, &t);
    bt_domain_reduce(w, &t);
    work->residual = t.most;
    work->squares = bt_sum_value(&t.sum[BT_RESIDUAL_SQUARES]) / p->per_square;
    work->rows = (int64_t)bt_sum_value(&t.sum[BT_RESIDUAL_ROWS]);
    work->contacts = (int64_t)bt_sum_value(&t.sum[BT_RESIDUAL_CONTACTS]);
    work->listed = (int64_t)bt_sum_value(&t.sum[BT_RESIDUAL_LISTED]);
    work->bad = (int64_t)bt_sum_value(&t.sum[BT_RESIDUAL_BAD]);
    work->checks += (int64_t)bt_sum_value(&t.sum[BT_RESIDUAL_CHECKS]) + (settles ? work->contacts : 0);
    lists_are_new(w);
}

// --- rounds over a part of the field --------------------------------------------------------------------------------

/// The cell at (x, y) is bad: its list and those beside it stay.
static void keep_beside(bt_cells *t, int32_t x, int32_t y, double bad)
{
    for (int32_t dy = -1; bad > 0 && dy <= 1; dy++)
        for (int32_t dx = -1; dx <= 1; dx++) {
            const bt_idx k = bt_cells_at(t, x + dx, y + dy);
            if (k >= 0) t->cell[k].work.kept = true;
        }
}

/// Collective. Empty the lists of cells that are neither bad nor beside one that is; the contacts of large bodies reach
/// anywhere and stay.
static void keep_near_bad(bt_world *w)
{
    bt_cells *t = w->cells;
    for (bt_idx i = 0; i < t->n_order; i++) t->cell[t->order[i]].work.kept = t->order[i] == t->n - 1;
    spread(w, is_bad, keep_beside);
    for (bt_idx i = 0; i < t->n_order; i++)
        if (!t->cell[t->order[i]].work.kept) t->cell[t->order[i]].work.n_list = 0;
    lists_are_new(w);
}

// --- sweeps ----------------------------------------------------------------------------------------------------------

typedef struct {
    bt_vel *vel, *before;
    double beta;
} body_move;

/// Move n velocities on by beta along their last change, 0: only keep them. A velocity is four numbers side by side, of
/// which the last stays 0.
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

static void move_bodies(bt_world *w, bt_idx k, const void *context, bt_totals *t)
{
    (void)t;
    const body_move *m = context;
    bt_cell *cell = &w->cells->cell[k];
    if (!cell->work.swept) return;
    const double beta = cell->work.still ? 0 : m->beta;
    cell->work.still = false;
    move_on_bodies(m->vel + cell->first, m->before + cell->first, cell->end - cell->first, beta);
}

/// Returns the largest update. `first` moves the bodies on.
static double sweep(bt_world *w, const bt_problem *p, const bt_before *first, bool moves, double beta, bt_work *work,
                    double *against)
{
    bt_totals t = {.n_sums = BT_SWEEP_N};
    const bt_sweep s = {.problem = p, .moves = moves, .beta = beta};
    bt_phases_run(w, first, p->sweep, &s, p->vel, &t);
    bt_domain_reduce(w, &t);
    work->sweeps++;
    work->updates += (int64_t)bt_sum_value(&t.sum[BT_SWEEP_UPDATES]);
    work->moves += (int64_t)bt_sum_value(&t.sum[BT_SWEEP_MOVED]);
    *against = bt_sum_value(&t.sum[BT_SWEEP_AGAINST]);
    return t.most;
}

double bt_rounds_sweep(bt_world *w, const bt_problem *p, bt_work *work)
{
    double against;
    return sweep(w, p, NULL, false, 0, work, &against);
}

/// What counts against the limit.
static double spent(const bt_problem *p, const bt_work *k)
{
    if (p->plain) return (double)k->sweeps;
    return (double)(k->updates + k->checks) + (1 + LEAST_SWEEP * (double)k->contacts) * (double)k->sweeps;
}

typedef struct {
    double theta, beta;
    double against; ///< of the last sweep
} momentum;

/// How far the next sweep moves on from where the last one has come to.
static void gather(double cap, momentum *m)
{
    if (!(m->against <= 0)) { // or not a number
        m->theta = 1, m->beta = 0;
    } else {
        const double next = 0.5 * (1 + sqrt(1 + 4 * m->theta * m->theta));
        m->beta = bt_min(cap, (m->theta - 1) / next);
        m->theta = next;
    }
}

/// With `on`, the momentum of the round before goes on. Returns true when the last update was small.
static bool run_round(bt_world *w, const bt_problem *p, int length, double cap, bool on, double limit, momentum *m,
                      bt_work *work)
{
    const double small = p->plain ? p->tolerance : BT_NEAR * p->tolerance;
    if (!on) *m = (momentum){.theta = 1};
    for (int n = 0;; n++) {
        const bool moves_on = !p->plain && (n > 0 || on);
        if (moves_on) gather(cap, m);
        const bt_before move = {move_bodies, &(body_move){p->vel, w->solver->before, m->beta}};
        if (sweep(w, p, moves_on ? &move : NULL, !p->plain, m->beta, work, &m->against) <= small) return true;
        if (n + 1 == length || spent(p, work) >= limit) return false;
    }
}

/// The cap and the length of the rounds, by what they bring.
typedef struct {
    double cap, mark; ///< mark: misfit at the last residual pass
    int length;
} pace;

/// The sum of squares, or the largest where the part of a cell is cut off (bt_rounds_scale): that sum shows no gain.
static double misfit_of(const bt_problem *p, const bt_work *work)
{
    const double largest = work->residual * work->residual;
    return largest * p->per_square > p->most_squares ? largest : work->squares;
}

static void adapt(pace *a, const bt_problem *p, double misfit)
{
    const bool gained = !(misfit > GAIN * a->mark), first = isinf(a->mark);
    a->mark = misfit;
    if (first || (gained && a->cap == 1)) return;
    if (gained) {
        a->cap = bt_min(MOST_CAP, 1 - (1 - a->cap) / NARROWER);
        a->length = (int)bt_min(MOST_LENGTH, NARROWER * a->length);
        return;
    }
    a->length = p->length;
    if (a->cap == 0) a->cap = 1, a->length = FREE_LENGTH;
    else if (a->cap == 1) a->cap = p->cap;
    else a->cap = 1 - WIDER * (1 - a->cap);
    if (a->cap < LEAST_CAP) a->cap = 0;
}

/// Keep the unknowns of a hard problem when they are the best so far; `best`: the residual of those kept, INFINITY =
/// none.
static void keep_better(bt_world *w, const bt_problem *p, const bt_work *work, double *best)
{
    if (!(work->residual < *best)) return;
    *best = work->residual;
    bt_phases_any_order(w, p->keep, &(bt_keeping){BT_KEEP}, &(bt_totals){0});
}

/// Back to the best unknowns where they are better than the present ones. True: the velocities are theirs.
static bool back_to_best(bt_world *w, const bt_problem *p, bt_work *work, double best)
{
    if (!(work->residual > p->tolerance && best < work->residual)) return false;
    bt_phases_any_order(w, p->keep, &(bt_keeping){BT_PUT_BACK}, &(bt_totals){0});
    bt_rounds_residual(w, p, BT_SETTLES, work);
    return true;
}

void bt_rounds_run(bt_world *w, const bt_problem *p, bt_work *work)
{
    bt_solver *s = w->solver;
    if (w->bodies.n > s->cap_before) {
        s->cap_before = w->bodies.n;
        free(s->before);
        s->before = bt_alloc_aligned((size_t)s->cap_before, sizeof *s->before);
    }
    pace a = {.cap = p->cap, .mark = INFINITY, .length = p->plain ? INT_MAX : p->length};
    momentum m = {.theta = 1};
    double best = INFINITY;
    const double all_work = p->limit * (p->plain ? 1 : (double)(work->contacts + 1));
    // between the two no momentum
    double fast = spent(p, work) + all_work, limit = fast + (p->plain ? 0 : NO_MOMENTUM * all_work);
    int more = 0; // further attempts
    bool settled = true; // velocities, and the residual, are those of the impulses
    bool all = false;    // the last round was over the whole field
    for (int n = 0; work->residual > p->tolerance && spent(p, work) < limit; n++) {
        const bool last = !p->plain && spent(p, work) >= fast;
        if (last) {
            // from where momentum came nearest
            if (a.cap > 0 && back_to_best(w, p, work, best)) settled = true, all = false;
            a.cap = 0, a.length = p->length;
        } else if (n % ROUNDS == 0 && !p->plain) adapt(&a, p, misfit_of(p, work));
        const bool part = !p->plain && n % 2 == 1 && FEW_BAD * work->bad < work->listed, on = all && !part && !settled;
        if (part) keep_near_bad(w);
        settled = run_round(w, p, a.length, a.cap, on, last ? limit : fast, &m, work) && !part;
        all = !part;
        bt_rounds_residual(w, p, settled ? BT_SETTLES : BT_SWEPT, work);
        if (p->keep && !p->plain && spent(p, work) > fast - HARD * all_work) keep_better(w, p, work, &best);
        if (!settled && work->residual <= p->tolerance) {
            bt_rounds_residual(w, p, BT_SETTLES, work);
            settled = true;
        }
        if (spent(p, work) < limit || bt_min(best, work->residual) <= FAR * p->tolerance) continue;
        if (p->plain || !p->keep || more++ == MOST_MORE) continue;
        a = (pace){.cap = p->cap, .mark = INFINITY, .length = p->length};
        all = false;
        fast = spent(p, work) + HARD * all_work, limit = fast + NO_MOMENTUM * all_work;
    }
    if (!settled) bt_rounds_residual(w, p, BT_SETTLES, work);
    back_to_best(w, p, work, best);
    if (!isinf(best)) bt_phases_any_order(w, p->keep, &(bt_keeping){BT_FORGET}, &(bt_totals){0});
}
