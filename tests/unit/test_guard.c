// SPDX-License-Identifier: MIT
// Guards: each fires at its limit and not below, names the step, and can be switched off.
#include "scene.h"

#include "bergtow/tiles.h"
#include "guard.h"

static bt_world *two_floes(void)
{
    const bt_params p = scene_params(0.1, 1);
    bt_world *w = bt_world_create(&p);
    double v[8] = {0.5, 0.5, -0.5, 0.5, -0.5, -0.5, 0.5, -0.5};
    for (int k = 0; k < 2; k++) {
        bt_body_def d = scene_prism(4, v, 100);
        d.x = 3 * k + 1, d.y = 2;
        bt_world_add(w, &d);
    }
    bt_tiles_begin(w);
    w->step = BT_ESCAPE_STEPS;
    w->stats.converged = true;
    return w;
}

static bt_case a_case(void)
{
    bt_case c;
    bt_case_defaults(&c);
    c.domain.x0 = c.domain.y0 = 0;
    c.domain.length = 10, c.domain.width = 4;
    c.guard.overlap = 0.5, c.guard.energy = 100, c.guard.unconverged = 3;
    return c;
}

static void expect(bt_guard *g, const bt_world *w, const char *part)
{
    bt_errors err = {0};
    const bt_status status = bt_guard_check(g, w, &err);
    if (!part) {
        if (status != BT_OK || err.n) fail_msg("refused: %s", err.n ? err.text[0] : "no message");
        return;
    }
    assert_int_equal(status, BT_ERR_NUMERIC);
    assert_int_equal(err.n, 1);
    if (!strstr(err.text[0], part) || !strstr(err.text[0], "step 50: ")) fail_msg("%s", err.text[0]);
    bt_errors_free(&err);
}

static void guards_fire_at_their_limits(void **state)
{
    (void)state;
    bt_case c = a_case();
    bt_world *w = two_floes();
    bt_guard g = {0};
    const double mass = w->bodies.mass[0] + w->bodies.mass[1], speed = 0.2;
    bt_guard_begin(&g, &c, w, 2, 0.8, speed);
    expect(&g, w, NULL);

    w->stats.overlap = 0.399;
    expect(&g, w, NULL);
    w->stats.overlap = 0.401;
    expect(&g, w, "overlap by 0.401 m, 0.501 of the mean floe size (guard.overlap 0.5)");
    w->stats.overlap = 0;

    w->stats.kinetic_energy = 0.999 * 100 * 0.5 * mass * speed * speed;
    expect(&g, w, NULL);
    w->stats.kinetic_energy *= 1.002;
    expect(&g, w, "guard.energy");
    w->stats.kinetic_energy = 0;

    w->stats.converged = false;
    expect(&g, w, NULL);
    expect(&g, w, NULL);
    w->stats.converged = true;
    expect(&g, w, NULL); // no longer in a row
    w->stats.converged = false;
    expect(&g, w, NULL);
    expect(&g, w, NULL);
    expect(&g, w, "3 steps in a row did not converge");
    w->stats.converged = true;

    w->bodies.pose[bt_world_index(w, 1)].y = 4.01;
    expect(&g, w, "floe 1 is beyond a wall");
    w->step++;
    expect(&g, w, NULL); // looked for now and then
    w->step--;
    c.domain.sides = BT_BOUND_OPEN;
    bt_guard_begin(&g, &c, w, 2, 0.8, speed);
    expect(&g, w, NULL);

    // All off: nothing is too much.
    c = a_case();
    c.guard.overlap = c.guard.energy = 0;
    c.guard.unconverged = 0;
    c.guard.escape = false;
    bt_guard_begin(&g, &c, w, 2, 0.8, speed);
    w->stats.overlap = w->stats.kinetic_energy = 1e30;
    w->stats.converged = false;
    for (int k = 0; k < 10; k++) expect(&g, w, NULL);
    bt_world_free(w);
}

static void numbers_that_are_none_are_found(void **state)
{
    (void)state;
    bt_world *w = two_floes();
    bt_errors err = {0};
    assert_int_equal(bt_guard_finite(w, &err), BT_OK);
    w->bodies.vel[bt_world_index(w, 1)].w = NAN;
    assert_int_equal(bt_guard_finite(w, &err), BT_ERR_NUMERIC);
    assert_true(err.n == 1 && strstr(err.text[0], "step 50: body 1 has a pose or velocity that is not a number"));
    bt_errors_free(&err);
    bt_world_free(w);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(guards_fire_at_their_limits), cmocka_unit_test(numbers_that_are_none_are_found)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
