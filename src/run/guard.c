// SPDX-License-Identifier: MIT
// Guards of a run; see guard.h.
#include "run/guard.h"

#include <inttypes.h>

#include "case/case_derived.h"
#include "bergtow/forces.h"
#include "output/observe.h"
#include "solve/islands.h"
#include "space/cells.h"
#include "partition/domain.h"
#include "output/state.h"
#include "base/elementary.h"

#define WALL_SIZES 5.0   // a wall is at least as thick, in mean floe sizes (setup.c)
#define UNIT 0x1p30      // J: sums hold numbers up to 2⁶² (sum.h)

// --- limits ----------------------------------------------------------------------------------------------------------

/// The drivers of the bodies of a case; equations in guard.h.
typedef struct {
    double prescribed, water, wind; ///< v_p, U_w, D, m/s
    double slope;                   ///< a, m/s²
    double dt, duration;            ///< s
} drivers;

static drivers drivers_of(const bt_case *input)
{
    const double water = bt_case_fastest_flow(input, true), air = bt_case_fastest_flow(input, false);
    const bool circles = input->water.tilt == BT_TILT_GEOSTROPHIC || input->water.tilt == BT_TILT_DYNAMIC;
    double prescribed =
        bt_max(bt_case_reference_speed(input), bt_max(input->domain.ends_closing, input->domain.sides_closing));
    if (input->tow.mode != BT_TOW_NONE) prescribed = bt_max(prescribed, input->tow.speed);
    return (drivers){
        .prescribed = prescribed,
        .water = circles ? 2 * water : water,
        .wind = air + water,
        .slope = input->water.tilt == BT_TILT_SLOPE ? BT_GRAVITY * bt_hypot(input->water.slope_x, input->water.slope_y)
                                                    : 0,
        .dt = input->run.dt,
        .duration = input->run.duration,
    };
}

/// a/b, with 0/0 = 0.
static double ratio(double a, double b) { return a > 0 ? a / b : 0; }

/// v of body i, m/s.
static double driven_speed(const drivers *d, const bt_world *world, bt_idx i)
{
    const bt_bodies *bodies = &world->bodies;
    const bt_drag *drag = &bodies->drag[i];
    bt_load load;
    bt_forces_load(world, i, &bodies->vel[i], &load);
    const double pushed = d->slope + bt_hypot(load.fx, load.fy) / bodies->mass[i],
                 drawn = ratio(bt_hypot(load.jx, load.jy), load.g);
    const double mass = bodies->mass[i], width = 2 * bodies->radius[i];
    // at worst the lee of others removes all form drag of the water, and none of the wind
    const double form = world->par.lee > 0 && drag->water_skin > 0 && bodies->gid[i] != world->towed
                        ? 0 : drag->water_form;
    const double alpha = form > 0 || drag->water_form == 0
                             ? sqrt(bt_max(ratio(drag->air_skin, drag->water_skin),
                                           ratio(drag->air_form, drag->water_form)))
                             : sqrt(ratio(drag->air_skin + drag->air_form * width, drag->water_skin));
    const double share = bt_max(alpha, d->dt * (drag->air_skin + drag->air_form * width) * d->wind / mass);
    const double wind = share <= 1 ? d->wind * share / (1 + share) : d->wind;
    const double terminal = sqrt(ratio(mass * pushed, drag->water_skin + form * bodies->area[i] / width));
    const double push = bt_min(pushed * d->duration, bt_max(pushed * d->dt, terminal));
    return bt_max(d->prescribed, d->water + wind + push + drawn);
}

static double energy_of(double mass, double inertia, double vx, double vy, double turn)
{
    return 0.5 * (mass * (vx * vx + vy * vy) + inertia * turn * turn);
}

/// E_0 + Σ ½ M v². E_0 is that of time zero in a resumed run, too.
static double driven_energy(const bt_case *input, const bt_world *world, const bt_roster *roster)
{
    const drivers d = drivers_of(input);
    const bt_bodies *bodies = &world->bodies;
    bt_totals totals = {.n_sums = 1};
    for (bt_idx i = 0; i < bodies->n; i++) {
        if (bodies->motion[i] != BT_DYNAMIC || !bt_domain_owns(world, i)) continue;
        double start = 0;
        const bt_gid by_hand = bt_roster_row(roster, bodies->gid[i]) - roster->n_free;
        // A velocity not given is that of free drift, below the driven speed.
        if (bodies->gid[i] == world->towed)
            start = energy_of(bodies->mass[i], bodies->inertia[i], bt_case_start(input->body.vx),
                              bt_case_start(input->body.vy), input->body.yaw_rate);
        else if (by_hand >= 0 && by_hand < input->n_floes)
            start = energy_of(bodies->mass[i], bodies->inertia[i], bt_case_start(input->floes[by_hand].vx),
                              bt_case_start(input->floes[by_hand].vy), input->floes[by_hand].yaw_rate);
        bt_sum_add(&totals.sum[0], (start + energy_of(bodies->mass[i], 0, driven_speed(&d, world, i), 0, 0)) / UNIT);
    }
    bt_domain_reduce(world, &totals);
    return UNIT * bt_sum_value(&totals.sum[0]);
}

void bt_guard_begin(bt_guard *guard, const bt_case *input, const bt_world *world, const bt_roster *roster)
{
    *guard = (bt_guard){
        .c = input,
        .overlap = input->guard.overlap * roster->mean_size,
        .energy = input->guard.energy * driven_energy(input, world, roster),
        .most_locked = input->guard.no_solution > 0 ? (int64_t)(input->guard.no_solution * (double)bt_case_steps(input))
                                                    : -1,
        .n_floes = roster->n_floes + roster->n_kept,
        .size = roster->mean_size,
        .in_a_row = guard->in_a_row,
        .locked = guard->locked,
        .broken = -1,
        .gone = -1,
    };
}

// --- bodies ----------------------------------------------------------------------------------------------------------

/// The present domain, m.
typedef struct { double low[2], high[2]; bool wall[2], open[2]; double depth; } range;

static range range_of(const bt_guard *guard, const bt_world *world)
{
    const bt_case *c = guard->c;
    const double time = (double)world->step * world->par.dt,
                 closed[2] = {c->domain.ends_closing * time, c->domain.sides_closing * time};
    return (range){
        .low = {c->domain.x0 + closed[0], c->domain.y0 + closed[1]},
        .high = {c->domain.x0 + c->domain.length - closed[0], c->domain.y0 + c->domain.width - closed[1]},
        .wall = {c->guard.escape && c->domain.ends == BT_BOUND_WALL,
                 c->guard.escape && c->domain.sides == BT_BOUND_WALL},
        .open = {c->domain.ends == BT_BOUND_OPEN, c->domain.sides == BT_BOUND_OPEN},
        .depth = WALL_SIZES * world->par.size};
}

/// Is a place beyond a wall? A body that has left by an open edge may move around behind the walls of the other edges:
/// it is beyond these only where they stand.
static bool beyond(const range *limits, double x, double y)
{
    if (x >= limits->low[0] && x <= limits->high[0] && y >= limits->low[1] && y <= limits->high[1]) return false;
    const double out[2] =
        {bt_max(limits->low[0] - x, x - limits->high[0]), bt_max(limits->low[1] - y, y - limits->high[1])};
    for (int k = 0; k < 2; k++)
        if (limits->wall[k] && out[k] > 0 && (!limits->open[1 - k] || (out[1 - k] <= 0 && out[k] <= limits->depth)))
            return true;
    return false;
}

/// Highest ids in cell k, as maxima: of a body that is not finite, and of a body beyond a wall.
static void look_at(const bt_world *world, bt_idx k, const range *limits, bt_totals *totals)
{
    const bt_bodies *bodies = &world->bodies;
    const bt_cell *cell = &world->cells->cell[k];
    if (!cell->own) return;
    for (bt_idx i = 0; i < cell->laws->n_memory; i++) {
        const bt_memory *memory = &cell->laws->memory[i];
        if (!isfinite(memory->value[0] + memory->value[1] + memory->value[2] + memory->value[3]))
            totals->most = bt_max(totals->most, (double)memory->a);
    }
    for (bt_idx i = cell->first; i < cell->end; i++) {
        const bt_pose *pose = &bodies->pose[i];
        const bt_vel *v = &bodies->vel[i];
        if (!isfinite(pose->x + pose->y + pose->yaw + v->x + v->y + v->w))
            totals->most = bt_max(totals->most, (double)bodies->gid[i]);
        else if (bodies->motion[i] == BT_DYNAMIC && beyond(limits, pose->x, pose->y))
            totals->most2 = bt_max(totals->most2, (double)bodies->gid[i]);
    }
}

/// As in the step: bodies at rest in still water have not moved. In a cell BT_ASLEEP_NEW they have, and came to rest in
/// this step.
static void look_at_moved(bt_world *world, bt_idx k, const void *context, bt_totals *totals)
{
    const bt_cells *ts = world->cells;
    if (k == ts->n - 1 || ts->asleep[k] != BT_ASLEEP || ts->awake[k] || !ts->still) look_at(world, k, context, totals);
}

static bool look_at_bodies(bt_guard *guard, bt_world *world, bool all)
{
    const range limits = range_of(guard, world);
    bt_totals totals = {.most = -1, .most2 = -1};
    if (!all) bt_phases_busy(world, look_at_moved, &limits, &totals);
    for (bt_idx k = 0; all && k < world->cells->n; k++) look_at(world, k, &limits, &totals);
    guard->broken = totals.most;
    guard->gone = totals.most2;
    return totals.most < 0 && totals.most2 < 0;
}

static void body_name(const bt_guard *guard, const bt_world *world, bt_gid gid, char out[40])
{
    if (gid < guard->n_floes) snprintf(out, 40, "floe %" PRId64, gid);
    else snprintf(out, 40, gid == world->towed ? "the towed body" : "body %" PRId64, gid);
}

void bt_guard_name(const bt_guard *guard, const bt_world *world, bt_errors *err)
{
    char name[40];
    double found[2] = {guard->broken, guard->gone};
    bt_domain_maxima(world, found, 2);
    if (found[0] >= 0) {
        body_name(guard, world, (bt_gid)found[0], name);
        bt_errors_add(err,
                      "step %" PRId64 ": %s has a pose or velocity that is not a number, or a contact law stores one "
                                      "for it; use a smaller run.dt, and check the law, and masses, stiffness and "
                                      "speeds of the case",
                      world->step, name);
    }
    if (found[1] >= 0) {
        body_name(guard, world, (bt_gid)found[1], name);
        bt_errors_add(err,
                      "step %" PRId64 ": %s is beyond a wall (guard.escape); use a smaller run.dt, or more "
                      "solver.max_sweeps",
                      world->step, name);
    }
}

// --- numbers ---------------------------------------------------------------------------------------------------------

static bool numbers_of_state(const bt_world *world, bt_errors *err)
{
    char buffer[64];
    const char *name = bt_state_not_finite(world, buffer);
    if (name) bt_errors_add(err,
                            "step %" PRId64 ": %s of the state is not a number; use a smaller run.dt, and check "
                            "masses, stiffness and speeds of the case",
                            world->step, name);
    return !name;
}

static bool numbers_of_sample(const bt_world *world, const bt_sample *sample, bt_errors *err)
{
    const bt_quantity *quantity = bt_sample_fault(sample, bt_observe_applies(world));
    if (!quantity) return true;
    const double x = bt_sample_value(sample, quantity);
    bt_errors_add(err,
                  "step %" PRId64 ": %s (%s) is %s; use a smaller run.dt, and check masses, stiffness and speeds of "
                  "the case",
                  world->step, quantity->name, quantity->description,
                  isnan(x)                   ? "not a number, or a sum of numbers too large to add"
                  : fabs(x) < BT_SAMPLE_MOST ? "a number where there is nothing to measure"
                                             : "larger than any run can give");
    return false;
}

static bool overlap_within(const bt_guard *guard, const bt_world *world, double overlap, bt_errors *err)
{
    if (!(guard->overlap > 0) || overlap <= guard->overlap) return true;
    bt_errors_add(err,
                  "step %" PRId64 ": two bodies overlap by %.4g m, %.3g of the mean floe size (guard.overlap %.3g); "
                  "use a smaller run.dt, or more solver.max_sweeps and solver.position_sweeps",
                  world->step, overlap, overlap / guard->size, guard->overlap / guard->size);
    return false;
}

bt_status bt_guard_check(bt_guard *guard, bt_world *world, const bt_sample *sample, bt_errors *err)
{
    bool sound = look_at_bodies(guard, world, false);
    sound = numbers_of_state(world, err) && sound;
    sound = numbers_of_sample(world, sample, err) && sound;
    sound = overlap_within(guard, world, sample->overlap, err) && sound;
    guard->in_a_row = sample->unconverged == 0 ? 0 : guard->in_a_row + 1;
    if (guard->energy > 0 && sample->kinetic_energy > guard->energy) {
        sound = false;
        bt_errors_add(err,
                      "step %" PRId64
                      ": the bodies have %.4g J of kinetic energy, more than the %.4g J that guard.energy allows; use "
                      "a smaller run.dt or a smaller solver.tolerance, and check the forces of the case",
                      world->step, sample->kinetic_energy, guard->energy);
    }
    if (guard->c->guard.unconverged > 0 && guard->in_a_row >= guard->c->guard.unconverged) {
        sound = false;
        bt_errors_add(
            err,
            "step %" PRId64 ": %" PRId64 " steps in a row did not converge (guard.unconverged); %s",
            world->step, guard->in_a_row,
            sample->locked != 0
            ? "in the last, bodies are locked between others that cannot give way: " BT_LOCKED_REMEDY
                                : "use a smaller run.dt or more solver.max_sweeps, or consider ice.crushing.pressure "
                                  "where ice jams");
    }
    guard->locked += sample->locked != 0;
    if (guard->most_locked >= 0 && guard->locked > guard->most_locked) {
        sound = false;
        bt_errors_add(err,
                      "step %" PRId64 ": %" PRId64 " steps have no solution, since bodies are locked between others "
                      "that cannot give way; guard.no_solution allows %" PRId64 ": " BT_LOCKED_REMEDY,
                      world->step, guard->locked, guard->most_locked);
        bt_errors_code(err, "no_solution");
    }
    return sound ? BT_OK : BT_ERR_NUMERIC;
}

bt_status bt_guard_check_end(bt_guard *guard, bt_world *world, double overlap, bt_errors *err)
{
    bool sound = look_at_bodies(guard, world, true);
    sound = numbers_of_state(world, err) && sound;
    sound = overlap_within(guard, world, overlap, err) && sound;
    return sound ? BT_OK : BT_ERR_NUMERIC;
}
