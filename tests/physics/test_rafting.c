// SPDX-License-Identifier: MIT
// Floes that slide over each other, against closed forms: the load on two squares pushed together and apart, a row of
// floes, a plough, momentum and energy.
//
// What turns these tests red: the moment of the gradient with the other sign, a largest area that is forgotten,
// friction of the largest area instead of the present one, sides that lie on each other and push, a towed body that
// rafts, a projection that takes rafted overlap back. Each was tried.
#include "scene.h"

#include "contact/overlap.h"
#include "contact/raft.h"
#include "output/observe.h"

static const double ice = 910, water = 1027, gravity = 9.81, kappa = 8, mu = 0.3, h = 1;

static double rise(void) { return ice * (1 - ice / water) * gravity; }                             // Pa/m
static double edge_load(void) { return kappa * 0.5 * ice * (1 - ice / water) * gravity * h * h; } // N/m
static double sheet_load(void) { return mu * (water - ice) * gravity * h; }                        // N/m²

static bt_params params(double dt)
{
    bt_params p = scene_params(dt, 10);
    p.slop = 0.01;
    p.tolerance = 1e-8;
    double *own = p.law_own[BT_LAW_RAFTING];
    own[BT_RAFT_LINE] = kappa * 0.5 * rise(), own[BT_RAFT_RISE] = rise(), own[BT_RAFT_SHEET] = (water - ice) * gravity;
    own[BT_RAFT_FREEBOARD] = 1 - ice / water;
    return p;
}

static bt_gid add(bt_world *w, bt_motion motion, int n, double *v, double x, double y, double yaw, double thickness)
{
    bt_body_def d = scene_prism(n, v, ice * (thickness > 0 ? thickness : 1));
    d.motion = motion;
    d.x = x, d.y = y, d.yaw = yaw;
    d.thickness = thickness;
    d.friction = thickness > 0 ? mu : 0;
    return bt_world_add(w, &d);
}

static bt_gid add_box(bt_world *w, bt_motion motion, double length, double width, double x, double y, double thickness)
{
    double v[8] = {0, 0, length, 0, length, width, 0, width};
    return add(w, motion, 4, v, x, y, 0, thickness);
}

/// At rest whatever presses, and yet a floe: one that is fixed does not raft.
static const bt_motion HELD = BT_KINEMATIC;

static bt_vel *vel(bt_world *w, bt_gid g) { return &w->bodies.vel[bt_world_index(w, g)]; }
static bt_pose *pose(bt_world *w, bt_gid g) { return &w->bodies.pose[bt_world_index(w, g)]; }

static void set_speed(bt_world *w, bt_gid g, double x)
{
    vel(w, g)->x = x;
    w->bodies.disturbed[bt_world_index(w, g)] = 1;
    w->cells->relabel = true; // it may lie in a cell that rests
}

/// Sum of the normal impulses on body g over dt, N.
static double load_on(const bt_world *w, bt_gid g)
{
    double sum = 0;
    for (bt_idx k = 0; k < w->cells->n; k++)
        for (bt_idx j = 0; j < w->cells->cell[k].n_contacts; j++) {
            const bt_contact *u = &w->cells->cell[k].contacts[j];
            if (w->bodies.gid[u->a] == g || w->bodies.gid[u->b] == g) sum += u->ln[0] + u->ln[1];
        }
    return sum / w->par.dt;
}

/// What a step must not break: momentum, work, the size of what is booked.
static void check_step(const bt_world *w)
{
    const bt_step_stats *st = &w->stats;
    assert_true(st->converged);
    assert_true(st->momentum_residual < 1e-9);
    assert_true(st->contact_work <= 1e-6 * (1 + fabs(st->contact_work)));
    // Work is by the mean of the speeds without contacts and with them: an edge that would part, and that another
    // contact presses to its bound, gives a little. What an edge that is held at its bound gives, sheets take.
    const double taken = scene_law(w, "raft_edge_work") + scene_law(w, "raft_friction_work");
    assert_true(taken >= -1e-3 * fabs(st->contact_work) - 1e-9);
}

/// A plate pushes a square of side a onto one that is held, F(d) = q0 a + μ (ρ_w − ρ_i) g h a d, also when it is more
/// than half under; another pushes it back, where friction alone resists; pushed again it meets the edge at the depth
/// where it was. Walls without friction guide it, closer than a slop, or it would give way to a side.
TEST(two_squares)
{
    const double a = 10, v = 0.05, dt = 0.1;
    bt_params p = params(dt);
    bt_world *w = bt_world_create(&p);
    const bt_gid held = add_box(w, HELD, a, a, -0.5 * a, 0, h);
    const bt_gid floe = add_box(w, BT_DYNAMIC, a, a, 0.5 * a + 0.02, 1e-6, h); // sides that all but lie on each other
    scene_wall(w, -2 * a, 0.5 * a + 1e-5, 2 * a, 2 * a, 0);
    scene_wall(w, -2 * a, -2 * a, 2 * a, -0.5 * a - 1e-5, 0);
    const bt_gid right = add_box(w, BT_KINEMATIC, 1, 4, a + 0.55, 0, 0),
                 left = add_box(w, BT_KINEMATIC, 1, 4, -9.5, 0, 0);
    set_speed(w, right, -v);
    double work = 0, edge = 0, friction = 0, depth = 0;
    while (depth < 0.8 * a) {
        bt_world_step(w);
        check_step(w);
        const double f = load_on(w, right);
        depth = 0.5 * a - pose(w, floe)->x;
        if (depth > 0) work += f * v * dt;
        edge += scene_law(w, "raft_edge_work"), friction += scene_law(w, "raft_friction_work");
        if (depth > 0.1) CHECK_CLOSE(f, a * (edge_load() + sheet_load() * (depth - v * dt)), 0.002 * f);
        if (depth > 0.1) CHECK_CLOSE(scene_law(w, "rafted_area"), a * (depth - v * dt), 1e-5 * a);
        assert_true(w->stats.overlap < 0.02);
        double force[16] = {0};
        bt_observe_contact_force(w, force);
        if (depth > 0.1) CHECK_CLOSE(force[bt_world_index(w, held)], a * edge_load(), 0.002 * f); // without friction
    }
    CHECK_CLOSE(edge, edge_load() * a * depth, 0.01 * edge);
    CHECK_CLOSE(friction, 0.5 * sheet_load() * a * depth * depth, 0.01 * friction);
    CHECK_CLOSE(edge + friction, work, 0.01 * work);
    CHECK_CLOSE(scene_law(w, "rafted_energy"), rise() * h * h * a * depth, 0.01 * scene_law(w, "rafted_energy"));
    CHECK_CLOSE(pose(w, floe)->y, 0, 2e-5);
    // Back: friction alone.
    set_speed(w, right, 0.08);
    set_speed(w, left, v);
    const double deepest = depth;
    int touched = 0; // steps: the first ones set the floe in motion
    for (int s = 0; s < 800; s++) {
        bt_world_step(w);
        check_step(w);
        depth = 0.5 * a - pose(w, floe)->x;
        if (touched > 3)
            CHECK_CLOSE(load_on(w, left), a * sheet_load() * (depth + v * dt), 0.002 * a * sheet_load() * depth);
        if (touched > 3) assert_true(scene_law(w, "raft_edge_work") == 0);
        touched += load_on(w, left) > 0;
    }
    assert_true(deepest - depth > 2);
    // In again: the edge bears nothing until it is where it was.
    set_speed(w, left, -0.5);
    set_speed(w, right, -v);
    touched = 0;
    for (int s = 0; s < 4000 && depth < deepest + 1; s++) {
        bt_world_step(w);
        check_step(w);
        depth = 0.5 * a - pose(w, floe)->x;
        const double f = load_on(w, right), sheets = a * sheet_load() * depth;
        touched += f > 0;
        if (touched > 3 && depth < deepest - 0.1) CHECK_CLOSE(f, sheets, 0.01 * sheets);
        if (depth > deepest + 0.1) CHECK_CLOSE(f, sheets + a * edge_load(), 0.01 * f);
    }
    assert_true(depth >= deepest + 1);
    bt_world_free(w);
}

/// A corner meets an edge while the next one is far from it. A fast floe in the neighbourhood makes the search look
/// farther ahead and find that corner, too, which must not change what the first one bears: the line load on a length
/// of one thickness.
TEST(the_margin_of_the_search)
{
    const double dt = 1e-4, yaw = 0.03, corner = 0.5 * (cos(yaw) + sin(yaw));
    for (int fast = 0; fast < 2; fast++) {
        bt_params p = params(dt);
        p.slop = 1e-6, p.size = 1;
        bt_world *w = bt_world_create(&p);
        double v[8];
        scene_square(1, v);
        const bt_gid floe = add(w, BT_DYNAMIC, 4, v, -corner, 0, yaw, h);
        vel(w, floe)->x = 2;
        add_box(w, HELD, 20, 20, 10, 0, h);
        if (fast) vel(w, add(w, BT_DYNAMIC, 4, v, -corner - 2, 0, 0, h))->x = -300;
        bt_world_step(w);
        assert_true(w->stats.n_points == 1 + fast);
        CHECK_CLOSE(vel(w, floe)->x, 2 - edge_load() * h * dt / ice, 1e-9);
        bt_world_free(w);
    }
}

/// A floe at rest is pushed across a gap and shut against an edge by a plate: whether it lies true or is turned a
/// little, it bears along its whole edge, and both ends alike.
TEST(pushed_shut)
{
    const double a = 10, yaw[] = {0, 1e-12, -1e-12, 1e-4};
    for (int i = 0; i < 4; i++) {
        bt_params p = params(0.1);
        bt_world *w = bt_world_create(&p);
        double v[8];
        scene_square(a, v);
        add(w, BT_DYNAMIC, 4, v, 0.5 * a + 0.05, 0, yaw[i], h);
        set_speed(w, add_box(w, BT_KINEMATIC, 1, 4, a + 0.55, 0, 0), -0.6);
        add_box(w, HELD, a, a, -0.5 * a, 0, h);
        bt_world_step(w);
        int seen = 0;
        for (bt_idx k = 0; k < w->cells->n; k++)
            for (bt_idx j = 0; j < w->cells->cell[k].n_contacts; j++) {
                const bt_limit *l = &w->cells->cell[k].laws->limits[j];
                if (w->cells->cell[k].contacts[j].n < 2 || isinf(l->cap[0])) continue;
                seen++;
                for (int e = 0; e < 2; e++)
                    CHECK_CLOSE(l->cap[e], 0.5 * edge_load() * a * p.dt, 0.06 * edge_load() * a * p.dt);
            }
        assert_int_equal(seen, 1);
        bt_world_free(w);
    }
}

/// Pushed on, the floe goes wholly under and comes out behind; once they have parted the pair has forgotten, and they
/// meet as at first.
TEST(out_behind)
{
    const double a = 4, v = 0.1, dt = 0.1;
    bt_params p = params(dt);
    bt_world *w = bt_world_create(&p);
    add_box(w, HELD, a, a, -0.5 * a, 0, h);
    const bt_gid floe = add_box(w, BT_DYNAMIC, 3, 2, 1.52, 0, h);
    const bt_gid plate = add_box(w, BT_KINEMATIC, 1, 2, 3.55, 0, 0);
    set_speed(w, plate, -v);
    bool under = false, parted = false;
    for (int s = 0; s < 1000 && !parted; s++) {
        bt_world_step(w);
        check_step(w);
        const double x = pose(w, floe)->x, f = load_on(w, plate);
        if (x < -1.6 && x > -2.4) {
            under = true;
            CHECK_CLOSE(f, 6 * sheet_load(), 0.01 * f); // no edge crosses another
        }
        if (x < -2.6 && x > -5.4) CHECK_CLOSE(f, 2 * sheet_load() * (x + 1.5 + a + v * dt), 0.01 * f + 2);
        if (x < -5.6) {
            assert_true(scene_law(w, "rafting") == 0 && scene_law(w, "rafted_area") == 0);
            parted = true;
        }
    }
    assert_true(under && parted);
    bt_idx records = 0;
    for (bt_idx k = 0; k < w->cells->n; k++) records += w->cells->cell[k].laws->n_memory;
    assert_int_equal(records, 0);
    bt_world_free(w);
}

/// A row of equal floes between a plate and a wall gives way at its weakest contact, and the contacts take turns:
/// shortened by s over m contacts F = q0 a + μ (ρ_w − ρ_i) g h a s/m.
TEST(confined_row)
{
    enum { N = 5 };
    const double a = 8, v = 0.05, dt = 0.1;
    bt_params p = params(dt);
    bt_world *w = bt_world_create(&p);
    for (int i = 0; i < N; i++) add_box(w, BT_DYNAMIC, a, a, (0.5 + i) * a + 0.001 * i, 0, h);
    scene_wall(w, -5, -20, 0, 20, 0);
    scene_wall(w, 0, 0.5 * a + 0.001, N * a, 10, 0);
    scene_wall(w, 0, -10, N * a, -0.5 * a - 0.001, 0);
    const double end = N * a + 0.001 * N;
    const bt_gid plate = add_box(w, BT_KINEMATIC, 2, 30, end + 1, 0, 0);
    set_speed(w, plate, -v);
    double s = 0, sum = 0, want = 0;
    for (int k = 0; k < 2400; k++) {
        bt_world_step(w);
        check_step(w);
        s += v * dt;
        if (s < 4) continue; // while all begin
        sum += load_on(w, plate);
        want += a * (edge_load() + sheet_load() * s / (N - 1));
    }
    CHECK_CLOSE(sum, want, 0.02 * want);
    double least = INFINITY, most = 0;
    for (int i = 0; i + 1 < N; i++) {
        const double depth = a - (pose(w, i + 1)->x - pose(w, i)->x);
        least = bt_min(least, depth), most = bt_max(most, depth);
    }
    assert_true(least > 0.5 * most);
    bt_world_free(w);
}

/// A square that lies on another by a fifth turns by 0.1 rad and more in a step: its pose follows from its velocity
/// alone, and what has slid over the other stays there.
TEST(a_turn_takes_no_raft_back)
{
    const double a = 10, dt = 2;
    bt_params p = params(dt);
    bt_world *w = bt_world_create(&p);
    add_box(w, HELD, a, a, -0.5 * a, 0, h);
    const bt_gid floe = add_box(w, BT_DYNAMIC, a, a, 0.5 * a + 0.02, 1e-6, h),
                 right = add_box(w, BT_KINEMATIC, 1, 4, a + 0.55, 0, 0);
    set_speed(w, right, -0.05);
    while (0.5 * a - pose(w, floe)->x < 0.2 * a) bt_world_step(w);
    set_speed(w, right, 1);
    bt_world_step(w);
    for (int s = 0; s < 3; s++) {
        *vel(w, floe) = (bt_vel){.w = 0.2};
        const bt_pose before = *pose(w, floe);
        bt_world_step(w);
        const bt_vel v = *vel(w, floe);
        assert_true(fabs(v.w) * dt > 0.1 && w->stats.converged);
        CHECK_CLOSE(pose(w, floe)->x, before.x + v.x * dt, 2 * p.slop);
        CHECK_CLOSE(pose(w, floe)->y, before.y + v.y * dt, 2 * p.slop);
        CHECK_CLOSE(pose(w, floe)->yaw, before.yaw + v.w * dt, 1e-3);
        assert_true(scene_law(w, "rafted_area") > 0.1 * a * a);
    }
    bt_world_free(w);
}

/// The apex of a triangle, angle φ, is pushed by its base under a straight edge: chord 2 d tan(φ/2), at least the
/// thickness; F = q0 L + μ (ρ_w − ρ_i) g h d² tan(φ/2). So is a floe that a hull drives into the pack: the hull itself
/// does not raft, and its load is that of the edge behind.
TEST(apex_under_an_edge)
{
    const double v = 0.02, dt = 0.1, base = 6, height = 5, slope = 0.5 * base / height;
    bt_params p = params(dt);
    bt_world *w = bt_world_create(&p);
    add_box(w, HELD, 20, 20, -10, 0, h);
    double corners[6] = {0, 0, height, -0.5 * base, height, 0.5 * base};
    // the thinner of the two counts
    const bt_gid floe = add(w, BT_DYNAMIC, 3, corners, 2.0 / 3 * height + 0.01, 0, 0, 1.5 * h);
    const bt_gid hull = add_box(w, BT_KINEMATIC, 2, 2, height + 1.02, 0, 2 * h);
    w->towed = hull; // it carries ice, but is towed
    w->tow = bt_alloc(1, sizeof *w->tow);
    *w->tow = (bt_tow){.mode = BT_TOW_SPEED, .ux = -1, .speed = v, .dt = dt};
    set_speed(w, hull, -v);
    double depth = 0;
    while (depth < 4) {
        bt_world_step(w);
        check_step(w);
        const double f = load_on(w, hull);
        const double in = depth; // at the start of the step, where the bounds are formed
        depth = 2.0 / 3 * height - pose(w, floe)->x;
        if (in < 0.05) continue;
        const double length = bt_max(h, 2 * in * slope);
        CHECK_CLOSE(f, edge_load() * length + sheet_load() * in * in * slope, 0.002 * f);
        assert_true(scene_law(w, "rafting") == 1); // not floe and hull
    }
    bt_world_free(w);
}

/// A floe runs against one that is fixed, or free and ten times as thick: no sheet slides over them. Against one that
/// is twice as thick it does.
TEST(structures_do_not_raft)
{
    const double a = 10, thickness[] = {h, 10 * h, 2 * h};
    for (int i = 0; i < 3; i++) {
        bt_params p = params(0.1);
        bt_world *w = bt_world_create(&p);
        add_box(w, i == 0 ? BT_STATIC : BT_DYNAMIC, a, 4 * a, 0, 0, thickness[i]);
        const bt_gid floe = add_box(w, BT_DYNAMIC, a, a, a + 0.1, 0, h);
        set_speed(w, floe, -1);
        for (int s = 0; s < 20; s++) {
            bt_world_step(w);
            check_step(w);
        }
        assert_true(scene_law(w, "rafting") == (i == 2));
        bt_world_free(w);
    }
}

/// A plough as wide as its channel, closed at the end, pushes floes in two lanes, half a floe apart. What it needs for
/// a metre of advance is what goes under on it: the work of the plough is that of edges and sheets, edges take q0 for
/// the area that went under, and as the channel grows shorter by s its width times s lies twice.
TEST(plough_in_a_channel)
{
    enum { LANE = 5 };
    const double a = 6, v = 0.05, dt = 0.1, width = 2 * a;
    bt_params p = params(dt);
    bt_world *w = bt_world_create(&p);
    for (int lane = 0; lane < 2; lane++) {
        const double y = lane ? 0.5 * a + 0.001 : -0.5 * a - 0.001;
        for (int i = 0; i < LANE; i++) add_box(w, BT_DYNAMIC, a, a, (0.5 + i + 0.5 * lane) * a, y, h);
        add_box(w, BT_DYNAMIC, 0.5 * a, a, lane ? 0.25 * a : (LANE + 0.25) * a, y, h);
    }
    const double end = (LANE + 0.5) * a;
    scene_wall(w, -5, -20, -0.001, 20, 0);
    scene_wall(w, -5, a + 0.003, end + 5, 20, 0);
    scene_wall(w, -5, -20, end + 5, -a - 0.003, 0);
    const bt_gid plough = add_box(w, BT_KINEMATIC, 2, 2 * a, end + 1, 0, 0);
    set_speed(w, plough, -v);
    double work = 0, edge = 0, friction = 0, way = 0;
    while (way < 3) {
        bt_world_step(w);
        check_step(w);
        way += v * dt;
        work += load_on(w, plough) * v * dt;
        edge += scene_law(w, "raft_edge_work"), friction += scene_law(w, "raft_friction_work");
    }
    CHECK_CLOSE(edge + friction, work, 0.02 * work);
    CHECK_CLOSE(scene_law(w, "rafted_area"), width * way, 0.02 * width * way);
    CHECK_CLOSE(edge, edge_load() * width * way, 0.03 * edge);
    CHECK_CLOSE(scene_law(w, "rafted_energy"), rise() * h * h * scene_law(w, "rafted_area"),
                1e-9 * scene_law(w, "rafted_energy"));
    bt_world_free(w);
}

/// Random floes driven at each other with spin and friction: momentum to round-off, no work gained, and what the
/// contacts take is what the kinetic energy loses.
TEST(energy_is_booked)
{
    uint64_t rng = 11;
    int rafted = 0;
    for (int c = 0; c < 20; c++) {
        bt_params p = params(0.05);
        p.tolerance = 1e-9;
        bt_world *w = bt_world_create(&p);
        for (int i = 0; i < 9; i++) {
            double v[2 * BT_MAX_VERTICES];
            const int n = scene_random_polygon(&rng, 5, v);
            // one after the other: compilers differ in the order of arguments
            const double thickness = 0.3 + scene_uniform(&rng), yaw = 6 * scene_uniform(&rng);
            const double vy = 0.3 * scene_uniform(&rng), spin = 0.1 * scene_uniform(&rng);
            add(w, BT_DYNAMIC, n, v, 15 * (i % 3), 15 * (i / 3), yaw, thickness);
            *vel(w, i) = (bt_vel){-0.08 * (15 * (i % 3) - 15), -0.08 * (15 * (i / 3) - 15) + vy, spin, 0};
        }
        double before = 0, edge = 0, friction = 0, all = 0;
        for (int s = 0; s < 400; s++) {
            bt_world_step(w);
            check_step(w);
            if (s == 0) before = w->stats.kinetic_energy - w->stats.contact_work;
            all += w->stats.contact_work, edge += scene_law(w, "raft_edge_work");
            friction += scene_law(w, "raft_friction_work");
            CHECK_CLOSE(w->stats.kinetic_energy, before + all, 1e-6 * before);
            assert_true(w->stats.overlap < 0.05);
        }
        assert_true(edge + friction <= -all * (1 + 1e-6) + 1e-6);
        rafted += scene_law(w, "rafting") > 0;
        if (scene_law(w, "rafted_area") > 1) assert_true(edge > 0 && friction > 0);
        bt_world_free(w);
    }
    assert_true(rafted > 10);
}

/// A floe comes to rest on another: friction that is carried over from step to step pushes it to and fro below the
/// tolerance, where there is next to no kinetic energy left. That is no energy added by the contacts.
TEST(residual_adds_no_energy)
{
    bt_params p = params(0.5);
    p.tolerance = 1e-2;
    bt_world *w = bt_world_create(&p);
    add_box(w, HELD, 60, 60, 0, 0, h);
    set_speed(w, add_box(w, BT_DYNAMIC, 100, 100, -82, 0, h), 1);
    int pushed = 0;
    for (int s = 0; s < 400; s++) {
        bt_world_step(w);
        assert_true(w->stats.converged);
        pushed += w->stats.contact_work > 1e-10 * w->stats.kinetic_energy;
        assert_false(w->stats.added_energy);
    }
    print_message("%d steps with work\n", pushed);
    assert_true(pushed > 10 && scene_law(w, "rafting") == 1);
    bt_world_free(w);
}

/// Rectangles in a row whose long sides lie on each other to rounding: those sides push neither way, the ends do, by
/// the width of the row. Where they have passed each other by half of the blend, half of their length pushes.
TEST(sides_that_lie_on_each_other_do_not_push)
{
    const double length = 10, overlap = 4, blend = 0.01;
    for (int side = -1; side <= 1; side += 2)
        for (int half = 0; half < 2; half++) {
            const double aside = side * (half ? 0.5 * blend : 1e-13);
            bt_params p = params(0.1);
            bt_world *w = bt_world_create(&p);
            add_box(w, BT_DYNAMIC, length, length, 0, 0, h);
            add_box(w, BT_DYNAMIC, length, length, length - overlap, aside, h);
            bt_overlap o;
            double grad[2];
            const bt_idx a = bt_world_index(w, 0), b = bt_world_index(w, 1);
            bt_overlap_clip(w, a, b, (uint16_t[]){0, 0}, 0, 0, &o);
            bt_overlap_gradient(w, a, b, (uint16_t[]){0, 0}, &o, blend, grad);
            CHECK_CLOSE(grad[0], -(length - fabs(aside)), 1e-9);
            CHECK_CLOSE(grad[1], half ? -side * 0.5 * overlap : 0, 1e-9);
            bt_world_free(w);
        }
}

/// Squares between two plates, out of line by turns; lateral guides are none. No pair bears less than q0 on the width
/// lies on each other, with the friction of the sheets, until one of them is under by a fifteenth of its side.
/// Without friction the row drifts on to a side, by 0.5 m at most in the minute that this takes. Without the ends of
/// the overlap it slipped out: no load at no friction.
TEST(a_row_out_of_line)
{
    enum { N = 5 };
    const double a = 8, v = 0.02;
    for (int i = 0; i < 8; i++) {
        const double aside = i & 1 ? 0.3 * a : 0.01, q0 = (i & 2 ? 10 : 4) * 0.5 * rise(), friction = i & 4 ? 0.35 : 0;
        bt_params p = params(0.1);
        p.law_own[BT_LAW_RAFTING][BT_RAFT_LINE] = q0;
        bt_world *w = bt_world_create(&p);
        for (int k = 0; k < N; k++) {
            const bt_gid g = add_box(w, BT_DYNAMIC, a, a, (0.5 + k) * a + 0.001 * k, (k % 2) * aside, h);
            w->bodies.friction[bt_world_index(w, g)] = friction;
        }
        add_box(w, BT_KINEMATIC, 2, 30, -1, 0, 0);
        const bt_gid plate = add_box(w, BT_KINEMATIC, 2, 30, N * a + 0.001 * N + 1, 0, 0);
        set_speed(w, plate, -v);
        double deepest = 0, least = INFINITY, most = 0, drift = 0;
        while (deepest < a / 15) {
            bt_world_step(w);
            assert_true(w->stats.converged);
            deepest = 0;
            double weakest = INFINITY;
            for (int k = 0; k + 1 < N; k++) {
                const double depth = a - (pose(w, k + 1)->x - pose(w, k)->x),
                             off = fabs(pose(w, k + 1)->y - pose(w, k)->y);
                deepest = bt_max(deepest, depth), drift = bt_max(drift, off - aside);
                weakest = bt_min(weakest, (a - off) * (q0 + friction * (water - ice) * gravity * h * depth));
            }
            if (deepest < 0.01 * a) continue; // while all begin
            const double part = load_on(w, plate) / weakest;
            least = bt_min(least, part), most = bt_max(most, part);
        }
        print_message("kappa %d, friction %g, %g m out of line: %.4f to %.4f drift %.2f m\n",
                      i & 2 ? 10 : 4, friction, aside, least, most, drift);
        assert_true(least > 0.99 && most < 1.04);
        assert_true(drift < (friction > 0 ? 0.2 : 0.55));
        bt_world_free(w);
    }
}

/// What it costs to cover an area, without friction: q0 where the area of the overlap grows, whatever the angle to the
/// edge, and q0 times half the width that is under for each length along the edge. The way back costs nothing. The floe
/// is so heavy that nothing stops it.
TEST(the_cost_of_an_angle)
{
    const double a = 10, v = 0.05, angle[] = {0, 15, 30, 45, 90, 120, 180};
    for (int i = 0; i < 7; i++) {
        bt_params p = params(0.1);
        bt_world *w = bt_world_create(&p);
        add_box(w, HELD, a, 10 * a, -0.5 * a, 0, h);
        double outline[8];
        scene_square(a, outline);
        bt_body_def d = scene_prism(4, outline, 1e13);
        d.x = 0.5 * a + 0.001, d.thickness = h, d.friction = 0;
        const bt_gid floe = bt_world_add(w, &d);
        set_speed(w, floe, -v);
        for (int k = 0; k < 2 * a / v; k++) bt_world_step(w); // a fifth of it is under
        CHECK_CLOSE(pose(w, floe)->x, 0.3 * a, 0.01);
        const double c = cos(angle[i] * M_PI / 180), s = sin(angle[i] * M_PI / 180);
        *vel(w, floe) = (bt_vel){-v * c, v * s, 0, 0};
        double work = 0, want = 0, way = 0, from = pose(w, floe)->x;
        for (int k = 0; k < 50; k++) {
            const double under = 0.5 * a - pose(w, floe)->x;
            bt_world_step(w);
            work += scene_law(w, "raft_edge_work"), way += v * p.dt;
            want += v * p.dt * edge_load() * (a * bt_max(0, c) + 0.5 * under * s);
            assert_true(fabs(scene_law(w, "raft_friction_work")) <= 1e-9 * edge_load() * a * v * p.dt);
            CHECK_CLOSE(scene_law(w, "raft_edge_work"), -w->stats.contact_work, 1e-9 * edge_load() * a * v * p.dt);
            if (c < 0 && pose(w, floe)->x < from + 2 * p.slop) work = want = way = 0; // it is free from a slop on
            if (c < 0) want = 0;
        }
        CHECK_CLOSE(work / way, want / way, 1e-8 * edge_load() * a);
        bt_world_free(w);
    }
}

/// A heavy floe slides back by 0.2 m, and comes on: in a step that leaves it short of where it was the edge bears
/// nothing; in one of 0.5 m the losses are those of 0.3 m, within a slop.
TEST(a_gap_is_crossed_in_a_step)
{
    const double a = 10, stored = rise() * h * h, on[] = {0.1, 0.5};
    for (int i = 0; i < 2; i++) {
        bt_params p = params(1);
        bt_world *w = bt_world_create(&p);
        add_box(w, HELD, a, 10 * a, -0.5 * a, 0, h);
        double outline[8];
        scene_square(a, outline);
        bt_body_def d = scene_prism(4, outline, 1e13);
        d.x = 0.5 * a + 0.001, d.thickness = h;
        const bt_gid floe = bt_world_add(w, &d);
        set_speed(w, floe, -0.5);
        for (int k = 0; k < 4; k++) bt_world_step(w);
        vel(w, floe)->x = 0.2;
        bt_world_step(w);
        CHECK_CLOSE(scene_law(w, "raft_edge_work"), 0, 0.01 * edge_load() * a);
        vel(w, floe)->x = -on[i];
        bt_world_step(w);
        const double beyond = i == 0 ? 0 : on[i] * (1 - 0.2 / (on[i] + p.slop));
        const double want = i == 0 ? 0 : a * (stored * on[i] + (edge_load() - stored) * beyond);
        CHECK_CLOSE(scene_law(w, "raft_edge_work"), want, 1e-6 * edge_load() * a);
        bt_world_free(w);
    }
}

/// In line what a plate does is what is stored, in rafted_energy, and what is lost, to the last digits; a wedge, whose
/// chord grows within a step, is off by an amount that halves with the step.
TEST(stored_and_lost_is_work)
{
    const double a = 10, v = 0.02, base = 6, height = 5;
    double off[2];
    for (int i = 0; i < 3; i++) {
        bt_params p = params(i == 2 ? 0.1 : 0.2);
        p.tolerance = 1e-12;
        bt_world *w = bt_world_create(&p);
        add_box(w, HELD, 2 * a, 4 * a, -a, 0, h);
        double corners[6] = {0, 0, height, -0.5 * base, height, 0.5 * base};
        const bt_gid floe = i == 0 ? add_box(w, BT_DYNAMIC, a, a, 0.5 * a, 0, h)
                                   : add(w, BT_DYNAMIC, 3, corners, 2.0 / 3 * height, 0, 0, h);
        const double start = pose(w, floe)->x;
        const bt_gid plate = add_box(w, BT_KINEMATIC, 1, 4, (i ? height : a) + 0.5, 0, 0);
        set_speed(w, plate, -v);
        while (start - pose(w, floe)->x < 2) bt_world_step(w);
        double work = 0, edge = 0, friction = 0, area = 0, energy = 0;
        for (int k = 0; k < (i == 2 ? 401 : 201); k++) { // area and energy are those of the start of a step
            bt_world_step(w);
            if (k == 0) area = -scene_law(w, "rafted_area"), energy = -scene_law(w, "rafted_energy");
            if (k == (i == 2 ? 400 : 200)) break;
            work += load_on(w, plate) * v * p.dt;
            edge += scene_law(w, "raft_edge_work"), friction += scene_law(w, "raft_friction_work");
        }
        area += scene_law(w, "rafted_area"), energy += scene_law(w, "rafted_energy");
        CHECK_CLOSE(edge + friction, work, 1e-9 * work);
        CHECK_CLOSE(energy, rise() * h * h * area, 1e-9 * energy);
        const double want = edge_load() * area;
        if (i == 0) CHECK_CLOSE(edge, want, 1e-9 * want);
        else off[i - 1] = edge / want - 1;
        bt_world_free(w);
    }
    print_message("of a wedge: %g and %g\n", off[0], off[1]);
    assert_true(fabs(off[0]) < 2e-3 && fabs(off[0]) > 1e-5);
    CHECK_CLOSE(off[1] / off[0], 0.5, 0.02);
}

/// Floes driven together, in two worlds that are the same; then one step of them, in one from the impulses of the step
/// before, in the other from none. The velocities are the same: the law of what has rafted is associated.
TEST(cold_and_warm)
{
    double worst = 0;
    int rafted = 0;
    for (int seed = 1; seed <= 10; seed++) {
        bt_world *w[2];
        for (int i = 0; i < 2; i++) {
            uint64_t rng = (uint64_t)seed;
            bt_params p = params(0.05);
            p.tolerance = 1e-10, p.max_sweeps = 200000;
            w[i] = bt_world_create(&p);
            for (int k = 0; k < 9; k++) {
                double v[2 * BT_MAX_VERTICES];
                const int n = scene_random_polygon(&rng, 5, v);
                const double thickness = 0.3 + scene_uniform(&rng), yaw = 6 * scene_uniform(&rng);
                const double vy = 0.3 * scene_uniform(&rng), spin = 0.1 * scene_uniform(&rng);
                const double x = 9 * (k % 3), y = 9 * (k / 3);
                add(w[i], BT_DYNAMIC, n, v, x, y, yaw, thickness);
                *vel(w[i], k) = (bt_vel){-0.2 * (x - 9), -0.2 * (y - 9) + vy, spin, 0};
            }
        }
        for (int s = 0; s < 60; s++) bt_world_step(w[0]), bt_world_step(w[1]);
        for (int s = 0; s < 20; s++) {
            w[1]->par.warm_start = false;
            bt_world_step(w[0]), bt_world_step(w[1]);
            for (int k = 0; k < 9; k++) {
                const bt_vel *x = vel(w[0], k), *y = vel(w[1], k);
                worst = bt_max(worst, bt_max(fabs(x->x - y->x), bt_max(fabs(x->y - y->y), 5 * fabs(x->w - y->w))));
                assert_true(w[0]->stats.converged && w[1]->stats.converged);
                *pose(w[1], k) = *pose(w[0], k), *vel(w[1], k) = *vel(w[0], k);
            }
            rafted += scene_law(w[0], "rafting") > 2;
        }
        bt_world_free(w[0]);
        bt_world_free(w[1]);
    }
    print_message("%d steps, at most %g m/s apart\n", rafted, worst);
    assert_true(rafted > 50 && worst < 1e-8);
}

TEST_MAIN(NULL, NULL)
