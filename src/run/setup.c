// SPDX-License-Identifier: MIT
// Builds the world of a case; every derived mass, drag and frame term is formed here and nowhere else.
#include "run/setup.h"
#include "base/inside.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "contact/contacts.h"
#include "force/drift.h"
#include "force/environment.h"
#include "force/exposure.h"
#include "force/forces.h"
#include "loads/impact.h"
#include "tow/tow.h"
#include "step/window.h"
#include "contact/law.h"
#include "geometry/polygons.h"
#include "space/shore.h"
#include "step/splitting.h"
#include "case/arch.h"
#include "case/case_tow.h"
#include "case/case_derived.h"
#include "case/ice_bounds.h"
#include "base/elementary.h"

#define EARTH_RATE 7.292115e-5  // Ω, rad/s
#define LARGE_RATIO                                                                                                    \
    8.0 // a floe with more than this times the mean radius is in no cell: cells fit the largest of the others

bt_params bt_setup_params(const bt_case *c, double size)
{
    const double f = 2 * EARTH_RATE * bt_sin(c->water.latitude);
    // Seen from above the geographic frame (x north, y east) is left-handed: dVx/dt = −f Vy, dVy/dt = +f Vx; the
    // basin's frame is right-handed and the signs swap. In both a body turns right in the north.
    const double turn = c->domain.frame == BT_FRAME_GEOGRAPHIC ? f : -f;
    double water[2], air[2]; // at time zero; where they change, each step sets its own
    bt_environment_at(c, true, 0, water);
    bt_environment_at(c, false, 0, air);
    bt_params p = {
        .dt = c->run.dt,
        .x0 = c->domain.x0,
        .y0 = c->domain.y0,
        .period_x = bt_bound_wraps(c->domain.ends) ? c->domain.length : 0,
        .period_y = c->domain.sides == BT_BOUND_PERIODIC ? c->domain.width : 0,
        .tolerance = c->solver.tolerance * bt_case_reference_speed(c),
        .max_sweeps = c->solver.max_sweeps,
        .warm_start = c->solver.warm_start,
        .plain_sweeps = c->solver.plain,
        .plain_schedule = c->solver.plain_schedule,
        .inner_sweeps = c->solver.inner_sweeps,
        .cell = c->solver.cell_size,
        .slop = c->solver.slop * size,
        .position_sweeps = c->solver.position_sweeps,
        .rest_speed = c->solver.rest_speed,
        .size = size,
        .water_u = water[0],
        .water_v = water[1],
        .air_u = air[0],
        .air_v = air[1],
        .coriolis = turn,
        .tilt_moves_water = c->water.tilt == BT_TILT_DYNAMIC,
        .lee = c->ice.sheltering,
        .draft = c->ice.density / c->water.density,
        .covers = c->ice.rafting_kappa > 0,
    };
    if (c->water.tilt == BT_TILT_GEOSTROPHIC || c->water.tilt == BT_TILT_DYNAMIC) {
        p.balance_u = water[0];
        p.balance_v = water[1];
    } else if (c->water.tilt == BT_TILT_SLOPE) {
        p.tilt_ax = -BT_GRAVITY * c->water.slope_x;
        p.tilt_ay = -BT_GRAVITY * c->water.slope_y;
    }
    bt_laws_setup(c, &p);
    return p;
}

/// A floe of uniform thickness, floating: draft = h ρ_i/ρ_w.
static void floe_def(const bt_case *c, int n, const double *v, double h, bt_body_def *d)
{
    const bt_moments m = bt_shape_moments(n, v);
    const double sheet = c->ice.density * h, draft = h * c->ice.density / c->water.density;
    d->n_vertices = n;
    d->vertices = v;
    d->mass = sheet * m.area * (1 + c->ice.added_mass);
    d->added = sheet * m.area * c->ice.added_mass;
    d->inertia = sheet * m.polar * (1 + c->ice.added_inertia);
    d->friction = c->ice.friction;
    d->restitution = c->ice.restitution;
    d->thickness = h;
    d->drag = bt_forces_drag(&m, draft, h - draft, c->water.density, c->air.density, c->ice.drag.water_form,
                             c->ice.drag.water_skin, c->ice.drag.air_form, c->ice.drag.air_skin);
    d->drag.tangential = c->ice.drag.tangential;
}

static void add_field(const bt_case *c, const bt_field *f, bt_world *w, bt_roster *r)
{
    for (bt_idx i = 0; i < f->n; i++) {
        const int64_t first = f->offsets[i];
        const double *pose = f->pose + 3 * (size_t)i;
        bt_body_def d = {.motion = BT_DYNAMIC, .x = pose[0], .y = pose[1], .yaw = pose[2]};
        const int n = (int)(f->offsets[i + 1] - first);
        floe_def(c, n, f->vertices + 2 * first, f->thickness[i], &d);
        // The parts follow from the outline alone: the same on every rank, and nothing that a field file need hold.
        bt_parts parts;
        if (f->outlines.split && !bt_outline_convex(n, d.vertices) && bt_outline_split(n, d.vertices, &parts))
            d.parts = &parts;
        d.large = sqrt(f->area[i] / BT_PI) > 0.5 * LARGE_RATIO * r->mean_size;
        r->thickness[bt_roster_row(r, bt_world_add(w, &d))] = f->thickness[i];
    }
}

/// Turn the outline by yaw and move it to (x, y), or back.
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

/// Outlines of the floes by hand [n_floes], about their places: those of fixed ones that lie flush have common
/// vertices.
static bt_welded *outlines_by_hand(const bt_case *c, const bt_world *w)
{
    bt_welded *all = bt_alloc((size_t)c->n_floes, sizeof *all), *fixed = bt_alloc((size_t)c->n_floes, sizeof *fixed);
    int n_fixed = 0;
    for (bt_idx i = 0; i < c->n_floes; i++) {
        const bt_floe_def *g = &c->floes[i];
        all[i].n = bt_case_floe_outline(g, all[i].v);
        if (!g->fixed) continue;
        fixed[n_fixed] = all[i];
        carry(all[i].n, fixed[n_fixed++].v, g->x, g->y, g->yaw, false);
    }
    bt_welded *moved = bt_alloc((size_t)n_fixed, sizeof *moved);
    memcpy(moved, fixed, (size_t)n_fixed * sizeof *moved);
    bt_weld(n_fixed, moved, w->par.slop, w->par.period_x, w->par.period_y);
    for (bt_idx i = 0, k = 0; i < c->n_floes; i++) {
        const bt_floe_def *g = &c->floes[i];
        if (!g->fixed) continue;
        if (memcmp(moved[k].v, fixed[k].v, 2 * (size_t)moved[k].n * sizeof *moved[k].v)) {
            all[i] = moved[k];
            carry(all[i].n, all[i].v, g->x, g->y, g->yaw, true);
        }
        k++;
    }
    free(fixed);
    free(moved);
    return all;
}

static void add_floes_by_hand(const bt_case *c, bt_world *w, bt_roster *r)
{
    bt_welded *outline = outlines_by_hand(c, w);
    for (bt_idx i = 0; i < c->n_floes; i++) {
        const bt_floe_def *g = &c->floes[i];
        const double *v = outline[i].v;
        const int n = outline[i].n;
        bt_body_def d = {.motion = g->fixed ? BT_STATIC : BT_DYNAMIC, .x = g->x, .y = g->y, .yaw = g->yaw,
                         .vx = bt_case_start(g->vx), .vy = bt_case_start(g->vy), .yaw_rate = g->yaw_rate};
        floe_def(c, n, v, g->thickness, &d);
        bt_parts parts;
        if (!bt_outline_convex(n, v) && bt_outline_split(n, v, &parts)) d.parts = &parts;
        d.large = bt_shape_extent(n, v).radius > 0.5 * LARGE_RATIO * r->mean_size;
        r->thickness[bt_roster_row(r, bt_world_add(w, &d))] = g->thickness;
    }
    free(outline);
    bt_shore_create(w);
}

static void add_towed_body(const bt_case *c, bt_world *w, bt_roster *r)
{
    double v[2 * BT_MAX_VERTICES];
    const int n = bt_case_waterline(c, v);
    const bt_moments m = bt_shape_moments(n, v);
    const double mass = bt_case_body_mass(c);
    const bool prescribed = c->tow.mode == BT_TOW_SPEED;
    bt_body_def d = {
        .motion = prescribed ? BT_KINEMATIC : BT_DYNAMIC,
        .large = true,
        .n_vertices = n,
        .vertices = v,
        .x = c->body.x,
        .y = c->body.y,
        .yaw = c->body.yaw,
        .vx = bt_case_start(c->body.vx),
        .vy = bt_case_start(c->body.vy),
        .yaw_rate = c->body.yaw_rate,
        .mass = mass * (1 + c->body.added_mass),
        .added = mass * c->body.added_mass,
        // Uniform over the waterline plane, as a prism.
        .inertia = mass * m.polar / m.area * (1 + c->body.added_inertia),
        .friction = c->body.friction,
        .restitution = c->body.restitution,
        .drag =
            bt_forces_drag(&m, c->body.draft, c->body.sail, c->water.density, c->air.density, c->body.drag.water_form,
                           c->body.drag.water_skin, c->body.drag.air_form, c->body.drag.air_skin),
    };
    d.drag.tangential = c->body.drag.tangential;
    bt_tow *t = w->tow = bt_setup_tow(c);
    if (prescribed) {
        const double s = bt_tow_speed(t, 0);
        d.vx = s * t->ux;
        d.vy = s * t->uy;
        d.yaw_rate = 0;
    }
    w->towed = bt_world_add(w, &d);
    r->thickness[bt_roster_row(r, w->towed)] = c->body.draft + c->body.sail;
}

static void add_wall(const bt_case *c, bt_world *w, double x, double y, double half_x, double half_y, double vx,
                     double vy)
{
    const double v[8] = {-half_x, -half_y, half_x, -half_y, half_x, half_y, -half_x, half_y};
    bt_body_def d = {.motion = vx != 0 || vy != 0 ? BT_KINEMATIC : BT_STATIC,
                     .large = true,
                     .n_vertices = 4,
                     .vertices = v,
                     .x = x,
                     .y = y,
                     .vx = vx,
                     .vy = vy,
                     .friction = c->domain.wall_friction,
                     .restitution = c->domain.wall_restitution};
    bt_world_add(w, &d);
}

/// Does body i begin with its free drift?
static bool begins_adrift(const bt_case *c, const bt_world *w, bt_idx i, const bt_roster *r)
{
    const bt_gid g = w->bodies.gid[i], row = bt_roster_row(r, g);
    if (c->ice.start != BT_START_DRIFT || w->bodies.motion[i] != BT_DYNAMIC) return false;
    return row < r->n_free || (g == w->towed ? isnan(c->body.vx) : isnan(c->floes[row - r->n_free].vx));
}

/// Free drift to the floes of the field, and to floes by hand and a free body whose velocity is not given.
/// Ice between walls has nowhere to drift across them: it has been there for long, and lies against one of them. False
/// when it was not found.
static bool begin_drift(const bt_case *c, bt_world *w, const bt_roster *r, bt_errors *err)
{
    bt_bodies *b = &w->bodies;
    const bool hold[2] = {c->domain.ends == BT_BOUND_WALL, c->domain.sides == BT_BOUND_WALL};
    bt_idx lost = 0;
#pragma omp parallel for schedule(dynamic, 64) reduction(+ : lost) if (BT_MANY(b->n, 2000))
    for (bt_idx i = 0; i < b->n; i++) {
        if (!begins_adrift(c, w, i, r)) continue;
        double u[2];
        if (!bt_drift_velocity(w, i, hold, u)) lost++;
        b->vel[i] = b->vel_start[i] = b->vel_free[i] = (bt_vel){.x = u[0], .y = u[1], .w = b->vel[i].w};
    }
    if (lost > 0)
        bt_errors_add(err,
                      "%s: ice.start: for %d bodies no velocity was found at which wind, water, Coriolis and slope "
                      "balance; set it to rest, or check drag, current and wind",
                      c->path ? c->path : "case", (int)lost);
    return lost == 0;
}

/// Floes in company. In a field their lee and their drift follow from each other: from the drift of lone floes, in
/// rounds, every floe with the factors of all (exposure.h), which undisturbed ice keeps.
static bool begin_sheltered(const bt_case *c, bt_world *w, const bt_roster *r, bt_errors *err)
{
    enum { ROUNDS = 2 };
    bool found = true;
    bt_exposure_setup(w, bt_case_reference_speed(c));
    for (int k = 0; k < ROUNDS && w->par.lee > 0 && w->par.exposure_steps > 0 && found; k++) {
        bt_exposure_look(w);
        const bt_gid n = r->n_floes + r->n_kept;
        const bt_exposure mean = bt_exposure_mean(w, n);
        for (bt_idx i = 0; i < w->bodies.n; i++)
            if (w->bodies.gid[i] < n) w->bodies.exposure[i] = mean;
        found = begin_drift(c, w, r, err);
    }
    return found;
}

/// A world with one round floe of this size and thickness, with the lee of others at this concentration.
static bt_world *one_floe(const bt_case *c, double size, double thickness, double concentration)
{
    bt_params p = bt_setup_params(c, size);
    bt_world *w = bt_world_create(&p);
    bt_forces_setup(w, c);
    double v[2 * BT_MAX_VERTICES];
    bt_shape_regular(24, BT_PI / 4 * size * size, v);
    bt_body_def d = {.motion = BT_DYNAMIC};
    floe_def(c, 24, v, thickness, &d);
    const bt_gid g = bt_world_add(w, &d);
    w->bodies.exposure[g] = bt_exposure_estimate(&w->par, size, thickness, concentration);
    return w;
}

void bt_setup_drift(const bt_case *c, double size, double thickness, double concentration, double floe[2],
                    double body[2])
{
    floe[0] = floe[1] = body[0] = body[1] = NAN;
    if (c->ice.start != BT_START_DRIFT) return;
    bt_world *w = one_floe(c, size, thickness, concentration);
    double thicknesses[2];
    bt_roster alone = {.n_floes = 1, .n_free = 1, .thickness = thicknesses};
    bt_errors unfound = {0}; // NaN says it
    if (c->body.shape != BT_BODY_ABSENT) add_towed_body(c, w, &alone);
    if (begin_drift(c, w, &alone, &unfound)) {
        floe[0] = w->bodies.vel[0].x, floe[1] = w->bodies.vel[0].y;
        if (c->body.shape != BT_BODY_ABSENT && begins_adrift(c, w, 1, &alone))
            body[0] = w->bodies.vel[1].x, body[1] = w->bodies.vel[1].y;
    }
    bt_errors_free(&unfound);
    bt_world_free(w);
}

/// Along which axes undisturbed ice rests, as step/window.h says.
static void held_ice(const bt_case *c, double concentration, bool held[2])
{
    const bool dense = concentration >= BT_BOUND_CONCENTRATION - BT_MADE_OFF,
               moving = c->domain.ends == BT_BOUND_MOVING;
    held[0] = dense && c->domain.ends == BT_BOUND_WALL;
    held[1] = (dense || moving) && c->domain.sides == BT_BOUND_WALL;
}

bt_track bt_setup_track(const bt_case *c, double size, double thickness, double concentration)
{
    enum { POINTS = 4000 };
    bt_trail body;
    if (c->tow.mode == BT_TOW_NONE || c->body.shape == BT_BODY_ABSENT || !bt_case_trail_begin(c, &body))
        return (bt_track){0};
    bt_case coarse = *c;
    coarse.run.dt = c->run.duration / (POINTS - 1);
    bt_world *w = one_floe(&coarse, size, thickness, concentration);
    w->environment = bt_environment_create(&coarse);
    bt_errors unfound = {0};
    // where it is not found from rest, as undisturbed ice goes on
    begin_drift(&coarse, w, &(bt_roster){.n_floes = 1, .n_free = 1}, &unfound);
    bt_errors_free(&unfound);
    bool held[2];
    held_ice(c, concentration, held);
    bt_undisturbed_create(w, 1, held);
    double *time = bt_alloc(POINTS, sizeof *time), *x = bt_alloc(POINTS, sizeof *x), *y = bt_alloc(POINTS, sizeof *y);
    bt_track t = {.n = POINTS, .time = time, .x = x, .y = y};
    for (int i = 0; i < POINTS; i++, w->step++) {
        double at[2];
        time[i] = c->run.duration * i / (POINTS - 1);
        bt_case_trail_to(&body, bt_case_tow_distance(c, time[i]), at);
        t.drift[0] = w->undisturbed->drift_x, t.drift[1] = w->undisturbed->drift_y;
        x[i] = at[0] - t.drift[0];
        y[i] = at[1] - t.drift[1];
        bt_environment_begin(w);
        bt_undisturbed_advance(w);
    }
    bt_case_trail_end(&body);
    bt_world_free(w);
    return t;
}

void bt_setup_track_free(bt_track *t)
{
    free((double *)t->time);
    free((double *)t->x);
    free((double *)t->y);
    *t = (bt_track){0};
}

static const char *const wall_names[4] = {"wall x low", "wall x high", "wall y low", "wall y high"};

/// Walls are slabs outside the domain, thick enough that nothing can pass and overlapping at the corners. Each pair of
/// bodies touches as one image: around a period a wall goes on for as far as any body reaches beyond the seam.
static int add_walls(const bt_case *c, bt_world *w, const char *names[4])
{
    double thick = bt_max(0.1 * bt_max(c->domain.length, c->domain.width), 5 * w->par.size);
    for (bt_idx i = 0; i < w->bodies.n && (w->par.period_x > 0 || w->par.period_y > 0); i++)
        thick = bt_max(thick, 1.1 * w->bodies.radius[i]);
    const double x0 = c->domain.x0, x1 = x0 + c->domain.length, y0 = c->domain.y0, y1 = y0 + c->domain.width;
    const double mid_x = 0.5 * (x0 + x1), mid_y = 0.5 * (y0 + y1), h = 0.5 * thick;
    int n = 0;
    if (c->domain.ends == BT_BOUND_WALL) {
        const double half = 0.5 * c->domain.width + thick, s = c->domain.ends_closing;
        add_wall(c, w, x0 - h, mid_y, h, half, s, 0);
        add_wall(c, w, x1 + h, mid_y, h, half, -s, 0);
        names[n++] = wall_names[0];
        names[n++] = wall_names[1];
    }
    if (c->domain.sides == BT_BOUND_WALL) {
        const double half = 0.5 * c->domain.length + thick, s = c->domain.sides_closing;
        add_wall(c, w, mid_x, y0 - h, half, h, 0, s);
        add_wall(c, w, mid_x, y1 + h, half, h, 0, -s);
        names[n++] = wall_names[2];
        names[n++] = wall_names[3];
    }
    return n;
}

/// Are the parts p of a and q of b, which lies d from a, apart, also while a moves on by (dx, dy) relative to b?
/// Separating axes of the convex hull of both ends of the path: edge normals of a and of b, and the normal of the path.
static bool parts_apart_on_path(const bt_world *w, bt_idx a, int p_first, bt_idx b, int q_first, const double d[2],
                                double dx, double dy)
{
    const bt_bodies *bd = &w->bodies;
    const int64_t from_a = bd->offset[a] + p_first, from_b = bd->offset[b] + q_first, na = bd->mark[from_a].count,
                  nb = bd->mark[from_b].count;
    for (int64_t k = 0; k <= na + nb; k++) {
        double nx = -dy, ny = dx;
        if (k < na + nb) {
            const int64_t first = k < na ? from_a : from_b, m = k < na ? na : nb,
                          at = k < na ? k : k - na;
            const double *p = bd->outline + 2 * (first + at), *q = bd->outline + 2 * (first + (at + 1) % m);
            nx = q[1] - p[1], ny = p[0] - q[0];
        }
        double low_a = INFINITY, high_a = -INFINITY, low_b = INFINITY, high_b = -INFINITY;
        const double along = nx * dx + ny * dy, offset = nx * d[0] + ny * d[1];
        for (int64_t i = from_a; i < from_a + na; i++) {
            const double p = nx * bd->outline[2 * i] + ny * bd->outline[2 * i + 1];
            low_a = bt_min(low_a, p + bt_min(along, 0));
            high_a = bt_max(high_a, p + bt_max(along, 0));
        }
        for (int64_t i = from_b; i < from_b + nb; i++) {
            const double p = nx * bd->outline[2 * i] + ny * bd->outline[2 * i + 1] + offset;
            low_b = bt_min(low_b, p);
            high_b = bt_max(high_b, p);
        }
        if (low_b >= high_a || low_a >= high_b) return true;
    }
    return false;
}

static bool apart_on_path(const bt_world *w, bt_idx a, bt_idx b, const double d[2], double dx, double dy)
{
    const bt_bodies *bd = &w->bodies;
    for (int p = bt_part_first(bd, a); p >= 0; p = bt_part_next(bd, a, p))
        for (int q = bt_part_first(bd, b); q >= 0; q = bt_part_next(bd, b, q))
            if (!parts_apart_on_path(w, a, p, b, q, d, dx, dy)) return false;
    return true;
}

/// The same for a displaced by from, and all images of b around the periods.
static bool images_apart(const bt_world *w, bt_idx a, bt_idx b, const double from[2], double dx, double dy)
{
    const double period[2] = {w->par.period_x, w->par.period_y}, way[2] = {dx, dy};
    double d[2], near[2];
    int64_t low[2] = {0, 0}, high[2] = {0, 0};
    bt_bodies_offset(w, a, b, d);
    for (int k = 0; k < 2; k++) {
        d[k] -= from[k];
        if (!(period[k] > 0)) continue;
        const double reach = w->bodies.radius[a] + w->bodies.radius[b]; // at either end of the way
        low[k] = (int64_t)ceil((bt_min(way[k], 0) - reach - d[k]) / period[k]);
        high[k] = (int64_t)floor((bt_max(way[k], 0) + reach - d[k]) / period[k]);
    }
    bool apart = true;
    for (int64_t i = low[0]; i <= high[0]; i++)
        for (int64_t j = low[1]; j <= high[1] && apart; j++) {
            near[0] = d[0] + (double)i * period[0];
            near[1] = d[1] + (double)j * period[1];
            apart = apart_on_path(w, a, b, near, dx, dy);
        }
    return apart;
}

/// Displacement of body m, of prescribed velocity, from the start until time t.
static void displacement(const bt_case *c, const bt_world *w, bt_idx m, double t, double d[2])
{
    d[0] = w->bodies.vel[m].x * t, d[1] = w->bodies.vel[m].y * t;
    if (m == bt_world_towed(w)) bt_setup_tow_displacement(c, w->tow, bt_case_tow_led(c, t), d);
}

/// Does j, on its way relative to i, meet it? On a course that changes in pieces of the run, each of them straight.
static bool meet(const bt_case *c, const bt_world *w, bt_idx i, bt_idx j, bool wall)
{
    const bool bent = c->tow.n_waypoints > 0 && (i == bt_world_towed(w) || j == bt_world_towed(w));
    const int pieces = bent ? 500 : 1;
    const double end = (double)bt_case_steps(c) * c->run.dt;
    double from[2] = {0, 0};
    for (int k = 1; k <= pieces; k++) {
        double di[2], dj[2];
        displacement(c, w, i, end * k / pieces, di);
        displacement(c, w, j, end * k / pieces, dj);
        const double to[2] = {dj[0] - di[0], dj[1] - di[1]};
        if (wall && (w->bodies.motion[j] == BT_STATIC || (to[0] == 0 && to[1] == 0))) return false;
        if (!images_apart(w, j, i, from, to[0] - from[0], to[1] - from[1])) return true;
        from[0] = to[0], from[1] = to[1];
    }
    return false;
}

/// Two bodies of infinite mass pass through each other without a contact: no prescribed path may cross such a body.
static bool check_prescribed(const bt_case *c, const bt_world *w, const bt_roster *r, bt_idx first_wall, bt_errors *err)
{
    const bt_bodies *b = &w->bodies;
    bool sound = true;
    for (bt_idx i = 0; i < b->n; i++)
        for (bt_idx j = i + 1; j < b->n; j++) {
            if (b->motion[i] == BT_DYNAMIC) break;
            if (b->motion[j] == BT_DYNAMIC || i >= first_wall) continue;
            const bool towed = i == bt_world_towed(w) || j == bt_world_towed(w);
            if (j == bt_world_towed(w) || j >= first_wall) {
                // Walls that stand may hold fixed bodies (piers) and were checked with the tow.
                if (!meet(c, w, i, j, j >= first_wall)) continue;
                bt_errors_add(
                    err,
                    "%s: %s meets %s, which cannot give way, on its prescribed path; shorten the run, move the "
                    "fixed floe, or tow on a line",
                    c->path ? c->path : "case", r->names[j - r->n_floes],
                    towed && j != bt_world_towed(w) ? "the towed body" : "a fixed floe of the list floes");
                sound = false;
            }
        }
    return sound;
}

/// Walls that leave less room than the ice takes end any run; who has set guard.overlap: 0 wants to see it.
static bool check_closing(const bt_case *c, const bt_field *f, bt_errors *err)
{
    const double made = f->n > 0 ? bt_field_floe_area(f) : bt_case_made_area(c),
                 closed = bt_ice_closed(c, made + bt_case_area_by_hand(c));
    if (!(closed >= 1) || c->guard.overlap == 0) return true;
    char how[64] = "none beside the body";
    if (isfinite(closed)) snprintf(how, sizeof how, "which would be a concentration of %.3g", closed);
    bt_errors_add(err,
                  "%s: domain.%s_closing: by the end of the run the walls leave less room than rigid floes take, %s; "
                  "slow them, shorten run.duration, or set ice.crushing.pressure or ice.rafting.kappa",
                  c->path ? c->path : "case", c->domain.ends_closing > 0 ? "ends" : "sides", how);
    return false;
}

/// How far fixed body i reaches from its centroid along an axis, m.
static double reach_along(const bt_bodies *b, bt_idx i, int axis)
{
    double reach = 0;
    for (int64_t k = b->offset[i]; k < b->offset[i + 1]; k++) reach = bt_max(reach, fabs(b->outline[2 * k + axis]));
    return reach;
}

/// A pair has one contact, with the nearest image: across a period there must be room for both images apart. Fixed
/// bodies do not turn, and do not meet each other.
static bool check_periods(const bt_case *c, const bt_world *w, bt_idx n_field, bt_idx first_wall, bt_errors *err)
{
    const bt_bodies *b = &w->bodies;
    double first = 0, second = 0, fixed[2] = {0, 0}; // the two largest radii, and what fixed bodies reach
    bt_idx longest[2] = {-1, -1};
    for (bt_idx i = 0; i < first_wall; i++) {
        for (int k = 0; k < 2 && b->motion[i] == BT_STATIC; k++) {
            const double r = reach_along(b, i, k);
            if (r > fixed[k]) fixed[k] = r, longest[k] = i;
        }
        if (b->motion[i] == BT_STATIC) continue;
        const double r = b->radius[i];
        if (r > first) second = first, first = r;
        else if (r > second) second = r;
    }
    const double periods[2] = {w->par.period_x, w->par.period_y};
    bool sound = true;
    for (int k = 0; k < 2; k++) {
        const double need = 2 * (first + second), beside = 2 * (first + fixed[k]);
        if (periods[k] > 0 && first > 0 && beside >= periods[k]) {
            bt_errors_add(err,
                          "%s: domain.%s: the period of %g m has no room for the largest body, as it turns, beside "
                          "floes[%d], which is fixed, and its image, %.4g m; cut that floe in two: fixed floes that "
                          "lie flush act as one",
                          c->path ? c->path : "case", k ? "width" : "length", periods[k],
                          (int)(longest[k] - n_field), beside);
            sound = false;
        }
        if (periods[k] > 0 && need >= periods[k]) {
            bt_errors_add(
                err,
                "%s: domain.%s: the period of %g m has no room for the two largest bodies side by side as they "
                "turn, %.4g m; enlarge it or take smaller bodies",
                c->path ? c->path : "case", k ? "width" : "length", periods[k], need);
            sound = false;
        }
    }
    return sound;
}

/// Floes of a field that was read may belong to another domain.
static bool check_inside(const bt_case *c, const bt_field *f, bt_errors *err)
{
    // A managed lead may cut a floe that reaches over an open edge, and leave a piece beyond it.
    const bool over_x = c->lead.mode == BT_LEAD_MANAGED && c->domain.ends == BT_BOUND_OPEN,
               over_y = c->lead.mode == BT_LEAD_MANAGED && c->domain.sides == BT_BOUND_OPEN;
    for (bt_idx i = 0; i < f->n; i++) {
        const double x = f->pose[3 * (size_t)i], y = f->pose[3 * (size_t)i + 1];
        if ((over_x || (x >= c->domain.x0 && x <= c->domain.x0 + c->domain.length)) &&
            (over_y || (y >= c->domain.y0 && y <= c->domain.y0 + c->domain.width)))
            continue;
        bt_errors_add(err, "%s: floe %d at (%g, %g) m is outside the domain; make the field for this domain",
                      c->ice.field ? c->ice.field : c->path ? c->path : "case", (int)i, x, y);
        return false;
    }
    return true;
}

/// What a body is to the user.
static void name_body(const bt_roster *r, bt_gid gid, char out[64])
{
    const bt_gid row = bt_roster_row(r, gid);
    if (row < r->n_free) snprintf(out, 64, "floe %lld of the ice", (long long)row);
    else if (row < r->n_floes) snprintf(out, 64, "floes[%lld]", (long long)(row - r->n_free));
    else snprintf(out, 64, "%s", r->names[row - r->n_floes]);
}

/// Nothing lies in anything else by more than the position projection takes out.
static bool check_apart(const bt_case *c, bt_world *w, const bt_roster *r, bt_errors *err)
{
    const double allowed = bt_max(w->par.slop, 1e-9 * r->mean_size);
    const bt_overlaps o = bt_world_overlaps(w, allowed);
    if (o.pairs == 0) return true;
    char a[64], b[64];
    name_body(r, o.a < o.b ? o.a : o.b, a);
    name_body(r, o.a < o.b ? o.b : o.a, b);
    bt_errors_add(err,
                  "%s: %lld pair%s of floes, towed body or walls overlap by up to %.3g m at the start (allowed: %.3g "
                  "m), deepest %s and %s; move or "
                  "shrink the floes given by hand, or make the field for this body and domain",
                  c->path ? c->path : "case", (long long)o.pairs, o.pairs == 1 ? "" : "s", o.deepest, allowed, a, b);
    return false;
}

/// Ids for the pieces of floes: each split makes one floe more, of two new ids.
static bt_gid kept_ids(const bt_case *c, const bt_field *f)
{
    if (!(c->ice.splitting.toughness > 0)) return 0;
    const bt_gid more = c->ice.splitting.reserve > 0 ? c->ice.splitting.reserve : 2 * ((bt_gid)f->n + c->n_floes);
    return 2 * more;
}

static void create_splitting(const bt_case *c, bt_world *w, const bt_roster *r)
{
    if (!(c->ice.splitting.toughness > 0)) return;
    bt_splitting *s = w->splitting = bt_alloc(1, sizeof *s);
    *s = (bt_splitting){
        .law = {.toughness = c->ice.splitting.toughness, .strength = c->ice.splitting.strength,
                .least_width = c->ice.splitting.least_size, .aspect = c->ice.splitting.aspect, .slop = w->par.slop},
        .modulus = c->ice.splitting.scatter,
        .seed = c->ice.seed,
        .generations = c->ice.splitting.generations,
        .first = r->n_free,
        .reserve = r->n_kept,
        .rule = bt_impact_rule_of(c),
        .large = 0.5 * LARGE_RATIO * r->mean_size,
    };
}

bt_status bt_setup_world(const bt_case *c, const bt_field *f, bt_world **out, bt_roster *r, bt_errors *err)
{
    double sum = 0, v[2 * BT_MAX_VERTICES];
    double size = f->n ? bt_field_mean_size(f) : c->ice.size;
    if (!f->n && c->n_floes) {
        for (bt_idx i = 0; i < c->n_floes; i++)
            sum += sqrt(4 * bt_shape_moments(bt_case_floe_outline(&c->floes[i], v), v).area / BT_PI);
        size = sum / c->n_floes;
    }
    if (!check_inside(c, f, err) || !check_closing(c, f, err)) return BT_ERR_CASE;
    bt_params p = bt_setup_params(c, size);
    bt_world *w = bt_world_create(&p);
    w->environment = bt_environment_create(c);
    bt_forces_setup(w, c);
    const bt_idx others = c->n_floes + 5; // floes by hand, body, four walls
    bt_bodies_reserve(&w->bodies, f->n + others, (f->n > 0 ? f->offsets[f->n] : 0) + (int64_t)others * 16);
    const bool with_body = c->body.shape != BT_BODY_ABSENT;
    *r = (bt_roster){.n_floes = f->n + c->n_floes, .mean_size = size, .n_free = f->n,
                      .n_kept = kept_ids(c, f)};
    r->thickness = bt_alloc((size_t)r->n_floes + 5, sizeof *r->thickness);
    r->names = bt_alloc(5, sizeof *r->names);
    add_field(c, f, w, r);
    bt_bodies_skip(&w->bodies, r->n_kept);
    add_floes_by_hand(c, w, r);
    int n = 0;
    if (with_body) {
        add_towed_body(c, w, r);
        r->names[n++] = "towed body";
    }
    const bool drifts = begin_drift(c, w, r, err);
    w->impacts = bt_impacts_create(c, w);
    create_splitting(c, w, r);
    const bt_idx first_wall = w->bodies.n;
    add_walls(c, w, r->names + n);
    *out = w;
    if (!drifts) return BT_ERR_CASE;
    const bool paths = check_prescribed(c, w, r, first_wall, err), periods = check_periods(c, w, f->n, first_wall, err);
    if (!paths || !periods) return BT_ERR_CASE;

    // Generated fields are free of overlap by construction; a field that was read, floes given by hand, body and walls
    // may not be.
    if (!check_apart(c, w, r, err)) return BT_ERR_CASE;
    if (!begin_sheltered(c, w, r, err)) return BT_ERR_CASE;
    bool held[2];
    held_ice(c, f->concentration, held);
    // floes by hand are no ice beside a field
    if (with_body) bt_undisturbed_create(w, f->n > 0 ? f->n : r->n_floes + r->n_kept, held);
    if (c->domain.ends == BT_BOUND_MOVING && with_body)
        bt_window_create(w, bt_case_tow_sign(c), c->domain.ahead, r->n_floes);
    // all have just been looked at: what rests needs no first step to show it
    memset(w->bodies.disturbed, 0, (size_t)w->bodies.n);
    return BT_OK;
}
