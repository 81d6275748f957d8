// SPDX-License-Identifier: MIT
// Builds the world of a case; all derived masses, drag coefficients and frame terms are formed here and nowhere else.
#include "run/setup.h"
#include "base/inside.h"

#include <string.h>

#include "force/drift.h"
#include "force/environment.h"
#include "force/exposure.h"
#include "force/forces.h"
#include "loads/impact.h"
#include "step/window.h"
#include "contact/law.h"
#include "geometry/polygons.h"
#include "space/shore.h"
#include "step/splitting.h"
#include "case/arch.h"
#include "case/case_tow.h"
#include "base/elementary.h"

#define EARTH_RATE 7.292115e-5  // Ω, rad/s
// Of the mean floe size, assumed. Below it rounding would decide whether and in which direction bodies touch, and the
// position projection could not reach its tolerance.
#define LEAST_SLOP 1e-6
#define LARGE_RATIO                                                                                                    \
    8.0 // factor on the mean radius: larger floes are in no cell, so that cells fit the largest of the others

bt_params bt_setup_params(const bt_case *input, double size)
{
    const double f = 2 * EARTH_RATE * bt_sin(input->water.latitude);
    // Seen from above the geographic frame (x north, y east) is left-handed: dVx/dt = −f Vy, dVy/dt = +f Vx; the
    // basin's frame is right-handed and the signs swap. In both a body is deflected to the right in the northern
    // hemisphere.
    const double turn = input->domain.frame == BT_FRAME_GEOGRAPHIC ? f : -f;
    double water[2], air[2]; // at time zero; if they change, each step sets its own
    bt_environment_at(input, true, 0, water);
    bt_environment_at(input, false, 0, air);
    bt_params par = {
        .dt = input->run.dt,
        .x0 = input->domain.x0,
        .y0 = input->domain.y0,
        .period_x = bt_bound_wraps(input->domain.ends) ? input->domain.length : 0,
        .period_y = input->domain.sides == BT_BOUND_PERIODIC ? input->domain.width : 0,
        .tolerance = input->solver.tolerance * bt_case_reference_speed(input),
        .max_sweeps = input->solver.max_sweeps,
        .warm_start = input->solver.warm_start,
        .plain_sweeps = input->solver.plain,
        .plain_schedule = input->solver.plain_schedule,
        .inner_sweeps = input->solver.inner_sweeps,
        .cell = input->solver.cell_size,
        .slop = bt_max(input->solver.slop, LEAST_SLOP) * size,
        .position_sweeps = input->solver.position_sweeps,
        .rest_speed = input->solver.rest_speed,
        .size = size,
        .water_u = water[0],
        .water_v = water[1],
        .air_u = air[0],
        .air_v = air[1],
        .coriolis = turn,
        .tilt_moves_water = input->water.tilt == BT_TILT_DYNAMIC,
        .lee = input->ice.sheltering,
        .draft = input->ice.density / input->water.density,
        .covers = input->ice.rafting_kappa > 0,
    };
    if (input->water.tilt == BT_TILT_GEOSTROPHIC || input->water.tilt == BT_TILT_DYNAMIC) {
        par.balance_u = water[0];
        par.balance_v = water[1];
    } else if (input->water.tilt == BT_TILT_SLOPE) {
        par.tilt_ax = -BT_GRAVITY * input->water.slope_x;
        par.tilt_ay = -BT_GRAVITY * input->water.slope_y;
    }
    bt_laws_setup(input, &par);
    return par;
}

bt_tow *bt_setup_tow(const bt_case *input)
{
    bt_tow *tow = bt_alloc(1, sizeof *tow);
    const bool thrust = input->tow.mode == BT_TOW_THRUST, line = thrust || input->tow.mode == BT_TOW_LINE;
    double start[2];
    bt_case_tow_start(input, start);
    *tow = (bt_tow){
        .mode = input->tow.mode,
        .ux = bt_cos(input->tow.direction),
        .uy = bt_sin(input->tow.direction),
        .speed = input->tow.speed,
        .ramp = input->tow.ramp,
        .n_branches = line ? (int)input->tow.line.branches : 0,
        .branch[0] = {.length0 = input->tow.line_length,
                      .k = line ? input->tow.line_stiffness / input->tow.line_length : 0,
                      .c = input->tow.line_damping,
                      .hull_x = input->tow.hull_x,
                      .hull_y = input->tow.hull_y,
                      .breaking = input->tow.line.breaking_load,
                      .weight = input->tow.line.weight},
        .dt = input->run.dt,
        .carriage_x = start[0],
        .carriage_y = start[1],
        .travel_x = input->body.x,
        .travel_y = input->body.y,
    };
    if (tow->n_branches > 1)
        tow->branch[1] = (bt_branch){.length0 = input->tow.branch2.length,
                                     .k = input->tow.branch2.stiffness / input->tow.branch2.length,
                                     .c = input->tow.branch2.damping,
                                     .hull_x = input->tow.branch2.hull_x,
                                     .hull_y = input->tow.branch2.hull_y,
                                     .breaking = input->tow.branch2.breaking_load,
                                     .weight = input->tow.line.weight};
    if (input->tow.n_programme > 0) {
        tow->n_programme = input->tow.n_programme;
        tow->programme = bt_alloc((size_t)tow->n_programme, 2 * sizeof *tow->programme);
        memcpy(tow->programme, input->tow.programme, (size_t)tow->n_programme * 2 * sizeof *tow->programme);
    }
    char why[200];
    // A straight course needs no path, except for the vessel, which has to find its place on it.
    if (input->tow.n_waypoints > 0 || thrust) bt_case_tow_path(input, &tow->path, why);
    if (thrust) {
        const double speed = bt_tow_speed(tow, 0);
        tow->vessel = (bt_vessel){.mass = input->tow.vessel.mass * (1 + input->tow.vessel.added_mass),
                                  .bollard_pull = input->tow.vessel.bollard_pull,
                                  .free_speed = input->tow.vessel.free_speed,
                                  .free_resistance = input->tow.vessel.free_resistance,
                                  .lateral = input->tow.vessel.lateral_drag,
                                  .lookahead = input->tow.vessel.lookahead,
                                  .vx = speed * tow->ux,
                                  .vy = speed * tow->uy};
    }
    return tow;
}

/// A floe of uniform thickness, floating: draft = h ρ_i/ρ_w.
static void floe_def(const bt_case *input, int n, const double *v, double h, bt_body_def *def)
{
    const bt_moments moments = bt_shape_moments(n, v);
    const double sheet = input->ice.density * h, draft = h * input->ice.density / input->water.density;
    def->n_vertices = n;
    def->vertices = v;
    def->mass = sheet * moments.area * (1 + input->ice.added_mass);
    def->added = sheet * moments.area * input->ice.added_mass;
    def->inertia = sheet * moments.polar * (1 + input->ice.added_inertia);
    def->friction = input->ice.friction;
    def->restitution = input->ice.restitution;
    def->thickness = h;
    def->drag = bt_forces_drag(&moments, draft, h - draft, input->water.density, input->air.density,
                               input->ice.drag.water_form, input->ice.drag.water_skin, input->ice.drag.air_form,
                               input->ice.drag.air_skin);
    def->drag.tangential = input->ice.drag.tangential;
}

static void add_field(const bt_case *input, const bt_field *field, bt_world *world, bt_roster *roster)
{
    for (bt_idx i = 0; i < field->n; i++) {
        const int64_t first = field->offsets[i];
        const double *pose = field->pose + 3 * (size_t)i;
        bt_body_def def = {.motion = BT_DYNAMIC, .x = pose[0], .y = pose[1], .yaw = pose[2]};
        const int n = (int)(field->offsets[i + 1] - first);
        floe_def(input, n, field->vertices + 2 * first, field->thickness[i], &def);
        // The parts follow from the outline alone: they are the same on every rank, and need not be in a field file.
        bt_parts parts;
        if (field->outlines.split && !bt_outline_convex(n, def.vertices) && bt_outline_split(n, def.vertices, &parts))
            def.parts = &parts;
        def.large = sqrt(field->area[i] / BT_PI) > 0.5 * LARGE_RATIO * roster->mean_size;
        roster->thickness[bt_roster_row(roster, bt_world_add(world, &def))] = field->thickness[i];
    }
}

/// Rotate the outline by yaw and move it to (x, y), or back.
static void carry(int n, double *v, double x, double y, double yaw, bool back)
{
    double s, c;
    bt_sincos(back ? -yaw : yaw, &s, &c);
    for (int k = 0; k < n; k++) {
        const double px = v[2 * k] - (back ? x : 0), py = v[2 * k + 1] - (back ? y : 0);
        v[2 * k] = c * px - s * py + (back ? 0 : x);
        v[2 * k + 1] = s * px + c * py + (back ? 0 : y);
    }
}

/// Outlines of the floes by hand [n_floes], relative to their places: fixed floes that lie flush share vertices.
static bt_welded *outlines_by_hand(const bt_case *input, const bt_world *world)
{
    bt_welded *all = bt_alloc((size_t)input->n_floes, sizeof *all),
              *fixed = bt_alloc((size_t)input->n_floes, sizeof *fixed);
    int n_fixed = 0;
    for (bt_idx i = 0; i < input->n_floes; i++) {
        const bt_floe_def *floe = &input->floes[i];
        all[i].n = bt_case_floe_outline(floe, all[i].v);
        if (!floe->fixed) continue;
        fixed[n_fixed] = all[i];
        carry(all[i].n, fixed[n_fixed++].v, floe->x, floe->y, floe->yaw, false);
    }
    bt_welded *moved = bt_alloc((size_t)n_fixed, sizeof *moved);
    memcpy(moved, fixed, (size_t)n_fixed * sizeof *moved);
    bt_weld(n_fixed, moved, world->par.slop, world->par.period_x, world->par.period_y);
    for (bt_idx i = 0, k = 0; i < input->n_floes; i++) {
        const bt_floe_def *floe = &input->floes[i];
        if (!floe->fixed) continue;
        if (memcmp(moved[k].v, fixed[k].v, 2 * (size_t)moved[k].n * sizeof *moved[k].v)) {
            all[i] = moved[k];
            carry(all[i].n, all[i].v, floe->x, floe->y, floe->yaw, true);
        }
        k++;
    }
    free(fixed);
    free(moved);
    return all;
}

static void add_floes_by_hand(const bt_case *input, bt_world *world, bt_roster *roster)
{
    bt_welded *outline = outlines_by_hand(input, world);
    for (bt_idx i = 0; i < input->n_floes; i++) {
        const bt_floe_def *floe = &input->floes[i];
        const double *v = outline[i].v;
        const int n = outline[i].n;
        bt_body_def def = {.motion = floe->fixed ? BT_STATIC : BT_DYNAMIC, .x = floe->x, .y = floe->y, .yaw = floe->yaw,
                           .vx = bt_case_start(floe->vx), .vy = bt_case_start(floe->vy), .yaw_rate = floe->yaw_rate};
        floe_def(input, n, v, floe->thickness, &def);
        bt_parts parts;
        if (!bt_outline_convex(n, v) && bt_outline_split(n, v, &parts)) def.parts = &parts;
        def.large = bt_shape_area_moments(n, v).radius > 0.5 * LARGE_RATIO * roster->mean_size;
        roster->thickness[bt_roster_row(roster, bt_world_add(world, &def))] = floe->thickness;
    }
    free(outline);
    bt_shore_create(world);
}

static void add_towed_body(const bt_case *input, bt_world *world, bt_roster *roster)
{
    double v[2 * BT_MAX_VERTICES];
    const int n = bt_case_waterline(input, v);
    const bt_moments moments = bt_shape_moments(n, v);
    const double mass = bt_case_body_mass(input);
    const bool prescribed = input->tow.mode == BT_TOW_SPEED;
    bt_body_def def = {
        .motion = prescribed ? BT_KINEMATIC : BT_DYNAMIC,
        .large = true,
        .n_vertices = n,
        .vertices = v,
        .x = input->body.x,
        .y = input->body.y,
        .yaw = input->body.yaw,
        .vx = bt_case_start(input->body.vx),
        .vy = bt_case_start(input->body.vy),
        .yaw_rate = input->body.yaw_rate,
        .mass = mass * (1 + input->body.added_mass),
        .added = mass * input->body.added_mass,
        // Uniform over the waterline plane, as a prism.
        .inertia = mass * moments.polar / moments.area * (1 + input->body.added_inertia),
        .friction = input->body.friction,
        .restitution = input->body.restitution,
        .drag =
            bt_forces_drag(&moments, input->body.draft, input->body.sail, input->water.density, input->air.density,
                           input->body.drag.water_form, input->body.drag.water_skin, input->body.drag.air_form,
                           input->body.drag.air_skin),
    };
    def.drag.tangential = input->body.drag.tangential;
    bt_tow *tow = world->tow = bt_setup_tow(input);
    if (prescribed) {
        const double s = bt_tow_speed(tow, 0);
        def.vx = s * tow->ux;
        def.vy = s * tow->uy;
        def.yaw_rate = 0;
    }
    world->towed = bt_world_add(world, &def);
    roster->thickness[bt_roster_row(roster, world->towed)] = input->body.draft + input->body.sail;
}

static void add_wall(const bt_case *input, bt_world *world, double x, double y, double half_x, double half_y, double vx,
                     double vy)
{
    const double v[8] = {-half_x, -half_y, half_x, -half_y, half_x, half_y, -half_x, half_y};
    bt_body_def def = {.motion = vx != 0 || vy != 0 ? BT_KINEMATIC : BT_STATIC,
                       .large = true,
                       .n_vertices = 4,
                       .vertices = v,
                       .x = x,
                       .y = y,
                       .vx = vx,
                       .vy = vy,
                       .friction = input->domain.wall_friction,
                       .restitution = input->domain.wall_restitution};
    bt_world_add(world, &def);
}

/// Does body i start with its free drift?
static bool begins_adrift(const bt_case *input, const bt_world *world, bt_idx i, const bt_roster *roster)
{
    const bt_gid g = world->bodies.gid[i], row = bt_roster_row(roster, g);
    if (input->ice.start != BT_START_DRIFT || world->bodies.motion[i] != BT_DYNAMIC) return false;
    return row < roster->n_free ||
           (g == world->towed ? isnan(input->body.vx) : isnan(input->floes[row - roster->n_free].vx));
}

/// Give free drift to the floes of the field, and to floes by hand and a free body without a given velocity.
/// Ice between walls does not drift across them: it has been there for long, and lies against one of them. False if no
/// balance was found.
static bool begin_drift(const bt_case *input, bt_world *world, const bt_roster *roster, bt_errors *err)
{
    bt_bodies *bodies = &world->bodies;
    const bool hold[2] = {input->domain.ends == BT_BOUND_WALL, input->domain.sides == BT_BOUND_WALL};
    bt_idx lost = 0;
#pragma omp parallel reduction(+ : lost) if (BT_MANY(bodies->n, 2000))
    {
        BT_PLAIN_NUMBERS;
#pragma omp for schedule(dynamic, 64)
        for (bt_idx i = 0; i < bodies->n; i++) {
            if (!begins_adrift(input, world, i, roster)) continue;
            double u[2];
            if (!bt_drift_velocity(world, i, hold, u)) lost++;
            bodies->vel[i] =
                bodies->vel_start[i] = bodies->vel_free[i] = (bt_vel){.x = u[0], .y = u[1], .w = bodies->vel[i].w};
        }
    }
    if (lost > 0)
        bt_errors_add(err,
                      "%s: ice.start: for %d bodies no velocity was found at which wind, water, Coriolis and slope "
                      "balance; set it to rest, or check drag, current and wind",
                      bt_case_name(input), (int)lost);
    return lost == 0;
}

/// Free drift of floes in each other's lee. Lee and drift depend on each other: iterate from the drift of single floes,
/// every floe with the mean factors of all (exposure.h), which undisturbed ice keeps.
static bool begin_sheltered(const bt_case *input, bt_world *world, const bt_roster *roster, bt_errors *err)
{
    enum { ROUNDS = 2 };
    bool found = true;
    bt_exposure_setup(world, bt_case_reference_speed(input));
    for (int k = 0; k < ROUNDS && world->par.lee > 0 && world->par.exposure_steps > 0 && found; k++) {
        bt_exposure_look(world);
        const bt_gid n = roster->n_floes + roster->n_kept;
        const bt_exposure mean = bt_exposure_mean(world, n);
        for (bt_idx i = 0; i < world->bodies.n; i++)
            if (world->bodies.gid[i] < n) world->bodies.exposure[i] = mean;
        found = begin_drift(input, world, roster, err);
    }
    return found;
}

/// A world with one round floe of this size and thickness (m), in the lee of others at this concentration.
static bt_world *one_floe(const bt_case *input, double size, double thickness, double concentration)
{
    bt_params par = bt_setup_params(input, size);
    bt_world *world = bt_world_create(&par);
    bt_forces_setup(world, input);
    double v[2 * BT_MAX_VERTICES];
    bt_shape_regular(24, BT_PI / 4 * size * size, v);
    bt_body_def def = {.motion = BT_DYNAMIC};
    floe_def(input, 24, v, thickness, &def);
    const bt_gid g = bt_world_add(world, &def);
    world->bodies.exposure[g] = bt_exposure_estimate(&world->par, size, thickness, concentration);
    return world;
}

void bt_setup_drift(const bt_case *input, double size, double thickness, double concentration, double floe[2],
                    double body[2])
{
    floe[0] = floe[1] = body[0] = body[1] = NAN;
    if (input->ice.start != BT_START_DRIFT) return;
    bt_world *world = one_floe(input, size, thickness, concentration);
    double thicknesses[2];
    bt_roster alone = {.n_floes = 1, .n_free = 1, .thickness = thicknesses};
    if (input->body.shape != BT_BODY_ABSENT) add_towed_body(input, world, &alone);
    if (begin_drift(input, world, &alone, NULL)) { // NaN reports it
        floe[0] = world->bodies.vel[0].x, floe[1] = world->bodies.vel[0].y;
        if (input->body.shape != BT_BODY_ABSENT && begins_adrift(input, world, 1, &alone))
            body[0] = world->bodies.vel[1].x, body[1] = world->bodies.vel[1].y;
    }
    bt_world_free(world);
}

/// The axes along which undisturbed ice rests (step/window.h).
static void held_ice(const bt_case *input, double concentration, bool held[2])
{
    const bool dense = concentration >= BT_BOUND_CONCENTRATION - BT_MADE_OFF,
               moving = input->domain.ends == BT_BOUND_MOVING;
    held[0] = dense && input->domain.ends == BT_BOUND_WALL;
    held[1] = (dense || moving) && input->domain.sides == BT_BOUND_WALL;
}

bt_track bt_setup_track(const bt_case *input, double size, double thickness, double concentration)
{
    enum { POINTS = 4000 };
    bt_trail body;
    if (input->tow.mode == BT_TOW_NONE || input->body.shape == BT_BODY_ABSENT || !bt_case_trail_begin(input, &body))
        return (bt_track){0};
    bt_case coarse = *input;
    coarse.run.dt = input->run.duration / (POINTS - 1);
    bt_world *world = one_floe(&coarse, size, thickness, concentration);
    world->environment = bt_environment_create(&coarse);
    // if not found, from rest; undisturbed ice continues from there
    begin_drift(&coarse, world, &(bt_roster){.n_floes = 1, .n_free = 1}, NULL);
    bool held[2];
    held_ice(input, concentration, held);
    bt_undisturbed_create(world, 1, held);
    double *time = bt_alloc(POINTS, sizeof *time), *x = bt_alloc(POINTS, sizeof *x), *y = bt_alloc(POINTS, sizeof *y);
    bt_track track = {.n = POINTS, .time = time, .x = x, .y = y};
    for (int i = 0; i < POINTS; i++, world->step++) {
        double at[2];
        time[i] = input->run.duration * i / (POINTS - 1);
        bt_case_trail_to(&body, bt_case_tow_distance(input, time[i]), at);
        track.drift[0] = world->undisturbed->drift_x, track.drift[1] = world->undisturbed->drift_y;
        x[i] = at[0] - track.drift[0];
        y[i] = at[1] - track.drift[1];
        bt_environment_begin(world);
        bt_undisturbed_advance(world);
    }
    bt_case_trail_end(&body);
    bt_world_free(world);
    return track;
}

void bt_setup_track_free(bt_track *track)
{
    BT_FREE((double *)track->time, (double *)track->x, (double *)track->y);
    *track = (bt_track){0};
}

/// Walls are slabs outside the domain, thick enough that nothing can pass and overlapping at the corners. A pair of
/// bodies touches at one image only: along a period a wall extends as far as any body reaches beyond the seam.
static void add_walls(const bt_case *input, bt_world *world, const char **names)
{
    double thick = bt_max(0.1 * bt_max(input->domain.length, input->domain.width), 5 * world->par.size);
    for (bt_idx i = 0; i < world->bodies.n && (world->par.period_x > 0 || world->par.period_y > 0); i++)
        thick = bt_max(thick, 1.1 * world->bodies.radius[i]);
    const double x0 = input->domain.x0, x1 = x0 + input->domain.length, y0 = input->domain.y0,
                 y1 = y0 + input->domain.width;
    const double mid_x = 0.5 * (x0 + x1), mid_y = 0.5 * (y0 + y1), h = 0.5 * thick;
    if (input->domain.ends == BT_BOUND_WALL) {
        const double half = 0.5 * input->domain.width + thick, s = input->domain.ends_closing;
        add_wall(input, world, x0 - h, mid_y, h, half, s, 0);
        add_wall(input, world, x1 + h, mid_y, h, half, -s, 0);
        *names++ = "wall x low", *names++ = "wall x high";
    }
    if (input->domain.sides == BT_BOUND_WALL) {
        const double half = 0.5 * input->domain.length + thick, s = input->domain.sides_closing;
        add_wall(input, world, mid_x, y0 - h, half, h, 0, s);
        add_wall(input, world, mid_x, y1 + h, half, h, 0, -s);
        *names++ = "wall y low", *names++ = "wall y high";
    }
}

/// Number of ids reserved for pieces of floes: each split adds one floe and takes two new ids.
static bt_gid kept_ids(const bt_case *input, const bt_field *field)
{
    if (!(input->ice.splitting.toughness > 0)) return 0;
    const bt_gid more = input->ice.splitting.reserve > 0 ? input->ice.splitting.reserve
                                                         : 2 * ((bt_gid)field->n + input->n_floes);
    return 2 * more;
}

static void create_splitting(const bt_case *input, bt_world *world, const bt_roster *roster)
{
    if (!(input->ice.splitting.toughness > 0)) return;
    bt_splitting *splitting = world->splitting = bt_alloc(1, sizeof *splitting);
    *splitting = (bt_splitting){
        .law = {.toughness = input->ice.splitting.toughness, .strength = input->ice.splitting.strength,
                .least_width = input->ice.splitting.least_size, .aspect = input->ice.splitting.aspect,
                .slop = world->par.slop},
        .modulus = input->ice.splitting.scatter,
        .seed = input->ice.seed,
        .generations = input->ice.splitting.generations,
        .first = roster->n_free,
        .reserve = roster->n_kept,
        .rule = bt_impact_rule_of(input),
        .large = 0.5 * LARGE_RATIO * roster->mean_size,
    };
}

bt_floe_means bt_setup_mean_floe(const bt_case *input, const bt_field *field)
{
    if (field->n > 0) {
        bt_floe_means mean = {.size = bt_field_mean_size(field)};
        for (bt_idx i = 0; i < field->n; i++) {
            mean.thickness += field->thickness[i] / field->n;
            mean.volume += field->area[i] * field->thickness[i] / field->n;
        }
        return mean;
    }
    const bt_floe_means by_hand = bt_case_hand_means(input);
    if (by_hand.size > 0 && bt_case_expected_floes(input) == 0) return by_hand;
    const double thickness = input->ice.thickness;
    return (bt_floe_means){bt_case_mean_size(input), thickness, thickness * BT_PI / 4 * bt_case_size_moment(input, 2)};
}

bt_status bt_setup_world(const bt_case *input, const bt_field *field, bt_world **out, bt_roster *roster, bt_errors *err)
{
    const double size = bt_setup_mean_floe(input, field).size;
    if (!bt_setup_check_field(input, field, err)) return BT_ERR_CASE;
    bt_params par = bt_setup_params(input, size);
    bt_world *world = bt_world_create(&par);
    world->environment = bt_environment_create(input);
    bt_forces_setup(world, input);
    const bt_idx others = input->n_floes + 5; // floes by hand, body, four walls
    bt_bodies_reserve(&world->bodies, field->n + others,
                      (field->n > 0 ? field->offsets[field->n] : 0) + (int64_t)others * 16);
    const bool with_body = input->body.shape != BT_BODY_ABSENT;
    *roster = (bt_roster){.n_floes = field->n + input->n_floes, .mean_size = size, .n_free = field->n,
                           .n_kept = kept_ids(input, field)};
    roster->thickness = bt_alloc((size_t)roster->n_floes + 5, sizeof *roster->thickness);
    roster->names = bt_alloc(5, sizeof *roster->names);
    add_field(input, field, world, roster);
    bt_bodies_skip(&world->bodies, roster->n_kept);
    add_floes_by_hand(input, world, roster);
    int n = 0;
    if (with_body) {
        add_towed_body(input, world, roster);
        roster->names[n++] = "towed body";
    }
    const bool drifts = begin_drift(input, world, roster, err);
    world->impacts = bt_impacts_create(input, world);
    create_splitting(input, world, roster);
    const bt_idx first_wall = world->bodies.n;
    add_walls(input, world, roster->names + n);
    *out = world;
    if (!drifts) return BT_ERR_CASE;
    if (!bt_setup_check_bodies(input, world, roster, first_wall, err)) return BT_ERR_CASE;
    if (!begin_sheltered(input, world, roster, err)) return BT_ERR_CASE;
    bool held[2];
    held_ice(input, field->concentration, held);
    // besides a field, floes by hand do not count as ice
    if (with_body) bt_undisturbed_create(world, field->n > 0 ? field->n : roster->n_floes + roster->n_kept, held);
    if (input->domain.ends == BT_BOUND_MOVING && with_body)
        bt_window_create(world, bt_case_tow_sign(input), input->domain.ahead, roster->n_floes);
    // velocities are known: bodies at rest need no first step to show it
    memset(world->bodies.disturbed, 0, (size_t)world->bodies.n);
    return BT_OK;
}
