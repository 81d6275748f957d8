// SPDX-License-Identifier: MIT
// Motion of free and towed bodies with closed forms: drag, inertial circle, tilt, elastic line.
#include "scene.h"

static bt_idx add_disc(bt_world *w, double area, double sheet, bt_drag drag, double vx, double vy, double yaw_rate)
{
    double v[2 * 24];
    bt_shape_regular(24, area, v);
    bt_body_def d = scene_prism(24, v, sheet);
    d.drag = drag, d.vx = vx, d.vy = vy, d.yaw_rate = yaw_rate;
    return bt_world_add(w, &d);
}

/// M du/dt = −k u|u| in still water: u = u0 / (1 + k u0 t / M); yaw alike with I and its own coefficient.
TEST(quadratic_drag_decay)
{
    bt_params p = scene_params(0.1, 1);
    bt_world *w = bt_world_create(&p);
    const bt_drag drag = {.water_skin = 3, .yaw = 0.7};
    add_disc(w, 2, 20, drag, 0.6, -0.8, 0.5);
    const double m = w->bodies.mass[bt_world_index(w, 0)], inertia = w->bodies.inertia[bt_world_index(w, 0)];
    for (int s = 0; s < 1000; s++) bt_world_step(w);
    const double u = 1 / (1 + 3 * 1 * 100 / m), om = 0.5 / (1 + 0.7 * 0.5 * 100 / inertia);
    CHECK_CLOSE(w->bodies.vel[bt_world_index(w, 0)].x, 0.6 * u, 1e-12);
    CHECK_CLOSE(w->bodies.vel[bt_world_index(w, 0)].y, -0.8 * u, 1e-12);
    CHECK_CLOSE(w->bodies.vel[bt_world_index(w, 0)].w, om, 1e-12);
    bt_world_free(w);
}

/// Wind U_a over still water: k_w u² = k_a (U_a − u)², so u = U_a / (1 + √(k_w/k_a)), skin and form, any Δt.
TEST(terminal_velocity)
{
    const double steps[] = {0.1, 5, 500};
    for (int i = 0; i < 3; i++) {
        bt_params p = scene_params(steps[i], 1);
        p.air_u = 12;
        p.air_v = 5;
        bt_world *w = bt_world_create(&p);
        const bt_drag drag = {.water_skin = 4, .water_form = 10, .air_skin = 0.02, .air_form = 0.1};
        add_disc(w, 2, 20, drag, 0, 0, 0);
        double furthest = 0;
        for (int s = 0; s < 20000; s++) {
            bt_world_step(w);
            furthest =
                bt_max(furthest, hypot(w->bodies.vel[bt_world_index(w, 0)].x, w->bodies.vel[bt_world_index(w, 0)].y));
        }
        const double width = bt_shape_width(24, w->bodies.vertices, 12.0 / 13, 5.0 / 13);
        const double kw = 4 + 10 * width, ka = 0.02 + 0.1 * width, u = 13 / (1 + sqrt(kw / ka));
        CHECK_CLOSE(w->bodies.vel[bt_world_index(w, 0)].x, u * 12 / 13, 1e-9);
        CHECK_CLOSE(w->bodies.vel[bt_world_index(w, 0)].y, u * 5 / 13, 1e-9);
        // Drag never reverses a relative velocity; while it is resolved it does not overshoot the balance either.
        assert_true(furthest <= (steps[i] < 1 ? u * (1 + 1e-9) : 13));
        bt_world_free(w);
    }
}

/// A free body under Coriolis runs a circle of radius U/f in 2π/f: to the right in the north, left in the south.
TEST(inertial_circle)
{
    const double f = 1.4e-4, u = 0.3, dt = 5;
    for (int sense = 1; sense >= -1; sense -= 2) {
        bt_params p = scene_params(dt, 30);
        p.coriolis = sense * f;
        bt_world *w = bt_world_create(&p);
        add_disc(w, 700, 900, (bt_drag){0}, u, 0, 0);
        double x_min = 0, x_max = 0, y_far = 0;
        const int n = (int)(2 * BT_PI / f / dt);
        for (int s = 0; s < n; s++) {
            bt_world_step(w);
            if (s == n / 8) assert_true(sense * w->bodies.vel[bt_world_index(w, 0)].y > 0);
            x_min = bt_min(x_min, w->bodies.pose[bt_world_index(w, 0)].x);
            x_max = bt_max(x_max, w->bodies.pose[bt_world_index(w, 0)].x);
            if (fabs(w->bodies.pose[bt_world_index(w, 0)].y) > fabs(y_far))
                y_far = w->bodies.pose[bt_world_index(w, 0)].y;
        }
        CHECK_CLOSE(hypot(w->bodies.vel[bt_world_index(w, 0)].x, w->bodies.vel[bt_world_index(w, 0)].y), u, 1e-13);
        CHECK_CLOSE(0.5 * (x_max - x_min), u / f, 2e-3 * u / f);
        CHECK_CLOSE(y_far, sense * 2 * u / f, 2e-3 * u / f);
        CHECK_CLOSE(hypot(w->bodies.pose[bt_world_index(w, 0)].x, w->bodies.pose[bt_world_index(w, 0)].y), 0,
                    0.01 * u / f);
        bt_world_free(w);
    }
}

/// Sea-surface tilt: −g ∇η accelerates; with the current in geostrophic balance a body at the current's speed keeps it.
TEST(tilt_and_geostrophic_balance)
{
    bt_params p = scene_params(1, 30);
    p.tilt_ax = -9.81e-5;
    bt_world *w = bt_world_create(&p);
    add_disc(w, 700, 900, (bt_drag){0}, 0, 0, 0);
    for (int s = 0; s < 100; s++) bt_world_step(w);
    CHECK_CLOSE(w->bodies.vel[bt_world_index(w, 0)].x, -9.81e-3, 1e-12);
    bt_world_free(w);

    p = scene_params(5, 30);
    p.coriolis = 1.4e-4;
    p.balance_u = p.water_u = 0.2;
    p.balance_v = p.water_v = -0.1;
    w = bt_world_create(&p);
    add_disc(w, 700, 900, (bt_drag){.water_skin = 4000}, 0.2, -0.1, 0);
    for (int s = 0; s < 1000; s++) bt_world_step(w);
    CHECK_CLOSE(w->bodies.vel[bt_world_index(w, 0)].x, 0.2, 1e-12);
    CHECK_CLOSE(w->bodies.vel[bt_world_index(w, 0)].y, -0.1, 1e-12);
    bt_world_free(w);
}

static bt_world *line_world(double dt, double k, double c, double speed, bt_drag drag)
{
    bt_params p = scene_params(dt, 1);
    bt_world *w = bt_world_create(&p);
    double v[2 * 24];
    bt_shape_regular(24, 2, v);
    bt_body_def d = scene_prism(24, v, 50);
    d.large = true;
    d.drag = drag;
    w->towed = bt_world_add(w, &d);
    w->tow = bt_alloc(1, sizeof *w->tow);
    *w->tow = (bt_tow){.mode = BT_TOW_LINE,
                       .ux = 1,
                       .speed = speed,
                       .branch[0] = {.length0 = 10, .k = k, .c = c},
                       .n_branches = 1,
                       .dt = dt,
                       .carriage_x = 10};
    return w;
}

/// Carriage at constant speed V, no drag, taut from the start: u = V (1 − cos ωt), so the line goes slack first
/// at ωt = π. Tension k V/ω sin ωt.
TEST(spring_towed_mass)
{
    const double k = 4, v = 0.13, dt = 0.02;
    bt_world *w = line_world(dt, k, 0, v, (bt_drag){0});
    const double m = w->bodies.mass[bt_world_index(w, 0)], om = sqrt(k / m), peak = k * v / om;
    double worst_u = 0, worst_t = 0;
    const int n = (int)(BT_PI / om / dt);
    for (int s = 1; s <= n; s++) {
        bt_world_step(w);
        const double t = s * dt;
        worst_u = bt_max(worst_u, fabs(w->bodies.vel[bt_world_index(w, 0)].x - v * (1 - cos(om * t))));
        // The tension of a step is its mean, at t − Δt/2 to second order; with θ = 0 it is taken at the step's start.
        worst_t = bt_max(worst_t, fabs(bt_tow_tension(w->tow, 0) - peak * sin(om * (t - 0.5 * dt))));
    }
    assert_true(w->stats.converged);
    CHECK_CLOSE(worst_u, 0, 0.003 * 2 * v);
    CHECK_CLOSE(worst_t, 0, 0.003 * peak);
    // Slack: it coasts at 2V, faster than the carriage, without any force.
    for (int s = 0; s < 100; s++) bt_world_step(w);
    CHECK_CLOSE(w->bodies.vel[bt_world_index(w, 0)].x, 2 * v, 0.003 * 2 * v);
    CHECK_CLOSE(bt_tow_tension(w->tow, 0), 0, 0);
    bt_world_free(w);
}

/// With drag the tow becomes steady: T = k_d V². Damped line, any stiffness: stable at Δt 0.1 s for EA over ten
/// decades.
TEST(line_is_stable_and_carries_the_drag)
{
    for (double k = 1e-1; k < 1e10; k *= 10) {
        const double v = 0.13, kd = 80;
        bt_world *w = line_world(0.1, k, 0.5 * sqrt(k * 100), v, (bt_drag){.water_skin = kd});
        double largest = 0;
        for (int s = 0; s < 20000; s++) {
            bt_world_step(w);
            assert_true(w->stats.converged);
            largest = bt_max(largest, fabs(w->bodies.vel[bt_world_index(w, 0)].x));
        }
        CHECK_CLOSE(bt_tow_tension(w->tow, 0), kd * v * v, 1e-4 * kd * v * v);
        CHECK_CLOSE(w->bodies.vel[bt_world_index(w, 0)].x, v, 1e-4 * v);
        assert_true(largest <= 2.05 * v);
        bt_world_free(w);
    }
}

/// A line made fast off the axis turns the body until the fastening point leads.
TEST(line_turns_the_body)
{
    bt_world *w = line_world(0.1, 50, 20, 0.13, (bt_drag){.water_skin = 80, .yaw = 20});
    w->tow->branch[0].hull_x = 0;
    w->tow->branch[0].hull_y = 0.6;
    for (int s = 0; s < 20000; s++) bt_world_step(w);
    CHECK_CLOSE(remainder(w->bodies.pose[bt_world_index(w, 0)].yaw + 0.5 * BT_PI, 2 * BT_PI), 0, 0.02);
    bt_world_free(w);
}

TEST_MAIN(NULL, NULL)
