// SPDX-License-Identifier: MIT
// Known answers of the towing operation: oscillation on the line, bridle, breaking, vessel, paths.
#include "scene.h"

enum { CORNERS = 24 };

/// A disc of 2 m², sheet kg/m², towed; the tow is left to the test.
static bt_world *tow_world(double dt, double sheet, bt_drag drag)
{
    bt_params p = scene_params(dt, 1);
    bt_world *w = bt_world_create(&p);
    double v[2 * CORNERS];
    bt_shape_regular(CORNERS, 2, v);
    bt_body_def d = scene_prism(CORNERS, v, sheet);
    d.large = true;
    d.drag = drag;
    w->towed = bt_world_add(w, &d);
    w->tow = bt_alloc(1, sizeof *w->tow);
    w->tow->dt = dt;
    w->tow->ux = 1;
    return w;
}

static void straight_path(bt_tow *t, double x, double y, double ux, double uy)
{
    char why[200];
    assert_true(bt_path_make(&t->path, x, y, 1, (double[]){x + ux, y + uy}, 0, why));
    t->path.n_marks = 0;
}

static double body_mass(const bt_world *w) { return w->bodies.mass[bt_world_towed(w)]; }
static bt_vel body_vel(const bt_world *w) { return w->bodies.vel[bt_world_towed(w)]; }

/// A vessel without power or drag.
static bt_world *vessel_world(double dt, double sheet, double vessel_mass, double k, double c, double stretch)
{
    bt_world *w = tow_world(dt, sheet, (bt_drag){0});
    bt_tow *t = w->tow;
    t->mode = BT_TOW_THRUST;
    t->n_branches = 1;
    t->branch[0] = (bt_branch){.length0 = 10, .k = k, .c = c};
    t->carriage_x = 10 + stretch;
    t->vessel = (bt_vessel){.mass = vessel_mass, .free_speed = 1, .lateral = 1, .lookahead = 100};
    straight_path(t, 10, 0, 1, 0);
    return w;
}

/// Two masses on a line stretched by s0 and let go oscillate with the reduced mass μ = m M/(m + M):
/// stretch s0 e^(−ct/2μ) (cos ωt + (c/2μω) sin ωt), ω² = k/μ − (c/2μ)², until the line goes slack; their centre of mass
/// stays.
TEST(free_vessel_and_body_swing_with_the_reduced_mass)
{
    const double ratios[] = {0.02, 1, 50}, dampings[] = {0, 0.3};
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 2; j++) {
            const double dt = 2e-3, m = 100, big = ratios[i] * m, mu = m * big / (m + big), k = 40 * mu, s0 = 0.05;
            const double c = 2 * dampings[j] * sqrt(k * mu), half = 0.5 * c / mu, om = sqrt(k / mu - half * half);
            bt_world *w = vessel_world(dt, 50, big, k, c, s0);
            assert_true(fabs(body_mass(w) - m) < 1e-9);
            const int n = (int)(0.9 * acos(half / sqrt(half * half + om * om)) / om / dt); // before the tension is gone
            double worst = 0, worst_t = 0;
            for (int s = 1; s <= n; s++) {
                bt_world_step(w);
                const double t = s * dt, e = exp(-half * t), stretch = s0 * e * (cos(om * t) + half / om * sin(om * t));
                worst = bt_max(worst, fabs(w->tow->carriage_x - w->tow->travel_x - 10 - stretch));
                const double tm = t - 0.5 * dt, em = exp(-half * tm);
                const double tension =
                    s0 * em * (k * cos(om * tm) + (k * half / om - c * (half * half + om * om) / om) * sin(om * tm));
                worst_t = bt_max(worst_t, fabs(bt_tow_tension(w->tow, 0) - tension));
                CHECK_CLOSE(m * body_vel(w).x + big * w->tow->vessel.vx, 0, 1e-12 * m);
            }
            CHECK_CLOSE(worst, 0, 0.01 * s0);
            CHECK_CLOSE(worst_t, 0, 0.02 * k * s0);
            bt_world_free(w);
        }
}

/// Period by zero crossings of the swing about a mean tension: body and vessel pulled apart by drag-free constant
/// thrust would drift, so the end stands and the wind pulls; ω² = k/m, decrement e^(−cT/2m).
TEST(body_in_the_wind_swings_on_a_fixed_end)
{
    const double dt = 0.01, k = 40, c = 8;
    bt_world *w = tow_world(dt, 50, (bt_drag){0});
    w->par.tilt_ax = -0.05; // a steady force m × 0.05 against the line
    bt_tow *t = w->tow;
    t->mode = BT_TOW_LINE;
    t->n_branches = 1;
    t->branch[0] = (bt_branch){.length0 = 10, .k = k, .c = c};
    t->carriage_x = 10;
    const double m = body_mass(w), rest = -m * 0.05 / k, half = 0.5 * c / m, om = sqrt(k / m - half * half);
    double crossing[6], peak[6] = {0};
    int n = 0;
    double before = 0;
    for (int s = 1; n < 6; s++) {
        bt_world_step(w);
        assert_true(s < 100000 && bt_tow_tension(t, 0) > 0);
        const double x = t->travel_x - rest; // from +|rest| down
        peak[n] = bt_max(peak[n], fabs(x));
        if (s > 1 && (x > 0) != (before > 0)) crossing[n++] = (s - x / (x - before)) * dt;
        before = x;
    }
    for (int i = 1; i < 6; i++) CHECK_CLOSE(crossing[i] - crossing[i - 1], BT_PI / om, 0.002 * BT_PI / om);
    for (int i = 2; i < 6; i++) CHECK_CLOSE(peak[i] / peak[i - 1], exp(-half * BT_PI / om), 0.01);
    bt_world_free(w);
}

/// A slack line does not damp: a heavily damped one pays out its metre of slack without a force, and pulls from then
/// on.
TEST(a_slack_line_is_no_damper)
{
    bt_world *w = tow_world(0.1, 50, (bt_drag){.water_skin = 80});
    bt_tow *t = w->tow;
    t->mode = BT_TOW_LINE;
    t->n_branches = 1;
    t->branch[0] = (bt_branch){.length0 = 10, .k = 4, .c = 1000};
    t->speed = 0.5;
    t->carriage_x = 9; // taut after 2 s
    for (int s = 1; s <= 30; s++) {
        bt_world_step(w);
        if (s < 20) CHECK_CLOSE(bt_tow_tension(t, 0), 0, 0);
        if (s > 21) assert_true(bt_tow_tension(t, 0) > 1);
    }
    bt_world_free(w);
}

/// What a solution begins from: the impulse of the last step in a branch that is taut, none in a slack one, none at all
/// where there is no last step.
TEST(a_slack_branch_begins_from_nothing)
{
    for (int keep = 0; keep < 2; keep++) {
        bt_tow t = {.n_branches = 2, .branch = {{.taut = true, .lambda = 3}, {.taut = false, .lambda = 4}}};
        bt_tow_warm_start(&t, keep);
        assert_true(t.branch[0].lambda == (keep ? 3 : 0) && t.branch[1].lambda == 0);
    }
}

/// A stretched line that slackens within the step damps as long as it is stretched:
/// T Δt = Δt (k s − c v) / (1 + Δt c/m).
TEST(a_stretched_line_damps_while_it_slackens)
{
    const double dt = 0.1, k = 40, c = 1, stretch = 0.01, v = 0.3;
    bt_world *w = tow_world(dt, 50, (bt_drag){0});
    bt_tow *t = w->tow;
    t->mode = BT_TOW_LINE;
    t->n_branches = 1;
    t->branch[0] = (bt_branch){.length0 = 10, .k = k, .c = c};
    t->carriage_x = 10 + stretch;
    w->bodies.vel[bt_world_towed(w)].x = v;
    bt_world_step(w);
    assert_true(dt * v > stretch);
    CHECK_CLOSE(bt_tow_tension(t, 0), (k * stretch - c * v) / (1 + dt * c / body_mass(w)), 1e-12);
    bt_world_free(w);
}

/// A vessel without thrust on a slack line goes with the current, along its course and across.
TEST(a_vessel_drifts_with_the_current)
{
    bt_world *w = vessel_world(0.1, 50, 1000, 1, 0, -20);
    bt_tow *t = w->tow;
    t->vessel.bollard_pull = 500;
    t->vessel.free_resistance = 1e5;
    w->par.water_u = 0.1, w->par.water_v = -0.4;
    for (int s = 0; s < 50; s++) bt_world_step(w); // within 1 / (1 + R t/M)
    CHECK_CLOSE(t->vessel.vx, 0.1, 1e-2);
    CHECK_CLOSE(t->vessel.vy, -0.4, 1e-2);
    bt_world_free(w);
}

/// Bridle: two branches at ±0.6 m. Their stiffnesses add along the tow; a body that is turned is turned back. Against
/// drag k_d V² each carries half, more by the angle between them.
TEST(bridle_shares_the_load)
{
    bt_world *w = tow_world(0.1, 50, (bt_drag){.water_skin = 80, .yaw = 60});
    bt_tow *t = w->tow;
    const double v = 0.5, l = 5;
    t->mode = BT_TOW_LINE;
    t->n_branches = 2;
    for (int i = 0; i < 2; i++)
        t->branch[i] = (bt_branch){.length0 = l, .k = 2000, .c = 500, .hull_x = 0.2, .hull_y = i ? -0.6 : 0.6};
    t->speed = v;
    t->carriage_x = 0.2 + sqrt(l * l - 0.36);
    bt_idx i = bt_world_towed(w);
    w->bodies.pose[i].yaw = 0.2;
    bt_bodies_turn(&w->bodies, i);
    for (int s = 0; s < 20000; s++) {
        bt_world_step(w);
        assert_true(w->stats.converged);
    }
    CHECK_CLOSE(w->bodies.pose[bt_world_towed(w)].yaw, 0, 1e-6);
    const double stretched = t->branch[0].length, cosine = sqrt(stretched * stretched - 0.36) / stretched;
    for (int k = 0; k < 2; k++) CHECK_CLOSE(bt_tow_tension(t, k), 0.5 * 80 * v * v / cosine, 1e-6 * 80 * v * v);
    CHECK_CLOSE(stretched, l + 0.5 * 80 * v * v / cosine / 2000, 1e-9);
    bt_world_free(w);
}

/// T below and above the breaking load by a thousandth. The load grows slowly: the tension of a ramp a of the end is,
/// for a fixed body, k a t²/2.
TEST(a_branch_breaks_at_its_load)
{
    for (int above = 0; above < 2; above++) {
        const double drag = 80, v = 0.5, load = drag * v * v;
        bt_world *w = tow_world(0.1, 50, (bt_drag){.water_skin = drag});
        bt_tow *t = w->tow;
        t->mode = BT_TOW_LINE;
        t->n_branches = 1;
        // Critically damped and ramped: the tension comes up to the drag without overshoot.
        t->branch[0] = (bt_branch){.length0 = 10, .k = 50, .c = 400, .breaking = load * (above ? 0.999 : 1.001)};
        t->carriage_x = 10;
        t->speed = v;
        t->ramp = 600;
        double most = 0, broke = 0;
        for (int s = 0; s < 20000; s++) {
            bt_world_step(w);
            const double tension = bt_tow_tension(t, 0);
            if (broke > 0) CHECK_CLOSE(tension, 0, 0);
            most = bt_max(most, tension);
            if (tension > t->branch[0].breaking) broke = (double)w->step * 0.1;
        }
        if (above) {
            assert_true(broke > 0 && t->branch[0].broken);
            assert_int_equal(w->events.n, 2);
            assert_int_equal(w->events.event[0].kind, BT_EVENT_LINE_BROKEN);
            assert_int_equal(w->events.event[0].subject, 1);
            CHECK_CLOSE(w->events.event[0].time, broke, 1e-9);
            assert_true(w->events.event[0].value > t->branch[0].breaking && w->events.event[0].value == most);
            assert_int_equal(w->events.event[1].kind, BT_EVENT_ADRIFT);
            assert_true(body_vel(w).x < 0.1 * v); // drag has stopped it
        } else {
            assert_int_equal(w->events.n, 0);
            CHECK_CLOSE(most, load, 1e-6 * load);
            CHECK_CLOSE(body_vel(w).x, v, 1e-6);
        }
        bt_world_free(w);
    }
}

/// Of two branches the shorter breaks first; the other carries all and holds.
TEST(the_other_branch_takes_over)
{
    bt_world *w = tow_world(0.1, 50, (bt_drag){.water_skin = 80, .yaw = 60});
    bt_tow *t = w->tow;
    t->mode = BT_TOW_LINE;
    t->n_branches = 2;
    t->branch[0] = (bt_branch){.length0 = 5.1, .k = 2000, .c = 500, .hull_x = 0.2, .hull_y = 0.5, .breaking = 100};
    t->branch[1] = (bt_branch){.length0 = 5, .k = 2000, .c = 500, .hull_x = 0.2, .hull_y = -0.5, .breaking = 8};
    t->speed = 0.5;
    t->ramp = 100;
    t->carriage_x = 5.1;
    for (int s = 0; s < 20000; s++) bt_world_step(w);
    assert_int_equal(w->events.n, 1);
    assert_int_equal(w->events.event[0].subject, 2);
    assert_true(!t->branch[0].broken && t->branch[1].broken);
    CHECK_CLOSE(bt_tow_tension(t, 1), 0, 0);
    CHECK_CLOSE(bt_tow_tension(t, 0), 80 * 0.25, 1e-3);
    // The hull point of the branch that is left leads.
    const double yaw = w->bodies.pose[bt_world_towed(w)].yaw;
    CHECK_CLOSE(remainder(yaw + atan2(0.5, 0.2), 2 * BT_PI), 0, 1e-3);
    bt_world_free(w);
}

/// Momentum of the vessel in the step just done, along and across the course, relative to the largest term.
static double vessel_closure(const bt_tow *t)
{
    const bt_vessel *s = &t->vessel;
    double pull[2] = {0, 0};
    for (int k = 0; k < t->n_branches; k++) {
        pull[0] += t->branch[k].lambda * (t->branch[k].lx * t->ux + t->branch[k].ly * t->uy);
        pull[1] += t->branch[k].lambda * (t->branch[k].ly * t->ux - t->branch[k].lx * t->uy);
    }
    const double drag[2] = {t->dt * s->kd * (s->vd2 - s->ud), t->dt * s->kn * (s->vn2 - s->un)};
    const double gain[2] = {s->mass * (s->vd2 - s->vd1), s->mass * (s->vn2 - s->vn1)};
    const double scale = bt_max(bt_max(fabs(s->thrust), hypot(pull[0], pull[1])),
                                bt_max(hypot(drag[0], drag[1]), s->mass * hypot(s->vd2, s->vn2)));
    return scale > 0 ? hypot(s->thrust - drag[0] - gain[0] - pull[0], drag[1] + gain[1] + pull[1]) / scale : 0;
}

/// Full power: T_b (1 − (v/s_f)²) = k_d v². Governed: v of the programme, thrust R_f (v/s_f)² + k_d v². In a current U
/// along the course both drags are by the speed through the water, the governor by that over ground. Any step up to 5
/// s, any line, a vessel a hundredth of the body or heavier.
TEST(vessel_bollard_equilibrium)
{
    const double steps[] = {0.1, 5}, stiff[] = {10, 1e4, 1e9}, mass[] = {1, 100, 3000}, current[] = {0, 0.3};
    const double kd = 80, tb = 400, sf = 6, rf = 150;
    for (int a = 0; a < 2; a++)
        for (int b = 0; b < 3; b++)
            for (int c = 0; c < 3; c++)
                for (int e = 0; e < 2; e++)
                    for (int governed = 0; governed < 2; governed++) {
                        bt_world *w = tow_world(steps[a], 50, (bt_drag){.water_skin = kd});
                        w->par.water_u = current[e];
                        bt_tow *t = w->tow;
                        t->mode = BT_TOW_THRUST;
                        t->n_branches = 1;
                        t->branch[0] = (bt_branch){.length0 = 10, .k = stiff[b], .c = 0.2 * sqrt(stiff[b] * mass[c])};
                        t->carriage_x = 10;
                        t->vessel = (bt_vessel){.mass = mass[c],
                                                .bollard_pull = tb,
                                                .free_speed = sf,
                                                .free_resistance = rf,
                                                .lateral = 10,
                                                .lookahead = 50};
                        straight_path(t, 10, 0, 1, 0);
                        t->speed = governed ? 1.5 : 50;
                        double fastest = 0;
                        const int n = a ? 4000 : 8000;
                        for (int s = 0; s < n; s++) {
                            bt_world_step(w);
                            assert_true(w->stats.converged);
                            assert_true(vessel_closure(t) < 1e-12);
                            fastest = bt_max(fastest, t->vessel.vx);
                        }
                        const double through = governed ? 1.5 - current[e] : sqrt(tb / (kd + tb / sf / sf)),
                                     v = through + current[e];
                        CHECK_CLOSE(t->vessel.vx, v, 1e-6 * v);
                        CHECK_CLOSE(body_vel(w).x, v, 1e-6 * v);
                        CHECK_CLOSE(bt_tow_tension(t, 0), kd * through * through, 1e-5 * kd * through * through);
                        const double thrust = (kd + rf / sf / sf) * through * through;
                        CHECK_CLOSE(t->vessel.thrust / steps[a], thrust, 1e-5 * thrust);
                        if (governed) assert_true(fastest <= 1.5 * (1 + 1e-12));
                        bt_world_free(w);
                    }
}

static double energy(const bt_world *w)
{
    const bt_tow *t = w->tow;
    const bt_idx i = bt_world_towed(w);
    const bt_vel v = w->bodies.vel[i];
    double e = 0.5 * (w->bodies.mass[i] * (v.x * v.x + v.y * v.y) + w->bodies.inertia[i] * v.w * v.w) +
               0.5 * t->vessel.mass * (t->vessel.vx * t->vessel.vx + t->vessel.vy * t->vessel.vy);
    for (int k = 0; k < t->n_branches; k++) {
        const bt_branch *b = &t->branch[k];
        const double x = t->travel_x + cos(w->bodies.pose[i].yaw) * b->hull_x - sin(w->bodies.pose[i].yaw) * b->hull_y;
        const double y = t->travel_y + sin(w->bodies.pose[i].yaw) * b->hull_x + cos(w->bodies.pose[i].yaw) * b->hull_y;
        const double stretch = hypot(t->carriage_x - x, t->carriage_y - y) - b->length0;
        if (stretch > 0) e += 0.5 * b->k * stretch * stretch;
    }
    return e;
}

/// A stretched bridle between free body and vessel, no damping, no drag, Δt 5 s, stiffness over eleven decades and
/// unequal by ten: the energy never grows beyond what the line held (twice that while the swing is resolved coarsely, h
/// < 2).
TEST(a_bridle_is_stable_at_any_stiffness)
{
    for (double k = 1e-3; k < 1e9; k *= 10)
        for (int light = 0; light < 2; light++) {
            bt_world *w = vessel_world(5, 50, light ? 1 : 100, k, 0, 0.05);
            bt_tow *t = w->tow;
            t->n_branches = 2;
            for (int i = 0; i < 2; i++)
                t->branch[i] = (bt_branch){.length0 = 10, .k = i ? 10 * k : k, .hull_y = i ? -0.3 : 0.3};
            const double e0 = energy(w);
            double most = 0;
            for (int s = 0; s < 6000; s++) {
                bt_world_step(w);
                assert_true(w->stats.converged);
                most = bt_max(most, energy(w));
            }
            if (!(most <= 2 * e0)) fail_msg("k %g, vessel %d: energy grew %g-fold", k, light, most / e0);
            bt_world_free(w);
        }
}

/// No astern: a vessel that runs out its way against its own drag alone, 1/v = 1/v0 + k t/M.
TEST(a_stopped_programme_leaves_the_vessel_to_its_drag)
{
    bt_world *w = vessel_world(1, 50, 1000, 1, 0, -20); // 20 m of slack
    bt_tow *t = w->tow;
    t->vessel.vx = 2;
    t->vessel.bollard_pull = 500;
    t->vessel.free_resistance = 10;
    for (int s = 0; s < 5; s++) bt_world_step(w);
    CHECK_CLOSE(t->vessel.vx, 1 / (0.5 + 10 * 5.0 / 1000), 1e-12);
    CHECK_CLOSE(t->vessel.thrust, 0, 0);
    bt_world_free(w);
}

/// A heavy body pushed into a row of light floes against a wall, on a bridle of a light vessel: contact forces, line
/// and thrust in one system, solved to the tolerance, and in the end at rest, with thrust = tension = push on the wall.
TEST(rows_and_contacts_are_one_system)
{
    const double stiff[] = {1e2, 1e8};
    for (int i = 0; i < 2; i++) {
        bt_params p = scene_params(5, 1);
        p.tolerance = 1e-8;
        bt_world *w = bt_world_create(&p);
        double v[8], big[2 * CORNERS];
        scene_square(1, v);
        for (int k = 0; k < 6; k++) {
            bt_body_def d = scene_prism(4, v, 10);
            d.x = 2.3 + 1.05 * k, d.y = 0.01 * k, d.friction = 0.3, d.drag = (bt_drag){.water_skin = 1, .yaw = 1};
            bt_world_add(w, &d);
        }
        bt_shape_regular(CORNERS, 8, big);
        bt_body_def d = scene_prism(CORNERS, big, 2000);
        d.large = true, d.drag = (bt_drag){.water_skin = 50, .yaw = 50}, d.friction = 0.3;
        w->towed = bt_world_add(w, &d);
        scene_wall(w, 9, -5, 12, 5, 0.3);
        w->tow = bt_alloc(1, sizeof *w->tow);
        bt_tow *t = w->tow;
        *t = (bt_tow){.mode = BT_TOW_THRUST, .ux = 1, .dt = 5, .speed = 0.5, .n_branches = 2, .carriage_x = 20.2};
        for (int k = 0; k < 2; k++)
            t->branch[k] = (bt_branch){
                .length0 = 20, .k = stiff[i], .c = 10 * sqrt(stiff[i]), .hull_x = 0.5, .hull_y = k ? -1 : 1};
        t->vessel = (bt_vessel){
            .mass = 200, .bollard_pull = 400, .free_speed = 5, .free_resistance = 100, .lateral = 10, .lookahead = 50};
        straight_path(t, 20.2, 0, 1, 0);
        for (int s = 0; s < 200; s++) {
            bt_world_step(w);
            assert_true(w->stats.converged);
            assert_true(w->stats.momentum_residual < 1e-9 && vessel_closure(t) < 1e-12);
        }
        double wall = 0; // normal impulse on it
        for (bt_idx k = 0; k < w->cells->n; k++)
            for (bt_idx j = 0; j < w->cells->cell[k].n_contacts; j++) {
                const bt_contact *u = &w->cells->cell[k].contacts[j];
                if (w->bodies.inv[u->b].m == 0) wall += (u->ln[0] + u->ln[1]) * u->nx - u->lt * u->ny;
            }
        const double pull = bt_tow_tension(t, 0) * t->branch[0].lx + bt_tow_tension(t, 1) * t->branch[1].lx;
        CHECK_CLOSE(body_vel(w).x, 0, 1e-4);
        CHECK_CLOSE(t->vessel.thrust / 5, 400, 0.4);
        CHECK_CLOSE(pull, 400, 2);
        CHECK_CLOSE(wall / 5, 400, 2);
        bt_world_free(w);
    }
}

/// The end of a line, and in mode speed the body, are on the path to rounding at every step, and have gone the integral
/// of the programme.
TEST(the_end_follows_the_path_exactly)
{
    const double points[] = {60, 0, 90, 30, 90, 80};
    const bt_tow_mode modes[] = {BT_TOW_LINE, BT_TOW_SPEED};
    for (int i = 0; i < 2; i++)
        for (int round = 0; round < 2; round++) {
            bt_world *w = tow_world(0.5, 50, (bt_drag){.water_skin = 10, .yaw = 1});
            bt_tow *t = w->tow;
            const bool line = modes[i] == BT_TOW_LINE;
            const double x0 = line ? 10 : 0;
            char why[200];
            t->mode = modes[i];
            t->n_branches = line;
            t->branch[0] = (bt_branch){.length0 = 10, .k = 100, .c = 50};
            t->carriage_x = x0;
            if (!line)
                w->bodies.motion[bt_world_towed(w)] = BT_KINEMATIC, w->bodies.inv[bt_world_towed(w)] = (bt_inv){0};
            assert_true(bt_path_make(&t->path, x0, 0, 3, points, round ? 12 : 0, why));
            t->programme = bt_alloc(4, 2 * sizeof(double));
            memcpy(t->programme, (double[]){0, 0, 20, 1, 120, 1, 140, 0}, 8 * sizeof(double));
            t->n_programme = 4;
            double way = 0;
            for (int s = 1; s <= 320; s++) {
                const double yaw = w->bodies.pose[bt_world_towed(w)].yaw;
                bt_world_step(w);
                way += 0.5 * bt_tow_speed(t, 0.5 * s);
                double at[2], tangent[2];
                bt_path_at(&t->path, way, at, tangent);
                CHECK_CLOSE(line ? t->carriage_x : t->travel_x, at[0], 1e-11);
                CHECK_CLOSE(line ? t->carriage_y : t->travel_y, at[1], 1e-11);
                if (!line) assert_true(w->bodies.pose[bt_world_towed(w)].yaw == yaw);
            }
            CHECK_CLOSE(way, 10 + 100 + 10, 1e-9);
            CHECK_CLOSE(t->ux, 0, 1e-12); // on the last leg, and there the course is kept at rest
            CHECK_CLOSE(t->uy, 1, 1e-12);
            assert_int_equal(w->events.n, t->path.mark[2] < 120 ? 3 : 2);
            for (int k = 0; k < (int)w->events.n; k++) {
                assert_int_equal(w->events.event[k].kind, BT_EVENT_WAYPOINT);
                assert_int_equal(w->events.event[k].subject, k + 1);
                // The programme reaches way s at t = s + 10 while at 1 m/s.
                if (t->path.mark[k] > 10 && t->path.mark[k] < 110)
                    assert_true(w->events.event[k].time >= t->path.mark[k] + 10 - 1e-9 - 0.26 &&
                                w->events.event[k].time < t->path.mark[k] + 10 + 0.51);
            }
            bt_world_free(w);
        }
}

/// A vessel 10 m ahead of its body, ordered 1 m/s, and what it needs to keep a track.
static bt_world *piloted_world(void)
{
    bt_world *w = tow_world(1, 50, (bt_drag){.water_skin = 30, .yaw = 30});
    bt_tow *t = w->tow;
    t->mode = BT_TOW_THRUST;
    t->n_branches = 1;
    t->branch[0] = (bt_branch){.length0 = 10, .k = 100, .c = 100};
    t->carriage_x = 10;
    t->speed = 1;
    t->vessel = (bt_vessel){
        .mass = 500, .bollard_pull = 300, .free_speed = 6, .free_resistance = 100, .lateral = 20, .lookahead = 20};
    return w;
}

/// A vessel with a current abeam keeps its track: no cross-track error is left but what the current's drag makes.
TEST(a_vessel_keeps_its_track_and_passes_the_waypoints)
{
    bt_world *w = piloted_world();
    bt_tow *t = w->tow;
    char why[200];
    assert_true(bt_path_make(&t->path, 10, 0, 2, (double[]){300, 0, 300, 1000}, 0, why));
    double across = 0, after = 0;
    for (int s = 0; s < 1000; s++) {
        bt_world_step(w);
        assert_true(vessel_closure(t) < 1e-12);
        if (t->carriage_x < 280) across = bt_max(across, fabs(t->carriage_y));
        if (t->vessel.way > 400) after = bt_max(after, fabs(t->carriage_x - 300));
    }
    CHECK_CLOSE(across, 0, 1e-9);
    assert_true(after < 2 && t->carriage_y > 500);
    assert_true(fabs(t->carriage_x - 300) < 0.05);
    assert_int_equal(w->events.n, 1);
    assert_int_equal(w->events.event[0].kind, BT_EVENT_WAYPOINT);
    bt_world_free(w);
}

/// Way-points whose course changes by more than 90°, sharp or round: on the leg before, the point ahead can lie abeam
/// of the vessel, which once hung there for ever.
TEST(a_vessel_turns_back)
{
    const struct { double degrees, radius;
    } corner[] = {{97, 0}, {120, 0}, {120, 5}, {150, 2}, {179, 0}};
    for (size_t k = 0; k < sizeof corner / sizeof *corner; k++) {
        bt_world *w = piloted_world();
        bt_tow *t = w->tow;
        char why[200];
        const double a = corner[k].degrees * BT_PI / 180, x = 60 + 200 * cos(a), y = 200 * sin(a);
        assert_true(bt_path_make(&t->path, 10, 0, 2, (double[]){60, 0, x, y}, corner[k].radius, why));
        for (int s = 0; s < 400; s++) bt_world_step(w);
        assert_int_equal(t->mark, 2);
        // on the leg after, on its line
        CHECK_CLOSE((t->carriage_y - y) * cos(a) - (t->carriage_x - x) * sin(a), 0, 0.1);
        assert_true((t->carriage_x - x) * cos(a) + (t->carriage_y - y) * sin(a) > 0);
        bt_world_free(w);
    }
}

TEST_MAIN(NULL, NULL)
