// SPDX-License-Identifier: MIT
// The moving window floe by floe: what comes back, when, where, what waits for what, and what is counted.
#include "scene.h"


#include "bergtow/outline.h"
#include "space/cells.h"
#include "step/window.h"

enum { LENGTH = 40, AHEAD = 16 }; // zone 8 m, stride 2 m, rear at first body − 24 m
static const double speed = 0.5;

static void add_floe(bt_world *w, double x, double y, double yaw)
{
    double v[2 * 6];
    bt_shape_regular(6, 1, v);
    bt_body_def d = scene_prism(6, v, 36.4);
    d.x = x, d.y = y, d.yaw = yaw, d.vx = w->par.water_u, d.vy = w->par.water_v;
    d.drag = (bt_drag){.water_skin = 5, .air_skin = 0.002};
    bt_world_add(w, &d);
}

/// Body at x = 24 (or 16 for a tow towards −x) far aside from the floes, so that the window begins as [0, 40).
static void add_body_and_window(bt_world *w, double sign, double body_speed)
{
    double v[8];
    scene_square(1, v);
    const double x = sign > 0 ? LENGTH - AHEAD : AHEAD;
    bt_body_def d = {.motion = BT_KINEMATIC,
                     .large = true,
                     .n_vertices = 4,
                     .vertices = v,
                     .x = x,
                     .y = 30,
                     .vx = sign * body_speed,
                     .mass = 1e3};
    const bt_gid n_floes = w->bodies.n_global;
    w->towed = bt_world_add(w, &d);
    w->tow = bt_alloc(1, sizeof *w->tow);
    *w->tow = (bt_tow){.mode = BT_TOW_SPEED, .ux = sign, .speed = body_speed, .dt = w->par.dt, .travel_x = x};
    bt_undisturbed_create(w, n_floes, (const bool[2]){false, false});
    bt_window_create(w, sign, AHEAD, n_floes);
}

static bt_world *empty(double dt)
{
    bt_params p = scene_params(dt, 1);
    p.period_x = LENGTH;
    return bt_world_create(&p);
}

static bt_pose pose(const bt_world *w, bt_gid g) { return w->bodies.pose[bt_world_index(w, g)]; }
static double unwrapped(const bt_world *w, bt_gid g)
{
    return pose(w, g).x + LENGTH * w->bodies.lap[bt_world_index(w, g)];
}

static void move(bt_world *w, bt_gid g, double dx, double dy, double yaw)
{
    const bt_idx i = bt_world_index(w, g);
    bt_pose *p = &w->bodies.pose[i];
    p->x += dx, p->y += dy, p->yaw += yaw;
    if (p->x < 0) p->x += LENGTH, w->bodies.lap[i]--;
    if (p->x >= LENGTH) p->x -= LENGTH, w->bodies.lap[i]++;
    bt_bodies_turn(&w->bodies, i);
    w->bodies.disturbed[i] = 1;
    w->cells->labelled = false;
}

static bool at(const bt_world *w, bt_gid g, double x, double y) { return pose(w, g).x == x && pose(w, g).y == y; }

static void run_until_rear(bt_world *w, double rear)
{
    while (w->window->rear < rear) bt_world_step(w);
}

/// Twelve floes in three rows; disturbed once, they are back to the bit after a lap, each renewed once a lap, either
/// way along x.
TEST(come_back_as_they_were)
{
    for (double sign = -1; sign <= 1; sign += 2) {
        bt_world *w = empty(0.1);
        enum { N = 12 };
        double x[N], y[N];
        for (int k = 0; k < N; k++) {
            x[k] = 1 + 39.0 / N * k, y[k] = 3 * (k % 3) - 3 + 0.1 * k;
            add_floe(w, x[k], y[k], 0.2 * k);
        }
        add_body_and_window(w, sign, speed);
        const double start = w->window->rear;
        assert_true(fabs(bt_window_low(w->window, w->undisturbed)) < 1e-9);
        for (int k = 0; k < N; k++) {
            move(w, k, 0.3 * (k % 2 ? 1 : -1), 0.2, 0.5);
            w->bodies.vel[bt_world_index(w, k)] = (bt_vel){.x = 0.01 * sign, .y = 0.005, .w = 0.02};
        }
        int64_t seen = 0;
        while (bt_window_laps(w->window) < 2.5) {
            bt_world_step(w);
            seen += w->window->renewed_now;
            for (int k = 0; k < N; k++) { // all within the window: nothing is lost, nothing ahead of it
                const double s = sign * unwrapped(w, k) - w->window->rear;
                assert_true(s > -3.5 && s < LENGTH + 0.5);
            }
        }
        assert_int_equal(w->window->kept + w->window->missed, 0);
        assert_int_equal(seen, w->window->renewed);
        // The rear has gone 100 m on, in strides of 2: as many homes as it has passed.
        int64_t homes = 0;
        for (int k = 0; k < N; k++)
            homes += (int64_t)floor((w->window->rear - sign * x[k]) / LENGTH) -
                     (int64_t)floor((start - sign * x[k]) / LENGTH);
        assert_true(llabs(homes - w->window->renewed) <= 1); // one may lie just where the rear is
        for (int k = 0; k < N; k++) {
            assert_true(at(w, k, x[k], y[k]) && pose(w, k).yaw == 0.2 * k);
            const bt_vel v = w->bodies.vel[bt_world_index(w, k)];
            assert_true(v.x == 0 && v.y == 0 && v.w == 0);
        }
        bt_world_free(w);
    }
}

/// Floe 1 lies on the place of floe 0 and leaves it when its own home at `other` is passed; floe 0 waits until then, or
/// beyond the front zone goes round as it is while its place stays empty.
TEST(wait_for_a_place)
{
    for (int late = 0; late < 2; late++) {
        bt_world *w = empty(0.1);
        const double other = late ? 20 : 10;
        add_floe(w, 5, 0, 0);
        add_floe(w, other, 0, 0);
        add_body_and_window(w, 1, speed);
        bt_world_step(w);
        move(w, 1, 5.2 - other, 0.1, 0); // to the place of floe 0
        move(w, 0, -0.5, 3, 0);
        run_until_rear(w, 6);
        assert_true(at(w, 0, 4.5, 3)); // behind, due, and not renewed
        run_until_rear(w, 9);
        assert_true(at(w, 0, 4.5, 3));
        assert_int_equal(w->window->renewed, 0);
        assert_int_equal(w->window->waiting, 2);
        run_until_rear(w, other + 2);
        assert_true(at(w, 1, other, 0) != late); // late: it went round, and is renewed in the next lap
        if (!late) {
            assert_true(at(w, 0, 5, 0)); // at once with the one that held the place
            assert_int_equal(w->window->renewed, 2);
            assert_int_equal(w->window->waiting + w->window->kept + w->window->missed, 0);
        } else {
            assert_true(at(w, 0, 4.5, 3));
            assert_int_equal(w->window->kept, 2);
            assert_int_equal(w->window->missed, 1);
            assert_int_equal(w->window->renewed, 0);
            move(w, 1, 20 - 5.2, 0, 0); // the place is free: in the next lap both are renewed
            run_until_rear(w, 60 + 2);
            assert_int_equal(w->window->renewed, 2);
            assert_true(at(w, 0, 5, 0) && at(w, 1, 20, 0));
        }
        assert_true(bt_world_overlaps(w, 0).deepest <= 1e-6);
        bt_world_free(w);
    }
}

/// Three floes in a ring, each on the place of the next, homes passed in one stride: they go at once. With a fourth on
/// the place of one of them, whose home is not passed, all three wait.
TEST(rings_go_at_once)
{
    for (int blocked = 0; blocked < 2; blocked++) {
        bt_world *w = empty(0.1);
        const double x[3] = {4.2, 5.9, 5.0}, y[3] = {0, 0, 2};
        for (int k = 0; k < 3; k++) add_floe(w, x[k], y[k], 0);
        add_floe(w, 11, 0, 0);
        add_body_and_window(w, 1, speed);
        bt_world_step(w);
        // The last of the three lies a little aside from the place it holds, so that the fourth can touch that place,
        // too.
        for (int k = 0; k < 3; k++) move(w, k, x[(k + 1) % 3] - x[k] - 0.1, y[(k + 1) % 3] - y[k], 0);
        if (blocked) move(w, 3, x[0] - 1.1 - 11 + 0.1, 0.05, 0);
        run_until_rear(w, 8);
        for (int k = 0; k < 3; k++) assert_true(at(w, k, x[k], y[k]) != blocked);
        assert_int_equal(w->window->renewed, blocked ? 0 : 3);
        run_until_rear(w, 12);
        for (int k = 0; k < 3; k++) assert_true(at(w, k, x[k], y[k])); // the fourth has gone home
        assert_true(at(w, 3, 11, 0));
        bt_world_free(w);
    }
}

/// A floe may lie in the bay of another's place, which is then free: shapes that are not convex are held against each
/// other by their parts.
TEST(bays_are_free)
{
    for (int deep = 0; deep < 2; deep++) {
        bt_world *w = empty(0.1);
        double v[16] = {-3, -3, 3, -3, 3, 3, 2, 3, 2, -2, -2, -2, -2, 3, -3, 3}; // a U, 4 m wide inside
        bt_parts parts;
        bt_body_def d = scene_prism(8, v, 36.4);
        assert_true(bt_outline_split(8, v, &parts));
        d.parts = &parts, d.x = 4;
        bt_world_add(w, &d);
        add_floe(w, 20, 0, 0);
        add_body_and_window(w, 1, speed);
        bt_world_step(w);
        move(w, 0, 0, 9, 1);
        move(w, 1, 4 - 20, deep ? -0.5 + v[1] : 1, 0); // into the bay; into the bottom of the U
        run_until_rear(w, 8);
        assert_true((pose(w, 0).y == 0) == !deep);
        assert_int_equal(w->window->renewed, !deep);
        bt_world_free(w);
    }
}

/// A floe that the body carries along is never taken away from it; its place is missed once a lap. One that is pushed
/// ahead by 10 m is renewed all the same, 5 m late.
TEST(carried_along)
{
    bt_world *w = empty(0.1);
    add_floe(w, 10, 0, 0);
    add_floe(w, 12, 5, 0);
    add_floe(w, 12, -5, 0);
    add_body_and_window(w, 1, speed);
    bt_world_step(w);
    move(w, 0, 20, 0, 0);
    move(w, 1, 10, 0, 0);
    double late = 0;
    while (bt_window_laps(w->window) < 2) {
        bt_world_step(w);
        move(w, 0, speed * w->par.dt, 0, 0);
        if (late == 0 && w->bodies.home[bt_world_index(w, 1)].copy == 1) late = w->window->rear - 12;
    }
    CHECK_CLOSE(unwrapped(w, 0) - w->tow->travel_x, 6 - speed * w->par.dt, 1e-9);
    assert_int_equal(w->window->missed, 2);
    assert_int_equal(w->window->kept, 0);
    assert_int_equal(w->window->renewed, 4);
    assert_true(late >= 5 && late <= 7); // within a stride
    bt_world_free(w);
}

/// Current: the mother field drifts with the water, what enters rests in it to the last bit. Wind: it drifts as its
/// mean floe does, so that equal floes keep their distances whether renewed or not.
TEST(drifts_as_undisturbed_ice)
{
    for (int wind = 0; wind < 2; wind++) {
        bt_world *w = empty(0.1);
        w->par.water_u = 0.1;
        w->par.air_u = wind ? 9 : 0.1, w->par.air_v = wind ? -6 : 0;
        w->par.coriolis = wind ? 1.4e-4 : 0;
        for (int k = 0; k < 8; k++) add_floe(w, 1 + 5 * k, 2 * (k % 2), 0);
        add_body_and_window(w, 1, speed);
        while (bt_window_laps(w->window) < 2.4) bt_world_step(w);
        assert_true(w->window->renewed > 8 && w->window->kept + w->window->missed == 0);
        for (int k = 0; k < 8; k++) {
            const bt_vel v = w->bodies.vel[bt_world_index(w, k)];
            CHECK_CLOSE(v.x, w->undisturbed->vel.x, 1e-12);
            CHECK_CLOSE(v.y, w->undisturbed->vel.y, 1e-12);
            if (!wind) assert_true(v.x == 0.1 && v.y == 0);
            CHECK_CLOSE(unwrapped(w, k),
                        1 + 5 * k + w->undisturbed->drift_x + LENGTH * w->bodies.home[bt_world_index(w, k)].copy, 1e-9);
            CHECK_CLOSE(pose(w, k).y, 2 * (k % 2) + w->undisturbed->drift_y, 1e-9);
        }
        if (wind)
            assert_true(w->undisturbed->drift_y < -0.5 &&
                        w->undisturbed->drift_x > 1.1 * 0.1 * w->par.dt * (double)w->step);
        else CHECK_CLOSE(w->undisturbed->drift_x, 0.1 * w->par.dt * (double)w->step, 1e-9);
        bt_world_free(w);
    }
}

/// A body that goes back leaves the window where it is, and the window goes on when the body has its place again.
TEST(does_not_go_back)
{
    bt_world *w = empty(0.1);
    for (int k = 0; k < 8; k++) add_floe(w, 1 + 5 * k, 0, 0);
    add_body_and_window(w, 1, speed);
    run_until_rear(w, 8);
    const int64_t renewed = w->window->renewed;
    w->tow->speed = -speed;
    for (int k = 0; k < 200; k++) bt_world_step(w);
    assert_true(w->window->rear == 8 && w->window->renewed == renewed && renewed == 2);
    w->tow->speed = speed;
    for (int k = 0; k < 200; k++) bt_world_step(w);
    assert_true(w->window->rear == 8);
    run_until_rear(w, 12);
    CHECK_CLOSE(w->tow->travel_x, 24 + 12, 2 * speed * w->par.dt);
    bt_world_free(w);
}

/// Two floes that nearly touch are put at their places: they have the velocity of the undisturbed ice, know of no
/// contact, and are looked at as after a blow. Two others are left alone. A home a rounding below the period's rim is
/// on the rim.
TEST(put_as_new)
{
    bt_world *w = empty(0.1);
    const double x[4] = {0, 1.25, 30, 31.25};
    for (int k = 0; k < 4; k++) add_floe(w, x[k], 0, 0);
    add_body_and_window(w, 1, speed);
    w->window->rear = -2; // so that the first home is not passed
    w->window->start = -2;
    bt_world_step(w);
    bt_bodies *b = &w->bodies;
    bt_idx of[4], n_pairs = 0;
    for (int k = 0; k < 4; k++) {
        of[k] = bt_world_index(w, k);
        b->vel[of[k]] = b->vel_start[of[k]] = b->vel_free[of[k]] = (bt_vel){.x = 1, .y = 2, .w = 3};
        b->disturbed[of[k]] = 0;
    }
    for (bt_idx k = 0; k < w->cells->n; k++)
        for (bt_idx j = 0; j < w->cells->cell[k].search.n_pairs; j++, n_pairs++)
            w->cells->cell[k].search.pairs[j].contact = 0;
    assert_int_equal(n_pairs, 2);
    assert_false(w->cells->relabel);
    b->home[of[0]].x = -1e-20;
    w->undisturbed->vel = (bt_vel){.x = 0.3, .y = 0.1};
    w->tow->travel_x += 4.5;
    bt_window_begin(w);
    assert_int_equal(w->window->renewed_now, 2);
    assert_true(w->cells->relabel);
    for (int k = 0; k < 4; k++) {
        const bt_vel put = {.x = 0.3, .y = 0.1}, left = {.x = 1, .y = 2, .w = 3};
        const bt_vel *want = k < 2 ? &put : &left;
        const bt_vel *is[3] = {&b->vel[of[k]], &b->vel_start[of[k]], &b->vel_free[of[k]]};
        for (int j = 0; j < 3; j++) assert_true(is[j]->x == want->x && is[j]->y == want->y && is[j]->w == want->w);
        assert_int_equal(b->disturbed[of[k]], k < 2);
        assert_true(at(w, k, x[k], 0));
    }
    assert_int_equal(b->lap[of[0]], b->home[of[0]].copy);
    for (bt_idx k = 0; k < w->cells->n; k++)
        for (bt_idx j = 0; j < w->cells->cell[k].search.n_pairs; j++) {
            const bt_pair *p = &w->cells->cell[k].search.pairs[j];
            assert_int_equal(p->contact, p->a == of[0] || p->a == of[1] ? -1 : 0);
        }
    bt_world_free(w);
}

/// A floe whose place another has entered by some times the slop waits; by less than the slop it goes.
TEST(no_place_upon_others)
{
    for (int deep = 0; deep < 2; deep++) {
        bt_world *w = empty(0.1);
        double v[8];
        scene_square(1, v);
        for (int k = 0; k < 2; k++) {
            bt_body_def d = scene_prism(4, v, 36.4);
            d.x = 2 + (k ? 6 : 0), d.drag.water_skin = 5;
            bt_world_add(w, &d);
        }
        add_body_and_window(w, 1, speed);
        bt_world_step(w);
        move(w, 1, -5 - (deep ? 5 : 0.5) * w->par.slop, 0, 0); // onto the place of floe 0
        move(w, 0, -0.5, 4, 0);
        w->tow->travel_x += 4.5;
        bt_window_begin(w);
        assert_int_equal(w->window->renewed, !deep);
        bt_world_free(w);
    }
}

/// Where walls hold the ice, the field around it does not drift across; a stride leaves most of the zone of entry as it
/// is, however short that is.
TEST(held_by_walls)
{
    for (int held = 0; held < 2; held++) {
        bt_params p = scene_params(0.1, 1);
        p.period_x = LENGTH;
        p.water_u = p.water_v = 0.2;
        bt_world *w = bt_world_create(&p);
        add_floe(w, 2, 0, 0);
        add_body_and_window(w, 1, speed);
        free(w->undisturbed);
        bt_undisturbed_create(w, 1, (const bool[2]){false, held});
        for (int k = 0; k < 10; k++) bt_undisturbed_advance(w);
        assert_true(w->undisturbed->drift_x > 0.1);
        assert_true(held ? w->undisturbed->drift_y == 0 : w->undisturbed->drift_y > 0.1);
        bt_world_free(w);
    }
    bt_world *w = empty(0.1);
    add_floe(w, 2, 0, 0);
    add_body_and_window(w, 1, speed);
    free(w->window);
    bt_window_create(w, 1, 4, 1);
    assert_true(w->window->zone == 2 && w->window->stride == 0.5);
    bt_world_free(w);
}

/// What decides about the floes' way is in the hash of the state.
TEST(hashed)
{
    bt_world *w = empty(0.1);
    add_floe(w, 1, 0, 0);
    add_body_and_window(w, 1, speed);
    bt_world_step(w);
    const uint64_t h = bt_world_hash(w);
    w->window->rear += 1;
    assert_true(bt_world_hash(w) != h);
    w->window->rear -= 1;
    w->undisturbed->drift_x += 1;
    assert_true(bt_world_hash(w) != h);
    w->undisturbed->drift_x -= 1;
    w->bodies.home[bt_world_index(w, 0)].copy++;
    assert_true(bt_world_hash(w) != h);
    w->bodies.home[bt_world_index(w, 0)].copy--;
    w->bodies.lap[bt_world_index(w, 0)]++;
    assert_true(bt_world_hash(w) != h);
    bt_world_free(w);
}

TEST_MAIN(NULL, NULL)
