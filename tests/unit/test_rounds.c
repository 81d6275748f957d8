// SPDX-License-Identifier: MIT
// What rounds do when the work is spent: on made-up problems whose residual after each sweep is given. Tried: unknowns
// never kept, kept from the first sweep on, not put back, and put back although the problem is solved; no further
// attempts, one for ever, and further ones although the result is near: each red.
#include "all_pairs.h"

#include "solve/rounds.h"

enum { SWEEPS = 160 };

/// A problem with one unknown, the number of the sweep that it comes from.
static struct {
    double residual[SWEEPS]; ///< after each sweep
    int sweeps;              ///< done
    int at;                  ///< the unknown
    int best;                ///< what is kept; −1 = nothing
    int puts;                ///< how often it was put back
} made_up;

static bool first(const bt_world *w, bt_idx k) { return k == w->cells->order[0]; }

static void residual_of(bt_world *w, bt_idx k, const void *context, bt_totals *t)
{
    (void)context;
    bt_rounds_list(&w->cells->cell[k]);
    t->most = bt_max(t->most, made_up.residual[made_up.at]);
}

static void sweep(bt_world *w, bt_idx k, const void *context, bt_totals *t)
{
    (void)context;
    t->most = 1e3;
    if (first(w, k)) made_up.at = made_up.sweeps++;
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

/// Solve with twenty sweeps of momentum and six without; returns the residual.
static double run(const double *residual)
{
    made_up.sweeps = made_up.at = made_up.puts = 0;
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
    assert_true(w->cells->n_order > 0);
    const bt_problem p = {.residual = residual_of, .sweep = sweep, .keep = keep, .vel = w->bodies.vel,
                          .tolerance = 1, .cap = 0.9, .length = 1, .limit = 20};
    bt_work work = {.residual = INFINITY};
    bt_rounds_run(w, &p, &work);
    CHECK_CLOSE(work.residual, made_up.residual[made_up.at], 0);
    assert_int_equal(made_up.best, -1); // nothing stays behind
    bt_world_free(w);
    return work.residual;
}

/// 9 after each sweep but those given as pairs (sweep, residual), ended by −1.
static void script(double *residual, const double *pairs)
{
    for (int i = 0; i < SWEEPS; i++) residual[i] = 9;
    for (; pairs[0] >= 0; pairs += 2) residual[(int)pairs[0]] = pairs[1];
}

static void the_best_of_the_second_half_is_the_result(void **state)
{
    (void)state;
    double r[SWEEPS];
    script(r, (double[]){3, 2, 13, 5, 15, 3, 17, 4, -1});
    CHECK_CLOSE(run(r), 3, 0);
    assert_int_equal(made_up.at, 15);
    assert_int_equal(made_up.puts, 2); // before the sweeps without momentum, and at the end
    assert_int_equal(made_up.sweeps, 26);
}

static void a_better_end_stays(void **state)
{
    (void)state;
    double r[SWEEPS];
    script(r, (double[]){15, 3, 25, 2, -1});
    CHECK_CLOSE(run(r), 2, 0);
    assert_int_equal(made_up.at, 25);
    assert_int_equal(made_up.puts, 1);
}

static void a_result_far_off_has_further_attempts(void **state)
{
    (void)state;
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

static void a_solution_is_kept_whatever_came_before(void **state)
{
    (void)state;
    double r[SWEEPS];
    script(r, (double[]){15, 3, 18, 0.5, -1});
    CHECK_CLOSE(run(r), 0.5, 0);
    assert_int_equal(made_up.sweeps, 19);
    assert_int_equal(made_up.puts, 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_best_of_the_second_half_is_the_result),
        cmocka_unit_test(a_better_end_stays),
        cmocka_unit_test(a_result_far_off_has_further_attempts),
        cmocka_unit_test(a_solution_is_kept_whatever_came_before),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
