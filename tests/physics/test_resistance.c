// SPDX-License-Identifier: MIT
// Resistance of broken ice in its two closed-form limits: dilute floes on a disc, and a plough that fills a channel.
#include "scene.h"

#include "output/observe.h"

static const double sheet = 36.4; // ρ_i h, kg/m²

static bt_idx add_body(bt_world *w, int n, double *v, double x, double speed)
{
    bt_body_def d = {
        .motion = BT_KINEMATIC, .large = true, .n_vertices = n, .vertices = v, .x = x, .vx = speed, .mass = 1e4};
    w->towed = bt_world_add(w, &d);
    w->tow = bt_alloc(1, sizeof *w->tow);
    *w->tow = (bt_tow){.mode = BT_TOW_SPEED, .ux = 1, .speed = speed, .dt = w->par.dt, .travel_x = x};
    return w->towed;
}

static void add_floe(bt_world *w, double r, double x, double y, double yaw, double e)
{
    double v[2 * 24];
    bt_shape_regular(24, BT_PI * r * r, v);
    bt_body_def d = scene_prism(24, v, sheet);
    d.x = x, d.y = y, d.yaw = yaw, d.restitution = e;
    bt_world_add(w, &d);
}

/// Disc of radius R at speed V, floes of radius r at rest, each met alone: one hit gives m(1+e)V cosθ along the normal,
/// (R+r) sinθ = y, so over all y  F = (4/3)(1+e) A ρ_i h (R+r) V². Here A ρ_i h V · 1 s of lane per stratum of y.
TEST(dilute_floes_one_by_one)
{
    const double big = 5, r = 0.5, v = 0.13, es[] = {0, 0.5, 1};
    for (int i = 0; i < 3; i++) {
        const int strata = 500;
        uint64_t rng = 5;
        double impulse = 0;
        for (int k = 0; k < strata; k++) {
            bt_params p = scene_params(0.1, 1);
            bt_world *w = bt_world_create(&p);
            const double y = (big + r) * (2 * (k + 0.5) / strata - 1);
            add_floe(w, r, 0, y, 7 * scene_uniform(&rng), es[i]);
            double o[2 * BT_MAX_VERTICES];
            int n = bt_shape_named("disc", 2 * big, 2 * big, o);
            add_body(w, n, o, -sqrt((big + r) * (big + r) - y * y) - 0.1, v);
            w->bodies.restitution[bt_world_index(w, w->towed)] = es[i];
            for (int s = 0; s < 60; s++) {
                bt_sample sample;
                bt_world_step(w);
                bt_observe(w, v, &sample);
                impulse += sample.ice_resistance * p.dt;
            }
            bt_world_free(w);
        }
        // One floe per stratum of width 2(R+r)/strata: mean impulse × flux of floes A V 2(R+r)/(π r²) is the force.
        const double mass = sheet * BT_PI * r * r, mean = impulse / strata;
        CHECK_CLOSE(mean, (2.0 / 3) * (1 + es[i]) * mass * v, 0.02 * (2.0 / 3) * (1 + es[i]) * mass * v);
    }
}

/// The same limit in one field: random floes at 1 % in a lane, inelastic. The concentration is that of the lane.
TEST(dilute_field)
{
    const double big = 5, r = 0.5, v = 0.5, a = 0.01;
    const int n = 233; // a Fibonacci number: with the golden ratio below, the evenest sequence of that length
    const double lane = 2 * (big + r + 2), length = n * BT_PI * r * r / (a * lane);
    bt_params p = scene_params(0.1, 1);
    p.tolerance = 1e-7;
    bt_world *w = bt_world_create(&p);
    uint64_t rng = 9;
    for (int k = 0; k < n; k++) // strata along x, a low-discrepancy sequence across: little scatter, no two overlap
        add_floe(w, r, 10 + length * (k + 0.5) / n, lane * (fmod(0.618033988749895 * k, 1) - 0.5),
                 7 * scene_uniform(&rng), 0);
    double o[2 * BT_MAX_VERTICES];
    int m = bt_shape_named("disc", 2 * big, 2 * big, o);
    add_body(w, m, o, 0, v);
    double impulse = 0, budget = 0, worst = 0;
    const int64_t steps = (int64_t)(length / (v * p.dt));
    for (int64_t s = 0; s < steps; s++) {
        bt_sample sample;
        bt_world_step(w);
        bt_observe(w, v, &sample);
        impulse += sample.ice_resistance;
        budget += sample.ice_resistance_budget;
        worst = bt_max(worst, w->stats.momentum_residual);
        assert_true(w->stats.converged);
    }
    const double want = (4.0 / 3) * a * sheet * (big + r) * v * v;
    CHECK_CLOSE(impulse / (double)steps, want, 0.02 * want);
    CHECK_CLOSE(budget / impulse, 1, 1e-9);
    assert_true(worst <= 1e-10);
    bt_world_free(w);
}

/// A piston sweeps frictionless inelastic floes of concentration A together to φ: front V φ/(φ−A), force
/// ρ_i h W V² A φ/(φ−A). φ is measured behind the front.
TEST(plough_in_a_channel)
{
    const double width = 6, length = 200, r = 0.5, v = 0.5, area = BT_PI * r * r;
    const double targets[] = {0.2, 0.35};
    for (int i = 0; i < 2; i++) {
        bt_params p = scene_params(0.1, 1);
        p.tolerance = 1e-3 * v;
        p.slop = 1e-3;
        bt_world *w = bt_world_create(&p);
        uint64_t rng = 17;
        const int n = (int)(targets[i] * width * length / area);
        double *xy = bt_alloc(2 * (size_t)n, sizeof *xy);
        for (int k = 0; k < n;) { // random sequential addition
            double x = r + (length - 2 * r) * scene_uniform(&rng), y = (width - 2.01 * r) * (scene_uniform(&rng) - 0.5);
            bool clear = true;
            for (int j = 0; clear && j < k; j++) clear = hypot(x - xy[2 * j], y - xy[2 * j + 1]) > 2.02 * r;
            if (!clear) continue;
            xy[2 * k] = x, xy[2 * k + 1] = y, k++;
            add_floe(w, r, x, y, 7 * scene_uniform(&rng), 0);
        }
        free(xy);
        double piston[8] = {-1, -0.4995 * width, 1, -0.4995 * width, 1, 0.4995 * width, -1, 0.4995 * width};
        add_body(w, 4, piston, -1.02, v);
        scene_wall(w, -50, 0.5 * width, length + 50, width, 0);
        scene_wall(w, -50, -width, length + 50, -0.5 * width, 0);
        const double a = n * area / (width * length);

        // Momentum and front between two times at which the front is well developed.
        double impulse = 0, t0 = 0, t1 = 0, front0 = 0, front1 = 0;
        for (int64_t s = 0;; s++) {
            bt_sample sample;
            bt_world_step(w);
            bt_observe(w, v, &sample);
            // A row solved to the residual ρ can do at most λ ρ of positive work.
            double exchanged = 0;
            for (bt_idx k = 0; k < w->cells->n; k++)
                for (bt_idx j = 0; j < w->cells->cell[k].n_contacts; j++)
                    exchanged += w->cells->cell[k].contacts[j].ln[0] + w->cells->cell[k].contacts[j].ln[1];
            assert_true(w->stats.contact_work <= 2 * exchanged * p.tolerance);
            if (s % 50 && front0 > 0) {
                impulse += sample.ice_resistance * p.dt;
                continue;
            }
            // Front: where the ice that moves on average ends, by the momentum of the swept floes: all floes up
            // to it have been swept, so their number gives it without a threshold on single floes.
            double momentum = 0;
            for (int k = 0; k < n; k++)
                momentum += w->bodies.mass[bt_world_index(w, k)] * w->bodies.vel[bt_world_index(w, k)].x;
            const double front = momentum / (sheet * a * width * v);
            if (front0 == 0 && front > 0.3 * length) front0 = front, t0 = sample.time, impulse = 0;
            else if (front0 > 0) impulse += sample.ice_resistance * p.dt;
            front1 = front, t1 = sample.time;
            if (front > 0.85 * length) break;
        }
        // φ from areas: every floe whose centre lies between piston and front, away from the loose layer at the front.
        const double low = w->bodies.pose[bt_world_index(w, w->towed)].x + 1, high = front1 - 5;
        double inside = 0;
        for (int k = 0; k < n; k++)
            inside += w->bodies.pose[bt_world_index(w, k)].x > low && w->bodies.pose[bt_world_index(w, k)].x < high
                          ? area
                          : 0;
        const double phi = inside / (width * (high - low));
        const double speed = v * phi / (phi - a), force = sheet * width * v * v * a * phi / (phi - a);
        print_message("A %.3f phi %.4f front %.4f want %.4f force %.4f want %.4f\n", a, phi,
                      (front1 - front0) / (t1 - t0), speed, impulse / (t1 - t0), force);
        assert_true(phi > 0.7 && phi < 0.9);
        CHECK_CLOSE((front1 - front0) / (t1 - t0), speed, 0.05 * speed);
        CHECK_CLOSE(impulse / (t1 - t0), force, 0.05 * force);
        bt_world_free(w);
    }
}

TEST_MAIN(NULL, NULL)
