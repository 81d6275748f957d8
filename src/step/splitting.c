// SPDX-License-Identifier: MIT
// Loads of the floes in a step, and the floes that split under them; see step/splitting.h.
#include "step/splitting.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/elementary.h"
#include "base/inside.h"
#include "body/bodies.h"
#include "contact/cell_contacts.h"
#include "contact/crush.h"
#include "contact/law.h"
#include "loads/impact.h"
#include "partition/domain.h"
#include "split/section.h"

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

static void add(load_list *list, const load_row *row)
{
    BT_MAKE_ROOM(list->row, list->n, list->cap, 256);
    list->row[list->n++] = *row;
}

/// Append and free `more`; an empty list takes it over without a copy.
static void append(load_list *list, load_list *more)
{
    if (list->n == 0) {
        free(list->row);
        *list = *more;
        return;
    }
    for (size_t k = 0; k < more->n; k++) add(list, &more->row[k]);
    free(more->row);
}

static bool may_split(const bt_world *world, bt_idx i)
{
    const bt_bodies *bodies = &world->bodies;
    return bodies->motion[i] == BT_DYNAMIC && bodies->thickness[i] > 0 && bodies->gid[i] != world->towed;
}

/// Body i as the law sees it.
static bt_split_floe floe_of(const bt_world *world, bt_idx i)
{
    const bt_splitting *splitting = world->splitting;
    const bt_bodies *bodies = &world->bodies;
    bt_split_floe floe = {.n = bt_body_corners(bodies, i), .outline = bodies->outline + 2 * bodies->offset[i],
                          .convex = bt_part_first(bodies, i) == 0, .thickness = bodies->thickness[i], .factor = 1};
    if (splitting->modulus > 0) {
        int64_t path;
        const bt_gid ancestor = bt_splitting_ancestor(splitting, bodies->gid[i], &path);
        floe.factor = bt_split_scatter(splitting->seed, ancestor, path, splitting->modulus);
    }
    return floe;
}

/// Centre of pressure and bearing length of a contact with a normal impulse.
typedef struct {
    double ran, rbn;    ///< ra×n, rb×n of the centre, m
    double length;      ///< m
} centre;

/// Is contact j the edge of floes that have rafted (contact/raft.h)?
static bool is_raft_edge(const bt_world *world, const bt_cell *cell, bt_idx j)
{
    return bt_law_on(&world->par, BT_LAW_RAFTING) && cell->laws->limits[j].record[BT_LAW_RAFTING] >= 0;
}

/// With two points the centre lies between them, and the uniform pressure about it extends to the nearer end: the
/// nearer point itself, or, for floes that have rafted, half the distance between the points beyond it. One point bears
/// on the crushed length F/(p h), or without crushing on length 0.
static centre centre_of(const bt_world *world, const bt_cell *cell, bt_idx j)
{
    const bt_contact *contact = &cell->contacts[j];
    const double total = contact->ln[0] + contact->ln[1], s0 = contact->ln[0] / total, s1 = contact->ln[1] / total;
    centre c = {.ran = s0 * contact->ran[0] + s1 * contact->ran[1], .rbn = s0 * contact->rbn[0] + s1 * contact->rbn[1]};
    if (contact->n > 1)
        c.length = (2 * bt_min(s0, s1) + is_raft_edge(world, cell, j)) * fabs(contact->ran[1] - contact->ran[0]);
    const bt_bodies *bodies = &world->bodies;
    const double pressure = world->par.law_own[BT_LAW_CRUSHING][BT_CRUSH_PRESSURE],
                 h = bt_crush_thickness(bodies, contact->a, contact->b);
    if (pressure > 0) c.length = bt_max(c.length, total / world->par.dt / (pressure * h));
    return c;
}

static bool gives_way(const bt_world *world, int law, const bt_contact *contact)
{
    return bt_law_on(&world->par, law) && bt_law_applies(world, law, contact->a, contact->b);
}

#define WEDGE (BT_PI / 3) // half angle above which the thrust of a wedge closes the crack that it would open

static bool is_collision(const bt_world *world, const bt_collision *collision)
{
    const bt_impact_rule *rule = &world->splitting->rule;
    return rule->conversion != BT_IMPACT_NONE && collision->impulse > 0 && collision->approach >= rule->least_speed;
}

/// Peak force of a collision, N, as if none of it were left to the next step.
static double peak_of(const bt_world *world, const bt_cell *cell, bt_idx j, const bt_collision *collision,
                      double corner)
{
    const bt_contact *contact = &cell->contacts[j];
    bt_impact impact = {.impulse = collision->whole, .approach = collision->approach, .mass = collision->mass,
                        .corner = corner,
                        .thickness = bt_crush_thickness(&world->bodies, contact->a, contact->b)};
    bt_impact_convert(&world->splitting->rule, bt_collision_bears(world, cell, j, collision), &impact);
    return impact.peak;
}

/// Sizes of the loads of a contact with a normal impulse.
typedef struct {
    double force, peak; ///< normal forces: persisting, and at the peak of a collision, N; 0 = none
    double friction;    ///< per normal force
    double opening[2];  ///< of a and of b, by the other's vertex: each force of the pair, per normal force
    int at;             ///< the point that bears most
} pressing;

/// Sizes of the loads of contact j. A sharp vertex of another body that penetrates a floe opens it by a pair of forces
/// along the edge. A rigid contact does not penetrate.
static pressing pressing_of(const bt_world *world, const bt_cell *cell, bt_idx j)
{
    const bt_contact *contact = &cell->contacts[j];
    const double total = contact->ln[0] + contact->ln[1];
    const bt_collision collision = bt_contact_collision(world, contact);
    const bool hit = is_collision(world, &collision);
    pressing p = {.friction = contact->lt / total, .at = contact->ln[1] / total > contact->ln[0] / total};
    const bool one = contact->n == 1 || contact->ln[1 - p.at] == 0,
               sharp = one && !is_raft_edge(world, cell, j) && (gives_way(world, BT_LAW_CRUSHING, contact) ||
                                                                gives_way(world, BT_LAW_RAFTING, contact));
    if (sharp || hit) {
        const bt_contact_corner corner = bt_contact_corner_of(
            world, contact, cell->search.pairs[contact->pair].part, cell->gaps[j].feature[p.at]);
        const double half = 0.5 * corner.angle, wedge = half < WEDGE ? bt_split_wedge(half, contact->mu) : 0;
        if (sharp && corner.of >= 0 && wedge > 0) p.opening[1 - corner.of] = 1 / wedge;
        if (hit) p.peak = peak_of(world, cell, j, &collision, corner.angle);
    }
    p.force = bt_max(0, (hit ? total - collision.impulse : total) / world->par.dt);
    return p;
}

/// Add the loads of contact j on the floe on its side a or b.
static void add_side(const bt_world *world, const bt_cell *cell, bt_idx j, const pressing *p, const centre *c,
                     bool of_b, load_list *to)
{
    const bt_bodies *bodies = &world->bodies;
    const bt_contact *contact = &cell->contacts[j];
    const bt_idx i = of_b ? contact->b : contact->a, other = of_b ? contact->a : contact->b;
    const uint16_t *part = cell->search.pairs[contact->pair].part;
    const double along = of_b ? contact->rbt : contact->rat, across = of_b ? c->rbn : c->ran;
    const double nx = contact->nx, ny = contact->ny, sign = of_b ? 1 : -1;
    const double fx = sign * (nx - p->friction * ny), fy = sign * (ny + p->friction * nx);
    for (int collision = 1; collision >= 0; collision--) {
        const double force = collision ? p->peak : p->force;
        if (!(force > 0)) continue;
        const bt_floe_load load = {
            .x = along * nx + across * ny, .y = along * ny - across * nx, .fx = force * fx, .fy = force * fy,
            .edge_x = -ny, .edge_y = nx, .length = c->length, .opening = force * p->opening[of_b],
            .other = bodies->gid[other], .part = part[0] << 16 | part[1], .point = p->at, .collision = collision};
        add(to, &(load_row){bodies->gid[i], load});
    }
}

/// The two passes over the contacts of a cell.
typedef enum {
    SUM, ///< add up bounds of the loads on floes that this rank owns, list the loads on others
    LIST ///< list the loads on its own floes that may split
} pass;

static bool is_mine(const bt_world *world, bt_idx i) { return !world->domain || bt_domain_owns(world, i); }

/// Does a pass consider floe i? The second only if it may split under the sum of its loads.
static bool is_looked_at(const bt_world *world, bt_idx i, pass what)
{
    return what == SUM || (is_mine(world, i) && world->splitting->sum[i] > 0);
}

/// Size of the loads of a contact on its side a or b, with their opening forces, N.
static double size_on(const pressing *p, bool of_b)
{
    return (p->force + p->peak) * (sqrt(1 + p->friction * p->friction) + p->opening[of_b]);
}

/// Is the load of a contact on body i to be listed? If not, the first pass adds `most`, N, to the sum of i.
static bool is_listed(bt_world *world, bt_idx i, pass what, double most)
{
    double *sum = &world->splitting->sum[i];
    if (!is_mine(world, i)) return what == SUM;
    if (what == LIST) return *sum > 0;
#pragma omp atomic
    *sum += most;
    return false;
}

static void add_cell(bt_world *world, const bt_cell *cell, pass what, load_list *to)
{
    const bt_bodies *bodies = &world->bodies;
    for (bt_idx j = 0; j < cell->n_contacts; j++) {
        const bt_contact *contact = &cell->contacts[j];
        if (contact->n == 0) {
            if (is_listed(world, contact->a, what, 0)) add(to, &(load_row){.floe = bodies->gid[contact->a]});
            if (is_listed(world, contact->b, what, 0)) add(to, &(load_row){.floe = bodies->gid[contact->b]});
            continue;
        }
        if (!(contact->ln[0] + contact->ln[1] > 0)) continue;
        const bool a = may_split(world, contact->a) && is_looked_at(world, contact->a, what),
                   b = may_split(world, contact->b) && is_looked_at(world, contact->b, what);
        if (!a && !b) continue;
        const pressing p = pressing_of(world, cell, j);
        const bool list_a = a && is_listed(world, contact->a, what, size_on(&p, false)),
                   list_b = b && is_listed(world, contact->b, what, size_on(&p, true));
        if (!list_a && !list_b) continue;
        const centre c = centre_of(world, cell, j);
        if (list_a) add_side(world, cell, j, &p, &c, false, to);
        if (list_b) add_side(world, cell, j, &p, &c, true, to);
    }
    for (bt_idx k = 0; k < cell->laws->n_memory; k++) {
        const bt_memory *memory = &cell->laws->memory[k];
        if (memory->law != BT_LAW_RAFTING) continue;
        for (int side = 0; side < 2; side++) {
            const bt_idx i = bt_world_index(world, side ? memory->b : memory->a);
            if (i < 0 ? what == SUM : is_listed(world, i, what, 0))
                add(to, &(load_row){.floe = side ? memory->b : memory->a});
        }
    }
}

static void add_cells(bt_world *world, pass what, load_list *to)
{
    const bt_cells *cells = world->cells;
#pragma omp parallel if (BT_MANY(cells->n_order, BT_FEW_CELLS))
    {
        BT_PLAIN_NUMBERS;
        load_list mine = {0};
#pragma omp for schedule(dynamic, 16) nowait
        for (bt_idx i = 0; i < cells->n_order; i++) add_cell(world, &cells->cell[cells->order[i]], what, &mine);
#pragma omp critical
        append(to, &mine);
    }
}

static double size_of(const bt_floe_load *load) { return bt_hypot(load->fx, load->fy) + load->opening; }

/// Does body i certainly bear loads of this sum, N? Its bound follows from outline, thickness and strength, which never
/// change for an id.
static bool is_borne(const bt_world *world, bt_idx i, double sum)
{
    bt_splitting *splitting = world->splitting;
    double *borne = &splitting->borne[world->bodies.gid[i]];
    if (*borne == 0) {
        const bt_split_floe floe = floe_of(world, i);
        // less the rounding of sums and of rotated outlines
        *borne = (1 - 1e-9) * bt_split_borne(&floe, &splitting->law);
    }
    return sum <= *borne;
}

/// Make room for the sum of each body and the bound of each id.
static void make_room(bt_splitting *splitting, const bt_bodies *bodies)
{
    if (splitting->cap_sum < bodies->n) {
        free(splitting->sum);
        splitting->sum = bt_alloc((size_t)(splitting->cap_sum = bodies->n + bodies->n / 4), sizeof *splitting->sum);
    } else memset(splitting->sum, 0, (size_t)bodies->n * sizeof *splitting->sum);
    if (splitting->cap_borne >= bodies->n_global) return;
    splitting->borne = bt_realloc(splitting->borne, (size_t)bodies->n_global, sizeof *splitting->borne);
    for (; splitting->cap_borne < bodies->n_global; splitting->cap_borne++) splitting->borne[splitting->cap_borne] = 0;
}

/// Collective. Loads of the floes that this rank owns, except floes whose loads together are too small to split them,
/// which is nearly all. Other ranks may find contacts of a floe; they send its loads.
static load_list collect(bt_world *world)
{
    bt_splitting *splitting = world->splitting;
    const bt_bodies *bodies = &world->bodies;
    make_room(splitting, bodies);
    load_list all = {0}, foreign = {0}, came = {0};
    add_cells(world, SUM, &foreign);
    if (world->domain) {
        came.row = bt_domain_gather_all(world, foreign.row, foreign.n, sizeof *foreign.row, &came.n);
        for (size_t k = 0; k < came.n; k++) {
            const bt_idx i = bt_world_index(world, came.row[k].floe);
            if (i >= 0 && bt_domain_owns(world, i)) splitting->sum[i] += size_of(&came.row[k].load);
        }
    }
    free(foreign.row);
    bool any = false;
#pragma omp parallel reduction(|| : any) if (BT_MANY(bodies->n, 4096))
    {
        BT_PLAIN_NUMBERS;
#pragma omp for
        for (bt_idx i = 0; i < bodies->n; i++) {
            if (splitting->sum[i] > 0) splitting->sum[i] = !is_borne(world, i, splitting->sum[i]);
            any = any || splitting->sum[i] > 0;
        }
    }
    if (any) add_cells(world, LIST, &all);
    for (size_t k = 0; k < came.n; k++) {
        const bt_idx i = bt_world_index(world, came.row[k].floe);
        if (i >= 0 && bt_domain_owns(world, i) && splitting->sum[i] > 0) add(&all, &came.row[k]);
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

typedef enum { NONE, SPLITS, TOO_SMALL, LAST_GENERATION, RAFTED } verdict;

typedef struct {
    bt_idx floe;
    verdict verdict;
    bt_split best;
} judged;

/// Judge floe i under its loads [n], which are sorted here.
static judged judge(const bt_world *world, bt_idx i, load_row *row, size_t n)
{
    const bt_splitting *splitting = world->splitting;
    const bt_bodies *bodies = &world->bodies;
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
    const bt_gid gid = bodies->gid[i];
    const bt_split_floe floe = floe_of(world, i);
    const bool splits = !is_borne(world, i, sum + peak) &&
                        bt_split_find(&floe, load, n_loads, &splitting->law, &out.best);
    if (load != few) free(load);
    if (splits) {
        out.verdict = rafted ? RAFTED : bt_splitting_generation(splitting, gid) >= splitting->generations
                      ? LAST_GENERATION : SPLITS;
        if (out.verdict != SPLITS) out.best.refused_ratio = bt_max(out.best.refused_ratio, out.best.ratio);
    } else if (out.best.refused_ratio > 1) out.verdict = TOO_SMALL;
    return out;
}

/// Group the loads by floe: those of floe k of the n returned are rows first[k] to first[k + 1] − 1.
static bt_idx by_floe(const bt_world *world, load_list *list, bt_idx **floe, size_t **first)
{
    const bt_bodies *bodies = &world->bodies;
    size_t *count = bt_alloc((size_t)bodies->n + 1, sizeof *count);
    for (size_t k = 0; k < list->n; k++) count[bt_world_index(world, list->row[k].floe) + 1]++;
    bt_idx n = 0;
    for (bt_idx i = 0; i < bodies->n; i++) n += count[i + 1] > 0;
    *floe = bt_alloc((size_t)n, sizeof **floe);
    *first = bt_alloc((size_t)n + 1, sizeof **first);
    n = 0;
    for (bt_idx i = 0; i < bodies->n; i++) {
        if (count[i + 1] > 0) (*floe)[n] = i, (*first)[++n] = count[i] + count[i + 1];
        count[i + 1] += count[i];
    }
    load_row *sorted = bt_realloc(NULL, list->n, sizeof *sorted);
    for (size_t k = 0; k < list->n; k++) sorted[count[bt_world_index(world, list->row[k].floe)]++] = list->row[k];
    free(count);
    free(list->row);
    list->row = sorted;
    return n;
}

static void add_outline(found_list *list, int n, const double *v)
{
    list->vertex = bt_realloc(list->vertex, list->n_vertices + (size_t)n, 2 * sizeof *list->vertex);
    memcpy(list->vertex + 2 * list->n_vertices, v, 2 * (size_t)n * sizeof *v);
    list->n_vertices += (size_t)n;
}

static void place_of(const bt_bodies *bodies, bt_idx i, bt_chord_end end, double out[2])
{
    bt_chord_place(bt_body_corners(bodies, i), bodies->outline + 2 * bodies->offset[i], end, out);
    out[0] += bodies->pose[i].x;
    out[1] += bodies->pose[i].y;
}

/// Append a floe that splits; false if the cut cannot be made.
static bool add_found(const bt_world *world, const judged *j, found_list *to)
{
    const bt_bodies *bodies = &world->bodies;
    const bt_idx i = j->floe;
    const int n = bt_body_corners(bodies, i);
    const double *outline = bodies->vertices + 2 * bodies->offset[i];
    bt_piece piece[2];
    if (!bt_split_cut(n, outline, bodies->area[i], bt_splitting_polar(world, i), &j->best.chord, piece)) return false;
    found_row row = {.record = {.step = world->step, .parent = bodies->gid[i],
                                .generation = bt_splitting_generation(world->splitting, bodies->gid[i]) + 1,
                                .mode = j->best.mode, .thickness = bodies->thickness[i], .ratio = j->best.ratio},
                     .first_vertex = (int64_t)to->n_vertices};
    place_of(bodies, i, j->best.chord.a, row.record.near);
    place_of(bodies, i, j->best.chord.b, row.record.far);
    for (int k = 0; k < 2; k++) {
        add_outline(to, piece[k].n, piece[k].outline);
        row.record.area[k] = piece[k].area;
        row.record.polar[k] = piece[k].polar;
        row.record.at[k][0] = piece[k].x, row.record.at[k][1] = piece[k].y;
        row.record.corners[k] = piece[k].n;
    }
    if (row.record.generation == 1) {
        row.record.corners[2] = n;
        add_outline(to, n, outline);
    }
    to->row = bt_realloc(to->row, to->n + 1, sizeof *to->row);
    to->row[to->n++] = row;
    return true;
}

static int by_parent(const void *p, const void *q)
{
    const found_row *a = p, *b = q;
    return (a->record.parent > b->record.parent) - (a->record.parent < b->record.parent);
}

/// Collective. Gather the split floes of all ranks, in the order of the ids of the parents.
static found_list of_all(const bt_world *world, found_list *mine)
{
    found_list all = {0};
    all.row = bt_domain_gather_all(world, mine->row, mine->n, sizeof *mine->row, &all.n);
    all.vertex = bt_domain_gather_all(world, mine->vertex, mine->n_vertices, 2 * sizeof *mine->vertex, &all.n_vertices);
    int64_t at = 0;
    for (size_t k = 0; k < all.n; k++) { // in the order in which they were gathered
        all.row[k].first_vertex = at;
        const int64_t *c = all.row[k].record.corners;
        at += c[0] + c[1] + c[2];
    }
    if (all.n > 0) qsort(all.row, all.n, sizeof *all.row, by_parent);
    return all;
}

// --- the step --------------------------------------------------------------------------------------------------------

enum { N_DEFERRED, N_SIZE, N_GENERATION, N_RAFTED, N_COUNTS };

/// This rank's floes that split under the loads of this solution. *most: largest ratio of a floe that cannot.
static found_list find(bt_world *world, bt_sum count[N_COUNTS], double *most)
{
    load_list loads = collect(world);
    if (loads.n == 0) return (found_list){0};
    bt_idx *floe;
    size_t *first;
    const bt_idx n = by_floe(world, &loads, &floe, &first);
    judged *result = bt_alloc((size_t)n, sizeof *result);
#pragma omp parallel if (BT_MANY(n, 64))
    {
        BT_PLAIN_NUMBERS;
#pragma omp for schedule(dynamic, 16)
        for (bt_idx k = 0; k < n; k++) result[k] = judge(world, floe[k], loads.row + first[k], first[k + 1] - first[k]);
    }
    found_list found = {0};
    for (bt_idx k = 0; k < n; k++) {
        judged *j = &result[k];
        *most = bt_max(*most, j->best.refused_ratio);
        if (j->verdict == SPLITS && !add_found(world, j, &found)) {
            j->verdict = TOO_SMALL;
            *most = bt_max(*most, j->best.ratio);
        }
        if (j->verdict == TOO_SMALL) bt_sum_add(&count[N_SIZE], 1);
        if (j->verdict == LAST_GENERATION) bt_sum_add(&count[N_GENERATION], 1);
        if (j->verdict == RAFTED) bt_sum_add(&count[N_RAFTED], 1);
    }
    free(result);
    free(floe);
    free(first);
    free(loads.row);
    return found;
}

static void book(bt_splitting *splitting, const bt_split_record *record)
{
    const double length = bt_hypot(record->far[0] - record->near[0], record->far[1] - record->near[1]);
    splitting->total.by_mode[record->mode]++;
    splitting->total.crack_length += length;
    splitting->total.work += bt_split_work(splitting->law.toughness, record->thickness, length);
    splitting->total.steps += splitting->now++ == 0;
}

bool bt_splitting_step(bt_world *world, int round)
{
    bt_splitting *splitting = world->splitting;
    if (!splitting) return false;
    if (round == 0) splitting->now = 0;
    if (!world->stats.converged) {
        splitting->total.unconverged += round == 0;
        return false;
    }
    bt_totals all = {.n_sums = N_COUNTS};
    found_list mine = find(world, all.sum, &all.most), found = of_all(world, &mine);
    free(mine.row);
    free(mine.vertex);
    const int64_t from = splitting->n;
    int64_t no_id = 0;
    for (size_t k = 0; k < found.n && round < BT_SPLIT_ROUNDS; k++) {
        const found_row *row = &found.row[k];
        if (2 * splitting->n + 2 > splitting->reserve) {
            no_id++;
            all.most = bt_max(all.most, row->record.ratio);
            continue;
        }
        bt_splitting_append(splitting, &row->record, found.vertex + 2 * row->first_vertex);
        book(splitting, &row->record);
    }
    const bool again = splitting->n > from;
    if (!again) { // the last round of the step
        const int64_t left = (int64_t)found.n - no_id;
        bt_domain_reduce(world, &all);
        splitting->total.deferred += left;
        splitting->total.refused_reserve += no_id;
        splitting->total.refused_size += (int64_t)bt_sum_value(&all.sum[N_SIZE]);
        splitting->total.refused_generation += (int64_t)bt_sum_value(&all.sum[N_GENERATION]);
        splitting->total.refused_rafted += (int64_t)bt_sum_value(&all.sum[N_RAFTED]);
        splitting->total.largest_refused = bt_max(splitting->total.largest_refused, all.most);
    }
    free(found.row);
    free(found.vertex);
    if (again) bt_splitting_put(world, from);
    return again;
}
