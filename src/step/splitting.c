// SPDX-License-Identifier: MIT
// Loads of the floes in a step, floes that split by them, and pieces in their place; see step/splitting.h.
#include "step/splitting.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/elementary.h"
#include "base/inside.h"
#include "body/bodies.h"
#include "contact/crush.h"
#include "contact/law.h"
#include "contact/row.h"
#include "force/forces.h"
#include "loads/collision.h"
#include "partition/domain.h"
#include "space/cells.h"
#include "split/cut.h"

void bt_splitting_free(bt_splitting *s)
{
    if (!s) return;
    free(s->split);
    free(s->begin);
    free(s->vertex);
    free(s->sum);
    free(s->borne);
    free(s);
}

// --- the history -----------------------------------------------------------------------------------------------------

static bool is_piece(const bt_splitting *s, bt_gid gid) { return gid >= s->first && gid < s->first + 2 * s->n; }

int64_t bt_splitting_generation(const bt_splitting *s, bt_gid gid)
{
    return s && is_piece(s, gid) ? bt_splitting_birth(s, gid - s->first)->generation : 0;
}

bt_gid bt_splitting_ancestor(const bt_splitting *s, bt_gid gid, int64_t *path)
{
    int64_t way = 0, bit = 1;
    for (; s && is_piece(s, gid); bit <<= 1) {
        const bt_gid k = gid - s->first;
        way |= k % 2 ? bit : 0;
        gid = bt_splitting_birth(s, k)->parent;
    }
    *path = bit | way;
    return gid;
}

void bt_splitting_append(bt_splitting *s, const bt_split_record *r, const double *vertex)
{
    if (s->n == s->cap) {
        s->cap = s->cap ? 2 * s->cap : 64;
        s->split = bt_realloc(s->split, (size_t)s->cap, sizeof *s->split);
        s->begin = bt_realloc(s->begin, (size_t)s->cap, sizeof *s->begin);
    }
    s->begin[s->n] = s->n_vertices;
    s->split[s->n++] = *r;
    const int64_t more = r->corners[0] + r->corners[1] + r->corners[2];
    if (s->n_vertices + more > s->cap_vertices) {
        s->cap_vertices = 2 * s->cap_vertices + more;
        s->vertex = bt_realloc(s->vertex, (size_t)s->cap_vertices, 2 * sizeof *s->vertex);
    }
    memcpy(s->vertex + 2 * s->n_vertices, vertex, 2 * (size_t)more * sizeof *vertex);
    s->n_vertices += more;
}

// --- loads -----------------------------------------------------------------------------------------------------------

/// A load of a floe, or, without a force, a floe that lies over or under another one.
typedef struct {
    bt_gid floe;
    bt_floe_load load;
} load_row;

typedef struct {
    load_row *row;
    size_t n, cap;
} load_list;

static void add(load_list *l, const load_row *r)
{
    if (l->n == l->cap) l->row = bt_realloc(l->row, (l->cap = l->cap ? 2 * l->cap : 256), sizeof *l->row);
    l->row[l->n++] = *r;
}

static bool may_split(const bt_world *w, bt_idx i)
{
    const bt_bodies *b = &w->bodies;
    return b->motion[i] == BT_DYNAMIC && b->thickness[i] > 0 && b->gid[i] != w->towed;
}

/// Body i as the law sees it.
static bt_split_floe floe_of(const bt_world *w, bt_idx i)
{
    const bt_splitting *s = w->splitting;
    const bt_bodies *b = &w->bodies;
    bt_split_floe f = {.n = bt_body_corners(b, i), .outline = b->outline + 2 * b->offset[i],
                       .convex = bt_part_first(b, i) == 0, .thickness = b->thickness[i], .factor = 1};
    if (s->modulus > 0) {
        int64_t path;
        const bt_gid ancestor = bt_splitting_ancestor(s, b->gid[i], &path);
        f.factor = bt_split_scatter(s->seed, ancestor, path, s->modulus);
    }
    return f;
}

/// A contact with a normal impulse: where its pressure has its centre, and on what length it bears.
typedef struct {
    double ran, rbn;    ///< ra×n, rb×n of the centre, m
    double length;      ///< m
    int at;             ///< the point that bears most
} centre;

/// Is contact j the edge of floes that have rafted (contact/raft.h)?
static bool is_raft_edge(const bt_world *w, const bt_cell *cell, bt_idx j)
{
    return bt_law_on(&w->par, BT_LAW_RAFTING) && cell->laws.limits[j].record[BT_LAW_RAFTING] >= 0;
}

/// Of two points that bear, the centre lies between them, and uniform pressure about it reaches to the nearer end: that
/// is the nearer point itself, and where floes have rafted a half of the way between the points beyond it. One point
/// bears on what it crushes, F/(p h), or on a point where nothing is crushed.
static centre centre_of(const bt_world *w, const bt_cell *cell, bt_idx j)
{
    const bt_contact *u = &cell->contacts[j];
    const double total = u->ln[0] + u->ln[1], s0 = u->ln[0] / total, s1 = u->ln[1] / total;
    centre c = {.ran = s0 * u->ran[0] + s1 * u->ran[1], .rbn = s0 * u->rbn[0] + s1 * u->rbn[1], .at = s1 > s0};
    if (u->n > 1) c.length = (2 * bt_min(s0, s1) + is_raft_edge(w, cell, j)) * fabs(u->ran[1] - u->ran[0]);
    const bt_bodies *b = &w->bodies;
    const double pressure = w->par.law_own[BT_LAW_CRUSHING][BT_CRUSH_PRESSURE],
                 h = bt_max(b->thickness[u->a], b->thickness[u->b]);
    if (pressure > 0) c.length = bt_max(c.length, total / w->par.dt / (pressure * h));
    return c;
}

static bool gives_way(const bt_world *w, int law, const bt_contact *u)
{
    return bt_law_on(&w->par, law) && bt_law_applies(w, law, u->a, u->b);
}

#define WEDGE (BT_PI / 3) // half angle from which on the thrust of a wedge closes the crack that it would open

/// A sharp vertex of another body that goes into the floe opens it by a pair of forces along the edge: each of them per
/// normal force, 0 = none. A rigid vertex does not go in.
static double wedge_of(const bt_world *w, const bt_contact *u, const bt_contact_corner *corner, bool of_b)
{
    if (corner->of != (of_b ? 0 : 1)) return 0; // the vertex is not of the other body
    if (!gives_way(w, BT_LAW_CRUSHING, u) && !gives_way(w, BT_LAW_RAFTING, u)) return 0;
    const double wedge = bt_split_wedge(0.5 * corner->angle, u->mu);
    return 0.5 * corner->angle < WEDGE && wedge > 0 ? 1 / wedge : 0;
}

static bool is_collision(const bt_world *w, const bt_collision *q)
{
    const bt_impact_rule *rule = &w->splitting->rule;
    return rule->conversion != BT_IMPACT_NONE && q->impulse > 0 && q->approach >= rule->least_speed;
}

/// Of a collision, N; the thinner ice is crushed.
static double peak_of(const bt_world *w, const bt_contact *u, const bt_collision *q, double corner)
{
    const double a = w->bodies.thickness[u->a], b = w->bodies.thickness[u->b];
    bt_impact e = {.impulse = q->impulse, .approach = q->approach, .mass = q->mass, .corner = corner,
                   .thickness = a > 0 && b > 0 ? bt_min(a, b) : bt_max(a, b)};
    bt_impact_convert(&w->splitting->rule, &e);
    return e.peak;
}

/// The loads that contact j puts on the floe on its side a or b: what persists, and a collision at its peak.
static void add_side(const bt_world *w, const bt_cell *cell, bt_idx j, const centre *c, const bt_collision *q,
                     bool of_b, load_list *to)
{
    const bt_bodies *b = &w->bodies;
    const bt_contact *u = &cell->contacts[j];
    const bt_idx i = of_b ? u->b : u->a, other = of_b ? u->a : u->b;
    const uint16_t *part = cell->search.pairs[u->pair].part;
    const double total = u->ln[0] + u->ln[1], along = of_b ? u->rbt : u->rat, across = of_b ? c->rbn : c->ran;
    const double nx = u->nx, ny = u->ny, rho = u->lt / total;
    const bt_contact_corner corner =
        bt_contact_corner_of(b, u, part, cell->gaps[j].feature[c->at]);
    const bool sharp = !is_raft_edge(w, cell, j) && (u->n == 1 || u->ln[1 - c->at] == 0);
    load_row r = {
        .floe = b->gid[i],
        .load = {.x = along * nx + across * ny, .y = along * ny - across * nx, .edge_x = -ny, .edge_y = nx,
                 .length = c->length, .other = b->gid[other], .part = part[0] << 16 | part[1], .point = c->at},
    };
    const double sign = of_b ? 1 : -1, fx = sign * (nx - rho * ny), fy = sign * (ny + rho * nx);
    const double open = sharp ? wedge_of(w, u, &corner, of_b) : 0;
    double impulse = total;
    if (is_collision(w, q)) {
        const double peak = peak_of(w, u, q, corner.angle);
        load_row hit = r;
        hit.load.fx = peak * fx, hit.load.fy = peak * fy, hit.load.opening = peak * open;
        hit.load.collision = true;
        add(to, &hit);
        impulse -= q->impulse;
    }
    const double force = impulse / w->par.dt;
    if (!(force > 0)) return;
    r.load.fx = force * fx, r.load.fy = force * fy, r.load.opening = force * open;
    add(to, &r);
}

/// Upper bound of the forces that a contact puts on a floe, opening ones with them, N. A wedge opens no more than one
/// without an angle would, 1/(2 μ) of the normal force.
static double most_of(const bt_world *w, const bt_contact *u)
{
    const double total = u->ln[0] + u->ln[1];
    const bt_collision q = bt_contact_collision(w, u);
    double force = total / w->par.dt;
    if (is_collision(w, &q)) force += w->splitting->rule.real_corner ? INFINITY : peak_of(w, u, &q, NAN);
    const bool pair = (u->n == 1 || u->ln[0] == 0 || u->ln[1] == 0) &&
                      (bt_law_on(&w->par, BT_LAW_CRUSHING) || bt_law_on(&w->par, BT_LAW_RAFTING));
    return force * (1 + fabs(u->lt) / total + (pair ? 1 / (2 * u->mu) : 0));
}

/// What is done with the contacts of a cell.
typedef enum {
    SUM, ///< bounds of the loads on floes that this rank owns are added up, and the loads on others listed
    LIST ///< loads on its own floes that are to be looked at are listed
} pass;

static bool is_mine(const bt_world *w, bt_idx i) { return !w->domain || bt_domain_owns(w, i); }

/// For body i of a contact: is its load to be listed? In the first pass `most`, N, is added where it is not.
static bool is_listed(bt_world *w, bt_idx i, pass what, double most)
{
    double *sum = &w->splitting->sum[i];
    if (!is_mine(w, i)) return what == SUM;
    if (what == LIST) return *sum > 0;
#pragma omp atomic
    *sum += most;
    return false;
}

static void add_cell(bt_world *w, const bt_cell *cell, pass what, load_list *to)
{
    const bt_bodies *b = &w->bodies;
    for (bt_idx j = 0; j < cell->n_contacts; j++) {
        const bt_contact *u = &cell->contacts[j];
        if (u->n == 0) {
            if (is_listed(w, u->a, what, 0)) add(to, &(load_row){.floe = b->gid[u->a]});
            if (is_listed(w, u->b, what, 0)) add(to, &(load_row){.floe = b->gid[u->b]});
            continue;
        }
        if (!(u->ln[0] + u->ln[1] > 0)) continue;
        const double most = what == SUM ? most_of(w, u) : 0;
        const bool a = may_split(w, u->a) && is_listed(w, u->a, what, most),
                   of_b = may_split(w, u->b) && is_listed(w, u->b, what, most);
        if (!a && !of_b) continue;
        const centre c = centre_of(w, cell, j);
        const bt_collision q = bt_contact_collision(w, u);
        if (a) add_side(w, cell, j, &c, &q, false, to);
        if (of_b) add_side(w, cell, j, &c, &q, true, to);
    }
    for (bt_idx k = 0; k < cell->laws.n_memory; k++) {
        const bt_memory *m = &cell->laws.memory[k];
        if (m->law != BT_LAW_RAFTING) continue;
        for (int side = 0; side < 2; side++) {
            const bt_idx i = bt_world_index(w, side ? m->b : m->a);
            if (i < 0 ? what == SUM : is_listed(w, i, what, 0)) add(to, &(load_row){.floe = side ? m->b : m->a});
        }
    }
}

static void add_cells(bt_world *w, pass what, load_list *to)
{
    const bt_cells *t = w->cells;
#pragma omp parallel if (BT_MANY(t->n_order, BT_FEW_CELLS))
    {
        load_list mine = {0};
#pragma omp for schedule(dynamic, 16) nowait
        for (bt_idx i = 0; i < t->n_order; i++) add_cell(w, &t->cell[t->order[i]], what, &mine);
#pragma omp critical
        for (size_t i = 0; i < mine.n; i++) add(to, &mine.row[i]);
        free(mine.row);
    }
}

static double size_of(const bt_floe_load *l) { return bt_hypot(l->fx, l->fy) + l->opening; }

/// Does body i surely bear loads of this sum, N? What it bears follows from outline, thickness and strength, which an
/// id has for ever.
static bool is_borne(const bt_world *w, bt_idx i, double sum)
{
    bt_splitting *s = w->splitting;
    double *borne = &s->borne[w->bodies.gid[i]];
    if (*borne == 0) {
        const bt_split_floe f = floe_of(w, i);
        *borne = (1 - 1e-9) * bt_split_borne(&f, &s->law); // less what is rounding in sums and in turned outlines
    }
    return sum <= *borne;
}

/// Room for a sum of each body and for what each id bears.
static void make_room(bt_splitting *s, const bt_bodies *b)
{
    if (s->cap_sum < b->n) {
        free(s->sum);
        s->sum = bt_alloc((size_t)(s->cap_sum = b->n + b->n / 4), sizeof *s->sum);
    } else memset(s->sum, 0, (size_t)b->n * sizeof *s->sum);
    if (s->cap_borne >= b->n_global) return;
    s->borne = bt_realloc(s->borne, (size_t)b->n_global, sizeof *s->borne);
    for (; s->cap_borne < b->n_global; s->cap_borne++) s->borne[s->cap_borne] = 0;
}

/// Collective. Loads of the floes that this rank owns, but for those of floes whose loads together are too small to
/// split them, in nearly all steps nearly all. Contacts of a floe may be found by other ranks, which send its loads.
static load_list collect(bt_world *w)
{
    bt_splitting *s = w->splitting;
    const bt_bodies *b = &w->bodies;
    make_room(s, b);
    load_list all = {0}, foreign = {0}, came = {0};
    add_cells(w, SUM, &foreign);
    if (w->domain) {
        came.row = bt_domain_gather_all(w, foreign.row, foreign.n, sizeof *foreign.row, &came.n);
        for (size_t k = 0; k < came.n; k++) {
            const bt_idx i = bt_world_index(w, came.row[k].floe);
            if (i >= 0 && bt_domain_owns(w, i)) s->sum[i] += size_of(&came.row[k].load);
        }
    }
    free(foreign.row);
    bool any = false;
#pragma omp parallel for reduction(|| : any) if (BT_MANY(b->n, 4096))
    for (bt_idx i = 0; i < b->n; i++) {
        if (s->sum[i] > 0) s->sum[i] = !is_borne(w, i, s->sum[i]);
        any = any || s->sum[i] > 0;
    }
    if (any) add_cells(w, LIST, &all);
    for (size_t k = 0; k < came.n; k++) {
        const bt_idx i = bt_world_index(w, came.row[k].floe);
        if (i >= 0 && bt_domain_owns(w, i) && s->sum[i] > 0) add(&all, &came.row[k]);
    }
    free(came.row);
    return all;
}

// --- which floes split -----------------------------------------------------------------------------------------------

/// A floe that splits, and how it is cut.
typedef struct {
    bt_split_record record;
    int64_t first_vertex; ///< in the list of vertices
} found_row;

typedef struct {
    found_row *row;
    double *vertex;
    size_t n, n_vertices;
} found_list;

typedef enum { NONE, SPLITS, TOO_SMALL, TOO_OLD, RAFTED } verdict;

typedef struct {
    bt_idx floe;
    verdict verdict;
    bt_split best;
} judged;

/// The loads [n] of floe i. They are sorted.
static judged judge(const bt_world *w, bt_idx i, load_row *row, size_t n)
{
    const bt_splitting *s = w->splitting;
    const bt_bodies *b = &w->bodies;
    judged out = {.floe = i};
    bool rafted = false;
    bt_floe_load few[24], *load = n <= 24 ? few : bt_alloc(n, sizeof *load);
    int n_loads = 0;
    double sum = 0, peak = 0;
    for (size_t k = 0; k < n; k++) {
        const bt_floe_load *l = &row[k].load;
        if (l->fx == 0 && l->fy == 0) rafted = true;
        else load[n_loads++] = *l;
        if (l->collision) peak = bt_max(peak, size_of(l));
        else sum += size_of(l);
    }
    const bt_gid gid = b->gid[i];
    const bt_split_floe f = floe_of(w, i);
    const bool splits = !is_borne(w, i, sum + peak) && bt_split_find(&f, load, n_loads, &s->law, &out.best);
    if (load != few) free(load);
    if (splits) {
        out.verdict = rafted ? RAFTED : bt_splitting_generation(s, gid) >= s->generations ? TOO_OLD : SPLITS;
        if (out.verdict != SPLITS) out.best.refused_ratio = bt_max(out.best.refused_ratio, out.best.ratio);
    } else if (out.best.refused_ratio > 1) out.verdict = TOO_SMALL;
    return out;
}

/// Loads by floe: those of floe k of the n are at[first[k]] up to at[first[k + 1]].
static bt_idx by_floe(const bt_world *w, load_list *l, bt_idx **floe, size_t **first)
{
    const bt_bodies *b = &w->bodies;
    size_t *count = bt_alloc((size_t)b->n + 1, sizeof *count);
    for (size_t k = 0; k < l->n; k++) count[bt_world_index(w, l->row[k].floe) + 1]++;
    bt_idx n = 0;
    for (bt_idx i = 0; i < b->n; i++) n += count[i + 1] > 0;
    *floe = bt_alloc((size_t)n, sizeof **floe);
    *first = bt_alloc((size_t)n + 1, sizeof **first);
    n = 0;
    for (bt_idx i = 0; i < b->n; i++) {
        if (count[i + 1] > 0) (*floe)[n] = i, (*first)[++n] = count[i] + count[i + 1];
        count[i + 1] += count[i];
    }
    load_row *sorted = bt_alloc(l->n, sizeof *sorted);
    for (size_t k = 0; k < l->n; k++) sorted[count[bt_world_index(w, l->row[k].floe)]++] = l->row[k];
    free(count);
    free(l->row);
    l->row = sorted;
    return n;
}

static void add_outline(found_list *l, int n, const double *v)
{
    l->vertex = bt_realloc(l->vertex, l->n_vertices + (size_t)n, 2 * sizeof *l->vertex);
    memcpy(l->vertex + 2 * l->n_vertices, v, 2 * (size_t)n * sizeof *v);
    l->n_vertices += (size_t)n;
}

/// ∫r²dA of floe i about its centroid, m⁴: that of a piece is what was left for it.
static double polar_of(const bt_world *w, bt_idx i)
{
    const bt_bodies *b = &w->bodies;
    const bt_splitting *s = w->splitting;
    const bt_gid k = b->gid[i] - s->first;
    if (is_piece(s, b->gid[i])) return bt_splitting_birth(s, k)->polar[k % 2];
    return bt_shape_extent(bt_body_corners(b, i), b->vertices + 2 * b->offset[i]).polar;
}

static void place_of(const bt_bodies *b, bt_idx i, bt_chord_end e, double out[2])
{
    bt_chord_place(bt_body_corners(b, i), b->outline + 2 * b->offset[i], e, out);
    out[0] += b->pose[i].x;
    out[1] += b->pose[i].y;
}

/// False when the cut cannot be made.
static bool add_found(const bt_world *w, const judged *j, found_list *to)
{
    const bt_bodies *b = &w->bodies;
    const bt_idx i = j->floe;
    const int n = bt_body_corners(b, i);
    const double *outline = b->vertices + 2 * b->offset[i];
    bt_piece piece[2];
    if (!bt_split_cut(n, outline, b->area[i], polar_of(w, i), &j->best.chord, piece)) return false;
    found_row r = {.record = {.step = w->step, .parent = b->gid[i],
                              .generation = bt_splitting_generation(w->splitting, b->gid[i]) + 1,
                              .mode = j->best.mode, .thickness = b->thickness[i], .ratio = j->best.ratio},
                   .first_vertex = (int64_t)to->n_vertices};
    place_of(b, i, j->best.chord.a, r.record.near);
    place_of(b, i, j->best.chord.b, r.record.far);
    for (int k = 0; k < 2; k++) {
        add_outline(to, piece[k].n, piece[k].outline);
        r.record.area[k] = piece[k].area;
        r.record.polar[k] = piece[k].polar;
        r.record.at[k][0] = piece[k].x, r.record.at[k][1] = piece[k].y;
        r.record.corners[k] = piece[k].n;
    }
    if (r.record.generation == 1) {
        r.record.corners[2] = n;
        add_outline(to, n, outline);
    }
    to->row = bt_realloc(to->row, to->n + 1, sizeof *to->row);
    to->row[to->n++] = r;
    return true;
}

static int by_parent(const void *p, const void *q)
{
    const found_row *a = p, *b = q;
    return (a->record.parent > b->record.parent) - (a->record.parent < b->record.parent);
}

/// Collective. Those of all ranks, in the order of the ids of the parents.
static found_list of_all(const bt_world *w, found_list *mine)
{
    found_list all = {0};
    all.row = bt_domain_gather_all(w, mine->row, mine->n, sizeof *mine->row, &all.n);
    all.vertex = bt_domain_gather_all(w, mine->vertex, mine->n_vertices, 2 * sizeof *mine->vertex, &all.n_vertices);
    int64_t at = 0;
    for (size_t k = 0; k < all.n; k++) { // as they were put one after the other
        all.row[k].first_vertex = at;
        const int64_t *c = all.row[k].record.corners;
        at += c[0] + c[1] + c[2];
    }
    if (all.n > 0) qsort(all.row, all.n, sizeof *all.row, by_parent);
    return all;
}

// --- pieces ----------------------------------------------------------------------------------------------------------

/// A body for piece k of body i, by its velocity at the start of the step. v: its outline.
static void put_piece(bt_world *w, bt_idx i, const bt_split_record *r, int k, const double *v, bt_gid gid)
{
    bt_bodies *b = &w->bodies;
    const int n = (int)r->corners[k];
    const double whole = bt_shape_moments(bt_body_corners(b, i), b->vertices + 2 * b->offset[i]).cubic,
                 own = bt_shape_moments(n, v).cubic;
    double s, c;
    bt_sincos(b->pose[i].yaw, &s, &c);
    const double *at = r->at[k], dx = c * at[0] - s * at[1], dy = s * at[0] + c * at[1],
                 share = r->area[k] / b->area[i];
    const bt_vel u = b->vel_start[i];
    int32_t lap = b->lap[i], across = 0;
    bt_body_def d = {
        .motion = BT_DYNAMIC, .n_vertices = n, .vertices = v,
        .x = bt_into_period(b->pose[i].x + dx, w->par.x0, w->par.period_x, &lap),
        .y = bt_into_period(b->pose[i].y + dy, w->par.y0, w->par.period_y, &across), .yaw = b->pose[i].yaw,
        .vx = u.x - u.w * dy, .vy = u.y + u.w * dx, .yaw_rate = u.w, .mass = b->mass[i] * share,
        .inertia = b->inertia[i] * (r->polar[k] / polar_of(w, i)), .friction = b->friction[i],
        .restitution = b->restitution[i], .thickness = b->thickness[i], .drag = b->drag[i],
        .large = b->large[i] && sqrt(r->area[k] / BT_PI) > w->splitting->large,
    };
    d.drag.water_skin *= share;
    d.drag.air_skin *= share;
    d.drag.yaw *= own / whole;
    bt_parts parts;
    if (!bt_outline_convex(n, v) && bt_outline_split(n, v, &parts)) d.parts = &parts;
    const bt_idx j = bt_bodies_put(b, &d, gid);
    b->area[j] = r->area[k];
    b->share[j] = b->share[i];
    b->exposure[j] = b->exposure[i];
    b->path[j] = b->path[i];
    b->lap[j] = lap;
}

/// Splits from..n of the history: pieces in the place of parents that this rank holds.
static void put_pieces(bt_world *w, int64_t from)
{
    bt_bodies *b = &w->bodies;
    const bt_splitting *s = w->splitting;
    const bt_idx n = b->n;
    const size_t most = (size_t)n + 2 * (size_t)(s->n - from);
    bt_idx *source = bt_alloc(most, sizeof *source);
    uint8_t *keep = bt_alloc(most, sizeof *keep);
    for (bt_idx i = 0; i < n; i++) source[i] = i, keep[i] = 1;
    for (int64_t k = from; k < s->n; k++) {
        const bt_split_record *r = &s->split[k];
        const bt_idx i = b->index_of[r->parent];
        for (int p = 0; p < 2; p++) {
            const bt_gid gid = s->first + 2 * k + p;
            b->gone[gid] = 0;
            if (i >= 0) {
                source[b->n] = source[i], keep[b->n] = 1;
                put_piece(w, i, r, p, bt_splitting_outline(s, k, p), gid);
            }
        }
        if (i >= 0) keep[i] = 0;
        b->index_of[r->parent] = -1;
        b->gone[r->parent] = 1;
    }
    bt_idx kept = 0;
    for (bt_idx i = 0; i < b->n; i++)
        if (keep[i]) source[kept++] = source[i];
    bt_bodies_compact(b, keep);
    for (bt_idx i = 0; i < b->n; i++) b->index_of[b->gid[i]] = i;
    bt_domain_follow(w, source);
    free(source);
    free(keep);
}

/// Records of pairs with parents become those of pairs with their pieces. Impulses are not handed on: points of a piece
/// have other names.
static bt_memory *hand_on(const bt_world *w, bt_memory *memory, int64_t *n, int64_t from)
{
    const bt_splitting *s = w->splitting;
    const bt_bodies *b = &w->bodies;
    bt_memory *out = bt_alloc(4 * (size_t)*n + 1, sizeof *out);
    int64_t m = 0;
    for (int64_t k = 0; k < *n; k++) {
        const bt_memory *r = &memory[k];
        if (!b->gone[r->a] && !b->gone[r->b]) {
            out[m++] = *r;
            continue;
        }
        if (r->law == BT_LAW_RIGID) continue;
        bt_gid side[2][2];
        int n_side[2];
        for (int e = 0; e < 2; e++) {
            const bt_gid g = e ? r->b : r->a;
            side[e][0] = g, n_side[e] = 1;
            for (int64_t q = from; b->gone[g] && q < s->n; q++) // few, of one step
                if (s->split[q].parent == g)
                    side[e][0] = s->first + 2 * q, side[e][1] = side[e][0] + 1, n_side[e] = 2;
        }
        for (int p = 0; p < n_side[0]; p++)
            for (int q = 0; q < n_side[1]; q++) {
                bt_memory piece = *r;
                bt_gid x = side[0][p], y = side[1][q];
                if (n_side[0] > 1) piece.part[0] = (uint16_t)bt_part_first(b, bt_world_index(w, x));
                if (n_side[1] > 1) piece.part[1] = (uint16_t)bt_part_first(b, bt_world_index(w, y));
                if (x > y) {
                    const bt_gid g = x;
                    const uint16_t part = piece.part[0];
                    x = y, y = g;
                    piece.part[0] = piece.part[1], piece.part[1] = part;
                }
                piece.a = x, piece.b = y;
                out[m++] = piece;
            }
    }
    free(memory);
    *n = m;
    return out;
}

/// context: the first of the new splits.
static bt_memory *change(bt_world *w, bt_memory *memory, int64_t *n, const void *context)
{
    bt_bodies *b = &w->bodies;
    const int64_t from = *(const int64_t *)context;
    for (bt_idx i = 0; i < b->n; i++)
        if (b->motion[i] == BT_DYNAMIC) b->vel[i] = b->vel_start[i];
    put_pieces(w, from);
    return hand_on(w, memory, n, from);
}

// --- the step --------------------------------------------------------------------------------------------------------

enum { N_DEFERRED, N_TOO_SMALL, N_TOO_OLD, N_RAFTED, N_COUNTS };

/// Floes that split by the loads of this solution: those of this rank. *most: largest ratio of one that cannot.
static found_list find(bt_world *w, bt_sum count[N_COUNTS], double *most)
{
    load_list loads = collect(w);
    if (loads.n == 0) return (found_list){0};
    bt_idx *floe;
    size_t *first;
    const bt_idx n = by_floe(w, &loads, &floe, &first);
    judged *result = bt_alloc((size_t)n, sizeof *result);
#pragma omp parallel for schedule(dynamic, 16) if (BT_MANY(n, 64))
    for (bt_idx k = 0; k < n; k++) result[k] = judge(w, floe[k], loads.row + first[k], first[k + 1] - first[k]);
    found_list found = {0};
    for (bt_idx k = 0; k < n; k++) {
        judged *j = &result[k];
        *most = bt_max(*most, j->best.refused_ratio);
        if (j->verdict == SPLITS && !add_found(w, j, &found)) {
            j->verdict = TOO_SMALL;
            *most = bt_max(*most, j->best.ratio);
        }
        if (j->verdict == TOO_SMALL) bt_sum_add(&count[N_TOO_SMALL], 1);
        if (j->verdict == TOO_OLD) bt_sum_add(&count[N_TOO_OLD], 1);
        if (j->verdict == RAFTED) bt_sum_add(&count[N_RAFTED], 1);
    }
    free(result);
    free(floe);
    free(first);
    free(loads.row);
    return found;
}

static void book(bt_splitting *s, const bt_split_record *r)
{
    const double length = bt_hypot(r->far[0] - r->near[0], r->far[1] - r->near[1]);
    s->total.by_mode[r->mode]++;
    s->total.crack_length += length;
    s->total.work += bt_split_work(s->law.toughness, r->thickness, length);
    s->total.steps += s->now++ == 0;
}

bool bt_splitting_step(bt_world *w, int round)
{
    bt_splitting *s = w->splitting;
    if (!s) return false;
    if (round == 0) s->now = 0;
    if (!w->stats.converged) {
        s->total.unconverged += round == 0;
        return false;
    }
    bt_totals all = {.n_sums = N_COUNTS};
    found_list mine = find(w, all.sum, &all.most), found = of_all(w, &mine);
    free(mine.row);
    free(mine.vertex);
    const int64_t from = s->n;
    int64_t no_id = 0;
    for (size_t k = 0; k < found.n && round < BT_SPLIT_ROUNDS; k++) {
        const found_row *f = &found.row[k];
        if (2 * s->n + 2 > s->reserve) {
            no_id++;
            continue;
        }
        bt_splitting_append(s, &f->record, found.vertex + 2 * f->first_vertex);
        book(s, &f->record);
    }
    const bool again = s->n > from;
    if (!again) { // the last look at the step
        const int64_t left = (int64_t)found.n - no_id;
        bt_domain_reduce(w, &all);
        s->total.deferred += left;
        s->total.no_id += no_id;
        s->total.too_small += (int64_t)bt_sum_value(&all.sum[N_TOO_SMALL]);
        s->total.too_old += (int64_t)bt_sum_value(&all.sum[N_TOO_OLD]);
        s->total.rafted += (int64_t)bt_sum_value(&all.sum[N_RAFTED]);
        s->total.largest_refused = bt_max(s->total.largest_refused, all.most);
    }
    free(found.row);
    free(found.vertex);
    if (again) bt_cells_change(w, change, &from);
    return again;
}

void bt_splitting_restore(bt_world *w) { put_pieces(w, 0); }

uint64_t bt_splitting_hash(const bt_splitting *s)
{
    uint64_t h = (uint64_t)s->n;
    for (int64_t k = 0; k < s->n; k++) h = h * UINT64_C(0x100000001b3) ^ (uint64_t)s->split[k].parent;
    for (int64_t k = 0; k < 2 * s->n_vertices; k++) {
        uint64_t u;
        memcpy(&u, &s->vertex[k], sizeof u);
        h = h * UINT64_C(0x100000001b3) ^ u;
    }
    return h;
}
