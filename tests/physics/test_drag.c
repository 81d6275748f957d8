// SPDX-License-Identifier: MIT
// Form drag along the outline against plain sums, width and hull; no reversal at any step; added mass; free drift that
// stays.
#include "scene.h"
#include "force/forces.h"

#include "force/drift.h"
#include "step/window.h"

/// A convex outline of n corners on an ellipse, at random; vertices [2n].
static void random_outline(uint64_t *rng, int n, double *v)
{
    const double a = 1 + 3 * scene_uniform(rng), b = 1 + scene_uniform(rng);
    double angle = 0;
    for (int k = 0; k < n; k++) {
        angle += 2 * BT_PI / n * (0.6 + 0.4 * scene_uniform(rng));
        v[2 * k] = a * cos(angle), v[2 * k + 1] = b * sin(angle);
    }
    bt_shape_centre(n, v);
}

/// ∮ form max(0, −v·n) u dl and its moment by the middles of many pieces; u: the flow past the arm, which has a share
/// of what lies along the normal.
static void plain_sum(int n, const double *v, double form, double share, double rx, double ry, double w, double f[3])
{
    enum { PIECES = 4000 };
    f[0] = f[1] = f[2] = 0;
    for (int k = 0; k < n; k++) {
        const double *p = v + 2 * k, *q = v + 2 * ((k + 1) % n), ex = (q[0] - p[0]) / PIECES,
                     ey = (q[1] - p[1]) / PIECES;
        for (int j = 0; j < PIECES; j++) {
            const double x = p[0] + (j + 0.5) * ex, y = p[1] + (j + 0.5) * ey, vx = rx + w * y, vy = ry - w * x;
            const double g = form * bt_max(0, -(vx * ey - vy * ex));
            const double length = hypot(ex, ey), nx = ey / length, ny = -ex / length;
            const double out = (1 - share) * (x * nx + y * ny), ax = x - out * nx, ay = y - out * ny;
            f[0] += g * (rx + w * ay);
            f[1] += g * (ry - w * ax);
            f[2] += g * (ax * (ry - w * ax) - ay * (rx + w * ay));
        }
    }
}

static bt_world *one_body(double dt, bt_body_def *d)
{
    bt_params p = scene_params(dt, 1);
    bt_world *w = bt_world_create(&p);
    bt_world_add(w, d);
    return w;
}

/// Impulse of the drag on the only body.
static bt_impulse drag_of(const bt_world *w)
{
    bt_impulse law[BT_MAX_FORCE_LAWS], series[BT_MAX_FORCE_SERIES];
    bt_forces_impulses(w, 0, law, series);
    return series[bt_force_series_find("drag")];
}

/// Force and moment on a body that is led, any outline, drift and turn, water and air at once.
TEST(force_and_moment_are_the_integral)
{
    uint64_t rng = 1;
    for (int trial = 0; trial < 40; trial++) {
        double v[2 * 12];
        const int n = 3 + trial % 10;
        random_outline(&rng, n, v);
        bt_body_def d = scene_prism(n, v, 10);
        d.motion = BT_KINEMATIC, d.large = true, d.drag = (bt_drag){.water_form = 7, .air_form = 0.3};
        const double share = d.drag.tangential = 0.5 * (trial % 3);
        d.vx = scene_uniform(&rng) - 0.5, d.vy = scene_uniform(&rng) - 0.5,
        d.yaw_rate = trial % 4 ? scene_uniform(&rng) - 0.5 : 0;
        bt_world *w = one_body(0.5, &d);
        w->par.water_u = 0.2, w->par.air_v = -3;
        const bt_impulse e = drag_of(w);
        double water[3], air[3];
        plain_sum(n, v, 7, share, 0.2 - d.vx, -d.vy, d.yaw_rate, water);
        plain_sum(n, v, 0.3, share, -d.vx, -3 - d.vy, d.yaw_rate, air);
        const double scale = 0.5 * hypot(water[0], water[1]) + 0.5 * hypot(air[0], air[1]);
        CHECK_CLOSE(e.x, 0.5 * (water[0] + air[0]), 1e-6 * scale);
        CHECK_CLOSE(e.y, 0.5 * (water[1] + air[1]), 1e-6 * scale);
        CHECK_CLOSE(e.turn, 0.5 * (water[2] + air[2]), 1e-6 * scale * w->bodies.radius[0]);
        bt_world_free(w);
    }
}

/// On a body that is led, deflection and the tilt that balances the current bear f k×(U − U_w) of its mass, along and
/// across.
TEST(a_led_body_is_deflected)
{
    uint64_t rng = 7;
    for (int trial = 0; trial < 10; trial++) {
        double v[8];
        scene_square(2, v);
        bt_body_def d = scene_prism(4, v, 10);
        d.motion = BT_KINEMATIC, d.large = true, d.vx = scene_uniform(&rng) - 0.5, d.vy = scene_uniform(&rng) - 0.5;
        bt_world *w = one_body(0.5, &d);
        const double f = w->par.coriolis = 1e-2, u = w->par.balance_u = scene_uniform(&rng) - 0.5,
                     o = w->par.balance_v = scene_uniform(&rng) - 0.5, push = 0.5 * d.mass * f;
        bt_impulse law[BT_MAX_FORCE_LAWS], series[BT_MAX_FORCE_SERIES];
        bt_forces_impulses(w, 0, law, series);
        const bt_impulse turn = series[bt_force_series_find("coriolis")], tilt = series[bt_force_series_find("tilt")];
        CHECK_CLOSE(turn.x, -push * d.vy, 1e-15);
        CHECK_CLOSE(turn.y, push * d.vx, 1e-15);
        CHECK_CLOSE(turn.x + tilt.x, -push * (d.vy - o), 1e-15);
        CHECK_CLOSE(turn.y + tilt.y, push * (d.vx - u), 1e-15);
        bt_world_free(w);
    }
}

/// An outline with a bay has the drag of its hull, and in translation that of its width.
TEST(a_bay_is_passed_by)
{
    double bay[] = {-3, -1, 3, -1, 3, 2, 1, 2, 0, -0.5, -1, 2, -3, 2},
           hull[] = {-3, -1, 3, -1, 3, 2, 1, 2, -1, 2, -3, 2};
    bt_moments m = bt_shape_moments(7, bay);
    bt_shape_centre(7, bay);
    for (int k = 0; k < 6; k++) hull[2 * k] -= m.cx, hull[2 * k + 1] -= m.cy;
    const bt_parts parts = {.n = 2, .count = {5, 4}, .n_vertices = 9, .corner = {0, 1, 2, 3, 4, 0, 4, 5, 6}};
    for (int turn = 0; turn < 2; turn++)
        for (double heading = 0; heading < 6; heading += 0.7) {
            double f[3];
            const double vx = 0.4 * cos(heading), vy = 0.4 * sin(heading), w = turn ? 0.1 : 0;
            bt_body_def d = {.motion = BT_KINEMATIC,
                             .large = true,
                             .n_vertices = 7,
                             .vertices = bay,
                             .parts = &parts,
                             .vx = vx,
                             .vy = vy,
                             .yaw_rate = w,
                             .mass = 1,
                             .inertia = 1,
                             .drag = {.water_form = 7, .tangential = 0.4}};
            bt_world *a = one_body(1, &d);
            const bt_impulse e = drag_of(a);
            plain_sum(6, hull, 7, 0.4, -vx, -vy, w, f);
            CHECK_CLOSE(e.x, f[0], 1e-6);
            CHECK_CLOSE(e.y, f[1], 1e-6);
            CHECK_CLOSE(e.turn, f[2], 1e-6);
            if (!turn)
                CHECK_CLOSE(hypot(e.x, e.y), 7 * 0.16 * bt_shape_width(7, bay, cos(heading), sin(heading)), 1e-13);
            bt_world_free(a);
        }
}

/// One step of any length: the velocity relative to the fluid loses energy and does not turn round, drift and rotation
/// together.
TEST(drag_never_reverses)
{
    uint64_t rng = 5;
    for (int trial = 0; trial < 400; trial++) {
        double v[2 * 12];
        const int n = 3 + trial % 10;
        random_outline(&rng, n, v);
        bt_body_def d = scene_prism(n, v, 10);
        d.drag = (bt_drag){.water_form = 7, .water_skin = trial % 3, .yaw = trial % 2, .tangential = 0.5 * (trial % 3)};
        d.vx = scene_uniform(&rng) - 0.5, d.vy = scene_uniform(&rng) - 0.5, d.yaw_rate = 2 * scene_uniform(&rng) - 1;
        bt_world *w = one_body(pow(10, 8 * scene_uniform(&rng) - 3), &d);
        bt_world_step(w); // nothing to touch
        const bt_vel *a = &w->bodies.vel_start[0], *b = &w->bodies.vel[0];
        const double m = w->bodies.mass[0], i = w->bodies.inertia[0],
                     before = m * (a->x * a->x + a->y * a->y) + i * a->w * a->w;
        const double along = m * (a->x * b->x + a->y * b->y) + i * a->w * b->w,
                     after = m * (b->x * b->x + b->y * b->y) + i * b->w * b->w;
        assert_true(along >= 0 && after <= along * (1 + 1e-12) && along < before);
        bt_world_free(w);
    }
}

/// A rectangle 2a × 2b that turns in place, against closed forms: pressure has the moment ½ form ω² (a⁴ + b⁴), strip
/// theory for both pairs of sides; drag along the local flow 2 a² b² form ω² more. And the force on one that does not
/// turn is the same to the bit, whatever the share.
TEST(a_rectangle_that_turns)
{
    const double a = 40, b = 28, w = 0.005;
    double force[2][2] = {0};
    for (int share = 0; share < 2; share++)
        for (int turns = 0; turns < 2; turns++) {
            double v[] = {-a, -b, a, -b, a, b, -a, b};
            bt_body_def d = scene_prism(4, v, 10);
            d.motion = BT_KINEMATIC, d.large = true, d.drag = (bt_drag){.water_form = 7, .tangential = share};
            if (turns) d.yaw_rate = w;
            else d.vx = 0.3, d.vy = 0.1, d.yaw = 0.7;
            bt_world *world = one_body(1, &d);
            const bt_impulse e = drag_of(world);
            const double moment = 7 * w * w * (0.5 * (a * a * a * a + b * b * b * b) + share * 2 * a * a * b * b);
            if (turns) CHECK_CLOSE(e.turn, -moment, 1e-12 * moment);
            else force[share][0] = e.x, force[share][1] = e.y;
            bt_world_free(world);
        }
    assert_true(force[0][0] < 0 && force[0][0] == force[1][0] && force[0][1] == force[1][1]);
}

/// Slope and Coriolis act on the body without its added mass; in a window, on undisturbed ice alike.
TEST(added_mass_takes_no_part)
{
    enum { FLOES = 3 };
    bt_params p = scene_params(0.5, 1);
    p.coriolis = 1.4e-4, p.tilt_ax = -1e-4, p.period_x = 100, p.water_u = 0.1;
    bt_world *w = bt_world_create(&p);
    double v[8];
    for (int k = 0; k < FLOES; k++) {
        scene_square(1, v);
        bt_body_def d = scene_prism(4, v, 20);
        d.added = 0.4 * d.mass, d.x = 10 * k, d.vx = 0.3, d.vy = -0.1;
        if (k) d.drag.water_skin = 3; // none on the first
        bt_world_add(w, &d);
    }
    w->tow = bt_alloc(1, sizeof *w->tow);
    bt_undisturbed_create(w, FLOES, (const bool[2]){false, false});
    bt_window_create(w, 1, 50, FLOES);
    w->undisturbed->drag = (bt_drag){.water_skin = 3};
    w->tow->travel_x = -1e9; // the window stands
    double along = 0.3, across = -0.1; // dU/dt = 0.6 (f k×U + a), by small steps
    for (int s = 0; s < 2000; s++) {
        bt_world_step(w);
        for (int k = 0; k < 100; k++) {
            const double dt = 5e-3, x = along - 0.5 * dt * 0.6 * 1.4e-4 * across - 0.5 * dt * 0.6e-4,
                         y = across + 0.5 * dt * 0.6 * 1.4e-4 * along;
            along += dt * 0.6 * (-1.4e-4 * y - 1e-4);
            across += dt * 0.6 * 1.4e-4 * x;
        }
    }
    const bt_vel *free_of_drag = &w->bodies.vel[bt_world_index(w, 0)], *floe = &w->bodies.vel[bt_world_index(w, 1)];
    CHECK_CLOSE(free_of_drag->x, along, 1e-5);
    CHECK_CLOSE(free_of_drag->y, across, 1e-5);
    CHECK_CLOSE(w->undisturbed->vel.x, floe->x, 1e-14);
    CHECK_CLOSE(w->undisturbed->vel.y, floe->y, 1e-14);
    CHECK_CLOSE(w->undisturbed->inertia, w->bodies.inertia[bt_world_index(w, 1)], 1e-12); // all alike
    bt_world_free(w);
}

/// A square of 30 m with a bay of 22 × 14 m: 164 m around, 120 m around its hull, by which the mean floe has its form
/// drag, as floes do.
TEST(a_bay_adds_no_drag_to_undisturbed_ice)
{
    double v[] = {-15, -15, 15, -15, 15, -11, 1, -11, 1, 11, 15, 11, 15, 15, -15, 15};
    bt_parts parts;
    bt_params p = scene_params(1, 30);
    bt_world *w = bt_world_create(&p);
    bt_body_def d = scene_prism(8, v, 900);
    assert_true(bt_outline_split(8, v, &parts));
    d.parts = &parts;
    d.drag = (bt_drag){.water_skin = 3, .water_form = 0.5, .air_form = 0.01};
    bt_world_add(w, &d);
    bt_undisturbed_create(w, 1, (const bool[2]){false, false});
    CHECK_CLOSE(w->undisturbed->drag.water_skin, 3 + 0.5 * 120 / BT_PI, 1e-12);
    CHECK_CLOSE(w->undisturbed->drag.air_skin, 0.01 * 120 / BT_PI, 1e-12);
    bt_world_free(w);
}

/// Free drift of random bodies in random weather, drag over eight decades: found, and kept by the steps.
TEST(free_drift_stays)
{
    uint64_t rng = 9;
    for (int trial = 0; trial < 2000; trial++) {
        bt_params p = scene_params(pow(10, 3 * scene_uniform(&rng) - 1), 1);
        p.water_u = scene_uniform(&rng) - 0.5, p.water_v = scene_uniform(&rng) - 0.5;
        p.air_u = 40 * scene_uniform(&rng) - 20, p.air_v = 40 * scene_uniform(&rng) - 20;
        if (trial & 1) p.coriolis = 2.8e-4 * (scene_uniform(&rng) - 0.5);
        if (trial & 2) p.tilt_ax = 1e-3 * (scene_uniform(&rng) - 0.5);
        else if (trial & 4) p.balance_u = p.water_u, p.balance_v = p.water_v;
        if (trial % 5 == 0) p.air_u = p.water_u, p.air_v = p.water_v;
        double v[8];
        scene_square(1 + 50 * scene_uniform(&rng), v);
        bt_body_def d = scene_prism(4, v, pow(10, 1 + 3 * scene_uniform(&rng)));
        d.added = trial & 8 ? 0.3 * d.mass : 0;
        d.yaw = 6 * scene_uniform(&rng);
        const double size = v[2] - v[0];
        d.drag.water_skin = trial % 7 == 0 ? 0 : size * size * pow(10, 8 * scene_uniform(&rng) - 4);
        d.drag.water_form = trial % 11 == 0 ? 0 : size * pow(10, 8 * scene_uniform(&rng) - 4);
        d.drag.air_skin = d.drag.water_skin * 1e-3, d.drag.air_form = d.drag.water_form * 1e-3;
        bt_world *w = bt_world_create(&p);
        bt_world_add(w, &d);
        double u[2];
        const bool hold[2] = {false, false};
        assert_true(bt_drift_velocity(w, 0, hold, u));
        w->bodies.vel[0] = (bt_vel){.x = u[0], .y = u[1]};
        if (d.drag.water_skin > 0 || d.drag.water_form > 0) {
            for (int s = 0; s < 3; s++) bt_world_step(w);
            const double scale = hypot(u[0], u[1]) + hypot(p.water_u, p.water_v);
            CHECK_CLOSE(w->bodies.vel[0].x, u[0], 1e-9 * scale);
            CHECK_CLOSE(w->bodies.vel[0].y, u[1], 1e-9 * scale);
        } else assert_true(u[0] == 0 && u[1] == 0);
        const bool calm = trial % 5 == 0 && !(trial & 2) && (!(trial & 1) || (trial & 4)) &&
                          (d.drag.water_skin > 0 || d.drag.water_form > 0);
        if (calm) assert_true(u[0] == p.water_u && u[1] == p.water_v);
        const bool wall[2] = {true, false};
        assert_true(bt_drift_velocity(w, 0, wall, u) && u[0] == 0);
        bt_world_free(w);
    }
}

/// A floe at rest goes as soon as one thing pushes it, in whatever direction: on a slope a t exactly, in a wind to its
/// lee.
TEST(what_is_pushed_does_not_rest)
{
    for (int k = 0; k < 6; k++) {
        bt_params p = scene_params(0.5, 1);
        double *const push[] = {&p.air_u, &p.air_v, &p.water_u, &p.water_v, &p.tilt_ax, &p.tilt_ay};
        *push[k] = -1e-2;
        if (k == 2) p.air_u = p.water_u; // all goes with the water: that is rest
        if (k == 3) p.air_v = p.water_v;
        double v[8];
        scene_square(1, v);
        bt_body_def d = scene_prism(4, v, 20);
        if (k < 4) d.drag = (bt_drag){.water_skin = 3, .air_skin = 0.01};
        bt_world *w = one_body(p.dt, &d);
        w->par = p;
        assert_int_equal(bt_forces_rest(w), k == 2 || k == 3);
        for (int s = 0; s < 8; s++) bt_world_step(w);
        const double along = k & 1 ? w->bodies.vel[0].y : w->bodies.vel[0].x;
        if (k < 4) assert_true(along < -1e-9 && along > -1e-2);
        else CHECK_CLOSE(along, -1e-2 * 8 * p.dt, 1e-16);
        bt_world_free(w);
    }
}

TEST_MAIN(NULL, NULL)
