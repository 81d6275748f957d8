// SPDX-License-Identifier: MIT
// Crushing-limited contact against closed forms: creep at the limit force, stops, corners, friction, memory.
#include "scene.h"

#include "bergtow/outline.h"
#include "contact/crush.h"
#include "contact/hit.h"
#include "contact/law_pair.h"
#include "space/shore.h"

static const double pressure = 2e4, sheet = 36.4; // Pa, kg/m²

static bt_params params(double dt)
{
    bt_params p = scene_params(dt, 1);
    p.law_own[BT_LAW_CRUSHING][BT_CRUSH_PRESSURE] = pressure;
    p.law_own[BT_LAW_CRUSHING][BT_CRUSH_LEAST] = 0.01;
    return p;
}

static bt_idx add_floe(bt_world *w, int n, double *v, double x, double y, double yaw, double vx, double h)
{
    bt_body_def d = scene_prism(n, v, sheet);
    d.x = x, d.y = y, d.yaw = yaw, d.vx = vx, d.thickness = h;
    return bt_world_add(w, &d);
}

static bt_idx add_square(bt_world *w, double x, double vx, double h)
{
    double v[8];
    scene_square(1, v);
    return add_floe(w, 4, v, x, 0, 0, vx, h);
}

static bt_vel *vel(bt_world *w, bt_gid g) { return &w->bodies.vel[bt_world_index(w, g)]; }
static bt_pose *pose(bt_world *w, bt_gid g) { return &w->bodies.pose[bt_world_index(w, g)]; }

/// Normal impulse of all contacts of the step, N s.
static double pushed(const bt_world *w)
{
    double sum = 0;
    for (bt_idx k = 0; k < w->cells->n; k++)
        for (bt_idx j = 0; j < w->cells->cell[k].n_contacts; j++)
            sum += w->cells->cell[k].contacts[j].ln[0] + w->cells->cell[k].contacts[j].ln[1];
    return sum;
}

/// A steady force (the slope of the sea surface) presses a floe edge-on against a wall, limit F = p h L. Below the
/// limit it stands still; above, it goes on with the acceleration a − F/m into the ice, whose resistance stays F.
TEST(pressed_against_a_wall)
{
    const double h = 0.1, limit = pressure * h, dt = 0.005, shares[] = {0.3, 0.999, 1.001, 1.5};
    for (int i = 0; i < 4; i++) {
        bt_params p = params(dt);
        p.tilt_ax = shares[i] * limit / sheet;
        bt_world *w = bt_world_create(&p);
        add_square(w, 0, 0, h);
        scene_wall(w, 0.5, -50, 5, 50, 0);
        double v = 0, depth = 0;
        for (int s = 0; s < 20; s++) {
            bt_world_step(w);
            assert_true(w->stats.converged);
            v += bt_max(0, shares[i] - 1) * limit / sheet * dt;
            depth += dt * v;
            CHECK_CLOSE(vel(w, 0)->x, v, 1e-9);
            CHECK_CLOSE(pose(w, 0)->x, depth, 1e-9);
            CHECK_CLOSE(pushed(w) / dt, bt_min(1, shares[i]) * limit, 1e-6 * limit);
            CHECK_CLOSE(scene_law(w, "crushed_depth"), depth, 1e-9);
            assert_true(scene_law(w, "crushing") == (shares[i] > 1 ? 2 : 0));
            assert_true(w->stats.overlap <= 1e-9);
            assert_true(w->stats.position_sweeps == 0); // nothing to put right
        }
        bt_world_free(w);
    }
}

/// A floe hits a wall edge-on: it stops after t = m v/(p h L), at the depth m v²/(2 p h L), and crushing has taken its
/// energy.
TEST(stop_at_constant_force)
{
    // the way to the wall crushes nothing
    const double h = 0.1, v = 2, dt = 1e-4, brake = pressure * h / sheet, gap = 1.37 * v * dt;
    bt_params p = params(dt);
    bt_world *w = bt_world_create(&p);
    add_square(w, -gap, v, h);
    scene_wall(w, 0.5, -50, 5, 50, 0);
    double work = 0, energy = 0, stopped = 0;
    for (int s = 1; s <= 500; s++) {
        bt_world_step(w);
        assert_true(w->stats.converged);
        work += scene_law(w, "crushed_work");
        energy += w->stats.contact_work;
        if (stopped == 0 && vel(w, 0)->x < 1e-9) stopped = s * dt;
    }
    CHECK_CLOSE(stopped, gap / v + v / brake, 8 * dt); // what is left of its speed is squared from step to step
    CHECK_CLOSE(pose(w, 0)->x, scene_law(w, "crushed_depth"), 1e-9);
    CHECK_CLOSE(scene_law(w, "crushed_depth"), 0.5 * v * v / brake, 1e-9);
    CHECK_CLOSE(energy, -0.5 * sheet * v * v, 1e-9 * sheet * v * v);
    CHECK_CLOSE(work, 0.5 * sheet * v * v, 1e-9 * sheet * v * v);
    bt_world_free(w);
}

/// A corner is crushed at a wall while the next one is far from it, or just beyond the slop. A fast floe in the
/// neighbourhood makes the search look farther ahead and find that corner, too, which must not change what the first
/// one bears.
TEST(the_margin_of_the_search)
{
    const double dt = 1e-4;
    const struct { double yaw, slop; int steps; } at[] = {{0.03, 1e-6, 20}, {1.1e-3, 1e-3, 1}};
    for (int i = 0; i < 2; i++) {
        const double corner = 0.5 * (cos(at[i].yaw) + sin(at[i].yaw));
        double x[2] = {0}, spin[2] = {0};
        for (int fast = 0; fast < 2; fast++) {
            bt_params p = params(dt);
            p.slop = at[i].slop;
            bt_world *w = bt_world_create(&p);
            double v[8];
            scene_square(1, v);
            add_floe(w, 4, v, -corner, 0, at[i].yaw, 2, 0.1);
            if (fast) add_floe(w, 4, v, -corner - 2, 0, 0, -300, 0.1);
            scene_wall(w, 0, -50, 5, 50, 0);
            for (int s = 0; s < at[i].steps; s++) bt_world_step(w);
            assert_true(w->stats.n_points == 1 + fast && scene_law(w, "crushing") == 1);
            x[fast] = vel(w, 0)->x, spin[fast] = vel(w, 0)->w;
            bt_world_free(w);
        }
        assert_true(x[0] < 2 && spin[0] != 0);
        CHECK_CLOSE(x[1], x[0], 1e-12);
        CHECK_CLOSE(spin[1], spin[0], 1e-12);
    }
}

/// The only contact of floe 0 with the last body; its cell in *at.
static bt_idx contact_with_last(bt_world *w, bt_cell **at)
{
    const bt_idx one = bt_world_index(w, 0), other = bt_world_index(w, w->bodies.n - 1);
    for (bt_idx k = 0; k < w->cells->n; k++)
        for (bt_idx j = 0; j < w->cells->cell[k].n_contacts; j++) {
            const bt_contact *u = &w->cells->cell[k].contacts[j];
            *at = &w->cells->cell[k];
            if (bt_min(u->a, u->b) == bt_min(one, other) && bt_max(u->a, u->b) == bt_max(one, other)) return j;
        }
    fail();
    return -1;
}

/// Which points take part: by the speed before the step and by the free one, and what lies beside the nearest.
TEST(points_that_take_part)
{
    bt_params p = params(0.01);
    p.slop = 1e-3;
    bt_world *w = bt_world_create(&p);
    add_square(w, -0.5, 0.1, 0.1);
    scene_wall(w, 0, -50, 5, 50, 0);
    bt_world_step(w);
    bt_cell *t = NULL;
    const bt_idx j = contact_with_last(w, &t);
    const struct { double before, free, gap[2], outline[2]; bool closes[2]; double least, approach; } at[] = {
        {0, 0, {0, 5e-4}, {0, 5e-4}, {true, true}, 0, 0},                 // within the slop
        {0, 0, {0.02, 0.0209}, {0.02, 0.0209}, {true, true}, 0.02, 0},    // beside the nearest, whatever closes them
        {0, 0, {0.02, 0.0211}, {0.02, 0.0211}, {true, false}, 0.02, 0},   // farther
        {0.5, 0.1, {0, 4e-3}, {0, 4e-3}, {true, true}, 0, 0.5},           // 5 mm a step, before
        {0.1, 0.5, {4e-3, 0}, {4e-3, 0}, {true, true}, 0, 0.5},           // and without contacts
        {0.5, 0.1, {0, 5.5e-3}, {0, 5.5e-3}, {true, false}, 0, 0.5},      // not slop and way together
        {0.1, 0.1, {0.02, 0}, {-0.01, -0.03}, {false, true}, 0, 0.1},     // crushed
        {0.1, 0.1, {3e-3, 2e-3}, {-0.02, 0}, {true, true}, 2e-3, 0.1},    // the outlines' nearest, and the surfaces'
        {-1, -1, {3e-3, -1e-3}, {3e-3, -1e-3}, {false, true}, 0, 0},      // they part
    };
    for (size_t k = 0; k < sizeof at / sizeof *at; k++) {
        const bt_idx floe = bt_world_index(w, 0);
        w->bodies.vel_start[floe] = (bt_vel){at[k].before, 0, 0, 0};
        w->bodies.vel_free[floe] = (bt_vel){at[k].free, 0, 0, 0};
        bt_manifold m = {.n_points = 2};
        for (int i = 0; i < 2; i++) t->gaps[j].gap[i] = at[k].gap[i], m.p[i].gap = at[k].outline[i];
        const bt_closing c = bt_law_closing(w, t, j, &m);
        for (int i = 0; i < 2; i++)
            if (c.point[i] != at[k].closes[i]) fail_msg("row %zu, point %d", k, i);
        assert_int_equal(c.n, at[k].closes[0] + at[k].closes[1]);
        CHECK_CLOSE(c.gap, at[k].least, 1e-15);
        CHECK_CLOSE(c.approach, at[k].approach, 1e-12);
    }
    bt_world_free(w);
}

/// A point beside the nearest one is found though it lies beyond the margin, where a law bounds the load; rigid
/// contacts need none.
TEST(a_point_beside_the_nearest_is_found)
{
    for (int crushes = 0; crushes < 2; crushes++) {
        bt_params p = params(0.01);
        p.slop = 1e-3;
        if (!crushes) p.law_own[BT_LAW_CRUSHING][BT_CRUSH_PRESSURE] = 0;
        bt_world *w = bt_world_create(&p);
        double v[8];
        scene_square(1, v);
        const double yaw = 6e-4, corner = 0.5 * (cos(yaw) + sin(yaw));
        add_floe(w, 4, v, -corner - 0.9e-3, 0, yaw, 1e-4, 0.1); // 0.9 and 1.5 slops off
        scene_wall(w, 0, -50, 5, 50, 0);
        bt_world_step(w);
        bt_cell *t = NULL;
        const bt_idx j = contact_with_last(w, &t);
        assert_int_equal(t->contacts[j].n, 1 + crushes);
        bt_world_free(w);
    }
}

/// A floe at rest is pushed across a gap and shut against a wall by another one: whether its edge lies true or is
/// turned a little, both of its ends bear.
TEST(pushed_shut)
{
    const double h = 0.1, dt = 0.01, yaw[] = {0, 1e-12, -1e-12, 1e-4};
    for (int i = 0; i < 4; i++) {
        bt_params p = params(dt);
        p.slop = 1e-3;
        bt_world *w = bt_world_create(&p);
        double v[8];
        scene_square(1, v);
        add_floe(w, 4, v, -0.505, 0, yaw[i], 0, h);
        bt_body_def d = scene_prism(4, v, sheet);
        d.motion = BT_KINEMATIC, d.x = -1.505, d.vx = 0.6;
        bt_world_add(w, &d);
        scene_wall(w, 0, -50, 5, 50, 0);
        bt_world_step(w);
        bt_cell *t = NULL;
        const bt_idx j = contact_with_last(w, &t);
        const bt_limit *l = &t->laws->limits[j];
        assert_int_equal(t->contacts[j].n, 2);
        for (int k = 0; k < 2; k++) CHECK_CLOSE(l->flat[k], 0.5 * pressure * h * dt, 0.06 * pressure * h * dt);
        bt_world_free(w);
    }
}

/// Two corners are crushed; the floe is turned until one is farther off than the search looks. Found or not, it remains
/// as deep.
TEST(a_corner_out_of_sight_is_not_forgotten)
{
    for (int fast = 0; fast < 2; fast++) {
        bt_params p = params(1e-3);
        bt_world *w = bt_world_create(&p);
        double v[8];
        scene_square(1, v);
        add_floe(w, 4, v, -0.5, 0, 0, 2, 0.1);
        if (fast) add_floe(w, 4, v, -3, 0, 0, -30, 0.1);
        scene_wall(w, 0, -50, 5, 50, 0);
        for (int s = 0; s < 100; s++) bt_world_step(w);
        const bt_idx floe = bt_world_index(w, 0);
        bt_cell *t = NULL;
        contact_with_last(w, &t);
        const double deep = t->laws->memory[0].value[0];
        assert_true(t->laws->n_memory == 1 && t->laws->memory[0].n_points == 2 && deep > 0.02);
        *vel(w, 0) = (bt_vel){1e-6, 0, 0, 0};
        // about the corner that remains where it is
        w->bodies.pose[floe].yaw = 0.06, w->bodies.pose[floe].x -= 0.5 * (cos(0.06) + sin(0.06)) - 0.5;
        bt_bodies_turn(&w->bodies, floe);
        w->bodies.disturbed[floe] = 1;
        bt_world_step(w);
        const bt_idx j = contact_with_last(w, &t);
        assert_int_equal(t->contacts[j].n, 1 + fast);
        assert_true(t->laws->memory[0].n_points == 2);
        for (int i = 0; i < 2; i++) CHECK_CLOSE(t->laws->memory[0].value[i], deep, 0.01 * deep);
        bt_world_free(w);
    }
}

/// A third corner is crushed: of the two old depths the deeper stays, whichever comes first in the record.
TEST(the_deeper_of_two_old_depths_stays)
{
    for (int deep = 0; deep < 2; deep++) {
        bt_params p = params(1e-3);
        bt_world *w = bt_world_create(&p);
        double v[8];
        scene_square(1, v);
        add_floe(w, 4, v, -0.5 * sqrt(2), 0, 0.25 * BT_PI, 2, 0.1);
        scene_wall(w, 0, -50, 5, 50, 0);
        for (int s = 0; s < 5; s++) bt_world_step(w);
        bt_cell *t = NULL;
        contact_with_last(w, &t);
        assert_int_equal(t->laws->n_memory, 1);
        bt_memory *memory = &t->laws->memory[0];
        memory->n_points = 2;
        for (int i = 0; i < 2; i++)
            memory->feature[i] = (uint32_t)(1000 + i), memory->value[i] = i == deep ? 0.3 : 0.001;
        bt_world_step(w);
        const bt_idx j = contact_with_last(w, &t);
        memory = &t->laws->memory[0];
        assert_int_equal(memory->n_points, 2);
        assert_int_equal(memory->feature[0], t->gaps[j].feature[0]);
        assert_int_equal(memory->feature[1], 1000 + deep);
        CHECK_CLOSE(memory->value[1], 0.3, 0);
        bt_world_free(w);
    }
}

static void drive(bt_world *w, double vx, double vy, int steps, double *overlap)
{
    for (int s = 0; s < steps; s++) {
        *vel(w, 0) = (bt_vel){vx, vy, 0, 0};
        bt_world_step(w);
        *overlap = bt_max(*overlap, w->stats.overlap);
    }
}

/// A corner is crushed, slides off the end of the edge and gets another name there, is crushed deeper, and slides back:
/// that the first name was less deep brings no overlap back.
TEST(sliding_back_brings_no_overlap)
{
    const double yaw = -0.06;
    bt_params p = params(1e-3);
    p.slop = 1e-3;
    bt_world *w = bt_world_create(&p);
    double v[8], overlap = 0;
    scene_square(1, v);
    bt_body_def d = scene_prism(4, v, sheet);
    d.motion = BT_KINEMATIC, d.thickness = 0.1;
    d.x = -0.5 * (cos(yaw) + sin(-yaw)) - 0.5 - 1e-3, d.y = -0.1, d.yaw = yaw;
    bt_world_add(w, &d);
    bt_body_def heavy = scene_prism(4, v, 1e4 * sheet);
    heavy.thickness = 0.1;
    bt_world_add(w, &heavy);
    drive(w, 1, 0, 25, &overlap);
    drive(w, 0, 1, 200, &overlap);
    drive(w, 1, 0, 20, &overlap);
    drive(w, 0, -1, 200, &overlap);
    assert_true(scene_law(w, "crushed_depth") > 0.03 && overlap < 2 * p.slop);
    bt_world_free(w);
}

/// Two floes of different mass and thickness meet edge-on, also on a part of their edges only: the thinner is crushed,
/// over the part, with the reduced mass; they end with the common velocity.
TEST(two_floes)
{
    const double v = 1, dt = 1e-4;
    bt_params p = params(dt);
    bt_world *w = bt_world_create(&p);
    double bar[8] = {-2, -0.5, 2, -0.5, 2, 0.5, -2, 0.5};
    add_square(w, 0, v, 0.3);
    add_floe(w, 4, bar, 2.5, 0, 0, 0, 0.05);
    const double reduced = sheet * 4 / 5, force = pressure * 0.05 * 1;
    double work = 0;
    for (int s = 0; s < 1000; s++) {
        bt_world_step(w);
        work += scene_law(w, "crushed_work");
        assert_true(w->stats.momentum_residual <= 1e-10);
        assert_true(pushed(w) <= force * dt * (1 + 1e-12));
    }
    CHECK_CLOSE(vel(w, 0)->x, v / 5, 1e-8);
    CHECK_CLOSE(vel(w, 1)->x, v / 5, 1e-8);
    CHECK_CLOSE(scene_law(w, "crushed_depth"), 0.5 * reduced * v * v / force, v * dt);
    CHECK_CLOSE(work, 0.5 * reduced * v * v, force * force * dt * dt / reduced);
    CHECK_CLOSE(pose(w, 1)->x - pose(w, 0)->x, 2.5 - scene_law(w, "crushed_depth"), 1e-8);
    bt_world_free(w);

    // a body that is no ice: the floe's thickness; half a length of overlap on a slab that cannot turn
    w = bt_world_create(&p);
    add_square(w, 0, v, 0.3);
    double slab[8] = {-1, -1, 1, -1, 1, 1, -1, 1};
    bt_body_def d = scene_prism(4, slab, sheet);
    d.motion = BT_STATIC, d.large = true, d.x = 1.5, d.y = 1.25; // reaches down to y = 0.25: a quarter of the edge
    bt_world_add(w, &d);
    bt_world_step(w);
    // by the energy, F Δt 2 u/(v + u): the slab meets two ends of the edge's part at two speeds
    CHECK_CLOSE(pushed(w) / dt, pressure * 0.3 * 0.25, 0.005 * pressure * 0.3 * 0.25);
    bt_world_free(w);
}

/// A corner of angle φ: a spring k = 2 p h tan(φ/2) that never gives back, depth v √(m/k), after a quarter of the
/// period.
TEST(corner)
{
    const double h = 0.1, v = 0.5, angles[] = {90, 40, 140};
    for (int i = 0; i < 3; i++) {
        const double half = 0.5 * angles[i] * BT_PI / 180;
        // A kite with its tip at (0.5, 0) before centring.
        double kite[8] = {0.5 - cos(half), -sin(half), 0.5, 0, 0.5 - cos(half), sin(half), -cos(half) - 0.5, 0};
        bt_shape_centre(4, kite);
        const double m = sheet * bt_shape_moments(4, kite).area, k = 2 * pressure * h * tan(half),
                     deep = v * sqrt(m / k);
        const double steps[] = {0.005, 0.1, 1, 8}; // Δt √(k/m)
        for (int j = 0; j < 4; j++) {
            const double dt = steps[j] * sqrt(m / k);
            bt_params p = params(dt);
            p.law_own[BT_LAW_CRUSHING][BT_CRUSH_LEAST] = 0;
            p.slop = 1e-11; // lengths are looked at one slop deeper
            bt_world *w = bt_world_create(&p);
            add_floe(w, 4, kite, 0, 0, 0, v, h);
            scene_wall(w, kite[2], -50, kite[2] + 5, 50, 0);
            double work = 0, stopped = 0, depth = 0;
            for (int s = 1; s < 3 * BT_PI / steps[j] + 4; s++) {
                bt_world_step(w);
                assert_true(w->stats.converged);
                work += scene_law(w, "crushed_work");
                depth = bt_max(depth, scene_law(w, "crushed_depth")); // of pairs in contact: none where all rests
                if (stopped == 0 && vel(w, 0)->x < 1e-9) stopped = s * dt;
                if (s == 1) { // takes from the floe the energy that this depth costs
                    CHECK_CLOSE(scene_law(w, "crushed_work"), 0.5 * k * pow(scene_law(w, "crushed_depth"), 2),
                                1e-8 * m * v * v);
                    CHECK_CLOSE(scene_law(w, "crushed_depth"), v * dt / sqrt(1 + dt * dt * k / m), 1e-9);
                }
            }
            if (j == 0) {
                CHECK_CLOSE(depth, deep, 0.005 * deep);
                CHECK_CLOSE(stopped, 0.5 * BT_PI * sqrt(m / k), 8 * dt);
                CHECK_CLOSE(work, 0.5 * m * v * v, 0.005 * 0.5 * m * v * v);
            }
            print_message("dt √(k/m) %g: depth %.3f of v √(m/k)\n", steps[j], depth / deep);
            CHECK_CLOSE(depth, deep, 1e-3 * deep);
            CHECK_CLOSE(work, 0.5 * m * v * v, 1e-3 * m * v * v);
            CHECK_CLOSE(pose(w, 0)->x, depth, 1e-6);
            assert_true(w->stats.overlap <= 1e-9);
            bt_world_free(w);
        }
    }
}

/// A floe of 30 m at full scale meets a wall by its face, a corner, a disc's rim, at 0.5 m/s, from a gap to cross
/// first or none: its depth is the one at which crushing has taken its kinetic energy, and its work that energy.
TEST(energy_at_any_time_step)
{
    const double p0 = 1.5e6, h = 1, v = 0.5, steps[] = {0.002, 0.01, 0.05, 0.1, 0.2, 0.5, 1, 2, 5},
                 gaps[] = {0, 0.03, 0.37, 0.9};
    enum { FACE, CORNER, BLUNT, RIM, SHAPES };
    const char *name[] = {"face", "corner", "blunt corner", "rim"};
    for (int shape = 0; shape < SHAPES; shape++) {
        double o[2 * BT_MAX_VERTICES], worst[2] = {0};
        const int n = shape == RIM ? 32 : 4;
        const double radius = 15, half = BT_PI / n;
        for (int k = 0; k < n; k++) { // a corner at +x, or an edge
            const double at = 2 * half * k + (shape == FACE || shape == RIM ? half : 0), r = radius / cos(half);
            o[2 * k] = r * cos(at), o[2 * k + 1] = r * sin(at);
        }
        const double tip = shape == CORNER || shape == BLUNT ? radius / cos(half) : radius;
        const double energy = 0.5 * 910 * h * bt_shape_moments(n, o).area * v * v, least = shape == BLUNT ? 0.3 : 0;
        // The depth at which p h ∫ max(l, least) is the energy.
        double deep = 0, taken = 0;
        for (const double dd = 1e-6; taken < energy; deep += dd) {
            double l = 2 * radius;
            if (shape == CORNER || shape == BLUNT) l = 2 * deep;
            if (shape == RIM) { // of the polygon
                const double x = radius - deep;
                for (int k = 0; k < n / 4; k++) {
                    const double *a = o + 2 * k, *b = a + 2;
                    if (a[0] >= x && b[0] <= x) l = 2 * (a[1] + (a[0] - x) / (a[0] - b[0]) * (b[1] - a[1]));
                }
            }
            taken += p0 * h * bt_max(l, least * h) * dd;
        }
        for (int j = 0; j < 9; j++)
            for (int k = 0; k < 4; k++) {
                const double dt = steps[j];
                bt_params p = scene_params(dt, 30);
                p.slop = 0.03;
                p.rest_speed = 0.005;
                p.law_own[BT_LAW_CRUSHING][BT_CRUSH_PRESSURE] = p0;
                p.law_own[BT_LAW_CRUSHING][BT_CRUSH_LEAST] = least;
                bt_world *w = bt_world_create(&p);
                bt_body_def d = scene_prism(n, o, 910 * h);
                d.vx = v, d.thickness = h;
                bt_world_add(w, &d);
                const double gap = gaps[k] * v * dt;
                scene_wall(w, tip + gap, -500, tip + 500, 500, 0);
                double work = 0, depth = 0;
                for (int s = 0; s < 4 / dt + 8; s++) {
                    bt_world_step(w);
                    assert_true(w->stats.converged);
                    work += scene_law(w, "crushed_work");
                    depth = bt_max(depth, scene_law(w, "crushed_depth"));
                }
                const double off[2] = {fabs(depth / deep - 1), fabs(work / energy - 1)};
                for (int i = 0; i < 2; i++) worst[i] = bt_max(worst[i], off[i]);
                CHECK_CLOSE(pose(w, 0)->x - gap, depth, 1e-6);
                bt_world_free(w);
            }
        print_message("%s: off by %.2g, %.2g\n", name[shape], worst[0], worst[1]);
        assert_true(worst[0] < 0.005 && worst[1] < 0.005);
    }
}

/// A corner at rest that a steady force L presses into a wall from now on goes in to 2 L/κ, F = κ d, where the force
/// has given what crushing took. An edge shorter than the least length bears p h times that, both of its ends together.
TEST(pressed_from_rest)
{
    const double h = 0.1, kappa = 2 * pressure * h, steps[] = {0.0005, 0.005, 0.05};
    for (int j = 0; j < 3; j++) {
        bt_params p = params(steps[j]);
        p.slop = 1e-9, p.law_own[BT_LAW_CRUSHING][BT_CRUSH_LEAST] = 0;
        const double load = 0.1 * kappa;
        double v[8] = {-0.5, 0, 0, -0.5, 0.5, 0, 0, 0.5};
        p.tilt_ax = load / (0.5 * sheet);
        bt_world *w = bt_world_create(&p);
        add_floe(w, 4, v, 0, 0, 0, 0, h);
        scene_wall(w, 0.5, -50, 5, 50, 0);
        for (int s = 0; s < 1 / steps[j] + 4; s++) bt_world_step(w);
        CHECK_CLOSE(pose(w, 0)->x, 2 * load / kappa, 0.25 * load / kappa); // -11 % at worst
        CHECK_CLOSE(vel(w, 0)->x, 0, 1e-6);
        CHECK_CLOSE(pushed(w), load * steps[j], 1e-6 * load);
        bt_world_free(w);
    }
    for (int beyond = 0; beyond < 2; beyond++) {
        bt_params p = params(0.005);
        p.law_own[BT_LAW_CRUSHING][BT_CRUSH_LEAST] = 20; // 2 m, the edge has 1 m
        p.tilt_ax = (beyond ? 1.1 : 0.9) * 2 * pressure * h / sheet;
        bt_world *w = bt_world_create(&p);
        add_square(w, 0, 0, h);
        scene_wall(w, 0.5, -50, 5, 50, 0);
        for (int s = 0; s < 4; s++) bt_world_step(w);
        assert_true((pose(w, 0)->x > 1e-9) == beyond);
        bt_world_free(w);
    }
}

/// In company the work of crushing is the energy lost, too, whatever the step: a heavy body comes in on a row of floes
/// that lies against a wall, by a face or a corner; and one of four floes that touch ends with their common velocity.
TEST(energy_in_company)
{
    const double p0 = 1.5e6, h = 1, v = 0.5, side = 30, sheet_1m = 910, half = 0.5 * side, reach = side / sqrt(2),
                 steps[] = {0.002, 0.02, 0.1, 0.5, 1, 2, 5};
    enum { FACE, TIP, FREE, KINDS };
    for (int kind = 0; kind < KINDS; kind++)
        for (int j = 0; j < 7; j++) {
            const double dt = steps[j], line = p0 * h, heavy = kind == FREE ? 1 : 20;
            bt_params p = scene_params(dt, side);
            p.slop = 0.03, p.rest_speed = 0.005;
            p.law_own[BT_LAW_CRUSHING][BT_CRUSH_PRESSURE] = p0, p.law_own[BT_LAW_CRUSHING][BT_CRUSH_LEAST] = 0;
            bt_world *w = bt_world_create(&p);
            double square[8], corner[8] = {-reach, 0, 0, -reach, reach, 0, 0, reach};
            scene_square(side, square);
            bt_body_def d = scene_prism(4, kind == TIP ? corner : square, heavy * sheet_1m);
            const double energy = 0.5 * d.mass * v * v * (kind == FREE ? 0.75 : 1);
            d.vx = v, d.thickness = h, d.x = kind == TIP ? half - reach : 0;
            bt_world_add(w, &d);
            for (int k = 1; k < 4; k++) {
                bt_body_def floe = scene_prism(4, square, sheet_1m);
                floe.x = side * k, floe.thickness = h;
                bt_world_add(w, &floe);
            }
            if (kind != FREE) scene_wall(w, 3.5 * side, -500, 900, 500, 0);
            double work = 0;
            for (int s = 0; s < 6 / dt + 30; s++) {
                bt_world_step(w);
                work += scene_law(w, "crushed_work");
            }
            CHECK_CLOSE(work, energy, 2e-3 * energy);
            const double in = pose(w, 0)->x - d.x - pose(w, 3)->x + 3 * side;
            if (kind == FREE) CHECK_CLOSE(vel(w, 0)->x, 0.25 * v, 1e-2 * v);
            CHECK_CLOSE(kind == TIP ? line * in * in : line * side * in, energy, 0.01 * energy);
            bt_world_free(w);
        }
}

/// The end of a hit is where its curve meets the contact's own equation, and E has no step at the kink.
TEST(the_curve_of_a_hit)
{
    uint64_t rng = 4;
    int ends = 0;
    for (int trial = 0; trial < 20000; trial++) {
        const double w = pow(10, -6 * scene_uniform(&rng)), place = trial % 3 ? 0 : 0.4 * scene_uniform(&rng);
        bt_hit h = {.before = place + scene_uniform(&rng), .load = trial % 2 ? 0 : 0.1 * scene_uniform(&rng) / w};
        h.kink = trial % 4 ? 0.3 * scene_uniform(&rng) : 0;
        h.touch = scene_uniform(&rng) / w, h.ramp = trial % 5 ? scene_uniform(&rng) / w : 0;
        h.slope = scene_uniform(&rng) / w, h.force = h.touch + (h.ramp - h.slope) * h.kink;
        h.work = h.kink * (h.touch - h.force + 0.5 * (h.ramp - h.slope) * h.kink);
        CHECK_CLOSE(bt_hit_work(&h, h.kink * (1 + 1e-12)), bt_hit_work(&h, h.kink), 1e-9 / w);
        const double free = h.before + w * h.load - 0.5 * scene_uniform(&rng), in = bt_hit_end(&h, place, free, w);
        assert_true(in >= 0);
        if (!(in > 0)) continue;
        ends++;
        CHECK_CLOSE(bt_hit_bound(&h, place, in), (free - place - in) / w, 1e-9 / w);
        const double u = place + in, mean = 0.5 * (h.before + u); // energy lost is what crushing costs
        CHECK_CLOSE((free - u) / w * mean - h.load * mean + h.load * u, bt_hit_work(&h, in), 1e-9 / w);
    }
    assert_true(ends > 10000);
}

/// A floe that slides along the wall while it is pressed at the limit: friction is μ p h L, and what it takes and what
/// crushing takes is the kinetic energy lost.
TEST(friction_from_the_limit)
{
    const double h = 0.1, v = 1, slide = 3, mu = 0.2, dt = 1e-4, brake = pressure * h / sheet;
    bt_params p = params(dt);
    bt_world *w = bt_world_create(&p);
    double sq[8];
    scene_square(1, sq);
    bt_body_def d = scene_prism(4, sq, sheet);
    d.thickness = h, d.vx = v, d.vy = slide;
    d.inertia *= 1e9; // both points are at the limit: nothing else would keep it from turning
    bt_world_add(w, &d);
    scene_wall(w, 0.5, -50, 5, 50, mu);
    double work = 0, crushed = 0, friction = 0;
    for (int s = 0; s < 400; s++) {
        const bt_vel last = *vel(w, 0);
        bt_world_step(w);
        assert_true(w->stats.converged);
        work += w->stats.contact_work;
        crushed += scene_law(w, "crushed_work");
        friction += mu * sheet * (last.x - vel(w, 0)->x) * 0.5 * (last.y + vel(w, 0)->y);
        if (s * dt < 0.9 * v / brake) {
            CHECK_CLOSE(slide - vel(w, 0)->y, mu * (v - vel(w, 0)->x), 1e-8);
            CHECK_CLOSE(v - vel(w, 0)->x, brake * (s + 1) * dt, 0.01 * v);
            const double before = 0.5 * sheet * (v * v + slide * slide);
            CHECK_CLOSE(before - w->stats.kinetic_energy, crushed + friction, 1e-7 * before);
        }
        CHECK_CLOSE(work, w->stats.kinetic_energy - 0.5 * sheet * (v * v + slide * slide), 1e-8 * sheet);
    }
    CHECK_CLOSE(vel(w, 0)->x, 0, 1e-9);
    CHECK_CLOSE(vel(w, 0)->y, slide - mu * v, 1e-7); // in all μ times the normal impulse, as in rigid contact
    bt_world_free(w);
}

/// What is crushed stays so: the floe stands in its dent, leaves it, comes back without a force up to the dent's
/// bottom; once it has been farther away than the memory reaches, it meets the wall's face again.
TEST(memory)
{
    const double h = 0.1, v = 2, dt = 1e-3, back = 0.05;
    bt_params p = params(dt);
    bt_world *w = bt_world_create(&p);
    add_square(w, 0, v, h);
    scene_wall(w, 0.5, -50, 5, 50, 0);
    for (int s = 0; s < 200; s++) bt_world_step(w);
    const double deep = pose(w, 0)->x;
    assert_true(deep > 0.02 && w->cells->cell[0].laws->n_memory == 1);
    for (int s = 0; s < 20; s++) bt_world_step(w);
    CHECK_CLOSE(pose(w, 0)->x, deep, 0);
    const uint64_t hash = bt_world_hash(w);
    w->cells->cell[0].laws->memory[0].value[0] *= 1 + 1e-15;
    assert_true(bt_world_hash(w) != hash);

    const double away[] = {0.5, 0.95, 1.1}; // of the memory, from the face
    for (int i = 0; i < 3; i++) {
        const double out = away[i] * BT_LAW_MEMORY, start = pose(w, 0)->x;
        vel(w, 0)->x = -0.5;
        w->bodies.disturbed[bt_world_index(w, 0)] = 1;
        w->cells->asleep[0] = BT_AWAKE;
        bt_cells_wake(w->cells, 0);
        while (pose(w, 0)->x > -out) bt_world_step(w);
        vel(w, 0)->x = back;
        double free_until = 0;
        for (int s = 0; s < 3000 && vel(w, 0)->x > 0; s++) {
            if (vel(w, 0)->x == back) free_until = pose(w, 0)->x;
            bt_world_step(w);
        }
        CHECK_CLOSE(free_until, away[i] < 1 ? start : 0, 2 * back * dt);
        assert_true(w->stats.overlap <= 1e-9);
        const double again = 0.5 * back * back / (pressure * h / sheet); // its energy goes on crushing
        if (away[i] < 1) CHECK_CLOSE(pose(w, 0)->x, start + again, 1e-6);
    }
    bt_world_free(w);
}

/// With restitution the floe rebounds once the limit bears it; it never comes back faster than e v, and crushing gives
/// no energy.
TEST(rebound_below_the_limit)
{
    const double h = 0.1, v = 2, e = 0.6, dt = 0.002, brake = pressure * h / sheet;
    bt_params p = params(dt);
    bt_world *w = bt_world_create(&p);
    add_square(w, 0, v, h);
    bt_idx wall = scene_wall(w, 0.5, -50, 5, 50, 0);
    w->bodies.restitution[wall] = e;
    double before = v, depth = 0;
    for (int s = 0; s < 100; s++) {
        bt_world_step(w);
        const double now = vel(w, 0)->x;
        assert_true(w->stats.contact_work <= 1e-12);
        if (before > 0) { // λ = min(m (1 + e) v, p h L Δt)
            CHECK_CLOSE(now, bt_max(-e * before, before - brake * dt), 1e-9);
            depth += bt_max(0, now) * dt;
        } else {
            CHECK_CLOSE(now, before, 0);
        }
        before = now;
    }
    assert_true(before < -1e-3 && depth > 0.01);
    assert_true(w->cells->cell[0].laws->n_memory == 1);
    for (int s = 0; s < 20000 && pose(w, 0)->x > -1.1 * BT_LAW_MEMORY; s++) bt_world_step(w);
    assert_true(w->cells->cell[0].laws->n_memory == 0); // parted, forgotten
    bt_world_free(w);
}

/// A body at a set speed presses a row of floes against a wall. Rigid, no force would do; here it is at most p h L of
/// the weakest.
TEST(body_at_a_set_speed)
{
    const double dt = 0.1, h = 0.1;
    bt_params p = params(dt);
    p.tolerance = 1e-9;
    bt_world *w = bt_world_create(&p);
    for (int k = 0; k < 4; k++) add_square(w, k, 0, k == 2 ? 0.5 * h : h);
    double o[8] = {-1, -1, 1, -1, 1, 1, -1, 1};
    bt_body_def d = {
        .motion = BT_KINEMATIC, .large = true, .n_vertices = 4, .vertices = o, .x = -1.5, .vx = 0.1, .mass = 1};
    bt_world_add(w, &d);
    scene_wall(w, 3.5, -50, 8, 50, 0);
    for (int s = 0; s < 20; s++) {
        bt_world_step(w);
        assert_true(w->stats.converged);
        if (s < 12) continue; // the floes are set in motion
        const bt_cell *t = w->cells->cell;
        for (bt_idx k = 0; k < w->cells->n; k++)
            for (bt_idx j = 0; j < t[k].n_contacts; j++)
                CHECK_CLOSE((t[k].contacts[j].ln[0] + t[k].contacts[j].ln[1]) / dt, 0.5 * pressure * h,
                            1e-4 * pressure * h);
        CHECK_CLOSE(scene_law(w, "crushed_work"), 0.5 * pressure * h * 0.1 * dt, 1e-6 * pressure * h);
    }
    // The thin floe's two sides share what is crushed.
    // The first floe is hit while others hold it: up to half its share of the limit of that step is crushed, 1/4 + ...
    assert_true(pose(w, 0)->x > 0.2 - 0.006 && pose(w, 0)->x < 0.2 + 1e-6);
    CHECK_CLOSE(pose(w, 3)->x, 3, 1e-6);
    assert_true(pose(w, 2)->x > 2 - 1e-6 && pose(w, 2)->x < 2.2 + 1e-6);
    bt_world_free(w);
}

/// A jam of floes that crush and raft, solved badly: whatever the impulses are, crushed ice does not grow back, and a
/// pair that has rafted measures its contact from the edges, not from what was crushed before.
TEST(laws_of_a_jam)
{
    const double h = 0.1, speed = 0.5;
    bt_params p = params(0.01);
    p.max_sweeps = 1; // far off, up to three times that
    double *own = p.law_own[BT_LAW_RAFTING];
    own[BT_RAFT_LINE] = 2 * pressure / h, own[BT_RAFT_SHEET] = own[BT_RAFT_RISE] = 1e3;
    bt_world *w = bt_world_create(&p);
    uint64_t seed = 1;
    for (int k = 0; k < 64; k++) {
        double v[16];
        const int n = scene_random_polygon(&seed, 0.45, v);
        const double x = k % 8 - 3.5, y = k / 8 - 3.5; // NOLINT(bugprone-integer-division): rows of eight
        const bt_idx floe = add_floe(w, n, v, x, y, 0, -speed * x, h);
        w->bodies.vel[floe].y = -speed * y, w->bodies.restitution[floe] = 0.5, w->bodies.friction[floe] = 0.3;
    }
    int crushed = 0, rafted = 0, unconverged = 0;
    for (int s = 0; s < 400; s++) {
        bt_world_step(w);
        unconverged += !w->stats.converged;
        for (bt_idx k = 0; k < w->cells->n; k++) {
            const bt_cell *t = &w->cells->cell[k];
            for (bt_idx j = 0; j < t->n_contacts; j++) {
                const bt_limit *l = &t->laws->limits[j];
                const bool rafts = l->record[BT_LAW_RAFTING] >= 0;
                for (int i = 0; i < t->contacts[j].n; i++) {
                    assert_true(l->grown[i] >= 0);
                    if (rafts) assert_true(l->rise->depth[i] <= l->grown[i]);
                    crushed += l->grown[i] > 0, rafted += rafts;
                }
            }
        }
    }
    assert_true(crushed > 100 && rafted > 100 && unconverged > 50);
    bt_world_free(w);
}

/// A floe in two parts crushes against a wall. What one part crushed stands open to the other too: a contact that finds
/// no point of its own in the records goes by the deepest of them.
TEST(parts_share_their_dent)
{
    bt_params p = params(1e-3);
    bt_world *w = bt_world_create(&p);
    double v[] = {0.5, -1, 0.5, -0.1, 0, 0, 0.5, 0.1, 0.5, 1, -0.5, 1, -0.5, -1};
    bt_parts parts;
    bt_body_def d = scene_prism(7, v, sheet);
    assert_true(bt_outline_split(7, v, &parts));
    d.parts = &parts, d.vx = 2, d.thickness = 0.1;
    bt_world_add(w, &d);
    scene_wall(w, v[0], -50, 5, 50, 0);
    for (int s = 0; s < 200; s++) bt_world_step(w);
    const double deep = pose(w, 0)->x;
    bt_law_state *laws = w->cells->cell[0].laws;
    assert_true(deep > 0.02 && laws->n_memory == 2);
    for (int k = 0; k < 2; k++)
        for (int i = 0; i < 2; i++) laws->memory[k].feature[i] = 1000, laws->memory[k].value[i] /= 1 + k;
    vel(w, 0)->x = 1e-9;
    w->bodies.disturbed[bt_world_index(w, 0)] = 1;
    w->cells->asleep[0] = BT_AWAKE;
    bt_cells_wake(w->cells, 0);
    for (int s = 0; s < 5; s++) {
        bt_world_step(w);
        assert_true(w->stats.overlap <= 1e-9);
    }
    CHECK_CLOSE(pose(w, 0)->x, deep, 1e-6);
    bt_world_free(w);
}

/// A right-angled corner runs into a wall. The cuts from notches at the far side end at it, so that the parts found
/// there share it: it bears k y, k = 2 p h tan(φ/2), and is crushed v √(m/k) deep as if there were no cut.
TEST(a_corner_bears_with_all_parts_that_share_it)
{
    double outlines[3][18] = {{-0.5, -1, 0.5, 0, -0.5, 1},
                              {-0.5, -1, 0.5, 0, -0.5, 1, -0.1, 0},
                              {-0.5, -1, 0.5, 0, -0.5, 1, -0.5, 0.5, -0.2, 0.3, -0.5, 0.2, -0.5, -0.2, -0.2, -0.3, -0.5,
                               -0.5}};
    const int corners[] = {3, 4, 9}, n_parts[] = {1, 2, 3};
    const double v = 0.5, h = 0.1, k = 2 * pressure * h;
    for (int i = 0; i < 3; i++)
        for (int long_step = 0; long_step < 2; long_step++) {
            bt_params p = params(long_step ? 0.1 : 1e-3);
            p.law_own[BT_LAW_CRUSHING][BT_CRUSH_LEAST] = 0;
            bt_world *w = bt_world_create(&p);
            double outline[18];
            memcpy(outline, outlines[i], sizeof outline);
            bt_body_def d = scene_prism(corners[i], outline, sheet);
            bt_parts parts;
            if (i > 0) {
                assert_true(bt_outline_split(corners[i], outline, &parts));
                d.parts = &parts;
                assert_int_equal(parts.n, n_parts[i]);
            }
            d.vx = v, d.thickness = h;
            bt_world_add(w, &d);
            scene_wall(w, outline[2], -50, 5, 50, 0);
            for (int s = 0; s < (long_step ? 10 : 500); s++) bt_world_step(w);
            CHECK_CLOSE(pose(w, 0)->x, v * sqrt(sheet * bt_shape_moments(corners[i], outline).area / k), 3e-4);
            bt_world_free(w);
        }
}

/// A corner comes through one part of a floe to the cut behind it. The part beyond has its outline elsewhere: it bears
/// nothing there, and the floe turns on the corner as one without the cut.
TEST(a_corner_that_reaches_a_cut)
{
    const bt_parts parts = {.n = 2, .count = {3, 3}, .n_vertices = 6, .corner = {1, 2, 3, 1, 3, 0}};
    bt_pose end[2];
    for (int cut = 0; cut < 2; cut++) {
        bt_params p = params(2e-3);
        p.slop = 1e-3, p.law_own[BT_LAW_CRUSHING][BT_CRUSH_LEAST] = 1;
        bt_world *w = bt_world_create(&p);
        double fixed[] = {0, 0, 2.49, -8.65, 9, 0, 6.4, 6.33}, v[] = {-0.99, -0.32, -0.018, -0.083, -0.255, 0.889,
                                                                      -1.227, 0.652};
        bt_moments m = bt_shape_centre(4, fixed);
        bt_world_add(w, &(bt_body_def){.motion = BT_STATIC, .n_vertices = 4, .vertices = fixed, .x = m.cx, .y = m.cy});
        m = bt_shape_centre(4, v);
        bt_body_def d = scene_prism(4, v, sheet);
        d.x = m.cx, d.y = m.cy, d.vx = 1.44, d.thickness = 0.1, d.parts = cut ? &parts : NULL;
        bt_world_add(w, &d);
        for (int s = 0; s < 500; s++) {
            bt_world_step(w);
            assert_true(w->stats.overlap < 2e-3);
        }
        end[cut] = *pose(w, 1);
        bt_world_free(w);
    }
    CHECK_CLOSE(end[1].x, end[0].x, 0.01);
    CHECK_CLOSE(end[1].y, end[0].y, 0.01);
    CHECK_CLOSE(end[1].yaw, end[0].yaw, 0.01);
}

/// A quay whose face is x = 0, in rectangles from y to y, m.
static void add_quay(bt_world *w, int n, const double (*from_to)[2])
{
    for (int i = 0; i < n; i++) {
        const double half = 0.5 * (from_to[i][1] - from_to[i][0]);
        double v[] = {-2, -half, 2, -half, 2, half, -2, half};
        const bt_body_def d = {.motion = BT_STATIC, .n_vertices = 4, .vertices = v, .x = 2,
                               .y = 0.5 * (from_to[i][0] + from_to[i][1])};
        bt_world_add(w, &d);
    }
    bt_shore_create(w);
}

typedef struct {
    int n;
    double from_to[4][2];
} quay;

static const quay quays[] = {
    {1, {{-9, 9}}},                                          // whole
    {2, {{-9, 0}, {0, 9}}},                                  // flush
    {2, {{0, 9}, {-9, 0}}},                                  // in the other order
    {4, {{-9, -0.3}, {-0.3, 0}, {0, 0.2}, {0.2, 9}}},        // with short pieces
    {2, {{-9, 0.25}, {-0.25, 9}}},                           // overlapping
    {3, {{-9, 0.4}, {-0.4, 9}, {-0.2, 0.3}}},                // three times in places
    {2, {{-9, -0.497}, {-0.497, 9}}},                        // at the end of the face, where points are merged
    {2, {{-0.497, 9}, {-9, -0.497}}},
};
enum { QUAYS = sizeof quays / sizeof *quays };

/// A floe runs into a quay in pieces, face on, then with a corner at a seam. It stops as deep as at a whole one, at
/// m v²/(2 p h L) and v √(m/k), and does not turn.
TEST(a_quay_in_pieces_bears_like_a_whole_one)
{
    const double h = 0.1, speed = 0.5, face = sheet * speed * speed / (2 * pressure * h),
                 corner = speed * sqrt(sheet / (2 * pressure * h));
    for (int i = 0; i < QUAYS; i++)
        for (int k = 0; k < 4; k++) {
            const bool long_step = k & 1, by_corner = k & 2;
            bt_params p = params(long_step ? 0.2 : 2e-3);
            p.law_own[BT_LAW_CRUSHING][BT_CRUSH_LEAST] = 0;
            bt_world *w = bt_world_create(&p);
            add_quay(w, quays[i].n, quays[i].from_to);
            double v[8];
            scene_square(1, v);
            const double half = by_corner ? sqrt(0.5) : 0.5;
            const bt_gid floe = quays[i].n;
            add_floe(w, 4, v, -half, 0, by_corner ? 0.25 * BT_PI : 0, speed, h);
            for (int s = 0; s < (long_step ? 10 : 300); s++) bt_world_step(w);
            const double depth = by_corner ? corner : face;
            CHECK_CLOSE(pose(w, floe)->x, -half + depth, 5e-3 * depth);
            CHECK_CLOSE(pose(w, floe)->yaw - (by_corner ? 0.25 * BT_PI : 0), 0, 1e-3);
            assert_true(w->stats.overlap <= 1e-3 * depth);
            bt_world_free(w);
        }
}

/// A crushed corner slides along the quay, over its seams, and stays as deep as it is.
TEST(a_dent_goes_with_the_corner_from_piece_to_piece)
{
    const double h = 0.1;
    bt_pose whole = {0};
    for (int i = 0; i < QUAYS; i++) {
        bt_params p = params(0.02);
        bt_world *w = bt_world_create(&p);
        add_quay(w, quays[i].n, quays[i].from_to);
        double v[8];
        scene_square(1, v);
        const bt_gid floe = quays[i].n;
        add_floe(w, 4, v, -sqrt(0.5), -0.6, 0.25 * BT_PI, 0.5, h);
        vel(w, floe)->y = 0.4;
        for (int s = 0; s < 100; s++) {
            bt_world_step(w);
            assert_true(w->stats.overlap <= 1e-9);
        }
        if (i == 0) whole = *pose(w, floe);
        assert_true(pose(w, floe)->y > 0.1);
        CHECK_CLOSE(pose(w, floe)->x, whole.x, 1e-4);
        CHECK_CLOSE(pose(w, floe)->yaw, whole.yaw, 1e-4);
        bt_world_free(w);
    }
}

/// A round floe with a deep notch at its far side has several parts, some of which only overlap the wall deeper in.
/// It is crushed as deep as a floe without a notch that has the same mass.
TEST(parts_that_touch_deeper_in_bear_too)
{
    enum { N = 16 };
    for (int long_step = 0; long_step < 2; long_step++) {
        double depth[2], area = 0;
        for (int notch = 0; notch < 2; notch++) {
            bt_params p = params(long_step ? 0.1 : 2e-3);
            p.law_own[BT_LAW_CRUSHING][BT_CRUSH_LEAST] = 0;
            bt_world *w = bt_world_create(&p);
            double v[2 * N];
            for (int i = 0; i < N; i++) v[2 * i] = cos(2 * BT_PI * i / N), v[2 * i + 1] = sin(2 * BT_PI * i / N);
            if (notch) v[N] = 0.2, v[N + 1] = 0;
            const double own = bt_shape_moments(N, v).area;
            if (!notch) area = own;
            bt_body_def d = scene_prism(N, v, sheet * area / own);
            bt_parts parts;
            if (notch) {
                assert_true(bt_outline_split(N, v, &parts));
                d.parts = &parts;
            }
            d.vx = 0.5, d.thickness = 0.1;
            bt_world_add(w, &d);
            scene_wall(w, v[0], -50, 5, 50, 0);
            for (int s = 0; s < (long_step ? 10 : 400); s++) bt_world_step(w);
            depth[notch] = pose(w, 0)->x;
            bt_world_free(w);
        }
        assert_true(depth[0] > 0.03);
        CHECK_CLOSE(depth[1], depth[0], 0.01 * depth[0]);
    }
}

/// Between two quays in pieces, one in front and one behind, a floe crushes the one that it runs into as if the other
/// were not there, whichever is first in the list.
TEST(a_quay_behind_changes_nothing)
{
    const double h = 0.1, speed = 0.5, depth = sheet * speed * speed / (2 * pressure * h);
    for (int behind_first = 0; behind_first < 2; behind_first++) {
        bt_params p = params(0.02);
        p.law_own[BT_LAW_CRUSHING][BT_CRUSH_LEAST] = 0;
        bt_world *w = bt_world_create(&p);
        for (int i = 0; i < 4; i++) {
            const bool behind = i / 2 != behind_first;
            double v[] = {-2, -4, 2, -4, 2, 4, -2, 4};
            const bt_body_def d = {.motion = BT_STATIC, .n_vertices = 4, .vertices = v, .x = behind ? -3 : 2,
                                   .y = i % 2 ? 4.1 : -3.9};
            bt_world_add(w, &d);
        }
        bt_shore_create(w);
        const bt_gid floe = 4;
        double v[8];
        scene_square(1, v);
        add_floe(w, 4, v, -0.5, 0, 0, speed, h);
        for (int s = 0; s < 50; s++) bt_world_step(w);
        CHECK_CLOSE(pose(w, floe)->x, -0.5 + depth, 5e-3 * depth);
        CHECK_CLOSE(pose(w, floe)->yaw, 0, 1e-3);
        bt_world_free(w);
    }
}

/// A face strikes two piers at once, 2 m apart: each pier is a face of its own, in one piece or two.
TEST(two_piers_bear_apart)
{
    const double speed = 0.25, side = 4, h = 0.1, off = 0.02;
    // m v²/2 = p h (d + max(0, d − off)) for two faces of 1 m, with d from the nearer pier
    const double energy = 0.5 * sheet * 10 * side * side * speed * speed;
    double end[2];
    for (int halves = 0; halves < 2; halves++) {
        bt_params p = params(2);
        p.law_own[BT_LAW_CRUSHING][BT_CRUSH_LEAST] = 0;
        bt_world *w = bt_world_create(&p);
        bt_gid floe = 0;
        for (int pier = 0; pier < 2; pier++)
            for (int i = 0; i <= halves; i++, floe++) {
                const double wide = halves ? 0.5 : 1, from = 0.5 * side + off * pier;
                double v[] = {0, 0, 1, 0, 1, wide, 0, wide};
                const bt_moments m = bt_shape_centre(4, v);
                bt_world_add(w, &(bt_body_def){.motion = BT_STATIC, .n_vertices = 4, .vertices = v,
                                               .x = from + m.cx, .y = (pier ? -2 : 1) + wide * i + m.cy});
            }
        bt_shore_create(w);
        double v[8];
        scene_square(side, v);
        bt_body_def d = scene_prism(4, v, 10 * sheet);
        d.vx = speed, d.thickness = h;
        bt_world_add(w, &d);
        for (int s = 0; s < 4; s++) bt_world_step(w);
        end[halves] = pose(w, floe)->x;
        bt_world_free(w);
    }
    CHECK_CLOSE(end[0], energy / (2 * pressure * h) + 0.5 * off, 0.01 * end[0]);
    CHECK_CLOSE(end[1], end[0], 0.01 * end[0]);
}

/// Crushed ice is no outline: a floe that has been drawn back from its dent flies past without load.
TEST(past_a_dent_without_load)
{
    bt_params p = params(0.05);
    p.slop = 1e-3, p.law_own[BT_LAW_CRUSHING][BT_CRUSH_LEAST] = 0;
    bt_world *w = bt_world_create(&p);
    double v[8];
    scene_square(1, v);
    bt_world_add(w, &(bt_body_def){.motion = BT_STATIC, .n_vertices = 4, .vertices = v});
    add_floe(w, 4, v, 0.5 + sqrt(0.5), 0.3, 0.25 * BT_PI, -1, 0.1);
    for (int s = 0; s < 20; s++) bt_world_step(w);
    const double deep = 0.5 + sqrt(0.5) - pose(w, 1)->x;
    assert_true(deep > 0.05);
    *vel(w, 1) = (bt_vel){.x = deep + 0.05};
    for (int s = 0; s < 20; s++) bt_world_step(w);
    *vel(w, 1) = (bt_vel){.x = -7, .y = 70};
    bt_world_step(w);
    assert_true(vel(w, 1)->x == -7 && vel(w, 1)->y == 70 && vel(w, 1)->w == 0);
    bt_world_free(w);
}

/// Two pieces that fill a period meet at two seams. A floe is crushed alike at both.
TEST(both_seams_of_a_period_bear_alike)
{
    const double h = 0.1, speed = 0.5, depth = sheet * speed * speed / (2 * pressure * h);
    for (int seam = 0; seam < 2; seam++) {
        bt_params p = params(0.02);
        p.law_own[BT_LAW_CRUSHING][BT_CRUSH_LEAST] = 0;
        p.period_y = 16;
        bt_world *w = bt_world_create(&p);
        add_quay(w, 2, (const double[2][2]){{-8, 0}, {0, 8}});
        double v[8];
        scene_square(1, v);
        add_floe(w, 4, v, -0.5, 8 * seam, 0, speed, h);
        for (int s = 0; s < 50; s++) bt_world_step(w);
        CHECK_CLOSE(pose(w, 2)->x, -0.5 + depth, 5e-3 * depth);
        CHECK_CLOSE(pose(w, 2)->yaw, 0, 1e-3);
        bt_world_free(w);
    }
}

/// The corner of a floe runs into a bay of two faces so shallow that their contacts are one. The dent is as deep as the
/// work says, p h times its area, and the corner is not thrown out of it.
TEST(a_corner_in_a_shallow_bay_stays)
{
    const double h = 0.1, tilt = tan(BT_PI / 60);
    bt_params p = params(0.02);
    p.law_own[BT_LAW_CRUSHING][BT_CRUSH_LEAST] = 0;
    bt_world *w = bt_world_create(&p);
    for (int side = -1; side <= 1; side += 2) {
        double v[] = {0, 0, 4, 0, 4, 4, -4 * tilt, 4};
        if (side < 0) {
            const double lower[] = {0, 0, -4 * tilt, -4, 4, -4, 4, 0};
            memcpy(v, lower, sizeof v);
        }
        const bt_moments m = bt_shape_centre(4, v);
        const bt_body_def d = {.motion = BT_STATIC, .n_vertices = 4, .vertices = v, .x = m.cx, .y = m.cy};
        bt_world_add(w, &d);
    }
    bt_shore_create(w);
    double v[8];
    scene_square(1, v);
    add_floe(w, 4, v, -sqrt(0.5), 0, 0.25 * BT_PI, 0.8, h);
    double before = -sqrt(0.5);
    for (int s = 0; s < 50; s++) {
        bt_world_step(w);
        CHECK_CLOSE(pose(w, 2)->x, before + p.dt * vel(w, 2)->x, 1e-3);
        before = pose(w, 2)->x;
    }
    // a right angle between faces at 90° − 3°: k = 2 p h / (1 − tan 3°) on the depth from the bottom of the bay
    const double depth = 0.8 * sqrt(sheet * (1 - tilt) / (2 * pressure * h));
    CHECK_CLOSE(before + sqrt(0.5), depth, 0.05 * depth);
    bt_world_free(w);
}

/// A blunt corner bears on the least length. A seam beside it, which the floe touches only deeper in, takes none of it.
TEST(a_seam_beside_a_corner_leaves_it_the_least_length)
{
    static const quay beside[] = {{1, {{-9, 9}}}, {2, {{-9, 0.03}, {0.03, 9}}}, {2, {{-9, -0.03}, {-0.03, 9}}}};
    enum { N = 6 };
    double depth[3];
    for (int i = 0; i < 3; i++) {
        bt_params p = params(0.2);
        p.law_own[BT_LAW_CRUSHING][BT_CRUSH_LEAST] = 1;
        bt_world *w = bt_world_create(&p);
        add_quay(w, beside[i].n, beside[i].from_to);
        double v[2 * N];
        for (int k = 0; k < N; k++)
            v[2 * k] = 0.5 * cos(2 * BT_PI * k / N), v[2 * k + 1] = 0.5 * sin(2 * BT_PI * k / N);
        const bt_gid floe = beside[i].n;
        add_floe(w, N, v, -0.5, 0, 0, 0.5, 0.1);
        for (int s = 0; s < 10; s++) bt_world_step(w);
        depth[i] = pose(w, floe)->x + 0.5;
        bt_world_free(w);
    }
    assert_true(depth[0] > 0.01);
    for (int i = 1; i < 3; i++) CHECK_CLOSE(depth[i], depth[0], 0.02 * depth[0]);
}

/// A corner strikes a quay some millimetres beside a seam: v √(m/k) deep, as if there were none.
TEST(a_corner_beside_a_seam_bears_as_elsewhere)
{
    const double h = 0.1, speed = 0.5, depth = speed * sqrt(sheet / (2 * pressure * h)), beside[] = {5e-4, 2e-3, 7e-3};
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++) {
            const double steps[] = {1e-3, 0.02, 0.1};
            bt_params p = params(steps[k]);
            p.slop = 1e-3, p.law_own[BT_LAW_CRUSHING][BT_CRUSH_LEAST] = 0;
            bt_world *w = bt_world_create(&p);
            add_quay(w, 2, (const double[2][2]){{-9, beside[i]}, {beside[i], 9}});
            double v[8];
            scene_square(1, v);
            add_floe(w, 4, v, -sqrt(0.5), 0, 0.25 * BT_PI, speed, h);
            for (int s = 0; s < 0.6 / p.dt; s++) bt_world_step(w);
            CHECK_CLOSE(pose(w, 2)->x + sqrt(0.5), depth, 2e-3 * depth);
            bt_world_free(w);
        }
}

/// A corner that has crushed its way in slides over an oblique seam: the dent stays open, where the piece behind it has
/// nothing on it any more that can be touched.
TEST(a_dent_stays_open_past_an_oblique_seam)
{
    const double piece[][8] = {{0, -9, 6, -9, 6, -8.0774, 0, -0.2086}, {0, -0.2086, 6, -8.0774, 6, -8.0294, 0, 0.1317},
                               {0, 0.1317, 6, -8.0294, 6, 9, 0, 9}, {0, -9, 6, -9, 6, 9, 0, 9}};
    const double outline[] = {-0.5663, 0.4712,  -1.0319, 0.2794, -1.1875, -0.0542, -0.8493,
                              -0.3720, -0.2974, -0.2848, -0.0142, 0.0741, -0.1495, 0.3706};
    double end[2][2];
    for (int whole = 0; whole < 2; whole++) {
        bt_params p = params(2e-3);
        p.slop = 1e-3, p.law_own[BT_LAW_CRUSHING][BT_CRUSH_LEAST] = 0;
        bt_world *w = bt_world_create(&p);
        for (int i = whole ? 3 : 0; i < (whole ? 4 : 3); i++) {
            double v[8];
            memcpy(v, piece[i], sizeof v);
            const bt_moments m = bt_shape_centre(4, v);
            bt_world_add(w, &(bt_body_def){.motion = BT_STATIC, .n_vertices = 4, .vertices = v, .x = m.cx, .y = m.cy});
        }
        bt_shore_create(w);
        double v[14];
        memcpy(v, outline, sizeof v);
        const bt_moments at = bt_shape_centre(7, v);
        const bt_gid floe = whole ? 1 : 3;
        add_floe(w, 7, v, at.cx, at.cy, 0, 0.631, 0.1);
        w->bodies.vel[bt_world_index(w, floe)].y = 0.403;
        for (int s = 0; s < 500; s++) {
            bt_world_step(w);
            assert_true(w->stats.overlap < 2e-3);
        }
        end[whole][0] = pose(w, floe)->x, end[whole][1] = pose(w, floe)->y;
        bt_world_free(w);
    }
    for (int i = 0; i < 2; i++) CHECK_CLOSE(end[0][i], end[1][i], 2e-3);
}

/// A turning block ploughs along a quay at a long step. Where its corner comes over a seam, the next piece has no
/// record of the dent yet, and the position projection must not push the block out of it.
TEST(a_corner_ploughs_over_a_seam)
{
    const double seams[] = {9, -1.2, -1.4, -1.6, -1.8};
    double end[5];
    for (int i = 0; i < 5; i++) {
        bt_params p = params(0.1);
        p.slop = 1e-3, p.tilt_ax = 0.2, p.tilt_ay = -0.5;
        p.law_own[BT_LAW_CRUSHING][BT_CRUSH_PRESSURE] = 2e3, p.law_own[BT_LAW_CRUSHING][BT_CRUSH_LEAST] = 0.1;
        bt_world *w = bt_world_create(&p);
        for (int piece = 0; piece < (i > 0 ? 2 : 1); piece++) {
            const double from = piece ? seams[i] : -9, to = piece ? 9 : seams[i];
            double v[] = {from, -2, to, -2, to, 0, from, 0};
            const bt_moments m = bt_shape_centre(4, v);
            bt_world_add(w, &(bt_body_def){.motion = BT_STATIC, .n_vertices = 4, .vertices = v,
                                           .x = m.cx, .y = m.cy});
        }
        bt_shore_create(w);
        double v[] = {-0.77, -0.44, 0.77, -0.44, 0.77, 0.44, -0.77, 0.44};
        bt_body_def d = scene_prism(4, v, 900);
        d.x = -3.78, d.y = 1.43, d.yaw = 4.863, d.vx = 1.25, d.vy = -0.757, d.yaw_rate = -0.36;
        d.thickness = 1, d.friction = 0.2;
        const bt_gid block = bt_world_add(w, &d);
        for (int s = 0; s < 30; s++) {
            const double before = pose(w, block)->y;
            bt_world_step(w);
            assert_true(pose(w, block)->y < before + 0.01);
        }
        end[i] = pose(w, block)->y;
        bt_world_free(w);
        CHECK_CLOSE(end[i], end[0], 0.05);
    }
}

/// A tilted face that turns on a quay until it lies flush bears at its ends, not at the seams between them, and ends as
/// on a quay in one piece. The second corner to come bears no share of the first, whose ice is gone.
TEST(a_tilted_face_turns_about_its_ends)
{
    const double yaw[] = {0.08, 0.3};
    for (int tilt = 0; tilt < 2; tilt++) {
        bt_pose whole = {0};
        double work[QUAYS] = {0}, most[QUAYS] = {0};
        for (int i = 0; i < QUAYS; i++) {
            bt_params p = params(tilt ? 2e-3 : 5e-3);
            p.law_own[BT_LAW_CRUSHING][BT_CRUSH_LEAST] = 0;
            bt_world *w = bt_world_create(&p);
            add_quay(w, quays[i].n, quays[i].from_to);
            double v[8];
            scene_square(1, v);
            const bt_gid floe = quays[i].n;
            add_floe(w, 4, v, -0.5 * (cos(yaw[tilt]) + sin(yaw[tilt])), 0.05, yaw[tilt], 0.5, 0.1);
            for (int s = 0; s < 300; s++) {
                bt_world_step(w);
                work[i] += scene_law(w, "crushed_work");
                most[i] = bt_max(most[i], pushed(w) / p.dt);
            }
            if (i == 0) whole = *pose(w, floe);
            CHECK_CLOSE(work[i], work[0], 0.01 * work[0]);
            CHECK_CLOSE(most[i], most[0], 0.1 * most[0]);
            CHECK_CLOSE(pose(w, floe)->x, whole.x, 2e-3);
            CHECK_CLOSE(pose(w, floe)->yaw, whole.yaw, 5e-3);
            bt_world_free(w);
        }
    }
}

/// A quay stands closely behind a narrower one. A floe that crushes the first reaches the second, which then bears only
/// beside the first: p h times the width of the floe from there on, whichever is first in the list.
TEST(a_piece_behind_another_adds_only_what_it_shows)
{
    const double h = 0.1, speed = 2, behind = 0.01, width = 0.94, energy = 0.5 * sheet * speed * speed / (pressure * h),
                 depth = energy + behind * (1 - width);
    for (int i = 0; i < 4; i++) {
        const bool behind_first = i & 1;
        bt_params p = params(i & 2 ? 0.02 : 0.002);
        p.law_own[BT_LAW_CRUSHING][BT_CRUSH_LEAST] = 0;
        bt_world *w = bt_world_create(&p);
        for (int k = 0; k < 4; k++) {
            const bool back = k / 2 != behind_first;
            const double half = back ? 2 : 0.25 * width, thick = back ? 2 : 5e-3;
            double v[] = {-thick, -half, thick, -half, thick, half, -thick, half};
            const bt_body_def d = {.motion = BT_STATIC, .n_vertices = 4, .vertices = v,
                                   .x = thick + (back ? behind : 0), .y = k % 2 ? half : -half};
            bt_world_add(w, &d);
        }
        bt_shore_create(w);
        double v[8];
        scene_square(1, v);
        add_floe(w, 4, v, -0.5, 0, 0, speed, h);
        for (int s = 0; s < (i & 2 ? 20 : 100); s++) bt_world_step(w);
        CHECK_CLOSE(pose(w, 4)->x, -0.5 + depth, 0.02 * depth);
        CHECK_CLOSE(pose(w, 4)->yaw, 0, 1e-3);
        bt_world_free(w);
    }
}

/// A round floe in parts comes in so fast that a step takes it past its next corners, Δt √(k/m) = 3. They bear only
/// from where they touch: the dent is as deep as in short steps.
TEST(parts_reached_within_the_step)
{
    enum { N = 32 };
    double depth[2];
    for (int i = 0; i < 2; i++) {
        double v[2 * N];
        for (int k = 0; k < N; k++) v[2 * k] = cos(2 * BT_PI * k / N), v[2 * k + 1] = sin(2 * BT_PI * k / N);
        v[N] = 0.2, v[N + 1] = 0;
        bt_parts parts;
        bt_body_def d = scene_prism(N, v, sheet);
        assert_true(bt_outline_split(N, v, &parts));
        const double k = 2 * pressure * 0.1 * tan(BT_PI / 2 - BT_PI / N);
        bt_params p = params((i ? 3 : 0.01) * sqrt(d.mass / k));
        p.law_own[BT_LAW_CRUSHING][BT_CRUSH_LEAST] = 0;
        bt_world *w = bt_world_create(&p);
        d.parts = &parts, d.vx = 0.75, d.thickness = 0.1;
        bt_world_add(w, &d);
        scene_wall(w, v[0], -50, 5, 50, 0);
        for (int s = 0; s < (i ? 10 : 1000); s++) bt_world_step(w);
        depth[i] = pose(w, 0)->x;
        bt_world_free(w);
    }
    assert_true(depth[0] > 0.03);
    CHECK_CLOSE(depth[1], depth[0], 0.12 * depth[0]);
}

TEST_MAIN(NULL, NULL)
