// SPDX-License-Identifier: MIT
// A pass over the cells: what each body meets, that cells done at once share no body, and who does what.
#include <omp.h>
#include <stdatomic.h>
#include <string.h>

#include "test.h"
#include "space/exchange.h"
#include "space/phases.h"
#include "all_pairs.h"

/// What a pass has done so far.
typedef struct {
    atomic_int *holder; ///< [n bodies] 1 + cell that works on it, 0 = none
    int *stamp;         ///< [n bodies] the latest phase that it met
    atomic_int *visits; ///< [n cells] begun
    atomic_int *done;   ///< [n cells]
    atomic_int shared, early;
    atomic_int before; ///< busy cells of which the bodies have been seen to first
} log_of_pass;

typedef struct {
    log_of_pass *log;
    /// this thread takes long over each cell; −1 = none, −2 = any over some cells, −3 = another than the first at the
    /// border
    int held_up;
} visitor;

static void take_long(double seconds)
{
    const double began = bt_clock();
    while (bt_clock() < began + seconds) {}
}

static bool movable(const bt_world *w, bt_idx i) { return w->bodies.inv[i].m > 0; }

/// What other ranks would see of the pass. Nothing is asserted there: it is called in the middle of a team of threads.
static struct {
    const log_of_pass *log;
    atomic_int sent;
    int received, wrong;
    atomic_int at_work[BT_PHASES]; ///< another thread than the first has begun a border cell
} elsewhere;

/// The first thread does not begin the border before another one has; that one then waits whether it is sent without
/// it. Either gives up after some time.
static void hold_up_border(int phase)
{
    const double until = bt_clock() + 0.03;
    const bool first = omp_get_thread_num() == 0;
    if (!first && atomic_exchange(&elsewhere.at_work[phase], 1) != 0) return;
    while (bt_clock() < until && !(first ? elsewhere.at_work[phase] : elsewhere.sent > phase)) {}
    if (first) elsewhere.at_work[phase] = 1;
}

/// The bodies of a cell, before the pass; the first of them take long.
static void see_to_bodies(bt_world *w, bt_idx k, const void *context, bt_totals *t)
{
    (void)w, (void)t;
    log_of_pass *log = *(log_of_pass *const *)context;
    if (k < 3) take_long(50e-6);
    atomic_fetch_add(&log->before, 1);
}

static void visit(bt_world *w, bt_idx k, const void *context, bt_totals *t)
{
    const visitor *v = context;
    log_of_pass *log = v->log;
    const bt_cell *cell = &w->cells->cell[k];
    const int now = cell->phase;
    atomic_fetch_add(&log->visits[k], 1);
    if (log->before != w->cells->n_busy) atomic_fetch_add(&log->early, 1);
    if (v->held_up == omp_get_thread_num()) take_long(20e-6);
    if (v->held_up == -3 && cell->border) hold_up_border(now);
    if (v->held_up == -2 && k * 7 % 101 == 0) take_long(200e-6);
    for (bt_idx j = 0; j < cell->n_contacts; j++) {
        const bt_idx ends[2] = {cell->contacts[j].a, cell->contacts[j].b};
        for (int e = 0; e < 2; e++) {
            if (!movable(w, ends[e])) continue;
            const int before = atomic_exchange(&log->holder[ends[e]], k + 1);
            if (before != 0 && before != k + 1) atomic_fetch_add(&log->shared, 1);
            if (log->stamp[ends[e]] > now) atomic_fetch_add(&log->early, 1);
            log->stamp[ends[e]] = now;
        }
    }
    for (bt_idx j = 0; j < cell->n_contacts; j++) {
        atomic_store(&log->holder[cell->contacts[j].a], 0);
        atomic_store(&log->holder[cell->contacts[j].b], 0);
    }
    bt_sum_add(&t->sum[0], cell->n_contacts);
    t->most = bt_max(t->most, 1);
    atomic_fetch_add(&log->done[k], 1);
}

/// Cells of later phases that have been visited.
static int later(const bt_world *w, int phase)
{
    int n = 0;
    for (bt_idx i = w->cells->start[phase + 1]; i < w->cells->n_order; i++)
        n += elsewhere.log->visits[w->cells->order[i]] != 0;
    return n;
}

/// All border cells of the phase are done, and are sent once, phase by phase.
static void send_phase(bt_world *w, int phase, bt_vel *v)
{
    (void)v;
    elsewhere.wrong += elsewhere.sent++ != phase || later(w, phase) > 0;
    for (bt_idx i = w->cells->start[phase]; i < w->cells->start[phase] + w->cells->n_border[phase]; i++)
        elsewhere.wrong += elsewhere.log->done[w->cells->order[i]] != 1;
}

static void receive_phase(bt_world *w, int phase, bt_vel *v)
{
    (void)v;
    elsewhere.wrong += elsewhere.received++ != phase || elsewhere.sent != phase + 1 || later(w, phase) > 0;
}

/// One pass, over cells that are all listed; a thread may be held up (visitor).
static void assert_pass(bt_world *w, bt_which which, int held_up)
{
    const size_t bodies = (size_t)w->bodies.n, cells = (size_t)w->cells->n;
    log_of_pass log = {.holder = bt_alloc(bodies, sizeof *log.holder),
                       .stamp = bt_alloc(bodies, sizeof *log.stamp),
                       .visits = bt_alloc(cells, sizeof *log.visits),
                       .done = bt_alloc(cells, sizeof *log.done)};
    bt_totals t = {.n_sums = 1};
    elsewhere.log = &log;
    elsewhere.sent = elsewhere.received = elsewhere.wrong = 0;
    for (int p = 0; p < BT_PHASES; p++) elsewhere.at_work[p] = 0;
    log_of_pass *of_bodies = &log;
    bt_phases_run(w, which, &(bt_before){see_to_bodies, &of_bodies}, visit, &(visitor){&log, held_up},
                  w->exchange ? w->bodies.vel : NULL, &t);
    assert_int_equal(elsewhere.sent, w->exchange ? BT_PHASES : 0);
    assert_int_equal(elsewhere.received, elsewhere.sent);
    assert_int_equal(elsewhere.wrong, 0);
    assert_int_equal(log.shared, 0);
    assert_int_equal(log.early, 0);
    CHECK_CLOSE(bt_sum_value(&t.sum[0]), w->cells->n_contacts, 0);
    CHECK_CLOSE(t.most, 1, 0);
    for (size_t k = 0; k < cells; k++) assert_int_equal(log.visits[k], w->cells->cell[k].n_contacts > 0);
    free(log.holder);
    free(log.stamp);
    free(log.visits);
    free(log.done);
}

static void assert_sound(bt_world *w, int held_up)
{
    assert_pass(w, BT_WITH_WORK, held_up);
    memcpy(w->cells->swept, w->cells->busy, (size_t)w->cells->n_busy * sizeof *w->cells->swept);
    w->cells->n_swept = w->cells->n_busy;
    assert_pass(w, BT_LISTED, held_up);
}

typedef struct {
    double length, width;
    bool round_x, round_y;
    double at_x, at_y; ///< of a large movable body, as shares; negative = none
} scene;

/// 6,000 floes or more thrown into some thousand cells, over each other: only the order is asked for.
static bt_world *fill(const scene *s, uint64_t *rng)
{
    bt_params p = scene_params(0.1, 1);
    p.cell = 2;
    p.period_x = s->round_x ? s->length : 0;
    p.period_y = s->round_y ? s->width : 0;
    bt_world *w = bt_world_create(&p);
    double v[2 * BT_MAX_VERTICES];
    for (int i = 0; i < 2.0 / 3 * s->length * s->width; i++) {
        const int nv = scene_random_polygon(rng, 0.3 + 0.2 * scene_uniform(rng), v);
        bt_body_def d = scene_prism(nv, v, 900);
        d.x = s->length * scene_uniform(rng), d.y = s->width * scene_uniform(rng);
        bt_world_add(w, &d);
    }
    if (s->at_x >= 0) {
        const int nv = bt_shape_named("disc", 9, 9, v);
        bt_body_def d = scene_prism(nv, v, 900);
        d.x = s->at_x * s->length, d.y = s->at_y * s->width, d.large = true;
        bt_world_add(w, &d);
    }
    detect_all(w, 0.1);
    return w;
}

static const scene scenes[] = {
    {90, 90, false, false, -1, 0},      {300, 30, false, false, -1, 0},     {90, 90, true, true, -1, 0},
    {30, 480, false, true, -1, 0},      {90, 90, false, false, 0.4, 0.6},   {30, 480, false, true, 0.5, 0.999},
    {480, 30, true, false, 0.001, 0.5}, {12, 1200, false, true, 0.5, 0.26},
};
enum { N_SCENES = sizeof scenes / sizeof *scenes };

TEST(every_body_meets_its_cells_in_order)
{
    uint64_t rng = 11;
    for (int f = 0; f < N_SCENES; f++)
        for (int threads = 1; threads <= 4; threads++) {
            omp_set_num_threads(threads);
            bt_world *w = fill(&scenes[f], &rng);
            const bt_cells *t = w->cells;
            assert_int_equal(t->n_shares, threads);
            assert_int_equal(scenes[f].at_x >= 0, t->cell[t->n - 1].n_contacts > 0);
            assert_sound(w, -1);
            assert_sound(w, -2);
            assert_sound(w, f % threads);
            bt_world_free(w);
        }
}

/// The cells at the border of a rank come first in each phase, and what they do is sent when they are all done, however
/// long one of them takes.
TEST(the_border_is_done_before_it_is_sent)
{
    static const bt_exchange fake = {.send = send_phase, .receive = receive_phase};
    uint64_t rng = 5;
    for (int threads = 1; threads <= 4; threads++) {
        omp_set_num_threads(threads);
        bt_world *w = fill(&scenes[5], &rng);
        bt_cells *t = w->cells;
        for (bt_idx k = 0; k < t->n; k++) t->cell[k].border = k % 3 == 0 || k == t->n - 1;
        w->exchange = &fake;
        bt_phases_order(w);
        for (int p = 0; p < BT_PHASES; p++) {
            assert_true(t->n_border[p] > 0);
            for (bt_idx i = t->start[p]; i < t->start[p + 1]; i++)
                assert_int_equal(t->cell[t->order[i]].border, i < t->start[p] + t->n_border[p]);
        }
        assert_sound(w, -1);
        assert_sound(w, -2);
        if (threads > 1) assert_sound(w, -3);
        w->exchange = NULL;
        bt_world_free(w);
    }
}

/// Lists of all lengths: the shares of a sweep are of listed contacts, and hold every cell with a list once, those of
/// other passes are of all contacts and all cells.
TEST(shares_follow_the_lists)
{
    uint64_t rng = 3;
    for (int threads = 1; threads <= 3; threads++) {
        omp_set_num_threads(threads);
        bt_world *w = fill(&(scene){90, 90, false, false, -1, 0}, &rng);
        bt_cells *t = w->cells;
        for (bt_idx i = 0; i < t->n_order; i++)
            t->cell[t->order[i]].n_listed = i % 7 == 0 ? 0 : t->cell[t->order[i]].n_contacts;
        bt_phases_distribute(w);
        assert_int_equal(t->n_shares, threads);
        for (int p = 0; p < 2 * BT_COLOURS; p++) {
            const bool listed = p % 2;
            bt_idx at = t->start[p / 2];
            int64_t least = INT64_MAX, most = 0, largest = 0;
            for (bt_idx s = 0; s < threads; s++) {
                const bt_share *share = &t->share[((listed ? BT_STRETCHES : 0) + 2 * (p / 2) + 1) * threads + s];
                assert_int_equal(share->begin, at);
                at = share->end;
                int64_t contacts = 0;
                for (bt_idx i = share->begin; i < share->end; i++) {
                    const bt_cell *cell = &t->cell[t->order[i]];
                    const bt_idx n = listed ? cell->n_listed : cell->n_contacts;
                    assert_true(!listed || n > 0);
                    contacts += n;
                    largest = n > largest ? n : largest;
                }
                least = contacts < least ? contacts : least, most = contacts > most ? contacts : most;
            }
            for (; listed && at < t->start[p / 2 + 1]; at++) assert_int_equal(t->cell[t->order[at]].n_listed, 0);
            assert_int_equal(at, t->start[p / 2 + 1]);
            assert_true((double)(most - least) <= 2 * (double)largest + 0.05 * (double)most);
        }
        assert_pass(w, BT_WITH_WORK, -1);
        for (bt_idx i = 0; i < t->n_order; i++) t->cell[t->order[i]].n_listed = 0;
        bt_phases_distribute(w);
        assert_pass(w, BT_WITH_WORK, -1);
        bt_world_free(w);
    }
}

/// A team smaller than the number of shares: what nobody has is taken by those who are there.
TEST(a_small_team_does_all)
{
    uint64_t rng = 8;
    omp_set_num_threads(4);
    bt_world *w = fill(&(scene){30, 480, false, true, 0.5, 0.3}, &rng);
    assert_int_equal(w->cells->n_shares, 4);
    omp_set_max_active_levels(1);
#pragma omp parallel num_threads(2)
#pragma omp single
    {
        assert_int_equal(omp_get_num_threads(), 2); // within it every team is of one thread
        assert_sound(w, -1);
    }
    bt_world_free(w);
}

/// Detection in a team of the caller, by a thread whose number is higher than the library's threads.
TEST(a_team_of_the_caller_detects)
{
    uint64_t rng = 8;
    bt_world *w = fill(&scenes[0], &rng);
    const bt_idx contacts = w->cells->n_contacts;
    omp_set_num_threads(1);
#pragma omp parallel num_threads(4)
    if (omp_get_thread_num() == 3) {
        omp_set_num_threads(1);
        detect_all(w, 0.1);
    }
    assert_int_equal(w->cells->n_contacts, contacts);
    bt_world_free(w);
}

/// A sum over the cells, and two maxima that are negative: of the lowest cell, and of the highest.
static void visit_busy(bt_world *w, bt_idx k, const void *visits, bt_totals *t)
{
    atomic_fetch_add(&((atomic_int *const *)visits)[0][k], 1);
    bt_sum_add(&t->sum[0], k);
    t->most = bt_max(t->most, -1 - (double)k);
    t->most2 = bt_max(t->most2, (double)k - w->cells->n);
}

TEST(every_busy_cell_is_visited_once)
{
    uint64_t rng = 9;
    for (int threads = 1; threads <= 4; threads++) {
        omp_set_num_threads(threads);
        bt_world *w = fill(&scenes[0], &rng);
        bt_cells *t = w->cells;
        const bt_idx all = t->n_busy;
        const bt_idx counts[] = {all, BT_FEW_CELLS + 1, BT_FEW_CELLS, 1, 0};
        assert_true(all > 4 * BT_FEW_CELLS);
        for (int c = 0; c < 5; c++) {
            t->n_busy = counts[c];
            atomic_int *visits = bt_alloc((size_t)t->n, sizeof *visits);
            bt_totals found = {.n_sums = 1, .most = -INFINITY, .most2 = -INFINITY};
            bt_phases_busy(w, visit_busy, &visits, &found);
            double sum = 0, highest = -1, lowest = INFINITY;
            for (bt_idx j = 0; j < t->n_busy; j++) {
                sum += t->busy[j], highest = bt_max(highest, t->busy[j]), lowest = bt_min(lowest, t->busy[j]);
                assert_int_equal(visits[t->busy[j]], 1);
                visits[t->busy[j]] = 0;
            }
            for (bt_idx k = 0; k < t->n; k++) assert_int_equal(visits[k], 0);
            CHECK_CLOSE(bt_sum_value(&found.sum[0]), sum, 0);
            const bool any = t->n_busy > 0;
            assert_true(any ? found.most == -1 - lowest : found.most == -INFINITY);
            assert_true(any ? found.most2 == highest - t->n : found.most2 == -INFINITY);
            free(visits);
        }
        t->n_busy = all;
        bt_world_free(w);
    }
}

TEST_MAIN(NULL, NULL)
