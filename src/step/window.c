// SPDX-License-Identifier: MIT
// Implementation of the moving window (step/window.h).
//
// Ranks. Whether a floe is due follows from its own state, so owners find these floes; the list, with the places they
// would take, goes to all ranks, and each tests the places against the bodies it owns. After that, all ranks that hold
// a body do the same, so copies stay equal; labels are renewed in the same step, which brings the floes to their new
// ranks.
#include "step/window.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/elementary.h"
#include "body/bodies.h"
#include "contact/contacts.h"
#include "force/forces.h"
#include "partition/domain.h"
#include "space/cells.h"
#include "tow/tow.h"

// --- undisturbed ice -------------------------------------------------------------------------------------------------

// Free drift of the mean floe, step by step; see step/window.h.

/// Perimeter of the convex hull, on which form drag acts, m.
static double hull_perimeter(const bt_bodies *bodies, bt_idx i)
{
    const int n = bt_body_corners(bodies, i);
    const double *v = bodies->vertices + 2 * bodies->offset[i], *per_length = bodies->per_length + bodies->offset[i];
    const bt_mark *mark = bodies->mark + bodies->offset[i];
    double sum = 0;
    for (int k = 0; k < n; k++) {
        const int to = mark[k].next;
        if (to == (k + 1) % n) sum += 1 / per_length[k];
        else if (to != k) sum += bt_hypot(v[2 * to] - v[2 * k], v[2 * to + 1] - v[2 * k + 1]); // across a bay
    }
    return sum;
}

/// Mean floe: its drag is that of all floes together over their number, all of it as skin drag: form drag needs a
/// width, and for a floe of any orientation that is the mean width of its convex hull, perimeter / π (Cauchy).
static void mean_floe(const bt_world *world, bt_undisturbed *ice, bt_gid n_floes)
{
    const bt_bodies *bodies = &world->bodies;
    double n = 0;
    for (bt_gid g = 0; g < n_floes; g++) {
        const bt_idx i = bt_world_index(world, g);
        if (i < 0 || bodies->motion[i] != BT_DYNAMIC) continue;
        const double perimeter = hull_perimeter(bodies, i);
        ice->mass += bodies->mass[i];
        ice->share += bodies->share[i] * bodies->mass[i];
        ice->inertia += bodies->inertia[i];
        ice->radius += bodies->radius[i];
        ice->area += bodies->area[i];
        ice->thickness += bodies->thickness[i];
        const bt_drag *drag = &bodies->drag[i];
        ice->exposure = bodies->exposure[i];
        ice->drag.water_skin += drag->water_skin + ice->exposure.water_form * drag->water_form * perimeter / BT_PI;
        ice->drag.air_skin += drag->air_skin + ice->exposure.air_form * drag->air_form * perimeter / BT_PI;
        // relative to the water, so that the mean of floes at rest in it is exactly so
        ice->vel.x += bodies->vel[i].x - world->par.water_u;
        ice->vel.y += bodies->vel[i].y - world->par.water_v;
        n++;
    }
    if (n == 0) { // no ice: the velocity of the water
        ice->vel = (bt_vel){.x = world->par.water_u, .y = world->par.water_v};
        return;
    }
    ice->share /= ice->mass;
    ice->mass /= n, ice->drag.water_skin /= n, ice->drag.air_skin /= n;
    ice->inertia /= n, ice->radius /= n, ice->area /= n, ice->thickness /= n;
    ice->vel.x = world->par.water_u + ice->vel.x / n, ice->vel.y = world->par.water_v + ice->vel.y / n;
}

void bt_undisturbed_create(bt_world *world, bt_gid n_floes, const bool held[2])
{
    bt_undisturbed *ice = world->undisturbed = bt_alloc(1, sizeof *ice);
    *ice = (bt_undisturbed){.held = {held[0], held[1]}, .exposure = bt_exposed};
    mean_floe(world, ice, n_floes);
    if (held[0]) ice->vel.x = 0;
    if (held[1]) ice->vel.y = 0;
}

/// By the table of force laws, like every floe, so that ice with the velocity of the water keeps it to the last bit.
void bt_undisturbed_advance(bt_world *world)
{
    bt_undisturbed *ice = world->undisturbed;
    if (!ice) return;
    bt_pose nowhere = {NAN, NAN, NAN};
    const bt_bodies one = {
        .n = 1, .pose = &nowhere, .radius = &ice->radius, .area = &ice->area, .thickness = &ice->thickness};
    bt_force_body mean = {
        .drag = &ice->drag, .exposure = &bt_exposed, .vel = ice->vel, .mass = ice->mass, .inertia = ice->inertia,
        .share = ice->share, .all = &one};
    const bt_vel water = {.x = world->par.water_u, .y = world->par.water_v};
    bt_vel u = ice->mass > 0 ? bt_forces_drift(world, &mean) : water;
    // NaN comes from a law that depends on the place. With a window it stays, and the run ends.
    if (!world->window && !(isfinite(u.x) && isfinite(u.y))) u = water;
    u.w = 0;
    if (ice->held[0]) u.x = 0;
    if (ice->held[1]) u.y = 0;
    ice->vel = u;
    ice->drift_x += world->par.dt * u.x;
    ice->drift_y += world->par.dt * u.y;
}

void bt_undisturbed_place(const bt_world *world, double at[2])
{
    const bt_undisturbed *ice = world->undisturbed;
    at[0] = world->tow->travel_x - (ice ? ice->drift_x : 0);
    at[1] = world->tow->travel_y - (ice ? ice->drift_y : 0);
}

// --- the window ------------------------------------------------------------------------------------------------------

#define ZONE_SHARE 0.5    // of `ahead`, and of the distance from body to rear, assumed

/// A floe that is due, and the place it would take.
typedef struct candidate {
    bt_gid gid;
    bt_pose place;
    double radius, mass, inertia;
    bt_vel was;
    int64_t n, first; ///< number and first of its vertices, those of parts included, in the list of all
    bool stays;
} candidate;

/// s of the body.
static double body_at(const bt_world *world)
{
    double at[2];
    bt_undisturbed_place(world, at);
    return world->window->sign * at[0];
}

void bt_window_create(bt_world *world, double sign, double ahead, bt_gid n_floes)
{
    bt_bodies *bodies = &world->bodies;
    const double length = world->par.period_x, zone = ZONE_SHARE * ahead;
    bt_window *window = world->window = bt_alloc(1, sizeof *window);
    *window = (bt_window){.sign = sign, .length = length, .ahead = ahead, .zone = zone, .n_floes = n_floes};
    window->stride = bt_min(BT_WINDOW_STRIDE * world->par.size, bt_min(0.25 * zone, length / 16));
    window->start = window->rear = body_at(world) + ahead - length;
    window->most = body_at(world);
    bt_bodies_make_homes(bodies);
    for (bt_idx i = 0; i < bodies->n; i++) {
        const double x = bodies->pose[i].x;
        bt_home *home = &bodies->home[i];
        *home = (bt_home){.x = x, .y = bodies->pose[i].y, .yaw = bodies->pose[i].yaw};
        if (bodies->gid[i] >= n_floes) continue;
        home->copy = bodies->lap[i] = bt_window_lap(world, x);
    }
}

int32_t bt_window_lap(const bt_world *world, double x)
{
    const bt_window *window = world->window;
    x -= world->undisturbed->drift_x;
    // the copy within [rear, rear + L)
    return (int32_t)(window->sign > 0 ? ceil((window->rear - x) / window->length)
                                      : floor((-x - window->rear) / window->length));
}

static bool renewable(const bt_world *world, bt_idx i)
{
    return world->bodies.gid[i] < world->window->n_floes && world->bodies.motion[i] == BT_DYNAMIC;
}

/// s of the home of floe i, and of the floe itself.
static double home_at(const bt_world *world, bt_idx i)
{
    const bt_home *home = &world->bodies.home[i];
    return world->window->sign * (home->x + home->copy * world->window->length);
}
static double floe_at(const bt_world *world, bt_idx i)
{
    const double x = world->bodies.pose[i].x + world->bodies.lap[i] * world->window->length;
    return world->window->sign * (x - world->undisturbed->drift_x);
}

/// Has the rear passed the home of floe i, and may the floe be taken from its present place?
static bool due(const bt_world *world, bt_idx i)
{
    const bt_window *window = world->window;
    const double late = window->rear - home_at(world, i);
    return late > 0 && floe_at(world, i) < window->rear + bt_min(late, ZONE_SHARE * (window->length - window->ahead));
}

/// The place that floe i takes in the mother field, wrapped into the period; *turns: periods taken off.
static bt_pose place_of(const bt_world *world, bt_idx i, int32_t *turns)
{
    const bt_window *window = world->window;
    const bt_home *home = &world->bodies.home[i];
    int32_t across = 0;
    bt_pose pose = {.yaw = home->yaw};
    pose.x = bt_into_period(home->x + world->undisturbed->drift_x, world->par.x0, window->length, turns);
    pose.y = bt_into_period(home->y + world->undisturbed->drift_y, world->par.y0, world->par.period_y, &across);
    return pose;
}

/// Vertices of the candidates relative to their centroids, rotated as at their places.
typedef struct shapes {
    double *vertex;  ///< [n][2] m
    bt_mark *mark;   ///< [n]
} shapes;

static int by_gid(const void *p, const void *q)
{
    const candidate *a = p, *b = q;
    return (a->gid > b->gid) - (a->gid < b->gid);
}

/// Collective. Collect all floes that are due, by id, and their shapes.
static candidate *collect(const bt_world *world, size_t *n, shapes *shape)
{
    const bt_bodies *bodies = &world->bodies;
    size_t m = 0, n_vertices = 0, all;
    candidate *mine = NULL;
    shapes own = {NULL, NULL};
    for (int pass = 0; pass < 2; pass++) { // first count, then fill
        if (pass) {
            mine = bt_alloc(m, sizeof *mine);
            own = (shapes){bt_alloc(2 * n_vertices, sizeof *own.vertex), bt_alloc(n_vertices, sizeof *own.mark)};
        }
        m = n_vertices = 0;
        for (bt_idx i = 0; i < bodies->n; i++) {
            if (!renewable(world, i) || !bt_domain_owns(world, i) || !due(world, i)) continue;
            int32_t turns = 0;
            const bt_pose pose = place_of(world, i, &turns);
            const int64_t count = bodies->offset[i + 1] - bodies->offset[i];
            if (pass)
                mine[m] = (candidate){.gid = bodies->gid[i], .place = pose, .radius = bodies->radius[i],
                                      .mass = bodies->mass[i], .inertia = bodies->inertia[i], .was = bodies->vel[i],
                                      .n = count};
            m++;
            double s, c;
            bt_sincos(pose.yaw, &s, &c);
            for (int64_t k = 0; pass && k < count; k++) {
                const double *q = bodies->vertices + 2 * (bodies->offset[i] + k);
                double *to = own.vertex + 2 * (n_vertices + (size_t)k);
                to[0] = c * q[0] - s * q[1];
                to[1] = s * q[0] + c * q[1];
                own.mark[n_vertices + (size_t)k] = bodies->mark[bodies->offset[i] + k];
            }
            n_vertices += (size_t)count;
        }
    }
    candidate *list = bt_domain_gather_all(world, mine, m, sizeof *mine, n);
    shape->vertex = bt_domain_gather_all(world, own.vertex, n_vertices, 2 * sizeof *own.vertex, &all);
    shape->mark = bt_domain_gather_all(world, own.mark, n_vertices, sizeof *own.mark, &all);
    free(mine);
    free(own.vertex);
    free(own.mark);
    int64_t first = 0;
    for (size_t k = 0; k < *n; k++) {
        list[k].first = first;
        first += list[k].n;
    }
    if (*n) qsort(list, *n, sizeof *list, by_gid);
    return list;
}

static candidate *find(candidate *list, size_t n, bt_gid gid)
{
    return n ? bsearch(&(candidate){.gid = gid}, list, n, sizeof *list, by_gid) : NULL;
}

/// Mark the places that body i, at its present pose, obstructs.
static void obstruct(const bt_world *world, bt_idx i, const candidate *list, size_t n, const shapes *s, double *blocked)
{
    const bt_bodies *bodies = &world->bodies;
    const bt_pose *pose = &bodies->pose[i];
    const double slop = bt_max(world->par.slop, 1e-9 * world->par.size);
    for (size_t k = 0; k < n; k++) {
        const candidate *found = &list[k];
        const double dx = bt_nearest_image(pose->x - found->place.x, world->par.period_x),
                     dy = bt_nearest_image(pose->y - found->place.y, world->par.period_y);
        const double reach = bodies->radius[i] + found->radius;
        if (dx * dx + dy * dy >= reach * reach) continue;
        if (bt_bodies_depth(bodies, i, s->mark + found->first, s->vertex + 2 * found->first, found->n, dx, dy) > slop)
            blocked[k] = 1;
    }
}

/// Collective. Find the candidates that stay: those whose place is obstructed by a body that is not a candidate, then
/// those obstructed by these, and so on; the rest can all move at once. Rounds mark all they can: no order matters.
static void settle_places(const bt_world *world, candidate *list, size_t n, const shapes *shape)
{
    const bt_bodies *bodies = &world->bodies;
    double half = 0, widest = 0; // the places lie within `half` of the first
    for (size_t k = 0; k < n; k++) {
        half = bt_max(half, fabs(bt_nearest_image(list[k].place.x - list[0].place.x, world->par.period_x)));
        widest = bt_max(widest, list[k].radius);
    }
    double *blocked = bt_alloc(n, sizeof *blocked);
    uint8_t *tested = bt_alloc((size_t)bodies->n, 1);
    for (bool more = true; more;) {
        for (bt_idx i = 0; i < bodies->n; i++) {
            if (tested[i] || !bt_domain_owns(world, i)) continue;
            const candidate *found = find(list, n, bodies->gid[i]);
            if (found && !found->stays) continue;
            tested[i] = 1;
            // walls leave room for the mother field
            if (bodies->motion[i] != BT_DYNAMIC && bodies->gid[i] != world->towed) continue;
            if (fabs(bt_nearest_image(bodies->pose[i].x - list[0].place.x, world->par.period_x)) >
                half + widest + bodies->radius[i])
                continue;
            obstruct(world, i, list, n, shape, blocked);
        }
        bt_domain_maxima(world, blocked, (int)n);
        more = false;
        for (size_t k = 0; k < n; k++) {
            more = more || (blocked[k] > 0 && !list[k].stays);
            list[k].stays = blocked[k] > 0;
        }
    }
    free(blocked);
    free(tested);
}

/// Was the body of this id moved? False where this rank does not hold it.
static bool was_moved(const bt_world *world, const uint8_t *moved, bt_gid gid)
{
    const bt_idx i = bt_world_index(world, gid);
    return i >= 0 && moved[i];
}

/// Drop the impulses and records of pairs with a moved floe: they belong to the place that it has left.
static void forget_contacts(bt_world *world, const uint8_t *moved)
{
    const bt_cells *cells = world->cells;
    for (bt_idx k = 0; k < cells->n; k++) {
        bt_cell *cell = &cells->cell[k];
        for (bt_idx j = 0; j < cell->search.n_pairs; j++) {
            bt_pair *pair = &cell->search.pairs[j];
            if (moved[pair->a] || moved[pair->b]) pair->contact = -1;
        }
        bt_idx kept = 0;
        for (bt_idx j = 0; j < cell->laws->n_memory; j++) {
            const bt_memory memory = cell->laws->memory[j];
            if (!was_moved(world, moved, memory.a) && !was_moved(world, moved, memory.b))
                cell->laws->memory[kept++] = memory;
        }
        cell->laws->n_memory = kept;
    }
}

static void put(bt_world *world, bt_idx i)
{
    bt_bodies *bodies = &world->bodies;
    const bt_window *window = world->window;
    bt_home *home = &bodies->home[i];
    int32_t turns = 0;
    bodies->pose[i] = place_of(world, i, &turns);
    home->copy += (int32_t)window->sign;
    bodies->lap[i] = turns + home->copy;
    bodies->vel[i] = bodies->vel_start[i] = bodies->vel_free[i] = world->undisturbed->vel;
    bodies->exposure[i] = world->undisturbed->exposure;
    bodies->disturbed[i] = 1;
    bt_bodies_turn(&world->bodies, i);
}

/// Every rank adds over all floes, held here or not, in the order of ids: the sums are the same everywhere.
static void account(bt_window *window, const candidate *found, const bt_vel *enters)
{
    const bt_vel *states[2] = {&found->was, enters};
    double *sums[2] = {window->dropped, window->brought};
    for (int k = 0; k < 2; k++) {
        const bt_vel *u = states[k];
        sums[k][0] += found->mass * u->x;
        sums[k][1] += found->mass * u->y;
        sums[k][2] += 0.5 * (found->mass * (u->x * u->x + u->y * u->y) + found->inertia * u->w * u->w);
    }
    window->renewed++;
    window->renewed_now++;
}

static void renew(bt_world *world, const candidate *list, size_t n)
{
    bt_window *window = world->window;
    uint8_t *moved = bt_alloc((size_t)world->bodies.n, 1);
    for (size_t k = 0; k < n; k++) {
        if (list[k].stays) continue;
        account(window, &list[k], &world->undisturbed->vel);
        const bt_idx i = bt_world_index(world, list[k].gid);
        if (i < 0) continue;
        moved[i] = 1;
        put(world, i);
    }
    if (window->renewed_now > 0) {
        forget_contacts(world, moved);
        world->cells->relabel = true;
    }
    free(moved);
}

/// Collective. Keep the floes, and give up the places, that the front zone has left behind; count floes that wait.
static void let_go(bt_world *world)
{
    enum { KEPT, MISSED, WAITING, N };
    bt_window *window = world->window;
    bt_bodies *bodies = &world->bodies;
    bt_totals totals = {.n_sums = N};
    for (bt_idx i = 0; i < bodies->n; i++) {
        if (!renewable(world, i)) continue;
        const bool own = bt_domain_owns(world, i);
        if (home_at(world, i) < window->rear - window->zone) {
            bodies->home[i].copy += (int32_t)window->sign;
            if (own) bt_sum_add(&totals.sum[MISSED], 1);
        }
        if (floe_at(world, i) < window->rear - window->zone) {
            bodies->lap[i] += (int32_t)window->sign;
            if (own) bt_sum_add(&totals.sum[KEPT], 1);
        }
        if (own && floe_at(world, i) < window->rear) bt_sum_add(&totals.sum[WAITING], 1);
    }
    bt_domain_reduce(world, &totals);
    window->kept += (int64_t)bt_sum_value(&totals.sum[KEPT]);
    window->missed += (int64_t)bt_sum_value(&totals.sum[MISSED]);
    window->waiting = (int64_t)bt_sum_value(&totals.sum[WAITING]);
}

void bt_window_begin(bt_world *world)
{
    bt_window *window = world->window;
    if (!window) return;
    window->renewed_now = 0;
    const double body = body_at(world);
    window->most = bt_max(window->most, body);
    window->overtaken = bt_max(window->overtaken, window->most - body);
    const double behind = body + window->ahead - window->length - window->rear;
    if (!(behind >= window->stride)) return; // the window does not follow a body that drifts back
    window->rear += window->stride * floor(behind / window->stride);
    size_t n;
    shapes shape;
    candidate *list = collect(world, &n, &shape);
    if (n > 0) {
        settle_places(world, list, n, &shape);
        renew(world, list, n);
    }
    free(list);
    free(shape.vertex);
    free(shape.mark);
    let_go(world);
}

uint64_t bt_window_hash(const bt_world *world)
{
    const bt_window *window = world->window;
    const bt_undisturbed *ice = world->undisturbed;
    const double state[] = {window->rear,    ice->drift_x,       ice->drift_y,    ice->vel.x,
                            ice->vel.y, (double)window->renewed, (double)window->kept, (double)window->missed};
    uint64_t h = 0, u;
    for (size_t k = 0; k < sizeof state / sizeof *state; k++) {
        memcpy(&u, &state[k], sizeof u);
        h = (h ^ u) * 0x9e3779b97f4a7c15u;
        h ^= h >> 29;
    }
    return h;
}
