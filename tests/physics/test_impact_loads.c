// SPDX-License-Identifier: MIT
// Collisions and quasi-static loads on the towed body against closed forms: impulse, effective mass, peak, duration,
// panels.
#include "scene.h"

#include "bergtow/outline.h"
#include "contact/crush.h"
#include "loads/impact.h"
#include "output/observe.h"

static const double speed = 0.4, sheet = 910 * 0.5; // m/s; kg/m² of floes 0.5 m thick

/// A square body of side 10 m towed along x at `speed`, its right side at x = 0, with the given rule; added last.
static void add_body(bt_world *w, bt_impact_rule rule, bool free_body, double yaw)
{
    double v[8];
    scene_square(10, v);
    bt_body_def d = scene_prism(4, v, 900 * 3.0);
    d.motion = free_body ? BT_DYNAMIC : BT_KINEMATIC;
    d.large = true;
    d.x = -5, d.vx = speed, d.yaw = yaw;
    w->towed = bt_world_add(w, &d);
    w->tow = bt_alloc(1, sizeof *w->tow);
    *w->tow = (bt_tow){
        .mode = free_body ? BT_TOW_NONE : BT_TOW_SPEED, .ux = 1, .speed = speed, .dt = w->par.dt, .travel_x = -5};
    if (rule.least_speed == 0) rule.least_speed = 0.01;
    bt_impacts *m = w->impacts = bt_alloc(1, sizeof *m);
    *m = (bt_impacts){.rule = rule, .dt = w->par.dt, .tolerance = w->par.tolerance, .sheet = 910, .body_height = 3};
    bt_panels_init(&m->panels, 40, 4, w->bodies.vertices + 2 * w->bodies.offset[bt_world_towed(w)]);
}

static bt_gid add_square(bt_world *w, double x, double y, double yaw, double e, double mu)
{
    double v[8];
    scene_square(1, v);
    bt_body_def d = scene_prism(4, v, sheet);
    d.x = x, d.y = y, d.yaw = yaw, d.restitution = e, d.friction = mu;
    return bt_world_add(w, &d);
}

static void set_contact(bt_world *w, double e, double mu)
{
    w->bodies.restitution[bt_world_towed(w)] = e;
    w->bodies.friction[bt_world_towed(w)] = mu;
}

static double largest_quasi_static_load; ///< of the steps of the last call of run, N

/// Collisions of `steps` steps, [0..10); returns how many there were.
static int run(bt_world *w, int steps, bt_impact *out)
{
    int n = 0;
    largest_quasi_static_load = 0;
    for (int s = 0; s < steps; s++) {
        bt_world_step(w);
        assert_true(w->stats.converged);
        for (int64_t i = 0; i < w->impacts->n_closed && n < 10; i++) out[n++] = w->impacts->closed[i];
        largest_quasi_static_load = fmax(largest_quasi_static_load, w->impacts->largest_quasi_static_load);
    }
    return n;
}

/// Flush and central, heavy body: one collision with λ = (1+e) m V and m_e = m, whatever part of the gap its first step
/// closes. Half-sine: mean λ/T_c, peak π/2 of it.
TEST(central_impact)
{
    const double es[] = {0, 0.5}, gaps[] = {0, 0.013, 0.0299, 0.037};
    for (int i = 0; i < 2; i++)
        for (int k = 0; k < 4; k++) {
            bt_params p = scene_params(0.1, 1);
            bt_world *w = bt_world_create(&p);
            add_square(w, 0.5 + gaps[k], 2, 0, es[i], 0);
            add_body(w, (bt_impact_rule){.conversion = BT_IMPACT_DURATION, .duration = 0.05}, false, 0);
            set_contact(w, es[i], 0);
            bt_impact e[10];
            assert_int_equal(run(w, 20, e), 1);
            const double impulse = (1 + es[i]) * sheet * speed;
            CHECK_CLOSE(e[0].impulse, impulse, 1e-6 * impulse);
            CHECK_CLOSE(e[0].approach, speed, 1e-9);
            CHECK_CLOSE(e[0].mass, sheet, 1e-6);
            CHECK_CLOSE(e[0].mean, impulse / 0.05, 1e-5 * impulse);
            CHECK_CLOSE(e[0].peak, 0.5 * BT_PI * impulse / 0.05, 1e-4 * impulse);
            CHECK_CLOSE(e[0].duration, 0.05, 0);
            CHECK_CLOSE(e[0].time, 0.1, 1e-12);
            CHECK_CLOSE(e[0].gid, 0, 0);
            CHECK_CLOSE(e[0].x, 5, 0.03); // half-way across the gap
            CHECK_CLOSE(e[0].y, 2, 1e-9);
            CHECK_CLOSE(e[0].thickness, 0.5, 1e-12);
            CHECK_CLOSE(largest_quasi_static_load, 0, 1e-6 * impulse);
            bt_world_free(w);
        }
}

/// A corner of a turned floe is hit: 1/m_e = 1/m + (r×n)²/I, λ = (1+e) V m_e; with a free body 1/M + (R×n)²/J comes on
/// top, and friction, which here sticks, changes λ but not that all of it is collision.
TEST(eccentric_impact)
{
    const double es[] = {0, 0.5}, mus[] = {0, 2};
    for (int i = 0; i < 8; i++) {
        const double e = es[i & 1], mu = mus[i >> 1 & 1], yaw = 0.3;
        const bool free_body = i & 4;
        bt_params p = scene_params(0.001, 1);
        bt_world *w = bt_world_create(&p);
        // The corner farthest to −x is at 135° + yaw from the centroid, or 225° + yaw.
        const double cx = -0.5 * cos(yaw) - 0.5 * sin(yaw), cy = -0.5 * sin(yaw) + 0.5 * cos(yaw);
        add_square(w, -cx + 1e-5, 3 - cy, yaw, e, mu);
        add_body(w, (bt_impact_rule){.conversion = BT_IMPACT_CRUSHING, .pressure = 2e6, .corner_angle = 1}, free_body,
                 0);
        set_contact(w, e, mu);
        bt_impact hit[10];
        assert_int_equal(run(w, 8, hit), 1);
        const double m = sheet, inertia = m / 6, body = 900 * 3.0 * 100, body_inertia = body * 100 / 6;
        double inverse = 1 / m + cy * cy / inertia;
        if (free_body) inverse += 1 / body + 3 * 3.0 / body_inertia;
        CHECK_CLOSE(hit[0].mass, 1 / inverse, 1e-4 / inverse);
        CHECK_CLOSE(hit[0].approach, speed, 1e-9);
        CHECK_CLOSE(hit[0].x, 5, 1e-4);
        CHECK_CLOSE(hit[0].y, 3, 1e-3);
        if (mu == 0) CHECK_CLOSE(hit[0].impulse, (1 + e) * speed / inverse, 1e-3 * speed / inverse);
        // Momentum of the floe along x is λ of the whole run.
        CHECK_CLOSE(hit[0].impulse, m * w->bodies.vel[bt_world_index(w, 0)].x, 1e-3 * speed * m);
        CHECK_CLOSE(largest_quasi_static_load * p.dt, 0, 1e-3 * speed * m);
        // Crushing: k = 2 p h tan(φ/2).
        const double k = 2 * 2e6 * 0.5 * tan(0.5), m_e = hit[0].mass, v = fmin(speed, hit[0].impulse / m_e);
        CHECK_CLOSE(hit[0].peak, v * sqrt(k * m_e), 1e-9 * hit[0].peak);
        CHECK_CLOSE(hit[0].duration, 0.5 * BT_PI * sqrt(m_e / k), 1e-12);
        CHECK_CLOSE(hit[0].mean * hit[0].duration, m_e * v, 1e-9 * m_e * v); // the impulse up to the peak
        bt_world_free(w);
    }
}

/// A floe slides through water at rest onto the body: the drag of the step is in the solver's masses, (M + Δt K), and
/// in λ, but the collision has the momentum of the mass alone, and the rest is quasi-static. From then on the contact
/// carries k V².
TEST(drag_is_quasi_static)
{
    bt_params p = scene_params(0.5, 1);
    bt_world *w = bt_world_create(&p);
    double v[8];
    scene_square(1, v);
    bt_body_def d = scene_prism(4, v, sheet);
    d.x = 0.5, d.vx = -1, d.drag.water_skin = 200;
    bt_world_add(w, &d);
    add_body(w, (bt_impact_rule){.conversion = BT_IMPACT_DURATION, .duration = 0.5}, false, 0);
    bt_impact hit[10];
    assert_int_equal(run(w, 1, hit), 1);
    CHECK_CLOSE(hit[0].impulse, sheet * (1 + speed), 1e-6 * sheet);
    CHECK_CLOSE(hit[0].mass, sheet, 1e-6);
    CHECK_CLOSE(largest_quasi_static_load, 200 * 1 * speed, 1e-4); // K V, K = k |U1|
    assert_int_equal(run(w, 30, hit), 0);
    bt_sample s;
    bt_observe(w, speed, &s);
    CHECK_CLOSE(s.ice_resistance, 200 * speed * speed, 1e-4);
    CHECK_CLOSE(s.collision_resistance, 0, 0);
    bt_world_free(w);
}

/// Flush, but only a part of the floe's side meets the hull: the body's corner, 0.2 m from the floe's middle, has all
/// of it.
TEST(hit_beside_the_middle)
{
    bt_params p = scene_params(0.1, 1);
    bt_world *w = bt_world_create(&p);
    add_square(w, 0.5, 5.2, 0, 0, 0);
    add_body(w, (bt_impact_rule){.conversion = BT_IMPACT_DURATION, .duration = 0.1}, false, 0);
    bt_impact hit[10];
    assert_int_equal(run(w, 1, hit), 1);
    const double m_e = sheet / (1 + 0.04 * 6);
    CHECK_CLOSE(hit[0].mass, m_e, 1e-9 * m_e);
    CHECK_CLOSE(hit[0].impulse, m_e * speed, 1e-6 * m_e);
    CHECK_CLOSE(hit[0].y, 5, 1e-9);
    bt_world_free(w);
}

/// The body itself, free, runs into a wall with its front, or turned by a quarter with its side: it is now the first of
/// the pair. λ = M V, and the force is against the motion.
TEST(body_against_a_wall)
{
    for (int i = 0; i < 2; i++) {
        bt_params p = scene_params(0.1, 1);
        bt_world *w = bt_world_create(&p);
        add_body(w, (bt_impact_rule){.conversion = BT_IMPACT_CRUSHING, .pressure = 1e6, .corner_angle = 0.5 * BT_PI},
                 true, i * 0.5 * BT_PI);
        scene_wall(w, 0.03, -50, 20, 60, 0);
        bt_impact hit[10];
        assert_int_equal(run(w, 1, hit), 0);
        const bt_panels *panels = &w->impacts->panels;
        double f[2] = {0, 0};
        for (int k = 0; k < panels->n; k++) f[0] += panels->panel[k].fx, f[1] += panels->panel[k].fy;
        // Body frame: the wall is where its x points, or its −y. A gap of 0.03 m is closed in the step.
        const double mass = 900 * 3.0 * 100, towards[2] = {1 - i, -i};
        for (int k = 0; k < 2; k++) CHECK_CLOSE(f[k] * p.dt, -towards[k] * mass * (speed - 0.3), 1e-6 * mass);
        assert_int_equal(run(w, 3, hit), 1);
        CHECK_CLOSE(hit[0].gid, 1, 0);
        CHECK_CLOSE(hit[0].impulse, mass * speed, 1e-6 * mass);
        CHECK_CLOSE(hit[0].mass, mass, 1e-6 * mass);
        CHECK_CLOSE(hit[0].x, 5 * towards[0], 0.02);
        CHECK_CLOSE(hit[0].y, 5 * towards[1], 0.02);
        CHECK_CLOSE(hit[0].panel, i ? 30 : 0, 0);
        CHECK_CLOSE(hit[0].peak, speed * sqrt(2 * 1e6 * 3 * mass), 1e-6 * hit[0].peak); // its own height is crushed
        bt_world_free(w);
    }
}

/// A floe lies against a body at rest and the wind presses on it: a quasi-static load of that force, never a collision;
/// no matter with how many of its parts it lies there.
TEST(static_load)
{
    for (int parts = 1; parts <= 2; parts++) {
        bt_params p = scene_params(0.1, 1);
        p.air_u = -20;
        bt_world *w = bt_world_create(&p);
        double v[] = {-0.5, 1, -0.5, 0.1, 0, 0, -0.5, -0.1, -0.5, -1, 0.5, -1, 0.5, 1};
        bt_parts split;
        if (parts == 1) scene_square(1, v);
        else assert_true(bt_outline_split(7, v, &split));
        bt_body_def d = scene_prism(parts == 1 ? 4 : 7, v, sheet);
        d.parts = parts == 1 ? NULL : &split;
        d.x = -v[0], d.drag.air_skin = 0.3;
        bt_world_add(w, &d);
        add_body(w, (bt_impact_rule){.conversion = BT_IMPACT_DURATION, .duration = 0.1}, false, 0);
        w->tow->speed = 0;
        w->bodies.vel[bt_world_towed(w)].x = w->bodies.vel_start[bt_world_towed(w)].x = 0;
        bt_impact hit[10];
        assert_int_equal(run(w, 50, hit), 0);
        assert_int_equal(w->impacts->n_open, 0);
        assert_int_equal(w->impacts->n_contacts, parts);
        CHECK_CLOSE(largest_quasi_static_load, 0.3 * 400, 1e-6);
        bt_sample s;
        bt_observe(w, speed, &s);
        CHECK_CLOSE(s.ice_resistance, 120, 1e-6);
        CHECK_CLOSE(s.collision_resistance, 0, 0);
        CHECK_CLOSE(s.collisions, 0, 0);
        bt_world_free(w);
    }
}

/// A body that speeds up with a floe before it pushes; so does one that squeezes a floe against a wall.
TEST(pushed_ahead)
{
    bt_params p = scene_params(0.1, 1);
    bt_world *w = bt_world_create(&p);
    add_square(w, 0.5, 0, 0, 0, 0);
    w->bodies.vel[0].x = 0;
    add_body(w, (bt_impact_rule){.conversion = BT_IMPACT_DURATION, .duration = 0.1}, false, 0);
    w->tow->ramp = 5;
    w->bodies.vel[bt_world_towed(w)].x = w->bodies.vel_start[bt_world_towed(w)].x = 0;
    bt_impact hit[10];
    assert_int_equal(run(w, 40, hit), 0);
    CHECK_CLOSE(largest_quasi_static_load, sheet * speed / 5, 1e-6);
    bt_world_free(w);
}

/// Two floes in a row, apart: the first is hit, then carries the body's push into the second; and a floe met later is
/// an event of its own.
TEST(events_in_their_order)
{
    bt_params p = scene_params(0.1, 1);
    bt_world *w = bt_world_create(&p);
    add_square(w, 1.5, 3, 0, 0, 0);
    add_square(w, 0.52, -3, 0, 0, 0);
    add_square(w, 0.53, 0, 0, 0, 0);
    add_body(w, (bt_impact_rule){.conversion = BT_IMPACT_DURATION, .duration = 0.1}, false, 0);
    bt_impact hit[10];
    assert_int_equal(run(w, 40, hit), 3);
    const double gids[] = {1, 2, 0}, times[] = {0.1, 0.1, 2.5};
    for (int k = 0; k < 3; k++) {
        CHECK_CLOSE(hit[k].gid, gids[k], 0);
        CHECK_CLOSE(hit[k].time, times[k], 0.1001);
        CHECK_CLOSE(hit[k].impulse, sheet * speed, 1e-6 * sheet);
    }
    bt_world_free(w);
}

/// The real corner: 90° of a square that hits with its corner, 60° of a triangle, and the body's own corner in a floe's
/// edge.
TEST(corner_in_contact)
{
    for (int i = 0; i < 3; i++) {
        bt_params p = scene_params(0.001, 1);
        bt_world *w = bt_world_create(&p);
        double v[2 * 8];
        int n = 4;
        if (i == 1) bt_shape_regular(n = 3, 1, v);
        else scene_square(i == 2 ? 3 : 1, v);
        bt_body_def d = scene_prism(n, v, sheet);
        d.yaw = i == 0 ? 0.6 : i == 1 ? BT_PI : 0;
        double low = INFINITY;
        for (int k = 0; k < n; k++) low = fmin(low, cos(d.yaw) * v[2 * k] - sin(d.yaw) * v[2 * k + 1]);
        const double yaw = i == 2 ? 0.5 : 0, right = i == 2 ? -5 + 5 * (cos(yaw) + sin(yaw)) : 0;
        d.x = right - low + 1e-5;
        d.y = i == 2 ? 5 * (sin(yaw) - cos(yaw)) : 1;
        bt_world_add(w, &d);
        add_body(
            w,
            (bt_impact_rule){.conversion = BT_IMPACT_CRUSHING, .pressure = 1e6, .corner_angle = 1, .real_corner = true},
            false, yaw);
        bt_impact hit[10];
        assert_true(run(w, 5, hit) >= 1);
        CHECK_CLOSE(hit[0].corner, i == 1 ? BT_PI / 3 : BT_PI / 2, 1e-6);
        if (i == 2) {
            CHECK_CLOSE(hit[0].x, 5, 1e-3);
            CHECK_CLOSE(hit[0].y, -5, 1e-3);
        }
        const double k = 2 * 1e6 * 0.5 * tan(0.5 * hit[0].corner);
        CHECK_CLOSE(hit[0].peak, speed * sqrt(k * hit[0].mass), 1e-3 * hit[0].peak);
        bt_world_free(w);
    }
}

/// Where ice is crushed, a collision has at most the force at the depth where the work of crushing is its energy,
/// whatever the time step, the slop and the rebound: p h L of flush edges, v √(k m) of a sharp corner, p h² of one that
/// is blunt. Its impulse stays. A conversion that gives less counts.
TEST(a_peak_is_at_most_what_the_ice_bears)
{
    const double h = 0.5, pressure = 1e6, k = 2 * pressure * h, dts[] = {2e-4, 5e-3, 0.1, 1};
    const struct { double yaw, least, duration, peak; } hits[] = {
        {0, 0, 1e-6, pressure * h},
        {0.25 * BT_PI, 0, 1e-3, speed * sqrt(k * sheet)},
        {0.25 * BT_PI, 1, 1e-4, pressure * h * h},
        {0.25 * BT_PI, 1, 0.2, 0.5 * BT_PI * sheet * speed / 0.2},
    };
    for (size_t i = 0; i < sizeof hits / sizeof *hits; i++)
        for (size_t n = 0; n < 4 * sizeof dts / sizeof *dts; n++) {
            const double dt = dts[n / 4], rebound = n & 1 ? 0.3 : 0;
            bt_params p = scene_params(dt, 1);
            p.law_own[BT_LAW_CRUSHING][BT_CRUSH_PRESSURE] = pressure;
            p.law_own[BT_LAW_CRUSHING][BT_CRUSH_LEAST] = hits[i].least;
            p.slop = n & 2 ? 1e-6 : 0.01; // the depth is 0.4 to 8.5 mm
            bt_world *w = bt_world_create(&p);
            const double half = 0.5 * (cos(hits[i].yaw) + sin(hits[i].yaw));
            const bt_gid floe = add_square(w, half + 0.3 * speed * dt, 2, hits[i].yaw, rebound, 0);
            w->bodies.thickness[bt_world_index(w, floe)] = h;
            add_body(w, (bt_impact_rule){.conversion = BT_IMPACT_DURATION, .duration = hits[i].duration}, false, 0);
            set_contact(w, rebound, 0);
            bt_impact e[10];
            assert_int_equal(run(w, (int)(0.3 / dt) + 5, e), 1);
            const double whole = hits[i].duration < 0.1 ? 1 : e[0].impulse / (sheet * speed);
            CHECK_CLOSE(e[0].peak, hits[i].peak * whole, 2e-3 * hits[i].peak);
            if (rebound == 0) CHECK_CLOSE(e[0].impulse, sheet * speed, 1e-3 * sheet * speed);
            CHECK_CLOSE(e[0].mean, 2 / BT_PI * e[0].peak, 1e-9 * e[0].peak);
            CHECK_CLOSE(e[0].mean * e[0].duration, e[0].impulse, 1e-9 * e[0].impulse);
            bt_world_free(w);
        }
}

/// A heap of many floes before a turning, free body: at every sample the panels together carry the ice force, panels
/// hold what touches there, and quasi-static load and collision make up the resistance.
TEST(panels_carry_the_ice_force)
{
    bt_params p = scene_params(0.1, 1);
    p.tolerance = 1e-6;
    bt_world *w = bt_world_create(&p);
    uint64_t rng = 3;
    for (int i = 0; i < 6; i++)
        for (int k = -6; k <= 6; k++) add_square(w, 0.8 + 1.45 * i, 1.45 * k + 0.1, 7 * scene_uniform(&rng), 0, 0.3);
    add_body(w, (bt_impact_rule){.conversion = BT_IMPACT_DURATION, .duration = 0.1}, true, 0.1);
    w->bodies.pose[bt_world_towed(w)].x = -5.6;
    set_contact(w, 0, 0.3);
    double turned = 0, collided = 0, in_steps = 0, in_events = 0, behind = 0, counted = 0;
    int64_t events = 0;
    for (int s = 0; s < 100; s++) {
        bt_sample o;
        const double yaw = w->bodies.pose[bt_world_towed(w)].yaw; // of the start of the step
        bt_world_step(w);
        if (s == 99) bt_impacts_end(w->impacts);
        bt_observe(w, speed, &o);
        double fx = 0, fy = 0, normal = 0;
        for (int k = 0; k < w->impacts->panels.n; k++) {
            const bt_panel *l = &w->impacts->panels.panel[k];
            fx += l->fx, fy += l->fy, normal += l->normal;
            if (k >= 16 && k < 24) behind += l->normal;
        }
        const double force = hypot(o.ice_force_x, o.ice_force_y);
        CHECK_CLOSE(cos(yaw) * fx - sin(yaw) * fy, o.ice_force_x, 1e-12 * (normal + 1));
        CHECK_CLOSE(sin(yaw) * fx + cos(yaw) * fy, o.ice_force_y, 1e-12 * (normal + 1));
        assert_true(normal >= force / hypot(1, 0.3) * (1 - 1e-9));
        assert_true(fabs(o.collision_resistance) <= fabs(o.ice_resistance) * (1 + 1e-9) + 0.4 * normal);
        for (int64_t i = 0; i < w->impacts->n_contacts; i++) in_steps += w->impacts->contact[i].collision;
        for (int64_t i = 0; i < w->impacts->n_closed; i++) in_events += w->impacts->closed[i].impulse;
        events += w->impacts->n_closed;
        counted += o.collisions;
        turned = fmax(turned, fabs(yaw - 0.1));
        collided += o.collision_resistance;
    }
    // No part of a collision is lost or counted twice on the way from steps to events.
    CHECK_CLOSE(in_events, in_steps, 1e-9 * in_steps);
    CHECK_CLOSE(counted, (double)events, 0);
    assert_true(turned > 1e-4 && collided > 0 && events > 10);
    // Loads only where ice was: panels 35..39 and 0..4 are the front side, 15..24 the rear.
    CHECK_CLOSE(behind, 0, 0);
    bt_world_free(w);
}

/// Panels of a square of side 10 in 40 pieces of 1 m: panel 0 is centred on the x axis, then anticlockwise.
TEST(panels_of_a_square)
{
    double v[8];
    scene_square(10, v);
    bt_panels p;
    bt_panels_init(&p, 40, 4, v);
    const struct {
        double x, y;
        int panel;
    } at[] = {{5.1, 0, 0},    {5, 0.49, 0}, {5, -0.49, 0},   {5, 0.51, 1}, {5, -0.51, 39}, {4.9, 4.4, 4},
              {0.1, 5.2, 10}, {-5, 0, 20},  {-5.3, 0.6, 19}, {0, -5, 30},  {9, 9, 5}};
    for (size_t i = 0; i < sizeof at / sizeof *at; i++)
        assert_int_equal(bt_panels_at(&p, at[i].x, at[i].y, 0, 0), at[i].panel);
    for (int k = 0; k < 40; k++) {
        double xy[2], n[2];
        bt_panels_point(&p, k + 0.5, xy, n);
        assert_int_equal(bt_panels_at(&p, xy[0], xy[1], 0, 0), k);
        CHECK_CLOSE(n[0] * xy[0] + n[1] * xy[1], 5, 1e-12);
    }
    double xy[2];
    bt_panels_point(&p, 0.5, xy, NULL);
    CHECK_CLOSE(xy[0], 5, 1e-12);
    CHECK_CLOSE(xy[1], 0, 1e-12);
    bt_panels_free(&p);
}

/// 36 panels of a square end at its corners: a load on a corner counts for the side it presses on, on the left as on
/// the right.
TEST(a_corner_belongs_to_the_side_pressed_on)
{
    double v[8];
    scene_square(10, v);
    bt_panels p;
    bt_panels_init(&p, 36, 4, v);
    const struct {
        double x, y, nx, ny;
        int panel;
    } at[] = {{5, 5, -1, 0, 4},  {5.01, 5.002, -1, 0.01, 4}, {5, 5, 0, -1, 5},   {5, -5, -1, 0, 32},
              {5, -5, 0, 1, 31}, {-5, 5, 1, 0, 14},          {-5, 5, 0, -1, 13}, {-5, -5, 0, 1, 23}};
    for (size_t i = 0; i < sizeof at / sizeof *at; i++)
        assert_int_equal(bt_panels_at(&p, at[i].x, at[i].y, at[i].nx, at[i].ny), at[i].panel);
    bt_panels_free(&p);
}

TEST_MAIN(NULL, NULL)
