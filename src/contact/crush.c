// SPDX-License-Identifier: MIT
// Bounds of the contacts from their geometry, and the records of crushed depths; equations in contact/crush.h.
#include "contact/crush.h"
#include "case/warning.h"

#include <math.h>
#include <stdlib.h>

#include "base/inside.h"
#include "contact/bearing.h"
#include "body/bodies.h"
#include "contact/row.h"
#include "contact/law_pair.h"
#include "space/shore.h"

// Of the mean floe size: the contact length is linear over the approach of the step, or over this.
#define LEAST_WAY 0.01
#define LEAST_OF_FACE 1e-4 // the same for a face of several polygons: farther in, some have not been found
#define NEAR 0.5 // of the penetration at which the overlap was evaluated: if it ends below this share, evaluate again
#define MAX_DEPTH 0.3 // of the mean floe size: deeper, unchanged outlines are no longer a valid model

// --- numbers ---------------------------------------------------------------------------------------------------------

enum { CRUSHING, CRUSHED_WORK, CRUSHED_DEPTH };
static const bt_law_number numbers[] = {
    [CRUSHING] = {"crushing", "1",
                  "contact points that crush: their normal force is at the limit pressure x thickness x length",
                  BT_KEEP_MEAN, .key = "max_crushing_contacts"},
    [CRUSHED_WORK] = {"crushed_work", "J", "work taken by contact points that crush", BT_KEEP_SUM,
                      .key = "crushed_work_j"},
    [CRUSHED_DEPTH] = {"crushed_depth", "m",
                       "deepest crush of a pair of bodies that touch, or touched and are still near", BT_KEEP_MAX,
                       .largest = true, .key = "max_crushed_depth_m"},
};

enum { WORK, DEPTH, STEPS, MOST };
static const bt_law_total totals[] = {
    [WORK] = {CRUSHED_WORK, BT_TOTAL_SUM, "crushed_work", .key = "crushed_work_j", .units = "J",
              .description = "work taken by contact points that crush"},
    [DEPTH] = {CRUSHED_DEPTH, BT_TOTAL_MAX, "max_crushed_depth", .key = "max_crushed_depth_m", .units = "m",
               .description = "deepest crush of a pair of bodies"},
    [STEPS] = {CRUSHING, BT_TOTAL_STEPS, "crushing_steps", .key = "crushing_steps", .units = "1",
               .description = "steps with contact points that crush"},
    [MOST] = {CRUSHING, BT_TOTAL_MAX, "max_crushing", .key = "max_crushing_contacts", .units = "1",
              .description = "largest number of crushing contact points at once"},
};

static void setup(const bt_case *input, double own[BT_MAX_CONTACT_OWN])
{
    own[BT_CRUSH_PRESSURE] = input->ice.crushing_pressure;
    own[BT_CRUSH_LEAST] = input->ice.crushing_least;
}

static bool on(const double *own) { return own[BT_CRUSH_PRESSURE] > 0; }

static char *check(const bt_case *input, double thickness, double size)
{
    if (!(input->ice.crushing_pressure > 0)) return NULL;
    const double line = input->ice.crushing_pressure * thickness;
    return bt_text_of(
        "crushing             limit %.4g N per m of contact, %.4g N at first contact, %.4g N over the width of a mean "
        "floe\n",
        line, line * input->ice.crushing_least * thickness, line * size);
}

static char *result(const bt_case *input, const bt_total_value *total, double ice_area)
{
    (void)ice_area;
    if (!(input->ice.crushing_pressure > 0)) return NULL;
    return bt_text_of(
        "  crushed             %.4g J in %lld steps, at most %.0f contact points at once, deepest %.3g m\n",
        total[WORK].real, (long long)total[STEPS].whole, total[MOST].real, total[DEPTH].real);
}

static void warn(const bt_total_value *total, double size, bt_errors *warnings)
{
    const double depth = total[DEPTH].real;
    if (depth <= MAX_DEPTH * size) return;
    bt_warn(warnings, BT_WARN_CRUSHED,
            "floes were crushed to a depth of %.2g m, %.0f %% of the mean floe size: outlines and masses stay as they "
            "were, so the model no longer holds",
            depth, 100 * depth / size);
}

double bt_crush_thickness(const bt_bodies *bodies, bt_idx a, bt_idx b)
{
    const double ha = bodies->thickness[a], hb = bodies->thickness[b];
    return ha > 0 && hb > 0 ? bt_min(ha, hb) : bt_max(ha, hb);
}

static bool applies(const bt_world *world, bt_idx a, bt_idx b) { return bt_crush_thickness(&world->bodies, a, b) > 0; }

// --- memory ----------------------------------------------------------------------------------------------------------

enum { UNSEEN = 2 }; // value[UNSEEN + i]: 1 = point i was not found when the record was written, and kept its depth

static bool keeps(const bt_world *world, bt_memory *memory) { return bt_law_near(world, memory); }

static double depth_of(const bt_memory *memory)
{
    return bt_max(memory->value[0], memory->n_points > 1 ? memory->value[1] : 0);
}

static double count(const bt_world *world, const bt_memory *memory, bt_sum *number)
{
    (void)world, (void)number;
    return depth_of(memory);
}

BT_ASCENDING_BY(by_bodies, bt_memory, a, b)

/// The records of the cell among which those of the same two outlines are.
static const bt_memory *records_of(const bt_cell *cell, const bt_memory *names, bool shore, const bt_memory **end)
{
    const bt_memory *all = cell->laws->memory, *last = all + cell->laws->n_memory;
    *end = last;
    if (shore || cell->laws->n_memory == 0) return all;
    const bt_memory *any = bsearch(names, all, (size_t)cell->laws->n_memory, sizeof *names, by_bodies);
    if (!any) return last;
    *end = any + 1;
    while (any > all && by_bodies(any - 1, names) == 0) any--;
    while (*end < last && by_bodies(*end, names) == 0) ++*end;
    return any;
}

/// Depth of each point from the earlier crushing of the two bodies, in these parts or in others, or of the body by any
/// piece of the shore: contact that moves from one to the other is sliding. So is a point that is found again:
/// meanwhile they may have crushed each other deeper at another feature.
static void recall(const bt_world *world, bt_cell *cell, bt_idx j, const bt_pair *pair, const bt_manifold *manifold)
{
    bt_limit *limit = &cell->laws->limits[j];
    const bt_memory names = bt_law_names(world, pair, BT_LAW_CRUSHING);
    const bool shore_a = bt_shore_holds(world, pair->a), shore = shore_a || bt_shore_holds(world, pair->b);
    const bool several = shore || pair->part[0] || pair->part[1]; // the contact may have been with another polygon
    const bt_gid body = shore_a ? names.b : names.a;
    const bt_memory *end, *own = NULL;
    double deepest = 0;
    for (const bt_memory *memory = records_of(cell, &names, shore, &end); memory < end; memory++) {
        if (memory->law != BT_LAW_CRUSHING) continue;
        if (shore && !(memory->a == body && bt_shore_has(world->shore, memory->b)) &&
            !(memory->b == body && bt_shore_has(world->shore, memory->a)))
            continue;
        deepest = bt_max(deepest, depth_of(memory));
        if (bt_memory_by_names(memory, &names) == 0) own = memory;
    }
    limit->rise->dent = deepest;
    if (own) limit->record[BT_LAW_CRUSHING] = (int32_t)(own - cell->laws->memory);
    for (int i = 0; i < manifold->n_points; i++) {
        limit->rise->depth[i] = bt_min(deepest, bt_max(0, -manifold->p[i].gap));
        for (int k = 0; own && k < own->n_points; k++)
            if (own->feature[k] == manifold->p[i].feature)
                limit->rise->depth[i] = several || own->value[UNSEEN + k] > 0
                                            ? bt_max(own->value[k], limit->rise->depth[i]) : own->value[k];
    }
}

// --- geometry --------------------------------------------------------------------------------------------------------

/// Force F(y) of the ice on one point at penetration y, piecewise linear in two pieces, and its work E(y).
typedef struct {
    double touch, ramp;        ///< F = touch + ramp y up to `kink`, m; N, N/m
    double kink;
    double force, slope, work; ///< beyond it F = force + slope y and E = work + force y + ½ slope y²; N, N/m, J
    double mean;               ///< E(way)/way, N
} resistance;

static double work_to(const resistance *ice, double y)
{
    return y <= ice->kink ? y * (ice->touch + 0.5 * ice->ramp * y)
                          : ice->work + y * (ice->force + 0.5 * ice->slope * y);
}

/// From the lengths and areas of the overlap at the depths `slop` and `way`; line: p h, N/m.
///
/// ∫ l = l(0) y + c y^q matches l(0), l(way) and the area; q = 2: a corner, 3/2: a disc, 1: an edge, flush at once. Two
/// lines that match l(0), and l and its slope at y = way, match the area if they meet at (1 − 1/q) way.
static resistance resistance_of(const double length[2], const double area[2], double least, double line, double slop,
                                double way)
{
    const double last = bt_max(length[0], length[1]);
    const double first = bt_max(0, length[0] - (last - length[0]) * slop / (way - slop)), rise = last - first;
    resistance ice = {.touch = line * bt_max(first, least), .kink = INFINITY};
    ice.mean = ice.touch;
    if (!(last > bt_max(first, least))) return ice;
    const double before = bt_max(0, area[0] - 0.5 * slop * (first + length[0]));
    const double share = bt_max(0.5, bt_min(1, (area[1] - before - first * way) / (rise * way))); // 1/q
    const double slope = rise / way * (1 / share - 1), at = last - slope * way;
    const bool blunt = at < least; // the second line meets the least length
    ice.kink = blunt ? (least - at) / slope : (1 - share) * way;
    ice.force = line * at, ice.slope = line * slope;
    if (!blunt && ice.kink > 0) ice.ramp = bt_max(0, ice.force + ice.slope * ice.kink - ice.touch) / ice.kink;
    ice.work = ice.kink * (ice.touch - ice.force + 0.5 * (ice.ramp - ice.slope) * ice.kink);
    ice.mean = bt_max(ice.touch, work_to(&ice, way) / way);
    return ice;
}

/// End of a collision of this pair alone, both points in turn: the penetration of each per time step, m/s, 0 = stopped.
static void collide(const bt_mass *m, const bt_hit hit[2], const double place[2], const resistance ice[2], int n,
                    double dt, double in[2])
{
    enum { TURNS = 2 };
    double impulse[2] = {0};
    // If both penetrate alike, the impulses are in the ratio of the lengths.
    for (int i = 0; i < n; i++) {
        const double all = m->w[i] + (n > 1 && ice[i].mean > 0 ? m->w12 * ice[1 - i].mean / ice[i].mean : 0);
        const double w = all > 0.1 * m->w[i] ? all : m->w[i], free = hit[i].before + w * hit[i].load;
        impulse[i] = bt_max(0, (free - place[i] - bt_hit_end(&hit[i], place[i], free, w)) / w);
    }
    for (int turn = 0; turn < (n > 1 ? TURNS : 1); turn++)
        for (int i = 0; i < n; i++) {
            const double other = n > 1 ? m->w12 * (impulse[1 - i] - hit[1 - i].load) : 0;
            const double free = hit[i].before + m->w[i] * hit[i].load - other;
            in[i] = hit[i].before > place[i] ? bt_hit_end(&hit[i], place[i], free, m->w[i]) : 0;
            impulse[i] = bt_max(0, (free - place[i] - in[i]) * m->mn[i]);
            if (!(in[i] > 0)) impulse[i] = bt_min(impulse[i], dt * ice[i].touch);
        }
}

/// Approaches at the start of the step, and the loads: W load = the gain in approach up to the free velocities.
static void approach_of(const bt_world *world, const bt_contact *contact, const bt_mass *m, bt_hit hit[2])
{
    const bt_bodies *bodies = &world->bodies;
    double gain[2] = {0};
    for (int i = 0; i < contact->n; i++) {
        hit[i].before = -bt_normal_velocity(contact, i, &bodies->vel_start[contact->a], &bodies->vel_start[contact->b]);
        gain[i] = -bt_normal_velocity(contact, i, &bodies->vel_free[contact->a], &bodies->vel_free[contact->b]) -
                  hit[i].before;
    }
    for (int i = 0; i < contact->n; i++) {
        hit[i].load = m->per_det > 0 ? (m->w[1 - i] * gain[i] - m->w12 * gain[1 - i]) * m->per_det : gain[i] * m->mn[i];
        if (contact->n > 1 && !(m->per_det > 0)) hit[i].load *= 0.5;
    }
}

/// The resistance of the ice, in units of impulse over a step.
static void take_resistance(bt_hit *hit, const resistance *ice, double dt)
{
    hit->touch = dt * ice->touch, hit->ramp = dt * dt * ice->ramp, hit->kink = ice->kink / dt;
    hit->force = dt * ice->force, hit->slope = dt * dt * ice->slope, hit->work = ice->work;
}

/// Bound of a hit: the work of crushing equals the energy lost. The loads' share is borne without penetration.
static void bound_hit(bt_limit *limit, int i, const bt_hit *hit, double place, double most)
{
    limit->flat[i] = bt_min(limit->flat[i], bt_max(0, hit->load * (hit->before - place) / (hit->before + place)));
    limit->most[i] = bt_min(limit->most[i], most);
    limit->rise->hit[i] = *hit;
}

/// Bound of a push: the mean force over the penetration.
static void bound_push(bt_limit *limit, int i, const resistance *ice, double way, double dt)
{
    const double flat = dt * ice->touch;
    limit->flat[i] = bt_min(limit->flat[i], flat);
    limit->most[i] = bt_min(limit->most[i], dt * ice->mean);
    limit->rise->base[i] = bt_min(limit->flat[i], flat);
    limit->rise->slope[i] = dt * dt * (ice->mean - ice->touch) / way;
}

/// bt_bearing_of, where both outlines are single polygons.
static void bear_alone(const bt_world *world, const bt_pair *pair, const bt_manifold *manifold,
                       const bt_closing *closing, const double depth[2], bt_bearing of[2])
{
    double area[2];
    bt_patch patch[2];
    for (int k = 0; k < 2; k++) patch[k] = bt_law_patch(world, pair->part, manifold, depth[k], &area[k]);
    const double all = patch[0].length + patch[1].length;
    for (int i = 0; i < manifold->n_points; i++) {
        const double share = bt_law_share(manifold, i, patch[0], closing), first = patch[0].length * share,
                     second = patch[1].length * bt_law_share(manifold, i, patch[1], closing),
                     part = all > 0 ? (first + second) / all : 0, before = area[0] * share;
        of[i] = (bt_bearing){.length = {first, second}, .area = {before, before + (area[1] - area[0]) * part},
                             .least = 1.0 / closing->n};
    }
}

static void bound(const bt_world *world, bt_cell *cell, bt_idx j, const bt_pair *pair, const bt_manifold *manifold)
{
    enum { LOOKS = 4 };
    const bt_bodies *bodies = &world->bodies;
    const bt_contact *contact = &cell->contacts[j];
    bt_gaps *gaps = &cell->gaps[j];
    bt_limit *limit = &cell->laws->limits[j];
    const double h = bt_crush_thickness(bodies, manifold->a, manifold->b), dt = world->par.dt,
                 *own = world->par.law_own[BT_LAW_CRUSHING];
    const double line = own[BT_CRUSH_PRESSURE] * h, slop = world->par.slop;
    const bt_mass mass = bt_mass_of(contact, bodies->inv);
    // then its edges bear no more than the rafting load, and give way by rafting
    const bool rafts = limit->record[BT_LAW_RAFTING] >= 0;
    if (rafts) limit->record[BT_LAW_CRUSHING] = -1, limit->rise->depth[0] = limit->rise->depth[1] = 0;
    for (int i = 0; i < manifold->n_points; i++) gaps->gap[i] += limit->rise->depth[i];
    const bt_closing *face = bt_bearing_closing(world, cell, j),
                     closing = face ? *face : bt_law_closing(world, cell, j, manifold);
    const double least = own[BT_CRUSH_LEAST] * h,
                 least_way = bt_max((face ? LEAST_OF_FACE : LEAST_WAY) * world->par.size, 2 * slop);
    bt_hit hits[2] = {0};
    double place[2] = {0}, in[2] = {0};
    bool strikes[2] = {false};
    approach_of(world, contact, &mass, hits);
    for (int i = 0; i < manifold->n_points; i++) {
        place[i] = bt_max(gaps->gap[i], 0) / dt;
        strikes[i] = !rafts && !(bt_pair_restitution(bodies, manifold->a, manifold->b) > 0) && closing.point[i] &&
                     hits[i].before > bt_max(place[i], world->par.rest_speed);
    }
    const double free_way = bt_max(dt * closing.approach - closing.gap, least_way);
    double way = free_way;
    resistance ice[2], found[2];
    for (int look = 0; look < LOOKS; look++) {
        bt_bearing of[2];
        const double depth[2] = {closing.gap + slop, closing.gap + way};
        if (face) bt_bearing_of(world, cell, j, depth, of);
        else bear_alone(world, pair, manifold, &closing, depth, of);
        for (int i = 0; i < manifold->n_points; i++) {
            const double own_way = bt_max(way - of[i].late, 2 * slop);
            found[i] = resistance_of(of[i].length, of[i].area, least * of[i].least, line, slop, own_way);
            if (look == 0) ice[i] = found[i];
            take_resistance(&hits[i], &found[i], dt);
        }
        if ((!strikes[0] && !strikes[1]) || !(way > least_way / NEAR)) break;
        collide(&mass, hits, place, found, manifold->n_points, dt, in);
        double deep = least_way;
        for (int i = 0; i < manifold->n_points; i++)
            if (strikes[i]) deep = bt_max(deep, isinf(found[i].kink) ? way : dt * in[i]);
        if (!(deep < NEAR * way)) break;
        way = deep;
    }
    for (int i = 0; i < manifold->n_points; i++) {
        // Loads beyond the limit drive the point in ever faster: it never stops, and there is no energy to match.
        if (strikes[i] && hits[i].load * hits[i].before < bt_hit_work(&hits[i], hits[i].before - place[i]))
            bound_hit(limit, i, &hits[i], place[i], dt * ice[i].mean);
        else bound_push(limit, i, &ice[i], free_way, dt);
    }
}

/// The force at the depth at which the work of the ice is this energy, by the curve through the first touch and `way`.
/// Newton's method brings `way` there, unless it is less than the curve can resolve. Where the contact length grows
/// with the depth, E is convex, and all iterates after the first are too deep: the force is not too small. The first
/// length is not taken at the slop, which may be deeper than the energy reaches.
static double bears(const bt_world *world, const bt_cell *cell, bt_idx j, double energy)
{
    enum { ITERATIONS = 40 };
    const double PRECISION = 1e-4, TOUCH = 1e-6; // of the depth; depth of the first length / mean floe size
    const bt_contact *contact = &cell->contacts[j];
    if (cell->laws->limits[j].record[BT_LAW_RAFTING] >= 0) return INFINITY;
    const double h = bt_crush_thickness(&world->bodies, contact->a, contact->b), touch = TOUCH * world->par.size,
                 *own = world->par.law_own[BT_LAW_CRUSHING];
    const double line = own[BT_CRUSH_PRESSURE] * h, least = own[BT_CRUSH_LEAST] * h;
    const bt_closing *face = bt_bearing_closing(world, cell, j);
    // of a face with several contacts each takes the same share of the energy and of the force
    const double share = bt_bearing_share(world, cell, j);
    if (!(share > 0)) return 0;
    energy /= share;
    double gap = face ? face->gap : INFINITY, way = LEAST_WAY * world->par.size, length[2], area[2];
    for (int i = 0; i < contact->n; i++) gap = bt_min(gap, bt_max(0, cell->gaps[j].gap[i]));
    length[0] = bt_bearing_whole(world, cell, j, gap + touch, &area[0]);
    resistance ice = {0};
    for (int k = 0; k < ITERATIONS; k++) {
        length[1] = bt_bearing_whole(world, cell, j, gap + way, &area[1]);
        const double force = line * bt_max(least, bt_max(length[0], length[1]));
        if (!(force > 0)) return INFINITY; // the outlines pass each other
        ice = resistance_of(length, area, least, line, touch, way);
        const double next = bt_max(2 * touch, way - (way * ice.mean - energy) / force);
        if (!(fabs(next - way) > PRECISION * way)) break;
        way = next;
    }
    double y = bt_hit_root(0.5 * ice.ramp, ice.touch, energy);
    if (y <= ice.kink) return share * (ice.touch + ice.ramp * y);
    y = bt_hit_root(0.5 * ice.slope, ice.force, energy - ice.work);
    return share * (ice.force + ice.slope * y);
}

// --- growth ----------------------------------------------------------------------------------------------------------

static bool gives_way(const bt_contact *contact, const bt_limit *limit, int i)
{
    return contact->ln[i] >= limit->flat[i];
}

static void give_way(bt_world *world, bt_cell *cell, bt_idx j, int i, bt_sum *number)
{
    cell->laws->limits[j].rise->depth[i] += cell->laws->limits[j].grown[i];
    bt_sum_add(&number[CRUSHED_WORK], -bt_contacts_normal_work(world, &cell->contacts[j], i));
    bt_sum_add(&number[CRUSHING], 1);
}

/// Add a depth to the record if there is room and the feature is not in it yet.
static void keep_depth(bt_memory *memory, uint32_t feature, double depth, bool unseen)
{
    for (int i = 0; i < memory->n_points; i++)
        if (memory->feature[i] == feature) return;
    if (memory->n_points == 2) return;
    memory->feature[memory->n_points] = feature, memory->value[memory->n_points] = depth,
    memory->value[UNSEEN + memory->n_points] = unseen;
    memory->n_points++;
}

static void remember(bt_world *world, bt_cell *cell, bt_idx j, bt_sum *number)
{
    (void)number;
    const bt_contact *contact = &cell->contacts[j];
    const bt_limit *limit = &cell->laws->limits[j];
    const bt_idx at = limit->record[BT_LAW_CRUSHING];
    if (limit->record[BT_LAW_RAFTING] >= 0) return;
    double deepest = 0;
    for (int i = 0; i < contact->n; i++) deepest = bt_max(deepest, limit->rise->depth[i]);
    if (deepest == 0) return;
    const uint32_t *feature = cell->gaps[j].feature;
    bt_memory memory = bt_law_names(world, &cell->search.pairs[contact->pair], BT_LAW_CRUSHING);
    // First points that are crushed or touch; then crushed points not found, with old depths, the deeper one first (the
    // order of a record follows the numbering of corners); then the rest.
    for (int i = 0; i < contact->n; i++)
        if (limit->rise->depth[i] > 0 || cell->gaps[j].gap[i] <= 0)
            keep_depth(&memory, feature[i], limit->rise->depth[i], false);
    const bt_memory *before = at >= 0 ? &cell->laws->memory[at] : NULL;
    const int deeper = before && before->n_points > 1 && before->value[1] > before->value[0];
    for (int k = 0; before && k < before->n_points; k++) {
        const int i = deeper ? 1 - k : k;
        if (before->value[i] > 0) keep_depth(&memory, before->feature[i], before->value[i], true);
    }
    for (int i = 0; i < contact->n; i++) keep_depth(&memory, feature[i], limit->rise->depth[i], false);
    bt_law_put(cell, at, &memory);
}

const bt_law bt_crush_law = {.name = "crushing",
                             .keys = "ice.crushing",
                             .what = "ice bears a limited pressure, and crushes beyond it",
                             .setup = setup,
                             .on = on,
                             .rises = true,
                             .numbers = numbers,
                             .n_numbers = sizeof numbers / sizeof *numbers,
                             .totals = totals,
                             .n_totals = sizeof totals / sizeof *totals,
                             .applies = applies,
                             .recall = recall,
                             .bound = bound,
                             .bears = bears,
                             .keeps = keeps,
                             .gives_way = gives_way,
                             .give_way = give_way,
                             .remember = remember,
                             .count = count,
                             .check = check,
                             .result = result,
                             .warn = warn};
