// SPDX-License-Identifier: MIT
// What a step's sample says of the towed body: force and moment of the ice on it, whichever of the two bodies of a
// contact it is, against the momentum of the other body; drag of the vessel in a current; contact forces of floes.
#include "scene.h"

#include "output/observe.h"
#include "step/edit.h"

/// A square that stands on its corner slides along the flat side of the towed body, with friction. What the towed body
/// feels is what the square loses, at the point of its corner; the bodies are added in either order.
TEST(force_and_moment_on_the_towed_body)
{
    for (int towed_first = 0; towed_first < 2; towed_first++) {
        const bt_params p = scene_params(0.1, 1);
        bt_world *w = bt_world_create(&p);
        double hull[8], floe[8];
        scene_square(4, hull);
        scene_square(1, floe);
        const double corner = sqrt(0.5), y = 1.3;
        bt_gid gid[2];
        for (int k = 0; k < 2; k++) {
            const bool towed = towed_first ? k == 0 : k == 1;
            bt_body_def d = scene_prism(4, towed ? hull : floe, 100);
            d.friction = 0.3;
            if (!towed) d.x = 2 + corner + 0.001, d.y = y, d.yaw = BT_PI / 4, d.vx = -0.5, d.vy = 0.4;
            else d.large = true;
            gid[towed] = bt_world_add(w, &d);
        }
        w->towed = gid[1];
        w->tow = bt_alloc(1, sizeof *w->tow);
        *w->tow = (bt_tow){.mode = BT_TOW_LINE, .ux = 1, .dt = p.dt};
        const bt_vel before = w->bodies.vel[bt_world_index(w, gid[0])];
        bt_sample s;
        bt_world_step(w);
        bt_observe(w, 1, &s);
        const bt_idx i = bt_world_index(w, gid[0]); // a step may sort the storage
        const bt_vel after = w->bodies.vel[i];
        const double fx = -w->bodies.mass[i] * (after.x - before.x) / p.dt,
                     fy = -w->bodies.mass[i] * (after.y - before.y) / p.dt;
        assert_true(fx < -10 && fy > 1);
        CHECK_CLOSE(s.ice_force_x, fx, 1e-9 * fabs(fx));
        CHECK_CLOSE(s.ice_force_y, fy, 1e-9 * fabs(fx));
        CHECK_CLOSE(s.ice_moment, 2 * fy - y * fx, 0.01 * fabs(y * fx)); // arms to the middle of a gap of 1 mm
        bt_world_free(w);
    }
}

/// Linear drag of the vessel is that of its speed through the water.
TEST(vessel_in_a_current)
{
    const bt_params p = scene_params(0.1, 1);
    bt_world *w = bt_world_create(&p);
    double v[8];
    scene_square(4, v);
    bt_body_def d = scene_prism(4, v, 100);
    d.large = true;
    w->towed = bt_world_add(w, &d);
    w->tow = bt_alloc(1, sizeof *w->tow);
    *w->tow = (bt_tow){.mode = BT_TOW_THRUST, .ux = 1, .dt = p.dt, .n_branches = 0,
                       .vessel = {.kd = 50, .vd1 = 1.5, .vd2 = 2, .ud = 0.5, .mass = 10, .thrust = 7}};
    bt_cells_begin(w);
    bt_sample s;
    bt_observe(w, 1, &s);
    assert_true(s.vessel_drag == 75 && s.vessel_speed == 2 && s.vessel_thrust == 70 && s.vessel_inertia == 50);
    bt_world_free(w);
}

/// Two squares that have rafted are drawn apart: friction of the sheets is spread over them, and no contact bears it.
TEST(sheets_are_no_contact)
{
    bt_params p = scene_params(0.1, 10);
    p.slop = 0.01;
    double *own = p.law_own[BT_LAW_RAFTING];
    own[BT_RAFT_LINE] = 4e3, own[BT_RAFT_RISE] = own[BT_RAFT_SHEET] = 1e3;
    bt_world *w = bt_world_create(&p);
    double v[8];
    for (int k = 0; k < 2; k++) {
        scene_square(10, v);
        bt_body_def d = scene_prism(4, v, 900);
        d.x = -10.01 * k, d.vx = k ? 1 : -1, d.thickness = 1, d.friction = 0.3;
        bt_world_add(w, &d);
    }
    double force[2];
    int edges = 0, sheets = 0;
    for (int n = 0; n < 100; n++) {
        bt_world_step(w);
        bt_observe_contact_force(w, force);
        edges += force[0] > 1e3 && force[1] == force[0];
        if (n == 60)
            for (int k = 0; k < 2; k++) w->bodies.vel[k].x *= -1, w->bodies.vel[k].x += w->bodies.gid[k] ? -0.5 : 0.5;
        if (n < 65) continue;
        assert_true(force[0] == 0 && force[1] == 0);
        sheets += scene_law(w, "raft_friction_work") > 0;
    }
    assert_true(edges > 3 && sheets > 3);
    bt_world_free(w);
}

/// Two squares that meet: what each has from the other is opposite, and the momentum it gained; the same where the
/// second is a body that forces are taken of by its contacts. A velocity that is set afterwards is no force.
TEST(net_forces_of_two)
{
    bt_params p = scene_params(0.1, 10);
    bt_world *w = bt_world_create(&p);
    double v[8], force[2][2], by_contacts[2][2];
    for (int k = 0; k < 2; k++) {
        scene_square(10, v);
        bt_body_def d = scene_prism(4, v, 900);
        d.x = -10.02 * k, d.vx = k ? 1 : -1;
        bt_world_add(w, &d);
    }
    bt_observe_net_force(&bt_comm_alone, w, &(bt_roster){.n_free = 2}, force);
    assert_true(force[0][0] == 0 && force[1][0] == 0);
    bt_world_step(w);
    const bt_bodies *b = &w->bodies;
    const int i = b->gid[0] == 0 ? 0 : 1;
    bt_observe_net_force(&bt_comm_alone, w, &(bt_roster){.n_free = 2}, force);
    assert_true(force[i][0] > 1e4 && fabs(force[0][0] + force[1][0]) < 1e-9 * force[i][0]);
    assert_true(fabs(force[i][1]) < 1e-9 * force[i][0]);
    assert_float_equal(force[i][0], b->mass[i] * (b->vel[i].x - b->vel_start[i].x) / 0.1, 0.1 * force[i][0]); // drag
    bt_observe_net_force(&bt_comm_alone, w, &(bt_roster){.n_free = 1}, by_contacts);
    assert_float_equal(by_contacts[1 - i][0], force[1 - i][0], 1e-9 * force[i][0]);
    bt_errors err = {0};
    assert_int_equal(bt_edit_velocity(w, 0, (const double[3]){7, 8, 9}, &err), BT_OK);
    bt_observe_net_force(&bt_comm_alone, w, &(bt_roster){.n_free = 2}, by_contacts);
    assert_float_equal(by_contacts[i][0], force[i][0], 1e-9 * force[i][0]);
    bt_world_free(w);
}

TEST_MAIN(NULL, NULL)
