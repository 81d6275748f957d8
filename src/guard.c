// SPDX-License-Identifier: MIT
// Guards of a run; what they look at is in guard.h.
#include "guard.h"

#include <inttypes.h>
#include <math.h>

#include "bergtow/observe.h"
#include "domain.h"

static double mass_of_all(const bt_world *w)
{
    bt_totals t = {.n_sums = 1};
    for (bt_idx i = 0; i < w->bodies.n; i++)
        if (w->bodies.motion[i] == BT_DYNAMIC && bt_domain_owns(w, i)) bt_sum_add(&t.sum[0], w->bodies.mass[i]);
    bt_domain_reduce(w, &t);
    return bt_sum_value(&t.sum[0]);
}

void bt_guard_begin(bt_guard *g, const bt_case *c, const bt_world *w, bt_gid n_floes, double mean_size, double reference_speed)
{
    *g = (bt_guard){
        .overlap = c->guard.overlap * mean_size,
        .energy = c->guard.energy * 0.5 * mass_of_all(w) * reference_speed * reference_speed,
        .unconverged = c->guard.unconverged,
        .escape_x = c->guard.escape && c->domain.ends == BT_BOUND_WALL,
        .escape_y = c->guard.escape && c->domain.sides == BT_BOUND_WALL,
        .low = {c->domain.x0, c->domain.y0},
        .high = {c->domain.x0 + c->domain.length, c->domain.y0 + c->domain.width},
        .n_floes = n_floes,
        .size = mean_size,
        .in_a_row = g->in_a_row,
    };
}

bt_status bt_guard_finite(const bt_world *w, bt_errors *err)
{
    const bt_idx bad = bt_observe_not_finite(w);
    if (bad < 0) return BT_OK;
    bt_errors_add(err, "step %" PRId64 ": body %" PRId64 " has a pose or velocity that is not a number; take a smaller run.dt, and check masses, stiffness and speeds of the case",
                  w->step, w->bodies.gid[bad]);
    return BT_ERR_NUMERIC;
}

/// Collective. The floe of the highest id that is beyond a wall, −1 = none.
static bt_gid escaped(const bt_guard *g, const bt_world *w)
{
    const bt_bodies *b = &w->bodies;
    double most = -1;
    for (bt_idx i = 0; i < b->n; i++) {
        if (b->gid[i] >= g->n_floes || b->motion[i] != BT_DYNAMIC) continue;
        const double x = b->pose[i].x, y = b->pose[i].y;
        if ((g->escape_x && (x < g->low[0] || x > g->high[0])) || (g->escape_y && (y < g->low[1] || y > g->high[1]))) most = bt_max(most, (double)b->gid[i]);
    }
    bt_domain_maxima(w, &most, 1);
    return (bt_gid)most;
}

bt_status bt_guard_check(bt_guard *g, const bt_world *w, bt_errors *err)
{
    const bt_step_stats *st = &w->stats;
    bool sound = true;
    g->in_a_row = st->converged ? 0 : g->in_a_row + 1;
    if (g->overlap > 0 && st->overlap > g->overlap) {
        sound = false;
        bt_errors_add(err, "step %" PRId64 ": two bodies overlap by %.4g m, %.3g of the mean floe size (guard.overlap %.3g); take a smaller run.dt, or more solver.max_sweeps and solver.position_sweeps",
                      w->step, st->overlap, st->overlap / g->size, g->overlap / g->size);
    }
    if (g->energy > 0 && st->kinetic_energy > g->energy) {
        sound = false;
        bt_errors_add(err, "step %" PRId64 ": the bodies have %.4g J of kinetic energy, more than the %.4g J that guard.energy allows; take a smaller run.dt or a smaller solver.tolerance, and check the forces of the case",
                      w->step, st->kinetic_energy, g->energy);
    }
    if (g->unconverged > 0 && g->in_a_row >= g->unconverged) {
        sound = false;
        bt_errors_add(err, "step %" PRId64 ": %" PRId64 " steps in a row did not converge (guard.unconverged); take a smaller run.dt or more solver.max_sweeps, or consider ice.crushing.pressure where ice jams",
                      w->step, g->in_a_row);
    }
    const bt_gid gone = sound && (g->escape_x || g->escape_y) && w->step % BT_ESCAPE_STEPS == 0 ? escaped(g, w) : -1;
    if (gone >= 0) {
        sound = false;
        bt_errors_add(err, "step %" PRId64 ": floe %" PRId64 " is beyond a wall (guard.escape); take a smaller run.dt, or more solver.max_sweeps", w->step, gone);
    }
    return sound ? BT_OK : BT_ERR_NUMERIC;
}
