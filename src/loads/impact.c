// SPDX-License-Identifier: MIT
// Collisions of the towed body: events over steps, their forces, loads by panel; definitions in loads/impact.h.
#include "loads/impact.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/elementary.h"
#include "base/inside.h"
#include "contact/law.h"
#include "contact/row.h"
#include "partition/domain.h"
#include "solve/kernel.h"
#include "space/cells.h"
#include "space/shore.h"

// --- contacts of the body --------------------------------------------------------------------------------------------

// Contacts of the towed body after a step: place, impulse, approach; equations in loads/impact.h.

enum { CONTACT_WIDTH = sizeof(bt_body_contact) / sizeof(double) };
_Static_assert(sizeof(bt_body_contact) % sizeof(double) == 0, "a contact is a row of doubles");

typedef struct {
    bt_body_contact *row;
    int64_t n, cap;
    double c, s; ///< of the yaw of the towed body at X1
} contact_rows;

/// Masses without the drag included in the solver's: a collision is short compared with the step.
static bt_inv bare(const bt_bodies *bodies, bt_idx i)
{
    return bodies->inv[i].m > 0 ? (bt_inv){1 / bodies->mass[i], 1 / bodies->inertia[i]} : (bt_inv){0};
}

static bt_body_contact row_of(const bt_world *world, const bt_impacts *impacts, const bt_cell *cell, bt_idx j,
                              bt_idx towed, double c, double s)
{
    const bt_bodies *bodies = &world->bodies;
    const bt_contact *contact = &cell->contacts[j];
    const bool is_b = contact->b == towed;
    const bt_idx other = is_b ? contact->a : contact->b;
    const double sign = is_b ? 1 : -1;
    const bt_collision collision = bt_contact_collision(world, contact);
    const bt_inv inverse = bare(bodies, other);

    // Arms in world axes from their products with n and t, rotated into the body's frame at X1.
    const double along = is_b ? contact->rbt : contact->rat, arm = is_b ? collision.rbn : collision.ran;
    const double nx = c * contact->nx + s * contact->ny, ny = c * contact->ny - s * contact->nx;
    bt_body_contact t = {
        .gid = (double)bodies->gid[other],
        .outline = (double)bt_shore_outline(world->shore, bodies->gid[other]),
        .x = along * nx + arm * ny,
        .y = along * ny - arm * nx,
        .nx = sign * nx,
        .ny = sign * ny,
        .normal = contact->ln[0] + contact->ln[1],
        .friction = contact->lt,
        .collision = collision.impulse,
        .approach = collision.approach,
        .rest = collision.rest,
        .mass = collision.mass,
        .arm = sign * arm,
        .other_arm = sign * (is_b ? collision.ran : collision.rbn),
        .inverse_mass = inverse.m,
        .inverse_inertia = inverse.i,
        .most = bt_collision_bears(world, cell, j, &collision),
        .thickness = bodies->mass[other] > 0 ? bodies->mass[other] / (impacts->sheet * bodies->area[other])
                                             : impacts->body_height,
        .corner = bt_contact_corner_of(world, contact, cell->search.pairs[contact->pair].part,
                               cell->gaps[j].feature[contact->n > 1 && contact->ln[1] > contact->ln[0]]).angle,
    };
    for (int i = 0; i < contact->n; i++) {
        const double a = is_b ? contact->rbn[i] : contact->ran[i];
        t.px[i] = along * nx + a * ny;
        t.py[i] = along * ny - a * nx;
        t.point[i] = contact->ln[i];
    }
    return t;
}

static void add(contact_rows *list, const bt_body_contact *row)
{
    BT_MAKE_ROOM(list->row, list->n, list->cap, 64);
    list->row[list->n++] = *row;
}

static void add_cell(const bt_world *world, const bt_impacts *impacts, bt_idx k, contact_rows *to)
{
    const bt_cell *cell = &world->cells->cell[k];
    const bt_idx towed = bt_world_towed(world);
    for (bt_idx j = 0; j < cell->n_contacts; j++) {
        const bt_contact *contact = &cell->contacts[j];
        if ((contact->a != towed && contact->b != towed) || contact->ln[0] + contact->ln[1] == 0) continue;
        const bt_body_contact t = row_of(world, impacts, cell, j, towed, to->c, to->s);
        add(to, &t);
    }
}

static int by_outline(const void *a, const void *b)
{
    // A pair has one manifold; a floe of several parts has more, sorted by place.
    const bt_body_contact *p = a, *q = b;
    if (p->outline != q->outline) return p->outline < q->outline ? -1 : 1;
    if (p->gid != q->gid) return p->gid < q->gid ? -1 : 1;
    if (p->x != q->x) return p->x < q->x ? -1 : 1;
    return (p->y > q->y) - (p->y < q->y);
}

/// Collective. All manifolds on the towed body with an impulse, [*n], outline by outline, on rank 0; NULL on other
/// ranks. The caller frees them. Call after the solve and before poses move.
static bt_body_contact *collect_body_contacts(const bt_world *world, const bt_impacts *impacts, int64_t *n)
{
    const bt_cells *ts = world->cells;
    const bt_idx towed = bt_world_towed(world);
    // The contacts of a large movable body are in the last cell, the last in the order; those of a body of infinite
    // mass are in the cells of the floes.
    const bt_idx from = world->bodies.large[towed] && world->bodies.motion[towed] == BT_DYNAMIC
                        ? ts->start[BT_COLOURS] : 0;
    contact_rows all = {0};
    bt_sincos(world->bodies.pose[towed].yaw, &all.s, &all.c);
    if (!BT_MANY(ts->n_order - from, BT_FEW_CELLS))
        for (bt_idx i = from; i < ts->n_order; i++) add_cell(world, impacts, ts->order[i], &all);
    else {
#pragma omp parallel
        {
            BT_PLAIN_NUMBERS;
            contact_rows mine = {.c = all.c, .s = all.s};
#pragma omp for schedule(dynamic, 16)
            for (bt_idx i = from; i < ts->n_order; i++) add_cell(world, impacts, ts->order[i], &mine);
#pragma omp critical
            for (int64_t i = 0; i < mine.n; i++) add(&all, &mine.row[i]);
            free(mine.row);
        }
    }
    bt_body_contact *rows = all.row;
    *n = all.n;
    if (world->domain) {
        const double *mine = (const double *)(const void *)all.row;
        rows = (bt_body_contact *)(void *)bt_domain_gather(world, all.n, CONTACT_WIDTH, mine, n);
        free(all.row);
    }
    if (*n > 0) qsort(rows, (size_t)*n, sizeof *rows, by_outline);
    return rows;
}

// --- collisions ------------------------------------------------------------------------------------------------------

#define TURNED                                                                                                         \
    1.25 // factor on the remaining approach: a turning floe may close the rest of its gap somewhat faster, assumed

bt_impact_rule bt_impact_rule_of(const bt_case *input)
{
    bt_params laws = {0};
    bt_laws_setup(input, &laws);
    return (bt_impact_rule){.conversion = input->impact.conversion, .duration = input->impact.duration,
                            .pressure = input->impact.pressure, .real_corner = input->impact.corner == BT_CORNER_REAL,
                            .corner_angle = input->impact.corner_angle, .least_speed = input->impact.least_speed,
                            .limited = bt_laws_on(&laws)};
}

bt_impacts *bt_impacts_create(const bt_case *input, const bt_world *world)
{
    const bt_idx towed = bt_world_towed(world);
    if (towed < 0 || input->impact.conversion == BT_IMPACT_NONE) return NULL;
    bt_impacts *impacts = bt_alloc(1, sizeof *impacts);
    *impacts = (bt_impacts){
        .rule = bt_impact_rule_of(input),
        .dt = world->par.dt,
        .tolerance = world->par.tolerance,
        .sheet = input->ice.density * (1 + input->ice.added_mass),
        .body_height = input->body.draft + input->body.sail,
    };
    const bt_bodies *bodies = &world->bodies;
    const int64_t first = bodies->offset[towed];
    bt_panels_init(&impacts->panels, (int)input->impact.panels, (int)(bodies->offset[towed + 1] - first),
                   bodies->vertices + 2 * first);
    return impacts;
}

void bt_impacts_free(bt_impacts *impacts)
{
    if (!impacts) return;
    bt_panels_free(&impacts->panels);
    free(impacts->contact);
    free(impacts->closed);
    free(impacts->open);
    free(impacts);
}

// --- force of a collision --------------------------------------------------------------------------------------------

void bt_impact_convert(const bt_impact_rule *rule, double most, bt_impact *impact)
{
    // as the limit of impact.corner_angle: where two flush edges meet, the angle is half a turn but for rounding
    if (!rule->real_corner || !(impact->corner > 0 && impact->corner < 179 * BT_PI / 180))
        impact->corner = rule->corner_angle;
    if (rule->conversion == BT_IMPACT_CRUSHING) {
        const double k = 2 * rule->pressure * impact->thickness * bt_tan(0.5 * impact->corner);
        impact->peak = bt_min(impact->approach, impact->impulse / impact->mass) * sqrt(k * impact->mass);
        impact->mean = 2 / BT_PI * impact->peak;
        impact->duration = 0.5 * BT_PI * sqrt(impact->mass / k);
    } else {
        impact->duration = rule->duration;
        impact->mean = impact->impulse / rule->duration;
        impact->peak = 0.5 * BT_PI * impact->mean;
    }
    if (most > 0 && impact->peak > most) {
        const double longer = impact->peak / most;
        impact->peak = most, impact->mean /= longer, impact->duration *= longer;
    }
}

void bt_impact_describe(const bt_impact_rule *rule, char out[160])
{
    const char *most = rule->limited ? ", at most what the ice bears" : "";
    if (rule->conversion == BT_IMPACT_CRUSHING)
        snprintf(out, 160, "crushing of %s%g deg at %g kPa%s",
                 rule->real_corner ? "the real corner, without one of " : "a corner of ",
                 rule->corner_angle * 180 / BT_PI, rule->pressure / 1e3, most);
    else snprintf(out, 160, "half-sine of %g s%s", rule->duration, most);
}

// --- events over steps -----------------------------------------------------------------------------------------------

static void close_event(bt_impacts *impacts, const bt_impact_open *o)
{
    BT_MAKE_ROOM(impacts->closed, impacts->n_closed, impacts->cap_closed, 64);
    bt_impact *impact = &impacts->closed[impacts->n_closed++];
    *impact = o->so_far;
    bt_impact_convert(&impacts->rule, o->most, impact);
}

/// m_e of contacts `contact[n]` that take the part `sum` of a collision together, kg.
static double mass_together(const bt_world *world, const bt_body_contact *contact, int64_t n, double sum)
{
    const bt_inv body = bare(&world->bodies, bt_world_towed(world));
    double x = 0, y = 0, arm = 0, other_arm = 0;
    for (int64_t i = 0; i < n; i++) {
        const double share = contact[i].collision / sum;
        if (share == 1) return contact[i].mass;
        x += share * contact[i].nx, y += share * contact[i].ny;
        arm += share * contact[i].arm, other_arm += share * contact[i].other_arm;
    }
    return 1 / ((body.m + contact->inverse_mass) * (x * x + y * y) + body.i * arm * arm +
                contact->inverse_inertia * other_arm * other_arm);
}

/// Add contacts `contact[n]` with one outline in this step to its event; o: its open event, or empty. True if there is
/// an event that may continue.
static bool follow(const bt_world *world, bt_body_contact *contact, int64_t n, double time, bt_impact_open *o,
                   bool *begun)
{
    const bt_impacts *impacts = world->impacts;
    double sum = 0, approach = 0, rest = 0, bears = 0;
    int64_t most = 0;
    for (int64_t i = 0; i < n; i++) {
        sum += contact[i].collision;
        if (contact[i].collision > 0) approach = bt_max(approach, contact[i].approach), bears += contact[i].most;
        rest = bt_max(rest, contact[i].rest);
        if (contact[i].collision > contact[most].collision) most = i;
    }
    const bool continues = *begun && sum > 0 && approach <= TURNED * o->rest + impacts->tolerance;
    if (!continues && !(sum > 0 && approach >= impacts->rule.least_speed)) {
        for (int64_t i = 0; i < n; i++) contact[i].collision = 0; // quasi-static
        return false;
    }
    if (!continues) *o = (bt_impact_open){.so_far = {.time = time, .approach = approach}};
    *begun = true;
    bt_impact *impact = &o->so_far;
    impact->impulse += sum;
    o->rest = rest;
    o->most = bt_max(o->most, bears);
    if (contact[most].collision > o->largest) {
        o->largest = contact[most].collision;
        impact->gid = contact[most].gid;
        impact->x = contact[most].x, impact->y = contact[most].y;
        impact->panel = bt_panels_at(&impacts->panels, impact->x, impact->y, contact[most].nx, contact[most].ny);
        impact->mass = mass_together(world, contact, n, sum);
        impact->thickness = contact[most].thickness, impact->corner = contact[most].corner;
    }
    return rest > impacts->tolerance;
}

/// The outline that a collision under way is with.
static double outline_of(const bt_world *world, const bt_impact_open *o)
{
    return (double)bt_shore_outline(world->shore, (bt_gid)o->so_far.gid);
}

/// Merge this step's contacts into the open events; both are in the order of outlines.
static void follow_events(bt_world *world, double time)
{
    bt_impacts *impacts = world->impacts;
    bt_impact_open *next = NULL;
    int64_t n_next = 0, at = 0;
    if (impacts->n_contacts > 0) next = bt_alloc((size_t)impacts->n_contacts, sizeof *next);
    for (int64_t i = 0; i < impacts->n_contacts;) {
        int64_t end = i + 1;
        const double outline = impacts->contact[i].outline;
        while (end < impacts->n_contacts && impacts->contact[end].outline == outline) end++;
        while (at < impacts->n_open && outline_of(world, &impacts->open[at]) < outline)
            close_event(impacts, &impacts->open[at++]);
        const bool was_open = at < impacts->n_open && outline_of(world, &impacts->open[at]) == outline;
        const bt_impact_open before = was_open ? impacts->open[at++] : (bt_impact_open){0};
        bt_impact_open o = before;
        bool there = was_open;
        const bool stays = follow(world, impacts->contact + i, end - i, time, &o, &there);
        const bool same = was_open && o.so_far.time == before.so_far.time;
        if (was_open && (!same || !stays)) {
            // Close it as it is, with this step's part if there was one; another may have begun.
            close_event(impacts, same ? &o : &before);
        }
        if (there && !same && !stays) close_event(impacts, &o);
        if (stays) next[n_next++] = o;
        i = end;
    }
    while (at < impacts->n_open) close_event(impacts, &impacts->open[at++]);
    free(impacts->open);
    impacts->open = next;
    impacts->n_open = n_next;
}

/// Add collision b, under way beside a with the same outline.
static void add_event(bt_impact_open *a, const bt_impact_open *b)
{
    const bt_impact_open *of = b->largest > a->largest ? b : a;
    bt_impact_open both = *of;
    both.so_far.time = bt_min(a->so_far.time, b->so_far.time);
    both.so_far.impulse = a->so_far.impulse + b->so_far.impulse;
    both.so_far.approach = bt_max(a->so_far.approach, b->so_far.approach);
    both.rest = bt_max(a->rest, b->rest);
    both.most = a->most > 0 && b->most > 0 ? a->most + b->most : 0;
    *a = both;
}

void bt_impacts_resume(bt_world *world)
{
    bt_impacts *impacts = world->impacts;
    int64_t n = 0;
    for (int64_t k = 0; k < impacts->n_open; k++) {
        const bt_impact_open o = impacts->open[k];
        const double outline = outline_of(world, &o);
        int64_t to = n;
        while (to > 0 && outline_of(world, &impacts->open[to - 1]) > outline) to--;
        if (to > 0 && outline_of(world, &impacts->open[to - 1]) == outline) {
            add_event(&impacts->open[to - 1], &o);
            continue;
        }
        memmove(&impacts->open[to + 1], &impacts->open[to], (size_t)(n++ - to) * sizeof o);
        impacts->open[to] = o;
    }
    impacts->n_open = n;
}

// --- one step --------------------------------------------------------------------------------------------------------

/// Add the impulses of the step to panels and sums. c, s: cosine and sine of the body's yaw at X1.
static void add_loads(bt_impacts *impacts, double c, double s)
{
    double hit[2] = {0, 0}, push = 0;
    impacts->largest_quasi_static_load = 0;
    for (int64_t i = 0; i < impacts->n_contacts; i++) {
        const bt_body_contact *contact = &impacts->contact[i];
        const double fx = contact->normal * contact->nx - contact->friction * contact->ny,
                     fy = contact->normal * contact->ny + contact->friction * contact->nx,
                     part = contact->collision / contact->normal;
        hit[0] += part * fx, hit[1] += part * fy;
        push = contact->normal - contact->collision + (i > 0 && contact[-1].outline == contact->outline ? push : 0);
        impacts->largest_quasi_static_load = bt_max(impacts->largest_quasi_static_load, push / impacts->dt);
        for (int k = 0; k < 2; k++) {
            if (!(contact->point[k] > 0)) continue;
            const double share = contact->point[k] / contact->normal / impacts->dt;
            bt_panels_load(&impacts->panels, &(bt_point_load){contact->px[k], contact->py[k], contact->nx, contact->ny,
                                                              contact->point[k] / impacts->dt, share * fx, share * fy});
        }
    }
    impacts->collision_x = c * hit[0] - s * hit[1];
    impacts->collision_y = s * hit[0] + c * hit[1];
}

void bt_impacts_take(bt_world *world)
{
    bt_impacts *impacts = world->impacts;
    if (!impacts) return;
    free(impacts->contact);
    impacts->contact = collect_body_contacts(world, impacts, &impacts->n_contacts);
    impacts->n_closed = 0;
    follow_events(world, (double)(world->step + 1) * world->par.dt);
    bt_panels_clear(&impacts->panels);
    double s, c;
    bt_sincos(world->bodies.pose[bt_world_towed(world)].yaw, &s, &c);
    add_loads(impacts, c, s);
}

void bt_impacts_end(bt_impacts *impacts)
{
    for (int64_t i = 0; i < impacts->n_open; i++) close_event(impacts, &impacts->open[i]);
    impacts->n_open = 0;
}

// --- one contact as a collision --------------------------------------------------------------------------------------

/// Interior angle of the outline of body i, rad, at vertex v of a part; NaN if there is no such vertex. Every corner of
/// a part is a corner of the outline: a cut leads from one corner of the outline to another. Fixed bodies that lie
/// against each other have one outline: the corner turns as far as its normal cone is wide.
static double interior_angle(const bt_world *world, bt_idx i, int part, uint32_t v)
{
    const bt_bodies *bodies = &world->bodies;
    const bt_mark *mark = bodies->mark + bodies->offset[i] + part;
    const uint32_t count = mark->count;
    if (v > count) return NAN;
    if (bt_shore_holds(world, i)) {
        const bt_face *face = bt_shore_faces(world->shore, bodies->gid[i], part) + (v < count ? v : 0);
        const double *u = face->u, *w = face->w;
        if (u[0] == 0 && u[1] == 0) return NAN;
        return BT_PI - bt_atan2(u[0] * w[1] - u[1] * w[0], u[0] * w[0] + u[1] * w[1]);
    }
    const int n = bt_body_corners(bodies, i), k = mark[v < count ? v : 0].corner; // v = count: the end of the last edge
    const double *o = bodies->outline + 2 * bodies->offset[i], *at = o + 2 * k, *before = o + 2 * (k ? k - 1 : n - 1),
                 *after = o + 2 * (k + 1 < n ? k + 1 : 0);
    const double px = at[0] - before[0], py = at[1] - before[1], qx = after[0] - at[0], qy = after[1] - at[1];
    return BT_PI - bt_atan2(px * qy - py * qx, px * qx + py * qy);
}

bt_contact_corner bt_contact_corner_of(const bt_world *world, const bt_contact *contact, const uint16_t part[2],
                                       uint32_t feature)
{
    if ((feature >> 20) == 0x7ffu)
        return (bt_contact_corner){bt_min(interior_angle(world, contact->a, part[0], (feature >> 10) & 0x3ffu),
                                          interior_angle(world, contact->b, part[1], feature & 0x3ffu)), -1};
    const bool reference_b = feature >> 31, of_reference = feature & 1u, of_b = reference_b == of_reference;
    return (bt_contact_corner){interior_angle(world, of_b ? contact->b : contact->a, part[of_b],
                                              (feature & 0xfffffu) >> 1), of_b};
}

bt_collision bt_contact_collision(const bt_world *world, const bt_contact *contact)
{
    const bt_bodies *bodies = &world->bodies;
    const double total = contact->ln[0] + contact->ln[1], share[2] = {contact->ln[0] / total, contact->ln[1] / total};
    const bt_inv ia = bare(bodies, contact->a), ib = bare(bodies, contact->b);
    bt_collision collision = {0};
    double v1 = 0, v2 = 0;
    for (int i = 0; i < contact->n; i++) {
        v1 += share[i] * bt_normal_velocity(contact, i, &bodies->vel_start[contact->a], &bodies->vel_start[contact->b]);
        v2 += share[i] * bt_normal_velocity(contact, i, &bodies->vel[contact->a], &bodies->vel[contact->b]);
        collision.ran += share[i] * contact->ran[i];
        collision.rbn += share[i] * contact->rbn[i];
    }
    const double effect = ia.m + ib.m + ia.i * collision.ran * collision.ran + ib.i * collision.rbn * collision.rbn;
    const double coupled = effect + (ia.i * collision.ran * contact->rat + ib.i * collision.rbn * contact->rbt) *
                           (contact->lt / total);
    if (v1 < 0 && v2 > v1) collision.impulse = coupled > 0 ? bt_min(total, (v2 - v1) / coupled) : total;
    collision.approach = bt_max(0, -v1);
    collision.rest = bt_max(0, -v2);
    collision.mass = 1 / effect;
    collision.whole = collision.impulse;
    if (collision.impulse > 0 && collision.rest > 0)
        collision.whole *= collision.approach / (collision.approach - collision.rest);
    return collision;
}

double bt_collision_bears(const bt_world *world, const bt_cell *cell, bt_idx j, const bt_collision *collision)
{
    if (!(collision->impulse > 0)) return INFINITY;
    const double stopped = bt_min(collision->approach, collision->whole / collision->mass);
    return bt_laws_bear(world, cell, j, 0.5 * collision->mass * stopped * stopped);
}
