// SPDX-License-Identifier: MIT
// What rounds do when the work is spent: on made-up problems whose residual after each sweep is given. Tried: unknowns
// never kept, kept from the first sweep on, not put back, and put back although the problem is solved; no further
// attempts, one for ever, and further ones although the result is near: each red.
#include "test.h"
#include "all_pairs.h"

#include "solve/rounds.h"

enum { SWEEPS = 160 };

/// A problem with one unknown, the number of the sweep that it comes from.
static struct {
    double residual[SWEEPS]; ///< after each sweep
    double share;            ///< of an update in the residual after it; 0: updates are large
    int sweeps;              ///< done
    int looks;               ///< residual passes
    int at;                  ///< the unknown
    int best;                ///< what is kept; −1 = nothing
    int puts;                ///< how often it was put back
} made_up;

static bool first(const bt_world *w, bt_idx k) { return k == w->cells->order[0]; }

static void residual_of(bt_world *w, bt_idx k, const void *context, bt_totals *t)
{
    (void)context, (void)t;
    bt_cell *cell = &w->cells->cell[k];
    bt_rounds_list(cell);
    cell->work->list[cell->n_listed++] = 0;
    made_up.looks++;
    bt_rounds_found(cell, &(bt_found){.most = made_up.residual[made_up.at], .bad = 1});
}

static void sweep(bt_world *w, bt_idx k, const void *context, bt_totals *t)
{
    (void)context;
    if (first(w, k)) made_up.at = made_up.sweeps++;
    t->most = made_up.share > 0 ? made_up.share * made_up.residual[made_up.at] : 1e3;
}

static void keep(bt_world *w, bt_idx k, const void *context, bt_totals *t)
{
    (void)t;
    const bt_keeping what = *(const bt_keeping *)context;
    if (!first(w, k)) return;
    if (what == BT_PUT_BACK) {
        assert_true(made_up.best >= 0);
        made_up.at = made_up.best;
        made_up.puts++;
    } else {
        made_up.best = what == BT_KEEP ? made_up.at : -1;
    }
}

/// Solve within a limit of work by rounds of `length` sweeps; returns the residual.
static double run_rounds(const double *residual, int length, double limit)
{
    made_up.sweeps = made_up.at = made_up.puts = made_up.looks = 0;
    made_up.best = -1;
    for (int i = 0; i < SWEEPS; i++) made_up.residual[i] = residual[i];
    bt_world *w = bt_world_create(&(bt_params){.dt = 1, .size = 1, .max_sweeps = 1});
    double v[8];
    scene_square(1, v);
    for (int i = 0; i < 2; i++) {
        bt_body_def d = scene_prism(4, v, 900);
        d.x = 1.0 * i;
        bt_world_add(w, &d);
    }
    detect_all(w, 0.1);
    bt_rounds_begin(w);
    assert_int_equal(w->cells->n_order, 1);
    assert_int_equal(w->cells->n_contacts, 1);
    w->cells->cell[w->cells->order[0]].swept = true;
    const bt_problem p = {.residual = residual_of, .sweep = sweep, .keep = keep, .vel = w->bodies.vel,
                          .tolerance = 1, .cap = 0.9, .length = length, .limit = limit};
    bt_work work = {.residual = INFINITY};
    bt_rounds_run(w, &p, &work);
    CHECK_CLOSE(work.residual, made_up.residual[made_up.at], 0);
    assert_int_equal(made_up.best, -1); // nothing stays behind
    bt_world_free(w);
    return work.residual;
}

/// With twenty sweeps of momentum and six without. A sweep over the one contact counts for two against the limit, with
/// the residual after it.
static double run(const double *residual) { return run_rounds(residual, 1, 40); }

/// 9 after each sweep but those given as pairs (sweep, residual), ended by −1.
static void script(double *residual, const double *pairs)
{
    for (int i = 0; i < SWEEPS; i++) residual[i] = 9;
    for (; pairs[0] >= 0; pairs += 2) residual[(int)pairs[0]] = pairs[1];
}

TEST(the_best_of_the_second_half_is_the_result)
{
    double r[SWEEPS];
    script(r, (double[]){3, 2, 13, 5, 15, 3, 17, 4, -1});
    CHECK_CLOSE(run(r), 3, 0);
    assert_int_equal(made_up.at, 15);
    assert_int_equal(made_up.puts, 2); // before the sweeps without momentum, and at the end
    assert_int_equal(made_up.sweeps, 26);
}

TEST(a_better_end_stays)
{
    double r[SWEEPS];
    script(r, (double[]){15, 3, 25, 2, -1});
    CHECK_CLOSE(run(r), 2, 0);
    assert_int_equal(made_up.at, 25);
    assert_int_equal(made_up.puts, 1);
}

TEST(a_result_far_off_has_further_attempts)
{
    double r[SWEEPS];
    script(r, (double[]){31, 3.5, -1}); // in the first of them: ten sweeps with momentum, six without
    CHECK_CLOSE(run(r), 3.5, 0);
    assert_int_equal(made_up.sweeps, 26 + 16);
    script(r, (double[]){-1}); // in none of two
    CHECK_CLOSE(run(r), 9, 0);
    assert_int_equal(made_up.sweeps, 26 + 2 * 16);
    script(r, (double[]){50, 0.5, -1});
    CHECK_CLOSE(run(r), 0.5, 0);
    assert_int_equal(made_up.sweeps, 51);
}

TEST(a_solution_is_kept_whatever_came_before)
{
    double r[SWEEPS];
    script(r, (double[]){15, 3, 18, 0.5, -1});
    CHECK_CLOSE(run(r), 0.5, 0);
    assert_int_equal(made_up.sweeps, 19);
    assert_int_equal(made_up.puts, 0);
}

/// Residuals that are three times the updates and fall by 3 % a sweep: rounds that ended at updates of 0.7 would be of
/// one sweep each, until the residual is the tolerance.
TEST(rounds_that_end_in_vain_become_longer)
{
    double r[SWEEPS];
    for (int i = 0; i < SWEEPS; i++) r[i] = 2 * pow(0.97, i);
    made_up.share = 1.0 / 3;
    const double residual = run_rounds(r, 40, 1000);
    made_up.share = 0;
    assert_true(residual <= 1 && made_up.sweeps < 60);
    assert_true(made_up.looks <= 8); // 25 and more otherwise
}

enum { LENGTH = 3, SEEN = 3 * LENGTH };

/// Two pairs of floes in cells side by side. A sweep over the first moves a floe of its own cell, one over the second
/// its floe in the cell beyond, each by 1 m/s. The second is listed from the residual pass after the first round on.
static struct {
    int passes[2], sweeps[2];
    double speed[2][SEEN]; ///< as each sweep over it finds it
} apart;

static int which(const bt_world *w, bt_idx k) { return w->cells->cell[k].x > 0; }

static void list_in_turn(bt_world *w, bt_idx k, const void *context, bt_totals *t)
{
    (void)context, (void)t;
    bt_cell *cell = &w->cells->cell[k];
    bt_rounds_list(cell);
    if (apart.passes[which(w, k)]++ >= which(w, k)) cell->work->list[cell->n_listed++] = 0;
    bt_rounds_found(cell, &(bt_found){.most = 9, .bad = 1});
}

static void speed_up(bt_world *w, bt_idx k, const void *context, bt_totals *t)
{
    (void)context;
    const bt_cell *cell = &w->cells->cell[k];
    const int c = which(w, k), n = apart.sweeps[c];
    t->most = 1e3;
    if (cell->n_listed == 0) return;
    const bt_cell *moved = c ? &w->cells->cell[cell->right] : cell;
    if (n < SEEN) apart.speed[c][n] = w->bodies.vel[moved->first].x, apart.sweeps[c]++;
    w->bodies.vel[moved->first].x += 1;
}

/// Momentum is that of Nesterov, by what the last sweep has changed, and goes on from one round to the next; of a cell
/// that comes into the lists with the second there is no such change, and it has none before its first sweep.
TEST(what_is_new_in_the_lists_has_no_momentum)
{
    memset(&apart, 0, sizeof apart);
    bt_world *w = bt_world_create(&(bt_params){.dt = 1, .size = 1, .max_sweeps = 1});
    double v[8];
    scene_square(1, v);
    for (int i = 0; i < 4; i++) {
        bt_body_def d = scene_prism(4, v, 900);
        d.x = (i < 2 ? 1 : 7.9) + i, d.y = 2; // cells of 5 m
        bt_world_add(w, &d);
    }
    detect_all(w, 0.1);
    bt_rounds_begin(w);
    assert_int_equal(w->cells->n_order, 2);
    for (bt_idx i = 0; i < 4; i++) w->bodies.vel[i].x = 7;
    const bt_problem p = {.residual = list_in_turn, .sweep = speed_up, .vel = w->bodies.vel, .tolerance = 1, .cap = 0.9,
                          .length = LENGTH, .limit = SEEN};
    bt_work work = {0};
    assert_int_equal(w->bodies.cell[3][0], 2);
    bt_rounds_residual(w, &p, BT_BEGINS, &work);
    bt_rounds_run(w, &p, &work);
    double theta = 1, now[2] = {7, 7}, before[2] = {7, 7};
    for (int n = 0; n < 2 * LENGTH; n++) {
        if (n > 0) {
            const double next = 0.5 * (1 + sqrt(1 + 4 * theta * theta)), beta = (theta - 1) / next;
            theta = next;
            for (int c = 0; c < 2; c++) {
                const double moved = now[c] + beta * (now[c] - before[c]);
                before[c] = now[c];
                now[c] = moved;
            }
        }
        for (int c = 0; c < 2; c++) {
            const int at = c ? n - LENGTH : n; // of the sweeps over it
            if (at < 0) continue;
            CHECK_CLOSE(apart.speed[c][at], now[c], 1e-12);
            now[c] += 1;
        }
    }
    assert_true(now[1] > 7 + LENGTH + 0.5); // it has momentum later
    bt_world_free(w);
}

static int looks[2];

static void nothing(bt_world *w) { (void)w; }

static void look(bt_world *w, bt_idx k, const void *context, bt_totals *t)
{
    (void)context, (void)t;
    looks[w->cells->cell[k].x > 2]++;
    bt_rounds_list(&w->cells->cell[k]);
    if (w->cells->cell[k].x <= 2) w->cells->cell[k].work->list[w->cells->cell[k].n_listed++] = 0;
    bt_rounds_found(&w->cells->cell[k], &(bt_found){.most = 2, .rows = 1});
}

/// Of a cell whose bodies no sweep has moved, the residual of before counts, and it is looked at no more; after a
/// settling all are.
TEST(a_residual_is_taken_where_something_moved)
{
    bt_world *w = bt_world_create(&(bt_params){.dt = 1, .size = 1, .max_sweeps = 1});
    double v[8];
    scene_square(1, v);
    for (int i = 0; i < 4; i++) {
        bt_body_def d = scene_prism(4, v, 900);
        d.x = i / 2 * 30 + i % 2 + 1, d.y = 2;
        bt_world_add(w, &d);
    }
    detect_all(w, 0.1);
    bt_rounds_begin(w);
    const bt_problem p = {.residual = look, .settle = nothing, .vel = w->bodies.vel, .tolerance = 1, .per_square = 1};
    bt_work work = {0};
    const bt_since since[4] = {BT_BEGINS, BT_SWEPT, BT_SETTLES, BT_SWEPT};
    for (int n = 0; n < 4; n++) {
        bt_rounds_residual(w, &p, since[n], &work);
        CHECK_CLOSE(work.residual, 2, 0);
        assert_int_equal(work.rows, 2);
    }
    assert_int_equal(looks[0], 4);
    assert_int_equal(looks[1], 2);
    assert_int_equal(work.checks, 2 + 1 + 4 + 1); // a settling counts as one more look at all
    bt_world_free(w);
}

TEST_MAIN(NULL, NULL)
