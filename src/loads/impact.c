// SPDX-License-Identifier: MIT
// Collisions of the towed body: events over steps, their forces, loads by panel; definitions in loads/impact.h.
#include "loads/impact.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/elementary.h"
#include "base/inside.h"
#include "loads/collision.h"
#include "partition/domain.h"
#include "solve/kernel.h"
#include "space/cells.h"
#include "space/phases.h"

// --- contacts of the body --------------------------------------------------------------------------------------------

// Contacts of the towed body as a step leaves them: where, how hard, how fast; see loads/impact.h for the equations.

enum { CONTACT_WIDTH = sizeof(bt_body_contact) / sizeof(double) };
_Static_assert(sizeof(bt_body_contact) % sizeof(double) == 0, "a contact is a row of doubles");

typedef struct {
    bt_body_contact *row;
    int64_t n, cap;
    double c, s; ///< of the yaw of the towed body at X1
} contact_rows;

static bt_body_contact row_of(const bt_world *w, const bt_impacts *m, const bt_cell *cell, bt_idx j,
                              bt_idx towed, double c, double s)
{
    const bt_bodies *b = &w->bodies;
    const bt_contact *u = &cell->contacts[j];
    const bool is_b = u->b == towed;
    const bt_idx other = is_b ? u->a : u->b;
    const double sign = is_b ? 1 : -1;
    const bt_collision q = bt_contact_collision(w, u);

    // Arms in the world's axes from their products with n and t, turned into the body's frame at X1.
    const double along = is_b ? u->rbt : u->rat, arm = is_b ? q.rbn : q.ran;
    const double nx = c * u->nx + s * u->ny, ny = c * u->ny - s * u->nx;
    bt_body_contact t = {
        .gid = (double)b->gid[other],
        .x = along * nx + arm * ny,
        .y = along * ny - arm * nx,
        .nx = sign * nx,
        .ny = sign * ny,
        .normal = u->ln[0] + u->ln[1],
        .friction = u->lt,
        .collision = q.impulse,
        .approach = q.approach,
        .rest = q.rest,
        .mass = q.mass,
        .thickness = b->mass[other] > 0 ? b->mass[other] / (m->sheet * b->area[other]) : m->body_height,
        .corner = bt_contact_corner_of(b, u, cell->search.pairs[u->pair].part,
                               cell->gaps[j].feature[u->n > 1 && u->ln[1] > u->ln[0]]).angle,
    };
    for (int i = 0; i < u->n; i++) {
        const double a = is_b ? u->rbn[i] : u->ran[i];
        t.px[i] = along * nx + a * ny;
        t.py[i] = along * ny - a * nx;
        t.point[i] = u->ln[i];
    }
    return t;
}

static void add(contact_rows *t, const bt_body_contact *row)
{
    if (t->n == t->cap) t->row = bt_realloc(t->row, (size_t)(t->cap = t->cap ? 2 * t->cap : 64), sizeof *t->row);
    t->row[t->n++] = *row;
}

static void add_cell(const bt_world *w, const bt_impacts *m, bt_idx k, contact_rows *to)
{
    const bt_cell *cell = &w->cells->cell[k];
    const bt_idx towed = bt_world_towed(w);
    for (bt_idx j = 0; j < cell->n_contacts; j++) {
        const bt_contact *u = &cell->contacts[j];
        if ((u->a != towed && u->b != towed) || u->ln[0] + u->ln[1] == 0) continue;
        const bt_body_contact t = row_of(w, m, cell, j, towed, to->c, to->s);
        add(to, &t);
    }
}

static int by_gid(const void *a, const void *b)
{
    // A pair has one manifold. A floe of several parts has more: then by place.
    const bt_body_contact *p = a, *q = b;
    if (p->gid != q->gid) return p->gid < q->gid ? -1 : 1;
    if (p->x != q->x) return p->x < q->x ? -1 : 1;
    return (p->y > q->y) - (p->y < q->y);
}

/// Collective. All manifolds on the towed body with an impulse, in the order of gids, on rank 0: [*n], the caller
/// frees; nothing on other ranks. After the solve and before poses move.
static bt_body_contact *collect_body_contacts(const bt_world *w, const bt_impacts *m, int64_t *n)
{
    const bt_cells *ts = w->cells;
    const bt_idx towed = bt_world_towed(w);
    // A large movable body has its contacts in the last cell, which comes last of all; one of infinite mass has them in
    // the cells of the floes.
    const bt_idx from = w->bodies.large[towed] && w->bodies.motion[towed] == BT_DYNAMIC ? ts->start[BT_COLOURS] : 0;
    contact_rows all = {0};
    bt_sincos(w->bodies.pose[towed].yaw, &all.s, &all.c);
    if (!BT_MANY(ts->n_order - from, BT_FEW_CELLS))
        for (bt_idx i = from; i < ts->n_order; i++) add_cell(w, m, ts->order[i], &all);
    else {
#pragma omp parallel
        {
            contact_rows mine = {.c = all.c, .s = all.s};
#pragma omp for schedule(dynamic, 16)
            for (bt_idx i = from; i < ts->n_order; i++) add_cell(w, m, ts->order[i], &mine);
#pragma omp critical
            for (int64_t i = 0; i < mine.n; i++) add(&all, &mine.row[i]);
            free(mine.row);
        }
    }
    bt_body_contact *rows = all.row;
    *n = all.n;
    if (w->domain) {
        const double *mine = (const double *)(const void *)all.row;
        rows = (bt_body_contact *)(void *)bt_domain_gather(w, all.n, CONTACT_WIDTH, mine, n);
        free(all.row);
    }
    if (*n > 0) qsort(rows, (size_t)*n, sizeof *rows, by_gid);
    return rows;
}

// --- collisions ------------------------------------------------------------------------------------------------------

#define TURNED                                                                                                         \
    1.25 // a floe that turns may close the rest of its gap somewhat faster than the last step left it, assumed

bt_impact_rule bt_impact_rule_of(const bt_case *c)
{
    return (bt_impact_rule){.conversion = c->impact.conversion, .duration = c->impact.duration,
                            .pressure = c->impact.pressure, .real_corner = c->impact.corner == BT_CORNER_REAL,
                            .corner_angle = c->impact.corner_angle, .least_speed = c->impact.least_speed};
}

bt_impacts *bt_impacts_create(const bt_case *c, const bt_world *w)
{
    const bt_idx towed = bt_world_towed(w);
    if (towed < 0 || c->impact.conversion == BT_IMPACT_NONE) return NULL;
    bt_impacts *m = bt_alloc(1, sizeof *m);
    *m = (bt_impacts){
        .rule = bt_impact_rule_of(c),
        .dt = w->par.dt,
        .tolerance = w->par.tolerance,
        .sheet = c->ice.density * (1 + c->ice.added_mass),
        .body_height = c->body.draft + c->body.sail,
    };
    const bt_bodies *b = &w->bodies;
    const int64_t first = b->offset[towed];
    bt_panels_init(&m->panels, (int)c->impact.panels, (int)(b->offset[towed + 1] - first), b->vertices + 2 * first);
    return m;
}

void bt_impacts_free(bt_impacts *m)
{
    if (!m) return;
    bt_panels_free(&m->panels);
    free(m->contact);
    free(m->closed);
    free(m->open);
    free(m);
}

// --- force of a collision --------------------------------------------------------------------------------------------

void bt_impact_convert(const bt_impact_rule *r, bt_impact *e)
{
    if (!r->real_corner || !(e->corner > 0 && e->corner < BT_PI)) e->corner = r->corner_angle;
    if (r->conversion == BT_IMPACT_CRUSHING) {
        const double k = 2 * r->pressure * e->thickness * bt_tan(0.5 * e->corner);
        e->peak = bt_min(e->approach, e->impulse / e->mass) * sqrt(k * e->mass);
        e->mean = 2 / BT_PI * e->peak;
        e->duration = 0.5 * BT_PI * sqrt(e->mass / k);
    } else {
        e->duration = r->duration;
        e->mean = e->impulse / r->duration;
        e->peak = 0.5 * BT_PI * e->mean;
    }
}

void bt_impact_describe(const bt_impact_rule *r, char out[160])
{
    if (r->conversion == BT_IMPACT_CRUSHING)
        snprintf(out, 160, "crushing of %s%g deg at %g kPa",
                 r->real_corner ? "the real corner, without one of " : "a corner of ", r->corner_angle * 180 / BT_PI,
                 r->pressure / 1e3);
    else snprintf(out, 160, "half-sine of %g s", r->duration);
}

// --- events over steps -----------------------------------------------------------------------------------------------

static void close_event(bt_impacts *m, const bt_impact_open *o)
{
    if (m->n_closed == m->cap_closed)
        m->closed =
            bt_realloc(m->closed, (size_t)(m->cap_closed = m->cap_closed ? 2 * m->cap_closed : 64), sizeof *m->closed);
    bt_impact *e = &m->closed[m->n_closed++];
    *e = o->so_far;
    e->panel = bt_panels_at(&m->panels, e->x, e->y);
    bt_impact_convert(&m->rule, e);
}

/// Contacts t[n] of one floe in this step into its event; o is its open one, or empty. True when an event is there that
/// may go on.
static bool follow(const bt_impacts *m, bt_body_contact *t, int64_t n, double time, bt_impact_open *o, bool *begun)
{
    double sum = 0, approach = 0, rest = 0;
    int64_t most = 0;
    for (int64_t i = 0; i < n; i++) {
        sum += t[i].collision;
        if (t[i].collision > 0) approach = bt_max(approach, t[i].approach);
        rest = bt_max(rest, t[i].rest);
        if (t[i].collision > t[most].collision) most = i;
    }
    const bool goes_on = *begun && sum > 0 && approach <= TURNED * o->rest + m->tolerance;
    if (!goes_on && !(sum > 0 && approach >= m->rule.least_speed)) {
        for (int64_t i = 0; i < n; i++) t[i].collision = 0; // quasi-static
        return false;
    }
    if (!goes_on) *o = (bt_impact_open){.so_far = {.time = time, .gid = t[0].gid, .approach = approach}};
    *begun = true;
    bt_impact *e = &o->so_far;
    e->impulse += sum;
    o->rest = rest;
    if (t[most].collision > o->largest) {
        o->largest = t[most].collision;
        e->x = t[most].x, e->y = t[most].y;
        e->mass = t[most].mass, e->thickness = t[most].thickness, e->corner = t[most].corner;
    }
    return rest > m->tolerance;
}

/// Merge this step's contacts into the open events; both are in the order of gids.
static void follow_events(bt_impacts *m, double time)
{
    bt_impact_open *next = NULL;
    int64_t n_next = 0, at = 0;
    if (m->n_contacts > 0) next = bt_alloc((size_t)m->n_contacts, sizeof *next);
    for (int64_t i = 0; i < m->n_contacts;) {
        int64_t end = i + 1;
        while (end < m->n_contacts && m->contact[end].gid == m->contact[i].gid) end++;
        while (at < m->n_open && m->open[at].so_far.gid < m->contact[i].gid) close_event(m, &m->open[at++]);
        const bool was_open = at < m->n_open && m->open[at].so_far.gid == m->contact[i].gid;
        const bt_impact_open before = was_open ? m->open[at++] : (bt_impact_open){0};
        bt_impact_open o = before;
        bool there = was_open;
        const bool stays = follow(m, m->contact + i, end - i, time, &o, &there);
        const bool same = was_open && o.so_far.time == before.so_far.time;
        if (was_open && (!same || !stays)) {
            // Closed as it is, with this step's part if there was one; and another may have begun.
            close_event(m, same ? &o : &before);
        }
        if (there && !same && !stays) close_event(m, &o);
        if (stays) next[n_next++] = o;
        i = end;
    }
    while (at < m->n_open) close_event(m, &m->open[at++]);
    free(m->open);
    m->open = next;
    m->n_open = n_next;
}

// --- one step --------------------------------------------------------------------------------------------------------

/// Impulses of the step into panels and sums. c, s: yaw of the body at X1.
static void add_loads(bt_impacts *m, double c, double s)
{
    double hit[2] = {0, 0}, push = 0;
    m->largest_quasi_static_load = 0;
    for (int64_t i = 0; i < m->n_contacts; i++) {
        const bt_body_contact *t = &m->contact[i];
        const double fx = t->normal * t->nx - t->friction * t->ny, fy = t->normal * t->ny + t->friction * t->nx,
                     part = t->collision / t->normal;
        hit[0] += part * fx, hit[1] += part * fy;
        push = t->normal - t->collision + (i > 0 && t[-1].gid == t->gid ? push : 0);
        m->largest_quasi_static_load = bt_max(m->largest_quasi_static_load, push / m->dt);
        for (int k = 0; k < 2; k++) {
            if (!(t->point[k] > 0)) continue;
            const double share = t->point[k] / t->normal / m->dt;
            bt_panels_load(&m->panels, t->px[k], t->py[k], t->point[k] / m->dt, share * fx, share * fy);
        }
    }
    m->collision_x = c * hit[0] - s * hit[1];
    m->collision_y = s * hit[0] + c * hit[1];
}

void bt_impacts_take(bt_world *w)
{
    bt_impacts *m = w->impacts;
    if (!m) return;
    free(m->contact);
    m->contact = collect_body_contacts(w, m, &m->n_contacts);
    m->n_closed = 0;
    follow_events(m, (double)(w->step + 1) * w->par.dt);
    bt_panels_clear(&m->panels);
    double s, c;
    bt_sincos(w->bodies.pose[bt_world_towed(w)].yaw, &s, &c);
    add_loads(m, c, s);
}

void bt_impacts_end(bt_impacts *m)
{
    m->n_closed = 0;
    for (int64_t i = 0; i < m->n_open; i++) close_event(m, &m->open[i]);
    m->n_open = 0;
}
