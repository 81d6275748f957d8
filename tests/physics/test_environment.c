// SPDX-License-Identifier: MIT
// Current and wind in time: ellipse and table by hand, floes that follow the water, what rests and what wakes.
#include "scene.h"


#include "case/case_derived.h"
#include "force/environment.h"
#include "base/table.h"

static const double hour = 3600, deg = BT_PI / 180;

static bt_case tidal_case(double major, double minor, double inclination, double phase)
{
    bt_case c;
    bt_case_defaults(&c);
    c.water.tide.major = major, c.water.tide.minor = minor;
    c.water.tide.inclination = inclination, c.water.tide.phase = phase;
    c.water.tide.period = 12 * hour;
    return c;
}

static void set_table(bt_table *t, int n, const double *row)
{
    t->n = n;
    t->row = bt_alloc((size_t)n, 3 * sizeof *row);
    memcpy(t->row, row, (size_t)n * 3 * sizeof *row);
}

/// Largest along the major axis at phase/2π T; a quarter of a period later along the minor axis, turned from x towards
/// y.
TEST(ellipse_by_hand)
{
    bt_case c = tidal_case(0.5, 0.2, 30 * deg, 60 * deg); // largest at 2 h
    c.water.current_x = 0.1, c.water.current_y = -0.05;
    const double x = cos(30 * deg), y = sin(30 * deg);
    const double want[4][2] = {{0.5 * x, 0.5 * y}, {-0.2 * y, 0.2 * x}, {-0.5 * x, -0.5 * y}, {0.2 * y, -0.2 * x}};
    for (int k = 0; k < 8; k++) {
        double v[2];
        bt_environment_at(&c, true, (2 + 3 * k) * hour, v);
        CHECK_CLOSE(v[0], 0.1 + want[k % 4][0], 1e-12);
        CHECK_CLOSE(v[1], -0.05 + want[k % 4][1], 1e-12);
    }
    CHECK_CLOSE(bt_case_fastest_flow(&c, true), hypot(0.1, 0.05) + 0.5, 1e-15);
    // The mean: of whole periods the constant part; of the half in which the current goes along the axis 2/π of the
    // largest more.
    double mean[2];
    c.run.duration = 24 * hour;
    bt_environment_mean(&c, mean);
    CHECK_CLOSE(mean[0], 0.1, 1e-9);
    CHECK_CLOSE(mean[1], -0.05, 1e-9);
    c.run.duration = 6 * hour, c.water.tide.phase = 90 * deg;
    bt_environment_mean(&c, mean);
    CHECK_CLOSE(mean[0], 0.1 + 2 / BT_PI * 0.5 * x, 1e-6);
    CHECK_CLOSE(mean[1], -0.05 + 2 / BT_PI * 0.5 * y, 1e-6);
    bt_case_free(&c);
}

TEST(table_by_hand)
{
    bt_table t;
    set_table(&t, 4, (const double[]){-1, 0, 2, 3, 4, 2, 4, 4, 0, 10, 1, 1});
    const double want[][3] = {{-5, 0, 2},     {-1, 0, 2}, {0, 1, 2},     {1, 2, 2},  {3, 4, 2},
                              {3.25, 4, 1.5}, {4, 4, 0},  {7, 2.5, 0.5}, {10, 1, 1}, {99, 1, 1}};
    for (size_t k = 0; k < sizeof want / sizeof *want; k++) {
        double v[2];
        bt_table_at(&t, want[k][0], v);
        CHECK_CLOSE(v[0], want[k][1], 1e-15);
        CHECK_CLOSE(v[1], want[k][2], 1e-15);
    }
    CHECK_CLOSE(bt_table_fastest(&t), hypot(4, 2), 0);
    bt_table_free(&t);
}

/// One disc of 1 m² at the origin with the velocity of the water at time zero.
static bt_world *disc_world(const bt_case *c, double dt, bt_drag drag)
{
    bt_params p = scene_params(dt, 1);
    bt_world *w = bt_world_create(&p);
    w->environment = bt_environment_create(c);
    assert_non_null(w->environment);
    double v[2 * 24], u[2];
    bt_shape_regular(24, 1, v);
    bt_body_def d = scene_prism(24, v, 10);
    bt_environment_at(c, true, 0, u);
    d.drag = drag, d.vx = u[0], d.vy = u[1];
    bt_world_add(w, &d);
    return w;
}

/// A floe that clings to the water goes where the water goes: x = (a/ω)(sin(ωt − φ) + sin φ) along the major axis,
/// y = (b/ω)(cos φ − cos(ωt − φ)). The way of the water is of second order in Δt: it takes the current of the middle of
/// a step.
TEST(light_floe_follows_the_ellipse)
{
    double error[2];
    for (int k = 0; k < 2; k++) {
        const double dt = k ? 600 : 1200, a = 0.5, b = -0.2, phase = 1, om = 2 * BT_PI / (12 * hour);
        bt_case c = tidal_case(a, b, 0, phase);
        bt_world *w = disc_world(&c, dt, (bt_drag){.water_skin = 1e12});
        error[k] = 0;
        for (int s = 1; s * dt <= 11 * hour; s++) { // not a whole period, over which errors cancel
            bt_world_step(w);
            const double t = s * dt, x = a / om * (sin(om * t - phase) + sin(phase)),
                         y = b / om * (cos(phase) - cos(om * t - phase));
            const bt_pose *p = &w->bodies.pose[bt_world_index(w, 0)];
            error[k] = bt_max(error[k], hypot(p->x - x, p->y - y));
        }
        assert_true(error[k] < 1e-3 * a / om * (dt / 600) * (dt / 600));
        bt_world_free(w);
        bt_case_free(&c);
    }
    CHECK_CLOSE(error[0] / error[1], 4, 0.1);
}

/// Without drag: with the dynamic tilt a body moves with the water, Coriolis or not. The geostrophic tilt leaves it
/// behind: of a current u cos ωt along x, Coriolis apart, it knows nothing.
TEST(dynamic_tilt_carries_a_body)
{
    for (int k = 0; k < 4; k++) {
        const bool dynamic = k & 1, turning = k & 2;
        bt_case c = tidal_case(0.5, turning ? 0.2 : 0, 20 * deg, 1);
        c.water.tilt = dynamic ? BT_TILT_DYNAMIC : BT_TILT_GEOSTROPHIC;
        bt_world *w = disc_world(&c, 60, (bt_drag){0});
        const double f = turning ? 1.4e-4 : 0;
        w->par.coriolis = f;
        double apart = 0;
        for (int s = 0; s < 600; s++) {
            bt_world_step(w);
            const bt_vel *v = &w->bodies.vel[bt_world_index(w, 0)];
            apart = bt_max(apart, hypot(v->x - w->par.water_u, v->y - w->par.water_v));
        }
        if (dynamic) assert_true(apart < 1e-12);
        else assert_true(apart > 0.4);
        bt_world_free(w);
        bt_case_free(&c);
    }
}

enum { SIDE = 20 };

/// A sparse field at rest. disturbed: every floe is looked at in every step, whatever its velocity.
static bt_world *field_world(const bt_case *c, int steps, bool disturbed, double *active)
{
    bt_params p = scene_params(0.5, 1);
    bt_world *w = bt_world_create(&p);
    w->environment = bt_environment_create(c);
    for (int i = 0; i < SIDE * SIDE; i++) {
        double v[8];
        scene_square(1, v);
        bt_body_def d = scene_prism(4, v, 10);
        d.drag = (bt_drag){.water_skin = 50, .air_skin = 0.5};
        d.x = 3 * (i % SIDE), d.y = 3 * (i / SIDE), d.yaw = i;
        bt_world_add(w, &d);
    }
    memset(w->bodies.disturbed, 0, (size_t)w->bodies.n);
    for (int s = 0; s < steps; s++) {
        if (disturbed) memset(w->bodies.disturbed, 1, (size_t)w->bodies.n);
        bt_world_step(w);
        if (active) active[s] = (double)w->stats.n_active;
    }
    return w;
}

static void check_same_field(const bt_case *c)
{
    double active[100];
    bt_world *a = field_world(c, 100, false, active), *b = field_world(c, 100, true, NULL);
    // Nothing to do until the water, or the wind, begins to move at 10 s; then every floe is in motion.
    for (int s = 0; s < 100; s++) CHECK_CLOSE(active[s], s < 20 ? 0 : SIDE * SIDE, 0);
    assert_true(bt_world_hash(a) == bt_world_hash(b));
    const bt_vel *first = &a->bodies.vel[bt_world_index(a, 0)];
    assert_true(fabs(first->x) > 1e-3);
    for (bt_gid g = 1; g < SIDE * SIDE; g++) {
        const bt_vel *v = &a->bodies.vel[bt_world_index(a, g)];
        assert_true(v->x == first->x && v->y == first->y); // all alike: none slept on
    }
    bt_world_free(a);
    bt_world_free(b);
}

/// A field at rest costs nothing and wakes as a whole: when the current sets in, and also when it only changes for
/// others than the water: a gust.
TEST(rest_ends_when_the_water_or_the_wind_moves)
{
    const double rows[] = {0, 0, 0, 10, 0, 0, 20, 0.3, -0.1, 30, 0.3, -0.1, 50, 0, 0},
                 gust[] = {0, 0, 0, 10, 0, 0, 11, 20, 0, 12, 0, 0, 50, 0, 0};
    bt_case c;
    bt_case_defaults(&c);
    set_table(&c.water.table, 5, rows);
    check_same_field(&c);
    bt_case_free(&c);
    bt_case_defaults(&c);
    set_table(&c.air.table, 5, gust);
    check_same_field(&c);
    bt_case_free(&c);
}

/// A floe with exactly the water's velocity rests in that step; when the water goes faster in the next, it must not
/// keep its old velocity.
TEST(a_floe_at_rest_follows_a_new_current)
{
    bt_case c;
    bt_case_defaults(&c);
    // 0.25 m/s (a power of two) until 10 s. Air moves with the water: calm.
    const double rows[] = {0, 0.25, 0, 10, 0.25, 0, 11, 0.5, 0, 50, 0.5, 0};
    set_table(&c.water.table, 4, rows);
    set_table(&c.air.table, 4, rows);
    bt_params p = scene_params(0.5, 1);
    p.water_u = p.air_u = 0.25;
    bt_world *w = bt_world_create(&p);
    w->environment = bt_environment_create(&c);
    for (int i = 0; i < 9; i++) {
        double v[8];
        scene_square(1, v);
        bt_body_def d = scene_prism(4, v, 10);
        d.drag.water_skin = 50;
        d.x = 3 * (i % 3), d.y = 3 * (i / 3), d.vx = 0.25;
        bt_world_add(w, &d);
    }
    memset(w->bodies.disturbed, 0, (size_t)w->bodies.n);
    for (int s = 1; s <= 100; s++) {
        bt_world_step(w);
        const bt_vel *v = &w->bodies.vel[bt_world_index(w, 4)];
        if (s <= 20) assert_true(v->x == 0.25 && w->stats.n_active == 0);
        else assert_true(w->stats.n_active == 9);
    }
    assert_true(w->bodies.vel[bt_world_index(w, 4)].x > 0.48);
    bt_world_free(w);
    bt_case_free(&c);
}

/// One square of 4 kg at rest at the middle of the upper side of a wall.
static bt_world *on_a_wall(void)
{
    bt_params p = scene_params(0.5, 1);
    bt_world *w = bt_world_create(&p);
    double v[8];
    scene_square(2, v);
    bt_body_def d = scene_prism(4, v, 1);
    d.drag = (bt_drag){.water_skin = 50, .air_skin = 1}, d.y = 1;
    bt_world_add(w, &d);
    scene_wall(w, -4, -1, 4, 0, 0);
    memset(w->bodies.disturbed, 0, (size_t)w->bodies.n);
    return w;
}

/// Velocity zero is not rest where the wall alone holds a floe against wind or slope: it stays active, and the wall
/// bears the force in each step.
TEST(what_a_wall_holds_does_not_rest)
{
    for (int kind = 0; kind < 3; kind++) {
        bt_world *w = on_a_wall();
        if (kind == 1) w->par.air_v = -4;
        if (kind == 2) w->par.tilt_ay = -0.25;
        for (int s = 0; s < 10; s++) {
            bt_world_step(w);
            const bt_idx i = bt_world_index(w, 0);
            const bt_vel *v = &w->bodies.vel[i], *free = &w->bodies.vel_free[i];
            assert_true(v->x == 0 && v->y == 0 && v->w == 0);
            assert_true(kind ? free->y < -1e-2 : free->y == 0);
            if (s > 0) CHECK_CLOSE((double)w->stats.n_active, kind > 0, 0);
        }
        bt_world_free(w);
    }
}

/// With the water's velocity and no drag, a floe that turns goes on turning.
TEST(what_turns_does_not_rest)
{
    bt_params p = scene_params(0.5, 1);
    bt_world *w = bt_world_create(&p);
    double v[8];
    scene_square(2, v);
    bt_body_def d = scene_prism(4, v, 1);
    d.yaw_rate = 0.125;
    bt_world_add(w, &d);
    memset(w->bodies.disturbed, 0, (size_t)w->bodies.n);
    for (int s = 0; s < 8; s++) bt_world_step(w);
    const bt_pose *q = &w->bodies.pose[bt_world_index(w, 0)];
    CHECK_CLOSE(q->yaw, 0.5, 1e-12);
    bt_world_free(w);
}

/// Cells go with the water: floes that do the same stay in theirs however far the tide carries them (here 7 km, cells
/// of some metres).
TEST(cells_go_with_the_tide)
{
    bt_case c = tidal_case(0.5, 0.3, 40 * deg, 0);
    bt_params p = scene_params(60, 1);
    bt_world *w = bt_world_create(&p);
    w->environment = bt_environment_create(&c);
    double u[2];
    bt_environment_at(&c, true, 0, u);
    for (int i = 0; i < 100; i++) {
        double v[8];
        scene_square(1, v);
        bt_body_def d = scene_prism(4, v, 10);
        d.drag.water_skin = 1e9;
        d.x = 2 * (i % 10), d.y = 2 * (i / 10), d.vx = u[0], d.vy = u[1];
        bt_world_add(w, &d);
    }
    double most = 0;
    for (int s = 0; s < 720; s++) {
        bt_world_step(w);
        most = bt_max(most, hypot(w->bodies.pose[bt_world_index(w, 0)].x, w->bodies.pose[bt_world_index(w, 0)].y));
    }
    assert_true(most > 3000);
    // Once at the start, once when the first speed was seen.
    assert_true(w->cells->n_labellings <= 3);
    CHECK_CLOSE(w->drift_x, w->bodies.pose[bt_world_index(w, 0)].x, 1);
    bt_world_free(w);
    bt_case_free(&c);
}

TEST_MAIN(NULL, NULL)
