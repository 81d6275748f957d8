// SPDX-License-Identifier: MIT
// Resistance in a moving window: a closed form over several laps, the momentum of what is dropped and enters, and the
// same force to rounding as in one long domain that holds the same field over and over.
#include "scene.h"

#include "output/observe.h"
#include "step/window.h"

static const double sheet = 36.4; // ρ_i h, kg/m²

static void add_floe(bt_world *w, double r, double x, double y, double yaw, double spin, double drag)
{
    double v[2 * 24];
    bt_shape_regular(24, BT_PI * r * r, v);
    bt_body_def d = scene_prism(24, v, sheet);
    d.x = x, d.y = y, d.yaw = yaw;
    d.inertia *= spin;
    d.drag.water_skin = drag * BT_PI * r * r;
    bt_world_add(w, &d);
}

static void add_body(bt_world *w, int n, double *v, double x, double speed)
{
    bt_shape_centre(n, v);
    bt_body_def d = {
        .motion = BT_KINEMATIC, .large = true, .n_vertices = n, .vertices = v, .x = x, .vx = speed, .mass = 1e4};
    w->towed = bt_world_add(w, &d);
    w->tow = bt_alloc(1, sizeof *w->tow);
    *w->tow = (bt_tow){.mode = BT_TOW_SPEED, .ux = 1, .speed = speed, .dt = w->par.dt, .travel_x = x};
}

/// A wedge of half-angle α and beam B meets discs of radius r at |y| >= y0 (0 elsewhere), dilute, at rest, inelastic,
/// without friction, spin or
/// drag: the normal of a hit is that of the wedge widened by r (its Minkowski sum with the disc), so with c = cos α
///     flanks and shoulders give
///     F = A ρ_i h V² 2 [(B/2 + r c − y0) sin²α + r (2/3 − c + c³/3)].
/// A wedge, and nothing before its tip: what is hit head on stays ahead for ever where there is no drag.
TEST(wedge_in_dilute_ice)
{
    const double beam = 10, r = 0.4, speed = 0.5, a = 0.003, alpha = 30 * BT_PI / 180, c = cos(alpha);
    const double y0 = 1, half = 0.5 * beam + r + 1.5; // ice at y0 <= |y| <= half
    const int n = 200;
    const double length = n * BT_PI * r * r / (a * 2 * (half - y0)), nose = 0.5 * beam / tan(alpha);
    bt_params p = scene_params(0.5, 1);
    p.period_x = length;
    p.tolerance = 1e-7;
    bt_world *w = bt_world_create(&p);
    uint64_t rng = 9;
    double v[6] = {nose, 0, 0, 0.5 * beam, 0, -0.5 * beam};
    const double ahead = 0.6 * length, body = length - ahead;
    for (int k = 0; k < n; k++) { // strata along x, a low-discrepancy sequence across
        const double x = length * (k + 0.5) / n, u = 2 * fmod(0.618033988749895 * k, 1) - 1;
        const double y = u * (half - y0) + (u < 0 ? -y0 : y0);
        if (fabs(x - body) > nose) add_floe(w, r, x, y, 7 * scene_uniform(&rng), 1e6, 0);
    }
    const bt_gid floes = w->bodies.n_global;
    add_body(w, 3, v, body, speed);
    bt_undisturbed_create(w, floes, (const bool[2]){false, false});
    bt_window_create(w, 1, ahead, floes);
    double impulse[2] = {0, 0}, before = 0, way = 0;
    while (bt_window_laps(w->window) < 4.3) {
        bt_sample s;
        bt_world_step(w);
        bt_observe(w, speed, &s);
        assert_true(w->stats.converged);
        impulse[0] -= s.ice_force_x * p.dt;
        impulse[1] -= s.ice_force_y * p.dt;
        if (bt_window_laps(w->window) < 0.3) before = impulse[0], way = w->tow->travel_x;
    }
    way = w->tow->travel_x - way;
    // The floes that stand: without those taken out for the body.
    const double density = floes * BT_PI * r * r / (length * 2 * (half - y0));
    const double want = density * sheet * speed * 2 *
                        ((0.5 * beam + r * c - y0) * sin(alpha) * sin(alpha) + r * (2.0 / 3 - c + c * c * c / 3));
    print_message("force %.4f want %.4f; renewed %d kept %d missed %d\n", (impulse[0] - before) / way * speed,
                  want * speed, (int)w->window->renewed, (int)w->window->kept, (int)w->window->missed);
    CHECK_CLOSE((impulse[0] - before) / way, want, 0.02 * want);
    assert_true(w->window->renewed > 4 * (int64_t)floes && w->window->missed + w->window->kept == 0);
    // Momentum: what the body gave is in the floes, or was dropped with them; they came in at rest.
    double now[3] = {0, 0, 0};
    for (bt_gid g = 0; g < floes; g++) {
        const bt_idx i = bt_world_index(w, g);
        const bt_vel u = w->bodies.vel[i];
        now[0] += w->bodies.mass[i] * u.x;
        now[1] += w->bodies.mass[i] * u.y;
    }
    for (int k = 0; k < 2; k++) {
        assert_true(w->window->brought[k] == 0);
        CHECK_CLOSE(now[k] + w->window->dropped[k], impulse[k], 1e-9 * impulse[0]);
    }
    assert_true(w->window->dropped[0] > 0.3 * impulse[0] && w->window->dropped[2] > 0);
    bt_world_free(w);
}

/// A wedge in loose ice with drag: in a window of one field, and through that field six times over. A slender bow,
/// strong drag and no friction keep rounding from growing as it does in dense ice, where single hits soon differ and
/// only means can be compared (tests/long).
TEST(as_in_one_long_domain)
{
    const double r = 0.5, speed = 0.4, length = 60, width = 12, ahead = 30, big = 1.5, laps = 2.5;
    enum { MOST = 400, COPIES = 6 };
    double xy[MOST][2], yaw[MOST];
    uint64_t rng = 3;
    int n = 0;
    while (n < (int)(0.12 * length * width / (BT_PI * r * r))) { // random sequential addition, around the period
        const double x = length * scene_uniform(&rng), y = (width - 2 * r) * (scene_uniform(&rng) - 0.5);
        bool clear = hypot(x - (length - ahead), y) > 2.5 * big;
        for (int j = 0; clear && j < n; j++)
            clear = hypot(bt_nearest_image(x - xy[j][0], length), y - xy[j][1]) > 2.05 * r;
        if (!clear) continue;
        xy[n][0] = x, xy[n][1] = y, yaw[n++] = 7 * scene_uniform(&rng);
    }
    bt_world *w[2];
    for (int k = 0; k < 2; k++) { // 0: window, 1: long
        bt_params p = scene_params(0.2, 1);
        p.tolerance = 1e-10;
        p.period_x = k ? 0 : length;
        w[k] = bt_world_create(&p);
        for (int copy = k ? -1 : 0; copy < (k ? COPIES - 1 : 1); copy++)
            for (int j = 0; j < n; j++) add_floe(w[k], r, xy[j][0] + copy * length, xy[j][1], yaw[j], 1, 60);
        const bt_gid floes = w[k]->bodies.n_global;
        double v[6] = {2.5 * big, 0, 0, big, 0, -big};
        add_body(w[k], 3, v, length - ahead, speed);
        if (k == 0) {
            bt_undisturbed_create(w[k], floes, (const bool[2]){false, false});
            bt_window_create(w[k], 1, ahead, floes);
        }
    }
    double impulse[2] = {0, 0}, worst = 0, largest = 0;
    while (bt_window_laps(w[0]->window) < laps) {
        bt_sample s[2];
        for (int k = 0; k < 2; k++) {
            bt_world_step(w[k]);
            bt_observe(w[k], speed, &s[k]);
            impulse[k] += s[k].ice_resistance * w[k]->par.dt;
        }
        worst = bt_max(worst, fabs(impulse[0] - impulse[1]));
        largest = bt_max(largest, s[1].ice_resistance);
    }
    print_message(
        "mean force %.6f, in the long domain %.6f N (largest %.3g), worst difference of the impulse %.3g of %.3g N s\n",
        impulse[0] / w[0]->tow->time, impulse[1] / w[1]->tow->time, largest, worst, impulse[1]);
    assert_true(w[0]->window->renewed > 2 * n && w[0]->window->kept + w[0]->window->missed == 0);
    assert_true(impulse[1] > 0);
    assert_true(worst <= 1e-7 * impulse[1]);
    bt_world_free(w[0]);
    bt_world_free(w[1]);
}

TEST_MAIN(NULL, NULL)
