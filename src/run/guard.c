// SPDX-License-Identifier: MIT
// Guards of a run; what they look at is in guard.h.
#include "run/guard.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>

#include "case/case_derived.h"
#include "force/environment.h"
#include "bergtow/forces.h"
#include "output/observe.h"
#include "bergtow/sum.h"
#include "solve/islands.h"
#include "space/cells.h"
#include "partition/domain.h"
#include "output/state.h"
#include "base/elementary.h"

#define WALL_SIZES 5.0   // a wall is at least as thick, in mean floe sizes (setup.c)
#define UNIT 0x1p30      // J: sums hold numbers up to 2⁶² (sum.h)

// --- limits ----------------------------------------------------------------------------------------------------------

/// What drives the bodies of a case; equations in guard.h.
typedef struct {
    double prescribed, water, wind; ///< v_p, U_w, D, m/s
    double slope;                   ///< a, m/s²
    double dt, duration;            ///< s
} drivers;

static drivers drivers_of(const bt_case *c)
{
    const double water = bt_case_fastest_flow(c, true), air = bt_case_fastest_flow(c, false);
    const bool circles = c->water.tilt == BT_TILT_GEOSTROPHIC || c->water.tilt == BT_TILT_DYNAMIC;
    double prescribed = bt_max(bt_case_reference_speed(c), bt_max(c->domain.ends_closing, c->domain.sides_closing));
    if (c->tow.mode != BT_TOW_NONE) prescribed = bt_max(prescribed, c->tow.speed);
    return (drivers){
        .prescribed = prescribed,
        .water = circles ? 2 * water : water,
        .wind = air + water,
        .slope = c->water.tilt == BT_TILT_SLOPE ? BT_GRAVITY * bt_hypot(c->water.slope_x, c->water.slope_y) : 0,
        .dt = c->run.dt,
        .duration = c->run.duration,
    };
}

/// a/b, where nothing over nothing is nothing.
static double ratio(double a, double b) { return a > 0 ? a / b : 0; }

/// v of body i, m/s.
static double driven_speed(const drivers *d, const bt_world *w, bt_idx i)
{
    const bt_bodies *b = &w->bodies;
    const bt_drag *k = &b->drag[i];
    bt_load load;
    bt_forces_load(w, i, &b->vel[i], &load);
    const double pushed = d->slope + bt_hypot(load.fx, load.fy) / b->mass[i],
                 drawn = ratio(bt_hypot(load.jx, load.jy), load.g);
    const double mass = b->mass[i], width = 2 * b->radius[i];
    // at worst the lee of others takes all form drag of the water, and none of the wind
    const double form = w->par.lee > 0 && k->water_skin > 0 && b->gid[i] != w->towed ? 0 : k->water_form;
    const double alpha = form > 0 || k->water_form == 0
                             ? sqrt(bt_max(ratio(k->air_skin, k->water_skin), ratio(k->air_form, k->water_form)))
                             : sqrt(ratio(k->air_skin + k->air_form * width, k->water_skin));
    const double share = bt_max(alpha, d->dt * (k->air_skin + k->air_form * width) * d->wind / mass);
    const double wind = share <= 1 ? d->wind * share / (1 + share) : d->wind;
    const double terminal = sqrt(ratio(mass * pushed, k->water_skin + form * b->area[i] / width));
    const double push = bt_min(pushed * d->duration, bt_max(pushed * d->dt, terminal));
    return bt_max(d->prescribed, d->water + wind + push + drawn);
}

static double energy_of(double mass, double inertia, double vx, double vy, double turn)
{
    return 0.5 * (mass * (vx * vx + vy * vy) + inertia * turn * turn);
}

/// E_0 + Σ ½ M v². Of a run that goes on, too, E_0 is that of time zero.
static double driven_energy(const bt_case *c, const bt_world *w, const bt_roster *r)
{
    const drivers d = drivers_of(c);
    const bt_bodies *b = &w->bodies;
    bt_totals t = {.n_sums = 1};
    for (bt_idx i = 0; i < b->n; i++) {
        if (b->motion[i] != BT_DYNAMIC || !bt_domain_owns(w, i)) continue;
        double start = 0;
        const bt_gid by_hand = bt_roster_row(r, b->gid[i]) - r->n_free;
        // A velocity that is not given is that of free drift, below the driven speed.
        if (b->gid[i] == w->towed)
            start = energy_of(b->mass[i], b->inertia[i], bt_case_start(c->body.vx), bt_case_start(c->body.vy),
                              c->body.yaw_rate);
        else if (by_hand >= 0 && by_hand < c->n_floes)
            start = energy_of(b->mass[i], b->inertia[i], bt_case_start(c->floes[by_hand].vx),
                              bt_case_start(c->floes[by_hand].vy), c->floes[by_hand].yaw_rate);
        bt_sum_add(&t.sum[0], (start + energy_of(b->mass[i], 0, driven_speed(&d, w, i), 0, 0)) / UNIT);
    }
    bt_domain_reduce(w, &t);
    return UNIT * bt_sum_value(&t.sum[0]);
}

void bt_guard_begin(bt_guard *g, const bt_case *c, const bt_world *w, const bt_roster *r)
{
    *g = (bt_guard){
        .overlap = c->guard.overlap * r->mean_size,
        .energy = c->guard.energy * driven_energy(c, w, r),
        .unconverged = c->guard.unconverged,
        .most_locked = c->guard.no_solution > 0 ? (int64_t)(c->guard.no_solution * (double)bt_case_steps(c)) : -1,
        .escape_x = c->guard.escape && c->domain.ends == BT_BOUND_WALL,
        .escape_y = c->guard.escape && c->domain.sides == BT_BOUND_WALL,
        .open_x = c->domain.ends == BT_BOUND_OPEN,
        .open_y = c->domain.sides == BT_BOUND_OPEN,
        .low = {c->domain.x0, c->domain.y0},
        .high = {c->domain.x0 + c->domain.length, c->domain.y0 + c->domain.width},
        .closing = {c->domain.ends_closing, c->domain.sides_closing},
        .n_floes = r->n_floes + r->n_kept,
        .size = r->mean_size,
        .in_a_row = g->in_a_row,
        .locked = g->locked,
        .broken = -1,
        .gone = -1,
    };
}

// --- bodies ----------------------------------------------------------------------------------------------------------

/// The domain of now, m.
typedef struct { double low[2], high[2]; bool wall[2], open[2]; double depth; } range;

static range range_of(const bt_guard *g, const bt_world *w)
{
    const double time = (double)w->step * w->par.dt;
    range r = {.wall = {g->escape_x, g->escape_y}, .open = {g->open_x, g->open_y}, .depth = WALL_SIZES * w->par.size};
    for (int k = 0; k < 2; k++) {
        r.low[k] = g->low[k] + g->closing[k] * time;
        r.high[k] = g->high[k] - g->closing[k] * time;
    }
    return r;
}

/// Beyond a wall? A body that has left by an open edge may go round behind the walls of the others: it is beyond them
/// only where they stand.
static bool beyond(const range *r, double x, double y)
{
    if (x >= r->low[0] && x <= r->high[0] && y >= r->low[1] && y <= r->high[1]) return false;
    const double out[2] = {bt_max(r->low[0] - x, x - r->high[0]), bt_max(r->low[1] - y, y - r->high[1])};
    for (int k = 0; k < 2; k++)
        if (r->wall[k] && out[k] > 0 && (!r->open[1 - k] || (out[1 - k] <= 0 && out[k] <= r->depth))) return true;
    return false;
}

/// The highest ids among the bodies of cell k into the maxima: what is broken, what is gone.
static void look_at(const bt_world *w, bt_idx k, const range *r, bt_totals *t)
{
    const bt_bodies *b = &w->bodies;
    const bt_cell *cell = &w->cells->cell[k];
    if (!cell->own) return;
    for (bt_idx i = 0; i < cell->laws.n_memory; i++) {
        const bt_memory *m = &cell->laws.memory[i];
        if (!isfinite(m->value[0] + m->value[1] + m->value[2] + m->value[3])) t->most = bt_max(t->most, (double)m->a);
    }
    for (bt_idx i = cell->first; i < cell->end; i++) {
        const bt_pose *p = &b->pose[i];
        const bt_vel *v = &b->vel[i];
        if (!isfinite(p->x + p->y + p->yaw + v->x + v->y + v->w)) t->most = bt_max(t->most, (double)b->gid[i]);
        else if (b->motion[i] == BT_DYNAMIC && beyond(r, p->x, p->y)) t->most2 = bt_max(t->most2, (double)b->gid[i]);
    }
}

/// As in the step: what drifts with water at rest has not moved. BT_ASLEEP_NEW has, and has come to rest in it.
static void look_at_moved(bt_world *w, bt_idx k, const void *context, bt_totals *t)
{
    const bt_cells *ts = w->cells;
    if (k == ts->n - 1 || ts->asleep[k] != BT_ASLEEP || ts->awake[k] || !ts->still) look_at(w, k, context, t);
}

static bool look_at_bodies(bt_guard *g, bt_world *w, bool all)
{
    const range r = range_of(g, w);
    bt_totals t = {.most = -1, .most2 = -1};
    if (!all) bt_phases_busy(w, look_at_moved, &r, &t);
    for (bt_idx k = 0; all && k < w->cells->n; k++) look_at(w, k, &r, &t);
    g->broken = t.most;
    g->gone = t.most2;
    return t.most < 0 && t.most2 < 0;
}

static void body_name(const bt_guard *g, const bt_world *w, bt_gid gid, char out[40])
{
    if (gid < g->n_floes) snprintf(out, 40, "floe %" PRId64, gid);
    else snprintf(out, 40, gid == w->towed ? "the towed body" : "body %" PRId64, gid);
}

void bt_guard_name(const bt_guard *g, const bt_world *w, bt_errors *err)
{
    char name[40];
    double found[2] = {g->broken, g->gone};
    bt_domain_maxima(w, found, 2);
    if (found[0] >= 0) {
        body_name(g, w, (bt_gid)found[0], name);
        bt_errors_add(err,
                      "step %" PRId64 ": %s has a pose or velocity that is not a number, or a contact law remembers "
                      "one of it; take a smaller run.dt, and check the law, and masses, stiffness and speeds of the "
                      "case",
                      w->step, name);
    }
    if (found[1] >= 0) {
        body_name(g, w, (bt_gid)found[1], name);
        bt_errors_add(err,
                      "step %" PRId64 ": %s is beyond a wall (guard.escape); "
                      "take a smaller run.dt, or more solver.max_sweeps",
                      w->step, name);
    }
}

// --- numbers ---------------------------------------------------------------------------------------------------------

static bool numbers_of_state(const bt_world *w, bt_errors *err)
{
    char buffer[64];
    const char *name = bt_state_not_finite(w, buffer);
    if (name) bt_errors_add(err,
                            "step %" PRId64 ": %s of the state is not a number; "
                            "take a smaller run.dt, and check masses, stiffness and speeds of the case",
                            w->step, name);
    return !name;
}

static bool numbers_of_sample(const bt_world *w, const bt_sample *s, bt_errors *err)
{
    const bt_quantity *f = bt_sample_fault(s, bt_observe_applies(w));
    if (!f) return true;
    const double x = bt_sample_value(s, f);
    bt_errors_add(err,
                  "step %" PRId64 ": %s (%s) is %s; "
                  "take a smaller run.dt, and check masses, stiffness and speeds of the case",
                  w->step, f->name, f->description,
                  isnan(x)                   ? "not a number, or came from some too large to be summed up"
                  : fabs(x) < BT_SAMPLE_MOST ? "a number where there is nothing to measure"
                                             : "beyond all numbers of a run");
    return false;
}

static bool overlap_within(const bt_guard *g, const bt_world *w, double overlap, bt_errors *err)
{
    if (!(g->overlap > 0) || overlap <= g->overlap) return true;
    bt_errors_add(err,
                  "step %" PRId64 ": two bodies overlap by %.4g m, %.3g of the mean floe size (guard.overlap %.3g); "
                  "take a smaller run.dt, or more solver.max_sweeps and solver.position_sweeps",
                  w->step, overlap, overlap / g->size, g->overlap / g->size);
    return false;
}

bt_status bt_guard_check(bt_guard *g, bt_world *w, const bt_sample *s, bt_errors *err)
{
    bool sound = look_at_bodies(g, w, false);
    sound = numbers_of_state(w, err) && sound;
    sound = numbers_of_sample(w, s, err) && sound;
    sound = overlap_within(g, w, s->overlap, err) && sound;
    g->in_a_row = s->unconverged == 0 ? 0 : g->in_a_row + 1;
    if (g->energy > 0 && s->kinetic_energy > g->energy) {
        sound = false;
        bt_errors_add(err,
                      "step %" PRId64
                      ": the bodies have %.4g J of kinetic energy, more than the %.4g J that guard.energy allows; "
                      "take a smaller run.dt or a smaller solver.tolerance, and check the forces of the case",
                      w->step, s->kinetic_energy, g->energy);
    }
    if (g->unconverged > 0 && g->in_a_row >= g->unconverged) {
        sound = false;
        bt_errors_add(
            err,
            "step %" PRId64 ": %" PRId64 " steps in a row did not converge (guard.unconverged); "
            "%s",
            w->step, g->in_a_row,
            s->locked != 0 ? "in the last, bodies are locked between others that give way to nothing: " BT_LOCKED_REMEDY
                           : "take a smaller run.dt or more solver.max_sweeps, or consider ice.crushing.pressure "
                             "where ice jams");
    }
    g->locked += s->locked != 0;
    if (g->most_locked >= 0 && g->locked > g->most_locked) {
        sound = false;
        bt_errors_add(err,
                      "step %" PRId64 ": %" PRId64 " steps have no solution, since bodies are locked between others "
                      "that give way to nothing, and guard.no_solution allows %" PRId64 ": " BT_LOCKED_REMEDY,
                      w->step, g->locked, g->most_locked);
    }
    return sound ? BT_OK : BT_ERR_NUMERIC;
}

bt_status bt_guard_check_end(bt_guard *g, bt_world *w, double overlap, bt_errors *err)
{
    bool sound = look_at_bodies(g, w, true);
    sound = numbers_of_state(w, err) && sound;
    sound = overlap_within(g, w, overlap, err) && sound;
    return sound ? BT_OK : BT_ERR_NUMERIC;
}
