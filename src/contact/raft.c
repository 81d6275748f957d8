// SPDX-License-Identifier: MIT
// Edges and sheets of floes that lie over each other; equations in contact/raft.h.
#include "contact/raft.h"

#include <math.h>

#include "contact/overlap.h"
#include "body/bodies.h"
#include "contact/row.h"
#include "contact/law_pair.h"
#include "base/elementary.h"
#include "case/case_derived.h"

// Share of the thickness: with less boundary inside each other the floes have no edge; one is wholly under the other.
#define LEAST_LENGTH 1e-3

// --- numbers ---------------------------------------------------------------------------------------------------------

enum { PAIRS, AREA, LARGEST, ENERGY, EDGE_WORK, FRICTION_WORK };
static const bt_law_number numbers[] = {
    [PAIRS] = {"rafting", "1", "pairs of floes that lie over each other", BT_KEEP_LAST, .key = "rafting_pairs"},
    [AREA] = {"rafted_area", "m2", "area where floes lie over each other, pair by pair, at the start of the step",
              BT_KEEP_LAST, .key = "rafted_area_m2"},
    [LARGEST] = {"rafted_largest", "m2",
        "largest area where two floes of a pair lie over each other", BT_KEEP_MAX, .largest = true,
                 .key = "largest_rafted_pair_m2"},
    [ENERGY] = {"rafted_energy", "J",
                "potential energy of floes that lie over each other, above that of floes side by side", BT_KEEP_LAST,
                .key = "rafted_energy_j"},
    [EDGE_WORK] = {"raft_edge_work", "J",
                   "work taken where edges raft; part of it is in rafted_energy, the rest is lost",
                   BT_KEEP_SUM, .key = "raft_edge_work_j"},
    [FRICTION_WORK] = {"raft_friction_work", "J",
                       "work taken by friction between floes that lie over each other; can be negative in the step in "
                       "which they stop, where it and the edges share one load",
                       BT_KEEP_SUM, .key = "raft_friction_work_j"},
};

enum { ALL_PAIRS, ALL_AREA = BT_RAFT_TOTAL_AREA, MAX_AREA, LARGEST_PAIR, ALL_ENERGY,
       ALL_EDGE_WORK, ALL_FRICTION_WORK };
static const bt_law_total totals[] = {
    [ALL_PAIRS] = {PAIRS, BT_TOTAL_LAST, "rafting", "rafting_pairs", "1",
                   "pairs of floes that lie over each other, at the end"},
    [ALL_AREA] = {AREA, BT_TOTAL_LAST, "rafted_area", "rafted_area_m2", "m2",
                  "area where floes lie over each other, pair by pair, at the end"},
    [MAX_AREA] = {AREA, BT_TOTAL_MAX, "max_rafted_area", "max_rafted_area_m2", "m2",
                   "largest area where floes lie over each other in a step, pair by pair"},
    [LARGEST_PAIR] = {LARGEST, BT_TOTAL_MAX, "rafted_largest", "largest_rafted_pair_m2", "m2",
                      "largest area where two floes of a pair lie over each other"},
    [ALL_ENERGY] = {ENERGY, BT_TOTAL_LAST, "rafted_energy", "rafted_energy_j", "J",
                    "potential energy of floes that lie over each other, above that of floes side by side, at the end"},
    [ALL_EDGE_WORK] = {EDGE_WORK, BT_TOTAL_SUM, "raft_edge_work", "raft_edge_work_j", "J",
                       "work taken by edges that raft"},
    [ALL_FRICTION_WORK] = {FRICTION_WORK, BT_TOTAL_SUM, "raft_friction_work", "raft_friction_work_j", "J",
                           "work taken by friction between floes that lie over each other"},
};

static void setup(const bt_case *input, double own[BT_MAX_CONTACT_OWN])
{
    const double rise = bt_case_rise(input->ice.density, input->water.density);
    own[BT_RAFT_LINE] = input->ice.rafting_kappa * 0.5 * rise;
    own[BT_RAFT_SHEET] = (input->water.density - input->ice.density) * BT_GRAVITY;
    own[BT_RAFT_RISE] = rise;
    own[BT_RAFT_FREEBOARD] = 1 - input->ice.density / input->water.density;
}

static bool on(const double *own) { return own[BT_RAFT_LINE] > 0; }

static char *check(const bt_case *input, double thickness, double size)
{
    if (!(input->ice.rafting_kappa > 0)) return NULL;
    const double h = thickness,
                 line = 0.5 * input->ice.rafting_kappa * bt_case_rise(input->ice.density, input->water.density) * h * h;
    return bt_text_of(
        "rafting              from %.4g N per m of edge (kappa %.3g, assumed), and %.4g N per m2 of overlap; an "
        "edge of a mean floe's width rafts at %.4g N\n",
        line, input->ice.rafting_kappa,
        input->ice.friction * (input->water.density - input->ice.density) * BT_GRAVITY * h, line * size);
}

static char *result(const bt_case *input, const bt_total_value *total, double ice_area)
{
    if (!(input->ice.rafting_kappa > 0)) return NULL;
    return bt_text_of(
        "  rafted              %.4g m2 at the end, %.3g %% of the ice, in %.0f pairs; edges took %.4g J, %.4g J "
        "of it in the sheets' height, friction between sheets %.4g J\n",
        total[ALL_AREA].real, ice_area > 0 ? 100 * total[ALL_AREA].real / ice_area : 0.0, total[ALL_PAIRS].real,
        total[ALL_EDGE_WORK].real, total[ALL_ENERGY].real, total[ALL_FRICTION_WORK].real);
}

static const double *own_of(const bt_world *world) { return world->par.law_own[BT_LAW_RAFTING]; }

static double thinner(const bt_bodies *bodies, bt_idx a, bt_idx b)
{
    return bt_min(bodies->thickness[a], bodies->thickness[b]);
}

static bool applies(const bt_world *world, bt_idx a, bt_idx b)
{
    const bt_bodies *bodies = &world->bodies;
    return bt_bodies_slide(bodies, a, bodies, b, world->towed, own_of(world)[BT_RAFT_FREEBOARD]);
}

/// q0, N/m.
static double line_load(const bt_world *world, bt_idx a, bt_idx b)
{
    const double h = thinner(&world->bodies, a, b);
    return own_of(world)[BT_RAFT_LINE] * h * h;
}

/// The part of it stored as potential energy: E', N/m.
static double stored_load(const bt_world *world, bt_idx a, bt_idx b)
{
    const double *h = world->bodies.thickness;
    return bt_min(own_of(world)[BT_RAFT_RISE] * h[a] * h[b], line_load(world, a, b));
}

// --- memory ----------------------------------------------------------------------------------------------------------

static bool keeps(const bt_world *world, bt_memory *memory)
{
    const bt_idx a = bt_world_index(world, memory->a), b = bt_world_index(world, memory->b);
    if (a < 0 || b < 0) return false;
    bt_overlap overlap;
    double centroid[2];
    bt_overlap_clip(world, a, b, memory->part, 0, 0, &overlap);
    memory->value[1] = bt_overlap_area(&overlap, centroid);
    memory->value[0] = bt_max(memory->value[0], memory->value[1]);
    return memory->value[1] > 0;
}

static double count(const bt_world *world, const bt_memory *memory, bt_sum *number)
{
    const bt_bodies *bodies = &world->bodies;
    const bt_idx a = bt_world_index(world, memory->a), b = bt_world_index(world, memory->b);
    if (!(memory->value[1] > 0)) return 0;
    bt_sum_add(&number[PAIRS], 1);
    bt_sum_add(&number[AREA], memory->value[1]);
    bt_sum_add(&number[ENERGY],
               own_of(world)[BT_RAFT_RISE] * bodies->thickness[a] * bodies->thickness[b] * memory->value[1]);
    return memory->value[1];
}

// --- geometry --------------------------------------------------------------------------------------------------------

static void set_point(bt_manifold *manifold, double x, double y, const double off[2], double gap, uint32_t feature)
{
    manifold->p[manifold->n_points++] = (bt_point){.gap = gap, .ra = {x, y}, .rb = {x - off[0], y - off[1]},
                                                   .feature = feature};
}

/// The contact of the edge: two points along it, on either side of the centroid of the overlap.
static void edge_of(const double grad[2], double length, double gap, const double centroid[2], const double off[2],
                    bt_manifold *manifold)
{
    manifold->nx = -grad[0] / length, manifold->ny = -grad[1] / length;
    for (int side = -1; side <= 1; side += 2)
        set_point(manifold, centroid[0] - side * 0.25 * length * manifold->ny,
                  centroid[1] + side * 0.25 * length * manifold->nx, off, gap, side < 0 ? 0xfff00000u : 0xfff00001u);
}

/// s of raft.h; a push whose component along the edge is below the blend counts in part.
static double length_of_ends(const bt_overlap *overlap, const bt_manifold *edge, double length, double blend)
{
    double sum = 0;
    for (int k = 0; k < overlap->n; k++) {
        const double along = overlap->push[k][1] * edge->nx - overlap->push[k][0] * edge->ny;
        sum += along * bt_max(0, bt_min(1, 0.5 * (1 + along / blend)));
    }
    return bt_min(0.5, sum / length);
}

/// False if there is no edge. `sheets` is always set; its normal is a vector along the edge of length s.
static bool contact(const bt_world *world, const bt_pair *pair, const bt_memory *memory, bt_manifold *edge,
                    bt_manifold *sheets)
{
    bt_overlap overlap;
    double grad[2], centroid[2], off[2];
    bt_overlap_clip(world, pair->a, pair->b, pair->part, 0, 0, &overlap);
    bt_overlap_area(&overlap, centroid);
    // rounding must not decide which edge is inside
    bt_overlap_gradient(world, pair->a, pair->b, pair->part, &overlap, world->par.slop, grad);
    bt_bodies_offset(world, pair->a, pair->b, off);
    *edge = (bt_manifold){.a = pair->a, .b = pair->b};
    *sheets = (bt_manifold){.a = pair->a, .b = pair->b};
    sheets->p[0] = (bt_point){.ra = {centroid[0], centroid[1]}, .rb = {centroid[0] - off[0], centroid[1] - off[1]}};
    const double length = bt_hypot(grad[0], grad[1]);
    if (!(length > LEAST_LENGTH * thinner(&world->bodies, pair->a, pair->b))) return false;
    edge_of(grad, length, (memory->value[0] - memory->value[1]) / length, centroid, off, edge);
    const double part = length_of_ends(&overlap, edge, length, world->par.slop);
    sheets->nx = -part * edge->ny, sheets->ny = part * edge->nx;
    return true;
}

/// Patch of a pair that has rafted: its two points, L/4 from the middle, take half each.
static bt_patch chord_of(const bt_manifold *manifold)
{
    return (bt_patch){2 * fabs(bt_law_along(manifold, 1) - bt_law_along(manifold, 0)), NAN};
}

/// Patch of a pair that has not: the flush part of its edges, from the nearer point on.
static bt_patch flush_part(const bt_manifold *manifold)
{
    if (manifold->n_points < 2) return (bt_patch){manifold->flush, NAN};
    const int near = manifold->p[1].gap < manifold->p[0].gap;
    const double half = 0.5 * manifold->flush, from = bt_law_along(manifold, near),
                 to = bt_law_along(manifold, 1 - near);
    return (bt_patch){manifold->flush, from + (to < from ? -half : half)};
}

// --- bounds ----------------------------------------------------------------------------------------------------------

/// Share, beyond the gap, of the distance that an edge would advance in the step at the velocities without contacts; a
/// slop is added to that distance.
static double reached(const bt_world *world, const bt_contact *edge, double gap)
{
    const bt_bodies *bodies = &world->bodies;
    const double before = bt_mean_normal_velocity(edge, &bodies->vel_start[edge->a], &bodies->vel_start[edge->b]),
                 free = bt_mean_normal_velocity(edge, &bodies->vel_free[edge->a], &bodies->vel_free[edge->b]);
    const double way = world->par.dt * bt_max(0, -bt_min(before, free));
    return bt_max(0, 1 - gap / (way + world->par.slop));
}

/// edge: the edge contact of the same pair, already bounded (detect.c puts sheets after all others), −1 = none.
static void bound_sheets(const bt_world *world, bt_cell *cell, bt_idx j, bt_idx edge, const bt_manifold *manifold,
                         const bt_memory *memory)
{
    bt_contact *contact = &cell->contacts[j];
    bt_limit *l = &cell->laws->limits[j];
    const double pressure = own_of(world)[BT_RAFT_SHEET] * thinner(&world->bodies, contact->a, contact->b);
    l->flat[0] = bt_pair_friction(&world->bodies, contact->a, contact->b) * pressure * memory->value[1] * world->par.dt;
    double load = 0;
    if (edge >= 0) {
        const bt_limit *e = &cell->laws->limits[edge];
        load = (e->flat[0] + e->flat[1]) * reached(world, &cell->contacts[edge], cell->gaps[edge].gap[0]);
    }
    l->ends[0] = load * manifold->nx, l->ends[1] = load * manifold->ny;
    if (world->par.warm_start) contact->ln[0] = memory->value[2], contact->lt = memory->value[3];
}

static void bound(const bt_world *world, bt_cell *cell, bt_idx j, const bt_pair *pair, const bt_manifold *manifold)
{
    bt_limit *limit = &cell->laws->limits[j];
    const bt_memory names = bt_law_names(world, pair, BT_LAW_RAFTING);
    const bt_idx at = bt_law_find(cell, &names);
    limit->record[BT_LAW_RAFTING] = (int32_t)at;
    if (manifold->n_points == 0) {
        bound_sheets(world, cell, j, pair->contact, manifold, &cell->laws->memory[at]);
        return;
    }
    const double h = thinner(&world->bodies, manifold->a, manifold->b),
                 stored = stored_load(world, manifold->a, manifold->b);
    double load = line_load(world, manifold->a, manifold->b);
    if (at >= 0) load = stored + (load - stored) * reached(world, &cell->contacts[j], manifold->p[0].gap);
    const bt_closing closing = bt_law_closing(world, cell, j, manifold);
    const bt_patch edge = at >= 0 ? chord_of(manifold) : flush_part(manifold);
    for (int i = 0; i < manifold->n_points; i++) {
        const double length = edge.length * bt_law_share(manifold, i, edge, &closing);
        bt_law_narrow(limit, i, load * world->par.dt * bt_max(length, h / closing.n), BT_LAW_RAFTING);
    }
}

// --- growth ----------------------------------------------------------------------------------------------------------

static bool gives_way(const bt_contact *contact, const bt_limit *limit, int i)
{
    return limit->by[i] == BT_LAW_RAFTING && contact->ln[i] >= limit->cap[i];
}

static void give_way(bt_world *world, bt_cell *cell, bt_idx j, int i, bt_sum *number)
{
    bt_sum_add(&number[EDGE_WORK], -bt_contacts_normal_work(world, &cell->contacts[j], i));
}

/// The sheets with only the load of their ends.
static bt_contact ends_of(const bt_contact *sheets, const bt_limit *limit)
{
    bt_contact contact = *sheets;
    const double part = bt_part_of_ends(limit->ends, contact.ln[0], contact.lt);
    contact.ln[0] = part * limit->ends[0], contact.lt = part * limit->ends[1];
    return contact;
}

/// Write the record: a pair that gives way for the first time gets one; sheets store their load in it.
static void remember(bt_world *world, bt_cell *cell, bt_idx j, bt_sum *number)
{
    const bt_contact *contact = &cell->contacts[j];
    const bt_limit *limit = &cell->laws->limits[j];
    const bt_idx at = limit->record[BT_LAW_RAFTING];
    if (contact->n == 0) {
        cell->laws->memory[at].value[2] = contact->ln[0];
        cell->laws->memory[at].value[3] = contact->lt;
        const bt_contact ends = ends_of(contact, limit);
        const double of_ends = -bt_contacts_work(world, &ends);
        bt_sum_add(&number[EDGE_WORK], of_ends);
        bt_sum_add(&number[FRICTION_WORK], -bt_contacts_work(world, contact) - of_ends);
        return;
    }
    bool begins = false;
    for (int i = 0; i < contact->n; i++) begins = begins || (limit->grown[i] > 0 && gives_way(contact, limit, i));
    if (!begins || at >= 0) return;
    bt_memory memory = bt_law_names(world, &cell->search.pairs[cell->contacts[j].pair], BT_LAW_RAFTING);
    memory.n_points = 2;
    bt_law_put(cell, -1, &memory);
}

const bt_law bt_raft_law = {.name = "rafting",
                            .keys = "ice.rafting",
                            .what =
                            "edges bear a limited line load, and floes pressed together harder slide over each other",
                            .setup = setup,
                            .on = on,
                            .numbers = numbers,
                            .n_numbers = sizeof numbers / sizeof *numbers,
                            .totals = totals,
                            .n_totals = sizeof totals / sizeof *totals,
                            .applies = applies,
                            .contact = contact,
                            .bound = bound,
                            .keeps = keeps,
                            .gives_way = gives_way,
                            .give_way = give_way,
                            .remember = remember,
                            .count = count,
                            .check = check,
                            .result = result};
