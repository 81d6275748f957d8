// SPDX-License-Identifier: MIT
// Guards: each fires at its limit and not below, at every step and at the end, names the step, and can be switched off;
// every number is looked at; the scale of the energy bounds what wind, current, tide and slope can do.
#include "scene.h"

#include <unistd.h>

#include "bergtow/run.h"
#include "contact/contacts.h"
#include "loads/impact.h"
#include "output/observe.h"
#include "run/setup.h"
#include "space/cells.h"
#include "step/window.h"
#include "run/guard.h"

static bt_world *two_floes(void)
{
    const bt_params p = scene_params(0.1, 1);
    bt_world *w = bt_world_create(&p);
    double v[8] = {0.5, 0.5, -0.5, 0.5, -0.5, -0.5, 0.5, -0.5};
    for (int k = 0; k < 2; k++) {
        bt_body_def d = scene_prism(4, v, 100);
        d.x = 3 * k + 1, d.y = 2;
        bt_world_add(w, &d);
    }
    bt_cells_begin(w);
    w->step = 50;
    return w;
}

static bt_case a_case(void)
{
    bt_case c;
    bt_case_defaults(&c);
    c.domain.x0 = c.domain.y0 = 0;
    c.domain.length = 10, c.domain.width = 4;
    c.tow.mode = BT_TOW_SPEED;
    c.tow.speed = 0.2;
    c.guard.overlap = 0.5, c.guard.energy = 100, c.guard.unconverged = 3;
    return c;
}

/// A sample in which nothing is wrong.
static bt_sample sound_sample(const bt_world *w)
{
    bt_sample s;
    memset(&s, 0, sizeof s);
    const unsigned has = bt_observe_applies(w);
    for (int k = 0; k < bt_n_series(); k++)
        if (!(has & 1u << bt_series(k)->applies)) bt_sample_set(&s, bt_series(k), NAN);
    return s;
}

/// part: of the message, NULL = none. end: of the run, with this overlap.
static void expect_of(bt_guard *g, bt_world *w, const bt_sample *s, bool end, const char *part)
{
    bt_errors err = {0};
    const bt_status status = end ? bt_guard_check_end(g, w, s->overlap, &err) : bt_guard_check(g, w, s, &err);
    if (status == BT_ERR_NUMERIC) bt_guard_name(g, w, &err);
    if (!part) {
        if (status != BT_OK || err.n) fail_msg("refused: %s", err.n ? err.text[0] : "no message");
        return;
    }
    assert_int_equal(status, BT_ERR_NUMERIC);
    if (err.n != 1) fail_msg("%d messages, wanted one with \"%s\"", (int)err.n, part);
    if (!strstr(err.text[0], part) || !strstr(err.text[0], "step 5")) fail_msg("%s", err.text[0]);
    bt_errors_free(&err);
}

static void expect(bt_guard *g, bt_world *w, const bt_sample *s, const char *part)
{
    expect_of(g, w, s, false, part);
}

TEST(guards_fire_at_their_limits)
{
    bt_case c = a_case();
    bt_world *w = two_floes();
    bt_guard g = {0};
    bt_sample s = sound_sample(w);
    const double mass = w->bodies.mass[0] + w->bodies.mass[1], speed = 0.2;
    bt_guard_begin(&g, &c, w, &(bt_roster){.n_floes = 2, .n_free = 2, .mean_size = 0.8});
    expect(&g, w, &s, NULL);

    s.overlap = 0.399;
    expect(&g, w, &s, NULL);
    expect_of(&g, w, &s, true, NULL);
    s.overlap = 0.401;
    expect(&g, w, &s, "overlap by 0.401 m, 0.501 of the mean floe size (guard.overlap 0.5)");
    expect_of(&g, w, &s, true, "overlap by 0.401 m");
    s.overlap = 0;

    s.kinetic_energy = 0.999 * 100 * 0.5 * mass * speed * speed;
    expect(&g, w, &s, NULL);
    s.kinetic_energy *= 1.002;
    expect(&g, w, &s, "guard.energy");
    s.kinetic_energy = 0;

    s.unconverged = 1;
    expect(&g, w, &s, NULL);
    expect(&g, w, &s, NULL);
    s.unconverged = 0;
    expect(&g, w, &s, NULL); // no longer in a row
    s.unconverged = 1;
    expect(&g, w, &s, NULL);
    expect(&g, w, &s, NULL);
    expect(&g, w, &s, "3 steps in a row did not converge");
    s.unconverged = 0;

    // All off: nothing is too much, but what is no number.
    c.guard.overlap = c.guard.energy = 0;
    c.guard.unconverged = 0;
    c.guard.escape = false;
    bt_guard_begin(&g, &c, w, &(bt_roster){.n_floes = 2, .n_free = 2, .mean_size = 0.8});
    s.overlap = s.kinetic_energy = 1e30;
    s.unconverged = 1;
    w->bodies.pose[bt_world_index(w, 1)].y = 4.01;
    for (int k = 0; k < 10; k++) expect(&g, w, &s, NULL);
    expect_of(&g, w, &s, true, NULL);
    bt_world_free(w);
}

TEST(a_floe_beyond_a_wall_is_seen_at_every_step_and_at_the_end)
{
    bt_case c = a_case();
    bt_world *w = two_floes();
    bt_guard g = {0};
    const bt_sample s = sound_sample(w);
    bt_guard_begin(&g, &c, w, &(bt_roster){.n_floes = 2, .n_free = 2, .mean_size = 0.8});
    double *y = &w->bodies.pose[bt_world_index(w, 1)].y;
    for (int k = 0; k < 3; k++, w->step++) {
        expect(&g, w, &s, NULL);
        *y = 4.01;
        expect(&g, w, &s, "floe 1 is beyond a wall");
        *y = -0.01;
        expect_of(&g, w, &s, true, "floe 1 is beyond a wall");
        *y = 2;
    }
    w->step = 50;

    // Where nothing has moved a step does not look; the end does.
    *y = 4.01;
    for (bt_idx k = 0; k < w->cells->n; k++) w->cells->asleep[k] = BT_ASLEEP, w->cells->awake[k] = 0;
    w->cells->still = true;
    expect(&g, w, &s, NULL);
    expect_of(&g, w, &s, true, "floe 1 is beyond a wall");
    w->cells->still = false; // all drifts
    expect(&g, w, &s, "floe 1 is beyond a wall");
    for (bt_idx k = 0; k < w->cells->n; k++) w->cells->asleep[k] = BT_ASLEEP_NEW; // come to rest in this step
    w->cells->still = true;
    expect(&g, w, &s, "floe 1 is beyond a wall");

    // A wall that closes is where it is now: 0.2 m/s for 5 s.
    *y = 3.05;
    expect(&g, w, &s, NULL);
    c.domain.sides_closing = 0.2;
    bt_guard_begin(&g, &c, w, &(bt_roster){.n_floes = 2, .n_free = 2, .mean_size = 0.8});
    expect(&g, w, &s, "floe 1 is beyond a wall");
    *y = 2.95;
    expect(&g, w, &s, NULL);
    *y = 0.95;
    expect(&g, w, &s, "floe 1 is beyond a wall");

    // The towed body, too; an open side lets all out; what stands in a wall for ever may.
    c.domain.sides_closing = 0;
    *y = 4.01;
    w->towed = 1;
    bt_guard_begin(&g, &c, w, &(bt_roster){.n_floes = 1, .n_free = 1, .mean_size = 0.8});
    expect_of(&g, w, &s, true, "the towed body is beyond a wall");
    w->towed = -1;
    w->bodies.motion[bt_world_index(w, 1)] = BT_STATIC;
    expect_of(&g, w, &s, true, NULL);
    w->bodies.motion[bt_world_index(w, 1)] = BT_DYNAMIC;
    c.domain.sides = BT_BOUND_OPEN;
    bt_guard_begin(&g, &c, w, &(bt_roster){.n_floes = 2, .n_free = 2, .mean_size = 0.8});
    expect(&g, w, &s, NULL);

    // Out there it may go round the ends of the walls that there are; within their breadth it has come through.
    double *x = &w->bodies.pose[bt_world_index(w, 1)].x;
    *x = -0.5;
    expect(&g, w, &s, NULL);
    *y = 2;
    expect(&g, w, &s, "floe 1 is beyond a wall");
    *x = -5.5; // behind it
    expect_of(&g, w, &s, true, NULL);
    c.domain.sides = BT_BOUND_PERIODIC; // no way round
    bt_guard_begin(&g, &c, w, &(bt_roster){.n_floes = 2, .n_free = 2, .mean_size = 0.8});
    expect_of(&g, w, &s, true, "floe 1 is beyond a wall");
    bt_world_free(w);
}

TEST(numbers_that_are_none_are_found_in_bodies)
{
    const bt_case c = a_case();
    bt_world *w = two_floes();
    bt_guard g = {0};
    const bt_sample s = sound_sample(w);
    bt_guard_begin(&g, &c, w, &(bt_roster){.n_floes = 2, .n_free = 2, .mean_size = 0.8});
    const bt_idx i = bt_world_index(w, 1);
    double *const number[] = {&w->bodies.pose[i].x, &w->bodies.pose[i].y, &w->bodies.pose[i].yaw,
                              &w->bodies.vel[i].x,  &w->bodies.vel[i].y,  &w->bodies.vel[i].w};
    for (int k = 0; k < 6; k++) {
        const double before = *number[k];
        *number[k] = k % 2 ? NAN : -INFINITY;
        expect(&g, w, &s, "floe 1 has a pose or velocity that is not a number");
        expect_of(&g, w, &s, true, "floe 1 has a pose or velocity that is not a number");
        *number[k] = before;
    }
    expect(&g, w, &s, NULL);
    bt_world_free(w);
}

/// A tow by a vessel in a moving window: everything that a state can have.
static bt_world *whole_scene(bt_case *c, bt_roster *r)
{
    bt_case_defaults(c);
    c->run.dt = 0.1, c->run.duration = 20;
    c->domain.length = 30, c->domain.width = 12;
    c->domain.ends = BT_BOUND_MOVING;
    c->ice.concentration = 0;
    c->tow.mode = BT_TOW_THRUST;
    c->tow.line.branches = 2;
    c->tow.vessel.mass = 1e3, c->tow.vessel.bollard_pull = 1e3, c->tow.vessel.free_speed = 2;
    bt_errors err = {0};
    bt_field f;
    bt_field_init(&f);
    bt_world *w = NULL;
    if (bt_case_finish(c, &err) != BT_OK || bt_setup_world(c, &f, &w, r, &err) != BT_OK) fail_msg("%s", err.text[0]);
    bt_field_free(&f);
    bt_cells_begin(w);
    while (w->step < 50) bt_world_step(w);
    return w;
}

TEST(numbers_that_are_none_are_found_in_tow_window_and_collisions)
{
    bt_case c;
    bt_roster r;
    bt_world *w = whole_scene(&c, &r);
    bt_guard g = {0};
    bt_sample s;
    bt_observe(w, 0.13, &s);
    bt_guard_begin(&g, &c, w, &r);
    expect(&g, w, &s, NULL);
    expect_of(&g, w, &s, true, NULL);
    const struct { double *number; const char *name;
    } all[] = {
        {&w->tow->carriage_x, "tow/carriage_x"},
        {&w->tow->way, "tow/way"},
        {&w->tow->branch[1].lambda, "tow/impulse_2"},
        {&w->tow->vessel.vy, "tow/vessel_vy"},
        {&w->window->rear, "window/rear_in_ice"},
        {&w->undisturbed->vel.y, "undisturbed/vel"},
        {&w->window->brought[2], "window/brought"},
        {&w->drift_y, "world/drift_y"},
        {&w->par.air_u, "step/air_u"},
        {&w->impacts->panels.panel[3].fx, "impacts/panels"},
    };
    for (size_t k = 0; k < sizeof all / sizeof *all; k++) {
        const double before = *all[k].number;
        *all[k].number = k % 2 ? NAN : INFINITY;
        char part[80];
        snprintf(part, sizeof part, "step 50: %s of the state is not a number", all[k].name);
        expect(&g, w, &s, part);
        expect_of(&g, w, &s, true, part);
        *all[k].number = before;
    }
    bt_impact_open open = {.so_far = {.corner = NAN}}; // without a corner: as it should be
    free(w->impacts->open);
    w->impacts->open = &open, w->impacts->n_open = 1;
    expect(&g, w, &s, NULL);
    open.so_far.approach = NAN;
    expect(&g, w, &s, "impacts/open of the state");
    w->impacts->open = NULL, w->impacts->n_open = 0;
    bt_world_free(w);
    bt_roster_free(&r);
    bt_case_free(&c);
}

/// Every number of a sample: none where it applies is a fault, and one where it does not.
TEST(numbers_that_are_none_are_found_in_samples)
{
    bt_case c;
    bt_roster r;
    bt_world *w = whole_scene(&c, &r), *bare = two_floes();
    bt_case walls = a_case();
    bt_guard g = {0};
    bt_sample s, without = sound_sample(bare);
    c.guard.unconverged = walls.guard.unconverged = 0;
    bt_observe(w, 0.13, &s);
    assert_int_equal(bt_observe_applies(w), (1u << BT_APPLIES_KINDS) - 1);
    assert_int_equal(bt_observe_applies(bare), 1u << BT_APPLIES_ALWAYS);
    for (int k = 0; k < bt_n_series(); k++) {
        const bt_quantity *f = bt_series(k);
        double *x = (double *)(void *)((char *)&s + f->offset), *y = (double *)(void *)((char *)&without + f->offset);
        const double before = *x, before_without = *y, none[] = {NAN, INFINITY, -INFINITY, 1e100, -2e100};
        char part[80];
        snprintf(part, sizeof part, "step 50: %s (", f->name);
        bt_guard_begin(&g, &c, w, &r);
        g.overlap = g.energy = 0;
        for (int j = 0; j < 5; j++) {
            *x = none[j];
            expect(&g, w, &s, part);
        }
        *x = before;
        bt_guard_begin(&g, &walls, bare, &(bt_roster){.n_floes = 2, .n_free = 2, .mean_size = 0.8});
        g.overlap = 0;
        *y = f->applies == BT_APPLIES_ALWAYS ? NAN : 0;
        expect(&g, bare, &without,
               f->applies == BT_APPLIES_ALWAYS ? part : "a number where there is nothing to measure");
        *y = before_without;
    }
    bt_world_free(w);
    bt_world_free(bare);
    bt_roster_free(&r);
    bt_case_free(&c);
}

// --- the scale of the energy -----------------------------------------------------------------------------------------

static double draw(uint64_t *state, double low, double high)
{
    return low * exp(scene_uniform(state) * log(high / low));
}

/// A floe alone under wind, current, tide and slope, from rest or not: with guard.energy 1 the limit is what the
/// derivation says, and every step stays below.
TEST(no_floe_is_driven_beyond_the_scale)
{
    uint64_t seed = 1;
    double closest = 0;
    for (int scene = 0; scene < 400; scene++) {
        bt_case c;
        bt_case_defaults(&c);
        const double size = draw(&seed, 0.1, 100), wind = scene % 4 ? draw(&seed, 0.1, 50) : 0,
                     angle = 2 * BT_PI * scene_uniform(&seed);
        c.run.dt = draw(&seed, 0.01, 100), c.run.duration = 300 * c.run.dt;
        c.domain.ends = c.domain.sides = BT_BOUND_OPEN;
        c.domain.length = c.domain.width = 1e6, c.domain.x0 = c.domain.y0 = -5e5;
        c.body.shape = BT_BODY_ABSENT;
        c.tow.mode = BT_TOW_NONE, c.tow.speed = 0;
        c.solver.reference_speed = 1e-9;
        c.ice.concentration = 0, c.ice.size = size, c.ice.thickness = draw(&seed, 1e-3, 0.3) * size;
        c.ice.drag.air_skin = draw(&seed, 1e-4, 1), c.ice.drag.water_skin = draw(&seed, 1e-4, 1);
        if (scene % 5 == 0) c.ice.drag.water_form = 0;
        if (scene % 7 == 0) c.ice.drag.water_skin = 0;
        c.air.wind_x = wind * cos(angle), c.air.wind_y = wind * sin(angle);
        if (scene % 3)
            c.water.current_x = draw(&seed, 0.01, 2), c.water.tide.major = draw(&seed, 0.01, 2),
            c.water.tide.minor = -0.5 * c.water.tide.major, c.water.tide.period = draw(&seed, 20, 300) * c.run.dt;
        if (scene % 6 == 1) c.water.tilt = BT_TILT_SLOPE, c.water.slope_x = draw(&seed, 1e-6, 1e-2);
        if (scene % 2) c.water.latitude = 80 * BT_PI / 180;
        if (scene % 6 == 3) c.water.tilt = BT_TILT_DYNAMIC;
        if (scene % 6 == 5) c.water.tilt = BT_TILT_GEOSTROPHIC;
        if (scene % 13 == 12) { // next to no drag, half a day: an inertial circle about the current
            c.run.dt = 150, c.run.duration = 300 * c.run.dt;
            c.ice.drag = (bt_drag_coefs){.water_skin = 1e-12};
            c.water.current_x = 1, c.water.tide.major = c.water.tide.minor = 0;
            c.water.latitude = 80 * BT_PI / 180, c.water.tilt = BT_TILT_GEOSTROPHIC, c.water.slope_x = 0;
        }
        bt_floe_def floe = {
            .shape = BT_BODY_RECTANGLE, .length = size, .width = 0.4 * size, .thickness = c.ice.thickness};
        if (scene % 8 == 7) floe.vx = 3, floe.yaw_rate = 0.5;
        c.floes = &floe, c.n_floes = 1;
        bt_errors err = {0};
        bt_field f;
        bt_field_init(&f);
        bt_world *w = NULL;
        bt_roster r;
        if (bt_case_finish(&c, &err) != BT_OK || bt_setup_world(&c, &f, &w, &r, &err) != BT_OK)
            fail_msg("scene %d: %s", scene, err.text[0]);
        c.guard.energy = 1;
        bt_guard g = {0};
        bt_guard_begin(&g, &c, w, &r);
        for (int k = 0; k < 300; k++) {
            bt_world_step(w);
            if (!(w->stats.kinetic_energy <= g.energy * (1 + 1e-9)))
                fail_msg("scene %d step %d: %g J, limit %g J (wind %g, dt %g, size %g)", scene, k,
                         w->stats.kinetic_energy, g.energy, wind, c.run.dt, size);
            if (g.energy > 0) closest = bt_max(closest, w->stats.kinetic_energy / g.energy);
        }
        bt_world_free(w);
        bt_roster_free(&r);
        bt_field_free(&f);
        c.floes = NULL, c.n_floes = 0;
        bt_case_free(&c);
    }
    assert_true(closest > 0.5); // and it is no bound for its own sake
}

static double stream; // m/s, of a law from outside the program

static void add_stream(const bt_force_body *b, bt_load *l)
{
    if (stream > 0) bt_load_damper(l, b->mass, 0, stream);
}

/// Nor by a law that draws it along, in water and air at rest.
TEST(no_floe_is_drawn_beyond_the_scale)
{
    static const bt_force_law law = {.name = "stream", .doc = "drawn along", .add = add_stream};
    bt_errors err = {0};
    assert_int_equal(bt_force_register(&law, &err), BT_OK);
    stream = 3;
    bt_case c;
    bt_case_defaults(&c);
    c.run.dt = 0.1, c.run.duration = 20;
    c.domain.ends = c.domain.sides = BT_BOUND_OPEN;
    c.domain.length = c.domain.width = 1000, c.domain.x0 = c.domain.y0 = -500;
    c.body.shape = BT_BODY_ABSENT;
    c.tow.mode = BT_TOW_NONE, c.tow.speed = 0;
    c.solver.reference_speed = 1e-9;
    c.ice.concentration = 0, c.ice.size = 1, c.ice.thickness = 0.1;
    c.ice.drag = (bt_drag_coefs){0};
    bt_floe_def floe = {.shape = BT_BODY_RECTANGLE, .length = 1, .width = 1, .thickness = 0.1};
    c.floes = &floe, c.n_floes = 1;
    bt_field f;
    bt_field_init(&f);
    bt_world *w = NULL;
    bt_roster r;
    if (bt_case_finish(&c, &err) != BT_OK || bt_setup_world(&c, &f, &w, &r, &err) != BT_OK) fail_msg("%s", err.text[0]);
    c.guard.energy = 1;
    bt_guard g = {0};
    bt_guard_begin(&g, &c, w, &r);
    for (int k = 0; k < 200; k++) {
        bt_world_step(w);
        assert_true(w->stats.kinetic_energy <= g.energy * (1 + 1e-9));
    }
    assert_true(w->stats.kinetic_energy > 0.9 * g.energy);
    stream = 0;
    bt_world_free(w);
    bt_roster_free(&r);
    bt_field_free(&f);
    c.floes = NULL, c.n_floes = 0;
    bt_case_free(&c);
}

/// The limit of a run that goes on is that of its start: red when it is taken anew, once the law draws no longer.
TEST(the_limit_of_energy_goes_on)
{
    static const char *const text =
        "run: {dt: 0.1 s, duration: 2 s}\ndomain: {length: 100 m, width: 100 m, ends: open, sides: open}\n"
        "ice: {concentration: 0, size: 1 m, thickness: 0.1 m}\nbody: {shape: none}\ntow: {mode: none}\n"
        "floes: [{shape: disc, length: 1 m, x: 50 m, y: 0 m, thickness: 0.1 m}]\nguard: {energy: 2}\n";
    char folder[] = "/tmp/bergtow-guard-XXXXXX";
    assert_non_null(mkdtemp(folder));
    bt_errors err = {0};
    bt_case c;
    const bt_run_options o = {.dir = folder, .quiet = true, .threads = 1, .dump_step = -1, .max_steps = 10};
    stream = 3;
    bt_status status = bt_case_read_text(&c, "case", text, NULL, NULL, 0, &err);
    if (status == BT_OK) status = bt_run(&bt_comm_alone, &c, &o, &err);
    stream = 0;
    if (status == BT_OK) status = bt_run_resume(&bt_comm_alone, &o, &err);
    if (status != BT_OK) fail_msg("%s", err.text[0]);
    bt_case_free(&c);
    char command[64];
    snprintf(command, sizeof command, "rm -rf %s", folder);
    assert_int_equal(system(command), 0);
}

// --- the last state --------------------------------------------------------------------------------------------------

/// What the last look finds is what the next step finds, and the state stays as it was.
TEST(overlap_of_the_last_state_is_that_of_the_next_step)
{
    for (int crush = 0; crush < 2; crush++) {
        double deepest = 0;
        bt_params p = scene_params(0.1, 1);
        p.position_sweeps = 1, p.max_sweeps = 3, p.slop = 1e-6;
        p.law_own[BT_LAW_CRUSHING][BT_CRUSH_PRESSURE] = crush ? 1e3 : 0, p.law_own[BT_LAW_CRUSHING][BT_CRUSH_LEAST] = 1;
        bt_world *w = bt_world_create(&p);
        double v[8];
        uint64_t seed = 7;
        for (int k = 0; k < 36; k++) {
            scene_square(1, v);
            bt_body_def d = scene_prism(4, v, 100);
            d.x = 1.5 * (k % 6) + 0.3 * scene_uniform(&seed), d.y = 1.5 * (k / 6), d.yaw = scene_uniform(&seed),
            d.thickness = 0.1;
            d.vx = 2 * (4 - d.x), d.vy = 2 * (4 - d.y);
            bt_world_add(w, &d);
        }
        for (int k = 0; k < 30; k++) {
            bt_world_step(w);
            const uint64_t hash = bt_world_hash(w);
            const double overlap = bt_contacts_overlap(w);
            // with it, what has come apart is forgotten, as the next step would
            if (!crush) assert_true(bt_world_hash(w) == hash);
            bt_world_step(w);
            if (w->stats.overlap != overlap)
                fail_msg("step %d: %.17g m in the last look, %.17g m in the step after it", 2 * k, overlap,
                         w->stats.overlap);
            deepest = bt_max(deepest, overlap);
        }
        if (!(deepest > 1e-3)) fail_msg("crush %d: nothing overlaps: %g", crush, deepest);
        bt_world_free(w);
    }
}

TEST_MAIN(NULL, NULL)
