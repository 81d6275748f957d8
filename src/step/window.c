// SPDX-License-Identifier: MIT
// The moving window: what step/window.h says, step by step.
//
// Ranks. Which floes are due follows from their own state, so owners find them; the list of them, with the places they
// would take, goes to all ranks, each of which tests the places against the bodies it owns. From there on everything is
// done alike by every rank that holds a body, so copies stay copies; labels are renewed in the same step, which brings
// the floes to their new ranks.
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

// Free drift of the mean floe, step by step; what it is for: step/window.h.

/// Of the convex hull, along which form drag acts, m.
static double hull_perimeter(const bt_bodies *b, bt_idx i)
{
    const int n = bt_body_corners(b, i);
    const double *v = b->vertices + 2 * b->offset[i], *per_length = b->per_length + b->offset[i];
    const bt_mark *mark = b->mark + b->offset[i];
    double sum = 0;
    for (int k = 0; k < n; k++) {
        const int to = mark[k].next;
        if (to == (k + 1) % n) sum += 1 / per_length[k];
        else if (to != k) sum += bt_hypot(v[2 * to] - v[2 * k], v[2 * to + 1] - v[2 * k + 1]); // across a bay
    }
    return sum;
}

/// Mean floe: its drag as that of all floes together over their number, all of it in the skin's, since a floe that has
/// no direction has a width of its own. Mean width of a convex hull: its perimeter / π (Cauchy).
static void mean_floe(const bt_world *w, bt_undisturbed *v, bt_gid n_floes)
{
    const bt_bodies *b = &w->bodies;
    double n = 0;
    for (bt_gid g = 0; g < n_floes; g++) {
        const bt_idx i = bt_world_index(w, g);
        if (i < 0 || b->motion[i] != BT_DYNAMIC) continue;
        const double perimeter = hull_perimeter(b, i);
        v->mass += b->mass[i];
        v->share += b->share[i] * b->mass[i];
        v->inertia += b->inertia[i];
        v->radius += b->radius[i];
        v->area += b->area[i];
        v->thickness += b->thickness[i];
        const bt_drag *d = &b->drag[i];
        v->exposure = b->exposure[i];
        v->drag.water_skin += d->water_skin + v->exposure.water_form * d->water_form * perimeter / BT_PI;
        v->drag.air_skin += d->air_skin + v->exposure.air_form * d->air_form * perimeter / BT_PI;
        // relative to the water, so that the mean of floes that rest in it does to the last bit
        v->vel.x += b->vel[i].x - w->par.water_u;
        v->vel.y += b->vel[i].y - w->par.water_v;
        n++;
    }
    if (n == 0) { // as the water goes
        v->vel = (bt_vel){.x = w->par.water_u, .y = w->par.water_v};
        return;
    }
    v->share /= v->mass;
    v->mass /= n, v->drag.water_skin /= n, v->drag.air_skin /= n;
    v->inertia /= n, v->radius /= n, v->area /= n, v->thickness /= n;
    v->vel.x = w->par.water_u + v->vel.x / n, v->vel.y = w->par.water_v + v->vel.y / n;
}

void bt_undisturbed_create(bt_world *w, bt_gid n_floes, const bool held[2])
{
    bt_undisturbed *v = w->undisturbed = bt_alloc(1, sizeof *v);
    *v = (bt_undisturbed){.held = {held[0], held[1]}, .exposure = bt_exposed};
    mean_floe(w, v, n_floes);
    if (held[0]) v->vel.x = 0;
    if (held[1]) v->vel.y = 0;
}

/// By the table of force laws, as of every floe; so what has the velocity of the water keeps it to the last bit.
void bt_undisturbed_advance(bt_world *w)
{
    bt_undisturbed *v = w->undisturbed;
    if (!v) return;
    bt_pose nowhere = {NAN, NAN, NAN};
    const bt_bodies one = {
        .n = 1, .pose = &nowhere, .radius = &v->radius, .area = &v->area, .thickness = &v->thickness};
    bt_force_body mean = {
        .drag = &v->drag, .exposure = &bt_exposed, .vel = v->vel, .mass = v->mass, .inertia = v->inertia,
        .share = v->share, .all = &one};
    const bt_vel water = {.x = w->par.water_u, .y = w->par.water_v};
    bt_vel u = v->mass > 0 ? bt_forces_drift(w, &mean) : water;
    // A law that depends on the place. The ice that a window takes in has none, and the run ends.
    if (!w->window && !(isfinite(u.x) && isfinite(u.y))) u = water;
    u.w = 0;
    if (v->held[0]) u.x = 0;
    if (v->held[1]) u.y = 0;
    v->vel = u;
    v->drift_x += w->par.dt * u.x;
    v->drift_y += w->par.dt * u.y;
}

void bt_undisturbed_place(const bt_world *w, double at[2])
{
    const bt_undisturbed *v = w->undisturbed;
    at[0] = w->tow->travel_x - (v ? v->drift_x : 0);
    at[1] = w->tow->travel_y - (v ? v->drift_y : 0);
}

// --- the window ------------------------------------------------------------------------------------------------------

#define ZONE_SHARE 0.5    // of `ahead`, and of the way behind the body, assumed

/// A floe that could go, and the place it would take.
typedef struct candidate {
    bt_gid gid;
    bt_pose place;
    double radius, mass, inertia;
    bt_vel was;
    int64_t n, first; ///< its vertices at the place, with those of parts, in the list of them all
    bool stays;
} candidate;

/// s of the body.
static double body_at(const bt_world *w)
{
    double at[2];
    bt_undisturbed_place(w, at);
    return w->window->sign * at[0];
}

void bt_window_create(bt_world *w, double sign, double ahead, bt_gid n_floes)
{
    bt_bodies *b = &w->bodies;
    const double length = w->par.period_x, zone = ZONE_SHARE * ahead;
    bt_window *v = w->window = bt_alloc(1, sizeof *v);
    *v = (bt_window){.sign = sign, .length = length, .ahead = ahead, .zone = zone, .n_floes = n_floes};
    v->stride = bt_min(BT_WINDOW_STRIDE * w->par.size, bt_min(0.25 * zone, length / 16));
    v->start = v->rear = body_at(w) + ahead - length;
    v->most = body_at(w);
    bt_bodies_make_homes(b);
    for (bt_idx i = 0; i < b->n; i++) {
        const double x = b->pose[i].x;
        bt_home *h = &b->home[i];
        *h = (bt_home){.x = x, .y = b->pose[i].y, .yaw = b->pose[i].yaw};
        if (b->gid[i] >= n_floes) continue;
        h->copy = b->lap[i] = bt_window_lap(w, x);
    }
}

int32_t bt_window_lap(const bt_world *w, double x)
{
    const bt_window *v = w->window;
    x -= w->undisturbed->drift_x;
    // the copy that lies within [rear, rear + L)
    return (int32_t)(v->sign > 0 ? ceil((v->rear - x) / v->length) : floor((-x - v->rear) / v->length));
}

static bool renewable(const bt_world *w, bt_idx i)
{
    return w->bodies.gid[i] < w->window->n_floes && w->bodies.motion[i] == BT_DYNAMIC;
}

/// s of the home of floe i, and of the floe itself.
static double home_at(const bt_world *w, bt_idx i)
{
    const bt_home *h = &w->bodies.home[i];
    return w->window->sign * (h->x + h->copy * w->window->length);
}
static double floe_at(const bt_world *w, bt_idx i)
{
    const double x = w->bodies.pose[i].x + w->bodies.lap[i] * w->window->length;
    return w->window->sign * (x - w->undisturbed->drift_x);
}

/// Has the rear passed the home of floe i, and may the floe be taken from where it is?
static bool due(const bt_world *w, bt_idx i)
{
    const bt_window *v = w->window;
    const double late = v->rear - home_at(w, i);
    return late > 0 && floe_at(w, i) < v->rear + bt_min(late, ZONE_SHARE * (v->length - v->ahead));
}

/// Place that floe i takes in the mother field around the period; *turns: periods that it lies from there without
/// copies.
static bt_pose place_of(const bt_world *w, bt_idx i, int32_t *turns)
{
    const bt_window *v = w->window;
    const bt_home *h = &w->bodies.home[i];
    int32_t across = 0;
    bt_pose p = {.yaw = h->yaw};
    p.x = bt_into_period(h->x + w->undisturbed->drift_x, w->par.x0, v->length, turns);
    p.y = bt_into_period(h->y + w->undisturbed->drift_y, w->par.y0, w->par.period_y, &across);
    return p;
}

/// Vertices of the candidates, turned as at their places, relative to the centroids.
typedef struct shapes {
    double *vertex;  ///< [n][2] m
    bt_mark *mark;   ///< [n]
} shapes;

static int by_gid(const void *p, const void *q)
{
    const candidate *a = p, *b = q;
    return (a->gid > b->gid) - (a->gid < b->gid);
}

/// Collective. All floes that are due, by id, and their shapes.
static candidate *collect(const bt_world *w, size_t *n, shapes *shape)
{
    const bt_bodies *b = &w->bodies;
    size_t m = 0, n_vertices = 0, all;
    candidate *mine = NULL;
    shapes own = {NULL, NULL};
    for (int pass = 0; pass < 2; pass++) { // to count, to fill
        if (pass) {
            mine = bt_alloc(m, sizeof *mine);
            own = (shapes){bt_alloc(2 * n_vertices, sizeof *own.vertex), bt_alloc(n_vertices, sizeof *own.mark)};
        }
        m = n_vertices = 0;
        for (bt_idx i = 0; i < b->n; i++) {
            if (!renewable(w, i) || !bt_domain_owns(w, i) || !due(w, i)) continue;
            int32_t turns = 0;
            const bt_pose p = place_of(w, i, &turns);
            const int64_t count = b->offset[i + 1] - b->offset[i];
            if (pass)
                mine[m] = (candidate){.gid = b->gid[i], .place = p, .radius = b->radius[i], .mass = b->mass[i],
                                      .inertia = b->inertia[i], .was = b->vel[i], .n = count};
            m++;
            double s, c;
            bt_sincos(p.yaw, &s, &c);
            for (int64_t k = 0; pass && k < count; k++) {
                const double *q = b->vertices + 2 * (b->offset[i] + k);
                double *to = own.vertex + 2 * (n_vertices + (size_t)k);
                to[0] = c * q[0] - s * q[1];
                to[1] = s * q[0] + c * q[1];
                own.mark[n_vertices + (size_t)k] = b->mark[b->offset[i] + k];
            }
            n_vertices += (size_t)count;
        }
    }
    candidate *list = bt_domain_gather_all(w, mine, m, sizeof *mine, n);
    shape->vertex = bt_domain_gather_all(w, own.vertex, n_vertices, 2 * sizeof *own.vertex, &all);
    shape->mark = bt_domain_gather_all(w, own.mark, n_vertices, sizeof *own.mark, &all);
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

/// Mark the places that body i, where it is, does not leave free.
static void obstruct(const bt_world *w, bt_idx i, const candidate *list, size_t n, const shapes *s, double *blocked)
{
    const bt_bodies *b = &w->bodies;
    const bt_pose *p = &b->pose[i];
    const double slop = bt_max(w->par.slop, 1e-9 * w->par.size);
    for (size_t k = 0; k < n; k++) {
        const candidate *c = &list[k];
        const double dx = bt_nearest_image(p->x - c->place.x, w->par.period_x),
                     dy = bt_nearest_image(p->y - c->place.y, w->par.period_y);
        const double reach = b->radius[i] + c->radius;
        if (dx * dx + dy * dy >= reach * reach) continue;
        if (bt_bodies_depth(b, i, s->mark + c->first, s->vertex + 2 * c->first, c->n, dx, dy) > slop) blocked[k] = 1;
    }
}

/// Collective. Which candidates stay: those whose place is held by a body that is not a candidate, then those whose
/// place is held by one of these, and so on; what is left can go all at once. Each round, all that it can tell: the
/// order of nothing matters.
static void settle_places(const bt_world *w, candidate *list, size_t n, const shapes *shape)
{
    const bt_bodies *b = &w->bodies;
    double half = 0, widest = 0; // the places lie within this of the first
    for (size_t k = 0; k < n; k++) {
        half = bt_max(half, fabs(bt_nearest_image(list[k].place.x - list[0].place.x, w->par.period_x)));
        widest = bt_max(widest, list[k].radius);
    }
    double *blocked = bt_alloc(n, sizeof *blocked);
    uint8_t *tested = bt_alloc((size_t)b->n, 1);
    for (bool more = true; more;) {
        for (bt_idx i = 0; i < b->n; i++) {
            if (tested[i] || !bt_domain_owns(w, i)) continue;
            const candidate *c = find(list, n, b->gid[i]);
            if (c && !c->stays) continue;
            tested[i] = 1;
            if (b->motion[i] != BT_DYNAMIC && b->gid[i] != w->towed) continue; // walls leave room for the mother field
            if (fabs(bt_nearest_image(b->pose[i].x - list[0].place.x, w->par.period_x)) > half + widest + b->radius[i])
                continue;
            obstruct(w, i, list, n, shape, blocked);
        }
        bt_domain_maxima(w, blocked, (int)n);
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
static bool was_moved(const bt_world *w, const uint8_t *moved, bt_gid gid)
{
    const bt_idx i = bt_world_index(w, gid);
    return i >= 0 && moved[i];
}

/// What a pair knew, its impulses and the records of all laws, is of the place that the floe has left.
static void forget_contacts(bt_world *w, const uint8_t *moved)
{
    const bt_cells *t = w->cells;
    for (bt_idx k = 0; k < t->n; k++) {
        bt_cell *cell = &t->cell[k];
        for (bt_idx j = 0; j < cell->search.n_pairs; j++) {
            bt_pair *p = &cell->search.pairs[j];
            if (moved[p->a] || moved[p->b]) p->contact = -1;
        }
        bt_idx kept = 0;
        for (bt_idx j = 0; j < cell->laws.n_memory; j++) {
            const bt_memory r = cell->laws.memory[j];
            if (!was_moved(w, moved, r.a) && !was_moved(w, moved, r.b)) cell->laws.memory[kept++] = r;
        }
        cell->laws.n_memory = kept;
    }
}

static void put(bt_world *w, bt_idx i)
{
    bt_bodies *b = &w->bodies;
    const bt_window *v = w->window;
    bt_home *h = &b->home[i];
    int32_t turns = 0;
    b->pose[i] = place_of(w, i, &turns);
    h->copy += (int32_t)v->sign;
    b->lap[i] = turns + h->copy;
    b->vel[i] = b->vel_start[i] = b->vel_free[i] = w->undisturbed->vel;
    b->exposure[i] = w->undisturbed->exposure;
    b->disturbed[i] = 1;
    bt_bodies_turn(&w->bodies, i);
}

/// Every rank adds in the order of ids, all floes, held here or not: the sums are the same everywhere.
static void account(bt_window *v, const candidate *c, const bt_vel *enters)
{
    const bt_vel *states[2] = {&c->was, enters};
    double *sums[2] = {v->dropped, v->brought};
    for (int k = 0; k < 2; k++) {
        const bt_vel *u = states[k];
        sums[k][0] += c->mass * u->x;
        sums[k][1] += c->mass * u->y;
        sums[k][2] += 0.5 * (c->mass * (u->x * u->x + u->y * u->y) + c->inertia * u->w * u->w);
    }
    v->renewed++;
    v->renewed_now++;
}

static void renew(bt_world *w, const candidate *list, size_t n)
{
    bt_window *v = w->window;
    uint8_t *moved = bt_alloc((size_t)w->bodies.n, 1);
    for (size_t k = 0; k < n; k++) {
        if (list[k].stays) continue;
        account(v, &list[k], &w->undisturbed->vel);
        const bt_idx i = bt_world_index(w, list[k].gid);
        if (i < 0) continue;
        moved[i] = 1;
        put(w, i);
    }
    if (v->renewed_now > 0) {
        forget_contacts(w, moved);
        w->cells->relabel = true;
    }
    free(moved);
}

/// Collective. Floes and places that the front zone has left behind as they are; floes that wait.
static void let_go(bt_world *w)
{
    enum { KEPT, MISSED, WAITING, N };
    bt_window *v = w->window;
    bt_bodies *b = &w->bodies;
    bt_totals t = {.n_sums = N};
    for (bt_idx i = 0; i < b->n; i++) {
        if (!renewable(w, i)) continue;
        const bool own = bt_domain_owns(w, i);
        if (home_at(w, i) < v->rear - v->zone) {
            b->home[i].copy += (int32_t)v->sign;
            if (own) bt_sum_add(&t.sum[MISSED], 1);
        }
        if (floe_at(w, i) < v->rear - v->zone) {
            b->lap[i] += (int32_t)v->sign;
            if (own) bt_sum_add(&t.sum[KEPT], 1);
        }
        if (own && floe_at(w, i) < v->rear) bt_sum_add(&t.sum[WAITING], 1);
    }
    bt_domain_reduce(w, &t);
    v->kept += (int64_t)bt_sum_value(&t.sum[KEPT]);
    v->missed += (int64_t)bt_sum_value(&t.sum[MISSED]);
    v->waiting = (int64_t)bt_sum_value(&t.sum[WAITING]);
}

void bt_window_begin(bt_world *w)
{
    bt_window *v = w->window;
    if (!v) return;
    v->renewed_now = 0;
    const double body = body_at(w);
    v->most = bt_max(v->most, body);
    v->overtaken = bt_max(v->overtaken, v->most - body);
    const double behind = body + v->ahead - v->length - v->rear;
    if (!(behind >= v->stride)) return; // a body that drifts back does not take the window with it
    v->rear += v->stride * floor(behind / v->stride);
    size_t n;
    shapes shape;
    candidate *list = collect(w, &n, &shape);
    if (n > 0) {
        settle_places(w, list, n, &shape);
        renew(w, list, n);
    }
    free(list);
    free(shape.vertex);
    free(shape.mark);
    let_go(w);
}

uint64_t bt_window_hash(const bt_world *w)
{
    const bt_window *v = w->window;
    const bt_undisturbed *ice = w->undisturbed;
    const double state[] = {v->rear,    ice->drift_x,       ice->drift_y,    ice->vel.x,
                            ice->vel.y, (double)v->renewed, (double)v->kept, (double)v->missed};
    uint64_t h = 0, u;
    for (size_t k = 0; k < sizeof state / sizeof *state; k++) {
        memcpy(&u, &state[k], sizeof u);
        h = (h ^ u) * 0x9e3779b97f4a7c15u;
        h ^= h >> 29;
    }
    return h;
}
